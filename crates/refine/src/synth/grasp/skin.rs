//! Forces on taxels from contacts.

use nalgebra::{Isometry3, Vector3};
use prehend_geometry::hand::Taxel;

use super::simulation::Touch;

/// Force of the object on each taxel, in the frame of its link \[N\]; `links` are those of the taxels, `poses` those of all links.
///
/// Each contact spreads over the taxels of its link within `reach` r \[m\], by weights (1 − (d/r)²)²·(n·n_t)⁺ that sum to one;
/// d is the distance, n the normal of the contact and n_t that of the taxel. Where there is none it is not felt.
pub(super) fn taxel_forces(
    taxels: &[Taxel],
    links: &[usize],
    reach: f64,
    touches: &[Touch],
    poses: &[Isometry3<f64>],
) -> Vec<Vector3<f64>> {
    let mut forces = vec![Vector3::zeros(); taxels.len()];
    for touch in touches {
        let pose = &poses[touch.link];
        let point = pose.inverse_transform_point(&touch.point);
        let normal = pose.rotation.inverse() * touch.normal;
        let weight = |number: usize| {
            let taxel = &taxels[number];
            let nearness = 1.0 - (taxel.position - point).norm_squared() / (reach * reach);
            let facing = taxel.normal.dot(&normal);
            let felt = links[number] == touch.link && nearness > 0.0 && facing > 0.0;
            felt.then_some((number, nearness * nearness * facing))
        };
        let weights: Vec<(usize, f64)> = (0..taxels.len()).filter_map(weight).collect();
        let sum: f64 = weights.iter().map(|(_, w)| w).sum();
        let force = pose.rotation.inverse() * -touch.force;
        for (number, weight) in weights {
            forces[number] += force * (weight / sum);
        }
    }
    forces
}

#[cfg(test)]
mod tests {
    use prehend_geometry::hand::{ALLEGRO_XELA_URDF, taxels};
    use prehend_geometry::robot::KinematicTree as Tree;

    use super::*;
    use crate::scene::Hand;

    #[test]
    fn contacts_on_pads_are_felt_whole_and_others_not_at_all() {
        let tree = Tree::from_urdf_str(ALLEGRO_XELA_URDF, None).unwrap();
        let robot = Hand::new(tree, taxels()).unwrap();
        let links: Vec<usize> = robot.taxels.iter().map(|t| robot.link_of(t).unwrap()).collect();
        let forces =
            |touch: Touch, poses: &[_]| taxel_forces(&robot.taxels, &links, 8e-3, &[touch], poses);
        let poses = robot.tree.forward_kinematics(&[0.3; 16]);
        let link = robot.tree.link_index("link_2.0").unwrap();
        let t = &poses[link];
        let taxel = robot.taxels.iter().find(|t| t.link == "link_2.0").unwrap();
        let touch = |offset: f64, normal: Vector3<f64>| Touch {
            link,
            point: t * (taxel.position + taxel.normal * offset),
            normal: t.rotation * normal,
            force: t.rotation * Vector3::new(1.0, 0.2, -0.3),
            stiffness: 1.0,
        };
        let felt = forces(touch(1e-3, taxel.normal), &poses);
        let sum: Vector3<f64> = felt.iter().sum();
        assert!((sum - Vector3::new(-1.0, -0.2, 0.3)).norm() < 1e-12);
        assert!(felt.iter().filter(|f| f.norm() > 0.0).count() > 3);
        let largest = (0..368).max_by(|&a, &b| felt[a].norm().total_cmp(&felt[b].norm()));
        assert_eq!(largest, Some(taxel.index));
        for unfelt in [touch(9e-3, taxel.normal), touch(0.0, -taxel.normal)] {
            assert!(forces(unfelt, &poses).iter().all(|f| *f == Vector3::zeros()));
        }
    }
}
