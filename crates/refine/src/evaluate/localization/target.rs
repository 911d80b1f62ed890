//! Targets of localization, and their scores.

/// An object to be localized in one image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LocalizationTarget {
    /// Scene of the split.
    pub scene_id: u32,
    /// Image of the scene.
    pub im_id: u32,
    /// The object.
    pub obj_id: u32,
    /// How many instances of it are to be found: the most visible ones.
    pub instances: usize,
}

/// How often the instances of one target were found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TargetScore {
    /// The target.
    pub target: LocalizationTarget,
    /// Number of estimates that count, at most one an instance.
    pub estimates: usize,
    /// Number of times that they are found by VSD, MSSD and MSPD.
    pub(super) found: [usize; 3],
    /// True where depth was measured.
    pub(super) has_depth: bool,
}
