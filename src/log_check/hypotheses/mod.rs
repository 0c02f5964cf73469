//! Explanations of rotations that neither noise nor a constant orientation and time offset explain.
//!
//! A hypothesis is a correction of the measurements with a few parameters, for the whole log or from a time on. Each one
//! is fitted with the camera's orientation, the gyroscope's bias, the time offset and the chain within its prior, and all
//! are compared by their likelihood and their number of parameters (BIC). A cause is named if what remains is explained by
//! noise and no other cause comes near; else those that remain are listed.

mod candidates;
mod cause;
mod fit;
mod focal_grid;
mod text;

use rayon::prelude::*;

use self::candidates::{candidates, intrinsics};
use self::cause::Cause;
use self::fit::{Fitted, Fitter, Hypothesis, Kind, length_s};
use self::focal_grid::FocalGrid;
use super::rotation_data::RotationData;
use super::{Area, Findings, Severity};
use crate::gimbal::ClassicalChain;

/// Difference of the criterion by which a hypothesis must be better than another to exclude it: odds of e⁻¹⁰.
const DECISIVE: f64 = 20.0;
/// Largest number of causes that are listed.
const LISTED: usize = 3;
/// A cause must leave at most this ratio of the misfit to be listed.
const MIN_IMPROVEMENT: f64 = 0.5;
/// The same for χ² of a cause that leaves more than noise explains.
const UNEXPLAINED_IMPROVEMENT: f64 = 0.1;

/// Result of a comparison of all hypotheses.
pub(super) enum Explanation {
    /// One cause explains the misfit, and no other does.
    Decisive(Cause, String),
    /// Causes that remain, best first, each with what it leaves; may be empty.
    Open(Vec<(Cause, String)>),
}

/// Searches for the cause of a misfit between the rotations of a camera and their prediction by a chain.
pub(super) fn explain(data: &RotationData<'_>, chain: &ClassicalChain) -> Explanation {
    let fitter = Fitter::new(data, chain);
    let Some(given) = fitter.fit_given() else { return Explanation::Open(Vec::new()) };
    let fit_all =
        |all: Vec<Hypothesis>| all.into_par_iter().filter_map(|one| fitter.best(one)).collect::<Vec<Fitted>>();
    let mut fitted = fit_all(candidates(data, chain));
    // Other intrinsics need all rotations measured again; only a wrong scale of the gyroscope resembles them.
    let found = |it: &Fitted| {
        it.fit.is_explained()
            && it.kind != Kind::GyroscopeScale
            && it.criterion + DECISIVE < given.deviance
            && it.fit.misfit_rad < MIN_IMPROVEMENT * given.misfit_rad
    };
    if !fitted.iter().any(found) {
        let grid = FocalGrid::new(&fitter);
        fitted.extend(fit_all(intrinsics(chain.joint_count(), grid.best_constant())));
        fitted.extend(grid.pieces_fit(&fitter));
    }
    fitted.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    let compared = match length_s(chain) {
        0.0 => "rotations from image to image".to_owned(),
        length_s => format!("rotations over {length_s:.1} s"),
    };
    let evidence = |found: &Fitted| {
        format!(
            "{compared} then differ by {:.3}°, {:.3}° without; noise predicts {:.3}° (χ²/dof {:.2}, {:.2} without)",
            found.fit.misfit_rad.to_degrees(),
            given.misfit_rad.to_degrees(),
            found.fit.predicted_misfit_rad.to_degrees(),
            found.fit.mean_square,
            given.mean_square
        )
    };
    let describe = |found: &Fitted| (text::cause(data, found), evidence(found));
    // Of two that explain the misfit, a special case is preferred unless it is decisively worse.
    let simpler = |best: &Fitted| {
        fitted.iter().find(|it| {
            best.contains(it)
                && it.kind != best.kind
                && it.fit.is_explained()
                && it.criterion < best.criterion + DECISIVE
        })
    };
    let Some(best) = fitted.first().map(|best| simpler(best).unwrap_or(best)) else {
        return Explanation::Open(Vec::new());
    };
    let rival = fitted.iter().find(|other| !other.contains(best));
    let is_alone = rival.is_none_or(|rival| rival.criterion > best.criterion + DECISIVE);
    if best.fit.is_explained() && is_alone && best.criterion + DECISIVE < given.deviance {
        let (cause, evidence) = describe(best);
        return Explanation::Decisive(cause, evidence);
    }
    let mut open: Vec<(Cause, String)> = Vec::new();
    for found in &fitted {
        let is_explained = found.fit.is_explained();
        let remains = found.criterion < best.criterion + DECISIVE || (best.fit.is_explained() && is_explained);
        let improves = is_explained && found.fit.misfit_rad < MIN_IMPROVEMENT * given.misfit_rad
            || found.fit.mean_square < UNEXPLAINED_IMPROVEMENT * given.mean_square;
        let (cause, evidence) = describe(found);
        if remains && improves && open.len() < LISTED && open.iter().all(|(listed, _)| listed.title != cause.title) {
            open.push((cause, evidence));
        }
    }
    Explanation::Open(open)
}

impl Explanation {
    /// Adds the finding; `evidence` has the numbers of the misfit as recorded.
    pub(super) fn report(self, key: &str, evidence: &str, remedy: &str, findings: &mut Findings) {
        match self {
            Self::Decisive(cause, of_cause) => {
                let evidence = format!("{of_cause}; as recorded: {evidence}");
                findings.add(cause.severity, cause.area, cause.title, evidence, cause.remedy);
            }
            Self::Open(causes) => {
                let title =
                    format!("unexplained: the rotations of {key} differ from the prediction by more than their noise");
                if causes.is_empty() {
                    return findings.add(Severity::Warning, Area::Extrinsics, title, evidence, remedy);
                }
                if let [(only, of_cause)] = causes.as_slice() {
                    let title = format!("most likely {}", only.title);
                    let evidence = format!("{of_cause}; as recorded: {evidence}");
                    return findings.add(only.severity, only.area, title, evidence, only.remedy.clone());
                }
                let listed: Vec<String> =
                    causes.iter().map(|(cause, evidence)| format!("{} ({evidence})", cause.title)).collect();
                let titles: Vec<&str> = causes.iter().map(|(cause, _)| cause.title.as_str()).collect();
                let remedies: Vec<&str> = causes.iter().map(|(cause, _)| cause.remedy.as_str()).collect();
                let title = format!("the rotations of {key} differ from the prediction: {}", titles.join(", or "));
                let evidence = format!("{}; as recorded: {evidence}", listed.join("; or "));
                findings.add(Severity::Warning, Area::Extrinsics, title, evidence, remedies.join("; or "));
            }
        }
    }
}
