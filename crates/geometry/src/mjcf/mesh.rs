//! Mesh assets: read once, when the first geom asks for them.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

use super::class::{Classes, MAIN};
use super::compiler::Compiler;
use super::element::Element;
use super::error::MjcfError;
use super::mesh_mass::{self, MeshInertia};
use super::orientation;
use crate::inertial::Inertial;
use crate::io::{folder, load_shape};
use crate::limits::MAX_ELEMENTS;
use crate::mesh::TriMesh;

/// What is known of a mesh before it is read.
#[derive(Clone)]
pub(super) struct Spec {
    scale: Vector3<f64>,
    /// The frame, in the file's coordinates, that becomes the mesh's own.
    t_file_mesh: Isometry3<f64>,
    inertia: MeshInertia,
}

impl Default for Spec {
    fn default() -> Self {
        let (scale, inertia) = (Vector3::repeat(1.0), MeshInertia::Legacy);
        Self { scale, t_file_mesh: Isometry3::identity(), inertia }
    }
}

impl Spec {
    pub(super) fn read(&mut self, e: &Element) -> Result<(), MjcfError> {
        self.scale = e.numbers("scale")?.map_or(self.scale, Vector3::from);
        if let Some(position) = e.numbers("refpos")? {
            self.t_file_mesh.translation = Vector3::from(position).into();
        }
        if let Some(q) = e.numbers("refquat")? {
            self.t_file_mesh.rotation = orientation::quaternion_wxyz(q)
                .ok_or_else(|| e.invalid("refquat", "must not be zero"))?;
        }
        self.inertia = e.keyword("inertia", &MeshInertia::WORDS)?.unwrap_or(self.inertia);
        if self.inertia == MeshInertia::Convex {
            e.refuse_attribute("inertia", "of the convex hull not known: that of the mesh");
        }
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
#[derive(Clone)]
pub(super) struct Mesh {
    pub(super) mesh: Arc<TriMesh>,
    inertia: MeshInertia,
}

impl Mesh {
    /// The mesh at 1 kg/m³, or at 1 kg/m² where it is a shell; `None` where it holds no volume.
    pub(super) fn of_unit_density(&self) -> Option<Inertial> {
        mesh_mass::of_unit_density(&self.mesh, self.inertia)
    }
}

struct Asset<'a> {
    element: &'a Element,
    spec: Spec,
}

/// The meshes of a model by name.
pub(super) struct Meshes<'a> {
    assets: BTreeMap<String, Asset<'a>>,
    folder: Option<&'a Path>,
    read: RefCell<BTreeMap<String, Mesh>>,
}

impl<'a> Meshes<'a> {
    pub(super) fn new(
        root: &'a Element,
        classes: &Classes,
        folder: Option<&'a Path>,
    ) -> Result<Self, MjcfError> {
        let mut assets = BTreeMap::new();
        for element in root.in_sections("asset").filter(|e| e.tag == "mesh") {
            element.take();
            let mut spec = classes.of(element, MAIN)?.mesh.clone();
            spec.read(element)?;
            let name = match element.text("name") {
                Some(name) => name.to_owned(),
                None => {
                    let file = element.text("file").ok_or_else(|| element.missing("name"))?;
                    let stem = Path::new(file).file_stem().unwrap_or_default();
                    stem.to_string_lossy().into_owned()
                }
            };
            for field in ["file", "vertex", "face"] {
                element.text(field);
            }
            if assets.insert(name, Asset { element, spec }).is_some() {
                return Err(element.duplicate("mesh"));
            }
        }
        Ok(Self { assets, folder, read: RefCell::default() })
    }

    /// The mesh that `geom` names.
    pub(super) fn get(
        &self,
        geom: &Element,
        name: &str,
        compiler: &Compiler,
    ) -> Result<Mesh, MjcfError> {
        if let Some(mesh) = self.read.borrow().get(name) {
            return Ok(mesh.clone());
        }
        let asset = self.assets.get(name).ok_or_else(|| geom.unknown("mesh", name))?;
        let raw = match asset.element.text("file") {
            Some(file) => self.load(asset.element, file, compiler)?,
            None => written(asset.element)?,
        };
        let spec = &asset.spec;
        let mesh = Mesh { mesh: Arc::new(spec.apply(raw)), inertia: spec.inertia };
        self.read.borrow_mut().insert(name.to_owned(), mesh.clone());
        Ok(mesh)
    }

    fn load(&self, e: &Element, name: &str, compiler: &Compiler) -> Result<TriMesh, MjcfError> {
        let Some(folder) = self.folder else {
            return Err(e.unusable(name, "mesh files need a folder to be looked for in"));
        };
        let file = match Path::new(name).file_name() {
            Some(file) if compiler.strip_path => Path::new(file),
            _ => Path::new(name),
        };
        let relative = Path::new(&compiler.mesh_folder).join(file);
        // Meshes of an included file may lie beside it.
        let beside =
            e.file.as_deref().and_then(Path::parent).and_then(|p| p.strip_prefix(folder).ok());
        let places: [PathBuf; 2] =
            [relative.clone(), beside.unwrap_or(Path::new("")).join(relative)];
        for place in places {
            let path = folder::inside(folder, &place.to_string_lossy())
                .map_err(|reason| e.unusable(name, reason))?;
            if path.is_file() {
                return load_shape(&path).map_err(|error| e.unusable(name, error.to_string()));
            }
        }
        Err(e.unusable(name, "no such file"))
    }
}

/// A mesh whose vertices and faces are in the model itself.
fn written(e: &Element) -> Result<TriMesh, MjcfError> {
    let vertices = e.list("vertex", 3 * MAX_ELEMENTS)?.ok_or_else(|| e.missing("file"))?;
    let faces = e.list("face", 3 * MAX_ELEMENTS)?.ok_or_else(|| e.missing("face"))?;
    let count = vertices.len() / 3;
    if count == 0 || faces.is_empty() {
        return Err(e.invalid("face", "must not be empty"));
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
