//! kiddo: the immutable k-d tree, which its documentation recommends for points that are known beforehand.
//! It has no registration, so the steps of ICP around its queries are written here.

use ::kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::workloads::cloud::{Registration, few};
use crate::workloads::{Comparisons, Scenes};

const NAME: &str = "kiddo";

type Tree = ImmutableKdTree<f64, 3>;

pub(crate) fn add<'a>(to: &mut Comparisons<'a>, scenes: &'a Scenes) {
    let clouds = &scenes.registration;
    let distances = |tree: Tree| few(clouds).iter().map(|p| nearest(&tree, p).1.sqrt()).collect();
    to.cloud.add(NAME, || tree(clouds), distances);
    let own = tree(clouds);
    let all = move || clouds.source.iter().map(|p| nearest(&own, p)).collect();
    let distances = |found: Vec<(usize, f64)>| found.iter().map(|(_, d)| d.sqrt()).collect();
    to.nearest.add(NAME, all, distances);
    let own = tree(clouds);
    let name = "kiddo and normal equations";
    to.registration.add(name, move || align(&own, clouds), |pose| clouds.corners(&pose));
}

fn tree(clouds: &Registration) -> Tree {
    let points: Vec<[f64; 3]> = clouds.target.iter().map(|p| (*p).into()).collect();
    Tree::new_from_slice(&points).expect("a tree of finite points")
}

/// The nearest point of the target, and its squared distance \[m²\].
fn nearest(tree: &Tree, point: &Point3<f64>) -> (usize, f64) {
    let found = tree.query(&(*point).into()).nearest_one::<SquaredEuclidean<f64>>().execute();
    (found.item as usize, found.distance)
}

/// Gauss–Newton steps on the distances along the normals of the target.
fn align(tree: &Tree, clouds: &Registration) -> Isometry3<f64> {
    let mut pose = Isometry3::identity();
    for _ in 0..Registration::STEPS {
        let (mut matrix, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for point in &clouds.source {
            let point = pose * point;
            let (i, squared) = nearest(tree, &point);
            if squared > Registration::REACH * Registration::REACH {
                continue;
            }
            let normal = clouds.normals[i];
            let lever = point.coords.cross(&normal);
            let row = Vector6::new(normal.x, normal.y, normal.z, lever.x, lever.y, lever.z);
            matrix.ger(1.0, &row, &row, 1.0);
            right += row * normal.dot(&(clouds.target[i] - point));
        }
        let step = matrix.cholesky().expect("a body that constrains every motion").solve(&right);
        let [shift, turn] = [0, 3].map(|i| Vector3::new(step[i], step[i + 1], step[i + 2]));
        pose = Translation3::from(shift) * UnitQuaternion::from_scaled_axis(turn) * pose;
    }
    pose
}
