//! Common parts of the files of several programs: head lines, matrices, masks.

use std::fmt::Write as _;

use nalgebra::SMatrix;

use super::OtherEstimator;
use crate::files::yaml::{number, numbers};
use crate::geometry::RigidTransform;
use crate::sensors::{CameraMount, CameraRig, GrayImage, ImageMask, Rig};
use crate::text::{Named as _, printable};

/// Text in the first line of every file, which identifies files of this program.
pub(super) const MARK: &str = "Written by dcvins export";

/// The first lines of every file.
pub(super) fn head(program: OtherEstimator, rig: &str, notes: &[String]) -> Vec<String> {
    let mut head = vec![format!("{MARK} for {} from the rig '{}'.", program.name(), printable(rig))];
    head.extend(notes.iter().map(|note| {
        let mut letters = note.chars();
        let first = letters.next().map(|letter| letter.to_uppercase().to_string()).unwrap_or_default();
        // The key of a camera keeps its case, as in the rig.
        let first = if note.starts_with("cam") { note.chars().take(1).collect() } else { first };
        format!("{}.", printable(&format!("{first}{}", letters.as_str())))
    }));
    head
}

pub(super) fn comments(head: &[String]) -> String {
    head.iter().map(|line| format!("# {line}\n")).collect::<Vec<_>>().concat()
}

/// The head of a YAML file for `OpenCV`, which requires the version in the first line.
pub(super) fn opencv_comments(head: &[String]) -> String {
    format!("%YAML:1.0\n{}", comments(head))
}

/// `imu_from_camera` of a camera whose gimbal is fixed.
pub(super) fn imu_from_camera(camera: &CameraRig) -> RigidTransform {
    match &camera.mount {
        CameraMount::Static { imu_from_camera } => *imu_from_camera,
        // A rig with a fixed gimbal has none.
        CameraMount::Gimbal => RigidTransform::identity(),
    }
}

/// A matrix as a list of rows after its key; the key is indented by `depth` levels.
pub(super) fn rows<const N: usize>(depth: usize, key: &str, matrix: &SMatrix<f64, N, N>) -> String {
    let indentation = " ".repeat(2 * depth);
    let mut out = format!("{indentation}{key}:\n");
    for row in matrix.row_iter() {
        let row: Vec<f64> = row.iter().copied().collect();
        // Writing to a string cannot fail.
        let _infallible = writeln!(out, "{indentation}  - {}", numbers(&row));
    }
    out
}

/// A 4 × 4 matrix in the format of `OpenCV`; `kind` is `d` for doubles, `f` for floats.
pub(super) fn opencv_matrix(key: &str, transform: &RigidTransform, kind: char) -> String {
    let matrix = transform.to_matrix();
    let rows: Vec<String> =
        matrix.row_iter().map(|row| row.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", ")).collect();
    let data = rows.join(",\n          ");
    format!("{key}: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: {kind}\n   data: [{data}]\n")
}

/// Text in double quotes, with the escapes of JSON and YAML.
pub(super) fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// YAML lines `key: value` in the order of the entries.
pub(super) fn entries(entries: &[(&str, String)]) -> String {
    entries.iter().map(|(key, value)| format!("{key}: {value}\n")).collect::<Vec<_>>().concat()
}

/// True if the centre of one camera's image is visible in the other, for distant objects.
pub(super) fn overlap(one: &CameraRig, other: &CameraRig) -> bool {
    let sees_centre_of = |camera: &CameraRig, other: &CameraRig| {
        let camera_from_other = imu_from_camera(camera).inverse() * imu_from_camera(other);
        let [width, height] = other.model.resolution_px;
        let centre = nalgebra::Vector2::new(width as f64 - 1.0, height as f64 - 1.0) / 2.0;
        let bearing = other.model.unproject(&centre).map(|bearing| camera_from_other.rotation * bearing);
        let pixel = bearing.and_then(|bearing| camera.model.project(&bearing));
        pixel.is_some_and(|pixel| camera.model.contains(&pixel, 0.0))
    };
    sees_centre_of(one, other) || sees_centre_of(other, one)
}

/// Indices of the cameras that overlap with one camera, as a list in brackets.
pub(super) fn overlaps(rig: &Rig, number: usize) -> String {
    let camera = &rig.cameras[number];
    let others = rig.cameras.iter().enumerate().filter(|(other, _)| *other != number);
    let numbers: Vec<String> =
        others.filter(|(_, other)| overlap(camera, other)).map(|(other, _)| other.to_string()).collect();
    format!("[{}]", numbers.join(", "))
}

pub(super) fn mask_name(program: OtherEstimator, number: usize) -> String {
    if program == OtherEstimator::OpenVins { format!("mask{number}.png") } else { format!("cam{number}.mask.png") }
}

/// Masks that belong to the files. OpenVINS requires masks of all cameras or none: cameras without one get an empty
/// mask.
pub(super) fn masks(program: OtherEstimator, rig: &Rig) -> Vec<(String, ImageMask)> {
    let any = rig.cameras.iter().any(|camera| camera.mask.is_some());
    let of_camera = |(number, camera): (usize, &CameraRig)| {
        let image = match &camera.mask {
            Some(mask) => mask.image.clone(),
            None if any && program == OtherEstimator::OpenVins => empty_mask(camera.model.resolution_px),
            None => return None,
        };
        Some((mask_name(program, number), image))
    };
    rig.cameras.iter().enumerate().filter_map(of_camera).collect()
}

fn empty_mask([width, height]: [usize; 2]) -> ImageMask {
    ImageMask::from_image(&GrayImage { width, height, pixels: vec![0; width * height] })
}

/// The matrix with exact zeros above its diagonal, where rounding may have left small values.
pub(super) fn lower_triangle(matrix: &nalgebra::Matrix3<f64>) -> nalgebra::Matrix3<f64> {
    matrix.lower_triangle()
}
