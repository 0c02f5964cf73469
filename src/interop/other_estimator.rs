//! The programs whose configuration can be written.

use crate::text::Named;

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
