//! Content of the image panel for one camera, collected from the report and the tracks of its last image.

use nalgebra::Vector2;

use crate::estimator::{ObservationReport, Phase, StepReport};
use crate::frontend::{FeatureId, FrontEndStatistics, TrackedFeature};
use crate::geometry::seconds_from_ns;
use crate::sensors::Rig;
use crate::session::{RunRecord, StepTracks};

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
    /// [`FeatureId::camera`] is the index of the camera that tracks it.
    pub(super) id: FeatureId,
    /// True for a feature of the other camera of a stereo pair that is found in this image.
    pub(super) matched: bool,
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

impl FeatureMark {
    /// Mark of a feature of a camera, from the report of the step.
    fn of(
        report: &StepReport,
        (feature, camera): (&TrackedFeature, usize),
        trail_px: Vec<Vector2<f64>>,
        matched: bool,
    ) -> Self {
        let id = feature.id.of_camera(camera);
        let solved = report.features.iter().find(|solved| solved.id == id).map(|solved| {
            let observations = if matched { &solved.matched } else { &solved.observations };
            SolvedMark {
                observation: observations.iter().find(|seen| seen.frame_index == report.frame_index),
                track_weight: solved.track_weight(),
                slides: solved.slides(),
                depth_m: 1.0 / solved.inverse_depth_per_m,
                observation_count: solved.observations.len() + solved.matched.len(),
                rejected: solved.rejected,
            }
        });
        Self { id, matched, age: feature.age, measured_px: feature.uv_px, trail_px, solved }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImageModel {
    pub(super) camera_key: String,
    /// True if the run has one camera.
    pub(super) is_only_camera: bool,
    /// Index of the image in the camera's stream.
    pub(super) image_index: usize,
    /// Stamp of the image on its camera's clock.
    pub(super) image_stamp_ns: i64,
    /// Stamp of the step.
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
    /// Overlay of a camera's last image at or before the cursor; `None` before the first. `camera` is its index in the
    /// run.
    pub(super) fn at(rig: &Rig, run: &RunRecord, camera: usize, cursor_ns: i64) -> Option<Self> {
        let after = run.steps.partition_point(|step| step.report.stamp_ns <= cursor_ns);
        let number = (0..after).rev().find(|number| run.steps[*number].image(camera).is_some())?;
        let step = run.step(number)?;
        let (image_index, kept) = step.image(camera)?;
        let tracks = kept.frame();
        let report = &step.report;
        let earlier = run.steps[..number].iter().rev().filter_map(|step| Some(step.image(camera)?.1));
        let earlier: Vec<_> = earlier.take(TRAIL_FRAMES).map(StepTracks::frame).collect();
        let own = tracks.features.iter().map(|feature| {
            let trail = earlier.iter().take(feature.age as usize).map_while(|earlier| {
                let at = earlier.features.binary_search_by_key(&feature.id, |earlier| earlier.id).ok()?;
                earlier.features.get(at).map(|earlier| earlier.uv_px)
            });
            FeatureMark::of(report, (feature, camera), trail.collect(), false)
        });
        let keys = run.camera_keys(&report.calibration);
        let other = (0..keys.len()).filter(|other| *other != camera).find_map(|other| {
            let (_, of_other) = step.image(other)?;
            let partner = rig.stereo_partner(rig.camera(keys[other]).ok()?)?;
            let of_other = (partner.key == keys[camera]).then(|| of_other.frame())?;
            (!of_other.matched.is_empty()).then_some((other, of_other))
        });
        let of_other = other.iter().flat_map(|&(other, ref of_other)| {
            of_other.matched.iter().map(move |feature| FeatureMark::of(report, (feature, other), Vec::new(), true))
        });
        let of_camera = || report.features.iter().filter(|feature| feature.id.camera() == camera);
        Some(Self {
            camera_key: keys[camera].to_owned(),
            is_only_camera: keys.len() == 1,
            image_index,
            image_stamp_ns: if camera == 0 { report.stamp_ns } else { tracks.stamp_ns },
            stamp_ns: report.stamp_ns,
            phase: report.phase,
            keyframe: report.keyframe,
            statistics: tracks.statistics,
            rejected: of_camera().filter(|feature| feature.rejected).count(),
            sliding: of_camera().filter(|feature| feature.slides() && !feature.rejected).count(),
            rms_before_px: report.reprojection_rms_before_px,
            rms_after_px: report.reprojection_rms_after_px,
            median_after_px: report.reprojection_median_after_px,
            marks: own.chain(of_other).collect(),
        })
    }

    /// The parts of the caption, the most important first: `frame 120`, `6.000 s`, `reprojection RMS 0.40 px`,
    /// `tracked 98`, `keyframe`, `before the solve 0.93 px`, `median 0.12 px`, `new 12`, `lost 9`, `rejected 5`, `sliding 14`.
    fn caption_parts(&self) -> Vec<String> {
        let camera = if self.is_only_camera { "frame" } else { &self.camera_key };
        let mut parts =
            vec![format!("{camera} {}", self.image_index), format!("{:.3} s", seconds_from_ns(self.image_stamp_ns))];
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
    if mark.matched {
        lines.push("tracked by the other camera of the stereo pair".to_owned());
    }
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
