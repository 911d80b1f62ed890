//! The compute shaders: one module, put together from files by concept.

const FILES: [&str; 18] = [
    include_str!("../../shaders/problem.wgsl"),
    include_str!("../../shaders/work.wgsl"),
    include_str!("../../shaders/project.wgsl"),
    include_str!("../../shaders/bins.wgsl"),
    include_str!("../../shaders/raster.wgsl"),
    include_str!("../../shaders/silhouette.wgsl"),
    include_str!("../../shaders/pieces.wgsl"),
    include_str!("../../shaders/row.wgsl"),
    include_str!("../../shaders/texture.wgsl"),
    include_str!("../../shaders/surface.wgsl"),
    include_str!("../../shaders/pixel.wgsl"),
    include_str!("../../shaders/contour.wgsl"),
    include_str!("../../shaders/band.wgsl"),
    include_str!("../../shaders/residuals.wgsl"),
    include_str!("../../shaders/total.wgsl"),
    include_str!("../../shaders/picture.wgsl"),
    include_str!("../../shaders/fragment.wgsl"),
    include_str!("../../shaders/softras.wgsl"),
];

/// The whole module.
pub(super) fn source() -> String {
    FILES.concat()
}

#[cfg(test)]
mod tests {
    use std::mem::offset_of;

    use super::super::layout::*;
    use super::*;
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use naga::{ScalarKind, TypeInner};

    fn module() -> naga::Module {
        let source = source();
        match naga::front::wgsl::parse_str(&source) {
            Ok(module) => module,
            Err(error) => panic!("{}", error.emit_to_string(&source)),
        }
    }

    #[test]
    fn the_shaders_are_valid() {
        let module = module();
        // None of the optional capabilities are needed.
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        if let Err(error) = validator.validate(&module) {
            panic!("{}", error.emit_to_string(&source()));
        }
        let names: Vec<&str> = module.entry_points.iter().map(|e| e.name.as_str()).collect();
        for pass in super::super::device::PASSES {
            assert!(names.contains(&pass.entry), "{} is no entry point", pass.entry);
        }
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
        let module = module();
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
            let (members, span) = members(&module, name);
            assert_eq!(span as usize, size, "size of {name}");
            let theirs: Vec<(&str, usize, usize)> = members
                .iter()
                .map(|m| {
                    let size = module.types[m.ty].inner.size(module.to_ctx()) as usize;
                    (m.name.as_deref().unwrap_or(""), m.offset as usize, size)
                })
                .collect();
            assert_eq!(theirs, fields, "fields of {name}");
        }
        for (name, size) in [("Tally", TALLY), ("Bin", BIN), ("Segment", SEGMENT), ("Piece", PIECE)]
        {
            assert_eq!(members(&module, name).1 as usize, size, "size of {name}");
        }
        let (results, _) = members(&module, "Results");
        let offsets: Vec<usize> = results.iter().map(|m| m.offset as usize).collect();
        let expected = [
            offset_of!(Usage, entries),
            offset_of!(Usage, segments),
            offset_of!(Usage, pieces),
            offset_of!(Usage, unused),
            size_of::<Usage>(),
        ];
        assert_eq!(offsets, expected);
    }

    fn members<'a>(module: &'a naga::Module, name: &str) -> (&'a [naga::StructMember], u32) {
        let found = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name));
        match &found.unwrap_or_else(|| panic!("no struct {name}")).1.inner {
            TypeInner::Struct { members, span } => (members, *span),
            other => panic!("{name} is {other:?}"),
        }
    }

    #[test]
    fn constants_are_alike_in_both_languages() {
        let module = module();
        let value = |name: &str| {
            let (_, constant) = module
                .constants
                .iter()
                .find(|(_, c)| c.name.as_deref() == Some(name))
                .unwrap_or_else(|| panic!("no constant {name}"));
            match &module.global_expressions[constant.init] {
                naga::Expression::Literal(naga::Literal::U32(v)) => *v as usize,
                other => panic!("{name} is {other:?}, not {:?}", ScalarKind::Uint),
            }
        };
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
            ("PICTURE_COLUMNS", PICTURE_COLUMNS),
        ] {
            assert_eq!(value(name), ours, "{name}");
        }
    }
}
