//! Fit of a hypothesis to the rotations of a camera.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::faults::{Explanation, Fault, FaultKind, LensChange};
use crate::gimbal::ClassicalChain;
use crate::log_check::rotations::data::{JOINED_S, MeasuredRotation, RotationData, joined};
use crate::log_check::rotations::fit::{
    ExtraColumn, FREE_ORIENTATION_RAD, FitPriors, Prediction, RotationFit, RotationPair,
};
use crate::log_check::statistics::median;

/// Prior standard deviation of the time offset of camera and gyroscope beyond the rig's.
const OFFSET_SIGMA_S: f64 = 0.02;
/// Prior standard deviation of the ratio of image rotations to predicted ones: a change of it is a hypothesis.
const SCALE_SIGMA: f64 = 0.005;
/// Number of standard deviations of the camera's orientation in its tolerance.
const ORIENTATION_SIGMAS: f64 = 3.0;
/// Prior standard deviation of the camera's orientation where a hypothesis takes it from the rig, in radians.
const KEPT_ORIENTATION_RAD: f64 = 0.02;
const ITERATIONS: usize = 8;
/// Half the relative range in which a focal length is searched around the grid's focal length, and the length at which
/// it ends.
const FOCAL_RANGE: f64 = 0.06;
const FOCAL_PRECISION: f64 = 1e-3;
/// Range of the coefficients of a radial distortion that is searched, to a hundredth of its length.
const RADIAL_RANGE: [f64; 2] = [-0.6, 0.6];
/// Change of all parameters, in units of their steps, at which the iterations end.
const CONVERGED: f64 = 0.05;
/// Number of starts from which a hypothesis is fitted until it converges: the best after one iteration.
const FOLLOWED: usize = 2;
/// Ratio of the median misfit with a correction to that without up to which it removes a misfit.
const REMOVED_MISFIT: f64 = 0.6;
/// Time around the one at which a fault begins in which a better one is searched, in seconds.
const NEAR_S: f64 = 0.7;
/// Minimum number of rotations.
const MIN_ROTATIONS: usize = 12;

/// Possible cause of a misfit.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::log_check) struct Hypothesis {
    /// Faults from which the values are fitted; the best fit is taken.
    starts: Vec<Fault>,
    /// Number of the first values that are fitted.
    fitted: usize,
    /// Times in seconds from which on the fault may act; the best one is taken. Empty: in the whole log.
    since_s: Vec<f64>,
    /// True if the camera's orientation is the rig's: else it is estimated, whatever it is.
    keeps_orientation: bool,
}

impl Hypothesis {
    /// A fault in the whole log, with any orientation of the camera.
    pub(super) fn new(starts: Vec<Fault>, fitted: usize) -> Self {
        Self { starts, fitted, since_s: Vec::new(), keeps_orientation: false }
    }

    /// The same from one of these times on.
    pub(super) fn since_one_of(self, since_s: Vec<f64>) -> Self {
        Self { since_s, ..self }
    }

    /// The same also from a further time on, if it begins at a time, else from this time on.
    pub(super) fn since(mut self, since_s: f64) -> Self {
        self.since_s.push(since_s);
        self
    }

    /// True if the fault begins at a time.
    pub(super) fn begins(&self) -> bool {
        !self.since_s.is_empty()
    }

    /// Faults from which the values are fitted.
    pub(super) fn starts(&self) -> &[Fault] {
        &self.starts
    }

    /// The same with the camera's orientation by the rig.
    pub(super) fn with_orientation_of_rig(self) -> Self {
        Self { keeps_orientation: true, ..self }
    }
}

/// Fit of a hypothesis.
#[derive(Clone, Debug)]
pub(in crate::log_check) struct Fitted {
    pub(super) fault: Fault,
    /// Fit of the corrected data.
    pub(super) fit: RotationFit,
    /// Deviance plus the logarithm of the number of measurements per parameter.
    pub(super) criterion: f64,
}

impl Explanation for Fitted {
    fn criterion(&self) -> f64 {
        self.criterion
    }

    fn contains(&self, other: &Self) -> bool {
        self.fault.contains(&other.fault)
    }
}

impl Fitted {
    /// True if the correction removes a misfit, in all rotations or, if it begins at a time, in the rotations before or
    /// after it: a few wrong rotations alone can raise the likelihood.
    pub(super) fn removes_misfit(&self, given: &RotationFit) -> bool {
        let split_s = self.fault.since_s.unwrap_or(f64::NEG_INFINITY);
        let is_removed = |is_after: bool| {
            let [without, with] = [given, &self.fit].map(|fit| {
                let part = fit.misfits_rad.iter().filter(|(middle_s, _)| (*middle_s >= split_s) == is_after);
                median(&part.map(|(_, misfit_rad)| *misfit_rad).collect::<Vec<_>>())
            });
            with < REMOVED_MISFIT * without
        };
        is_removed(true) || (self.fault.since_s.is_some() && is_removed(false))
    }
}

/// Length over which rotations of consecutive images are joined, in seconds; for a rigid camera the length of one pair.
pub(super) fn length_s(chain: &ClassicalChain) -> f64 {
    if chain.links.is_empty() { 0.0 } else { JOINED_S }
}

/// Fits hypotheses to the rotations of one camera.
pub(super) struct Fitter<'a> {
    pub(super) data: &'a RotationData<'a>,
    pub(super) chain: &'a ClassicalChain,
    /// With any orientation of the camera.
    priors: FitPriors,
    /// Smallest error of the orientation that counts as one, in radians: [`ORIENTATION_SIGMAS`] standard deviations.
    pub(super) orientation_tolerance_rad: f64,
    /// Rotations of the images as recorded.
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

    /// Criterion of a fit with a number of parameters. The orientation is the rig's within its standard deviation, or any
    /// one: the squared difference in standard deviations counts up to the cost of three parameters.
    pub(super) fn criterion(&self, fit: &RotationFit, parameters: usize) -> f64 {
        let sigmas = ORIENTATION_SIGMAS * fit.orientation.angle() / self.orientation_tolerance_rad;
        let orientation = (sigmas * sigmas).min(3.0 * self.parameter_cost());
        fit.deviance + orientation + parameters as f64 * self.parameter_cost()
    }

    /// Cost of a parameter in the criterion.
    pub(super) fn parameter_cost(&self) -> f64 {
        (3.0 * self.measured.len() as f64).ln()
    }

    /// True if the orientation of a fit differs from the rig's.
    pub(super) fn has_other_orientation(&self, fit: &RotationFit) -> bool {
        fit.orientation.angle() > self.orientation_tolerance_rad
    }

    /// Rotations with the lens of a fault.
    fn measured(&self, fault: Option<&Fault>) -> Cow<'_, [MeasuredRotation]> {
        match fault.map(Fault::lens) {
            Some(lens) if lens != LensChange::NONE => {
                Cow::Owned(joined(&self.data.with_lens(&lens), length_s(self.chain)))
            }
            _ => Cow::Borrowed(&self.measured),
        }
    }

    /// Fit without a correction.
    pub(super) fn fit_given(&self) -> Option<RotationFit> {
        self.linear_fit(None, 0, &self.priors)
    }

    /// Changes of the values of a fault in a fit that is linear in them, with their standard deviations.
    pub(super) fn linear_values(&self, fault: &Fault) -> Option<Vec<(f64, f64)>> {
        let fit = self.linear_fit(Some(fault), fault.values.len(), &self.priors)?;
        Some(fit.extra.into_iter().zip(fit.extra_sigmas).collect())
    }

    /// Best fit of a hypothesis over its starts and times.
    pub(super) fn best(&self, hypothesis: Hypothesis) -> Option<Fitted> {
        let Hypothesis { starts, fitted, since_s, keeps_orientation } = hypothesis;
        let orientation_rad = if keeps_orientation { KEPT_ORIENTATION_RAD } else { FREE_ORIENTATION_RAD };
        let priors = FitPriors { orientation_rad, ..self.priors };
        let times: Vec<Option<f64>> =
            if since_s.is_empty() { vec![None] } else { since_s.into_iter().map(Some).collect() };
        let at = |start: &Fault, since_s: &Option<f64>| Fault { since_s: *since_s, ..start.clone() };
        let starts = starts.iter().flat_map(|start| times.iter().map(move |since_s| at(start, since_s)));
        let tried = |start: Fault| Some((self.linear_fit(Some(&start), fitted, &priors)?.deviance, start));
        let mut tried: Vec<(f64, Fault)> = starts.filter_map(tried).collect();
        tried.sort_by(|a, b| a.0.total_cmp(&b.0));
        let fits = tried.into_iter().take(FOLLOWED).filter_map(|(_, start)| self.converged(start, fitted, &priors));
        let fits = fits.filter(|found| found.fault.is_possible());
        fits.min_by(|one, other| one.criterion.total_cmp(&other.criterion))
    }

    /// A fit whose fault begins at a time, at the time near it that fits best; `None` if it begins at none.
    pub(super) fn at_best_time(&self, found: &Fitted) -> Option<Fitted> {
        let since_s = found.fault.since_s?;
        let middles = self.measured.iter().map(MeasuredRotation::middle_s);
        let near = middles.filter(|middle_s| (middle_s - since_s).abs() < NEAR_S);
        let fits = near.filter_map(|near_s| {
            let fault = Fault { since_s: Some(near_s), ..found.fault.clone() };
            let fit = self.linear_fit(Some(&fault), 0, &self.priors)?;
            let criterion = found.criterion + fit.deviance - found.fit.deviance;
            Some(Fitted { fault, fit, criterion })
        });
        fits.chain([found.clone()]).min_by(|one, other| one.criterion.total_cmp(&other.criterion))
    }

    /// Iterates corrections of the data and linear fits until the values no longer change.
    fn converged(&self, start: Fault, fitted: usize, priors: &FitPriors) -> Option<Fitted> {
        let mut fault = match start.kind {
            FaultKind::Focal => {
                let focal = start.value(0);
                self.best_value(&start, [-FOCAL_RANGE, FOCAL_RANGE], |logarithm| focal * logarithm.exp())
            }
            FaultKind::Radial => self.best_value(&start, RADIAL_RANGE, |value| value),
            _ => start,
        };
        let is_searched = matches!(fault.kind, FaultKind::Focal | FaultKind::Radial);
        let iterations = if is_searched || fitted == 0 { 0 } else { ITERATIONS };
        for _ in 0..iterations {
            let changes = self.linear_fit(Some(&fault), fitted, priors)?.extra;
            let mut largest_ratio: f64 = 0.0;
            for (number, change) in changes.into_iter().enumerate() {
                let parameter = fault.parameter(number)?;
                fault.change(number, change.clamp(-parameter.largest, parameter.largest));
                largest_ratio = largest_ratio.max((change / parameter.step).abs());
            }
            if largest_ratio < CONVERGED {
                break;
            }
        }
        self.evaluated(fault, fitted, priors)
    }

    /// Fit with a fault whose values are known. What is reported is the misfit of corrected data, not that of a linear model
    /// of the correction.
    fn evaluated(&self, fault: Fault, fitted: usize, priors: &FitPriors) -> Option<Fitted> {
        let fit = self.linear_fit(Some(&fault), 0, priors)?;
        let criterion = self.criterion(&fit, fitted + usize::from(fault.since_s.is_some()));
        Some(Fitted { fault, fit, criterion })
    }

    /// Fit with a fault in the whole log that is known.
    pub(super) fn with_fault(&self, fault: Fault) -> Option<Fitted> {
        let parameters = fault.values.len();
        self.evaluated(fault, parameters, &self.priors)
    }

    /// Best fit of a hypothesis about the lens, whose values are fitted to the rotations of `few`, which are some of these.
    pub(super) fn best_lens(&self, hypothesis: Hypothesis, few: &Fitter<'_>) -> Option<Fitted> {
        let fitted = hypothesis.fitted;
        self.evaluated(few.best(hypothesis)?.fault, fitted, &self.priors)
    }

    /// Fault with the value in a range that has the largest likelihood, by golden section: every lens has other measured
    /// rotations, and other wrong ones among them. `value` computes the value from a place in the range.
    fn best_value(&self, start: &Fault, [mut low, mut high]: [f64; 2], value: impl Fn(f64) -> f64) -> Fault {
        let at = |place: f64| Fault::new(start.kind, &[value(place)]);
        let deviance =
            |place: f64| self.linear_fit(Some(&at(place)), 0, &self.priors).map_or(f64::INFINITY, |fit| fit.deviance);
        let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
        let precision = FOCAL_PRECISION * ((high - low) / (2.0 * FOCAL_RANGE));
        let (mut left, mut right) = (high - ratio * (high - low), low + ratio * (high - low));
        let (mut at_left, mut at_right) = (deviance(left), deviance(right));
        while high - low > precision {
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

    /// Fit of the data with a fault undone, linear in its first values.
    fn linear_fit(&self, fault: Option<&Fault>, fitted: usize, priors: &FitPriors) -> Option<RotationFit> {
        let at = self.pairs(fault);
        if at.len() < MIN_ROTATIONS {
            return None;
        }
        let column = |number: usize| {
            let (mut changed, parameter) = (fault?.clone(), fault?.parameter(number)?);
            changed.change(number, parameter.step);
            let stepped = self.pairs(Some(&changed));
            // A rotation that the changed data no longer cover does not constrain the parameter.
            let derivative = |of: &dyn Fn(&RotationPair) -> Vector3<f64>| {
                let quotient = |(key, pair): (&i64, &RotationPair)| {
                    stepped.get(key).map_or_else(Vector3::zeros, |stepped| (of(stepped) - of(pair)) / parameter.step)
                };
                at.iter().map(quotient).collect::<Vec<_>>()
            };
            Some(ExtraColumn {
                of_predicted: derivative(&|pair| pair.predicted(self.chain)),
                of_measured: derivative(&|pair| pair.measured),
                sigma: parameter.sigma,
            })
        };
        let columns: Vec<ExtraColumn> = (0..fitted).map(column).collect::<Option<_>>()?;
        let pairs: Vec<RotationPair> = at.values().cloned().collect();
        RotationFit::with_columns(&pairs, self.chain, priors, &columns)
    }

    /// Pairs by the stamp of their first image with a fault undone, from its time on.
    fn pairs(&self, fault: Option<&Fault>) -> BTreeMap<i64, RotationPair> {
        let mut pairs = BTreeMap::new();
        let mut extend = |fault: Option<&Fault>, from_s: f64, to_s: f64| {
            let predictor = self.data.predictor(self.chain, fault);
            let measured = self.measured(fault);
            let within = measured.iter().filter(|it| (from_s..to_s).contains(&it.middle_s()));
            pairs.extend(within.filter_map(|it| Some((it.rotation.from_ns, predictor.pair(it)?))));
        };
        let since_s = fault.and_then(|fault| fault.since_s);
        let split_s = since_s.unwrap_or(f64::NEG_INFINITY);
        extend(fault, split_s, f64::INFINITY);
        if since_s.is_some() {
            extend(None, f64::NEG_INFINITY, split_s);
        }
        pairs
    }

    /// Rotations with intrinsics that depend on the stamp of an image, in seconds since the log began.
    pub(super) fn with_lens_at(&self, lens_at: impl Fn(f64) -> LensChange) -> Vec<MeasuredRotation> {
        joined(&self.data.with_lens_at(lens_at), length_s(self.chain))
    }

    /// Fit of pairs without a correction.
    pub(super) fn fit_pairs(&self, pairs: &[RotationPair]) -> Option<RotationFit> {
        if pairs.len() < MIN_ROTATIONS { None } else { RotationFit::of(pairs, self.chain, &self.priors) }
    }

    /// Fit of rotations as measured with another lens each, and their predictions in the frame of the measured rotations
    /// with covariances in rad², by the stamp of the first image.
    pub(super) fn fit_measured(&self, measured: &[MeasuredRotation]) -> Option<(RotationFit, Predictions)> {
        let predictor = self.data.predictor(self.chain, None);
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
        let predictor = self.data.predictor(self.chain, None);
        let predicted = |it: &MeasuredRotation| {
            let pair = predictor.pair(it)?;
            Some((it.rotation.from_ns, (pair.predicted(self.chain), pair.covariance_rad2)))
        };
        measured.iter().filter_map(predicted).collect()
    }
}

/// Predicted rotation vectors and their covariances by the stamp of the first image.
pub(super) type Predictions = BTreeMap<i64, Prediction>;
