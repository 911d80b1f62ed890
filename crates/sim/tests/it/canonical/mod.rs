//! Canonical problems of contact and joints with closed forms, for every integrator and every contact law they apply to.
//!
//! `cargo test -p prehend-sim --release --test it canonical -- --nocapture` prints the table. An integrator is added by
//! one entry in [`integrators::SCHEMES`], a law by one in [`laws::LAWS`], a problem by one in [`PROBLEMS`].

mod balls;
mod flight;
mod friction;
mod integrators;
mod joints;
mod laws;
mod painleve;
mod rest;
mod rolling;
mod rows;
mod scene;
mod singular;

use rayon::prelude::*;

use integrators::SCHEMES;
use laws::LAWS;
use rows::{Over, Problem, Row, heading, line};

/// Every problem, in the order of the table.
const PROBLEMS: &[Problem] = &[
    Problem { name: "free fall", over: Over::Integrators(flight::free_fall) },
    Problem { name: "torque-free precession", over: Over::Integrators(flight::precession) },
    Problem { name: "intermediate-axis flip", over: Over::Integrators(flight::flip) },
    Problem { name: "pendulum", over: Over::Integrators(joints::pendulum_period) },
    Problem { name: "torsion spring", over: Over::Integrators(joints::torsion_spring) },
    Problem { name: "accelerometer", over: Over::Integrators(joints::accelerometer) },
    Problem { name: "momentum of two bodies", over: Over::Pairs(balls::momentum) },
    Problem { name: "rest", over: Over::Pairs(rest::rest) },
    Problem { name: "restitution", over: Over::Pairs(rest::restitution) },
    Problem { name: "stability limit", over: Over::Pairs(rest::stability_limit) },
    Problem { name: "incline, stick", over: Over::Pairs(friction::creep) },
    Problem { name: "incline, slip", over: Over::Pairs(friction::slip) },
    Problem { name: "stopping distance", over: Over::Pairs(friction::stopping) },
    Problem { name: "bowling ball", over: Over::Pairs(rolling::bowling_ball) },
    Problem { name: "Painlevé rod, paradox", over: Over::Pairs(painleve::jam) },
    Problem { name: "Painlevé rod, below it", over: Over::Pairs(painleve::slide) },
    Problem { name: "bounce gradients", over: Over::Pairs(balls::bounce_gradients) },
    Problem { name: "two balls", over: Over::Pairs(balls::exchange) },
    Problem { name: "singular points", over: Over::Laws(singular::finite) },
    Problem { name: "friction cone", over: Over::Laws(singular::cone) },
];

/// The rows of `problem` with the names of their integrator and law.
fn rows(problem: &Problem) -> Vec<(&'static str, &'static str, Row)> {
    let label = |integrator, law, rows: Vec<Row>| {
        rows.into_iter().map(move |row| (integrator, law, row)).collect::<Vec<_>>()
    };
    match problem.over {
        Over::Integrators(solve) => {
            SCHEMES.par_iter().flat_map_iter(|s| label(s.name, "", solve(s))).collect()
        }
        Over::Laws(solve) => {
            LAWS.par_iter().flat_map_iter(|l| label("", l.name, solve(l))).collect()
        }
        Over::Pairs(solve) => SCHEMES
            .par_iter()
            .flat_map(|s| LAWS.par_iter().map(move |l| (s, l)))
            .flat_map_iter(|(s, l)| label(s.name, l.name, solve(s, l)))
            .collect(),
    }
}

#[test]
fn every_closed_form_is_met() {
    println!("{}", heading());
    let mut missed = Vec::new();
    for problem in PROBLEMS {
        for (integrator, law, row) in rows(problem) {
            let line = line(problem.name, integrator, law, &row);
            println!("{line}");
            if !row.is_met() {
                missed.push(line);
            }
        }
    }
    assert!(missed.is_empty(), "out of tolerance:\n{}", missed.join("\n"));
}
