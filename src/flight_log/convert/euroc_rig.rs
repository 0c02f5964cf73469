//! Rig inside an EuRoC folder that this program has written, for all that `sensor.yaml` cannot describe: the gimbal, time
//! offsets, the readout of a rolling shutter, and priors.

use std::path::Path;

use super::super::file::kind_of;
use super::super::limits::LINE_BYTES;
use super::euroc_sensor::{IMU_TOPIC, image_topic};
use super::sink::LogSink;
use crate::sensors::{CameraRig, GimbalRig, ImuIntrinsics, ImuRig, Rig};

/// Name of the rig in `mav0`.
pub const EUROC_RIG: &str = "rig.yaml";
/// Folder of the joint readings in `mav0`.
pub const EUROC_GIMBAL: &str = "gimbal0";
/// Folder of the ground truth in `mav0`.
pub const EUROC_GROUND_TRUTH: &str = "state_groundtruth_estimate0";
/// Topic of the joint readings in the log of such a folder.
pub(super) const JOINT_TOPIC: &str = "/gimbal0/joint_states";
/// Largest size of the rig.
const LARGEST_BYTES: u64 = 4 * LINE_BYTES;

/// Topic of the poses of a folder in its log.
pub(super) fn pose_topic(folder: &str) -> String {
    format!("/{folder}/pose")
}

/// The rig of a EuRoC folder made of `cameras` (`cam0`, `cam1`, … in this order): names and topics as the conversion of
/// the folder gives them, samples of IMU and joints in IMU time and corrected.
pub fn rig_of_euroc_folder(rig: &Rig, cameras: &[&CameraRig], has_joints: bool, has_ground_truth: bool) -> Rig {
    let camera = |(number, camera): (usize, &&CameraRig)| {
        let key = format!("cam{number}");
        CameraRig {
            topic: image_topic(&key),
            frame_id: key.clone(),
            use_log_time: false,
            key,
            ..CameraRig::clone(camera)
        }
    };
    let gimbal = |gimbal: &GimbalRig| GimbalRig {
        topic: has_joints.then(|| JOINT_TOPIC.to_owned()),
        attitude: None,
        use_log_time: false,
        timeshift_gimbal_imu_s: 0.0,
        ..gimbal.clone()
    };
    Rig {
        imu: ImuRig {
            topic: IMU_TOPIC.to_owned(),
            accelerometer_topic: None,
            use_log_time: false,
            frame_id: "imu0".to_owned(),
            intrinsics: ImuIntrinsics::default(),
            ..rig.imu.clone()
        },
        cameras: cameras.iter().enumerate().map(camera).collect(),
        gimbal: rig.gimbal.as_ref().map(gimbal),
        ground_truth_topic: has_ground_truth.then(|| pose_topic(EUROC_GROUND_TRUTH)),
        ground_truth_use_log_time: false,
        ground_truth_lever_arm: None,
        ..rig.clone()
    }
}

/// Rig in the folder of the sensors; `None` without one, with a note if it cannot be used. Masks stay in the folder.
pub(super) fn rig_in(root: &Path, sink: &mut LogSink<'_>) -> Option<Rig> {
    let path = root.join(EUROC_RIG);
    let metadata = std::fs::metadata(&path).ok()?;
    let problem = if !metadata.is_file() {
        format!("it is {}, expected a file", kind_of(&metadata))
    } else if metadata.len() > LARGEST_BYTES {
        format!("it has {} bytes, more than {LARGEST_BYTES}", metadata.len())
    } else {
        match Rig::from_file(&path) {
            Ok(mut rig) => {
                for camera in rig.cameras.iter_mut().filter(|camera| camera.mask.is_some()) {
                    camera.mask = None;
                    sink.note(format!("the mask of {} stays in {}", camera.key, root.display()));
                }
                return Some(rig);
            }
            Err(error) => error.to_string(),
        }
    };
    sink.note(format!("{EUROC_RIG} cannot be used, so the rig is that of the files sensor.yaml: {problem}"));
    None
}
