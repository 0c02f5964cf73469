//! Sentences about sources that disagree.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

use super::comparison::{Change, Parameter};
use super::pair::Pair;
use super::rotation::WRONG_SCALE;
use super::source::Source;
use crate::faults::{Area, Fault, FaultKind, Sentence, Severity, Subject};
use crate::geometry::{SignedAxes, so3};
use crate::log_check::report::agreement::Quantity;
use crate::log_check::report::{Finding, FindingInterval, Findings};
use crate::sensors::Rig;

/// Largest error with which the factor on a missing term is one.
const MISSING_TOLERANCE: f64 = 0.1;
/// Times that are closer count as one, in seconds.
pub(super) const SAME_TIME_S: f64 = 1.0;
/// Ratio of the noise of two pairs up to which both are precise.
const AS_PRECISE: f64 = 2.0;
/// Largest factor on an axis of a sensor that is named.
const LARGEST_AXIS_SCALE: f64 = 5.0;
/// Largest ratio of a factor on positions to a unit with which it is this unit: accelerations in a small unit measure the
/// factor coarsely, and other units are far.
const UNIT_RATIO: f64 = 2.0;

/// Finding about sources that disagree.
pub(super) struct Statement {
    pub(super) severity: Severity,
    pub(super) area: Area,
    pub(super) title: String,
    pub(super) evidence: String,
    pub(super) remedy: String,
    pub(super) interval: FindingInterval,
    /// Sources of which at least one is wrong.
    pub(super) suspected: Vec<Source>,
    /// True if exactly these are wrong.
    pub(super) is_isolated: bool,
    /// True if the sentence names the cause.
    pub(super) is_cause: bool,
    /// True if it names the difference of one source with its value.
    pub(super) has_value: bool,
    /// The same for a change at a time.
    pub(super) is_measured_change: bool,
    /// Parameter by which the sources differ.
    pub(super) parameter: Option<Parameter>,
    /// The cause, if it is known with its value.
    pub(super) cause: Option<Fault>,
}

impl Statement {
    /// Sentence for the smallest sets of sources that explain the pairs; `None` without a set.
    pub(super) fn of(alternatives: &[Vec<Source>], pairs: &[Pair], rig: &Rig) -> Option<Self> {
        let suspected: Vec<Source> = {
            let mut all: Vec<Source> = alternatives.iter().flatten().cloned().collect();
            all.sort();
            all.dedup();
            all
        };
        let first = suspected.first()?;
        let involved =
            |pair: &&Pair| pair.fit.disagrees.is_some() && pair.sources.iter().any(|it| suspected.contains(it));
        // The most precise pair gives time and value.
        let sharpest = pairs.iter().filter(involved).min_by(|a, b| a.fit.noise.total_cmp(&b.fit.noise))?;
        let mut interval = sharpest.fit.disagrees.unwrap_or_default();
        // Of pairs that are as precise, the one that shows the change first has its time.
        let is_precise = |pair: &&Pair| pair.fit.noise < AS_PRECISE * sharpest.fit.noise;
        let starts = pairs.iter().filter(involved).filter(is_precise).filter_map(|pair| pair.fit.disagrees?.since_s);
        if interval.since_s.is_some() && interval.until_s.is_none() {
            interval.since_s = starts.min_by(f64::total_cmp);
        }
        let times = times(interval);
        let is_isolated = alternatives.len() == 1;
        let change = sharpest.fit.change.as_ref();
        let mut statement = Self {
            severity: Severity::Warning,
            area: first.area(),
            title: String::new(),
            evidence: evidence(pairs),
            remedy: suspected.iter().map(Source::remedy).collect::<Vec<_>>().join("; or "),
            interval,
            is_isolated,
            is_cause: false,
            has_value: false,
            is_measured_change: false,
            parameter: change.map(|change| change.parameter),
            cause: None,
            suspected: suspected.clone(),
        };
        let cause = match (change, alternatives) {
            (Some(change), [only]) if *only == [Source::Gyroscope] => cause_of_gyroscope(change, sharpest),
            _ => None,
        };
        if let Some(cause) = sharpest.fit.fault.clone().or(cause) {
            statement.name(cause, rig);
            return Some(statement);
        }
        if let Some((severity, title, remedy)) = change.and_then(named_cause) {
            (statement.severity, statement.title, statement.remedy) = (severity, title, remedy.to_owned());
            statement.is_cause = true;
            return Some(statement);
        }
        let detail = match (change, alternatives) {
            (Some(change), [only]) if only.len() == 1 => {
                let is_first = sharpest.sources[0] == only[0];
                detail(change, sharpest, is_first).map_or_else(String::new, |text| format!(": {text}"))
            }
            _ => String::new(),
        };
        statement.has_value = !detail.is_empty();
        statement.is_measured_change = statement.has_value && interval.since_s.is_some();
        let names: Vec<String> = suspected.iter().map(Source::name).collect();
        statement.title = match alternatives {
            [only] => {
                let verb = if only.len() == 1 { first.disagrees() } else { "disagree" };
                let others = others(&suspected, pairs);
                format!("{} {verb} with {}{times}{detail}", all_of(&names, "and"), all_of(&others, "and"))
            }
            [_, _] if names.len() == alternatives.len() => {
                format!("{} or {} is wrong: they disagree{times}", names[0], names[1])
            }
            _ => format!("{} disagree with each other{times}", all_of(&names, "and")),
        };
        Some(statement)
    }

    /// Adds findings that are excluded to the evidence.
    pub(super) fn add_excluded(&mut self, excluded: &[Finding]) {
        for finding in excluded {
            self.evidence.push_str("; excluded: ");
            self.evidence.push_str(&finding.title);
        }
    }

    /// Names the cause with its value.
    fn name(&mut self, cause: Fault, rig: &Rig) {
        let Sentence { severity, statement, remedy } = Subject { rig, camera_key: "" }.sentence(&cause);
        (self.severity, self.title, self.remedy) = (severity, statement, remedy);
        (self.is_cause, self.has_value, self.is_measured_change) = (true, true, cause.since_s.is_some());
        self.cause = Some(cause);
    }

    /// Joins axes that are wrong of the accelerometer and, by a finding, of the gyroscope: the whole IMU has them.
    pub(super) fn join_axes(&mut self, findings: &mut Findings, rig: &Rig) {
        let Some(cause) = self.cause.clone().filter(|it| it.kind == FaultKind::AccelerometerAxes) else { return };
        let is_same = |fault: &Fault| {
            let times_s = [fault, &cause].map(|it| it.since_s.unwrap_or(0.0));
            fault.kind == FaultKind::GyroscopeAxes
                && fault.choice == cause.choice
                && (times_s[0] - times_s[1]).abs() < SAME_TIME_S
        };
        let of_gyroscope = findings.retract_misfits(|finding| finding.faults.iter().any(is_same));
        if let Some(first) = of_gyroscope.first() {
            self.evidence = format!("{}; {}", self.evidence, first.evidence);
            self.name(Fault { kind: FaultKind::ImuAxes, ..cause }, rig);
        }
    }

    /// Fault of the only sensor that is wrong, or of each of two exchanged cameras: the cause, or that its cause is not known;
    /// none for several sources, for images, whose causes a run may find, and for ground truth.
    pub(super) fn faults(&self) -> Vec<Fault> {
        match (&self.cause, self.suspected.as_slice()) {
            (Some(cause), [Source::Images { camera_key: one, .. }, Source::Images { camera_key: other, .. }])
                if cause.kind == FaultKind::ImagesExchanged =>
            {
                [one, other].map(|key| cause.clone().of_camera(key)).into()
            }
            (Some(cause), _) => vec![cause.clone()],
            (None, [Source::Gyroscope | Source::Accelerometer]) => vec![FaultKind::UnusableImu.into()],
            (None, [Source::Joint { joint, .. }]) => vec![Fault::from(FaultKind::UnusableJoints).of_joints([joint])],
            _ => Vec::new(),
        }
    }

    /// Sentence about a cause that is no parameter of a comparison; its fault if it is one of a sensor.
    pub(super) fn of_cause(
        (severity, area): (Severity, Area),
        title: String,
        evidence: String,
        remedy: String,
        suspected: Vec<Source>,
        cause: Option<Fault>,
    ) -> Self {
        Self {
            severity,
            area,
            title,
            evidence,
            remedy,
            interval: FindingInterval::default(),
            suspected,
            is_isolated: true,
            is_cause: true,
            has_value: false,
            is_measured_change: false,
            parameter: None,
            cause,
        }
    }

    /// Sentence about a ground truth with inverted orientations; `misfits` are those with the gyroscope, as recorded and inverted.
    pub(super) fn of_inverted_truth(misfits: [f64; 2]) -> Self {
        Self::of_cause(
            (Severity::Warning, Area::Log),
            "the orientations of the ground truth are inverted: they are body_from_world".to_owned(),
            misfits_text("its rotations with the gyroscope's", "with inverted orientations", misfits),
            "invert its quaternions: nav_msgs and geometry_msgs map the body to the world".to_owned(),
            vec![Source::GroundTruth],
            None,
        )
    }

    /// Sentence about two cameras whose images are exchanged.
    pub(super) fn of_exchange([first, second]: [&str; 2], misfits: [[f64; 2]; 2], suspected: Vec<Source>) -> Self {
        let of = |key: &str, misfits: [f64; 2]| misfits_text(key, "with the images of the other", misfits);
        Self::of_cause(
            (Severity::Error, Area::Images),
            format!("the images of {first} and {second} are exchanged"),
            format!("{}; {}", of(first, misfits[0]), of(second, misfits[1])),
            format!("exchange rostopic of {first} and {second} in the rig, or the topics in the driver"),
            suspected,
            Some(FaultKind::ImagesExchanged.into()),
        )
    }
}

/// Fault of a gyroscope that is the only wrong source, whose rotations have another scale: a negative one if its axes form a
/// left-handed frame.
fn cause_of_gyroscope(change: &Change, pair: &Pair) -> Option<Fault> {
    if change.parameter != Parameter::Scale {
        return None;
    }
    let is_first = pair.sources[0] == Source::Gyroscope;
    let ratio = 1.0 + change.values.first()?;
    let since_s = pair.fit.disagrees.and_then(|interval| interval.since_s);
    if (ratio + 1.0).abs() < WRONG_SCALE {
        let axes = pair.first_from_second;
        let of_recording = if is_first { axes.inverse() } else { axes };
        let axes = SignedAxes::nearest(&-of_recording.to_rotation_matrix().into_inner())?;
        return Some(Fault { since_s, ..Fault::of_axes(FaultKind::GyroscopeAxes, axes) });
    }
    let factor = if is_first { ratio.recip() } else { ratio };
    let fault = Fault { since_s, ..Fault::new(FaultKind::GyroscopeScale, &[factor]) };
    fault.is_possible().then_some(fault)
}

/// Cause that a parameter alone is, with its remedy.
fn named_cause(change: &Change) -> Option<(Severity, String, &'static str)> {
    let other_axes = |title: &str| {
        let remedy = "publish the specific forces in the axes of the IMU, with gravity, as sensor_msgs/Imu requires";
        Some((Severity::Error, title.to_owned(), remedy))
    };
    match change.parameter {
        Parameter::WorldAxes => return other_axes("the specific forces have the axes of the world, not of the IMU"),
        Parameter::LevelAxes => {
            return other_axes("the specific forces are levelled: they lack roll and pitch of the IMU");
        }
        Parameter::PositionAxes => {
            let axes = SignedAxes::nearest(&Matrix3::from_iterator(change.values.iter().copied()))?;
            let world =
                if axes.is_left_handed() { "form a left-handed world" } else { "differ from its orientations'" };
            return Some((
                Severity::Warning,
                format!("the axes of the ground truth's positions {world}: {}", axes.inverse().describe()),
                "convert positions and orientations to one right-handed world with z up (ENU); errors against it mean nothing",
            ));
        }
        _ => {}
    }
    let value = *change.values.first()?;
    match change.parameter {
        Parameter::Transport if (value - 1.0).abs() < MISSING_TOLERANCE => Some((
            Severity::Error,
            "the accelerometer lacks ω × v: its specific forces are derivatives of the velocity in the body's axes"
                .to_owned(),
            "add the cross product of angular rate and velocity where the forces are made: an accelerometer measures the \
             acceleration in the world, in its axes",
        )),
        Parameter::PositionScale => {
            let factor = 1.0 / (1.0 + value);
            let units = [(1000.0, "millimetres"), (100.0, "centimetres")];
            let unit = units.iter().find(|(size, _)| (1.0 / UNIT_RATIO..UNIT_RATIO).contains(&(factor / size)))?.1;
            Some((
                Severity::Warning,
                format!("positions of the ground truth are in {unit}"),
                "convert its positions to metres, as nav_msgs and geometry_msgs require",
            ))
        }
        _ => None,
    }
}

/// Difference of the only suspected source, the first or the second one of a pair, from the other one.
fn detail(change: &Change, pair: &Pair, is_first: bool) -> Option<String> {
    let sign = if is_first { 1.0 } else { -1.0 };
    let vector = || {
        let of_first = Vector3::from_iterator(change.values.iter().copied());
        let axes = pair.first_from_second;
        if is_first { of_first } else { -(axes.inverse() * of_first) }
    };
    let is_constant = pair.fit.disagrees.is_none_or(|interval| interval == FindingInterval::default());
    let value = sign * change.values.first()?;
    let factor = |value: f64| if is_first { 1.0 + value } else { 1.0 / (1.0 + value) };
    Some(match change.parameter {
        Parameter::Rate => {
            let rate = vector();
            format!("its angular rates shift by ({:+.3}, {:+.3}, {:+.3}) rad/s", rate.x, rate.y, rate.z)
        }
        Parameter::RateDrift => {
            let rate = vector();
            format!("its angular rates drift by ({:+.3}, {:+.3}, {:+.3}) rad/s over the log", rate.x, rate.y, rate.z)
        }
        Parameter::Orientation => {
            let degrees = so3::exp(&vector()).angle().min(TAU).to_degrees();
            format!("rotated by {degrees:.1}°")
        }
        Parameter::Delay => {
            let side = if value > 0.0 { "earlier" } else { "later" };
            let then = if is_constant { "" } else { "then " };
            format!("stamps are {then}{:.0} ms {side}", 1e3 * value.abs())
        }
        Parameter::Scale => format!("its rotations are {:.3} times theirs", factor(*change.values.first()?)),
        Parameter::AxisScales => {
            let axes = ["x", "y", "z"].into_iter().zip(change.values.iter().map(|value| factor(*value)));
            let possible = LARGEST_AXIS_SCALE.recip()..LARGEST_AXIS_SCALE;
            if axes.clone().any(|(_, factor)| !possible.contains(&factor)) {
                return None;
            }
            let wrong = axes.filter(|(_, factor)| (factor - 1.0).abs() > WRONG_SCALE);
            let (values, along) = match pair.quantity {
                Quantity::SpecificForce => ("specific forces", "along"),
                Quantity::Rotation | Quantity::Direction => ("rotations", "about"),
            };
            let texts: Vec<String> =
                wrong.map(|(axis, factor)| format!("{factor:.2} times theirs {along} {axis}")).collect();
            format!("its {values} are {}", all_of(&texts, "and"))
        }
        Parameter::ForceBias => {
            let bias = vector();
            format!("its specific forces shift by ({:+.2}, {:+.2}, {:+.2}) m/s²", bias.x, bias.y, bias.z)
        }
        Parameter::Gravity
        | Parameter::Lever
        | Parameter::PositionScale
        | Parameter::Transport
        | Parameter::PositionAxes
        | Parameter::WorldAxes
        | Parameter::LevelAxes => return None,
    })
}

/// Sources that disagree with the suspected ones.
fn others(suspected: &[Source], pairs: &[Pair]) -> Vec<String> {
    let mut others: Vec<&Source> = pairs
        .iter()
        .filter(|pair| pair.fit.disagrees.is_some())
        .flat_map(|pair| &pair.sources)
        .filter(|source| !suspected.contains(source))
        .collect();
    others.sort();
    others.dedup();
    others.into_iter().map(Source::name).collect()
}

fn evidence(pairs: &[Pair]) -> String {
    let of_pair = |pair: &Pair| {
        let [one, other] = pair.sources.each_ref().map(Source::name);
        let misfit = pair.fit.misfit;
        match pair.fit.disagrees {
            None => format!("{one} and {other} agree ({misfit:.1} times the noise)"),
            Some(interval) => format!("{one} and {other} disagree{} ({misfit:.1} times the noise)", times(interval)),
        }
    };
    pairs.iter().map(of_pair).collect::<Vec<_>>().join("; ")
}

fn times(interval: FindingInterval) -> String {
    match (interval.since_s, interval.until_s) {
        (Some(since_s), Some(until_s)) => format!(" from {since_s:.1} to {until_s:.1} s"),
        (Some(since_s), None) => format!(" from {since_s:.1} s on"),
        (None, Some(until_s)) => format!(" up to {until_s:.1} s"),
        (None, None) => String::new(),
    }
}

/// Misfits of a source as recorded and as changed.
pub(super) fn misfits_text(name: &str, changed: &str, [given, then]: [f64; 2]) -> String {
    format!("the misfit of {name} is {given:.1} times the noise, {then:.1} times {changed}")
}

/// Names as a list with a conjunction before the last one.
fn all_of(names: &[String], conjunction: &str) -> String {
    match names {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} {conjunction} {last}", first.join(", ")),
    }
}
