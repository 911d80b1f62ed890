use super::truth::*;
use super::*;
use crate::contour::ContourView;
use crate::projected::Region;
use crate::model::{Albedo, NONE};
use crate::scene::{SceneObject, render_scene};
use prehend_geometry::objects::YcbObject;

fn segment_distance(a: [f32; 3], b: [f32; 3], x: f32, y: f32) -> (f32, f32) {
    let d = [b[0] - a[0], b[1] - a[1]];
    let r = [x - a[0], y - a[1]];
    let l = d[0] * d[0] + d[1] * d[1];
    let t = if l > 0.0 { ((r[0] * d[0] + r[1] * d[1]) / l).clamp(0.0, 1.0) } else { 0.0 };
    let o = [r[0] - t * d[0], r[1] - t * d[1]];
    ((o[0] * o[0] + o[1] * o[1]).sqrt(), a[2] + t * (b[2] - a[2]))
}

fn study(name: &str, scene: &Scene, truth: &Isometry3<f64>, guess: &Isometry3<f64>, samples: usize, rays: usize) {
    let (model, light, camera) = (scene.model, &scene.light, scene.camera);
    let center = truth * model.center();
    let (w, h) = (camera.width, camera.height);
    let picture = |pose: &Isometry3<f64>| {
        render_scene(&camera, &[SceneObject { model, t_cam_model: *pose }], light, [0.0; 3], rays).color
    };
    let seen = picture(truth);
    let mask = seen.pixels().iter().map(|c| *c != [0.0; 3]).collect();
    let target = Target::new(camera, &seen, &Mask::new(w, h, mask).unwrap()).unwrap();
    let pixel = guess.translation.vector.z / camera.fx;
    let radius = model.radius();
    let mut true_rows = vec![[0.0f64; 6]; w * h];
    for axis in 0..6 {
        let scale = if axis < 3 { 1.0 } else { 1.0 / radius };
        let step = 0.1 * pixel * scale;
        let [p, m] = [1.0, -1.0].map(|s| picture(&twisted(guess, &center, &unit(axis, s * step))));
        for i in 0..w * h {
            let e = |q: &RgbImage| (0..3).map(|k| f64::from(q.pixels()[i][k] - seen.pixels()[i][k]).powi(2)).sum::<f64>();
            true_rows[i][axis] = (e(&p) - e(&m)) / (2.0 * step) * scale * target.normalisation;
        }
    }
    let options = ContourOptions { half_width: 0.645, creases: std::env::var("CREASES").is_ok() };
    let fine = camera.scaled(samples as f64);
    let view = ContourView::new(&options.finer(samples), model, guess, &center, &fine, light, &Region::EMPTY.union(&target.bounds).scaled(samples));
    let mut ours = vec![[0.0f64; 6]; w * h];
    {
        let mut each = |x: usize, y: usize, s: Option<Seen>| {
            let Some(s) = s else { return };
            let at = y * w + x;
            for k in 0..3 {
                let r = (s.pixel.color[k] - target.color[at][k]) as f64;
                for i in 0..6 {
                    let scale = if i < 3 { 1.0 } else { 1.0 / radius };
                    ours[at][i] += 2.0 * r * s.pixel.color_rows[k][i] as f64 * scale * target.normalisation;
                }
            }
        };
        if samples == 1 {
            for b in 0..View::blocks(&view) { view.visit::<true>(b, &mut each); }
        } else {
            let a = averaged::Averaged::new(view, samples);
            for b in 0..View::blocks(&a) { a.visit::<true>(b, &mut each); }
        }
    }
    // Classes, at one sample.
    let view = ContourView::new(&options, model, guess, &center, &camera, light, &target.bounds);
    let posed = &view.scene.posed;
    let mut class = vec![0usize; w * h];
    let mut depth = vec![0.0f32; w * h];
    for v in &view.visible {
        for (i, &f) in v.face.iter().enumerate() {
            if f == crate::raster::MISS { continue; }
            let (x, y) = v.position(i);
            depth[y * w + x] = v.inverse_z[i];
            let ids = model.faces[f as usize].map(|k| posed.position[k as usize]);
            let n = (ids[1] - ids[0]).cross(&(ids[2] - ids[0])).normalize();
            let cos = n.dot(&ids[0].normalize()).abs();
            class[y * w + x] = if cos < 0.3 { 2 } else { 1 };
        }
    }
    let mut mark = |a: [f32; 3], b: [f32; 3], c: usize, reach: f32, check: bool| {
        let (x0, x1) = ((a[0].min(b[0]) - reach).max(0.0) as usize, (a[0].max(b[0]) + reach + 1.0).clamp(0.0, w as f32 - 1.0) as usize);
        let (y0, y1) = ((a[1].min(b[1]) - reach).max(0.0) as usize, (a[1].max(b[1]) + reach + 1.0).clamp(0.0, h as f32 - 1.0) as usize);
        for y in y0..=y1 { for x in x0..=x1 {
            let (d, iz) = segment_distance(a, b, x as f32, y as f32);
            if d > reach || class[y * w + x] > c { continue; }
            if check && (depth[y * w + x] == 0.0 || (1.0 / iz - 1.0 / depth[y * w + x]) > 0.03 * radius as f32) { continue; }
            class[y * w + x] = c;
        }}
    };
    for e in &model.edges {
        if e.other == NONE { continue; }
        let (f, g) = (e.face as usize, e.other as usize);
        if posed.projected.facing[f] != 1 || posed.projected.facing[g] != 1 { continue; }
        let (a, b) = (e.corner as usize, (e.corner as usize + 1) % 3);
        let (c, d) = ((e.other_corner as usize + 1) % 3, e.other_corner as usize);
        let n = &model.normals;
        let flat = n[f][a].dot(&n[g][c]).min(n[f][b].dot(&n[g][d])) < 0.999;
        let jump = match &model.albedo {
            Albedo::Texture(_, uv) => uv[f][a] != uv[g][c] || uv[f][b] != uv[g][d],
            Albedo::Corners(cs) => cs[f][a] != cs[g][c] || cs[f][b] != cs[g][d],
            _ => false,
        };
        let [p, q] = e.vertices.map(|v| posed.projected.screen[v as usize]);
        if flat { mark(p, q, 4, 1.2, true); } else if jump { mark(p, q, 3, 1.2, true); }
    }
    let ends = |p: &crate::contour::Piece| {
        let at = |t: f32| [p.a[0] + t * (p.b[0] - p.a[0]), p.a[1] + t * (p.b[1] - p.a[1]), 0.0];
        (at(p.range[0]), at(p.range[1]))
    };
    for p in &view.inner { let (a, b) = ends(&p.piece); mark(a, b, 5, 1.7, false); }
    for p in &view.pieces { let (a, b) = ends(p); mark(a, b, 6, 1.7, false); }
    let names = ["nothing", "flat", "grazing", "seam", "crease", "inner", "outline"];
    let mut total = [0.0f64; 6];
    let mut all_ours = [0.0f64; 6];
    let mut by = [[0.0f64; 6]; 7];
    let mut count = [0usize; 7];
    for i in 0..w * h {
        count[class[i]] += 1;
        for k in 0..6 { total[k] += true_rows[i][k]; all_ours[k] += ours[i][k]; by[class[i]][k] += ours[i][k] - true_rows[i][k]; }
    }
    let norm = |v: &[f64; 6]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let n = norm(&total);
    let err: [f64; 6] = std::array::from_fn(|k| all_ours[k] - total[k]);
    print!("{name:34} s{samples} {:5.2} |", 100.0 * norm(&err) / n);
    for c in 0..7 { print!(" {} {:.2} ({})", names[c], 100.0 * norm(&by[c]) / n, count[c]); }
    println!();
    if std::env::var("TOP").is_ok() {
        let mut order: Vec<usize> = (0..w * h).collect();
        let e = |i: usize| norm(&std::array::from_fn(|k| ours[i][k] - true_rows[i][k]));
        order.sort_by(|a, b| e(*b).total_cmp(&e(*a)));
        for &i in &order[..16] {
            let f = |v: &[f64; 6]| v.iter().map(|x| format!("{:7.2}", 100.0 * x / n)).collect::<String>();
            println!("   {} {} class {} err {:.2}: ours {} true {}", i % w, i / w, names[class[i]], 100.0 * e(i) / n, f(&ours[i]), f(&true_rows[i]));
        }
        println!("   sum err {:?}", err.map(|e| (1e4 * e / n).round() / 100.0));
    }
}

#[test]
#[ignore = "a study"]
fn whence_errors_come() {
    let rays = std::env::var("RAYS").map_or(11, |v| v.parse().unwrap());
    let samples: Vec<usize> = std::env::var("SAMPLES").map_or(vec![1, 4], |v| v.split(',').map(|v| v.parse().unwrap()).collect());
    let objects = [YcbObject::MustardBottle, YcbObject::SugarBox, YcbObject::TomatoSoupCan, YcbObject::PottedMeatCan, YcbObject::BleachCleanser];
    let only = std::env::var("ONLY").unwrap_or_default();
    let mut cases: Vec<(String, RenderModel, Light)> = Vec::new();
    for o in objects {
        let m = RenderModel::new(&o.mesh()).unwrap();
        cases.push((format!("outline {}", o.name()), m.clone().with_uniform_color([0.8, 0.6, 0.7]), Light::ambient(0.9)));
        cases.push((format!("shading {}", o.name()), m.clone().with_uniform_color([0.8, 0.6, 0.7]), lamp()));
        cases.push((format!("print {}", o.name()), m, Light::ambient(0.9)));
    }
    for o in ["000005", "000006", "000021"] {
        let data = std::path::PathBuf::from(std::env::var_os("PREHEND_DATA").unwrap());
        let mesh = TriMesh::load(&data.join(format!("mujoco/models/obj_{o}.ply"))).unwrap();
        let m = RenderModel::new(&mesh.scaled(1e-3)).unwrap();
        println!("{o} closed {} faces {} kind {}", m.is_closed(), m.face_count(), match &m.albedo { Albedo::Texture(..) => "texture", Albedo::Corners(_) => "corners", _ => "one" });
        cases.push((format!("scan {o}"), m.clone(), lamp()));
        cases.push((format!("print-scan {o}"), m.clone(), Light::ambient(0.9)));
        cases.push((format!("shade-scan {o}"), m.with_uniform_color([0.8, 0.6, 0.7]), lamp()));
    }
    for (name, model, light) in cases {
        if !name.contains(&only) { continue; }
        for camera in cameras() {
            let [truth, guess] = pair(&model, &camera, 70);
            let scene = Scene { model: &model, light, camera };
            for s in &samples { study(&format!("{name} {}", camera.width), &scene, &truth, &guess, *s, rays); }
        }
    }
}
