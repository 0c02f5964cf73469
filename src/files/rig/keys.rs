//! Keys of a rig: those that are read, those that are known and unused; any other is an error.

use std::path::Path;

use crate::files::FileError;
use crate::files::located::Located;
use crate::text::{nearest_name, printable, shortened};

/// Keys of one kind of mapping.
struct Keys {
    read: &'static [&'static str],
    /// Keys of other programs without a meaning here, and this program's entries for human readers.
    unused: &'static [&'static str],
}

const ROOT: Keys = Keys {
    read: &[
        "rig_version",
        "name",
        "gravity",
        "imu0",
        "imu1",
        "cam0",
        "gimbal",
        "ground_truth",
        "required_accuracy",
        "assumed",
    ],
    // Written by `dcvins calibrate` and `dcvins simulate` at the end of a rig.
    unused: APPENDICES,
};
/// Entries that this program appends to a rig for human readers.
const APPENDICES: &[&str] = &["calibration", "truth"];
/// Keys of every IMU, then of one on the gimbal, `imu1` with `mount: gimbal`.
const IMU_KEYS: &[&str] = &[
    "rostopic",
    "accelerometer_rostopic",
    "use_log_time",
    "frame_id",
    "update_rate",
    "accelerometer_noise_density",
    "accelerometer_random_walk",
    "gyroscope_noise_density",
    "gyroscope_random_walk",
    "gyroscopes",
    "accelerometers",
    "Tw",
    "R_IMUtoGYRO",
    "Ta",
    "mount",
    "T_cam_imu",
    "timeshift_imu1_imu",
];
/// Includes keys that Kalibr writes for its IMU models, and OpenVINS in its own files.
const IMU: Keys = Keys {
    read: IMU_KEYS.split_at(IMU_KEYS.len() - 3).0,
    unused: &["model", "T_i_b", "time_offset", "R_IMUtoACC", "Tg"],
};
const GIMBAL_IMU: Keys = Keys { read: IMU_KEYS, unused: IMU.unused };
const CAMERA: Keys = Keys {
    read: &[
        "mount",
        "rostopic",
        "use_log_time",
        "frame_id",
        "update_rate",
        "camera_model",
        "intrinsics",
        "distortion_model",
        "distortion_coeffs",
        "resolution",
        "timeshift_cam_imu",
        "readout",
        "readout_sigma",
        "line_delay",
        "intrinsics_sigma",
        "T_cam_imu",
        "T_cn_cnm1",
        "T_cn_cnm1_prior",
        "mask",
    ],
    unused: &["cam_overlaps", "model"],
};
const INTRINSICS_SIGMA: Keys = Keys { read: &["focal", "centre", "distortion"], unused: &[] };
/// The gyroscope's dependence on acceleration and the positions of the accelerometers' axes are not used.
const GYROSCOPES: Keys = Keys { read: &["M", "C_gyro_i"], unused: &["A"] };
const ACCELEROMETERS: Keys = Keys { read: &["M"], unused: &["rx_i", "ry_i", "rz_i"] };
const GIMBAL: Keys = Keys {
    read: &[
        "rostopic",
        "source",
        "use_log_time",
        "timeshift_gimbal_imu",
        "update_rate",
        "encoder_sigma",
        "prior",
        "parameterization",
        "T_I_B",
        "links",
        "T_E_C",
    ],
    unused: &["frame_id", "model"],
};
const SOURCE: Keys = Keys {
    read: &[
        "topic",
        "type",
        "frame",
        "axes",
        "gimbal_axes",
        "imu_axes",
        "order",
        "unit",
        "parent",
        "child",
        "vehicle",
        "vehicle_axes",
        "first_joint_offset",
        "chain",
    ],
    unused: &[],
};
const CHAIN: Keys = Keys { read: &["T_I_B", "links", "T_E_C"], unused: &[] };
const PRIOR: Keys = Keys { read: &["translation_bound", "rotation_bound"], unused: &[] };
const LINK: Keys = Keys { read: &["joint", "theta_offset", "d", "a", "alpha", "limits"], unused: &[] };
const REQUIRED_ACCURACY: Keys = Keys { read: &["translation", "rotation"], unused: &[] };
const GROUND_TRUTH: Keys = Keys { read: &["rostopic", "use_log_time", "lever_arm"], unused: &["frame_id"] };

/// Keys of a document that are not read.
#[derive(Default)]
struct Found {
    /// Paths of unknown keys, with the nearest known key and the line.
    unknown: Vec<(String, &'static str, usize)>,
    unused: Vec<String>,
}

/// Checks every key of a rig or of Kalibr's camera chain; returns the paths of known but unused keys.
pub(crate) fn check_rig(document: &Located, file: &Path) -> Result<Vec<String>, FileError> {
    let mut found = Found::default();
    check_root(document, &mut found);
    found.into_result(file)
}

/// Checks every key of Kalibr's IMU file: the IMU itself, or a mapping with `imu0`.
pub(crate) fn check_imu_file(document: &Located, file: &Path) -> Result<Vec<String>, FileError> {
    let mut found = Found::default();
    if document.get("imu0").is_some() {
        check_root(document, &mut found);
    } else {
        check_imu(document, "", &IMU, &mut found);
    }
    found.into_result(file)
}

/// True for a key of a rig's outermost mapping.
pub(super) fn is_of_root(key: &str) -> bool {
    ROOT.read.contains(&key) || APPENDICES.contains(&key) || is_numbered(key, "cam") || is_numbered(key, "imu")
}

/// True for a key of the mapping with a key of the outermost one.
pub(super) fn is_of_mapping(key: &str, mapping: &str) -> bool {
    let keys = match mapping {
        "gimbal" => &GIMBAL,
        "ground_truth" => &GROUND_TRUTH,
        "required_accuracy" => &REQUIRED_ACCURACY,
        mapping if is_numbered(mapping, "cam") => &CAMERA,
        "imu1" => &GIMBAL_IMU,
        mapping if is_numbered(mapping, "imu") => &IMU,
        _ => return false,
    };
    keys.read.contains(&key) || keys.unused.contains(&key)
}

/// True for a name followed by a number, such as `cam0`.
fn is_numbered(key: &str, name: &str) -> bool {
    key.strip_prefix(name).is_some_and(|number| number.parse::<u32>().is_ok())
}

fn check_root(document: &Located, found: &mut Found) {
    let Some(mapping) = document.mapping() else { return };
    for (key, value) in mapping {
        match key.as_str() {
            "imu0" => check_imu(value, key, &IMU, found),
            "imu1" if value.get("mount").is_some() => check_imu(value, key, &GIMBAL_IMU, found),
            "gimbal" => check_gimbal(value, found),
            "ground_truth" => check_mapping(value, key, &GROUND_TRUTH, found),
            key if is_numbered(key, "cam") => check_camera(value, key, found),
            // Kalibr's files may have several IMUs on the vehicle, of which the first is used.
            key if is_numbered(key, "imu") => found.unused.push(key.to_owned()),
            key => found.check_key("", key, value.key_line, &ROOT),
        }
    }
}

fn check_imu(imu: &Located, path: &str, keys: &Keys, found: &mut Found) {
    check_mapping(imu, path, keys, found);
    for (key, keys) in [("gyroscopes", &GYROSCOPES), ("accelerometers", &ACCELEROMETERS)] {
        if let Some(sensor) = imu.get(key) {
            let path = if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
            check_mapping(sensor, &path, keys, found);
        }
    }
}

fn check_camera(camera: &Located, path: &str, found: &mut Found) {
    if path == "cam0" && camera.get("T_cn_cnm1").is_some() {
        // There is no camera before it.
        found.unused.push(format!("{path}.T_cn_cnm1"));
    }
    check_mapping(camera, path, &CAMERA, found);
    if camera.get("mount").is_none() {
        // A camera chain of OpenVINS has the inverse transform.
        found.unknown.retain(|(field, ..)| field.strip_suffix(".T_imu_cam") != Some(path));
    }
    if let Some(prior) = camera.get("T_cn_cnm1_prior") {
        check_mapping(prior, &format!("{path}.T_cn_cnm1_prior"), &PRIOR, found);
    }
    if let Some(sigma) = camera.get("intrinsics_sigma") {
        check_mapping(sigma, &format!("{path}.intrinsics_sigma"), &INTRINSICS_SIGMA, found);
    }
}

fn check_gimbal(gimbal: &Located, found: &mut Found) {
    check_mapping(gimbal, "gimbal", &GIMBAL, found);
    if let Some(prior) = gimbal.get("prior") {
        check_mapping(prior, "gimbal.prior", &PRIOR, found);
    }
    if let Some(source) = gimbal.get("source") {
        check_mapping(source, "gimbal.source", &SOURCE, found);
        if let Some(chain) = source.get("chain") {
            check_mapping(chain, "gimbal.source.chain", &CHAIN, found);
        }
    }
    for (index, link) in gimbal.get("links").and_then(Located::list).into_iter().flatten().enumerate() {
        check_mapping(link, &format!("gimbal.links[{index}]"), &LINK, found);
    }
}

fn check_mapping(mapping: &Located, path: &str, keys: &Keys, found: &mut Found) {
    for (key, value) in mapping.mapping().into_iter().flatten() {
        found.check_key(path, key, value.key_line, keys);
    }
}

impl Found {
    fn check_key(&mut self, path: &str, key: &str, line: usize, keys: &Keys) {
        let full = || if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
        if keys.read.contains(&key) || path.is_empty() && APPENDICES.contains(&key) {
            return;
        }
        if keys.unused.contains(&key) {
            self.unused.push(full());
            return;
        }
        let known = keys.read.iter().chain(keys.unused).copied();
        let nearest = nearest_name(key, known).map_or("", |(_, known)| known);
        self.unknown.push((full(), nearest, line));
    }

    /// Returns the unused keys, or an error about the unknown ones.
    fn into_result(self, file: &Path) -> Result<Vec<String>, FileError> {
        /// Largest number of further unknown keys in a message.
        const MAX_LISTED: usize = 8;
        let Some(((field, nearest, line), others)) = self.unknown.split_first() else { return Ok(self.unused) };
        let mut problem = match field.rsplit_once('.') {
            Some((_, "T_imu_cam")) => "unknown key, expected T_cam_imu, the inverse of T_imu_cam".to_owned(),
            _ => format!("unknown key, the nearest known key is '{nearest}'"),
        };
        if !others.is_empty() {
            let listed = others.iter().take(MAX_LISTED);
            let listed: Vec<String> =
                listed.map(|(field, nearest, _)| format!("{} ('{nearest}'?)", shortened(field, 60))).collect();
            let more = others.len().saturating_sub(MAX_LISTED);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            problem = format!("{problem}; also unknown: {}{more}", listed.join(", "));
        }
        Err(FileError::of_field(&printable(field), problem, *line, file))
    }
}
