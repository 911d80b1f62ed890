//! Are the links and joints one tree, and in which order are they visited?

use std::collections::BTreeSet;

use super::{Joint, Link, Result, RobotError};

/// Joints ordered so that every parent link comes before its children, and the root link.
pub(super) fn order(links: &[Link], joints: &[Joint]) -> Result<(Vec<usize>, usize)> {
    let in_cycle =
        |l: usize| RobotError::structure(format!("link '{}' is part of a cycle", links[l].name));
    let mut parent_joint: Vec<Option<usize>> = vec![None; links.len()];
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
    for (j, joint) in joints.iter().enumerate() {
        if let Some(first) = parent_joint[joint.child].replace(j) {
            let (link, first, second) =
                (&links[joint.child].name, &joints[first].name, &joint.name);
            return Err(RobotError::structure(format!(
                "link '{link}' is the child of both joint '{first}' and joint '{second}'"
            )));
        }
        children[joint.parent].push(j);
    }
    let roots: Vec<usize> = (0..links.len()).filter(|&l| parent_joint[l].is_none()).collect();
    if roots.is_empty() && !links.is_empty() {
        return Err(in_cycle(0));
    }
    let &[root] = roots.as_slice() else {
        let names: Vec<&str> = roots.iter().map(|&l| links[l].name.as_str()).collect();
        let (count, names) = (names.len(), names.join(", "));
        return Err(RobotError::structure(format!(
            "expected one root link, found {count}: {names}"
        )));
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
        Some(l) => Err(in_cycle(l)),
        None => Ok((order, root)),
    }
}

/// Refuses names that two links or two joints, as `kind` says, share.
pub(super) fn unique<'a>(
    kind: &'static str,
    names: impl Iterator<Item = &'a String>,
) -> Result<()> {
    let mut seen = BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(RobotError::structure(format!("more than one {kind} is named '{name}'")));
        }
    }
    Ok(())
}
