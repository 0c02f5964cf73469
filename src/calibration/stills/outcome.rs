//! Results of a calibration from stills as plain values.

use serde::Serialize;

use super::encoders::EncoderTest;
use super::fit::AngleModel;
use super::noise::StillsNoise;
use super::ranks::StillsRank;
use crate::geometry::Dimension;
use crate::sensors::StillsChain;

/// Mean and standard deviation (n − 1) over sets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PixelStatistics {
    pub sets: usize,
    pub mean_px: f64,
    pub std_px: f64,
}

impl PixelStatistics {
    /// Summary of some values; `None` if there are none.
    pub(super) fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        let mean_px = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean_px).powi(2)).sum();
        let std_px = (squares / (count - 1.0).max(1.0)).sqrt();
        (!values.is_empty()).then_some(Self { sets: values.len(), mean_px, std_px })
    }
}

/// Residuals of the refined pose of a camera on its own points: the smallest error that a chain can have.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraFloor {
    pub camera: String,
    /// Mean length of the residuals of each set.
    pub floor: PixelStatistics,
    /// Points that were left out because they fit no pose.
    pub points_left_out: usize,
}

/// Origin of the chain that an error belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScoredChain {
    /// Chain of the file before the calibration.
    Initial,
    /// Calibrated chain on the sets that calibrated it.
    Training,
    /// Chain calibrated without the stations on which it is evaluated.
    HoldOut,
    /// Chain that was given to be judged.
    Given,
}

impl ScoredChain {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Initial => "initial",
            Self::Training => "training",
            Self::HoldOut => "hold-out",
            Self::Given => "given",
        }
    }
}

/// Errors of a chain in one rigid camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StillsScore {
    pub chain: ScoredChain,
    pub camera: String,
    /// Angles as read, sets with right readings.
    pub as_read: Option<PixelStatistics>,
    /// Angles estimated from half of the points, evaluated on the other half, the same sets.
    pub estimated: Option<PixelStatistics>,
    /// Angles as read, all sets.
    pub as_read_all: Option<PixelStatistics>,
}

/// Error of one chain in one view of a set, `None` where the chain does not see the set or a point lies behind the camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewReport {
    pub camera: String,
    pub floor_px: f64,
    pub initial_px: Option<f64>,
    /// Calibrated or given chain.
    pub as_read_px: Option<f64>,
    pub estimated_px: Option<f64>,
    pub hold_out_as_read_px: Option<f64>,
    pub hold_out_estimated_px: Option<f64>,
}

/// One set with the corrections of its readings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetReport {
    pub id: u64,
    pub station: u64,
    /// True if the readings contradict the images.
    pub wrong: bool,
    pub readings_deg: Vec<f64>,
    /// Estimated angle minus reading.
    pub corrections_deg: Vec<f64>,
    /// Standard deviations of the estimated angles.
    pub sigmas_deg: Vec<f64>,
    pub views: Vec<ViewReport>,
}

/// One parameter in one parameterization.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StillsParameter {
    pub name: String,
    #[serde(rename = "unit")]
    pub dimension: Dimension,
    pub initial: f64,
    pub value: f64,
    /// Larger one of the two following.
    pub sigma: f64,
    pub sigma_formal: f64,
    /// From calibrations without one station each; `None` with fewer than three stations.
    pub sigma_jackknife: Option<f64>,
}

impl StillsParameter {
    /// Parameter with its initial and calibrated `values` and its formal standard deviation.
    pub(super) fn new(
        name: String,
        dimension: Dimension,
        [initial, value]: [f64; 2],
        sigma_formal: f64,
        sigma_jackknife: Option<f64>,
    ) -> Self {
        let sigma = sigma_jackknife.map_or(sigma_formal, |it| it.max(sigma_formal));
        Self { name, dimension, initial, value, sigma, sigma_formal, sigma_jackknife }
    }
}

/// Chain in one parameterization.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterTable {
    pub parameterization: &'static str,
    pub parameters: Vec<StillsParameter>,
}

/// Angle between the axes of two consecutive joints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisAngle {
    /// Names of the two joints.
    pub joints: [String; 2],
    pub initial_deg: f64,
    pub value_deg: f64,
    pub sigma_deg: f64,
}

/// Correlation matrix of the chain's parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StillsCorrelations {
    pub names: Vec<String>,
    /// Entries of the matrix by rows.
    pub values: Vec<Vec<f64>>,
}

impl StillsCorrelations {
    /// Pairs whose correlation exceeds `limit`, the largest first.
    pub fn pairs_above(&self, limit: f64) -> Vec<(&str, &str, f64)> {
        let pairs = (0..self.names.len()).flat_map(|row| (0..row).map(move |column| (row, column)));
        let mut pairs: Vec<(&str, &str, f64)> = pairs
            .map(|(row, column)| (self.names[column].as_str(), self.names[row].as_str(), self.values[row][column]))
            .filter(|(.., value)| value.abs() > limit)
            .collect();
        pairs.sort_by(|a, b| b.2.abs().total_cmp(&a.2.abs()));
        pairs
    }
}

/// Result of [`super::calibrate_stills`] or [`super::judge_stills`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StillsOutcome {
    pub configuration: String,
    pub joints: Vec<String>,
    /// Model of the readings in the fit; `None` if a given chain was judged.
    pub angles: Option<AngleModel>,
    pub stations: usize,
    pub floors: Vec<CameraFloor>,
    pub scores: Vec<StillsScore>,
    /// Noise of readings and map. For free angles the noise of the encoders is estimated by the encoder model on the
    /// same sets; for a given chain it is a robust estimate, and there is no noise of the map.
    pub noise: StillsNoise,
    pub axes: Vec<AxisAngle>,
    /// Parameterization in which the chain is reported first, minimal and far from its singularities.
    pub parameterization: &'static str,
    /// Chain in every parameterization, the reported one first.
    pub tables: Vec<ParameterTable>,
    /// Transforms between the rigid cameras.
    pub rigid: Vec<StillsParameter>,
    pub ranks: Vec<StillsRank>,
    pub correlations: StillsCorrelations,
    pub encoder_tests: Vec<EncoderTest>,
    pub sets: Vec<SetReport>,
    pub warnings: Vec<String>,
    /// Calibrated or given chain.
    #[serde(skip)]
    pub chain: StillsChain,
}

impl StillsOutcome {
    /// Score of a chain in the rigid camera of this index.
    pub fn score(&self, chain: ScoredChain, camera: &str) -> Option<&StillsScore> {
        self.scores.iter().find(|score| score.chain == chain && score.camera == camera)
    }

    /// Root mean square of the corrections of a joint over the sets with right readings, in degrees.
    pub fn rms_correction_deg(&self, joint: usize) -> f64 {
        let right: Vec<f64> = self.sets.iter().filter(|set| !set.wrong).map(|set| set.corrections_deg[joint]).collect();
        (right.iter().map(|it| it * it).sum::<f64>() / right.len().max(1) as f64).sqrt()
    }

    /// Largest correction of a set's joints with its joint.
    pub fn largest_correction_deg<'a>(&'a self, set: &SetReport) -> Option<(&'a str, f64)> {
        let corrections = self.joints.iter().map(String::as_str).zip(set.corrections_deg.iter().copied());
        corrections.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }
}
