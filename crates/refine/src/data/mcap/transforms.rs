//! Where frames are in one another (ROS's `tf`).

use std::collections::HashMap;
use std::iter;

use nalgebra::Isometry3;

use super::messages::TransformStamped;
use super::series::Series;

/// All frames, each in its parent.
#[derive(Debug, Default)]
pub(super) struct Transforms {
    frames: HashMap<String, Place>,
}

#[derive(Debug)]
struct Place {
    parent: String,
    /// Its coordinates → those of the parent \[m\].
    poses: Poses,
}

#[derive(Debug)]
enum Poses {
    Fixed(Isometry3<f64>),
    Moving(Series<Isometry3<f64>>),
}

/// A frame is where it was last said to be for so long \[ns\].
const HELD: i64 = 100_000_000;

/// ROS 1 let names begin with a slash.
fn plain(name: &str) -> &str {
    name.trim_start_matches('/')
}

impl Transforms {
    /// Takes over where a frame is, once and for all if it is `fixed`. What is no pose is left out.
    pub(super) fn add(&mut self, message: &TransformStamped, fixed: bool) {
        let Some(pose) = message.transform.isometry() else { return };
        let (child, parent) = (plain(&message.child_frame_id), plain(&message.header.frame_id));
        let place = self.frames.entry(child.to_owned()).or_insert_with(|| Place {
            parent: parent.to_owned(),
            poses: Poses::Moving(Series::default()),
        });
        parent.clone_into(&mut place.parent);
        match &mut place.poses {
            _ if fixed => place.poses = Poses::Fixed(pose),
            Poses::Moving(series) => series.push(message.header.stamp.nanoseconds(), pose),
            Poses::Fixed(known) => *known = pose,
        }
    }

    /// Whether anything is said of the frame `name`.
    pub(super) fn knows(&self, name: &str) -> bool {
        let name = plain(name);
        self.frames.contains_key(name) || self.frames.values().any(|place| place.parent == name)
    }

    /// Coordinates of `from` → those of `to` \[m\] at the moment `at` \[ns\]; none if the two are not connected then.
    pub(super) fn between(&self, to: &str, from: &str, at: i64) -> Option<Isometry3<f64>> {
        let (to, from) = (plain(to), plain(from));
        let above: Vec<&str> = self.ancestors(to).collect();
        let meeting = self.ancestors(from).find(|name| above.contains(name))?;
        let (t_meeting_to, t_meeting_from) =
            (self.up(to, meeting, at)?, self.up(from, meeting, at)?);
        Some(t_meeting_to.inverse() * t_meeting_from)
    }

    /// The frame, its parent, the parent's parent …; a circle ends.
    fn ancestors<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a str> {
        let parent = |name: &&'a str| Some(self.frames.get(*name)?.parent.as_str());
        iter::successors(Some(name), parent).take(self.frames.len() + 1)
    }

    /// Coordinates of `name` → those of `ancestor` \[m\].
    fn up(&self, name: &str, ancestor: &str, at: i64) -> Option<Isometry3<f64>> {
        let mut pose = Isometry3::identity();
        for name in self.ancestors(name).take_while(|name| *name != ancestor) {
            let in_parent = match &self.frames.get(name)?.poses {
                Poses::Fixed(pose) => *pose,
                Poses::Moving(series) => series.at(at, HELD, |a, b, part| a.lerp_slerp(b, part))?,
            };
            pose = in_parent * pose;
        }
        Some(pose)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::data::mcap::messages::{Header, Time};

    fn placed(parent: &str, child: &str, at: i64, pose: &Isometry3<f64>) -> TransformStamped {
        TransformStamped {
            header: Header { stamp: Time::from_nanoseconds(at), frame_id: parent.to_owned() },
            child_frame_id: child.to_owned(),
            transform: pose.into(),
        }
    }

    #[test]
    fn frames_meet_where_their_branches_do() {
        let mut all = Transforms::default();
        let camera = Isometry3::new(Vector3::new(0.0, 0.0, 1.0), Vector3::x());
        let arm = Isometry3::new(Vector3::new(0.5, 0.0, 0.0), Vector3::z() * 0.3);
        let hand = [0.0, 0.1].map(|x| Isometry3::new(Vector3::new(x, 0.0, 0.0), Vector3::y() * x));
        all.add(&placed("world", "camera", 0, &camera), true);
        all.add(&placed("/world", "arm", 0, &arm), true);
        for (at, hand) in [(0, &hand[0]), (100, &hand[1])] {
            all.add(&placed("arm", "hand", at, hand), false);
        }
        let middle = hand[0].lerp_slerp(&hand[1], 0.5);
        let found = all.between("camera", "hand", 50).unwrap();
        let expected = camera.inverse() * arm * middle;
        assert!((found.to_homogeneous() - expected.to_homogeneous()).norm() < 1e-12);
        assert_eq!(all.between("camera", "camera", 7), Some(Isometry3::identity()));
        assert!(all.knows("world") && !all.knows("moon"));
        assert_eq!(all.between("camera", "moon", 0), None);
        // Nothing is known of where the hand is a second later, and in a circle of where anything is.
        assert_eq!(all.between("camera", "hand", 1_000_000_000), None);
        all.add(&placed("hand", "world", 0, &arm), true);
        assert_eq!(all.between("camera", "moon", 0), None);
    }
}
