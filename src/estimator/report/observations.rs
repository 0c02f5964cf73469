//! Packed observations of a feature in a report: they are by far the largest part of a recording.

use std::fmt;

use nalgebra::Vector2;

/// Observation of a feature in a frame of the window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservationReport {
    /// Index of the observing image in its stream.
    pub frame_index: usize,
    pub measured_px: Vector2<f64>,
    /// Predicted minus measured before the solve, in pixels; `None` behind the camera.
    pub residual_before_px: Option<Vector2<f64>>,
    /// Predicted minus measured after the solve, in pixels; `None` behind the camera.
    pub residual_after_px: Option<Vector2<f64>>,
    /// Squared whitened residual after the solve.
    pub chi2: f64,
    /// Robust weight, 0 to 1.
    pub robust_weight: f64,
}

/// Observations of one feature in the window; the anchor's comes first.
///
/// Stored in single precision, which resolves a ten-thousandth of a pixel at the far edge of an image.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Observations {
    packed: Box<[PackedObservation]>,
}

/// 36 bytes instead of 88; numbers are stored as bits, so that a missing value equals itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PackedObservation {
    frame_index: u32,
    measured_px: [u32; 2],
    residual_before_px: [u32; 2],
    residual_after_px: [u32; 2],
    chi2: u32,
    robust_weight: u32,
}

/// Missing residual: a NaN that no computation produces.
const MISSING: [u32; 2] = [0x7fc0_dead; 2];

impl Observations {
    pub fn len(&self) -> usize {
        self.packed.len()
    }

    pub fn is_empty(&self) -> bool {
        self.packed.is_empty()
    }

    pub fn iter(&self) -> impl ExactSizeIterator<Item = ObservationReport> + '_ {
        self.packed.iter().map(PackedObservation::unpacked)
    }

    pub(crate) fn heap_bytes(&self) -> usize {
        size_of_val(&*self.packed)
    }
}

impl FromIterator<ObservationReport> for Observations {
    fn from_iter<I: IntoIterator<Item = ObservationReport>>(observations: I) -> Self {
        Self { packed: observations.into_iter().map(|observation| PackedObservation::new(&observation)).collect() }
    }
}

impl fmt::Debug for Observations {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_list().entries(self.iter()).finish()
    }
}

impl PackedObservation {
    fn new(observation: &ObservationReport) -> Self {
        let bits = |number: f64| (number as f32).to_bits();
        let pair = |pair: Vector2<f64>| [bits(pair.x), bits(pair.y)];
        Self {
            frame_index: u32::try_from(observation.frame_index).unwrap_or(u32::MAX),
            measured_px: pair(observation.measured_px),
            residual_before_px: observation.residual_before_px.map_or(MISSING, pair),
            residual_after_px: observation.residual_after_px.map_or(MISSING, pair),
            chi2: bits(observation.chi2),
            robust_weight: bits(observation.robust_weight),
        }
    }

    fn unpacked(&self) -> ObservationReport {
        let number = |bits: u32| f64::from(f32::from_bits(bits));
        let pair = |[x, y]: [u32; 2]| Vector2::new(number(x), number(y));
        let residual = |bits: [u32; 2]| (bits != MISSING).then(|| pair(bits));
        ObservationReport {
            frame_index: self.frame_index as usize,
            measured_px: pair(self.measured_px),
            residual_before_px: residual(self.residual_before_px),
            residual_after_px: residual(self.residual_after_px),
            chi2: number(self.chi2),
            robust_weight: number(self.robust_weight),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(observation: ObservationReport) {
        let packed: Observations = std::iter::once(observation).collect();
        assert_eq!(packed, packed.clone());
        let back = packed.iter().next().unwrap();
        assert_eq!((packed.len(), back.frame_index), (1, observation.frame_index));
        assert!((back.measured_px - observation.measured_px).norm() < 1e-4, "{back:?}");
        for (is, was) in [
            (back.residual_before_px, observation.residual_before_px),
            (back.residual_after_px, observation.residual_after_px),
        ] {
            assert_eq!(is.is_some(), was.is_some(), "{back:?}");
            if let (Some(is), Some(was)) = (is, was) {
                assert!((is - was).norm() <= 1e-6 * was.norm(), "{is} and {was}");
            }
        }
        assert!((back.chi2 - observation.chi2).abs() <= 1e-6 * observation.chi2, "{back:?}");
        assert!((back.robust_weight - observation.robust_weight).abs() < 1e-7, "{back:?}");
    }

    #[test]
    fn packed_reports_keep_all_readable_values() {
        let observation = ObservationReport {
            frame_index: 11_999,
            measured_px: Vector2::new(1919.123, 0.031),
            residual_before_px: Some(Vector2::new(-3.217, 0.004)),
            residual_after_px: Some(Vector2::new(0.111, -1e-9)),
            chi2: 0.0123,
            robust_weight: 0.93,
        };
        check(observation);
        check(ObservationReport { residual_before_px: None, ..observation });
        check(ObservationReport { residual_after_px: None, chi2: 0.0, robust_weight: 0.0, ..observation });
    }

    #[test]
    fn not_a_number_differs_from_missing() {
        let wrong = Vector2::new(f64::NAN, 1.0);
        let observation = ObservationReport {
            frame_index: 0,
            measured_px: Vector2::zeros(),
            residual_before_px: Some(wrong),
            residual_after_px: None,
            chi2: 0.0,
            robust_weight: 0.0,
        };
        let packed: Observations = std::iter::once(observation).collect();
        let back = packed.iter().next().unwrap();
        assert!(back.residual_before_px.unwrap().x.is_nan() && back.residual_after_px.is_none());
    }
}
