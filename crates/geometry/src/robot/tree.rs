//! Are the links and joints one tree, and in which order are they visited?

use super::{Joint, Link, Result, RobotError};

/// Joints ordered so that every parent link comes before its children, and the root link.
pub(super) fn order(links: &[Link], joints: &[Joint]) -> Result<(Vec<usize>, usize)> {
    let mut parent_joint: Vec<Option<usize>> = vec![None; links.len()];
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
    for (j, joint) in joints.iter().enumerate() {
        if let Some(first) = parent_joint[joint.child].replace(j) {
            return Err(RobotError::TwoParents {
                link: links[joint.child].name.clone(),
                first: joints[first].name.clone(),
                second: joint.name.clone(),
            });
        }
        children[joint.parent].push(j);
    }
    let roots: Vec<usize> = (0..links.len()).filter(|&l| parent_joint[l].is_none()).collect();
    if roots.is_empty() && !links.is_empty() {
        return Err(RobotError::Cycle { kind: "link", name: links[0].name.clone() });
    }
    let &[root] = roots.as_slice() else {
        let names = roots.iter().map(|&l| links[l].name.clone()).collect();
        return Err(RobotError::Roots { roots: names });
    };
    let mut order = Vec::with_capacity(joints.len());
    let mut reached = vec![false; links.len()];
    reached[root] = true;
    let mut open = vec![root];
    while let Some(link) = open.pop() {
        for &j in children[link].iter().rev() {
            order.push(j);
            reached[joints[j].child] = true;
            open.push(joints[j].child);
        }
    }
    // Every link but the root has one parent: what the root does not reach runs in a circle.
    match reached.iter().position(|r| !r) {
        Some(l) => Err(RobotError::Cycle { kind: "link", name: links[l].name.clone() }),
        None => Ok((order, root)),
    }
}
