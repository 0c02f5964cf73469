//! Static regions of the images of a moving camera: the vehicle in view.
//!
//! The gradient of a pixel that shows the vehicle keeps its direction in all images; gradients of the scene have any
//! direction.

use std::collections::BTreeMap;

use crate::log_check::report::{Area, Findings, ImageRotation, ProposedMask, Severity};
use crate::log_check::survey::Survey;
use crate::sensors::{ImageMask, Rig};

/// Minimum number of neighbouring blocks of a region.
const MIN_BLOCKS: usize = 3;
/// Minimum number of images that are compared.
const MIN_IMAGES: usize = 20;
/// Minimum rotation of the camera, summed over all measured pairs of images, in degrees.
const MIN_ROTATION_DEG: f64 = 45.0;
/// If more of the textured blocks are static, all images show the same scene.
const MAX_STILL_RATIO: f64 = 0.5;
/// A mask of more of the image than this is probably inverted.
const MAX_MASKED_RATIO: f64 = 0.6;

/// Keeps the static blocks with enough neighbours.
fn connected(still: &[bool], columns: usize) -> Vec<bool> {
    let mut kept = vec![false; still.len()];
    let mut visited = vec![false; still.len()];
    let rows = still.len().checked_div(columns).unwrap_or(0);
    for start in 0..still.len() {
        if !still[start] || visited[start] {
            continue;
        }
        let (mut part, mut open) = (Vec::new(), vec![start]);
        visited[start] = true;
        while let Some(block) = open.pop() {
            part.push(block);
            let (column, row) = (block % columns, block / columns);
            for row in row.saturating_sub(1)..(row + 2).min(rows) {
                for column in column.saturating_sub(1)..(column + 2).min(columns) {
                    let next = row * columns + column;
                    if still[next] && !visited[next] {
                        visited[next] = true;
                        open.push(next);
                    }
                }
            }
        }
        if part.len() >= MIN_BLOCKS {
            for block in part {
                kept[block] = true;
            }
        }
    }
    kept
}

/// Proposes a mask for each camera with the vehicle in view, and checks the masks of the rig.
pub(crate) fn check_still_pixels(
    survey: &Survey,
    rig: &Rig,
    rotations: &[ImageRotation],
    findings: &mut Findings,
) -> Vec<ProposedMask> {
    let mut rotated_deg: BTreeMap<&str, (f64, usize)> = BTreeMap::new();
    for rotation in rotations {
        let entry = rotated_deg.entry(&rotation.camera_key).or_default();
        *entry = (entry.0 + rotation.second_from_first.angle().to_degrees(), entry.1 + 1);
    }
    let mut proposed = Vec::new();
    for camera in &rig.cameras {
        let given = camera.mask.as_ref().map(|mask| &mask.image);
        if let Some(mask) = given.filter(|mask| mask.ratio() > MAX_MASKED_RATIO) {
            let title = format!("most of the images of {} is masked", camera.key);
            let evidence = format!("{:.0} % of the pixels", 100.0 * mask.ratio());
            let remedy = "white pixels are masked: invert the mask if it marks the pixels to use";
            findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
        }
        let (rotation_deg, pairs) = rotated_deg.get(camera.key.as_str()).copied().unwrap_or_default();
        let Some(sums) = survey.gradients.get(&camera.key).filter(|sums| sums.images >= MIN_IMAGES) else { continue };
        if rotation_deg < MIN_ROTATION_DEG {
            continue;
        }
        let judged = sums.judge();
        let textured = judged.iter().flatten().count();
        let open = |(index, still): (usize, &Option<bool>)| {
            *still == Some(true) && !given.is_some_and(|mask| sums.is_covered(mask, index))
        };
        let still: Vec<bool> = judged.iter().enumerate().map(open).collect();
        let all_still = judged.iter().filter(|still| **still == Some(true)).count();
        if all_still as f64 > MAX_STILL_RATIO * textured as f64 {
            continue;
        }
        let parts = connected(&still, sums.blocks()[0]);
        let motion =
            format!("in {} images, while the camera rotated by {rotation_deg:.0}° over {pairs} pairs", sums.images);
        if !parts.contains(&true) {
            if given.is_some() {
                let title = format!("the mask of {} covers all static regions", camera.key);
                findings.good(Area::Images, title, motion);
            }
            continue;
        }
        let mask = sums.mask(&parts);
        let title = format!("a region of the images of {} is static", camera.key);
        let evidence = format!("{:.1} % of the pixels {motion}: {}", 100.0 * mask.ratio(), extent(&mask));
        let remedy = format!(
            "it is likely the vehicle: write the proposed mask with dcvins check --write-masks FOLDER, correct it, and name it in {}.mask",
            camera.key
        );
        findings.add(Severity::Warning, Area::Images, title, evidence, remedy);
        proposed.push(ProposedMask { camera_key: camera.key.clone(), mask });
    }
    proposed
}

/// Columns and rows of the masked pixels.
fn extent(mask: &ImageMask) -> String {
    let [width, height] = mask.size_px();
    let columns: Vec<usize> = (0..width).filter(|column| (0..height).any(|row| mask.is_masked(*column, row))).collect();
    let rows: Vec<usize> = (0..height).filter(|row| (0..width).any(|column| mask.is_masked(column, *row))).collect();
    let range = |places: &[usize]| format!("{} to {}", places.first().unwrap_or(&0), places.last().unwrap_or(&0));
    format!("columns {}, rows {}", range(&columns), range(&rows))
}
