//! The quantities of a step that a condition can use: names, meanings, accessors.

use crate::estimator::{EventKind, Phase};
use crate::geometry::seconds_from_ns;
use crate::session::record::StepRecord;
use crate::text::condition::Number;

/// A quantity of a step.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Quantity {
    Plain(NumberName),
    /// With an argument: `sigma(yaw.alpha)`.
    Named(NamedNumber, String),
    /// A singular value by its number from 1, largest first: `singular(1)`.
    Singular(usize),
    /// The difference from the step before: `rise(x)`.
    Rise(Box<Number<Self>>),
}

/// A property of a step in a condition.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum StepFlag {
    Literal(bool),
    Named(FlagName),
    /// The step has an event of one of these kinds.
    Event(Vec<EventKind>),
}

/// A quantity without an argument.
#[derive(Clone, Copy, Debug)]
pub(super) struct NumberName {
    pub(super) name: &'static str,
    meaning: &'static str,
    value: fn(&StepRecord) -> Option<f64>,
}

impl NumberName {
    pub(super) fn of(self, step: &StepRecord) -> Option<f64> {
        (self.value)(step).filter(|value| value.is_finite())
    }
}

impl PartialEq for NumberName {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

const fn number(name: &'static str, meaning: &'static str, value: fn(&StepRecord) -> Option<f64>) -> NumberName {
    NumberName { name, meaning, value }
}

/// All quantities without an argument.
pub(super) const NUMBERS: &[NumberName] = &[
    number("rank", "structural rank of the calibration", |step| Some(step.rank.as_ref()?.rank_structural as f64)),
    number("rank_informed", "informed rank", |step| Some(step.rank.as_ref()?.rank_informed as f64)),
    number("columns", "calibration columns", |step| Some(step.rank.as_ref()?.parameters.len() as f64)),
    number("singular_min", "smallest singular value", |step| step.rank.as_ref()?.singular_values.last().copied()),
    number("margin", "smallest singularity margin of the parameterization", |step| {
        step.report.calibration.margins.iter().map(|(_, margin)| *margin).reduce(f64::min)
    }),
    number("features", "features in the images of all cameras", |step| Some(step.feature_count() as f64)),
    number("solved", "features used in the solve", |step| tracking(step).then_some(step.report.counts.solved as f64)),
    number("inliers", "features in the solve, not rejected", |step| {
        tracking(step).then_some(step.report.counts.inliers() as f64)
    }),
    number("outliers", "features in the solve, rejected", |step| {
        tracking(step).then_some(step.report.counts.rejected as f64)
    }),
    number("rms", "reprojection RMS after the solve, px", |step| {
        tracking(step).then_some(step.report.reprojection_rms_after_px)
    }),
    number("rms_before", "reprojection RMS before the solve, px", |step| {
        tracking(step).then_some(step.report.reprojection_rms_before_px)
    }),
    number("chi2", "χ² of all factors after the solve", |step| {
        let summaries = &step.report.residuals;
        (!summaries.is_empty()).then(|| summaries.iter().map(|summary| summary.chi2_after).sum())
    }),
    number("nis", "χ² per residual of all factors after the solve", |step| {
        let summaries = &step.report.residuals;
        let count: usize = summaries.iter().map(|summary| summary.count).sum();
        (count > 0).then(|| summaries.iter().map(|summary| summary.chi2_after).sum::<f64>() / count as f64)
    }),
    number("cost", "cost after the last solver iteration", |step| Some(step.report.iterations.last()?.cost_after)),
    number("cost_before", "cost before the first solver iteration", |step| {
        Some(step.report.iterations.first()?.cost_before)
    }),
    number("cost_rise", "largest relative cost increase in one solver iteration", |step| {
        let rises = step.report.iterations.iter().map(|it| it.cost_after / it.cost_before - 1.0);
        rises.map(|rise| rise.max(0.0)).reduce(f64::max)
    }),
    number("iterations", "solver iterations", |step| Some(step.report.iterations.len() as f64)),
    number("rejected_iterations", "rejected solver iterations", |step| {
        Some(step.report.iterations.iter().filter(|iteration| !iteration.accepted).count() as f64)
    }),
    number("speed", "velocity, norm, m/s", |step| Some(step.report.newest()?.velocity_m_per_s.norm())),
    number("gyro_bias", "gyroscope bias, norm, rad/s", |step| {
        Some(step.report.newest()?.gyroscope_bias_rad_per_s.norm())
    }),
    number("accel_bias", "accelerometer bias, norm, m/s²", |step| {
        Some(step.report.newest()?.accelerometer_bias_m_per_s2.norm())
    }),
    number("restarts", "re-initializations so far", |step| Some(step.report.restarts as f64)),
    number("frame", "frame index", |step| Some(step.report.frame_index as f64)),
    number("time", "header stamp since the start of the log, s", |step| Some(seconds_from_ns(step.report.stamp_ns))),
];

fn tracking(step: &StepRecord) -> bool {
    step.report.phase == Phase::Tracking
}

/// A quantity with an argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NamedNumber {
    Sigma,
    PriorSigma,
    Value,
    Joint,
    Margin,
    Lost,
    Chi2,
    Nis,
}

/// All quantities with an argument: name, kind, example of the argument, meaning.
pub(super) const NAMED: [(&str, NamedNumber, &str, &str); 8] = [
    ("sigma", NamedNumber::Sigma, "yaw.alpha", "standard deviation of a parameter, rad or m"),
    ("prior_sigma", NamedNumber::PriorSigma, "yaw.alpha", "prior standard deviation of a parameter, rad or m"),
    ("value", NamedNumber::Value, "yaw.alpha", "value of a parameter, rad or m"),
    ("joint", NamedNumber::Joint, "yaw", "estimated joint angle, rad"),
    ("margin", NamedNumber::Margin, "end", "margin of one singularity"),
    (
        "lost",
        NamedNumber::Lost,
        "motion",
        "lost calibration columns by cause: parameterization, joints, absorbed or motion",
    ),
    ("chi2", NamedNumber::Chi2, "visual", "χ² of a factor after the solve"),
    ("nis", NamedNumber::Nis, "imu", "χ² per residual of a factor after the solve"),
];

/// Causes of rank loss.
pub(super) const CAUSES: [&str; 4] = ["parameterization", "joints", "absorbed", "motion"];

/// A Boolean property of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct FlagName {
    pub(super) name: &'static str,
    meaning: &'static str,
    value: fn(&StepRecord) -> bool,
}

impl PartialEq for FlagName {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl FlagName {
    pub(super) fn of(self, step: &StepRecord) -> bool {
        (self.value)(step)
    }
}

pub(super) const FLAGS: &[FlagName] = &[
    FlagName { name: "tracking", meaning: "estimator initialized and tracking", value: tracking },
    FlagName { name: "initializing", meaning: "estimator initializing", value: |step| !tracking(step) },
    FlagName { name: "keyframe", meaning: "the frame is a keyframe", value: |step| step.report.keyframe },
    FlagName { name: "warning", meaning: "the step has warnings", value: |step| !step.report.warnings.is_empty() },
];

pub(super) const EVENTS: [(&str, &[EventKind]); 10] = [
    ("waits", &[EventKind::InitializationWaits]),
    ("initialized", &[EventKind::InitializedFromMotion, EventKind::InitializedFromStationary]),
    ("keyframe_decided", &[EventKind::KeyframeChosen]),
    ("marginalized", &[EventKind::OldestMarginalized]),
    ("dropped", &[EventKind::SecondNewestDropped]),
    ("outliers", &[EventKind::OutliersRejected]),
    ("standstill", &[EventKind::Stationary]),
    ("failure", &[EventKind::Failure]),
    ("chart_switched", &[EventKind::ParameterizationSwitched]),
    ("missing", &[EventKind::MeasurementMissing]),
];

/// Every quantity with its syntax and its meaning, for help texts.
pub fn quantity_help() -> Vec<(String, &'static str)> {
    let numbers = NUMBERS.iter().map(|it| (it.name.to_owned(), it.meaning));
    let named = NAMED.iter().map(|(name, _, example, meaning)| (format!("{name}({example})"), *meaning));
    let functions = [
        ("singular(1)", "singular value by index, 1 for the largest"),
        ("rise(x)", "change since the previous step"),
        ("abs(x)", "absolute value"),
        ("min(x, y)", "minimum"),
        ("max(x, y)", "maximum"),
    ];
    let flags = FLAGS.iter().map(|it| (it.name.to_owned(), it.meaning));
    let events: Vec<&str> = EVENTS.iter().map(|(name, _)| *name).collect();
    let events = (format!("event({})", events.join("|")), "an event of this kind in the step");
    numbers
        .chain(named)
        .chain(functions.map(|(name, meaning)| (name.to_owned(), meaning)))
        .chain(flags)
        .chain(std::iter::once(events))
        .collect()
}
