//! Offset of a camera's clock by the specific forces, whose magnitude does not depend on the rotation of a gimbal.

use nalgebra::{SMatrix, SVector, Vector3};

use super::super::super::ForceAgreement;
use super::super::recorded::RecordedImu;
use super::rates;
use crate::geometry::{correlation, ns_from_seconds, seconds_from_ns, so3};
use crate::sensors::AngularRates;

/// Search range on either side of the first guess, in seconds.
const SEARCH_S: f64 = 60.0;
/// Length of the averages in the search, and in the refinement, in seconds: vibrations are no common motion.
const COARSE_S: f64 = 0.05;
const FINE_S: f64 = 0.02;
/// Shortest overlap of both recordings, in seconds.
const MIN_OVERLAP_S: f64 = 10.0;
/// Smallest correlation of the magnitudes of both specific forces.
const MIN_CORRELATION: f64 = 0.7;
/// Offsets closer than this count as one, in seconds.
const DISTINCT_S: f64 = 0.25;
/// Minimum ratio of the unexplained variance at the next offset to that at the best one.
const MIN_DISTINCTION: f64 = 1.5;
/// Prior standard deviation of the drift between two quartz clocks.
const DRIFT_SIGMA: f64 = 1e-4;
/// Length of the sections whose residuals are taken as independent for the standard deviation, in seconds.
const SECTION_S: f64 = 2.0;
/// Largest standard deviation of a usable offset, in seconds.
const MAX_SIGMA_S: f64 = 0.02;
const ITERATIONS: usize = 15;
/// Update of the offset below which the iterations end.
const CONVERGED_S: f64 = 1e-6;
/// Prior standard deviation of the position of a camera in the vehicle, in metres.
const ARM_SIGMA_M: f64 = 0.3;
/// Longest distance of two averages that are interpolated, in seconds.
const LONGEST_STEP_S: f64 = 0.08;
/// Most averages of a recording: five hours of the finer ones.
const MAX_AVERAGES: usize = 1_000_000;

/// Clock of the camera by the specific forces: `t_log = start + (1 + drift) · t_video`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct ForceClock {
    pub(in super::super) start_ns: i64,
    pub(in super::super) drift: f64,
    pub(in super::super) agreement: ForceAgreement,
}

/// Times in seconds since `origin_ns` and specific forces in m/s².
fn forces(imu: &RecordedImu, origin_ns: i64) -> Vec<(f64, Vector3<f64>)> {
    let since = |time_ns: i64| seconds_from_ns(time_ns.saturating_sub(origin_ns));
    let combined = imu.combined.iter().map(|(time_ns, [_, force])| (since(*time_ns), *force));
    let apart = imu.accelerometer.iter().map(|(time_ns, force)| (since(*time_ns), *force));
    if imu.combined.is_empty() { apart.collect() } else { combined.collect() }
}

/// Averages over intervals of `step_s`, at the mean time of their samples; `None` where there are none.
fn averages(samples: &[(f64, Vector3<f64>)], step_s: f64) -> Vec<Option<(f64, Vector3<f64>)>> {
    let Some((first_s, last_s)) = samples.first().zip(samples.last()).map(|(first, last)| (first.0, last.0)) else {
        return Vec::new();
    };
    let count = (((last_s - first_s) / step_s) as usize).min(MAX_AVERAGES) + 1;
    let mut sums = vec![(0.0, Vector3::zeros(), 0.0); count];
    for (time_s, value) in samples {
        let place = ((time_s - first_s) / step_s).max(0.0) as usize;
        if let Some((times, values, number)) = sums.get_mut(place) {
            (*times, *values, *number) = (*times + time_s, *values + value, *number + 1.0);
        }
    }
    sums.into_iter().map(|(times, values, number)| (number > 0.0).then(|| (times / number, values / number))).collect()
}

/// Offset of the camera's clock at which the magnitudes of both specific forces agree, within 60 s of a guess of the log
/// time at which the video starts; `None` if no single offset explains them.
pub(in super::super) fn clock_by_forces(
    vehicle: &RecordedImu,
    camera: &RecordedImu,
    guess_ns: i64,
) -> Option<ForceClock> {
    // Both clocks begin at the start of the video, so that the offset is zero where the guess is right.
    let (of_vehicle, of_camera) = (forces(vehicle, guess_ns), forces(camera, 0));
    let (offset_s, correlation) = coarse_offset(&averages(&of_vehicle, COARSE_S), &averages(&of_camera, COARSE_S))?;
    let averaged = averages(&of_camera, FINE_S).into_iter().flatten();
    let measured: Vec<(f64, f64)> = averaged.map(|(time_s, force)| (time_s, force.norm())).collect();
    let (offset_s, drift, sigma_s) =
        refined(&reference_forces(&of_vehicle, &rates(vehicle, guess_ns)), &measured, offset_s)?;
    let agreement = ForceAgreement { correlation, offset_sigma_s: sigma_s };
    let start_ns = guess_ns.saturating_add(ns_from_seconds(offset_s));
    (sigma_s <= MAX_SIGMA_S).then_some(ForceClock { start_ns, drift, agreement })
}

/// Specific force of the vehicle at a time.
#[derive(Clone, Copy, Debug)]
struct ReferenceForce {
    time_s: f64,
    /// Magnitude of the specific force in m/s².
    magnitude: f64,
    /// Derivative of the magnitude by the position of the other IMU in the vehicle, `f̂ᵀ ([α]× + [ω]×²)`, in 1/s².
    by_arm: Vector3<f64>,
}

fn reference_forces(forces: &[(f64, Vector3<f64>)], rates: &AngularRates) -> Vec<ReferenceForce> {
    let of_average = |(time_s, force): (f64, Vector3<f64>)| {
        let mean = |from_s: f64, to_s: f64| Some(rates.angle_between(from_s, to_s)? / (to_s - from_s));
        let (before, after) = (mean(time_s - FINE_S, time_s), mean(time_s, time_s + FINE_S));
        // At the ends the arm is left out.
        let by_arm = before.zip(after).map_or_else(Vector3::zeros, |(before, after)| {
            let rotation = so3::hat(&((before + after) / 2.0));
            let carried = so3::hat(&((after - before) / FINE_S)) + rotation * rotation;
            carried.tr_mul(&force.normalize())
        });
        ReferenceForce { time_s, magnitude: force.norm(), by_arm }
    };
    let moving = |(_, force): &(f64, Vector3<f64>)| force.norm() > 0.0;
    averages(forces, FINE_S).into_iter().flatten().filter(moving).map(of_average).collect()
}

/// Offset in seconds with the most significant correlation of the magnitudes, and that correlation; `None` if it is small or
/// ambiguous.
fn coarse_offset(
    reference: &[Option<(f64, Vector3<f64>)>],
    measured: &[Option<(f64, Vector3<f64>)>],
) -> Option<(f64, f64)> {
    let start =
        |averages: &[Option<(f64, Vector3<f64>)>]| averages.first().copied().flatten().map(|(time_s, _)| time_s);
    let magnitudes = |averages: &[Option<(f64, Vector3<f64>)>]| -> Vec<Option<f64>> {
        averages.iter().map(|average| average.map(|(_, force)| force.norm())).collect()
    };
    let base_s = start(reference)? - start(measured)?;
    let (reference, measured) = (magnitudes(reference), magnitudes(measured));
    let needed = (MIN_OVERLAP_S / COARSE_S) as usize;
    let range = |limit_s: f64| ((limit_s - base_s) / COARSE_S).round() as i64;
    let at = |lag: i64| {
        let pairs = measured.iter().enumerate().filter_map(|(place, average)| {
            let other = reference.get(usize::try_from(lag + place as i64).ok()?)?;
            Some(((*average)?, (*other)?))
        });
        let (correlation, count) = correlation(pairs)?;
        let significance = correlation.min(1.0 - 1e-9).atanh() * (count as f64).sqrt();
        (count >= needed).then_some((significance, base_s + lag as f64 * COARSE_S, correlation))
    };
    let all: Vec<(f64, f64, f64)> = (range(-SEARCH_S)..=range(SEARCH_S)).filter_map(at).collect();
    let best = all.iter().max_by(|one, other| one.0.total_cmp(&other.0))?;
    let others = all.iter().filter(|other| (other.1 - best.1).abs() > DISTINCT_S);
    let next = others.map(|other| other.2.max(0.0)).fold(0.0, f64::max);
    let distinct = 1.0 - next * next >= MIN_DISTINCTION * (1.0 - best.2 * best.2);
    (best.2 >= MIN_CORRELATION && distinct).then_some((best.1, best.2))
}

/// Unknowns: offset in the middle, drift, level, scale, position of the camera's IMU in the vehicle (3).
const UNKNOWNS: usize = 7;
type Information = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
type Gradient = SVector<f64, UNKNOWNS>;

/// Offset at the start of the video in seconds, drift, and standard deviation of the offset in the middle, by least
/// squares of `measured(t) = level + scale · |f|(t') + ∂|f|/∂arm(t') · arm` with `t' = t + offset + drift · (t − middle)`.
///
/// Differences of the two magnitudes, for example by the motion of the camera in the gimbal, last longer than a sample:
/// the standard deviation is computed from sums over sections.
fn refined(reference: &[ReferenceForce], measured: &[(f64, f64)], offset_s: f64) -> Option<(f64, f64, f64)> {
    let middle_s = measured.iter().map(|(time_s, _)| time_s).sum::<f64>() / measured.len().max(1) as f64;
    let mut state = Gradient::zeros();
    (state[0], state[3]) = (offset_s, 1.0);
    let prior_sigmas = [(1, DRIFT_SIGMA), (4, ARM_SIGMA_M), (5, ARM_SIGMA_M), (6, ARM_SIGMA_M)];
    let mut sigma_s = f64::INFINITY;
    for _ in 0..ITERATIONS {
        let (mut information, mut gradient) = (Information::zeros(), Gradient::zeros());
        let mut sections: Vec<(i64, Gradient)> = Vec::new();
        let (mut squares, mut count) = (0.0, 0.0);
        for (time_s, value) in measured {
            let since_s = time_s - middle_s;
            let Some((force, slope)) = interpolated(reference, time_s + state[0] + state[1] * since_s) else {
                continue;
            };
            let by_time = state[3] * slope;
            let arm = force.by_arm;
            let by = Gradient::from([by_time, by_time * since_s, 1.0, force.magnitude, arm.x, arm.y, arm.z]);
            let residual = value - state[2] - state[3] * force.magnitude - arm.dot(&state.fixed_rows::<3>(4));
            information += by * by.transpose();
            gradient += by * residual;
            let section = (time_s / SECTION_S).floor() as i64;
            match sections.last_mut().filter(|(last, _)| *last == section) {
                Some((_, sum)) => *sum += by * residual,
                None => sections.push((section, by * residual)),
            }
            squares += residual * residual;
            count += 1.0;
        }
        let variance: f64 = squares / f64::max(count, 1.0);
        for (place, sigma) in prior_sigmas {
            information[(place, place)] += variance / (sigma * sigma);
            gradient[place] -= state[place] * variance / (sigma * sigma);
        }
        let inverse = information.try_inverse()?;
        let mut step = inverse * gradient;
        let between: Information = sections.iter().map(|(_, sum)| sum * sum.transpose()).sum();
        sigma_s = (inverse * between * inverse)[(0, 0)].max(0.0).sqrt();
        step[0] = step[0].clamp(-COARSE_S, COARSE_S);
        state += step;
        if step[0].abs() < CONVERGED_S {
            break;
        }
    }
    let (offset_s, drift) = (state[0] - state[1] * middle_s, state[1]);
    [offset_s, drift, sigma_s].iter().all(|value| value.is_finite()).then_some((offset_s, drift, sigma_s))
}

/// Force at a time and the derivative of its magnitude by time, linear between neighbours; `None` outside the samples or in
/// a gap.
fn interpolated(samples: &[ReferenceForce], time_s: f64) -> Option<(ReferenceForce, f64)> {
    let after = samples.partition_point(|sample| sample.time_s <= time_s);
    let (from, to) = (samples.get(after.checked_sub(1)?)?, samples.get(after)?);
    let length_s = to.time_s - from.time_s;
    let (slope, fraction) = ((to.magnitude - from.magnitude) / length_s, (time_s - from.time_s) / length_s);
    let magnitude = from.magnitude + fraction * (to.magnitude - from.magnitude);
    let by_arm = from.by_arm + fraction * (to.by_arm - from.by_arm);
    (length_s <= LONGEST_STEP_S).then_some((ReferenceForce { time_s, magnitude, by_arm }, slope))
}
