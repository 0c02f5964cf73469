//! Experiments of the table of docs/mathematics.md, section 11.

use crate::estimator::{JointKnowledge, PoseKnowledge};
use crate::observability::laboratory::experiment::{READOUT_S, with_lens};
use crate::observability::laboratory::{LABORATORY_IMU, LaboratoryMotion as Motion, LaboratorySetup, Mechanism};

/// Frames of an experiment: enough for every set of columns.
const FRAMES: usize = 16;
/// Landmarks of an experiment; each image shows only some of them.
const LANDMARKS: usize = 160;
const RIGID: &str = "rigid";
const GIMBAL: &str = "yaw-roll-pitch-offset";

/// Experiment with every sensor column, and the cause of its rank loss.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SensorExperiment {
    pub(crate) mechanism: &'static str,
    pub(crate) motion: Motion,
    pub(crate) joints: JointKnowledge,
    /// True if the camera has a lens with radial distortion.
    pub(crate) lens: bool,
    /// Reason that sensor columns are unobservable; empty if all are observable.
    pub(crate) cause: &'static str,
}

/// Experiments under one heading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SensorSection {
    pub(crate) title: &'static str,
    pub(crate) experiments: &'static [SensorExperiment],
}

const fn rigid(motion: Motion, cause: &'static str) -> SensorExperiment {
    SensorExperiment { mechanism: RIGID, motion, joints: JointKnowledge::Known, lens: true, cause }
}

const fn gimbal(motion: Motion, cause: &'static str) -> SensorExperiment {
    SensorExperiment { mechanism: GIMBAL, ..rigid(motion, cause) }
}

impl SensorExperiment {
    const fn without_lens(self) -> Self {
        Self { lens: false, ..self }
    }

    const fn without_encoder(self) -> Self {
        Self { joints: JointKnowledge::Unknown, ..self }
    }

    /// Setup of the experiment; `None` for an unknown mechanism.
    pub(crate) fn setup(&self) -> Option<LaboratorySetup> {
        let mut setup = LaboratorySetup::new(Mechanism::named(self.mechanism).ok()?);
        setup.motion = self.motion;
        setup.joints = self.joints;
        setup.poses = PoseKnowledge::Imu { noise: LABORATORY_IMU, biases_known: false };
        setup.frames = FRAMES;
        setup.landmarks = LANDMARKS;
        setup.readout_s = READOUT_S;
        if self.lens {
            setup.camera = with_lens(&setup.camera)?;
        }
        Some(setup)
    }
}

const NO_RATE: &str = "no angular rate: the gyroscope's columns are zero; accelerations and gravity scale with the lengths, \
                       the biases take up the rest";
const NO_RATE_FOCAL: &str = "no angular rate: the gyroscope's columns are zero, the accelerometer's scale trades with the lengths; and without rotation the focal length, k1 and k2 stretch the scene along the axis, \
                             which the accelerometer's intrinsics take up";
const ONE_AXIS: &str =
    "the gyroscope measures one axis: only the third of its matrix that belongs to that axis is observable";
const VERTICAL_AXIS: &str =
    "as with one axis; gravity is constant in the IMU, so that the accelerometer's scale trades with the lengths";
const STEADY: &str = "rate and specific force are constant in the IMU: biases take up its intrinsics; a time shift moves the \
                      vehicle along its own steady motion";
const STEADY_FOCAL: &str = "rate and specific force are constant in the IMU, as in a steady turn; and without rotation the focal length, \
                            k1 and k2 stretch the scene along the axis";
const AFFINE: &str = "without rotation and lens, focal lengths and centre are an affine map of the scene, which the \
                      accelerometer's scale and misalignment take up";

pub(crate) const SECTIONS: [SensorSection; 4] = [
    SensorSection {
        title: "Sensor columns, rigid camera with a lens, poses from the IMU",
        experiments: &[
            rigid(Motion::Aggressive, ""),
            rigid(Motion::StraightLine, ""),
            rigid(Motion::RotationOnly, ""),
            rigid(Motion::TranslationOnly, NO_RATE_FOCAL),
            rigid(Motion::RollOnly, ONE_AXIS),
            rigid(Motion::PitchOnly, ONE_AXIS),
            rigid(Motion::YawOnly, VERTICAL_AXIS),
            rigid(Motion::ConstantAcceleration, STEADY_FOCAL),
            rigid(Motion::ConstantVelocity, STEADY_FOCAL),
            rigid(Motion::SteadyTurn, STEADY),
            rigid(Motion::Hover, "nothing moves in the images"),
        ],
    },
    SensorSection {
        title: "The same without a lens (pinhole)",
        experiments: &[
            rigid(Motion::Aggressive, "").without_lens(),
            rigid(Motion::RotationOnly, "").without_lens(),
            rigid(Motion::TranslationOnly, AFFINE).without_lens(),
            rigid(Motion::YawOnly, VERTICAL_AXIS).without_lens(),
            rigid(Motion::ConstantVelocity, AFFINE).without_lens(),
            rigid(Motion::SteadyTurn, STEADY).without_lens(),
        ],
    },
    SensorSection {
        title: "Sensor columns, gimbal with encoders",
        experiments: &[
            gimbal(Motion::Aggressive, ""),
            gimbal(Motion::RotationOnly, ""),
            gimbal(Motion::TranslationOnly, NO_RATE),
            gimbal(Motion::RollOnly, ONE_AXIS),
            gimbal(Motion::YawOnly, VERTICAL_AXIS),
            gimbal(Motion::ConstantAcceleration, "as of a rigid camera; both clocks shift together"),
            gimbal(Motion::ConstantVelocity, "as of a rigid camera; both clocks shift together"),
            gimbal(Motion::SteadyTurn, "as of a rigid camera; both clocks shift together"),
            gimbal(Motion::Hover, "only the joints move: both clocks shift together, the IMU measures constants"),
            gimbal(Motion::Stabilized, ""),
            gimbal(Motion::StabilizedRotationOnly, ""),
            gimbal(Motion::CameraStationary, "nothing moves in the images: neither shutter, clock nor intrinsics"),
            gimbal(Motion::AllJointsFrozen, "no joint moves: the encoders' clock"),
        ],
    },
    SensorSection {
        title: "Sensor columns, gimbal without encoders, joint rates unknown",
        experiments: &[
            gimbal(Motion::Aggressive, "").without_encoder(),
            gimbal(Motion::TranslationOnly, NO_RATE).without_encoder(),
            gimbal(Motion::YawOnly, VERTICAL_AXIS).without_encoder(),
            gimbal(Motion::ConstantVelocity, STEADY).without_encoder(),
            gimbal(Motion::Hover, "only the joints move, and their unknown rates take up readout and time offset")
                .without_encoder(),
            gimbal(Motion::Stabilized, "").without_encoder(),
        ],
    },
];
