//! Images of videos that cannot be decoded.

use super::survey::Survey;
use super::{Area, Findings, Severity};
use crate::flight_log::FlightLog;
use crate::flight_log::video::{MissingPictures, missing_pictures};
use crate::geometry::seconds_from_ns;
use crate::sensors::Rig;

/// Number of messages of a video that are decoded: about a minute at 30 Hz.
const DECODED: usize = 2000;
/// Maximum number of listed intervals.
const LISTED: usize = 3;

/// Decodes the videos of a rig's cameras and reports the intervals that a run has to skip.
pub(super) fn check_pictures(log: &FlightLog, survey: &Survey, rig: &Rig, findings: &mut Findings) {
    for camera in &rig.cameras {
        let Some(info) = log.topic(&camera.topic) else { continue };
        let Some(kind) = info.kind.filter(|kind| kind.is_video()) else { continue };
        let (read, missing) = missing_pictures(log, &camera.topic, kind, DECODED);
        let of = if read < info.count as usize { format!("the first {read}") } else { read.to_string() };
        let count: usize = missing.iter().map(|stretch| stretch.count).sum();
        if count == 0 {
            findings.good(Area::Images, format!("the video of {} can be decoded", camera.key), format!("{of} images"));
            continue;
        }
        let times = survey.topics.get(&camera.topic).map_or(&[][..], |topic| topic.times.as_slice());
        let second = |number: usize| times.get(number).map_or(0.0, |times| seconds_from_ns(times.stamp_ns));
        let listed = |stretch: &MissingPictures| {
            let (from_s, to_s) = (second(stretch.first), second(stretch.first + stretch.count - 1));
            format!("{} from {from_s:.3} to {to_s:.3} s ({})", stretch.count, stretch.problem)
        };
        let mut stretches: Vec<String> = missing.iter().take(LISTED).map(listed).collect();
        if missing.len() > LISTED {
            stretches.push(format!("{} more intervals", missing.len() - LISTED));
        }
        let title = format!("images of {} cannot be decoded", camera.key);
        let evidence = format!("{count} of {of} images: {}", stretches.join("; "));
        let remedy = "a run skips them up to the next keyframe: record without losses, or with more frequent keyframes";
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
    }
}
