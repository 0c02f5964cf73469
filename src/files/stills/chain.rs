//! Chains of stills: in a stills file, in a JSON file of their own, or in a rig.

use crate::files::RigFile as _;
use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Matrix4;

use super::document::{ChainDocument, Matrix, parsed};
use crate::files::FileError;
use crate::geometry::RigidTransform;
use crate::gimbal::{ClassicalChain, DhLink};
use crate::sensors::{CameraMount, Rig, Stills, StillsChain};

/// Largest entry of `RᵀR − I` of a rotation.
const ROTATION_TOLERANCE: f64 = 1e-4;

/// Reads a chain for given stills: from a rig (`.yaml`, `.yml`), or from a JSON file that has the entries of
/// `initial_chain`, at its top or in `initial_chain`.
///
/// # Errors
/// If the file cannot be read or its joints or rigid cameras differ from the joints or rigid cameras of the stills.
pub fn read_stills_chain(path: &Path, stills: &Stills) -> Result<StillsChain, FileError> {
    let names: Vec<&str> = stills.rigid_cameras.iter().map(|camera| camera.name.as_str()).collect();
    let of_rig = path.extension().is_some_and(|ending| ending == "yaml" || ending == "yml");
    let chain = if of_rig {
        chain_of_rig(&Rig::from_file(path)?, &stills.joints, &names)
    } else {
        let document: serde_json::Value = parsed(path)?;
        let document = document.get("initial_chain").unwrap_or(&document).clone();
        let document = serde_json::from_value(document).map_err(|error| format!("initial_chain: {error}"));
        document.and_then(|document| chain_of(document, &stills.joints, &names))
    };
    chain.map_err(|problem| FileError::Stills { problem, path: path.to_owned() })
}

/// Chain of a rig, with the frame of the first rigid camera as IMU frame; cameras are found by key or `frame_id`.
fn chain_of_rig(rig: &Rig, joints: &[String], rigid: &[&str]) -> Result<StillsChain, String> {
    let gimbal = rig.gimbal.as_ref().ok_or("the rig has no gimbal; expected that of the stills")?;
    let names: Vec<&str> = gimbal.joints.iter().map(|joint| joint.name.as_str()).collect();
    if names != joints {
        return Err(format!("gimbal.links has the joints {names:?}, expected {joints:?} as in the stills"));
    }
    let imu_from = |name: &str| -> Result<RigidTransform, String> {
        let named = rig.cameras.iter().filter(|camera| camera.key == name || camera.frame_id == name);
        let poses: Vec<RigidTransform> = named
            .filter_map(|camera| match camera.mount {
                CameraMount::Static { imu_from_camera } => Some(imu_from_camera),
                CameraMount::Gimbal => None,
            })
            .collect();
        match poses[..] {
            [pose] => Ok(pose),
            _ => Err(format!(
                "the rig has {} rigid cameras with the key or frame_id '{name}', expected one, as in the stills",
                poses.len()
            )),
        }
    };
    let (first, further) = rigid.split_first().ok_or("the stills have no rigid camera")?;
    // Without a pose of the first camera the IMU frame is taken as its frame.
    let first_from_imu = imu_from(first)?.inverse();
    let further_from_first =
        further.iter().map(|name| Ok((first_from_imu * imu_from(name)?).inverse())).collect::<Result<_, String>>()?;
    let chain = ClassicalChain { imu_from_base: first_from_imu * gimbal.chain.imu_from_base, ..gimbal.chain.clone() };
    Ok(StillsChain { chain, further_from_first })
}

/// Checks the chain of a document; `rigid` are the names of the rigid cameras.
pub(super) fn chain_of(mut document: ChainDocument, joints: &[String], rigid: &[&str]) -> Result<StillsChain, String> {
    if document.links.len() != joints.len() {
        let (found, expected) = (document.links.len(), joints.len());
        return Err(format!("initial_chain.links has {found} links, expected {expected}, one per entry of joints"));
    }
    let mut links = Vec::with_capacity(joints.len());
    for (index, (link, joint)) in document.links.iter().zip(joints).enumerate() {
        if let Some(other) = link.joint.as_ref().filter(|name| *name != joint) {
            return Err(format!("initial_chain.links[{index}].joint is '{other}', expected '{joint}' as in joints"));
        }
        links.push(DhLink { theta_offset_rad: link.theta_offset, d_m: link.d, a_m: link.a, alpha_rad: link.alpha });
    }
    let further_from_first = match rigid.split_first() {
        Some((first, further)) => {
            further.iter().map(|camera| further_of(&mut document.others, camera, first)).collect::<Result<_, _>>()?
        }
        None => Vec::new(),
    };
    let chain = ClassicalChain {
        imu_from_base: transform(&document.imu_from_base).map_err(|it| format!("initial_chain.T_I_B {it}"))?,
        links,
        effector_from_camera: transform(&document.effector_from_camera)
            .map_err(|it| format!("initial_chain.T_E_C {it}"))?,
    };
    Ok(StillsChain { chain, further_from_first })
}

/// `T_camera_first` of a further rigid camera.
fn further_of(
    others: &mut BTreeMap<String, serde_json::Value>,
    camera: &str,
    first: &str,
) -> Result<RigidTransform, String> {
    let key = format!("T_{camera}_{first}");
    let at = format!("initial_chain.{key}");
    let value = others.remove(&key).filter(|value| !value.is_null());
    let value = value.ok_or_else(|| {
        format!("{at} is missing: a first estimate of the transform from '{first}' to '{camera}', 4 rows of 4 numbers")
    })?;
    let matrix: Matrix = serde_json::from_value(value).map_err(|error| format!("{at}: {error}"))?;
    transform(&matrix).map_err(|problem| format!("{at} {problem}"))
}

/// Rigid transform of a homogeneous matrix.
pub(super) fn transform(rows: &Matrix) -> Result<RigidTransform, String> {
    let matrix = Matrix4::from_fn(|row, column| rows[row][column]);
    RigidTransform::from_matrix(&matrix, ROTATION_TOLERANCE).ok_or_else(|| {
        format!(
            "is no rigid transform: expected a rotation (orthonormal within {ROTATION_TOLERANCE:.0e}, determinant +1), a \
             translation in m, and the last row 0 0 0 1"
        )
    })
}
