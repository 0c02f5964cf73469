//! Time of the next frame during playback, and while runs compute.

use std::time::Duration;

use crate::geometry::seconds_from_ns;
use crate::session::{Recording, RunRecord};

/// Period at which the window checks for new steps.
pub(super) const POLL_PERIOD: Duration = Duration::from_millis(60);

/// Longest period of these checks while runs compute.
const LONGEST_POLL_PERIOD: Duration = Duration::from_millis(400);

/// Time between two frames while runs compute and nothing else asks for one, as a multiple of the time that drawing takes:
/// the processors belong to the runs.
const POLL_TO_FRAME: f32 = 9.0;

/// Longest time in seconds between two frames of playback; between two steps only the cursor moves.
const LONGEST_PAUSE_S: f64 = 0.05;

/// Time until playback reaches the next step of any run; until then only the cursor moves.
pub(super) fn until_next_step(recording: &Recording, cursor_ns: i64, speed: f64) -> Duration {
    let next = |run: &RunRecord| {
        let place = run.index_at(cursor_ns).map_or(0, |place| place + 1);
        run.steps.get(place).map(|step| step.report.stamp_ns - cursor_ns)
    };
    let wait_ns = recording.runs.iter().filter_map(next).min();
    let wait_s = wait_ns.map_or(LONGEST_PAUSE_S, |wait_ns| seconds_from_ns(wait_ns) / speed.max(f64::MIN_POSITIVE));
    Duration::from_secs_f64(wait_s.clamp(0.0, LONGEST_PAUSE_S))
}

/// Time until the window looks for steps of runs that compute, after a frame that took `frame_s` seconds.
pub(super) fn until_next_poll(frame_s: Option<f32>) -> Duration {
    let wait_s = POLL_TO_FRAME * frame_s.unwrap_or_default();
    Duration::from_secs_f32(wait_s.clamp(POLL_PERIOD.as_secs_f32(), LONGEST_POLL_PERIOD.as_secs_f32()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::{FRAME_PERIOD_NS, sample_recording};

    #[test]
    fn the_next_frame_is_due_at_the_next_step() {
        let recording = &sample_recording();
        let stamp_ns = recording.runs[0].steps[40].report.stamp_ns;
        let period = Duration::from_nanos(FRAME_PERIOD_NS as u64);
        let off = |wait: Duration, expected: Duration| wait.abs_diff(expected) < Duration::from_micros(1);
        assert!(off(until_next_step(recording, stamp_ns, 2.0), period / 2));
        assert!(off(until_next_step(recording, stamp_ns + FRAME_PERIOD_NS / 4, 2.0), period * 3 / 8));
        // In slow motion the cursor moves between two steps, and after the last one it waits for more.
        let longest = Duration::from_secs_f64(LONGEST_PAUSE_S);
        assert_eq!(until_next_step(recording, stamp_ns, 0.1), longest);
        assert_eq!(until_next_step(recording, recording.last_stamp_ns(), 1.0), longest);
        assert_eq!(until_next_step(recording, stamp_ns, 0.0), longest);
    }

    #[test]
    fn slow_frames_leave_the_processors_to_the_runs() {
        let ms = |frame_s| (1e3 * until_next_poll(frame_s).as_secs_f64()).round();
        assert_eq!([ms(None), ms(Some(0.002)), ms(Some(0.03)), ms(Some(0.5))], [60.0, 60.0, 270.0, 400.0]);
    }
}
