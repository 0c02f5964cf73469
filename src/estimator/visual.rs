//! All reprojection factors of a window, linearized by camera poses, with the landmarks eliminated.
//!
//! Six columns per frame hold whatever the camera sees, however many joints and parameters move it: the Schur
//! complement of the landmarks is formed there and only its result is carried on to the states.

use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix2x6, Matrix3, Matrix6, Matrix6x3, Vector2, Vector3, Vector6};

use super::dense;
use super::options::{EstimatorOptions, LandmarkModel, RobustLoss};
use super::reprojection::{self, CameraPose, Landmark, RelativePose, Reprojection};
use crate::camera::CameraModel;

/// Squared whitened residual that an observation counts for when its landmark cannot be projected.
const UNSEEN_SQUARED: f64 = 1e4;

/// One measurement of a feature: the slot of the frame and the pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sighting {
    /// Slot of the frame in the window.
    pub(super) slot: usize,
    /// Measured pixel.
    pub(super) uv_px: Vector2<f64>,
}

/// The observations of one feature that takes part, its anchor's first.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    /// In the order of the slots.
    pub(super) sightings: Vec<Sighting>,
}

/// How pixels are weighed.
#[derive(Clone, Copy, Debug)]
pub(super) struct VisualModel<'a> {
    pub(super) camera: &'a CameraModel,
    pub(super) sigma_px: f64,
    pub(super) loss: RobustLoss,
    pub(super) landmark_model: LandmarkModel,
}

impl<'a> VisualModel<'a> {
    pub(super) fn new(camera: &'a CameraModel, options: &EstimatorOptions) -> Self {
        Self { camera, sigma_px: options.pixel_sigma_px, loss: options.loss, landmark_model: options.landmark_model }
    }

    /// Whether the anchor's own measurement is a residual.
    fn measures_in_anchor(&self) -> bool {
        self.landmark_model == LandmarkModel::BearingAndInverseDistance
    }
}

/// Relative poses of every pair of frames, `[anchor][observer]`.
#[derive(Clone, Debug)]
pub(super) struct RelativePoses {
    frames: usize,
    pairs: Vec<RelativePose>,
}

impl RelativePoses {
    pub(super) fn new(cameras: &[CameraPose]) -> Self {
        let pairs = cameras
            .iter()
            .flat_map(|anchor| cameras.iter().map(move |observer| RelativePose::new(anchor, observer)))
            .collect();
        Self { frames: cameras.len(), pairs }
    }

    pub(super) fn get(&self, anchor: usize, observer: usize) -> &RelativePose {
        &self.pairs[anchor * self.frames + observer]
    }
}

/// Pixel residual of one sighting, `None` when the landmark cannot be seen there.
pub(super) fn sighting_residual_px(
    model: &VisualModel<'_>,
    relative: &RelativePoses,
    anchor: usize,
    landmark: &Landmark,
    sighting: &Sighting,
) -> Option<Vector2<f64>> {
    reprojection::residual_px(model.camera, relative.get(anchor, sighting.slot), landmark, &sighting.uv_px)
}

/// Robust cost (half the sum of losses) of all reprojection factors.
pub(super) fn cost(model: &VisualModel<'_>, cameras: &[CameraPose], tracks: &[Track], landmarks: &[Landmark]) -> f64 {
    let relative = RelativePoses::new(cameras);
    let mut total = 0.0;
    for (track, landmark) in tracks.iter().zip(landmarks) {
        let Some(anchor) = track.sightings.first().map(|first| first.slot) else { continue };
        for sighting in &track.sightings {
            if sighting.slot == anchor && !model.measures_in_anchor() {
                continue;
            }
            let squared = sighting_residual_px(model, &relative, anchor, landmark, sighting)
                .map_or(UNSEEN_SQUARED, |residual| residual.norm_squared() / (model.sigma_px * model.sigma_px));
            total += 0.5 * model.loss.cost_and_weight(squared).0;
        }
    }
    total
}

/// One landmark's part of the normal equations.
#[derive(Clone, Debug)]
struct LandmarkBlock {
    hessian: Matrix3<f64>,
    gradient: Vector3<f64>,
    /// By slot: coupling of the camera pose with the landmark.
    couplings: Vec<(usize, Matrix6x3<f64>)>,
}

/// Normal equations of the reprojection factors: camera poses on one side, landmarks on the other.
#[derive(Clone, Debug)]
pub(super) struct VisualSystem {
    frames: usize,
    /// Upper blocks of the camera poses, row-wise: `(0,0) (0,1) … (1,1) …`.
    hessian: Vec<Matrix6<f64>>,
    gradient: Vec<Vector6<f64>>,
    landmarks: Vec<LandmarkBlock>,
}

/// The camera side after the landmarks were eliminated.
#[derive(Clone, Debug)]
pub(super) struct ReducedVisualSystem {
    frames: usize,
    hessian: Vec<Matrix6<f64>>,
    gradient: Vec<Vector6<f64>>,
    /// For the way back: inverse of each damped landmark block.
    inverses: Vec<Matrix3<f64>>,
}

fn pair_index(frames: usize, row: usize, column: usize) -> usize {
    debug_assert!(row <= column && column < frames, "upper blocks only");
    row * (2 * frames + 1 - row) / 2 + column - row
}

impl VisualSystem {
    /// Linearizes at `current`, with the derivatives by poses taken at `linearized`.
    pub(super) fn new(
        model: &VisualModel<'_>,
        current: &[CameraPose],
        linearized: &[CameraPose],
        tracks: &[Track],
        landmarks: &[Landmark],
    ) -> Self {
        let frames = current.len();
        let relative = RelativePoses::new(current);
        let relative_linearized = RelativePoses::new(linearized);
        let mut system = Self {
            frames,
            hessian: vec![Matrix6::zeros(); frames * (frames + 1) / 2],
            gradient: vec![Vector6::zeros(); frames],
            landmarks: Vec::with_capacity(tracks.len()),
        };
        for (track, landmark) in tracks.iter().zip(landmarks) {
            let block = system.add_track(model, &relative, &relative_linearized, track, landmark);
            system.landmarks.push(block);
        }
        system
    }

    fn add_track(
        &mut self,
        model: &VisualModel<'_>,
        relative: &RelativePoses,
        linearized: &RelativePoses,
        track: &Track,
        landmark: &Landmark,
    ) -> LandmarkBlock {
        let mut block = LandmarkBlock { hessian: Matrix3::zeros(), gradient: Vector3::zeros(), couplings: Vec::new() };
        let Some(anchor) = track.sightings.first().map(|first| first.slot) else { return block };
        block.couplings.reserve_exact(track.sightings.len());
        let mut anchor_hessian = Matrix6::zeros();
        let mut anchor_gradient = Vector6::zeros();
        let mut anchor_coupling = Matrix6x3::zeros();
        for sighting in &track.sightings {
            let Some(term) = whitened(model, relative, linearized, anchor, landmark, sighting) else { continue };
            block.hessian += term.by_landmark.tr_mul(&term.by_landmark);
            block.gradient += term.by_landmark.tr_mul(&term.residual_px);
            if sighting.slot == anchor {
                continue;
            }
            let index = pair_index(self.frames, sighting.slot, sighting.slot);
            self.hessian[index] += term.by_observer.tr_mul(&term.by_observer);
            self.gradient[sighting.slot] += term.by_observer.tr_mul(&term.residual_px);
            block.couplings.push((sighting.slot, term.by_observer.tr_mul(&term.by_landmark)));
            anchor_hessian += term.by_anchor.tr_mul(&term.by_anchor);
            anchor_gradient += term.by_anchor.tr_mul(&term.residual_px);
            anchor_coupling += term.by_anchor.tr_mul(&term.by_landmark);
            // Sightings come in the order of the slots and the anchor is the first of them.
            let index = pair_index(self.frames, anchor, sighting.slot);
            self.hessian[index] += term.by_anchor.tr_mul(&term.by_observer);
        }
        let index = pair_index(self.frames, anchor, anchor);
        self.hessian[index] += anchor_hessian;
        self.gradient[anchor] += anchor_gradient;
        block.couplings.insert(0, (anchor, anchor_coupling));
        block
    }

    /// Eliminates the landmarks, their diagonal raised by the factor `1 + damping`.
    pub(super) fn eliminate(&self, damping: f64) -> ReducedVisualSystem {
        let mut reduced = ReducedVisualSystem {
            frames: self.frames,
            hessian: self.hessian.clone(),
            gradient: self.gradient.clone(),
            inverses: Vec::with_capacity(self.landmarks.len()),
        };
        let mut weighted: Vec<Matrix6x3<f64>> = Vec::new();
        for block in &self.landmarks {
            let inverse = damped_inverse(&block.hessian, damping);
            weighted.clear();
            weighted.extend(block.couplings.iter().map(|(_, coupling)| coupling * inverse));
            for (first, (row, _)) in block.couplings.iter().enumerate() {
                reduced.gradient[*row] -= weighted[first] * block.gradient;
                for (column, coupling) in &block.couplings[first..] {
                    let index = pair_index(self.frames, *row, *column);
                    reduced.hessian[index] -= weighted[first] * coupling.transpose();
                }
            }
            reduced.inverses.push(inverse);
        }
        reduced
    }

    /// Steps of the landmarks that belong to steps of the camera poses.
    pub(super) fn substitute(&self, reduced: &ReducedVisualSystem, camera_steps: &[Vector6<f64>]) -> Vec<Vector3<f64>> {
        self.landmarks
            .iter()
            .zip(&reduced.inverses)
            .map(|(block, inverse)| {
                let mut right = -block.gradient;
                for (slot, coupling) in &block.couplings {
                    right -= coupling.tr_mul(&camera_steps[*slot]);
                }
                inverse * right
            })
            .collect()
    }

    /// Sum of squares of the columns of all camera poses before the elimination, mapped by `columns`
    /// (per slot 6 × n): the squared norms of the `n` columns that move the cameras through them.
    pub(super) fn squared_column_norms(&self, columns: &[DMatrix<f64>]) -> DVector<f64> {
        let count = columns.first().map_or(0, DMatrix::ncols);
        let mut norms = DVector::zeros(count);
        for row in 0..self.frames {
            for column in row..self.frames {
                let block = &self.hessian[pair_index(self.frames, row, column)];
                let factor = if row == column { 1.0 } else { 2.0 };
                for k in 0..count {
                    let right = block * columns[column].fixed_view::<6, 1>(0, k);
                    norms[k] += factor * columns[row].fixed_view::<6, 1>(0, k).dot(&right);
                }
            }
        }
        norms
    }
}

/// The inverse of a landmark's block with its diagonal raised; directions without information get no step.
fn damped_inverse(hessian: &Matrix3<f64>, damping: f64) -> Matrix3<f64> {
    let mut damped = *hessian;
    let floor = 1e-9 * hessian.trace().max(1e-6);
    for axis in 0..3 {
        damped[(axis, axis)] += damping * hessian[(axis, axis)] + floor;
    }
    damped.cholesky().map_or_else(Matrix3::zeros, |factor| factor.inverse())
}

impl ReducedVisualSystem {
    /// The block of two camera poses, `row ≤ column`.
    pub(super) fn block(&self, row: usize, column: usize) -> &Matrix6<f64> {
        &self.hessian[pair_index(self.frames, row, column)]
    }

    /// The gradient by one camera pose.
    pub(super) fn gradient(&self, slot: usize) -> &Vector6<f64> {
        &self.gradient[slot]
    }
}

/// One sighting linearized, divided by sigma and by the root of its robust weight.
fn whitened(
    model: &VisualModel<'_>,
    relative: &RelativePoses,
    linearized: &RelativePoses,
    anchor: usize,
    landmark: &Landmark,
    sighting: &Sighting,
) -> Option<Reprojection> {
    let term = if sighting.slot == anchor {
        if !model.measures_in_anchor() {
            return None;
        }
        reprojection::linearize_in_anchor(model.camera, landmark, &sighting.uv_px)?
    } else {
        reprojection::linearize(
            model.camera,
            relative.get(anchor, sighting.slot),
            linearized.get(anchor, sighting.slot),
            landmark,
            &sighting.uv_px,
        )?
    };
    let squared = term.residual_px.norm_squared() / (model.sigma_px * model.sigma_px);
    let scale = model.loss.cost_and_weight(squared).1.sqrt() / model.sigma_px;
    let mut by_landmark: Matrix2x3<f64> = term.by_landmark * scale;
    if !model.measures_in_anchor() {
        by_landmark.fixed_view_mut::<2, 2>(0, 0).fill(0.0);
    }
    let by_anchor: Matrix2x6<f64> = term.by_anchor * scale;
    let by_observer: Matrix2x6<f64> = term.by_observer * scale;
    Some(Reprojection { residual_px: term.residual_px * scale, by_anchor, by_observer, by_landmark })
}

/// The reprojection factors as whitened rows `[camera poses 6·frames | residual]` with every landmark projected out
/// orthogonally (its own rows turned so that it shows in the first few, which are dropped), compressed to at most
/// `6·frames + 1` rows by a further rotation. No normal equations are formed.
pub(super) fn projected_rows(
    model: &VisualModel<'_>,
    current: &[CameraPose],
    linearized: &[CameraPose],
    tracks: &[Track],
    landmarks: &[Landmark],
) -> DMatrix<f64> {
    let columns = 6 * current.len() + 1;
    let relative = RelativePoses::new(current);
    let relative_linearized = RelativePoses::new(linearized);
    let mut stacked = RowStack::new(columns);
    for (track, landmark) in tracks.iter().zip(landmarks) {
        let Some(anchor) = track.sightings.first().map(|first| first.slot) else { continue };
        let terms: Vec<(usize, Reprojection)> = track
            .sightings
            .iter()
            .filter_map(|sighting| {
                let term = whitened(model, &relative, &relative_linearized, anchor, landmark, sighting)?;
                Some((sighting.slot, term))
            })
            .collect();
        let mut rows = DMatrix::zeros(2 * terms.len(), 3 + columns);
        for (index, (slot, term)) in terms.iter().enumerate() {
            let mut pair = rows.fixed_rows_mut::<2>(2 * index);
            pair.fixed_columns_mut::<3>(0).copy_from(&term.by_landmark);
            if *slot != anchor {
                pair.fixed_columns_mut::<6>(3 + 6 * anchor).copy_from(&term.by_anchor);
                pair.fixed_columns_mut::<6>(3 + 6 * slot).copy_from(&term.by_observer);
            }
            pair.fixed_columns_mut::<1>(2 + columns).copy_from(&term.residual_px);
        }
        let used = project_out_leading(&mut rows, 3);
        for row in used..rows.nrows() {
            stacked.push(rows.row(row).columns_range(3..).iter().copied());
        }
    }
    stacked.triangularized()
}

/// Householder reflections that clear the first `count` columns below as many rows (fewer for dependent columns);
/// returns how many rows those columns still fill.
fn project_out_leading(rows: &mut DMatrix<f64>, count: usize) -> usize {
    let (height, width) = rows.shape();
    let mut pivot = 0;
    for column in 0..count {
        if pivot >= height {
            break;
        }
        let scale = rows.column(column).norm();
        let tail = rows.view((pivot, column), (height - pivot, 1)).norm();
        if tail <= 1e-12 * scale.max(1e-300) {
            rows.view_mut((pivot, column), (height - pivot, 1)).fill(0.0);
            continue;
        }
        let head = rows[(pivot, column)];
        let target = if head > 0.0 { -tail } else { tail };
        let mut reflector: DVector<f64> = rows.view((pivot, column), (height - pivot, 1)).column(0).into_owned();
        reflector[0] -= target;
        let squared = reflector.norm_squared();
        for other in column..width {
            let mut part = rows.view_mut((pivot, other), (height - pivot, 1));
            let dot = part.column(0).dot(&reflector) * 2.0 / squared;
            if dot != 0.0 {
                part.column_mut(0).axpy(-dot, &reflector, 1.0);
            }
        }
        pivot += 1;
    }
    pivot
}

/// Rows collected one by one.
#[derive(Clone, Debug)]
pub(super) struct RowStack {
    columns: usize,
    entries: Vec<f64>,
}

impl RowStack {
    pub(super) fn new(columns: usize) -> Self {
        Self { columns, entries: Vec::new() }
    }

    pub(super) fn push(&mut self, row: impl Iterator<Item = f64>) {
        self.entries.extend(row);
    }

    /// The upper echelon factor of the stack.
    pub(super) fn triangularized(self) -> DMatrix<f64> {
        let rows = self.entries.len() / self.columns;
        dense::triangularize(&DMatrix::from_row_slice(rows, self.columns, &self.entries))
    }
}
