//! The robot and the bodies besides.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Vector3;
use prehend_geometry::TriMesh;
use prehend_geometry::hand::{Taxel, load_taxels};
use prehend_geometry::robot::KinematicTree;

use super::layout::{BodyLayout, Layout, RobotLayout};
use crate::data::bodies::{Bodies, PlacedBody, check_name, plane, solid};
use crate::data::bop::{
    DatasetError, KindName, TactileReading, body_sigmas, field_fault, positions,
};
use crate::scene::HandMeasurement;

/// What the robot of a frame file is called beside other bodies.
const ROBOT: &str = "robot";

impl Layout {
    /// The robot and all other bodies as one, its taxels, and what is measured of it; nothing without any.
    ///
    /// # Errors
    /// If a file that is named is missing or broken, or a field does not fit it.
    pub(super) fn robot(
        &self,
        file: &Path,
    ) -> Result<Option<(KinematicTree, Vec<Taxel>, HandMeasurement)>, DatasetError> {
        let folder = file.parent().unwrap_or(Path::new("."));
        let mut placed = Vec::new();
        if let Some(robot) = &self.robot {
            placed.push(robot.placed(file, folder)?);
        }
        for (k, body) in self.bodies.iter().enumerate() {
            let body = body.placed(file, folder, &format!("bodies[{k}]"))?;
            if placed.iter().any(|other: &PlacedBody| other.name == body.name) {
                let problem = format!("there are two bodies called {:?}", body.name);
                return Err(DatasetError::field(file, &format!("bodies[{k}].name"), problem));
            }
            placed.push(body);
        }
        let Some(all) = Bodies::new(placed) else { return Ok(None) };
        let mut measured = all.measured();
        let tree = all.tree().map_err(|e| DatasetError::unusable(file, e))?;
        let Some(robot) = &self.robot else { return Ok(Some((tree, Vec::new(), measured))) };
        let layout = |csv: &Path| {
            load_taxels(&folder.join(csv)).map_err(|e| DatasetError::unusable(file, e))
        };
        let skin = robot.taxels.as_deref().map(layout).transpose()?.unwrap_or_default();
        let forces = robot.forces.as_deref().unwrap_or_default();
        if !forces.is_empty() && forces.len() != skin.len() {
            let (expected, found) = (skin.len(), forces.len());
            let problem =
                format!("expected one force for each of {expected} taxels, found {found}");
            return Err(DatasetError::field(file, "robot.forces", problem));
        }
        measured.forces = forces.iter().map(|f| Vector3::from(f.0)).collect();
        for (k, entry) in robot.touch.iter().enumerate() {
            let name = format!("robot.touch[{k}]");
            let fault = |problem: String| field_fault(file, &name, &problem);
            let mut sensor = entry.clone().read(folder).map_err(fault)?;
            if sensor.body.is_empty() {
                ROBOT.clone_into(&mut sensor.body);
            }
            if !all.has(&sensor.body) {
                let problem = format!("names {:?}, the bodies are {}", sensor.body, all.names());
                return Err(DatasetError::field(file, &format!("{name}.body"), problem));
            }
            if let TactileReading::Force { .. } = &sensor.reading {
                let problem = "is missing or force, which is what robot.forces are".to_owned();
                return Err(DatasetError::field(file, &format!("{name}.kind"), problem));
            }
            let layout = sensor.reading.taxels().map(layout).transpose()?.unwrap_or_default();
            measured.touch.extend(all.reading(&tree, &sensor, &layout).map_err(fault)?);
        }
        Ok(Some((tree, skin, measured)))
    }
}

impl RobotLayout {
    fn placed(&self, file: &Path, folder: &Path) -> Result<PlacedBody, DatasetError> {
        let tree = KinematicTree::from_urdf_file(folder.join(&self.urdf))
            .map_err(|e| DatasetError::unusable(file, e))?;
        let joints = tree.joint_vector(&positions(&self.joints));
        Ok(PlacedBody {
            name: ROBOT.to_owned(),
            joints: joints.map_err(|e| DatasetError::field(file, "robot.joints", e))?,
            tree: Arc::new(tree),
            is_hand: true,
            t_cam_body: self.base_pose.0,
            sigmas: body_sigmas(self.sigma_mm, self.sigma_deg)
                .map_err(|problem| DatasetError::field(file, "robot", problem))?,
        })
    }
}

impl BodyLayout {
    fn placed(&self, file: &Path, folder: &Path, name: &str) -> Result<PlacedBody, DatasetError> {
        let field = |part: &str, problem: String| {
            DatasetError::field(file, &format!("{name}.{part}"), problem)
        };
        let needed = |part: &'static str| move || field(part, "is missing".to_owned());
        let broken = |error: String| DatasetError::unusable(file, error);
        check_name(&self.name).map_err(|problem| DatasetError::field(file, name, problem))?;
        let mut joints = Vec::new();
        let tree = match self.kind {
            KindName::Hand => {
                let urdf = self.urdf.as_ref().ok_or_else(needed("urdf"))?;
                let tree = KinematicTree::from_urdf_file(folder.join(urdf))
                    .map_err(|e| broken(e.to_string()))?;
                let said = self.joints.as_ref().ok_or_else(needed("joints"))?;
                joints = tree
                    .joint_vector(&positions(said))
                    .map_err(|e| field("joints", e.to_string()))?;
                tree
            }
            KindName::Plane => plane(),
            KindName::Object => {
                let mesh = self.mesh.as_ref().ok_or_else(needed("mesh"))?;
                let unit = self.mesh_unit.ok_or_else(needed("mesh_unit"))?;
                let mesh = TriMesh::load(&folder.join(mesh)).map_err(|e| broken(e.to_string()))?;
                solid(&mesh.scaled(unit.meters()))
            }
        };
        let sigmas = body_sigmas(self.sigma_mm, self.sigma_deg);
        Ok(PlacedBody {
            name: self.name.clone(),
            tree: Arc::new(tree),
            joints,
            is_hand: self.kind == KindName::Hand,
            t_cam_body: self.pose.0,
            sigmas: sigmas.map_err(|problem| DatasetError::field(file, name, problem))?,
        })
    }
}
