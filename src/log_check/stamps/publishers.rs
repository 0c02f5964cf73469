//! Two publishers on one topic.

use super::used_topics::UsedTopic;
use crate::faults::FaultKind;
use crate::flight_log::stamps::spacing::Spacing;
use crate::geometry::seconds_from_ns;
use crate::log_check::report::{Area, Findings, Measurement, Severity};
use crate::log_check::statistics::{median, middle_range};
use crate::log_check::survey::topic_survey::TopicSurvey;
use crate::sensors::ImuSample;

/// Smallest ratio of a publisher among the messages.
const MIN_SHARE: f64 = 0.05;
/// Smallest ratio of each of two sequences of stamps.
const MIN_SEQUENCE: f64 = 0.3;
/// Smallest ratio of the rate to the rate in the rig at which two publishers can share a topic.
const DOUBLE_RATE: f64 = 1.7;
/// Largest ratio of the rate to the rate in the rig at which two publishers can share a topic.
const TRIPLE_RATE: f64 = 2.6;
/// Smallest ratio of the shorter of two alternating steps to the mean step.
const MIN_STEP: f64 = 0.15;
/// Smallest ratio of the change to the next sample to the change to the next but one, for samples of two IMUs in turn.
const ALTERNATING: f64 = 2.5;
/// Smallest difference of two alternating steps, as a ratio of the mean step.
const MIN_DIFFERENCE: f64 = 0.3;
/// Largest range of the middle 80 % of equal steps, as a ratio of the difference of alternating ones.
const LARGEST_SPREAD: f64 = 0.5;
/// Stamps of two sequences run backwards in at least one of this many messages.
const BACKWARDS_ONE_IN: usize = 10;
/// Messages that belong to neither sequence are at most one in this many.
const OTHERS_ONE_IN: usize = 50;

/// Reports the topic of a sensor on which two publishers send in turn.
pub(super) fn has_two_publishers(
    used: &UsedTopic<'_>,
    spacing: &Spacing,
    imu: &[ImuSample],
    findings: &mut Findings,
) -> bool {
    let of_imu = used.role == "imu0";
    // Drivers of single joints share a topic.
    let reason = if used.role == "gimbal" { None } else { frames_in_turn(used.topic) };
    let reason = reason.or_else(|| two_sequences(used.topic)).or_else(|| double_rate(used, spacing, of_imu, imu));
    let Some(evidence) = reason else { return false };
    let title = format!("two publishers send on the topic of {}", used.role);
    let remedy = "give each publisher its own topic; of this recording keep the messages of one of them";
    findings.add(Severity::Error, Area::Time, title, format!("{}: {evidence}", used.topic.topic), remedy);
    let mixed: &[Measurement] = match used.role.as_str() {
        "imu0" => &[Measurement::Gyroscope, Measurement::Accelerometer],
        "imu0 accelerometer" => &[Measurement::Accelerometer],
        "gimbal" => &[Measurement::Joints],
        _ => &[],
    };
    for measurement in mixed {
        let is_of_joints = *measurement == Measurement::Joints;
        let kind = if is_of_joints { FaultKind::UnusableJoints } else { FaultKind::UnusableImu };
        findings.state_faults([kind.into()]);
        findings.exclude(*measurement);
    }
    true
}

/// Two frames in the headers that change often.
fn frames_in_turn(topic: &TopicSurvey) -> Option<String> {
    let mut counts = vec![0_usize; topic.frames.len()];
    for times in &topic.times {
        if let Some(count) = counts.get_mut(times.frame) {
            *count += 1;
        }
    }
    let changes = topic.times.windows(2).filter(|pair| pair[0].frame != pair[1].frame).count();
    let least = (MIN_SHARE * topic.times.len() as f64) as usize;
    let frames: Vec<usize> = (0..counts.len()).filter(|frame| counts[*frame] > least).collect();
    let rarest = frames.iter().map(|frame| counts[*frame]).min()?;
    // A publisher that changes its frame does so once.
    if frames.len() < 2 || changes * 2 < rarest {
        return None;
    }
    let listed: Vec<String> =
        frames.iter().map(|frame| format!("'{}' in {} messages", topic.frames[*frame], counts[*frame])).collect();
    Some(format!("frame_id {}", listed.join(", ")))
}

/// Two sequences of stamps, each in order, in messages whose stamps run backwards again and again.
fn two_sequences(topic: &TopicSurvey) -> Option<String> {
    let stamps_ns = topic.stamps_without_duplicates();
    let backwards = stamps_ns.windows(2).filter(|pair| pair[1] < pair[0]).count();
    if backwards * BACKWARDS_ONE_IN < stamps_ns.len() {
        return None;
    }
    let mut sequences: [Vec<i64>; 2] = [Vec::new(), Vec::new()];
    let mut others = 0;
    for stamp_ns in &stamps_ns {
        // The sequence with the latest stamp that is not after this one.
        let fits = |sequence: &&mut Vec<i64>| sequence.last().is_none_or(|last| last <= stamp_ns);
        match sequences.iter_mut().filter(fits).max_by_key(|sequence| sequence.last().copied()) {
            Some(sequence) => sequence.push(*stamp_ns),
            None => others += 1,
        }
    }
    let [first, second] = &sequences;
    let smallest = first.len().min(second.len()) as f64;
    if smallest < MIN_SEQUENCE * stamps_ns.len() as f64 || others * OTHERS_ONE_IN > stamps_ns.len() {
        return None;
    }
    let offset_s = |position: usize| Some(seconds_from_ns(*second.get(position)? - *first.get(position)?));
    let offsets: Vec<f64> = (0..first.len()).filter_map(offset_s).collect();
    Some(format!(
        "{} and {} messages have stamps in order, and the two sequences are {:.3} s apart in the median",
        first.len(),
        second.len(),
        median(&offsets).abs()
    ))
}

/// Twice the rate of the rig, with steps or values that alternate.
fn double_rate(used: &UsedTopic<'_>, spacing: &Spacing, of_imu: bool, imu: &[ImuSample]) -> Option<String> {
    let steps_s = &spacing.steps_s;
    let mean_s = steps_s.iter().sum::<f64>() / steps_s.len().max(1) as f64;
    let ratio = 1.0 / (mean_s * used.nominal_hz.filter(|rate| *rate > 0.0)?);
    if !(DOUBLE_RATE..TRIPLE_RATE).contains(&ratio) {
        return None;
    }
    let rate = format!("{:.1} Hz, {ratio:.1} times the rate of the rig", 1.0 / mean_s);
    let every_second = |from: usize| steps_s.iter().skip(from).step_by(2).copied().collect::<Vec<f64>>();
    let (even, odd) = (every_second(0), every_second(1));
    let difference_s = (median(&even) - median(&odd)).abs();
    // Closer pairs can be batches of one publisher.
    let apart_s = median(&even).min(median(&odd));
    if apart_s > MIN_STEP * mean_s
        && difference_s > MIN_DIFFERENCE * mean_s
        && middle_range(&even).max(middle_range(&odd)) < LARGEST_SPREAD * difference_s
    {
        let (even_ms, odd_ms) = (1e3 * median(&even), 1e3 * median(&odd));
        return Some(format!("{rate}, with steps of {even_ms:.2} and {odd_ms:.2} ms in turn"));
    }
    let change = |apart: usize, value: fn(&ImuSample) -> nalgebra::Vector3<f64>| {
        median(
            &imu.windows(apart + 1)
                .map(|window| (value(&window[apart]) - value(&window[0])).norm())
                .collect::<Vec<_>>(),
        )
    };
    let alternates = |value: fn(&ImuSample) -> nalgebra::Vector3<f64>| {
        let (next, next_but_one) = (change(1, value), change(2, value));
        (of_imu && next > ALTERNATING * next_but_one).then_some((next, next_but_one))
    };
    let of_rates = alternates(|sample| sample.angular_velocity_rad_per_s).map(|found| (found, "rad/s"));
    let ((next, other), unit) =
        of_rates.or_else(|| alternates(|sample| sample.specific_force_m_per_s2).map(|found| (found, "m/s²")))?;
    Some(format!(
        "{rate}, with values that differ by {next:.3} {unit} from the next sample and by {other:.3} {unit} from the next but \
         one, in the median"
    ))
}
