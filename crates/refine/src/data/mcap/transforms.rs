//! Where frames are in one another (ROS's `tf`).

use std::collections::HashMap;

use nalgebra::Isometry3;

use super::messages::TransformStamped;
use super::series::TimeSeries;

/// All frames, each in its parent.
#[derive(Debug, Default)]
pub(super) struct Transforms {
    /// Numbers of frames by name.
    numbers: HashMap<String, usize>,
    /// By number.
    frames: Vec<FrameMotion>,
}

/// A frame in its parent, which may be another one later.
#[derive(Debug, Default)]
struct FrameMotion {
    fixed: Option<ParentPose>,
    moving: TimeSeries<ParentPose>,
}

#[derive(Clone, Copy, Debug)]
struct ParentPose {
    parent: usize,
    /// The frame's coordinates → those of the parent \[m\].
    pose: Isometry3<f64>,
}

/// ROS 1 let names begin with a slash.
pub(super) fn plain(name: &str) -> &str {
    name.trim_start_matches('/')
}

impl Transforms {
    /// Takes over where a frame is at the moment `at` \[ns\], or once and for all if it is `fixed`.
    ///
    /// # Errors
    /// That the numbers are no pose.
    pub(super) fn add(
        &mut self,
        message: &TransformStamped,
        at: i64,
        fixed: bool,
    ) -> Result<(), String> {
        let (child, parent) = (plain(&message.child_frame_id), plain(&message.header.frame_id));
        let pose = message.transform.isometry().ok_or_else(|| {
            format!("{child:?} in {parent:?}: not finite, or the quaternion is not of length 1")
        })?;
        let place = ParentPose { parent: self.number(parent), pose };
        let child = self.number(child);
        let motion = &mut self.frames[child];
        match fixed {
            true => motion.fixed = Some(place),
            false => motion.moving.push(at, place),
        }
        Ok(())
    }

    /// To be called when all has been taken over.
    pub(super) fn sort(&mut self) {
        self.frames.iter_mut().for_each(|motion| motion.moving.sort());
    }

    fn number(&mut self, name: &str) -> usize {
        if let Some(known) = self.numbers.get(name) {
            return *known;
        }
        let number = self.frames.len();
        self.numbers.insert(name.to_owned(), number);
        self.frames.push(FrameMotion::default());
        number
    }

    /// Whether anything is said of the frame `name`.
    pub(super) fn knows(&self, name: &str) -> bool {
        self.numbers.contains_key(plain(name))
    }

    /// Coordinates of `from` → those of `to` \[m\] at the moment `at` \[ns\]; none if the two are not connected then.
    pub(super) fn between(&self, to: &str, from: &str, at: i64) -> Option<Isometry3<f64>> {
        let (to, from) = (plain(to), plain(from));
        if to == from {
            return Some(Isometry3::identity());
        }
        let number = |name: &str| self.numbers.get(name).copied();
        let above = self.chain(number(to)?, at);
        self.chain(number(from)?, at).into_iter().find_map(|(meeting, t_meeting_from)| {
            let (_, t_meeting_to) = above.iter().find(|(other, _)| *other == meeting)?;
            Some(t_meeting_to.inverse() * t_meeting_from)
        })
    }

    /// The frame, its parent, the parent's parent … at the moment `at`, each with the frame's coordinates → its own. In a circle, which no
    /// robot has, each is there once.
    fn chain(&self, frame: usize, at: i64) -> Vec<(usize, Isometry3<f64>)> {
        let mut chain = vec![(frame, Isometry3::identity())];
        while chain.len() <= self.frames.len() {
            let Some((last, pose)) = chain.last() else { break };
            let Some(place) = self.frames[*last].at(at) else { break };
            chain.push((place.parent, place.pose * pose));
        }
        chain
    }
}

impl FrameMotion {
    fn at(&self, at: i64) -> Option<ParentPose> {
        self.fixed.or_else(|| {
            self.moving.at(at, |a, b, part| match a.parent == b.parent {
                true => ParentPose { parent: a.parent, pose: a.pose.lerp_slerp(&b.pose, part) },
                false => *if part < 0.5 { a } else { b },
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::data::mcap::messages::{RosHeader, Time};

    fn placed(parent: &str, child: &str, pose: &Isometry3<f64>) -> TransformStamped {
        TransformStamped {
            header: RosHeader { stamp: Time::default(), frame_id: parent.to_owned() },
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
        all.add(&placed("world", "camera", &camera), 0, true).unwrap();
        all.add(&placed("/world", "arm", &arm), 0, true).unwrap();
        for (at, hand) in [(0, &hand[0]), (100, &hand[1])] {
            all.add(&placed("arm", "hand", hand), at, false).unwrap();
        }
        let middle = hand[0].lerp_slerp(&hand[1], 0.5);
        let near = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
            (a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-12
        };
        let found = all.between("camera", "hand", 50).unwrap();
        assert!(near(&found, &(camera.inverse() * arm * middle)));
        assert_eq!(all.between("camera", "camera", 7), Some(Isometry3::identity()));
        assert!(all.knows("world") && !all.knows("moon"));
        assert_eq!(all.between("camera", "moon", 0), None);
        // Nothing is known of where the hand is a second later.
        assert_eq!(all.between("camera", "hand", 1_000_000_000), None);
        // The hand is handed over: it is where it was before, and in another frame from then on.
        all.add(&placed("world", "hand", &arm), 200, false).unwrap();
        assert!(near(&all.between("arm", "hand", 0).unwrap(), &hand[0]));
        assert!(near(&all.between("world", "hand", 200).unwrap(), &arm));
        // A circle ends.
        all.add(&placed("hand", "world", &arm), 0, true).unwrap();
        assert_eq!(all.between("camera", "moon", 0), None);
        let nothing = Isometry3::translation(f64::NAN, 0.0, 0.0);
        assert!(all.add(&placed("world", "x", &nothing), 0, false).unwrap_err().contains("\"x\""));
    }
}
