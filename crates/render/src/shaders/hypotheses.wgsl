// The poses to try, each with its light.
#define_import_path prehend::hypotheses

struct Hypothesis {
    // Rotation from the mesh into the camera frame, by columns.
    rotation: mat3x3<f32>,
    // The model's center in the camera frame [m], about which twists turn.
    center: vec3<f32>,
    // Whether everything is finite.
    alive: u32,
    // Directional light of each channel in the camera frame, and in the mesh frame.
    camera_light: mat3x3<f32>,
    object_light: mat3x3<f32>,
    ambient: vec3<f32>,
    // No channel depends on the normal.
    flat_light: u32,
    offset: vec3<f32>,
    // Pyramid level of the texture, and its derivative by the center's Z.
    level: f32,
    level_dz: f32,
    // The projected center: its pixel, which screen positions are relative to, and the rest [px]. Zero in the contour mode,
    // where screen positions are those of the image.
    image_center: vec4<f32>,
}

@group(0) @binding(1) var<storage, read> hypotheses: array<Hypothesis>;
