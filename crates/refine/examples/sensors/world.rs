//! An object that is held or lies on a table, and what cameras see of it.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::hand::{ALLEGRO_XELA_URDF, JOINT_NAMES, default_grasp, taxels};
use prehend_geometry::objects::YcbObject;
use prehend_geometry::robot::{KinematicTree, PosedRobot};
use prehend_geometry::shapes::{RoundedBox, cuboid, rounded_box};
use prehend_geometry::{ClosestPoints, SplitMix64, TriMesh};
use prehend_refine::scene::{Frame, Hand};
use prehend_render::{Camera, Light, Mask, RenderModel, look_at, render_scene};

pub(crate) const CAMERA: Camera =
    Camera { fx: 580.0, fy: 580.0, cx: 319.5, cy: 239.5, width: 640, height: 480 };

/// Standard deviations of what is seen: of colors, and of depth at half a meter \[m\].
const COLOR_NOISE: f64 = 0.02;
const DEPTH_NOISE: f64 = 1.5e-3;

/// The object, what is about it, and a camera. Poses are those of the world, in which z points up \[m\].
pub(crate) struct World {
    pub(crate) object: TriMesh,
    pub(crate) mass: f64,
    pub(crate) t_world_object: Isometry3<f64>,
    /// Hands, each with the pose of its base.
    pub(crate) hands: Vec<Isometry3<f64>>,
    /// Positions of each hand's joints \[rad\].
    pub(crate) joints: Vec<f64>,
    /// Whether there is a table, at height 0.
    pub(crate) has_table: bool,
    /// Another object.
    pub(crate) other: Option<(TriMesh, Isometry3<f64>)>,
    pub(crate) t_world_cam: Isometry3<f64>,
    pub(crate) hand: Hand,
}

impl World {
    /// The built-in grasp, in as many as two hands, from another side for each seed.
    pub(crate) fn held(seed: u64, hands: usize) -> anyhow::Result<Self> {
        let grasp = default_grasp();
        let tree = KinematicTree::from_urdf_str(ALLEGRO_XELA_URDF, None)?;
        let joints = JOINT_NAMES.iter().map(|name| (*name).to_owned()).zip(grasp.joints);
        let joints = tree.joint_vector(&joints.collect())?;
        // About the bottle's long axis: from there it looks the same.
        let half = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        let around = grasp.t_base_object
            * Isometry3::from_parts(Translation3::identity(), half)
            * grasp.t_base_object.inverse();
        let poses = [Isometry3::identity(), around];
        let mut random = SplitMix64::new(seed);
        let angle = 0.28 + 0.5 * random.normal().clamp(-1.0, 1.0);
        let (distance, height) = (0.43, 0.2 + 0.05 * random.normal());
        let eye = Point3::new(distance * angle.cos(), distance * angle.sin(), height);
        Ok(Self {
            object: grasp.object.mesh(),
            mass: grasp.object.mass(),
            t_world_object: grasp.t_base_object,
            hands: poses[..hands].to_vec(),
            joints,
            has_table: false,
            other: None,
            t_world_cam: eye_at(&eye, &Point3::new(0.04, 0.02, 0.03)),
            hand: Hand::new(tree, taxels())?,
        })
    }

    /// A box on a table, with another one that leans against nothing but hides a part of it.
    pub(crate) fn on_table(seed: u64) -> anyhow::Result<Self> {
        let mut random = SplitMix64::new(seed);
        let object = YcbObject::SugarBox;
        let mesh = object.mesh();
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.0 * random.normal());
        // Lying on one of its sides, of which the other box hides a half.
        let lying =
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
        let turn = yaw * lying;
        let lowest = |mesh: &TriMesh, turn: &UnitQuaternion<f64>| {
            mesh.vertices.iter().map(|v| (turn * v).z).fold(f64::INFINITY, f64::min)
        };
        let height = -lowest(&mesh, &turn);
        let other = cuboid(Vector3::new(0.05, 0.05, 0.12));
        let direction = 6.0 * random.normal();
        let beside = Vector3::new(0.14 * direction.cos(), 0.14 * direction.sin(), 0.06);
        let eye = Point3::new(0.45 * direction.cos(), 0.45 * direction.sin(), 0.3);
        Ok(Self {
            object: mesh,
            mass: object.mass(),
            t_world_object: Isometry3::from_parts([0.0, 0.0, height].into(), turn),
            hands: Vec::new(),
            joints: Vec::new(),
            has_table: true,
            other: Some((other, Isometry3::from_parts(beside.into(), yaw))),
            t_world_cam: eye_at(&eye, &Point3::new(0.0, 0.0, 0.05)),
            ..Self::held(seed, 0)?
        })
    }

    /// World → camera.
    pub(crate) fn t_cam_world(&self) -> Isometry3<f64> {
        self.t_world_cam.inverse()
    }

    pub(crate) fn t_cam_object(&self) -> Isometry3<f64> {
        self.t_cam_world() * self.t_world_object
    }

    /// Hand `k`, in the world.
    pub(crate) fn posed(&self, k: usize) -> anyhow::Result<PosedRobot> {
        Ok(self.hand.posed(&self.hands[k], &self.joints)?)
    }

    /// The object's surface, in its own frame.
    pub(crate) fn surface(&self) -> anyhow::Result<ClosestPoints> {
        Ok(ClosestPoints::new(&self.object.cleaned().0)?)
    }

    /// Frame of `camera` at `t_world_cam`, with noise.
    pub(crate) fn seen(
        &self,
        camera: &Camera,
        t_world_cam: &Isometry3<f64>,
        noise: &mut SplitMix64,
    ) -> anyhow::Result<Frame> {
        let t_cam_world = t_world_cam.inverse();
        let model = RenderModel::new(&self.object)?;
        let table = RenderModel::new(&table())?;
        let other = self.other.as_ref();
        let other =
            other.map(|(mesh, pose)| Ok::<_, anyhow::Error>((RenderModel::new(mesh)?, pose)));
        let other = other.transpose()?;
        let mut bodies = vec![(&model, t_cam_world * self.t_world_object)];
        if self.has_table {
            bodies.push((&table, t_cam_world));
        }
        if let Some((model, pose)) = &other {
            bodies.push((model, t_cam_world * *pose));
        }
        for hand in &self.hands {
            bodies.extend(self.hand.render_bodies(&(t_cam_world * hand), &self.joints));
        }
        let light = Light {
            ambient: [0.45; 3],
            directional: [Vector3::new(-0.25, -0.4, -0.35); 3],
            offset: [0.0; 3],
        };
        let mut image =
            render_scene(camera, &bodies, 3, |_, point| light.color(point), |_, _| [0.12; 3]);
        for value in image.color.pixels_mut().iter_mut().flatten() {
            *value = (*value + (COLOR_NOISE * noise.normal()) as f32).clamp(0.0, 1.0);
        }
        for z in image.depth.pixels_mut().iter_mut().filter(|z| **z > 0.0) {
            *z += (DEPTH_NOISE * noise.normal()) as f32 * (*z / 0.5).powi(2);
        }
        let mut mask = Mask::filled(camera.width, camera.height, false);
        for (set, body) in mask.pixels_mut().iter_mut().zip(&image.object) {
            *set = *body == Some(0);
        }
        Ok(Frame::new(*camera).color(image.color).depth(image.depth).mask(mask))
    }
}

/// A plate that ends at height 0, of faces that are all before the camera or behind it.
fn table() -> TriMesh {
    let (size, flat) = (Vector3::new(1.5, 1.5, 0.02), Vector3::zeros());
    let shape = RoundedBox { size, radius: 0.0, bulge: flat, arc_steps: 0, cell: 0.05 };
    rounded_box(&shape).transformed(&Translation3::new(0.0, 0.0, -0.01).into())
}

/// A camera at `eye` that looks at `target`, in the world.
pub(crate) fn eye_at(eye: &Point3<f64>, target: &Point3<f64>) -> Isometry3<f64> {
    look_at(eye, target, &Vector3::z(), 0.0).inverse()
}
