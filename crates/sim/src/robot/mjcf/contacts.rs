//! Contacts between the geoms of a file.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use prehend_geometry::mjcf::{Geom, Model as MjcfModel};

use super::{MjcfError, MjcfOptions, MjcfRobot};
use crate::handle::BodyId;
use crate::model::Model;
use crate::model::material::Material;

/// A body that geoms touch with, by its place in the file; none is the world.
type Touching<'a> = (BodyId, Option<usize>, &'a [Geom]);

impl Model {
    /// Model of an MJCF file: its robot or scene, as [`Model::add_mjcf`] adds it, under its gravity, with contacts between all bodies of which two geoms
    /// collide by `contype` and `conaffinity`, unless they share a joint or are among `<exclude>`. Their law is that of a [`Material`] with the sliding friction
    /// of both geoms: that of the higher priority, or else the larger; `solref` and `solimp` of contacts are not read. The file's time step is
    /// [`time_step`](MjcfModel::time_step).
    ///
    /// ```
    /// use prehend_geometry::mjcf;
    /// use prehend_sim::prelude::*;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let file = mjcf::Model::from_str(
    ///     r#"<mujoco><worldbody><geom type="plane" size="1 1 1"/>
    ///     <body name="box" pos="0 0 .1"><freejoint/><geom type="box" size=".05 .05 .05"/></body></worldbody></mujoco>"#,
    ///     None,
    /// )?;
    /// let (mut model, scene) = Model::from_mjcf(&file, &MjcfOptions::default())?;
    /// let mut start = model.neutral_state();
    /// scene.reset(&mut model, &mut start)?;
    /// let end = model.simulate(&start, 0.5)?;
    /// assert!((end[scene.bodies[0]].pose.translation.z - 0.05).abs() < 1e-3);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As [`Model::add_mjcf`].
    pub fn from_mjcf(
        mjcf: &MjcfModel,
        options: &MjcfOptions,
    ) -> Result<(Self, MjcfRobot), MjcfError> {
        let mut model = Self::new(options.t_world_mjcf.rotation * mjcf.gravity);
        let robot = model.add_mjcf(mjcf, options)?;
        model.add_geom_contacts(mjcf, &robot)?;
        Ok((model, robot))
    }

    fn add_geom_contacts(&mut self, mjcf: &MjcfModel, robot: &MjcfRobot) -> Result<(), MjcfError> {
        let bodies = mjcf.bodies.iter().zip(&robot.bodies).enumerate();
        let bodies = bodies.map(|(index, (body, id))| (*id, Some(index), &*body.geoms));
        let fixed = mjcf.world_geoms.iter().filter(|geom| geom.collides()).zip(&robot.fixed);
        let fixed = fixed.map(|(geom, id)| (*id, None, std::slice::from_ref(geom)));
        let all: Vec<Touching<'_>> = bodies.chain(fixed).collect();
        let ids: Vec<BodyId> = all.iter().map(|(id, ..)| *id).collect();
        let excluded = |a: Option<usize>, b: Option<usize>| {
            mjcf.exclusions.iter().any(|pair| *pair == [a, b] || *pair == [b, a])
        };
        let mut laws = BTreeMap::new();
        for (k, a) in all.iter().enumerate() {
            for b in &all[k + 1..] {
                let Some(friction) = friction(a.2, b.2) else { continue };
                let can = self.moves_against(a.0, b.0) && self.sides(a.0, b.0).is_ok();
                if !can || excluded(a.1, b.1) {
                    continue;
                }
                let (law, smoothing) = match laws.entry(friction.to_bits()) {
                    Entry::Occupied(known) => known.into_mut(),
                    Entry::Vacant(new) => {
                        let material = Material { friction, ..Material::default() };
                        new.insert(self.material_law(&ids, material)?)
                    }
                };
                self.add_contacts_between(&[a.0], &[b.0], Arc::clone(law), *smoothing)?;
            }
        }
        Ok(())
    }
}

/// Coefficient of sliding friction between the geoms of two bodies, the largest of those that collide; none if none do.
fn friction(a: &[Geom], b: &[Geom]) -> Option<f64> {
    let pairs = a.iter().flat_map(|a| b.iter().map(move |b| (a, b)));
    let collide = |a: &Geom, b: &Geom| a.contact_type & b.contact_affinity != 0;
    let touching = pairs.filter(|(a, b)| collide(a, b) || collide(b, a));
    let coefficients = touching.map(|(a, b)| match a.priority.cmp(&b.priority) {
        std::cmp::Ordering::Greater => a.friction[0],
        std::cmp::Ordering::Less => b.friction[0],
        std::cmp::Ordering::Equal => a.friction[0].max(b.friction[0]),
    });
    coefficients.reduce(f64::max)
}
