use nalgebra::Vector3;

use crate::sensors::AngularRates;

/// Number of rows for which a sweep is computed.
const NODES: usize = 9;

/// Rotation of a camera during the readout of an image: rotation vectors by row, relative to the first row.
pub(super) struct ReadoutSweep([Vector3<f64>; NODES]);

impl ReadoutSweep {
    /// Rotation during the readout of an image whose first row is exposed at a time; zero without rates.
    pub(super) fn new(rates: &AngularRates, first_row_s: f64, readout_s: f64) -> Self {
        let start = rates.angle_at(first_row_s);
        Self(std::array::from_fn(|node| {
            let row_s = readout_s * node as f64 / (NODES - 1) as f64;
            match (start, rates.angle_at(first_row_s + row_s)) {
                (Some(start), Some(end)) => end - start,
                _ => Vector3::zeros(),
            }
        }))
    }

    /// Rotation vector (rad) at a row, as a ratio of the height: it maps directions in the camera at that row to the
    /// camera at the first row.
    pub(super) fn at(&self, row: f64) -> Vector3<f64> {
        let place = (row * (NODES - 1) as f64).clamp(0.0, (NODES - 1) as f64);
        let before = (place as usize).min(NODES - 2);
        self.0[before].lerp(&self.0[before + 1], place - before as f64)
    }
}
