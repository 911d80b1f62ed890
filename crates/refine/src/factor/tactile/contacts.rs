//! Where a skin is touched: taxels that feel force together.

use nalgebra::{Point3, Vector3};
use prehend_geometry::DistanceField;
use prehend_geometry::hand::Taxel;
use prehend_geometry::robot::RobotShape;

use super::probe::{Distance, Probe};
use crate::defaults::settings;
use crate::problem::NoiseModel;
use crate::scene::Hand;

settings! {
    /// How touched taxels become contacts.
    pub struct ContactSettings {
        /// Distance within which taxels of one link that feel force are of one contact \[m\]: each from the next, and none twice as far from the strongest,
        /// or facing away from it.
        pub reach: f64 = 8e-3,
        /// Noise of distances of the object's surface from the skin where it is touched \[m\]: the skin's compliance, the coarseness of its taxels, and how
        /// far the object is off from its model. EXPERIMENTS: Standard deviation of a contact.
        pub noise: NoiseModel = NoiseModel::cauchy(1.8e-3, f64::INFINITY),
        /// Force of a contact that counts half \[N\]: taxels that ring false feel less. EXPERIMENTS: Contacts instead of single taxels.
        pub force: f64 = 2.0,
    }
}

/// A touched taxel.
struct Touched {
    link: usize,
    position: Point3<f64>,
    normal: Vector3<f64>,
    force: f64,
}

/// Where the skin of `robot` feels `forces` \[N\] above `least`: one probe for each group of neighbors, at their center of
/// force, on the skin.
///
/// A contact presses on all taxels around it, which lie beneath the skin and to its sides, each at a distance of its own from what
/// touches. Their center of force is where it does.
pub(super) fn contacts(
    robot: &Hand,
    links: &[usize],
    forces: &[Vector3<f64>],
    least: f64,
    settings: &ContactSettings,
) -> Vec<Probe> {
    let touched = robot.taxels.iter().zip(links).zip(forces);
    let touched = touched.filter_map(|((Taxel { position, normal, .. }, link), force)| {
        let force = force.norm();
        let touched = Touched { link: *link, position: *position, normal: *normal, force };
        (force > least && force.is_finite()).then_some(touched)
    });
    let noise = settings.noise;
    groups(touched.collect(), settings.reach)
        .iter()
        .map(|group| {
            let force: f64 = group.iter().map(|t| t.force).sum();
            let sum = |sum: Vector3<f64>, t: &Touched| sum + t.position.coords * t.force;
            let center = Point3::from(group.iter().fold(Vector3::zeros(), sum) / force);
            let trust = 1.0 / (1.0 + (settings.force / force).powi(2));
            Probe {
                link: group[0].link,
                position: on_skin(robot, group[0].link, center),
                distance: Distance::Is(0.0),
                weighting: noise.weighting(1).shared(trust),
            }
        })
        .collect()
}

/// Those of `touched` that hang together about the strongest.
fn groups(mut touched: Vec<Touched>, reach: f64) -> Vec<Vec<Touched>> {
    touched.sort_by(|a, b| b.force.total_cmp(&a.force));
    let mut groups = Vec::new();
    while !touched.is_empty() {
        let mut group = vec![touched.remove(0)];
        let Touched { link, position: strongest, normal, .. } = group[0];
        let mut looked_at = 0;
        while looked_at < group.len() {
            let place = group[looked_at].position;
            looked_at += 1;
            let near = |t: &mut Touched| {
                let of_same = t.link == link && t.normal.dot(&normal) > 0.0;
                let apart = (t.position - strongest).norm();
                of_same && (t.position - place).norm() <= reach && apart <= 2.0 * reach
            };
            group.extend(touched.extract_if(.., near));
        }
        groups.push(group);
    }
    groups
}

/// The point of the skin of `link` that is nearest to `point`, or `point` itself where the link has no shape near.
fn on_skin(robot: &Hand, link: usize, point: Point3<f64>) -> Point3<f64> {
    let grid = robot.shape.links()[link].grid();
    let sample = grid.and_then(|grid| grid.sample(&point, RobotShape::DEFAULT_MARGIN));
    sample.map_or(point, |s| point - s.gradient * s.distance)
}

#[cfg(test)]
mod tests {
    use super::super::super::gradient_check::scene;
    use super::*;
    use crate::scene::Scene;

    fn found(scene: &Scene, forces: &[Vector3<f64>]) -> Vec<Probe> {
        let taxels = scene.hand.taxels.iter();
        let links: Vec<usize> = taxels.map(|t| scene.hand.link_of(t).unwrap()).collect();
        contacts(&scene.hand, &links, forces, 0.1, &ContactSettings::default())
    }

    #[test]
    fn a_press_is_found_where_it_is() {
        let scene = scene();
        let taxels = &scene.hand.taxels;
        // In the middle of four taxels of a flat pad, each of which bears a quarter.
        let pad: Vec<&Taxel> = taxels.iter().filter(|t| t.patch == "11").collect();
        let corner = pad[5];
        let near = |t: &&Taxel| (t.position - corner.position).norm();
        let mut square = pad.clone();
        square.sort_by(|a, b| near(a).total_cmp(&near(b)));
        let square = [square[0], square[1], square[2], pad[10]];
        let middle = square.iter().map(|t| t.position.coords).sum::<Vector3<f64>>() / 4.0;
        let mut forces = vec![Vector3::zeros(); taxels.len()];
        for taxel in square {
            forces[taxel.index] = -taxel.normal;
        }
        let [contact] = &found(scene, &forces)[..] else { panic!("not one contact") };
        let lifted = contact.position - middle;
        // On the skin above: taxels of flat pads lie less than a millimeter beneath it.
        assert!(lifted.coords.dot(&corner.normal) > 2e-4 && lifted.coords.norm() < 1e-3);
        assert!(lifted.coords.cross(&corner.normal).norm() < 1e-4, "{lifted}");
        // Four newtons count four fifths with half at two.
        let full = ContactSettings::default().noise.sigma.powi(-2);
        assert!((contact.weighting.information / full - 0.8).abs() < 1e-12);
    }

    #[test]
    fn presses_apart_are_apart_and_weak_ones_hardly_count() {
        let scene = scene();
        let taxels = &scene.hand.taxels;
        let first = |patch: &str| taxels.iter().position(|t| t.patch == patch).unwrap();
        let mut forces = vec![Vector3::zeros(); taxels.len()];
        // The first and the last of a pad, and one on another finger that rings false.
        forces[first("11")] = -5.0 * taxels[first("11")].normal;
        forces[first("12") - 1] = -5.0 * taxels[first("11")].normal;
        forces[first("33")] = Vector3::new(0.2, 0.0, 0.0);
        let contacts = found(scene, &forces);
        assert_eq!(contacts.len(), 3);
        assert!(contacts[2].weighting.information < 0.02 * contacts[0].weighting.information);
    }

    #[test]
    fn contacts_of_a_grasp_lie_on_the_object() {
        let scene = scene();
        let hand = scene.frame.hand.as_ref().unwrap();
        let posed = scene.hand.posed(&hand.t_cam_hand, &hand.joints).unwrap();
        let contacts = found(scene, &hand.forces);
        assert!(contacts.len() >= 3);
        for contact in contacts {
            let point = posed.t_world_links()[contact.link] * contact.position;
            let local = scene.truth.inverse_transform_point(&point);
            let (distance, _) = scene.object.surface.signed_distance(&local);
            assert!(distance.abs() < 3e-3, "{distance}");
        }
    }
}
