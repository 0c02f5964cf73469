//! Corner detection: Shi and Tomasi's smaller eigenvalue, distributed over the image.

use nalgebra::Vector2;

use super::responses::{Peak, Responses, TILE};
use crate::sensors::{GrayImage, ImageMask};

/// Options of corner detection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerOptions {
    /// Maximum number of features in an image, tracked and new.
    pub max_features: usize,
    /// Minimum distance of a new feature from all others, in pixels.
    pub min_distance_px: f64,
    /// Minimum distance from the image border, in pixels.
    pub border_px: usize,
    /// Smallest accepted smaller eigenvalue of the mean structure tensor, in (grey levels/px)².
    pub min_eigenvalue: f64,
}

impl Default for CornerOptions {
    fn default() -> Self {
        Self { max_features: 150, min_distance_px: 25.0, border_px: 8, min_eigenvalue: 2.0 }
    }
}

/// Maximum number of corners from one tile.
const CORNERS_PER_TILE: usize = 3;

/// A candidate for a new feature.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    uv_px: Vector2<f64>,
    response: f32,
}

/// Square of the image that is searched separately, smaller at the image border.
#[derive(Clone, Copy, Debug)]
struct Tile {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

/// Corner detector; its buffers are reused from image to image.
#[derive(Clone, Debug, Default)]
pub struct CornerDetector {
    candidates: Vec<Candidate>,
    in_tile: Vec<Peak>,
    responses: Responses,
    /// Tiles that have not been searched yet.
    tiles: Vec<Tile>,
    taken: PointGrid,
    /// Number of features in each cell of the image.
    crowd: Vec<usize>,
}

impl CornerDetector {
    /// Adds corners of `image` to `found` until there are `max_features` together with the `existing` ones (all in
    /// pixels).
    ///
    /// Masked pixels contain no corners. The image is divided into about `max_features` cells. First every cell without
    /// a feature gets its best corner, even if it is weaker than corners of other cells, then every cell with one
    /// feature gets a second, and so on.
    pub fn detect(
        &mut self,
        image: &GrayImage,
        existing: impl Iterator<Item = Vector2<f64>>,
        options: &CornerOptions,
        mask: Option<&ImageMask>,
        found: &mut Vec<Vector2<f64>>,
    ) {
        found.clear();
        self.taken.reset(image.width, image.height, options.min_distance_px);
        let cells = Cells::new(image, options.max_features);
        self.crowd.clear();
        self.crowd.resize(cells.columns * cells.rows, 0);
        let mut count = 0;
        for uv in existing {
            self.taken.insert(uv);
            self.crowd[cells.index(&uv)] += 1;
            count += 1;
        }
        if count >= options.max_features {
            return;
        }
        self.candidates.clear();
        self.tiles.clear();
        self.tiles.extend(tiles_of(image, options.border_px));
        let mut crowd = std::mem::take(&mut self.crowd);
        let mut round = 0;
        while count < options.max_features {
            // The first round fills empty cells and needs no corners of other cells; usually it is the only round.
            self.collect(image, options, mask, |tile| round > 0 || cells.about(tile).any(|cell| crowd[cell] == 0));
            if self.candidates.is_empty() && self.tiles.is_empty() {
                break;
            }
            let taken = &mut self.taken;
            self.candidates.retain(|candidate| {
                if !taken.is_free(&candidate.uv_px) {
                    return false;
                }
                let crowd = &mut crowd[cells.index(&candidate.uv_px)];
                if *crowd > round || count >= options.max_features {
                    return true;
                }
                *crowd += 1;
                count += 1;
                taken.insert(candidate.uv_px);
                found.push(candidate.uv_px);
                false
            });
            round += 1;
        }
        self.crowd = crowd;
    }

    /// Collects the best corners of the `wanted` tiles that are neither searched yet nor covered by features.
    fn collect(
        &mut self,
        image: &GrayImage,
        options: &CornerOptions,
        mask: Option<&ImageMask>,
        wanted: impl Fn(&Tile) -> bool,
    ) {
        let mut tiles = std::mem::take(&mut self.tiles);
        let before = self.candidates.len();
        tiles.retain(|tile| {
            let searched = wanted(tile);
            if searched && !self.is_covered(tile) {
                self.search(image, tile, options, mask);
            }
            !searched
        });
        self.tiles = tiles;
        if self.candidates.len() > before {
            self.candidates.sort_by(|a, b| b.response.total_cmp(&a.response).then(a.place().cmp(&b.place())));
        }
    }

    /// Adds the best corners of a tile to the candidates.
    fn search(&mut self, image: &GrayImage, tile: &Tile, options: &CornerOptions, mask: Option<&ImageMask>) {
        self.responses.compute(image, [tile.left, tile.top], options.min_eigenvalue as f32);
        self.in_tile.clear();
        self.in_tile.extend(self.responses.peaks(tile.width, tile.height));
        self.in_tile.sort_by(|a, b| b.response.total_cmp(&a.response));
        let first = self.candidates.len();
        for peak in &self.in_tile {
            if self.candidates.len() == first + CORNERS_PER_TILE {
                break;
            }
            let [x, y] = peak.pixel;
            let uv_px = Vector2::new((tile.left + x) as f64, (tile.top + y) as f64) + self.responses.peak_shift(peak);
            let is_apart = |other: &Candidate| (other.uv_px - uv_px).norm() >= options.min_distance_px;
            let usable = self.candidates[first..].iter().all(is_apart)
                && self.taken.is_free(&uv_px)
                && !mask.is_some_and(|mask| mask.covers(&uv_px));
            if usable {
                self.candidates.push(Candidate { uv_px, response: peak.response });
            }
        }
    }

    /// True if a coarse test finds no position in a tile that is far enough from the features.
    fn is_covered(&self, tile: &Tile) -> bool {
        const LOOK: usize = 4;
        (0..=LOOK).all(|j| {
            (0..=LOOK).all(|i| {
                let x = tile.left as f64 + (tile.width - 1) as f64 * i as f64 / LOOK as f64;
                let y = tile.top as f64 + (tile.height - 1) as f64 * j as f64 / LOOK as f64;
                !self.taken.is_free(&Vector2::new(x, y))
            })
        })
    }
}

impl Candidate {
    /// Pixel, row first: order of candidates with equal responses.
    fn place(&self) -> (usize, usize) {
        (self.uv_px.y.round() as usize, self.uv_px.x.round() as usize)
    }
}

fn tiles_of(image: &GrayImage, border_px: usize) -> impl Iterator<Item = Tile> {
    let (right, bottom) = (image.width.saturating_sub(border_px), image.height.saturating_sub(border_px));
    (border_px..bottom).step_by(TILE).flat_map(move |top| {
        (border_px..right).step_by(TILE).map(move |left| Tile {
            left,
            top,
            width: TILE.min(right - left),
            height: TILE.min(bottom - top),
        })
    })
}

/// Division of an image into about `count` cells.
#[derive(Clone, Copy)]
struct Cells {
    side_px: f64,
    columns: usize,
    rows: usize,
}

impl Cells {
    fn new(image: &GrayImage, count: usize) -> Self {
        let side_px = ((image.width * image.height) as f64 / count.max(1) as f64).sqrt().max(1.0);
        let along = |length: usize| ((length as f64 / side_px).ceil() as usize).max(1);
        Self { side_px, columns: along(image.width), rows: along(image.height) }
    }

    fn index(&self, uv_px: &Vector2<f64>) -> usize {
        let column = ((uv_px.x / self.side_px) as usize).min(self.columns - 1);
        let row = ((uv_px.y / self.side_px) as usize).min(self.rows - 1);
        row * self.columns + column
    }

    /// Cells that may contain a corner of a tile.
    fn about(&self, tile: &Tile) -> impl Iterator<Item = usize> {
        // A corner may be half a pixel away from its pixel.
        let range = |first: usize, length: usize, count: usize| {
            let at = |pixel: usize| ((pixel as f64 / self.side_px) as usize).min(count - 1);
            at(first.saturating_sub(1))..at(first + length) + 1
        };
        let columns = range(tile.left, tile.width, self.columns);
        let width = self.columns;
        range(tile.top, tile.height, self.rows)
            .flat_map(move |row| columns.clone().map(move |column| row * width + column))
    }
}

/// Points in squares of the minimum distance's side, so that a distance test visits only nine squares.
#[derive(Clone, Debug, Default)]
pub(super) struct PointGrid {
    distance_px: f64,
    columns: usize,
    squares: Vec<Vec<Vector2<f64>>>,
}

impl PointGrid {
    pub(super) fn reset(&mut self, width: usize, height: usize, distance_px: f64) {
        self.distance_px = distance_px.max(1.0);
        self.columns = (width as f64 / self.distance_px) as usize + 3;
        let rows = (height as f64 / self.distance_px) as usize + 3;
        self.squares.iter_mut().for_each(Vec::clear);
        self.squares.resize(self.columns * rows, Vec::new());
    }

    /// Column and row of a point's square; a border of one square gives every square eight neighbours.
    fn square(&self, uv_px: &Vector2<f64>) -> (usize, usize) {
        let last_row = self.squares.len() / self.columns - 2;
        let column = (uv_px.x / self.distance_px) as usize + 1;
        let row = (uv_px.y / self.distance_px) as usize + 1;
        (column.min(self.columns - 2), row.min(last_row))
    }

    pub(super) fn insert(&mut self, uv_px: Vector2<f64>) {
        let (column, row) = self.square(&uv_px);
        self.squares[row * self.columns + column].push(uv_px);
    }

    /// True if no point is nearer than the minimum distance.
    pub(super) fn is_free(&self, uv_px: &Vector2<f64>) -> bool {
        let (column, row) = self.square(uv_px);
        (row - 1..=row + 1).all(|row| {
            self.squares[row * self.columns + column - 1..=row * self.columns + column + 1]
                .iter()
                .flatten()
                .all(|other| (other - uv_px).norm_squared() >= self.distance_px * self.distance_px)
        })
    }
}
