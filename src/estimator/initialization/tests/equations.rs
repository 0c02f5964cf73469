//! Gradients of the refinements against central differences.

use nalgebra::{DVector, Vector3};

use super::flight::{Random, noise};
use crate::estimator::initialization::VectorPrior;
use crate::estimator::initialization::refinement::{RefinedState, Refinement, RefinementInput};
use crate::estimator::initialization::visual_problem::{BearingObservation, TrackedLandmark};
use crate::estimator::state::navigation::ImuBias;
use crate::estimator::state::preintegration::Preintegration;
use crate::frontend::FeatureId;
use crate::geometry::{RigidTransform, so3};
use crate::sensors::ImuSample;

fn increments(count: usize, random: &mut Random) -> Vec<Preintegration> {
    (0..count)
        .map(|_| {
            let (angular_velocity, force) = (random.vector(0.8), random.vector(3.0) + Vector3::new(0.0, 0.0, 9.8));
            let samples: Vec<ImuSample> = (0..=30)
                .map(|step| ImuSample {
                    stamp_ns: step * 5_000_000,
                    angular_velocity_rad_per_s: angular_velocity + random.vector(0.1),
                    specific_force_m_per_s2: force + random.vector(0.5),
                    unmeasured_s: 0.0,
                })
                .collect();
            Preintegration::from_samples(noise(), ImuBias::default(), &samples)
        })
        .collect()
}

#[test]
fn gradient_of_the_refinement_meets_central_differences() {
    const VIEWS: usize = 4;
    let mut random = Random::new(11);
    for own_noise in [0.0, 0.1] {
        let extrinsics: Vec<RigidTransform> =
            (0..VIEWS).map(|_| RigidTransform::new(so3::exp(&random.vector(0.5)), random.vector(0.1))).collect();
        let increments = increments(VIEWS - 1, &mut random);
        let input = RefinementInput {
            imu_from_camera: &extrinsics,
            increments: &increments,
            bearing_sigma_rad: 0.05,
            extrinsics_rotation_sigma_rad: 0.1,
            extrinsics_rotation_noise_rad: own_noise,
            extrinsics_translation_sigma_m: 0.05,
            gyroscope_bias: VectorPrior { mean: random.vector(0.01), sigma: 0.05 },
            accelerometer_bias: VectorPrior { mean: Vector3::zeros(), sigma: 0.5 },
        };
        let mut poses = vec![RigidTransform::identity()];
        poses.extend((1..VIEWS).map(|_| RigidTransform::new(so3::exp(&random.vector(0.2)), random.vector(0.5))));
        let landmarks = (0..12)
            .map(|index: u64| {
                let anchor = index as usize % 2;
                let observations = [anchor, 2, 3]
                    .map(|view| BearingObservation::new(view, (random.vector(0.4) + Vector3::z()).normalize()));
                let mut landmark =
                    TrackedLandmark::new(FeatureId(index), random.uniform(0.1, 0.3), observations.to_vec()).unwrap();
                landmark.landmark.bearing = (landmark.landmark.bearing + random.vector(0.05)).normalize();
                landmark
            })
            .collect();
        let random_rotation = |random: &mut Random| so3::exp(&random.vector(if own_noise > 0.0 { 0.1 } else { 0.0 }));
        let state = RefinedState {
            poses,
            velocities: (0..VIEWS).map(|_| random.vector(1.0)).collect(),
            gravity: Vector3::new(0.5, -1.0, -9.7).normalize() * 9.81,
            bias: ImuBias { gyroscope_rad_per_s: random.vector(0.02), accelerometer_m_per_s2: random.vector(0.3) },
            landmarks,
            common_rotation: so3::exp(&random.vector(0.1)),
            common_shift: random.vector(0.02),
            per_view_rotations: (0..VIEWS).map(|_| random_rotation(&mut random)).collect(),
        };
        let refinement = Refinement::new(&input).unwrap();
        // A damping of 1e15 on the depths leaves the plain gradient at fixed depths.
        let (reduced, _) = refinement.reduced(&state, &refinement.linearized(&state), 1e15);
        let (normal, gradient) = (reduced.hessian, reduced.gradient);
        assert!((&normal - normal.transpose()).amax() < 1e-9 * normal.amax());
        let fixed_columns = refinement.layout.pose(0);
        for column in 0..refinement.layout.columns() {
            if (fixed_columns..fixed_columns + 6).contains(&column) {
                continue;
            }
            let h = 1e-6;
            let cost = |sign: f64| {
                let mut step = DVector::zeros(refinement.layout.columns());
                step[column] = sign * h;
                refinement.cost(&state.moved(&step, &refinement.layout, state.landmarks.clone()))
            };
            let numeric = (cost(1.0) - cost(-1.0)) / (2.0 * h);
            let analytic = 2.0 * gradient[column];
            // Magnitude of the summed terms, for the rounding of the differences.
            let scale = normal[(column, column)].sqrt() + 1e-6 * cost(0.0);
            assert!(
                (numeric - analytic).abs() < 1e-5 * numeric.abs().max(1.0) + 1e-3 * scale,
                "column {column}: {numeric} against {analytic}"
            );
        }
    }
}
