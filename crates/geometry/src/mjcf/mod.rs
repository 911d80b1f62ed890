//! Robots and scenes in MJCF, the XML format of MuJoCo, read into plain data.
//!
//! [`Model::from_file`] reads bodies, joints, shapes, actuators, tendons that are sums of joints, equality constraints and
//! keyframes, and the sensors that a state determines, with default classes applied, included files put in place, ranges resolved and inertias inferred as MuJoCo 4
//! does. All is in SI units and radians. What is not read is named in [`Model::warnings`], once for each kind of
//! element or attribute; attributes that concern looks alone are passed over.
//!
//! ```
//! use prehend_geometry::mjcf::Model;
//!
//! let model = Model::from_str(r#"<mujoco model="lever">
//!     <compiler angle="degree"/>
//!     <default><joint damping="0.1"/></default>
//!     <worldbody><body name="arm" pos="0 0 1">
//!         <joint name="q" axis="0 1 0" range="-90 90"/>
//!         <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.01" mass="0.5"/>
//!     </body></worldbody>
//!     <actuator><position joint="q" kp="20"/></actuator></mujoco>"#, None)?;
//! let joint = model.joint(model.joint_index("q").ok_or("no such joint")?);
//! assert_eq!((joint.damping, joint.range.map(|r| r.1)), (0.1, Some(90_f64.to_radians())));
//! let inertial = model.bodies[0].inertial.ok_or("no mass")?;
//! assert!((inertial.com.z - 0.1).abs() < 1e-15 && (inertial.mass - 0.5).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod actuator;
mod asset;
mod body;
mod builtin_mesh;
mod class;
mod compiler;
mod contact;
mod copies;
mod drive;
mod element;
mod equality;
mod error;
mod fit;
mod flags;
mod geom;
mod height_field;
mod inertial;
mod joint;
mod keyframe;
mod mass;
mod material;
mod mesh;
mod mesh_mass;
mod model;
mod msh;
mod names;
mod orientation;
mod reference;
mod sensor;
mod shape;
mod site;
mod solver;
mod source;
mod submodel;
mod tendon;
mod value;
mod warning;

pub use actuator::{Actuator, Dynamics, Muscle, PlacedFrame, Transmission};
pub use body::Body;
pub use equality::{Equality, EqualityKind};
pub use error::{MjcfError, Place};
pub use geom::Geom;
pub use height_field::HeightField;
pub use joint::{Joint, JointKind};
pub use keyframe::Keyframe;
pub use model::{JointIndex, Model};
pub use sensor::{FramePart, Quantity, Sensor};
pub use shape::Shape;
pub use site::Site;
pub use solver::SolverParameters;
pub use tendon::{Tendon, TendonJoint, TendonPart};
pub use warning::Warning;
