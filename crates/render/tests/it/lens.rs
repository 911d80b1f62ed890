//! Images of a pinhole through a lens, and back.

use nalgebra::{Isometry3, Vector2};
use prehend_geometry::TriMesh;
use prehend_render::{
    BrownConrady, Camera, DepthImage, Distortion, DistortionError, Mask, Remap, RenderModel,
    RgbImage, SurfacePoint, render_scene,
};

const WIDE: [f64; 5] = [-0.31, 0.11, 1.2e-3, -7e-4, -0.02];

#[test]
fn nothing_is_seen_beyond_the_fold() {
    let lens = Distortion::by_name("brown_conrady", &[-0.4, 0.0, 0.0, 0.0]).unwrap();
    let camera = Camera { fx: 10.0, fy: 10.0, cx: 19.5, cy: 0.0, width: 40, height: 1 };
    let made = Remap::undistort(camera, &lens, camera);
    let picture = made.rgb(&RgbImage::filled(40, 1, [1.0; 3])).unwrap();
    // Beyond x = 1.58 the factor is negative, and the derivative positive again.
    assert_eq!([0, 3, 36, 39].map(|x| picture.get(x, 0)), [Some([0.0; 3]); 4]);
    // The fold is at x = 0.913.
    assert_eq!((picture.get(28, 0), picture.get(29, 0)), (Some([1.0; 3]), Some([0.0; 3])));
}

#[test]
fn straight_lines_become_straight() {
    // A photograph of the half-plane 2x + y < 0.1, and of a ramp along x.
    let camera = Camera { fx: 80.0, fy: 82.0, cx: 40.2, cy: 29.7, width: 80, height: 60 };
    let lens = Distortion::by_name("brown_conrady", &WIDE).unwrap();
    let ideal =
        |at: usize| lens.undistort(camera.ray((at % 80) as f64, (at / 80) as f64).xy()).unwrap();
    let count = 80 * 60;
    let ramp = (0..count).map(|at| [0.5 + 0.5 * ideal(at).x as f32; 3]).collect();
    let half = |p: Vector2<f64>| 2.0 * p.x + p.y < 0.1;
    let mask = (0..count).map(|at| half(ideal(at))).collect();
    let depth = (0..count).map(|at| if half(ideal(at)) { 0.4 } else { 0.8 }).collect();
    let made = Remap::undistort(camera, &lens, camera);
    let ramp = made.rgb(&RgbImage::new(80, 60, ramp).unwrap()).unwrap();
    let mask = made.mask(&Mask::new(80, 60, mask).unwrap()).unwrap();
    let depth = made.depth(&DepthImage::new(80, 60, depth).unwrap()).unwrap();
    for y in 4..56 {
        for x in 4..76 {
            let p = camera.ray(x as f64, y as f64).xy();
            let color = ramp.get(x, y).unwrap()[0];
            assert!((color - 0.5 - 0.5 * p.x as f32).abs() < 1e-3, "{x} {y}");
            if (2.0 * p.x + p.y - 0.1).abs() > 0.03 {
                assert_eq!(mask.get(x, y), Some(half(p)));
                let z = if half(p) { 0.4 } else { 0.8 };
                assert!((depth.get(x, y).unwrap() - z).abs() < 1e-6);
            }
        }
    }
}

/// How far bars lean, so that the picture's samples see their edges at all distances.
const LEAN: f64 = 0.2;

/// A wall of bright bars along one axis of the image plane at a depth of 1 m, at these positions there and half as wide as `half`.
fn bars(places: &[f64], half: f64, axis: usize) -> RenderModel {
    let mut mesh = TriMesh::new(Vec::new(), Vec::new());
    for &at in places {
        let first = mesh.vertices.len() as u32;
        for [across, along] in [[-half, -2.0], [half, -2.0], [half, 2.0], [-half, 2.0]] {
            let mut corner = [0.0, 0.0, 1.0];
            (corner[axis], corner[1 - axis]) = (at + across + LEAN * along, along);
            mesh.vertices.push(corner.into());
        }
        mesh.faces.extend([[0, 2, 1], [0, 3, 2]].map(|f| f.map(|v| v + first)));
    }
    RenderModel::new(&mesh).unwrap()
}

/// Largest distance of the bars' edges in the picture from where the lens shows them [px], and how many were looked at.
fn worst_bar(camera: &Camera, lens: &Distortion, axis: usize) -> (f64, usize) {
    let wide = lens.pinhole_that_covers(camera, 4.0);
    let (places, half) = ((-8..=8).map(|i| 0.08 * f64::from(i)).collect::<Vec<_>>(), 0.012);
    let bars = bars(&places, half, axis);
    let white = |_: usize, _: &SurfacePoint<f32>| [1.0; 3];
    let bodies = [(&bars, Isometry3::identity())];
    let (fine, finer) = (wide.scaled(5.0), camera.scaled(5.0));
    let ideal = render_scene(&fine, &bodies, 3, white, |_, _| [0.0; 3]);
    let seen = Remap::distort(fine, finer, lens).rgb(&ideal.color).unwrap().downsampled(5);
    let (mut worst, mut count) = (0.0f64, 0);
    let size = [camera.width, camera.height];
    let (focal, principal) = ([camera.fx, camera.fy], [camera.cx, camera.cy]);
    for line in (4..size[1 - axis] - 4).step_by(3) {
        for &at in &places {
            // Where the edges of the bar cross this line of pixels.
            let crossing = |edge: f64| {
                let other = (line as f64 - principal[1 - axis]) / focal[1 - axis];
                let mut ideal = Vector2::zeros();
                ideal[1 - axis] = other;
                for _ in 0..50 {
                    ideal[axis] = edge + LEAN * ideal[1 - axis];
                    ideal[1 - axis] += other - lens.distort(ideal)[1 - axis];
                }
                focal[axis] * lens.distort(ideal)[axis] + principal[axis]
            };
            let [low, high] = [at - half, at + half].map(crossing);
            let (from, to) = ((low - 4.0).floor(), (high + 4.0).ceil());
            if from < 0.0 || to >= size[axis] as f64 {
                continue;
            }
            // Both edges, by how much of the bar lies on either side of a border between pixels near its middle.
            let middle = (0.5 * (low + high)).round();
            let (mut before, mut after) = (0.0, 0.0);
            for p in from as usize..=to as usize {
                let [x, y] = if axis == 0 { [p, line] } else { [line, p] };
                let value = f64::from(seen.get(x, y).unwrap()[0]);
                *(if (p as f64) < middle { &mut before } else { &mut after }) += value;
            }
            let border = middle - 0.5;
            let errors = [border - before - low, border + after - high];
            worst = errors.iter().fold(worst, |worst, e| worst.max(e.abs()));
            count += 1;
        }
    }
    (worst, count)
}

#[test]
fn a_rendered_grid_is_where_the_lens_shows_it() {
    let camera = Camera { fx: 300.0, fy: 302.0, cx: 161.3, cy: 118.2, width: 320, height: 240 };
    for (name, coefficients) in
        [("brown_conrady", WIDE.as_slice()), ("kannala_brandt", &[0.02, -0.01, 0.002, 0.0])]
    {
        let lens = Distortion::by_name(name, coefficients).unwrap();
        for axis in 0..2 {
            let (worst, count) = worst_bar(&camera, &lens, axis);
            println!("{name}, axis {axis}: {worst:.4} px at most in {count} places");
            assert!(count > 500 && worst < 0.02, "{name}, axis {axis}: {worst} of {count}");
        }
    }
}

#[test]
fn planes_keep_their_depth() {
    let camera = Camera { fx: 80.0, fy: 82.0, cx: 40.2, cy: 29.7, width: 80, height: 60 };
    let lens = Distortion::by_name("brown_conrady", &WIDE).unwrap();
    let wide = lens.pinhole_that_covers(&camera, 4.0);
    let plane = |ray: Vector2<f64>| 0.4 / (1.0 + 0.1 * ray.x - 0.07 * ray.y);
    let ideal = (0..wide.width * wide.height)
        .map(|at| plane(wide.ray((at % wide.width) as f64, (at / wide.width) as f64).xy()) as f32);
    let ideal = DepthImage::new(wide.width, wide.height, ideal.collect()).unwrap();
    let seen = Remap::distort(wide, camera, &lens).depth(&ideal).unwrap();
    let back = Remap::undistort(camera, &lens, camera).depth(&seen).unwrap();
    for (at, z) in back.pixels().iter().enumerate() {
        let ray = camera.ray((at % 80) as f64, (at / 80) as f64).xy();
        let place = lens.distort(ray);
        let [u, v] = [camera.fx * place.x + camera.cx, camera.fy * place.y + camera.cy];
        // Elsewhere it is that of the border.
        if (0.0..79.0).contains(&u) && (0.0..59.0).contains(&v) {
            let error = f64::from(*z) - plane(ray);
            assert!(error.abs() < 1e-5, "{at}: {error}");
        }
    }
}

#[test]
fn images_of_another_size_are_refused() {
    let camera = Camera { fx: 8.0, fy: 8.0, cx: 4.0, cy: 3.0, width: 8, height: 6 };
    let made = Remap::undistort(camera, &Distortion::BrownConrady(BrownConrady::default()), camera);
    let wrong = made.rgb(&RgbImage::filled(8, 7, [0.0; 3]));
    assert!(matches!(wrong, Err(DistortionError::Size { found_height: 7, .. })));
}
