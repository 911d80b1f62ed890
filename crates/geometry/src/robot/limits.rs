//! Joint limits: checking and clamping joint vectors.

use super::{Drive, Joint, KinematicTree, Result, RobotError};

/// Positions that an entry of the joint vector may take.
#[derive(Clone, Debug)]
pub(super) struct Range {
    lower: f64,
    upper: f64,
    /// The joints whose limits these are.
    by: [Option<usize>; 2],
}

/// Limits of each entry of the joint vector: those of its joint and, brought back through multiplier and offset, of the
/// joints that mimic it.
pub(super) fn ranges(joints: &[Joint], variables: &[String]) -> Result<Vec<Range>> {
    let free = Range { lower: f64::NEG_INFINITY, upper: f64::INFINITY, by: [None; 2] };
    let mut ranges = vec![free; variables.len()];
    for (j, joint) in joints.iter().enumerate() {
        let (Some(limits), Drive::Variable { index, multiplier, offset }) =
            (joint.limits, joint.drive)
        else {
            continue;
        };
        // A multiplier of zero holds the joint where it is, whatever moves.
        let (a, b) = ((limits.0 - offset) / multiplier, (limits.1 - offset) / multiplier);
        if multiplier == 0.0 || a.is_nan() || b.is_nan() {
            continue;
        }
        let (lower, upper) = if multiplier > 0.0 { (a, b) } else { (b, a) };
        let range = &mut ranges[index];
        if lower > range.lower {
            (range.lower, range.by[0]) = (lower, Some(j));
        }
        if upper < range.upper {
            (range.upper, range.by[1]) = (upper, Some(j));
        }
    }
    match ranges.iter().position(|r| r.lower > r.upper) {
        None => Ok(ranges),
        Some(i) => Err(RobotError::Limits {
            joint: variables[i].clone(),
            lower: ranges[i].lower,
            upper: ranges[i].upper,
            by: ranges[i].named(joints),
        }),
    }
}

impl Range {
    fn named(&self, joints: &[Joint]) -> String {
        let mut names: Vec<_> =
            self.by.iter().flatten().map(|&j| format!("joint '{}'", joints[j].name)).collect();
        names.dedup();
        names.join(" and ")
    }
}

impl KinematicTree {
    /// Smallest and largest position \[rad or m\] of each entry of the joint vector, infinite where there is no limit.
    ///
    /// The limits of joints that mimic an entry count too, so that none of them leaves its own.
    pub fn joint_limits(&self) -> Vec<(f64, f64)> {
        self.ranges.iter().map(|r| (r.lower, r.upper)).collect()
    }

    /// Whether `joints` holds one finite position for each of [`KinematicTree::joint_names`], all within their limits.
    ///
    /// # Errors
    /// [`RobotError::JointCount`], [`RobotError::Number`] or [`RobotError::OutsideLimits`], naming the joint.
    pub fn check_joints(&self, joints: &[f64]) -> Result<()> {
        self.check_finite(joints)?;
        let outside = |(q, r): (&f64, &Range)| *q < r.lower || *q > r.upper;
        match joints.iter().zip(&self.ranges).position(outside) {
            None => Ok(()),
            Some(i) => Err(RobotError::OutsideLimits {
                joint: self.variables[i].clone(),
                position: joints[i],
                lower: self.ranges[i].lower,
                upper: self.ranges[i].upper,
                by: self.ranges[i].named(&self.joints),
            }),
        }
    }

    /// The nearest joint vector within the limits.
    ///
    /// # Errors
    /// [`RobotError::JointCount`] or [`RobotError::Number`].
    pub fn clamp_joints(&self, joints: &[f64]) -> Result<Vec<f64>> {
        self.check_finite(joints)?;
        Ok(joints.iter().zip(&self.ranges).map(|(q, r)| q.max(r.lower).min(r.upper)).collect())
    }

    /// Whether there is one finite position for each name.
    pub(super) fn check_finite(&self, joints: &[f64]) -> Result<()> {
        let (given, expected) = (joints.len(), self.variables.len());
        if given != expected {
            return Err(RobotError::JointCount { given, expected });
        }
        match joints.iter().position(|q| !q.is_finite()) {
            None => Ok(()),
            Some(i) => Err(RobotError::Number {
                owner: format!("joint '{}'", self.variables[i]),
                field: "position",
                requirement: "must be finite",
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(mimic_limit: &str, last: &str) -> Result<KinematicTree> {
        let xml = format!(
            r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/>
            <joint name="p" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
            <joint name="q" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/><mimic joint="p" multiplier="-0.5" offset="0.25"/>{mimic_limit}</joint>
            <joint name="r" type="continuous"><parent link="c"/><child link="d"/><axis xyz="0 0 1"/></joint>
            <joint name="s" type="revolute"><parent link="d"/><child link="e"/><axis xyz="0 0 1"/>{last}</joint></robot>"#
        );
        KinematicTree::from_urdf_str(&xml, None)
    }

    fn limit(lower: f64, upper: f64) -> String {
        format!("<limit lower=\"{lower}\" upper=\"{upper}\" effort=\"1\" velocity=\"1\"/>")
    }

    #[test]
    fn limits_of_mimicking_joints_count() {
        let free = (f64::NEG_INFINITY, f64::INFINITY);
        let robot = robot(&limit(-0.25, 0.5), "").unwrap();
        // q = 0.25 - p / 2 is within -0.25 and 0.5 for p between -0.5 and 1; a missing tag limits nothing.
        assert_eq!(robot.joint_limits(), [(-0.5, 1.0), free, free]);
        robot.check_joints(&[1.0, 100.0, -7.0]).unwrap();
        let error = robot.check_joints(&[1.5, 0.0, 0.0]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "joint 'p' at 1.5 is outside -0.5 to 1, imposed by joint 'q'"
        );
        assert_eq!(robot.clamp_joints(&[1.5, 3.0, -9.0]).unwrap(), [1.0, 3.0, -9.0]);
        assert_eq!(robot.clamp_joints(&[-8.0, 0.0, 0.0]).unwrap(), [-0.5, 0.0, 0.0]);
        assert!(matches!(
            robot.check_joints(&[0.0]),
            Err(RobotError::JointCount { given: 1, expected: 3 })
        ));
        let error = robot.clamp_joints(&[0.0, f64::NAN, 0.0]).unwrap_err().to_string();
        assert!(error.contains("joint 'r'"), "{error}");
    }

    #[test]
    fn limits_that_contradict_each_other_name_their_joints() {
        let error = robot(&limit(5.0, 6.0), "").unwrap_err().to_string();
        assert!(error.contains("joint 'p': no position") && error.contains("joint 'q'"), "{error}");
        // Upside down there are none.
        let free = robot("", &limit(1.0, -1.0)).unwrap().joint_limits()[2];
        assert_eq!(free, (f64::NEG_INFINITY, f64::INFINITY));
        // A single position is a limit like any other.
        assert_eq!(robot("", &limit(0.0, 0.0)).unwrap().joint_limits()[2], (0.0, 0.0));
    }
}
