use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use super::tuning::{EstimatorTuning, read_count};
use crate::estimator::SensorColumns;
use crate::sensors::Rig;

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
    /// The gimbal camera as in `auto` and the rig's rigid camera, in one window.
    Cluster,
}

/// Names on the command line, in the order of the help text.
const NAMES: [(&str, ParameterizationChoice); 7] = [
    ("auto", ParameterizationChoice::Auto),
    ("minimal", ParameterizationChoice::Minimal),
    ("minimal-swapped", ParameterizationChoice::MinimalSwapped),
    ("classical", ParameterizationChoice::Classical),
    ("poe", ParameterizationChoice::Poe),
    ("static", ParameterizationChoice::Static),
    ("cluster", ParameterizationChoice::Cluster),
];

/// Range of the window size: two keyframes give too little parallax, and with more than thirty the dense solve takes
/// much longer than real time.
const WINDOW_RANGE: std::ops::RangeInclusive<usize> = 4..=30;

/// Default number of keyframes in the window, as in the paper.
const DEFAULT_WINDOW: usize = 10;

impl ParameterizationChoice {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(_, choice)| *choice == self).map_or("auto", |(name, _)| name)
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

    /// All parameterizations with their names, in the order of the help text.
    pub fn all() -> impl Iterator<Item = (&'static str, Self)> {
        NAMES.into_iter()
    }
}

/// One `--run NAME[:key=value,…]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunSpec {
    /// Name in the window and of the result folder: `name=…`, or the specification as written.
    pub label: String,
    /// The parameterization in which the calibration is estimated.
    pub parameterization: ParameterizationChoice,
    /// True if encoder readings are used (`encoder=off` clears it).
    pub encoder: bool,
    /// True if the calibration is estimated (`calibrate=off` clears it).
    pub calibrate: bool,
    /// True if the time offsets of cameras and encoders are estimated (`timeshift=on` sets it).
    pub timeshift: bool,
    /// True if the readout times of rolling shutters are estimated (`readout=on` sets it).
    pub readout: bool,
    /// True if the intrinsics of the cameras are estimated (`intrinsics=on` sets it).
    pub intrinsics: bool,
    /// True if the intrinsics of the IMU are estimated (`imu-intrinsics=on` sets it).
    pub imu_intrinsics: bool,
    /// True if Jacobians are evaluated at first estimates, FEJ (`first-estimates=off` clears it). Without FEJ the prior
    /// gains spurious information.
    pub first_estimates: bool,
    /// Number of keyframes in the window (`window=10`).
    pub window: usize,
    /// Number of passes over the log (`passes=2`): each starts from the calibration and biases estimated by the
    /// previous one.
    /// The last one is recorded.
    pub passes: usize,
    /// Key of the main camera (`camera=cam1`). `None` means the gimballed camera, or the first rigid one for `static`
    /// and for rigs without a gimbal. A `cluster` also uses the first rigid camera.
    pub camera_key: Option<String>,
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
            first_estimates: true,
            window: DEFAULT_WINDOW,
            passes: 1,
            camera_key: None,
            tuning: EstimatorTuning::default(),
        }
    }
}

/// The reason why a run specification was rejected.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum RunSpecError {
    /// Unknown parameterization.
    #[error("unknown run '{name}': expected one of auto, minimal, minimal-swapped, classical, poe, static, cluster")]
    UnknownName { name: String },
    /// Unknown key, or invalid value.
    #[error("run '{spec}': {problem}")]
    BadOption {
        /// The whole specification.
        spec: String,
        /// The problem, and the expected input.
        problem: String,
    },
}

impl RunSpec {
    /// Range of the number of passes: more than three passes change little.
    pub const PASSES: std::ops::RangeInclusive<usize> = 1..=3;

    /// True if these columns are estimated in addition to the chain's.
    pub fn estimates(&self, columns: SensorColumns) -> bool {
        match columns {
            SensorColumns::Timeshift => self.timeshift,
            SensorColumns::Readout => self.readout,
            SensorColumns::Intrinsics => self.intrinsics,
            SensorColumns::ImuIntrinsics => self.imu_intrinsics,
        }
    }

    /// Text of all settings that affect the results, without the name. Keys with default values are omitted and the
    /// others have a fixed order, so that equivalent specifications have the same text.
    pub fn settings(&self) -> String {
        let standard = Self::default();
        let mut options = Vec::new();
        if !self.encoder {
            options.push("encoder=off".to_owned());
        }
        if !self.calibrate {
            options.push("calibrate=off".to_owned());
        }
        let estimated = SensorColumns::ALL.into_iter().filter(|columns| self.estimates(*columns));
        options.extend(estimated.map(|columns| format!("{}=on", columns.key())));
        if !self.first_estimates {
            options.push("first-estimates=off".to_owned());
        }
        if self.window != standard.window {
            options.push(format!("window={}", self.window));
        }
        if self.passes != standard.passes {
            options.push(format!("passes={}", self.passes));
        }
        options.extend(self.tuning.options());
        options.extend(self.camera_key.iter().map(|key| format!("camera={key}")));
        let name = self.parameterization.name();
        if options.is_empty() { name.to_owned() } else { format!("{name}:{}", options.join(",")) }
    }

    /// Mutable reference to the flag of [`Self::estimates`].
    pub(super) fn estimates_mut(&mut self, columns: SensorColumns) -> &mut bool {
        match columns {
            SensorColumns::Timeshift => &mut self.timeshift,
            SensorColumns::Readout => &mut self.readout,
            SensorColumns::Intrinsics => &mut self.intrinsics,
            SensorColumns::ImuIntrinsics => &mut self.imu_intrinsics,
        }
    }
}

impl FromStr for RunSpec {
    type Err = RunSpecError;

    fn from_str(spec: &str) -> Result<Self, RunSpecError> {
        let (name, options) = spec.split_once(':').map_or((spec, ""), |(name, options)| (name, options));
        let parameterization = NAMES
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, choice)| *choice)
            .ok_or_else(|| RunSpecError::UnknownName { name: name.to_owned() })?;
        let bad = |problem: String| RunSpecError::BadOption { spec: spec.to_owned(), problem };
        let mut run = Self { label: folder_name(spec), parameterization, ..Self::default() };
        for option in options.split(',').filter(|option| !option.is_empty()) {
            let (key, value) = option
                .split_once('=')
                .ok_or_else(|| bad(format!("option '{option}' has no value; expected key=value, as in encoder=off")))?;
            if let Some(columns) = SensorColumns::ALL.into_iter().find(|columns| columns.key() == key) {
                *run.estimates_mut(columns) = on_or_off(value).map_err(|problem| bad(format!("{key}: {problem}")))?;
                continue;
            }
            match key {
                "encoder" => run.encoder = on_or_off(value).map_err(|problem| bad(format!("encoder: {problem}")))?,
                "calibrate" => {
                    run.calibrate = on_or_off(value).map_err(|problem| bad(format!("calibrate: {problem}")))?;
                }
                "first-estimates" => {
                    run.first_estimates =
                        on_or_off(value).map_err(|problem| bad(format!("first-estimates: {problem}")))?;
                }
                "window" => run.window = read_count(key, value, &WINDOW_RANGE).map_err(bad)?,
                "passes" => run.passes = read_count(key, value, &Self::PASSES).map_err(bad)?,
                tuned if EstimatorTuning::KEYS.contains(&tuned) => run.tuning.set(tuned, value).map_err(bad)?,
                "camera" => run.camera_key = Some(value.to_owned()),
                "name" if folder_name(value) == value && !value.is_empty() => run.label = value.to_owned(),
                "name" => {
                    return Err(bad(format!("name is '{value}', expected letters, digits, '-', '_' and '.' only")));
                }
                _ => {
                    let known = "encoder, calibrate, timeshift, readout, intrinsics, imu-intrinsics, first-estimates, window, passes, camera, name";
                    let tuning = EstimatorTuning::KEYS.join(", ");
                    return Err(bad(format!("unknown key '{key}', expected one of {known}, {tuning}")));
                }
            }
        }
        let estimated = SensorColumns::ALL.into_iter().find(|columns| run.estimates(*columns) && !run.calibrate);
        if let Some(columns) = estimated {
            return Err(bad(format!("{}=on requires calibrate=on", columns.key())));
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
fn folder_name(text: &str) -> String {
    let clean: String = text
        .chars()
        .map(|letter| if letter.is_ascii_alphanumeric() || "-_.".contains(letter) { letter } else { '-' })
        .collect();
    if clean.trim_matches('.').is_empty() { "run".to_owned() } else { clean }
}

fn on_or_off(value: &str) -> Result<bool, String> {
    match value {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err(format!("it is '{value}', expected on or off")),
    }
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
