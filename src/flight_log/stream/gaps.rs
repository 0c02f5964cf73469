//! Intervals without messages of a topic, by the spacing of its stamps.

use super::super::{LogWarning, Magnitude, WarningKind};
use super::read_context::ReadContext;
use crate::flight_log::stamps::spacing::Spacing;
use crate::geometry::seconds_from_ns;

/// Number of stamps from which the usual spacing is taken; a batch has a few.
const STAMPS: usize = 100;

/// Finds the gaps of one topic; pauses between batches that were stamped on arrival are none.
#[derive(Debug)]
pub(super) struct GapWatch {
    kind: WarningKind,
    topic: String,
    nominal_hz: f64,
    /// First stamps, until the longest step without a gap is known.
    first_ns: Vec<i64>,
    longest_s: Option<f64>,
    previous_ns: Option<i64>,
}

impl GapWatch {
    /// Gaps of a topic, [`WarningKind::ImageGap`] or [`WarningKind::ImuGap`]; `nominal_hz` is the rig's rate.
    pub(super) fn new(kind: WarningKind, topic: &str, nominal_hz: f64) -> Self {
        let topic = topic.to_owned();
        Self { kind, topic, nominal_hz, first_ns: Vec::new(), longest_s: None, previous_ns: None }
    }

    /// Adds the next stamp and reports the gap before it; those before the first [`STAMPS`] are reported with the last
    /// of these.
    pub(super) fn push(&mut self, context: &mut ReadContext, stamp_ns: i64) {
        match (self.longest_s, self.previous_ns.replace(stamp_ns)) {
            (Some(longest_s), Some(previous_ns)) => self.compare(context, longest_s, previous_ns, stamp_ns),
            (Some(_), None) => {}
            (None, _) => {
                self.first_ns.push(stamp_ns);
                if self.first_ns.len() >= STAMPS {
                    self.finish(context);
                }
            }
        }
    }

    /// Reports the gaps of fewer than [`STAMPS`] stamps.
    pub(super) fn finish(&mut self, context: &mut ReadContext) {
        let stamps_ns = std::mem::take(&mut self.first_ns);
        if stamps_ns.len() < 3 {
            return;
        }
        let longest_s =
            Spacing::of(stamps_ns.iter().copied(), Some(self.nominal_hz)).longest_s(self.kind == WarningKind::ImageGap);
        self.longest_s = Some(longest_s);
        for pair in stamps_ns.windows(2) {
            self.compare(context, longest_s, pair[0], pair[1]);
        }
    }

    fn compare(&self, context: &mut ReadContext, longest_s: f64, from_ns: i64, to_ns: i64) {
        let (length_s, from_s) = (seconds_from_ns(to_ns - from_ns), seconds_from_ns(from_ns));
        if length_s <= longest_s {
            return;
        }
        let topic = &self.topic;
        let message = if self.kind == WarningKind::ImageGap {
            format!("{topic}: no image for {length_s:.3} s from {from_s:.3} s on")
        } else {
            format!(
                "{topic}: no samples for {length_s:.3} s from {from_s:.3} s on; IMU samples are interpolated over the gap"
            )
        };
        let warning = LogWarning::new(self.kind, topic, from_ns, message).until(to_ns);
        context.warnings.push(warning.with_magnitude(Magnitude::Seconds(length_s)));
    }
}
