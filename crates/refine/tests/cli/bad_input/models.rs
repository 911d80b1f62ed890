//! Faults of models and hands.

use super::*;

#[test]
fn models_and_hands() {
    table(
        &[
            (
                "no ply",
                |p| {
                    other_object(p, |_| ());
                    p.write("ds/models/obj_000006.ply", "no mesh");
                },
                &["ds/models/obj_000006.ply: "],
            ),
            (
                "truncated ply",
                |p| {
                    other_object(p, |_| ());
                    p.truncate("ds/models/obj_000006.ply", 0.5);
                },
                &["ds/models/obj_000006.ply: "],
            ),
            (
                "all faces flat",
                |p| {
                    other_object(p, |m| {
                        m.vertices.iter_mut().for_each(|v| *v = Point3::new(v.x, 0.0, 0.0));
                    })
                },
                &["ds/models/obj_000006.ply: the mesh is degenerate"],
            ),
            (
                "all in one point",
                |p| {
                    other_object(p, |m| {
                        m.vertices.iter_mut().for_each(|v| *v = Point3::origin());
                    })
                },
                &["ds/models/obj_000006.ply: the mesh "],
            ),
            (
                "not a number in the mesh",
                |p| other_object(p, |m| m.vertices[3].y = f64::NAN),
                &["ds/models/obj_000006.ply: "],
            ),
            (
                "open without inertia",
                |p| {
                    other_object(p, |m| {
                        m.faces.pop();
                    });
                    p.edit_json("ds/models/models_info.json", |info| {
                        info["6"].as_object_mut().unwrap().remove("inertia_kg_m2");
                    });
                },
                &[
                    "ds/models/obj_000006.ply: the mesh is not closed (3 edges",
                    "inertia must all be given",
                ],
            ),
            (
                "text for a mass",
                |p| {
                    other_object(p, |_| ());
                    p.edit_json("ds/models/models_info.json", |info| {
                        info["6"]["mass_kg"] = json!("heavy")
                    });
                },
                &[
                    "ds/models/models_info.json: 6.mass_kg: invalid type: string \"heavy\", expected f64",
                ],
            ),
            (
                "hand absent",
                |p| {
                    entry(p, "scene_bodies.json", |e| {
                        e["bodies"][0]["urdf"] = json!("hand/none.urdf")
                    })
                },
                &["ds/hand/none.urdf"],
            ),
            (
                "hand of broken XML",
                |p| other_hand(p, |urdf| urdf.replacen("</link>", "", 1)),
                &["ds/hand/other.urdf: invalid URDF: "],
            ),
            (
                "hand with a missing mesh",
                |p| with_collision_mesh(p, "palm.stl"),
                &[
                    "ds/hand/other.urdf: link '",
                    "collision mesh 'palm.stl': no such file in ds/hand",
                ],
            ),
            (
                "hand with a vertex far away",
                |p| {
                    p.write("ds/hand/far.obj", "v 0 0 0\nv 1e30 0 0\nv 0 1 0\nf 1 2 3\n");
                    with_collision_mesh(p, "far.obj");
                },
                &[
                    "ds/hand/other.urdf: link '",
                    "collision mesh 'far.obj': vertex 1 of the mesh is not finite or farther than 1e9 m",
                ],
            ),
        ],
        &OTHERS,
    );
}

/// Gives the hand's first link a mesh for its collision shape.
fn with_collision_mesh(place: &Workplace, file: &str) {
    other_hand(place, |urdf| {
        let (a, rest) = urdf.split_once("<collision>").unwrap();
        let (_, b) = rest.split_once("</collision>").unwrap();
        let mesh = format!("<geometry><mesh filename=\"{file}\"/></geometry>");
        format!("{a}<collision>{mesh}</collision>{b}")
    });
}
