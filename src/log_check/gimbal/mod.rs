//! Joint angles of the gimbal: their coverage of the images, names, units, ranges, limits and noise.

pub(super) mod frozen_joints;
pub(super) mod gimbal_imu;
pub(super) mod source_fit;
pub(super) mod vehicle_attitude;

use std::f64::consts::{PI, TAU};

use self::frozen_joints::AT_LIMIT_RAD;
use super::report::{Area, Findings, Measurement, Severity};
use super::statistics::{median, percentile, white_sigma};
use super::survey::held::Held;
use super::survey::{Survey, is_in_radians};
use crate::flight_log::joints::JointReading;
use crate::flight_log::joints::attitude::MAX_VEHICLE_GAP_NS;
use crate::geometry::seconds_from_ns;
use crate::sensors::{CameraMount, GimbalRig, Joint, Rig};

/// Tolerated rotation that the joints cannot reach: before calibration the chain may have an error of degrees.
const UNREACHABLE_RAD: f64 = 0.035;

/// Range of motion over the log below which the parameters of a joint are unobservable.
const MIN_RANGE_RAD: f64 = 0.05;
/// Rotation beyond a limit that is tolerated, before the noise of the encoder.
const LIMIT_MARGIN_RAD: f64 = 0.03;
/// Standard deviations of an encoder within which its readings lie.
const NOISE_SIGMAS: f64 = 4.0;
/// Quantiles of the readings between which a joint moves.
const MOTION_QUANTILES: [f64; 2] = [0.02, 0.98];
/// Ratio of readings at a limit that is reported.
const AT_LIMIT_RATIO: f64 = 0.01;
/// Joints whose limits are closer to a whole revolution than this have no stop.
const FREE_ROTATION_RAD: f64 = 0.1;
/// Ratio of the measured noise of an encoder to the rig's from which the rig's is too small.
const NOISE_TOO_SMALL: f64 = 2.0;
/// Ratio of the measured noise of an encoder to the rig's below which the rig's is too large.
const NOISE_TOO_LARGE: f64 = 0.2;
/// One unreachable attitude in this many is reported.
const UNREACHABLE_ONE_IN: usize = 100;

/// Smallest reported time without joint angles at the begin and the end of the images, in seconds.
const MISSING_TOLERANCE_S: f64 = 0.5;
/// A longer missing part of the images, as a ratio, makes a result useless.
const USELESS_MISSING_RATIO: f64 = 0.1;

/// Checks names, range, limits and noise of the encoders.
pub(super) fn check_joints(survey: &Survey, rig: &Rig, findings: &mut Findings) {
    let Some(gimbal) = &rig.gimbal else { return };
    if gimbal.topic.is_none() || gimbal.encoder_sigma_rad.is_none() {
        let evidence = match (&gimbal.topic, gimbal.encoder_sigma_rad) {
            (None, _) => "gimbal.rostopic is null, and there is no gimbal.source",
            (Some(_), _) => "gimbal.encoder_sigma is null",
        };
        let title = "the gimbal's encoders are not used";
        let remedy = "joint angles are then estimated in every frame and need more observations to converge";
        return findings.add(Severity::Note, Area::Encoders, title, evidence, remedy);
    }
    check_attitude(survey, findings);
    if survey.joints.is_empty() {
        return;
    }
    let is_held = check_held(survey, gimbal, findings);
    let readings: Vec<Vec<(i64, f64)>> =
        (0..gimbal.joints.len()).map(|number| finite_readings(survey, number)).collect();
    check_unit(gimbal, &readings, findings);
    for (number, (joint, readings)) in gimbal.joints.iter().zip(readings).enumerate() {
        let white = check_joint(survey, gimbal, number, joint, readings, findings);
        if let Some(white) = white.filter(|_| !is_held) {
            compare_sigma(&joint.name, white, gimbal.encoder_sigma_rad.unwrap_or(0.0), findings);
        }
    }
}

/// Reports joint angles or attitudes that are held; true if they are.
fn check_held(survey: &Survey, gimbal: &GimbalRig, findings: &mut Findings) -> bool {
    let held = if gimbal.attitude.is_some() {
        let topic = gimbal.topic.as_ref().and_then(|topic| survey.topics.get(topic));
        topic.and_then(|topic| Held::of(&topic.contents()))
    } else {
        let complete = survey.joints.iter().filter(|reading| reading.angles_rad.iter().all(Option::is_some));
        let mut readings: Vec<(i64, &[Option<f64>])> =
            complete.map(|reading| (reading.stamp_ns, reading.angles_rad.as_slice())).collect();
        readings.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        Held::of(&readings)
    };
    let Some(held) = held else { return false };
    let (name, verb) = if gimbal.attitude.is_some() {
        ("the gimbal's attitude", "holds its")
    } else {
        ("the joint angles", "hold their")
    };
    held.report(Area::Encoders, name, verb, findings);
    if held.is_late() {
        findings.exclude(Measurement::Joints);
    }
    true
}

/// Finite readings of a joint with their stamps.
fn finite_readings(survey: &Survey, number: usize) -> Vec<(i64, f64)> {
    let reading = |message: &JointReading| Some((message.stamp_ns, message.angles_rad[number]?));
    survey.joints.iter().filter_map(reading).filter(|(_, angle)| angle.is_finite()).collect()
}

fn exceeds_radians(readings: &[(i64, f64)]) -> bool {
    readings.iter().any(|(_, reading)| !is_in_radians(*reading))
}

/// Reports readings that are not in radians, from the finite ones of every joint.
fn check_unit(gimbal: &GimbalRig, readings: &[Vec<(i64, f64)>], findings: &mut Findings) {
    let joints = gimbal.joints.iter().zip(readings).filter(|(_, readings)| exceeds_radians(readings));
    let beyond: Vec<(&str, Vec<f64>)> = joints
        .map(|(joint, readings)| (joint.name.as_str(), readings.iter().map(|(_, angle)| *angle).collect()))
        .collect();
    if beyond.is_empty() {
        return;
    }
    let is_whole = beyond.iter().all(|(_, values)| values.iter().all(|angle| angle.fract() == 0.0));
    let unit = if is_whole { "encoder counts or whole degrees" } else { "degrees" };
    let names: Vec<String> = beyond.iter().map(|(name, _)| format!("'{name}'")).collect();
    let title = format!("readings of {} appear to be in {unit}", names.join(", "));
    let range = |(name, values): &(&str, Vec<f64>)| {
        format!("'{name}' from {:.1} to {:.1}", percentile(values, 0.0), percentile(values, 1.0))
    };
    let evidence = beyond.iter().map(range).collect::<Vec<_>>().join(", ");
    let remedy = "convert them in the driver: sensor_msgs/JointState requires radians";
    findings.add(Severity::Error, Area::Encoders, title, evidence, remedy);
}

/// Time in seconds of the first step by more than half a revolution between two readings.
fn first_revolution_s(readings: &[(i64, f64)]) -> Option<f64> {
    let step = readings.windows(2).find(|pair| (pair[1].1 - pair[0].1).abs() > PI)?;
    Some(seconds_from_ns(step[1].0))
}

/// Checks one joint and returns the standard deviation of its white noise in radians; `angles` are its finite readings.
fn check_joint(
    survey: &Survey,
    gimbal: &GimbalRig,
    number: usize,
    joint: &Joint,
    angles: Vec<(i64, f64)>,
    findings: &mut Findings,
) -> Option<f64> {
    let name = &joint.name;
    let readings = || survey.joints.iter().filter_map(|message| message.angles_rad[number]);
    let missing = survey.joints.len() - readings().count();
    let all = survey.joints.len();
    // A message that names another joint may come from that joint's driver; a message that names no joint of the rig is
    // an error.
    let silent = survey.joints.iter().filter(|message| message.angles_rad.iter().all(Option::is_none)).count();
    if missing == all || silent > 0 {
        let evidence = format!("missing in {missing} of {all} messages, which name {}", survey.joint_names.join(", "));
        let severity = if missing == all { Severity::Error } else { Severity::Warning };
        let remedy = format!("set the messages' name in gimbal.links[{number}].joint");
        findings.add(severity, Area::Encoders, format!("joint '{name}' is not in the messages"), evidence, remedy);
    } else if missing > 0 {
        let title = format!("'{name}' has separate messages");
        let evidence = format!("it is in {} of {all} messages; the joints are merged by name", all - missing);
        findings.add(Severity::Note, Area::Encoders, title, evidence, "");
    }
    let bad = readings().filter(|angle| !angle.is_finite()).count();
    if bad > 0 {
        let evidence = format!("{bad} readings");
        let remedy = "check the driver; these messages are dropped";
        findings.add(
            Severity::Warning,
            Area::Encoders,
            format!("readings of '{name}' are not finite"),
            evidence,
            remedy,
        );
    }
    let values: Vec<f64> = angles.iter().map(|(_, angle)| *angle).collect();
    if values.len() < 3 || exceeds_radians(&angles) {
        return None;
    }
    let (low, high) = (percentile(&values, 0.0), percentile(&values, 1.0));
    let (lower, upper) = joint.limits_rad;
    let sigma = gimbal.encoder_sigma_rad.unwrap_or(0.0);
    let degrees = f64::to_degrees;
    let range = format!(
        "{:+.1}° to {:+.1}°, limits {:+.1}° and {:+.1}°",
        degrees(low),
        degrees(high),
        degrees(lower),
        degrees(upper)
    );
    let margin = LIMIT_MARGIN_RAD + NOISE_SIGMAS * sigma;
    let turned = |angle: &f64| *angle - TAU * ((*angle - 0.5 * (lower + upper)) / TAU).round();
    let is_within = |angle: f64| (lower - margin..=upper + margin).contains(&angle);
    let has_turns = values.iter().all(|angle| is_within(turned(angle))) && !(is_within(low) && is_within(high));
    if has_turns {
        let title = format!("readings of '{name}' contain whole turns");
        let since = first_revolution_s(&angles).map_or_else(String::new, |at_s| format!("; a step at {at_s:.2} s"));
        let remedy = "the orientation is the same: nothing to do";
        findings.add(Severity::Note, Area::Encoders, title, format!("{range}{since}"), remedy);
    } else if low < lower - margin || high > upper + margin {
        let remedy = format!("correct gimbal.links[{number}].limits, or the encoder's zero");
        findings.add(Severity::Warning, Area::Encoders, format!("'{name}' exceeds its limits"), range.clone(), remedy);
    }
    let angles: Vec<(i64, f64)> =
        if has_turns { angles.iter().map(|(at, angle)| (*at, turned(angle))).collect() } else { angles };
    let values: Vec<f64> = angles.iter().map(|(_, angle)| *angle).collect();
    let white = white_sigma(&values, true);
    // The range without the noise of single readings.
    let [low, high] = MOTION_QUANTILES.map(|quantile| percentile(&values, quantile));
    let moved = high - low - NOISE_SIGMAS * white;
    if moved < MIN_RANGE_RAD {
        let title = format!("'{name}' hardly moves");
        let remedy = "its static parameters are unobservable without joint motion: record with the joint moving, or keep them fixed";
        findings.add(Severity::Warning, Area::Encoders, title, range, remedy);
    } else {
        findings.good(Area::Encoders, format!("'{name}' moves"), range);
    }
    let at_limit =
        angles.iter().filter(|(_, angle)| *angle < lower + AT_LIMIT_RAD || *angle > upper - AT_LIMIT_RAD).count();
    let ratio = at_limit as f64 / angles.len() as f64;
    if ratio > AT_LIMIT_RATIO && upper - lower < TAU - FREE_ROTATION_RAD {
        let first = angles.iter().find(|(_, angle)| *angle < lower + AT_LIMIT_RAD || *angle > upper - AT_LIMIT_RAD);
        let evidence = format!(
            "{:.0} % of the readings, the first at {:.1} s",
            ratio * 100.0,
            first.map_or(0.0, |(at, _)| seconds_from_ns(*at))
        );
        let remedy = "the camera is not stabilized there: expect faster image motion";
        findings.add(Severity::Note, Area::Encoders, format!("'{name}' reaches its limit"), evidence, remedy);
    }
    Some(white)
}

fn compare_sigma(name: &str, measured: f64, given: f64, findings: &mut Findings) {
    let ratio = measured / given;
    let evidence = format!("white noise {:.3}°, {:.3}° in the rig", measured.to_degrees(), given.to_degrees());
    if ratio > NOISE_TOO_SMALL {
        let remedy = format!("raise gimbal.encoder_sigma to {measured:.4}");
        let title = format!("encoder noise of '{name}' is {ratio:.1} times the rig's");
        findings.add(Severity::Warning, Area::Encoders, title, evidence, remedy);
    } else if ratio < NOISE_TOO_LARGE {
        let title = format!("encoder noise of '{name}' is below the rig's");
        let remedy = "the rig's value may cover slow errors such as backlash; otherwise lower gimbal.encoder_sigma";
        findings.add(Severity::Note, Area::Encoders, title, evidence, remedy);
    } else {
        findings.good(Area::Encoders, format!("encoder noise of '{name}' agrees with the rig"), evidence);
    }
}

/// Checks that the attitude is readable, that the joints can reach it, and that it determines their angles.
fn check_attitude(survey: &Survey, findings: &mut Findings) {
    if let Some(problem) = &survey.attitude_problem {
        let title = "the gimbal's attitude cannot be read";
        let remedy = "correct gimbal.source; its topics and types are in the table of topics";
        findings.add(Severity::Error, Area::Encoders, title, problem.clone(), remedy);
    }
    let Some(attitude) = &survey.attitude else { return };
    for warning in &attitude.warnings {
        let title = "the stamps of an attitude are of an unknown clock";
        findings.add(Severity::Warning, Area::Time, title, warning.clone(), "record with synchronized clocks");
    }
    let all = attitude.values.len();
    let solved = &survey.solved;
    if solved.len() < all {
        let evidence =
            format!("{} of {all} attitudes are too far in time from an attitude of the vehicle", all - solved.len());
        let remedy = format!(
            "record the vehicle's attitude at 10 Hz or more; gaps above {:.1} s are not interpolated",
            seconds_from_ns(MAX_VEHICLE_GAP_NS)
        );
        findings.add(Severity::Warning, Area::Encoders, "attitudes of the gimbal are not used", evidence, remedy);
    }
    if solved.is_empty() || !findings.can_compare(Measurement::Joints) {
        return;
    }
    let unreachable: Vec<f64> = solved.iter().map(|solved| solved.unreachable_rad).collect();
    let worst = solved.iter().max_by(|a, b| a.unreachable_rad.total_cmp(&b.unreachable_rad));
    let (worst_rad, worst_ns) = worst.map_or((0.0, 0), |worst| (worst.unreachable_rad, worst.reading.stamp_ns));
    let evidence = format!(
        "the nearest attitude of the joints within their limits differs by {:.2}° in the median, by at most {:.1}° at {:.1} s",
        median(&unreachable).to_degrees(),
        worst_rad.to_degrees(),
        seconds_from_ns(worst_ns)
    );
    let beyond = unreachable.iter().filter(|angle| **angle > UNREACHABLE_RAD).count();
    if beyond * UNREACHABLE_ONE_IN > solved.len() {
        let severity = if beyond * 2 > solved.len() { Severity::Error } else { Severity::Warning };
        let title = "the joints cannot reach the recorded attitude";
        let remedy = "check frame, axes, order and unit of gimbal.source, then links and limits";
        findings.add(severity, Area::Encoders, title, evidence, remedy);
    } else {
        findings.good(Area::Encoders, "the joints can reach the recorded attitude", evidence);
    }
    let undecided = solved.iter().filter(|solved| !solved.decided).count();
    if undecided * 2 > solved.len() {
        let title = "the limits of the joints admit two solutions";
        let evidence =
            format!("for {undecided} of {} attitudes; the one nearest to the previous is taken", solved.len());
        let remedy =
            "narrow the limits of gimbal.links to the mechanism's: a seek then need not read the log from its start";
        findings.add(Severity::Note, Area::Encoders, title, evidence, remedy);
    }
}

/// Compares the times of the first and the last joint angles with the times of the images.
pub(crate) fn check_joint_coverage(survey: &Survey, rig: &Rig, findings: &mut Findings) {
    if rig.gimbal.as_ref().is_none_or(|gimbal| gimbal.topic.is_none()) {
        return;
    }
    let Some(camera) = rig.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal) else { return };
    let images = survey.topics.get(&camera.topic).filter(|images| images.times.len() > 1);
    let Some(images) = images.filter(|images| !images.has_one_stamp()) else { return };
    let samples = &survey.joint_samples;
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return };
    let (first_image, last_image) = images.stamp_range();
    let [begin_s, end_s, from_s, to_s] = [first_image, last_image, first.stamp_ns, last.stamp_ns].map(seconds_from_ns);
    let (begin_s, end_s) = (begin_s + camera.timeshift_cam_imu_s, end_s + camera.timeshift_cam_imu_s);
    let missing = [("begin", from_s, from_s - begin_s), ("end", to_s, end_s - to_s)];
    for (what, at_s, missing_s) in missing.into_iter().filter(|(.., missing_s)| *missing_s > MISSING_TOLERANCE_S) {
        let ratio = missing_s / (end_s - begin_s);
        let title = format!("joint angles {what} at {at_s:.1} s");
        let evidence = format!(
            "images of {} from {begin_s:.1} s to {end_s:.1} s: {missing_s:.1} s ({:.0} %) without joint angles",
            camera.key,
            100.0 * ratio
        );
        let remedy = "record the joint angles over the whole flight, or use the images up to there (--start, --duration): \
                      without them the camera's orientation is estimated from its images alone";
        let severity = if ratio > USELESS_MISSING_RATIO { Severity::Error } else { Severity::Warning };
        findings.add(severity, Area::Encoders, title, evidence, remedy);
        if what == "begin" { findings.state_times(None, Some(at_s)) } else { findings.state_times(Some(at_s), None) }
    }
}
