//! Ground truth compared with the gyroscope and with gravity: its clock, its body frame and the vertical of its world.
//! Errors of an estimate against a reference that is itself wrong look like errors of the estimate.

mod placed_forces;

use nalgebra::{UnitQuaternion, Vector3};

pub(super) use self::placed_forces::{HALF_VELOCITY_NS, around};
use self::placed_forces::{OtherAxes, PlacedForces, velocity_at};
use super::clock_alignment::{
    AlignmentError, ClockAlignment, ORIENTATION_TOLERANCE_RAD, RotationReference, SCALE_TOLERANCE, align_clocks,
};
use super::imu::{ImuFacts, LARGEST_BIAS_M_PER_S2};
use super::report::{Area, Findings, ImageRotation, Measurement, Severity};
use super::statistics::median;
use super::survey::held::Held;
use crate::faults::{Fault, FaultKind};
use crate::flight_log::log::relative_ns;
use crate::flight_log::stamps::spacing::Spacing;
use crate::flight_log::{FlightLog, RecordedPose};
use crate::geometry::{RigidTransform, SignedAxes, ns_from_seconds, seconds_from_ns, so3};
use crate::sensors::Rig;

/// Step between the compared orientations in nanoseconds.
const STEP_NS: i64 = 100_000_000;
/// Poses farther apart are not compared, in nanoseconds.
const MAX_STEP_NS: i64 = 3 * STEP_NS;
/// Largest magnitude of a time offset in the search.
const MAX_OFFSET_S: f64 = 1.0;
/// Smallest reported time offset, in seconds.
const OFFSET_TOLERANCE_S: f64 = 0.005;
/// Smallest reported rotation between the body of the ground truth and the IMU, in radians.
const BODY_TOLERANCE_RAD: f64 = 0.02;
/// Ratio of the misfit to the misfit with reversed rates from which the gyroscope's frame counts as left-handed.
const REVERSED_RATIO: f64 = 4.0;
/// Ratio of the misfit to the rotations above which nothing is concluded from the alignment.
const UNEXPLAINED_RATIO: f64 = 0.2;
/// Number of standard deviations from which a value is reported.
const SIGNIFICANT_SIGMAS: f64 = 4.0;
/// Smallest reported angle between gravity and the vertical of the ground truth's world: biases of low-cost accelerometers
/// tilt gravity by up to 4°.
const TILT_TOLERANCE_RAD: f64 = 0.087;
/// A larger angle means other axes, not an inaccurate levelling.
const OTHER_AXES_RAD: f64 = 1.0;
/// Name of the ground truth as the subject of a misfit.
const MISFIT_NAME: &str = "ground truth";
/// Largest mean acceleration over a log by the positions of its ground truth, in m/s²: larger ones are no motion.
const LARGEST_MEAN_ACCELERATION_M_PER_S2: f64 = 20.0;
/// Shortest time over which a mean specific force is compared with the vertical, in seconds.
const MIN_DURATION_S: f64 = 1.0;

/// Poses of the ground truth on the log's clock, ordered by stamp.
struct GroundTruth<'a> {
    topic: &'a str,
    /// Nanoseconds since the log began, and `world_from_body`.
    poses: &'a [(i64, RigidTransform)],
}

/// Poses of the ground truth of a rig: nanoseconds since the log began and `world_from_body`, ordered by stamp. Empty without
/// attitudes; a topic that is missing or unreadable is reported by other checks.
pub(super) fn poses_of(log: &FlightLog, rig: &Rig) -> Vec<(i64, RigidTransform)> {
    let topic = rig.ground_truth_topic.as_deref().filter(|topic| !log.is_position_topic(topic));
    let recorded = topic.and_then(|topic| log.read_trajectory_topic(topic).ok()).unwrap_or_default();
    let pose = |pose: RecordedPose| {
        Some((relative_ns(pose.stamp_ns, log.epoch_ns()), RigidTransform::new(pose.rotation?, pose.position_m)))
    };
    recorded.into_iter().filter_map(pose).collect()
}

/// Reports messages of the ground truth without a usable pose or position; they are not used.
pub(super) fn check_unusable_poses(log: &FlightLog, rig: &Rig, findings: &mut Findings) {
    let Some(topic) = rig.ground_truth_topic.as_deref() else { return };
    let unusable = log.stamps_without_pose(topic);
    let all = log.topic(topic).map_or(0, |info| info.count);
    let [without_fix, wrong] = [true, false].map(|is_fix| {
        let of_kind = unusable.iter().filter(|(_, has_no_fix)| *has_no_fix == is_fix);
        of_kind.map(|(stamp_ns, _)| *stamp_ns).collect::<Vec<i64>>()
    });
    let texts = [
        (without_fix, "positions of the ground truth have no fix", "the receiver says so (status −1)"),
        (wrong, "poses of the ground truth are no poses", "positions are not finite, or quaternions have no length"),
    ];
    for (stamps_ns, title, reason) in texts {
        let (Some(first), Some(last)) = (stamps_ns.iter().min(), stamps_ns.iter().max()) else { continue };
        let evidence = format!(
            "{} of {all} messages, the first at {:.3} s, the last at {:.3} s: {reason}; they are not used",
            stamps_ns.len(),
            seconds_from_ns(*first),
            seconds_from_ns(*last)
        );
        let remedy = "errors are computed from the others; record until and from when it is valid";
        findings.add(Severity::Warning, Area::Log, title, evidence, remedy);
        findings.state_interval(stamps_ns.iter().copied());
    }
}

/// Compares the ground truth of the rig with the IMU, if the log has one with attitudes. `rotations_of_imu` are rotations of
/// the IMU, in its frame, that would explain the orientations of the cameras.
pub(super) fn check_ground_truth(
    poses: &[(i64, RigidTransform)],
    rig: &Rig,
    imu_facts: &ImuFacts,
    rotations_of_imu: &[UnitQuaternion<f64>],
    findings: &mut Findings,
) {
    let Some(topic) = rig.ground_truth_topic.as_deref().filter(|_| findings.can_compare(Measurement::Gyroscope)) else {
        return;
    };
    let truth = GroundTruth { topic, poses };
    if imu_facts.samples.is_empty() || truth.poses.is_empty() {
        return;
    }
    if let Some(held) = Held::of(poses) {
        held.report(Area::Log, "the ground truth", "holds its", findings);
    }
    // Stamps of a batch are late by up to its length.
    let stamps = imu_facts.samples.iter().map(|sample| sample.stamp_ns);
    let batches = Spacing::of(stamps, Some(rig.imu.rate_hz)).batches;
    truth.compare(imu_facts, batches.map_or(0.0, |batches| batches.pause_s), rotations_of_imu, findings);
}

impl GroundTruth<'_> {
    /// `imu_delay_s` is the largest delay of the IMU's own stamps.
    fn compare(
        &self,
        imu_facts: &ImuFacts,
        imu_delay_s: f64,
        rotations_of_imu: &[UnitQuaternion<f64>],
        findings: &mut Findings,
    ) {
        let rotations = self.rotations();
        let [given, reversed] = [1.0, -1.0].map(|factor| {
            let reference = RotationReference::Gyroscope(imu_facts.gyroscope.changed(|rate| rate * factor));
            align_clocks(&rotations, &reference, 0.0, MAX_OFFSET_S)
        });
        if let Ok(reversed) = &reversed
            && given.as_ref().map_or(f64::INFINITY, |given| given.residual_deg) > REVERSED_RATIO * reversed.residual_deg
        {
            return report_left_handed(reversed, given.ok().as_ref(), findings);
        }
        match given {
            Ok(found) if found.residual_deg > UNEXPLAINED_RATIO * found.rotation_deg => {
                let (offset_s, explained) = (found.offset_s, found.explained);
                report_failure(&AlignmentError::NoAgreement { offset_s, explained }, findings);
            }
            Ok(found) => {
                self.report_clock(&found, imu_delay_s, findings);
                let placed = PlacedForces { poses: self.poses, clock: &found, samples: &imu_facts.samples };
                let can_compare = findings.can_compare(Measurement::Accelerometer);
                let of_forces = if can_compare { placed.other_axes() } else { None };
                let is_of_gyroscope = report_body(&found, rotations_of_imu, of_forces.as_ref(), findings);
                match of_forces {
                    Some(other) if !is_of_gyroscope => other.report(findings),
                    None if can_compare => self.report_world(&found, imu_facts, findings),
                    _ => {}
                }
            }
            Err(error) => report_failure(&error, findings),
        }
    }

    /// Rotations of the body between poses about [`STEP_NS`] apart.
    fn rotations(&self) -> Vec<ImageRotation> {
        let mut chosen: Vec<&(i64, RigidTransform)> = Vec::new();
        for pose in self.poses {
            if chosen.last().is_none_or(|last| pose.0 - last.0 >= STEP_NS) {
                chosen.push(pose);
            }
        }
        let rotation = |pair: &[&(i64, RigidTransform)]| {
            let [(from_ns, from), (to_ns, to)] = [pair[0], pair[1]];
            (to_ns - from_ns <= MAX_STEP_NS).then(|| ImageRotation {
                camera_key: self.topic.to_owned(),
                from_ns: *from_ns,
                to_ns: *to_ns,
                second_from_first: to.rotation.inverse() * from.rotation,
                tracks: Vec::new(),
            })
        };
        chosen.windows(2).filter_map(rotation).collect()
    }

    /// Median speed over the compared steps, in m/s.
    fn speed_m_per_s(&self) -> f64 {
        let speed = |pair: &[(i64, RigidTransform)]| {
            let interval_s = seconds_from_ns(pair[1].0 - pair[0].0);
            (pair[1].1.translation_m - pair[0].1.translation_m).norm() / interval_s.max(1e-9)
        };
        median(&self.poses.windows(2).map(speed).collect::<Vec<_>>())
    }

    fn report_clock(&self, found: &ClockAlignment, imu_delay_s: f64, findings: &mut Findings) {
        let (offset_s, sigma_s) = (found.offset_s, found.offset_sigma_s);
        let evidence = format!(
            "{:.1} ± {:.1} ms {} than the gyroscope, by {} rotations of {:.2}° in the median, which then differ by {:.3}°; \
             at the median speed of {:.2} m/s this is {:.3} m",
            offset_s.abs() * 1e3,
            sigma_s * 1e3,
            if offset_s < 0.0 { "later" } else { "earlier" },
            found.rotations,
            found.rotation_deg,
            found.residual_deg,
            self.speed_m_per_s(),
            self.speed_m_per_s() * offset_s.abs()
        );
        if offset_s.abs() < OFFSET_TOLERANCE_S.max(SIGNIFICANT_SIGMAS * sigma_s) + imu_delay_s {
            return findings.good(Area::Time, "ground truth and gyroscope are synchronized", evidence);
        }
        let late = if offset_s < 0.0 { "late" } else { "early" };
        let title = format!("the ground truth is {:.0} ms {late}", offset_s.abs() * 1e3);
        let remedy = format!(
            "add {offset_s:+.3} s to its stamps before errors against it are used; position errors contain this delay"
        );
        findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
        findings.mark_by_pair(&[Measurement::Gyroscope]);
    }

    /// Compares the direction of the mean specific force in the world of the ground truth with the vertical (z up).
    fn report_world(&self, found: &ClockAlignment, imu_facts: &ImuFacts, findings: &mut Findings) {
        let Some((up, acceleration)) = self.up_in_world(found, imu_facts) else { return };
        let vertical = up - acceleration;
        let tilt_rad = vertical.angle(&Vector3::z());
        let evidence = format!(
            "mean specific force ({:+.2}, {:+.2}, {:+.2}) m/s² in its world, {:.1}° from +z; mean acceleration \
             {:.2} m/s² by its positions",
            up.x,
            up.y,
            up.z,
            tilt_rad.to_degrees(),
            acceleration.norm()
        );
        if acceleration.norm() > LARGEST_MEAN_ACCELERATION_M_PER_S2 {
            let title = "the positions of the ground truth have accelerations that no vehicle keeps up";
            let remedy = "check their unit (metres) and that they have no jumps";
            findings.add(Severity::Warning, Area::Log, title, evidence, remedy);
            return findings.mark_misfit(MISFIT_NAME);
        }
        let tolerance_rad = TILT_TOLERANCE_RAD.max(LARGEST_BIAS_M_PER_S2 / vertical.norm().max(1.0));
        if tilt_rad < tolerance_rad {
            return findings.good(Area::Log, "the world of the ground truth has z up", evidence);
        }
        let degrees = tilt_rad.to_degrees();
        let (title, remedy) = if tilt_rad > std::f64::consts::PI - tolerance_rad {
            let remedy =
                "convert it to a world with z up (ENU): by yaw and position alone such trajectories cannot be aligned";
            ("the world of the ground truth has z down (NED)".to_owned(), remedy)
        } else if tilt_rad > OTHER_AXES_RAD {
            let remedy = "convert it to a world with z up; check also that its quaternions are world_from_body";
            (format!("the world of the ground truth has other axes: gravity is {degrees:.0}° from its z"), remedy)
        } else {
            let remedy =
                "align by a rigid transform (dcvins evaluate --align se3), or level the world of the ground truth";
            (format!("the world of the ground truth is tilted by {degrees:.1}° against gravity"), remedy)
        };
        findings.add(Severity::Warning, Area::Log, title, evidence, remedy);
        findings.mark_by_pair(&[Measurement::Gyroscope, Measurement::Accelerometer]);
    }

    /// Mean specific force in the world of the ground truth, with the mean acceleration by its positions, in m/s².
    fn up_in_world(&self, found: &ClockAlignment, imu_facts: &ImuFacts) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let body_from_imu = so3::exp(&Vector3::from(found.camera_from_body_rad));
        let offset_ns = ns_from_seconds(found.offset_s);
        let force = |(stamp_ns, pose): &(i64, RigidTransform)| {
            let imu_ns = stamp_ns + offset_ns;
            let after = imu_facts.samples.partition_point(|sample| sample.stamp_ns < imu_ns);
            let sample = imu_facts.samples.get(after).filter(|sample| sample.stamp_ns - imu_ns < STEP_NS)?;
            Some((*stamp_ns, pose.rotation * (body_from_imu * sample.specific_force_m_per_s2)))
        };
        let forces: Vec<(i64, Vector3<f64>)> = self.poses.iter().filter_map(force).collect();
        let (first, last) = (forces.first()?.0, forces.last()?.0);
        // The integral over time, so that unequal steps do not change the mean.
        let integral = forces.windows(2).fold(Vector3::zeros(), |sum, pair| {
            sum + (pair[0].1 + pair[1].1) * (0.5 * seconds_from_ns(pair[1].0 - pair[0].0))
        });
        let duration_s = seconds_from_ns(last - first);
        let change = velocity_at(self.poses, last)? - velocity_at(self.poses, first)?;
        (duration_s > MIN_DURATION_S).then(|| (integral / duration_s, change / duration_s))
    }
}

/// Reports that the reversed rates of the gyroscope fit; `given` is the alignment with the recorded ones.
fn report_left_handed(reversed: &ClockAlignment, given: Option<&ClockAlignment>, findings: &mut Findings) {
    let without = given.map_or_else(
        || "with the recorded ones nothing fits".to_owned(),
        |given| format!("by {:.3}° with the recorded ones", given.residual_deg),
    );
    let evidence = format!(
        "{} rotations of {:.2}° in the median differ by {:.3}° with reversed angular rates, {without}",
        reversed.rotations, reversed.rotation_deg, reversed.residual_deg
    );
    let title = "the axes of the gyroscope form a left-handed frame, by the ground truth";
    let remedy = "correct order and signs of the axes in the IMU's driver, of gyroscope and accelerometer alike";
    findings.add(Severity::Error, Area::Imu, title, evidence, remedy);
    findings.state_faults([Fault::from(FaultKind::GyroscopeAxes)]);
    findings.mark_by_pair(&[Measurement::Gyroscope]);
}

fn report_failure(error: &AlignmentError, findings: &mut Findings) {
    let title = match error {
        AlignmentError::NoAgreement { .. } | AlignmentError::NoOverlap { .. } => {
            let title = "unexplained: the rotations of the ground truth are not those of the gyroscope";
            let remedy = "check that it is the trajectory of this vehicle and flight, that its quaternions are \
                          world_from_body, and its stamps; its errors mean nothing until then";
            findings.add(Severity::Warning, Area::Log, title, error.to_string(), remedy);
            return findings.mark_misfit(MISFIT_NAME);
        }
        _ => "the ground truth cannot be compared with the gyroscope",
    };
    findings.add(Severity::Note, Area::Log, title, error.to_string(), "");
}

/// Reports the rotation of the ground truth's body against the IMU, and the scale of the gyroscope. True if the gyroscope's axes
/// alone are other ones than the rig's, by which the accelerometer's seem to be other ones, too.
fn report_body(
    found: &ClockAlignment,
    rotations_of_imu: &[UnitQuaternion<f64>],
    of_forces: Option<&OtherAxes>,
    findings: &mut Findings,
) -> bool {
    let body_from_imu = so3::exp(&Vector3::from(found.camera_from_body_rad));
    let angle_rad = body_from_imu.angle();
    // Each rotation measures two axes; the misfit of one is averaged over all.
    let sigma_rad = found.residual_deg / found.rotation_deg.max(1e-9) / (found.rotations as f64).sqrt();
    let evidence = format!(
        "rotated by {:.1} ± {:.1}° against the IMU; {:.3} times the rotation of the gyroscope",
        angle_rad.to_degrees(),
        sigma_rad.to_degrees(),
        found.scale
    );
    let off_scale = (found.scale - 1.0).abs() > SCALE_TOLERANCE.max(SIGNIFICANT_SIGMAS * sigma_rad);
    if off_scale {
        let title = format!("the gyroscope measures {:.2} times the rotation of the ground truth", 1.0 / found.scale);
        let remedy = "check unit and range setting of the gyroscope, or imu0's scale factors in the rig";
        findings.add(Severity::Warning, Area::Imu, title, evidence.clone(), remedy);
        findings.state_faults([Fault::new(FaultKind::GyroscopeScale, &[found.scale])]);
        findings.mark_by_pair(&[Measurement::Gyroscope]);
    }
    if angle_rad > BODY_TOLERANCE_RAD.max(SIGNIFICANT_SIGMAS * sigma_rad) {
        let vector = so3::log(&body_from_imu).map(f64::to_degrees);
        let evidence = format!(
            "{evidence}; rotation vector ({:+.1}, {:+.1}, {:+.1})° in the IMU frame",
            vector.x, vector.y, vector.z
        );
        let turned = format!("rotated by {:.1}°", angle_rad.to_degrees());
        let is_same = |rotation: &UnitQuaternion<f64>| rotation.angle_to(&body_from_imu) < ORIENTATION_TOLERANCE_RAD;
        if !rotations_of_imu.is_empty() && rotations_of_imu.iter().all(is_same) {
            let axes = SignedAxes::nearest(&body_from_imu.to_rotation_matrix().into_inner());
            let is_of_gyroscope = of_forces.is_some() && of_forces.map(|it| it.axes) == axes.map(|axes| axes.inverse());
            let (sensor, kind) =
                if is_of_gyroscope { ("gyroscope", FaultKind::GyroscopeAxes) } else { ("IMU", FaultKind::ImuAxes) };
            let title = format!("the axes of the {sensor} are not those of the rig: {turned}");
            let evidence = format!("ground truth and cameras agree with each other: {evidence}");
            let remedy = "publish the IMU in the axes of the calibration, or calibrate the extrinsics of all cameras with \
                          the axes that it has";
            findings.add(Severity::Error, Area::Imu, title, evidence, remedy);
            findings.state_faults(axes.map(|axes| Fault::of_axes(kind, axes)));
            return is_of_gyroscope;
        }
        let title = format!("the ground truth is of another body frame: {turned}");
        let remedy = "publish the pose of the IMU: attitude errors and NEES contain this rotation, and position errors the \
                      distance between both origins";
        findings.add(Severity::Warning, Area::Log, title, evidence, remedy);
        findings.mark_by_pair(&[Measurement::Gyroscope]);
    } else if !off_scale {
        findings.good(Area::Log, "the ground truth is of the IMU's axes", evidence);
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::{AngularRates, ImuSample};

    const GRAVITY: f64 = 9.81;
    const STEP_S: f64 = 0.005;

    fn rate_at(time_s: f64) -> Vector3<f64> {
        Vector3::new(0.5 * (1.3 * time_s).sin(), 0.4 * (1.9 * time_s).cos(), 0.3 * (0.7 * time_s).sin())
    }

    /// IMU facts of a vehicle that rotates in place for 10 s, and its poses every 5 ms.
    fn flight() -> (ImuFacts, Vec<(i64, RigidTransform)>) {
        let mut world_from_imu = UnitQuaternion::identity();
        let (mut samples, mut poses) = (Vec::new(), Vec::new());
        for number in 0..2000 {
            let time_s = f64::from(number) * STEP_S;
            let stamp_ns = ns_from_seconds(time_s);
            samples.push(ImuSample {
                stamp_ns,
                angular_velocity_rad_per_s: rate_at(time_s),
                specific_force_m_per_s2: world_from_imu.inverse() * Vector3::new(0.0, 0.0, GRAVITY),
                unmeasured_s: 0.0,
            });
            poses.push((stamp_ns, RigidTransform::new(world_from_imu, Vector3::new(time_s, 0.0, 0.0))));
            world_from_imu *= so3::exp(&(rate_at(time_s + 0.5 * STEP_S) * STEP_S));
        }
        let rates = samples.iter().map(|it| (seconds_from_ns(it.stamp_ns), it.angular_velocity_rad_per_s));
        let gyroscope = AngularRates::new(rates);
        (ImuFacts { samples, gyroscope, ..ImuFacts::default() }, poses)
    }

    /// Titles of all findings that are not good, for poses that are changed first.
    fn titles(change: impl Fn(&mut (i64, RigidTransform))) -> Vec<String> {
        let (imu_facts, mut poses) = flight();
        poses.iter_mut().for_each(change);
        let truth = GroundTruth { topic: "/truth", poses: &poses };
        let mut findings = Findings::default();
        truth.compare(&imu_facts, 0.0, &[], &mut findings);
        findings.list.into_iter().filter(|it| it.severity != Severity::Good).map(|it| it.title).collect()
    }

    #[test]
    fn sound_ground_truth_has_no_findings() {
        assert_eq!(titles(|_| {}), Vec::<String>::new());
    }

    #[test]
    fn a_delay_is_named_with_its_value() {
        assert_eq!(titles(|pose| pose.0 += 80_000_000), ["the ground truth is 80 ms late"]);
        assert_eq!(titles(|pose| pose.0 -= 30_000_000), ["the ground truth is 30 ms early"]);
    }

    #[test]
    fn another_body_frame_and_another_world_are_named() {
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.3, 0.0);
        assert_eq!(
            titles(|pose| pose.1.rotation *= turn),
            ["the ground truth is of another body frame: rotated by 17.2°"]
        );
        let ned = UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.4);
        assert_eq!(
            titles(|pose| pose.1 = RigidTransform::new(ned, Vector3::zeros()) * pose.1),
            ["the world of the ground truth has z down (NED)"]
        );
        let tilt = UnitQuaternion::from_euler_angles(0.2, 0.0, 0.0);
        assert_eq!(
            titles(|pose| pose.1 = RigidTransform::new(tilt, Vector3::zeros()) * pose.1),
            ["the world of the ground truth is tilted by 11.5° against gravity"]
        );
    }

    #[test]
    fn a_left_handed_gyroscope_is_named() {
        let (mut imu_facts, poses) = flight();
        let swapped = |rate: Vector3<f64>| Vector3::new(rate.y, rate.x, rate.z);
        let rates =
            imu_facts.samples.iter().map(|it| (seconds_from_ns(it.stamp_ns), swapped(it.angular_velocity_rad_per_s)));
        imu_facts.gyroscope = AngularRates::new(rates.collect::<Vec<_>>());
        let mut findings = Findings::default();
        GroundTruth { topic: "/truth", poses: &poses }.compare(&imu_facts, 0.0, &[], &mut findings);
        let titles: Vec<&str> = findings.list.iter().map(|finding| finding.title.as_str()).collect();
        assert_eq!(titles, ["the axes of the gyroscope form a left-handed frame, by the ground truth"]);
    }

    #[test]
    fn rotations_of_another_flight_are_unexplained() {
        let found =
            titles(|pose| pose.1.rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, (pose.0 as f64 * 3e-9).sin()));
        assert!(found.iter().any(|title| title.starts_with("unexplained")), "{found:?}");
    }

    /// Flight with accelerations of up to 2 m/s², and titles of all findings that are not good after a change of the
    /// specific forces.
    fn titles_of_forces(change: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Vec<String> {
        let (mut imu_facts, mut poses) = flight();
        let position = |t: f64| Vector3::new((2.0 * t).sin(), 0.5 * (1.6 * t).cos(), 0.3 * (2.4 * t).sin()) * 0.5;
        for (sample, (stamp_ns, pose)) in imu_facts.samples.iter_mut().zip(&mut poses) {
            let t = seconds_from_ns(*stamp_ns);
            pose.translation_m = position(t);
            let acceleration = (position(t + 0.01) - 2.0 * position(t) + position(t - 0.01)) / 1e-4;
            let force = pose.rotation.inverse() * (acceleration + Vector3::new(0.0, 0.0, GRAVITY));
            sample.specific_force_m_per_s2 = change(force);
        }
        let mut findings = Findings::default();
        GroundTruth { topic: "/truth", poses: &poses }.compare(&imu_facts, 0.0, &[], &mut findings);
        findings.list.into_iter().filter(|it| it.severity != Severity::Good).map(|it| it.title).collect()
    }

    #[test]
    fn axes_and_sign_of_the_accelerometer_are_named() {
        assert_eq!(titles_of_forces(|force| force), Vec::<String>::new());
        assert_eq!(
            titles_of_forces(|force| -force),
            ["the accelerometer has the opposite sign: it measures gravity, not specific force"]
        );
        assert_eq!(
            titles_of_forces(|force| Vector3::new(force.y, force.x, force.z)),
            ["the axes of the accelerometer differ from the gyroscope's: x and y swapped"]
        );
    }

    #[test]
    fn axes_of_the_imu_that_ground_truth_and_camera_agree_on_are_named() {
        let (imu_facts, mut poses) = flight();
        let turn = UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0);
        for (_, pose) in &mut poses {
            pose.rotation *= turn;
        }
        let titles = |turns: &[UnitQuaternion<f64>]| {
            let mut findings = Findings::default();
            GroundTruth { topic: "/truth", poses: &poses }.compare(&imu_facts, 0.0, turns, &mut findings);
            findings.list.iter().map(|it| it.title.clone()).collect::<Vec<_>>().join("; ")
        };
        let by_both = titles(&[turn.inverse()]);
        assert!(by_both.contains("the axes of the IMU are not those of the rig: rotated by 180.0°"), "{by_both}");
        let by_one = titles(&[UnitQuaternion::from_euler_angles(0.0, 0.3, 0.0)]);
        assert!(by_one.contains("the ground truth is of another body frame"), "{by_one}");
    }
}
