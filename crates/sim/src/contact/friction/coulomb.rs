//! Coulomb friction.

use nalgebra::Vector3;
use prehend_autodiff::Scalar;

use super::{FrictionCoefficient, FrictionLaw};
use crate::contact::parameters::law_part;
use crate::contact::point::ContactKinematics;

law_part! {
    /// Coulomb friction: f_t = −μ f_n u/√(|u|² + v_s²) for slip u, friction coefficient μ and slip scale v_s
    /// ([`regularized_coulomb`](super::regularized_coulomb)).
    ///
    /// A sticking contact creeps: a tangential force s μ f_n, s < 1, takes the slip v_s s/√(1 − s²). Choose v_s as the tolerable
    /// creep: a hundredth of the speeds that matter, often 1 cm/s for impacts and 0.1 mm/s for grasps. Fixed steps must be
    /// shorter than m v_s/(μ f_n), or derivatives are wrong; [`Model::simulate`](crate::Model::simulate) takes such steps. To
    /// hold for seconds, a contact needs [`BristleFriction`](super::bristle::BristleFriction) around it.
    pub struct Coulomb: "Coulomb friction" {
        friction [""] NotNegative "friction coefficient";
    }
    constants {
        slip_scale ["m/s"] Positive "slip speed that regularizes it";
    }
}

impl FrictionCoefficient for Coulomb {
    #[inline]
    fn coefficient<S: Scalar>(&self, [friction]: [S; 1], _speed: S) -> S {
        friction
    }

    #[inline]
    fn slip_scale(&self) -> f64 {
        self.slip_scale
    }
}

impl FrictionLaw for Coulomb {
    #[inline]
    fn force<S: Scalar>(
        &self,
        p: [S; 1],
        normal_force: S,
        contact: &ContactKinematics<S>,
    ) -> Vector3<S> {
        self.isotropic_force(p, normal_force, &contact.slip)
    }
}
