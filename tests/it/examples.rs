//! Every example runs to its end, where it asserts what it found. In one program: by itself, each compiles the simulator anew.

macro_rules! examples {
    ($($name:ident: $path:literal,)*) => {$(
        #[path = $path]
        mod $name;

        #[test]
        fn $name() {
            $name::main().unwrap();
        }
    )*};
}

examples! {
    align_with_glam: "../../examples/align_with_glam.rs",
    arm_push: "../../examples/arm_push/main.rs",
    bounce_onto_target: "../../examples/bounce_onto_target.rs",
    custom_contact_law: "../../examples/custom_contact_law.rs",
    custom_joint: "../../examples/custom_joint.rs",
    custom_strategy: "../../examples/custom_strategy.rs",
    door_closer: "../../examples/door_closer.rs",
    gltf_gradients: "../../examples/gltf_gradients.rs",
    gripper_lift: "../../examples/gripper_lift/main.rs",
    hand_drop: "../../examples/hand_drop/main.rs",
    identify_slide: "../../examples/identify_slide.rs",
    inverse_rendering: "../../examples/inverse_rendering.rs",
    law_report: "../../examples/law_report/main.rs",
    learn_friction_from_throws: "../../examples/learn_friction_from_throws.rs",
    lqr: "../../examples/lqr.rs",
    loss_term: "../../examples/loss_term.rs",
    marbles: "../../examples/marbles.rs",
    mesh_contacts: "../../examples/mesh_contacts.rs",
    mug_onto_hook: "../../examples/mug_onto_hook.rs",
    pendulum_swing_up: "../../examples/pendulum_swing_up.rs",
    pixels_to_physics: "../../examples/pixels_to_physics.rs",
    plan_push: "../../examples/plan_push.rs",
    pose_refinement: "../../examples/pose_refinement.rs",
    stack_and_cradle: "../../examples/stack_and_cradle.rs",
    tosses: "../../examples/tosses/main.rs",
}

#[test]
fn every_example_is_among_these() {
    let own = include_str!("examples.rs");
    let listed = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/examples")).unwrap();
    for entry in listed {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|of| of == "rs") || path.join("main.rs").exists() {
            let name = path.file_stem().unwrap().to_string_lossy();
            assert!(own.contains(&format!("    {name}: ")), "{name}");
        }
    }
}
