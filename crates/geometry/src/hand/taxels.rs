//! Where the 368 taxels of the XELA modules sit on the hand.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::allegro::link_name;

/// One three-axis touch sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Taxel {
    /// Position in the sensor's list, from 0.
    pub index: usize,
    /// Module, such as "52".
    pub patch: String,
    /// Link that carries it.
    pub link: String,
    /// Sensing point in the link frame \[m\].
    pub position: Point3<f64>,
    /// Unit outward normal in the link frame.
    pub normal: Vector3<f64>,
}

/// A kind of module and the layout of its taxels in the module's frame.
enum Module {
    /// uSPa44: 4 × 4 on a flat pad, z out of the skin.
    Flat44,
    /// uSPa46: 4 × 6 on a flat pad, z out of the skin.
    Flat46,
    /// uSCuAH: 30 around a fingertip, y towards the tip, z to the palm side.
    CurvedTip,
}

/// Every taxel, in the sensor's order: thumb (modules 01–03), index (10–13), middle (20–23), ring (30–33), palm
/// (51–53).
///
/// Positions on the flat modules are the published grids. On the curved tips the published columns (at 90°, 50°
/// and 25° to the palm side, mirrored) lie 1.7 mm beneath the capsule that [`super::ALLEGRO_XELA_URDF`] gives the
/// fingertip.
pub fn taxels() -> Vec<Taxel> {
    use Module::{CurvedTip, Flat44, Flat46};
    let mut taxels = Vec::with_capacity(368);
    let mut add = |patch: String, module: Module, link: Option<usize>, xyz, rpy: [f64; 3]| {
        let [roll, pitch, yaw] = rpy.map(f64::to_radians);
        let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let t_link_patch = Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), turn);
        for (position, normal) in layout(module) {
            taxels.push(Taxel {
                index: taxels.len(),
                patch: patch.clone(),
                link: link_name(link),
                position: t_link_patch * position,
                normal: t_link_patch * normal,
            });
        }
    };
    let (low, high, tip) = ([0.0, 90.0, 0.0], [0.0, -90.0, 180.0], [90.0, 0.0, 90.0]);
    add("01".into(), Flat44, Some(14), [0.011, -0.012, 0.023], low);
    add("02".into(), Flat44, Some(15), [0.011, -0.012, 0.021], low);
    add("03".into(), CurvedTip, Some(15), [-0.013, 0.0, 0.0315], tip);
    for finger in 0..3 {
        let (name, root) = (|k: usize| format!("{}{k}", finger + 1), 4 * finger);
        add(name(0), Flat44, Some(root + 1), [0.0108, -0.012, 0.021], low);
        add(name(1), Flat44, Some(root + 1), [0.0108, 0.012, 0.033], high);
        add(name(2), Flat44, Some(root + 2), [0.010, -0.012, 0.0445], low);
        add(name(3), CurvedTip, Some(root + 3), [-0.013, 0.0, 0.016], tip);
    }
    let (left, right) = ([90.0, 180.0, 90.0], [90.0, 0.0, 90.0]);
    add("51".into(), Flat46, None, [0.014, -0.021, -0.0204], left);
    add("52".into(), Flat46, None, [0.014, 0.021, -0.0204], right);
    add("53".into(), Flat46, None, [0.014, -0.021, -0.0515], left);
    taxels
}

/// Positions \[m\] and normals of a module's taxels in its frame: rows from high to low y, then x rising.
fn layout(module: Module) -> Vec<(Point3<f64>, Vector3<f64>)> {
    let grid = |columns: usize, pitch: [f64; 2], offset: [f64; 2], z: f64| {
        let at = move |i: usize, j: usize| {
            [pitch[0] * i as f64 + offset[0], pitch[1] * j as f64 + offset[1]]
        };
        (1..=4)
            .rev()
            .flat_map(|j| (1..=columns).map(move |i| at(i, j)))
            .map(|[x, y]| (Point3::new(x, y, z) * 1e-3, Vector3::z()))
            .collect()
    };
    match module {
        Module::Flat44 => grid(4, [4.6666, 4.6667], [0.7, 0.15], 4.0),
        Module::Flat46 => grid(6, [7.24, 7.17], [-23.7, -17.8], 5.0),
        Module::CurvedTip => curved_tip(),
    }
}

/// Taxels around a fingertip: columns of 5, 4 and 6 from the side towards the palm, then their mirror images.
fn curved_tip() -> Vec<(Point3<f64>, Vector3<f64>)> {
    // The tip's capsule in the module frame: its axis along y from 0 to 23.6 mm, 12.7 mm above the origin.
    const AXIS: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0127);
    const LENGTH: f64 = 0.0236;
    const DEPTH: f64 = 0.0157 - 0.0017;
    let side: [&[f64]; 3] = [
        &[30.3, 23.5, 17.0, 10.3, 3.8],
        &[23.2, 16.9, 10.3, 3.8],
        &[33.8, 29.7, 23.3, 17.0, 10.3, 3.8],
    ];
    let column = |k: usize, sign: f64| {
        let (s, c) = [90.0_f64, 50.0, 25.0][k].to_radians().sin_cos();
        side[k].iter().map(move |y| {
            let beyond = (y * 1e-3 - LENGTH).max(0.0);
            let normal = {
                let across = (DEPTH * DEPTH - beyond * beyond).max(0.0).sqrt();
                Vector3::new(sign * s * across, beyond, c * across) / DEPTH
            };
            (Point3::from(AXIS + Vector3::y() * (y * 1e-3 - beyond) + DEPTH * normal), normal)
        })
    };
    let near = (0..3).flat_map(|k| column(k, 1.0));
    near.chain([2, 1, 0].into_iter().flat_map(|k| column(k, -1.0))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand::parts::{Part, parts};

    #[test]
    fn counts_a_link() {
        let taxels = taxels();
        assert_eq!(taxels.len(), 368);
        for (link, count) in
            [("base_link", 72), ("link_5.0", 32), ("link_10.0", 16), ("link_15.0", 46)]
        {
            assert_eq!(taxels.iter().filter(|t| t.link == link).count(), count, "{link}");
        }
        assert!(
            taxels
                .iter()
                .enumerate()
                .all(|(i, t)| t.index == i && (t.normal.norm() - 1.0).abs() < 1e-12)
        );
    }

    /// Each taxel lies in the skin of a part of its own link, and its normal leaves that part.
    #[test]
    fn taxels_lie_in_the_skin() {
        let depth = |part: &Part, p: &Vector3<f64>| match *part {
            Part::Box { size, center } => (p - Vector3::from(center))
                .abs()
                .zip_map(&Vector3::from(size), |d, s| d - 0.5 * s)
                .max(),
            Part::Capsule { low, high, radius } => {
                (p - Vector3::new(low[0], low[1], p.z.clamp(low[2], high[2]))).norm() - radius
            }
        };
        for taxel in taxels() {
            let parts = parts(&taxel.link);
            let signed = |p: Vector3<f64>| {
                parts.iter().map(|part| depth(part, &p)).fold(f64::INFINITY, f64::min)
            };
            let here = signed(taxel.position.coords);
            assert!((-0.003..0.0011).contains(&here), "{taxel:?} {here}");
            assert!(signed(taxel.position.coords + 0.004 * taxel.normal) > 0.0, "{taxel:?}");
        }
    }
}
