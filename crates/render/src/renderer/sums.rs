//! Adjoints that the pixels of some rows add up.

use nalgebra::Vector3;

use crate::model::NONE;

/// Adjoints of a face's corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct FaceAdjoint {
    pub(super) face: u32,
    /// Adjoints of the positions, camera frame.
    pub(super) position: [Vector3<f64>; 3],
    /// Adjoints of the corner normals, mesh frame.
    pub(super) normal: [Vector3<f64>; 3],
    pub(super) albedo: [[f64; 3]; 3],
}

/// A place of a texture that a sample has looked up, and the adjoint of the color found.
#[derive(Clone, Copy, Debug)]
pub(super) struct TexelUse {
    pub(super) object: u32,
    pub(super) place: [f64; 2],
    pub(super) adjoint: [f64; 3],
}

/// Adjoints that belong to an object as a whole.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BodySums {
    /// Adjoint of a rotation of its normals, camera frame.
    pub(super) turn: Vector3<f64>,
    /// Adjoint of the pyramid level.
    pub(super) level: f64,
    /// Adjoint of its uniform color.
    pub(super) uniform: [f64; 3],
}

/// Sums of adjoints over a block of rows.
pub(super) struct Sums {
    /// Place in `faces` of each face of the scene.
    slots: Vec<u32>,
    pub(super) faces: Vec<FaceAdjoint>,
    pub(super) texels: Vec<TexelUse>,
    pub(super) bodies: Vec<BodySums>,
    /// Adjoints of fx, fy, cx, cy.
    pub(super) intrinsics: [f64; 4],
    pub(super) parameters: Vec<f64>,
    pub(super) background: [f64; 3],
}

impl Sums {
    pub(super) fn new(faces: usize, bodies: usize, parameters: usize) -> Self {
        Self {
            slots: vec![NONE; faces],
            faces: Vec::new(),
            texels: Vec::new(),
            bodies: vec![BodySums::default(); bodies],
            intrinsics: [0.0; 4],
            parameters: vec![0.0; parameters],
            background: [0.0; 3],
        }
    }

    /// The sums of a face, zero at first.
    #[inline]
    pub(super) fn face(&mut self, face: usize) -> &mut FaceAdjoint {
        let slot = &mut self.slots[face];
        if *slot == NONE {
            *slot = self.faces.len() as u32;
            let zeros = [Vector3::zeros(); 3];
            let albedo = [[0.0; 3]; 3];
            let face = face as u32;
            self.faces.push(FaceAdjoint { face, position: zeros, normal: zeros, albedo });
        }
        &mut self.faces[*slot as usize]
    }
}
