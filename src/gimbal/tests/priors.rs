use nalgebra::{DMatrix, DVector};

use super::random::{Random, all_chains, special_chains};
use crate::geometry::Dimension;
use crate::gimbal::{Chain, Parameterization, transport, transport_covariance};
use crate::text::Named as _;

const TRANSLATION_SIGMA_M: f64 = 0.003;
const ROTATION_SIGMA_RAD: f64 = 0.0087;

#[test]
fn transported_steps_move_the_camera_equally() {
    let mut random = Random::new(21);
    for (name, classical) in all_chains() {
        let given = Chain::from_classical(&classical, Parameterization::Classical);
        for parameterization in Parameterization::all() {
            let chain = Chain::from_classical(&classical, parameterization);
            if chain.margins().iter().any(|(_, margin)| *margin < 0.05) {
                continue;
            }
            let motion = transport(&given, &chain);
            let angles = random.angles(chain.joint_count());
            let error =
                (&chain.linearize(&angles).by_parameters * &motion - given.linearize(&angles).by_parameters).amax();
            assert!(error < 1e-11, "{name} as {parameterization}: {error}");
        }
    }
}

#[test]
fn the_prior_covers_the_error_bounds_of_the_rig() {
    let mut random = Random::new(22);
    let (_, mut classical) = special_chains().remove(0);
    classical.links.iter_mut().for_each(|link| {
        link.d_m += random.within(0.05);
        link.a_m += random.within(0.05);
        link.alpha_rad += random.within(0.05);
    });
    let given = Chain::from_classical(&classical, Parameterization::Classical);
    let sigma = DVector::from_iterator(
        24,
        given.parameters().iter().map(|parameter| match parameter.dimension() {
            Dimension::Angle => ROTATION_SIGMA_RAD,
            _ => TRANSLATION_SIGMA_M,
        }),
    );
    for parameterization in [Parameterization::Classical, Parameterization::Minimal, Parameterization::Poe] {
        let chain = Chain::from_classical(&classical, parameterization);
        let covariance = chain.prior_covariance(&classical, TRANSLATION_SIGMA_M, ROTATION_SIGMA_RAD);
        let draws = 4000;
        let mut sampled = DMatrix::zeros(chain.dof(), chain.dof());
        for _ in 0..draws {
            // Uniform within ±√3 σ has the standard deviation σ.
            let wrong = given.plus(&sigma.map(|sigma| random.within(sigma * 3.0_f64.sqrt())));
            let error = wrong.minus(&chain);
            sampled += &error * error.transpose() / f64::from(draws);
        }
        for column in 0..chain.dof() {
            let (expected, found) = (covariance[(column, column)].sqrt(), sampled[(column, column)].sqrt());
            assert!(
                (found / expected - 1.0).abs() < 0.06,
                "{parameterization} column {column}: {found} for {expected}"
            );
        }
        let spread = covariance.clone().cholesky().expect("positive definite").l();
        let whitened = spread.solve_lower_triangular(&sampled).unwrap();
        let whitened = spread.solve_lower_triangular(&whitened.transpose()).unwrap();
        assert!((whitened - DMatrix::identity(chain.dof(), chain.dof())).amax() < 0.15, "{parameterization}");
    }
}

#[test]
fn every_prior_is_invertible_even_at_a_singularity() {
    for (name, classical) in all_chains() {
        for parameterization in Parameterization::all() {
            let chain = Chain::from_classical(&classical, parameterization);
            for chain in [chain.clone(), chain.without_joint_offsets()] {
                let covariance = chain.prior_covariance(&classical, TRANSLATION_SIGMA_M, ROTATION_SIGMA_RAD);
                assert_eq!(covariance.shape(), (chain.dof(), chain.dof()));
                assert!(covariance.iter().all(|entry| entry.is_finite()));
                let near_singular = chain.margins().iter().any(|(_, margin)| *margin > 1e-9 && *margin < 0.03);
                assert!(near_singular || covariance.cholesky().is_some(), "{name} as {parameterization}");
            }
        }
    }
}

#[test]
fn a_switch_of_parameterization_keeps_the_prior() {
    let mut random = Random::new(23);
    for joints in 1..=4 {
        let classical = random.chain(joints);
        for offsets in [true, false] {
            let make = |form| {
                let chain = Chain::from_classical(&classical, form);
                if offsets { chain } else { chain.without_joint_offsets() }
            };
            let (from, to) = (make(Parameterization::Minimal), make(Parameterization::MinimalSwappedYx));
            let before = from.prior_covariance(&classical, TRANSLATION_SIGMA_M, ROTATION_SIGMA_RAD);
            let direct = to.prior_covariance(&classical, TRANSLATION_SIGMA_M, ROTATION_SIGMA_RAD);
            let switched = transport_covariance(&from, &before, &to);
            let scale = direct.amax();
            assert!((&switched - &direct).amax() < 1e-9 * scale, "{joints} joints, offsets {offsets}");
            let back = transport_covariance(&to, &switched, &from);
            assert!((back - &before).amax() < 1e-9 * before.amax());
        }
    }
}
