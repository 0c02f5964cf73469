//! Order, rate, gaps and jitter of the stamps of each topic.

mod clocks;
pub(super) mod copies;
mod grid;
mod publishers;
mod used_topics;

use self::clocks::check_clocks;
use self::copies::check_copies;
use self::grid::tick_s;
use self::publishers::has_two_publishers;
use self::used_topics::{UsedTopic, used_topics};
use super::report::{Area, Findings, Severity};
use super::statistics::percentile;
use super::survey::Survey;
use super::survey::held::Held;
use crate::flight_log::stamps::spacing::Spacing;
use crate::flight_log::stream::ordered::HORIZON_NS;
use crate::geometry::seconds_from_ns;
use crate::sensors::Rig;

/// Smallest reported relative difference from the rig's rate.
const RATE_TOLERANCE: f64 = 0.05;
/// Smallest reported jitter of the stamps, as a ratio of the period.
const JITTER_TOLERANCE: f64 = 0.2;
/// Jitter that is a warning, as a ratio of the period.
const LARGE_JITTER: f64 = 0.5;
/// Quantile of the differences from the period that is the jitter.
const JITTER_QUANTILE: f64 = 0.95;
/// Ratio of missing messages that is a warning.
const MISSING_TOLERANCE: f64 = 0.01;
/// Gap that is a warning, in seconds.
const LONG_GAP_S: f64 = 0.5;
/// Lowest usual rate of an IMU.
const SLOWEST_IMU_HZ: f64 = 100.0;
/// Lowest usual rate of a camera.
const SLOWEST_CAMERA_HZ: f64 = 5.0;
/// Ratio of the lowest rate below which a sensor is slow: clocks and losses change a rate by less.
const SLOW_RATIO: f64 = 0.95;

/// Checks rates, gaps, order and time bases of every topic that the rig names.
pub(super) fn check_timing(survey: &Survey, rig: Option<&Rig>, findings: &mut Findings) {
    let mut used = used_topics(survey, rig);
    used.retain(|used| {
        let unset = used.topic.has_one_stamp();
        if unset {
            report_unset(used, findings);
        }
        !unset
    });
    let mut regular = Vec::new();
    used.retain(|used| {
        let stamps = used.topic.times.iter().map(|times| times.stamp_ns);
        let spacing = Spacing::of(stamps, used.nominal_hz);
        let before = findings.list.len();
        check_copies(used, findings);
        // Order, steps and clock of two senders together say nothing about either.
        let single = !has_two_publishers(used, &spacing, &survey.imu, findings);
        if single {
            check_stamps(used, &spacing, findings);
        }
        if findings.list.len() == before && spacing.period_s > 0.0 {
            regular.push(format!("{} {:.1} Hz", used.role, 1.0 / spacing.period_s));
        }
        single
    });
    if !regular.is_empty() {
        findings.good(Area::Time, "stamps are in order, without gaps, at the rate of the rig", regular.join(", "));
    }
    check_clocks(&used, findings);
}

/// Checks order, gaps, jitter and rate of a topic.
fn check_stamps(used: &UsedTopic<'_>, spacing: &Spacing, findings: &mut Findings) {
    let role = used.role.as_str();
    check_order(used, findings);
    check_held(used, findings);
    check_gaps(role, spacing, used.of_images, findings);
    if let Some(tick_s) = tick_s(spacing) {
        return report_grid(used, spacing, tick_s, findings);
    }
    check_jitter(role, spacing, findings);
    check_rate(role, spacing.period_s, used.nominal_hz, findings);
}

/// Reports a topic whose stamps are all equal.
fn report_unset(used: &UsedTopic<'_>, findings: &mut Findings) {
    const DRIVER: &str = "set header.stamp to the time of measurement in the driver";
    let log_times = || used.topic.times.iter().map(|times| seconds_from_ns(times.log_time_ns));
    let (first_s, last_s) = (log_times().fold(f64::INFINITY, f64::min), log_times().fold(f64::NEG_INFINITY, f64::max));
    let count = used.topic.times.len();
    let evidence = format!("{count} messages, which were logged from {first_s:.3} to {last_s:.3} s");
    let remedy = if used.can_use_log_time && last_s > first_s {
        format!(
            "for this recording set {}.use_log_time: true in the rig: log times are arrival times, so expect a delay, which \
             check then measures; for the next one {DRIVER}",
            used.role.replace(' ', "_")
        )
    } else {
        format!("{DRIVER}; without stamps the topic has no times")
    };
    findings.add(Severity::Error, Area::Time, format!("all stamps of {} are equal", used.role), evidence, remedy);
}

/// Checks the order of the messages by their stamps; copies of earlier messages do not count.
fn check_order(used: &UsedTopic<'_>, findings: &mut Findings) {
    let stamps_ns = used.topic.stamps_without_duplicates();
    let steps: Vec<f64> = stamps_ns.windows(2).map(|pair| seconds_from_ns(pair[1] - pair[0])).collect();
    let backwards: Vec<usize> = (0..steps.len()).filter(|index| steps[*index] < 0.0).collect();
    let Some(first) = backwards.first() else { return };
    let deepest = steps.iter().copied().fold(0.0, f64::min);
    let evidence = format!(
        "{} of {} steps are negative, the first after {:.3} s, the largest {:.3} s",
        backwards.len(),
        steps.len(),
        seconds_from_ns(stamps_ns[*first]),
        -deepest
    );
    let (severity, title, remedy) = if deepest < -seconds_from_ns(HORIZON_NS) {
        let title = format!("stamps of {} run backwards", used.role);
        (Severity::Error, title, "check how the driver stamps; samples up to 0.1 s late are sorted, others are dropped")
    } else {
        let title = format!("messages of {} are out of order", used.role);
        (Severity::Warning, title, "record them in the order of their stamps; nothing is missing: a run sorts them")
    };
    findings.add(severity, Area::Time, title, evidence, remedy);
    findings.state_interval(backwards.iter().map(|index| stamps_ns[*index]));
}

/// Reports steps between stamps in which messages are missing.
fn check_gaps(role: &str, spacing: &Spacing, of_images: bool, findings: &mut Findings) {
    let (steps, period) = (&spacing.steps_s, spacing.period_s);
    let limit = spacing.longest_s(of_images);
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
    let severity = if lost > MISSING_TOLERANCE * received || steps[longest] > LONG_GAP_S {
        Severity::Warning
    } else {
        Severity::Note
    };
    let remedy = "record with less load or a larger buffer; over a gap the IMU is interpolated and features are lost";
    findings.add(severity, Area::Time, format!("{role} has gaps"), evidence, remedy);
    let ends = |index: &usize| spacing.start_s(*index) + steps[*index];
    findings.state_times(gaps.first().map(|first| spacing.start_s(*first)), gaps.last().map(ends));
}

/// Reports attitudes of the vehicle and ground truth that hold the content of the message before.
fn check_held(used: &UsedTopic<'_>, findings: &mut Findings) {
    let (area, name) = match used.role.as_str() {
        "vehicle" => (Area::Encoders, "the vehicle's attitude"),
        "ground truth" => (Area::Log, "the ground truth"),
        _ => return,
    };
    if let Some(held) = Held::of(&used.topic.contents()) {
        held.report(area, name, "holds its", findings);
    }
}

/// Reports stamps that are rounded to multiples of a time.
fn report_grid(used: &UsedTopic<'_>, spacing: &Spacing, tick_s: f64, findings: &mut Findings) {
    let role = &used.role;
    let mean_s = spacing.steps_s.iter().sum::<f64>() / spacing.steps_s.len() as f64;
    let [shortest_s, longest_s] = [0.1, 0.9].map(|quantile| percentile(&spacing.steps_s, quantile));
    let title = format!("stamps of {role} are rounded to multiples of {:.1} ms", tick_s * 1e3);
    let evidence = format!(
        "steps of {:.1} to {:.1} ms, multiples of {:.3} ms, where the mean step is {:.1} ms: errors up to {:.1} ms",
        shortest_s * 1e3,
        longest_s * 1e3,
        tick_s * 1e3,
        mean_s * 1e3,
        tick_s * 1e3
    );
    let remedy = "stamp in the driver with a clock that counts microseconds, from the sensor's own clock or trigger";
    findings.add(Severity::Warning, Area::Time, title, evidence, remedy);
    check_rate(role, mean_s, used.nominal_hz, findings);
    if used.of_images {
        findings.exclude_camera(role);
    }
}

/// Reports stamps that are taken on arrival: batches, or steps that scatter.
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
    let jitter = percentile(&scatter, JITTER_QUANTILE);
    if period > 0.0 && jitter > JITTER_TOLERANCE * period {
        let evidence =
            format!("5 % of the steps differ from {:.3} ms by more than {:.3} ms", period * 1e3, jitter * 1e3);
        let severity = if jitter > LARGE_JITTER * period { Severity::Warning } else { Severity::Note };
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
        // Only the noise of the IMU depends on the rate in the rig.
        let (severity, remedy) = if role == "imu0" {
            let remedy = "set imu0.update_rate; where noise is given per sample, convert it with the true rate";
            (Severity::Warning, remedy.to_owned())
        } else {
            (Severity::Note, format!("set {role}.update_rate"))
        };
        findings.add(severity, Area::Time, format!("the rate of {role} differs from the rig"), evidence, remedy);
    }
    let slowest_hz = match role {
        "imu0" => SLOWEST_IMU_HZ,
        _ if role.starts_with("cam") => SLOWEST_CAMERA_HZ,
        _ => return,
    };
    if measured_hz < SLOW_RATIO * slowest_hz {
        let evidence = format!("{measured_hz:.1} Hz, usually at least {slowest_hz:.0} Hz");
        let remedy = "record at a higher rate: motion between samples is assumed smooth";
        findings.add(Severity::Warning, Area::Time, format!("{role} is slow"), evidence, remedy);
    }
}
