//! The modules are valid, and agree with what this side believes of them.

use std::collections::HashMap;
use std::mem::offset_of;

use naga::TypeInner;
use naga::valid::{Capabilities, ValidationFlags, Validator};

use super::super::layout::*;
use super::*;

#[test]
fn every_pass_is_valid() {
    let mut composer = Composer::default();
    // None of the optional capabilities are needed.
    composer.capabilities = Capabilities::empty();
    add_modules(&mut composer).unwrap_or_else(|error| panic!("{error}"));
    for pass in &PASSES {
        let Composed { entry, module } =
            composed(&mut composer, pass).unwrap_or_else(|error| panic!("{error}"));
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        if let Err(error) = validator.validate(&module) {
            panic!("{}: {error:?}", pass.path);
        }
        let names: Vec<&str> = module.entry_points.iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, [entry], "{}", pass.path);
    }
}

#[test]
fn residuals_alone_come_with_and_without_derivatives() {
    let composed = compose().unwrap();
    let names: Vec<&str> = composed
        .iter()
        .filter(|composed| !composed.module.overrides.is_empty())
        .map(|composed| composed.entry)
        .collect();
    assert_eq!(names, ["contour_residuals", "softras_residuals"]);
}

#[test]
fn every_pass_binds_what_it_uses_alone() {
    let bindings = |entry: &str| {
        let composed = compose().unwrap().into_iter().find(|c| c.entry == entry).unwrap();
        let globals = composed.module.global_variables.iter();
        let mut all: Vec<u32> = globals.filter_map(|(_, g)| g.binding.map(|b| b.binding)).collect();
        all.sort_unstable();
        all
    };
    // Settings, poses, vertices, projected vertices, tallies.
    assert_eq!(bindings("project"), [0, 1, 2, 8, 9]);
}

/// Everything that the passes declare, under its name in its file.
struct Declared(Vec<Composed>);

impl Declared {
    fn new() -> Self {
        let mut composer = Composer::non_validating();
        let all = add_modules(&mut composer)
            .and_then(|()| PASSES.iter().map(|pass| composed(&mut composer, pass)).collect());
        Self(all.unwrap_or_else(|error| panic!("{error}")))
    }

    /// The members of a struct, each with its size, and the size of the whole.
    fn members(&self, name: &str) -> (Vec<(String, usize, usize)>, usize) {
        let mut found = self.0.iter().flat_map(|composed| {
            let module = &composed.module;
            module.types.iter().filter_map(move |(_, ty)| {
                (plain(ty.name.as_deref()?) == name).then_some((module, &ty.inner))
            })
        });
        let (module, inner) = found.next().unwrap_or_else(|| panic!("no struct {name}"));
        let TypeInner::Struct { members, span } = inner else { panic!("{name} is {inner:?}") };
        let member = |m: &naga::StructMember| {
            let size = module.types[m.ty].inner.size(module.to_ctx()) as usize;
            (m.name.clone().unwrap_or_default(), m.offset as usize, size)
        };
        (members.iter().map(member).collect(), *span as usize)
    }

    fn constants(&self) -> HashMap<&str, usize> {
        let all = self.0.iter().flat_map(|composed| {
            let module = &composed.module;
            module.constants.iter().filter_map(|(_, constant)| {
                let name = plain(constant.name.as_deref()?);
                match &module.global_expressions[constant.init] {
                    naga::Expression::Literal(naga::Literal::U32(v)) => Some((name, *v as usize)),
                    _ => None,
                }
            })
        });
        all.collect()
    }
}

/// The name of an imported item as its file has it.
fn plain(mangled: &str) -> &str {
    mangled.split("X_naga_oil_mod_X").next().unwrap_or(mangled)
}

/// Name, offset and size of every field of a struct of ours.
macro_rules! fields {
    ($type:ty, $($field:ident),+) => {{
        let value: $type = bytemuck::Zeroable::zeroed();
        (
            size_of::<$type>(),
            vec![$((stringify!($field), offset_of!($type, $field), size_of_val(&value.$field))),+],
        )
    }};
}

#[test]
fn structs_are_laid_out_alike_in_both_languages() {
    let declared = Declared::new();
    let ours = [
        (
            "Params",
            fields!(
                Params,
                size,
                tiles,
                focal,
                principal,
                bounds,
                vertices,
                faces,
                edges,
                hypotheses,
                entry_capacity,
                segment_capacity,
                piece_capacity,
                closed,
                albedo_kind,
                levels,
                margin,
                half_width,
                albedo,
                least_step,
                color_weight,
                mask_weight,
                depth_weight,
                depth_scale,
                depth_truncation,
                kernel_kind,
                kernel_scale,
                penalize_occluded,
                reach,
                blur,
                sharpness,
                depth_rate,
                farthest,
                least_area,
                faces_per_pixel,
                soft_flags,
                side,
                parts,
                squares,
                level
            ),
        ),
        (
            "Hypothesis",
            fields!(
                Hypothesis,
                rotation,
                center,
                alive,
                camera_light,
                object_light,
                ambient,
                flat_light,
                offset,
                level,
                level_dz,
                image_center
            ),
        ),
        ("Corner", fields!(Corner, normal, paint)),
        ("Edge", fields!(Edge, vertices, face, other, corner, other_corner)),
        ("TargetPixel", fields!(TargetPixel, color, coverage, depth, occluder)),
    ];
    for (name, (size, fields)) in ours {
        let (members, span) = declared.members(name);
        assert_eq!(span, size, "size of {name}");
        let theirs: Vec<_> = members.iter().map(|(n, at, size)| (n.as_str(), *at, *size)).collect();
        assert_eq!(theirs, fields, "fields of {name}");
    }
    for (name, size) in [("Tally", TALLY), ("Bin", BIN), ("Segment", SEGMENT), ("Piece", PIECE)] {
        assert_eq!(declared.members(name).1, size, "size of {name}");
    }
    let offsets: Vec<usize> = declared.members("Results").0.iter().map(|m| m.1).collect();
    let expected = [
        offset_of!(Usage, entries),
        offset_of!(Usage, segments),
        offset_of!(Usage, pieces),
        offset_of!(Usage, unused),
        size_of::<Usage>(),
    ];
    assert_eq!(offsets, expected);
}

#[test]
fn constants_are_alike_in_both_languages() {
    let declared = Declared::new();
    let constants = declared.constants();
    for (name, ours) in [
        ("TILE", TILE),
        ("TILE_PIXELS", TILE * TILE),
        ("ALBEDO_UNIFORM", ALBEDO_UNIFORM as usize),
        ("ALBEDO_CORNERS", ALBEDO_CORNERS as usize),
        ("ALBEDO_TEXTURE", ALBEDO_TEXTURE as usize),
        ("KERNEL_SQUARED", KERNEL_SQUARED as usize),
        ("KERNEL_HUBER", KERNEL_HUBER as usize),
        ("KERNEL_CAUCHY", KERNEL_CAUCHY as usize),
        ("KERNEL_GEMAN_MCCLURE", KERNEL_GEMAN_MCCLURE as usize),
        ("KERNEL_TUKEY", KERNEL_TUKEY as usize),
        ("SOFT_MODE", SOFT_MODE as usize),
        ("SOFT_PERSPECTIVE", SOFT_PERSPECTIVE as usize),
        ("SOFT_CLIP", SOFT_CLIP as usize),
        ("SOFT_CULL", SOFT_CULL as usize),
        ("SOFT_FADE", SOFT_FADE as usize),
        ("MOST_FACES", crate::mode::SoftRasOptions::MOST_FACES),
        ("SUM_COLOR", SUM_COLOR),
        ("SUM_MASK", SUM_MASK),
        ("SUM_DEPTH", SUM_DEPTH),
        ("SUM_GRADIENT", SUM_GRADIENT),
        ("SUM_HESSIAN", SUM_HESSIAN),
        ("SUM_COVERED", SUM_COVERED),
        ("SUM_CONTOUR", SUM_CONTOUR),
        ("SUM_HIDDEN", SUM_HIDDEN),
        ("SUM_MISSED", SUM_MISSED),
        ("SUM_WITH_DEPTH", SUM_WITH_DEPTH),
        ("SUM_COLUMNS", SUM_COLUMNS),
    ] {
        assert_eq!(constants.get(name), Some(&ours), "{name}");
    }
}
