//! Mesh assets: read once, when the first geom asks for them.

use std::cell::OnceCell;
use std::rc::Rc;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::asset::{Assets, Files};
use super::class::{Classes, MAIN};
use super::element::Element;
use super::error::Result;
use super::mesh_mass::{self, MeshInertia};
use super::{builtin_mesh, msh, orientation};
use crate::inertial::Inertial;
use crate::io::load_shape;
use crate::limits::MAX_ELEMENTS;
use crate::mesh::TriMesh;

/// Attributes of a mesh asset: the defaults of its class, replaced by those of its element.
#[derive(Clone)]
pub(super) struct MeshSpec {
    scale: Vector3<f64>,
    /// The frame, in the file's coordinates, that becomes the mesh's own.
    t_file_mesh: Isometry3<f64>,
    inertia: MeshInertia,
}

impl Default for MeshSpec {
    fn default() -> Self {
        let (scale, inertia) = (Vector3::repeat(1.0), MeshInertia::Legacy);
        Self { scale, t_file_mesh: Isometry3::identity(), inertia }
    }
}

impl MeshSpec {
    pub(super) fn read(&mut self, e: &Element) -> Result<()> {
        self.scale = e.numbers("scale")?.map_or(self.scale, Vector3::from);
        if let Some(position) = e.numbers("refpos")? {
            self.t_file_mesh.translation = Vector3::from(position).into();
        }
        if let Some(q) = e.numbers("refquat")? {
            self.t_file_mesh.rotation = orientation::quaternion_wxyz(q)
                .ok_or_else(|| e.invalid("refquat", "must not be zero"))?;
        }
        self.inertia = e.keyword("inertia", &MeshInertia::WORDS)?.unwrap_or(self.inertia);
        e.text("maxhullvert");
        Ok(())
    }

    /// The mesh of a file's coordinates.
    fn apply(&self, mut mesh: TriMesh) -> TriMesh {
        let turn: UnitQuaternion<f64> = self.t_file_mesh.rotation.inverse();
        for v in &mut mesh.vertices {
            let moved = turn * (v.coords - self.t_file_mesh.translation.vector);
            *v = Point3::from(moved.component_mul(&self.scale));
        }
        // An odd number of reflections turns the surface inside out.
        if self.scale.product() < 0.0 {
            mesh.faces.iter_mut().for_each(|f| f.swap(1, 2));
        }
        mesh
    }
}

/// A mesh that has been read.
pub(super) struct Mesh {
    pub(super) mesh: Arc<TriMesh>,
    inertia: MeshInertia,
    /// Found when the first geom asks for it.
    unit: OnceCell<Option<Inertial>>,
}

impl Mesh {
    /// The mesh at 1 kg/m³, or at 1 kg/m² where it is a shell; `None` where it holds no volume.
    pub(super) fn of_unit_density(&self) -> Option<Inertial> {
        *self.unit.get_or_init(|| mesh_mass::of_unit_density(&self.mesh, self.inertia))
    }
}

/// The meshes of a model.
pub(super) struct Meshes<'a> {
    assets: Assets<'a, Rc<Mesh>>,
    files: Files<'a>,
    classes: &'a Classes,
}

impl<'a> Meshes<'a> {
    pub(super) fn new(root: &'a Element, classes: &'a Classes, files: Files<'a>) -> Result<Self> {
        let assets = Assets::new(root, "mesh", &["file", "vertex", "face", "builtin", "params"])?;
        let meshes = Self { assets, files, classes };
        meshes.assets.elements().try_for_each(|e| meshes.spec(e).map(|_| ()))?;
        Ok(meshes)
    }

    fn spec(&self, e: &Element) -> Result<MeshSpec> {
        let mut spec = self.classes.of(e, MAIN)?.mesh.clone();
        spec.read(e)?;
        Ok(spec)
    }

    /// The mesh that `geom` names.
    pub(super) fn get(&self, geom: &Element, name: &str) -> Result<Rc<Mesh>> {
        self.assets.get(geom, name, |e| {
            let mut raw = match (e.text("file"), e.text("builtin")) {
                (Some(file), _) => self.load(e, file)?,
                (None, Some(kind)) => builtin_mesh::made(e, kind)?,
                (None, None) => written(e)?,
            };
            if raw.faces.is_empty() {
                let flat = || e.invalid("vertex", "is in a plane: it has no convex hull");
                raw = raw.convex_hull().ok_or_else(flat)?;
            }
            let spec = self.spec(e)?;
            let (mesh, inertia) = (Arc::new(spec.apply(raw)), spec.inertia);
            Ok(Rc::new(Mesh { mesh, inertia, unit: OnceCell::new() }))
        })
    }

    fn load(&self, e: &Element, name: &str) -> Result<TriMesh> {
        let path = self.files.path(e, name)?;
        if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("msh")) {
            return msh::load(&path).map_err(|reason| e.unusable(name, reason));
        }
        load_shape(&path).map_err(|error| e.unusable(name, error.to_string()))
    }
}

/// A mesh whose vertices are in the model itself, with faces where it has some.
fn written(e: &Element) -> Result<TriMesh> {
    let vertices = e.list("vertex", 3 * MAX_ELEMENTS)?.ok_or_else(|| e.missing("file"))?;
    let faces = e.list("face", 3 * MAX_ELEMENTS)?.unwrap_or_default();
    let count = vertices.len() / 3;
    if count == 0 {
        return Err(e.invalid("vertex", "must not be empty"));
    }
    for (field, list) in [("vertex", &vertices), ("face", &faces)] {
        if list.len() % 3 != 0 {
            return Err(e.invalid(field, format!("has {} numbers, not three each", list.len())));
        }
    }
    let is_vertex = |&x: &f64| x >= 0.0 && x < count as f64 && x.fract() == 0.0;
    if let Some(x) = faces.iter().find(|x| !is_vertex(x)) {
        return Err(e.invalid("face", format!("refers to vertex {x} of {count}")));
    }
    let vertices = vertices.chunks_exact(3).map(Point3::from_slice).collect();
    let faces = faces.chunks_exact(3).map(|f| [f[0] as u32, f[1] as u32, f[2] as u32]).collect();
    Ok(TriMesh::new(vertices, faces))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{Model, Shape};
    use super::*;

    const TETRAHEDRON: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nmtllib gone.mtl\nusemtl x\n\
        f 1/1 3/1 2/1\nf 1/1 2/1 4/1\nf 2/1 3/1 4/1\nf 1/1 4/1 3/1\n";

    fn read(mesh: &str, folder: Option<&Path>) -> Result<Model, String> {
        let xml = format!(
            "<mujoco><compiler meshdir=\"m\"/><asset><mesh {mesh}/></asset><worldbody><body>\
            <geom type=\"mesh\" mesh=\"a\"/><geom type=\"mesh\" mesh=\"a\" pos=\"1 0 0\"/></body></worldbody></mujoco>"
        );
        Model::from_str(&xml, folder).map_err(|e| e.to_string())
    }

    #[test]
    fn meshes_are_moved_then_scaled_and_shared() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("m")).unwrap();
        // Materials that were never shipped do not matter.
        std::fs::write(root.path().join("m/a.obj"), TETRAHEDRON).unwrap();
        std::fs::write(root.path().join("b.obj"), TETRAHEDRON).unwrap();
        let attributes = "file=\"a.obj\" scale=\"2 -3 4\" refpos=\"0 0 1\" refquat=\"1 0 0 1\"";
        let model = read(attributes, Some(root.path())).unwrap();
        let [Shape::Mesh(a), Shape::Mesh(b)] = [0, 1].map(|g| &model.bodies[0].geoms[g].shape)
        else {
            panic!()
        };
        assert!(Arc::ptr_eq(a, b));
        // (1, 0, 0) - (0, 0, 1), turned by -90° about z: (0, -1, -1).
        let moved = Point3::new(0.0, 3.0, -4.0);
        assert!(a.vertices.iter().any(|v| (v - moved).norm() < 1e-12));
        let inertial = model.bodies[0].inertial.unwrap();
        assert!((inertial.mass - 2.0 * 4000.0).abs() < 1e-8, "{}", inertial.mass);
        for (mesh, part) in [
            ("name=\"a\" file=\"../b.obj\"", "leaves the folder"),
            ("name=\"a\" file=\"/etc/passwd\"", "leaves the folder"),
            ("name=\"a\" file=\"c.obj\"", "mesh 'a': file 'c.obj': no such file"),
            ("name=\"a\"", "mesh 'a': file is missing"),
            ("name=\"b\" file=\"a.obj\"", "geom: mesh names 'a'"),
            ("scale=\"1 1 1\"", "mesh: name is missing"),
        ] {
            let error = read(mesh, Some(root.path())).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        assert!(read("file=\"a.obj\"", None).unwrap_err().contains("need a folder"));
        std::fs::write(root.path().join("m/a.obj"), "v 0 0\n").unwrap();
        assert!(read("file=\"a.obj\"", Some(root.path())).unwrap_err().contains("a.obj: line 1"));
    }

    #[test]
    fn meshes_in_the_model_are_checked() {
        let vertices = "name=\"a\" vertex=\"0 0 0 1 0 0 0 1 0 0 0 1\"";
        let with = |faces: &str| read(&format!("{vertices} face=\"{faces}\""), None);
        assert!(with("0 2 1 0 1 3 1 2 3 0 3 2").is_ok());
        for (faces, part) in [
            ("0 1 4", "face refers to vertex 4 of 4"),
            ("0 1 -1", "face refers to vertex -1"),
            ("0 1", "not three each"),
            ("0 1 2", "holds no volume"),
        ] {
            let error = with(faces).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
        // Without faces it is a hull.
        assert!(with("").is_ok() && read(vertices, None).is_ok());
        let flat = "name=\"a\" vertex=\"0 0 0 1 0 0 0 1 0 1 1 0\"";
        assert!(read(flat, None).unwrap_err().contains("no convex hull"));
    }
}
