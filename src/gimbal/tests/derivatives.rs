use nalgebra::{DMatrix, DVector};

use super::random::{Random, all_chains};
use crate::gimbal::{
    Chain, ParameterPart, Parameterization, Quantity, generic_joint_angles, redundant_directions, stacked_jacobian,
};
use crate::text::Named as _;

/// Every chain in every parameterization, with and without offsets.
fn every_chain() -> Vec<(String, Chain)> {
    let mut chains = vec![];
    for (name, classical) in all_chains() {
        for parameterization in Parameterization::all() {
            let chain = Chain::from_classical(&classical, parameterization);
            chains.push((format!("{name} as {parameterization}"), chain.clone()));
            chains.push((format!("{name} as {parameterization} without offsets"), chain.without_joint_offsets()));
        }
    }
    chains
}

#[test]
fn derivatives_meet_central_differences() {
    let mut random = Random::new(11);
    let step = 1e-6;
    for (name, chain) in every_chain() {
        let angles = random.angles(chain.joint_count());
        let linearization = chain.linearize(&angles);
        let check =
            |column: usize, plus: crate::geometry::RigidTransform, minus, analytic: nalgebra::DVectorView<'_, f64>| {
                let at = &linearization.imu_from_camera;
                let numeric = (plus.minus(at) - crate::geometry::RigidTransform::minus(&minus, at)) / (2.0 * step);
                assert!((numeric - analytic).amax() < 2e-9, "{name} column {column}: {numeric} against {analytic}");
            };
        for column in 0..chain.dof() {
            let mut delta = DVector::zeros(chain.dof());
            delta[column] = step;
            let (plus, minus) = (chain.plus(&delta), chain.plus(&-delta));
            let analytic = linearization.by_parameters.column(column).clone_owned();
            let analytic = DVector::from_column_slice(analytic.as_slice());
            check(column, plus.imu_from_camera(&angles), minus.imu_from_camera(&angles), analytic.as_view());
        }
        for joint in 0..chain.joint_count() {
            let shifted = |by: f64| {
                let mut angles = angles.clone();
                angles[joint] += by;
                chain.imu_from_camera(&angles)
            };
            let analytic = DVector::from_column_slice(linearization.by_joints.column(joint).clone_owned().as_slice());
            check(joint, shifted(step), shifted(-step), analytic.as_view());
        }
    }
}

#[test]
fn chains_obey_the_manifold_laws() {
    let mut random = Random::new(12);
    for (name, chain) in every_chain() {
        let zero = DVector::zeros(chain.dof());
        assert!(chain.plus(&zero).minus(&chain).amax() < 1e-14, "{name}");
        for size in [1e-7, 1e-2, 0.3] {
            let delta = DVector::from_fn(chain.dof(), |_, _| random.within(size));
            let moved = chain.plus(&delta);
            let error = (moved.minus(&chain) - &delta).amax();
            assert!(error < 1e-12, "{name}: (x ⊞ δ) ⊟ x error {error}");
            // Two updates, so that `poe` leaves the set that one update reaches.
            let far = moved.plus(&DVector::from_fn(chain.dof(), |_, _| random.within(size)));
            let rebuilt = chain.plus(&far.minus(&chain));
            let angles = random.angles(chain.joint_count());
            let error = rebuilt.imu_from_camera(&angles).minus(&far.imu_from_camera(&angles)).amax();
            assert!(error < 1e-12, "{name}: x ⊞ (y ⊟ x) error {error}");
        }
    }
}

#[test]
fn values_follow_scalar_updates() {
    let mut random = Random::new(13);
    for (name, chain) in every_chain() {
        let delta = DVector::from_fn(chain.dof(), |_, _| random.within(1e-3));
        let difference = chain.plus(&delta).values() - chain.values();
        for (index, column) in chain.parameters().iter().enumerate() {
            // Rotation vectors do not add, and jump at half revolutions; the local translations of `poe` are in
            // rotated axes.
            let scalar = matches!(column.part, ParameterPart::Link(_) | ParameterPart::Base)
                || matches!(column.quantity, Quantity::Tx | Quantity::Ty | Quantity::Tz);
            assert!(!scalar || (difference[index] - delta[index]).abs() < 1e-15, "{name} {column:?}");
        }
    }
}

#[test]
fn redundant_directions_of_the_classical_form_keep_the_camera_pose() {
    let mut random = Random::new(14);
    for (name, classical) in all_chains() {
        let directions = redundant_directions(&classical);
        assert_eq!(directions.shape(), (12 + 4 * classical.joint_count(), 6));
        let singular_values = directions.clone().singular_values();
        assert!(singular_values.min() > 0.3, "{name}: the six directions are independent: {singular_values}");
        let chain = Chain::from_classical(&classical, Parameterization::Classical);
        for _ in 0..4 {
            let angles = random.angles(classical.joint_count());
            let residue = &chain.linearize(&angles).by_parameters * &directions;
            assert!(residue.amax() < 1e-14, "{name}: {residue}");
        }
    }
}

#[test]
fn ranks_over_all_joint_angles_are_four_per_joint_and_six() {
    let rank = |chain: &Chain| {
        let angles = generic_joint_angles(chain.joint_count(), 40);
        let values = stacked_jacobian(chain, &angles).singular_values();
        values.iter().filter(|value| **value > 1e-10 * values.max()).count()
    };
    let mut random = Random::new(15);
    for joints in 0..=4 {
        let classical = random.chain(joints);
        for parameterization in Parameterization::all() {
            let chain = Chain::from_classical(&classical, parameterization);
            assert_eq!(rank(&chain), 6 + 4 * joints, "{parameterization} with {joints} joints");
        }
    }
    let expected = [
        ("ideal", [18, 18, 17, 18]),
        ("roll first", [18, 17, 16, 18]),
        ("body camera", [18, 17, 18, 18]),
        ("camera on the last axis", [18, 16, 18, 18]),
        ("parallel axes", [17, 17, 16, 18]),
        ("coaxial axes", [16, 16, 15, 18]),
        ("pan only", [10, 9, 10, 10]),
    ];
    let forms = [
        Parameterization::Classical,
        Parameterization::Minimal,
        Parameterization::MinimalSwapped,
        Parameterization::Poe,
    ];
    for (name, ranks) in expected {
        let chains = super::random::special_chains();
        let classical = &chains.iter().find(|(other, _)| *other == name).unwrap().1;
        let found = forms.map(|form| rank(&Chain::from_classical(classical, form)));
        assert_eq!(found, ranks, "{name}");
    }
}

#[test]
fn generic_angles_are_spread_and_repeatable() {
    let angles = generic_joint_angles(3, 64);
    assert_eq!(angles, generic_joint_angles(3, 64));
    for joint in 0..3 {
        let mut quadrants = [0; 4];
        for vector in &angles {
            assert!(vector[joint].abs() <= std::f64::consts::PI);
            quadrants[(((vector[joint] / std::f64::consts::PI + 1.0) * 2.0) as usize).min(3)] += 1;
        }
        assert!(quadrants.iter().all(|count| (12..=20).contains(count)), "{quadrants:?}");
    }
    let moments = DMatrix::from_fn(64, 3, |row, column| angles[row][column].sin());
    assert!((moments.tr_mul(&moments) / 32.0 - DMatrix::identity(3, 3)).amax() < 0.2);
}
