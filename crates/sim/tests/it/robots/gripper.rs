//! A gripper with closed loops beside MuJoCo: `benches/peers/sim/gripper_golden.py` has made its motion.

use prehend_geometry::mjcf::Model as MjcfModel;
use prehend_sim::robot::MjcfOptions;
use prehend_sim::{Adaptive, Model, State, TimeSteps};
use serde_json::Value;

use super::data_folder;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
#[ignore = "reads PREHEND_DATA"]
fn data_loops_of_a_gripper_move_as_in_mujoco() {
    let golden: Value = serde_json::from_str(include_str!("../golden/gripper.json")).unwrap();
    let mjcf = MjcfModel::from_file(data_folder().join("robots/robotiq_2f85/2f85.xml")).unwrap();
    let mut model = Model::new(mjcf.gravity);
    let options = MjcfOptions { shapes: false, ..MjcfOptions::default() };
    let robot = model.add_mjcf(&mjcf, &options).unwrap();
    let names = golden["joints"].as_array().unwrap();
    let links: Vec<_> =
        names.iter().map(|name| robot.joint(name.as_str().unwrap()).unwrap().link).collect();
    let actuator = robot.actuator("fingers_actuator").unwrap();
    let run = golden["positions"].as_array().unwrap();
    let controls = numbers(&golden["controls"]);
    let time_steps = TimeSteps { dt: golden["every"].as_f64().unwrap(), steps: run.len() - 1 };
    let mut found: Vec<Vec<f64>> = Vec::new();
    let control = |step: prehend_sim::Step, model: &mut Model, states: &mut State| {
        let half = usize::from(2 * step.index >= time_steps.steps);
        model.joint_force_mut(actuator).set_param("control", controls[half]).unwrap();
        let position = |link| model.joint(states, link).unwrap().position[0];
        found.push(links.iter().map(|link| position(*link)).collect());
    };
    let start = model.neutral_state();
    model.simulate_controlled(&Adaptive::default(), &start, time_steps, control).unwrap();
    let travel = run.iter().map(|at| numbers(at)[0]).fold(0.0, f64::max);
    let mut worst = 0.0_f64;
    for (at, expected) in found.iter().zip(run) {
        for (x, expected) in at.iter().zip(numbers(expected)) {
            worst = worst.max((x - expected).abs() / travel);
        }
    }
    println!("within {:.2} % of the drivers' travel", 100.0 * worst);
    assert!(travel > 0.5 && worst < 0.01, "{worst}");
}
