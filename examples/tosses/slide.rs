//! How the last slide of a toss begins, on a face and to where it stops.

use nalgebra::{DMatrix, DVector, Isometry3, UnitQuaternion, Vector3};

use super::recording::{RATE, Row, Start, Toss};

/// How far a cube that slides on a face may seem tilted \[rad\], and its height may seem to change \[m\].
const TILT: f64 = 0.023;
const LEVEL: f64 = 3e-4;
/// Rows that tell how the slide begins, rows of a slide at least, and its least speed \[m/s\].
const FIRST: usize = 9;
const SHORTEST: usize = 15;
const SLOWEST: f64 = 0.15;

/// The first row of the last slide, and its start, exactly on a face.
pub(crate) fn begin(toss: &Toss) -> Option<(usize, Start)> {
    let end = toss.rows.last()?.pose().translation.z;
    let slides =
        |row: &Row| row.up().amax() > TILT.cos() && (row.pose().translation.z - end).abs() < LEVEL;
    let first = toss.rows.iter().rposition(|row| !slides(row)).map_or(0, |last| last + 1);
    let slide = &toss.rows[first..];
    // What has not flown is no toss.
    if first == 0 || slide.len() < SHORTEST {
        return None;
    }
    let (rotation, up) = (slide[0].pose().rotation, slide[0].up());
    let moved = |row: &Row| {
        let pose = row.pose();
        let turned = (pose.rotation * rotation.inverse()).scaled_axis();
        Vector3::new(pose.translation.x, pose.translation.y, turned.z)
    };
    let [place, rate] = parabola(slide[..FIRST].iter().map(moved))?;
    if rate.xy().norm() < SLOWEST {
        return None;
    }
    // The axis of the cube that is nearly vertical becomes so.
    let axis = Vector3::ith(up.iamax(), up[up.iamax()].signum());
    let upright = UnitQuaternion::rotation_between(&(rotation * axis), &Vector3::z())?;
    let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), place.z);
    let rotation = turned * upright * rotation;
    let start = Start {
        pose: Isometry3::from_parts(Vector3::new(place.x, place.y, end).into(), rotation),
        velocity: Vector3::new(rate.x, rate.y, 0.0),
        spin: rotation.inverse() * Vector3::new(0.0, 0.0, rate.z),
    };
    Some((first, start))
}

/// Value and rate at the first row of the parabolas nearest to some rows.
fn parabola(rows: impl ExactSizeIterator<Item = Vector3<f64>>) -> Option<[Vector3<f64>; 2]> {
    let powers = DMatrix::from_fn(rows.len(), 3, |i, j| (i as f64 / RATE).powi(j as i32));
    let inverse = powers.pseudo_inverse(1e-12).ok()?;
    let rows: Vec<Vector3<f64>> = rows.collect();
    let coefficient = |j: usize| {
        let component = |k: usize| {
            let values = DVector::from_iterator(rows.len(), rows.iter().map(|row| row[k]));
            inverse.row(j).transpose().dot(&values)
        };
        Vector3::new(component(0), component(1), component(2))
    };
    Some([coefficient(0), coefficient(1)])
}
