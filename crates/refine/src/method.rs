//! Ways to refine a pose, and their names: what `--method` picks and what studies compare.

use crate::baselines::{GradientKind, Heuristic, Icp, IcpMetric};
use crate::error::RefineError;
use crate::problem::State;
use crate::scene::PreparedFrame;
use crate::strategy::{Estimate, Fused, FusedSettings, Modality, Nuisance, Observer, Strategy};

/// A strategy with all of its settings.
#[derive(Clone, Debug)]
pub enum Method {
    /// All evidence in one least-squares problem; the default.
    Fused(Box<Fused>),
    /// The paper's heuristic.
    Heuristic(Box<Heuristic>),
    /// The paper's ICP, or the robust one; they use depth alone.
    Icp(Icp),
}

impl Default for Method {
    fn default() -> Self {
        Fused::default().into()
    }
}

impl Method {
    /// The paper's method with all four gradients, which returns the pose whose rendering fits best.
    pub fn combined() -> Self {
        Heuristic::combined().into()
    }

    /// Sets how many steps are tried at most: of the fused estimator, by every solve of each stage.
    pub fn set_iterations(&mut self, iterations: usize) {
        match self {
            Self::Fused(fused) => {
                let stages = fused.settings.stages.iter_mut();
                stages.for_each(|stage| stage.solver.iterations = iterations);
            }
            Self::Heuristic(heuristic) => heuristic.iterations = iterations,
            Self::Icp(icp) => icp.iterations = iterations,
        }
    }

    /// Makes all the steps however small they become; the robust ICP always does.
    pub fn set_exhaustive(&mut self) {
        match self {
            Self::Fused(fused) => {
                let stages = fused.settings.stages.iter_mut();
                stages.for_each(|stage| stage.solver.min_decrease = 0.0);
            }
            Self::Heuristic(heuristic) => heuristic.exhaustive = true,
            Self::Icp(icp) => {
                if icp.metric == IcpMetric::PointToPoint {
                    icp.step_tolerance = f64::NEG_INFINITY;
                }
            }
        }
    }

    /// Gradients that are combined, each with evidence without which it cannot begin; none but of a [`Heuristic`].
    pub fn gradients(&self) -> &[GradientKind] {
        match self {
            Self::Heuristic(heuristic) => &heuristic.gradients,
            Self::Fused(_) | Self::Icp(_) => &[],
        }
    }

    fn strategy(&self) -> &dyn Strategy {
        match self {
            Self::Fused(fused) => fused.as_ref(),
            Self::Heuristic(heuristic) => heuristic.as_ref(),
            Self::Icp(icp) => icp,
        }
    }
}

impl Strategy for Method {
    fn run(
        &self,
        frame: &PreparedFrame<'_>,
        initial: &State,
        observe: &mut Observer<'_>,
    ) -> Result<Estimate, RefineError> {
        self.strategy().run(frame, initial, observe)
    }

    fn iterations(&self) -> usize {
        self.strategy().iterations()
    }
}

impl From<Fused> for Method {
    fn from(fused: Fused) -> Self {
        Self::Fused(Box::new(fused))
    }
}

impl From<Heuristic> for Method {
    fn from(heuristic: Heuristic) -> Self {
        Self::Heuristic(Box::new(heuristic))
    }
}

impl From<Icp> for Method {
    fn from(icp: Icp) -> Self {
        Self::Icp(icp)
    }
}

impl Method {
    /// Names of the methods with what each is, in the order of the paper's tables.
    pub const ALL: [(&str, &str); 17] = [
        ("fused", "all evidence in one least-squares problem, with calibrations estimated"),
        ("combined", "all four gradients, checkpointing"),
        ("combined-last", "all four gradients, the last pose"),
        ("combined-free", "all four gradients, no regularization, the last pose"),
        ("combined-free-best", "all four gradients, no regularization, checkpointing"),
        ("depth", "this gradient alone, the last pose"),
        ("depth-best", "this gradient alone, checkpointing"),
        ("tactile", "this gradient alone, the last pose"),
        ("tactile-best", "this gradient alone, checkpointing"),
        ("rendering", "this gradient alone, the last pose"),
        ("rendering-best", "this gradient alone, checkpointing"),
        ("physics", "this gradient alone, the last pose"),
        ("physics-best", "this gradient alone, checkpointing"),
        ("physics-free", "this gradient alone, no regularization, the last pose"),
        ("icp", "the paper's ICP, point to point, the last pose"),
        ("icp-best", "the paper's ICP, point to point, checkpointing"),
        ("robust-icp", "robust point-to-plane ICP, a strong baseline, the last pose"),
    ];

    /// Names of the fused estimator with less than all evidence, or with quantities believed that it would estimate: what each of them is worth.
    #[cfg(any(feature = "cli", test))]
    pub(crate) fn ablations() -> Vec<String> {
        let of = |kind: &'static str| move |m: Modality| format!("fused-{kind}-{}", m.name());
        let without = Modality::ALL.iter().copied().map(of("without"));
        let only = Modality::ALL.iter().copied().map(of("only"));
        let fixed = Nuisance::ALL.iter().map(|group| format!("fused-fixed-{}", group.name()));
        without.chain(only).chain(fixed).chain(["fused-fixed-all".to_owned()]).collect()
    }

    /// The method called `name`, of default settings: one of [`ALL`](Self::ALL), or `fused-without-M` and `fused-only-M` of a [`Modality`],
    /// `fused-fixed-N` of a [`Nuisance`] and `fused-fixed-all`.
    pub fn named(name: &str) -> Option<Self> {
        Self::with_settings(name, &FusedSettings::default())
    }

    /// The method called `name`, as [`named`](Self::named) has it; one of the fused estimator changes `settings`, a heuristic one takes the
    /// renderer's mode from them.
    pub fn with_settings(name: &str, settings: &FusedSettings) -> Option<Self> {
        if let Some(ablation) = name.strip_prefix("fused") {
            return ablated(settings.clone(), ablation).map(|settings| Fused::new(settings).into());
        }
        Self::ALL.iter().find(|(known, _)| *known == name)?;
        let checkpoint = name == "combined" || name.ends_with("-best");
        let gradients = match name.split('-').next()? {
            "icp" => return Some(Icp { checkpoint, ..Icp::default() }.into()),
            "robust" => return Some(Icp::robust().into()),
            "combined" => GradientKind::ALL.to_vec(),
            gradient => vec![gradient.parse().ok()?],
        };
        let mut heuristic = Heuristic { checkpoint, ..Heuristic::of(&gradients) };
        heuristic.rendering.set_mode_of(&settings.rendering);
        if name.contains("-free") {
            // Without the pull to the initial pose.
            heuristic.stability.displacement_sigma = f64::INFINITY;
        }
        Some(heuristic.into())
    }

    /// Takes what this method has of `settings`: the fused estimator all, a heuristic the renderer's mode.
    pub(crate) fn configure(&mut self, settings: &FusedSettings) {
        match self {
            Self::Fused(fused) => fused.settings.clone_from(settings),
            Self::Heuristic(heuristic) => heuristic.rendering.set_mode_of(&settings.rendering),
            Self::Icp(_) => {}
        }
    }
}

/// `settings` with less evidence or fewer quantities estimated: those of the name's part after `fused`.
fn ablated(mut settings: FusedSettings, ablation: &str) -> Option<FusedSettings> {
    let modality = |name: &str| Modality::ALL.iter().copied().find(|m| m.name() == name);
    if let Some(without) = ablation.strip_prefix("-without-") {
        let without = modality(without)?;
        settings.modalities.retain(|m| *m != without);
    } else if let Some(only) = ablation.strip_prefix("-only-") {
        settings.modalities = vec![modality(only)?];
    } else if ablation == "-fixed-all" {
        settings.nuisances.clear();
    } else if let Some(fixed) = ablation.strip_prefix("-fixed-") {
        let fixed = Nuisance::ALL.iter().find(|group| group.name() == fixed)?;
        settings.nuisances.retain(|group| group != fixed);
    } else if !ablation.is_empty() {
        return None;
    }
    Some(settings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::factor::{RenderingMode, RenderingSettings};

    #[test]
    fn names_are_unique_and_found() {
        let names = Method::ALL.iter().map(|(name, _)| (*name).to_owned());
        let mut all: Vec<String> = names.chain(Method::ablations()).collect();
        for name in &all {
            assert!(Method::named(name).is_some(), "{name}");
        }
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!((all.len(), count), (40, 40));
        for name in
            ["guess", "fused-", "fused-only-", "fused-fixed-touch", "depth-free", "icp-free"]
        {
            assert!(Method::named(name).is_none(), "{name}");
        }
        let debug = |name: &str| format!("{:?}", Method::named(name));
        assert_eq!(debug("combined"), format!("{:?}", Some(Method::combined())));
    }

    #[test]
    fn every_modality_and_every_nuisance_has_its_ablations() {
        let settings = |name: &str| match Method::named(name) {
            Some(Method::Fused(fused)) => fused.settings,
            _ => panic!("{name}"),
        };
        let all = settings("fused");
        for modality in Modality::ALL.iter().copied() {
            let without = settings(&format!("fused-without-{}", modality.name()));
            assert_eq!(without.modalities.len(), all.modalities.len() - 1);
            assert!(!without.modalities.contains(&modality));
            let only = settings(&format!("fused-only-{}", modality.name()));
            assert_eq!(only.modalities, [modality]);
        }
        for group in Nuisance::ALL.iter().copied() {
            let fixed = settings(&format!("fused-fixed-{}", group.name()));
            assert_eq!(fixed.nuisances.len(), all.nuisances.len() - 1);
            assert!(!fixed.nuisances.contains(&group) && fixed.modalities == all.modalities);
        }
        assert!(settings("fused-fixed-all").nuisances.is_empty());
    }

    #[test]
    fn heuristics_draw_in_the_mode_of_the_settings() {
        let mut settings = FusedSettings::default();
        settings.rendering.mode = RenderingMode::Softras;
        let Some(Method::Heuristic(soft)) = Method::with_settings("rendering", &settings) else {
            panic!("not a heuristic")
        };
        let Some(Method::Heuristic(plain)) = Method::named("rendering") else {
            panic!("not a heuristic")
        };
        assert_eq!(plain.rendering.mode, RenderingMode::Contour);
        let mode = RenderingMode::Softras;
        assert_eq!(soft.rendering, RenderingSettings { mode, ..plain.rendering });
    }

    #[test]
    fn iterations_are_set() {
        for (name, _) in Method::ALL {
            let mut method = Method::named(name).unwrap();
            method.set_iterations(7);
            match &method {
                Method::Fused(fused) => {
                    assert!(fused.settings.stages.iter().all(|s| s.solver.iterations == 7));
                    // What is counted are stages.
                    assert_eq!(method.iterations(), 4);
                }
                other => assert_eq!(other.iterations(), 7),
            }
        }
    }
}
