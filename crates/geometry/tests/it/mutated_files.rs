//! Whatever a file holds, reading it ends in a mesh or an error.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use prehend_geometry::mjcf::{JointKind, Model};
use prehend_geometry::{KinematicTree, SplitMix64, Texture, TriMesh};

fn tetrahedron() -> TriMesh {
    let p = Point3::new;
    let vertices = vec![p(0., 0., 0.), p(1., 0., 0.), p(0., 1., 0.), p(0., 0., 1.)];
    let mut mesh = TriMesh::new(vertices, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
    mesh.normals = Some(vec![Vector3::x(); 4]);
    mesh.uvs = Some(vec![[0.25, 0.5]; 4]);
    mesh.colors = Some(vec![[0.25, 0.5, 1.0]; 4]);
    mesh
}

/// Hands `original` to `read` with bytes replaced, removed and repeated at places chosen by a fixed sequence.
fn mutations(original: &[u8], count: usize, mut read: impl FnMut(Vec<u8>)) {
    let mut random = SplitMix64::new(1);
    let mut next = |below: usize| (random.uniform() * below as f64) as usize;
    for _ in 0..count {
        let mut bytes = original.to_vec();
        for _ in 0..=next(3) {
            let at = next(bytes.len());
            match next(6) {
                0 => bytes[at] = next(256) as u8,
                1 => bytes[at] = b"0129-. \n/ex#"[next(12)],
                2 => drop(bytes.drain(at..(at + next(20)).min(bytes.len()))),
                3 => bytes.truncate(at.max(1)),
                // The largest number that fits, where there is one.
                4 => {
                    let end = (at + 4).min(bytes.len());
                    bytes[at..end].fill(255);
                }
                _ => {
                    let piece = bytes[at..(at + next(40)).min(bytes.len())].to_vec();
                    bytes.splice(at..at, piece);
                }
            }
            if bytes.is_empty() {
                bytes.push(0);
            }
        }
        read(bytes);
    }
}

/// Whether `bytes` are a mesh; panics where it is one that contradicts itself.
fn reads(bytes: &[u8], path: &Path) -> bool {
    match TriMesh::from_bytes(bytes, path) {
        Ok(mesh) => {
            assert!(mesh.faces.iter().flatten().all(|&v| (v as usize) < mesh.vertices.len()));
            assert!(mesh.uvs.as_ref().is_none_or(|u| u.len() == mesh.vertices.len()));
            assert!(mesh.normals.as_ref().is_none_or(|n| n.len() == mesh.vertices.len()));
            assert!(mesh.colors.as_ref().is_none_or(|c| c.len() == mesh.vertices.len()));
            // What was read is fit for the next steps, too.
            let (clean, report) = mesh.cleaned();
            assert!(report.self_intersections <= clean.faces.len(), "{report}");
            prehend_geometry::mass::mass_properties(&clean, 1.0).ok();
            true
        }
        Err(error) => {
            assert!(error.to_string().starts_with(&path.display().to_string()), "{error}");
            false
        }
    }
}

fn mutate(original: &[u8], path: &Path) -> (usize, usize) {
    assert!(TriMesh::from_bytes(original, path).is_ok(), "{}", path.display());
    let (mut read, mut refused) = (0, 0);
    mutations(original, 3000, |bytes| if reads(&bytes, path) { read += 1 } else { refused += 1 });
    (read, refused)
}

fn check(original: &[u8], name: &str) {
    let (read, refused) = mutate(original, Path::new(name));
    // Both ends were met, or the mutations say nothing.
    assert!(read > 50 && refused > 50, "{name}: {read} read, {refused} refused");
}

#[test]
fn ply() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.ply");
    tetrahedron().save_ply(&path).unwrap();
    check(&std::fs::read(&path).unwrap(), "m.ply");
    let ascii = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        element face 3\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1 6 0 0 1 0 0 1\n3 0 1 3 6 0 0 1 0 0 1\n3 0 3 2 0\n";
    check(ascii.as_bytes(), "m.ply");
}

#[test]
fn obj() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.obj");
    tetrahedron().save_obj(&path).unwrap();
    check(&std::fs::read(&path).unwrap(), "m.obj");
}

fn painted() -> TriMesh {
    let texture = Texture { width: 3, height: 2, pixels: vec![[9, 90, 200]; 6] };
    TriMesh { texture: Some(Arc::new(texture)), ..tetrahedron() }
}

#[test]
fn materials_and_images_beside_an_obj() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.obj");
    painted().save_obj(&path).unwrap();
    let mesh = std::fs::read(&path).unwrap();
    for companion in ["m.mtl", "m.png"] {
        let file = folder.path().join(companion);
        let original = std::fs::read(&file).unwrap();
        let mut painted = 0;
        mutations(&original, 500, |bytes| {
            std::fs::write(&file, bytes).unwrap();
            // At most the colors are lost.
            assert!(reads(&mesh, &path), "{companion}");
            let read = TriMesh::from_bytes(&mesh, &path).unwrap();
            painted += usize::from(read.texture.is_some());
        });
        assert!(painted < 500, "no mutation of {companion} was noticed");
        std::fs::write(&file, original).unwrap();
        assert!(reads(&mesh, &path));
    }
}

#[test]
fn glb_with_its_image_inside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.glb");
    painted().save_glb(&path).unwrap();
    let original = std::fs::read(&path).unwrap();
    let (read, refused) = mutate(&original, &path);
    assert!(read + refused == 3000 && refused > 50, "{read} {refused}");
    // Every way to end too early.
    assert!((0..original.len()).all(|n| !reads(&original[..n], &path)));
}

#[test]
fn robot_descriptions() {
    let folder = tempfile::tempdir().unwrap();
    tetrahedron().save_ply(&folder.path().join("m.ply")).unwrap();
    let text = r#"<?xml version="1.0"?><!-- a --><robot name="r"><link name="a">
        <collision><origin xyz="1 0 0" rpy="0 1 0"/><geometry><box size="1 2 3"/></geometry></collision>
        <collision><geometry><mesh filename="package://r/m.ply" scale="1 2 1"/></geometry></collision></link>
        <link name="b"><collision><geometry><cylinder radius="1" length="2"/></geometry></collision></link>
        <link name="c"><collision><geometry><sphere radius="1"/></geometry></collision></link>
        <joint name="p" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
        <joint name="q" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 1 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="p" multiplier="0.5" offset="0.1"/></joint></robot>"#;
    let read = |text: &str| KinematicTree::from_urdf_str(text, Some(folder.path()));
    assert_eq!(read(text).unwrap().joint_limits(), [(-1.0, 1.0)]);
    let (mut accepted, mut refused) = (0, 0);
    mutations(text.as_bytes(), 2000, |bytes| match read(&String::from_utf8_lossy(&bytes)) {
        Ok(robot) => {
            let joints = robot.clamp_joints(&vec![0.3; robot.joint_names().len()]).unwrap();
            assert_eq!(robot.forward_kinematics(&joints).len(), robot.links().len());
            accepted += 1;
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            refused += 1;
        }
    });
    assert!(accepted > 50 && refused > 50, "{accepted} {refused}");
}

#[test]
fn mjcf() {
    let folder = tempfile::tempdir().unwrap();
    tetrahedron().save_obj(&folder.path().join("m.obj")).unwrap();
    let text = r#"<mujoco model="m"><compiler angle="radian" eulerseq="xYz"/><default><joint damping="1"/><default class="c">
        <geom type="capsule" size="0.1" fromto="0 0 0 0 0 1"/><position kp="3" dampratio="1"/></default></default>
        <asset><mesh file="m.obj" scale="1 -1 1"/><mesh name="n" vertex="0 0 0 1 0 0 0 1 0 0 0 1" face="0 2 1 0 1 3 1 2 3 0 3 2"/></asset>
        <worldbody><body name="a"><freejoint/><geom type="mesh" mesh="m"/><frame euler="0 1 0"><body name="b" childclass="c"><joint name="q"
        range="-1 1"/><geom/><geom type="box" mesh="n" class="main"/><site name="s" zaxis="0 1 1"/></body></frame></body></worldbody>
        <contact><exclude body1="a" body2="b"/></contact><tendon><fixed name="t"><joint joint="q" coef="2"/></fixed></tendon>
        <equality><weld body1="a" body2="b"/><joint joint1="q" polycoef="0 1"/></equality>
        <actuator><position joint="q" class="c" inheritrange="1"/><general tendon="t" biastype="affine" biasprm="1 2 3"/></actuator>
        <keyframe><key qpos="0 0 0 1 0 0 0 1" ctrl="1 2"/></keyframe></mujoco>"#;
    let read = |text: &str| Model::from_str(text, Some(folder.path()));
    assert_eq!(read(text).unwrap().warnings, []);
    let (mut accepted, mut refused) = (0, 0);
    mutations(text.as_bytes(), 3000, |bytes| match read(&String::from_utf8_lossy(&bytes)) {
        Ok(model) => {
            let numbers = |count: fn(JointKind) -> usize| -> usize {
                model.joint_indices().map(|j| count(model.joint(j).kind)).sum()
            };
            assert_eq!(model.reference_positions().len(), numbers(JointKind::positions));
            for frame in &model.keyframes {
                assert_eq!(frame.velocities.len(), numbers(JointKind::velocities));
                assert_eq!(frame.controls.len(), model.actuators.len());
            }
            for (b, body) in model.bodies.iter().enumerate() {
                assert!(body.parent.is_none_or(|p| p < b));
                assert!(body.inertial.is_none_or(|i| i.mass >= 0.0));
            }
            accepted += 1;
        }
        Err(error) => {
            assert!(!error.to_string().is_empty());
            refused += 1;
        }
    });
    assert!(accepted > 50 && refused > 50, "{accepted} {refused}");
}

#[test]
fn stl() {
    let mut bytes = vec![b' '; 80];
    bytes.extend(4_u32.to_le_bytes());
    let mesh = tetrahedron();
    for f in 0..4 {
        bytes.extend([0; 12]);
        mesh.triangle(f)
            .iter()
            .flat_map(|p| p.iter())
            .for_each(|c| bytes.extend((*c as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    check(&bytes, "m.stl");
}

#[test]
fn glb() {
    let mut bin = Vec::new();
    let mesh = tetrahedron();
    mesh.vertices.iter().flat_map(|p| p.iter()).for_each(|c| bin.extend((*c as f32).to_le_bytes()));
    mesh.faces.iter().flatten().for_each(|v| bin.extend((*v as u16).to_le_bytes()));
    let mut json = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0},
        {"mesh":0,"rotation":[0,0,1,0],"scale":[2,1,1],"translation":[1,2,3]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":0},"indices":1}]}],
        "buffers":[{"byteLength":72}],
        "bufferViews":[{"buffer":0,"byteLength":48,"byteStride":12},{"buffer":0,"byteOffset":48,"byteLength":24}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]},
        {"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"}]}"#
        .to_owned()
        .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + bin.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &bin)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    mutate(&bytes, Path::new("m.glb"));
    check(&json_with_data_uri(&json, &bin), "m.gltf");
}

/// The document with its buffer in a base64 data URI.
fn json_with_data_uri(json: &[u8], bin: &[u8]) -> Vec<u8> {
    const SYMBOLS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in bin.chunks_exact(3) {
        let bits = u32::from(chunk[0]) << 16 | u32::from(chunk[1]) << 8 | u32::from(chunk[2]);
        (0..4).rev().for_each(|k| text.push(SYMBOLS[(bits >> (6 * k) & 63) as usize] as char));
    }
    let uri = format!(r#"{{"uri":"data:application/octet-stream;base64,{text}","byteLength":72}}"#);
    String::from_utf8_lossy(json).replace(r#"{"byteLength":72}"#, &uri).into_bytes()
}
