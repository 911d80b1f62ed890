// Derivatives by a twist (translation, rotation) about the model's center, camera frame.
#define_import_path prehend::row

#import prehend::hypotheses::hypotheses
#import prehend::params::params

struct Row {
    linear: vec3<f32>,
    angular: vec3<f32>,
}

fn no_row() -> Row {
    return Row(vec3<f32>(0.0), vec3<f32>(0.0));
}

fn scaled(p: f32, a: Row) -> Row {
    return Row(p * a.linear, p * a.angular);
}

fn scaled_sum(p: f32, a: Row, q: f32, b: Row) -> Row {
    return Row(p * a.linear + q * b.linear, p * a.angular + q * b.angular);
}

// Row of `direction`·v for a point that moves with the twist.
fn motion_along(h: u32, direction: vec3<f32>, point: vec3<f32>) -> Row {
    return Row(direction, cross(point - hypotheses[h].center, direction));
}

// The viewing ray X/Z through an image position [px].
fn ray(p: vec2<f32>) -> vec3<f32> {
    return vec3<f32>((p - params.principal) / params.focal, 1.0);
}

// Gradient by the point of its image position along `direction`.
fn image_gradient(direction: vec2<f32>, point: vec3<f32>) -> vec3<f32> {
    let d = params.focal * direction;
    return vec3<f32>(d, -dot(d, point.xy) / point.z) / point.z;
}

// Motion of the image of `point` along the image direction `direction` [px] by the twist.
fn image_motion(h: u32, direction: vec2<f32>, point: vec3<f32>) -> Row {
    return motion_along(h, image_gradient(direction, point), point);
}
