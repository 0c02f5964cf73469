//! Forks on a synthetic flight, and a session that stops at breakpoints and forks there.

use std::path::PathBuf;
use std::sync::{Arc, LazyLock};

use crate::estimator::{FactorKind, FrameId, JacobianFactor, Phase, StageTimes};
use crate::session::breakpoints::Condition;
use crate::session::engine::input_of;
use crate::session::engine::{History, RunEngine, apply_fork, estimator_config};
use crate::session::plan::{ForkChanges, RunSpec, SessionPlan, SessionRequest};
use crate::session::playback::{Command, Session};
use crate::session::record::StepRecord;
use crate::simulation::{SyntheticFlight, SyntheticOptions, synthetic_tracks};

/// A run on a synthetic flight, with its engine and inputs.
struct SimulatedRun {
    flight: SyntheticFlight,
    history: Arc<History>,
    steps: Vec<StepRecord>,
}

/// Runs that several tests fork.
static AUTO: LazyLock<SimulatedRun> = LazyLock::new(|| simulated_run("auto"));
static MINIMAL: LazyLock<SimulatedRun> = LazyLock::new(|| simulated_run("minimal"));
static CLASSICAL: LazyLock<SimulatedRun> = LazyLock::new(|| simulated_run("classical"));

fn simulated_run(spec: &str) -> SimulatedRun {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 6.0, ..SyntheticOptions::default() });
    let spec: RunSpec = spec.parse().unwrap();
    let config = estimator_config(&flight.given_rig, &spec).unwrap();
    let sigma_rad = config.encoder_sigma_rad.unwrap();
    let mut engine = RunEngine::new(config, None);
    let history = Arc::new(History::new(usize::MAX));
    let steps = flight.frames.iter().enumerate().map(|(step, frame)| {
        let input = Arc::new(input_of(frame, Some(sigma_rad)));
        history.inputs().push(Arc::clone(&input));
        history.before_step(step, &engine);
        engine.step(&input)
    });
    let steps = steps.collect();
    SimulatedRun { flight, history, steps }
}

impl SimulatedRun {
    /// Steps of a fork from step `begin` on.
    fn forked(&self, begin: usize, changes: &str) -> Result<Vec<StepRecord>, String> {
        let changes: ForkChanges = changes.parse().map_err(|error: crate::session::ForkError| error.to_string())?;
        let mut engine = self.history.engine_before(begin).unwrap();
        apply_fork(&changes, &mut engine, &self.flight.given_rig, "cam0").map_err(|error| error.to_string())?;
        let inputs = (begin..self.steps.len()).map(|step| self.history.inputs().get(step).unwrap());
        Ok(inputs.map(|input| engine.step(&input)).collect())
    }
}

fn bits(record: &StepRecord) -> String {
    let mut record = record.clone();
    record.report.times = StageTimes::default();
    format!("{record:?}")
}

/// Distance between the newest positions of two steps, in metres.
fn position_difference_m(one: &StepRecord, other: &StepRecord) -> f64 {
    let at = |record: &StepRecord| record.report.newest().unwrap().world_from_imu.translation_m;
    (at(one) - at(other)).norm()
}

fn parameter(record: &StepRecord, name: &str) -> (f64, f64) {
    let calibration = &record.report.calibration;
    let index =
        calibration.parameters.iter().position(|known| *known == crate::session::tests::parameter(name)).unwrap();
    (calibration.values[index], calibration.sigmas[index])
}

const FORK_AT: usize = 90;

#[test]
fn a_fork_without_changes_is_its_parent() {
    let parent = &*AUTO;
    for (again, step) in parent.forked(FORK_AT, "").unwrap().iter().zip(&parent.steps[FORK_AT..]) {
        assert_eq!(bits(again), bits(step));
    }
}

#[test]
fn a_fork_goes_on_in_another_parameterization() {
    let parent = &*MINIMAL;
    let tracking = |step: &StepRecord| step.report.phase == Phase::Tracking && step.report.restarts == 0;
    for (changes, columns) in [("classical", 24), ("poe", 18), ("minimal-swapped", 18), ("auto", 18)] {
        let fork = parent.forked(FORK_AT, changes).unwrap();
        for (fork, parent) in fork.iter().zip(&parent.steps[FORK_AT..]) {
            assert!(tracking(fork) && fork.report.calibration.parameters.len() == columns, "{changes}");
            let position_difference_m = position_difference_m(fork, parent);
            assert!(position_difference_m < 0.01, "{changes}: {position_difference_m} m from the parent");
        }
    }
    // The reverse direction removes the redundant columns.
    let parent = &*CLASSICAL;
    for (fork, parent) in parent.forked(FORK_AT, "minimal").unwrap().iter().zip(&parent.steps[FORK_AT..]) {
        assert!(tracking(fork) && fork.rank.as_ref().unwrap().deficit_parameterization == 0);
        assert!(
            position_difference_m(fork, parent) < 0.01,
            "{} m from the parent",
            position_difference_m(fork, parent)
        );
    }
}

#[test]
fn sensor_parameters_are_estimated_from_the_fork_on() {
    let parent = &*CLASSICAL;
    let fork = parent.forked(FORK_AT, "estimate=readout+intrinsics+imu-intrinsics+timeshift").unwrap();
    for (step, parent) in fork.iter().zip(&parent.steps[FORK_AT..]) {
        assert_eq!(step.report.restarts, 0);
        assert!(
            position_difference_m(step, parent) < 0.04,
            "{} m from the parent",
            position_difference_m(step, parent)
        );
    }
    let last = fork.last().unwrap();
    let (readout_s, sigma_s) = parameter(last, "readout");
    assert!(readout_s.abs() < 0.005 && sigma_s > 0.0 && sigma_s < 0.005, "a global shutter: {readout_s} ± {sigma_s} s");
    let (fx_px, sigma_px) = parameter(last, "fx");
    let given_px = parent.flight.given_rig.cameras[0].model.intrinsics_px[0];
    assert!((fx_px - given_px).abs() < 0.02 * given_px && sigma_px < 5.0, "{fx_px} ± {sigma_px} of {given_px} px");
    let known = parent.steps[FORK_AT].report.calibration.parameters.len();
    let (clocks, readout, intrinsics, imu) = (2, 1, 4, 15);
    assert_eq!(last.report.calibration.parameters.len(), known + clocks + readout + intrinsics + imu);
    let problem = simulated_run("auto:calibrate=off").forked(FORK_AT, "estimate=readout").unwrap_err();
    assert!(problem.contains("calibrate=off"), "{problem}");
}

#[test]
fn frozen_parameters_stay_and_changed_ones_start_at_their_values() {
    let parent = &*AUTO;
    let before = &parent.steps[FORK_AT - 1];
    let (frozen_value, _) = parameter(before, "L2.alpha");
    let fork = parent.forked(FORK_AT, "freeze=L2.alpha").unwrap();
    for step in &fork {
        let (value, sigma) = parameter(step, "L2.alpha");
        assert!((value - frozen_value).abs() < 1e-12 && sigma == 0.0, "{value} {sigma}");
    }
    let moved = |name: &str| (parameter(&fork[20], name).0 - parameter(before, name).0).abs();
    assert!(moved("L2.a") > 1e-9 && parameter(&fork[20], "L2.a").1 > 0.0);

    let elsewhere = format!("freeze=L2.alpha,set=L2.alpha:{}", frozen_value + 0.05);
    let fork = parent.forked(FORK_AT, &elsewhere).unwrap();
    assert!((parameter(&fork[0], "L2.alpha").0 - frozen_value - 0.05).abs() < 1e-12);
    // A parameter that is only set is estimated again.
    let fork = parent.forked(FORK_AT, &format!("set=L2.alpha:{}", frozen_value + 0.05)).unwrap();
    let found = parameter(fork.last().unwrap(), "L2.alpha").0;
    assert!((found - frozen_value).abs() < 0.01, "{found} after {frozen_value}");
}

#[test]
fn measurements_can_be_dropped_and_disturbed() {
    let parent = &*AUTO;
    let ids: Vec<String> = parent.steps[FORK_AT].report.features[..8].iter().map(|it| it.id.0.to_string()).collect();
    let fork = parent.forked(FORK_AT, &format!("drop={}", ids.join("+"))).unwrap();
    let used = |steps: &[StepRecord], id: &String| {
        steps.iter().flat_map(|step| &step.report.features).any(|feature| feature.id.0.to_string() == *id)
    };
    assert!(ids.iter().all(|id| used(&parent.steps[FORK_AT..], id) && !used(&fork, id)));

    let chi2 = |steps: &[StepRecord], factor: FactorKind| -> f64 {
        let of = |step: &StepRecord| step.report.residuals.iter().find(|it| it.factor == factor).unwrap().chi2_after;
        steps.iter().map(of).sum()
    };
    let usual = chi2(&parent.steps[FORK_AT..], FactorKind::Encoder);
    let noisy = parent.forked(FORK_AT, "joint-noise=2deg").unwrap();
    assert!(chi2(&noisy, FactorKind::Encoder) > 2.0 * usual, "{} after {usual}", chi2(&noisy, FactorKind::Encoder));
    assert_eq!(noisy.iter().map(bits).collect::<Vec<_>>(), {
        let again = parent.forked(FORK_AT, "joint-noise=2deg").unwrap();
        again.iter().map(bits).collect::<Vec<_>>()
    });
    let lax = parent.forked(FORK_AT, "encoder-noise=10").unwrap();
    // Frames that were in the window already keep their joint-angle measurements.
    assert!(chi2(&lax, FactorKind::Encoder) < 0.8 * usual, "{} after {usual}", chi2(&lax, FactorKind::Encoder));
    let visual = chi2(&parent.steps[FORK_AT..], FactorKind::Visual);
    let lax = parent.forked(FORK_AT, "pixel-noise=3").unwrap();
    assert!(chi2(&lax, FactorKind::Visual) < 0.5 * visual);
}

/// Norm of the IMU factor's rows between two frames in the columns of the later pose, in standard deviations.
fn imu_row_norm(flight: &SyntheticFlight, step: &StepRecord, slot: usize) -> f64 {
    let model = &flight.given_rig.cameras[0].model;
    let jacobian = step.report.jacobian(&[model]).unwrap();
    let (from, to) = (FrameId(step.report.window[slot - 1].frame_index), FrameId(step.report.window[slot].frame_index));
    let row = jacobian.rows.iter().find(|row| row.factor == JacobianFactor::Imu { from, to }).unwrap();
    let norm = |(_, norm): &(u16, f32)| f64::from(*norm).powi(2);
    row.norms.iter().map(norm).sum::<f64>().sqrt()
}

#[test]
fn imu_noise_scales_the_rows_of_later_intervals() {
    let parent = &*AUTO;
    for factor in [2.0, 0.25] {
        let fork = parent.forked(FORK_AT, &format!("imu-noise={factor}")).unwrap();
        let (fork, parent_step) = (&fork[0], &parent.steps[FORK_AT]);
        let newest = fork.report.window.len() - 1;
        for slot in 1..=newest {
            let weight_ratio =
                imu_row_norm(&parent.flight, parent_step, slot) / imu_row_norm(&parent.flight, fork, slot);
            // Only the newest interval has the altered noise; the others change a little with the state.
            let expected = if slot == newest { factor } else { 1.0 };
            assert!(
                (weight_ratio / expected - 1.0).abs() < 0.01,
                "imu-noise={factor}, slot {slot} of {newest}: {weight_ratio}"
            );
        }
    }
}

#[test]
fn a_fork_with_other_imu_noise_from_the_start_equals_a_run_of_such_a_rig() {
    // A power of two, so that the order of multiplications does not change the rounding.
    const FACTOR: f64 = 4.0;
    let parent = &*AUTO;
    let fork = parent.forked(0, &format!("imu-noise={FACTOR}")).unwrap();
    let mut rig = parent.flight.given_rig.clone();
    let noise = &mut rig.imu.noise;
    noise.accelerometer_noise_density *= FACTOR;
    noise.accelerometer_random_walk *= FACTOR;
    noise.gyroscope_noise_density *= FACTOR;
    noise.gyroscope_random_walk *= FACTOR;
    let mut engine = RunEngine::new(estimator_config(&rig, &"auto".parse().unwrap()).unwrap(), None);
    for (step, forked) in fork.iter().enumerate() {
        let input = parent.history.inputs().get(step).unwrap();
        assert_eq!(bits(forked), bits(&engine.step(&input)), "step {step}");
    }
    // A noisier IMU increases every parameter's σ, although images and encoders constrain them most.
    let sigmas = |steps: &[StepRecord]| steps.last().unwrap().report.calibration.sigmas.clone();
    let ratios: Vec<f64> = sigmas(&fork).iter().zip(sigmas(&parent.steps)).map(|(more, usual)| more / usual).collect();
    assert!(ratios.iter().all(|ratio| *ratio > 1.0 && *ratio < FACTOR), "{ratios:?}");
}

#[test]
fn encoder_readings_can_be_disabled() {
    let parent = &*AUTO;
    let fork = parent.forked(FORK_AT, "encoder=off").unwrap();
    for (number, step) in fork.iter().enumerate() {
        let read = |index: usize| step.report.window[index].encoder_angles_rad.is_some();
        let own = |index: usize| step.report.window[index].frame_index >= parent.steps[FORK_AT].report.frame_index;
        // Earlier frames keep their measurements; later frames have none.
        assert!((0..step.report.window.len()).all(|index| read(index) != own(index)), "step {number}");
        assert_eq!(step.report.calibration.parameters, parent.steps[FORK_AT].report.calibration.parameters);
    }
    let last = fork.last().unwrap();
    let tracking = last.report.phase == Phase::Tracking && last.report.restarts == 0;
    assert!(tracking && position_difference_m(last, parent.steps.last().unwrap()) < 0.05);
    // Without encoder readings only the images constrain the joint angles.
    let joint_sigma = |step: &StepRecord| step.report.calibration.sigmas.iter().sum::<f64>();
    assert!(joint_sigma(last) > joint_sigma(parent.steps.last().unwrap()));
}

#[test]
fn one_camera_of_two_can_be_disabled() {
    let request = SessionRequest {
        log_path: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../sample_logs/garden.mcap"),
        specs: vec!["cluster".parse().unwrap()],
        duration_s: Some(3.5),
        ..SessionRequest::default()
    };
    let mut session = Session::start(SessionPlan::open(&request).unwrap()).unwrap();
    let finished = |session: &mut Session| {
        while session.recording().runs.iter().any(|run| !run.finished) {
            session.advance(0.0);
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    };
    finished(&mut session);
    let recording = session.recording();
    let steps = &recording.runs[0].steps;
    let at = steps.iter().rposition(|step| step.report.phase == Phase::Tracking).unwrap() - 8;
    session.apply(Command::Seek { stamp_ns: steps[at].report.stamp_ns });
    let [main, rigid] =
        [recording.runs[0].camera_key.clone(), steps[at].report.calibration.further_cameras[0].key.clone()];
    for (key, left) in [(&rigid, 0), (&main, 1)] {
        let changes: ForkChanges = format!("without={key}").parse().unwrap();
        session.apply(Command::Fork { run: 0, changes, label: None });
        assert_eq!(session.take_notices(), Vec::<String>::new());
        finished(&mut session);
        let recording = session.recording();
        for step in &recording.runs.last().unwrap().steps[at..] {
            assert_eq!(step.report.phase, Phase::Tracking);
            let seen = step.report.features.iter().map(|feature| feature.id.camera());
            assert!(seen.clone().all(|camera| camera == left) && seen.count() > 5, "without={key}");
        }
    }
    let refused = |session: &mut Session, text: &str| {
        session.apply(Command::Fork { run: 0, changes: text.parse().unwrap(), label: None });
        session.take_notices().pop().unwrap()
    };
    assert!(refused(&mut session, "without=cam7").contains("'cam7'"));
    assert!(refused(&mut session, &format!("without={main}+{rigid}")).contains("one of its cameras"));
}

#[test]
fn unsupported_changes_are_reported() {
    let problem = AUTO.forked(FORK_AT, "freeze=L2.alfa").unwrap_err();
    assert!(problem.contains("'L2.alfa'") && problem.contains("roll.alpha"), "{problem}");
    let problem = simulated_run("auto:calibrate=off").forked(FORK_AT, "freeze=L2.alpha").unwrap_err();
    assert!(problem.contains("calibrate=off"), "{problem}");
}

#[test]
fn a_run_that_initializes_can_be_forked() {
    let parent = &*MINIMAL;
    let first = parent.steps.iter().position(|step| step.report.phase == Phase::Tracking).unwrap();
    let fork = parent.forked(first - 2, "classical").unwrap();
    let begun = fork.iter().find(|step| step.report.phase == Phase::Tracking).unwrap();
    assert_eq!(begun.report.calibration.parameters.len(), 24);
    assert_eq!(begun.report.stamp_ns, parent.steps[first].report.stamp_ns);
}

#[test]
fn a_session_stops_at_breakpoints_and_forks_there() {
    let request = SessionRequest {
        log_path: PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../sample_logs/garden.mcap"),
        duration_s: Some(4.0),
        ..SessionRequest::default()
    };
    let mut session = Session::start(SessionPlan::open(&request).unwrap()).unwrap();
    let finished = |session: &mut Session| {
        while session.recording().runs.iter().any(|run| !run.finished) || session.is_running_to_breakpoint() {
            session.advance(0.0);
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    };
    session.apply(Command::GoToStart);
    session.apply(Command::RunToBreakpoint { forward: true });
    assert!(session.take_notices().pop().unwrap().contains("No breakpoints"));
    let condition: Condition = "tracking and features > 20".parse().unwrap();
    session.apply(Command::AddBreakpoint(condition));
    session.apply(Command::RunToBreakpoint { forward: true });
    finished(&mut session);
    let stop_ns = session.cursor_ns();
    let recording = session.recording();
    let parent = &recording.runs[0];
    let first = parent.steps.iter().position(|step| step.report.phase == Phase::Tracking).unwrap();
    assert_eq!(stop_ns, parent.steps[first].report.stamp_ns);
    let notice = session.take_notices().pop().unwrap();
    assert!(notice.contains("tracking and features > 20 in auto at") && notice.contains("features = "), "{notice}");
    // Playback over it stops there as well, and so does a run back from the end.
    session.apply(Command::GoToStart);
    session.apply(Command::Play);
    session.advance(100.0);
    assert_eq!((session.cursor_ns(), session.is_playing()), (stop_ns, false));
    session.apply(Command::GoToEnd);
    session.apply(Command::RunToBreakpoint { forward: false });
    assert_eq!(session.cursor_ns(), stop_ns);

    let at = first + 5;
    session.apply(Command::Seek { stamp_ns: parent.steps[at].report.stamp_ns });
    session.apply(Command::Fork { run: 0, changes: ForkChanges::default(), label: Some("twin".to_owned()) });
    session.apply(Command::Fork { run: 0, changes: "classical".parse().unwrap(), label: None });
    session.apply(Command::Fork { run: 0, changes: "freeze=nothing".parse().unwrap(), label: None });
    assert!(session.take_notices().pop().unwrap().contains("'nothing'"));
    finished(&mut session);
    let recording = session.recording();
    let [parent, twin, classical] = recording.runs.as_slice() else { panic!("{} runs", recording.runs.len()) };
    assert_eq!((twin.spec.label.as_str(), twin.origin.as_ref().unwrap().step), ("twin", at));
    assert!(classical.spec.label.starts_with("classical-"), "{}", classical.spec.label);
    for number in 0..parent.steps.len() {
        let (original, twin, other) = (&parent.steps[number], &twin.steps[number], &classical.steps[number]);
        assert_eq!((Arc::ptr_eq(original, twin), Arc::ptr_eq(original, other)), (number < at, number < at));
        assert_eq!(bits(original), bits(twin), "step {number}");
        assert_eq!(other.report.calibration.parameters.len(), if number < at { 18 } else { 24 });
    }
    // Steps of a fork can be recomputed as well, including the steps of its parent.
    for number in [at - 3, at, parent.steps.len() - 1] {
        let (_, again) = session.computation().recompute(2, number, 1).pop().unwrap();
        assert_eq!(bits(&again), bits(&classical.steps[number]));
    }
}
