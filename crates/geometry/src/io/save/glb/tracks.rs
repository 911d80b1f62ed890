//! Tracks of an animation.

use std::path::Path;

use nalgebra::UnitQuaternion;
use serde_json::{Value, json};

use super::chunk::Chunk;
use super::film::FilmKey;
use crate::io::Result;
use crate::io::save::invalid;

/// Samplers and channels of an animation.
#[derive(Default)]
pub(super) struct Tracks {
    pub(super) samplers: Vec<Value>,
    pub(super) channels: Vec<Value>,
}

impl Tracks {
    /// Gives `node`, of that index, its first place, and a track of all of them where they differ.
    pub(super) fn place(
        &mut self,
        node: &mut Value,
        index: usize,
        name: &str,
        keys: &[FilmKey],
        chunk: &mut Chunk,
        path: &Path,
    ) -> Result<()> {
        let fault = |what: &str| invalid(path, format!("{name}: {what}"));
        let times: Vec<[f32; 1]> = keys.iter().map(|key| [key.time as f32]).collect();
        if !times.is_sorted_by(|a, b| a[0] < b[0]) || times.iter().any(|t| t[0] < 0.0) {
            return Err(fault("times do not ascend from zero on"));
        }
        let places: Vec<[f32; 3]> = keys
            .iter()
            .map(|key| key.t_base_body.translation.vector.map(|c| c as f32).into())
            .collect();
        let mut turns: Vec<[f32; 4]> = Vec::with_capacity(keys.len());
        for key in keys {
            let turn = quaternion(&key.t_base_body.rotation);
            let before = turns.last().copied().unwrap_or(turn);
            let dot: f32 = turn.iter().zip(before).map(|(a, b)| a * b).sum();
            turns.push(if dot < 0.0 { turn.map(|c| -c) } else { turn });
        }
        let numbers = times.iter().flatten().chain(places.iter().flatten());
        if !numbers.chain(turns.iter().flatten()).all(|n| n.is_finite()) {
            return Err(fault("a key is not finite"));
        }
        let (Some(place), Some(turn)) = (places.first(), turns.first()) else {
            return Err(fault("it is nowhere: there is no key"));
        };
        node["translation"] = json!(place);
        node["rotation"] = json!(turn);
        let moves = places.iter().any(|p| p != place);
        let turns_over = turns.iter().any(|q| q != turn);
        if moves || turns_over {
            let input = chunk.bounded(&times, "SCALAR");
            if moves {
                let output = chunk.floats(&places, "VEC3");
                self.add(index, "translation", input, output);
            }
            if turns_over {
                let output = chunk.floats(&turns, "VEC4");
                self.add(index, "rotation", input, output);
            }
        }
        Ok(())
    }

    fn add(&mut self, node: usize, moved: &str, input: usize, output: usize) {
        let sampler = self.samplers.len();
        self.samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
        let target = json!({ "node": node, "path": moved });
        self.channels.push(json!({ "sampler": sampler, "target": target }));
    }
}

/// The real part last, of unit length in single precision.
pub(super) fn quaternion(rotation: &UnitQuaternion<f64>) -> [f32; 4] {
    let q = rotation.quaternion();
    [q.i, q.j, q.k, q.w].map(|c| c as f32)
}
