//! Derivatives against central differences.

use nalgebra::{DVector, Vector3, Vector6};

use super::fixture::{Flight, flight, true_states};
use crate::calibration::border_prior::BorderTerm;
use crate::calibration::bundle::{Bundle, Priors};
use crate::calibration::frame_sets::{FrameSet, frame_sets};
use crate::calibration::state::{BundleEstimate, Camera, Columns, ViewId};
use crate::calibration::visual::{BundleTrack, PixelModel};
use crate::calibration::{CalibrationOptions, observations};
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::{ImuBias, gravity_in_world};
use crate::geometry::RigidTransform;
use crate::optimization::{CameraPose, RobustLoss};
use crate::simulation::{SyntheticMotion, SyntheticOptions};

const STEP: f64 = 1e-6;

/// Short flight whose gimbal images are 50 ms after the static ones, at an estimate away from the ground truth.
struct Example {
    flight: Flight,
    frame_sets: Vec<FrameSet>,
    estimate: BundleEstimate,
    tracks: Vec<BundleTrack>,
    priors: Priors,
    columns: Columns,
}

fn example() -> Example {
    let mut flight = flight(&SyntheticOptions {
        duration_s: 1.5,
        features: 25,
        motion: SyntheticMotion::Aggressive,
        ..SyntheticOptions::default()
    });
    let odd = |view: &crate::calibration::TrackedView| view.frame_index % 2 == 1;
    flight.input.gimbal_camera.views.retain(odd);
    let options = CalibrationOptions { spacing_s: 0.2, ..CalibrationOptions::default() };
    let states: Vec<_> = true_states(&flight).into_iter().map(Some).collect();
    let (frame_sets, navigation) = frame_sets(&flight.input, &options, &states);
    assert!(frame_sets.iter().filter(|frame_set| frame_set.gimbal.is_some()).count() > 4);
    let border = BorderTerm::new(&flight.input, &options);
    let chain = border.chain.given.clone();
    let priors = Priors {
        border,
        start: StartPrior {
            reference: navigation[0].world_from_imu,
            bias: ImuBias::default(),
            gyroscope_bias_sigma: Vector3::repeat(0.05),
            accelerometer_bias_sigma: Vector3::repeat(0.5),
            gimbal_bias_sigmas: None,
        },
    };
    let joint = |frame_set: &FrameSet| {
        frame_set
            .gimbal
            .as_ref()
            .map_or_else(|| vec![0.0; 3], |g| g.encoder.angles_rad.iter().map(|q| q + 0.01).collect())
    };
    let mut estimate = BundleEstimate {
        joints_rad: frame_sets.iter().map(joint).collect(),
        navigation,
        extrinsics: flight.true_extrinsics,
        shifts_s: [0.002, -0.003],
        chain: chain.plus(&DVector::from_fn(chain.dof(), |k, _| 0.001 * (k as f64).sin())),
        landmarks: Vec::new(),
    };
    let columns = Columns { frame_sets: frame_sets.len(), joints: 3, chain: chain.dof() };
    let mut tracks = observations::collect(&flight.input, &options, &frame_sets, Camera::Static, &|_| true);
    tracks.extend(observations::collect(&flight.input, &options, &frame_sets, Camera::Gimbal, &|_| true));
    let mut example =
        Example { flight, frame_sets, estimate: estimate.clone(), tracks: tracks.clone(), priors, columns };
    let poses = bundle(&example).poses(&estimate);
    let (tracks, landmarks) = observations::triangulated(tracks, &poses, &options);
    assert!(tracks.iter().any(|track| track.observations[0].view.camera() == Camera::Gimbal));
    estimate.landmarks = landmarks;
    (example.estimate, example.tracks) = (estimate, tracks);
    example
}

fn bundle(example: &Example) -> Bundle<'_> {
    Bundle {
        columns: example.columns,
        frame_sets: &example.frame_sets,
        gravity_in_world: gravity_in_world(9.81),
        priors: &example.priors,
        pixels: PixelModel {
            cameras: [&example.flight.input.static_camera.model, &example.flight.input.gimbal_camera.model],
            sigma_px: [0.5, 0.7],
            loss: RobustLoss::Huber(1.5),
        },
        tracks: &example.tracks,
    }
}

fn pose_difference(to: &CameraPose, from: &CameraPose) -> Vector6<f64> {
    let pose = |view: &CameraPose| {
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(view.rotation);
        RigidTransform::new(nalgebra::UnitQuaternion::from_rotation_matrix(&rotation), view.position_m)
    };
    pose(to).minus(&pose(from))
}

#[test]
fn view_jacobians_meet_central_differences() {
    let example = example();
    let (estimate, columns, gravity) = (&example.estimate, &example.columns, gravity_in_world(9.81));
    let landmarks = vec![Vector3::zeros(); estimate.landmarks.len()];
    for camera in [Camera::Static, Camera::Gimbal] {
        let view = ViewId::new(3, camera);
        let map = estimate.view_map(view, columns, &example.frame_sets, &gravity);
        let slope = |band: &dyn Fn(f64) -> Vec<f64>, border: &dyn Fn(f64) -> DVector<f64>| {
            let at = |sign: f64| {
                let moved = estimate.moved(columns, &band(sign * STEP), &border(sign * STEP), &landmarks);
                moved.view(view, &example.frame_sets, &gravity)
            };
            pose_difference(&at(1.0), &at(-1.0)) / (2.0 * STEP)
        };
        let still_band = |_| vec![0.0; columns.band()];
        let still_border = |_| DVector::zeros(columns.borders());
        for k in 0..columns.own() {
            let band = |step: f64| {
                let mut band = still_band(step);
                band[3 * columns.block() + k] = step;
                band
            };
            assert!((slope(&band, &still_border) - map.own.column(k)).amax() < 1e-6, "{camera:?} own {k}");
        }
        for k in 0..columns.borders() {
            let border = |step: f64| {
                let mut border = still_border(step);
                border[k] = step;
                border
            };
            // The rotation over the time offset is accurate to first order in the offset.
            assert!(
                (slope(&still_band, &border) - map.shared.column(k)).amax()
                    < 2e-2 * map.shared.column(k).amax().max(1e-4),
                "{camera:?} shared {k}"
            );
        }
    }
}

#[test]
fn the_gradient_of_the_whole_bundle_is_that_of_its_cost() {
    let example = example();
    let bundle = bundle(&example);
    let columns = &example.columns;
    let equations = bundle.linearize(&example.estimate);
    // A damping of 1e18 fixes the landmarks, so that the plain gradient remains.
    let reduced = equations.visual().eliminate(1e18);
    let (_, band, border) = bundle.assemble(&equations, &reduced, Vec::new());
    let landmarks = vec![Vector3::zeros(); example.estimate.landmarks.len()];
    let slope = |column: usize| {
        let cost = |step: f64| {
            let (mut band, mut border) = (vec![0.0; columns.band()], DVector::zeros(columns.borders()));
            if column < columns.band() {
                band[column] = step;
            } else {
                border[column - columns.band()] = step;
            }
            bundle.cost(&example.estimate.moved(columns, &band, &border, &landmarks))
        };
        // The bundle's cost is twice the one with this gradient.
        -(cost(1e-5) - cost(-1e-5)) / (4.0 * 1e-5)
    };
    for column in 0..columns.band() + columns.borders() {
        let found = if column < columns.band() { band[column] } else { border[column - columns.band()] };
        let expected = slope(column);
        assert!((found - expected).abs() < 2e-3 * expected.abs() + 0.5, "column {column}: {found} against {expected}");
    }
}
