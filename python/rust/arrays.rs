//! Arrays of NumPy, and whatever becomes one.

use std::borrow::Cow;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use numpy::ndarray::IxDyn;
use numpy::{AllowTypeChange, PyArray, PyArrayLikeDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error::wrong;

/// An array of NumPy.
pub(crate) type Array<'py, T = f64> = Bound<'py, PyArray<T, IxDyn>>;

/// An array of numbers, or a list of them.
pub(crate) type Numbers<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// Its numbers in the order of C, not copied if that is how they are.
pub(crate) fn in_order<'a, T: numpy::Element + Copy>(
    array: &'a PyArrayLikeDyn<'_, T, AllowTypeChange>,
) -> Cow<'a, [T]> {
    // A slice may be in the order of Fortran, too.
    match array.as_slice() {
        Ok(slice) if array.is_c_contiguous() => Cow::Borrowed(slice),
        _ => Cow::Owned(array.as_array().iter().copied().collect()),
    }
}

/// An array that owns `values`.
pub(crate) fn array<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: &[usize],
) -> PyResult<Array<'py>> {
    PyArray::from_vec(py, values).reshape(IxDyn(shape))
}

/// As many numbers as wanted.
fn exactly<const N: usize>(values: &[f64], what: &str) -> PyResult<[f64; N]> {
    <[f64; N]>::try_from(values)
        .map_err(|_| wrong(format!("{what}: {N} numbers are expected, not {}", values.len())))
}

/// Three numbers.
pub(crate) fn vector(array: &Numbers<'_>, what: &str) -> PyResult<Vector3<f64>> {
    exactly(&in_order(array), what).map(Vector3::from)
}

/// Three numbers, or none given.
pub(crate) fn vector_or(
    array: Option<&Numbers<'_>>,
    otherwise: [f64; 3],
    what: &str,
) -> PyResult<Vector3<f64>> {
    array.map_or(Ok(Vector3::from(otherwise)), |array| vector(array, what))
}

/// A symmetric matrix of 3 × 3 without negative eigenvalues, or its diagonal.
pub(crate) fn inertia(array: &Numbers<'_>) -> PyResult<Matrix3<f64>> {
    let values = in_order(array);
    let matrix = match values.len() {
        3 => Matrix3::from_diagonal(&Vector3::from(exactly(&values, "inertia")?)),
        _ => Matrix3::from_row_slice(&exactly::<9>(&values, "inertia")?),
    };
    let size = matrix.amax();
    let symmetric = (matrix - matrix.transpose()).amax() <= 1e-9 * size;
    match symmetric && matrix.symmetric_eigenvalues().min() >= -1e-9 * size {
        true => Ok(0.5 * (matrix + matrix.transpose())),
        false => Err(wrong("inertia: a symmetric matrix without negative eigenvalues is expected")),
    }
}

/// Triples of places among `count`, the faces of a mesh.
pub(crate) fn faces(array: &Numbers<'_>, count: usize) -> PyResult<Vec<[u32; 3]>> {
    let [_, 3] = array.shape() else {
        let shape = array.shape();
        return Err(wrong(format!("faces: an array of m × 3 is expected, not {shape:?}")));
    };
    let numbers = in_order(array);
    let place = |x: &f64| x.fract() == 0.0 && (0.0..count as f64).contains(x);
    match numbers.iter().find(|x| !place(x)) {
        Some(wild) => Err(wrong(format!("faces: there is no vertex {wild}"))),
        None => {
            Ok(numbers.as_chunks().0.iter().map(|face: &[f64; 3]| face.map(|x| x as u32)).collect())
        }
    }
}

/// Points in the rows of an array.
pub(crate) fn points(array: &Numbers<'_>, what: &str) -> PyResult<Vec<Point3<f64>>> {
    match array.shape() {
        [_, 3] => Ok(in_order(array).as_chunks().0.iter().copied().map(Point3::from).collect()),
        shape => Err(wrong(format!("{what}: an array of n × 3 is expected, not {shape:?}"))),
    }
}

/// How far the columns of a rotation may be from orthonormal.
const ORTHONORMAL: f64 = 1e-6;

/// A pose: a matrix of 4 × 4, or a translation alone \[m\]; none is the identity.
pub(crate) fn pose(array: Option<&Numbers<'_>>, what: &str) -> PyResult<Isometry3<f64>> {
    let Some(array) = array else { return Ok(Isometry3::identity()) };
    let values = in_order(array);
    if values.len() == 3 {
        return Ok(Isometry3::from(vector(array, what)?));
    }
    let rows: [f64; 16] = match array.shape() {
        [4, 4] => exactly(&values, what)?,
        shape => {
            let text =
                format!("{what}: a pose is a matrix of 4 × 4 or a translation, not {shape:?}");
            return Err(wrong(text));
        }
    };
    let rotation = Matrix3::from_fn(|i, j| rows[4 * i + j]);
    let off = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    let proper =
        off < ORTHONORMAL && rotation.determinant() > 0.0 && rows[12..] == [0.0, 0.0, 0.0, 1.0];
    if !proper {
        return Err(wrong(format!("{what}: the matrix is no rotation and translation")));
    }
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Ok(Isometry3::from_parts(Translation3::new(rows[3], rows[7], rows[11]), rotation))
}

/// A pose as the sixteen numbers of a matrix, row by row.
pub(crate) fn rows(pose: &Isometry3<f64>) -> [f64; 16] {
    let columns = pose.to_homogeneous();
    std::array::from_fn(|i| columns[(i / 4, i % 4)])
}

/// A pose as a matrix of 4 × 4.
pub(crate) fn matrix<'py>(py: Python<'py>, pose: &Isometry3<f64>) -> PyResult<Array<'py>> {
    array(py, rows(pose).to_vec(), &[4, 4])
}
