//! Prints of the cartons and of the foam brick.

use crate::shapes::BoxFace;

use super::forms::Form;
use super::paint::{Area, Canvas, hash};

/// The part of `area` between fractions of its width and height.
pub(super) fn part([x0, y0, x1, y1]: Area, [a, b, c, d]: Area) -> Area {
    let (w, h) = (x1 - x0, y1 - y0);
    [x0 + a * w, y0 + b * h, x0 + c * w, y0 + d * h]
}

/// A white plate of ruled lines, dark headed, like a table of contents.
pub(super) fn facts(canvas: &mut Canvas, area: Area, ink: u32, seed: u64) {
    canvas.plate(area, 1.5, 0xffffff);
    canvas.text(part(area, [0.08, 0.84, 0.92, 0.96]), "FACTS", ink);
    canvas.rectangle(part(area, [0.06, 0.79, 0.94, 0.82]), ink);
    canvas.small_print(part(area, [0.08, 0.06, 0.92, 0.76]), 9, seed, ink);
}

pub(super) fn sugar(canvas: &mut Canvas, form: &Form) {
    const NAVY: u32 = 0x17307a;
    let [width, _] = form.sheet();
    canvas.rectangle([0.0, 0.0, width, 26.0], NAVY);
    canvas.rectangle([0.0, 26.0, width, 28.5], 0xffffff);
    canvas.rectangle([0.0, 150.0, width, 175.0], 0xfffaf0);
    canvas.rectangle([0.0, 147.0, width, 150.0], NAVY);

    let front = form.face(BoxFace::Front);
    canvas.ellipse(part(front, [0.04, 0.37, 0.96, 0.76]), NAVY);
    canvas.ellipse(part(front, [0.07, 0.385, 0.93, 0.745]), 0xffffff);
    canvas.text(part(front, [0.13, 0.50, 0.87, 0.64]), "SUGAR", NAVY);
    canvas.text(part(front, [0.28, 0.655, 0.72, 0.695]), "PURE CANE", 0xd2232a);
    canvas.rectangle(part(front, [0.25, 0.455, 0.75, 0.465]), 0xd2232a);
    canvas.text(part(front, [0.12, 0.885, 0.88, 0.965]), "GOLDEN", 0xd2232a);
    for (k, color) in [0xffffff, 0xf4f0e6, 0xffffff].into_iter().enumerate() {
        let x = front[0] + 22.0 + 15.0 * k as f64;
        canvas.plate([x, 30.0, x + 13.0, 43.0], 1.5, 0xd9a516);
        canvas.plate([x + 1.0, 31.0, x + 13.0, 43.0], 1.5, color);
    }
    canvas.text(part(front, [0.1, 0.05, 0.62, 0.11]), "GRANULATED", 0xffffff);

    let back = form.face(BoxFace::Back);
    canvas.plate(part(back, [0.08, 0.2, 0.92, 0.82]), 3.0, 0xffffff);
    canvas.text(part(back, [0.14, 0.72, 0.86, 0.79]), "SWEET IDEAS", 0xd2232a);
    canvas.small_print(part(back, [0.14, 0.24, 0.62, 0.69]), 14, 4, NAVY);
    canvas.disc([back[2] - 22.0, 72.0], 11.0, 0xf0a830);
    canvas.disc([back[2] - 22.0, 72.0], 7.5, 0x8a4b1c);
    canvas.text(part(back, [0.3, 0.89, 0.7, 0.95]), "GOLDEN", NAVY);

    let right = form.face(BoxFace::Right);
    facts(canvas, part(right, [0.12, 0.36, 0.88, 0.8]), NAVY, 5);
    canvas.bar_code(part(right, [0.14, 0.19, 0.86, 0.31]), 6);
    let left = form.face(BoxFace::Left);
    canvas.stripes(part(left, [0.0, 0.163, 1.0, 0.84]), 13.0, 1.0, 0xd2232a);
    canvas.plate(part(left, [0.08, 0.42, 0.92, 0.6]), 2.0, 0xffffff);
    canvas.text(part(left, [0.14, 0.45, 0.86, 0.57]), "SUGAR", NAVY);

    canvas.rectangle(form.face(BoxFace::Top), 0xfffaf0);
    canvas.text(part(form.face(BoxFace::Top), [0.15, 0.3, 0.85, 0.7]), "OPEN", NAVY);
    canvas.rectangle(form.face(BoxFace::Bottom), NAVY);
    canvas.small_print(part(form.face(BoxFace::Bottom), [0.2, 0.3, 0.8, 0.7]), 3, 7, 0xffffff);
}

pub(super) fn pudding(canvas: &mut Canvas, form: &Form) {
    const CREAM: u32 = 0xf9ead0;
    const GOLD: u32 = 0xe0a536;
    let [width, _] = form.sheet();
    canvas.rectangle([0.0, 4.0, width, 6.0], GOLD);

    let top = form.face(BoxFace::Top);
    let [x0, y0, x1, _] = top;
    canvas.shape(top, CREAM, |x, y| y - y0 < 30.0 + 5.0 * ((x - x0) / (x1 - x0) * 9.0).sin());
    // A glass of pudding under a swirl of cream, seen from the side.
    let (cx, cy) = (x0 + 77.0, y0 + 30.0);
    canvas.ellipse([cx - 27.0, cy - 25.0, cx + 27.0, cy - 16.0], 0xd9c7a6);
    canvas.shape([cx - 25.0, cy - 22.0, cx + 25.0, cy + 10.0], 0x7a3d1d, |x, y| {
        let depth = (cy + 10.0 - y) / 32.0;
        (x - cx).abs() < 25.0 * (1.0 - depth * depth).max(0.0).sqrt()
    });
    canvas.ellipse([cx - 25.0, cy + 5.0, cx + 25.0, cy + 15.0], 0x8d4a25);
    for (dy, half) in [(12.0, 14.0), (17.0, 10.0), (21.5, 6.0)] {
        canvas.ellipse([cx - half, cy + dy - 4.5, cx + half, cy + dy + 4.5], 0xe8d5b0);
        canvas.ellipse([cx - half, cy + dy - 3.2, cx + half - 1.0, cy + dy + 4.5], 0xffffff);
    }
    canvas.disc([cx + 1.0, cy + 27.5], 3.4, 0xc4182b);
    canvas.text(part(top, [0.06, 0.76, 0.94, 0.95]), "PUDDING", CREAM);
    canvas.text(part(top, [0.06, 0.62, 0.5, 0.71]), "CHOCOLATE", GOLD);
    canvas.plate(part(top, [0.06, 0.06, 0.38, 0.24]), 2.0, 0xc4182b);
    canvas.text(part(top, [0.09, 0.1, 0.35, 0.2]), "COOK", 0xffffff);
    canvas.star([x0 + 24.0, y0 + 42.0], [7.0, 12.0], 10, GOLD);

    for (face, text) in [(BoxFace::Front, "PUDDING"), (BoxFace::Back, "CHOCOLATE")] {
        canvas.text(part(form.face(face), [0.1, 0.35, 0.62, 0.8]), text, CREAM);
    }
    canvas.bar_code(part(form.face(BoxFace::Back), [0.7, 0.3, 0.95, 0.85]), 8);
    canvas.disc([form.face(BoxFace::Front)[2] - 18.0, 20.0], 9.0, 0xc4182b);
    canvas.rectangle(part(form.face(BoxFace::Right), [0.0, 0.2, 1.0, 1.0]), CREAM);
    canvas.small_print(part(form.face(BoxFace::Right), [0.08, 0.28, 0.92, 0.9]), 6, 9, 0x5b2c17);
    canvas.stripes(part(form.face(BoxFace::Left), [0.0, 0.2, 1.0, 1.0]), 12.0, 0.6, GOLD);
    let bottom = form.face(BoxFace::Bottom);
    canvas.rectangle(bottom, CREAM);
    canvas.text(part(bottom, [0.08, 0.8, 0.6, 0.92]), "EASY", 0xc4182b);
    canvas.small_print(part(bottom, [0.08, 0.1, 0.55, 0.74]), 11, 10, 0x5b2c17);
    facts(canvas, part(bottom, [0.62, 0.12, 0.94, 0.9]), 0x5b2c17, 11);
}

pub(super) fn gelatin(canvas: &mut Canvas, form: &Form) {
    const PINK: u32 = 0xffd3da;
    const RED: u32 = 0xd3133a;
    let top = form.face(BoxFace::Top);
    let [x0, y0, x1, y1] = top;
    canvas.shape(top, PINK, |x, y| (x - x0) / (x1 - x0) + (y - y0) / (y1 - y0) < 1.2);
    canvas.plate(part(top, [0.05, 0.66, 0.95, 0.94]), 3.0, 0xffffff);
    canvas.text(part(top, [0.1, 0.71, 0.9, 0.89]), "GELATIN", RED);
    canvas.text(part(top, [0.47, 0.06, 0.96, 0.16]), "STRAWBERRY", RED);
    for (fx, fy, r) in [(0.24, 0.36, 13.0), (0.55, 0.46, 9.0), (0.36, 0.12, 6.5)] {
        let (cx, cy) = (x0 + fx * (x1 - x0), y0 + fy * (y1 - y0));
        canvas.shape([cx - r, cy - 1.3 * r, cx + r, cy + r], 0xb30c2c, |x, y| {
            let (u, v) = ((x - cx) / r, (y - cy) / r);
            u.abs() < 0.95 * (1.0 - v).max(0.0).sqrt() * (1.3 + v).max(0.0).sqrt() * 0.85
        });
        for k in 0..12 {
            let (u, v) = (hash(3, k, 0) - 0.5, hash(3, k, 1) - 0.62);
            canvas.disc([cx + 1.2 * r * u, cy + 1.3 * r * v], 0.05 * r, 0xffe08a);
        }
        canvas.star([cx, cy + 0.85 * r], [0.15 * r, 0.6 * r], 6, 0x2f8f3a);
    }

    let [width, _] = form.sheet();
    canvas.rectangle([0.0, 0.0, width, 5.0], 0x2f8f3a);
    canvas.text(part(form.face(BoxFace::Front), [0.08, 0.35, 0.7, 0.85]), "GELATIN", 0xffffff);
    canvas.disc([form.face(BoxFace::Front)[2] - 13.0, 16.0], 8.0, PINK);
    canvas.rectangle(part(form.face(BoxFace::Right), [0.0, 0.18, 1.0, 1.0]), 0xffffff);
    canvas.small_print(part(form.face(BoxFace::Right), [0.08, 0.26, 0.92, 0.92]), 5, 12, RED);
    canvas.bar_code(part(form.face(BoxFace::Back), [0.06, 0.3, 0.4, 0.9]), 13);
    canvas.text(part(form.face(BoxFace::Back), [0.48, 0.4, 0.94, 0.8]), "FRUIT", PINK);
    canvas.stripes(part(form.face(BoxFace::Left), [0.0, 0.18, 1.0, 1.0]), 9.0, -0.8, PINK);
    let bottom = form.face(BoxFace::Bottom);
    canvas.rectangle(bottom, PINK);
    facts(canvas, part(bottom, [0.06, 0.1, 0.46, 0.9]), RED, 14);
    canvas.small_print(part(bottom, [0.53, 0.15, 0.94, 0.85]), 10, 15, RED);
}

pub(super) fn foam(canvas: &mut Canvas, form: &Form) {
    let [width, height] = form.sheet();
    let all = [0.0, 0.0, width, height];
    canvas.grain(all, 7.0, 0.12, 1);
    canvas.grain(all, 1.6, 0.10, 2);
    for k in 0..420 {
        let center = [hash(16, k, 0) * width, hash(16, k, 1) * height];
        let color = if hash(16, k, 3) < 0.7 { 0x7f2f20 } else { 0xc8694f };
        canvas.disc(center, 0.3 + 0.7 * hash(16, k, 2).powi(3), color);
    }
    // Stencilled marks, another on each side.
    let mark = |face| form.face(face);
    canvas.text(part(mark(BoxFace::Front), [0.12, 0.3, 0.88, 0.7]), "FOAM", 0xf3e3d3);
    canvas.stripes(part(mark(BoxFace::Right), [0.0, 0.1, 1.0, 0.32]), 12.0, 1.0, 0xf2b632);
    canvas.disc([mark(BoxFace::Right)[0] + 25.0, 33.0], 9.0, 0xf3e3d3);
    canvas.text(part(mark(BoxFace::Back), [0.12, 0.34, 0.6, 0.66]), "SOFT", 0x4d1a12);
    canvas.plate(part(mark(BoxFace::Back), [0.7, 0.3, 0.9, 0.7]), 2.0, 0x2c5f8a);
    canvas.star([mark(BoxFace::Left)[0] + 25.0, 25.0], [8.0, 16.0], 5, 0xf2b632);
    canvas.plate(part(mark(BoxFace::Top), [0.08, 0.14, 0.92, 0.3]), 2.0, 0x2c5f8a);
    canvas.text(part(mark(BoxFace::Top), [0.16, 0.42, 0.84, 0.82]), "BRICK", 0xf3e3d3);
    canvas.disc([mark(BoxFace::Bottom)[0] + 20.0, mark(BoxFace::Bottom)[1] + 25.0], 10.0, 0x4d1a12);
}
