//! IMU samples of a whole log, without those that no sensor measured.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::flight_log::imu::filter::{FilteredSample, ImuFilter, Unmeasured, is_measured};
use crate::flight_log::imu::merge::ImuMerge;
use crate::sensors::ImuSample;

/// Stamps of the messages that are no measurement, by reason.
pub(crate) type UnmeasuredStamps = BTreeMap<Unmeasured, Vec<i64>>;

/// Samples with all six values in the order of their stamps, from messages in any order. Specific forces of a separate
/// `accelerometer` replace the messages' forces; it is left ordered and without invalid measurements.
pub(crate) fn measured(
    messages: Vec<ImuSample>,
    accelerometer: &mut Vec<(i64, Vector3<f64>)>,
    dropped: &mut UnmeasuredStamps,
) -> Vec<ImuSample> {
    if accelerometer.is_empty() {
        measured_together(messages, dropped)
    } else {
        measured_apart(&messages, accelerometer, dropped)
    }
}

/// Samples of an IMU whose messages have all six values.
fn measured_together(messages: Vec<ImuSample>, dropped: &mut UnmeasuredStamps) -> Vec<ImuSample> {
    let has_forces = messages.iter().any(|sample| is_measured(&sample.specific_force_m_per_s2));
    let reason = |sample: &ImuSample| {
        Unmeasured::of(&sample.angular_velocity_rad_per_s, &sample.specific_force_m_per_s2, has_forces)
    };
    filtered(messages, reason, dropped)
}

/// Samples of a gyroscope with the specific forces of a separate accelerometer, both in any order.
fn measured_apart(
    gyroscope: &[ImuSample],
    accelerometer: &mut Vec<(i64, Vector3<f64>)>,
    dropped: &mut UnmeasuredStamps,
) -> Vec<ImuSample> {
    let zero = accelerometer.iter().any(|(_, force)| is_measured(force)).then_some(Unmeasured::ZeroForce);
    let of_force = |(_, force): &(i64, Vector3<f64>)| Unmeasured::of_vector(force, zero);
    for (stamp_ns, force) in accelerometer.iter() {
        if let Some(reason) = Unmeasured::of_vector(force, zero) {
            dropped.entry(reason).or_default().push(*stamp_ns);
        }
    }
    accelerometer.retain(|force| of_force(force).is_none());
    accelerometer.sort_by_key(|(stamp_ns, _)| *stamp_ns);
    let rates = gyroscope.iter().map(|sample| (sample.stamp_ns, sample.angular_velocity_rad_per_s)).collect();
    let mut merge = ImuMerge::default();
    for (stamp_ns, rate) in filtered(rates, |(_, rate)| Unmeasured::of_vector(rate, None), dropped) {
        merge.push_gyroscope(stamp_ns, rate);
    }
    for (stamp_ns, force) in accelerometer {
        merge.push_accelerometer(*stamp_ns, *force);
    }
    std::iter::from_fn(|| merge.pop()).collect()
}

/// Samples in the order of their stamps, one for each stamp, that are measurements.
fn filtered<T: FilteredSample>(
    mut messages: Vec<T>,
    reason: impl Fn(&T) -> Option<Unmeasured>,
    dropped: &mut UnmeasuredStamps,
) -> Vec<T> {
    let mut drop_sample = |reason: Unmeasured, stamp_ns: i64| dropped.entry(reason).or_default().push(stamp_ns);
    messages.sort_by_key(FilteredSample::stamp_ns);
    messages.retain(|sample| match reason(sample) {
        Some(reason) => {
            drop_sample(reason, sample.stamp_ns());
            false
        }
        None => true,
    });
    messages.dedup_by_key(|sample| sample.stamp_ns());
    let mut filter = ImuFilter::default();
    for sample in messages {
        filter.push(sample);
    }
    filter.finish();
    let mut samples = Vec::new();
    while let Some((sample, reason)) = filter.pop() {
        match reason {
            Some(reason) => drop_sample(reason, sample.stamp_ns()),
            None => samples.push(sample),
        }
    }
    samples
}
