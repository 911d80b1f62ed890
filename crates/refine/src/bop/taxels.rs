//! Tables of taxel positions.

use std::fs;
use std::path::Path;

use nalgebra::{Point3, Unit, Vector3};

use super::error::DatasetError;

/// One tactile sensing element.
#[derive(Clone, Debug, PartialEq)]
pub struct Taxel {
    /// The URDF link it sits on.
    pub link: String,
    /// Its position in the link frame \[m\].
    pub position: Point3<f64>,
    /// The outward direction of the skin there, in the link frame.
    pub normal: Unit<Vector3<f64>>,
}

/// Reads a CSV table with the columns `link,x_m,y_m,z_m,nx,ny,nz` (others are ignored), one taxel a row
/// in the order of the force readings.
///
/// # Errors
/// When the file is absent, lacks a column, or a row has no number where one is needed; the field is
/// named `line N: column`.
pub fn read_taxels(file: &Path) -> Result<Vec<Taxel>, DatasetError> {
    let bytes = fs::read(file).map_err(|e| DatasetError::reading(file, &e))?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes.as_slice());
    let header = reader.headers().map_err(|e| DatasetError::malformed(file, e))?.clone();
    let column = |name: &str| {
        header.iter().position(|h| h == name).ok_or_else(|| DatasetError::Field {
            file: file.to_path_buf(),
            field: name.to_owned(),
            problem: "column is missing".into(),
        })
    };
    let link = column("link")?;
    let mut numeric = [("", 0); 6];
    for (slot, name) in numeric.iter_mut().zip(["x_m", "y_m", "z_m", "nx", "ny", "nz"]) {
        *slot = (name, column(name)?);
    }
    let mut taxels = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| DatasetError::malformed(file, e))?;
        let line = record.position().map_or(0, csv::Position::line);
        let fault = |name: &str, problem: String| DatasetError::Field {
            file: file.to_path_buf(),
            field: format!("line {line}: {name}"),
            problem,
        };
        let mut values = [0.0; 6];
        for (value, (name, column)) in values.iter_mut().zip(numeric) {
            let text = record.get(column).unwrap_or_default();
            *value = text.parse().map_err(|_| fault(name, format!("{text:?} is not a number")))?;
            if !f64::is_finite(*value) {
                return Err(fault(name, "is not finite".into()));
            }
        }
        let [x, y, z, nx, ny, nz] = values;
        let normal = Unit::try_new(Vector3::new(nx, ny, nz), 1e-6);
        taxels.push(Taxel {
            link: record.get(link).unwrap_or_default().to_owned(),
            position: Point3::new(x, y, z),
            normal: normal.ok_or_else(|| fault("nx", "the normal has no direction".into()))?,
        });
    }
    Ok(taxels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Taxel>, DatasetError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("taxels.csv");
        fs::write(&path, text).unwrap();
        read_taxels(&path)
    }

    #[test]
    fn columns_are_found_by_name() {
        let taxels = read("nz,idx,link,x_m,y_m,z_m,nx,ny\n0,0,tip,1,2,3,0,-2\n").unwrap();
        assert_eq!(taxels[0].link, "tip");
        assert_eq!(taxels[0].position, Point3::new(1.0, 2.0, 3.0));
        assert_eq!(taxels[0].normal.into_inner(), -Vector3::y());
    }

    #[test]
    fn faults_name_line_and_column() {
        let named = |text: &str| read(text).unwrap_err().to_string();
        assert!(named("link,x_m,y_m,z_m,nx,ny\na,1,2,3,0,0\n").contains("nz: column is missing"));
        let header = "link,x_m,y_m,z_m,nx,ny,nz\na,1,2,3,0,0,1\n";
        assert!(
            named(&format!("{header}a,1,two,3,0,0,1\n"))
                .contains("line 3: y_m: \"two\" is not a number")
        );
        assert!(
            named(&format!("{header}a,1,2,NaN,0,0,1\n")).contains("line 3: z_m: is not finite")
        );
        assert!(
            named(&format!("{header}a,1,2,3,0,0,0\n"))
                .contains("line 3: nx: the normal has no direction")
        );
        assert!(matches!(read(&format!("{header}a,1,2\n")), Err(DatasetError::Malformed { .. })));
    }
}
