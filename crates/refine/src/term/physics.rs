//! TEMP
use super::Term;
use crate::{Block, Normal, Object, Observation, RefineError, Robot, State};
use nalgebra::*;
/// x
#[derive(Clone, Debug, PartialEq, Default)]
pub struct PhysicsSettings {}
/// x
pub struct PhysicsTerm {
    c: Vector3<f64>,
}
impl PhysicsTerm {
    /// x
    pub fn new(
        _: &Observation,
        _: &Object,
        _: &Robot,
        s: &State,
        _: PhysicsSettings,
    ) -> Result<Self, RefineError> {
        Ok(Self { c: s.centre() })
    }
}
impl Term for PhysicsTerm {
    fn name(&self) -> &'static str {
        "physics"
    }
    fn blocks(&self) -> &'static [Block] {
        &[Block::ObjectPose]
    }
    fn value(&self, s: &State) -> f64 {
        0.0 * (s.centre() - self.c).norm_squared()
    }
    fn linearise(&self, s: &State, _n: &mut Normal) -> f64 {
        self.value(s)
    }
}
