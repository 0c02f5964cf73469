//! Ground truth against a run whose residuals agree with their noise.

use nalgebra::Vector3;

use crate::geometry::seconds_from_ns;
use crate::session::accuracy::{AlignmentSums, TrajectoryAlignment};
use crate::session::record::{PoseError, RunRecord, TruthAgreement};

/// Mean NEES and ratio of the position error to the length of the path above which the ground truth disagrees; 6 is
/// consistent, and estimators are a few times too certain.
const LARGEST_NEES: f64 = 60.0;
const LARGEST_ERROR: f64 = 0.01;
/// Largest and smallest delay of the ground truth that is looked for, and the spacing, in milliseconds.
const DELAYS_MS: i32 = 400;
const SPACING_MS: i32 = 5;
/// Ratio of the position errors with and without a delay below which the delay is named.
const EXPLAINED: f64 = 0.6;
/// Smallest delay that is named, in milliseconds.
const LEAST_DELAY_MS: f64 = 8.0;
/// Fewest poses with ground truth.
const FEWEST: usize = 30;

/// Errors of a run against its ground truth; `None` without one.
pub(in crate::session) fn accuracy(run: &RunRecord) -> Option<TruthAgreement> {
    let ate_m = run.accuracy().ok()?.ate_rmse_m;
    Some(TruthAgreement { ate_m, nees: PoseError::mean_nees(&run.pose_errors()) })
}

/// Sentence about a ground truth that disagrees with the run, `None` if it agrees or there is none.
pub(in crate::session) fn disagreement(run: &RunRecord) -> Option<String> {
    let found = accuracy(run)?;
    let nees = found.nees?;
    if nees < LARGEST_NEES {
        return None;
    }
    let explanation = match delay(run) {
        Some((delay_ms, ate_m)) => {
            let side = if delay_ms > 0.0 { "late" } else { "early" };
            format!("it is {:.0} ms {side}: with that delay the ATE is {ate_m:.3} m", delay_ms.abs())
        }
        None if found.ate_m > LARGEST_ERROR * run.true_length_m()? => {
            "its frame, its stamps or the estimate may be wrong".to_owned()
        }
        None => return None,
    };
    Some(format!(
        "disagrees with the estimate (ATE {:.3} m, NEES {nees:.0}, 6 is consistent); {explanation}",
        found.ate_m
    ))
}

/// Delay of the ground truth in milliseconds at which the position error is least, with that error in metres; `None` if it
/// explains too little.
fn delay(run: &RunRecord) -> Option<(f64, f64)> {
    let poses: Vec<(i64, Vector3<f64>, Vector3<f64>)> = run
        .steps
        .iter()
        .filter_map(|step| {
            let newest = step.report.newest()?;
            Some((newest.stamp_ns, newest.world_from_imu.translation_m, step.ground_truth?.translation_m))
        })
        .collect();
    if poses.len() < FEWEST {
        return None;
    }
    let error_m = |delay_ms: f64| root_mean_square(&poses, (delay_ms * 1e6) as i64);
    let delays = (-DELAYS_MS / SPACING_MS..=DELAYS_MS / SPACING_MS).map(|number| f64::from(number * SPACING_MS));
    let (best_ms, best_m) =
        delays.filter_map(|ms| Some((ms, error_m(ms)?))).min_by(|one, other| one.1.total_cmp(&other.1))?;
    let explains = best_m < EXPLAINED * error_m(0.0)? && best_ms.abs() >= LEAST_DELAY_MS;
    explains.then_some((best_ms, best_m))
}

/// Root mean square of the position error in metres after alignment, with the ground truth at later stamps by the delay.
/// Only poses count that have ground truth for every delay.
fn root_mean_square(poses: &[(i64, Vector3<f64>, Vector3<f64>)], delay_ns: i64) -> Option<f64> {
    let margin_ns = i64::from(DELAYS_MS) * 1_000_000;
    let (first_ns, last_ns) = (poses.first()?.0 + margin_ns, poses.last()?.0 - margin_ns);
    let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = poses
        .iter()
        .filter(|(stamp_ns, ..)| (first_ns..=last_ns).contains(stamp_ns))
        .filter_map(|(stamp_ns, estimate, _)| Some((*estimate, truth_at(poses, stamp_ns + delay_ns)?)))
        .collect();
    let mut sums = AlignmentSums::default();
    for (estimate, truth) in &pairs {
        sums.add(estimate, truth);
    }
    let alignment = sums.solve(TrajectoryAlignment::YawPosition)?;
    let squares = pairs.iter().map(|(estimate, truth)| (alignment.rigid.transform(estimate) - truth).norm_squared());
    Some((squares.sum::<f64>() / pairs.len().max(1) as f64).sqrt())
}

/// Position of the ground truth, interpolated between steps.
fn truth_at(poses: &[(i64, Vector3<f64>, Vector3<f64>)], stamp_ns: i64) -> Option<Vector3<f64>> {
    let next = poses.partition_point(|(at_ns, ..)| *at_ns < stamp_ns);
    let (from, to) = (poses.get(next.checked_sub(1)?)?, poses.get(next)?);
    let ratio = seconds_from_ns(stamp_ns - from.0) / seconds_from_ns(to.0 - from.0);
    Some(from.2.lerp(&to.2, ratio))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_ground_truth_is_found_by_its_delay() {
        let position = |at_s: f64| Vector3::new((0.9 * at_s).sin() * 3.0, (1.7 * at_s).cos() * 2.0, 0.3 * at_s);
        let poses: Vec<(i64, Vector3<f64>, Vector3<f64>)> = (0..200)
            .map(|number| {
                let at_s = 0.05 * f64::from(number);
                ((at_s * 1e9) as i64, position(at_s), position(at_s - 0.1))
            })
            .collect();
        let at = |delay_ms: i64| root_mean_square(&poses, delay_ms * 1_000_000).unwrap();
        assert!(at(100) < 0.01 && at(0) > 0.1 && at(-100) > at(0), "{} {} {}", at(100), at(0), at(-100));
    }
}
