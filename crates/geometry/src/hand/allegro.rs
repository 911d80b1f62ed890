//! The Allegro right hand with XELA pads: its URDF, and the names of its joints and links.

/// Joints of the hand.
pub const JOINT_COUNT: usize = 16;

/// Joint names in the order of the joint vector.
pub const JOINT_NAMES: [&str; JOINT_COUNT] = [
    "joint_0.0",
    "joint_1.0",
    "joint_2.0",
    "joint_3.0",
    "joint_4.0",
    "joint_5.0",
    "joint_6.0",
    "joint_7.0",
    "joint_8.0",
    "joint_9.0",
    "joint_10.0",
    "joint_11.0",
    "joint_12.0",
    "joint_13.0",
    "joint_14.0",
    "joint_15.0",
];

/// The hand as URDF text \[m; rad; kg\]: 17 links named `base_link` and `link_0.0` … `link_15.0`, joints as in
/// [`JOINT_NAMES`], visuals and collisions of boxes, cylinders and spheres only.
pub const ALLEGRO_XELA_URDF: &str = include_str!("allegro_xela_right.urdf");

/// Name of a link; `None` is the base.
pub(super) fn link_name(i: Option<usize>) -> String {
    i.map_or_else(|| "base_link".to_owned(), |i| format!("link_{i}.0"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::parts::{Part, parts};
    use nalgebra::{Matrix3, Vector3};

    /// Center of mass \[m\] and inertia about it \[kg m²\] of parts of one density; their overlaps count twice.
    fn inertia(mass: f64, parts: &[Part]) -> (Vector3<f64>, Matrix3<f64>) {
        // Volume, center and second moments ∫ x² over each part's own center.
        let moments: Vec<(f64, Vector3<f64>, Vector3<f64>)> = parts
            .iter()
            .map(|part| match *part {
                Part::Box { size, center } => {
                    let (size, volume) = (Vector3::from(size), size.iter().product::<f64>());
                    (volume, center.into(), size.component_mul(&size) * (volume / 12.0))
                }
                Part::Capsule { low, high, radius: r } => {
                    let (low, high) = (Vector3::from(low), Vector3::from(high));
                    let (h, pi) = ((high - low).norm(), std::f64::consts::PI);
                    let (shaft, ball) = (pi * r * r * h, 4.0 / 3.0 * pi * r * r * r);
                    let across = shaft * r * r / 4.0 + ball * r * r / 5.0;
                    // Half balls at ±h/2: their centroids lie 3r/8 further out.
                    let lengthwise = shaft * h * h / 12.0
                        + ball * (h * h / 4.0 + 3.0 / 8.0 * h * r + r * r / 5.0);
                    (shaft + ball, 0.5 * (low + high), Vector3::new(across, across, lengthwise))
                }
            })
            .collect();
        let volume: f64 = moments.iter().map(|m| m.0).sum();
        let center = moments.iter().map(|m| m.0 * m.1).sum::<Vector3<f64>>() / volume;
        let mut second = Matrix3::zeros();
        for (v, c, own) in &moments {
            second += Matrix3::from_diagonal(own) + *v * (c - center) * (c - center).transpose();
        }
        (center, (Matrix3::identity() * second.trace() - second) * (mass / volume))
    }

    #[test]
    fn urdf_is_a_tree_of_seventeen_links() {
        let robot = urdf_rs::read_from_string(ALLEGRO_XELA_URDF).unwrap();
        assert_eq!((robot.links.len(), robot.joints.len()), (17, JOINT_COUNT));
        for (joint, name) in robot.joints.iter().zip(JOINT_NAMES) {
            assert_eq!(joint.name, name);
            assert!(robot.links.iter().any(|l| l.name == joint.parent.link));
            assert!(joint.limit.lower < joint.limit.upper);
        }
        let mass: f64 = robot.links.iter().map(|l| l.inertial.mass.value).sum();
        // Base, three fingers and the thumb.
        let expected = 0.4288 + 3.0 * 0.1672 + 0.1469;
        assert!((mass - expected).abs() < 1e-9, "{mass}");
    }

    #[test]
    fn inertias_are_those_of_the_parts_at_one_density() {
        let robot = urdf_rs::read_from_string(ALLEGRO_XELA_URDF).unwrap();
        for link in &robot.links {
            let stated = &link.inertial;
            let (center, inertia) = inertia(stated.mass.value, &parts(&link.name));
            assert!((center - Vector3::from(stated.origin.xyz.0)).amax() < 1e-9, "{}", link.name);
            let i = &stated.inertia;
            let stated =
                Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
            let error = (inertia - stated).amax() / stated.amax();
            assert!(error < 1e-6, "{}: {error}", link.name);
        }
    }

    #[test]
    fn inertia_of_a_capsule_matches_its_sampled_moments() {
        let (r, h) = (0.0157, 0.0236);
        let capsule = Part::Capsule { low: [0.0; 3], high: [0.0, 0.0, h], radius: r };
        let (center, inertia) = inertia(1.0, &[capsule]);
        let (n, mut sum, mut moments) = (120, 0.0, Vector3::zeros());
        let at = |i: usize, low: f64, high: f64| low + (high - low) * (i as f64 + 0.5) / n as f64;
        for (i, j, k) in
            (0..n).flat_map(|i| (0..n).flat_map(move |j| (0..n).map(move |k| (i, j, k))))
        {
            let p = Vector3::new(at(i, -r, r), at(j, -r, r), at(k, -r, h + r));
            if (p - Vector3::z() * p.z.clamp(0.0, h)).norm() < r {
                let d = p - center;
                sum += 1.0;
                moments += Vector3::new(
                    d.y * d.y + d.z * d.z,
                    d.z * d.z + d.x * d.x,
                    d.x * d.x + d.y * d.y,
                );
            }
        }
        let error = inertia.diagonal().component_div(&(moments / sum)).add_scalar(-1.0);
        assert!(error.amax() < 5e-3, "{error:?}");
    }
}
