use super::super::window::SensorWindow;
use super::super::{LaboratoryForm, LaboratorySetup};
use crate::camera::{CameraModel, Distortion, Projection};
use crate::estimator::{JointKnowledge, PoseKnowledge};
use crate::gimbal::Parameterization;
use crate::observability::laboratory::{LABORATORY_IMU, LaboratoryMotion, Mechanism, SensorColumns};

fn setup(mechanism: &str, joints: JointKnowledge, imu: bool) -> LaboratorySetup {
    let mut setup = LaboratorySetup::new(Mechanism::named(mechanism).unwrap());
    let lens = Distortion::Radtan([-0.28, 0.07, 2e-4, 2e-5]);
    setup.camera = CameraModel::new(Projection::Pinhole, lens, setup.camera.intrinsics_px, [640, 480]).unwrap();
    setup.motion = LaboratoryMotion::Aggressive;
    setup.joints = joints;
    if imu {
        setup.poses = PoseKnowledge::Imu { noise: LABORATORY_IMU, biases_known: false };
    }
    setup.frames = 4;
    setup.landmarks = 12;
    setup.readout_s = 0.03;
    setup
}

/// Checks the derivatives of all rows by all columns and landmarks, at a state that differs from ground truth.
fn check(setup: &LaboratorySetup) {
    let form = LaboratoryForm::whole(Parameterization::Minimal);
    let window = SensorWindow::new(setup, form, SensorColumns::ALL);
    let layout = &window.layout;
    let exact = window.rows(&window.truth).unwrap();
    let largest = exact.iter().map(|rows| rows.residual().amax()).fold(0.0, f64::max);
    assert!(largest < 1e-5, "the true state leaves residuals of {largest}");
    let offset: Vec<f64> = (0..layout.total()).map(|column| 2e-3 * (1.7 * column as f64 + 0.3).sin()).collect();
    let state = window.truth.plus(layout, &offset);
    let rows = window.rows(&state).unwrap();
    let mut compared = 0;
    for column in 0..layout.total() {
        let step = 1e-6;
        let at = |change: f64| {
            let mut delta = vec![0.0; layout.total()];
            delta[column] = change;
            window.rows(&state.plus(layout, &delta)).unwrap()
        };
        let (after, before) = (at(step), at(-step));
        for (rows, (after, before)) in rows.iter().zip(after.iter().zip(&before)) {
            let numeric = (after.residual() - before.residual()) / (2.0 * step);
            let analytic = rows.rows.column(column);
            let error = (&numeric - analytic).amax();
            let size = 1.0 + analytic.amax().max(rows.residual().amax());
            assert!(error < 2e-5 * size, "column {column} of {layout:?}: {error} at {size}");
            compared += usize::from(analytic.amax() > 0.0);
        }
    }
    assert!(compared > layout.total(), "{compared} blocks for {} columns", layout.total());
    for landmark in 0..state.landmarks.len() {
        for axis in 0..3 {
            let at = |change: f64| {
                let mut moved = state.clone();
                moved.landmarks[landmark][axis] += change;
                window.rows(&moved).unwrap().swap_remove(landmark).residual()
            };
            let numeric = (at(1e-5) - at(-1e-5)) / 2e-5;
            let error = (numeric - rows[landmark].by_landmark.column(axis)).amax();
            assert!(error < 1e-5, "landmark {landmark}: {error}");
        }
    }
}

#[test]
fn rows_meet_central_differences() {
    for joints in [JointKnowledge::Known, JointKnowledge::Encoder(0.01), JointKnowledge::Unknown] {
        for imu in [false, true] {
            check(&setup("yaw-roll-pitch-offset", joints, imu));
        }
    }
    check(&setup("rigid", JointKnowledge::Known, true));
}
