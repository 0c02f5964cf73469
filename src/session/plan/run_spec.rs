use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use crate::sensors::Rig;

/// Which parameterization a run estimates in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterizationChoice {
    /// The minimal parameterization, switched away from singularities of the mechanism.
    Auto,
    /// Eqs. 18–20 as printed (corrected).
    Minimal,
    /// The minimal parameterization with the end block swapped, away from the singularity of the printed one.
    MinimalSwapped,
    /// Eqs. 5–6, 12 + 4N columns.
    Classical,
    /// The product of exponentials, without singularities.
    Poe,
    /// The rigid camera of the rig alone.
    Static,
    /// The gimbal camera as in `auto` and the rigid camera of the rig, in one window.
    Cluster,
}

/// Names on the command line, in the order in which they are offered.
const NAMES: [(&str, ParameterizationChoice); 7] = [
    ("auto", ParameterizationChoice::Auto),
    ("minimal", ParameterizationChoice::Minimal),
    ("minimal-swapped", ParameterizationChoice::MinimalSwapped),
    ("classical", ParameterizationChoice::Classical),
    ("poe", ParameterizationChoice::Poe),
    ("static", ParameterizationChoice::Static),
    ("cluster", ParameterizationChoice::Cluster),
];

/// Smallest and largest window that makes sense: two keyframes give no parallax to spare, and beyond thirty the dense
/// solve leaves real time far behind.
const WINDOW_RANGE: std::ops::RangeInclusive<usize> = 4..=30;

/// Keyframes in the window unless the specification says otherwise, as in the paper.
const DEFAULT_WINDOW: usize = 10;

impl ParameterizationChoice {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(_, choice)| *choice == self).map_or("auto", |(name, _)| name)
    }

    /// Whether its runs switch to the other parameterization near a singularity; a rig may ask for it in any minimal run.
    pub fn switches_parameterization(self, rig: &Rig) -> bool {
        match self {
            Self::Auto | Self::Cluster => true,
            Self::Minimal | Self::MinimalSwapped => {
                rig.gimbal.as_ref().is_some_and(|gimbal| gimbal.switches_parameterization)
            }
            Self::Classical | Self::Poe | Self::Static => false,
        }
    }

    /// Every choice with its name, in the order in which they are offered.
    pub fn all() -> impl Iterator<Item = (&'static str, Self)> {
        NAMES.into_iter()
    }
}

/// One `--run NAME[:key=value,…]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunSpec {
    /// Its name on screen and as a folder: `name=…`, or the specification as written.
    pub label: String,
    /// The parameterization.
    pub parameterization: ParameterizationChoice,
    /// Whether encoder readings are used (`encoder=off` clears it).
    pub encoder: bool,
    /// Whether the static calibration is estimated (`calibrate=off` clears it).
    pub calibrate: bool,
    /// Whether the time offsets of cameras and encoders are estimated (`timeshift=on` sets it).
    pub timeshift: bool,
    /// Whether Jacobians are evaluated at first estimates, FEJ (`first-estimates=off` clears it): without, the prior gains
    /// spurious information.
    pub first_estimates: bool,
    /// Number of keyframes in the window (`window=10`).
    pub window: usize,
    /// Main camera (`camera=cam1`); `None` is the gimballed one, or the first rigid one for `static` and for rigs without a
    /// gimbal. A `cluster` uses the first rigid one beside it.
    pub camera_key: Option<String>,
}

impl Default for RunSpec {
    fn default() -> Self {
        Self {
            label: "auto".to_owned(),
            parameterization: ParameterizationChoice::Auto,
            encoder: true,
            calibrate: true,
            timeshift: false,
            first_estimates: true,
            window: DEFAULT_WINDOW,
            camera_key: None,
        }
    }
}

/// Why a run specification was refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum RunSpecError {
    /// No such parameterization.
    #[error("unknown run '{name}': expected one of auto, minimal, minimal-swapped, classical, poe, static, cluster")]
    UnknownName {
        /// What was written.
        name: String,
    },
    /// A key that no run has, or a value that the key cannot take.
    #[error("run '{spec}': {problem}")]
    BadOption {
        /// The whole specification.
        spec: String,
        /// What is wrong with it, and what was expected.
        problem: String,
    },
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
                .ok_or_else(|| bad(format!("'{option}' has no value; write key=value, as in encoder=off")))?;
            match key {
                "encoder" => run.encoder = on_or_off(value).map_err(|problem| bad(format!("encoder: {problem}")))?,
                "calibrate" => {
                    run.calibrate = on_or_off(value).map_err(|problem| bad(format!("calibrate: {problem}")))?;
                }
                "timeshift" => {
                    run.timeshift = on_or_off(value).map_err(|problem| bad(format!("timeshift: {problem}")))?;
                }
                "first-estimates" => {
                    run.first_estimates =
                        on_or_off(value).map_err(|problem| bad(format!("first-estimates: {problem}")))?;
                }
                "window" => {
                    run.window =
                        value.parse().ok().filter(|window| WINDOW_RANGE.contains(window)).ok_or_else(|| {
                            let (low, high) = (WINDOW_RANGE.start(), WINDOW_RANGE.end());
                            bad(format!("window is '{value}', expected a number from {low} to {high}"))
                        })?;
                }
                "camera" => run.camera_key = Some(value.to_owned()),
                "name" if folder_name(value) == value && !value.is_empty() => run.label = value.to_owned(),
                "name" => {
                    return Err(bad(format!("name is '{value}', expected letters, digits, '-', '_' and '.' only")));
                }
                _ => {
                    let known = "encoder, calibrate, timeshift, first-estimates, window, camera, name";
                    return Err(bad(format!("unknown key '{key}', expected one of {known}")));
                }
            }
        }
        if run.timeshift && !run.calibrate {
            return Err(bad("timeshift=on estimates part of the calibration; leave calibrate=off out".to_owned()));
        }
        Ok(run)
    }
}

impl fmt::Display for RunSpec {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let standard = Self::default();
        let mut options = Vec::new();
        if !self.encoder {
            options.push("encoder=off".to_owned());
        }
        if !self.calibrate {
            options.push("calibrate=off".to_owned());
        }
        if self.timeshift {
            options.push("timeshift=on".to_owned());
        }
        if !self.first_estimates {
            options.push("first-estimates=off".to_owned());
        }
        if self.window != standard.window {
            options.push(format!("window={}", self.window));
        }
        options.extend(self.camera_key.iter().map(|key| format!("camera={key}")));
        let name = self.parameterization.name();
        let written = if options.is_empty() { name.to_owned() } else { format!("{name}:{}", options.join(",")) };
        if self.label != folder_name(&written) {
            options.push(format!("name={}", self.label));
        }
        if options.is_empty() { formatter.write_str(name) } else { write!(formatter, "{name}:{}", options.join(",")) }
    }
}

/// The text with everything that a folder's name should not hold replaced by `-`; never empty, `.` or `..`.
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

/// Makes the labels of several runs differ, by a number after the later ones.
pub(in crate::session) fn distinct_labels(specs: &mut [RunSpec]) {
    for index in 1..specs.len() {
        let wanted = specs[index].label.clone();
        let mut number = 2;
        while specs[..index].iter().any(|earlier| earlier.label == specs[index].label) {
            specs[index].label = format!("{wanted}-{number}");
            number += 1;
        }
    }
}
