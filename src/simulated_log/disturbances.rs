//! Simulated sensor faults and calibration errors.

use std::ops::RangeInclusive;

use super::error::SimulationError;
use crate::faults::{Fault, FaultKind};
use crate::geometry::during;
use crate::sensors::CameraMount;
use crate::simulation::vibration::Vibration;
use crate::text::{FINITE, Field, Key, Numbers, read_item};

/// Simulated sensor faults, calibration errors and degenerate motions; none by default.
///
/// Meaning, numbers and ranges of each field: its row of [`Disturbances::KEYS`]. Times are seconds since the log began.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Disturbances {
    pub camera_time_offset_s: f64,
    pub readout_s: f64,
    pub focal_ratio: f64,
    pub imu_intrinsics: [f64; 2],
    pub accelerometer_drift: Option<[f64; 2]>,
    pub joint_lag_s: f64,
    pub joint_start_s: f64,
    pub image_gap_s: Option<[f64; 2]>,
    pub exposure_s: f64,
    pub image_noise: Option<f64>,
    pub jpeg_quality: Option<f64>,
    pub vignetting: Option<f64>,
    pub exposure_drift: Option<f64>,
    pub gyroscope_range_rad_per_s: Option<f64>,
    pub accelerometer_range_m_per_s2: Option<f64>,
    pub light_change: Option<[f64; 2]>,
    pub blank_s: Option<[f64; 2]>,
    pub blind_gimbal: Option<[f64; 3]>,
    pub blind_static: Option<[f64; 3]>,
    pub gimbal_slew_s: Option<[f64; 2]>,
    pub fixed_joint: Option<[f64; 3]>,
    pub hover_s: Option<[f64; 2]>,
    pub stabilized_s: Option<[f64; 2]>,
    pub spin: Option<[f64; 3]>,
    pub vibration: Option<Vibration>,
    pub gimbal_vibration: Option<Vibration>,
    pub gimbal_ripple: Option<Vibration>,
    pub gimbal_imu_error: [f64; 2],
    /// Faults that the corrections of a fork undo, in the order of these corrections.
    pub faults: Vec<Fault>,
}

/// Default ratio by which the farthest corner of an image is darker than the centre.
pub(crate) const VIGNETTING: f64 = 0.12;
/// Default slow drift of the exposure as a ratio of its mean.
pub(crate) const EXPOSURE_DRIFT: f64 = 0.05;
/// Time constant of the cameras' automatic exposure.
const AUTO_EXPOSURE_S: f64 = 0.4;
/// Grey value of the images in a blank interval.
const BLANK_GREY: f32 = 150.0;

/// One or several numbers between commas.
const fn key(
    name: &'static str,
    form: &'static str,
    meaning: &'static str,
    field: fn(&mut Disturbances) -> &mut dyn Numbers,
    ranges: &'static [RangeInclusive<f64>],
) -> Key<Disturbances> {
    Key::new(name, form, meaning, Field::Numbers(field, ranges))
}

impl Disturbances {
    /// The disturbances as on the command line, in seconds and SI units.
    pub const KEYS: &'static [Key<Self>] = &[
        key(
            "camera-offset",
            "S",
            "time offset of the cameras (Kalibr's `timeshift_cam_imu`: `t_imu = t_cam + S`); the given rig has none",
            |it| &mut it.camera_time_offset_s,
            &[-1.0..=1.0],
        ),
        key(
            "readout",
            "S",
            "rolling shutter of both cameras: row v is exposed `v / height · S` after the stamp, every two rows \
             rendered at their own pose of vehicle and gimbal; the given rig has no readout",
            |it| &mut it.readout_s,
            &[-0.2..=0.2],
        ),
        key(
            "focal",
            "RATIO",
            "error of the given rig's focal lengths, 0.01 for 1 % too long",
            |it| &mut it.focal_ratio,
            &[-0.5..=0.5],
        ),
        key(
            "imu-intrinsics",
            "SCALE,RAD",
            "the IMU measures with random scales and axes: standard deviations of each scale error, and of each \
             misalignment and rotation between the sensors; the given rig has none",
            |it| &mut it.imu_intrinsics,
            &[0.0..=0.1, 0.0..=0.1],
        ),
        key(
            "accelerometer-drift",
            "M/S²,S",
            "first-order Gauss–Markov error of each axis of the accelerometer: standard deviation and time constant",
            |it| &mut it.accelerometer_drift,
            &[0.0..=10.0, 0.01..=1e5],
        ),
        key("joint-lag", "S", "delay of the stamps of joint angles", |it| &mut it.joint_lag_s, &[0.0..=10.0]),
        key("joint-start", "S", "start of the joint angles", |it| &mut it.joint_start_s, &[0.0..=3600.0]),
        key("image-gap", "START,LENGTH", "missing images", |it| &mut it.image_gap_s, &[FINITE, FINITE]),
        key(
            "exposure",
            "S",
            "exposure time, which blurs images by the motion during it",
            |it| &mut it.exposure_s,
            &[0.0..=0.2],
        ),
        key(
            "image-noise",
            "GREY",
            "noise of the pixels in grey values, σ 2 without",
            |it| &mut it.image_noise,
            &[0.0..=100.0],
        ),
        key("jpeg", "QUALITY", "JPEG quality, 85 without", |it| &mut it.jpeg_quality, &[1.0..=100.0]),
        key(
            "vignetting",
            "RATIO",
            "how much darker the farthest corner is than the middle, 0.12 without",
            |it| &mut it.vignetting,
            &[0.0..=1.0],
        ),
        key(
            "exposure-drift",
            "RATIO",
            "amplitude of the slow drift of an automatic exposure, as a ratio of its mean; 0.05 without",
            |it| &mut it.exposure_drift,
            &[0.0..=0.9],
        ),
        key(
            "gyroscope-range",
            "RAD/S",
            "largest rate that the gyroscope measures",
            |it| &mut it.gyroscope_range_rad_per_s,
            &[1e-3..=1e3],
        ),
        key(
            "accelerometer-range",
            "M/S²",
            "largest specific force that the accelerometer measures",
            |it| &mut it.accelerometer_range_m_per_s2,
            &[1e-3..=1e4],
        ),
        key(
            "light",
            "START,FACTOR",
            "change of light by a factor, compensated by the automatic exposure with a time constant of 0.4 s",
            |it| &mut it.light_change,
            &[FINITE, 0.01..=100.0],
        ),
        key(
            "blank",
            "START,LENGTH",
            "even grey images, as in fog or close before a bare wall; their noise stays",
            |it| &mut it.blank_s,
            &[FINITE, FINITE],
        ),
        key(
            "blind-gimbal",
            "START,LENGTH,GREY",
            "even images of this grey value from the gimbal camera alone: 0 as with a covered lens, 150 as of `blank`; their \
             noise stays",
            |it| &mut it.blind_gimbal,
            &[FINITE, FINITE, 0.0..=255.0],
        ),
        key(
            "blind-static",
            "START,LENGTH,GREY",
            "the same from the static camera alone",
            |it| &mut it.blind_static,
            &[FINITE, FINITE, 0.0..=255.0],
        ),
        key(
            "slew",
            "START,LENGTH",
            "the operator swings the gimbal's heading by 60° to each side, as fast as the motors follow (200°/s)",
            |it| &mut it.gimbal_slew_s,
            &[FINITE, FINITE],
        ),
        key(
            "spin",
            "START,LENGTH,RAD/S",
            "the vehicle rotates about the vertical at this rate, beyond the limits of the experiments",
            |it| &mut it.spin,
            &[FINITE, FINITE, -6.0..=6.0],
        ),
        key(
            "hold-joint",
            "NUMBER,START,LENGTH",
            "degenerate motion: a joint, counted from 1, is fixed at its angle",
            |it| &mut it.fixed_joint,
            &[1.0..=3.0, FINITE, FINITE],
        ),
        key(
            "hover",
            "START,LENGTH",
            "degenerate motion: hover with a sway of a centimetre; the flight goes on after it",
            |it| &mut it.hover_s,
            &[FINITE, 0.0..=3600.0],
        ),
        key(
            "stabilize",
            "START,LENGTH",
            "degenerate motion: the camera keeps its orientation in the world exactly, as far as the stops let it",
            |it| &mut it.stabilized_s,
            &[FINITE, FINITE],
        ),
        key(
            "vibration",
            "HZ,RAD/S,M/S²",
            "vibration of four rotors in the IMU, of which images and gimbal are free: frequency while hovering, and amplitudes of angular rate and \
             specific force at it. The speed follows the thrust and wanders by 3 %, idles at 60 % until the \
             vehicle first moves, and has harmonics of 0.5, 0.25 and 0.12 of the amplitude; the sensor's low-pass \
             filter lies at 0.4 of its rate, and what passes beyond half the rate is aliased",
            |it| &mut it.vibration,
            &[1.0..=1000.0, 0.0..=100.0, 0.0..=1000.0],
        ),
        key(
            "gimbal-vibration",
            "HZ,RAD/S,M/S²",
            "the same in the IMU on the gimbal (`--gimbal-imu`), with phases of its own",
            |it| &mut it.gimbal_vibration,
            &[1.0..=1000.0, 0.0..=100.0, 0.0..=1000.0],
        ),
        key(
            "gimbal-ripple",
            "HZ,RAD/S,M/S²",
            "ripple of three servos in the IMU on the gimbal, which has no filter: frequency, which wanders by 0.2 %, \
             and amplitudes of angular rate and specific force; beyond half the IMU's rate it is aliased",
            |it| &mut it.gimbal_ripple,
            &[1.0..=1000.0, 0.0..=100.0, 0.0..=1000.0],
        ),
        key(
            "gimbal-imu-error",
            "S,RAD",
            "time offset of the IMU on the gimbal (`t_imu = t_imu1 + S`), and standard deviation of each component of a \
             rotation of its axes; the given rig has neither",
            |it| &mut it.gimbal_imu_error,
            &[-1.0..=1.0, 0.0..=0.5],
        ),
        Key::new(
            "fault",
            "CORRECTION[@S]",
            "the fault that the fork with `correct=CORRECTION` undoes, from a time on if one is given: `reversed:yaw`, \
             `offset:yaw:20deg@4`, `zoom:1.5:1s@3`, `imu-axes:y/x/-z`; `focal` is an error of the given rig, `camera-shift` \
             is as `camera-offset`; may be given several times",
            Field::Other(
                |it, entry| read_fault(entry.value).map(|fault| it.faults.push(fault)),
                |it| it.faults.iter().map(written_fault).collect(),
            ),
        ),
    ];

    /// Adds one disturbance written as `KEY=VALUE[,VALUE…]`.
    ///
    /// # Errors
    /// For an unknown key, and for values that are not as many numbers as the key has.
    pub fn set(&mut self, text: &str) -> Result<(), SimulationError> {
        let bad = |expected: String| SimulationError::BadDisturbance { text: text.to_owned(), expected };
        read_item(Self::KEYS, self, text).map_err(bad)
    }

    pub(crate) fn check(&self) -> Result<(), SimulationError> {
        let mut checked = self.clone();
        for key in Self::KEYS {
            let Field::Numbers(field, ranges) = &key.field else { continue };
            for (value, range) in field(&mut checked).get().into_iter().zip(*ranges) {
                if !range.contains(&value) {
                    let (low, high) = (*range.start(), *range.end());
                    return Err(SimulationError::BadOption { option: key.name, value, low, high });
                }
            }
        }
        Ok(())
    }

    /// Ratio of the image brightness at a time to the brightness without a change of the light.
    pub(crate) fn light_at(&self, time_s: f64) -> f64 {
        match self.light_change {
            Some([start_s, factor]) if time_s >= start_s => factor.powf((-(time_s - start_s) / AUTO_EXPOSURE_S).exp()),
            _ => 1.0,
        }
    }

    /// Grey value of the images of a camera with this mount at a time, if they show nothing.
    pub(crate) fn even_grey_at(&self, mount: &CameraMount, time_s: f64) -> Option<f32> {
        if during(self.blank_s, time_s) {
            return Some(BLANK_GREY);
        }
        let blind = if *mount == CameraMount::Gimbal { self.blind_gimbal } else { self.blind_static };
        let [start_s, length_s, grey] = blind?;
        during(Some([start_s, length_s]), time_s).then_some(grey as f32)
    }
}

/// Reads a fault written as its correction, with the time from which on it acts: `offset:yaw:20deg@4`.
///
/// # Errors
/// For an unknown correction, and for a fault that cannot be simulated.
fn read_fault(text: &str) -> Result<Fault, String> {
    let (correction, since) = text.split_once('@').map_or((text, None), |(before, since)| (before, Some(since)));
    let mut fault: Fault = correction.parse()?;
    if let Some(since) = since {
        let since_s = since.parse().ok().filter(|since_s: &f64| since_s.is_finite());
        fault.since_s = Some(since_s.ok_or_else(|| format!("'{since}' is no time in seconds"))?);
    }
    match fault.kind {
        FaultKind::ImageRegion => Err(format!("'{text}' leaves a half out: which images it had is unknown")),
        FaultKind::Focal | FaultKind::CameraClock if fault.since_s.is_some() => {
            Err(format!("'{text}': the rig has one value for the whole log, expected no time"))
        }
        _ => Ok(fault),
    }
}

/// Text of a fault as [`read_fault`] reads it.
fn written_fault(fault: &Fault) -> String {
    let since = fault.since_s.map_or_else(String::new, |since_s| format!("@{since_s}"));
    format!("{fault}{since}")
}
