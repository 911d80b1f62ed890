//! Shapes.

use std::path::PathBuf;

use numpy::PyUntypedArrayMethods;
use parry3d_f64::math::{Pose, Rotation, Vector};
use parry3d_f64::shape::{HalfSpace, HeightField, SharedShape, TriMesh};
use pyo3::prelude::*;

use prehend_sim::ShapeOptions;

use crate::arrays::{Numbers, faces, in_order, points, pose, vector, vector_or};
use crate::error::{Raise, wrong};
use crate::threads::detached;

/// The shape of a body: mass properties, samples of its surface and its distance field. Lengths in m; cylinders, capsules and cones lie along y.
///
/// `rounding` is the radius of the edges of sharp shapes (2 % of the smallest extent if not given), `spacing` the distance of the samples of
/// a surface, `cell` that of the distance grid of a mesh.
#[pyclass(name = "Shape", frozen, module = "prehend")]
#[derive(Clone)]
pub(crate) struct PyShape {
    parry: SharedShape,
    pub(crate) shape: prehend_sim::Shape,
}

impl PyShape {
    fn new(
        parry: SharedShape,
        rounding: Option<f64>,
        spacing: Option<f64>,
        cell: Option<f64>,
    ) -> PyResult<Self> {
        let options = ShapeOptions { rounding, spacing, cell };
        let make = || prehend_sim::Shape::from_parry_with(&*parry, &options);
        let shape = Python::attach(|py| detached(py, make))?.raise()?;
        Ok(Self { parry, shape })
    }
}

/// Refuses sizes of which parry makes others, or none.
fn sizes(named: &[(&str, f64)]) -> PyResult<()> {
    match named.iter().find(|(_, size)| !(*size >= 0.0 && size.is_finite())) {
        Some((name, size)) => Err(wrong(format!("{name} must be positive and finite, is {size}"))),
        None => Ok(()),
    }
}

#[pymethods]
impl PyShape {
    /// A ball.
    #[staticmethod]
    fn ball(radius: f64) -> PyResult<Self> {
        Self::new(SharedShape::ball(radius), None, None, None)
    }

    /// A box with these half extents.
    #[staticmethod]
    #[pyo3(signature = (half_extents, *, rounding=None, spacing=None))]
    fn cuboid(
        half_extents: Numbers<'_>,
        rounding: Option<f64>,
        spacing: Option<f64>,
    ) -> PyResult<Self> {
        let half = vector(&half_extents, "half_extents")?;
        Self::new(SharedShape::cuboid(half.x, half.y, half.z), rounding, spacing, None)
    }

    /// A capsule along y.
    #[staticmethod]
    #[pyo3(signature = (half_height, radius, *, spacing=None))]
    fn capsule(half_height: f64, radius: f64, spacing: Option<f64>) -> PyResult<Self> {
        sizes(&[("half_height", half_height), ("radius", radius)])?;
        Self::new(SharedShape::capsule_y(half_height, radius), None, spacing, None)
    }

    /// A cylinder along y.
    #[staticmethod]
    #[pyo3(signature = (half_height, radius, *, rounding=None, spacing=None))]
    fn cylinder(
        half_height: f64,
        radius: f64,
        rounding: Option<f64>,
        spacing: Option<f64>,
    ) -> PyResult<Self> {
        sizes(&[("half_height", half_height), ("radius", radius)])?;
        Self::new(SharedShape::cylinder(half_height, radius), rounding, spacing, None)
    }

    /// A cone along y, its tip at `half_height`.
    #[staticmethod]
    #[pyo3(signature = (half_height, radius, *, rounding=None, spacing=None))]
    fn cone(
        half_height: f64,
        radius: f64,
        rounding: Option<f64>,
        spacing: Option<f64>,
    ) -> PyResult<Self> {
        sizes(&[("half_height", half_height), ("radius", radius)])?;
        Self::new(SharedShape::cone(half_height, radius), rounding, spacing, None)
    }

    /// The convex hull of points, n × 3.
    #[staticmethod]
    #[pyo3(signature = (points, *, rounding=None, spacing=None))]
    fn convex_hull(
        points: Numbers<'_>,
        rounding: Option<f64>,
        spacing: Option<f64>,
    ) -> PyResult<Self> {
        let corners = vectors(&points, "points")?;
        let hull = SharedShape::convex_hull(&corners)
            .ok_or_else(|| wrong("points: they have no convex hull with a volume"))?;
        Self::new(hull, rounding, spacing, None)
    }

    /// A closed mesh: vertices n × 3, faces m × 3.
    #[staticmethod]
    #[pyo3(signature = (vertices, faces, *, spacing=None, cell=None))]
    fn mesh(
        vertices: Numbers<'_>,
        faces: Numbers<'_>,
        spacing: Option<f64>,
        cell: Option<f64>,
    ) -> PyResult<Self> {
        let vertices = vectors(&vertices, "vertices")?;
        let faces = self::faces(&faces, vertices.len())?;
        let mesh = TriMesh::new(vertices, faces).raise()?;
        Self::new(SharedShape::new(mesh), None, spacing, cell)
    }

    /// The mesh of a file: OBJ, PLY, STL or glTF; `scale` is how many meters one of its units is (1e-3 for millimeters).
    #[staticmethod]
    #[pyo3(signature = (path, *, scale=1.0, spacing=None, cell=None))]
    fn mesh_file(
        path: PathBuf,
        scale: f64,
        spacing: Option<f64>,
        cell: Option<f64>,
    ) -> PyResult<Self> {
        if !(scale.is_finite() && scale > 0.0) {
            return Err(wrong(format!("scale: {scale} is no length")));
        }
        let mesh = prehend_geometry::TriMesh::load(&path).raise()?.scaled(scale);
        let vertices = mesh.vertices.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
        let mesh = TriMesh::new(vertices, mesh.faces.clone()).raise()?;
        Self::new(SharedShape::new(mesh), None, spacing, cell)
    }

    /// All that is below the plane through the origin with this normal, for bodies that stay where they are.
    #[staticmethod]
    #[pyo3(signature = (normal=None))]
    fn half_space(normal: Option<Numbers<'_>>) -> PyResult<Self> {
        let normal = vector_or(normal.as_ref(), [0.0, 0.0, 1.0], "normal")?;
        let normal = normal
            .try_normalize(0.0)
            .filter(|normal| normal.iter().all(|x| x.is_finite()))
            .ok_or_else(|| wrong("normal: it has no direction"))?;
        let half_space = HalfSpace::new(Vector::new(normal.x, normal.y, normal.z));
        Self::new(SharedShape::new(half_space), None, None, None)
    }

    /// Heights over a rectangle in the plane x, z, as rows along z; `scale` is the size along x, the factor of heights, and the size along z.
    #[staticmethod]
    fn height_field(heights: Numbers<'_>, scale: Numbers<'_>) -> PyResult<Self> {
        let &[rows, columns] = heights.shape() else {
            let shape = heights.shape();
            return Err(wrong(format!(
                "heights: a matrix of 2 × 2 at least is expected, not {shape:?}"
            )));
        };
        if rows.min(columns) < 2 {
            return Err(wrong("heights: a matrix of 2 × 2 at least is expected"));
        }
        let scale = vector(&scale, "scale")?;
        let values = in_order(&heights);
        let by_columns = (0..columns)
            .flat_map(|column| (0..rows).map(move |row| columns * row + column))
            .map(|place| values[place])
            .collect();
        let heights = parry3d_f64::utils::Array2::new(rows, columns, by_columns);
        let field = HeightField::new(heights, Vector::new(scale.x, scale.y, scale.z));
        Self::new(SharedShape::new(field), None, None, None)
    }

    /// Several shapes in one, each with its pose (4 × 4 or a translation). They should not overlap.
    #[staticmethod]
    #[pyo3(signature = (parts, *, rounding=None, spacing=None, cell=None))]
    fn compound(
        parts: Vec<(Py<PyShape>, Numbers<'_>)>,
        rounding: Option<f64>,
        spacing: Option<f64>,
        cell: Option<f64>,
    ) -> PyResult<Self> {
        let placed = parts.iter().map(|(part, at)| {
            let at = pose(Some(at), "parts")?;
            if part.get().parry.as_compound().is_some() {
                return Err(wrong("parts: a compound is among them; give its parts"));
            }
            let (t, r) = (at.translation.vector, at.rotation.coords);
            let rotation = Rotation::from_xyzw(r.x, r.y, r.z, r.w);
            let at = Pose::from_parts(Vector::new(t.x, t.y, t.z), rotation);
            Ok((at, part.get().parry.clone()))
        });
        let placed = placed.collect::<PyResult<Vec<_>>>()?;
        if placed.is_empty() {
            return Err(wrong("parts: there are none"));
        }
        Self::new(SharedShape::compound(placed), rounding, spacing, cell)
    }

    /// Its dimensions by name, those by which a model can be differentiated [m].
    #[getter]
    fn dimensions(&self) -> std::collections::BTreeMap<String, f64> {
        self.shape.dimensions().into_iter().collect()
    }

    /// Its volume [m³]; None for what has none.
    #[getter]
    fn volume(&self) -> Option<f64> {
        self.shape.moments().map(|moments| moments.volume)
    }

    fn __repr__(&self) -> String {
        format!("Shape({:?})", self.shape)
    }
}

fn vectors(array: &Numbers<'_>, what: &str) -> PyResult<Vec<Vector>> {
    Ok(points(array, what)?.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect())
}
