//! Experiments of the survey: mechanisms, motions and known quantities for which the rank of the calibration is
//! computed.

use super::{LABORATORY_IMU, LaboratoryForm, LaboratoryMotion as Motion, LaboratorySetup, Mechanism};
use crate::estimator::{JointKnowledge, PoseKnowledge};
use crate::gimbal::Parameterization;

/// Landmarks of the windows with unknown joint angles; all other windows have a hundred.
const LANDMARKS_WITHOUT_ENCODER: usize = 130;

#[derive(Clone, Copy, Debug)]
pub(super) struct DegeneracyExperiment {
    /// Label in the table.
    pub(super) scenario: &'static str,
    pub(super) mechanism: &'static str,
    pub(super) motion: Motion,
    /// Joints that do not move, counted from 1.
    frozen: &'static [usize],
    joints: JointKnowledge,
    poses: PoseKnowledge,
    frames: usize,
    /// Parameterizations whose ranks are compared.
    pub(super) forms: &'static [LaboratoryForm],
}

/// Experiments under one heading.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    pub(super) title: &'static str,
    pub(super) experiments: &'static [DegeneracyExperiment],
}

/// Experiment with exciting motion, known poses and joint angles, in the classical and the minimal parameterization.
const fn experiment(scenario: &'static str, mechanism: &'static str) -> DegeneracyExperiment {
    DegeneracyExperiment {
        scenario,
        mechanism,
        motion: Motion::Aggressive,
        frozen: &[],
        joints: JointKnowledge::Known,
        poses: PoseKnowledge::Known,
        frames: 10,
        forms: CLASSICAL_MINIMAL,
    }
}

/// [`experiment`], also as a product of exponentials.
const fn with_poe(scenario: &'static str, mechanism: &'static str) -> DegeneracyExperiment {
    experiment(scenario, mechanism).forms(CLASSICAL_MINIMAL_POE)
}

/// [`experiment`] in all parameterizations.
const fn in_all_forms(scenario: &'static str, mechanism: &'static str) -> DegeneracyExperiment {
    experiment(scenario, mechanism).forms(ALL_FORMS)
}

impl DegeneracyExperiment {
    const fn moving(self, motion: Motion) -> Self {
        Self { motion, ..self }
    }

    const fn freezing(self, frozen: &'static [usize]) -> Self {
        Self { frozen, ..self }
    }

    const fn encoder_deg(self, sigma_deg: f64) -> Self {
        Self { joints: JointKnowledge::Encoder(sigma_deg.to_radians()), ..self }
    }

    const fn without_encoder(self) -> Self {
        Self { joints: JointKnowledge::Unknown, ..self }
    }

    const fn poses(self, poses: PoseKnowledge) -> Self {
        Self { poses, ..self }
    }

    const fn frames(self, frames: usize) -> Self {
        Self { frames, ..self }
    }

    const fn forms(self, forms: &'static [LaboratoryForm]) -> Self {
        Self { forms, ..self }
    }

    /// Setup of the experiment; `None` for an unknown mechanism.
    pub(super) fn setup(&self) -> Option<LaboratorySetup> {
        let mut setup = LaboratorySetup::new(Mechanism::named(self.mechanism).ok()?);
        setup.motion = self.motion;
        setup.frozen = self.frozen.iter().map(|joint| joint - 1).collect();
        setup.joints = self.joints;
        setup.poses = self.poses;
        setup.frames = self.frames;
        if self.joints == JointKnowledge::Unknown {
            setup.landmarks = LANDMARKS_WITHOUT_ENCODER;
        }
        Some(setup)
    }

    pub(super) fn setup_of(&self, frames: usize) -> Option<LaboratorySetup> {
        self.frames(frames).setup()
    }
}

const CLASSICAL: LaboratoryForm = LaboratoryForm::whole(Parameterization::Classical);
const MINIMAL: LaboratoryForm = LaboratoryForm::whole(Parameterization::Minimal);
const POE: LaboratoryForm = LaboratoryForm::whole(Parameterization::Poe);
const CLASSICAL_MINIMAL: &[LaboratoryForm] = &[CLASSICAL, MINIMAL];
const CLASSICAL_MINIMAL_POE: &[LaboratoryForm] = &[CLASSICAL, MINIMAL, POE];
const ALL_FORMS: &[LaboratoryForm] = &[
    CLASSICAL,
    MINIMAL,
    LaboratoryForm::whole(Parameterization::MinimalSwapped),
    LaboratoryForm::whole(Parameterization::MinimalYx),
    POE,
];
const WITHOUT_OFFSETS: &[LaboratoryForm] =
    &[LaboratoryForm { joint_offsets: false, ..CLASSICAL }, LaboratoryForm { joint_offsets: false, ..MINIMAL }];

const OFFSET: &str = "yaw-roll-pitch-offset";
const IDEAL: &str = "yaw-roll-pitch-ideal";
const IMU: PoseKnowledge = PoseKnowledge::Imu { noise: LABORATORY_IMU, biases_known: false };
const IMU_BIASES_KNOWN: PoseKnowledge = PoseKnowledge::Imu { noise: LABORATORY_IMU, biases_known: true };

/// Mechanism of the two windows of one motion; see [`super::spurious`].
pub(super) const GENERIC: DegeneracyExperiment = experiment("", "generic");
/// [`GENERIC`] with free joint angles.
pub(super) const GENERIC_WITHOUT_ENCODER: DegeneracyExperiment = GENERIC.without_encoder();

/// Experiments for which the smallest number of frames with full rank is searched.
pub(super) const MIN_FRAMES: [DegeneracyExperiment; 6] = [
    experiment("encoder, poses known", "generic"),
    experiment("encoder, IMU, bias known", "generic").poses(IMU_BIASES_KNOWN),
    experiment("encoder, IMU, bias free", "generic").poses(IMU),
    experiment("no encoder, poses known", "generic").without_encoder(),
    experiment("no encoder, IMU, bias known", "generic").without_encoder().poses(IMU_BIASES_KNOWN),
    experiment("no encoder, IMU, bias free", "generic").without_encoder().poses(IMU),
];

/// Experiments whose ranks are computed.
pub(super) const SECTIONS: [Section; 6] = [
    Section {
        title: "Joint angles and poses (exciting motion)",
        experiments: &[
            with_poe("encoder known, poses known", OFFSET),
            with_poe("encoder known, poses known, generic", "generic"),
            with_poe("encoder known, IMU, bias known", OFFSET).poses(IMU_BIASES_KNOWN),
            with_poe("encoder known, IMU, bias free", OFFSET).poses(IMU),
            with_poe("encoder prior 7 deg, poses known", OFFSET).encoder_deg(7.0),
            with_poe("encoder prior 10 deg, IMU, bias free", OFFSET).encoder_deg(10.0).poses(IMU),
            with_poe("no encoder, poses known", OFFSET).without_encoder().frames(16),
            with_poe("no encoder, poses known, generic", "generic").without_encoder().frames(16),
            with_poe("no encoder, IMU, bias known", OFFSET).without_encoder().poses(IMU_BIASES_KNOWN).frames(16),
            with_poe("no encoder, IMU, bias free, 10 frames", OFFSET).without_encoder().poses(IMU),
            with_poe("no encoder, IMU, bias free, 11 frames", OFFSET).without_encoder().poses(IMU).frames(11),
            with_poe("no encoder, ideal gimbal, poses known", IDEAL).without_encoder().frames(16),
            with_poe("no encoder, ideal gimbal, IMU, bias known", IDEAL)
                .without_encoder()
                .poses(IMU_BIASES_KNOWN)
                .frames(16),
            with_poe("no encoder, ideal gimbal, IMU, bias free", IDEAL).without_encoder().poses(IMU).frames(16),
            experiment("no encoder, without offsets (21 and 15)", OFFSET)
                .without_encoder()
                .frames(16)
                .forms(WITHOUT_OFFSETS),
        ],
    },
    Section {
        title: "Number of joints (12 + 4N columns, 4N + 6 identifiable)",
        experiments: &[
            with_poe("no joints", "rigid"),
            with_poe("one joint", "generic-1"),
            with_poe("two joints", "generic-2"),
            with_poe("three joints", "generic"),
            with_poe("four joints", "generic-4"),
        ],
    },
    Section {
        title: "Mechanisms (exciting, encoder known, poses known)",
        experiments: &[
            in_all_forms("generic", "generic"),
            in_all_forms("yaw-roll-pitch, 2-8 cm offsets, optical", OFFSET),
            in_all_forms("yaw-roll-pitch, axes intersect, optical", IDEAL),
            in_all_forms("yaw-roll-pitch, camera frame FLU", "yaw-roll-pitch-flu"),
            in_all_forms("same, camera centre on the last axis", "yaw-roll-pitch-flu-centred"),
            in_all_forms("pitch-roll-yaw, optical", "pitch-roll-yaw"),
            experiment("roll first (first axis || IMU x)", "roll-first").forms(ALL_FORMS),
            in_all_forms("axes 1, 2 parallel", "parallel-axes"),
            in_all_forms("axes 2, 3 parallel", "parallel-axes-2-3"),
            in_all_forms("axes 1, 2 coaxial", "coaxial-axes"),
            in_all_forms("pan only, optical", "one-joint"),
            in_all_forms("pan-tilt", "pan-tilt"),
        ],
    },
    Section {
        title: "Joints that do not move (identifiable = 4 N_moving + 6)",
        experiments: &[
            experiment("joints 1, 2 move", OFFSET).freezing(&[3]),
            experiment("joints 1, 3 move", OFFSET).freezing(&[2]),
            experiment("joints 2, 3 move", OFFSET).freezing(&[1]),
            experiment("joints 1, 2 move, generic", "generic").freezing(&[3]),
            experiment("joint 1 moves", OFFSET).freezing(&[2, 3]),
            experiment("joint 2 moves", OFFSET).freezing(&[1, 3]),
            experiment("joint 3 moves", OFFSET).freezing(&[1, 2]),
            experiment("no joint moves", OFFSET).freezing(&[1, 2, 3]),
            experiment("joint 2 stationary, axes 1, 3 parallel", "outer-parallel").freezing(&[2]),
            experiment("no encoder, joints 1, 3 move", OFFSET).freezing(&[2]).without_encoder().frames(16),
            experiment("no encoder, joint 1 moves", OFFSET).freezing(&[2, 3]).without_encoder().frames(16),
            experiment("no encoder, no joint moves", OFFSET).freezing(&[1, 2, 3]).without_encoder().frames(16),
        ],
    },
    Section {
        title: "Motion of vehicle and camera (encoder known)",
        experiments: &[
            experiment("pure translation", OFFSET).moving(Motion::TranslationOnly),
            experiment("hover", OFFSET).moving(Motion::Hover),
            experiment("constant velocity, IMU", OFFSET).moving(Motion::ConstantVelocity).poses(IMU),
            experiment("yaw only + translation", OFFSET).moving(Motion::YawOnly),
            experiment("the same in the plane", OFFSET).moving(Motion::YawPlanar),
            experiment("the same, body tilted", OFFSET).moving(Motion::YawTilted),
            experiment("yaw in place", OFFSET).moving(Motion::YawInPlace),
            experiment("rotation only", OFFSET).moving(Motion::RotationOnly),
            experiment("constant velocity + rotation, IMU", OFFSET).moving(Motion::ConstantVelocityRotation).poses(IMU),
            experiment("straight line, accelerated, rotating", OFFSET).moving(Motion::StraightLine),
            experiment("camera never rotates in the world", OFFSET).moving(Motion::Stabilized),
            experiment("the same, IMU, bias free", OFFSET).moving(Motion::Stabilized).poses(IMU),
            experiment("camera follows yaw only", OFFSET).moving(Motion::YawFollowing),
            experiment("stabilised + rotation only", OFFSET).moving(Motion::StabilizedRotationOnly),
            experiment("stabilised + pure translation", OFFSET).moving(Motion::StabilizedTranslationOnly),
        ],
    },
    Section {
        title: "Motion without encoders",
        experiments: &[
            experiment("pure translation", OFFSET).moving(Motion::TranslationOnly).without_encoder().frames(16),
            experiment("hover", OFFSET).moving(Motion::Hover).without_encoder().frames(16),
            experiment("yaw only + translation", OFFSET).moving(Motion::YawOnly).without_encoder().frames(16),
            experiment("camera never rotates in the world", OFFSET)
                .moving(Motion::Stabilized)
                .without_encoder()
                .frames(16),
            experiment("stabilised + pure translation", OFFSET)
                .moving(Motion::StabilizedTranslationOnly)
                .without_encoder()
                .frames(16),
        ],
    },
];
