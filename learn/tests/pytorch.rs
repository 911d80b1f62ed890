//! The network and its loss against PyTorch's values (tests/pytorch.py).

use std::collections::BTreeMap;
use std::path::Path;

use burn::tensor::Device;
use nalgebra::{Matrix3, Vector3};
use prehend_learn::loss::{ObjectPoints, TrueView, confidence_weighted_loss};
use prehend_learn::model::Pass;
use prehend_refine::network::{CHANNELS, PoseNetwork, Tensor, Tensors, VOTE, read_tensors};

const SETS: usize = 2;
const VOTERS: usize = 3;

struct Golden {
    all: Tensors,
    weights: Tensors,
}

impl Golden {
    fn read() -> Self {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/pytorch.safetensors");
        let all = read_tensors(&file).unwrap();
        let is_weight =
            |name: &str| ["point.", "global.", "vote."].iter().any(|part| name.starts_with(part));
        let weights = all.iter().filter(|(name, _)| is_weight(name));
        let weights = weights.map(|(name, w)| (name.clone(), w.clone())).collect();
        Self { all, weights }
    }

    fn values(&self, name: &str) -> &[f32] {
        &self.all[name].values
    }

    fn pass(&self) -> Pass {
        let device = Device::flex().autodiff();
        Pass::forward(&device, &self.weights, self.values("points").to_vec(), SETS, VOTERS)
    }
}

fn assert_near(name: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{name}");
    let scale = expected.iter().fold(0.1_f32, |most, v| most.max(v.abs()));
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() < 2e-5 * scale, "{name} {k}: {a}, PyTorch has {b}");
    }
}

#[test]
fn votes_and_derivatives_are_those_of_pytorch() {
    let golden = Golden::read();
    let pass = golden.pass();
    assert_near("votes", &pass.votes(), golden.values("votes"));
    let gradients = pass.backward(golden.values("gradient.votes").to_vec());
    assert_eq!(gradients.len(), golden.weights.len());
    for (name, gradient) in &gradients {
        assert_near(name, gradient, golden.values(&format!("gradient.{name}")));
    }
}

#[test]
fn inference_gives_the_votes_of_training() {
    let golden = Golden::read();
    let mut tensors: BTreeMap<String, Tensor> = golden.weights.clone();
    let turns = golden.all["turns"].clone();
    tensors.insert("object.symmetries".into(), turns);
    tensors.insert("object.center".into(), Tensor { shape: vec![3], values: vec![0.0; 3] });
    tensors.insert("object.radius".into(), Tensor { shape: vec![1], values: vec![0.1] });
    let network = PoseNetwork::from_tensors(Path::new("golden"), tensors).unwrap();
    let points = golden.values("points").as_chunks::<CHANNELS>().0;
    let each = points.len() / SETS;
    let votes = network.votes(&[&points[..each], &points[each..]], VOTERS);
    let votes: Vec<f32> = votes.into_iter().flatten().flatten().collect();
    assert_near("votes", &votes, golden.values("votes"));
}

#[test]
fn loss_and_derivative_are_those_of_pytorch() {
    let golden = Golden::read();
    let matrices = |name: &str| -> Vec<Matrix3<f32>> {
        let rows = golden.values(name).as_chunks::<9>().0;
        rows.iter().map(|m| Matrix3::from_row_slice(m)).collect()
    };
    let vectors = |name: &str, width: usize| -> Vec<Vector3<f32>> {
        let rows = golden.values(name).chunks(width);
        rows.map(|v| Vector3::new(v[0], v[1], v[2])).collect()
    };
    let object = ObjectPoints::of(vectors("model", 3), matrices("turns"));
    let truths = matrices("truth.rotation").into_iter().zip(vectors("truth.position", 3));
    let truths: Vec<TrueView> =
        truths.map(|(rotation, position)| TrueView { rotation, position }).collect();
    let all = vectors("points", CHANNELS);
    let each = all.len() / SETS;
    let positions: Vec<Vector3<f32>> =
        all.chunks(each).flat_map(|set| set[..VOTERS].to_vec()).collect();
    let votes = golden.values("votes");
    let loss = confidence_weighted_loss(&object, votes, &positions, &truths);
    assert_near("loss", &[loss.value], golden.values("loss"));
    assert_near("distance", &[loss.distance], golden.values("distance"));
    assert_near("gradient", &loss.gradient, golden.values("gradient.votes"));
    assert_eq!(loss.gradient.len(), SETS * VOTERS * VOTE);
}
