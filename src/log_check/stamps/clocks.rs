//! Clocks of the topics: delays, drift, different clocks, and the time offsets of the rig.

use super::used_topics::UsedTopic;
use crate::files::rig::read::MAX_TIMESHIFT_S;
use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Severity};
use crate::log_check::statistics::{median, slope};
use crate::log_check::survey::topic_survey::{Times, TopicSurvey};

/// Difference of the latencies (log time minus stamp) from which topics count as stamped by different clocks.
const CLOCK_TOLERANCE_S: f64 = 0.2;
/// Smallest reported clock drift over the log.
const DRIFT_TOLERANCE_S: f64 = 0.005;
/// Smallest reported step of a clock, and the largest ratio of the scatter around it to that around a line.
const STEP_TOLERANCE_S: f64 = 0.01;
const STEP_RATIO: f64 = 0.5;
/// Smallest part of the messages on a side of a step as a fraction of all, and number of places that are tried.
const STEP_PARTS: usize = 10;
const STEP_PLACES: usize = 40;
/// Most messages of a topic that are used.
const STEP_POINTS: usize = 2000;
/// Smallest reported time by which a topic starts later or ends earlier than the IMU.
const OVERLAP_TOLERANCE_S: f64 = 1.0;
/// Larger time offsets of the rig are neither delays of a camera nor of a gimbal.
const LARGE_SHIFT_S: f64 = 0.1;
/// Largest delay of images: an offset from a whole number of seconds by less is one.
const LARGEST_DELAY_S: f64 = 0.3;
/// Difference of log times and stamps, in nanoseconds, within which they are equal.
const EQUAL_NS: i64 = 1000;
/// Time by which a stamp must be later than its log time to be in the future, in seconds.
const FUTURE_S: f64 = 1e-3;
/// Stamps in the future are reported above one in this many.
const FUTURE_ONE_IN: usize = 20;
/// Number of standard errors from which a drift is reported: latencies are correlated.
const DRIFT_SIGMAS: f64 = 6.0;
/// Leap seconds of TAI and of GPS time to UTC, since 2017.
const WHOLE_OFFSETS_S: [(f64, &str); 2] =
    [(-37.0, "its clock is in TAI, 37 s ahead of UTC"), (-18.0, "its clock is in GPS time, 18 s ahead of UTC")];

/// Checks the time bases of the topics in IMU time, by their log times; the time offsets of the rig are applied.
pub(super) fn check_clocks(used: &[UsedTopic<'_>], findings: &mut Findings) {
    let clocks = Clocks::of(used);
    for topic in used {
        check_drift(topic, findings);
    }
    for topic in used.iter().filter(|topic| !clocks.is_apart(topic)) {
        check_future(topic, findings);
    }
    compare_clocks(used, &clocks, findings);
    for topic in used.iter().filter(|topic| topic.shift_s.abs() > LARGE_SHIFT_S) {
        check_shift(used, topic, &clocks, findings);
    }
    check_overlap(used, findings);
}

/// Clock with which the others are compared.
struct Clocks {
    /// Median of log time minus stamp of the IMU in seconds, `None` without an IMU.
    imu_latency_s: Option<f64>,
}

impl Clocks {
    fn of(used: &[UsedTopic<'_>]) -> Self {
        Self { imu_latency_s: used.iter().find(|topic| topic.role == "imu0").map(latency_s) }
    }

    /// True for a topic that is stamped by another clock than the IMU, with the time offset of the rig.
    fn is_apart(&self, topic: &UsedTopic<'_>) -> bool {
        self.imu_latency_s.is_some_and(|imu_s| (latency_s(topic) - imu_s).abs() > CLOCK_TOLERANCE_S)
    }
}

/// True if the log times equal the header stamps, so that they say nothing about the clock of the stamps.
fn is_stamped_on_arrival(topic: &TopicSurvey) -> bool {
    topic.times.iter().all(|times| (times.log_time_ns - times.stamp_ns).abs() < EQUAL_NS)
}

/// Median of log time minus stamp in IMU time, in seconds; stamps that equal the log times are not shifted.
fn latency_s(used: &UsedTopic<'_>) -> f64 {
    let shift_s = if is_stamped_on_arrival(used.topic) { 0.0 } else { used.shift_s };
    used.topic.median_latency_s() - shift_s
}

fn check_future(used: &UsedTopic<'_>, findings: &mut Findings) {
    // Small time offsets are caused by the exposure or by filters.
    let of_clock = used.shift_s.abs() > CLOCK_TOLERANCE_S;
    let shift_s = if of_clock { latency_s(used) - used.topic.median_latency_s() } else { 0.0 };
    let role = &used.role;
    let latencies: Vec<f64> =
        used.topic.times.iter().map(|times| seconds_from_ns(times.log_time_ns - times.stamp_ns) + shift_s).collect();
    let early = latencies.iter().filter(|latency| **latency < -FUTURE_S).count();
    if early * FUTURE_ONE_IN > latencies.len() {
        let evidence = format!(
            "{early} of {} messages were logged before their stamp, the median by {:.3} s",
            latencies.len(),
            -median(&latencies)
        );
        let remedy =
            "the sensor's clock runs ahead of the recorder's: synchronize them (PTP, chrony), or expect a time offset";
        findings.add(Severity::Warning, Area::Time, format!("stamps of {role} are in the future"), evidence, remedy);
        findings.mark_symptom();
    }
}

fn check_drift(used: &UsedTopic<'_>, findings: &mut Findings) {
    let point = |times: &Times| (seconds_from_ns(times.stamp_ns), seconds_from_ns(times.log_time_ns - times.stamp_ns));
    let points: Vec<(f64, f64)> = used.topic.times.iter().map(point).collect();
    if let Some(Step { at_s, step_s, scatter_s }) = Step::of(&points) {
        let evidence = format!(
            "log time minus stamp changes by {:+.1} ms there, and scatters by {:.1} ms on both sides",
            step_s * 1e3,
            scatter_s * 1e3
        );
        let side = if step_s > 0.0 { "earlier" } else { "later" };
        let title = format!("stamps of {} are {:.0} ms {side} from {at_s:.1} s on", used.role, step_s.abs() * 1e3);
        let remedy = "look for a lost or repeated message that shifted the matching of stamps, or a clock that was set";
        findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
        return findings.state_times(Some(at_s), None);
    }
    let (drift, error) = slope(&points);
    let length_s = points.last().map_or(0.0, |last| last.0) - points.first().map_or(0.0, |first| first.0);
    if (drift * length_s).abs() > DRIFT_TOLERANCE_S && drift.abs() > DRIFT_SIGMAS * error {
        let evidence = format!(
            "log time minus stamp changes by {:.1} ms over {length_s:.1} s ({:.0} ppm ± {:.0})",
            drift * length_s * 1e3,
            drift * 1e6,
            error * 1e6
        );
        let remedy = "two clocks are involved: synchronize them, or stamp all sensors with one";
        let title = format!("the clock of {} drifts", used.role);
        findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
    }
}

/// Step of log times less stamps.
struct Step {
    at_s: f64,
    step_s: f64,
    /// Mean distance from the medians on both sides.
    scatter_s: f64,
}

impl Step {
    /// Step between two constant parts of points (stamp, log time less stamp), in seconds; `None` if a line or a constant
    /// explains them as well.
    fn of(points: &[(f64, f64)]) -> Option<Self> {
        let stride = points.len().div_ceil(STEP_POINTS).max(1);
        let mut points: Vec<(f64, f64)> = points.iter().copied().step_by(stride).collect();
        points.sort_by(|one, other| one.0.total_cmp(&other.0));
        let split = |at: usize| {
            let (before, after) = points.split_at(at);
            let both = [before, after].map(middle);
            let left = scatter(before, both[0]) * before.len() as f64 + scatter(after, both[1]) * after.len() as f64;
            (left / points.len() as f64, at, both)
        };
        let smallest = STEP_PARTS.max(points.len() / STEP_PARTS);
        let places = (smallest..points.len().saturating_sub(smallest)).step_by((points.len() / STEP_PLACES).max(1));
        let (_, coarse, _) = places.map(split).min_by(|one, other| one.0.total_cmp(&other.0))?;
        let near = coarse.saturating_sub(points.len() / STEP_PLACES)..=(coarse + points.len() / STEP_PLACES);
        let inside = near.filter(|at| (smallest..points.len() - smallest).contains(at));
        let (scatter_s, at, [before, after]) = inside.map(split).min_by(|one, other| one.0.total_cmp(&other.0))?;
        let (drift, _) = slope(&points);
        let start_s = points[0].0;
        let along: Vec<(f64, f64)> =
            points.iter().map(|(at_s, late_s)| (*at_s, late_s - drift * (at_s - start_s))).collect();
        let by_line_s = scatter(&along, middle(&along));
        let step_s = after - before;
        (step_s.abs() > STEP_TOLERANCE_S.max(DRIFT_SIGMAS * scatter_s) && scatter_s < STEP_RATIO * by_line_s)
            .then(|| Self { at_s: points[at].0, step_s, scatter_s })
    }
}

fn middle(points: &[(f64, f64)]) -> f64 {
    median(&points.iter().map(|(_, late_s)| *late_s).collect::<Vec<_>>())
}

/// Mean distance from a middle.
fn scatter(points: &[(f64, f64)], middle_s: f64) -> f64 {
    points.iter().map(|(_, late_s)| (late_s - middle_s).abs()).sum::<f64>() / points.len().max(1) as f64
}

fn compare_clocks(used: &[UsedTopic<'_>], clocks: &Clocks, findings: &mut Findings) {
    let Some(imu_s) = clocks.imu_latency_s else { return };
    let listed: Vec<String> =
        used.iter().map(|topic| format!("{} {:.1} ms", topic.role, latency_s(topic) * 1e3)).collect();
    let shifted = used.iter().any(|topic| topic.shift_s != 0.0);
    let stamp = if shifted { "stamp, with the time offsets of the rig" } else { "stamp" };
    let evidence = format!("median of log time minus {stamp}: {}", listed.join(", "));
    let apart: Vec<&UsedTopic<'_>> = used.iter().filter(|topic| clocks.is_apart(topic)).collect();
    if !apart.is_empty() {
        let roles: Vec<&str> = apart.iter().map(|topic| topic.role.as_str()).collect();
        let title = format!("{} and imu0 are stamped by different clocks", roles.join(", "));
        let settings: Vec<String> = apart.iter().filter_map(|topic| shift_to_set(topic, imu_s)).collect();
        let remedy = match settings.as_slice() {
            [] => "stamp all sensors with one clock".to_owned(),
            settings => format!("stamp all sensors with one clock, or set {}", settings.join(", ")),
        };
        return findings.add(Severity::Error, Area::Time, title, evidence, remedy);
    }
    if used.len() > 1 && used.iter().all(|topic| is_stamped_on_arrival(topic.topic)) {
        let remedy = "if the driver stamps on arrival, calibrate timeshift_cam_imu; a converted log is fine";
        let title = "log times equal the header stamps: arrival times are unknown";
        return findings.add(Severity::Note, Area::Time, title, evidence, remedy);
    }
    if used.len() > 1 {
        findings.good(Area::Time, "all sensors appear to be stamped by one clock", evidence);
    }
}

/// Time offset that brings the stamps of a topic to the clock of the IMU, as an entry of the rig. Delays of the messages
/// are not known: the offset is a whole number of seconds if one lies within the usual delays.
fn shift_to_set(used: &UsedTopic<'_>, imu_latency_s: f64) -> Option<String> {
    let field = used.shift_field()?;
    let offset_s = used.topic.median_latency_s() - imu_latency_s;
    if used.shift_key == Some("timeshift_gimbal_imu") && offset_s.abs() > MAX_TIMESHIFT_S {
        return None;
    }
    let whole_s = offset_s.round();
    let known = WHOLE_OFFSETS_S.iter().find(|(known_s, _)| (known_s - whole_s).abs() < 0.5);
    if (offset_s - whole_s).abs() > LARGEST_DELAY_S || whole_s == 0.0 {
        return Some(format!("{field}: {offset_s:.2} (with the delay of its messages, which check then measures)"));
    }
    Some(known.map_or_else(|| format!("{field}: {whole_s:.1}"), |(_, name)| format!("{field}: {whole_s:.1} ({name})")))
}

/// Reports a large time offset of the rig, unless log times or the times of the IMU confirm it.
fn check_shift(used: &[UsedTopic<'_>], shifted: &UsedTopic<'_>, clocks: &Clocks, findings: &mut Findings) {
    let Some(field) = shifted.shift_field() else { return };
    let shift_s = shifted.shift_s;
    // The error about the clocks says what to set.
    if clocks.is_apart(shifted) {
        return;
    }
    let latency_s = shifted.topic.median_latency_s();
    if !is_stamped_on_arrival(shifted.topic)
        && clocks.imu_latency_s.is_some_and(|imu_s| (latency_s - imu_s).abs() > CLOCK_TOLERANCE_S)
    {
        let evidence = format!("{shift_s:+.3} s; log time minus stamp is {latency_s:+.3} s without it");
        return findings.good(Area::Time, format!("the log times confirm {field}"), evidence);
    }
    let (first_s, last_s) = shifted.range_s();
    let overlaps = |(first_s, last_s): (f64, f64), imu: (f64, f64)| first_s < imu.1 && last_s > imu.0;
    if let Some(imu) = used.iter().find(|topic| topic.role == "imu0").map(UsedTopic::range_s)
        && overlaps((first_s, last_s), imu)
        && !overlaps((first_s - shift_s, last_s - shift_s), imu)
    {
        let evidence = format!("{shift_s:+.3} s; without it no stamp lies within the time of the IMU");
        return findings.good(Area::Time, format!("the times of the IMU confirm {field}"), evidence);
    }
    if shifted.of_images {
        let evidence = format!("{shift_s:+.4} s, t_imu = t_cam + shift");
        let remedy = "check its sign and unit (seconds); preferably stamp images at mid-exposure";
        findings.add(Severity::Warning, Area::Time, format!("{field} is large"), evidence, remedy);
    }
}

fn check_overlap(used: &[UsedTopic<'_>], findings: &mut Findings) {
    let Some(imu) = used.iter().find(|topic| topic.role == "imu0") else { return };
    let (imu_first_s, imu_last_s) = imu.range_s();
    for topic in used.iter().filter(|topic| topic.role != "imu0") {
        let (first_s, last_s) = topic.range_s();
        let (late_s, early_s) = (first_s - imu_first_s, imu_last_s - last_s);
        let outside_s = (-late_s).max(-early_s);
        let role = &topic.role;
        let evidence = format!(
            "{role} from {first_s:.3} to {last_s:.3} s, the IMU from {imu_first_s:.3} to {imu_last_s:.3} s{}",
            if topic.shift_s == 0.0 { "" } else { ", with the time offset of the rig" }
        );
        if outside_s > OVERLAP_TOLERANCE_S && topic.of_images {
            let title = format!("{role} extends beyond the IMU samples");
            findings.add(Severity::Warning, Area::Time, title, evidence, "images without IMU samples are not used");
        } else if late_s.max(early_s) > OVERLAP_TOLERANCE_S {
            let title = format!("{role} covers only part of the log");
            findings.add(Severity::Note, Area::Time, title, evidence, "");
        }
    }
}
