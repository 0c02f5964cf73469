//! Small functions of numbers: time units and intervals, angles, lengths in the image plane, tangent plane of a direction,
//! ticks of an axis.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3x2, UnitQuaternion, Vector3};

pub fn seconds_from_ns(time_ns: i64) -> f64 {
    time_ns as f64 * 1e-9
}

/// Rounded to the nearest nanosecond.
pub fn ns_from_seconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

/// True if a time lies in an interval given as start and length, both in seconds; false without an interval.
pub fn during(interval_s: Option<[f64; 2]>, time_s: f64) -> bool {
    interval_s.is_some_and(|[start_s, length_s]| time_s >= start_s && time_s < start_s + length_s)
}

/// Rise from 0 to 1 over the same range of `fraction`, with first and second derivatives of zero at both ends.
pub fn smooth_step(fraction: f64) -> f64 {
    fraction * fraction * fraction * (fraction * (fraction * 6.0 - 15.0) + 10.0)
}

/// Returns the equivalent angle in [−π, π), in radians; π becomes −π. An angle already in this range is
/// returned bit by bit.
pub fn wrap_angle(angle_rad: f64) -> f64 {
    let revolutions = ((angle_rad + PI) / TAU).floor();
    angle_rad - revolutions * TAU
}

/// Returns the equivalent angle in (−π, π], in radians, for display and files.
pub fn principal_angle(angle_rad: f64) -> f64 {
    let revolutions = ((angle_rad - PI) / TAU).ceil();
    angle_rad - revolutions * TAU
}

/// Angle about the vertical (z) of the rotation about it that is nearest to `rotation`, in radians from −2π to 2π.
pub fn vertical_angle(rotation: &UnitQuaternion<f64>) -> f64 {
    2.0 * rotation.k.atan2(rotation.w)
}

/// Length of a vector in the plane, for inner loops over pixels.
#[expect(clippy::imprecise_flops, reason = "`hypot` is a call into the C library, this a vector instruction")]
#[expect(clippy::inline_always, reason = "code that is not inlined is not compiled for the registers of its caller")]
#[inline(always)]
pub fn planar_length([x, y]: [f32; 2]) -> f32 {
    (x * x + y * y).sqrt()
}

/// Returns an orthonormal basis of the plane tangent to the unit sphere at `direction`, one basis vector per column
/// (3 × 2).
///
/// With `direction` as third column the two form a right-handed frame: `first × second = direction`.
#[inline]
pub fn tangent_basis(direction: &Vector3<f64>) -> Matrix3x2<f64> {
    // The helper axis must not be parallel to the direction.
    let helper = if direction.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() };
    let first = direction.cross(&helper).normalize();
    let second = direction.cross(&first);
    Matrix3x2::from_columns(&[first, second])
}

/// Round values for the ticks of an axis from `low` to `high`, at most `max_count`, and their spacing.
pub fn ticks(low: f64, high: f64, max_count: usize) -> (Vec<f64>, f64) {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) || max_count == 0 {
        return (Vec::new(), 1.0);
    }
    let rough = span / max_count as f64;
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|digit| digit * power).find(|step| *step >= rough * 0.999_999);
    let step = step.unwrap_or(10.0 * power);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    // A range that is narrow relative to the magnitude of its values has no useful ticks.
    if last.saturating_sub(first) > 2 * max_count as i64 {
        return (Vec::new(), step);
    }
    ((first..=last).map(|number| number as f64 * step).collect(), step)
}
