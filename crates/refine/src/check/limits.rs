//! Limits of all checks: beyond them an input looks wrong. docs/DATASET.md lists them for users.
//!
//! Poses to start from are off by centimeters and tens of degrees, so what depends on the pose has wide limits; what does not is held to a centimeter.

use std::ops::Range;

/// Extent of an object in meters \[m\]: below a pea, above a door, meshes are in another unit.
pub(super) const EXTENT: Range<f64> = 5e-3..5.0;
/// Difference of a mesh from its stated size, as a share of the diameter: scans and decimated meshes are off by a percent.
pub(super) const STATED_SIZE: f64 = 0.02;
/// Difference of a ratio from a power of ten, as a share, that makes it one of units.
pub(super) const UNIT_RATIO: f64 = 0.1;

/// Excess of joints over their limits \[rad; m\]: encoders have errors, and limits are soft.
pub(super) const JOINT_EXCESS: [f64; 2] = [0.1, 5e-3];
/// Ratio of a joint position to its limit from which on it may be in another unit.
pub(super) const JOINT_RATIO: f64 = 3.0;
/// Distance of the hand's base from the camera \[m\]: arms and cameras reach no farther.
pub(super) const BASE_DISTANCE: Range<f64> = 0.01..5.0;

/// Ratio of measured to expected depth that is no question of units.
pub(super) const DEPTH_RATIO: Range<f64> = 0.5..2.0;
/// Offset of depth on the object \[m\], or its radius where that is more: poses to start from are off by as much.
pub(super) const DEPTH_ON_OBJECT: f64 = 0.06;
/// Offset of depth over the whole hand \[m\]: rigs are off by a few millimeters.
pub(super) const DEPTH_ON_HAND: f64 = 11e-3;
/// Distance of depth from the hand's within which it is of the hand \[m\], loosely, and where the object is near.
pub(super) const HAND_REACH: f64 = 15e-3;
pub(super) const HAND_REACH_AT_OBJECT: f64 = 8e-3;
/// Least share of the hand's pixels with depth, and of all, whose depth is of the hand: some materials give none.
pub(super) const SHARE_ON_HAND: f64 = 0.75;
pub(super) const SHARE_ON_HAND_OF_ALL: f64 = 0.65;
/// Fewest pixels of the hand that tell anything.
pub(super) const HAND_PIXELS: usize = 300;
/// Distance from the hand's outline and the mask within which depth is not asked \[px\]: it is blurred there.
pub(super) const OUTLINE_MARGIN: usize = 4;

/// Least intersection over union of the mask and the object, farthest distance of their centers \[m\], and ratio of their areas that poses to start
/// from explain.
pub(super) const MASK_OVERLAP: f64 = 0.25;
pub(super) const MASK_SHIFT: f64 = 0.05;
pub(super) const MASK_AREA: Range<f64> = 0.4..2.5;
/// Largest shares of the mask on the hand, and on what is behind the object: segmentations leak.
pub(super) const MASK_ON_HAND: f64 = 0.2;
pub(super) const MASK_BEHIND: f64 = 0.05;
/// Largest share of the mask's border along which the same surface goes on outside of it.
pub(super) const MASK_CUT: f64 = 0.12;

/// Largest force of a taxel, and of all together \[N\]; smallest of the largest one where an object is held.
pub(super) const TAXEL_FORCE: f64 = 50.0;
pub(super) const TOTAL_FORCE: f64 = 500.0;
pub(super) const HELD_FORCE: f64 = 0.02;
/// Least share of all forces that presses into the skin, those that pull counting as negative.
pub(super) const PRESSING_SHARE: f64 = -0.3;
/// Distance of a taxel from its link \[m\].
pub(super) const TAXEL_FROM_LINK: f64 = 10e-3;
/// Force from which on a taxel is touched \[N\].
pub(super) const TOUCHED: f64 = 0.1;
/// Distance of touches from the object where mask and depth have it \[m\].
pub(super) const TOUCH_FROM_OBJECT: f64 = 25e-3;
/// Distance of touches from the object from which on they are not of it \[m\], where most taxels are touched.
pub(super) const TOUCH_CLEAR: f64 = 10e-3;
/// Distance from the object of a hand that touches it \[m\].
pub(super) const HAND_FROM_OBJECT: f64 = 20e-3;
