//! Many pixels inside faces at once, side by side: the formulas of one pixel in loops over lanes.
//!
//! These loops are compiled once for each instruction set: a call left standing in one would run with the wrong one and keep it from
//! being vectorized. What they call of this crate is always inlined; glam's `Vec3` is too, as instruction counts have shown.

#![allow(clippy::needless_range_loop)] // loops over lanes index several arrays alike

use glam::{Vec3, vec2, vec3};
use pulp::{Arch, NullaryFnOnce};

use super::interior::{InteriorMotion, add_level};
use super::scene::ContourScene;
use crate::model::{Albedo, Cell, Mipmap, Texel};
use crate::projected::barycentric;
use crate::shading::surface::{Unlit, coordinates, lit};
use crate::view::{LANES, Lane, Patch, Pixel, Sink, get, put};

/// Three vectors, or colors, of each pixel.
type Nine = [Lane; 9];

/// Pixels inside faces that wait until there are enough of them.
pub(crate) struct Waiting {
    arch: Arch,
    x: Lane,
    y: Lane,
    face: [u32; LANES],
    b: [Lane; 3],
    corners: Nine,
    normals: Nine,
    side: Lane,
    unlit: Colors,
    pub(crate) patch: Patch,
}

/// Unlit colors.
struct Colors {
    color: [Lane; 3],
    along: [[Lane; 3]; 2],
    level: [Lane; 3],
}

impl Waiting {
    pub(crate) fn new() -> Self {
        const ZERO: Lane = [0.0; LANES];
        let unlit = Colors { color: [ZERO; 3], along: [[ZERO; 3]; 2], level: [ZERO; 3] };
        Self {
            arch: Arch::new(),
            x: ZERO,
            y: ZERO,
            face: [0; LANES],
            b: [ZERO; 3],
            corners: [ZERO; 9],
            normals: [ZERO; 9],
            side: ZERO,
            unlit,
            patch: Patch::new(),
        }
    }

    /// Adds pixel (x, y) with index `at`, which shows a face at depth `z`; true if there is room for no other.
    #[inline]
    pub(crate) fn push(&mut self, (x, y): (f32, f32), at: usize, face: u32, z: f32) -> bool {
        let l = self.patch.count;
        self.x[l] = x;
        self.y[l] = y;
        self.face[l] = face;
        self.patch.at[l] = at;
        self.patch.z[l] = z;
        self.patch.count += 1;
        self.patch.count == LANES
    }

    /// Hands all that wait to `sink`; none does afterwards.
    pub(crate) fn flush<const DERIVATIVES: bool>(
        &mut self,
        scene: &ContourScene,
        sink: &mut impl Sink<DERIVATIVES>,
    ) {
        if self.patch.count == 0 {
            return;
        }
        // Lanes without a pixel repeat the first.
        for l in self.patch.count..LANES {
            self.x[l] = self.x[0];
            self.y[l] = self.y[0];
            self.face[l] = self.face[0];
            self.patch.z[l] = self.patch.z[0];
        }
        self.arch.dispatch(Flush::<DERIVATIVES, _> { waiting: self, scene, sink });
        self.patch.count = 0;
    }
}

/// Blended pixels whose colors wait until there are enough of them.
pub(crate) struct Blended {
    arch: Arch,
    patch: Patch,
}

impl Blended {
    pub(crate) fn new() -> Self {
        Self { arch: Arch::new(), patch: Patch::new() }
    }

    /// Adds the color of the pixel with index `at`; true if there is room for no other.
    #[inline]
    pub(crate) fn push<const DERIVATIVES: bool>(&mut self, at: usize, pixel: &Pixel) -> bool {
        let l = self.patch.count;
        self.patch.at[l] = at;
        put(&mut self.patch.color, l, pixel.color);
        if DERIVATIVES {
            for k in 0..3 {
                put(&mut self.patch.color_rows[k], l, pixel.color_rows[k]);
            }
        }
        self.patch.count += 1;
        self.patch.count == LANES
    }

    /// Hands all that wait to `sink`; none does afterwards.
    pub(crate) fn flush<const DERIVATIVES: bool>(&mut self, sink: &mut impl Sink<DERIVATIVES>) {
        if self.patch.count == 0 {
            return;
        }
        // Lanes without a pixel have no weight.
        let patch = &self.patch;
        self.arch.dispatch(FlushBlended::<DERIVATIVES, _> { patch, sink });
        self.patch.count = 0;
    }
}

struct FlushBlended<'a, const DERIVATIVES: bool, S> {
    patch: &'a Patch,
    sink: &'a mut S,
}

impl<const DERIVATIVES: bool, S: Sink<DERIVATIVES>> NullaryFnOnce
    for FlushBlended<'_, DERIVATIVES, S>
{
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.sink.colors(self.patch);
    }
}

struct Flush<'a, 'b, const DERIVATIVES: bool, S> {
    waiting: &'a mut Waiting,
    scene: &'a ContourScene<'b>,
    sink: &'a mut S,
}

impl<const DERIVATIVES: bool, S: Sink<DERIVATIVES>> NullaryFnOnce
    for Flush<'_, '_, DERIVATIVES, S>
{
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.waiting.gather(self.scene);
        self.waiting.locate(self.scene);
        self.waiting.color(self.scene);
        self.waiting.shade::<DERIVATIVES>(self.scene);
        self.sink.patch(&self.waiting.patch);
    }
}

#[inline(always)]
fn triple(v: [f32; 9]) -> [Vec3; 3] {
    [vec3(v[0], v[1], v[2]), vec3(v[3], v[4], v[5]), vec3(v[6], v[7], v[8])]
}

#[inline(always)]
fn flat([a, b, c]: [Vec3; 3]) -> [f32; 9] {
    [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]
}

impl Waiting {
    #[inline(always)]
    fn gather(&mut self, scene: &ContourScene) {
        let (posed, model) = (&scene.posed, scene.posed.model);
        for l in 0..LANES {
            let face = self.face[l] as usize;
            let corners = model.faces[face].map(|v| posed.position[v as usize]);
            put(&mut self.corners, l, flat(corners));
            put(&mut self.normals, l, flat(model.normals[face]));
            self.side[l] = if posed.projected.facing[face] < 0 { -1.0 } else { 1.0 };
        }
    }

    /// Barycentric coordinates.
    #[inline(always)]
    fn locate(&mut self, scene: &ContourScene) {
        let posed = &scene.posed;
        for l in 0..LANES {
            let [a, b, c] = triple(get(&self.corners, l));
            let corners = [posed.project(a), posed.project(b), posed.project(c)];
            put(&mut self.b, l, barycentric(corners, vec2(self.x[l], self.y[l])));
        }
    }

    /// Unlit colors.
    #[inline(always)]
    fn color(&mut self, scene: &ContourScene) {
        match &scene.posed.model.albedo {
            Albedo::Uniform(color) => {
                (0..3).for_each(|k| self.unlit.color[k] = [color[k]; LANES]);
            }
            Albedo::Corners(corners) => {
                let mut colors: Nine = [[0.0; LANES]; 9];
                for l in 0..LANES {
                    put(&mut colors, l, flat(corners[self.face[l] as usize].map(Vec3::from)));
                }
                for l in 0..LANES {
                    let unlit = Unlit::between(triple(get(&colors, l)), get(&self.b, l));
                    self.unlit.put(l, &unlit);
                }
            }
            Albedo::Texture(map, corners) => self.texture(map, corners, scene.posed.level),
        }
    }

    #[inline(always)]
    fn texture(&mut self, map: &Mipmap, corners: &[[[f32; 2]; 3]], level: f32) {
        let mut uv = [[0.0; LANES]; 6];
        for l in 0..LANES {
            let [a, b, c] = corners[self.face[l] as usize];
            put(&mut uv, l, [a[0], a[1], b[0], b[1], c[0], c[1]]);
        }
        let pairs = |l: usize| {
            let uv = get(&uv, l);
            [[uv[0], uv[1]], [uv[2], uv[3]], [uv[4], uv[5]]]
        };
        let (fine, blend) = map.split(level);
        let coarse = if blend == 0.0 { fine } else { fine + 1 };
        let near = Texels::new(map, fine, |l| coordinates(&pairs(l), get(&self.b, l)));
        let far = Texels::new(map, coarse, |l| coordinates(&pairs(l), get(&self.b, l)));
        for l in 0..LANES {
            let texel = near.texel(l).blended(&far.texel(l), blend);
            self.unlit.put(l, &Unlit::textured(&texel, &pairs(l)));
        }
    }

    /// Lit colors, and rows.
    #[inline(always)]
    fn shade<const DERIVATIVES: bool>(&mut self, scene: &ContourScene) {
        let posed = &scene.posed;
        let (twist_center, arm) = (scene.twist_center, scene.level_arm());
        for l in 0..LANES {
            let b = get(&self.b, l);
            let normals = triple(get(&self.normals, l));
            let unlit = self.unlit.get(l);
            let shaded = lit::<DERIVATIVES>(&scene.lighting, &normals, self.side[l], b, &unlit);
            put(&mut self.patch.color, l, shaded.color);
            if DERIVATIVES {
                let corners = triple(get(&self.corners, l));
                let ray = posed.ray(vec2(self.x[l], self.y[l]));
                let motion = InteriorMotion::new(&corners, b, ray, self.patch.z[l], twist_center);
                for k in 0..3 {
                    let mut row = motion.color_row(&shaded, k);
                    add_level(&mut row, shaded.level[k] * posed.level_dz, arm);
                    put(&mut self.patch.color_rows[k], l, row);
                }
                put(&mut self.patch.z_row, l, motion.z_row);
            }
        }
    }
}

impl Colors {
    #[inline(always)]
    fn put(&mut self, l: usize, unlit: &Unlit) {
        put(&mut self.color, l, unlit.color);
        put(&mut self.along[0], l, unlit.along[0]);
        put(&mut self.along[1], l, unlit.along[1]);
        put(&mut self.level, l, unlit.level);
    }

    #[inline(always)]
    fn get(&self, l: usize) -> Unlit {
        let along = [get(&self.along[0], l), get(&self.along[1], l)];
        Unlit { color: get(&self.color, l), along, level: get(&self.level, l) }
    }
}

/// The texels around each pixel's point on one pyramid level.
struct Texels {
    x: Lane,
    y: Lane,
    around: [[Lane; 3]; 4],
    size: [f32; 2],
}

impl Texels {
    #[inline(always)]
    fn new(map: &Mipmap, index: usize, at: impl Fn(usize) -> [f32; 2]) -> Self {
        let level = map.level(index);
        let (mut right, mut lower) = ([0i32; LANES], [0i32; LANES]);
        let mut out = Self {
            x: [0.0; LANES],
            y: [0.0; LANES],
            around: [[[0.0; LANES]; 3]; 4],
            size: level.size(),
        };
        for l in 0..LANES {
            let [u, v] = at(l);
            let cell = level.cell(u, v);
            out.x[l] = cell.x;
            out.y[l] = cell.y;
            right[l] = cell.right;
            lower[l] = cell.lower;
        }
        for l in 0..LANES {
            let texels = level.around(right[l], lower[l]);
            for i in 0..4 {
                put(&mut out.around[i], l, texels[i]);
            }
        }
        out
    }

    #[inline(always)]
    fn texel(&self, l: usize) -> Texel {
        let around = [
            get(&self.around[0], l),
            get(&self.around[1], l),
            get(&self.around[2], l),
            get(&self.around[3], l),
        ];
        let cell = Cell { x: self.x[l], y: self.y[l], ..Cell::default() };
        Texel::bilinear(&around, &cell, self.size)
    }
}
