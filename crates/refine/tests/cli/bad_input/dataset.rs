//! Faults of images, rows of poses, and files of a scene.

use super::*;

#[test]
fn images() {
    table(
        &[
            (
                "missing color",
                |p| p.remove(RGB),
                &["scene 1 image 0 object 5: ", "rgb/000000.png: no such file"],
            ),
            ("truncated color", |p| p.truncate(RGB, 0.5), &["ds/test/000001/rgb/000000.png: "]),
            (
                "missing depth",
                |p| p.remove(DEPTH),
                &["ds/test/000001/depth/000000.png: no such file"],
            ),
            ("truncated depth", |p| p.truncate(DEPTH, 0.9), &["ds/test/000001/depth/000000.png: "]),
            (
                "depth of eight bits",
                |p| {
                    let file = p.path(DEPTH);
                    Mask::filled(640, 480, true).save(&file).unwrap();
                },
                &["object 5: ds/test/000001/depth/000000.png: expected 16-bit gray"],
            ),
            (
                "no depth",
                |p| {
                    let file = p.path(DEPTH);
                    DepthImage::filled(640, 480, 0.0).save(&file, 1e-4).unwrap();
                },
                &["ds/test/000001/depth/000000.png: every depth is zero"],
            ),
            (
                "depth of another size",
                |p| {
                    let file = p.path(DEPTH);
                    DepthImage::filled(320, 240, 0.5).save(&file, 1e-4).unwrap();
                },
                &["depth/000000.png: is 320x240 pixels but", "000000.png is 640x480"],
            ),
            (
                "missing mask",
                |p| p.remove(MASK),
                &["ds/test/000001/mask_visib/000000_000000.png: no such file"],
            ),
            (
                "truncated mask",
                |p| p.truncate(MASK, 0.6),
                &["ds/test/000001/mask_visib/000000_000000.png: "],
            ),
            (
                "empty mask",
                |p| {
                    let file = p.path(MASK);
                    Mask::filled(640, 480, false).save(&file).unwrap();
                },
                &["mask_visib/000000_000000.png: the mask is empty"],
            ),
            (
                "no depth in the mask",
                |p| {
                    let file = p.path(DEPTH);
                    let mask = p.path(MASK);
                    let mut depth = DepthImage::load(&file, 1e-4).unwrap();
                    let mask = Mask::load(&mask).unwrap();
                    let pixels = depth.pixels_mut().iter_mut().zip(mask.pixels());
                    pixels.filter(|(_, m)| **m).for_each(|(z, _)| *z = 0.0);
                    depth.save(&file, 1e-4).unwrap();
                },
                &["no pixel of the object's mask has a depth"],
            ),
        ],
        &OTHERS,
    );
}

#[test]
fn rows() {
    table(
        &[
            (
                "too few columns",
                |p| row(p, "1,0,5,1"),
                &["init.csv: line 2: row: expected 7 columns, found 4"],
            ),
            (
                "too many columns",
                |p| row(p, "1,0,5,1,2,3,4,5"),
                &["init.csv: line 2: row: expected 7 columns, found 8"],
            ),
            (
                "text for an id",
                |p| column(p, 1, "zero"),
                &["init.csv: line 2: im_id: \"zero\" is not an id"],
            ),
            (
                "text in a rotation",
                |p| column(p, 4, "1 0 0 0 1 0 0 0 x"),
                &["init.csv: line 2: R: \"x\" is not a number"],
            ),
            (
                "NaN in a translation",
                |p| column(p, 5, "0 nan 500"),
                &["init.csv: line 2: t: value 1 is not finite"],
            ),
            (
                "no rotation",
                |p| column(p, 4, "1 0 0 0 1 0 0 0 2"),
                &["init.csv: line 2: R: not orthonormal"],
            ),
            (
                "mirror image",
                |p| column(p, 4, "1 0 0 0 1 0 0 0 -1"),
                &["init.csv: line 2: R: a reflection"],
            ),
            (
                "unknown scene",
                |p| column(p, 0, "9"),
                &["scene 9 image 0 object 5: ds/test: no scene 9"],
            ),
            (
                "unknown image",
                |p| column(p, 1, "7"),
                &["scene 1 image 7 object 5: ds/test/000001/scene_camera.json: no entry \"7\""],
            ),
            (
                "unknown object",
                |p| column(p, 2, "8"),
                &["scene 1 image 0 object 8: ds/models/obj_000008.ply: unknown object id 8"],
            ),
            (
                "behind the camera",
                |p| column(p, 5, "0 0 -500"),
                &[
                    "scene 1 image 0 object 5: ",
                    "object's center at depth -0.",
                    "behind the camera",
                ],
            ),
        ],
        &OTHERS,
    );
}

#[test]
fn entries_of_an_image() {
    table(
        &[
            (
                "NaN in the intrinsics",
                |p| {
                    let file = format!("{SCENE}/scene_camera.json");
                    p.replace(&file, "580.0", "NaN");
                },
                &["scene_camera.json: 0.cam_K[0]: number out of range"],
            ),
            (
                "no intrinsics",
                |p| entry(p, "scene_camera.json", |e| e["cam_K"] = json!(null)),
                &["ds/test/000001/scene_camera.json: 0.cam_K: invalid type: null"],
            ),
            (
                "no image in the bodies",
                |p| {
                    p.edit_json(&format!("{SCENE}/scene_bodies.json"), |all| {
                        all.as_object_mut().unwrap().remove("0");
                    });
                },
                &["scene_bodies.json: no entry \"0\""],
            ),
            (
                "hand not rotated",
                |p| entry(p, "scene_bodies.json", |e| e["bodies"][0]["cam_R_b2c"][0] = json!(3)),
                &["scene_bodies.json: 0.bodies[0].cam_R_b2c: not orthonormal"],
            ),
            (
                "no gravity",
                |p| entry(p, "scene_bodies.json", |e| e["gravity"] = json!([0, 0, 0])),
                &["scene_bodies.json: 0.gravity: 0.000e0 m/s² is no gravity"],
            ),
            (
                "two hands",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        let hand = e["bodies"][0].clone();
                        e["bodies"].as_array_mut().unwrap().push(hand);
                    });
                },
                &["scene_bodies.json: 0.bodies[1].name: there are two bodies called \"hand\""],
            ),
            (
                "missing joint",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        let joints = e["bodies"][0]["joints"].as_object_mut().unwrap();
                        let first = joints.keys().next().unwrap().clone();
                        assert_eq!(first, "joint_0.0");
                        joints.remove(&first);
                    });
                },
                &["scene_bodies.json: 0.bodies[0].joints: joint 'joint_0.0' is missing"],
            ),
            (
                "text for a joint",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        e["bodies"][0]["joints"]["joint_0.0"] = json!("bent")
                    })
                },
                &[
                    "scene_bodies.json: 0.bodies[0].joints.joint_0.0: invalid type: string \"bent\", expected f64",
                ],
            ),
            (
                "no image in the touch",
                |p| {
                    p.edit_json(&format!("{SCENE}/scene_tactile.json"), |all| {
                        all.as_object_mut().unwrap().remove("0");
                    });
                },
                &["scene_tactile.json: no entry \"0\""],
            ),
            (
                "a force too few",
                |p| {
                    entry(p, "scene_tactile.json", |e| {
                        e["force"].as_array_mut().unwrap().pop();
                    });
                },
                &[
                    "scene_tactile.json: 0.force: expected 368 forces, one a taxel of ds/hand/taxels.csv, found 367",
                ],
            ),
            (
                "forces of another body",
                |p| entry(p, "scene_tactile.json", |e| e["body"] = json!("left_hand")),
                &["scene_tactile.json: 0.body: names \"left_hand\", the bodies are \"hand\""],
            ),
            (
                "a force of two numbers",
                |p| entry(p, "scene_tactile.json", |e| e["force"][5] = json!([0, 1])),
                &["scene_tactile.json: 0.force[5]: expected 3 numbers, found 2"],
            ),
            (
                "a taxel on no link of the hand",
                |p| {
                    let taxels = p.read("ds/hand/taxels.csv").replacen("link_14.0", "nolink", 1);
                    p.write("ds/hand/other.csv", &taxels);
                    entry(p, "scene_tactile.json", |e| e["taxels"] = json!("hand/other.csv"));
                },
                &[
                    "scene_tactile.json: 0.taxels: ds/hand/other.csv: \"hand\" has no link \"nolink\"",
                ],
            ),
            (
                "taxels absent",
                |p| entry(p, "scene_tactile.json", |e| e["taxels"] = json!("hand/none.csv")),
                &["ds/hand/none.csv: "],
            ),
        ],
        &OTHERS,
    );
}

#[test]
fn files_of_a_scene() {
    table(
        &[
            (
                "no camera file",
                |p| p.remove(&format!("{SCENE}/scene_camera.json")),
                &[
                    "scene 1 image 0 object 5: ds/test/000001/scene_camera.json: no such file",
                    "scene 1 image 1 object 5: ",
                ],
            ),
            (
                "camera file is no JSON",
                |p| p.truncate(&format!("{SCENE}/scene_camera.json"), 0.5),
                &["ds/test/000001/scene_camera.json: not valid JSON: "],
            ),
            (
                "no bodies file",
                |p| p.remove(&format!("{SCENE}/scene_bodies.json")),
                &["ds/test/000001/scene_bodies.json: no such file"],
            ),
            (
                "no tactile file",
                |p| p.remove(&format!("{SCENE}/scene_tactile.json")),
                &["ds/test/000001/scene_tactile.json: no such file"],
            ),
            (
                "tactile file is a list",
                |p| p.write(&format!("{SCENE}/scene_tactile.json"), "[1]"),
                &["scene_tactile.json: invalid type: sequence, expected an object"],
            ),
        ],
        &[(2, 1)],
    );
}
