//! Derivatives of contacts by the dimensions of the shapes that touch.

use nalgebra::{Point3, Vector3, Vector6};
use prehend_autodiff::{Fwd, Scalar};

use crate::contact::bristle_function::BristleFunction;
use crate::contact::contact_query::{ContactPoint, ContactQuery};
use crate::contact::dynamic::DynContactLaw;
use crate::contact::moved::LiftedContact;
use crate::contact::wrench::sum_forces;
use crate::shape::lifted::LiftedField;
use crate::shape::solid::RoundSample;

/// Dimensions that one evaluation differentiates by.
pub(crate) const LANES: usize = 6;

pub(crate) type Lane = Fwd<LANES>;

/// A query of shapes some of whose dimensions are variables.
///
/// Other than the motion of a body, which moves all samples and the whole field alike, a dimension moves each sample and every part of
/// the field in its own way: contacts are found by values, and each is made again over numbers that carry derivatives.
pub(crate) struct VariableShapes<'a> {
    pub(crate) query: &'a ContactQuery<'a>,
    /// The samples, if they change.
    pub(crate) samples: Option<Vec<RoundSample<Lane>>>,
    pub(crate) field: LiftedField<Lane>,
}

impl VariableShapes<'_> {
    /// Force and torque about the center of mass, along the axes of the field, of a law with parameters `p`.
    pub(crate) fn wrench(&self, law: &dyn DynContactLaw, p: &[f64]) -> [Lane; 6] {
        let p: Vec<Lane> = p.iter().map(|&p| Fwd::constant(p)).collect();
        let sum = sum_forces(self.query, law.cutoff(), false, |touch| {
            let LiftedContact { contact, lever } = self.lift(touch, law.cutoff());
            (lever, law.force_with_derivative(&p, &contact).along(&contact.normal))
        });
        sum.unwrap_or_else(|| Vector6::repeat(Fwd::constant(f64::NAN))).into()
    }

    /// [`wrench`](Self::wrench) of a contact with bristles, then the rate of its deflection.
    pub(crate) fn bristles(&self, function: &BristleFunction<'_>) -> [Lane; 12] {
        function.wrench_by_dimensions(|touch, cutoff| self.lift(touch, cutoff))
    }

    fn lift(&self, touch: &ContactPoint, cutoff: f64) -> LiftedContact<Lane> {
        let constant = |v: &Vector3<f64>| v.map(Fwd::constant);
        let rotation = self.query.state.pose.rotation.to_rotation_matrix();
        let sample = self.samples.as_ref().and_then(|all| all.get(touch.index as usize));
        let (arm, radius, area) = match sample {
            None => {
                let [radius, area] = [touch.radius, touch.area].map(Fwd::constant);
                (constant(&touch.arm), radius, area)
            }
            Some(RoundSample { center, radius, area }) => {
                let from_com = center - self.query.com.map(Fwd::constant);
                let arm = rotation.matrix().map(Fwd::constant) * from_com;
                (arm, *radius, area.times(touch.area / area.value))
            }
        };
        let place = Point3::from(arm + constant(&self.query.state.pose.translation.vector));
        let nowhere = || (Fwd::constant(f64::NAN), Vector3::zeros());
        let (distance, gradient) = self.field.at(&place).unwrap_or_else(nowhere);
        let change = distance - radius;
        let change = change.plus(-change.value);
        let normal = gradient / gradient.norm();
        let lever = arm - normal * radius;
        let velocity =
            constant(&self.query.state.linear) + constant(&self.query.state.angular).cross(&lever);
        let contact = touch.moved(cutoff, change, normal, velocity, area);
        LiftedContact { contact, lever }
    }
}
