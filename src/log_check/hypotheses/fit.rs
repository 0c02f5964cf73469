//! Fit of a hypothesis to the rotations of a camera.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::super::correction::{Correction, LensChange, Parameter};
use super::super::statistics::median;
use crate::gimbal::ClassicalChain;
use crate::log_check::rotations::data::{JOINED_S, MeasuredRotation, RotationData, joined};
use crate::log_check::rotations::fit::{
    ExtraColumn, FREE_ORIENTATION_RAD, FitPriors, Prediction, RotationFit, RotationPair,
};

/// Prior standard deviation of the time offset of camera and gyroscope beyond the rig's.
const OFFSET_SIGMA_S: f64 = 0.02;
/// Prior standard deviation of the ratio of image rotations to predicted ones: a change of it is a hypothesis.
const SCALE_SIGMA: f64 = 0.005;
/// Prior standard deviation of the camera's orientation where a hypothesis takes it from the rig, in radians.
const KEPT_ORIENTATION_RAD: f64 = 0.02;
const ITERATIONS: usize = 8;
/// Half the relative range in which a focal length is searched around that of the grid, and the length at which it ends.
const FOCAL_RANGE: f64 = 0.06;
const FOCAL_PRECISION: f64 = 1e-3;
/// Change of all parameters, in units of their steps, at which the iterations end.
const CONVERGED: f64 = 0.05;
/// Number of starts from which a hypothesis is fitted until it converges: the best after one iteration.
const FOLLOWED: usize = 2;
/// Smallest corrections that count as a fault where noise explains the rotations without them.
const NOTICEABLE_SCALE: f64 = 0.03;
const NOTICEABLE_ANGLE_RAD: f64 = 0.026;
const NOTICEABLE_DELAY_S: f64 = 0.02;
/// In seconds per second.
const NOTICEABLE_DRIFT: f64 = 2e-4;
/// Ratio of the median misfit with a correction to that without up to which it removes a misfit.
const REMOVED_MISFIT: f64 = 0.6;
/// Minimum number of rotations.
const MIN_ROTATIONS: usize = 12;

/// Possible cause of a misfit.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::log_check) struct Hypothesis {
    pub(super) kind: Kind,
    /// Corrections from which the parameters are fitted; the best fit is taken.
    pub(super) starts: Vec<Correction>,
    pub(super) parameters: Vec<Parameter>,
    /// Times in seconds from which on the correction may apply; the best one is taken. Empty: to the whole log.
    pub(super) since_s: Vec<f64>,
    /// True if the camera's orientation is the rig's: else it is estimated, whatever it is.
    pub(super) keeps_orientation: bool,
}

impl Hypothesis {
    /// A correction of the whole log, with any orientation of the camera.
    pub(super) fn new(kind: Kind, starts: Vec<Correction>, parameters: &[Parameter]) -> Self {
        Self { kind, starts, parameters: parameters.to_vec(), since_s: Vec::new(), keeps_orientation: false }
    }

    /// The same from one of these times on.
    pub(super) fn since_one_of(self, since_s: Vec<f64>) -> Self {
        Self { since_s, ..self }
    }

    /// The same with the camera's orientation by the rig.
    pub(super) fn with_orientation_of_rig(self) -> Self {
        Self { keeps_orientation: true, ..self }
    }
}

/// Kind of a hypothesis, from which its text is made.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::log_check) enum Kind {
    LeftHanded,
    GyroscopeScale,
    Focal,
    Centre,
    /// Focal length and principal point.
    Intrinsics,
    /// Time offset and its drift.
    CameraDrift,
    /// Joints whose readings have the other sign.
    JointSigns(Vec<usize>),
    /// Joints are recorded under each other's names.
    JointOrder,
    /// Readings of all joints are in another unit.
    JointUnit,
    JointScale(usize),
    JointOffset(usize),
    JointDelay,
    /// The mount of the camera moves at a time.
    Mount,
    /// The focal length changes: times in seconds from which on a ratio to the rig's holds.
    FocalPieces(Vec<(f64, f64)>),
}

/// Fit of a hypothesis.
#[derive(Clone, Debug)]
pub(in crate::log_check) struct Fitted {
    pub(super) kind: Kind,
    pub(super) correction: Correction,
    pub(super) since_s: Option<f64>,
    /// Fit of the corrected data.
    pub(super) fit: RotationFit,
    /// Deviance plus the logarithm of the number of measurements per parameter.
    pub(super) criterion: f64,
}

impl Fitted {
    /// True if the correction removes a misfit, in all rotations or, if it begins at a time, in those before or after it: a
    /// larger likelihood alone can be that of a few wrong rotations.
    pub(super) fn removes_misfit(&self, given: &RotationFit) -> bool {
        let split_s = self.since_s.unwrap_or(f64::NEG_INFINITY);
        let is_removed = |is_after: bool| {
            let [without, with] = [given, &self.fit].map(|fit| {
                let part = fit.misfits_rad.iter().filter(|(middle_s, _)| (*middle_s >= split_s) == is_after);
                median(&part.map(|(_, misfit_rad)| *misfit_rad).collect::<Vec<_>>())
            });
            with < REMOVED_MISFIT * without
        };
        is_removed(true) || (self.since_s.is_some() && is_removed(false))
    }

    /// True if the correction is larger than what sound sensors and rigs differ by.
    pub(super) fn is_noticeable(&self) -> bool {
        let correction = &self.correction;
        match &self.kind {
            Kind::GyroscopeScale => (correction.gyroscope_scale - 1.0).abs() > NOTICEABLE_SCALE,
            Kind::CameraDrift => correction.camera_drift.abs() > NOTICEABLE_DRIFT,
            Kind::JointScale(joint) => (correction.joints[*joint].scale - 1.0).abs() > NOTICEABLE_SCALE,
            Kind::JointOffset(joint) => correction.joints[*joint].offset_rad.abs() > NOTICEABLE_ANGLE_RAD,
            Kind::JointDelay => correction.joint_delay_s.abs() > NOTICEABLE_DELAY_S,
            Kind::Mount => correction.mount.angle() > NOTICEABLE_ANGLE_RAD,
            Kind::LeftHanded
            | Kind::Focal
            | Kind::Centre
            | Kind::Intrinsics
            | Kind::FocalPieces(_)
            | Kind::JointSigns(_)
            | Kind::JointOrder
            | Kind::JointUnit => true,
        }
    }

    /// True if this hypothesis has the other one as a special case: it cannot exclude it by fitting as well.
    pub(super) fn contains(&self, other: &Self) -> bool {
        match (&self.kind, &other.kind) {
            (Kind::FocalPieces(_) | Kind::Intrinsics, Kind::Focal) | (Kind::Intrinsics, Kind::Centre) => true,
            (Kind::Mount, Kind::JointOffset(_)) => self.since_s.is_some() && other.since_s.is_some(),
            // Two axes reversed are half a turn about the third: other signs with an offset can be the same mechanism.
            (Kind::JointSigns(mine), Kind::JointSigns(others)) => others.iter().all(|joint| mine.contains(joint)),
            (mine, others) => mine == others,
        }
    }
}

/// Length over which rotations of consecutive images are joined, in seconds; that of one pair for a rigid camera.
pub(super) fn length_s(chain: &ClassicalChain) -> f64 {
    if chain.links.is_empty() { 0.0 } else { JOINED_S }
}

/// Fits hypotheses to the rotations of one camera.
pub(super) struct Fitter<'a> {
    pub(super) data: &'a RotationData<'a>,
    pub(super) chain: &'a ClassicalChain,
    /// With any orientation of the camera.
    priors: FitPriors,
    /// Smallest error of the orientation that counts as one, in radians.
    orientation_tolerance_rad: f64,
    /// Rotations as recorded.
    pub(super) measured: Vec<MeasuredRotation>,
}

impl<'a> Fitter<'a> {
    pub(super) fn new(data: &'a RotationData<'a>, chain: &'a ClassicalChain, orientation_tolerance_rad: f64) -> Self {
        let priors = FitPriors {
            orientation_rad: FREE_ORIENTATION_RAD,
            time_offset_s: OFFSET_SIGMA_S,
            scale: SCALE_SIGMA,
            chain: data.chain_sigma_rad(),
        };
        let measured = joined(&data.measured, length_s(chain));
        Self { data, chain, priors, orientation_tolerance_rad, measured }
    }

    /// Criterion of a fit with a number of parameters: those of the orientation count if it is not the rig's.
    pub(super) fn criterion(&self, fit: &RotationFit, parameters: usize) -> f64 {
        let turned = if self.has_other_orientation(fit) { 3 } else { 0 };
        fit.deviance + (parameters + turned) as f64 * self.parameter_cost()
    }

    /// Cost of a parameter in the criterion.
    pub(super) fn parameter_cost(&self) -> f64 {
        (3.0 * self.measured.len() as f64).ln()
    }

    /// True if the orientation of a fit differs from the rig's.
    pub(super) fn has_other_orientation(&self, fit: &RotationFit) -> bool {
        fit.orientation.angle() > self.orientation_tolerance_rad
    }

    /// Rotations with the lens of a correction.
    fn measured(&self, correction: &Correction) -> Cow<'_, [MeasuredRotation]> {
        if correction.lens == LensChange::NONE {
            return Cow::Borrowed(&self.measured);
        }
        Cow::Owned(joined(&self.data.with_lens(&correction.lens), length_s(self.chain)))
    }

    /// Fit without a correction.
    pub(super) fn fit_given(&self) -> Option<RotationFit> {
        self.linear_fit(&Correction::none(self.chain.joint_count()), &[], None, &self.priors)
    }

    /// Best fit of a hypothesis over its starts and times.
    pub(super) fn best(&self, hypothesis: Hypothesis) -> Option<Fitted> {
        let Hypothesis { kind, starts, parameters, since_s, keeps_orientation } = hypothesis;
        let orientation_rad = if keeps_orientation { KEPT_ORIENTATION_RAD } else { FREE_ORIENTATION_RAD };
        let priors = FitPriors { orientation_rad, ..self.priors };
        let times: Vec<Option<f64>> =
            if since_s.is_empty() { vec![None] } else { since_s.iter().copied().map(Some).collect() };
        let mut tried: Vec<(f64, &Correction, Option<f64>)> = Vec::new();
        for start in &starts {
            for since_s in &times {
                if let Some(fit) = self.linear_fit(start, &parameters, *since_s, &priors) {
                    tried.push((fit.deviance, start, *since_s));
                }
            }
        }
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let followed = tried.into_iter().take(FOLLOWED);
        let fits =
            followed.filter_map(|(_, start, since_s)| self.converged(&kind, start, &parameters, since_s, &priors));
        fits.min_by(|a, b| a.criterion.total_cmp(&b.criterion))
    }

    /// Iterates corrections of the data and linear fits until the parameters no longer change.
    fn converged(
        &self,
        kind: &Kind,
        start: &Correction,
        parameters: &[Parameter],
        since_s: Option<f64>,
        priors: &FitPriors,
    ) -> Option<Fitted> {
        let mut correction = if *kind == Kind::Focal { self.best_focal(start) } else { start.clone() };
        let iterations = if *kind == Kind::Focal || parameters.is_empty() { 0 } else { ITERATIONS };
        for _ in 0..iterations {
            let values = self.linear_fit(&correction, parameters, since_s, priors)?.extra;
            apply(parameters, &values, &mut correction);
            let change = parameters.iter().zip(&values).map(|(parameter, value)| value.abs() / parameter.step());
            if change.fold(0.0, f64::max) < CONVERGED {
                break;
            }
        }
        // What is reported is the misfit of corrected data, not that of a linear model of the correction.
        let fit = self.linear_fit(&correction, &[], since_s, priors)?;
        let parameters = parameters.len() + usize::from(since_s.is_some());
        let criterion = self.criterion(&fit, parameters);
        Some(Fitted { kind: kind.clone(), correction, since_s, fit, criterion })
    }

    /// Correction with the focal length near the start that has the largest likelihood, by golden section: every focal
    /// length has other measured rotations, and other wrong ones among them.
    fn best_focal(&self, start: &Correction) -> Correction {
        let at = |logarithm: f64| {
            let mut correction = start.clone();
            correction.lens.focal *= logarithm.exp();
            correction
        };
        let deviance = |logarithm: f64| {
            self.linear_fit(&at(logarithm), &[], None, &self.priors).map_or(f64::INFINITY, |fit| fit.deviance)
        };
        let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut low, mut high) = (-FOCAL_RANGE, FOCAL_RANGE);
        let (mut left, mut right) = (high - ratio * (high - low), low + ratio * (high - low));
        let (mut at_left, mut at_right) = (deviance(left), deviance(right));
        while high - low > FOCAL_PRECISION {
            if at_left < at_right {
                (high, right, at_right) = (right, left, at_left);
                left = high - ratio * (high - low);
                at_left = deviance(left);
            } else {
                (low, left, at_left) = (left, right, at_right);
                right = low + ratio * (high - low);
                at_right = deviance(right);
            }
        }
        at(0.5 * (low + high))
    }

    fn linear_fit(
        &self,
        correction: &Correction,
        parameters: &[Parameter],
        since_s: Option<f64>,
        priors: &FitPriors,
    ) -> Option<RotationFit> {
        let none = Correction::none(self.chain.joint_count());
        let at = self.pairs(&none, correction, since_s);
        if at.len() < MIN_ROTATIONS {
            return None;
        }
        let column = |parameter: &Parameter| {
            let step = parameter.step();
            let mut changed = correction.clone();
            parameter.add(&mut changed, step);
            let stepped = self.pairs(&none, &changed, since_s);
            // A rotation that the changed data no longer cover does not constrain the parameter.
            let derivative = |of: &dyn Fn(&RotationPair) -> Vector3<f64>| {
                let quotient = |(key, pair): (&i64, &RotationPair)| {
                    stepped.get(key).map_or_else(Vector3::zeros, |stepped| (of(stepped) - of(pair)) / step)
                };
                at.iter().map(quotient).collect::<Vec<_>>()
            };
            ExtraColumn {
                of_predicted: derivative(&|pair| pair.predicted(self.chain)),
                of_measured: derivative(&|pair| pair.measured),
                sigma: parameter.bounds().0,
            }
        };
        let columns: Vec<ExtraColumn> = parameters.iter().map(column).collect();
        let pairs: Vec<RotationPair> = at.values().cloned().collect();
        RotationFit::with_columns(&pairs, self.chain, priors, &columns)
    }

    /// Pairs by the stamp of their first image, with one correction before and another one after a time.
    fn pairs(&self, before: &Correction, after: &Correction, since_s: Option<f64>) -> BTreeMap<i64, RotationPair> {
        let mut pairs = BTreeMap::new();
        let mut extend = |correction: &Correction, from_s: f64, to_s: f64| {
            let predictor = self.data.predictor(self.chain, correction);
            let measured = self.measured(correction);
            let within = measured.iter().filter(|it| (from_s..to_s).contains(&it.middle_s()));
            pairs.extend(within.filter_map(|it| Some((it.rotation.from_ns, predictor.pair(it)?))));
        };
        let split_s = since_s.unwrap_or(f64::NEG_INFINITY);
        extend(after, split_s, f64::INFINITY);
        if since_s.is_some() {
            extend(before, f64::NEG_INFINITY, split_s);
        }
        pairs
    }

    /// Fit of rotations as measured with another lens each, and their predictions in the frame of the measured rotations
    /// with covariances in rad², by the stamp of the first image.
    pub(super) fn fit_measured(&self, measured: &[MeasuredRotation]) -> Option<(RotationFit, Predictions)> {
        let none = Correction::none(self.chain.joint_count());
        let predictor = self.data.predictor(self.chain, &none);
        let (keys, pairs): (Vec<i64>, Vec<RotationPair>) =
            measured.iter().filter_map(|it| Some((it.rotation.from_ns, predictor.pair(it)?))).unzip();
        if pairs.len() < MIN_ROTATIONS {
            return None;
        }
        let (fit, predictions) = RotationFit::with_predictions(&pairs, self.chain, &self.priors)?;
        Some((fit, keys.into_iter().zip(predictions).collect()))
    }

    /// Predictions by the rig, as [`Self::fit_measured`] returns them.
    pub(super) fn predictions_by_rig(&self, measured: &[MeasuredRotation]) -> Predictions {
        let none = Correction::none(self.chain.joint_count());
        let predictor = self.data.predictor(self.chain, &none);
        let predicted = |it: &MeasuredRotation| {
            let pair = predictor.pair(it)?;
            Some((it.rotation.from_ns, (pair.predicted(self.chain), pair.covariance_rad2)))
        };
        measured.iter().filter_map(predicted).collect()
    }
}

/// Predicted rotation vectors and their covariances by the stamp of the first image.
pub(super) type Predictions = BTreeMap<i64, Prediction>;

/// Adds fitted values to a correction, none by more than its largest change.
fn apply(parameters: &[Parameter], values: &[f64], correction: &mut Correction) {
    for (parameter, value) in parameters.iter().zip(values) {
        let largest = parameter.bounds().1;
        parameter.add(correction, value.clamp(-largest, largest));
    }
}
