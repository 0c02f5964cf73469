//! The joint angles at an image's stamp, from all encoder readings that belong to it.

use std::collections::VecDeque;

use super::angle_fit::{self, Reading};
use super::joint_topic::JointSamples;
use super::ordered::ReadContext;
use crate::geometry::{seconds_from_ns, wrap_angle};
use crate::sensors::{JointAngles, JointSample};

/// A reading further than this from the stamp tells nothing about the angle there.
const NEAREST_NS: i64 = 100_000_000;
/// A batch reaches no further than this to either side: beyond, a stabilized joint is no parabola any more.
const LONGEST_HALF_BATCH_NS: i64 = 25_000_000;
/// The rate is taken from so many times the batch to either side, neighbours' readings among them: its noise falls with the
/// third power of the root of that length, and noise on a rate looks like a smaller offset of the clocks.
const RATE_BATCHES: i64 = 2;
/// Fewest readings of a batch: with two there is nothing to average.
const LEAST_BATCH: usize = 3;
/// How fast a joint may be turning where a single reading cannot tell, as a standard deviation.
const UNKNOWN_RATE_RAD_PER_S: f64 = 1.0;

/// Encoder readings of a log, looked up image by image.
pub(super) struct JointAngleStream {
    samples: JointSamples,
    ended: bool,
    average: EncoderAverage,
}

impl JointAngleStream {
    /// `sigma_rad` is the rig's standard deviation of a reading, `half_interval_ns` half an image interval.
    pub(super) fn new(samples: JointSamples, sigma_rad: f64, half_interval_ns: i64) -> Self {
        Self { samples, ended: false, average: EncoderAverage::new(sigma_rad, half_interval_ns) }
    }

    /// The angles at a stamp, `None` when no reading is near; stamps must not decrease, and `previous_ns` is the image
    /// before.
    pub(super) fn at(
        &mut self,
        context: &mut ReadContext,
        stamp_ns: i64,
        previous_ns: Option<i64>,
    ) -> Option<JointAngles> {
        while !self.ended && self.average.wants_readings(stamp_ns) {
            match self.samples.next(context) {
                Some(sample) => self.average.push(sample),
                None => self.ended = true,
            }
        }
        self.average.at(stamp_ns, previous_ns)
    }
}

/// Makes one angle per image and joint from the readings that come in between.
///
/// The readings of half an image interval to either side of a stamp give the angle there by a local fit. Batches of
/// consecutive images share no reading, so that their errors are independent. Only the part of the rig's variance that is
/// seen to scatter from reading to reading is averaged down; the rest (a slow error, a quantization) stays as it is.
#[derive(Debug)]
pub(super) struct EncoderAverage {
    /// Those near the last stamp, and the first one behind its batch.
    readings: VecDeque<JointSample>,
    noise: WhiteNoise,
    sigma_rad: f64,
    half_batch_ns: i64,
}

impl EncoderAverage {
    pub(super) fn new(sigma_rad: f64, half_interval_ns: i64) -> Self {
        Self {
            readings: VecDeque::new(),
            noise: WhiteNoise::default(),
            sigma_rad,
            half_batch_ns: half_interval_ns.min(LONGEST_HALF_BATCH_NS),
        }
    }

    /// Whether readings that belong to a stamp may still be missing.
    pub(super) fn wants_readings(&self, stamp_ns: i64) -> bool {
        let end_ns = stamp_ns.saturating_add(RATE_BATCHES * self.half_batch_ns);
        self.readings.back().is_none_or(|last| last.stamp_ns <= end_ns)
    }

    /// The next reading; stamps must increase.
    pub(super) fn push(&mut self, sample: JointSample) {
        self.noise.push(&sample);
        self.readings.push_back(sample);
    }

    /// The angles at a stamp, and what they are worth.
    pub(super) fn at(&mut self, stamp_ns: i64, previous_ns: Option<i64>) -> Option<JointAngles> {
        let end_ns = stamp_ns.saturating_add(self.half_batch_ns);
        let reach_ns = RATE_BATCHES * self.half_batch_ns;
        self.forget_before(stamp_ns.saturating_sub(reach_ns));
        let begin_ns = previous_ns
            .map_or(i64::MIN, |previous| previous.saturating_add(self.half_batch_ns))
            .max(stamp_ns.saturating_sub(self.half_batch_ns));
        let batch: Vec<&JointSample> =
            self.readings.iter().filter(|sample| (begin_ns + 1..=end_ns).contains(&sample.stamp_ns)).collect();
        let around: Vec<&JointSample> =
            self.readings.iter().filter(|sample| (sample.stamp_ns - stamp_ns).abs() <= reach_ns).collect();
        let after = self.readings.iter().position(|sample| sample.stamp_ns > stamp_ns).unwrap_or(self.readings.len());
        let pair: Vec<&JointSample> = self.readings.range(after.saturating_sub(1)..).take(2).collect();
        let nearest = *pair.iter().min_by_key(|sample| (sample.stamp_ns - stamp_ns).abs())?;
        if (nearest.stamp_ns - stamp_ns).abs() > NEAREST_NS {
            return None;
        }
        let joints = nearest.angles_rad.len();
        let given = self.sigma_rad * self.sigma_rad;
        let (mut angles_rad, mut sigmas_rad, mut lasting_sigmas_rad) = (Vec::new(), Vec::new(), Vec::new());
        let mut rates_rad_per_s = Vec::new();
        for joint in 0..joints {
            let near = |samples: &[&JointSample]| readings_of(samples, joint, nearest.angles_rad[joint], stamp_ns);
            let averaged = self.noise.at(stamp_ns, joint).filter(|_| batch.len() >= LEAST_BATCH).and_then(|noise| {
                let fitted = angle_fit::fit(&near(&batch), noise.variance.max(1e-6 * given))?;
                let lasting = (given - noise.upper_bound()).max(0.0);
                let variance = fitted.variance_rad2 + lasting;
                (variance < given).then_some((fitted.angle_rad, variance, lasting))
            });
            // Two readings that the neighbouring images may use as well: nothing is averaged.
            let interpolated = || {
                let fitted = angle_fit::fit(&near(&pair), given)?;
                let apart_ns = (pair[1].stamp_ns - stamp_ns).max(stamp_ns - pair[0].stamp_ns);
                let between = pair[0].stamp_ns <= stamp_ns && apart_ns <= NEAREST_NS;
                between.then(|| (fitted.angle_rad, fitted.variance_rad2.max(given), given))
            };
            let rate = angle_fit::fit(&near(&around), given).map_or(0.0, |fitted| fitted.rate_rad_per_s);
            let (angle, variance, lasting) = averaged.or_else(interpolated).unwrap_or_else(|| {
                let turned = UNKNOWN_RATE_RAD_PER_S * seconds_from_ns(nearest.stamp_ns - stamp_ns);
                (nearest.angles_rad[joint], given + turned * turned, given)
            });
            angles_rad.push(angle);
            rates_rad_per_s.push(rate);
            sigmas_rad.push(variance.sqrt());
            lasting_sigmas_rad.push(lasting.sqrt());
        }
        Some(JointAngles { angles_rad, sigmas_rad, lasting_sigmas_rad, rates_rad_per_s })
    }

    /// Forgets readings that no later stamp needs, but keeps the last one before the time.
    fn forget_before(&mut self, time_ns: i64) {
        while self.readings.get(1).is_some_and(|second| second.stamp_ns <= time_ns) {
            self.readings.pop_front();
        }
    }
}

/// One joint's readings against a stamp, brought to the turn of `around_rad`.
fn readings_of(samples: &[&JointSample], joint: usize, around_rad: f64, stamp_ns: i64) -> Vec<Reading> {
    samples
        .iter()
        .map(|sample| {
            let angle_rad = around_rad + wrap_angle(sample.angles_rad[joint] - around_rad);
            (seconds_from_ns(sample.stamp_ns - stamp_ns), angle_rad)
        })
        .collect()
}

/// Variance of the noise that is independent from reading to reading.
#[derive(Clone, Copy, Debug)]
struct MeasuredNoise {
    variance: f64,
    freedom: usize,
}

impl MeasuredNoise {
    /// The variance that it may have, two standard deviations of the measurement above it.
    fn upper_bound(&self) -> f64 {
        self.variance * (1.0 + 2.0 * (2.0 / self.freedom as f64).sqrt())
    }
}

/// Length of the blocks within which the scatter of the readings is measured, and from whose multiples on the log's clock
/// they begin: what is found must not depend on where a replay starts.
const BLOCK_NS: i64 = 50_000_000;
/// Blocks that are pooled; a replay begins to read further back than that.
const BLOCKS: i64 = 40;
/// Fewest degrees of freedom from which the noise counts as measured.
const LEAST_FREEDOM: usize = 50;

/// Measures how much the readings of each joint scatter about a smooth motion.
#[derive(Debug, Default)]
struct WhiteNoise {
    /// The block that is still being filled.
    open: Vec<JointSample>,
    /// Number of the block, and per joint the squares and their degrees of freedom.
    blocks: VecDeque<(i64, Vec<(f64, usize)>)>,
}

impl WhiteNoise {
    fn push(&mut self, sample: &JointSample) {
        let number = sample.stamp_ns.div_euclid(BLOCK_NS);
        if let Some(first) = self.open.first() {
            let open = first.stamp_ns.div_euclid(BLOCK_NS);
            if open != number {
                self.close(open);
            }
        }
        self.open.push(sample.clone());
        // One more than is pooled: reading runs ahead of the stamps that are asked for.
        while self.blocks.front().is_some_and(|(block, _)| *block < number - 2 * BLOCKS) {
            self.blocks.pop_front();
        }
    }

    fn close(&mut self, number: i64) {
        let samples = std::mem::take(&mut self.open);
        let samples: Vec<&JointSample> = samples.iter().collect();
        let Some(first) = samples.first() else { return };
        let scatter = |joint: usize| {
            let readings = readings_of(&samples, joint, first.angles_rad[joint], number * BLOCK_NS + BLOCK_NS / 2);
            angle_fit::scatter(&readings).unwrap_or((0.0, 0))
        };
        self.blocks.push_back((number, (0..first.angles_rad.len()).map(scatter).collect()));
    }

    /// From the blocks before the one of a stamp, `None` while there are too few readings.
    fn at(&self, stamp_ns: i64, joint: usize) -> Option<MeasuredNoise> {
        let number = stamp_ns.div_euclid(BLOCK_NS);
        let (squares, freedom) = self
            .blocks
            .iter()
            .filter(|(block, _)| (number - BLOCKS..number).contains(block))
            .filter_map(|(_, joints)| joints.get(joint))
            .fold((0.0, 0), |(squares, freedom), (more, further)| (squares + more, freedom + further));
        (freedom >= LEAST_FREEDOM).then(|| MeasuredNoise { variance: squares / freedom as f64, freedom })
    }
}
