//! IMU samples that no sensor measured: values that are not finite, zeros and frozen values.

use std::collections::VecDeque;

use nalgebra::Vector3;

use crate::flight_log::messages::ImuMessage;
use crate::flight_log::{FlightLog, messages};
use crate::sensors::ImuSample;

/// Angular rate of a vehicle that certainly rotates, in rad/s: above bias and noise of a gyroscope. An exact zero between
/// two such samples is none: gyroscopes have steps of 0.001 rad/s, and their rate does not jump by this within a sample.
pub(crate) const ROTATING_RAD_PER_S: f64 = 0.05;
/// Time after a rate above [`ROTATING_RAD_PER_S`] for which the vehicle is taken to move.
pub(crate) const ROTATING_NS: i64 = 1_000_000_000;
/// Longest interval of zeros that is judged by the samples around it; longer ones are taken for a stationary vehicle
/// whose driver rounds small rates to zero.
const LONGEST_ZERO_NS: i64 = 1_000_000_000;
/// Number of different consecutive samples after which equal ones are suspicious: a simulated sensor without noise
/// repeats its values whenever nothing moves, and some drivers send every measurement several times.
const CHANGING_SAMPLES: usize = 50;
/// Number of consecutive copies of a sample that are certainly none by chance.
const FROZEN_COPIES: usize = 3;

/// Reason why a message of an IMU is no measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Unmeasured {
    NotFinite,
    /// All six values are zero.
    AllZero,
    /// The specific force is zero, which only a sensor without noise in free fall measures.
    ZeroForce,
    /// The angular velocity is zero between samples of a rotation.
    ZeroRate,
    /// All values equal those before, after a time in which every sample differed.
    Frozen,
}

impl Unmeasured {
    /// Reason in a warning about dropped messages.
    pub(crate) fn reason(self) -> &'static str {
        match self {
            Self::NotFinite => "values are not finite",
            Self::AllZero => "all six values are exactly zero",
            Self::ZeroForce => "the specific force is exactly zero",
            Self::ZeroRate => "the angular velocity is exactly zero during a rotation",
            Self::Frozen => "the values are frozen",
        }
    }

    /// Judges a message by its own values. `has_forces` is false for a topic without any specific force.
    pub(crate) fn of(rate: &Vector3<f64>, force: &Vector3<f64>, has_forces: bool) -> Option<Self> {
        if !rate.iter().chain(force).all(|value| value.is_finite()) {
            Some(Self::NotFinite)
        } else if !has_forces || *force != Vector3::zeros() {
            None
        } else if *rate == Vector3::zeros() {
            Some(Self::AllZero)
        } else {
            Some(Self::ZeroForce)
        }
    }

    /// Judges a vector of a sensor with a separate topic; `zero` is the reason for an exact zero, if that is certain.
    pub(crate) fn of_vector(vector: &Vector3<f64>, zero: Option<Self>) -> Option<Self> {
        if vector.iter().all(|value| value.is_finite()) {
            zero.filter(|_| *vector == Vector3::zeros())
        } else {
            Some(Self::NotFinite)
        }
    }
}

/// True if a topic has specific forces: a message in which one is finite and not zero.
pub(crate) fn has_forces(log: &FlightLog, topic: &str) -> bool {
    let found = log.find_message(topic, |data| {
        messages::read_imu(data).ok().filter(|imu: &ImuMessage| is_measured(&imu.specific_force_m_per_s2))
    });
    found.is_some()
}

/// True for a finite vector that is not exactly zero.
pub(crate) fn is_measured(vector: &Vector3<f64>) -> bool {
    vector.iter().all(|value| value.is_finite()) && *vector != Vector3::zeros()
}

/// Sample that an [`ImuFilter`] judges.
pub(crate) trait FilteredSample: Clone {
    fn stamp_ns(&self) -> i64;
    /// Angular velocity in rad/s.
    fn rate(&self) -> &Vector3<f64>;
    /// True if all values are equal.
    fn equals(&self, other: &Self) -> bool;
}

impl FilteredSample for ImuSample {
    fn stamp_ns(&self) -> i64 {
        self.stamp_ns
    }

    fn rate(&self) -> &Vector3<f64> {
        &self.angular_velocity_rad_per_s
    }

    fn equals(&self, other: &Self) -> bool {
        self.angular_velocity_rad_per_s == other.angular_velocity_rad_per_s
            && self.specific_force_m_per_s2 == other.specific_force_m_per_s2
    }
}

impl FilteredSample for (i64, Vector3<f64>) {
    fn stamp_ns(&self) -> i64 {
        self.0
    }

    fn rate(&self) -> &Vector3<f64> {
        &self.1
    }

    fn equals(&self, other: &Self) -> bool {
        self.1 == other.1
    }
}

/// Judges finite samples in the order of their stamps by those around them.
#[derive(Clone, Debug)]
pub(crate) struct ImuFilter<T> {
    /// Last sample that was passed on.
    last: Option<T>,
    /// Number of consecutive samples before `last`, each different from the one before.
    changing: usize,
    /// Samples whose judgement depends on the next ones, and its reason.
    waiting: Vec<T>,
    suspicion: Unmeasured,
    /// True while every further copy of `last` is frozen.
    frozen: bool,
    /// Judged samples, `Some` with the reason if they are no measurement.
    judged: VecDeque<(T, Option<Unmeasured>)>,
}

impl<T> Default for ImuFilter<T> {
    fn default() -> Self {
        let (waiting, judged) = (Vec::new(), VecDeque::new());
        Self { last: None, changing: 0, waiting, suspicion: Unmeasured::ZeroRate, frozen: false, judged }
    }
}

impl<T: FilteredSample> ImuFilter<T> {
    /// Adds the next sample; stamps must not decrease.
    pub(crate) fn push(&mut self, sample: T) {
        let is_copy = self.last.as_ref().is_some_and(|last| last.equals(&sample));
        let is_zero = *sample.rate() == Vector3::zeros();
        if self.frozen {
            if is_copy {
                return self.judged.push_back((sample, Some(Unmeasured::Frozen)));
            }
            self.frozen = false;
        }
        if let Some(first) = self.waiting.first() {
            match self.suspicion {
                Unmeasured::Frozen if is_copy => {
                    self.waiting.push(sample);
                    self.frozen = self.waiting.len() >= FROZEN_COPIES;
                    if self.frozen {
                        self.changing = 0;
                        self.judge(Some(Unmeasured::Frozen));
                    }
                    return;
                }
                Unmeasured::ZeroRate if is_zero && sample.stamp_ns() - first.stamp_ns() <= LONGEST_ZERO_NS => {
                    return self.waiting.push(sample);
                }
                Unmeasured::ZeroRate if !is_zero && sample.rate().norm() > ROTATING_RAD_PER_S => {
                    self.judge(Some(Unmeasured::ZeroRate));
                }
                _ => self.judge(None),
            }
        }
        // Samples that were passed on just now have changed `last`.
        let last = self.last.as_ref();
        let rotated = last.is_some_and(|last| last.rate().norm() > ROTATING_RAD_PER_S);
        let repeats = last.is_some_and(|last| last.equals(&sample)) && self.changing >= CHANGING_SAMPLES;
        // A sensor without noise has no rate at all while it stands.
        if repeats && !is_zero {
            self.suspicion = Unmeasured::Frozen;
            self.waiting.push(sample);
        } else if is_zero && rotated {
            self.suspicion = Unmeasured::ZeroRate;
            self.waiting.push(sample);
        } else {
            self.pass(sample);
        }
    }

    /// Passes on the samples whose judgement would depend on later ones.
    pub(crate) fn finish(&mut self) {
        self.judge(None);
    }

    /// Next judged sample, with the reason if it is no measurement.
    pub(crate) fn pop(&mut self) -> Option<(T, Option<Unmeasured>)> {
        self.judged.pop_front()
    }

    /// Judges the waiting samples.
    fn judge(&mut self, reason: Option<Unmeasured>) {
        for sample in std::mem::take(&mut self.waiting) {
            match reason {
                Some(_) => self.judged.push_back((sample, reason)),
                None => self.pass(sample),
            }
        }
    }

    fn pass(&mut self, sample: T) {
        let is_copy = self.last.as_ref().is_some_and(|last| last.equals(&sample));
        self.changing = if is_copy { 0 } else { self.changing + 1 };
        self.last = Some(sample.clone());
        self.judged.push_back((sample, None));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SplitMix64;

    const PERIOD_NS: i64 = 5_000_000;

    /// Numbers of the samples that are no measurement, with their reasons; `change` changes a sample of a rotation with
    /// noise by its number.
    fn judged(count: i64, change: impl Fn(i64, &mut ImuSample)) -> Vec<(i64, Unmeasured)> {
        let mut random = SplitMix64::new(5);
        let mut filter = ImuFilter::default();
        let mut passed = 0;
        for number in 0..count {
            let mut noise = || Vector3::from_fn(|_, _| 0.01 * (random.next_unit() - 0.5));
            let mut sample = ImuSample {
                stamp_ns: number * PERIOD_NS,
                angular_velocity_rad_per_s: Vector3::new(0.3, -0.1, 0.2) + noise(),
                specific_force_m_per_s2: Vector3::new(0.0, 0.0, 9.81) + noise(),
                unmeasured_s: 0.0,
            };
            change(number, &mut sample);
            filter.push(sample);
        }
        filter.finish();
        let mut dropped = Vec::new();
        while let Some((sample, reason)) = filter.pop() {
            match reason {
                Some(reason) => dropped.push((sample.stamp_ns / PERIOD_NS, reason)),
                None => passed += 1,
            }
        }
        assert_eq!(passed + dropped.len() as i64, count);
        dropped
    }

    #[test]
    fn zeros_of_one_message_are_judged_by_its_values() {
        let (zero, one) = (Vector3::zeros(), Vector3::x());
        let nan = Vector3::new(0.0, f64::NAN, 0.0);
        assert_eq!(Unmeasured::of(&zero, &zero, true), Some(Unmeasured::AllZero));
        assert_eq!(Unmeasured::of(&one, &zero, true), Some(Unmeasured::ZeroForce));
        assert_eq!(Unmeasured::of(&zero, &one, true), None);
        assert_eq!(Unmeasured::of(&one, &nan, true), Some(Unmeasured::NotFinite));
        // A topic without specific forces.
        assert_eq!(Unmeasured::of(&one, &zero, false), None);
        assert_eq!(Unmeasured::of_vector(&zero, Some(Unmeasured::ZeroForce)), Some(Unmeasured::ZeroForce));
        assert_eq!(Unmeasured::of_vector(&zero, None), None);
    }

    #[test]
    fn zero_rates_within_a_rotation_are_dropped() {
        let zero = |numbers: &'static [i64]| {
            move |number: i64, sample: &mut ImuSample| {
                if numbers.contains(&number) {
                    sample.angular_velocity_rad_per_s = Vector3::zeros();
                }
            }
        };
        let expected: Vec<_> = [7, 30, 31].map(|number| (number, Unmeasured::ZeroRate)).into();
        assert_eq!(judged(100, zero(&[7, 30, 31])), expected);
        // The last sample has none behind it.
        assert_eq!(judged(100, zero(&[99])), []);
    }

    #[test]
    fn zero_rates_of_a_stationary_vehicle_are_measurements() {
        // A driver rounds to zero while the vehicle stands.
        let stops = |number: i64, sample: &mut ImuSample| {
            let speed = 1.0 - (number as f64 / 40.0).min(1.0) + ((number as f64 - 500.0) / 40.0).clamp(0.0, 1.0);
            sample.angular_velocity_rad_per_s = Vector3::new(0.3, 0.0, 0.0) * speed;
        };
        assert_eq!(judged(600, stops), []);
    }

    #[test]
    fn copies_after_changing_samples_are_frozen() {
        let freeze = |from: i64, to: i64| {
            move |number: i64, sample: &mut ImuSample| {
                if (from..to).contains(&number) {
                    sample.angular_velocity_rad_per_s = Vector3::new(0.1, 0.2, 0.3);
                    sample.specific_force_m_per_s2 = Vector3::new(0.1, 0.2, 9.8);
                }
            }
        };
        let expected: Vec<_> = (71..90).map(|number| (number, Unmeasured::Frozen)).collect();
        assert_eq!(judged(200, freeze(70, 90)), expected);
        // Two equal neighbours can be chance, and without changes before nothing is known about the noise.
        assert_eq!(judged(200, freeze(70, 72)), []);
        assert_eq!(judged(200, freeze(0, 90)), []);
        assert_eq!(judged(200, freeze(30, 90)), []);
        // Every measurement is sent twice.
        let twice = |number: i64, sample: &mut ImuSample| {
            sample.angular_velocity_rad_per_s = Vector3::new((number / 2) as f64 * 0.001, 0.1, 0.0);
            sample.specific_force_m_per_s2 = Vector3::new(0.0, 0.0, 9.81);
        };
        assert_eq!(judged(200, twice), []);
    }
}
