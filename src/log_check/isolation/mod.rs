//! Isolation of a wrong source: pairs of sources that measure one quantity are compared over time, and the source that
//! disagrees with others that are consistent among themselves is named, with its time, whether or not its cause is known.

mod compared;
mod comparison;
mod culprits;
mod directions;
mod forces;
mod joints;
mod orientations;
mod pair;
mod rotation;
mod source;
mod statement;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use nalgebra::UnitQuaternion;

pub(super) use self::compared::Compared;
pub use self::comparison::{AGREEING_MISFIT, LARGEST_MISFIT};
use self::comparison::{Fit, Parameter};
use self::culprits::{Verdict, culprits};
use self::orientations::Orientations;
use self::pair::Pair;
use self::source::Source;
use self::statement::Statement;
use super::report::agreement::{Agreement, Quantity};
use super::report::{Area, Finding, FindingInterval, Findings, Measurement, Severity};
use super::statistics::median;
use crate::faults::{Fault, FaultKind};
use crate::geometry::RigidTransform;
use crate::sensors::{CameraMount, CameraRig};

/// Misfit of directions in units of their noise from which they disagree; between it and [`LARGEST_MISFIT`] nothing is
/// concluded: parallax may be small.
const WRONG_DIRECTION: f64 = 5.0;
/// Times that are closer count as one, in seconds.
const SAME_TIME_S: f64 = 1.0;
/// Ratio of the misfit of a camera with the images of another one to its own from which images are exchanged.
const EXCHANGED_RATIO: f64 = 0.25;

/// Compares all sources; adds a finding about one that is wrong without a known cause, and removes causes of other sources
/// that the comparison excludes.
pub(super) fn isolate(compared: &Compared<'_>, findings: &mut Findings) -> Agreement {
    let (rotations, truth) = compared.rotations(findings);
    let mut statements: Vec<Statement> = compared.statement(&rotations).into_iter().collect();
    for statement in &mut statements {
        exclude_causes(statement, &rotations, findings);
    }
    let suspected: Vec<Source> = statements.iter().flat_map(|statement| statement.suspected.clone()).collect();
    let motion = truth.map_or_else(Vec::new, |truth| compared.motion(&truth, &suspected, findings));
    statements.extend(Statement::of(&motion_culprits(&motion), &motion));
    let isolated = statements.iter().map(|statement| statement.title.clone()).collect();
    for statement in statements {
        if statement.is_cause || !is_explained(&statement, findings) {
            report(statement, findings);
        }
    }
    Agreement { pairs: rotations.iter().chain(&motion).map(Pair::agreement).collect(), isolated }
}

/// Ground truth against the gyroscope.
struct TruthOffsets {
    body_from_imu: UnitQuaternion<f64>,
    /// Time of the IMU less that of the ground truth, in seconds.
    delay_s: f64,
}

impl Compared<'_> {
    /// Pairs of sources of rotation, of which a smaller misfit of a camera counts if each of its rotations exceeds its noise by
    /// another check, and the axes and the clock of a ground truth that agrees with the gyroscope.
    fn rotations(&self, findings: &Findings) -> (Vec<Pair>, Option<TruthOffsets>) {
        let sources = Orientations::all(self);
        let mut pairs = Vec::new();
        let mut truth = None;
        for (number, one) in sources.iter().enumerate() {
            for other in &sources[number + 1..] {
                let Some((sources, mut fit, offsets)) = rotation::compare(one, other) else { continue };
                let is_unexplained =
                    sources.iter().any(|it| it.camera_key().is_some_and(|key| findings.is_unexplained(key)));
                if is_unexplained && fit.disagrees.is_none() && fit.misfit > AGREEING_MISFIT {
                    fit.disagrees = Some(FindingInterval::default());
                }
                if fit.disagrees.is_none() {
                    let axes = offsets.first_from_second;
                    match &sources {
                        [Source::GroundTruth, Source::Gyroscope] => {
                            truth = Some(TruthOffsets { body_from_imu: axes, delay_s: offsets.delay_s });
                        }
                        [Source::Gyroscope, Source::GroundTruth] => {
                            truth = Some(TruthOffsets { body_from_imu: axes.inverse(), delay_s: -offsets.delay_s });
                        }
                        _ => {}
                    }
                }
                let first_from_second = offsets.first_from_second;
                pairs.push(Pair { quantity: Quantity::Rotation, sources, first_from_second, fit });
            }
        }
        (pairs, truth)
    }

    /// Pairs of the accelerometer and the images with the motion of the ground truth, but for images whose rotations are
    /// suspected.
    fn motion(&self, truth: &TruthOffsets, suspected: &[Source], findings: &Findings) -> Vec<Pair> {
        let TruthOffsets { body_from_imu, delay_s } = truth;
        let mut pairs = Vec::new();
        let mut add = |quantity, source: Source, fit: Fit| {
            let sources = [source, Source::Positions];
            pairs.push(Pair { quantity, sources, first_from_second: UnitQuaternion::identity(), fit });
        };
        if findings.can_compare(Measurement::Accelerometer)
            && let Some(fit) = forces::compare(self, body_from_imu, *delay_s)
        {
            add(Quantity::SpecificForce, Source::Accelerometer, fit);
        }
        let cameras = self.rig.cameras.iter();
        for camera in cameras.filter(|camera| !suspected.contains(&images_of(camera))) {
            let angles = directions::angles_rad(self, camera, body_from_imu, *delay_s);
            if let Some(fit) = fit_of_directions(&angles) {
                add(Quantity::Direction, images_of(camera), fit);
            }
        }
        pairs
    }

    /// Statement about sources of rotation that disagree.
    fn statement(&self, pairs: &[Pair]) -> Option<Statement> {
        let verdicts: Vec<Verdict> = pairs.iter().map(Pair::verdict).collect();
        let alternatives = culprits(&verdicts);
        let suspected: BTreeSet<&Source> = alternatives.iter().flatten().collect();
        if let Some(exchange) = self.exchange(&suspected, pairs) {
            return Some(exchange);
        }
        if let Some(inverted) = self.inverted_truth(&suspected, pairs) {
            return Some(inverted);
        }
        if let [only] = alternatives.as_slice()
            && let [images] = only.as_slice()
            && let Some(of_joint) = self.of_joint(images, pairs)
        {
            return Statement::of(&culprits(&of_joint.iter().map(Pair::verdict).collect::<Vec<_>>()), &of_joint);
        }
        Statement::of(&alternatives, pairs)
    }

    /// Suspected ground truth whose orientations agree with the gyroscope if they are inverted.
    fn inverted_truth(&self, suspected: &BTreeSet<&Source>, pairs: &[Pair]) -> Option<Statement> {
        if !suspected.iter().all(|source| **source == Source::GroundTruth) {
            return None;
        }
        let is_of_truth = |pair: &&Pair| pair.sources.contains(&Source::GroundTruth);
        let given = pairs.iter().filter(is_of_truth).find(|pair| pair.sources.contains(&Source::Gyroscope))?;
        let invert = |(stamp_ns, pose): &(i64, RigidTransform)| {
            (*stamp_ns, RigidTransform::new(pose.rotation.inverse(), pose.translation_m))
        };
        let inverse: Vec<(i64, RigidTransform)> = self.poses.iter().map(invert).collect();
        let (_, fit, _) = rotation::compare(&Orientations::of_gyroscope(self), &Orientations::of_truth(&inverse)?)?;
        let is_inverse = given.fit.disagrees.is_some() && fit.disagrees.is_none() && fit.misfit < AGREEING_MISFIT;
        is_inverse.then(|| Statement::of_inverted_truth([given.fit.misfit, fit.misfit]))
    }

    /// Two suspected cameras, each of which agrees with the gyroscope by the images of the other one.
    fn exchange(&self, suspected: &BTreeSet<&Source>, pairs: &[Pair]) -> Option<Statement> {
        let cameras: Vec<&CameraRig> =
            self.rig.cameras.iter().filter(|camera| suspected.contains(&images_of(camera))).collect();
        if cameras.len() < 2 {
            return None;
        }
        let gyroscope = Orientations::of_gyroscope(self);
        let misfits = |camera: &CameraRig, other: &CameraRig| {
            let own = images_of(camera);
            let given =
                pairs.iter().find(|pair| pair.sources.contains(&own) && pair.sources.contains(&Source::Gyroscope))?;
            let (_, fit, _) = rotation::compare(&gyroscope, &Orientations::of_images(self, camera, &other.key)?)?;
            let is_better = fit.misfit < EXCHANGED_RATIO * given.fit.misfit;
            (fit.disagrees.is_none() || is_better).then_some([given.fit.misfit, fit.misfit])
        };
        for (number, one) in cameras.iter().enumerate() {
            for other in &cameras[number + 1..] {
                if let (Some(first), Some(second)) = (misfits(one, other), misfits(other, one)) {
                    let suspected = vec![images_of(one), images_of(other)];
                    return Some(Statement::of_exchange([&one.key, &other.key], [first, second], suspected));
                }
            }
        }
        None
    }
}

fn images_of(camera: &CameraRig) -> Source {
    let with_joints = camera.mount == CameraMount::Gimbal;
    Source::Images { camera_key: camera.key.clone(), with_joints }
}

/// Wrong sources of motion: accelerations that agree up to a factor are those of positions in another unit.
fn motion_culprits(pairs: &[Pair]) -> Vec<Vec<Source>> {
    let scaled = |pair: &Pair| pair.fit.change.as_ref().is_some_and(|it| it.parameter == Parameter::PositionScale);
    if pairs.iter().any(scaled) {
        return vec![vec![Source::Positions]];
    }
    culprits(&pairs.iter().map(Pair::verdict).collect::<Vec<_>>())
}

/// Comparison of directions by the angles between them; `None` without them or if nothing follows.
fn fit_of_directions(angles_rad: &[[f64; 2]]) -> Option<Fit> {
    let misfits: Vec<f64> = angles_rad.iter().map(|[_, angle_rad]| angle_rad / directions::NOISE_RAD).collect();
    let misfit = median(&misfits);
    let is_wrong = misfit > WRONG_DIRECTION;
    (!angles_rad.is_empty() && (is_wrong || misfit < LARGEST_MISFIT)).then(|| Fit {
        misfit,
        by_axis: vec![misfit * directions::NOISE_RAD],
        noise: directions::NOISE_RAD,
        disagrees: is_wrong.then(FindingInterval::default),
        ..Fit::default()
    })
}

/// Removes causes, found by the rotations of one camera, of sensors that agree with others although the isolated ones do
/// not.
fn exclude_causes(statement: &mut Statement, pairs: &[Pair], findings: &mut Findings) {
    if !statement.is_isolated {
        return;
    }
    // Two sources that disagree are blamed by the third one.
    let mut excluded = match statement.suspected.as_slice() {
        [Source::Gyroscope] => findings.retract_by_truth(|finding| statement.has_value || finding.area != Area::Imu),
        [Source::GroundTruth] => findings.retract_by_truth(|finding| finding.area == Area::Imu),
        _ => Vec::new(),
    };
    let agreeing: Vec<&Source> =
        pairs.iter().filter(|pair| pair.fit.disagrees.is_none()).flat_map(|pair| &pair.sources).collect();
    let is_excluded = |finding: &Finding| {
        finding.faults.iter().all(|fault| {
            let sensor = fault.kind.row().sensor;
            !statement.suspected.iter().any(|source| source.uses(sensor))
                && agreeing.iter().any(|source| source.uses(sensor))
        })
    };
    // A change at a known time that explains the misfit excludes causes that act all the time.
    let is_constant = |finding: &Finding| {
        let changes = |fault: &Fault| fault.since_s.is_some() || fault.kind == FaultKind::FocalPieces;
        statement.is_measured_change && !finding.faults.iter().any(changes)
    };
    excluded.extend(findings.retract_misfits(|finding| {
        !finding.faults.is_empty() && (statement.is_cause || is_constant(finding) || is_excluded(finding))
    }));
    for finding in excluded {
        statement.evidence.push_str("; excluded: ");
        statement.evidence.push_str(&finding.title);
    }
}

/// True if a finding with a cause is about one of the suspected sources, and for a change whose value is measured about its
/// time.
fn is_explained(statement: &Statement, findings: &Findings) -> bool {
    let is_cause = |finding: &&Finding| finding.severity >= Severity::Warning && !finding.is_assumption;
    let has_time = |finding: &&Finding| {
        let since_s = finding.since_s().or(finding.interval.since_s);
        let (Some(since_s), Some(change_s)) = (since_s, statement.interval.since_s) else { return false };
        (since_s - change_s).abs() < SAME_TIME_S
    };
    findings
        .explained()
        .filter(is_cause)
        .filter(|finding| !statement.is_measured_change || !finding.faults.is_empty() || has_time(finding))
        .any(|finding| statement.suspected.iter().any(|source| source.is_explained_by(finding.area)))
}

/// Adds the finding in place of those that say that rotations, or the motion of the ground truth, are unexplained.
fn report(statement: Statement, findings: &mut Findings) {
    let fault = statement.fault();
    let mut evidence = statement.evidence;
    let of_motion = statement.suspected.iter().any(|it| matches!(it, Source::Accelerometer | Source::Positions));
    let is_replaced = |finding: &Finding| finding.faults.is_empty() && (!of_motion || statement.area == finding.area);
    for finding in findings.retract_misfits(is_replaced) {
        evidence = format!("{evidence}; {}", finding.evidence);
    }
    findings.add(statement.severity, statement.area, statement.title, evidence, statement.remedy);
    findings.state_faults(fault);
    findings.state_times(statement.interval.since_s, statement.interval.until_s);
}
