//! A gimballed and a rigid camera in one window.

use rayon::prelude::*;

use super::fixture;
use super::flight::{chain_error, run_flight, trajectory_error_m};
use crate::estimator::config::{EstimatorConfig, EstimatorOptions};
use crate::estimator::report::StepReport;
use crate::estimator::{Estimator, Phase, StepInput};
use crate::frontend::TrackedFrame;
use crate::geometry::{seconds_from_ns, so3};
use crate::gimbal::Parameterization;
use crate::gimbal::tests::parameter;
use crate::sensors::ChainPrior;
use crate::simulation::{SyntheticFlight, SyntheticMount, SyntheticOptions, synthetic_tracks};

/// The same flight with a gimballed and a rigid camera.
struct BothFlights {
    gimbal: SyntheticFlight,
    rigid: SyntheticFlight,
}

impl BothFlights {
    /// Flights with errors of the given chain of up to 10° and 3 cm in every parameter; the rigid extrinsics have the
    /// errors of a good calibration.
    fn new(seed: u64, duration_s: f64) -> Self {
        let flights = Self::interleaved(seed, duration_s, 0.0);
        assert_eq!(flights.gimbal.frames[7].imu, flights.rigid.frames[7].imu, "one flight");
        flights
    }

    /// The same with the images of the gimballed camera by a time later.
    fn interleaved(seed: u64, duration_s: f64, phase_s: f64) -> Self {
        let options = |mount| SyntheticOptions {
            mount,
            seed,
            duration_s,
            phase_s: if mount == SyntheticMount::Gimbal { phase_s } else { 0.0 },
            pixel_sigma_px: EstimatorOptions::default().pixel_sigma_px,
            outlier_ratio: 0.02,
            features: 80,
            ..SyntheticOptions::default()
        };
        let start_error = ChainPrior { translation_bound_m: 0.03, rotation_bound_rad: 10.0_f64.to_radians() };
        let gimbal = synthetic_tracks(&SyntheticOptions { start_error, ..options(SyntheticMount::Gimbal) });
        let rigid = synthetic_tracks(&options(SyntheticMount::Static));
        Self { gimbal, rigid }
    }

    fn config(&self) -> EstimatorConfig {
        EstimatorConfig {
            further_cameras: vec![fixture::rigid_camera(&self.rigid)],
            ..fixture::config(&self.gimbal.given_rig, Parameterization::Minimal, EstimatorOptions::default())
        }
    }

    /// Runs one step; a camera whose flag is false has no features.
    fn step(&self, estimator: &mut Estimator, index: usize, [gimbal, rigid]: [bool; 2]) -> StepReport {
        let nothing = TrackedFrame::default();
        let [frame, beside] = [&self.gimbal, &self.rigid].map(|flight| &flight.frames[index]);
        let (tracks, further_tracks) =
            (if gimbal { &frame.tracks } else { &nothing }, if rigid { &beside.tracks } else { &nothing });
        fixture::step(estimator, frame, tracks, &[further_tracks])
    }

    /// Runs one step with a frame at the rigid camera's image.
    fn interleaved_step(&self, estimator: &mut Estimator, index: usize) -> StepReport {
        let (main, frame) = (&self.gimbal.frames[index], &self.rigid.frames[index]);
        let joint_angles = estimator.config().encoder_sigma_rad.and_then(|sigma_rad| main.encoder_angles(sigma_rad));
        estimator.step(&StepInput {
            frame_index: main.index,
            stamp_ns: frame.stamp_ns,
            imu: &frame.imu,
            imu_after: self.rigid.frames.get(index + 1).map_or(&[], |next| &next.imu),
            image_times_s: &[seconds_from_ns(main.stamp_ns - frame.stamp_ns), 0.0],
            gimbal_imu: &[],
            joint_angles: joint_angles.as_ref(),
            tracks: &main.tracks,
            further_tracks: &[&frame.tracks],
        })
    }

    fn run_interleaved(&self) -> (Estimator, Vec<StepReport>) {
        let mut estimator = Estimator::new(EstimatorConfig { frame_camera: Some(1), ..self.config() });
        let steps = 0..self.gimbal.frames.len().min(self.rigid.frames.len());
        let reports = steps.map(|index| self.interleaved_step(&mut estimator, index)).collect();
        (estimator, reports)
    }

    fn run_flight(&self, config: EstimatorConfig, seen: impl Fn(usize) -> [bool; 2]) -> (Estimator, Vec<StepReport>) {
        let mut estimator = Estimator::new(config);
        let steps = 0..self.gimbal.frames.len();
        let reports = steps.map(|index| self.step(&mut estimator, index, seen(index))).collect();
        (estimator, reports)
    }
}

fn both(_: usize) -> [bool; 2] {
    [true, true]
}

/// Position errors in metres and chain errors in radians.
struct Errors {
    cluster_m: f64,
    gimbal_m: f64,
    rigid_m: f64,
    cluster_rad: f64,
    gimbal_rad: f64,
}

impl Errors {
    /// Errors of a flight with both cameras and with each of them alone.
    fn of(seed: u64) -> Self {
        let flights = BothFlights::new(seed, 12.0);
        let config = flights.config();
        let given = chain_error(&flights.gimbal, &Estimator::new(config.clone()));
        assert!(given.1 > 5.0_f64.to_radians(), "seed {seed}: the chain is given wrong by {} rad", given.1);
        let alone = EstimatorConfig { further_cameras: Vec::new(), ..config.clone() };
        let (estimator, reports) = run_flight(&flights.gimbal.frames, alone);
        let gimbal_m = trajectory_error_m(&flights.gimbal.frames, &reports).0;
        let gimbal_rad = chain_error(&flights.gimbal, &estimator).1;
        let alone = fixture::config(&flights.rigid.given_rig, Parameterization::Minimal, EstimatorOptions::default());
        let (_, reports) = run_flight(&flights.rigid.frames, alone);
        let rigid_m = trajectory_error_m(&flights.rigid.frames, &reports).0;
        let (estimator, reports) = flights.run_flight(config, both);
        assert_eq!(estimator.restarts, 0, "seed {seed}");
        let cluster_m = trajectory_error_m(&flights.gimbal.frames, &reports).0;
        Self { cluster_m, gimbal_m, rigid_m, cluster_rad: chain_error(&flights.gimbal, &estimator).1, gimbal_rad }
    }
}

#[test]
fn two_cameras_are_more_accurate_than_one_with_a_wrong_chain() {
    let errors: Vec<Errors> = (1_u64..=3).into_par_iter().map(Errors::of).collect();
    let sum = |part: fn(&Errors) -> f64| errors.iter().map(part).sum::<f64>();
    let cluster_m = sum(|errors| errors.cluster_m);
    let (gimbal_m, rigid_m) = (sum(|errors| errors.gimbal_m), sum(|errors| errors.rigid_m));
    assert!(
        cluster_m < gimbal_m && cluster_m < rigid_m,
        "{cluster_m} m with both, {gimbal_m} m with the gimballed one, {rigid_m} m with the rigid one"
    );
    let (cluster_rad, gimbal_rad) = (sum(|errors| errors.cluster_rad), sum(|errors| errors.gimbal_rad));
    assert!(cluster_rad < 1.1 * gimbal_rad, "{cluster_rad} rad with both, {gimbal_rad} rad with the gimballed one");
}

#[test]
fn interleaved_cameras_are_nearly_as_accurate_as_synchronized_ones() {
    let errors = |seed: u64| {
        let error_m =
            |reports: &[StepReport], flights: &BothFlights| trajectory_error_m(&flights.rigid.frames, reports).0;
        let flights = BothFlights::new(seed, 12.0);
        let together = flights.run_flight(flights.config(), both);
        // Half an interval: no image of the gimballed camera is nearer to one of the rigid camera.
        let apart = BothFlights::interleaved(seed, 12.0, -0.025);
        let (estimator, reports) = apart.run_interleaved();
        assert_eq!(estimator.restarts, 0, "seed {seed}");
        let [together_rad, apart_rad] =
            [(&flights, &together.0), (&apart, &estimator)].map(|(flights, of)| chain_error(&flights.gimbal, of).1);
        [error_m(&together.1, &flights), together_rad, error_m(&reports, &apart), apart_rad]
    };
    let all: Vec<[f64; 4]> = (1_u64..=3).into_par_iter().map(errors).collect();
    let [together_m, together_rad, apart_m, apart_rad] =
        [0, 1, 2, 3].map(|place| all.iter().map(|errors| errors[place]).sum::<f64>());
    // Over ten seeds the ratios are 1.13 and 1.05.
    assert!(apart_m < 1.35 * together_m, "{apart_m} m, {together_m} m with one stamp");
    assert!(apart_rad < 1.35 * together_rad, "{apart_rad} rad, {together_rad} rad with one stamp");
}

#[test]
fn the_gimballed_camera_starts_the_window_where_the_rigid_one_has_no_features() {
    let flights = BothFlights::new(1, 9.0);
    let (estimator, reports) = flights.run_flight(flights.config(), |_| [true, false]);
    let replaced =
        |report: &&StepReport| report.events.iter().any(|event| event.message.contains("another one starts"));
    assert_eq!(reports.iter().filter(replaced).count(), 1);
    assert_eq!((reports.last().unwrap().phase, estimator.restarts), (Phase::Tracking, 0));
    let alone = EstimatorConfig { further_cameras: Vec::new(), ..flights.config() };
    let (_, alone) = run_flight(&flights.gimbal.frames, alone);
    let [error_m, alone_m] = [&reports, &alone].map(|reports| trajectory_error_m(&flights.gimbal.frames, reports).0);
    assert!(error_m < 1.5 * alone_m, "{error_m} m, {alone_m} m with one camera");
}

#[test]
fn both_calibrations_have_named_columns() {
    let flights = BothFlights::new(5, 10.0);
    let options = EstimatorOptions { keep_linearization: true, ..EstimatorOptions::default() };
    let config = EstimatorConfig { options, ..flights.config() };
    let (estimator, reports) = flights.run_flight(config, both);
    let last = reports.last().unwrap();
    let calibration = &last.calibration;
    assert_eq!(calibration.parameters.len(), 24);
    let mut parameters = calibration.parameters.clone();
    parameters.sort();
    parameters.dedup();
    assert_eq!(parameters.len(), 24, "{parameters:?}");
    let rigid = ["rx", "ry", "rz", "tx", "ty", "tz"].map(|tail| parameter(&format!("cam1.{tail}")));
    assert_eq!(calibration.parameters[18..], rigid);
    for of_column in [&calibration.values, &calibration.sigmas, &calibration.prior_sigmas] {
        assert!(of_column.len() == 24 && of_column.iter().all(|number| number.is_finite()));
    }
    assert!(calibration.sigmas.iter().zip(&calibration.prior_sigmas).all(|(after, before)| after < before));
    let linearization = last.linearization.as_ref().unwrap();
    assert_eq!(linearization.calibration_column_norms.len(), 24);
    let cameras = [&estimator.config().camera, &estimator.config().further_cameras[0].model];
    crate::estimator::tests::jacobian::check(last, &cameras);
    let columns: Vec<_> = linearization.columns[..24].iter().filter_map(|column| column.id.parameter()).collect();
    assert_eq!(columns, calibration.parameters);

    // The rigid extrinsics converge as well.
    let ground_truth = flights.rigid.true_rig.chain_of_camera("cam0").unwrap().imu_from_camera(&[]);
    let angle =
        |pose: &crate::geometry::RigidTransform| so3::log(&(pose.rotation.inverse() * ground_truth.rotation)).norm();
    let [rigid] = calibration.further_cameras.as_slice() else { panic!("one rigid camera") };
    let (key, mount) = (&rigid.key, &rigid.base_from_camera);
    assert_eq!(key, "cam1");
    let given = estimator.config().further_cameras[0].base_from_camera;
    assert!(angle(mount) < 0.3 * angle(&given), "{} of {} rad", angle(mount), angle(&given));

    // Feature ids distinguish the cameras.
    let of = |camera: usize| last.features.iter().filter(|feature| feature.id.camera() == camera).count();
    assert!(of(0) > 30 && of(1) > 30, "{} and {}", of(0), of(1));
    assert!(last.landmarks.iter().any(|landmark| landmark.id.camera() == 1));
}

#[test]
fn a_missing_image_leaves_the_other_cameras_observations() {
    let flights = BothFlights::new(6, 12.0);
    let seen = |index: usize| match index {
        // Missing images of one camera at a time at the start, then a second without each camera.
        0..60 => [!index.is_multiple_of(3), !index.is_multiple_of(4)],
        120..140 => [false, true],
        160..180 => [true, false],
        _ => [true, true],
    };
    let (estimator, reports) = flights.run_flight(flights.config(), seen);
    assert_eq!(estimator.restarts, 0);
    assert!(reports[100..].iter().all(|report| report.phase == Phase::Tracking));
    let (error, length) = trajectory_error_m(&flights.gimbal.frames, &reports);
    assert!(error < 0.006 * length, "{error} m over {length} m");
}

#[test]
fn fixed_calibrations_keep_their_given_values() {
    let flights = BothFlights::new(5, 8.5);
    let config = EstimatorConfig { calibrate: false, ..flights.config() };
    let given = Estimator::new(config.clone()).classical_chain();
    let (estimator, reports) = flights.run_flight(config, both);
    assert_eq!(estimator.classical_chain(), given);
    let calibration = &reports.last().unwrap().calibration;
    assert_eq!(calibration.further_cameras[0].base_from_camera, fixture::rigid_camera(&flights.rigid).base_from_camera);
    assert_eq!(calibration.sigmas, vec![0.0; 24]);
}

#[test]
fn replays_and_clones_give_the_same_bits() {
    let flights = BothFlights::new(8, 6.5);
    let (_, reports) = flights.run_flight(flights.config(), both);
    let mut estimator = Estimator::new(flights.config());
    let half = flights.gimbal.frames.len() / 2 + 10;
    for (index, report) in reports[..half].iter().enumerate() {
        assert_eq!(format!("{:?}", flights.step(&mut estimator, index, both(index))), format!("{report:?}"));
    }
    assert_eq!(estimator.phase(), Phase::Tracking);
    let mut copy = estimator.clone();
    for (index, report) in reports.iter().enumerate().skip(half) {
        assert_eq!(format!("{:?}", flights.step(&mut copy, index, both(index))), format!("{report:?}"));
    }
}
