//! Explanations of rotations that neither noise nor a constant orientation and time offset explain.
//!
//! A hypothesis is a correction of the measurements with a few parameters, for the whole log or from a time on. Each one
//! is fitted with the camera's orientation, the gyroscope's bias, the time offset and the chain within its prior, and all
//! are compared by their likelihood and their number of parameters (BIC). A cause is named if what remains is explained by
//! noise and no other cause comes near; else those that remain are listed.

mod candidates;
mod change_time;
mod fit;
mod focal_grid;
mod focal_period;
mod image_order;
mod lens_precision;

use rayon::prelude::*;

use self::candidates::{candidates, intrinsics, other_axes, radial, since};
use self::change_time::change_s;
use self::fit::{Fitted, Fitter, Hypothesis, length_s};
use self::focal_grid::FocalGrid;
use self::focal_period::LinearModels;
pub(in crate::log_check) use self::lens_precision::LensValue;
use super::data::RotationData;
use super::fit::RotationFit;
use crate::faults::{Explanation as _, Fault, FaultKind, MOST_REMAINING, Sensor, Sentence, Subject};
use crate::geometry::SignedAxes;
use crate::gimbal::ClassicalChain;
use crate::log_check::report::suspects::Suspects;
use crate::log_check::report::{Area, Findings, Severity};
use crate::sensors::CameraMount;

/// Difference of the criterion by which a hypothesis must be better than another to exclude it: odds of e⁻¹⁰.
const DECISIVE: f64 = 20.0;
/// The same for a cause of rotations that noise explains: many are tried, at many times.
const DECISIVE_WITHIN_NOISE: f64 = 40.0;
/// A cause must leave at most this ratio of the misfit to be listed.
const MIN_IMPROVEMENT: f64 = 0.5;
/// The same for χ² of a cause that leaves more than noise explains.
const UNEXPLAINED_IMPROVEMENT: f64 = 0.1;

/// Cause of a misfit in words and with its value.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::log_check) struct NamedCause {
    area: Area,
    pub(in crate::log_check) sentence: Sentence,
    /// `None` if the fit does not give its value.
    pub(in crate::log_check) fault: Option<Fault>,
}

/// Result of a comparison of all hypotheses.
pub(in crate::log_check) enum Outcome {
    /// One cause explains the misfit, and no other does.
    Decisive(Box<NamedCause>, String),
    /// Causes that remain, best first, each with what it leaves; may be empty.
    Open(Vec<(NamedCause, String)>),
}

/// Causes of rotations that noise explains.
pub(in crate::log_check) struct WithinNoise {
    /// Causes that are much more likely than none, if there are any.
    pub(in crate::log_check) cause: Option<Outcome>,
    /// Causes that explain the rotations as well as another orientation of the camera does, the most likely first.
    pub(in crate::log_check) instead_of_orientation: Vec<NamedCause>,
    /// Number of them that are more likely than another orientation.
    pub(in crate::log_check) more_likely: usize,
    /// Values of the lens of which no rotation shows an error that makes results useless.
    pub(in crate::log_check) unverified: Vec<LensValue>,
}

/// Searches for the cause of a misfit between the rotations of a camera and their prediction by a chain, among the faults of the
/// suspects. An orientation that differs from the rig's by more than the tolerance counts as a fault.
pub(in crate::log_check) fn explain(
    data: &RotationData<'_>,
    chain: &ClassicalChain,
    suspects: &Suspects,
    orientation_tolerance_rad: f64,
) -> Outcome {
    let Some(mut comparison) = Comparison::new(data, chain, suspects, orientation_tolerance_rad) else {
        return Outcome::Open(Vec::new());
    };
    if suspects.include(Sensor::Camera) {
        comparison.fitted.extend(image_order::fit(&comparison.fitter));
        Fitted::sort(&mut comparison.fitted);
        comparison.add_intrinsics();
    }
    comparison.explanation()
}

/// Searches for faults that are within the noise of single rotations, such as a jump of a joint late in the log.
pub(in crate::log_check) fn explain_within_noise(
    data: &RotationData<'_>,
    chain: &ClassicalChain,
    suspects: &Suspects,
    orientation_tolerance_rad: f64,
) -> WithinNoise {
    let lens = LensValue::measured(data, chain);
    let unverified = lens.iter().filter(|value| value.is_unverified()).cloned().collect();
    let none = WithinNoise { cause: None, instead_of_orientation: Vec::new(), more_likely: 0, unverified };
    let Some(comparison) = Comparison::new(data, chain, suspects, orientation_tolerance_rad) else { return none };
    let given = comparison.criterion_given();
    let explains = |found: &&Fitted| found.fit.is_explained() && found.fault.is_noticeable();
    let is_decisive =
        |found: &&Fitted| found.criterion + DECISIVE_WITHIN_NOISE < given && found.removes_misfit(&comparison.given);
    if let Some(best) = comparison.fitted.first().filter(explains).filter(is_decisive) {
        return WithinNoise { cause: Some(comparison.decisive(best)), ..none };
    }
    if suspects.include(Sensor::Camera)
        && let Some(cause) = comparison.lens_within_noise(lens)
    {
        return WithinNoise { cause: Some(cause), ..none };
    }
    if !comparison.fitter.has_other_orientation(&comparison.given) {
        return none;
    }
    let instead = |found: &&Fitted| {
        explains(found) && found.criterion < given + DECISIVE && !comparison.fitter.has_other_orientation(&found.fit)
    };
    let mut listed: Vec<&Fitted> = Vec::new();
    for found in comparison.fitted.iter().filter(instead) {
        // A movement of the mount can always replace a jump of the last joint.
        if listed.len() + 1 < MOST_REMAINING && !listed.iter().any(|special| found.fault.contains(&special.fault)) {
            listed.push(found);
        }
    }
    WithinNoise {
        more_likely: listed.iter().filter(|found| found.criterion < given).count(),
        instead_of_orientation: listed.into_iter().map(|found| cause(data, found)).collect(),
        ..none
    }
}

/// Cause that a fit describes, in words and with its value.
fn cause(data: &RotationData<'_>, found: &Fitted) -> NamedCause {
    let kind = found.fault.kind;
    let fault = if found.fault == Fault::left_handed() {
        recorded_axes(data, found).map(|axes| Fault::of_axes(kind, axes))
    } else {
        Some(found.fault.clone().of_camera(&data.camera.key))
    };
    let fault = fault.map(|fault| {
        let is_turned = fault.axes().is_some_and(|axes| !axes.is_left_handed());
        // An accelerometer with the axes of the gyroscope has its wrong ones, too.
        let is_of_imu = kind == FaultKind::GyroscopeAxes && fault.since_s.is_none() && data.imu_facts.axes_agree;
        if is_of_imu && is_turned { Fault { kind: FaultKind::ImuAxes, ..fault } } else { fault }
    });
    let subject = Subject { rig: data.rig, camera_key: &data.camera.key };
    let without_axes = Fault::from(kind);
    let sentence = subject.sentence(fault.as_ref().unwrap_or(&without_axes));
    NamedCause { area: kind.row().area, sentence, fault }
}

/// Axes of the rig's IMU as those of a recording with a left-handed frame; the camera's orientation by the rig says which
/// are exchanged.
fn recorded_axes(data: &RotationData<'_>, found: &Fitted) -> Option<SignedAxes> {
    let CameraMount::Static { imu_from_camera } = &data.camera.mount else { return None };
    // Recorded rates are ω' = P ω; the images measure R₀ ω = −R₁ R₀ ω' with the fitted orientation R₁.
    let rotation = imu_from_camera.rotation.inverse().to_rotation_matrix().into_inner();
    let orientation = found.fit.orientation.to_rotation_matrix().into_inner();
    SignedAxes::nearest(&-(rotation.transpose() * orientation * rotation))
}

/// Hypotheses about one camera with their fits.
struct Comparison<'a> {
    data: &'a RotationData<'a>,
    fitter: Fitter<'a>,
    /// Fit without a correction.
    given: RotationFit,
    /// The most likely first.
    fitted: Vec<Fitted>,
}

impl<'a> Comparison<'a> {
    /// Fits all hypotheses about the suspects but those about intrinsics; `None` without enough rotations.
    fn new(
        data: &'a RotationData<'a>,
        chain: &'a ClassicalChain,
        suspects: &Suspects,
        orientation_tolerance_rad: f64,
    ) -> Option<Self> {
        let fitter = Fitter::new(data, chain, orientation_tolerance_rad);
        let given = fitter.fit_given()?;
        let mut all = candidates(data, chain);
        // Both an IMU and a camera that are turned explain the same rotations, and the camera's turn is more likely.
        if suspects.are_only(Sensor::Imu) {
            all.push(other_axes());
        }
        if let Some(change_s) = change_s(&fitter) {
            all = since(all, change_s);
        }
        all.retain(|hypothesis| hypothesis.starts().iter().any(|fault| suspects.allow(fault)));
        let mut comparison = Self { data, fitter, given, fitted: Vec::new() };
        comparison.add(all);
        Fitted::sort(&mut comparison.fitted);
        if let Some(refined) = comparison.fitted.first().and_then(|best| comparison.fitter.at_best_time(best)) {
            comparison.fitted[0] = refined;
        }
        Some(comparison)
    }

    fn add(&mut self, hypotheses: Vec<Hypothesis>) {
        let fitted: Vec<Fitted> = hypotheses.into_par_iter().filter_map(|one| self.fitter.best(one)).collect();
        self.fitted.extend(fitted);
    }

    /// Criterion without a correction.
    fn criterion_given(&self) -> f64 {
        self.fitter.criterion(&self.given, 0)
    }

    /// Adds the hypotheses about intrinsics unless another one explains the misfit: other intrinsics need all rotations
    /// measured again; only a wrong scale of the gyroscope resembles them.
    fn add_intrinsics(&mut self) {
        let found = |it: &Fitted| {
            it.fit.is_explained()
                && it.fault.kind != FaultKind::GyroscopeScale
                && it.criterion + DECISIVE < self.criterion_given()
                && it.fit.misfit_rad < MIN_IMPROVEMENT * self.given.misfit_rad
        };
        if self.fitted.iter().any(found) {
            return;
        }
        let Some(models) = LinearModels::new(&self.fitter, &self.fitter.measured) else { return };
        let few = self.data.thinned();
        let few = Fitter::new(&few, self.fitter.chain, self.fitter.orientation_tolerance_rad);
        let grid = FocalGrid::new(&few);
        let mut lenses = intrinsics(grid.best_constant());
        lenses.push(radial());
        let fitted: Vec<Fitted> = lenses.into_par_iter().filter_map(|lens| self.fitter.best_lens(lens, &few)).collect();
        self.fitted.extend(fitted);
        // Pieces of the few rotations tell whether all are worth the time.
        let given = few.fit_given().map_or(f64::NEG_INFINITY, |given| few.criterion(&given, 0));
        if grid.pieces_fit(&few).is_some_and(|pieces| pieces.criterion + DECISIVE < given) {
            self.fitted.extend(FocalGrid::new(&self.fitter).pieces_fit(&self.fitter));
        }
        self.fitted.extend(models.period_fit(&self.fitter));
        Fitted::sort(&mut self.fitted);
    }

    /// Another lens by rotations that noise explains: single rotations do not tell it, the sum of their information does. It must
    /// be much more likely than the rig's and than each other cause, and must reduce the misfit.
    fn lens_within_noise(&self, mut values: Vec<LensValue>) -> Option<Outcome> {
        values.sort_by(|one, other| other.sigmas.total_cmp(&one.sigmas));
        let best = values.first().filter(|value| value.is_contradicted())?;
        let by_others = self.fitted.first().map_or(0.0, |other| self.criterion_given() - other.criterion).max(0.0);
        if best.sigmas.powi(2) < by_others + DECISIVE {
            return None;
        }
        let remain = values.iter().take_while(|value| value.sigmas.powi(2) + DECISIVE > best.sigmas.powi(2));
        let fits = remain.filter_map(|value| self.fitter.with_fault(value.fault.clone()));
        let fits: Vec<Fitted> = fits.filter(|found| found.fit.misfit_rad < self.given.misfit_rad).collect();
        match fits.as_slice() {
            [] => None,
            [only] => Some(self.decisive(only)),
            several => Some(Outcome::Open(several.iter().map(|found| self.describe(found)).collect())),
        }
    }

    fn decisive(&self, found: &Fitted) -> Outcome {
        let (cause, evidence) = self.describe(found);
        Outcome::Decisive(Box::new(cause), evidence)
    }

    /// Cause in words, with what it leaves.
    fn describe(&self, found: &Fitted) -> (NamedCause, String) {
        let compared = match length_s(self.fitter.chain) {
            0.0 => "rotations from image to image".to_owned(),
            length_s => format!("rotations over {length_s:.1} s"),
        };
        let evidence = format!(
            "{compared} then differ by {:.3}°, {:.3}° without; noise predicts {:.3}° (χ²/dof {:.2}, {:.2} without)",
            found.fit.misfit_rad.to_degrees(),
            self.given.misfit_rad.to_degrees(),
            found.fit.predicted_misfit_rad.to_degrees(),
            found.fit.mean_square,
            self.given.mean_square
        );
        (cause(self.data, found), evidence)
    }

    fn explanation(&self) -> Outcome {
        let (fitted, given) = (&self.fitted, &self.given);
        let preferred = Fitted::preferred(fitted, DECISIVE, |it| it.fit.is_explained());
        let Some(best) = fitted.get(preferred) else { return Outcome::Open(Vec::new()) };
        let is_alone = best.rivals(fitted, DECISIVE).next().is_none();
        let is_less = |found: &Fitted| found.fit.misfit_rad < given.misfit_rad;
        if best.fit.is_explained() && is_less(best) && is_alone && best.criterion + DECISIVE < self.criterion_given() {
            return self.decisive(best);
        }
        let mut open: Vec<(NamedCause, String)> = Vec::new();
        for found in fitted {
            let is_explained = found.fit.is_explained();
            let remains = found.criterion < best.criterion + DECISIVE || (best.fit.is_explained() && is_explained);
            let improves = is_explained && found.fit.misfit_rad < MIN_IMPROVEMENT * given.misfit_rad
                || found.fit.mean_square < UNEXPLAINED_IMPROVEMENT * given.mean_square;
            let (cause, evidence) = self.describe(found);
            let key = |cause: &NamedCause| cause.fault.as_ref().map(|fault| (fault.kind, fault.choice));
            let is_listed = |listed: &NamedCause| {
                listed.sentence.statement == cause.sentence.statement
                    || (cause.area == Area::Imu && key(listed) == key(&cause))
            };
            if remains
                && improves
                && is_less(found)
                && open.len() < MOST_REMAINING
                && !open.iter().any(|(listed, _)| is_listed(listed))
            {
                open.push((cause, evidence));
            }
        }
        Outcome::Open(open)
    }
}

impl NamedCause {
    /// Adds the finding of the camera `key`.
    fn report(&self, key: &str, title: &str, evidence: String, findings: &mut Findings) {
        let Sentence { severity, remedy, .. } = &self.sentence;
        findings.add(*severity, self.area, title, evidence, remedy.clone());
        findings.state_faults(self.fault.clone());
        findings.mark_misfit(key);
    }
}

impl Outcome {
    /// True if the cause, or the first of those that remain, is in this area.
    pub(in crate::log_check) fn is_of(&self, area: Area) -> bool {
        match self {
            Self::Decisive(cause, _) => cause.area == area,
            Self::Open(causes) => causes.first().is_some_and(|(cause, _)| cause.area == area),
        }
    }

    /// Adds the finding; `evidence` has the numbers of the misfit as recorded.
    pub(in crate::log_check) fn report(&self, key: &str, evidence: &str, remedy: &str, findings: &mut Findings) {
        match self {
            Self::Decisive(cause, of_cause) => {
                let evidence = format!("{of_cause}; as recorded: {evidence}");
                cause.report(key, &cause.sentence.statement, evidence, findings);
            }
            Self::Open(causes) => {
                let title =
                    format!("unexplained: the rotations of {key} differ from the prediction by more than their noise");
                if causes.is_empty() {
                    findings.add(Severity::Warning, Area::Extrinsics, title, evidence, remedy);
                    return findings.mark_misfit(key);
                }
                if let [(only, of_cause)] = causes.as_slice() {
                    let title = format!("most likely {}", only.sentence.statement);
                    return only.report(key, &title, format!("{of_cause}; as recorded: {evidence}"), findings);
                }
                let listed: Vec<String> = causes
                    .iter()
                    .map(|(cause, evidence)| format!("{} ({evidence})", cause.sentence.statement))
                    .collect();
                let titles: Vec<&str> = causes.iter().map(|(cause, _)| cause.sentence.statement.as_str()).collect();
                let remedies: Vec<&str> = causes.iter().map(|(cause, _)| cause.sentence.remedy.as_str()).collect();
                let title = format!("the rotations of {key} differ from the prediction: {}", titles.join(", or "));
                let evidence = format!("{}; as recorded: {evidence}", listed.join("; or "));
                findings.add(Severity::Warning, Area::Extrinsics, title, evidence, remedies.join("; or "));
                findings.state_faults(causes.iter().filter_map(|(cause, _)| cause.fault.clone()));
                findings.mark_misfit(key);
            }
        }
    }
}
