//! Readings of tactile sensors that measure no forces.

use nalgebra::{Point3, Vector3};

/// Reading of one such sensor. Positions are in the frame of the link at that index of the hand's
/// [`links`](prehend_geometry::robot::KinematicTree::links).
#[derive(Clone, Debug, PartialEq)]
pub enum TouchReading {
    /// Whether places of the skin are touched.
    Binary(Vec<BinaryContact>),
    /// How far the object is from places of the skin.
    Proximity(Vec<ProximityReading>),
    /// The shape of a contact.
    Patch(ContactPatch),
}

/// Whether a place of the skin is touched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinaryContact {
    /// Index of the link.
    pub link: usize,
    /// Link frame \[m\].
    pub position: Point3<f64>,
    /// Whether something is felt there.
    pub touched: bool,
}

/// How far the object is from a place of the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProximityReading {
    /// Index of the link.
    pub link: usize,
    /// Link frame \[m\].
    pub position: Point3<f64>,
    /// Distance of the object's surface \[m\].
    pub distance: f64,
}

/// A part of the object's surface as it presses into a soft skin, such as that of a GelSight or a DIGIT.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactPatch {
    /// Index of the link that carries the skin.
    pub link: usize,
    /// Points of the surface, link frame \[m\].
    pub points: Vec<Point3<f64>>,
    /// The skin's outward unit normal at each of them, link frame: the object's points against it.
    pub normals: Vec<Vector3<f64>>,
}
