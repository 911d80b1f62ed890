//! Distance grids in files.
//!
//! Little-endian: `PREHSDF` and a zero byte; version (u32); samples along each axis (3 × u32); first sample \[m\] (3 ×
//! f64); spacing \[m\] (f64); smallest and largest corner of the shape's box \[m\] (6 × f64);
//! spline coefficients (f64, two more than samples along each axis, the last axis
//! fastest); and a hash of all that by 64-bit words after the first 8 bytes (u64).

use std::path::Path;

use nalgebra::Point3;

use super::lattice::FARTHEST;
use super::{Lattice, MAX_SAMPLES, SdfGrid};
use crate::io::read_plain;
use crate::io::{MeshError, Result, write_atomic};

const MAGIC: &[u8; 8] = b"PREHSDF\0";
const VERSION: u32 = 4;

/// No grid takes more: a spare coefficient on both sides of each axis at most doubles it.
const MAX_BYTES: usize = 120 + 8 * (8 * MAX_SAMPLES);

impl SdfGrid {
    /// Writes the grid to a file, atomically.
    ///
    /// # Errors
    /// [`MeshError::Write`].
    pub fn save(&self, path: &Path) -> Result<()> {
        write_atomic(path, &self.to_bytes())
            .map_err(|source| MeshError::Write { path: path.into(), source })
    }

    /// Reads a grid that [`Self::save`] wrote: the same to the last bit.
    ///
    /// # Errors
    /// [`MeshError::Read`], or [`MeshError::Malformed`] with the field that is wrong.
    pub fn load(path: &Path) -> Result<Self> {
        let bytes = read_plain(path, MAX_BYTES)
            .map_err(|source| MeshError::Read { path: path.into(), source })?;
        Self::from_bytes(&bytes)
            .map_err(|(field, reason)| MeshError::malformed(path, field, reason))
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(120 + 8 * self.coefficients.len());
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        // At most MAX_SAMPLES, so that they fit.
        self.dims().iter().for_each(|&n| bytes.extend((n as u32).to_le_bytes()));
        let origin = self.lattice.origin();
        let header = [self.spacing()];
        let bounds = self.bounds.0.iter().chain(self.bounds.1.iter());
        let numbers = origin.iter().chain(&header).chain(bounds);
        numbers.chain(&self.coefficients).for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend(hash(&bytes[MAGIC.len()..]).to_le_bytes());
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, (&'static str, String)> {
        let mut left = bytes;
        if take(&mut left, "magic")? != *MAGIC {
            return Err(("magic", "not a distance grid".into()));
        }
        let version = u32::from_le_bytes(take(&mut left, "version")?);
        if version != VERSION {
            return Err(("version", format!("{version} is not {VERSION}, the one that is read")));
        }
        let mut dims = [0; 3];
        for n in &mut dims {
            *n = u32::from_le_bytes(take(&mut left, "dims")?) as usize;
        }
        let origin = [(); 3].map(|()| number(&mut left, "origin"));
        let [x, y, z] = origin;
        let origin = Point3::new(x?, y?, z?);
        let spacing = number(&mut left, "spacing")?;
        let lattice =
            Lattice::new(origin, spacing, dims).map_err(|e| ("lattice", e.to_string()))?;
        let [a, b, c, d, e, f] = [(); 6].map(|()| number(&mut left, "bounds"));
        let bounds = (Point3::new(a?, b?, c?), Point3::new(d?, e?, f?));
        if !(0..3).all(|i| bounds.0[i] <= bounds.1[i] && (bounds.1[i] - bounds.0[i]).is_finite()) {
            return Err(("bounds", "not finite or of a negative size".into()));
        }
        // The lattice keeps this from overflowing.
        let count: usize = dims.iter().map(|n| n + 2).product();
        if left.len() != 8 * count + 8 {
            let reason = format!("{} bytes are left for {count} of them and a hash", left.len());
            return Err(("coefficients", reason));
        }
        let (body, end) = left.split_at(8 * count);
        if hash(&bytes[MAGIC.len()..bytes.len() - 8]).to_le_bytes() != *end {
            return Err(("hash", "the content is damaged".into()));
        }
        let mut body = body;
        let mut coefficients = Vec::with_capacity(count);
        for _ in 0..count {
            coefficients.push(number(&mut body, "coefficients")?);
        }
        // No distance is longer; a spline's coefficients go a little beyond its values.
        let longest = 10.0 * FARTHEST;
        if !coefficients.iter().all(|c| c.abs() <= longest) {
            return Err(("coefficients", format!("not all are within {longest:e} m")));
        }
        Ok(Self::from_coefficients(lattice, coefficients, bounds))
    }
}

/// The next `N` bytes.
fn take<const N: usize>(
    left: &mut &[u8],
    field: &'static str,
) -> Result<[u8; N], (&'static str, String)> {
    let (first, rest) =
        left.split_first_chunk().ok_or_else(|| (field, "the file ends here".to_string()))?;
    *left = rest;
    Ok(*first)
}

fn number(left: &mut &[u8], field: &'static str) -> Result<f64, (&'static str, String)> {
    take(left, field).map(f64::from_le_bytes)
}

/// Fowler, Noll and Vo's hash 1a, by words of eight bytes instead of one. A product carries nothing down, so that high bits, signs among them, are
/// folded into low ones.
pub(super) fn hash(bytes: &[u8]) -> u64 {
    bytes.chunks(8).fold(0xcbf2_9ce4_8422_2325, |hash, chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        let mixed = (hash ^ u64::from_le_bytes(word)).wrapping_mul(0x0000_0100_0000_01b3);
        mixed ^ (mixed >> 32)
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::closest::ClosestPoints;
    use crate::shapes::cuboid;

    fn grid() -> SdfGrid {
        let mesh = ClosestPoints::new(&cuboid(Vector3::new(0.4, 0.5, 0.6))).unwrap();
        let lattice = Lattice::around(mesh.bounds(), 0.1, 0.2).unwrap();
        SdfGrid::build_on(&mesh, lattice)
    }

    #[test]
    fn comes_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.sdf");
        let grid = grid();
        grid.save(&path).unwrap();
        let again = SdfGrid::load(&path).unwrap();
        assert_eq!(again.to_bytes(), grid.to_bytes());
        let p = Point3::new(0.21, 0.03, 0.14);
        assert_eq!(again.evaluate(&p), grid.evaluate(&p));
        assert_eq!(again.bounds(), grid.bounds());
        assert!(matches!(SdfGrid::load(folder.path()), Err(MeshError::Read { .. })));
        // A pipe or a device may never end.
        #[cfg(unix)]
        assert!(matches!(SdfGrid::load(Path::new("/dev/zero")), Err(MeshError::Read { .. })));
        let nowhere = folder.path().join("no/a.sdf");
        assert!(matches!(grid.save(&nowhere), Err(MeshError::Write { .. })));
    }

    #[test]
    fn damage_is_named() {
        let whole = grid().to_bytes();
        let field = |bytes: &[u8]| SdfGrid::from_bytes(bytes).unwrap_err().0;
        let changed = |at: usize, with: &[u8]| {
            let mut bytes = whole.clone();
            bytes[at..at + with.len()].copy_from_slice(with);
            field(&bytes)
        };
        assert_eq!(changed(0, b"x"), "magic");
        assert_eq!(changed(8, &[1]), "version");
        assert_eq!(changed(12, &[0]), "lattice");
        assert_eq!(changed(12, &[255; 12]), "lattice");
        assert_eq!(changed(16, &[99]), "coefficients");
        assert_eq!(changed(24, &f64::NAN.to_le_bytes()), "lattice");
        assert_eq!(changed(48, &(-1.0_f64).to_le_bytes()), "lattice");
        assert_eq!(changed(56, &9.0_f64.to_le_bytes()), "bounds");
        assert_eq!(changed(200, &[1, 2, 3]), "hash");
        // Two signs, and nothing else.
        let mut bytes = whole.clone();
        [207, 215].iter().for_each(|at| bytes[*at] ^= 0x80);
        assert_eq!(field(&bytes), "hash");
        // With a hash that fits.
        let mut bytes = whole.clone();
        bytes[104..112].copy_from_slice(&1e200_f64.to_le_bytes());
        let (body, end) = bytes.split_last_chunk_mut::<8>().unwrap();
        *end = hash(&body[MAGIC.len()..]).to_le_bytes();
        assert_eq!(field(&bytes), "coefficients");
        // No length is taken on trust, nor does any panic.
        for n in 0..whole.len().min(400) {
            field(&whole[..n]);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.sdf");
        std::fs::write(&path, &whole[..60]).unwrap();
        let message = SdfGrid::load(&path).unwrap_err().to_string();
        assert!(message.ends_with("a.sdf: bounds: the file ends here"), "{message}");
    }
}
