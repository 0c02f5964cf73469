//! Simulated errors of a rig: named quantity, distribution, magnitude, seed.

use std::fmt;
use std::ops::RangeInclusive;

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use thiserror::Error;

use crate::camera::CameraError;
use crate::geometry::{Dimension, SplitMix64, so3};
use crate::gimbal::ClassicalChain;
use crate::sensors::{CameraMount, GimbalRig, Rig};
use crate::text::Named;

/// A quantity of a rig that a study can perturb.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum RigQuantity {
    /// The independent translations of the gimbal chain.
    GimbalTranslation,
    /// The independent angles of the gimbal chain.
    GimbalRotation,
    /// The offsets of the joint angles.
    GimbalThetaOffset,
    /// The time offset of the joint angles.
    GimbalTimeshift,
    /// The standard deviation of the encoders stated in the rig.
    EncoderSigma,
    /// The positions of rigid cameras.
    StaticTranslation,
    /// The orientations of rigid cameras.
    StaticRotation,
    /// The focal lengths; fx and fy of a camera change by the same factor.
    Focal,
    /// The principal points of the cameras.
    Centre,
    /// The first two coefficients of the distortion.
    Distortion,
    CameraTimeshift,
    /// The readout times of the cameras.
    Readout,
    /// The four noise densities of the IMU stated in the rig, all by one factor.
    ImuNoise,
}

impl Named for RigQuantity {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::GimbalTranslation, "gimbal.translation"),
        (Self::GimbalRotation, "gimbal.rotation"),
        (Self::GimbalThetaOffset, "gimbal.theta_offset"),
        (Self::GimbalTimeshift, "gimbal.timeshift"),
        (Self::EncoderSigma, "gimbal.encoder_sigma"),
        (Self::StaticTranslation, "static.translation"),
        (Self::StaticRotation, "static.rotation"),
        (Self::Focal, "camera.focal"),
        (Self::Centre, "camera.centre"),
        (Self::Distortion, "camera.distortion"),
        (Self::CameraTimeshift, "camera.timeshift"),
        (Self::Readout, "camera.readout"),
        (Self::ImuNoise, "imu.noise"),
    ];
}

impl From<RigQuantity> for String {
    fn from(quantity: RigQuantity) -> Self {
        quantity.name().to_owned()
    }
}

impl TryFrom<String> for RigQuantity {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::from_name(&name).ok_or_else(|| format!("no quantity '{name}'"))
    }
}

impl RigQuantity {
    /// Dimension of a magnitude; a ratio is relative to the rig's value.
    pub fn dimension(self) -> MagnitudeDimension {
        MagnitudeDimension(match self {
            Self::GimbalTranslation | Self::StaticTranslation => Dimension::Length,
            Self::GimbalRotation | Self::GimbalThetaOffset | Self::StaticRotation => Dimension::Angle,
            Self::GimbalTimeshift | Self::CameraTimeshift | Self::Readout => Dimension::Time,
            Self::Centre => Dimension::Pixel,
            Self::EncoderSigma | Self::Focal | Self::Distortion | Self::ImuNoise => Dimension::Ratio,
        })
    }

    /// Range of a magnitude, in the unit of its dimension.
    pub(super) fn range(self) -> RangeInclusive<f64> {
        match self.dimension().0 {
            Dimension::Length => -10.0..=10.0,
            Dimension::Angle => -3.2..=3.2,
            Dimension::Time => -1.0..=1.0,
            Dimension::Pixel => -1000.0..=1000.0,
            Dimension::Ratio if matches!(self, Self::Focal | Self::Distortion) => -0.5..=0.5,
            Dimension::Ratio => -0.99..=1000.0,
        }
    }
}

/// Dimension of a magnitude, for parsing texts such as `5 mm`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MagnitudeDimension(pub Dimension);

/// The expected forms of a magnitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MagnitudeError {
    pub(super) dimension: MagnitudeDimension,
}

impl MagnitudeDimension {
    /// Unit suffixes, with their size in the unit of the dimension.
    fn units(self) -> &'static [(&'static str, f64)] {
        match self.0 {
            Dimension::Length => &[("m", 1.0), ("cm", 0.01), ("mm", 0.001)],
            Dimension::Angle => &[("rad", 1.0), ("mrad", 0.001), ("deg", std::f64::consts::PI / 180.0)],
            Dimension::Time => &[("s", 1.0), ("ms", 0.001)],
            Dimension::Pixel => &[("px", 1.0)],
            Dimension::Ratio => &[("%", 0.01)],
        }
    }

    /// Parses a number with a unit, `5 mm` or `5mm`.
    pub(super) fn parse(self, text: &str) -> Option<f64> {
        let end = text.find(|letter: char| letter.is_alphabetic() && letter != 'e' || letter == '%')?;
        let (number, unit) = text.split_at(end);
        let (_, size) = self.units().iter().find(|(name, _)| *name == unit.trim())?;
        let value = number.trim().parse::<f64>().ok().filter(|value| value.is_finite())?;
        Some(value * size)
    }
}

impl fmt::Display for MagnitudeError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let units: Vec<&str> = self.dimension.units().iter().map(|(name, _)| *name).collect();
        let unit = match self.dimension.0 {
            Dimension::Ratio => "as a ratio",
            other => other.unit(),
        };
        write!(
            out,
            "a number ({unit}), or a text with a unit ({}) as in \"5 {}\"",
            units.join(", "),
            units[units.len() - 1]
        )
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Uniform from minus to plus the magnitude.
    Uniform,
    /// Normal with the magnitude as its standard deviation.
    Normal,
    /// The magnitude itself, independent of the seed.
    Constant,
}

impl Named for Distribution {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Uniform, "uniform"), (Self::Normal, "normal"), (Self::Constant, "constant")];
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigChange {
    pub quantity: RigQuantity,
    /// Distribution of each value of the quantity; the values are independent.
    pub distribution: Distribution,
    /// Magnitude, in the unit of the quantity's dimension.
    pub magnitude: f64,
}

/// Rig to which errors are added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PerturbationStart {
    #[default]
    Rig,
    /// The ground-truth rig of the log, with the noise and the prior of the log's rig.
    Truth,
    /// The rig that the offline calibration estimates from the log itself.
    Calibrated,
}

impl Named for PerturbationStart {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Rig, "rig"), (Self::Truth, "truth"), (Self::Calibrated, "calibrated")];
}

/// A named set of errors, one level of the factor "perturbation" of a study.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RigPerturbation {
    /// Name in the tables.
    pub name: String,
    /// Rig to which errors are added.
    pub start: PerturbationStart,
    /// True if the prior of the gimbal chain is set to the bounds of the chain's changes.
    pub match_prior: bool,
    pub changes: Vec<RigChange>,
}

/// Reason why a rig cannot be perturbed.
#[derive(Debug, Error)]
pub enum PerturbationError {
    #[error("perturbation '{perturbation}' changes {quantity}, but the rig has {missing}")]
    NothingToChange {
        perturbation: String,
        quantity: &'static str,
        /// The missing entry of the rig.
        missing: &'static str,
    },
    #[error("perturbation '{perturbation}' gives {camera} impossible intrinsics: {source}")]
    Camera { perturbation: String, camera: String, source: CameraError },
    #[error("perturbation '{perturbation}' starts from the truth, but the log has no ground-truth rig")]
    NoGroundTruth { perturbation: String },
}

/// Random numbers of one change. They depend only on the seed and the quantity, so that two magnitudes of one quantity
/// draw the same errors except for their scale.
struct Draw {
    random: SplitMix64,
    distribution: Distribution,
    magnitude: f64,
}

impl Draw {
    fn new(change: &RigChange, seed: u64) -> Self {
        let digest = Sha256::digest(format!("{} {seed}", change.quantity.name()));
        let mut start = [0; 8];
        start.copy_from_slice(&digest[..8]);
        let RigChange { distribution, magnitude, .. } = *change;
        Self { random: SplitMix64::new(u64::from_le_bytes(start)), distribution, magnitude }
    }

    fn next(&mut self) -> f64 {
        let [first, second] = [self.random.next_unit(), self.random.next_unit()];
        self.magnitude
            * match self.distribution {
                Distribution::Uniform => 2.0 * first - 1.0,
                // Box–Muller.
                Distribution::Normal => (-2.0 * (1.0 - first).ln()).sqrt() * (std::f64::consts::TAU * second).cos(),
                Distribution::Constant => 1.0,
            }
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.next())
    }

    /// 1 plus the error, at least 0.01.
    fn factor(&mut self) -> f64 {
        (1.0 + self.next()).max(0.01)
    }
}

impl RigPerturbation {
    /// True if the result depends on the seed.
    pub fn is_random(&self) -> bool {
        self.changes.iter().any(|change| change.distribution != Distribution::Constant)
    }

    /// True if the rig remains unchanged.
    pub fn is_none(&self) -> bool {
        self.changes.is_empty() && self.start == PerturbationStart::Rig
    }

    /// The rig with the errors drawn with a seed. `given` is the rig of the log, or for
    /// [`PerturbationStart::Calibrated`] the rig of its offline calibration.
    ///
    /// # Errors
    /// If the rig does not have a changed quantity, a camera would have impossible intrinsics, or the perturbation
    /// starts from a ground truth that is missing.
    pub fn apply(&self, given: &Rig, truth: Option<&Rig>, seed: u64) -> Result<Rig, PerturbationError> {
        let mut rig = match self.start {
            PerturbationStart::Rig | PerturbationStart::Calibrated => given.clone(),
            PerturbationStart::Truth => {
                let missing = || PerturbationError::NoGroundTruth { perturbation: self.name.clone() };
                with_values_of(given, truth.ok_or_else(missing)?)
            }
        };
        for change in &self.changes {
            self.apply_one(&mut rig, change, &mut Draw::new(change, seed))?;
        }
        if let (true, Some(gimbal)) = (self.match_prior, &mut rig.gimbal) {
            self.widen_prior(gimbal);
        }
        Ok(rig)
    }

    /// Sets the prior of the chain to the bounds of its changes; a normal error of σ has the variance of a uniform one
    /// within √3·σ.
    fn widen_prior(&self, gimbal: &mut GimbalRig) {
        let bound = |quantities: &[RigQuantity]| {
            let of = self.changes.iter().filter(|change| quantities.contains(&change.quantity));
            of.map(|change| match change.distribution {
                Distribution::Normal => 3.0_f64.sqrt() * change.magnitude.abs(),
                Distribution::Uniform | Distribution::Constant => change.magnitude.abs(),
            })
            .reduce(f64::max)
        };
        if let Some(bound_m) = bound(&[RigQuantity::GimbalTranslation]) {
            gimbal.prior.translation_bound_m = bound_m;
        }
        if let Some(bound_rad) = bound(&[RigQuantity::GimbalRotation, RigQuantity::GimbalThetaOffset]) {
            gimbal.prior.rotation_bound_rad = bound_rad;
        }
    }

    fn apply_one(&self, rig: &mut Rig, change: &RigChange, draw: &mut Draw) -> Result<(), PerturbationError> {
        let nothing = |missing: &'static str| PerturbationError::NothingToChange {
            perturbation: self.name.clone(),
            quantity: change.quantity.name(),
            missing,
        };
        match change.quantity {
            RigQuantity::ImuNoise => {
                let (factor, noise) = (draw.factor(), &mut rig.imu.noise);
                for density in [
                    &mut noise.accelerometer_noise_density,
                    &mut noise.accelerometer_random_walk,
                    &mut noise.gyroscope_noise_density,
                    &mut noise.gyroscope_random_walk,
                ] {
                    *density *= factor;
                }
            }
            RigQuantity::EncoderSigma => {
                let sigma = rig.gimbal.as_mut().and_then(|gimbal| gimbal.encoder_sigma_rad.as_mut());
                *sigma.ok_or_else(|| nothing("no encoders"))? *= draw.factor();
            }
            RigQuantity::GimbalTimeshift => {
                let gimbal = rig.gimbal.as_mut().ok_or_else(|| nothing("no gimbal"))?;
                gimbal.timeshift_gimbal_imu_s += draw.next();
            }
            RigQuantity::GimbalTranslation | RigQuantity::GimbalRotation | RigQuantity::GimbalThetaOffset => {
                let gimbal = rig.gimbal.as_mut().ok_or_else(|| nothing("no gimbal"))?;
                let mut chain = gimbal.chain.clone();
                perturb_chain(&mut chain, change.quantity, draw);
                gimbal.set_chain(chain);
            }
            RigQuantity::StaticTranslation | RigQuantity::StaticRotation => {
                let poses = rig.cameras.iter_mut().filter_map(|camera| match &mut camera.mount {
                    CameraMount::Static { imu_from_camera } => Some(imu_from_camera),
                    CameraMount::Gimbal => None,
                });
                let mut count = 0;
                for pose in poses {
                    count += 1;
                    let error = draw.vector();
                    if change.quantity == RigQuantity::StaticTranslation {
                        pose.translation_m += error;
                    } else {
                        pose.rotation *= so3::exp(&error);
                    }
                }
                if count == 0 {
                    return Err(nothing("no rigid camera"));
                }
            }
            RigQuantity::Focal | RigQuantity::Centre | RigQuantity::Distortion => {
                self.perturb_intrinsics(rig, change.quantity, draw)?;
            }
            RigQuantity::CameraTimeshift => {
                rig.cameras.iter_mut().for_each(|camera| camera.timeshift_cam_imu_s += draw.next());
            }
            RigQuantity::Readout => rig.cameras.iter_mut().for_each(|camera| camera.readout_s += draw.next()),
        }
        Ok(())
    }

    fn perturb_intrinsics(
        &self,
        rig: &mut Rig,
        quantity: RigQuantity,
        draw: &mut Draw,
    ) -> Result<(), PerturbationError> {
        for camera in &mut rig.cameras {
            let [fx, fy, cx, cy, k1, k2] = camera.model.intrinsics();
            let wrong = match quantity {
                RigQuantity::Focal => {
                    let factor = draw.factor();
                    [fx * factor, fy * factor, cx, cy, k1, k2]
                }
                RigQuantity::Centre => [fx, fy, cx + draw.next(), cy + draw.next(), k1, k2],
                _ => [fx, fy, cx, cy, k1 + draw.next(), k2 + draw.next()],
            };
            camera.model = camera.model.with_intrinsics(wrong).map_err(|source| PerturbationError::Camera {
                perturbation: self.name.clone(),
                camera: camera.key.clone(),
                source,
            })?;
        }
        Ok(())
    }
}

/// Adds errors to the independent parameters of a chain: two of the base, all of each link, one of the end.
fn perturb_chain(chain: &mut ClassicalChain, quantity: RigQuantity, draw: &mut Draw) {
    match quantity {
        RigQuantity::GimbalTranslation => {
            chain.imu_from_base.translation_m += Vector3::new(draw.next(), draw.next(), 0.0);
            for link in &mut chain.links {
                link.d_m += draw.next();
                link.a_m += draw.next();
            }
            chain.effector_from_camera.translation_m.y += draw.next();
        }
        RigQuantity::GimbalRotation => {
            chain.imu_from_base.rotation *= so3::exp(&Vector3::new(draw.next(), draw.next(), 0.0));
            for link in &mut chain.links {
                link.theta_offset_rad += draw.next();
                link.alpha_rad += draw.next();
            }
            let end = &mut chain.effector_from_camera;
            end.rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), draw.next()) * end.rotation;
        }
        _ => chain.links.iter_mut().for_each(|link| link.theta_offset_rad += draw.next()),
    }
}

/// The ground-truth calibration, with the topics, the noise and the priors of the log's rig.
fn with_values_of(given: &Rig, truth: &Rig) -> Rig {
    let mut rig = given.clone();
    for camera in &mut rig.cameras {
        let Some(true_camera) = truth.cameras.iter().find(|other| other.key == camera.key) else { continue };
        camera.mount = true_camera.mount.clone();
        camera.model = true_camera.model.clone();
        camera.timeshift_cam_imu_s = true_camera.timeshift_cam_imu_s;
        camera.readout_s = true_camera.readout_s;
    }
    rig.imu.intrinsics = truth.imu.intrinsics;
    if let (Some(gimbal), Some(true_gimbal)) = (&mut rig.gimbal, &truth.gimbal) {
        gimbal.timeshift_gimbal_imu_s = true_gimbal.timeshift_gimbal_imu_s;
        gimbal.set_chain(true_gimbal.chain.clone());
    }
    rig
}
