//! Ranks and null spaces of windows with columns of sensors, against `tests/data/sensor_nulls.json`.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::super::table::{SetRank, set_ranks};
use super::super::{LaboratoryForm, LaboratorySetup};
use crate::camera::{CameraModel, Distortion, Projection};
use crate::estimator::{JointKnowledge, PoseKnowledge};
use crate::gimbal::{ParameterNames, Parameterization};
use crate::observability::laboratory::{LABORATORY_IMU, LaboratoryMotion, Mechanism, SensorColumns};
use crate::text::Named as _;

/// One window of the golden file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    mechanism: &'static str,
    motion: LaboratoryMotion,
    encoders: bool,
    lens: bool,
}

const fn case(mechanism: &'static str, motion: LaboratoryMotion) -> Case {
    Case { mechanism, motion, encoders: true, lens: true }
}

const RIGID: &str = "rigid";
const GIMBAL: &str = "yaw-roll-pitch-offset";

/// Every row of the table of docs/mathematics.md, section 11, that has null directions.
pub(super) const CASES: [Case; 24] = [
    case(RIGID, LaboratoryMotion::TranslationOnly),
    case(RIGID, LaboratoryMotion::RollOnly),
    case(RIGID, LaboratoryMotion::PitchOnly),
    case(RIGID, LaboratoryMotion::YawOnly),
    case(RIGID, LaboratoryMotion::RotationOnly),
    case(RIGID, LaboratoryMotion::ConstantVelocity),
    case(RIGID, LaboratoryMotion::ConstantAcceleration),
    case(RIGID, LaboratoryMotion::SteadyTurn),
    case(RIGID, LaboratoryMotion::Hover),
    case(RIGID, LaboratoryMotion::TranslationOnly).without_lens(),
    case(RIGID, LaboratoryMotion::ConstantVelocity).without_lens(),
    case(GIMBAL, LaboratoryMotion::TranslationOnly),
    case(GIMBAL, LaboratoryMotion::RollOnly),
    case(GIMBAL, LaboratoryMotion::YawOnly),
    case(GIMBAL, LaboratoryMotion::RotationOnly),
    case(GIMBAL, LaboratoryMotion::ConstantVelocity),
    case(GIMBAL, LaboratoryMotion::SteadyTurn),
    case(GIMBAL, LaboratoryMotion::Hover),
    case(GIMBAL, LaboratoryMotion::Stabilized),
    case(GIMBAL, LaboratoryMotion::CameraStationary),
    case(GIMBAL, LaboratoryMotion::AllJointsFrozen),
    case(GIMBAL, LaboratoryMotion::Hover).without_encoders(),
    case(GIMBAL, LaboratoryMotion::ConstantVelocity).without_encoders(),
    case(GIMBAL, LaboratoryMotion::Stabilized).without_encoders(),
];

impl Case {
    const fn without_lens(self) -> Self {
        Self { lens: false, ..self }
    }

    const fn without_encoders(self) -> Self {
        Self { encoders: false, ..self }
    }

    /// Name in the golden file.
    pub(super) fn name(&self) -> String {
        let encoders = if self.encoders { "" } else { ", no encoder" };
        let lens = if self.lens { "" } else { ", no lens" };
        format!("{}, {}{encoders}{lens}", self.mechanism, self.motion.name())
    }

    pub(super) fn setup(&self) -> LaboratorySetup {
        let mut setup = LaboratorySetup::new(Mechanism::named(self.mechanism).unwrap());
        if self.lens {
            let lens = Distortion::Radtan([-0.28, 0.07, 0.0, 0.0]);
            let resolution_px = setup.camera.resolution_px;
            setup.camera =
                CameraModel::new(Projection::Pinhole, lens, setup.camera.intrinsics_px, resolution_px).unwrap();
        }
        setup.motion = self.motion;
        setup.joints = if self.encoders { JointKnowledge::Known } else { JointKnowledge::Unknown };
        setup.poses = PoseKnowledge::Imu { noise: LABORATORY_IMU, biases_known: false };
        setup.columns = SensorColumns::ALL;
        setup.readout_s = 0.02;
        (setup.frames, setup.landmarks) = if self.encoders { (8, 30) } else { (12, 60) };
        setup
    }
}

/// One window of the file.
#[derive(Debug, Deserialize, Serialize)]
struct Golden {
    /// Structural rank of all columns together.
    rank: usize,
    /// Rank of the chain's columns alone.
    rank_of_chain: usize,
    /// Participation of each parameter in the null space: diagonal of its projector, in units of the column scale.
    null_projector: BTreeMap<String, f64>,
    /// Smallest singular value above the structural threshold.
    smallest: f64,
}

fn computed(case: &Case) -> Golden {
    let form = LaboratoryForm::whole(Parameterization::Minimal);
    let sets = [SensorColumns::NONE, SensorColumns::ALL];
    let ranks = set_ranks(&case.setup(), form, &sets).unwrap();
    let all = &ranks[1];
    let names = ParameterNames::default();
    let parameters = all.parameters.iter().map(|parameter| names.name(*parameter));
    Golden {
        rank: all.rank,
        rank_of_chain: ranks[0].rank,
        null_projector: parameters.zip(null_projector(all)).collect(),
        smallest: all.rank.checked_sub(1).map_or(0.0, |last| all.singular_values[last]),
    }
}

fn null_projector(rank: &SetRank) -> Vec<f64> {
    let count = rank.parameters.len();
    let basis = DMatrix::from_fn(count, rank.null.len(), |row, column| rank.null[column].weights[row]);
    let orthonormal = basis.qr().q();
    // Six digits: the remaining digits are rounding errors.
    (0..count).map(|row| (orthonormal.row(row).norm_squared() * 1e6).round() * 1e-6).collect()
}

fn path() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/sensor_nulls.json")
}

#[test]
fn null_spaces_of_sensor_columns_are_those_of_the_golden_file() {
    let golden: BTreeMap<String, Golden> =
        serde_json::from_str(include_str!("../../../../../tests/data/sensor_nulls.json")).unwrap();
    assert_eq!(golden.len(), CASES.len());
    CASES.par_iter().for_each(|case| {
        let (name, found) = (case.name(), computed(case));
        let expected = &golden[&name];
        assert_eq!((found.rank, found.rank_of_chain), (expected.rank, expected.rank_of_chain), "{name}");
        assert!((found.smallest / expected.smallest - 1.0).abs() < 1e-4 || expected.rank == 0, "{name}: {found:?}");
        for (parameter, participation) in &expected.null_projector {
            let error = (found.null_projector[parameter] - participation).abs();
            assert!(error < 1e-4, "{name} {parameter}: {error}");
        }
    });
}

#[test]
#[ignore = "writes the golden file"]
fn write_sensor_nulls() {
    let golden: BTreeMap<String, Golden> = CASES.par_iter().map(|case| (case.name(), computed(case))).collect();
    let mut text = serde_json::to_string_pretty(&golden).unwrap();
    text.push('\n');
    std::fs::write(path(), text).unwrap();
}
