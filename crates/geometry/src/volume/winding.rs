//! Winding numbers of one surface about the vertices of another.

use super::arrangement::{EdgeCrossing, crossings_of};
use super::chain::{Chain, NearFaces, SIDES};
use crate::topology::Groups;

/// Winding numbers of `other` about the vertices of `own`, of which `region` lies within the bounds of `other`.
///
/// `crossings` tell how they change along the sides of faces. Beyond the bounds they are zero; only where no side leads there, a
/// ray is followed.
pub(super) fn windings(
    own: &Chain,
    region: &NearFaces,
    other: &Chain,
    crossings: &[EdgeCrossing],
    other_is_a: bool,
) -> Vec<i32> {
    let mut known = Groups::new(own.positions.len() + 1);
    // All that lies beyond the bounds is one thing.
    let thing = |v: u32| if region.beyond[v as usize] == 0 { v + 1 } else { BEYOND };
    let mut rest = crossings;
    for &f in &region.faces {
        let here = crossings_of(f, &mut rest);
        let face = own.faces[f as usize];
        // Two sides lead to all corners.
        for (k, [from, to]) in SIDES.into_iter().enumerate().take(2) {
            let of_side = here.iter().filter(|c| c.side as usize % 3 == k);
            known.join(thing(face[from]), thing(face[to]), of_side.map(|c| c.change).sum());
        }
    }
    let things: Vec<u32> = (0..own.positions.len() as u32).map(thing).collect();
    let mut is_root = |thing: &u32| *thing != BEYOND && known.root(*thing).0 == *thing;
    let roots: Vec<u32> = things.iter().copied().filter(&mut is_root).collect();
    let points: Vec<_> = roots.iter().map(|root| own.positions[*root as usize - 1]).collect();
    for (root, winding) in roots.iter().zip(other.windings(&points, other_is_a)) {
        known.join(BEYOND, *root, winding);
    }
    things.iter().map(|thing| known.root(*thing).1).collect()
}

/// The thing that stands for all vertices beyond the bounds.
const BEYOND: u32 = 0;
