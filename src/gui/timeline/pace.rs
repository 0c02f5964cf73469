//! The measured speed of the cursor during playback.

use std::collections::VecDeque;

/// Interval in seconds over which the speed is measured.
const INTERVAL_S: f64 = 1.5;
/// Seconds of playback before a speed is shown.
const MIN_MEASURED_S: f64 = 0.4;

/// The last frames during playback.
#[derive(Debug, Default)]
pub struct Pace {
    /// Wall clock in seconds and position of the cursor at each frame.
    frames: VecDeque<(f64, i64)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaceReading {
    /// Log seconds per second.
    pub speed: f64,
    /// Frames drawn per second (fps).
    pub fps: f64,
}

impl Pace {
    /// Records a frame with wall clock and position of the cursor.
    pub fn frame(&mut self, playing: bool, now_s: f64, cursor_ns: i64) {
        // After a jump back (loop or seek) the measurement restarts.
        if !playing || self.frames.back().is_some_and(|(_, before_ns)| cursor_ns < *before_ns) {
            self.frames.clear();
        }
        if playing {
            self.frames.push_back((now_s, cursor_ns));
            while self.frames.get(1).is_some_and(|(then_s, _)| now_s - then_s > INTERVAL_S) {
                self.frames.pop_front();
            }
        }
    }

    /// The measured speed, `None` until playback has run for long enough.
    pub fn reading(&self) -> Option<PaceReading> {
        let ((begin_s, begin_ns), (end_s, end_ns)) = (self.frames.front()?, self.frames.back()?);
        let elapsed_s = end_s - begin_s;
        (elapsed_s >= MIN_MEASURED_S).then(|| PaceReading {
            speed: (end_ns - begin_ns) as f64 * 1e-9 / elapsed_s,
            fps: (self.frames.len() - 1) as f64 / elapsed_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_speed_is_that_of_the_last_seconds() {
        let mut pace = Pace::default();
        for frame in 0..100 {
            let now_s = 10.0 + 0.1 * f64::from(frame);
            // Half speed at first, double speed later.
            let cursor_s = if frame < 50 { 0.05 * f64::from(frame) } else { 2.5 + 0.2 * f64::from(frame - 50) };
            pace.frame(true, now_s, (cursor_s * 1e9) as i64);
            match frame {
                0..4 => assert_eq!(pace.reading(), None),
                40 => assert!((pace.reading().unwrap().speed - 0.5).abs() < 1e-6),
                _ => {}
            }
        }
        let reading = pace.reading().unwrap();
        assert!((reading.speed - 2.0).abs() < 1e-6 && (reading.fps - 10.0).abs() < 1e-6, "{reading:?}");
        pace.frame(true, 20.0, 0);
        assert_eq!(pace.reading(), None, "a loop restarts the measurement");
        pace.frame(false, 20.1, 0);
        assert_eq!(pace.frames.len(), 0);
    }
}
