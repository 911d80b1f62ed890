//! Cameras of recordings.

use prehend_render::{Camera, CameraError, Distortion, DistortionError};

use super::messages::CameraInfo;
use super::topics::is_rectified;
use crate::data::bop::LensedCamera;

/// The camera that took the images of `topic`.
///
/// # Errors
/// Error text of calibration messages that are wrong.
pub(super) fn camera_of(info: &CameraInfo, topic: &str) -> Result<LensedCamera, String> {
    let rectified = is_rectified(topic);
    let k = match (rectified, info.p) {
        (true, [fx, skew, cx, _, _, fy, cy, ..]) => [fx, skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        (false, _) => info.k,
    };
    let (width, height) = (info.width as usize, info.height as usize);
    let camera = Camera::from_k(k, width, height).map_err(|e: CameraError| e.to_string())?;
    if rectified || info.d.iter().all(|coefficient| *coefficient == 0.0) {
        return Ok(LensedCamera { camera, lens: None });
    }
    let model = match info.distortion_model.as_str() {
        "plumb_bob" | "rational_polynomial" => "brown_conrady",
        "equidistant" => "kannala_brandt",
        other => return Err(format!("the distortion model {other:?} is not read")),
    };
    let lens = Distortion::by_name(model, &info.d).map_err(|e: DistortionError| e.to_string())?;
    Ok(LensedCamera { camera, lens: Some(lens) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectified_images_have_the_projections_camera_and_no_lens() {
        let info = CameraInfo {
            height: 48,
            width: 64,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![0.1, 0.0, 0.0, 0.0, 0.0],
            k: [60.0, 0.0, 31.5, 0.0, 61.0, 23.5, 0.0, 0.0, 1.0],
            p: [50.0, 0.0, 30.0, 0.0, 0.0, 51.0, 20.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            ..CameraInfo::default()
        };
        let raw = camera_of(&info, "/c/image_raw").unwrap();
        assert_eq!((raw.camera.k()[0], raw.lens.unwrap().coefficients()[0]), (60.0, 0.1));
        let rectified = camera_of(&info, "/c/image_rect_color").unwrap();
        assert_eq!(
            (rectified.camera.k(), rectified.lens),
            ([50.0, 0.0, 30.0, 0.0, 51.0, 20.0, 0.0, 0.0, 1.0], None)
        );
        let other = CameraInfo { distortion_model: "fov".to_owned(), ..info.clone() };
        assert!(camera_of(&other, "/c/image_raw").unwrap_err().contains("fov"));
        let none = CameraInfo { k: [0.0; 9], ..info };
        assert!(camera_of(&none, "/c/image_raw").is_err());
    }
}
