//! Running window without recomputable data.

use super::packed_features::PackedFeatures;
use crate::estimator::factors::packed_prior::PackedPrior;
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::state::calibrations::Calibrations;
use crate::estimator::state::frame::Stationary;
use crate::estimator::state::frame::{Frame, InformedMotion};
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::imu_errors::ImuErrors;
use crate::estimator::state::navigation::ImuBias;
use crate::estimator::state::preintegration::Preintegration;
use crate::estimator::step_input::StepMeasurements;
use crate::estimator::window::frames::Frames;
use crate::estimator::window::loss_scale::LossScale;
use crate::estimator::window::sliding_window::{Monitors, SlidingWindow};
use crate::estimator::window::window_state::WindowState;
use crate::sensors::{ImuNoise, ImuSample, JointAngles};

/// [`SlidingWindow`] whose measurements are references to the inputs of earlier steps.
#[derive(Clone, Debug)]
pub(crate) struct PackedWindow {
    frames: Vec<PackedFrame>,
    features: Vec<PackedFeatures>,
    calibration: Calibrations,
    prior: Option<PackedPrior>,
    start: Option<StartPrior>,
    loss_scales: Vec<LossScale>,
    monitors: Monitors,
}

/// [`Frame`] without its integrated motion.
#[derive(Clone, Debug)]
struct PackedFrame {
    index: usize,
    stamp_ns: i64,
    /// Index of its step in `past`, `None` if it is not there.
    step: Option<usize>,
    state: FrameState,
    first_estimate: Option<FrameState>,
    encoder: Option<JointAngles>,
    stationary: Option<Stationary>,
    keyframe: bool,
    motion: PackedMotion,
    gimbal_motion: Option<PackedMotion>,
}

/// IMU whose samples are packed.
#[derive(Clone, Copy, Debug)]
enum PackedImu {
    Vehicle,
    Gimbal,
}

impl PackedImu {
    fn samples(self, step: &dyn StepMeasurements) -> &[ImuSample] {
        match self {
            Self::Vehicle => step.imu(),
            Self::Gimbal => step.gimbal_imu(),
        }
    }
}

/// Input of a [`Preintegration`].
#[derive(Clone, Debug)]
struct PackedMotion {
    noise: ImuNoise,
    bias: ImuBias,
    errors: Option<Box<ImuErrors>>,
    samples: PackedSamples,
}

#[derive(Clone, Debug)]
enum PackedSamples {
    /// Samples of consecutive steps in `past`: first index and end index (exclusive).
    OfSteps(usize, usize),
    /// Copied samples.
    Own(Vec<ImuSample>),
}

impl PackedWindow {
    pub(crate) fn new(window: &SlidingWindow, past: &[&dyn StepMeasurements]) -> Self {
        let state = &window.state;
        let frames: Vec<PackedFrame> = state.frames.iter().map(|frame| PackedFrame::new(frame, past)).collect();
        let features = state.features.iter().enumerate();
        let features = features
            .map(|(camera, features)| PackedFeatures::new(features, &steps_of(&frames, past), camera))
            .collect();
        Self {
            features,
            frames,
            calibration: state.calibration.clone(),
            prior: state.prior.as_ref().map(PackedPrior::new),
            start: state.start.clone(),
            loss_scales: state.loss_scales.clone(),
            monitors: window.monitors.clone(),
        }
    }

    pub(crate) fn unpacked(&self, past: &[&dyn StepMeasurements]) -> SlidingWindow {
        let mut frames = self.frames.iter().map(|frame| frame.unpacked(past));
        let mut window = Frames::new(frames.next().expect("a window has a frame"));
        frames.for_each(|frame| window.push(frame));
        let steps = steps_of(&self.frames, past);
        let features = self.features.iter().enumerate().map(|(camera, features)| features.unpacked(&steps, camera));
        SlidingWindow {
            state: WindowState {
                frames: window,
                features: features.collect(),
                calibration: self.calibration.clone(),
                prior: self.prior.as_ref().map(PackedPrior::unpacked),
                start: self.start.clone(),
                loss_scales: self.loss_scales.clone(),
            },
            monitors: self.monitors.clone(),
        }
    }

    pub(crate) fn heap_bytes(&self) -> usize {
        self.frames.iter().map(PackedFrame::bytes).sum::<usize>()
            + self.features.iter().map(PackedFeatures::bytes).sum::<usize>()
            + self.prior.as_ref().map_or(0, PackedPrior::heap_bytes)
            + self.monitors.heap_bytes()
    }
}

/// Step of each frame, `None` if it is not in the past.
fn steps_of<'a>(frames: &[PackedFrame], past: &[&'a dyn StepMeasurements]) -> Vec<Option<&'a dyn StepMeasurements>> {
    frames.iter().map(|frame| past.get(frame.step?).copied()).collect()
}

impl PackedFrame {
    fn new(frame: &Frame, past: &[&dyn StepMeasurements]) -> Self {
        Self {
            index: frame.index,
            stamp_ns: frame.stamp_ns,
            step: past.iter().rposition(|step| step.stamp_ns() == frame.stamp_ns),
            state: frame.state.clone(),
            first_estimate: frame.first_estimate.clone(),
            encoder: frame.encoder.clone(),
            stationary: frame.stationary,
            keyframe: frame.keyframe,
            motion: PackedMotion::new(&frame.motion, past, PackedImu::Vehicle),
            gimbal_motion: frame
                .gimbal_motion
                .as_ref()
                .map(|gimbal| PackedMotion::new(gimbal, past, PackedImu::Gimbal)),
        }
    }

    fn unpacked(&self, past: &[&dyn StepMeasurements]) -> Frame {
        let motion = self.motion.unpacked(past, PackedImu::Vehicle);
        let gimbal_motion = self.gimbal_motion.as_ref().map(|motion| motion.unpacked(past, PackedImu::Gimbal));
        Frame {
            index: self.index,
            stamp_ns: self.stamp_ns,
            state: self.state.clone(),
            first_estimate: self.first_estimate.clone(),
            encoder: self.encoder.clone(),
            stationary: self.stationary,
            keyframe: self.keyframe,
            motion: InformedMotion::new(motion),
            gimbal_motion: gimbal_motion.map(InformedMotion::new),
        }
    }

    fn bytes(&self) -> usize {
        let states = std::iter::once(&self.state).chain(&self.first_estimate);
        size_of::<Self>()
            + states.map(FrameState::heap_bytes).sum::<usize>()
            + self.state.rates.bytes()
            + self.encoder.as_ref().map_or(0, JointAngles::heap_bytes)
            + self.motion.heap_bytes()
            + self.gimbal_motion.as_ref().map_or(0, PackedMotion::heap_bytes)
    }
}

impl PackedMotion {
    fn new(motion: &Preintegration, past: &[&dyn StepMeasurements], imu: PackedImu) -> Self {
        let samples = motion.samples();
        let own = || PackedSamples::Own(samples.to_vec());
        Self {
            noise: *motion.noise(),
            bias: *motion.bias(),
            errors: motion.intrinsics().map(|errors| Box::new(*errors)),
            samples: steps_with(samples, past, imu).map_or_else(own, |(first, end)| PackedSamples::OfSteps(first, end)),
        }
    }

    fn unpacked(&self, past: &[&dyn StepMeasurements], imu: PackedImu) -> Preintegration {
        let mut motion = Preintegration::with_intrinsics(self.noise, self.bias, self.errors.as_deref().copied());
        match &self.samples {
            PackedSamples::OfSteps(first, end) => {
                past[*first..*end].iter().for_each(|step| motion.extend(imu.samples(*step)));
            }
            PackedSamples::Own(samples) => motion.extend(samples),
        }
        motion
    }

    fn heap_bytes(&self) -> usize {
        let samples = match &self.samples {
            PackedSamples::OfSteps(..) => 0,
            PackedSamples::Own(samples) => samples.capacity() * size_of::<ImuSample>(),
        };
        samples + self.errors.as_ref().map_or(0, |_| size_of::<ImuErrors>())
    }
}

/// Range of consecutive steps whose samples, concatenated, integrate exactly as `samples`; `None` if there is none.
fn steps_with(samples: &[ImuSample], past: &[&dyn StepMeasurements], imu: PackedImu) -> Option<(usize, usize)> {
    let (first, last) = (samples.first()?, samples.last()?);
    let begins =
        |step: &&dyn StepMeasurements| imu.samples(*step).first().is_some_and(|it| it.stamp_ns == first.stamp_ns);
    let ends = |step: &&dyn StepMeasurements| imu.samples(*step).last().is_some_and(|it| it.stamp_ns == last.stamp_ns);
    let end = past.iter().rposition(ends)? + 1;
    let begin = past[..end].iter().rposition(begins)?;
    let mut before: Option<&ImuSample> = None;
    let mut expected = samples.iter();
    for sample in past[begin..end].iter().flat_map(|step| imu.samples(*step)) {
        if Preintegration::takes(before, sample) {
            if expected.next() != Some(sample) {
                return None;
            }
            before = Some(sample);
        }
    }
    expected.next().is_none().then_some((begin, end))
}
