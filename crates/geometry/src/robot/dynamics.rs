//! Mass and inertia of links, and damping, friction, speed and effort limits of joints, from URDF.

use nalgebra::{Matrix3, Point3, Vector3};
use roxmltree::Node;

use super::urdf_reader::{UrdfReader, finite};
use super::{Link, Result, RobotError};
use crate::inertial::Inertial;
use crate::mass::mass_properties;
use crate::read_options::ReadOptions;

/// Mass and inertia of the link `node` in its frame; `None` without an `inertial` tag, and where it is at the origin and all
/// zeros.
pub(super) fn inertial(reader: &mut UrdfReader, node: Node<'_, '_>) -> Result<Option<Inertial>> {
    let Some(node) = reader.first(node, "inertial") else { return Ok(None) };
    let t_link_inertial = reader.origin(node)?;
    let mass = match reader.first(node, "mass") {
        Some(mass) => reader.number(mass, "value")?,
        None => None,
    };
    if mass.is_none() {
        reader.warn("its inertial has no mass: zero is taken");
    }
    let mass = mass.unwrap_or(0.0);
    let (inertia, mut moments, mut missing) = (reader.first(node, "inertia"), [0.0; 6], Vec::new());
    for (moment, field) in moments.iter_mut().zip(["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]) {
        match inertia.map(|inertia| reader.number(inertia, field)).transpose()?.flatten() {
            Some(given) => *moment = given,
            None => missing.push(field),
        }
    }
    if !missing.is_empty() {
        reader.warn(format!("its inertia has no {}: zero is taken", missing.join(", ")));
    }
    finite(&reader.owner, "inertial mass", &[mass])?;
    finite(&reader.owner, "inertia", &moments)?;
    if mass < 0.0 {
        let (field, requirement) = ("inertial mass", "must not be negative");
        return Err(RobotError::Number { owner: reader.owner.clone(), field, requirement });
    }
    let at_origin = t_link_inertial.translation.vector == Vector3::zeros();
    if mass == 0.0 && moments == [0.0; 6] && at_origin {
        return Ok(None);
    }
    let [ixx, ixy, ixz, iyy, iyz, izz] = moments;
    let inertia = Matrix3::new(ixx, ixy, ixz, ixy, iyy, iyz, ixz, iyz, izz);
    let inertial = Inertial { mass, com: Point3::origin(), inertia };
    Ok(Some(inertial.moved(&t_link_inertial)))
}

/// Warns of an inertia that no body can have, or replaces it by that of the collision shapes where that is wanted.
pub(super) fn judge(link: &mut Link, options: &ReadOptions, warnings: &mut Vec<String>) {
    let Some(inertial) = link.inertial.filter(|inertial| !is_possible(inertial)) else { return };
    let name = &link.name;
    let what = format!("link '{name}': no body has its inertia");
    if options.inertia_from_geometry {
        // Overlaps count twice, which a uniform density over the sum makes good for.
        let solids = link.parts.iter().filter_map(|part| mass_properties(part, 1.0).ok());
        let solids: Vec<Inertial> = solids
            .map(|s| Inertial { mass: s.mass, com: s.center_of_mass, inertia: s.inertia })
            .collect();
        if let Some(unit) = Inertial::joined(&solids) {
            let inertia = unit.inertia * (inertial.mass / unit.mass);
            link.inertial = Some(Inertial { mass: inertial.mass, com: unit.com, inertia });
            warnings.push(format!("{what}: that of its collision shapes is taken"));
            return;
        }
    }
    warnings.push(what);
}

/// Whether a body can have this inertia: no principal moment is negative, or greater than the sum of the others.
fn is_possible(inertial: &Inertial) -> bool {
    let moments = inertial.inertia.symmetric_eigenvalues();
    let (sum, most) = (moments.sum(), moments.max());
    let is_extended = most > 0.0 || inertial.mass == 0.0;
    is_extended && moments.min() >= -1e-9 * most.abs() && 2.0 * most <= sum * (1.0 + 1e-6)
}

/// Damping and dry friction of the joint `node`; `None` without a `dynamics` tag.
pub(super) fn damping_and_friction(
    reader: &mut UrdfReader,
    node: Node<'_, '_>,
) -> Result<[Option<f64>; 2]> {
    let Some(dynamics) = reader.first(node, "dynamics") else { return Ok([None; 2]) };
    let number = |field: &'static str| -> Result<Option<f64>> {
        let number = reader.number(dynamics, field)?.unwrap_or(0.0);
        finite(&reader.owner, field, &[number])?;
        Ok(Some(number))
    };
    Ok([number("damping")?, number("friction")?])
}

/// A limit of speed or effort. Zero is what stands where the tag or the attribute is missing, and a joint of no strength or
/// speed is none; since URDF 1.2 it is infinity.
pub(super) fn limit(owner: &str, field: &'static str, value: f64) -> Result<Option<f64>> {
    if value.is_nan() {
        let requirement = "must be a number";
        return Err(RobotError::Number { owner: owner.into(), field, requirement });
    }
    Ok((value > 0.0 && value.is_finite()).then_some(value))
}

#[cfg(test)]
mod tests {
    use super::super::KinematicTree;
    use super::*;

    fn read(link: &str, joint: &str) -> Result<KinematicTree, String> {
        let xml = format!(
            "<robot name=\"r\"><link name=\"a\">{link}</link><link name=\"b\"/><joint name=\"j\" type=\"revolute\">\
            <parent link=\"a\"/><child link=\"b\"/>{joint}</joint></robot>"
        );
        KinematicTree::from_urdf_str(&xml, None).map_err(|e| e.to_string())
    }

    const INERTIA: &str =
        "<inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.2\" iyz=\"0\" izz=\"0.25\"/>";

    #[test]
    fn inertia_is_turned_into_the_axes_of_the_link() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let tag = format!(
            "<inertial><origin xyz=\"0.1 0.2 0.3\" rpy=\"0 0 {quarter}\"/><mass value=\"2\"/>{INERTIA}</inertial>"
        );
        let robot = read(&tag, "").unwrap();
        let inertial = robot.links()[0].inertial.unwrap();
        let expected = Matrix3::from_diagonal(&Vector3::new(0.2, 0.1, 0.25));
        assert!((inertial.inertia - expected).norm() < 1e-15);
        assert_eq!((inertial.mass, inertial.com), (2.0, Point3::new(0.1, 0.2, 0.3)));
        assert_eq!(robot.links()[1].inertial, None);
    }

    #[test]
    fn what_a_joint_says_of_its_motion_is_kept() {
        let of = |tags: &str| {
            let robot = read("", tags).unwrap();
            let j = &robot.joints()[0];
            [j.damping, j.friction, j.velocity_limit, j.effort_limit]
        };
        let limit = "<limit lower=\"-1\" upper=\"1\" effort=\"30\" velocity=\"2\"/>";
        assert_eq!(of(""), [None; 4]);
        assert_eq!(of(limit), [None, None, Some(2.0), Some(30.0)]);
        assert_eq!(of("<dynamics friction=\"0.1\"/>"), [Some(0.0), Some(0.1), None, None]);
        assert_eq!(
            of("<limit lower=\"-1\" upper=\"1\" velocity=\"2\"/>"),
            [None, None, Some(2.0), None]
        );
    }

    #[test]
    fn what_is_no_mass_is_named() {
        let tag = |mass: &str| format!("<inertial><mass value=\"{mass}\"/>{INERTIA}</inertial>");
        assert!(read(&tag("-1"), "").unwrap_err().contains("link 'a': inertial mass"));
        assert!(read(&tag("NaN"), "").unwrap_err().contains("must be finite"));
        let bad = read("", "<dynamics damping=\"inf\"/>").unwrap_err();
        assert!(bad.contains("joint 'j': damping"), "{bad}");
    }
}
