//! Joint angles at an image's stamp, from all encoder readings around it.

use std::collections::VecDeque;

use super::angle_fit::{self, Reading};
use super::joint_topic::JointSamples;
use super::read_context::ReadContext;
use crate::geometry::{seconds_from_ns, wrap_angle};
use crate::sensors::{JointAngles, JointMotionFit, JointSample};

/// Largest distance between a stamp and the readings used for it.
const NEAREST_NS: i64 = 100_000_000;
/// The same for attitudes, which some gimbals record 5 times per second.
const NEAREST_ATTITUDE_NS: i64 = 150_000_000;
/// Standard deviation, half way between two attitudes, of a joint's deviation from a constant rate, relative to its
/// rotation between them. A joint that rotates only during one half of the time deviates four times as much.
const DEVIATION_OF_ROTATION: f64 = 1.0 / 16.0;
/// Largest half length of a batch; over longer times a stabilized joint does not follow a parabola.
const MAX_HALF_BATCH_NS: i64 = 25_000_000;
/// The rate is fitted to this many times the batch on either side, neighbouring batches included: its noise falls with
/// the length to the power of −3/2, and noise on a rate biases an estimated time offset towards zero.
const RATE_BATCHES: i64 = 2;
/// Minimum number of readings of a batch; two cannot be averaged.
const MIN_BATCH: usize = 3;
/// Standard deviation of a joint's rate if a single reading does not constrain it.
const UNKNOWN_RATE_RAD_PER_S: f64 = 1.0;

/// Standard deviation of a joint angle at an image, in radians, from evenly spaced readings around it whose noise is white
/// with this standard deviation.
pub fn nominal_joint_sigma_rad(sigma_rad: f64, encoder_rate_hz: f64, image_rate_hz: f64) -> f64 {
    let half_batch_s = (0.5 / image_rate_hz).min(seconds_from_ns(MAX_HALF_BATCH_NS));
    let count = (2.0 * half_batch_s * encoder_rate_hz + 1e-9) as usize;
    let reading = |index: usize| ((index as f64 - 0.5 * (count - 1) as f64) / encoder_rate_hz, 0.0);
    let readings: Vec<Reading> = (0..count).map(reading).collect();
    let averaged = angle_fit::fit(&readings, sigma_rad * sigma_rad).filter(|_| count >= MIN_BATCH);
    averaged.map_or(sigma_rad, |fitted| fitted.variance_rad2.sqrt().min(sigma_rad))
}

/// Joint angles of a log at the stamps of images.
pub(super) struct JointAngleStream {
    samples: JointSamples,
    ended: bool,
    average: EncoderAverage,
}

impl JointAngleStream {
    /// Creates the stream; `sigma_rad` is the rig's standard deviation of a reading, `half_interval_ns` half an image
    /// interval.
    pub(super) fn new(samples: JointSamples, sigma_rad: f64, half_interval_ns: i64) -> Self {
        let average = EncoderAverage::new(sigma_rad, half_interval_ns);
        let average = if samples.are_of_attitude() { average.of_attitude() } else { average };
        Self { samples, ended: false, average }
    }

    /// Angles in radians at a stamp, `None` without a reading near it; stamps must not decrease, and `previous_ns` is
    /// the stamp of the previous image.
    pub(super) fn at(
        &mut self,
        context: &mut ReadContext,
        stamp_ns: i64,
        previous_ns: Option<i64>,
    ) -> Option<JointAngles> {
        while !self.ended && self.average.needs_readings(stamp_ns) {
            match self.samples.next(context) {
                Some(sample) => self.average.push(sample),
                None => self.ended = true,
            }
        }
        self.average.at(stamp_ns, previous_ns)
    }
}

/// Estimates one angle per image and joint from the encoder readings between images.
///
/// A parabola is fitted to the readings within half an image interval of a stamp. Batches of consecutive images share no
/// reading, so that their errors are independent. Only the part of the rig's variance that is measured as white noise is
/// reduced by averaging; the remainder (slow errors, quantization) is kept.
#[derive(Debug)]
pub(super) struct EncoderAverage {
    /// Readings near the last stamp, and the first one after its batch.
    readings: VecDeque<JointSample>,
    noise: WhiteNoise,
    sigma_rad: f64,
    half_batch_ns: i64,
    /// True for readings of an attitude, which may be further apart than images.
    of_attitude: bool,
}

impl EncoderAverage {
    pub(super) fn new(sigma_rad: f64, half_interval_ns: i64) -> Self {
        Self {
            readings: VecDeque::new(),
            noise: WhiteNoise::default(),
            sigma_rad,
            half_batch_ns: half_interval_ns.min(MAX_HALF_BATCH_NS),
            of_attitude: false,
        }
    }

    /// Sets that the readings are attitudes: they are interpolated over larger gaps, with an uncertainty that grows
    /// with the gap and with the rotation in it, and the rate over the gap is used.
    pub(super) fn of_attitude(self) -> Self {
        Self { of_attitude: true, ..self }
    }

    /// Largest distance between a stamp and the readings used for it.
    fn nearest_ns(&self) -> i64 {
        if self.of_attitude { NEAREST_ATTITUDE_NS } else { NEAREST_NS }
    }

    /// True if readings that belong to a stamp may still be missing.
    pub(super) fn needs_readings(&self, stamp_ns: i64) -> bool {
        let end_ns = stamp_ns.saturating_add(RATE_BATCHES * self.half_batch_ns);
        self.readings.back().is_none_or(|last| last.stamp_ns <= end_ns)
    }

    /// Adds the next reading; stamps must increase.
    pub(super) fn push(&mut self, sample: JointSample) {
        self.noise.push(&sample);
        self.readings.push_back(sample);
    }

    /// Angles in radians at a stamp, with their standard deviations and rates.
    pub(super) fn at(&mut self, stamp_ns: i64, previous_ns: Option<i64>) -> Option<JointAngles> {
        let end_ns = stamp_ns.saturating_add(self.half_batch_ns);
        let reach_ns = RATE_BATCHES * self.half_batch_ns;
        self.forget_before(stamp_ns.saturating_sub(reach_ns));
        let start_ns = previous_ns
            .map_or(i64::MIN, |previous| previous.saturating_add(self.half_batch_ns))
            .max(stamp_ns.saturating_sub(self.half_batch_ns));
        let batch: Vec<&JointSample> =
            self.readings.iter().filter(|sample| (start_ns + 1..=end_ns).contains(&sample.stamp_ns)).collect();
        let around: Vec<&JointSample> =
            self.readings.iter().filter(|sample| (sample.stamp_ns - stamp_ns).abs() <= reach_ns).collect();
        let after = self.readings.iter().position(|sample| sample.stamp_ns > stamp_ns).unwrap_or(self.readings.len());
        let pair: Vec<&JointSample> = self.readings.range(after.saturating_sub(1)..).take(2).collect();
        let nearest = *pair.iter().min_by_key(|sample| (sample.stamp_ns - stamp_ns).abs())?;
        let nearest_ns = self.nearest_ns();
        if (nearest.stamp_ns - stamp_ns).abs() > nearest_ns {
            return None;
        }
        let span = (pair.len() == 2).then(|| (pair[0].stamp_ns, pair[1].stamp_ns));
        let span = span.filter(|(first_ns, second_ns)| *first_ns <= stamp_ns && second_ns > first_ns);
        // For an attitude, one reading on either side suffices, if their distance is small enough.
        let between = span.is_some_and(|(first_ns, second_ns)| {
            let farthest_ns = (second_ns - stamp_ns).max(stamp_ns - first_ns);
            if self.of_attitude { second_ns - first_ns <= 2 * nearest_ns } else { farthest_ns <= nearest_ns }
        });
        let fraction =
            span.map_or(0.0, |(first_ns, second_ns)| (stamp_ns - first_ns) as f64 / (second_ns - first_ns) as f64);
        let joints = nearest.angles_rad.len();
        let given = self.sigma_rad * self.sigma_rad;
        let (mut angles_rad, mut sigmas_rad, mut lasting_sigmas_rad) = (Vec::new(), Vec::new(), Vec::new());
        let (mut rates_rad_per_s, mut motion_fits) = (Vec::new(), Vec::new());
        for joint in 0..joints {
            let near = |samples: &[&JointSample]| readings_of(samples, joint, nearest.angles_rad[joint], stamp_ns);
            let averaged = self.noise.at(stamp_ns, joint).filter(|_| batch.len() >= MIN_BATCH).and_then(|noise| {
                let fitted = angle_fit::fit(&near(&batch), noise.variance.max(1e-6 * given))?;
                let lasting = (given - noise.upper_bound()).max(0.0);
                let variance = fitted.variance_rad2 + lasting;
                (variance < given).then_some((fitted.angle_rad, variance, lasting))
            });
            // Two readings that neighbouring images may use as well are interpolated without averaging.
            let interpolated = || {
                let fitted = angle_fit::fit(&near(&pair), given).filter(|_| between)?;
                let rotated_rad = wrap_angle(pair[1].angles_rad[joint] - pair[0].angles_rad[joint]);
                let deviation_rad = DEVIATION_OF_ROTATION * rotated_rad * 4.0 * fraction * (1.0 - fraction);
                let deviation = if self.of_attitude { deviation_rad * deviation_rad } else { 0.0 };
                Some((fitted.angle_rad, fitted.variance_rad2.max(given) + deviation, given))
            };
            let rates_of: &[&JointSample] =
                if self.of_attitude && around.len() < 2 && between { &pair } else { &around };
            let motion = angle_fit::fit(&near(rates_of), given);
            let rate = motion.map_or(0.0, |fitted| fitted.rate_rad_per_s);
            let (angle, variance, lasting) = averaged.or_else(interpolated).unwrap_or_else(|| {
                let rotated_rad = UNKNOWN_RATE_RAD_PER_S * seconds_from_ns(nearest.stamp_ns - stamp_ns);
                (nearest.angles_rad[joint], given + rotated_rad * rotated_rad, given)
            });
            angles_rad.push(angle);
            rates_rad_per_s.push(rate);
            motion_fits.push(motion.map_or(JointMotionFit::UNKNOWN, |fitted| JointMotionFit {
                rate_sigma_rad_per_s: fitted.rate_variance.sqrt(),
                acceleration_rad_per_s2: fitted.acceleration_rad_per_s2,
                acceleration_sigma_rad_per_s2: fitted.acceleration_variance.sqrt(),
            }));
            sigmas_rad.push(variance.sqrt());
            lasting_sigmas_rad.push(lasting.sqrt());
        }
        Some(JointAngles { angles_rad, sigmas_rad, lasting_sigmas_rad, rates_rad_per_s, motion_fits })
    }

    /// Drops readings that no later stamp needs, except the last one before the stamp.
    fn forget_before(&mut self, time_ns: i64) {
        while self.readings.get(1).is_some_and(|second| second.stamp_ns <= time_ns) {
            self.readings.pop_front();
        }
    }
}

/// Readings of one joint relative to a stamp, unwrapped around `around_rad`.
fn readings_of(samples: &[&JointSample], joint: usize, around_rad: f64, stamp_ns: i64) -> Vec<Reading> {
    samples
        .iter()
        .map(|sample| {
            let angle_rad = around_rad + wrap_angle(sample.angles_rad[joint] - around_rad);
            (seconds_from_ns(sample.stamp_ns - stamp_ns), angle_rad)
        })
        .collect()
}

/// Variance of the white noise of the readings.
#[derive(Clone, Copy, Debug)]
struct MeasuredNoise {
    variance: f64,
    freedom: usize,
}

impl MeasuredNoise {
    /// Measured variance plus two standard deviations of its measurement.
    fn upper_bound(&self) -> f64 {
        self.variance * (1.0 + 2.0 * (2.0 / self.freedom as f64).sqrt())
    }
}

/// Length of the blocks within which the white noise is measured. They start at multiples of it since the start of the
/// log, so that the result does not depend on the start of a replay.
const BLOCK_NS: i64 = 50_000_000;
/// Number of blocks that are pooled; a replay reads this many blocks before its start.
const BLOCKS: i64 = 40;
/// Minimum degrees of freedom of a noise measurement.
const MIN_DEGREES_OF_FREEDOM: usize = 50;

/// Measures the white noise of each joint's readings about a smooth motion.
#[derive(Debug, Default)]
struct WhiteNoise {
    /// Readings of the block that is still being filled.
    open: Vec<JointSample>,
    /// Number of the block, and per joint the sum of squares and its degrees of freedom.
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
        // More blocks than are pooled, because reading is ahead of the requested stamps.
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

    /// White noise measured in the blocks before the block of a stamp, `None` with too few readings.
    fn at(&self, stamp_ns: i64, joint: usize) -> Option<MeasuredNoise> {
        let number = stamp_ns.div_euclid(BLOCK_NS);
        let (squares, freedom) = self
            .blocks
            .iter()
            .filter(|(block, _)| (number - BLOCKS..number).contains(block))
            .filter_map(|(_, joints)| joints.get(joint))
            .fold((0.0, 0), |(squares, freedom), (more, further)| (squares + more, freedom + further));
        (freedom >= MIN_DEGREES_OF_FREEDOM).then(|| MeasuredNoise { variance: squares / freedom as f64, freedom })
    }
}
