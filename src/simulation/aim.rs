//! Heading of the vehicle that swings about the direction of what there is to see, at which the gimbal keeps pointing.

use nalgebra::{Vector2, Vector3};

use super::route::{Flight, FlightPoint, Manoeuvres};
use crate::geometry::wrap_angle;

/// Period of the swing: an amplitude of 90° then has a rate of 1.2 rad/s, half of the vehicle's limit.
const PERIOD_S: f64 = 8.0;

/// Direction of what there is to see, and swing of the vehicle's heading about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Position in plan view of what there is to see; `None` if that lies along the route.
    pub(crate) target_m: Option<Vector2<f64>>,
    /// Amplitude of the swing.
    pub(crate) swing_rad: f64,
}

impl Aim {
    /// Heading relative to the direction of what there is to see, 0 while the vehicle hovers at the start.
    pub(crate) fn swing_at(&self, time_s: f64) -> f64 {
        let pace = Manoeuvres::aggressive();
        let phase = std::f64::consts::TAU * (time_s - pace.hover_s) / PERIOD_S;
        self.swing_rad * pace.liveliness(time_s) * phase.sin()
    }

    /// Heading from a position to what there is to see, by whole revolutions nearest to `near_rad`, the direction of the route.
    pub(crate) fn direction_rad(&self, position_m: &Vector3<f64>, near_rad: f64) -> f64 {
        let Some(target_m) = self.target_m else { return near_rad };
        let to_target = target_m - position_m.xy();
        near_rad + wrap_angle(to_target.y.atan2(to_target.x) - near_rad)
    }
}

/// Flight whose heading swings about the direction of what there is to see.
pub struct Aimed {
    pub flight: Box<dyn Flight>,
    pub aim: Aim,
}

impl Flight for Aimed {
    fn knot_s(&self) -> f64 {
        self.flight.knot_s()
    }

    fn point(&self, time_s: f64) -> FlightPoint {
        let point = self.flight.point(time_s);
        let direction_rad = self.aim.direction_rad(&point.position_m, point.heading_rad);
        FlightPoint { heading_rad: direction_rad + self.aim.swing_at(time_s), ..point }
    }
}
