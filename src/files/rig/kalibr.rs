//! Files of Kalibr and OpenVINS as a rig: `camchain-imucam.yaml` with `imu.yaml` in the same folder, or
//! `kalibr_imucam_chain.yaml` with `kalibr_imu_chain.yaml`.

use std::path::{Path, PathBuf};

use super::camera_facts::CameraFacts;
use super::fields::Field;
use super::read;
use crate::files::FileError;
use crate::files::located::Located;
use crate::geometry::RigidTransform;
use crate::sensors::{CameraMount, CameraRig, ChainPrior, RequiredAccuracy, Rig};

/// Usual names of the IMU file.
const IMU_FILES: [&str; 4] = ["imu.yaml", "imu0.yaml", "imu-calib.yaml", "kalibr_imu_chain.yaml"];
/// Beginnings of the names of camera chains, and of the IMU files that belong to them.
const NAMES: [(&str, &str); 3] =
    [("camchain-imucam", "imu"), ("camchain", "imu"), ("kalibr_imucam_chain", "kalibr_imu_chain")];

pub(crate) fn is_camera_chain(document: &Located) -> bool {
    document.get("rig_version").is_none()
        && document
            .get("cam0")
            .is_some_and(|camera| camera.get("mount").is_none() && camera.get("camera_model").is_some())
}

/// True for the name of a camera chain, in lower case.
pub(crate) fn is_chain_name(name: &str) -> bool {
    NAMES.iter().any(|(chain, _)| name.contains(chain))
}

/// Candidate files for the IMU of a camera chain, most likely first: `imu-RUN.yaml` next to `camchain-imucam-RUN.yaml`,
/// or `kalibr_imu_chain.yaml` next to `kalibr_imucam_chain.yaml`, then the plain names.
pub(crate) fn imu_files(camera_chain: &Path) -> Vec<PathBuf> {
    let name = camera_chain.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let of_run = NAMES.into_iter().find_map(|(chain, imu)| Some(format!("{imu}{}", name.strip_prefix(chain)?)));
    let of_run = of_run.filter(|name| name != IMU_FILES[0]);
    let names = of_run.into_iter().chain(IMU_FILES.into_iter().map(str::to_owned));
    names.map(|name| camera_chain.with_file_name(name)).collect()
}

/// Reads a camera chain with its IMU (`imu` is the document of the IMU file, or the chain if it has `imu0`).
pub(crate) fn read_camera_chain(
    chain: &Field<'_>,
    imu: &Field<'_>,
    name: &str,
    facts: &dyn CameraFacts,
) -> Result<Rig, FileError> {
    let nested = imu.field("imu0");
    let imu = read::read_imu(if nested.is_present() { &nested } else { imu }, None)?;
    let mut cameras = Vec::new();
    let mut previous_from_imu = None;
    for key in read::camera_keys(chain)? {
        let camera = chain.field(&key);
        let camera_from_imu = camera_from_imu(&camera, previous_from_imu)?;
        previous_from_imu = Some(camera_from_imu);
        let imu_from_camera = camera_from_imu.inverse();
        let relative_prior =
            (!cameras.is_empty() && camera.field("T_cn_cnm1").is_present()).then_some(ChainPrior::RELATIVE);
        let read = read::read_camera_as(&camera, &key, CameraMount::Static { imu_from_camera }, facts)?;
        cameras.push(CameraRig { relative_prior, ..read });
    }
    Ok(Rig {
        name: name.to_owned(),
        gravity_m_per_s2: read::USUAL_GRAVITY_M_PER_S2,
        imu,
        gimbal_imu: None,
        cameras,
        gimbal: None,
        ground_truth_topic: None,
        ground_truth_use_log_time: false,
        ground_truth_lever_arm: None,
        required_accuracy: RequiredAccuracy::default(),
        assumed: Vec::new(),
    })
}

/// Transform `camera_from_imu`: `T_cam_imu`, else the inverse of `T_imu_cam` (OpenVINS), else the transform of the previous
/// camera followed by `T_cn_cnm1`, from the previous camera to this one.
fn camera_from_imu(camera: &Field<'_>, previous_from_imu: Option<RigidTransform>) -> Result<RigidTransform, FileError> {
    let (from_imu, from_previous) = (camera.field("T_cam_imu"), camera.field("T_cn_cnm1"));
    let imu_from_camera = camera.field("T_imu_cam");
    if imu_from_camera.is_present() && !from_imu.is_present() {
        return Ok(imu_from_camera.transform()?.inverse());
    }
    match previous_from_imu {
        Some(previous_from_imu) if !from_imu.is_present() && from_previous.is_present() => {
            Ok(from_previous.transform()? * previous_from_imu)
        }
        None if !from_imu.is_present() => Err(from_imu.unexpected(
            "4 rows of 4 numbers, from the IMU to the camera; kalibr_calibrate_imu_camera writes it into \
             camchain-imucam.yaml (camchain.yaml of kalibr_calibrate_cameras has cameras alone)",
        )),
        _ => from_imu.transform(),
    }
}
