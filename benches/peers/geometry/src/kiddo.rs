//! kiddo: the immutable k-d tree, which its documentation recommends for points that are known beforehand.

use ::kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::Point3;

use crate::workloads::cloud::{Clouds, few};
use crate::workloads::{Comparisons, Scenes};

const NAME: &str = "kiddo";

type Tree = ImmutableKdTree<f64, 3>;

pub(crate) fn add<'a>(to: &mut Comparisons<'a>, scenes: &'a Scenes) {
    let clouds = &scenes.clouds;
    let distances = |tree: Tree| few(clouds).iter().map(|p| nearest(&tree, p).1.sqrt()).collect();
    to.cloud.add(NAME, || tree(clouds), distances);
    let own = tree(clouds);
    let all = move || clouds.source.iter().map(|p| nearest(&own, p)).collect();
    let distances = |found: Vec<(usize, f64)>| found.iter().map(|(_, d)| d.sqrt()).collect();
    to.nearest.add(NAME, all, distances);
}

fn tree(clouds: &Clouds) -> Tree {
    let points: Vec<[f64; 3]> = clouds.target.iter().map(|p| (*p).into()).collect();
    Tree::new_from_slice(&points).expect("a tree of finite points")
}

/// The nearest point of the target, and its squared distance \[m²\].
fn nearest(tree: &Tree, point: &Point3<f64>) -> (usize, f64) {
    let found = tree.query(&(*point).into()).nearest_one::<SquaredEuclidean<f64>>().execute();
    (found.item as usize, found.distance)
}
