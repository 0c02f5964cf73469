//! `dcvins evaluate`: absolute and relative trajectory errors of one trajectory file against another.

use std::fmt;
use std::path::Path;

use serde::Serialize;

use super::error::ExportError;
use super::trajectory::read_trajectory;
use crate::session::accuracy::{
    ErrorStatistics, RelativeDelta, TrajectoryAlignment, absolute_errors_m, align, associate, path_length_m,
    relative_errors,
};
use crate::table::text::{TextTable, left, right};

/// Options of a comparison of two trajectories; the defaults are the settings of `evo_ape tum --align` and `evo_rpe tum
/// --align`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvaluationOptions {
    /// Alignment of the estimate with the reference.
    pub alignment: TrajectoryAlignment,
    /// Length of the sub-trajectories of the relative error.
    pub delta: RelativeDelta,
    /// Maximum difference of the stamps of associated poses, in seconds.
    pub max_difference_s: f64,
}

impl Default for EvaluationOptions {
    fn default() -> Self {
        Self { alignment: TrajectoryAlignment::Rigid, delta: RelativeDelta::Frames(1), max_difference_s: 0.01 }
    }
}

/// Result of a comparison of two trajectories.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EvaluationReport {
    /// Alignment of the estimate with the reference.
    pub alignment: TrajectoryAlignment,
    /// Number of associated poses.
    pub pairs: usize,
    pub estimate_poses: usize,
    pub reference_poses: usize,
    /// Path length of the reference over the associated poses, in metres.
    pub reference_length_m: f64,
    /// Scale factor of the alignment.
    pub scale: f64,
    /// Absolute position error in metres.
    pub ate_m: ErrorStatistics,
    /// Translation part of the relative error in metres.
    pub rpe_translation_m: ErrorStatistics,
    /// Rotation part of the relative error in degrees.
    pub rpe_rotation_deg: ErrorStatistics,
    /// Number of sub-trajectories of the relative error.
    pub rpe_pairs: usize,
}

/// Compares two trajectory files.
pub fn evaluate(
    estimate: &Path,
    reference: &Path,
    options: &EvaluationOptions,
) -> Result<EvaluationReport, ExportError> {
    let estimate_poses = read_trajectory(estimate)?;
    let reference_poses = read_trajectory(reference)?;
    let pairs = associate(&estimate_poses, &reference_poses, options.max_difference_s);
    let not_comparable = |problem: String| ExportError::NotComparable { problem };
    if pairs.is_empty() {
        return Err(not_comparable(format!(
            "no stamps within {} s of each other: the estimate covers {:.3} to {:.3} s, the reference {:.3} to {:.3} s; \
             give a larger --max-difference or check the clocks",
            options.max_difference_s,
            estimate_poses[0].stamp_s,
            estimate_poses[estimate_poses.len() - 1].stamp_s,
            reference_poses[0].stamp_s,
            reference_poses[reference_poses.len() - 1].stamp_s,
        )));
    }
    let transform = align(&pairs, options.alignment).ok_or_else(|| {
        not_comparable(format!(
            "{} associated poses do not determine the alignment '{}'; try --align none",
            pairs.len(),
            options.alignment.name()
        ))
    })?;
    let (translations, rotations) = relative_errors(&pairs, &transform, options.delta);
    let rotations_deg: Vec<f64> = rotations.iter().map(|angle| angle.to_degrees()).collect();
    let too_short = || not_comparable("the trajectory is shorter than one --delta: give a smaller --delta".to_owned());
    let ate = ErrorStatistics::of(&absolute_errors_m(&pairs, &transform)).ok_or_else(too_short)?;
    let rpe_translation = ErrorStatistics::of(&translations).ok_or_else(too_short)?;
    let rpe_rotation = ErrorStatistics::of(&rotations_deg).ok_or_else(too_short)?;
    Ok(EvaluationReport {
        alignment: options.alignment,
        pairs: pairs.len(),
        estimate_poses: estimate_poses.len(),
        reference_poses: reference_poses.len(),
        reference_length_m: path_length_m(pairs.iter().map(|(_, reference)| &reference.pose.translation_m)),
        scale: transform.scale,
        ate_m: ate,
        rpe_translation_m: rpe_translation,
        rpe_rotation_deg: rpe_rotation,
        rpe_pairs: translations.len(),
    })
}

impl fmt::Display for EvaluationReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            formatter,
            "{} associated poses of {} estimated and {} reference poses, path length {:.2} m, alignment {}{}",
            self.pairs,
            self.estimate_poses,
            self.reference_poses,
            self.reference_length_m,
            self.alignment.name(),
            if self.alignment == TrajectoryAlignment::Similarity {
                format!(", scale {:.6}", self.scale)
            } else {
                String::new()
            }
        )?;
        let columns = ["rmse", "mean", "median", "std", "min", "max"].map(|heading| right(heading, 12));
        let rows = [
            ("ATE (m)", &self.ate_m),
            ("RPE translation (m)", &self.rpe_translation_m),
            ("RPE rotation (°)", &self.rpe_rotation_deg),
        ];
        let rows = rows.map(|(name, row)| {
            let ErrorStatistics { count: _, rmse, mean, median, std, min, max } = row;
            let numbers = [rmse, mean, median, std, min, max].map(|value| format!("{value:.6}"));
            [name.to_owned()].into_iter().chain(numbers)
        });
        write!(formatter, "{}", TextTable::new([left("", 24)].into_iter().chain(columns), rows).not_indented())
    }
}
