//! Covariances of poses: against the window's rows, and against the errors of many flights.

use rayon::prelude::*;

use super::memory::{estimated, recorded_with};
use crate::estimator::{ColumnGroup, Linearization};
use crate::session::record::PoseError;
use crate::simulation::{SyntheticOptions, synthetic_tracks};

/// Standard deviations of the newest pose from the rows of a step, by a dense inverse.
fn sigmas_of_rows(linearization: &Linearization) -> Vec<f64> {
    let (measured, prior) = (&linearization.jacobian, &linearization.prior_jacobian);
    let covariance = (measured.tr_mul(measured) + prior.tr_mul(prior)).try_inverse().unwrap();
    let mut poses = linearization.columns.iter().filter(|block| block.id.group() == ColumnGroup::Pose);
    let newest = poses.next_back().unwrap().start;
    (newest..newest + 6).map(|column| covariance[(column, column)].sqrt()).collect()
}

#[test]
fn covariances_are_those_of_the_rows_of_the_window() {
    let flight = synthetic_tracks(&SyntheticOptions { duration_s: 6.0, ..SyntheticOptions::default() });
    for spec in ["auto", "auto:encoder=off"] {
        let run = recorded_with(&flight, spec, Some(20));
        let kept = run.steps.iter().filter_map(|step| Some((step, step.report.linearization.as_ref()?)));
        let mut compared = 0;
        for (step, linearization) in kept {
            let covariance = step.report.newest_pose_covariance.unwrap().0;
            for (place, expected) in sigmas_of_rows(linearization).into_iter().enumerate() {
                // The covariance belongs to the linearization before the last iteration.
                let ratio = covariance[(place, place)].sqrt() / expected;
                assert!((ratio - 1.0).abs() < 0.02, "{spec} {} component {place}: {ratio}", step.report.stamp_ns);
            }
            compared += 1;
        }
        assert!(compared >= 2, "{compared} steps");
    }
}

#[test]
fn errors_agree_with_covariances_that_grow_from_the_first_frame_on() {
    let nees_of = |seed| {
        let flight = synthetic_tracks(&SyntheticOptions { seed, duration_s: 10.0, ..SyntheticOptions::default() });
        let errors = estimated(&flight, "auto").pose_errors();
        let [first, last] = [errors.first(), errors.last()].map(|error| error.unwrap().covariance);
        assert!(first.position_sigma_m() < 0.03, "{} m", first.position_sigma_m());
        assert!(last.position_sigma_m() > first.position_sigma_m());
        PoseError::mean_nees(&errors).unwrap()
    };
    let nees: Vec<f64> = (1_u64..=6).into_par_iter().map(nees_of).collect();
    // Errors of one flight are correlated in time: the six flights count as about six samples of six components.
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    assert!((3.0..10.0).contains(&mean), "NEES {mean}: {nees:?}");
}
