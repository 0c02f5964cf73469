//! Features that slide with the viewpoint: moderate residuals on every observation, all to one side.

use super::fixture;
use crate::estimator::config::{EstimatorOptions, VisualLoss};
use crate::estimator::{Estimator, Phase, StepReport};
use crate::geometry::{vertical_angle, wrap_angle};
use crate::gimbal::Parameterization;
use crate::optimization::RobustLoss;
use crate::simulation::{SyntheticFlight, SyntheticMount, SyntheticOptions, synthetic_tracks};

/// Ratio of the features that slide: one in four.
const SLIDING: u64 = 4;

/// Rigid flight in which a quarter of the features slide to the right, by this number of pixels times the square of their age in images.
fn sliding_flight(slide_px: f64) -> SyntheticFlight {
    let options = SyntheticOptions {
        mount: SyntheticMount::Static,
        duration_s: 14.0,
        pixel_sigma_px: 0.05,
        ..SyntheticOptions::default()
    };
    let mut flight = synthetic_tracks(&options);
    let camera = flight.given_rig.cameras[0].model.clone();
    for frame in &mut flight.frames {
        for feature in frame.tracks.features.iter_mut().filter(|feature| feature.id.0 % SLIDING == 0) {
            feature.uv_px.x += slide_px * f64::from(feature.age).powi(2);
            feature.bearing = camera.unproject(&feature.uv_px).unwrap_or(feature.bearing);
        }
    }
    flight
}

/// Reports of a run with a loss.
fn reports(flight: &SyntheticFlight, loss: VisualLoss) -> Vec<StepReport> {
    let options = EstimatorOptions { loss, ..EstimatorOptions::default() };
    let mut estimator = Estimator::new(fixture::config(&flight.given_rig, Parameterization::Minimal, options));
    flight.frames.iter().map(|frame| fixture::step(&mut estimator, frame, &frame.tracks, &[])).collect()
}

/// Heading error gained since the first pose at the last step, in radians.
fn heading_drift_rad(flight: &SyntheticFlight, reports: &[StepReport]) -> f64 {
    let heading = |report: &StepReport| {
        let truth = flight.frames[report.frame_index].true_world_from_imu.rotation;
        vertical_angle(&(report.newest().unwrap().world_from_imu.rotation * truth.inverse()))
    };
    let first = reports.iter().find(|report| report.phase == Phase::Tracking).unwrap();
    wrap_angle(heading(reports.last().unwrap()) - heading(first))
}

/// Mean robust weight of the observations of features that slide, and of the others, over the last second.
fn weights(reports: &[StepReport]) -> [f64; 2] {
    let mut sums = [(0.0, 0); 2];
    for feature in reports[reports.len() - 20..].iter().flat_map(|report| &report.features) {
        let (sum, count) = &mut sums[usize::from(feature.id.0 % SLIDING != 0)];
        *sum += feature.observations.iter().map(|seen| seen.robust_weight).sum::<f64>();
        *count += feature.observations.len();
    }
    sums.map(|(sum, count)| sum / f64::from(count as u32))
}

#[test]
fn sliding_features_lose_weight_as_a_whole_and_hardly_turn_the_estimate() {
    let flight = sliding_flight(0.01);
    let adaptive = reports(&flight, VisualLoss::Adaptive);
    let wide = reports(&flight, VisualLoss::Fixed(RobustLoss::Cauchy(1.0)));
    let [sliding, others] = weights(&adaptive);
    assert!(sliding < 0.75 * others && others > 0.6, "weights {sliding} and {others}");
    let [drift, wide_drift] = [&adaptive, &wide].map(|reports| heading_drift_rad(&flight, reports).abs());
    assert!(drift < wide_drift, "heading drift {drift} rad, with a wide loss {wide_drift} rad");
}

#[test]
fn the_loss_opens_for_noisy_images() {
    let options = SyntheticOptions {
        mount: SyntheticMount::Static,
        duration_s: 8.0,
        pixel_sigma_px: 0.5,
        ..SyntheticOptions::default()
    };
    let flight = synthetic_tracks(&options);
    let last = |loss: VisualLoss| {
        let report = reports(&flight, loss).pop().unwrap();
        report.newest().unwrap().world_from_imu
    };
    let (adaptive, widest) = (last(VisualLoss::Adaptive), last(VisualLoss::Fixed(RobustLoss::Cauchy(1.0))));
    assert_eq!(adaptive, widest, "the scale stays at its upper bound");
}
