//! Standard deviations of encoders and map, estimated from the residuals (variance components).

use serde::Serialize;

/// Largest σ of a joint angle without a reading, in rad: half a revolution.
pub(super) const FREE_ANGLE_SIGMA_RAD: f64 = std::f64::consts::PI;
/// Smallest standard deviation of a rotation, in rad.
const MIN_RAD: f64 = 1e-5;
/// Smallest standard deviation of a position, in m.
const MIN_M: f64 = 1e-5;

/// Noise of readings and map; the noise of the pixels is part of the poses.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StillsNoise {
    /// σ of the readings of each joint.
    pub encoder_rad: Vec<f64>,
    /// σ of the rotation of a rigid camera's pose by the map, common to a station, per coordinate.
    pub station_rotation_rad: f64,
    /// σ of the position of a rigid camera by the map, common to a station, per coordinate.
    pub station_position_m: f64,
    /// σ of the position of the gimbal camera by the map, per set and coordinate.
    pub set_position_m: f64,
}

impl StillsNoise {
    /// Noise of the first adjustment.
    pub(super) fn initial(joints: usize) -> Self {
        Self {
            encoder_rad: vec![0.02; joints],
            station_rotation_rad: 1e-3,
            station_position_m: 5e-3,
            set_position_m: 2e-3,
        }
    }
}

/// Effects of one component: sum of squares, number, and the part of the number that the data leave undetermined.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EffectSum {
    squares: f64,
    count: f64,
    /// Sum of posterior over prior variances.
    undetermined: f64,
}

impl EffectSum {
    /// Adds an effect with its posterior variance, which had the standard deviation `sigma` before.
    pub(super) fn add(&mut self, effect: f64, variance: f64, sigma: f64) {
        self.squares += effect * effect;
        self.count += 1.0;
        self.undetermined += (variance / (sigma * sigma)).min(1.0);
    }

    /// Subtracts estimated coefficients of functions of these effects.
    pub(super) fn less(mut self, coefficients: usize) -> Self {
        self.undetermined += coefficients as f64;
        self
    }

    /// Standard deviation by the fixed point of restricted maximum likelihood, `σ² = Σu²/(n − Σ var(u)/σ²)`
    /// (Harville 1977); the previous one if the data do not determine any of the effects.
    pub(super) fn sigma(&self, previous: f64, is_angle: bool) -> f64 {
        let determined = self.count - self.undetermined;
        let least = if is_angle { MIN_RAD } else { MIN_M };
        if determined < 1e-6 { previous } else { (self.squares / determined).sqrt().max(least) }
    }
}
