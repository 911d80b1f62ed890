//! The initial poses of a study.

use std::path::Path;

use crate::data::bop::{DatasetError, ResultRow, read_results};
use crate::data::identity::file_fingerprint;

/// One initial pose of a study: a frame, at a level of noise.
#[derive(Clone, Debug)]
pub struct InitialPose {
    /// Name of the level; `low` and `high` are the paper's.
    pub(super) level: String,
    /// Index among the readable rows of the level's file.
    pub(super) frame: usize,
    /// Rows of the file that were asked for, unreadable ones included.
    pub(super) frames: usize,
    /// The pose.
    pub(super) row: ResultRow,
    /// Which of the image's rows it is.
    pub(super) instance: usize,
    /// Fingerprint of the file.
    pub(super) fingerprint: String,
}

impl InitialPose {
    /// Reads a level's results file of initial poses, keeping the rows that `admit` admits; and what is wrong with rows that
    /// cannot be read.
    ///
    /// # Errors
    /// If the file cannot be read at all.
    pub fn read(
        level: &str,
        file: &Path,
        admit: impl Fn(&ResultRow) -> bool,
    ) -> Result<(Vec<Self>, Vec<String>), DatasetError> {
        let fingerprint = file_fingerprint(file)?;
        let read = read_results(file)?;
        let rows = read.rows.into_iter().zip(read.instances).enumerate();
        let rows: Vec<_> = rows.filter(|(_, (row, _))| admit(row)).collect();
        let frames = rows.len() + read.errors.len();
        let pose = |(frame, (row, instance))| Self {
            level: level.into(),
            frame,
            frames,
            row,
            instance,
            fingerprint: fingerprint.clone(),
        };
        Ok((rows.into_iter().map(pose).collect(), read.errors))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_keep_the_numbers_of_frames() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("init_low.csv");
        let row = |id: u32| format!("1,{id},5,1,1 0 0 0 1 0 0 0 1,0 0 500,-1\n");
        std::fs::write(&file, row(0) + &row(1) + "1,2,5,1,1 0 0,0 0 500,-1\n" + &row(3)).unwrap();
        let (poses, unreadable) = InitialPose::read("low", &file, |r| r.im_id > 0).unwrap();
        let numbers: Vec<_> = poses.iter().map(|p| (p.row.im_id, p.frame, p.frames)).collect();
        assert_eq!(numbers, [(1, 1, 3), (3, 2, 3)]);
        assert!(
            unreadable.len() == 1 && unreadable[0].starts_with("line 3: R: "),
            "{unreadable:?}"
        );
    }
}
