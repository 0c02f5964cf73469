//! Derivatives of the pose loops against central differences.

use nalgebra::{DMatrix, DVector, Vector6};

use crate::calibration::stills::observed::{ObservedSet, observe};
use crate::geometry::RigidTransform;
use crate::gimbal::{Chain, Parameterization};
use crate::sensors::StillsChain;
use crate::simulation::{SyntheticStillsOptions, synthetic_stills};

const STEP: f64 = 1e-6;

/// Two sets without noise, and the truth.
fn exact() -> (Vec<ObservedSet>, StillsChain, Vec<Vec<f64>>) {
    let options = SyntheticStillsOptions {
        stations: 1,
        sets_per_station: 2,
        pixel_sigma_px: 0.0,
        encoder_sigma_rad: [0.0; 3],
        station_rotation_rad: 0.0,
        station_position_m: 0.0,
        set_position_m: 0.0,
        ..SyntheticStillsOptions::default()
    };
    let made = synthetic_stills(&options);
    let (sets, left_out) = observe(&made.stills);
    assert!(left_out.is_empty(), "{left_out:?}");
    (sets, made.truth, made.joint_angles_rad)
}

/// Checks a matrix against central differences of a function of `count` coordinates.
fn check(name: &str, found: &DMatrix<f64>, count: usize, residual: &dyn Fn(&DVector<f64>) -> DVector<f64>) {
    assert_eq!(found.ncols(), count, "{name}");
    let scale = found.amax().max(1.0);
    for column in 0..count {
        let mut step = DVector::zeros(count);
        step[column] = STEP;
        let difference = (residual(&step) - residual(&-step)) / (2.0 * STEP);
        let error = (found.column(column) - difference).amax() / scale;
        assert!(error < 2e-6, "{name}, column {column}: relative error {error:.1e}");
    }
}

#[test]
fn rows_are_the_derivatives_of_the_residual() {
    let (sets, truth, angles) = exact();
    for (set, angles) in sets.iter().zip(&angles) {
        for parameterization in [Parameterization::Poe, Parameterization::Classical, Parameterization::Minimal] {
            let chain = Chain::from_classical(&truth.chain, parameterization);
            // Away from the truth, so that the residual is not zero.
            let chain = chain.plus(&DVector::from_element(chain.dof(), 0.02));
            let further: Vec<RigidTransform> =
                truth.further_from_first.iter().map(|it| it.plus(&Vector6::repeat(0.03))).collect();
            let rows = set.rows(&chain, &further, angles);
            check("chain", &rows.by_chain, chain.dof(), &|step| set.residual(&chain.plus(step), &further, angles));
            check("joints", &rows.by_joints, 3, &|step| {
                let moved: Vec<f64> = angles.iter().zip(step).map(|(angle, step)| angle + step).collect();
                set.residual(&chain, &further, &moved)
            });
            check("further", &rows.by_further, 6, &|step| {
                let moved = further[0].plus(&step.fixed_rows::<6>(0).into_owned());
                set.residual(&chain, &[moved], angles)
            });
        }
    }
}

#[test]
fn map_errors_are_the_derivatives_by_the_measured_poses() {
    let (sets, truth, angles) = exact();
    let chain = Chain::from_classical(&truth.chain, Parameterization::Poe);
    for (set, angles) in sets.iter().zip(&angles) {
        let further = &truth.further_from_first;
        for place in 0..2 {
            check("rigid camera", &set.by_rigid_map[place], 6, &|step| {
                let mut moved = set.clone();
                let pose = &mut moved.rigid[place].1.camera_from_world;
                *pose = pose.plus(&step.fixed_rows::<6>(0).into_owned());
                moved.residual(&chain, further, angles)
            });
        }
        check("gimbal camera", &set.by_gimbal_map, 3, &|step| {
            let mut moved = set.clone();
            let pose = &mut moved.gimbal.camera_from_world;
            *pose = pose.plus(&Vector6::new(0.0, 0.0, 0.0, step[0], step[1], step[2]));
            moved.residual(&chain, further, angles)
        });
    }
}
