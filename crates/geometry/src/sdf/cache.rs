//! Distance grids kept in a folder between runs.

use std::path::PathBuf;

use nalgebra::Point3;

use super::SdfGrid;
use super::file::hash;
use crate::mesh::TriMesh;

/// Changes with whatever changes the grids of a link, of which a test below has some numbers.
const VERSION: u32 = 2;

/// A folder of distance grids, by a hash of meshes, spacing and margin.
///
/// Any number of processes may share one: grids are written atomically, and every process writes the same one. Grids
/// that are damaged, or of another version, are built again. Where the folder cannot be written, grids are built but not
/// kept. Nothing is ever removed.
#[derive(Clone, Debug)]
pub struct GridCache {
    folder: PathBuf,
    /// Told before a grid is built.
    tell: Option<fn(&str)>,
}

impl GridCache {
    /// The cache in `folder`, which is made when the first grid is written.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), tell: None }
    }

    /// With a function that is told of each grid that is not here and has to be built, which may take seconds.
    pub fn telling(self, tell: fn(&str)) -> Self {
        Self { tell: Some(tell), ..self }
    }

    /// The grid about all of `parts` within `bounds`, of that spacing and margin \[m\]: as it was left here, or as `build` makes it.
    pub(crate) fn grid<E>(
        &self,
        parts: &[TriMesh],
        bounds: (Point3<f64>, Point3<f64>),
        [spacing, margin]: [f64; 2],
        build: impl FnOnce() -> Result<SdfGrid, E>,
    ) -> Result<SdfGrid, E> {
        let key = key(parts, [spacing, margin]);
        let file = self.folder.join(format!("{key:016x}.sdf"));
        let kept = SdfGrid::load(&file).ok();
        // Grids of another shape by chance of the hash, one in 2⁶⁴, would need to have the same box besides.
        if let Some(grid) = kept.filter(|g| g.bounds() == bounds && g.spacing() == spacing) {
            return Ok(grid);
        }
        if let Some(tell) = self.tell {
            let faces: usize = parts.iter().map(|part| part.faces.len()).sum();
            tell(&format!("building a distance grid of {faces} faces, kept for later runs"));
        }
        let grid = build()?;
        // What cannot be kept is made again next time.
        let _ = std::fs::create_dir_all(&self.folder).map(|()| grid.save(&file));
        Ok(grid)
    }
}

fn key(parts: &[TriMesh], lengths: [f64; 2]) -> u64 {
    let mut bytes = Vec::new();
    bytes.extend(u64::from(VERSION).to_le_bytes());
    lengths.iter().for_each(|length| bytes.extend(length.to_le_bytes()));
    for part in parts {
        bytes.extend((part.vertices.len() as u64).to_le_bytes());
        part.vertices.iter().flat_map(|v| v.iter()).for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend((part.faces.len() as u64).to_le_bytes());
        part.faces.iter().flatten().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    hash(&bytes)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::closest::ClosestPoints;
    use crate::sdf::SdfError;
    use crate::shapes::cuboid;

    /// A cache, a shape, and how often its grid was built.
    struct Fixture {
        cache: GridCache,
        parts: [TriMesh; 1],
        built: Cell<usize>,
    }

    impl Fixture {
        fn new(folder: &Path, width: f64) -> Self {
            let parts = [cuboid([width, 0.02, 0.03].into())];
            Self { cache: GridCache::new(folder.join("deep/er")), parts, built: Cell::new(0) }
        }

        fn grid(&self, spacing: f64) -> SdfGrid {
            let shape = ClosestPoints::new(&self.parts[0]).unwrap();
            let build = || -> Result<SdfGrid, SdfError> {
                self.built.set(self.built.get() + 1);
                SdfGrid::build(&shape, spacing, 0.01)
            };
            self.cache.grid(&self.parts, shape.bounds(), [spacing, 0.01], build).unwrap()
        }

        fn files(&self) -> Vec<PathBuf> {
            let files = fs::read_dir(&self.cache.folder).unwrap();
            files.map(|file| file.unwrap().path()).collect()
        }
    }

    #[test]
    fn a_grid_is_built_once() {
        let folder = tempfile::tempdir().unwrap();
        let fixture = Fixture::new(folder.path(), 0.01);
        let (built, kept) = (fixture.grid(0.004), fixture.grid(0.004));
        assert_eq!((fixture.built.get(), fixture.files().len()), (1, 1));
        for point in [Point3::origin(), Point3::new(0.011, 0.0, -0.003)] {
            assert_eq!(built.evaluate(&point), kept.evaluate(&point));
        }
        // Another spacing or another shape is another grid.
        fixture.grid(0.003);
        Fixture::new(folder.path(), 0.011).grid(0.004);
        assert_eq!((fixture.built.get(), fixture.files().len()), (2, 3));
    }

    /// If this fails because grids are made otherwise now, raise [`VERSION`] with the numbers: files of before would go on being used.
    #[test]
    fn grids_are_those_of_this_version() {
        let folder = tempfile::tempdir().unwrap();
        let grid = Fixture::new(folder.path(), 0.01).grid(0.004);
        let of = |x, y, z| grid.value(&Point3::new(x, y, z));
        let found = [of(0.001, 0.002, 0.003), of(0.007, 0.001, -0.002), of(0.009, 0.014, 0.018)];
        let expected = [-0.004_699_984_568_997, 0.002_099_450_285_912, 0.006_329_357_092_998];
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(VERSION == 2 && off < 1e-12, "{found:?}");
    }

    #[test]
    fn a_shape_that_is_turned_in_its_box_is_another() {
        let folder = tempfile::tempdir().unwrap();
        let fixture = Fixture::new(folder.path(), 0.01);
        let mut turned = fixture.parts.clone();
        // Signs change in pairs, and nothing else.
        turned[0].vertices.iter_mut().for_each(|v| *v = Point3::new(-v.x, -v.y, v.z));
        assert_ne!(key(&fixture.parts, [0.004, 0.01]), key(&turned, [0.004, 0.01]));
    }

    #[test]
    fn what_is_damaged_or_another_shape_s_is_built_anew() {
        let folder = tempfile::tempdir().unwrap();
        let fixture = Fixture::new(folder.path(), 0.01);
        fixture.grid(0.004);
        let file = fixture.files().remove(0);
        let whole = fs::read(&file).unwrap();
        fs::write(&file, &whole[..whole.len() / 2]).unwrap();
        fixture.grid(0.004);
        assert_eq!((fixture.built.get(), fs::read(&file).unwrap() == whole), (2, true));
        let other = Fixture::new(folder.path(), 0.013);
        other.grid(0.004);
        let foreign = other.files().into_iter().find(|f| *f != file).unwrap();
        fs::copy(foreign, &file).unwrap();
        fixture.grid(0.004);
        assert_eq!((fixture.built.get(), fs::read(&file).unwrap() == whole), (3, true));
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_none() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("deep"), "a file").unwrap();
        let fixture = Fixture::new(folder.path(), 0.01);
        fixture.grid(0.004);
        fixture.grid(0.004);
        assert_eq!(fixture.built.get(), 2);
    }

    #[test]
    fn many_may_write_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let grids: Vec<SdfGrid> = std::thread::scope(|scope| {
            let one = || Fixture::new(folder.path(), 0.01).grid(0.004);
            let threads: Vec<_> = (0..8).map(|_| scope.spawn(one)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        let point = Point3::new(0.004, 0.012, 0.0);
        assert!(grids.iter().all(|grid| grid.evaluate(&point) == grids[0].evaluate(&point)));
        assert_eq!(Fixture::new(folder.path(), 0.01).files().len(), 1);
    }
}
