//! The measured speed of the cursor during playback.

use std::collections::VecDeque;

/// Interval in seconds over which the speed is measured.
const WINDOW_S: f64 = 1.5;
/// Seconds of playback before a speed is shown.
const SHORTEST_S: f64 = 0.4;

/// The last frames during playback.
#[derive(Debug, Default)]
pub struct Pace {
    /// Wall clock in seconds and position of the cursor at each frame.
    pictures: VecDeque<(f64, i64)>,
}

/// A measured speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Log seconds per second.
    pub speed: f64,
    /// Frames drawn per second (fps).
    pub pictures_per_s: f64,
}

impl Pace {
    /// Records a frame with wall clock and position of the cursor.
    pub fn picture(&mut self, playing: bool, now_s: f64, cursor_ns: i64) {
        // After a jump back (loop or seek) the measurement restarts.
        if !playing || self.pictures.back().is_some_and(|(_, before_ns)| cursor_ns < *before_ns) {
            self.pictures.clear();
        }
        if playing {
            self.pictures.push_back((now_s, cursor_ns));
            while self.pictures.get(1).is_some_and(|(then_s, _)| now_s - then_s > WINDOW_S) {
                self.pictures.pop_front();
            }
        }
    }

    /// The measured speed, `None` until playback has run for long enough.
    pub fn reading(&self) -> Option<Reading> {
        let ((begin_s, begin_ns), (end_s, end_ns)) = (self.pictures.front()?, self.pictures.back()?);
        let elapsed_s = end_s - begin_s;
        (elapsed_s >= SHORTEST_S).then(|| Reading {
            speed: (end_ns - begin_ns) as f64 * 1e-9 / elapsed_s,
            pictures_per_s: (self.pictures.len() - 1) as f64 / elapsed_s,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pace_is_that_of_the_last_seconds() {
        let mut pace = Pace::default();
        for picture in 0..100 {
            let now_s = 10.0 + 0.1 * f64::from(picture);
            // Half speed at first, double speed later.
            let cursor_s = if picture < 50 { 0.05 * f64::from(picture) } else { 2.5 + 0.2 * f64::from(picture - 50) };
            pace.picture(true, now_s, (cursor_s * 1e9) as i64);
            match picture {
                0..4 => assert_eq!(pace.reading(), None),
                40 => assert!((pace.reading().unwrap().speed - 0.5).abs() < 1e-6),
                _ => {}
            }
        }
        let reading = pace.reading().unwrap();
        assert!((reading.speed - 2.0).abs() < 1e-6 && (reading.pictures_per_s - 10.0).abs() < 1e-6, "{reading:?}");
        pace.picture(true, 20.0, 0);
        assert_eq!(pace.reading(), None, "a loop begins anew");
        pace.picture(false, 20.1, 0);
        assert_eq!(pace.pictures.len(), 0);
    }
}
