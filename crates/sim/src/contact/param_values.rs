//! A copy of a law's parameters.

use smallvec::SmallVec;

/// The parameters of a law; up to eight without allocation.
pub(crate) type ParamValues<T> = SmallVec<[T; 8]>;
