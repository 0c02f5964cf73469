//! Checks of a stills file: its values as plain types, or the first problem with its place.

use std::collections::BTreeSet;

use nalgebra::{Vector2, Vector3};

use super::chain::{chain_of, transform};
use super::document::{CameraDocument, SetDocument, StillsDocument, ViewDocument};
use crate::camera::CameraModel;
use crate::sensors::{MapPoint, StillCamera, StillSet, StillView, Stills};

/// Value of the field `format`.
const FORMAT: &str = "acdcc-stills 1";
/// Largest number of joints, as in a rig.
const MAX_JOINTS: usize = 16;
/// Largest number of cameras, as in a rig.
const MAX_CAMERAS: usize = 16;
/// Smallest number of points of a view: fewer leave a pose without a check of its residuals.
const MIN_POINTS: usize = 6;

pub(super) fn stills_of(document: StillsDocument) -> Result<Stills, String> {
    if document.format != FORMAT {
        return Err(format!("format is '{}', expected '{FORMAT}'", document.format));
    }
    check_joints(&document.joints)?;
    if document.cameras.len() > MAX_CAMERAS {
        return Err(format!("cameras has {} entries, expected at most {MAX_CAMERAS}", document.cameras.len()));
    }
    let camera = |name: &str| -> Result<StillCamera, String> {
        let found = document.cameras.get(name);
        let found = found.ok_or_else(|| format!("static_cameras names '{name}', which is not in cameras"))?;
        Ok(StillCamera { name: name.to_owned(), model: model_of(name, found)? })
    };
    let names: Vec<&str> = document.static_cameras.iter().map(String::as_str).collect();
    if names.is_empty() || names.iter().collect::<BTreeSet<_>>().len() != names.len() {
        return Err("static_cameras must name at least one rigid camera, each once".to_owned());
    }
    let rigid_cameras: Vec<StillCamera> = names.iter().map(|name| camera(name)).collect::<Result<_, _>>()?;
    let gimbals: Vec<&String> = document.cameras.keys().filter(|name| !names.contains(&name.as_str())).collect();
    let [gimbal] = gimbals[..] else {
        return Err(format!(
            "cameras has {} entries that static_cameras does not name ({gimbals:?}), expected one, the gimbal camera",
            gimbals.len()
        ));
    };
    let gimbal_camera = camera(gimbal)?;
    let initial = chain_of(document.initial_chain, &document.joints, &names)?;
    // Sets without a station share errors of the map with no other set.
    let unnamed = document.sets.iter().filter_map(|set| set.station).max().map_or(1, |last| last.saturating_add(1));
    let mut ids = BTreeSet::new();
    let mut sets = Vec::with_capacity(document.sets.len());
    for (index, set) in document.sets.iter().enumerate() {
        let at = format!("sets[{index}] (id {})", set.id);
        if !ids.insert(set.id) {
            return Err(format!("{at}: the id occurs twice, expected each once"));
        }
        let read = set_of(set, document.joints.len(), gimbal, &names).map_err(|it| format!("{at}: {it}"))?;
        sets.push(StillSet { station: set.station.unwrap_or_else(|| unnamed.saturating_add(index as u64)), ..read });
    }
    if sets.is_empty() {
        return Err("sets is empty, expected at least one set of images".to_owned());
    }
    Ok(Stills { name: document.configuration, joints: document.joints, gimbal_camera, rigid_cameras, initial, sets })
}

fn check_joints(joints: &[String]) -> Result<(), String> {
    if joints.is_empty() || joints.len() > MAX_JOINTS {
        return Err(format!("joints has {} names, expected 1 to {MAX_JOINTS}", joints.len()));
    }
    let twice = joints.iter().enumerate().find(|(index, name)| joints[..*index].contains(name));
    match twice {
        Some((_, name)) => Err(format!("joints names '{name}' twice, expected each joint once")),
        None => Ok(()),
    }
}

fn model_of(name: &str, camera: &CameraDocument) -> Result<CameraModel, String> {
    CameraModel::from_kalibr(
        &camera.camera_model,
        &camera.intrinsics,
        &camera.distortion_model,
        &camera.distortion_coeffs,
        camera.resolution,
    )
    .map_err(|error| format!("cameras.{name}: {error}"))
}

/// Checked set, without its station.
fn set_of(set: &SetDocument, joints: usize, gimbal: &str, rigid: &[&str]) -> Result<StillSet, String> {
    if set.joint_angles_rad.len() != joints {
        let found = set.joint_angles_rad.len();
        return Err(format!("joint_angles_rad has {found} numbers, expected {joints}, one per joint, in rad"));
    }
    if let Some(other) = set.views.keys().find(|name| *name != gimbal && !rigid.contains(&name.as_str())) {
        return Err(format!("views.{other} belongs to no entry of cameras"));
    }
    let view = |name: &str| -> Result<Option<StillView>, String> {
        set.views.get(name).map(|view| view_of(view).map_err(|it| format!("views.{name}{it}"))).transpose()
    };
    let rigid: Vec<Option<StillView>> = rigid.iter().map(|name| view(name)).collect::<Result<_, _>>()?;
    let gimbal =
        view(gimbal)?.ok_or_else(|| format!("views.{gimbal} is missing: the gimbal camera must see points"))?;
    if rigid.iter().all(Option::is_none) {
        return Err("views has no rigid camera, expected at least one: remove the set".to_owned());
    }
    Ok(StillSet { id: set.id, station: 0, joint_readings_rad: set.joint_angles_rad.clone(), gimbal, rigid })
}

fn view_of(view: &ViewDocument) -> Result<StillView, String> {
    if view.points.len() < MIN_POINTS {
        return Err(format!(
            ".points has {} points, expected at least {MIN_POINTS}: remove the view",
            view.points.len()
        ));
    }
    let points = view
        .points
        .iter()
        .map(|[x, y, z, u, v]| MapPoint { point_in_world_m: Vector3::new(*x, *y, *z), uv_px: Vector2::new(*u, *v) });
    let camera_from_world = view.camera_from_world.as_ref().map(transform).transpose();
    Ok(StillView {
        camera_from_world: camera_from_world.map_err(|problem| format!(".T_camera_world {problem}"))?,
        points: points.collect(),
    })
}
