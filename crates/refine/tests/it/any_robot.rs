//! Nothing assumes one hand: an object in a two-finger gripper, and one that rests on a table.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3, Vector6};
use prehend_autodiff::lie::perturb_about;
use prehend_geometry::objects::YcbObject;
use prehend_geometry::robot::KinematicTree;
use prehend_refine::PreparedFrame;
use prehend_refine::baselines::{GradientKind, Heuristic};
use prehend_refine::evaluate::metrics::{oe_deg, pe_cm};
use prehend_refine::refine;
use prehend_refine::scene::{Frame, Hand, Object};
use prehend_render::{Camera, Light, Mask, RenderModel, render_scene};

const GRIPPER: &str = r#"<robot name="gripper">
  <link name="palm"><collision><origin xyz="0 0 -0.02"/><geometry><box size="0.05 0.12 0.04"/></geometry></collision></link>
  <link name="left"><collision><origin xyz="0 0.005 0.03"/><geometry><box size="0.02 0.01 0.06"/></geometry></collision></link>
  <link name="right"><collision><origin xyz="0 -0.005 0.03"/><geometry><box size="0.02 0.01 0.06"/></geometry></collision></link>
  <joint name="left_slide" type="prismatic"><parent link="palm"/><child link="left"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.05" effort="10" velocity="1"/></joint>
  <joint name="right_slide" type="prismatic"><parent link="palm"/><child link="right"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.05" effort="10" velocity="1"/></joint>
</robot>"#;

const TABLE: &str = r#"<robot name="table"><link name="top"><collision><origin xyz="0 0 -0.01"/>
  <geometry><box size="0.3 0.3 0.02"/></geometry></collision></link></robot>"#;

const CAMERA: Camera =
    Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };

/// An object on a robot, and its pose.
struct Setting {
    object: Arc<Object>,
    robot: Arc<Hand>,
    joints: Vec<f64>,
    t_robot_object: Isometry3<f64>,
    t_cam_robot: Isometry3<f64>,
}

impl Setting {
    fn new(object: YcbObject, urdf: &str, joints: Vec<f64>, place: Isometry3<f64>) -> Self {
        let tree = KinematicTree::from_urdf_str(urdf, None).unwrap();
        let mass = Some(object.mass());
        let object = Object::with_mass(object.name(), object.mesh(), mass, 0).unwrap();
        // Nothing but the bounding box's center is known to be at the place.
        let t_robot_object = place * Translation3::from(-object.center.coords);
        Self {
            object: Arc::new(object),
            robot: Arc::new(Hand::new(tree, Vec::new()).unwrap()),
            joints,
            t_robot_object,
            t_cam_robot: look_at(&Point3::new(0.35, 0.15, 0.25), &place.translation.vector.into()),
        }
    }

    fn truth(&self) -> Isometry3<f64> {
        self.t_cam_robot * self.t_robot_object
    }

    /// Frame of a perfect camera; gravity is the robot's −z.
    fn observation(&self) -> Frame {
        let mut bodies: Vec<(&RenderModel, Isometry3<f64>)> =
            self.robot.render_bodies(&self.t_cam_robot, &self.joints);
        let model = RenderModel::new(&self.object.mesh).unwrap();
        bodies.insert(0, (&model, self.truth()));
        let light = Light {
            ambient: [0.5; 3],
            directional: [Vector3::new(-0.2, -0.4, -0.3); 3],
            offset: [0.0; 3],
        };
        let seen =
            render_scene(&CAMERA, &bodies, 3, |_, point| light.color(point), |_, _| [0.1; 3]);
        let mut mask = Mask::filled(CAMERA.width, CAMERA.height, false);
        for (set, body) in mask.pixels_mut().iter_mut().zip(&seen.object) {
            *set = *body == Some(0);
        }
        Frame {
            gravity: Some(self.t_cam_robot.rotation * Vector3::new(0.0, 0.0, -9.81)),
            hand: Some(self.robot.measured(self.t_cam_robot, self.joints.clone())),
            ..Frame::new(CAMERA).color(seen.color).depth(seen.depth).mask(mask)
        }
    }

    /// Position \[cm\] and orientation \[deg\] errors of the pose found from one that is off by `error`, and the pose in the
    /// robot's frame.
    fn refined(&self, error: &Vector6<f64>) -> (f64, f64, Isometry3<f64>) {
        let truth = self.truth();
        let initial = perturb_about(&truth, &(truth * self.object.center).coords, error);
        let gradients = [GradientKind::Physics, GradientKind::Rendering, GradientKind::Depth];
        let method = Heuristic { checkpoint: true, ..Heuristic::of(&gradients) };
        let observation = self.observation();
        let frame = PreparedFrame::new(&observation, &self.object).unwrap();
        let pose = *refine(&frame, &initial, &method).unwrap().t_cam_object();
        (pe_cm(&pose, &truth), oe_deg(&pose, &truth), self.t_cam_robot.inverse() * pose)
    }
}

/// Pose world → camera of a camera at `eye` that looks at `target`, +z up.
fn look_at(eye: &Point3<f64>, target: &Point3<f64>) -> Isometry3<f64> {
    let forward = (target - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let rows = [right, forward.cross(&right), forward].map(|v| v.transpose());
    let rotation = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_rows(&rows));
    let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    Isometry3::from_parts(Translation3::from(-(rotation * eye.coords)), rotation)
}

#[test]
fn an_object_in_a_gripper_is_refined() {
    // Lying, 28 mm thick: turned so that the fingers close on its faces.
    let mesh = YcbObject::GelatinBox.mesh();
    let (low, high) = mesh.bounds().unwrap();
    let half = 0.5 * (high.z - low.z);
    let place =
        Isometry3::new(Vector3::new(0.0, 0.0, 0.06), Vector3::x() * std::f64::consts::FRAC_PI_2);
    // The fingers press in by a fifth of a millimeter.
    let setting = Setting::new(YcbObject::GelatinBox, GRIPPER, vec![half - 2e-4; 2], place);
    let error = Vector6::new(0.006, -0.007, 0.008, 0.08, -0.1, 0.06);
    let (pe, oe, _) = setting.refined(&error);
    println!("gripper: {pe:.3} cm, {oe:.2}°");
    assert!(pe < 0.1 && oe < 1.0, "{pe} cm, {oe}°");
}

#[test]
fn an_object_on_a_table_comes_to_rest_on_it() {
    let mesh = YcbObject::SugarBox.mesh();
    let (low, high) = mesh.bounds().unwrap();
    let height = high.z - low.z;
    let place = Isometry3::translation(0.01, -0.02, 0.5 * height - 1e-4);
    let setting = Setting::new(YcbObject::SugarBox, TABLE, Vec::new(), place);
    // Sunk into the table and tilted.
    let down = setting.t_cam_robot.rotation * Vector3::new(0.005, 0.004, -0.01);
    let error = Vector6::new(down.x, down.y, down.z, 0.06, -0.05, 0.08);
    let (pe, oe, t_table_object) = setting.refined(&error);
    let lowest = setting.object.mesh.vertices.iter().map(|v| (t_table_object * v).z);
    let lowest = lowest.fold(f64::INFINITY, f64::min);
    println!("table: {pe:.3} cm, {oe:.2}°, lowest point at {:.2} mm", 1e3 * lowest);
    assert!(pe < 0.1 && oe < 1.0, "{pe} cm, {oe}°");
    assert!(lowest.abs() < 1e-3, "{lowest}");
}
