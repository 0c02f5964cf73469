//! Estimator: initialization or tracking, and the step from one image to the next.

use super::config::EstimatorConfig;
use super::report::{Phase, StepReport};
use super::start::initializer::{InitializationStep, Initializer};
use super::state::calibration_posterior::CalibrationPosterior;
use super::state::calibrations::{Calibrations, MAIN};
use super::state::earlier_pass::BiasPrior;
use super::state::earlier_pass::EarlierPass;
use super::step_input::StepInput;
use super::window::setup::Setup;
use super::window::sliding_window::{SlidingWindow, WindowFailure};
use super::window::solve::covariances;
use crate::geometry::RigidTransform;
use crate::gimbal::ClassicalChain;

/// Sliding-window visual-inertial estimator for a camera on a gimbal or a rigid camera, and further rigid cameras.
///
/// It is a plain value: a clone is a snapshot, and equal steps from it give equal bits. [`Estimator::packed`] makes
/// a smaller snapshot.
#[derive(Clone, Debug)]
pub struct Estimator {
    pub(super) setup: Setup,
    pub(super) phase: PhaseState,
    pub(super) restarts: usize,
    /// Last pose before the last failure, `None` if there was none.
    pub(super) resume_at: Option<RigidTransform>,
}

/// Data of each [`Phase`].
#[derive(Clone, Debug)]
pub(super) enum PhaseState {
    Initializing(Initializer),
    Tracking(Box<SlidingWindow>),
}

impl Estimator {
    pub fn new(config: EstimatorConfig) -> Self {
        let setup = Setup::new(config);
        let phase = PhaseState::Initializing(Initializer::new(setup.given_calibration(), None));
        Self { setup, phase, restarts: 0, resume_at: None }
    }

    /// Configuration, with all changes since the estimator's creation.
    pub fn config(&self) -> &EstimatorConfig {
        &self.setup.config
    }

    pub fn phase(&self) -> Phase {
        match self.phase {
            PhaseState::Initializing(_) => Phase::Initializing,
            PhaseState::Tracking(_) => Phase::Tracking,
        }
    }

    /// Requests [`StepReport::linearization`] from the next step on, or cancels the request.
    pub fn set_keep_linearization(&mut self, keep: bool) {
        self.setup.config.options.keep_linearization = keep;
    }

    /// Requests the linearization with [`StepReport::factor_rows`] from the next step on.
    pub fn set_keep_factor_rows(&mut self) {
        self.setup.config.options.keep_linearization = true;
        self.setup.config.options.keep_factor_rows = true;
    }

    /// Limits the solver's iterations from the next image on. If the limit is smaller than the iterations of a step,
    /// that step stops early.
    pub fn set_iterations(&mut self, iterations: usize) {
        self.setup.config.options.iterations = iterations;
    }

    /// Estimated chain in the classical parameterization.
    pub fn classical_chain(&self) -> ClassicalChain {
        self.calibration().of(MAIN).chain().to_classical()
    }

    /// Processes the tracks of one image with the IMU samples before it and returns the report of the step.
    pub fn step(&mut self, input: &StepInput<'_>) -> StepReport {
        let begin_ms = self.setup.clock_ms();
        let mut report = match &mut self.phase {
            PhaseState::Initializing(initializer) => {
                let step = initializer.step(&self.setup, input, Vec::new());
                self.after(step)
            }
            PhaseState::Tracking(window) => match window.step(&self.setup, input) {
                Ok(report) => report,
                Err(failure) => self.restart(input, failure),
            },
        };
        report.restarts = self.restarts;
        report.times.step_ms = self.setup.clock_ms() - begin_ms;
        report
    }

    pub(super) fn calibration(&self) -> &Calibrations {
        match &self.phase {
            PhaseState::Initializing(initializer) => &initializer.calibration,
            PhaseState::Tracking(window) => &window.state.calibration,
        }
    }

    pub(super) fn calibration_mut(&mut self) -> &mut Calibrations {
        match &mut self.phase {
            PhaseState::Initializing(initializer) => &mut initializer.calibration,
            PhaseState::Tracking(window) => &mut window.state.calibration,
        }
    }

    /// Discards the window and re-initializes from this image on; fixed parameters stay fixed.
    fn restart(&mut self, input: &StepInput<'_>, failure: WindowFailure) -> StepReport {
        self.resume_at = failure.last_pose.or(self.resume_at);
        self.restarts += 1;
        let mut calibration = self.setup.given_calibration();
        calibration.freeze_as(self.calibration());
        let mut initializer = Initializer::new(calibration, self.resume_at);
        let step = initializer.step(&self.setup, input, failure.events);
        self.phase = PhaseState::Initializing(initializer);
        self.after(step)
    }

    /// Replaces the initializer by the window once it exists.
    fn after(&mut self, step: InitializationStep) -> StepReport {
        match step {
            InitializationStep::Waiting(report) => report,
            InitializationStep::Initialized(window, report) => {
                self.phase = PhaseState::Tracking(window);
                report
            }
        }
    }
}

/// Factor on the standard deviations of a pass when they become the prior of the next.
///
/// Each pass uses the measurements again. With a factor k the information of the last pass is the information of the
/// measurements times 1 + 1/k² + 1/k⁴ + …: at most 4/3 for k = 2, so its standard deviations are too small by at most
/// 13 %.
const SIGMA_FACTOR: f64 = 2.0;

impl Estimator {
    /// Calibration of the current estimate with its covariance, as prior of another flight. `None` before the first
    /// window, with a fixed calibration, and if the information is not positive definite.
    ///
    /// The intrinsics of the IMU are not included.
    pub fn posterior(&self) -> Option<CalibrationPosterior> {
        let PhaseState::Tracking(window) = &self.phase else { return None };
        if window.state.calibration.dof() == 0 {
            return None;
        }
        let covariances = covariances(&self.setup, &window.state)?;
        window.state.calibration.posterior(&covariances.calibration)
    }

    /// Calibration before any measurement, with the covariance of its prior.
    pub fn start_posterior(&self) -> CalibrationPosterior {
        let calibrations = self.calibration();
        let count = calibrations.dof();
        let information = calibrations.prior_jacobian();
        let covariance = information.tr_mul(&information).cholesky().expect("a regular prior").inverse();
        assert_eq!(covariance.nrows(), count);
        calibrations.posterior(&covariance).expect("a free calibration")
    }

    /// Prior of another pass over the measurements from the current estimate: calibration with its covariance, and
    /// biases at the start of the log, `duration_s` before the newest image. Standard deviations are doubled. `None`
    /// before the first window, and if the information is not positive definite.
    ///
    /// The intrinsics of the IMU are not included: they restart at the rig's prior.
    pub fn findings(&self, duration_s: f64) -> Option<EarlierPass> {
        let PhaseState::Tracking(window) = &self.phase else { return None };
        let covariances = covariances(&self.setup, &window.state)?;
        let calibrations = &window.state.calibration;
        let cameras = (0..calibrations.cameras()).map(|camera| {
            let columns = calibrations.columns(camera);
            let covariance = covariances.calibration.view_range(columns.clone(), columns).into_owned();
            calibrations.of(camera).next_pass_prior(&covariance, SIGMA_FACTOR.powi(-2))
        });
        let mean = window.state.frames.newest().state.navigation.bias;
        let sigma = covariances.newest_bias.diagonal().map(|variance| SIGMA_FACTOR * variance.max(0.0).sqrt());
        let bias = BiasPrior {
            mean,
            gyroscope_sigma_rad_per_s: sigma.fixed_rows::<3>(0).into_owned(),
            accelerometer_sigma_m_per_s2: sigma.fixed_rows::<3>(3).into_owned(),
        };
        let noise = &self.setup.imu_noise;
        Some(EarlierPass {
            cameras: cameras.collect::<Option<_>>()?,
            bias: bias.after(duration_s, noise.gyroscope_random_walk, noise.accelerometer_random_walk),
        })
    }
}
