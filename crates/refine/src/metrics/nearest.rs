//! Exact nearest neighbours among a fixed set of points.

use nalgebra::Point3;

/// A k-d tree over points: median splits along the widest axis, small leaves.
#[derive(Clone, Debug)]
pub struct NearestPoint {
    points: Vec<Point3<f64>>,
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
enum Node {
    Leaf {
        start: usize,
        end: usize,
    },
    /// The left child follows its parent directly.
    Split {
        axis: usize,
        at: f64,
        right: usize,
    },
}

const LEAF_SIZE: usize = 16;

impl NearestPoint {
    /// Builds the tree; coordinates must be finite.
    pub fn new(points: &[Point3<f64>]) -> Self {
        let mut tree = Self { points: points.to_vec(), nodes: Vec::new() };
        if !points.is_empty() {
            tree.build(0, points.len());
        }
        tree
    }

    fn build(&mut self, start: usize, end: usize) {
        let part = &mut self.points[start..end];
        let (lo, hi) = part.iter().fold((part[0], part[0]), |(lo, hi), p| (lo.inf(p), hi.sup(p)));
        if part.len() <= LEAF_SIZE || lo == hi {
            self.nodes.push(Node::Leaf { start, end });
            return;
        }
        let axis = (hi - lo).imax();
        let middle = part.len() / 2;
        part.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
        let at = part[middle][axis];
        let node = self.nodes.len();
        self.nodes.push(Node::Split { axis, at, right: 0 });
        self.build(start, start + middle);
        let right = self.nodes.len();
        self.nodes[node] = Node::Split { axis, at, right };
        self.build(start + middle, end);
    }

    /// The distance from `query` to the nearest point; infinite when there are no points.
    pub fn distance(&self, query: &Point3<f64>) -> f64 {
        let mut best = f64::INFINITY;
        if !self.nodes.is_empty() {
            self.search(0, query, &mut best);
        }
        best.sqrt()
    }

    fn search(&self, node: usize, query: &Point3<f64>, best: &mut f64) {
        match self.nodes[node] {
            Node::Leaf { start, end } => {
                for p in &self.points[start..end] {
                    *best = best.min((p - query).norm_squared());
                }
            }
            Node::Split { axis, at, right } => {
                let offset = query[axis] - at;
                let (near, far) = if offset < 0.0 { (node + 1, right) } else { (right, node + 1) };
                self.search(near, query, best);
                if offset * offset < *best {
                    self.search(far, query, best);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A deterministic stream of numbers in 0..1 (Weyl sequences with irrational steps).
    fn cloud(n: usize, shift: f64) -> Vec<Point3<f64>> {
        let at = |i: usize, step: f64| (shift + i as f64 * step).fract();
        (0..n).map(|i| Point3::new(at(i, 0.618034), at(i, 0.414214), at(i, 0.732051))).collect()
    }

    #[test]
    fn agrees_with_exhaustive_search() {
        let mut points = cloud(2000, 0.1);
        // Duplicates and a flat part, as mesh vertices have them.
        points.extend(cloud(300, 0.1));
        points.extend(cloud(300, 0.7).iter().map(|p| Point3::new(p.x, p.y, 0.25)));
        let tree = NearestPoint::new(&points);
        for q in cloud(500, 0.33).iter().map(|p| p * 1.4) {
            let exhaustive = points.iter().map(|p| (p - q).norm()).fold(f64::INFINITY, f64::min);
            assert!((tree.distance(&q) - exhaustive).abs() < 1e-15);
        }
        assert_eq!(tree.distance(&points[17]), 0.0);
    }

    #[test]
    fn many_equal_points_and_none() {
        let tree = NearestPoint::new(&vec![Point3::new(1.0, 2.0, 2.0); 1000]);
        assert_eq!(tree.distance(&Point3::origin()), 3.0);
        assert_eq!(NearestPoint::new(&[]).distance(&Point3::origin()), f64::INFINITY);
    }
}
