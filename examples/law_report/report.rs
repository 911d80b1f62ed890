//! Report on a contact law, tried on the simplest problems.

use std::fmt;
use std::sync::Arc;

use prehend::nalgebra::Vector3;
use prehend::sim::{DynContactLaw, SimulationError};

use super::curves::{self, Curve};
use super::derivatives;
use super::finding::{Finding, Verdict};
use super::motion::{GRAVITY, Specimen};
use super::passivity;
use super::point_contact::{DEPTH, PointContact};

/// Findings about a law, see [`law_report`].
#[derive(Clone, Debug)]
pub(crate) struct LawReport {
    /// Findings, one line each.
    pub(crate) findings: Vec<Finding>,
    /// Forces and motions, to be drawn.
    pub(crate) curves: Vec<Curve>,
}

impl LawReport {
    /// Whether nothing is wrong.
    pub(crate) fn is_sound(&self) -> bool {
        self.findings.iter().all(|finding| finding.verdict != Verdict::Wrong)
    }
}

impl fmt::Display for LawReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Finding { what, measured, verdict, remark } in &self.findings {
            writeln!(f, "{:<8} {what:<52} {measured:>12.5e}  {remark}", verdict.name())?;
        }
        Ok(())
    }
}

/// Tries `law` with its own parameters: how its force begins; rest, bounces and slides of a body of which it carries the
/// weight half a millimeter deep, on 4 cm², against closed forms; whether it makes energy; its derivatives; stiffness, damping
/// and the longest stable step.
///
/// # Errors
/// If a parameter is out of its range, or the law cannot be simulated.
pub(crate) fn law_report(law: &Arc<dyn DynContactLaw>) -> Result<LawReport, SimulationError> {
    law.check(law.params())?;
    let contact_point = PointContact { law: law.as_ref() };
    let weight = contact_point.force(DEPTH, 0.0, Vector3::zeros()).normal;
    let mut findings = vec![Finding {
        what: "weight carried 0.5 mm deep on 4 cm² [N]".to_owned(),
        measured: weight,
        verdict: Verdict::when(weight > 0.0 && weight.is_finite()),
        remark: "must push".to_owned(),
    }];
    findings.push(onset(&contact_point));
    findings.extend(derivatives::findings(&contact_point));
    findings.extend(passivity::findings(&contact_point, weight));
    let mut curves = curves::of_forces(&contact_point);
    if weight > 0.0 && weight.is_finite() {
        let specimen = Specimen { law, mass: weight / GRAVITY };
        findings.extend(specimen.findings(&contact_point)?);
        curves.push(specimen.bounce_curve()?);
    }
    Ok(LawReport { findings, curves })
}

fn onset(contact_point: &PointContact<'_>) -> Finding {
    let [touch, pressed] = [1e-12, 1e-4].map(|depth| {
        let response = contact_point.force(depth, -1.0, Vector3::x());
        response.normal.abs() + response.tangential.norm()
    });
    // Even the root of the depth grows by more.
    let jump = touch > 1e-3 * pressed;
    let force = contact_point.force(1e-12, -1.0, Vector3::zeros()).normal;
    Finding {
        what: "force at first touch, 1 m/s [N]".to_owned(),
        measured: force,
        verdict: if jump { Verdict::Note } else { Verdict::Sound },
        remark: match jump {
            true => "jumps: derivatives through impacts need GapSmoothing::Softplus".to_owned(),
            false => "begins at zero".to_owned(),
        },
    }
}

#[cfg(test)]
mod tests {
    use prehend::autodiff::Scalar;
    use prehend::sim::{ContactForce, ContactKinematics, ContactLaw, Coulomb, KelvinVoigt, Law};

    use super::super::point_contact::AREA;
    use super::*;

    /// A belt: friction that drives instead of braking.
    struct Belt([f64; 2]);

    impl ContactLaw for Belt {
        fn params(&self) -> &[f64] {
            &self.0
        }
        fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
            let normal = -p[0] * contact.gap * contact.area;
            ContactForce { normal, tangential: contact.slip * (p[1] * normal) }
        }
        fn cutoff(&self) -> f64 {
            0.0
        }
    }

    #[test]
    fn a_law_that_drives_is_found_out() {
        let driving: Arc<dyn DynContactLaw> = Arc::new(Belt([1e7, 0.1]));
        let report = law_report(&driving).unwrap();
        let wrong = report.findings.iter().filter(|finding| finding.verdict == Verdict::Wrong);
        let wrong: Vec<&str> = wrong.map(|finding| finding.what.as_str()).collect();
        assert_eq!(wrong.len(), 3, "{report}");
        assert!(wrong.iter().all(|what| what.contains("sliding in circles")));
        assert!(!report.is_sound() && report.to_string().contains("WRONG"));
    }

    /// A spring that takes the derivatives of its gap or its stiffness for zero.
    struct Constant {
        stiffness: [f64; 1],
        gap: bool,
    }

    impl ContactLaw for Constant {
        fn params(&self) -> &[f64] {
            &self.stiffness
        }
        fn law<S: Scalar>(&self, p: &[S], contact: &ContactKinematics<S>) -> ContactForce<S> {
            let [mut stiffness, mut gap] = [p[0], contact.gap];
            let lost = if self.gap { &mut gap } else { &mut stiffness };
            *lost = S::constant(lost.value());
            let normal = -stiffness * gap * contact.area;
            ContactForce { normal, tangential: contact.slip.map(|_| S::zero()) }
        }
        fn cutoff(&self) -> f64 {
            0.0
        }
    }

    #[test]
    fn lost_derivatives_are_found_out() {
        for gap in [true, false] {
            let law: Arc<dyn DynContactLaw> = Arc::new(Constant { stiffness: [1e7], gap });
            let report = law_report(&law).unwrap();
            let is_wrong = |what: &str| {
                let finding = report.findings.iter().find(|f| f.what.starts_with(what)).unwrap();
                finding.verdict == Verdict::Wrong
            };
            assert_eq!(is_wrong("contacts whose derivatives differ"), gap, "{report}");
            assert_eq!(is_wrong("the same, derivatives by parameters"), !gap, "{report}");
        }
    }

    #[test]
    fn a_spring_and_damper_bounce_as_their_damping_ratio_says() {
        let spring = KelvinVoigt { stiffness: 1e7, damping: 1e4 };
        let friction = Coulomb { friction: 0.3, slip_scale: 1e-3 };
        let law: Arc<dyn DynContactLaw> = Arc::new(Law::new(spring, friction).unwrap());
        let report = law_report(&law).unwrap();
        assert!(report.is_sound(), "{report}");
        let found = |what: &str| {
            report.findings.iter().find(|f| f.what.starts_with(what)).unwrap().measured
        };
        let mass = 1e7 * DEPTH * AREA / GRAVITY;
        let zeta = 1e4 * AREA / (2.0 * (1e7 * AREA * mass).sqrt());
        let expected = (-2.0 * zeta / (1.0 - zeta * zeta).sqrt() * zeta.acos()).exp();
        assert!((found("restitution at 0.5") - expected).abs() < 1e-4, "{report}");
        assert!((found("friction coefficient") - 0.3).abs() < 1e-6);
        assert!((found("distance of a slide") - 1.0).abs() < 1e-2);
    }
}
