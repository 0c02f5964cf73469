//! Static regions of the images of a moving camera: the vehicle in view.
//!
//! The gradient of a pixel that shows the vehicle keeps its direction in all images; gradients of the scene have any
//! direction.

use std::collections::BTreeMap;

use super::survey::Survey;
use super::{Area, Findings, ImageRotation, ProposedMask, Severity};
use crate::geometry::planar_length;
use crate::sensors::{GrayImage, ImageMask, Rig};

/// Images are averaged down to this width or less.
const LARGEST_WIDTH: usize = 640;
/// Side of the classified blocks, in pixels of the averaged images.
const BLOCK: usize = 8;
/// Mean gradient of a block with texture, in grey levels per pixel; compression and noise stay below.
const MIN_GRADIENT: f32 = 2.0;
/// Ratio of the norm of the summed gradients to the sum of their norms above which a block is static. Moving scenes
/// have about the inverse square root of the number of images.
const STILL_COHERENCE: f32 = 0.6;
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

/// Sums of the gradients of all sampled images of a camera.
#[derive(Clone, Debug, Default)]
pub(super) struct GradientSums {
    size_px: [usize; 2],
    width: usize,
    height: usize,
    /// Side of the square of pixels that is averaged.
    scale: usize,
    images: usize,
    /// Sum of the gradients along columns and rows, and of their norms.
    sums: Vec<[f32; 3]>,
}

impl GradientSums {
    /// Adds an image; an image whose size differs from the first one is ignored.
    pub(super) fn add(&mut self, image: &GrayImage) {
        if self.images == 0 {
            self.size_px = [image.width, image.height];
            self.scale = image.width.div_ceil(LARGEST_WIDTH).max(1);
            (self.width, self.height) = (image.width / self.scale, image.height / self.scale);
            self.sums = vec![[0.0; 3]; self.width * self.height];
        }
        if self.size_px != [image.width, image.height] {
            return;
        }
        self.images += 1;
        let small = self.averaged(image);
        let width = self.width;
        for row in 1..self.height.saturating_sub(1) {
            let line = |row: usize| &small[row * width..(row + 1) * width];
            let (above, here, below) = (line(row - 1), line(row), line(row + 1));
            let sums = &mut self.sums[row * width..(row + 1) * width];
            for column in 1..width.saturating_sub(1) {
                let along = 0.5 * (here[column + 1] - here[column - 1]);
                let down = 0.5 * (below[column] - above[column]);
                let sum = &mut sums[column];
                *sum = [sum[0] + along, sum[1] + down, sum[2] + planar_length([along, down])];
            }
        }
    }

    fn averaged(&self, image: &GrayImage) -> Vec<f32> {
        let scale = self.scale;
        let mut averaged = Vec::with_capacity(self.width * self.height);
        let mut sums = vec![0_u32; self.width];
        for rows in image.pixels.chunks_exact((scale * image.width).max(1)) {
            sums.fill(0);
            for row in rows.chunks_exact(image.width) {
                for (sum, pixels) in sums.iter_mut().zip(row.chunks_exact(scale)) {
                    *sum += pixels.iter().map(|pixel| u32::from(*pixel)).sum::<u32>();
                }
            }
            averaged.extend(sums.iter().map(|sum| *sum as f32 / (scale * scale) as f32));
        }
        averaged
    }

    fn blocks(&self) -> [usize; 2] {
        [self.width / BLOCK, self.height / BLOCK]
    }

    /// True for each static block, row by row; `None` for a block without texture.
    fn judge(&self) -> Vec<Option<bool>> {
        let [columns, rows] = self.blocks();
        let block = |index: usize| {
            let (left, top) = (BLOCK * (index % columns), BLOCK * (index / columns));
            let row = |row: usize| &self.sums[row * self.width + left..][..BLOCK];
            let (mut summed, mut norms) = (0.0_f32, 0.0_f32);
            for [along, down, norm] in (top..top + BLOCK).flat_map(row) {
                summed += planar_length([*along, *down]);
                norms += norm;
            }
            let textured = norms > MIN_GRADIENT * (self.images * BLOCK * BLOCK) as f32;
            textured.then_some(summed > STILL_COHERENCE * norms)
        };
        (0..columns * rows).map(block).collect()
    }

    /// Mask of the pixels of some blocks and of the blocks around them.
    fn mask(&self, blocks: &[bool]) -> ImageMask {
        let [columns, rows] = self.blocks();
        let near = |column: usize, row: usize| {
            let around = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
            around(row, rows).any(|row| around(column, columns).any(|column| blocks[row * columns + column]))
        };
        let [width, height] = self.size_px;
        let side = BLOCK * self.scale;
        let pixel = |index: usize| {
            // Pixels beyond the last block belong to it.
            let (column, row) = ((index % width / side).min(columns - 1), (index / width / side).min(rows - 1));
            if near(column, row) { u8::MAX } else { 0 }
        };
        ImageMask::from_image(&GrayImage { width, height, pixels: (0..width * height).map(pixel).collect() })
    }

    /// True if a mask covers most of a block.
    fn is_covered(&self, mask: &ImageMask, block: usize) -> bool {
        let side = BLOCK * self.scale;
        let [columns, _] = self.blocks();
        let (left, top) = (side * (block % columns), side * (block / columns));
        let masked = (top..top + side).flat_map(|row| (left..left + side).map(move |column| (column, row)));
        2 * masked.filter(|(column, row)| mask.is_masked(*column, *row)).count() > side * side
    }
}

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
pub(super) fn check_still_pixels(
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
