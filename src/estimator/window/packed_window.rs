//! Running window without what the inputs of earlier steps reproduce to the same bits.

use nalgebra::{DMatrix, DVector};

use crate::estimator::factors::marginal_prior::{Prior, PriorColumn};
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::state::calibrations::Calibrations;
use crate::estimator::state::frame::{Frame, InformedMotion, Stationary};
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::gimbal_imu_noise::GimbalImuNoise;
use crate::estimator::state::imu_errors::ImuErrors;
use crate::estimator::state::navigation::ImuBias;
use crate::estimator::state::preintegration::Preintegration;
use crate::estimator::step_input::StepMeasurements;
use crate::estimator::window::features::{Feature, FeatureMap};
use crate::estimator::window::frames::Frames;
use crate::estimator::window::loss_scale::LossScale;
use crate::estimator::window::sliding_window::{Monitors, SlidingWindow};
use crate::estimator::window::window_state::WindowState;
use crate::frontend::{FeatureId, ObservedPixel};
use crate::optimization::Landmark;
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
    gimbal_imu_noise: GimbalImuNoise,
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
    /// Samples of no stored step, copied.
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
            gimbal_imu_noise: state.gimbal_imu_noise,
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
                gimbal_imu_noise: self.gimbal_imu_noise,
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

#[derive(Clone, Debug)]
struct PackedFeatures {
    features: Vec<PackedFeature>,
    /// Twice the slot of each observation, plus one if it is copied; of each feature, those by the other camera of a pair come
    /// last.
    observations: Vec<u16>,
    /// Copied observations: those missing in the step of their frame.
    own: Vec<ObservedPixel<usize>>,
}

#[derive(Clone, Debug)]
struct PackedFeature {
    id: FeatureId,
    landmark: Option<Landmark>,
    count: u32,
    /// Number of observations by the other camera of a pair, after the `count` own ones.
    matched: u32,
}

impl PackedFeatures {
    /// `steps` are the steps of the window's frames, by slot.
    fn new(features: &FeatureMap, steps: &[Option<&dyn StepMeasurements>], camera: usize) -> Self {
        let count = features.values().map(|feature| feature.observations.len() + feature.matched.len()).sum();
        let mut packed = Self {
            features: Vec::with_capacity(features.len()),
            observations: Vec::with_capacity(count),
            own: Vec::new(),
        };
        for (id, feature) in features {
            let own = feature.observations.iter().map(|observation| (false, observation));
            for (matched, observation) in own.chain(feature.matched.iter().map(|observation| (true, observation))) {
                let copied = observation_of(steps, observation.view, (camera, matched), *id) != Some(*observation);
                packed.observations.push(2 * observation.view as u16 + u16::from(copied));
                packed.own.extend(copied.then_some(*observation));
            }
            let (count, matched) = (feature.observations.len() as u32, feature.matched.len() as u32);
            packed.features.push(PackedFeature { id: *id, landmark: feature.landmark, count, matched });
        }
        packed
    }

    fn unpacked(&self, steps: &[Option<&dyn StepMeasurements>], camera: usize) -> FeatureMap {
        let (mut observations, mut own) = (self.observations.iter(), self.own.iter());
        let mut feature = |packed: &PackedFeature| {
            let mut unpack = |count: u32, matched: bool| -> Vec<ObservedPixel<usize>> {
                let observation = |place: &u16| match place % 2 {
                    0 => observation_of(steps, usize::from(place / 2), (camera, matched), packed.id),
                    _ => own.next().copied(),
                };
                observations.by_ref().take(count as usize).filter_map(observation).collect()
            };
            let (observations, matched) = (unpack(packed.count, false), unpack(packed.matched, true));
            (packed.id, Feature { observations, matched, landmark: packed.landmark })
        };
        self.features.iter().map(&mut feature).collect()
    }

    fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.features.capacity() * size_of::<PackedFeature>()
            + self.observations.capacity() * size_of::<u16>()
            + self.own.capacity() * size_of::<ObservedPixel<usize>>()
    }
}

/// Observation of a feature in the step of the frame at `slot`, by its camera or by the other one of a pair; `None` without
/// one.
fn observation_of(
    steps: &[Option<&dyn StepMeasurements>],
    slot: usize,
    (camera, matched): (usize, bool),
    id: FeatureId,
) -> Option<ObservedPixel<usize>> {
    let step = (*steps.get(slot)?)?;
    let features = if matched { step.matched(camera) } else { step.features(camera) };
    let place = features.binary_search_by_key(&id, |feature| feature.id).ok()?;
    features[place].seen_in(slot)
}

/// [`Prior`] that stores of each column of the Jacobian only the entries down to the last nonzero one: the Jacobian is
/// nearly triangular.
#[derive(Clone, Debug)]
struct PackedPrior {
    columns: Vec<PriorColumn>,
    /// Number of stored entries of each column.
    heights: Vec<u16>,
    entries: Vec<f64>,
    residual: DVector<f64>,
}

impl PackedPrior {
    fn new(prior: &Prior) -> Self {
        let height = |column: &[f64]| column.iter().rposition(|entry| entry.to_bits() != 0).map_or(0, |last| last + 1);
        let jacobian = prior.jacobian();
        let columns = || jacobian.as_slice().chunks_exact(jacobian.nrows().max(1));
        let heights: Vec<u16> = columns().map(|column| height(column) as u16).collect();
        let mut entries = Vec::with_capacity(heights.iter().map(|height| usize::from(*height)).sum());
        for (column, height) in columns().zip(&heights) {
            entries.extend_from_slice(&column[..usize::from(*height)]);
        }
        Self { columns: prior.columns().to_vec(), heights, entries, residual: prior.offset().clone() }
    }

    fn unpacked(&self) -> Prior {
        let mut jacobian = DMatrix::zeros(self.residual.len(), self.heights.len());
        let mut entries = &self.entries[..];
        for (mut column, height) in jacobian.column_iter_mut().zip(&self.heights) {
            let (own, rest) = entries.split_at(usize::from(*height));
            column.as_mut_slice()[..own.len()].copy_from_slice(own);
            entries = rest;
        }
        Prior::new(self.columns.clone(), jacobian, self.residual.clone())
    }

    fn heap_bytes(&self) -> usize {
        self.columns.capacity() * size_of::<PriorColumn>()
            + self.heights.capacity() * size_of::<u16>()
            + (self.entries.capacity() + self.residual.len()) * size_of::<f64>()
    }
}
