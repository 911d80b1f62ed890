//! Lengths that tendons and actuators act along: sums of joints, or paths through the links.

use std::sync::Arc;

use prehend_geometry::mjcf::{
    Actuator, JointIndex, JointKind, Model as MjcfModel, PlacedFrame, Tendon, TendonPart,
    Transmission,
};

use crate::model::joint_force::JointAxis;
use crate::model::path::{Anchor, LinkFrame, Obstacle, Path, PathPart};

/// A length.
#[derive(Clone, Debug)]
pub(super) enum Along {
    Joints(Vec<(JointAxis, f64)>),
    Path(Arc<Path>),
}

/// Lengths along the joints and tendons of a model.
pub(super) struct PathLengths<'a> {
    pub(super) mjcf: &'a MjcfModel,
    /// The link that each body is.
    pub(super) bodies: &'a [usize],
    /// Axis and link of each joint of the model, in ascending order.
    pub(super) axes: &'a [(JointIndex, JointAxis, usize)],
    pub(super) t_world_mjcf: nalgebra::Isometry3<f64>,
}

impl PathLengths<'_> {
    pub(super) fn axis(&self, joint: JointIndex) -> (JointAxis, usize) {
        let found = self.axes.binary_search_by(|(own, ..)| own.cmp(&joint));
        let (_, axis, link) = self.axes[found.unwrap_or_default()];
        (axis, link)
    }

    fn frame(&self, PlacedFrame { body, t_body_frame }: &PlacedFrame) -> LinkFrame {
        let link = body.map(|body| self.bodies[body]);
        let t_link_frame =
            if link.is_some() { *t_body_frame } else { self.t_world_mjcf * t_body_frame };
        LinkFrame { link, t_link_frame }
    }

    fn anchor(&self, body: Option<usize>, point: &nalgebra::Point3<f64>) -> Anchor {
        let frame = PlacedFrame { body, t_body_frame: point.coords.into() };
        let LinkFrame { link, t_link_frame } = self.frame(&frame);
        Anchor { link, point: t_link_frame.translation.vector.into() }
    }

    /// The length of a tendon times `factor`.
    pub(super) fn of_tendon(&self, tendon: &Tendon, factor: f64) -> Along {
        if tendon.parts.is_empty() {
            let joints = tendon.joints.iter();
            let axes = joints.map(|own| (self.axis(own.joint).0, factor * own.coefficient));
            return Along::Joints(axes.collect());
        }
        let (mut parts, mut share) = (Vec::new(), factor);
        let mut last: Option<Anchor> = None;
        let mut obstacle = None;
        for part in &tendon.parts {
            match part {
                TendonPart::Pulley { divisor } => {
                    share = factor / divisor;
                    (last, obstacle) = (None, None);
                }
                TendonPart::Site { body, point } => {
                    let here = self.anchor(*body, point);
                    if let Some(before) = last {
                        let (ends, factor) = ([before, here], share);
                        parts.push(match obstacle.take() {
                            Some(obstacle) => PathPart::Around { ends, obstacle, factor },
                            None => PathPart::Straight { ends, factor },
                        });
                    }
                    last = Some(here);
                }
                TendonPart::Around { body, t_body_geom, radius, is_cylinder, side } => {
                    let frame =
                        self.frame(&PlacedFrame { body: *body, t_body_frame: *t_body_geom });
                    let side = side.as_ref().map(|(body, point)| self.anchor(*body, point));
                    let (radius, is_cylinder) = (*radius, *is_cylinder);
                    obstacle = Some(Obstacle { frame, radius, is_cylinder, side });
                }
            }
        }
        Along::Path(Arc::new(Path(parts)))
    }

    /// The length that an actuator acts along, gear included.
    pub(super) fn of_actuator(&self, actuator: &Actuator) -> Along {
        let gear = actuator.gear;
        let path = |part| Along::Path(Arc::new(Path(vec![part])));
        match &actuator.transmission {
            Transmission::Joint { joint, in_parent } => {
                let (axis, link) = self.axis(*joint);
                match self.mjcf.joint(*joint).kind {
                    JointKind::Hinge | JointKind::Slide => Along::Joints(vec![(axis, gear[0])]),
                    kind => {
                        let (is_free, in_parent) = (kind == JointKind::Free, *in_parent);
                        let reference = (!is_free).then(nalgebra::Isometry3::identity);
                        path(PathPart::Turn { link, gear, is_free, in_parent, reference })
                    }
                }
            }
            Transmission::Tendon(index) => self.of_tendon(&self.mjcf.tendons[*index], gear[0]),
            Transmission::Site { site, reference } => {
                let frame = self.frame(site);
                path(match reference {
                    Some(reference) => {
                        let reference = self.frame(reference);
                        PathPart::Relative { frame, reference, gear }
                    }
                    None => PathPart::Twist { frame, gear },
                })
            }
            Transmission::SliderCrank { crank, slider, rod } => {
                let pin = self.anchor(crank.body, &crank.t_body_frame.translation.vector.into());
                let (slider, rod, factor) = (self.frame(slider), *rod, gear[0]);
                path(PathPart::Crank { pin, slider, rod, factor })
            }
            // Where nothing touches, there is nothing to hold.
            Transmission::Adhesion(_) => Along::Path(Arc::new(Path(Vec::new()))),
        }
    }
}
