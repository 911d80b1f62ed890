//! Joints, links and pads of the Allegro right hand with XELA pads, and their URDF.

use std::fmt::Write;

use nalgebra::{Matrix3, Vector3};

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

/// One revolute joint: origin in the parent link \[m; rad\], axis, limits \[rad\].
pub(super) struct Joint {
    /// Link number of the parent; `None` is the base.
    pub(super) parent: Option<usize>,
    pub(super) xyz: [f64; 3],
    pub(super) rpy: [f64; 3],
    pub(super) axis: [f64; 3],
    pub(super) limits: [f64; 2],
}

/// A piece of a link \[m\]; all are boxes but the curved fingertips.
#[derive(Clone, Copy)]
pub(super) enum Part {
    Box { size: [f64; 3], center: [f64; 3] },
    Capsule { low: [f64; 3], high: [f64; 3], radius: f64 },
}

/// Tilt of the index and ring finger's roots: 5° in radians.
const SPLAY: f64 = 0.08726646255;

/// Size of a 4×4 module seen along its normal, and of a 4×6 one.
const PAD_44: [f64; 3] = [0.0044, 0.0238, 0.026];
const PAD_46: [f64; 3] = [0.005, 0.0516, 0.0316];

/// The joint that moves link `i`.
pub(super) fn joint(i: usize) -> Joint {
    const X: [f64; 3] = [-1.0, 0.0, 0.0];
    const Y: [f64; 3] = [0.0, 1.0, 0.0];
    const Z: [f64; 3] = [0.0, 0.0, 1.0];
    let root = |xyz, roll| (xyz, [roll, 0.0, 0.0], Z, [-0.47, 0.47]);
    let along = |z, limits| ([0.0, 0.0, z], [0.0; 3], Y, limits);
    let (xyz, rpy, axis, limits) = match i {
        0 => root([0.0, 0.0435, -0.001542], -SPLAY),
        4 => root([0.0, 0.0, 0.0007], 0.0),
        8 => root([0.0, -0.0435, -0.001542], SPLAY),
        12 => (
            [-0.0182, 0.019333, -0.045987],
            [0.0, -1.65806278845, -1.5707963259],
            X,
            [0.263, 1.396],
        ),
        13 => ([-0.027, 0.005, 0.0399], [0.0; 3], Z, [-0.105, 1.163]),
        14 => along(0.0177, [-0.189, 1.644]),
        15 => along(0.0514, [-0.162, 1.719]),
        // The pads' wiring lengthens the plain hand's 16.4 mm by 4 mm.
        i if i % 4 == 1 => along(0.0204, [-0.196, 1.61]),
        i if i % 4 == 2 => along(0.054, [-0.174, 1.709]),
        _ => along(0.0384, [-0.227, 1.618]),
    };
    Joint { parent: if i.is_multiple_of(4) { None } else { Some(i - 1) }, xyz, rpy, axis, limits }
}

/// Mass \[kg\] and parts of a link; `None` is the base.
pub(super) fn link(i: Option<usize>) -> (f64, Vec<Part>) {
    fn cuboid(size: [f64; 3], center: [f64; 3]) -> Part {
        Part::Box { size, center }
    }
    /// A phalanx of square section from the joint to `length`.
    fn phalanx(length: f64) -> Part {
        cuboid([0.0196, 0.0275, length], [0.0, 0.0, 0.5 * length])
    }
    /// A 4×4 module whose center stands at `x` and `z` of the link and `y` beside its middle.
    fn pad(x: f64, y: f64, z: f64) -> Part {
        cuboid(PAD_44, [x, y, z])
    }
    fn tip(low: f64) -> Part {
        let end = |z| [-0.0003, 0.0, z];
        Part::Capsule { low: end(low), high: end(low + 0.0236), radius: 0.0157 }
    }
    let Some(i) = i else {
        return (
            0.4288,
            vec![
                cuboid([0.0414, 0.112, 0.0448], [-0.009, 0.0, -0.023]),
                cuboid([0.0414, 0.0538, 0.0428], [-0.009, -0.0253, -0.0667]),
                cuboid([0.0414, 0.072, 0.013], [-0.0093, -0.00557, -0.08874]),
                // Plates that carry the palm's modules.
                cuboid([0.003, 0.104, 0.033], [0.013, 0.0, -0.0204]),
                cuboid([0.003, 0.052, 0.032], [0.013, -0.021, -0.0515]),
                cuboid(PAD_46, [0.0165, -0.0201, -0.0206]),
                cuboid(PAD_46, [0.0165, 0.0201, -0.0202]),
                cuboid(PAD_46, [0.0165, -0.0201, -0.0517]),
            ],
        );
    };
    match i {
        12 => (0.0176, vec![cuboid([0.0358, 0.034, 0.0455], [-0.0179, 0.009, 0.0145])]),
        13 => (0.0127, vec![phalanx(0.0177)]),
        14 => (0.0435, vec![phalanx(0.0514), pad(0.0132, -0.0002, 0.01)]),
        15 => {
            let body = cuboid([0.0196, 0.0275, 0.0375], [0.0, 0.0, 0.0125]);
            (0.0731, vec![body, tip(0.0315), pad(0.0132, -0.0002, 0.008)])
        }
        i => match i % 4 {
            // Centered in the 20.4 mm up to the next joint, to which the lengthening adds 4 mm below it.
            0 => (0.0127, vec![cuboid([0.0196, 0.0275, 0.0164], [0.0, 0.0, 0.0112])]),
            1 => (
                0.0719,
                vec![phalanx(0.054), pad(0.013, -0.0002, 0.008), pad(0.013, 0.0002, 0.046)],
            ),
            2 => (0.0422, vec![phalanx(0.0384), pad(0.0122, -0.0002, 0.0315)]),
            _ => (0.0404, vec![cuboid([0.0196, 0.0269, 0.022], [0.0, 0.0, 0.0047]), tip(0.016)]),
        },
    }
}

/// Name of a link; `None` is the base.
pub(super) fn link_name(i: Option<usize>) -> String {
    i.map_or_else(|| "base_link".to_owned(), |i| format!("link_{i}.0"))
}

/// The hand as URDF text \[m; rad; kg\]: 17 links named `base_link` and `link_0.0` … `link_15.0`, joints as in
/// [`JOINT_NAMES`], visuals and collisions of boxes, cylinders and spheres only.
///
/// A fingertip is a capsule, given as one cylinder and two spheres. Inertias are those of each link's parts at
/// one density, because the published ones disagree by orders of magnitude.
pub fn allegro_xela_urdf() -> String {
    let mut xml = String::from("<?xml version=\"1.0\"?>\n<robot name=\"allegro_xela_right\">\n");
    // Writing to a string cannot fail.
    for i in std::iter::once(None).chain((0..JOINT_COUNT).map(Some)) {
        let (mass, parts) = link(i);
        let (center, inertia) = inertia(mass, &parts);
        let m = |r, c| inertia[(r, c)];
        let _ = writeln!(xml, "  <link name=\"{}\">", link_name(i));
        let _ = writeln!(
            xml,
            "    <inertial><origin xyz=\"{:.9} {:.9} {:.9}\" rpy=\"0 0 0\"/><mass value=\"{mass}\"/>\
             <inertia ixx=\"{:.6e}\" ixy=\"{:.6e}\" ixz=\"{:.6e}\" iyy=\"{:.6e}\" iyz=\"{:.6e}\" izz=\"{:.6e}\"/></inertial>",
            center.x,
            center.y,
            center.z,
            m(0, 0),
            m(0, 1),
            m(0, 2),
            m(1, 1),
            m(1, 2),
            m(2, 2),
        );
        for tag in ["visual", "collision"] {
            for (center, geometry) in parts.iter().flat_map(primitives) {
                let _ = writeln!(
                    xml,
                    "    <{tag}><origin xyz=\"{}\" rpy=\"0 0 0\"/><geometry>{geometry}</geometry></{tag}>",
                    triple(center)
                );
            }
        }
        xml.push_str("  </link>\n");
    }
    for (i, name) in JOINT_NAMES.iter().enumerate() {
        let Joint { parent, xyz, rpy, axis, limits: [lower, upper] } = joint(i);
        let _ = writeln!(
            xml,
            "  <joint name=\"{name}\" type=\"revolute\"><parent link=\"{}\"/><child link=\"{}\"/>\
             <origin xyz=\"{}\" rpy=\"{}\"/><axis xyz=\"{}\"/>\
             <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"10\" velocity=\"3.14\"/></joint>",
            link_name(parent),
            link_name(Some(i)),
            triple(xyz),
            triple(rpy),
            triple(axis),
        );
    }
    xml.push_str("</robot>\n");
    xml
}

fn triple([x, y, z]: [f64; 3]) -> String {
    format!("{x} {y} {z}")
}

/// Centers and URDF geometry elements of a part; capsules stand along z.
fn primitives(part: &Part) -> Vec<([f64; 3], String)> {
    match *part {
        Part::Box { size, center } => vec![(center, format!("<box size=\"{}\"/>", triple(size)))],
        Part::Capsule { low, high, radius } => {
            let middle = (0.5 * (Vector3::from(low) + Vector3::from(high))).map(rounded);
            let length = rounded(high[2] - low[2]);
            let ball = format!("<sphere radius=\"{radius}\"/>");
            let shaft = format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>");
            vec![(middle.into(), shaft), (low, ball.clone()), (high.map(rounded), ball)]
        }
    }
}

/// Removes the last bits of a sum of decimals, which would be printed as a long tail.
fn rounded(x: f64) -> f64 {
    (x * 1e9).round() / 1e9
}

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
                let lengthwise =
                    shaft * h * h / 12.0 + ball * (h * h / 4.0 + 3.0 / 8.0 * h * r + r * r / 5.0);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urdf_is_a_tree_of_seventeen_links() {
        let robot = urdf_rs::read_from_string(&allegro_xela_urdf()).unwrap();
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
