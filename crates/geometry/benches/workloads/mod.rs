//! Jobs for a geometry library, and how this crate does them. Everything is generated, the same on every
//! machine: a bumpy body of 16 128 faces, a hand of 17 overlapping capsules around it, and points about them.
//!
//! `benches/peers/geometry` mounts this module too and adds other crates to each [`Comparison`](table::Comparison).

pub(crate) mod bodies;
pub(crate) mod closest;
pub(crate) mod cloud;
pub(crate) mod contact;
pub(crate) mod grid;
mod oracle;
pub(crate) mod overlap;
mod points;
pub(crate) mod sign;
pub(crate) mod table;

use nalgebra::Point3;
use prehend_geometry::{ClosestPoints, KdTree, TriMesh};

use self::cloud::Clouds;
use self::grid::Lattice;
use self::points::QuerySet;
use self::sign::Tetrahedron;
use self::table::Comparison;

/// Geometry of the workloads.
pub(crate) struct Scenes {
    /// The body that is queried, 16 128 faces.
    pub(crate) body: TriMesh,
    tree: ClosestPoints,
    /// The links of the hand, 17 closed meshes that overlap.
    pub(crate) links: Vec<TriMesh>,
    /// All links in one mesh, 9 520 faces.
    pub(crate) hand: TriMesh,
    /// Points on the body, near it, and in a box about it.
    pub(crate) sets: [QuerySet; 3],
    /// Points on the body whose distance to the hand is asked for.
    pub(crate) samples: Vec<Point3<f64>>,
    pub(crate) lattice: Lattice,
    pub(crate) tetrahedron: Tetrahedron,
    /// Two bodies of 10 000 faces that overlap.
    pub(crate) pair: [TriMesh; 2],
    /// The body in many poses about the hand.
    pub(crate) posed: Vec<TriMesh>,
    pub(crate) cubes: Vec<overlap::Cubes>,
    pub(crate) clouds: Clouds,
    pub(crate) neighbors: KdTree,
}

impl Scenes {
    /// # Panics
    /// If the crate does not accept the body.
    pub(crate) fn new() -> Self {
        let body = bodies::body();
        let links = bodies::hand();
        let clouds = Clouds::new(&body);
        let neighbors = KdTree::new(&clouds.target).expect("finite points");
        let mut hand = TriMesh::default();
        links.iter().for_each(|link| hand.append(link));
        Self {
            tree: ClosestPoints::new(&body).expect("a sound body"),
            sets: points::query_sets(&body),
            samples: points::on_surface(&body, 100_000, 13).into_iter().map(|s| s.point).collect(),
            lattice: Lattice::about(&body),
            tetrahedron: Tetrahedron::new(),
            pair: bodies::pair(),
            posed: overlap::poses().iter().map(|pose| body.transformed(pose)).collect(),
            cubes: overlap::cubes(),
            clouds,
            neighbors,
            body,
            links,
            hand,
        }
    }
}

/// One comparison for each workload.
pub(crate) struct Comparisons<'a> {
    pub(crate) tree: Comparison<'a>,
    pub(crate) closest: [Comparison<'a>; 3],
    pub(crate) contact: Comparison<'a>,
    pub(crate) sign: Comparison<'a>,
    pub(crate) grid: Comparison<'a>,
    pub(crate) union: Comparison<'a>,
    pub(crate) pair: Comparison<'a>,
    pub(crate) grasp: Comparison<'a>,
    pub(crate) poses: Comparison<'a>,
    pub(crate) cubes: Comparison<'a>,
    pub(crate) cloud: Comparison<'a>,
    pub(crate) nearest: Comparison<'a>,
}

impl<'a> Comparisons<'a> {
    /// All workloads, with this crate in them.
    pub(crate) fn new(scenes: &'a Scenes) -> Self {
        let Scenes { body, tree, hand, links, .. } = scenes;
        Self {
            tree: closest::build(body, &scenes.sets[1]),
            closest: scenes.sets.each_ref().map(|set| closest::queries(body, tree, set)),
            contact: contact::area(hand, &scenes.samples),
            sign: sign::of_tetrahedron(&scenes.tetrahedron),
            grid: grid::whole(body, tree, &scenes.lattice),
            union: overlap::union(links),
            pair: overlap::pair(&scenes.pair),
            grasp: overlap::grasp(links, body),
            poses: overlap::in_poses(links, &scenes.posed),
            cubes: overlap::of_cubes(&scenes.cubes),
            cloud: cloud::build(&scenes.clouds),
            nearest: cloud::nearest(&scenes.clouds, &scenes.neighbors),
        }
    }

    /// Times the workloads that the command line picks and prints the table.
    pub(crate) fn print(self) {
        let [on, near, around] = self.closest;
        table::print(vec![
            self.tree,
            on,
            near,
            around,
            self.contact,
            self.sign,
            self.grid,
            self.union,
            self.pair,
            self.grasp,
            self.poses,
            self.cubes,
            self.cloud,
            self.nearest,
        ]);
    }
}

/// Keeps every library from spreading its work: figures are those of one core.
///
/// # Panics
/// If something has used the pool of threads already.
pub(crate) fn use_one_thread() {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().expect("no threads yet");
}
