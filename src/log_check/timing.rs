use super::spacing::Spacing;
use super::statistics::{median, percentile, slope};
use super::survey::{Survey, TopicSurvey};
use super::{Area, Findings, Severity};
use crate::geometry::seconds_from_ns;
use crate::sensors::{AttitudeMessage, GimbalRig, Rig};

/// Smallest reported relative difference from the rig's rate.
const RATE_TOLERANCE: f64 = 0.05;
/// Smallest reported jitter of the stamps, as a ratio of the period.
const JITTER_TOLERANCE: f64 = 0.2;
/// Difference of the latencies (log time minus header stamp) from which topics count as stamped by different clocks.
const CLOCK_TOLERANCE_S: f64 = 0.2;
/// Smallest reported clock drift over the log.
const DRIFT_TOLERANCE_S: f64 = 0.005;
/// Smallest reported time by which a topic starts later or ends earlier than the IMU.
const OVERLAP_TOLERANCE_S: f64 = 1.0;

/// Checks rates, gaps, order and time bases of every topic that the rig names.
pub(super) fn check_timing(survey: &Survey, rig: Option<&Rig>, findings: &mut Findings) {
    let mut used = used_topics(survey, rig);
    used.retain(|(role, topic, ..)| {
        let unset = topic.has_one_stamp();
        if unset {
            let evidence = format!("{} messages", topic.times.len());
            let remedy =
                "set header.stamp to the time of measurement in the driver; without stamps the topic has no times";
            findings.add(Severity::Error, Area::Time, format!("all stamps of {role} are equal"), evidence, remedy);
        }
        !unset
    });
    let mut regular = Vec::new();
    for (role, topic, nominal_hz, sparse) in &used {
        let before = findings.list.len();
        let spacing = Spacing::of(topic, *nominal_hz);
        check_order(role, topic, findings);
        check_gaps(role, &spacing, *sparse, findings);
        check_jitter(role, &spacing, findings);
        check_rate(role, spacing.period_s, *nominal_hz, findings);
        check_latency(role, topic, findings);
        if findings.list.len() == before && spacing.period_s > 0.0 {
            regular.push(format!("{role} {:.1} Hz", 1.0 / spacing.period_s));
        }
    }
    if !regular.is_empty() {
        findings.good(Area::Time, "stamps are in order, without gaps, at the rate of the rig", regular.join(", "));
    }
    check_clocks(&used, findings);
    check_overlap(&used, findings);
}

/// Role, times, the rig's rate in Hz, and true if one lost message counts as a gap (images).
type Used<'a> = (String, &'a TopicSurvey, Option<f64>, bool);

fn used_topics<'a>(survey: &'a Survey, rig: Option<&Rig>) -> Vec<Used<'a>> {
    let mut used: Vec<Used<'a>> = Vec::new();
    let mut add = |role: String, topic: Option<&str>, nominal_hz: Option<f64>, sparse: bool| {
        if let Some(topic) = topic.and_then(|topic| survey.topics.get(topic)).filter(|topic| topic.times.len() > 2) {
            used.push((role, topic, nominal_hz, sparse));
        }
    };
    add("imu0".into(), survey.imu_topic.as_deref(), rig.map(|rig| rig.imu.rate_hz), false);
    let Some(rig) = rig else { return used };
    for camera in &rig.cameras {
        add(camera.key.clone(), Some(&camera.topic), Some(camera.rate_hz), true);
    }
    // Transforms of other frames are interleaved with those of the gimbal.
    let of_one_kind = |gimbal: &&GimbalRig| {
        let message = gimbal.attitude.as_ref().map(|source| &source.message);
        !matches!(message, Some(AttitudeMessage::Transforms { .. }))
    };
    if let Some(gimbal) = rig.gimbal.as_ref().filter(of_one_kind) {
        add("gimbal".into(), gimbal.topic.as_deref(), Some(gimbal.rate_hz), false);
    }
    add("vehicle".into(), rig.vehicle_topic(), None, false);
    add("ground truth".into(), rig.ground_truth_topic.as_deref(), None, false);
    used
}

/// Checks the order of the messages by their stamps, and equal stamps.
fn check_order(role: &str, topic: &TopicSurvey, findings: &mut Findings) {
    let steps: Vec<f64> =
        topic.times.windows(2).map(|pair| seconds_from_ns(pair[1].stamp_ns - pair[0].stamp_ns)).collect();
    let backwards: Vec<usize> = (0..steps.len()).filter(|index| steps[*index] < 0.0).collect();
    if let Some(first) = backwards.first() {
        let deepest = steps.iter().copied().fold(0.0, f64::min);
        let evidence = format!(
            "{} of {} steps are negative, the first after {:.3} s, the largest {:.3} s",
            backwards.len(),
            steps.len(),
            seconds_from_ns(topic.times[*first].stamp_ns),
            -deepest
        );
        let severity =
            if deepest < -0.1 || backwards.len() * 100 > steps.len() { Severity::Error } else { Severity::Warning };
        let remedy = "check how the driver stamps; samples up to 0.1 s late are sorted, others are dropped";
        findings.add(severity, Area::Time, format!("stamps of {role} run backwards"), evidence, remedy);
    }
    let repeats = steps.iter().filter(|step| **step == 0.0).count();
    if repeats > 0 {
        let evidence = format!("{repeats} of {} stamps equal the previous one", steps.len());
        let remedy = "the driver or a relay sends messages twice, or stamps a batch once; repeats are dropped";
        findings.add(Severity::Warning, Area::Time, format!("stamps of {role} repeat"), evidence, remedy);
    }
}

/// Reports steps between stamps in which messages are missing.
fn check_gaps(role: &str, spacing: &Spacing, sparse: bool, findings: &mut Findings) {
    let (steps, period) = (&spacing.steps_s, spacing.period_s);
    let limit = spacing.longest_s(if sparse { 1.75 } else { 2.5 });
    let gaps: Vec<usize> = (0..steps.len()).filter(|index| period > 0.0 && steps[*index] > limit).collect();
    let Some(longest) = gaps.iter().copied().max_by(|a, b| steps[*a].total_cmp(&steps[*b])) else { return };
    let lost: f64 = gaps.iter().map(|index| (steps[*index] / period).round() - 1.0).sum();
    let received = steps.len() as f64 + 1.0;
    let evidence = format!(
        "{} gaps, the longest {:.3} s after {:.3} s; about {lost:.0} of {} messages are missing",
        gaps.len(),
        steps[longest],
        spacing.start_s(longest),
        lost + received
    );
    let severity = if lost > 0.01 * received || steps[longest] > 0.5 { Severity::Warning } else { Severity::Note };
    let remedy = "record with less load or a larger buffer; over a gap the IMU is interpolated and features are lost";
    findings.add(severity, Area::Time, format!("{role} has gaps"), evidence, remedy);
}

/// Reports stamps that are those of the arrival: batches, or steps that scatter.
fn check_jitter(role: &str, spacing: &Spacing, findings: &mut Findings) {
    if let Some(batches) = &spacing.batches {
        let evidence = format!(
            "{} batches of {:.0}, {:.3} ms apart, with pauses of {:.1} ms; {:.1} Hz by first stamp, last stamp and count: \
             the pauses miss no messages",
            batches.count,
            batches.size,
            batches.inner_s * 1e3,
            batches.pause_s * 1e3,
            1.0 / spacing.period_s
        );
        let title = format!("{role} is stamped on arrival, in batches");
        let remedy = "stamp each measurement in the driver, from the sensor's own clock or trigger";
        return findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
    }
    let period = spacing.period_s;
    let scatter: Vec<f64> = spacing.steps_s.iter().map(|step| (step - period).abs()).collect();
    let jitter = percentile(&scatter, 0.95);
    if period > 0.0 && jitter > JITTER_TOLERANCE * period {
        let evidence =
            format!("5 % of the steps differ from {:.3} ms by more than {:.3} ms", period * 1e3, jitter * 1e3);
        let severity = if jitter > 0.5 * period { Severity::Warning } else { Severity::Note };
        let remedy = "these appear to be arrival times: stamp in the driver, from the sensor's own clock or trigger";
        findings.add(severity, Area::Time, format!("stamps of {role} jitter"), evidence, remedy);
    }
}

fn check_rate(role: &str, period_s: f64, nominal_hz: Option<f64>, findings: &mut Findings) {
    if period_s <= 0.0 {
        return; // stamps that repeat or run backwards are reported as such
    }
    let measured_hz = 1.0 / period_s;
    if let Some(nominal_hz) = nominal_hz.filter(|rate| *rate > 0.0)
        && (measured_hz / nominal_hz - 1.0).abs() > RATE_TOLERANCE
    {
        let evidence = format!("{measured_hz:.1} Hz measured, {nominal_hz:.1} Hz in the rig");
        let remedy = format!("set {role}.update_rate; where noise is given per sample, convert it with the true rate");
        findings.add(
            Severity::Warning,
            Area::Time,
            format!("the rate of {role} differs from the rig"),
            evidence,
            remedy,
        );
    }
    let slowest_hz = match role {
        "imu0" => 100.0,
        _ if role.starts_with("cam") => 5.0,
        _ => return,
    };
    if measured_hz < 0.95 * slowest_hz {
        let evidence = format!("{measured_hz:.1} Hz, usually at least {slowest_hz:.0} Hz");
        let remedy = "record at a higher rate: motion between samples is assumed smooth";
        findings.add(Severity::Warning, Area::Time, format!("{role} is slow"), evidence, remedy);
    }
}

fn check_latency(role: &str, topic: &TopicSurvey, findings: &mut Findings) {
    let points: Vec<(f64, f64)> = topic
        .times
        .iter()
        .map(|times| (seconds_from_ns(times.stamp_ns), seconds_from_ns(times.log_time_ns - times.stamp_ns)))
        .collect();
    let latencies: Vec<f64> = points.iter().map(|point| point.1).collect();
    let early = latencies.iter().filter(|latency| **latency < -1e-3).count();
    if early * 20 > latencies.len() {
        let evidence = format!(
            "{early} of {} messages were logged before their stamp, the median by {:.3} s",
            latencies.len(),
            -median(&latencies)
        );
        let remedy =
            "the sensor's clock runs ahead of the recorder's: synchronize them (PTP, chrony), or expect a time offset";
        findings.add(Severity::Warning, Area::Time, format!("stamps of {role} are in the future"), evidence, remedy);
    }
    let (drift, error) = slope(&points);
    let length_s = points.last().map_or(0.0, |last| last.0) - points.first().map_or(0.0, |first| first.0);
    if (drift * length_s).abs() > DRIFT_TOLERANCE_S && drift.abs() > 6.0 * error {
        let evidence = format!(
            "log time minus stamp changes by {:.1} ms over {length_s:.1} s ({:.0} ppm ± {:.0})",
            drift * length_s * 1e3,
            drift * 1e6,
            error * 1e6
        );
        let remedy = "two clocks are involved: synchronize them, or stamp all sensors with one";
        findings.add(Severity::Warning, Area::Time, format!("the clock of {role} drifts"), evidence, remedy);
    }
}

fn check_clocks(used: &[Used<'_>], findings: &mut Findings) {
    let latencies: Vec<(&str, f64)> =
        used.iter().map(|(role, topic, _, _)| (role.as_str(), topic.median_latency_s())).collect();
    let Some((_, reference)) = latencies.first().copied() else { return };
    let listed: Vec<String> =
        latencies.iter().map(|(role, latency)| format!("{role} {:.1} ms", latency * 1e3)).collect();
    let evidence = format!("median of log time minus stamp: {}", listed.join(", "));
    let apart: Vec<&str> = latencies
        .iter()
        .filter(|(_, latency)| (latency - reference).abs() > CLOCK_TOLERANCE_S)
        .map(|(role, _)| *role)
        .collect();
    if !apart.is_empty() {
        let title = format!("{} and imu0 are stamped by different clocks", apart.join(", "));
        let remedy = "stamp all sensors with one clock, or set timeshift_cam_imu";
        return findings.add(Severity::Error, Area::Time, title, evidence, remedy);
    }
    let arrival =
        |topic: &TopicSurvey| topic.times.iter().all(|times| (times.log_time_ns - times.stamp_ns).abs() < 1000);
    if used.len() > 1 && used.iter().all(|(_, topic, _, _)| arrival(topic)) {
        let remedy = "if the driver stamps on arrival, calibrate timeshift_cam_imu; a converted log is fine";
        let title = "log times equal the header stamps: arrival times are unknown";
        return findings.add(Severity::Note, Area::Time, title, evidence, remedy);
    }
    if used.len() > 1 {
        findings.good(Area::Time, "all sensors appear to be stamped by one clock", evidence);
    }
}

fn check_overlap(used: &[Used<'_>], findings: &mut Findings) {
    let Some((_, imu, _, _)) = used.iter().find(|(role, ..)| role == "imu0") else { return };
    let (imu_first, imu_last) = imu.stamp_range();
    for (role, topic, _, _) in used.iter().filter(|(role, ..)| role != "imu0") {
        let (first, last) = topic.stamp_range();
        let (late_s, early_s) = (seconds_from_ns(first - imu_first), seconds_from_ns(imu_last - last));
        let outside_s = (-late_s).max(-early_s);
        let evidence = format!(
            "{role} from {:.3} to {:.3} s, the IMU from {:.3} to {:.3} s",
            seconds_from_ns(first),
            seconds_from_ns(last),
            seconds_from_ns(imu_first),
            seconds_from_ns(imu_last)
        );
        if outside_s > OVERLAP_TOLERANCE_S && role.starts_with("cam") {
            let title = format!("{role} extends beyond the IMU samples");
            findings.add(Severity::Warning, Area::Time, title, evidence, "images without IMU samples are not used");
        } else if late_s.max(early_s) > OVERLAP_TOLERANCE_S {
            let title = format!("{role} covers only part of the log");
            findings.add(Severity::Note, Area::Time, title, evidence, "");
        }
    }
}
