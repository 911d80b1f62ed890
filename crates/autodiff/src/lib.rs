//! Forward- and reverse-mode automatic differentiation over nalgebra's `RealField`.

mod scalar;

pub use scalar::Scalar;
