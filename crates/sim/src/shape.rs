//! Shapes of bodies: mass properties, samples and a distance field from one description.

mod ball;
mod border;
mod capsule;
mod compound;
mod cuboid;
pub(crate) mod error;
mod from_parry;
mod ground;
pub(crate) mod height_field;
mod kind;
mod lattice;
pub(crate) mod lifted;
mod nearest;
pub(crate) mod options;
mod polyhedron;
mod polytope;
mod profile;
mod revolved;
mod round;
mod rows;
pub(crate) mod solid;
pub(crate) mod variable;

use std::fmt;
use std::sync::Arc;

use nalgebra::UnitVector3;
use parry3d_f64::math::Vector;
use prehend_autodiff::Scalar;
use prehend_geometry::{DistanceField, Moments, TriMesh};

use crate::body::RigidBody;
use crate::surface::Surface;
use error::ShapeError;
use ground::Ground;
use kind::ShapeKind;
use lifted::LiftedField;
use options::ShapeOptions;
use solid::RoundSample;

/// The shape of a body, over plain numbers or numbers that carry derivatives: its dimensions, and samples of its surface and a
/// distance field of their values, which bodies of one shape share.
///
/// Shapes of [parry](https://parry.rs) are read by [`Shape::from_parry`]. All convex ones with a name are a core with a round border;
/// the distance is exact outside of the core. What is sharp there gets round edges within its size, by
/// [`ShapeOptions::rounding`]: faces stay where they are, edges, corners and the tip of a cone are that much blunter. Mass
/// properties are those of the sharp solid. Shapes with a border have it in their mass, too, unlike parry's.
///
/// Samples are balls on faces, edges and corners from within, 5/4 as large as the rounding of the field: they touch whole faces and
/// edges at once and roll over edges. The areas that they stand for share out each face, see [`Surface::cuboid`].
///
/// ```
/// use parry3d_f64::shape::Cuboid;
/// use parry3d_f64::math::Vector;
/// use prehend_autodiff::Fwd;
/// use prehend_sim::{Body, Shape};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let shape = Shape::from_parry(&Cuboid::new(Vector::new(0.02, 0.03, 0.05)))?;
/// let brick = Body::from_shape("brick", &shape, 1e3)?;
/// assert!((brick.rigid().map_or(0.0, |rigid| rigid.mass()) - 0.24).abs() < 1e-12);
/// // Mass by half an edge.
/// let mut lifted = shape.cast::<Fwd<1>>();
/// lifted.set_dimension("half_extent_x", Fwd::variable(0.02, 0))?;
/// let volume = lifted.moments().map_or(0.0, |moments| moments.volume.derivative[0]);
/// assert!((volume - 8.0 * 0.03 * 0.05).abs() < 1e-15);
/// # Ok(())
/// # }
/// ```
#[derive(Clone)]
pub struct Shape<S: Scalar = f64> {
    built: Arc<Built>,
    dimensions: Vec<S>,
}

/// Samples and field that follow from the values of the dimensions.
struct Built {
    kind: Arc<ShapeKind>,
    values: Vec<f64>,
    surface: Option<Arc<Surface>>,
    field: Arc<dyn DistanceField>,
}

impl Built {
    fn new(kind: Arc<ShapeKind>, values: Vec<f64>) -> Result<Self, ShapeError> {
        kind.check(&values)?;
        let samples = kind.samples(&values);
        let surface = match samples.is_empty() {
            true => None,
            false => Some(Arc::new(Surface::balls(
                samples.iter().map(|s| (s.center, s.radius, s.area)),
            )?)),
        };
        Ok(Self { surface, field: kind.field(&values), kind, values })
    }
}

impl Shape {
    /// The shape of parry, with lengths that follow from its size where it does not say them.
    ///
    /// Balls, boxes, capsules, cylinders, cones and convex polyhedra, sharp or round; half-spaces; height fields, which are C² splines
    /// through their heights and go on by straight lines beyond the border; meshes, whose distance is a C² grid; and compounds of
    /// them, whose parts should not overlap.
    ///
    /// # Errors
    /// For other kinds, and for dimensions that are not positive and finite.
    pub fn from_parry(shape: &dyn parry3d_f64::shape::Shape) -> Result<Self, ShapeError> {
        Self::from_parry_with(shape, &ShapeOptions::default())
    }

    /// [`Shape::from_parry`] with lengths of one's own.
    ///
    /// # Errors
    /// See there, and for lengths that are not positive and finite, or that leave nothing of the shape.
    pub fn from_parry_with(
        shape: &dyn parry3d_f64::shape::Shape,
        options: &ShapeOptions,
    ) -> Result<Self, ShapeError> {
        let (kind, dimensions) = from_parry::read(shape, options)?;
        let built = Arc::new(Built::new(Arc::new(kind), dimensions.clone())?);
        Ok(Self { built, dimensions })
    }

    /// Ball of this radius \[m\] around the origin.
    ///
    /// # Errors
    /// Unless the radius is positive and finite.
    pub fn ball(radius: f64) -> Result<Self, ShapeError> {
        Self::from_parry(&parry3d_f64::shape::Ball::new(radius))
    }

    /// Box around the origin, with these halves of its edges \[m\].
    ///
    /// # Errors
    /// Unless they are positive and finite.
    pub fn cuboid([x, y, z]: [f64; 3]) -> Result<Self, ShapeError> {
        Self::from_parry(&parry3d_f64::shape::Cuboid::new(Vector::new(x, y, z)))
    }

    /// Solid below the plane through the origin with this normal.
    ///
    /// # Errors
    /// Unless the normal is finite.
    pub fn half_space(normal: UnitVector3<f64>) -> Result<Self, ShapeError> {
        let normal = Vector::new(normal.x, normal.y, normal.z);
        Self::from_parry(&parry3d_f64::shape::HalfSpace::new(normal))
    }

    /// The shape of a closed mesh \[m\], whose distance is a C² grid; of an open one, or one that faces inward, only a fixed body.
    ///
    /// ```
    /// use prehend_geometry::shapes::sphere;
    /// use prehend_sim::{Body, Shape};
    ///
    /// let shape = Shape::from_mesh(&sphere(0.03, 24))?;
    /// let ball = Body::from_shape("ball", &shape, 1e3)?;
    /// # Ok::<(), prehend_sim::error::ShapeError>(())
    /// ```
    ///
    /// # Errors
    /// If the mesh has no faces or its numbers are not finite.
    pub fn from_mesh(mesh: &TriMesh) -> Result<Self, ShapeError> {
        Self::from_mesh_with(mesh, &ShapeOptions::default())
    }

    /// [`Shape::from_mesh`] with lengths of one's own.
    ///
    /// # Errors
    /// See there, and for lengths that are not positive and finite.
    pub fn from_mesh_with(mesh: &TriMesh, options: &ShapeOptions) -> Result<Self, ShapeError> {
        let ground = Ground::mesh(mesh, options)?;
        let built = Arc::new(Built::new(Arc::new(ShapeKind::Ground(ground)), Vec::new())?);
        Ok(Self { built, dimensions: Vec::new() })
    }

    /// Shape in constants of another scalar.
    pub fn cast<S: Scalar>(&self) -> Shape<S> {
        self.map(S::constant)
    }
}

impl<S: Scalar> Shape<S> {
    /// Its dimensions with their names \[m\], none of a half-space.
    pub fn dimensions(&self) -> Vec<(String, S)> {
        self.built.kind.names().into_iter().zip(self.dimensions.iter().copied()).collect()
    }

    /// Sets the dimension called `name`, such as `"radius"` \[m\]: to differentiate by it, put in a variable. Samples and the field are
    /// made anew if its value is another.
    ///
    /// # Errors
    /// If there is no such dimension, or no such shape.
    pub fn set_dimension(&mut self, name: &str, value: S) -> Result<(), ShapeError> {
        let names = self.built.kind.names();
        let Some(place) = names.iter().position(|own| own == name) else {
            return Err(ShapeError::NoDimension { name: name.to_owned(), known: names.join(", ") });
        };
        let mut dimensions = self.dimensions.clone();
        dimensions[place] = value;
        *self = self.with_dimensions(dimensions)?;
        Ok(())
    }

    /// Shape with other dimensions, as many.
    pub(crate) fn with_dimensions(&self, dimensions: Vec<S>) -> Result<Self, ShapeError> {
        let values: Vec<f64> = dimensions.iter().map(|x| x.value()).collect();
        let built = match values == self.built.values {
            true => Arc::clone(&self.built),
            false => Arc::new(Built::new(Arc::clone(&self.built.kind), values)?),
        };
        Ok(Self { built, dimensions })
    }

    /// Volume \[m³\] and the first two moments about the origin; none of what is a fixed body only.
    pub fn moments(&self) -> Option<Moments<S>> {
        self.built.kind.moments(&self.dimensions)
    }

    /// Mass properties at a uniform `density` \[kg/m³\].
    ///
    /// # Errors
    /// If it has no mass, as a half-space, or the density is not positive and finite.
    pub(crate) fn rigid(&self, density: S) -> Result<RigidBody<S>, ShapeError> {
        if let Some(kind) = self.built.kind.fixed_only() {
            return Err(ShapeError::FixedOnly { kind });
        }
        let (mass, com, inertia) =
            self.moments().ok_or(ShapeError::FixedOnly { kind: "shape" })?.of_density(density);
        Ok(RigidBody::new(mass, inertia, com)?)
    }

    /// Samples of its surface; none of what has no mass.
    pub fn surface(&self) -> Option<&Arc<Surface>> {
        self.built.surface.as_ref()
    }

    /// Signed distance to it.
    pub fn field(&self) -> &Arc<dyn DistanceField> {
        &self.built.field
    }

    /// Its field with `dimensions` that have its values.
    pub(crate) fn lifted_field<T: Scalar>(&self, dimensions: &[T]) -> LiftedField<T> {
        self.built.kind.lifted_field(dimensions)
    }

    /// Its samples with `dimensions` that have its values, in the order of [`SurfacePoint::index`](crate::SurfacePoint).
    pub(crate) fn lifted_samples<T: Scalar>(&self, dimensions: &[T]) -> Vec<RoundSample<T>> {
        self.built.kind.samples(dimensions)
    }

    /// Values of its dimensions, in the order of [`Shape::dimensions`].
    pub(crate) fn dimension_values(&self) -> &[S] {
        &self.dimensions
    }

    /// Shape, each dimension through `f`.
    pub(crate) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> Shape<T> {
        Shape {
            built: Arc::clone(&self.built),
            dimensions: self.dimensions.iter().map(|&x| f(x)).collect(),
        }
    }
}

impl<S: Scalar> fmt::Debug for Shape<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_map().entries(self.dimensions()).finish()
    }
}
