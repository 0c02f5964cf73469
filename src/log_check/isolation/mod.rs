//! Isolation of a wrong source: pairs of sources that measure one quantity are compared over time, and the source that
//! disagrees with others that are consistent among themselves is named, with its time, whether or not its cause is known.

mod compared;
mod comparison;
mod culprits;
mod directions;
mod exclusion;
mod forces;
mod frames;
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
use self::culprits::culprits;
use self::exclusion::{exclude_causes, exclude_pairs, is_explained, name_axes_of_imu};
use self::orientations::Orientations;
use self::pair::Pair;
use self::source::Source;
use self::statement::Statement;
use super::report::agreement::{Agreement, Quantity};
use super::report::suspects::Suspects;
use super::report::{Finding, FindingInterval, Findings, Measurement};
use super::statistics::median;
use crate::faults::{Fault, FaultKind};
use crate::geometry::RigidTransform;
use crate::sensors::{CameraMount, CameraRig};

/// Misfit of directions in units of their noise from which they disagree; between it and [`LARGEST_MISFIT`] nothing is
/// concluded: parallax may be small.
const WRONG_DIRECTION: f64 = 5.0;
/// Ratio of the misfit of a camera with the images of another one to its own from which images are exchanged.
const EXCHANGED_RATIO: f64 = 0.25;

/// Adds a finding about a source that is wrong without a known cause, and removes causes of other sources that the comparisons
/// exclude.
pub(super) fn isolate(compared: &Compared<'_>, rotations: Rotations, findings: &mut Findings) -> Agreement {
    let Rotations { pairs: mut rotations, truth } = rotations;
    mark_unexplained(&mut rotations, findings);
    let mut statements: Vec<Statement> = compared.statement(&rotations).into_iter().collect();
    for statement in &mut statements {
        exclude_causes(statement, &rotations, findings);
    }
    let suspected: Vec<Source> = statements.iter().flat_map(|statement| statement.suspected.clone()).collect();
    let truth = truth.filter(|_| !suspected.contains(&Source::GroundTruth));
    let motion = truth.map_or_else(Vec::new, |truth| compared.motion(&truth, &suspected, findings));
    if let Some(mut of_motion) = Statement::of(&motion_culprits(&motion), &motion, compared.rig) {
        exclude_pairs(&mut of_motion, findings);
        of_motion.join_axes(findings, compared.rig);
        statements.push(of_motion);
    }
    let isolated = statements.iter().map(|statement| statement.title.clone()).collect();
    let forces = motion.iter().find(|pair| pair.quantity == Quantity::SpecificForce);
    if forces.is_some_and(|pair| pair.fit.disagrees.is_none()) {
        name_axes_of_imu(findings, compared.rig);
    }
    // The axes of the whole IMU explain the gyroscope's.
    let is_of_imu = |fault: &Fault| fault.kind == FaultKind::ImuAxes;
    let has_imu_axes = statements.iter().any(|it| it.cause.as_ref().is_some_and(is_of_imu))
        || findings.list.iter().any(|finding| finding.faults.iter().any(is_of_imu));
    if has_imu_axes {
        statements.retain(|it| it.suspected != [Source::Gyroscope]);
        let is_of_gyroscope = |fault: &Fault| fault.kind == FaultKind::GyroscopeAxes;
        findings.retract_misfits(|finding| finding.faults.iter().any(is_of_gyroscope));
    }
    for statement in statements {
        if statement.is_cause || !is_explained(&statement, findings) {
            report(statement, findings);
        }
    }
    Agreement { pairs: rotations.iter().chain(&motion).map(Pair::agreement).collect(), isolated }
}

/// Sources of rotation, compared with each other.
pub(super) struct Rotations {
    pairs: Vec<Pair>,
    /// Axes and clock of a ground truth that agrees with the gyroscope, or did at first.
    truth: Option<TruthOffsets>,
}

/// Ground truth against the gyroscope.
struct TruthOffsets {
    body_from_imu: UnitQuaternion<f64>,
    /// Time of the IMU less that of the ground truth, in seconds.
    delay_s: f64,
}

impl Rotations {
    pub(super) fn of(compared: &Compared<'_>) -> Self {
        let sources = Orientations::all(compared);
        let mut pairs = Vec::new();
        let mut truth = None;
        for (number, one) in sources.iter().enumerate() {
            for other in &sources[number + 1..] {
                let Some((sources, fit, offsets)) = rotation::compare(one, other) else { continue };
                // Before a change the sources agree.
                if fit.disagrees.is_none_or(|interval| interval.since_s.is_some()) {
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
        Self { pairs, truth }
    }

    /// Sensors that may be the cause of the misfit of a camera: all of them unless it disagrees with the gyroscope.
    pub(super) fn suspects(&self, compared: &Compared<'_>, camera_key: &str) -> Suspects {
        let disagrees = |pair: &Pair| {
            pair.fit.disagrees.is_some()
                && pair.sources.contains(&Source::Gyroscope)
                && pair.sources.iter().any(|source| source.camera_key() == Some(camera_key))
        };
        if !self.pairs.iter().any(disagrees) {
            return Suspects::default();
        }
        let (alternatives, _) = compared.culprits(&self.pairs);
        Suspects::only(alternatives.iter().flatten().flat_map(Source::suspects).collect())
    }
}

impl Compared<'_> {
    /// Pairs of the accelerometer and the images with the motion of the ground truth, but for images whose rotations are
    /// suspected.
    fn motion(&self, truth: &TruthOffsets, suspected: &[Source], findings: &Findings) -> Vec<Pair> {
        let TruthOffsets { body_from_imu, delay_s } = truth;
        let mut pairs = Vec::new();
        let mut add = |quantity, source: Source, fit: Fit| {
            let sources = [source, Source::Positions];
            pairs.push(Pair { quantity, sources, first_from_second: UnitQuaternion::identity(), fit });
        };
        let can_compare = |it| findings.can_compare(it) || findings.is_by_pair(it);
        if can_compare(Measurement::Accelerometer)
            && let Some(fit) = forces::compare(self, body_from_imu, *delay_s)
        {
            add(Quantity::SpecificForce, Source::Accelerometer, fit);
        }
        // The cameras have the axes of the rig's IMU, which a wrong gyroscope may not have.
        let cameras = self.rig.cameras.iter().filter(|_| !suspected.contains(&Source::Gyroscope));
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
        let (alternatives, by_joint) = self.culprits(pairs);
        let suspected: BTreeSet<&Source> = alternatives.iter().flatten().collect();
        if let Some(exchange) = self.exchange(&suspected, pairs) {
            return Some(exchange);
        }
        if let Some(inverted) = self.inverted_truth(&suspected, pairs) {
            return Some(inverted);
        }
        let suspected: Vec<&Source> = suspected.into_iter().collect();
        if let Some(framed) = self.other_frame(&suspected, pairs) {
            return Some(framed);
        }
        Statement::of(&alternatives, by_joint.as_deref().unwrap_or(pairs), self.rig)
    }

    /// Smallest sets of sources that explain the pairs, and the pairs with one joint in place of a camera if it is wrong alone.
    fn culprits(&self, pairs: &[Pair]) -> (Vec<Vec<Source>>, Option<Vec<Pair>>) {
        let alternatives = culprits_of(pairs);
        if let [only] = alternatives.as_slice()
            && let [images] = only.as_slice()
            && let Some(of_joint) = self.of_joint(images, pairs)
        {
            return (culprits_of(&of_joint), Some(of_joint));
        }
        (alternatives, None)
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

/// Wrong sources of motion: accelerations that agree up to a factor or other axes belong to positions with another unit
/// or world.
fn motion_culprits(pairs: &[Pair]) -> Vec<Vec<Source>> {
    let of_positions = |parameter| matches!(parameter, Parameter::PositionScale | Parameter::PositionAxes);
    if pairs.iter().filter_map(|pair| pair.fit.change.as_ref()).any(|change| of_positions(change.parameter)) {
        return vec![vec![Source::Positions]];
    }
    culprits_of(pairs)
}

fn culprits_of(pairs: &[Pair]) -> Vec<Vec<Source>> {
    culprits(&pairs.iter().map(Pair::verdict).collect::<Vec<_>>())
}

/// A smaller misfit of a camera counts if each of its rotations exceeds its noise by another check.
fn mark_unexplained(pairs: &mut [Pair], findings: &Findings) {
    for Pair { sources, fit, .. } in pairs {
        let is_unexplained = sources.iter().any(|it| it.camera_key().is_some_and(|key| findings.is_unexplained(key)));
        if is_unexplained && fit.disagrees.is_none() && fit.misfit > AGREEING_MISFIT {
            fit.disagrees = Some(FindingInterval::default());
        }
    }
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

/// Adds the finding in place of those that say that rotations, or the motion of the ground truth, are unexplained.
fn report(statement: Statement, findings: &mut Findings) {
    let faults = statement.faults();
    let mut evidence = statement.evidence;
    let of_motion = statement.suspected.iter().any(|it| matches!(it, Source::Accelerometer | Source::Positions));
    let is_replaced = |finding: &Finding| finding.faults.is_empty() && (!of_motion || statement.area == finding.area);
    for finding in findings.retract_misfits(is_replaced) {
        evidence = format!("{evidence}; {}", finding.evidence);
    }
    findings.add(statement.severity, statement.area, statement.title, evidence, statement.remedy);
    findings.state_faults(faults);
    findings.state_times(statement.interval.since_s, statement.interval.until_s);
}
