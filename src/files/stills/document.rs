//! Layout of a stills file as serde reads it, before its values are checked, and the reading of such JSON files.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::files::FileError;

/// Largest file that is read: a million points.
const MAX_BYTES: u64 = 256 << 20;

/// Homogeneous matrix by rows.
pub(super) type Matrix = [[f64; 4]; 4];

#[derive(Debug, Deserialize)]
pub(super) struct StillsDocument {
    pub(super) format: String,
    #[serde(default)]
    pub(super) configuration: String,
    pub(super) joints: Vec<String>,
    pub(super) static_cameras: Vec<String>,
    pub(super) cameras: BTreeMap<String, CameraDocument>,
    pub(super) initial_chain: ChainDocument,
    pub(super) sets: Vec<SetDocument>,
}

#[derive(Debug, Deserialize)]
pub(super) struct CameraDocument {
    pub(super) resolution: [usize; 2],
    #[serde(default = "pinhole")]
    pub(super) camera_model: String,
    pub(super) intrinsics: Vec<f64>,
    #[serde(default = "none")]
    pub(super) distortion_model: String,
    #[serde(default)]
    pub(super) distortion_coeffs: Vec<f64>,
}

fn pinhole() -> String {
    "pinhole".to_owned()
}

fn none() -> String {
    "none".to_owned()
}

/// Classical chain; the entries `T_CAMERA_FIRST` of further rigid cameras are among `others`.
#[derive(Debug, Deserialize)]
pub(super) struct ChainDocument {
    #[serde(rename = "T_I_B")]
    pub(super) imu_from_base: Matrix,
    pub(super) links: Vec<LinkDocument>,
    #[serde(rename = "T_E_C")]
    pub(super) effector_from_camera: Matrix,
    #[serde(flatten)]
    pub(super) others: BTreeMap<String, serde_json::Value>,
}

#[derive(Debug, Deserialize)]
pub(super) struct LinkDocument {
    pub(super) joint: Option<String>,
    pub(super) theta_offset: f64,
    pub(super) d: f64,
    pub(super) a: f64,
    pub(super) alpha: f64,
}

#[derive(Debug, Deserialize)]
pub(super) struct SetDocument {
    pub(super) id: u64,
    pub(super) station: Option<u64>,
    pub(super) joint_angles_rad: Vec<f64>,
    pub(super) views: BTreeMap<String, ViewDocument>,
}

#[derive(Debug, Deserialize)]
pub(super) struct ViewDocument {
    #[serde(rename = "T_camera_world")]
    pub(super) camera_from_world: Option<Matrix>,
    /// `X Y Z u v`.
    pub(super) points: Vec<[f64; 5]>,
}

/// Reads a JSON file; the message of an error has line and column.
pub(super) fn parsed<T: DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    let io = |source| FileError::Io { action: "open the stills", source, path: path.to_owned() };
    let file = File::open(path).map_err(io)?;
    let bytes = file.metadata().map_err(io)?.len();
    if bytes > MAX_BYTES {
        let problem = format!("it has {} MiB, expected at most {} MiB; split its sets", bytes >> 20, MAX_BYTES >> 20);
        return Err(FileError::Stills { problem, path: path.to_owned() });
    }
    serde_json::from_reader(BufReader::new(file.take(MAX_BYTES))).map_err(|error| FileError::Stills {
        problem: format!("{error}; expected the JSON of docs/formats.md, section 'Stills'"),
        path: path.to_owned(),
    })
}
