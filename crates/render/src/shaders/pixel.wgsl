// What a pixel shows of the posed object, in either mode.
#define_import_path prehend::pixel

#import prehend::hypotheses::hypotheses
#import prehend::row::{Row, scaled_sum}
#import prehend::surface::Shaded

struct Pixel {
    // What is seen at all, and whether a face covers the pixel's center or it lies within the contour band.
    some: bool,
    hit: bool,
    near_outline: bool,
    // The face at the center, if one covers it.
    face: u32,
    // Color and coverage after blending with the black background.
    color: vec3<f32>,
    coverage: f32,
    // Z of the surface, or outside of the nearest outline point [m], and the weight of the depth.
    z: f32,
    depth_weight: f32,
    color_rows: array<Row, 3>,
    coverage_row: Row,
    z_row: Row,
    depth_weight_row: Row,
}

// Color rows from those of the barycentric coordinates of corners 1 and 2.
fn color_rows(h: u32, shaded: Shaded, moving_1: Row, moving_2: Row, pixel: ptr<function, Pixel>) {
    for (var k = 0u; k < 3u; k++) {
        var row = scaled_sum(shaded.along_second[k], moving_1, shaded.along_third[k], moving_2);
        row.angular += shaded.turning[k];
        // The texture's level follows the depth of the model's center, which a rotation about it leaves alone.
        row.linear.z += shaded.level[k] * hypotheses[h].level_dz;
        (*pixel).color_rows[k] = row;
    }
}
