//! Angles modulo 2π.

use std::f64::consts::{PI, TAU};

/// The equivalent angle in [−π, π), in radians; π becomes −π. An angle that already lies there is returned bit by bit.
pub fn wrap_angle(angle_rad: f64) -> f64 {
    let revolutions = ((angle_rad + PI) / TAU).floor();
    angle_rad - revolutions * TAU
}
