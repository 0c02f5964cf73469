//! Bundle adjustment: observations of both cameras, IMU samples between frame sets, encoder readings and priors.
//!
//! Cost: `Σ ρ(|π(T_WC⁻¹ X) − z|²/σ²) + Σ |r_IMU|² + Σ (q + q̇ s − reading)²/σ_q² + |r_start|² + |W (x ⊟ x₀)|²` over
//! observations, intervals, joints, the first frame set and the border `x`; `s` is the gimbal camera's time offset.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Vector3, Vector6};

use super::arrow::ArrowMatrix;
use super::border_prior::{BorderPriorFactor, BorderTerm};
use super::frame_sets::FrameSet;
use super::pairs::{ViewPair, ViewRows, add_pairs};
use super::state::{BundleEstimate, Camera, Columns, ViewId, ViewMap};
use super::visual::{self, BundleTrack, PixelModel, ReducedVisualEquations, VisualEquations};
use crate::estimator::factors::costs::Costs;
use crate::estimator::factors::encoder::EncoderFactor;
use crate::estimator::factors::factor::{NavigationColumns, Sink, WhitenedRows};
use crate::estimator::factors::imu::ImuFactor;
use crate::estimator::factors::kind::FactorLabel;
use crate::estimator::factors::start_prior::{StartPrior, StartPriorFactor};
use crate::optimization::CameraPose;

#[derive(Clone, Debug)]
pub(super) struct Priors {
    /// Prior on extrinsics, time offsets and chain.
    pub(super) border: BorderTerm,
    /// Prior on the first frame set, which fixes the gauge, and on its biases.
    pub(super) start: StartPrior,
}

#[derive(Clone, Debug)]
pub(super) struct Bundle<'a> {
    pub(super) columns: Columns,
    pub(super) frame_sets: &'a [FrameSet],
    pub(super) gravity_in_world: Vector3<f64>,
    pub(super) priors: &'a Priors,
    pub(super) pixels: PixelModel<'a>,
    pub(super) tracks: &'a [BundleTrack],
}

/// Normal equations; the equations of the visual factors are kept over the view poses.
pub(super) struct BundleEquations {
    visual: VisualEquations,
    maps: BTreeMap<ViewId, ViewMap>,
    /// Rows of all other factors; columns of the band, then of the border.
    others: StoredRows,
}

impl Bundle<'_> {
    /// Views with at least one observation.
    fn views(&self) -> Vec<ViewId> {
        let mut views: Vec<ViewId> = self
            .tracks
            .iter()
            .flat_map(|track| track.observations.iter().map(|observation| observation.view))
            .collect();
        views.sort_unstable();
        views.dedup();
        views
    }

    /// Poses `world_from_camera` of all views with an observation.
    pub(super) fn poses(&self, estimate: &BundleEstimate) -> BTreeMap<ViewId, CameraPose> {
        let pose = |view: ViewId| (view, estimate.view(view, self.frame_sets, &self.gravity_in_world));
        self.views().into_iter().map(pose).collect()
    }

    /// Twice the cost: sum of the robust squared whitened residuals.
    pub(super) fn cost(&self, estimate: &BundleEstimate) -> f64 {
        let mut costs = Costs::default();
        self.factors(estimate, &mut costs);
        self.pixels.cost(&self.poses(estimate), self.tracks, &estimate.landmarks) + 2.0 * costs.total()
    }

    /// Passes all factors but the reprojections to a sink; the columns of the band come first, then the columns of the
    /// border.
    fn factors(&self, estimate: &BundleEstimate, sink: &mut impl Sink) {
        for frame_set in 1..self.frame_sets.len() {
            sink.take(self.imu_factor(frame_set, estimate));
        }
        for frame_set in 0..self.frame_sets.len() {
            sink.take(self.encoder_factor(frame_set, estimate));
        }
        let state = &estimate.navigation[0];
        sink.take(Some(StartPriorFactor { prior: &self.priors.start, state, columns: self.navigation_columns(0) }));
        sink.take(Some(self.border_prior(estimate)));
    }

    /// IMU factor that ends at a frame set, `None` without samples.
    fn imu_factor<'s>(&'s self, frame_set: usize, estimate: &'s BundleEstimate) -> Option<ImuFactor<'s>> {
        let (motion, information) = self.frame_sets[frame_set].motion.as_ref()?;
        let states = [&estimate.navigation[frame_set - 1], &estimate.navigation[frame_set]];
        Some(ImuFactor {
            slot: frame_set,
            motion,
            information,
            gravity_in_world: &self.gravity_in_world,
            current: states,
            linearized: states,
            columns: [frame_set - 1, frame_set].map(|frame_set| self.navigation_columns(frame_set)),
            intrinsics: None,
        })
    }

    /// Encoder factor of a frame set: the reading at the gimbal camera's image moves with the camera's time offset.
    fn encoder_factor<'s>(&'s self, frame_set: usize, estimate: &'s BundleEstimate) -> Option<EncoderFactor<'s>> {
        let gimbal = self.frame_sets[frame_set].gimbal.as_ref()?;
        Some(EncoderFactor {
            slot: frame_set,
            reading: &gimbal.encoder,
            angles_rad: &estimate.joints_rad[frame_set],
            rates_rad_per_s: gimbal.reading_rate_rad_per_s.iter().map(|rate| -rate).collect(),
            shift_s: estimate.shifts_s[1],
            joints: frame_set * self.columns.block() + Columns::joint(0),
            clock: Some(self.columns.band() + self.columns.gimbal_shift()),
        })
    }

    fn border_prior<'s>(&'s self, estimate: &'s BundleEstimate) -> BorderPriorFactor<'s> {
        BorderPriorFactor { term: &self.priors.border, columns: self.columns, estimate }
    }

    /// Columns of a navigation state in the band.
    fn navigation_columns(&self, frame_set: usize) -> NavigationColumns {
        let start = frame_set * self.columns.block();
        let column = |entry: usize| start + self.columns.navigation(entry);
        NavigationColumns { pose: column(0), velocity: column(6), biases: column(9) }
    }

    /// Information matrix of the priors on the border (borders × borders).
    pub(super) fn border_prior_information(&self, estimate: &BundleEstimate) -> DMatrix<f64> {
        let (rows, _) = self.border_prior(estimate).jacobian_and_residual();
        rows.tr_mul(&rows)
    }

    pub(super) fn linearize(&self, estimate: &BundleEstimate) -> BundleEquations {
        let poses = self.poses(estimate);
        let map =
            |view: ViewId| (view, estimate.view_map(view, &self.columns, self.frame_sets, &self.gravity_in_world));
        let maps: BTreeMap<ViewId, ViewMap> = poses.keys().map(|view| map(*view)).collect();
        let mut others = StoredRows::default();
        self.factors(estimate, &mut others);
        BundleEquations {
            visual: visual::equations(&self.pixels, &poses, self.tracks, &estimate.landmarks),
            maps,
            others,
        }
    }

    /// Largest number of frame sets between two observations of one landmark, at least one for the IMU factors.
    fn reach(&self) -> usize {
        let span = |track: &BundleTrack| match (track.observations.first(), track.observations.last()) {
            (Some(first), Some(last)) => last.view.frame_set() - first.view.frame_set(),
            _ => 0,
        };
        self.tracks.iter().map(span).max().unwrap_or(0).max(1)
    }

    /// Reduced normal equations and their right side `−gradient`, split into band and border; reuses the `memory` of
    /// the previous equations.
    pub(super) fn assemble(
        &self,
        equations: &BundleEquations,
        reduced: &ReducedVisualEquations,
        memory: Vec<f64>,
    ) -> (ArrowMatrix, Vec<f64>, DVector<f64>) {
        let columns = &self.columns;
        let mut matrix =
            ArrowMatrix::zeros(columns.band(), (self.reach() + 1) * columns.block() - 1, columns.borders(), memory);
        let mut band = vec![0.0; columns.band()];
        let mut border = DVector::zeros(columns.borders());
        for rows in &equations.others.rows {
            let hessian = rows.jacobian.tr_mul(&rows.jacobian);
            let gradient = rows.jacobian.tr_mul(&rows.residual);
            for (a, row) in rows.columns.iter().enumerate() {
                match row.checked_sub(columns.band()) {
                    None => band[*row] -= gradient[a],
                    Some(row) => border[row] -= gradient[a],
                }
                for (b, column) in rows.columns.iter().enumerate() {
                    let entry = hessian[(a, b)];
                    match (row.checked_sub(columns.band()), column.checked_sub(columns.band())) {
                        (None, None) => matrix.add(*row, *column, entry),
                        (Some(row), None) => matrix.add_border(row, *column, entry),
                        (Some(row), Some(column)) => matrix.corner_mut()[(row, column)] += entry,
                        (None, Some(_)) => {}
                    }
                }
            }
        }
        for (view, gradient) in reduced.poses.gradients() {
            let map = &equations.maps[&view];
            let start = view.frame_set() * columns.block();
            for (offset, value) in map.own.tr_mul(gradient).iter().enumerate() {
                band[start + offset] -= value;
            }
            border -= map.shared.tr_mul(gradient);
        }
        let starts = |view: ViewId| view.frame_set() * columns.block();
        let carried: BTreeMap<ViewId, ViewRows<'_>> =
            equations.maps.iter().map(|(view, map)| (*view, ViewRows::new(map, starts(*view)))).collect();
        let pairs: Vec<ViewPair<'_>> = reduced
            .poses
            .blocks()
            .map(|(first, second, block)| ViewPair { first: &carried[&first], second: &carried[&second], block })
            .collect();
        add_pairs(&mut matrix, &pairs);
        (matrix, band, border)
    }

    /// Steps `[φ; δt]` of the view poses for a step of the unknowns.
    pub(super) fn view_steps(
        &self,
        equations: &BundleEquations,
        band: &[f64],
        border: &DVector<f64>,
    ) -> BTreeMap<ViewId, Vector6<f64>> {
        let own = self.columns.own();
        let step = |(view, map): (&ViewId, &ViewMap)| {
            let start = view.frame_set() * self.columns.block();
            let moved = &map.own * DVector::from_column_slice(&band[start..start + own]) + &map.shared * border;
            (*view, Vector6::from_column_slice(moved.as_slice()))
        };
        equations.maps.iter().map(step).collect()
    }
}

/// Rows of factors, kept for several assemblies.
#[derive(Default)]
struct StoredRows {
    rows: Vec<StoredFactor>,
}

struct StoredFactor {
    /// Column of the bundle for each column of the Jacobian.
    columns: Vec<usize>,
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
}

impl Sink for StoredRows {
    const DERIVATIVES: bool = true;

    fn add(&mut self, _label: FactorLabel, rows: &WhitenedRows<'_>) {
        let height = rows.residual.len();
        let columns: Vec<usize> = rows.columns().collect();
        let entries = rows.blocks.iter().flat_map(|block| block.entries.iter().copied());
        let jacobian = DMatrix::from_iterator(height, columns.len(), entries);
        self.rows.push(StoredFactor { columns, jacobian, residual: DVector::from_column_slice(rows.residual) });
    }
}

impl BundleEquations {
    /// Normal equations of the visual factors over the view poses.
    pub(super) fn visual(&self) -> &VisualEquations {
        &self.visual
    }
}

/// View of the gimbal camera in a frame set.
pub(super) fn gimbal_view(frame_set: usize) -> ViewId {
    ViewId::new(frame_set, Camera::Gimbal)
}
