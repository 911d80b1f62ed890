//! Calibrated rigs.

use std::path::Path;

use serde_json::{Value, json};

use crate::data::AssetError;
use crate::rig::Rig;

/// Size of images, joints of the hand, objects whose surfaces are corrected, and values and standard deviations of the parameters
/// \[m, rad; focal lengths\], without the coefficients of the depth field.
pub(super) fn read(path: &Path) -> Result<Value, AssetError> {
    let rig = Rig::load(path)?;
    let variances = rig.covariance.diagonal();
    let parameters = rig.parameters().into_iter().zip(variances.iter());
    let parameters = parameters.map(
        |((name, value), variance)| json!({ "name": name, "value": value, "sigma": variance.sqrt() }),
    );
    Ok(json!({
        "image_size": rig.image_size(),
        "joints": rig.joints.len(),
        "objects": rig.objects.keys().collect::<Vec<_>>(),
        "parameters": parameters.collect::<Vec<_>>(),
    }))
}
