//! How many frames of an object are like others.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

/// By object: how many frames there are, and the poses of those that are not like an earlier one.
#[derive(Clone, Default)]
pub(super) struct Views(BTreeMap<u32, (usize, Vec<Isometry3<f64>>)>);

impl Views {
    /// Adds a frame of an object at `pose` (object → camera), which shows the same as another within these limits \[rad, m\].
    pub(super) fn add(&mut self, obj_id: u32, pose: &Isometry3<f64>, limits: [f64; 2]) {
        let (frames, distinct) = self.0.entry(obj_id).or_default();
        *frames += 1;
        if !distinct.iter().any(|known| alike(known, pose, limits)) {
            distinct.push(*pose);
        }
    }

    /// Adds the frames of `other`.
    pub(super) fn merge(&mut self, other: &Self, limits: [f64; 2]) {
        for (obj_id, (frames, distinct)) in &other.0 {
            distinct.iter().for_each(|pose| self.add(*obj_id, pose, limits));
            if let Some((all, _)) = self.0.get_mut(obj_id) {
                *all += frames - distinct.len();
            }
        }
    }

    /// Share of distinct views among an object's frames: the weight of each frame's evidence on the surface, so that a thousand frames of a film count as
    /// its few views.
    pub(super) fn share(&self, obj_id: u32) -> f64 {
        self.0.get(&obj_id).map_or(1.0, |(frames, distinct)| distinct.len() as f64 / *frames as f64)
    }
}

fn alike(a: &Isometry3<f64>, b: &Isometry3<f64>, [angle, distance]: [f64; 2]) -> bool {
    a.rotation.angle_to(&b.rotation) < angle
        && (a.translation.vector - b.translation.vector).norm() < distance
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn frames_of_a_film_count_as_the_views_that_they_have() {
        let at = |degrees: f64| Isometry3::rotation(Vector3::y() * degrees.to_radians());
        let limits = [20f64.to_radians(), 0.05];
        let (mut first, mut second) = (Views::default(), Views::default());
        for k in 0..60 {
            first.add(4, &at(f64::from(k)), limits);
            second.add(4, &at(f64::from(k + 30)), limits);
        }
        second.add(5, &at(0.0), limits);
        // 0, 20 and 40°; 30, 50 and 70°.
        assert_eq!([first.share(4), second.share(4), second.share(5)], [0.05, 0.05, 1.0]);
        first.merge(&second, limits);
        // 70° is like none of the three.
        assert_eq!([first.share(4), first.share(5), first.share(6)], [4.0 / 120.0, 1.0, 1.0]);
        assert!(!alike(&at(0.0), &Isometry3::translation(0.06, 0.0, 0.0), limits));
    }
}
