//! Angles modulo 2π.

use std::f64::consts::{PI, TAU};

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
