//! Angles that mean the same direction.

use std::f64::consts::{PI, TAU};

/// The equal angle within [−π, π), in radians: a half turn to either side is −π. An angle that already lies there comes
/// back as it is, bit by bit.
pub fn wrap_angle(angle_rad: f64) -> f64 {
    let turns = ((angle_rad + PI) / TAU).floor();
    angle_rad - turns * TAU
}
