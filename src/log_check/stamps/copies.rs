//! Messages that are recorded twice: equal stamps, and content that a topic has had before.

use std::collections::BTreeMap;

use super::used_topics::UsedTopic;
use crate::flight_log::images::copies::CopyJudge;
use crate::flight_log::imu::filter::{ROTATING_NS, ROTATING_RAD_PER_S};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::{Area, Findings, Severity};
use crate::log_check::statistics::{median, percentile};
use crate::log_check::survey::Survey;
use crate::log_check::survey::topic_survey::{Times, TopicSurvey};
use crate::sensors::{CameraRig, Rig};

/// Smallest ratio of messages with the content of an earlier one in two streams of equal messages; noise does not
/// repeat itself.
const MIN_REPEATED: f64 = 0.1;
/// Longest delay of the second stream, in seconds.
const SEARCHED_S: f64 = 2.0;
/// Ratio of copies, in tenths, that follow each other by two images if every second one is a copy.
const EVERY_SECOND_TENTHS: usize = 8;
/// Minimum number of copies of which every second image can be one.
const MIN_COPIES: usize = 3;

/// Reports stamps that occur several times, and two streams with the same measurements.
pub(super) fn check_copies(used: &UsedTopic<'_>, findings: &mut Findings) {
    let (role, times) = (&used.role, &used.topic.times);
    let mut of_stamp: BTreeMap<i64, Option<u32>> = BTreeMap::new();
    let (mut equal, mut unequal) = (Vec::new(), Vec::new());
    for Times { stamp_ns, checksum, .. } in times {
        match of_stamp.entry(*stamp_ns) {
            std::collections::btree_map::Entry::Vacant(entry) => {
                entry.insert(*checksum);
            }
            std::collections::btree_map::Entry::Occupied(entry) => {
                let sent_twice = checksum.is_some() && entry.get() == checksum;
                if sent_twice { &mut equal } else { &mut unequal }.push(*stamp_ns);
            }
        }
    }
    let listed = |repeats_ns: &[i64]| {
        let repeats: Vec<f64> = repeats_ns.iter().copied().map(seconds_from_ns).collect();
        let (first_s, last_s) = (percentile(&repeats, 0.0), percentile(&repeats, 1.0));
        format!("{} of {} messages, the first at {first_s:.3} s, the last at {last_s:.3} s", repeats.len(), times.len())
    };
    if !equal.is_empty() {
        let evidence = format!("{} have stamp and content of an earlier one", listed(&equal));
        let remedy = "the driver or a relay sends them twice; the copies are dropped";
        findings.add(Severity::Warning, Area::Time, format!("messages of {role} are sent twice"), evidence, remedy);
        findings.state_interval(equal);
    }
    if !unequal.is_empty() {
        let evidence = format!("{} have the stamp of another one with other content", listed(&unequal));
        let remedy =
            "the driver stamps a batch once, or there are two publishers; the first message of a stamp is used";
        findings.add(Severity::Warning, Area::Time, format!("stamps of {role} repeat"), evidence, remedy);
        findings.state_interval(unequal);
    }
    if used.role == "imu0" || used.of_images {
        check_delayed_copies(role, used.topic, findings);
    }
}

/// Reports measurements that come again under a later stamp, with others in between.
fn check_delayed_copies(role: &str, topic: &TopicSurvey, findings: &mut Findings) {
    let mut times: Vec<&Times> = topic.times.iter().collect();
    times.sort_by_key(|times| times.stamp_ns);
    let mut places: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (place, times) in times.iter().enumerate() {
        if let Some(checksum) = times.checksum {
            places.entry(checksum).or_default().push(place);
        }
    }
    // Content that comes more often, as of a periodic scene without noise, is of one publisher.
    let delay = |places: &Vec<usize>| match places.as_slice() {
        [first, second] if first + 1 < *second => Some(times[*second].stamp_ns - times[*first].stamp_ns),
        _ => None,
    };
    let within = |delay_ns: &i64| (1..ns_from_seconds(SEARCHED_S)).contains(delay_ns);
    let delays_s: Vec<f64> = places.values().filter_map(delay).filter(within).map(seconds_from_ns).collect();
    if (delays_s.len() as f64) < MIN_REPEATED * times.len() as f64 || delays_s.is_empty() {
        return;
    }
    let evidence = format!(
        "{} of {} messages have the content of one before, {:.1} ms earlier in the median (80 % from {:.1} to {:.1} ms)",
        delays_s.len(),
        times.len(),
        1e3 * median(&delays_s),
        1e3 * percentile(&delays_s, 0.1),
        1e3 * percentile(&delays_s, 0.9),
    );
    let remedy = "a second publisher repeats them with a delay: record one of them alone, under its own topic";
    let title = format!("measurements of {role} are recorded twice under different stamps");
    findings.add(Severity::Error, Area::Time, title, evidence, remedy);
}

/// Reports images that are copies of the one before; a run skips them.
pub(crate) fn check_image_copies(survey: &Survey, rig: &Rig, imu: &ImuFacts, findings: &mut Findings) {
    let rotating_ns: Vec<i64> = imu
        .samples
        .iter()
        .filter(|sample| sample.angular_velocity_rad_per_s.norm() > ROTATING_RAD_PER_S)
        .map(|sample| sample.stamp_ns)
        .collect();
    for camera in &rig.cameras {
        let Some(topic) = survey.topics.get(&camera.topic).filter(|topic| !topic.has_one_stamp()) else { continue };
        // Images of one grey value show nothing.
        let shows_something =
            survey.images.get(&camera.key).is_some_and(|images| images.iter().any(|image| image.measure.edge > 0.0));
        if shows_something {
            check_images_of(camera, topic, &rotating_ns, findings);
        }
    }
}

fn check_images_of(camera: &CameraRig, topic: &TopicSurvey, rotating_ns: &[i64], findings: &mut Findings) {
    let mut times = topic.times.clone();
    times.sort_by_key(|times| times.stamp_ns);
    times.dedup_by_key(|times| times.stamp_ns);
    let shift_ns = ns_from_seconds(camera.timeshift_cam_imu_s);
    let rotates = |stamp_ns: i64| {
        let after = rotating_ns.partition_point(|rotating| *rotating <= stamp_ns);
        after.checked_sub(1).is_some_and(|last| stamp_ns - rotating_ns[last] < ROTATING_NS)
    };
    let mut judge = CopyJudge::default();
    let mut is_copy = |index: &usize| {
        let checksum = times[*index].checksum;
        judge.is_copy(
            checksum.is_some() && checksum == times[index - 1].checksum,
            rotates(times[*index].stamp_ns + shift_ns),
        )
    };
    let copies: Vec<usize> = (1..times.len()).filter(|index| is_copy(index)).collect();
    let (Some(first), Some(last)) = (copies.first(), copies.last()) else { return };
    let single = copies.windows(2).filter(|pair| pair[1] - pair[0] == 2).count();
    let second = |index: &usize| seconds_from_ns(times[*index].stamp_ns);
    let different_hz = (times.len() - copies.len()) as f64 / (second(&(times.len() - 1)) - second(&0)).max(1e-9);
    let evidence = format!(
        "{} of {} images ({:.0} %) have the bytes of the image before although the camera moves, the first at {:.3} s, the \
         last at {:.3} s; {different_hz:.1} different images per second",
        copies.len(),
        times.len(),
        100.0 * copies.len() as f64 / times.len() as f64,
        second(first),
        second(last),
    );
    let (title, remedy) = if single * 10 > copies.len() * EVERY_SECOND_TENTHS && copies.len() >= MIN_COPIES {
        let title = format!("every second image of {} is a copy of the one before", camera.key);
        (title, "let the driver or converter send each image once; a run skips the copies")
    } else {
        let title = format!("images of {} are copies of the one before", camera.key);
        (title, "the camera or its driver stalls, or fills gaps: send each image once; a run skips the copies")
    };
    findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
    findings.state_interval(copies.iter().map(|index| times[*index].stamp_ns));
}
