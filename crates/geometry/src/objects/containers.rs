//! Prints of the tins and bottles. The front is a quarter of the girth along the sheet, the back three quarters.

use super::cartons::{facts, part};
use super::forms::Form;
use super::paint::{Area, Canvas, hash};

/// The area between two heights \[mm\] and two fractions of the girth.
fn wall(form: &Form, [low, high]: [f64; 2], [from, to]: [f64; 2]) -> Area {
    let girth = form.sheet()[0];
    [from * girth, form.level(low), to * girth, form.level(high)]
}

/// Metal lids: rings of light and shade on the sheet outside `label`, and a stamp.
fn lids(canvas: &mut Canvas, form: &Form, label: Area) {
    let [width, height] = form.sheet();
    for k in 0..(height / 2.5) as i64 {
        let y = 2.5 * k as f64;
        if y + 2.5 < label[1] || y > label[3] {
            let shade = (165.0 + 70.0 * hash(20, k, 0)) as u32;
            canvas.rectangle([0.0, y, width, y + 2.5], (shade << 16) | (shade << 8) | (shade + 8));
        }
    }
    // A tab across one sector of the top, and a colored dot on the bottom, break the symmetry of the lids.
    canvas.rectangle([0.12 * width, height - 24.0, 0.30 * width, height], 0x7d8288);
    canvas.rectangle([0.55 * width, 4.0, 0.72 * width, 18.0], 0x4a5058);
}

pub(super) fn soup(canvas: &mut Canvas, form: &Form) {
    const RED: u32 = 0xc8161d;
    const CREAM: u32 = 0xfbf3e4;
    const GOLD: u32 = 0xd9a441;
    let label = wall(form, [4.0, 98.0], [0.0, 1.0]);
    lids(canvas, form, label);
    canvas.rectangle(label, CREAM);
    canvas.rectangle(part(label, [0.0, 0.52, 1.0, 1.0]), RED);
    canvas.rectangle(part(label, [0.0, 0.5, 1.0, 0.53]), GOLD);
    canvas.rectangle(part(label, [0.0, 0.03, 1.0, 0.05]), GOLD);

    let [girth, middle] = [form.sheet()[0], 0.5 * (label[1] + label[3])];
    let front = girth / 4.0;
    canvas.text(part(label, [0.11, 0.72, 0.39, 0.92]), "TOMATO", 0xffffff);
    canvas.star([front, middle + 2.0], [14.5, 16.0], 28, GOLD);
    canvas.disc([front, middle + 2.0], 13.0, CREAM);
    canvas.disc([front, middle + 1.0], 9.0, 0xdf2b20);
    canvas.disc([front - 3.0, middle + 4.0], 2.2, 0xf37a5f);
    canvas.star([front, middle + 9.0], [1.6, 6.5], 5, 0x2e8b3d);
    canvas.text(part(label, [0.13, 0.1, 0.37, 0.3]), "SOUP", RED);

    canvas.text(part(label, [0.62, 0.75, 0.88, 0.88]), "KITCHEN", CREAM);
    canvas.small_print(part(label, [0.55, 0.1, 0.72, 0.46]), 9, 21, 0x5a1512);
    facts(canvas, part(label, [0.75, 0.09, 0.93, 0.47]), 0x3a1010, 22);
    canvas.bar_code(part(label, [0.63, 0.57, 0.85, 0.7]), 23);
}

pub(super) fn tuna(canvas: &mut Canvas, form: &Form) {
    const BLUE: u32 = 0x1256a3;
    let label = wall(form, [7.5, 29.5], [0.0, 1.0]);
    lids(canvas, form, label);
    canvas.rectangle(label, BLUE);
    canvas.shape(label, 0x37a6dd, |x, y| {
        (y - label[1]) < 6.5 + 1.6 * (x / label[2] * std::f64::consts::TAU * 9.0).sin()
    });
    canvas.rectangle(part(label, [0.0, 0.92, 1.0, 1.0]), 0xf6d34c);
    let girth = form.sheet()[0];
    let middle = 0.5 * (label[1] + label[3]);
    canvas.plate(part(label, [0.13, 0.14, 0.33, 0.88]), 3.0, 0xffffff);
    canvas.text(part(label, [0.145, 0.24, 0.315, 0.8]), "TUNA", BLUE);
    // A fish beside the name.
    let x = 0.43 * girth;
    canvas.ellipse([x - 15.0, middle - 5.0, x + 15.0, middle + 6.5], 0xe8eef2);
    canvas.shape([x + 11.0, middle - 6.0, x + 23.0, middle + 7.5], 0xe8eef2, |px, py| {
        (py - middle - 0.7).abs() < 0.55 * (px - x - 10.0)
    });
    canvas.shape([x - 15.0, middle, x + 15.0, middle + 6.5], 0x7f9db5, |px, py| {
        let (u, v) = ((px - x) / 15.0, (py - middle - 0.7) / 5.75);
        u * u + v * v < 1.0 && v > 0.45
    });
    canvas.disc([x - 10.0, middle + 1.5], 1.1, 0x10243a);
    facts(canvas, part(label, [0.60, 0.08, 0.72, 0.9]), BLUE, 24);
    canvas.small_print(part(label, [0.75, 0.2, 0.88, 0.86]), 6, 25, 0xffffff);
    canvas.bar_code(part(label, [0.91, 0.15, 0.99, 0.85]), 26);
    // The lid carries the name's colors too: a blue ring and a yellow sector.
    let top = form.sheet()[1];
    canvas.rectangle([0.0, top - 34.0, girth, top - 20.0], BLUE);
    canvas.rectangle([0.0, top - 34.0, 0.25 * girth, top - 20.0], 0xf6d34c);
}

pub(super) fn potted_meat(canvas: &mut Canvas, form: &Form) {
    const BLUE: u32 = 0x1b2f86;
    const YELLOW: u32 = 0xffcf24;
    let label = wall(form, [4.5, 77.5], [0.0, 1.0]);
    lids(canvas, form, label);
    canvas.rectangle(label, BLUE);
    canvas.rectangle(part(label, [0.0, 0.0, 1.0, 0.10]), YELLOW);
    canvas.rectangle(part(label, [0.0, 0.10, 1.0, 0.125]), 0xc4202c);

    canvas.text(part(label, [0.09, 0.62, 0.41, 0.92]), "LUNCH", YELLOW);
    canvas.plate(part(label, [0.07, 0.18, 0.43, 0.56]), 5.0, 0xf7e9d2);
    let plate = part(label, [0.07, 0.18, 0.43, 0.56]);
    let (x, y) = (0.5 * (plate[0] + plate[2]), 0.5 * (plate[1] + plate[3]));
    canvas.ellipse([x - 40.0, y - 11.0, x + 14.0, y + 9.0], 0xffffff);
    for k in 0..3 {
        let left = x - 33.0 + 12.0 * f64::from(k);
        canvas.plate([left, y - 7.0, left + 17.0, y + 9.0], 4.0, 0xc66a63);
        canvas.plate([left + 1.0, y - 6.0, left + 16.0, y + 8.0], 3.5, 0xee9c92);
    }
    canvas.star([x + 6.0, y - 6.0], [2.0, 7.0], 6, 0x3a9a43);
    canvas.text([x + 15.0, y - 5.0, plate[2] - 2.0, y + 6.0], "MEAT", 0xc4202c);

    canvas.text(part(label, [0.57, 0.72, 0.755, 0.88]), "CLASSIC", 0xffffff);
    canvas.small_print(part(label, [0.56, 0.2, 0.74, 0.64]), 9, 27, 0xdfe5ff);
    facts(canvas, part(label, [0.78, 0.2, 0.93, 0.88]), BLUE, 28);
    canvas.bar_code(part(label, [0.465, 0.3, 0.535, 0.7]), 29);
}

pub(super) fn mustard(canvas: &mut Canvas, form: &Form) {
    const YELLOW: u32 = 0xf6c21a;
    const RED: u32 = 0xcf1f25;
    const GREEN: u32 = 0x1f7a3a;
    let [width, height] = form.sheet();
    let front = wall(form, [18.0, 118.0], [0.03, 0.47]);
    canvas.plate(front, 12.0, 0xffffff);
    canvas.plate(part(front, [0.025, 0.025, 0.975, 0.975]), 10.5, RED);
    canvas.plate(part(front, [0.05, 0.05, 0.95, 0.95]), 9.0, YELLOW);
    canvas.plate(part(front, [0.05, 0.46, 0.95, 0.78]), 4.0, RED);
    canvas.text(part(front, [0.1, 0.52, 0.9, 0.72]), "MUSTARD", 0xffffff);
    canvas.text(part(front, [0.24, 0.81, 0.76, 0.91]), "CLASSIC", GREEN);
    // A flag-like pennant and a mustard flower.
    canvas.rectangle(part(front, [0.05, 0.39, 0.95, 0.43]), GREEN);
    let (x, y) = (front[0] + 0.3 * (front[2] - front[0]), front[1] + 0.22 * (front[3] - front[1]));
    canvas.star([x, y], [5.5, 14.0], 8, 0xffffff);
    canvas.star([x, y], [4.0, 11.5], 8, 0xffe25a);
    canvas.disc([x, y], 4.0, 0xb9770e);
    canvas.text(part(front, [0.52, 0.17, 0.9, 0.28]), "YELLOW", RED);

    let back = wall(form, [18.0, 112.0], [0.56, 0.94]);
    canvas.plate(back, 8.0, 0xfffdf3);
    canvas.rectangle(part(back, [0.0, 0.84, 1.0, 0.90]), GREEN);
    canvas.text(part(back, [0.12, 0.70, 0.88, 0.81]), "SPREAD IT", RED);
    canvas.small_print(part(back, [0.08, 0.4, 0.92, 0.66]), 7, 30, 0x3b3220);
    facts(canvas, part(back, [0.08, 0.05, 0.46, 0.37]), 0x3b3220, 31);
    canvas.bar_code(part(back, [0.54, 0.08, 0.92, 0.3]), 32);

    // Cap: red skirt with a light notch to the front, yellow spout.
    canvas.rectangle([0.0, form.level(156.6), width, form.level(169.0)], RED);
    canvas.stripes([0.0, form.level(157.5), width, form.level(168.0)], width / 48.0, 0.0, 0xb3171d);
    canvas.rectangle([0.22 * width, form.level(156.6), 0.28 * width, form.level(169.0)], 0xffffff);
    canvas.rectangle([0.0, form.level(170.0), width, height], 0xffdb4d);
    canvas.rectangle([0.0, 0.0, width, form.level(4.0)], 0xe0ab0d);
}

pub(super) fn bleach(canvas: &mut Canvas, form: &Form) {
    const BLUE: u32 = 0x0e4ea0;
    const CYAN: u32 = 0x27a9e1;
    const GREEN: u32 = 0x62b32e;
    let [width, height] = form.sheet();
    let band = wall(form, [26.0, 140.0], [0.0, 1.0]);
    let front = part(band, [0.02, 0.0, 0.48, 1.0]);
    canvas.plate(front, 10.0, BLUE);
    canvas.shape(front, CYAN, |x, y| {
        let (u, v) =
            ((x - front[0]) / (front[2] - front[0]), (y - front[1]) / (front[3] - front[1]));
        v < 0.30 + 0.14 * (4.0 * u).sin() && v > 0.05 && u > 0.03 && u < 0.97
    });
    canvas.shape(front, 0xffffff, |x, y| {
        let (u, v) =
            ((x - front[0]) / (front[2] - front[0]), (y - front[1]) / (front[3] - front[1]));
        let edge = 0.30 + 0.14 * (4.0 * u).sin();
        v < edge + 0.03 && v > edge && u > 0.03 && u < 0.97
    });
    canvas.text(part(front, [0.15, 0.57, 0.85, 0.77]), "BLEACH", 0xffffff);
    canvas.text(part(front, [0.2, 0.83, 0.8, 0.93]), "CLEANSER", 0xffe14a);
    let star = [front[0] + 0.73 * (front[2] - front[0]), front[1] + 0.2 * (front[3] - front[1])];
    canvas.star(star, [11.0, 17.0], 14, 0xffe14a);
    canvas.text([star[0] - 9.5, star[1] - 4.0, star[0] + 9.5, star[1] + 4.0], "FRESH", 0xd0202a);
    for (dx, dy, r) in [(0.16, 0.13, 6.5), (0.32, 0.24, 4.5), (0.28, 0.08, 3.0), (0.44, 0.12, 4.0)]
    {
        let center = [front[0] + dx * (front[2] - front[0]), front[1] + dy * (front[3] - front[1])];
        canvas.disc(center, r, 0xffffff);
        canvas.disc(center, r - 0.9, 0x7fd0f2);
        canvas.disc([center[0] - 0.3 * r, center[1] + 0.3 * r], 0.25 * r, 0xffffff);
    }

    let back = part(band, [0.54, 0.04, 0.96, 0.96]);
    canvas.plate(back, 6.0, GREEN);
    canvas.plate(part(back, [0.03, 0.03, 0.97, 0.8]), 4.0, 0xffffff);
    canvas.text(part(back, [0.1, 0.84, 0.9, 0.95]), "HOW TO", 0xffffff);
    canvas.small_print(part(back, [0.09, 0.36, 0.91, 0.75]), 10, 33, 0x20364a);
    canvas.plate(part(back, [0.09, 0.08, 0.45, 0.3]), 2.0, 0xd0202a);
    canvas.text(part(back, [0.12, 0.13, 0.42, 0.25]), "CAUTION", 0xffffff);
    canvas.bar_code(part(back, [0.55, 0.08, 0.91, 0.3]), 34);

    canvas.rectangle([0.0, form.level(216.3), width, height], BLUE);
    canvas.stripes([0.0, form.level(219.0), width, form.level(247.0)], width / 40.0, 0.0, 0x0b3f83);
    canvas.rectangle([0.20 * width, form.level(216.3), 0.30 * width, height], CYAN);
}
