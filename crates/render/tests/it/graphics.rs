//! Poses and cameras of graphics engines mean what those engines mean by them.

use glam::camera::rh::proj::{directx, opengl};
use glam::{Affine3A, DMat4, DVec4, Mat4, Quat, Vec3, Vec4};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_render::{Camera, CameraError, MatrixError, ModelView};

const CAMERA: Camera =
    Camera { fx: 610.0, fy: 590.0, cx: 300.25, cy: 250.5, width: 640, height: 480 };

/// The projection of a camera into clip space as wgpu and Direct3D have it (right-handed view space, depth 0 at `near` and 1 at `far`
/// \[m\], which may be infinite).
fn perspective(camera: &Camera, near: f64, far: f64) -> Mat4 {
    let (width, height) = (camera.width as f64, camera.height as f64);
    let ratio = if far.is_finite() { far / (near - far) } else { -1.0 };
    DMat4::from_cols(
        DVec4::X * (2.0 * camera.fx / width),
        DVec4::Y * (2.0 * camera.fy / height),
        // Images reach half a pixel beyond the centers of their first and last pixels.
        DVec4::new(
            1.0 - (2.0 * camera.cx + 1.0) / width,
            (2.0 * camera.cy + 1.0) / height - 1.0,
            ratio,
            -1.0,
        ),
        DVec4::Z * (ratio * near),
    )
    .as_mat4()
}

fn poses() -> impl Iterator<Item = Isometry3<f64>> {
    (0..20).map(|i| {
        let a = f64::from(i);
        let rotation = Vector3::new(a.sin(), (2.3 * a).cos(), (0.7 * a).sin()) * (0.2 * a);
        Isometry3::from_parts(
            Translation3::new(0.1 * a.cos(), 0.1 * (3.1 * a).sin(), 0.3 + 0.05 * a),
            UnitQuaternion::from_scaled_axis(rotation),
        )
    })
}

/// Column and row of what a graphics engine draws at `clip` in a picture of the camera's size.
fn pixel(clip: Vec4) -> [f32; 2] {
    let ndc = clip / clip.w;
    [320.0 * (ndc.x + 1.0) - 0.5, 240.0 * (1.0 - ndc.y) - 0.5]
}

#[test]
fn an_engine_draws_points_where_the_camera_sees_them() {
    let (near, far) = (0.1, 5.0);
    let points = [[0.0, 0.0, 0.0], [0.05, -0.02, 0.03], [-0.04, 0.06, 0.01f32]].map(Vec3::from);
    for pose in poses() {
        let model_view = Mat4::from(ModelView { t_cam_model: pose });
        for point in points {
            let clip = perspective(&CAMERA, near, far) * model_view * point.extend(1.0);
            let in_camera = pose * Point3::from(point.as_dvec3());
            let seen = CAMERA.project(&in_camera).unwrap();
            let [u, v] = pixel(clip);
            assert!((f64::from(u) - seen.x).abs() < 1e-3 && (f64::from(v) - seen.y).abs() < 1e-3);
            let depth = far / (far - near) * (1.0 - near / in_camera.z);
            assert!((f64::from(clip.z / clip.w) - depth).abs() < 1e-6);
            let endless = perspective(&CAMERA, near, f64::INFINITY) * model_view;
            let clip = endless * point.extend(1.0);
            assert!((f64::from(clip.z / clip.w) - (1.0 - near / in_camera.z)).abs() < 1e-6);
        }
    }
}

#[test]
fn poses_and_cameras_come_back() {
    for pose in poses() {
        let given = ModelView { t_cam_model: pose };
        let as_parts: (Vec3, Quat) = given.into();
        for same in [
            ModelView::try_from(Mat4::from(given)).unwrap(),
            ModelView::try_from(Affine3A::from(given)).unwrap(),
            ModelView::from(as_parts),
        ] {
            let off = same.t_cam_model.inverse() * pose;
            assert!(off.translation.vector.norm() < 1e-7 && off.rotation.angle() < 1e-6, "{off}");
            assert!((same.t_cam_model.rotation.norm() - 1.0).abs() < 1e-15);
        }
    }
    for far in [5.0, f64::INFINITY] {
        let same = Camera::from_perspective(&perspective(&CAMERA, 0.1, far), 640, 480).unwrap();
        let worst = same.k().iter().zip(CAMERA.k()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-4, "{worst}");
    }
}

#[test]
fn projections_are_those_of_glam() {
    let (angle, aspect) = (0.9, 640.0 / 480.0);
    let glams = [
        directx::perspective(angle, aspect, 0.1, 8.0),
        directx::perspective_infinite(angle, aspect, 0.1),
        directx::perspective_infinite_reverse(angle, aspect, 0.1),
        opengl::perspective(angle, aspect, 0.1, 8.0),
    ];
    let cameras = glams.map(|glams| Camera::from_perspective(&glams, 640, 480).unwrap());
    let focal = 240.0 / (0.5 * f64::from(angle)).tan();
    for camera in cameras {
        assert!((camera.fx - focal).abs() < 1e-4 && (camera.fy - focal).abs() < 1e-4);
        assert_eq!((camera.cx, camera.cy), (319.5, 239.5));
    }
    for (glams, far) in glams.iter().zip([8.0, f64::INFINITY]) {
        assert!(perspective(&cameras[0], 0.1, far).abs_diff_eq(*glams, 1e-6));
    }
}

#[test]
fn what_is_no_pose_or_no_camera_is_said() {
    let good = Mat4::from_rotation_translation(Quat::from_rotation_x(0.3), Vec3::ONE);
    assert!(ModelView::try_from(good).is_ok());
    let not_rigid = |scale: Vec3| ModelView::try_from(good * Mat4::from_scale(scale));
    for scale in [Vec3::splat(1.01), Vec3::new(1.0, 1.0, 0.5), Vec3::new(-1.0, 1.0, 1.0)] {
        assert!(matches!(not_rigid(scale), Err(MatrixError::NotRigid { .. })), "{scale}");
    }
    let mut bad = good;
    bad.z_axis.y = f32::NAN;
    let error = ModelView::try_from(bad).unwrap_err();
    assert!(matches!(error, MatrixError::NotFinite { row: 1, column: 2, value } if value.is_nan()));
    let projection = perspective(&CAMERA, 0.1, 5.0);
    assert!(matches!(ModelView::try_from(projection), Err(MatrixError::LastRow { .. })));
    let flat = directx::orthographic(-1.0, 1.0, -1.0, 1.0, 0.1, 5.0);
    let camera = |m: &Mat4, width: usize| Camera::from_perspective(m, width, 480);
    assert!(matches!(camera(&flat, 640), Err(MatrixError::LastRow { .. })));
    let empty = CameraError::Empty { width: 0, height: 480 };
    assert_eq!(camera(&projection, 0).unwrap_err(), MatrixError::Camera(empty));
    let shifted = projection * Mat4::from_translation(Vec3::X * 0.03);
    assert!(matches!(camera(&shifted, 640), Err(MatrixError::Shifted { x, .. }) if x > 0.05));
    let mut skewed = projection;
    skewed.y_axis.x = 0.1;
    let error = camera(&skewed, 640).unwrap_err();
    assert!(matches!(error, MatrixError::Camera(CameraError::Layout { index: 1, .. })));
}
