//! Content of the image panel for one step, collected from report and tracks.

use nalgebra::Vector2;

use crate::estimator::{ObservationReport, Phase};
use crate::frontend::{FeatureId, FrontEndStatistics};
use crate::geometry::seconds_from_ns;
use crate::session::RunRecord;

/// Separator between two parts of the caption.
const SEPARATOR: &str = " · ";

/// Length of a track trail in images.
const TRAIL_FRAMES: usize = 4;

/// State of the solve for which residuals are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SolveSide {
    Before,
    #[default]
    After,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct FeatureMark {
    pub(super) id: FeatureId,
    /// Number of earlier images with an observation of this feature.
    pub(super) age: u32,
    /// Measured position in pixels.
    pub(super) measured_px: Vector2<f64>,
    /// Measured positions in earlier images, newest first.
    pub(super) trail_px: Vec<Vector2<f64>>,
    /// Result of the solve; `None` for a feature that was not in the solve.
    pub(super) solved: Option<SolvedMark>,
}

/// Result of the solve for a feature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SolvedMark {
    /// Its observation in this image.
    pub(super) observation: Option<ObservationReport>,
    /// Weight of the track as a whole.
    pub(super) track_weight: f64,
    /// True if the observations do not fit one point of the scene.
    pub(super) slides: bool,
    pub(super) depth_m: f64,
    pub(super) observation_count: usize,
    pub(super) rejected: bool,
}

impl SolvedMark {
    /// Predicted minus measured position in this image; `None` in the image that anchors the feature.
    pub(super) fn residual_px(&self, side: SolveSide) -> Option<Vector2<f64>> {
        let observation = self.observation?;
        match side {
            SolveSide::Before => observation.residual_before_px,
            SolveSide::After => observation.residual_after_px,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImageModel {
    pub(super) frame_index: usize,
    /// [`StepReport::frame_name`](crate::estimator::StepReport::frame_name).
    pub(super) frame_name: String,
    pub(super) stamp_ns: i64,
    pub(super) phase: Phase,
    pub(super) keyframe: bool,
    pub(super) statistics: FrontEndStatistics,
    /// Number of features rejected in the solve.
    pub(super) rejected: usize,
    /// Number of features that have little weight because they slide.
    pub(super) sliding: usize,
    pub(super) rms_before_px: f64,
    pub(super) rms_after_px: f64,
    /// Median of the residuals after the solve; the RMS is dominated by a few large ones.
    pub(super) median_after_px: f64,
    /// Features in the order of their ids.
    pub(super) marks: Vec<FeatureMark>,
}

impl ImageModel {
    /// Overlay of the last step at or before the cursor; `None` before the first.
    pub(super) fn at(run: &RunRecord, cursor_ns: i64) -> Option<Self> {
        let after = run.steps.partition_point(|step| step.report.stamp_ns <= cursor_ns);
        let earlier = run.steps.get(..after)?;
        let (_, before) = earlier.split_last()?;
        let step = run.step(before.len())?;
        let report = &step.report;
        let marks = step
            .tracks
            .features
            .iter()
            .map(|feature| {
                let reach = TRAIL_FRAMES.min(feature.age as usize);
                let trail_px = before
                    .iter()
                    .rev()
                    .take(reach)
                    .map_while(|step| {
                        let features = &step.tracks.features;
                        let at = features.binary_search_by_key(&feature.id, |earlier| earlier.id).ok()?;
                        features.get(at).map(|earlier| earlier.uv_px)
                    })
                    .collect();
                let solved = report.features.iter().find(|solved| solved.id == feature.id).map(|solved| {
                    let mut observations = solved.observations.iter();
                    SolvedMark {
                        observation: observations.find(|seen| seen.frame_index == report.frame_index),
                        track_weight: solved.track_weight(),
                        slides: solved.slides(),
                        depth_m: 1.0 / solved.inverse_depth_per_m,
                        observation_count: solved.observations.len(),
                        rejected: solved.rejected,
                    }
                });
                FeatureMark { id: feature.id, age: feature.age, measured_px: feature.uv_px, trail_px, solved }
            })
            .collect();
        Some(Self {
            frame_index: report.frame_index,
            frame_name: report.frame_name(),
            stamp_ns: report.stamp_ns,
            phase: report.phase,
            keyframe: report.keyframe,
            statistics: step.tracks.statistics,
            rejected: report.features.iter().filter(|feature| feature.rejected).count(),
            sliding: report.features.iter().filter(|feature| feature.slides() && !feature.rejected).count(),
            rms_before_px: report.reprojection_rms_before_px,
            rms_after_px: report.reprojection_rms_after_px,
            median_after_px: report.reprojection_median_after_px,
            marks,
        })
    }

    /// The parts of the caption, the most important first: `frame 120`, `6.000 s`, `reprojection RMS 0.40 px`,
    /// `tracked 98`, `keyframe`, `before the solve 0.93 px`, `median 0.12 px`, `new 12`, `lost 9`, `rejected 5`, `sliding 14`.
    fn caption_parts(&self) -> Vec<String> {
        let mut parts = vec![format!("frame {}", self.frame_name), format!("{:.3} s", seconds_from_ns(self.stamp_ns))];
        let tracking = self.phase == Phase::Tracking;
        if tracking {
            parts.push(format!("reprojection RMS {:.2} px", self.rms_after_px));
        } else {
            parts.push(self.phase.name().to_owned());
        }
        let FrontEndStatistics { tracked, detected, lost, rejected, .. } = self.statistics;
        parts.push(format!("tracked {tracked}"));
        if self.keyframe {
            parts.push("keyframe".to_owned());
        }
        if tracking {
            parts.push(format!("before the solve {:.2} px", self.rms_before_px));
            parts.push(format!("median {:.2} px", self.median_after_px));
        }
        parts.extend([
            format!("new {detected}"),
            format!("lost {lost}"),
            format!("rejected {}", rejected + self.rejected),
        ]);
        if tracking {
            parts.push(format!("sliding {}", self.sliding));
        }
        parts
    }

    pub(super) fn caption(&self) -> String {
        self.caption_parts().join(SEPARATOR)
    }

    /// The caption with as many of the most important parts as `fits` accepts; at least the first.
    pub(super) fn fitting_caption(&self, fits: impl Fn(&str) -> bool) -> String {
        let parts = self.caption_parts();
        let captions = (1..=parts.len()).rev().map(|count| parts[..count].join(SEPARATOR));
        captions.into_iter().find(|caption| fits(caption)).unwrap_or_else(|| parts[0].clone())
    }
}

/// Tooltip of a feature: `17 · age 42 · …`, one value per line.
pub(super) fn description(mark: &FeatureMark) -> String {
    let mut lines = vec![
        format!("feature {}", mark.id.0),
        format!("track age: {} frames", mark.age),
        format!("observation (u, v): ({:.2}, {:.2}) px", mark.measured_px.x, mark.measured_px.y),
    ];
    let Some(solved) = &mark.solved else {
        lines.push("not used in the solve".to_owned());
        return lines.join("\n");
    };
    let residual = |vector: Option<Vector2<f64>>| {
        vector.map_or_else(|| "–".to_owned(), |v| format!("{:.2} px ({:+.2}, {:+.2})", v.norm(), v.x, v.y))
    };
    lines.push(format!("residual before the solve: {}", residual(solved.residual_px(SolveSide::Before))));
    lines.push(format!("residual after the solve: {}", residual(solved.residual_px(SolveSide::After))));
    let [chi2, weight] = solved.observation.map_or([f64::NAN; 2], |seen| [seen.chi2, seen.robust_weight]);
    lines.push(format!("χ² {chi2:.2}, robust weight {weight:.2}"));
    lines.push(format!("depth: {:.2} m, {} observations", solved.depth_m, solved.observation_count));
    lines.push(format!("weight of the track {:.2}", solved.track_weight));
    if solved.slides {
        lines.push("slides: its observations do not fit one point of the scene".to_owned());
    }
    if solved.rejected {
        lines.push("outlier, rejected".to_owned());
    }
    lines.join("\n")
}
