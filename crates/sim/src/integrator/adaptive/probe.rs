//! The scalar by which a sensitivity is followed.

use prehend_autodiff::Fwd;

/// Numbers that carry the derivative along the probe.
pub(super) type Probe = Fwd<1>;
