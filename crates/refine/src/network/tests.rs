use std::collections::BTreeMap;

use prehend_geometry::SplitMix64;

use super::*;
use crate::scene::default_scene;

/// Tensors of a small network of `object` with random weights.
fn tensors(object: &Object) -> Tensors {
    let mut random = SplitMix64::new(3);
    let mut all = BTreeMap::new();
    let sizes = [
        ("point.0", CHANNELS, 8),
        ("point.1", 8, 12),
        ("point.2", 12, 16),
        ("global.0", 16, 10),
        ("vote.0", 12 + 10, 14),
        ("vote.1", 14, VOTE),
    ];
    for (name, inputs, outputs) in sizes {
        let mut values = |n: usize| (0..n).map(|_| 0.3 * random.normal() as f32).collect();
        let weight = Tensor { shape: vec![outputs, inputs], values: values(outputs * inputs) };
        let bias = Tensor { shape: vec![outputs], values: values(outputs) };
        all.insert(format!("{name}.weight"), weight);
        all.insert(format!("{name}.bias"), bias);
    }
    let center = object.center.coords.iter().map(|v| *v as f32).collect();
    all.insert("object.center".into(), Tensor { shape: vec![3], values: center });
    let radius = vec![object.radius as f32];
    all.insert("object.radius".into(), Tensor { shape: vec![1], values: radius });
    let identity = Matrix3::<f32>::identity().iter().copied().collect();
    all.insert("object.symmetries".into(), Tensor { shape: vec![1, 3, 3], values: identity });
    all
}

#[test]
fn a_network_is_read_as_it_was_written_and_gives_the_same_votes() {
    let scene = default_scene(1).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("network.safetensors");
    write_tensors(&file, &tensors(&scene.object)).unwrap();
    let network = PoseNetwork::load(&file).unwrap();
    let points = [[0.1; CHANNELS], [0.3; CHANNELS], [-0.2; CHANNELS]];
    let together = network.votes(&[&points, &points[..1]], 2);
    let alone = network.votes(&[&points], 2);
    assert_eq!((together[0].len(), together[1].len()), (2, 1));
    let apart = |a: &[f32; VOTE], b: &[f32; VOTE]| {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    assert!(apart(&together[0][1], &alone[0][1]) < 1e-5);
    // Another point that is in no way greater changes the whole: the maximum.
    assert!(apart(&together[1][0], &together[0][0]) > 1e-4);
    let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
    let found = network.find(&frame).unwrap();
    assert!((1..=5).contains(&found.len()));
    assert!(found.iter().map(|p| p.score).sum::<f64>() <= 1.0 + 1e-9);
    let bare = scene.frame.clone();
    let bare = crate::Frame { hand: None, ..bare };
    let bare = bare.color(prehend_render::RgbImage::filled(640, 480, [0.0; 3]));
    let frame = PreparedFrame::new(&bare, &scene.object).unwrap();
    assert!(!network.find(&frame).unwrap().is_empty());
}

#[test]
fn a_broken_or_foreign_file_is_a_clear_error() {
    let scene = default_scene(1).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("network.safetensors");
    let good = tensors(&scene.object);
    let refused = |change: &dyn Fn(&mut Tensors)| {
        let mut all = good.clone();
        change(&mut all);
        write_tensors(&file, &all).unwrap();
        PoseNetwork::load(&file).unwrap_err().to_string()
    };
    let renamed = refused(&|t| drop(t.remove("point.1.bias")));
    assert!(renamed.ends_with("network.safetensors: tensor point.1.bias: is missing"), "{renamed}");
    let cut = refused(&|t| drop(t.remove("vote.1.weight")));
    assert!(cut.contains("tensor vote.1.weight: must be the last, of 10 outputs"), "{cut}");
    let wide = refused(&|t| t.get_mut("global.0.weight").unwrap().shape = vec![16, 10]);
    assert!(wide.contains("global.0.weight: has the shape [16, 10], must have [n, 16]"), "{wide}");
    let nan = refused(&|t| t.get_mut("vote.0.bias").unwrap().values[2] = f32::NAN);
    assert!(nan.contains("vote.0.bias: number 2 is NaN"), "{nan}");
    let turned = refused(&|t| t.get_mut("object.symmetries").unwrap().values[0] = 2.0);
    assert!(turned.contains("object.symmetries: must be rotations"), "{turned}");
    std::fs::write(&file, b"PK\x03\x04 something else entirely").unwrap();
    let foreign = PoseNetwork::load(&file).unwrap_err().to_string();
    assert!(foreign.contains("no safetensors file: a header of "), "{foreign}");
    write_tensors(&file, &good).unwrap();
    let whole = std::fs::read(&file).unwrap();
    for length in [0, 7, 100, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&file, &whole[..length]).unwrap();
        assert!(PoseNetwork::load(&file).is_err(), "{length}");
    }
    let missing = PoseNetwork::load(&dir.path().join("none")).unwrap_err().to_string();
    assert!(missing.contains("none: "), "{missing}");
}

#[test]
fn another_object_is_refused() {
    let scene = default_scene(1).unwrap();
    let mut all = tensors(&scene.object);
    all.get_mut("object.radius").unwrap().values[0] *= 1.2;
    let network = PoseNetwork::from_tensors(Path::new("n"), all).unwrap();
    let frame = PreparedFrame::new(&scene.frame, &scene.object).unwrap();
    let refused = network.find(&frame).unwrap_err().to_string();
    assert!(refused.contains("the network is of another one"), "{refused}");
}
