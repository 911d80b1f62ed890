//! All metrics of one pose together.

use serde::{Deserialize, Serialize};

use super::recall::{NormalizedErrors, Recall};
use super::vsd::VSD_TOLERANCES;

/// A metric's heading, with its unit, and its value.
type Metric = (&'static str, fn(&PoseScore) -> Option<f64>);

/// The metrics in the order of their columns; of the recalls, BOP's average.
const METRICS: [Metric; 13] = [
    ("PE cm", |s| s.pe_cm),
    ("OE °", |s| s.oe_deg),
    ("OEsym °", |s| s.oe_symmetric_deg),
    ("ADD mm", |s| s.add_mm),
    ("ADI mm", |s| s.adi_mm),
    ("MSSD mm", |s| s.mssd_mm),
    ("MSPD px", |s| s.mspd_px),
    ("CA cm²", |s| s.ca_cm2),
    ("IV cm³", |s| s.iv_cm3),
    ("|ΔCA| cm²", |s| s.delta_ca_cm2),
    ("|ΔIV| cm³", |s| s.delta_iv_cm3),
    ("VSD", |s| s.vsd),
    ("AR", |s| s.recall.map(|r| r.average())),
];

/// Headings of the columns of [`PoseScore::values`], with units.
pub(crate) const COLUMNS: [&str; METRICS.len()] = {
    let mut headings = [""; METRICS.len()];
    let mut k = 0;
    while k < headings.len() {
        headings[k] = METRICS[k].0;
        k += 1;
    }
    headings
};

/// The metrics of one pose; what was not computed is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseScore {
    /// Position error \[cm\].
    pub pe_cm: Option<f64>,
    /// Orientation error \[deg\].
    pub oe_deg: Option<f64>,
    /// Orientation error up to symmetry \[deg\].
    pub oe_symmetric_deg: Option<f64>,
    /// Average distance of corresponding points \[mm\]; this and the next three are none of a model without points.
    pub add_mm: Option<f64>,
    /// Average distance to the nearest point \[mm\].
    pub adi_mm: Option<f64>,
    /// Maximum surface distance up to symmetry \[mm\].
    pub mssd_mm: Option<f64>,
    /// Maximum projected distance up to symmetry \[px\]; none where part of the object is behind the camera.
    pub mspd_px: Option<f64>,
    /// Contact area \[cm²\].
    pub ca_cm2: Option<f64>,
    /// Intersection volume with the hand \[cm³\].
    pub iv_cm3: Option<f64>,
    /// Deviation of the contact area from that of the true pose \[cm²\].
    pub delta_ca_cm2: Option<f64>,
    /// Deviation of the intersection volume from that of the true pose \[cm³\].
    pub delta_iv_cm3: Option<f64>,
    /// Visible surface discrepancy, the mean over BOP's ten tolerances (0..=1).
    pub vsd: Option<f64>,
    /// Recalls of BOP's three metrics over their thresholds (0..=1).
    pub(crate) recall: Option<Recall>,
}

impl PoseScore {
    /// The metrics in the order of the fields; of the recalls, BOP's average.
    pub fn values(&self) -> [Option<f64>; COLUMNS.len()] {
        METRICS.map(|(_, value)| value(self))
    }

    /// Adds contact area and intersection volume, and their deviations from those of the true pose.
    pub(crate) fn with_contact(mut self, estimate: Contact, truth: Contact) -> Self {
        self.ca_cm2 = Some(estimate.area_cm2);
        self.iv_cm3 = Some(estimate.volume_cm3);
        self.delta_ca_cm2 = Some((estimate.area_cm2 - truth.area_cm2).abs());
        self.delta_iv_cm3 = Some((estimate.volume_cm3 - truth.volume_cm3).abs());
        self
    }

    /// Adds the visible surface discrepancy, `vsd` for each of BOP's tolerances, and with it the recalls; `diameter` is the
    /// object's \[m\], `width` the image's \[px\].
    pub(crate) fn with_visible_surface(
        mut self,
        vsd: &[f64; VSD_TOLERANCES.len()],
        diameter: f64,
        width: usize,
    ) -> Self {
        self.vsd = Some(vsd.iter().sum::<f64>() / vsd.len() as f64);
        // What is behind the camera is missed.
        let mspd = self.mspd_px.unwrap_or(f64::INFINITY);
        self.recall = self
            .mssd_mm
            .map(|mssd| NormalizedErrors::new(vsd, 1e-3 * mssd, diameter, mspd, width).recall());
        self
    }
}

/// How an object in some pose touches the hand.
#[derive(Clone, Copy)]
pub(crate) struct Contact {
    /// Contact area \[cm²\].
    pub(crate) area_cm2: f64,
    /// Intersection volume \[cm³\].
    pub(crate) volume_cm3: f64,
}

#[cfg(test)]
mod tests {
    use super::super::ScoredModel;
    use super::*;
    use crate::symmetry::Symmetries;
    use nalgebra::{Isometry3, Point3, Vector3};
    use prehend_render::Camera;

    #[test]
    fn units_and_order_match_the_headings() {
        let points = vec![Point3::new(-0.05, 0.0, 0.0), Point3::new(0.05, 0.0, 0.0)];
        let model = ScoredModel::new(points, Symmetries::default());
        let camera = Camera { fx: 500.0, fy: 500.0, cx: 0.0, cy: 0.0, width: 0, height: 0 };
        let truth = Isometry3::translation(0.0, 0.0, 0.5);
        let estimate = Isometry3::new(Vector3::new(0.0, 0.01, 0.5), Vector3::y() * 0.0);
        let contact = |area_cm2, volume_cm3| Contact { area_cm2, volume_cm3 };
        let score = model.score(&estimate, &truth, &camera);
        let score = score.with_contact(contact(3.0, 2.0), contact(4.5, 0.5));
        let score = score.with_visible_surface(&[0.24; 10], 0.11, 800);
        // Of ten thresholds each, VSD is under six, MSSD (5.5 mm, 11 mm …) and MSPD (6.25 px, 12.5 px …) under nine.
        let recall = (0.6 + 0.9 + 0.9) / 3.0;
        let expected = [1.0, 0.0, 0.0, 10.0, 10.0, 10.0, 10.0, 3.0, 2.0, 1.5, 1.5, 0.24, recall];
        for ((value, expected), name) in score.values().into_iter().zip(expected).zip(COLUMNS) {
            assert!((value.unwrap() - expected).abs() < 1e-9, "{name}: {value:?}");
        }
    }
}
