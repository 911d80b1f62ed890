//! Discrete decisions of the contour mode.

use super::super::contour::{Contours, Decision};
use super::*;
use crate::contour::{Inner, Piece};

/// Discrete decisions about a pixel. None where the nearest point of a contour is the end of a piece within an edge: there the
/// visibility of the contour changes. None on faces seen within 3 degrees of their plane, whose colors are too steep for
/// finite differences.
pub(super) fn decision(frame: &Frame, contours: &Contours, place: Place) -> Option<Vec<u32>> {
    let Decision { face, edge, inner, crease } = contours.decision(place.block, place.i);
    let (x, y) = (place.x as f32, place.y as f32);
    let ends_here = |piece: &Piece| {
        let t = piece.foot(glam::vec2(x, y)).t;
        let [low, high] = piece.range;
        (low > 0.0 && t <= low) || (high < 1.0 && t >= high)
    };
    let grazes = |face: u32| {
        let [a, b, c] = frame.corners(face as usize);
        let ray = frame.camera.ray(f64::from(x), f64::from(y));
        ray.normalize().dot(&(b - a).cross(&(c - a)).normalize()).abs() < 0.05
    };
    let fold = crease.map(|(crease, _)| &crease.piece);
    let pieces = [edge, inner.map(|inner| &inner.piece), fold].into_iter().flatten();
    let own = face.map(|face| face as u32);
    let behind = inner.map(|inner| inner.behind);
    if pieces.clone().any(ends_here) || own.into_iter().chain(behind.map(|b| b.1)).any(grazes) {
        return None;
    }
    let ids = |piece: &Piece| [piece.face, u32::from(piece.corners[0])];
    let mut out = vec![u32::from(edge.is_some()), u32::from(inner.is_some())];
    out.extend(crease.map(|(_, side)| u32::from(side > 0.0)));
    out.extend(own);
    out.extend(pieces.flat_map(ids));
    out.extend(behind.map(|(at, face, _)| [at.x as u32, at.y as u32, face]).into_iter().flatten());
    Some(out)
}

/// The border where one object stands on another is a contour, although there is no step of depth.
#[test]
fn where_objects_touch_they_blend() {
    let (small, large) = (cuboid(Vector3::repeat(0.06)), cuboid(Vector3::new(0.3, 0.04, 0.3)));
    let model = |mesh: &TriMesh| Arc::new(RenderModel::new(mesh).unwrap());
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.5, 0.0, 0.0))
        * UnitQuaternion::from_scaled_axis(Vector3::y() * 0.6);
    let table = Isometry3::from_parts(Translation3::new(0.0, 0.03, 0.4), turn);
    // y is down: the small box stands on the large one.
    let scene = Scene::new(camera())
        .with(model(&small), table * Translation3::new(0.0, -0.05, 0.0))
        .with(model(&large), table);
    let rendering = Renderer::new(Light::headlight(0.4, 0.6)).render(&scene);
    let Visible::Contour(contours) = &rendering.visible else { panic!("the default mode") };
    let frame = &rendering.frame;
    let at_floor = |inner: &&Inner| {
        let corners = frame.corners(inner.piece.face as usize);
        let ends = inner.piece.corners.map(|c| table.inverse() * Point3::from(corners[c as usize]));
        ends.iter().all(|p| (p.y + 0.02).abs() < 1e-6)
    };
    let floor: Vec<&Inner> = contours.inner.iter().filter(at_floor).collect();
    let length = |inner: &&Inner| {
        let Piece { a, b, range, .. } = inner.piece;
        (b[0] - a[0]).hypot(b[1] - a[1]) * (range[1] - range[0])
    };
    let shown: f32 = floor.iter().map(length).sum();
    // Two edges of the small box's lower face are seen.
    let camera = camera();
    let corner = |x: f64, z: f64| camera.project(&(table * Point3::new(x, -0.02, z))).unwrap();
    let corners =
        [(-0.03, -0.03), (0.03, -0.03), (0.03, 0.03), (-0.03, 0.03)].map(|(x, z)| corner(x, z));
    let mut edges = [0, 1, 2, 3].map(|i| (i, (corners[(i + 1) % 4] - corners[i]).norm()));
    let low = |i: usize| corners[i].y + corners[(i + 1) % 4].y;
    edges.sort_by(|a, b| low(b.0).total_cmp(&low(a.0)));
    let expected = (edges[0].1 + edges[1].1) as f32;
    assert!((shown - expected).abs() < 0.1 * expected, "{shown} of {expected} px");
}
