//! Wrench and rate of the deflection of a contact with bristles.

use nalgebra::{Matrix3x6, Matrix6, SVector, Vector3, Vector6};
use prehend_autodiff::{Fwd, LocalFunction, Scalar};

use super::bristle_law::BristleLaw;
use super::bristles::Bristles;
use super::contact_query::{ContactPoint, ContactQuery};
use super::dynamic::DynContactLaw;
use super::moved::{LiftedContact, MovedQuery};
use super::wrench::sum_forces;
use crate::first_order::{Linearized, first_order, linearized};

/// Depth over which bristles take hold, in multiples of their deflection.
const TAKE_HOLD: f64 = 0.1;
/// Depth above which they do not let go, in multiples of their deflection.
const LET_GO: f64 = 1e-3;
/// Part of what contacts hold that holds every other direction.
const REGULARIZATION: f64 = 1e-6;

/// The wrench of all contacts of `query` about the center of mass and the rate of the deflection, along the axes of the field, as a
/// function of the tangent of the body's state and of the change of the deflection, to first order.
pub(crate) struct BristleFunction<'a> {
    pub(crate) law: &'a dyn DynContactLaw,
    pub(crate) p: &'a [f64],
    pub(crate) query: &'a ContactQuery<'a>,
    pub(crate) bristles: Bristles,
    pub(crate) deflection: Vector6<f64>,
}

impl LocalFunction<18, 12> for BristleFunction<'_> {
    #[inline]
    fn evaluate<S: Scalar>(&self, change: [S; 18]) -> [S; 12] {
        match S::ORDER {
            0 => self.value(&change.map(S::value)).map(S::constant),
            _ => first_order(&self.derivatives(change.map(S::value)), &change),
        }
    }

    fn linearize(&self, change: [f64; 18]) -> Option<Linearized<18, 12>> {
        Some(self.derivatives(change))
    }

    fn derivative_along(&self, x: [f64; 18], along: [f64; 18]) -> Option<([f64; 12], [f64; 12])> {
        Some(self.directional(&x, &along))
    }
}

/// Also of the place of the query's point from the center of mass, after the rest.
impl LocalFunction<21, 12> for BristleFunction<'_> {
    #[inline]
    fn evaluate<S: Scalar>(&self, change: [S; 21]) -> [S; 12] {
        match S::ORDER {
            0 => self.value(&change.map(S::value)).map(S::constant),
            _ => first_order(&self.derivatives_about(change.map(S::value)), &change),
        }
    }

    fn linearize(&self, change: [f64; 21]) -> Option<Linearized<21, 12>> {
        Some(self.derivatives_about(change))
    }

    fn derivative_along(&self, x: [f64; 21], along: [f64; 21]) -> Option<([f64; 12], [f64; 12])> {
        Some(self.directional(&x, &along))
    }
}

// Not generic: compiled here.
impl BristleFunction<'_> {
    fn value(&self, change: &[f64]) -> [f64; 12] {
        self.wrench(self.p, change, about(change).as_ref())
    }

    fn derivatives(&self, change: [f64; 18]) -> Linearized<18, 12> {
        linearized(self.wrench(&self.constants(), &Fwd::variables(change), None))
    }

    fn derivatives_about(&self, change: [f64; 21]) -> Linearized<21, 12> {
        let change = Fwd::variables(change);
        linearized(self.wrench(&self.constants(), &change, about(&change).as_ref()))
    }

    fn directional(&self, x: &[f64], along: &[f64]) -> ([f64; 12], [f64; 12]) {
        let pairs = x.iter().zip(along);
        let change: Vec<Fwd<1>> =
            pairs.map(|(&value, &slope)| Fwd { value, derivative: [slope] }).collect();
        let results = self.wrench(&self.constants(), &change, about(&change).as_ref());
        (results.map(|y| y.value), results.map(|y| y.derivative[0]))
    }

    /// The derivatives by each parameter.
    pub(crate) fn by_parameters(&self) -> Vec<SVector<f64, 12>> {
        const LANES: usize = 6;
        let mut columns = Vec::with_capacity(self.p.len());
        for from in (0..self.p.len()).step_by(LANES) {
            let seeded = |(i, &p): (usize, &f64)| match i.checked_sub(from) {
                Some(lane) if lane < LANES => Fwd::<LANES>::variable(p, lane),
                _ => Fwd::constant(p),
            };
            let p: Vec<_> = self.p.iter().enumerate().map(seeded).collect();
            let results = self.wrench(&p, &[Fwd::constant(0.0); 18], None);
            let lanes = LANES.min(self.p.len() - from);
            columns.extend((0..lanes).map(|k| SVector::from(results.map(|y| y.derivative[k]))));
        }
        columns
    }
}

/// The place of the query's point from the center of mass, if it is among what changes.
fn about<T: Scalar>(change: &[T]) -> Option<Vector3<T>> {
    change.get(18..21).map(Vector3::from_column_slice)
}

impl BristleFunction<'_> {
    fn constants<S: Scalar>(&self) -> Vec<S> {
        self.p.iter().map(|&p| S::constant(p)).collect()
    }

    /// The function with parameters `p`, and of `from_com`, from the center of mass to the point that the query has the state of.
    fn wrench<T: Scalar>(&self, p: &[T], change: &[T], from_com: Option<&Vector3<T>>) -> [T; 12] {
        let moved = MovedQuery::new(self.query, change);
        let deflection = Vector6::from_fn(|i, _| change[12 + i].plus(self.deflection[i]));
        self.wrench_of(p, &deflection, from_com, |touch, cutoff| moved.lift(touch, cutoff))
    }

    /// The function of dimensions of the shapes, with which `lift` gives a contact.
    pub(crate) fn wrench_by_dimensions<T: Scalar>(
        &self,
        lift: impl Fn(&ContactPoint, f64) -> LiftedContact<T>,
    ) -> [T; 12] {
        self.wrench_of(&self.constants(), &self.deflection.map(T::constant), None, lift)
    }

    fn wrench_of<T: Scalar>(
        &self,
        p: &[T],
        deflection: &Vector6<T>,
        from_com: Option<&Vector3<T>>,
        lift: impl Fn(&ContactPoint, f64) -> LiftedContact<T>,
    ) -> [T; 12] {
        let Self { query, bristles, .. } = *self;
        let (cutoff, law) = (self.law.cutoff(), BristleLaw::new(self.law, p));
        let mut fit = RateFit::default();
        let wrench = sum_forces(query, cutoff, T::ORDER == 0, |touch| {
            let LiftedContact { mut contact, lever } = lift(touch, cutoff);
            let lever = from_com.map_or(lever, |from_com| lever + from_com);
            let across = across(&contact.normal, &lever);
            let (slip, deflected) = (contact.slip, across * deflection);
            contact.slip += bristles.slip(&deflected);
            let force = law.force(&contact).along(&contact.normal);
            // By depth, which ends smoothly where a contact does; the force of a damper may end before.
            let depth = -contact.gap.plus(-cutoff);
            if depth.value() > 0.0 {
                fit.add(&across, depth * contact.area, depth, bristles.rate(&slip, &deflected));
            }
            (lever, force)
        });
        let Some(wrench) = wrench else { return [T::constant(f64::NAN); 12] };
        let rate = fit.rate(deflection, bristles);
        std::array::from_fn(|i| if i < 6 { wrench[i] } else { rate[i - 6] })
    }
}

/// The motion of a sample across the normal by a twist about the center of mass.
pub(crate) fn across<T: Scalar>(normal: &Vector3<T>, lever: &Vector3<T>) -> Matrix3x6<T> {
    let basis: [Vector3<T>; 3] = std::array::from_fn(|i| Vector3::ith(i, T::one()));
    let columns: [Vector3<T>; 6] =
        std::array::from_fn(|i| if i < 3 { basis[i] } else { basis[i - 3].cross(lever) });
    Matrix3x6::from_columns(&columns.map(|v| v - normal * normal.dot(&v)))
}

/// The least-squares fit of one rate of the deflection to the rates at all samples.
struct RateFit<T: Scalar> {
    normal: Matrix6<T>,
    right: Vector6<T>,
    /// Sums of weights, and of depths by their weight.
    weight: T,
    depth: T,
}

impl<T: Scalar> Default for RateFit<T> {
    fn default() -> Self {
        let (normal, right, zero) = (Matrix6::zeros(), Vector6::zeros(), T::zero());
        Self { normal, right, weight: zero, depth: zero }
    }
}

impl<T: Scalar> RateFit<T> {
    fn add(&mut self, across: &Matrix3x6<T>, weight: T, depth: T, rate: Vector3<T>) {
        let weighted = across.transpose() * weight;
        self.normal += weighted * across;
        self.right += weighted * rate;
        self.weight += weight;
        self.depth += weight * depth;
    }

    /// ζ'.
    fn rate(self, deflection: &Vector6<T>, bristles: Bristles) -> Vector6<T> {
        let returning =
            |x: &Vector6<T>| x.map(|x| x.times(bristles.slip_speed / bristles.deflection));
        if self.weight.value() <= 0.0 {
            return -returning(deflection);
        }
        // A turn by one counts as the lever of the mean contact, or as a micrometer if that is at the center of mass.
        let trace = |from: usize| {
            let diagonal = (from..from + 3).map(|i| self.normal[(i, i)]);
            diagonal.fold(T::zero(), |sum, x| sum + x)
        };
        let (moves, turns) = (trace(0), trace(3));
        let ground = [moves, turns + moves.times(1e-12)].map(|x| x.times(REGULARIZATION));
        let ground = Vector6::from_fn(|i, _| ground[i / 3]);
        let Some(factors) = (self.normal + Matrix6::from_diagonal(&ground)).cholesky() else {
            return Vector6::repeat(T::constant(f64::NAN));
        };
        // What no contact holds returns to zero, and everything where contacts end.
        let free = |x: &Vector6<T>| factors.solve(&ground.component_mul(x));
        let free = free(&free(&free(&free(deflection))));
        let depth = self.depth / self.weight;
        let held = depth / depth.plus(TAKE_HOLD * bristles.deflection);
        let part = depth.times(1.0 / (LET_GO * bristles.deflection));
        let released = match part.value() < 1.0 {
            true => part.times(2.0).plus(1.0) * part.plus(-1.0) * part.plus(-1.0),
            false => T::zero(),
        };
        factors.solve(&self.right) * held - returning(&(free + (deflection - free) * released))
    }
}
