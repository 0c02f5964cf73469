//! Forks: a run that leaves another one at a frame, with something changed.

use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use super::run_spec::{ParameterizationChoice, RunSpec};
use crate::estimator::InterventionError;
use crate::frontend::{FeatureId, TrackedFrame};
use crate::geometry::SplitMix64;
use crate::gimbal::Parameterization;
use crate::sensors::{JointAngles, Rig};
use crate::session::engine::RunEngine;

/// What a fork does otherwise than the run that it leaves.
///
/// Written as `classical,freeze=yaw.alpha+yaw.d,set=pitch.a:30mm,drop=12+15,joint-noise=0.5deg,imu-noise=2`.
#[derive(Clone, Debug, PartialEq)]
pub struct ForkChanges {
    /// Another parameterization of the same chain.
    pub parameterization: Option<ParameterizationChoice>,
    /// Parameters that are held at their values from there on.
    pub frozen: Vec<String>,
    /// Parameters that are set to other values, in radians or metres.
    pub values: Vec<(String, f64)>,
    /// Features that are not used any more.
    pub dropped: BTreeSet<u64>,
    /// Keys of cameras that are not looked through any more, of a run that watches two.
    pub without: BTreeSet<String>,
    /// Encoder readings are not used any more.
    pub encoder_off: bool,
    /// Standard deviation of noise that is added to every joint angle, in radians; the estimator is not told.
    pub joint_noise_rad: f64,
    /// The inertial noise densities are multiplied by this.
    pub imu_noise: f64,
    /// The standard deviation of a tracked pixel is multiplied by this.
    pub pixel_noise: f64,
    /// The standard deviations of the joint angles, as the estimator is told, are multiplied by this.
    pub encoder_noise: f64,
}

impl Default for ForkChanges {
    fn default() -> Self {
        Self {
            parameterization: None,
            frozen: Vec::new(),
            values: Vec::new(),
            dropped: BTreeSet::new(),
            without: BTreeSet::new(),
            encoder_off: false,
            joint_noise_rad: 0.0,
            imu_noise: 1.0,
            pixel_noise: 1.0,
            encoder_noise: 1.0,
        }
    }
}

/// Why a fork cannot be made.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum ForkError {
    /// Something that no fork can change, or a value that it cannot take.
    #[error("fork '{text}': {problem}")]
    BadChange {
        /// What was written.
        text: String,
        /// What is wrong with it, and what was expected.
        problem: String,
    },
    /// The run does not watch such a camera.
    #[error("the run watches no camera '{camera}', only {present}")]
    NoCamera {
        /// What was asked for.
        camera: String,
        /// The cameras that it watches.
        present: String,
    },
    /// Nothing would be left to see with.
    #[error("without {without} the run would see nothing: leave it one of its cameras")]
    Blind {
        /// What was to be left out.
        without: String,
    },
    /// The run has no such parameter.
    #[error(
        "this run cannot be forked so: there is no parameter '{name}' in this parameterization; there are {}",
        known.join(", ")
    )]
    UnknownParameter {
        /// What was asked for.
        name: String,
        /// The parameters that there are.
        known: Vec<String>,
    },
    /// The estimator refuses.
    #[error("this run cannot be forked so: {0}")]
    Estimator(#[from] InterventionError),
    /// There is no step at the cursor, or it cannot be taken again.
    #[error("there is no step of the run '{run}' here to fork from")]
    NoStep {
        /// The run.
        run: String,
    },
}

/// Why a fork cannot watch another camera.
const OTHER_CAMERA: &str = "the window of the run holds features that only its own cameras have seen, so that a fork can \
                            leave a camera of two out (without=cam1) but not take another one in";

/// Parameterizations that a fork may go over to: another camera would have other tracks.
pub const FORK_PARAMETERIZATIONS: [ParameterizationChoice; 5] = [
    ParameterizationChoice::Auto,
    ParameterizationChoice::Minimal,
    ParameterizationChoice::MinimalSwapped,
    ParameterizationChoice::Classical,
    ParameterizationChoice::Poe,
];

impl FromStr for ForkChanges {
    type Err = ForkError;

    fn from_str(text: &str) -> Result<Self, ForkError> {
        let mut changes = Self::default();
        let bad = |problem: String| ForkError::BadChange { text: text.to_owned(), problem };
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let Some((key, value)) = part.split_once('=') else {
                let choice = FORK_PARAMETERIZATIONS.into_iter().find(|choice| choice.name() == part);
                let known = FORK_PARAMETERIZATIONS.map(ParameterizationChoice::name).join(", ");
                let expected = || {
                    if ParameterizationChoice::all().any(|(name, _)| name == part) {
                        bad(format!("'{part}' watches other cameras: {OTHER_CAMERA}; run {part} beside it instead"))
                    } else {
                        bad(format!("'{part}' is no parameterization that a fork can have ({known})"))
                    }
                };
                changes.parameterization = Some(choice.ok_or_else(expected)?);
                continue;
            };
            let quantity = |text: &str| {
                number(text)
                    .ok_or_else(|| bad(format!("{key} is '{text}', expected a number, with deg or mm if you like")))
            };
            let factor = |text: &str| {
                let expected = || bad(format!("{key} is '{text}', expected a factor from 0.001 to 1000"));
                number(text).filter(|factor| (1e-3..=1e3).contains(factor)).ok_or_else(expected)
            };
            let several = || value.split('+').map(str::trim).filter(|name| !name.is_empty());
            match key.trim() {
                "freeze" => changes.frozen.extend(several().map(str::to_owned)),
                "set" => {
                    for one in several_values(value) {
                        let (name, value) = one
                            .split_once(':')
                            .ok_or_else(|| bad(format!("'{one}' has no value; write set=yaw.alpha:1deg")))?;
                        changes.values.push((name.trim().to_owned(), quantity(value)?));
                    }
                }
                "drop" => {
                    for id in several() {
                        let expected = || bad(format!("'{id}' is no number of a feature"));
                        changes.dropped.insert(id.parse().ok().ok_or_else(expected)?);
                    }
                }
                "without" => changes.without.extend(several().map(str::to_owned)),
                "camera" => return Err(bad(format!("{OTHER_CAMERA}; a run with camera={value} can be added instead"))),
                "encoder" => {
                    if value.trim() != "off" {
                        return Err(bad(format!(
                            "encoder is '{value}', a fork can only turn it off: a calibration that has begun without \
                             readings has no joint offsets, which they need; add a run with encoder=on instead"
                        )));
                    }
                    changes.encoder_off = true;
                }
                "joint-noise" => {
                    changes.joint_noise_rad = quantity(value)?;
                    if changes.joint_noise_rad < 0.0 {
                        return Err(bad(format!("joint-noise is '{value}', expected 0 or more")));
                    }
                }
                "imu-noise" => changes.imu_noise = factor(value)?,
                "pixel-noise" => changes.pixel_noise = factor(value)?,
                "encoder-noise" => changes.encoder_noise = factor(value)?,
                _ => {
                    let known =
                        "freeze, set, drop, without, encoder, joint-noise, imu-noise, pixel-noise, encoder-noise";
                    return Err(bad(format!("unknown key '{key}', expected one of {known}")));
                }
            }
        }
        Ok(changes)
    }
}

/// `yaw.a:1e+3+yaw.d:2` apart: a plus that follows an exponent belongs to its number.
fn several_values(text: &str) -> Vec<String> {
    let mut parts: Vec<String> = Vec::new();
    for piece in text.split('+') {
        match parts.last_mut() {
            Some(last) if last.ends_with(['e', 'E']) && last.contains(':') && !piece.contains(':') => {
                last.push('+');
                last.push_str(piece);
            }
            _ => parts.push(piece.trim().to_owned()),
        }
    }
    parts.retain(|part| !part.is_empty());
    parts
}

/// A number in radians or metres, with `deg`, `rad`, `mm` or `m` behind it.
fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let units = [("deg", std::f64::consts::PI / 180.0), ("mrad", 1e-3), ("rad", 1.0), ("mm", 1e-3), ("m", 1.0)];
    let unit = units.iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, *factor)));
    let (digits, factor) = unit.unwrap_or((text, 1.0));
    digits.trim().parse::<f64>().ok().map(|value| value * factor).filter(|value| value.is_finite())
}

impl fmt::Display for ForkChanges {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let standard = Self::default();
        let mut parts: Vec<String> = self.parameterization.iter().map(|choice| choice.name().to_owned()).collect();
        if !self.frozen.is_empty() {
            parts.push(format!("freeze={}", self.frozen.join("+")));
        }
        parts.extend(self.values.iter().map(|(name, value)| format!("set={name}:{value}")));
        if !self.dropped.is_empty() {
            let dropped: Vec<String> = self.dropped.iter().map(u64::to_string).collect();
            parts.push(format!("drop={}", dropped.join("+")));
        }
        if !self.without.is_empty() {
            parts.push(format!("without={}", self.without.iter().cloned().collect::<Vec<_>>().join("+")));
        }
        if self.encoder_off {
            parts.push("encoder=off".to_owned());
        }
        let figures = [
            ("joint-noise", self.joint_noise_rad, standard.joint_noise_rad),
            ("imu-noise", self.imu_noise, standard.imu_noise),
            ("pixel-noise", self.pixel_noise, standard.pixel_noise),
            ("encoder-noise", self.encoder_noise, standard.encoder_noise),
        ];
        parts.extend(
            figures.iter().filter(|(_, value, usual)| value != usual).map(|(key, value, _)| format!("{key}={value}")),
        );
        formatter.write_str(&parts.join(","))
    }
}

impl ForkChanges {
    /// The specification of the fork: the parent's with what can be said there.
    pub(in crate::session) fn spec(&self, parent: &RunSpec, time_s: f64) -> RunSpec {
        let parameterization = self.parameterization.unwrap_or(parent.parameterization);
        let name = self.parameterization.map_or(&*parent.label, |choice| choice.name());
        let encoder = parent.encoder && !self.encoder_off;
        RunSpec { label: format!("{name}-{time_s:.2}s"), parameterization, encoder, ..parent.clone() }
    }

    /// Changes the engine of the parent, as it is before the fork's first step; `camera_key` is its main camera's.
    pub(in crate::session) fn apply(
        &self,
        engine: &mut RunEngine,
        rig: &Rig,
        camera_key: &str,
    ) -> Result<(), ForkError> {
        let blind = self.blind(&engine.camera_keys(camera_key))?;
        let estimator = engine.estimator_mut();
        if let Some(choice) = self.parameterization {
            let (form, auto_chart) = match choice {
                ParameterizationChoice::Minimal => (Parameterization::Minimal, false),
                ParameterizationChoice::MinimalSwapped => (Parameterization::MinimalSwapped, false),
                ParameterizationChoice::Classical => (Parameterization::Classical, false),
                ParameterizationChoice::Poe => (Parameterization::Poe, false),
                _ => (crate::gimbal::auto_parameterization(&estimator.classical_chain()), true),
            };
            estimator.use_parameterization(form, auto_chart);
        }
        let names = rig.parameter_names();
        let known = estimator.parameters();
        let parameter = |name: &String| {
            let parameter = names.parse(name).filter(|parameter| known.contains(parameter));
            parameter.ok_or_else(|| ForkError::UnknownParameter {
                name: name.clone(),
                known: known.iter().map(|parameter| names.name(*parameter)).collect(),
            })
        };
        for (name, value) in &self.values {
            estimator.set_value(parameter(name)?, *value)?;
        }
        for name in &self.frozen {
            estimator.freeze(parameter(name)?)?;
        }
        estimator.scale_imu_noise(self.imu_noise);
        estimator.scale_pixel_noise(self.pixel_noise);
        let dropped = self.dropped.clone();
        for camera in 0..engine.cameras() {
            let all = blind.contains(&camera);
            engine.estimator_mut().forget_features(camera, |id| all || dropped.contains(&id.of_camera(camera).0));
        }
        engine.alter(Alterations {
            dropped: self.dropped.clone(),
            blind,
            encoder_off: self.encoder_off,
            joint_noise_rad: self.joint_noise_rad,
            encoder_noise: self.encoder_noise,
        });
        Ok(())
    }

    /// Numbers of the cameras that are left out, of those with the given keys.
    fn blind(&self, keys: &[String]) -> Result<BTreeSet<usize>, ForkError> {
        let number = |key: &String| keys.iter().position(|known| known == key);
        let missing = |key: &String| ForkError::NoCamera { camera: key.clone(), present: keys.join(", ") };
        let blind: BTreeSet<usize> =
            self.without.iter().map(|key| number(key).ok_or_else(|| missing(key))).collect::<Result<_, _>>()?;
        if blind.len() == keys.len() {
            return Err(ForkError::Blind { without: keys.join(", ") });
        }
        Ok(blind)
    }
}

/// What a run makes of its measurements before it uses them.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::session) struct Alterations {
    dropped: BTreeSet<u64>,
    /// Numbers of cameras whose tracks are not used.
    blind: BTreeSet<usize>,
    encoder_off: bool,
    joint_noise_rad: f64,
    encoder_noise: f64,
}

impl Default for Alterations {
    fn default() -> Self {
        Self {
            dropped: BTreeSet::new(),
            blind: BTreeSet::new(),
            encoder_off: false,
            joint_noise_rad: 0.0,
            encoder_noise: 1.0,
        }
    }
}

impl Alterations {
    /// Adds others, as a fork of a fork has them.
    pub(in crate::session) fn add(&mut self, other: Self) {
        self.dropped.extend(other.dropped);
        self.blind.extend(other.blind);
        self.encoder_off |= other.encoder_off;
        self.joint_noise_rad = self.joint_noise_rad.hypot(other.joint_noise_rad);
        self.encoder_noise *= other.encoder_noise;
    }

    /// Whether encoder readings are left out.
    pub(in crate::session) fn encoder_off(&self) -> bool {
        self.encoder_off
    }

    /// The tracks of a camera without what is dropped, `None` where nothing is.
    pub(in crate::session) fn tracks(&self, camera: usize, tracks: &TrackedFrame) -> Option<TrackedFrame> {
        let blind = self.blind.contains(&camera);
        let gone = |id: FeatureId| blind || self.dropped.contains(&id.of_camera(camera).0);
        tracks.features.iter().any(|feature| gone(feature.id)).then(|| {
            let mut kept = tracks.clone();
            kept.features.retain(|feature| !gone(feature.id));
            kept
        })
    }

    /// Joint angles with noise, which depends on nothing but the instant and the joint.
    pub(in crate::session) fn joint_angles(&self, angles: &JointAngles, stamp_ns: i64) -> Option<JointAngles> {
        if self.joint_noise_rad == 0.0 && self.encoder_noise == 1.0 {
            return None;
        }
        let mut altered = angles.clone();
        let mut random = SplitMix64::new(stamp_ns.unsigned_abs());
        for angle in &mut altered.angles_rad {
            // Irwin and Hall's: the sum of twelve uniform numbers has variance one.
            let normal = (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
            *angle += self.joint_noise_rad * normal;
        }
        let sigmas = altered.sigmas_rad.iter_mut().chain(&mut altered.lasting_sigmas_rad);
        sigmas.for_each(|sigma| *sigma *= self.encoder_noise);
        Some(altered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes(text: &str) -> ForkChanges {
        text.parse().unwrap()
    }

    #[test]
    fn changes_are_read_and_written() {
        let text =
            "classical,freeze=yaw.alpha+yaw.d,set=pitch.a:30mm+roll.a:1e+1mm,drop=15+12,joint-noise=0.5deg,imu-noise=2";
        let read = changes(text);
        assert_eq!(read.parameterization, Some(ParameterizationChoice::Classical));
        assert_eq!(read.frozen, ["yaw.alpha", "yaw.d"]);
        assert_eq!(read.values, [("pitch.a".to_owned(), 0.03), ("roll.a".to_owned(), 0.01)]);
        assert_eq!(read.dropped.iter().copied().collect::<Vec<_>>(), [12, 15]);
        assert!((read.joint_noise_rad - 0.5_f64.to_radians()).abs() < 1e-15);
        assert_eq!((read.imu_noise, read.pixel_noise), (2.0, 1.0));
        for text in [text, "", "poe", "without=cam1,encoder=off", "pixel-noise=0.5,encoder-noise=3", "set=L1.d:-0.25"] {
            assert_eq!(changes(&changes(text).to_string()), changes(text), "{text}");
        }
    }

    #[test]
    fn refused_changes_say_what_was_expected() {
        let check = |text: &str, words: &[&str]| {
            let message = text.parse::<ForkChanges>().unwrap_err().to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{text}: {message}");
        };
        check("statik", &["'statik'", "minimal-swapped"]);
        check("static", &["'static'", "features that only its own cameras have seen", "run static beside it"]);
        check("camera=cam1", &["without=cam1", "a run with camera=cam1"]);
        check("encoder=on", &["'on'", "joint offsets", "add a run with encoder=on"]);
        check("set=yaw.alpha", &["no value", "set=yaw.alpha:1deg"]);
        check("set=yaw.alpha:far", &["'far'", "number"]);
        check("drop=some", &["'some'", "feature"]);
        check("imu-noise=0", &["'0'", "factor"]);
        check("joint-noise=-1", &["'-1'", "0 or more"]);
        check("speed=3", &["unknown key 'speed'", "freeze"]);
    }

    #[test]
    fn measurements_are_altered_the_same_way_every_time() {
        let mut alterations = Alterations::default();
        let angles = JointAngles {
            angles_rad: vec![0.1, 0.2],
            sigmas_rad: vec![0.01, 0.01],
            lasting_sigmas_rad: vec![0.0, 0.0],
            ..JointAngles::default()
        };
        assert!(alterations.joint_angles(&angles, 7).is_none());
        alterations.add(Alterations { joint_noise_rad: 0.03, ..Alterations::default() });
        alterations.add(Alterations { joint_noise_rad: 0.04, encoder_noise: 2.0, ..Alterations::default() });
        let altered = alterations.joint_angles(&angles, 7).unwrap();
        assert_eq!(Some(&altered), alterations.joint_angles(&angles, 7).as_ref());
        assert_eq!(altered.sigmas_rad, [0.02, 0.02]);
        let errors: Vec<f64> = (0..2000)
            .map(|stamp_ns| alterations.joint_angles(&angles, stamp_ns).unwrap().angles_rad[1] - 0.2)
            .collect();
        let deviation = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        assert!((deviation - 0.05).abs() < 0.003, "{deviation}");
    }
}
