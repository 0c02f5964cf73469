//! The programs whose configuration can be written, and the capabilities of each one's format.

use super::ConfigurationError;
use crate::camera::{CameraModel, Distortion, Projection};
use crate::sensors::{CameraMount, Rig};
use crate::text::Named;

/// Support of a program for time offsets between cameras and IMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TimeOffset {
    PerCamera,
    /// One offset for all cameras: the first camera's.
    One,
    None,
}

/// Capabilities of a program's configuration format.
pub(super) struct Format {
    title: &'static str,
    most_cameras: usize,
    lens: fn(&CameraModel) -> bool,
    lenses: &'static str,
    time_offset: TimeOffset,
    /// True if the format has scale and misalignment of the IMU.
    pub(super) has_imu_intrinsics: bool,
    has_readout: bool,
    pub(super) has_masks: bool,
}

/// Radial–tangential lenses with at most four coefficients, and lenses without distortion.
fn is_radtan(lens: &Distortion) -> bool {
    matches!(lens, Distortion::None | Distortion::Radtan(_))
}

impl Format {
    pub(super) fn of(program: OtherEstimator) -> Self {
        let title = program.name();
        match program {
            OtherEstimator::Kalibr => Self {
                title,
                most_cameras: usize::MAX,
                lens: |model| !matches!(model.distortion, Distortion::Rational(_)),
                lenses: "pinhole with none, radtan (4 coefficients), equidistant or fov, omni with none or radtan, eucm and ds",
                time_offset: TimeOffset::PerCamera,
                has_imu_intrinsics: true,
                has_readout: true,
                has_masks: true,
            },
            OtherEstimator::VinsFusion => Self {
                title,
                most_cameras: 2,
                lens: |model| match model.projection {
                    Projection::Pinhole => !matches!(model.distortion, Distortion::Fov(_)),
                    Projection::Omni { .. } => true,
                    Projection::Eucm { .. } | Projection::Ds { .. } => false,
                },
                lenses: "pinhole with none, radtan, plumb_bob, rational_polynomial or equidistant, and omni with none or radtan",
                time_offset: TimeOffset::One,
                has_imu_intrinsics: false,
                has_readout: false,
                has_masks: false,
            },
            OtherEstimator::OpenVins => Self {
                title,
                most_cameras: usize::MAX,
                lens: |model| {
                    let lens = &model.distortion;
                    model.projection == Projection::Pinhole
                        && (is_radtan(lens) || matches!(lens, Distortion::Equidistant(_)))
                },
                lenses: "pinhole with none, radtan (4 coefficients) or equidistant",
                time_offset: TimeOffset::One,
                has_imu_intrinsics: true,
                has_readout: false,
                has_masks: true,
            },
            OtherEstimator::Basalt => Self {
                title,
                most_cameras: usize::MAX,
                lens: |model| match model.projection {
                    Projection::Pinhole => matches!(model.distortion, Distortion::None | Distortion::Equidistant(_)),
                    Projection::Omni { .. } | Projection::Eucm { .. } | Projection::Ds { .. } => {
                        model.distortion == Distortion::None
                    }
                },
                lenses: "pinhole with none or equidistant (its kb4), and omni (its ucm), eucm and ds with none",
                time_offset: TimeOffset::One,
                has_imu_intrinsics: true,
                has_readout: false,
                has_masks: false,
            },
            OtherEstimator::OrbSlam3 => Self {
                title,
                most_cameras: 1,
                lens: |model| {
                    let lens = &model.distortion;
                    let polynomial = matches!(lens, Distortion::Rational(lens) if lens.is_polynomial());
                    model.projection == Projection::Pinhole
                        && (is_radtan(lens) || polynomial || matches!(lens, Distortion::Equidistant(_)))
                },
                lenses: "pinhole with none, radtan, plumb_bob (5 coefficients) or equidistant",
                time_offset: TimeOffset::None,
                has_imu_intrinsics: false,
                has_readout: false,
                has_masks: false,
            },
        }
    }

    /// The rig with the cameras for the program, in their order.
    pub(super) fn choose_cameras(&self, rig: &Rig, keys: &[String]) -> Result<Rig, ConfigurationError> {
        let mut chosen = rig.clone();
        if keys.is_empty() {
            // A program takes two cameras as a stereo pair, which the user has to request explicitly.
            let count = if self.most_cameras <= 2 { 1 } else { rig.cameras.len() };
            chosen.cameras.truncate(count);
            return Ok(chosen);
        }
        if keys.len() > self.most_cameras {
            let (program, most) = (self.title, self.most_cameras);
            return Err(ConfigurationError::TooManyCameras { program, most, given: keys.len() });
        }
        if let Some((_, camera)) = keys.iter().enumerate().find(|(index, key)| keys[..*index].contains(key)) {
            return Err(ConfigurationError::CameraTwice { camera: camera.clone() });
        }
        chosen.cameras = keys.iter().map(|key| rig.camera(key).cloned()).collect::<Result<_, _>>()?;
        Ok(chosen)
    }

    /// Returns an error for a lens that the program does not support.
    pub(super) fn check_lenses(&self, rig: &Rig) -> Result<(), ConfigurationError> {
        let lacking = rig.cameras.iter().find(|camera| !(self.lens)(&camera.model));
        lacking.map_or(Ok(()), |camera| {
            Err(ConfigurationError::Lens {
                camera: camera.key.clone(),
                model: format!("{} with {}", camera.model.projection.name(), camera.model.distortion.name()),
                program: self.title,
                takes: self.lenses,
            })
        })
    }

    /// Properties of the rig that the program cannot express; `rig` has the cameras chosen from `whole`.
    pub(super) fn notes(&self, whole: &Rig, rig: &Rig, by_default: bool) -> Vec<String> {
        let title = self.title;
        let mut notes = Vec::new();
        if by_default && rig.cameras.len() < whole.cameras.len() {
            notes.push(other_cameras(whole, rig));
        }
        for (number, camera) in rig.cameras.iter().enumerate() {
            let key = &camera.key;
            if *key != format!("cam{number}") {
                notes.push(format!("cam{number} here is {key} of the rig"));
            }
            let shift_ms = 1e3 * camera.timeshift_cam_imu_s;
            let first_ms = 1e3 * rig.cameras[0].timeshift_cam_imu_s;
            match self.time_offset {
                TimeOffset::None if shift_ms != 0.0 => {
                    notes.push(format!("{title} takes no time offset: add {shift_ms:+.3} ms to the stamps of {key} first"));
                }
                TimeOffset::One if (shift_ms - first_ms).abs() > 1e-6 => notes.push(format!(
                    "{title} takes the time offset of its first camera for all: add {:+.3} ms to the stamps of {key} first",
                    shift_ms - first_ms
                )),
                _ => {}
            }
            if camera.readout_s != 0.0 && !self.has_readout {
                let readout_ms = 1e3 * camera.readout_s;
                notes.push(format!(
                    "{title} takes no rolling shutter: the readout of {key}, {readout_ms:.3} ms, is left out"
                ));
            }
            if camera.mask.is_some() && !self.has_masks {
                notes.push(format!("{title} takes no mask: that of {key} is left out"));
            }
        }
        if !rig.imu.intrinsics.is_identity() && !self.has_imu_intrinsics {
            notes.push(format!(
                "{title} takes no scale and misalignment of the IMU: correct the samples by imu0.gyroscopes and \
                 imu0.accelerometers of the rig first"
            ));
        }
        if let Some(topic) = &rig.imu.accelerometer_topic {
            notes.push(format!(
                "{title} reads one IMU topic: merge the specific forces of {topic} into the messages of {} first",
                rig.imu.topic
            ));
        }
        if !rig.assumed.is_empty() {
            let fields: Vec<&str> = rig.assumed.iter().map(|assumed| assumed.field.as_str()).collect();
            notes.push(format!("the rig only assumes {}: measure or confirm them", fields.join(", ")));
        }
        notes
    }
}

/// Note about the omitted cameras.
fn other_cameras(whole: &Rig, rig: &Rig) -> String {
    let left: Vec<&str> = whole.cameras[rig.cameras.len()..].iter().map(|camera| camera.key.as_str()).collect();
    let is_carried = rig.cameras.iter().any(|camera| camera.mount == CameraMount::Gimbal);
    let rigid = whole.cameras.iter().find(|camera| camera.mount != CameraMount::Gimbal).filter(|_| is_carried);
    let advice = rigid.map_or_else(String::new, |camera| {
        format!("; {} is rigid, its extrinsics hold at every joint angle (--camera {0})", camera.key)
    });
    format!("{} of the rig is left out{advice}", left.join(", "))
}

/// A program whose configuration can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherEstimator {
    /// Kalibr: `camchain-imucam.yaml` and `imu.yaml`.
    Kalibr,
    /// VINS-Fusion: its configuration with one file per camera.
    VinsFusion,
    /// OpenVINS: `estimator_config.yaml`, `kalibr_imucam_chain.yaml` and `kalibr_imu_chain.yaml`.
    OpenVins,
    /// Basalt: a calibration in JSON.
    Basalt,
    /// ORB-SLAM3: settings of a monocular-inertial system.
    OrbSlam3,
}

/// Names used by their authors.
impl Named for OtherEstimator {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::Kalibr, "Kalibr"),
        (Self::VinsFusion, "VINS-Fusion"),
        (Self::OpenVins, "OpenVINS"),
        (Self::Basalt, "Basalt"),
        (Self::OrbSlam3, "ORB-SLAM3"),
    ];
}
