use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use crate::estimator::{EstimatorConfig, SensorParameters, VisualLoss};
use crate::optimization::RobustLoss;
use crate::sensors::Rig;
use crate::text::{Named, items, read_item, written_items};

/// Maximum number of runs of a session.
pub const MAX_RUNS: usize = 4;

/// The parameterization in which a run estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterizationChoice {
    /// The minimal parameterization; switches to the other end block near a singularity.
    Auto,
    /// Eqs. 18–20 as printed (with the sign corrected).
    Minimal,
    /// The minimal parameterization with the swapped end block, whose singularity is elsewhere.
    MinimalSwapped,
    /// Denavit–Hartenberg parameters of Eqs. 5–6, 12 + 4N columns.
    Classical,
    /// The product of exponentials, without singularities.
    Poe,
    /// The extrinsics of the rig's rigid camera.
    Static,
    /// The gimbal camera as in `auto`, if there is one, and the rig's rigid cameras, in one window.
    Cluster,
}

impl Named for ParameterizationChoice {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Auto, "auto"),
        (Self::Minimal, "minimal"),
        (Self::MinimalSwapped, "minimal-swapped"),
        (Self::Classical, "classical"),
        (Self::Poe, "poe"),
        (Self::Static, "static"),
        (Self::Cluster, "cluster"),
    ];
}

impl ParameterizationChoice {
    pub const fn summary(self) -> &'static str {
        self.texts().0
    }

    /// Description for the documents, as Markdown.
    pub const fn meaning(self) -> &'static str {
        self.texts().1
    }

    const fn texts(self) -> (&'static str, &'static str) {
        match self {
            Self::Auto => (
                "minimal, switched away from singularities",
                "minimal, with the base and end blocks that have the larger singularity margin; switches with hysteresis",
            ),
            Self::Minimal => ("minimal, as in the paper", "Eqs. 18 to 20 of the paper, corrected"),
            Self::MinimalSwapped => (
                "minimal, end block swapped",
                "minimal with the blocks of the last link swapped, for mechanisms at the singularity of Eq. 19",
            ),
            Self::Classical => (
                "base, links, end effector; redundant directions",
                "Eqs. 5 and 6: 12 + 4N parameters, six of them redundant",
            ),
            Self::Poe => (
                "product of exponentials, without singularities",
                "product of exponentials, without singularities; the reference",
            ),
            Self::Static => ("static camera of the rig, rigid extrinsics", "the first rigid camera of the rig"),
            Self::Cluster => (
                "all cameras in one window",
                "the gimbal camera as in `auto` and the rigid cameras in one window, or several rigid cameras",
            ),
        }
    }

    /// True if runs switch to the other end block near a singularity. A rig may require that for every minimal run.
    pub fn switches_parameterization(self, rig: &Rig) -> bool {
        match self {
            Self::Auto | Self::Cluster => true,
            Self::Minimal | Self::MinimalSwapped => {
                rig.gimbal.as_ref().is_some_and(|gimbal| gimbal.switches_parameterization)
            }
            Self::Classical | Self::Poe | Self::Static => false,
        }
    }
}

/// One `--run NAME[:key=value,…]`.
///
/// Meaning and range of each option: its row of [`RunSpec::KEYS`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunSpec {
    /// Name in the window and of the folder: `name=…`, or the specification as written.
    pub label: String,
    /// Parameterization in which the calibration is estimated.
    pub parameterization: ParameterizationChoice,
    pub encoder: bool,
    pub calibrate: bool,
    pub timeshift: bool,
    pub readout: bool,
    pub intrinsics: bool,
    pub imu_intrinsics: bool,
    pub gimbal_imu: bool,
    pub gimbal_imu_axes: bool,
    pub first_estimates: bool,
    pub window: usize,
    pub passes: usize,
    /// Key of the main camera. `None` means the gimballed camera, or the first rigid one for `static` and for rigs without
    /// a gimbal, and for a `cluster` the first of [`Self::cluster_keys`] on the gimbal, else their first.
    pub camera_key: Option<String>,
    /// Keys of the cameras of a `cluster`; empty means all of the rig.
    pub cluster_keys: Vec<String>,
    pub tuning: EstimatorTuning,
}

impl Default for RunSpec {
    fn default() -> Self {
        Self {
            label: "auto".to_owned(),
            parameterization: ParameterizationChoice::Auto,
            encoder: true,
            calibrate: true,
            timeshift: false,
            readout: false,
            intrinsics: false,
            imu_intrinsics: false,
            gimbal_imu: true,
            gimbal_imu_axes: false,
            first_estimates: true,
            // As in the paper.
            window: 10,
            passes: 1,
            camera_key: None,
            cluster_keys: Vec::new(),
            tuning: EstimatorTuning::default(),
        }
    }
}

/// The reason why a run specification was rejected.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum RunSpecError {
    #[error("unknown run '{name}': expected one of {}", ParameterizationChoice::names())]
    UnknownName { name: String },
    /// Unknown key, or invalid value.
    #[error("run '{spec}': {problem}")]
    BadOption { spec: String, problem: String },
}

impl RunSpec {
    /// True if these columns are estimated in addition to the chain's.
    pub fn estimates(&self, columns: SensorParameters) -> bool {
        match columns {
            SensorParameters::Timeshift => self.timeshift,
            SensorParameters::Readout => self.readout,
            SensorParameters::Intrinsics => self.intrinsics,
            SensorParameters::ImuIntrinsics => self.imu_intrinsics,
            SensorParameters::GimbalImu => self.gimbal_imu_axes,
        }
    }

    /// True if the fixed calibration excludes a key: sensor columns require `calibrate=on`.
    pub fn excludes(&self, key: &str) -> bool {
        !self.calibrate && SensorParameters::ALL.into_iter().any(|columns| columns.key() == key)
    }

    /// Text of all settings that affect the results, without the name. Keys with default values are omitted and the
    /// others have a fixed order, so that equivalent specifications have the same text.
    pub fn settings(&self) -> String {
        let options = written_items(Self::KEYS, self, &Self::default());
        let name = self.parameterization.name();
        if options.is_empty() { name.to_owned() } else { format!("{name}:{}", options.join(",")) }
    }

    /// Mutable reference to the flag of [`Self::estimates`].
    pub(super) fn estimates_mut(&mut self, columns: SensorParameters) -> &mut bool {
        match columns {
            SensorParameters::Timeshift => &mut self.timeshift,
            SensorParameters::Readout => &mut self.readout,
            SensorParameters::Intrinsics => &mut self.intrinsics,
            SensorParameters::ImuIntrinsics => &mut self.imu_intrinsics,
            SensorParameters::GimbalImu => &mut self.gimbal_imu_axes,
        }
    }
}

impl FromStr for RunSpec {
    type Err = RunSpecError;

    fn from_str(spec: &str) -> Result<Self, RunSpecError> {
        let (name, options) = spec.split_once(':').map_or((spec, ""), |(name, options)| (name, options));
        let unknown = || RunSpecError::UnknownName { name: name.to_owned() };
        let parameterization = ParameterizationChoice::from_name(name).ok_or_else(unknown)?;
        let bad = |problem: String| RunSpecError::BadOption { spec: spec.to_owned(), problem };
        let mut run = Self { label: folder_name(spec), parameterization, ..Self::default() };
        items(options).try_for_each(|item| read_item(Self::KEYS, &mut run, item)).map_err(bad)?;
        let estimated = |columns: &SensorParameters| run.estimates(*columns) && run.excludes(columns.key());
        if let Some(columns) = SensorParameters::ALL.into_iter().find(estimated) {
            return Err(bad(format!("{}=on requires calibrate=on", columns.key())));
        }
        if parameterization != ParameterizationChoice::Cluster && !run.cluster_keys.is_empty() {
            return Err(bad("cameras=… requires a cluster; camera=KEY is the camera of any other run".to_owned()));
        }
        if run.camera_key.is_some() && !run.cluster_keys.is_empty() {
            return Err(bad("camera=KEY and cameras=… exclude each other".to_owned()));
        }
        Ok(run)
    }
}

/// Normalized text: [`RunSpec::settings`], and the name unless it is the default.
impl fmt::Display for RunSpec {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let settings = self.settings();
        formatter.write_str(&settings)?;
        if self.label == folder_name(&settings) {
            return Ok(());
        }
        let separator = if settings.contains(':') { ',' } else { ':' };
        write!(formatter, "{separator}name={}", self.label)
    }
}

/// The text with every character that is unsafe in folder names replaced by `-`; never empty, `.` or `..`.
pub(super) fn folder_name(text: &str) -> String {
    let clean: String = text
        .chars()
        .map(|letter| if letter.is_ascii_alphanumeric() || "-_.".contains(letter) { letter } else { '-' })
        .collect();
    if clean.trim_matches('.').is_empty() { "run".to_owned() } else { clean }
}

/// Makes the labels of several runs unique by appending numbers.
pub(in crate::session) fn distinct_labels(specs: &mut [RunSpec]) {
    for index in 1..specs.len() {
        let (earlier, later) = specs.split_at_mut(index);
        later[0].label = distinct_label(&later[0].label, |label| earlier.iter().any(|spec| spec.label == label));
    }
}

/// The desired label, with a number appended if it is taken.
pub(in crate::session) fn distinct_label(wanted: &str, is_taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2..).map(|number| format!("{wanted}-{number}"));
    let mut candidates = std::iter::once(wanted.to_owned()).chain(numbered);
    candidates.find(|label| !is_taken(label)).unwrap_or_default()
}

/// Deviations from the estimator's standard options; meaning and range of each: its row of
/// [`self::RunSpec::KEYS`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorTuning {
    pub pixel_noise: f64,
    pub imu_noise: f64,
    pub encoder_noise: f64,
    /// `None` for the standard loss.
    pub loss: Option<RobustLoss>,
    /// `None` for the standard number.
    pub iterations: Option<usize>,
}

/// Factors are finite, so that equality is reflexive.
impl Eq for EstimatorTuning {}

impl Default for EstimatorTuning {
    fn default() -> Self {
        Self { pixel_noise: 1.0, imu_noise: 1.0, encoder_noise: 1.0, loss: None, iterations: None }
    }
}

impl EstimatorTuning {
    pub(in crate::session) fn apply(&self, config: &mut EstimatorConfig) {
        let options = &mut config.options;
        options.pixel_sigma_px *= self.pixel_noise;
        options.imu_noise_factor *= self.imu_noise;
        options.loss = self.loss.map_or(options.loss, VisualLoss::Fixed);
        options.iterations = self.iterations.unwrap_or(options.iterations);
        config.encoder_sigma_rad = config.encoder_sigma_rad.map(|sigma_rad| sigma_rad * self.encoder_noise);
    }
}
