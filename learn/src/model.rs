//! The network in burn: the same layers as `prehend_refine::network` has, with derivatives.

use std::collections::BTreeMap;

use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor, TensorData};
use prehend_geometry::SplitMix64;
use prehend_refine::network::{CHANNELS, Tensor as Array, Tensors, VOTE};

/// Widths of the layers.
#[derive(Clone, Debug, PartialEq)]
pub struct Widths {
    /// Layers of each point, alone.
    pub point: Vec<usize>,
    /// Layers of all points together.
    pub global: Vec<usize>,
    /// Layers of each vote, but for the last.
    pub vote: Vec<usize>,
}

impl Default for Widths {
    fn default() -> Self {
        Self { point: vec![64, 128, 256], global: vec![256], vote: vec![256, 128] }
    }
}

impl Widths {
    /// Weights drawn at random (He et al., 2015), and biases of zero.
    pub fn draw(&self, seed: u64) -> Tensors {
        let mut random = SplitMix64::new(seed);
        let mut all = BTreeMap::new();
        let mut layer = |name: String, inputs: usize, outputs: usize, gain: f64| {
            let scale = (gain / inputs as f64).sqrt();
            let draw = |_| (scale * random.normal()) as f32;
            let values = (0..inputs * outputs).map(draw).collect();
            all.insert(format!("{name}.weight"), Array { shape: vec![outputs, inputs], values });
            let values = vec![0.0; outputs];
            all.insert(format!("{name}.bias"), Array { shape: vec![outputs], values });
            outputs
        };
        let mut chain = |part: &str, mut inputs: usize, widths: &[usize]| {
            for (n, outputs) in widths.iter().enumerate() {
                inputs = layer(format!("{part}.{n}"), inputs, *outputs, 2.0);
            }
            inputs
        };
        let whole = chain("point", CHANNELS, &self.point);
        let whole = chain("global", whole, &self.global);
        let local = self.point.iter().rev().nth(1).copied().unwrap_or(CHANNELS);
        let last = chain("vote", local + whole, &self.vote);
        layer(format!("vote.{}", self.vote.len()), last, VOTE, 0.1);
        // Rotations begin near the identity: a vote of zeros would make none.
        if let Some(bias) = all.get_mut(&format!("vote.{}.bias", self.vote.len())) {
            (bias.values[3], bias.values[7]) = (1.0, 1.0);
        }
        all
    }
}

/// Votes of a batch, and what gives their derivatives.
pub struct Pass {
    weights: BTreeMap<String, Tensor<1>>,
    votes: Tensor<2>,
}

impl Pass {
    /// Votes of the first `voters` of each of `sets` sets of points, all sets of the same size, with [`CHANNELS`] numbers a point.
    pub fn forward(
        device: &Device,
        weights: &Tensors,
        points: Vec<f32>,
        sets: usize,
        voters: usize,
    ) -> Self {
        let leaf = |(name, array): (&String, &Array)| {
            let data = TensorData::new(array.values.clone(), [array.values.len()]);
            (name.clone(), Tensor::<1>::from_data(data, device).require_grad())
        };
        let leaves: BTreeMap<String, Tensor<1>> = weights.iter().map(leaf).collect();
        let matrix = |name: &str| {
            let shape = &weights[name].shape;
            leaves[name].clone().reshape([shape[0], shape[1]]).transpose()
        };
        let bias = |name: &str| leaves[name].clone().unsqueeze::<2>();
        let dense = |name: &str, input: Tensor<2>| {
            input.matmul(matrix(&format!("{name}.weight"))) + bias(&format!("{name}.bias"))
        };
        let depth = |part: &str| {
            (0..).take_while(|n| weights.contains_key(&format!("{part}.{n}.weight"))).count()
        };
        let each = points.len() / CHANNELS / sets.max(1);
        let data = TensorData::new(points, [sets * each, CHANNELS]);
        let mut local = Tensor::<2>::from_data(data, device);
        let layers = depth("point");
        for n in 0..layers.saturating_sub(1) {
            local = relu(dense(&format!("point.{n}"), local));
        }
        let whole = relu(dense(&format!("point.{}", layers.saturating_sub(1)), local.clone()));
        let [_, width] = whole.dims();
        let mut whole = whole.reshape([sets, each, width]).max_dim(1).reshape([sets, width]);
        for n in 0..depth("global") {
            whole = relu(dense(&format!("global.{n}"), whole));
        }
        let [_, inner] = local.dims();
        let voting = local.reshape([sets, each, inner]).slice([0..sets, 0..voters, 0..inner]);
        let voting = voting.reshape([sets * voters, inner]);
        // A layer of both together, of which the part of all points is computed once a set.
        let first = matrix("vote.0.weight");
        let [inputs, outputs] = first.dims();
        let of_point = voting.matmul(first.clone().slice([0..inner, 0..outputs]));
        let of_whole = whole.matmul(first.slice([inner..inputs, 0..outputs])) + bias("vote.0.bias");
        let both = of_point.reshape([sets, voters, outputs]) + of_whole.unsqueeze_dim::<3>(1);
        let mut votes = relu(both).reshape([sets * voters, outputs]);
        let layers = depth("vote");
        for n in 1..layers {
            votes = dense(&format!("vote.{n}"), votes);
            if n + 1 < layers {
                votes = relu(votes);
            }
        }
        Self { weights: leaves, votes }
    }

    /// Numbers of all votes, one after the other.
    pub fn votes(&self) -> Vec<f32> {
        numbers(self.votes.clone().into_data())
    }

    /// Derivatives by all weights of what has the derivative `by_votes` by the votes.
    pub fn backward(self, by_votes: Vec<f32>) -> BTreeMap<String, Vec<f32>> {
        let Self { weights, votes } = self;
        let data = TensorData::new(by_votes, votes.dims());
        let sum = (votes.clone() * Tensor::from_data(data, &votes.device())).sum();
        let mut gradients = sum.backward();
        let of = |(name, leaf): (String, Tensor<1>)| {
            let gradient = leaf.grad_remove(&mut gradients);
            (name, gradient.map_or_else(Vec::new, |g| numbers(g.into_data())))
        };
        weights.into_iter().map(of).collect()
    }
}

fn numbers(data: TensorData) -> Vec<f32> {
    data.convert::<f32>().try_into_vec().unwrap_or_default()
}
