//! Sensor readings of a world, written as a frame file with the errors that calibrations have.

use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use prehend_geometry::SplitMix64;
use prehend_geometry::hand::{ALLEGRO_XELA_URDF, Taxel, taxels};
use prehend_geometry::sample::surface_samples;
use prehend_render::{Camera, DepthImage};
use serde_json::{Map, Value, json};

use super::world::{CAMERA, World, eye_at};

/// Difference from color and depth of one camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extra {
    /// Forces on taxels.
    Force,
    /// Contact on the same taxels.
    Binary,
    /// Distances from one taxel in six.
    Proximity,
    /// Contact patches.
    Patch,
    /// No depth.
    ColorAlone,
    /// No color.
    DepthAlone,
    /// Depth from another camera, of fewer pixels, 5 cm to the side.
    DepthCamera,
    /// A second camera from the side.
    SecondCamera,
    /// The table.
    Table,
    /// The other object.
    Other,
    /// A second hand.
    SecondHand,
}

/// Standard deviations of what is said: focal lengths, principal point \[px\], the hand's place \[m\] and rotation, joints \[rad\], depth.
const FOCAL: f64 = 4e-3;
const PRINCIPAL_POINT: f64 = 1.0;
const HAND_PLACE: f64 = 2.1e-3;
const HAND_TURN: f64 = 7e-3;
const JOINTS: f64 = 0.014;
const DEPTH_SCALE: f64 = 4e-3;
/// Standard deviations of the nominal poses of the table and the other object \[m\], \[rad\].
const TABLE: [f64; 2] = [1e-3, 2e-3];
const OTHER: [f64; 2] = [3e-3, 0.02];
/// Root mean square error of the initial pose \[m\], \[rad\].
const START: [f64; 2] = [0.012, 0.14];

/// Skin feels what is so near \[m\].
const FELT: f64 = 2e-3;
/// How many of the taxels are dead, and how many ring false.
const DEAD: f64 = 0.03;
const FALSE_CONTACTS: f64 = 0.01;
/// Proximity is measured so far \[m\].
const RANGE: f64 = 0.03;

/// Errors of what is said of a world.
struct Errors(SplitMix64);

impl Errors {
    fn vector(&mut self, sigma: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sigma * self.0.normal())
    }

    /// `pose` with an error in its own frame.
    fn pose(&mut self, pose: &Isometry3<f64>, place: f64, turn: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(self.vector(turn));
        pose * Isometry3::from_parts(Translation3::from(self.vector(place)), turn)
    }

    fn camera(&mut self, camera: &Camera) -> Camera {
        let mut scaled = |f: f64| f * (1.0 + FOCAL * self.0.normal());
        let (fx, fy) = (scaled(camera.fx), scaled(camera.fy));
        let shift = self.vector(PRINCIPAL_POINT);
        Camera { fx, fy, cx: camera.cx + shift.x, cy: camera.cy + shift.y, ..*camera }
    }

    fn depth(&mut self, mut depth: DepthImage) -> DepthImage {
        let factor = (1.0 + DEPTH_SCALE * self.0.normal()) as f32;
        depth.pixels_mut().iter_mut().for_each(|z| *z *= factor);
        depth
    }
}

/// Writes a frame of `world` with `extras` into `folder`: `frame.json` and the files that it names. Errors drawn for a `seed` do not depend on `extras`.
/// Returns the table's nominal pose, table → camera \[m\], whether or not the frame has it.
pub(crate) fn write_frame(
    folder: &Path,
    world: &World,
    extras: &[Extra],
    seed: u64,
) -> anyhow::Result<Isometry3<f64>> {
    let has = |extra| extras.contains(&extra);
    let mut errors = Errors(SplitMix64::new(seed));
    let t_cam_world = world.t_cam_world();
    let start = {
        let scale = 3f64.sqrt().recip();
        errors.pose(&world.t_cam_object(), START[0] * scale, START[1] * scale)
    };
    let said: Vec<Isometry3<f64>> = (0..2)
        .map(|k| {
            let hand = world.hands.get(k).copied().unwrap_or_default();
            errors.pose(&(t_cam_world * hand), HAND_PLACE, HAND_TURN)
        })
        .collect();
    let joints: Vec<f64> = world.joints.iter().map(|q| q + JOINTS * errors.0.normal()).collect();
    let table = errors.pose(&Isometry3::identity(), TABLE[0], TABLE[1]);
    let other = errors.pose(&Isometry3::identity(), OTHER[0], OTHER[1]);
    let told = errors.camera(&CAMERA);
    let seen = world.seen(&CAMERA, &world.t_world_cam, &mut errors.0)?;

    world.object.save_ply(&folder.join("object.ply"))?;
    std::fs::write(folder.join("hand.urdf"), ALLEGRO_XELA_URDF)?;
    let mut frame = Map::new();
    let mut set = |name: &str, value: Value| _ = frame.insert(name.to_owned(), value);
    set("K", json!(told.k()));
    set("mask", json!("mask.png"));
    seen.mask.save(&folder.join("mask.png"))?;
    if !has(Extra::DepthAlone) {
        set("rgb", json!("rgb.png"));
        seen.color.save(&folder.join("rgb.png"))?;
    }
    if !has(Extra::ColorAlone) {
        set("depth", json!("depth.png"));
        set("depth_unit_m", json!(1e-4));
        let mut depth = seen.depth;
        if has(Extra::DepthCamera) {
            let small = Camera { width: 320, height: 240, ..CAMERA.scaled(0.5) };
            let t_color_depth = Isometry3::from_parts(
                [0.05, 0.002, -0.004].into(),
                UnitQuaternion::from_euler_angles(0.01, -0.03, 0.02),
            );
            let place = world.t_world_cam * t_color_depth;
            depth = world.seen(&small, &place, &mut errors.0)?.depth;
            let turn = t_color_depth.rotation.to_rotation_matrix();
            let rows: Vec<f64> = turn.matrix().transpose().iter().copied().collect();
            let mm = t_color_depth.translation.vector * 1e3;
            set("depth_K", json!(small.k()));
            set("cam_R_d2c", json!(rows));
            set("cam_t_d2c", json!(mm.as_slice()));
        }
        errors.depth(depth).save(&folder.join("depth.png"), 1e-4)?;
    }
    if has(Extra::SecondCamera) {
        let center = Point3::from(world.t_world_object.translation.vector);
        let from = Point3::from(world.t_world_cam.translation.vector) - center;
        let around = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 1.2);
        let place = eye_at(&(center + around * from), &center);
        let told = errors.camera(&CAMERA);
        let seen = world.seen(&CAMERA, &place, &mut errors.0)?;
        let pose = errors.pose(&(t_cam_world * place), HAND_PLACE, 0.6 * HAND_TURN);
        seen.mask.save(&folder.join("mask_2.png"))?;
        seen.color.save(&folder.join("rgb_2.png"))?;
        errors.depth(seen.depth).save(&folder.join("depth_2.png"), 1e-4)?;
        set(
            "cameras",
            json!([{ "K": told.k(), "rgb": "rgb_2.png", "depth": "depth_2.png", "depth_unit_m": 1e-4,
                     "mask": "mask_2.png", "pose": matrix(&pose) }]),
        );
    }
    set("mesh", json!("object.ply"));
    set("mesh_unit", json!("m"));
    set("mass_kg", json!(world.mass));
    set("pose", matrix(&start));
    set("gravity", json!((t_cam_world * Vector3::new(0.0, 0.0, -9.81)).as_slice()));
    let joints: Map<String, Value> = world
        .hand
        .tree
        .joint_names()
        .iter()
        .cloned()
        .zip(joints.iter().map(|q| json!(q)))
        .collect();
    if !world.hands.is_empty() {
        let mut robot =
            json!({ "urdf": "hand.urdf", "base_pose": matrix(&said[0]), "joints": joints });
        let mut touch = Map::new();
        for extra in extras {
            touch.extend(felt(folder, world, *extra, &mut errors)?);
        }
        robot.as_object_mut().into_iter().for_each(|robot| robot.extend(touch.clone()));
        set("robot", robot);
    }
    let mut bodies = Vec::new();
    let table = t_cam_world * table;
    if has(Extra::Table) {
        let pose = table;
        bodies.push(json!({ "name": "table", "kind": "plane", "pose": matrix(&pose),
                            "sigma_mm": TABLE[0] * 1e3, "sigma_deg": TABLE[1].to_degrees() }));
    }
    if has(Extra::Other)
        && let Some((mesh, pose)) = &world.other
    {
        mesh.save_ply(&folder.join("other.ply"))?;
        bodies.push(
            json!({ "name": "other", "kind": "object", "mesh": "other.ply", "mesh_unit": "m",
                            "pose": matrix(&(t_cam_world * pose * other)),
                            "sigma_mm": OTHER[0] * 1e3, "sigma_deg": OTHER[1].to_degrees() }),
        );
    }
    if has(Extra::SecondHand) && world.hands.len() > 1 {
        bodies.push(
            json!({ "name": "second", "kind": "hand", "urdf": "hand.urdf", "joints": joints,
                            "pose": matrix(&said[1]), "sigma_mm": HAND_PLACE * 1e3,
                            "sigma_deg": HAND_TURN.to_degrees() }),
        );
    }
    set("bodies", Value::Array(bodies));
    let text = serde_json::to_string_pretty(&Value::Object(frame))?;
    std::fs::write(folder.join("frame.json"), text)?;
    Ok(table)
}

fn matrix(pose: &Isometry3<f64>) -> Value {
    let rows: Vec<Vec<f64>> =
        pose.to_homogeneous().row_iter().map(|row| row.iter().copied().collect()).collect();
    json!({ "unit": "m", "matrix": rows })
}

/// Tactile readings of the first hand.
fn felt(
    folder: &Path,
    world: &World,
    extra: Extra,
    errors: &mut Errors,
) -> anyhow::Result<Map<String, Value>> {
    let (posed, surface) = (world.posed(0)?, world.surface()?);
    let links = posed.t_world_links();
    let tree = &world.hand.tree;
    let all = taxels();
    let distance = |taxel: &Taxel| {
        let link = tree.link_index(&taxel.link).unwrap_or_default();
        let point = world.t_world_object.inverse() * (links[link] * taxel.position);
        surface.signed_distance(&point).0
    };
    let mut said = Map::new();
    match extra {
        Extra::Force => {
            write_layout(&folder.join("taxels.csv"), &all)?;
            let force = |taxel: &Taxel| {
                let pressed = (FELT - distance(taxel)).max(0.0) / FELT;
                let dead = errors.0.uniform() < DEAD;
                let felt = if dead { 0.0 } else { pressed };
                let rings = if errors.0.uniform() < FALSE_CONTACTS { 0.3 } else { 0.0 };
                (taxel.normal * -(felt + rings)).as_slice().to_vec()
            };
            let forces: Vec<Vec<f64>> = all.iter().map(force).collect();
            said.insert("taxels".into(), json!("taxels.csv"));
            said.insert("forces".into(), json!(forces));
        }
        Extra::Binary => {
            write_layout(&folder.join("taxels.csv"), &all)?;
            let contact = |taxel: &Taxel| {
                let dead = errors.0.uniform() < DEAD;
                let rings = errors.0.uniform() < FALSE_CONTACTS;
                if dead { Value::Null } else { json!(u8::from(distance(taxel) < FELT || rings)) }
            };
            let contact: Vec<Value> = all.iter().map(contact).collect();
            let sensor = json!({ "kind": "binary", "taxels": "taxels.csv", "contact": contact });
            said.insert("touch".into(), json!([sensor]));
        }
        Extra::Proximity => {
            let some = all.into_iter().step_by(6).enumerate();
            let some: Vec<Taxel> = some.map(|(index, taxel)| Taxel { index, ..taxel }).collect();
            write_layout(&folder.join("proximity.csv"), &some)?;
            let measured = |taxel: &Taxel| {
                let distance = distance(taxel).max(0.0);
                let off = (1e-3_f64).hypot(0.05 * distance) * errors.0.normal();
                let in_range = distance < RANGE;
                if in_range { json!(1e3 * (distance + off).max(0.0)) } else { Value::Null }
            };
            let distance: Vec<Value> = some.iter().map(measured).collect();
            let sensor =
                json!({ "kind": "proximity", "taxels": "proximity.csv", "distance": distance });
            said.insert("touch".into(), json!([sensor]));
        }
        Extra::Patch => _ = said.insert("touch".into(), json!(patches(world, errors)?)),
        _ => {}
    }
    Ok(said)
}

/// Contact patches of soft skins, on every link that touches the object.
fn patches(world: &World, errors: &mut Errors) -> anyhow::Result<Vec<Value>> {
    let posed = world.posed(0)?;
    let names = posed.shape().link_names();
    let samples = surface_samples(&world.object, 40_000, 0);
    let mut found: Vec<(Vec<Value>, Vec<Value>)> = vec![Default::default(); names.len()];
    for sample in samples {
        let point = world.t_world_object * sample.point;
        let Some((link, field)) = posed.sample_link(&point, FELT) else { continue };
        if field.distance > 1e-3 {
            continue;
        }
        let t_link_world = posed.t_world_links()[link].inverse();
        let against = t_link_world * (world.t_world_object * -sample.normal);
        let point = (t_link_world * point).coords + errors.vector(2e-4);
        let normal = against + errors.vector(0.05);
        found[link].0.push(json!((point * 1e3).as_slice()));
        found[link].1.push(json!(normal.as_slice()));
    }
    let patches = names.iter().zip(found).filter(|(_, (points, _))| points.len() > 5);
    Ok(patches
        .map(|(link, (points, normals))| {
            json!({ "kind": "patch", "link": link, "points": points, "normals": normals })
        })
        .collect())
}

fn write_layout(file: &Path, taxels: &[Taxel]) -> anyhow::Result<()> {
    let mut text = String::from("idx,patch,link,x_m,y_m,z_m,nx,ny,nz\n");
    for Taxel { index, patch, link, position: p, normal: n } in taxels {
        text +=
            &format!("{index},{patch},{link},{},{},{},{},{},{}\n", p.x, p.y, p.z, n.x, n.y, n.z);
    }
    Ok(std::fs::write(file, text)?)
}
