//! Bundle adjustment: observations of both cameras, IMU samples between frame sets, encoder readings and priors.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Vector3, Vector6};

use super::arrow::ArrowMatrix;
use super::chain_prior::ChainTerm;
use super::frame_sets::FrameSet;
use super::pairs::{ViewPair, ViewRows, add_pairs};
use super::state::{Camera, Columns, Estimate, ViewId, ViewMap};
use super::visual::{self, PixelModel, ReducedVisualEquations, Track, VisualEquations};
use crate::estimator::preintegration::Vector15;
use crate::estimator::{NavigationState, imu_factor};
use crate::geometry::{RigidTransform, so3, wrap_angle};
use crate::optimization::CameraPose;

/// Standard deviation of the first position in metres; only fixes the gauge.
const GAUGE_SIGMA_M: f64 = 1e-3;
/// Standard deviation of the first heading in radians; only fixes the gauge.
const GAUGE_SIGMA_RAD: f64 = 1e-4;

#[derive(Clone, Debug)]
pub(super) struct Priors {
    pub(super) chain: ChainTerm,
    /// Given `imu_from_camera` of the static camera.
    pub(super) extrinsics: RigidTransform,
    /// Standard deviations of the extrinsics per axis, in metres and radians.
    pub(super) extrinsics_sigmas: (f64, f64),
    pub(super) time_shift_sigma_s: f64,
    /// Standard deviations of the first biases about zero, in rad/s and m/s².
    pub(super) bias_sigmas: (f64, f64),
    /// State of the first frame set, which fixes the gauge.
    pub(super) first: NavigationState,
}

#[derive(Clone, Debug)]
pub(super) struct Bundle<'a> {
    pub(super) columns: Columns,
    pub(super) frame_sets: &'a [FrameSet],
    pub(super) gravity_in_world: Vector3<f64>,
    pub(super) priors: &'a Priors,
    pub(super) pixels: PixelModel<'a>,
    pub(super) tracks: &'a [Track],
}

/// Residual and derivatives of one encoder reading.
struct EncoderEquation {
    /// Column of the joint angle in the band.
    column: usize,
    information: f64,
    /// `q − reading` in radians; the reading is corrected by the gimbal camera's time offset.
    residual: f64,
    /// Rate of change of the reading, in rad/s.
    rate: f64,
}

/// Normal equations; those of the visual factors are kept over the view poses.
pub(super) struct BundleEquations {
    visual: VisualEquations,
    maps: BTreeMap<ViewId, ViewMap>,
    /// IMU rows of each pair of neighbouring frame sets: first column, whitened Jacobian, residual.
    imu: Vec<(usize, DMatrix<f64>, Vector15)>,
    encoders: Vec<EncoderEquation>,
    /// Jacobian and residual of the priors on the first frame set.
    first: (DMatrix<f64>, DVector<f64>),
    border_hessian: DMatrix<f64>,
    border_gradient: DVector<f64>,
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
    pub(super) fn poses(&self, estimate: &Estimate) -> BTreeMap<ViewId, CameraPose> {
        let pose = |view: ViewId| (view, estimate.view(view, self.frame_sets, &self.gravity_in_world));
        self.views().into_iter().map(pose).collect()
    }

    /// Twice the cost: sum of the robust squared whitened residuals.
    pub(super) fn cost(&self, estimate: &Estimate) -> f64 {
        let mut cost = self.pixels.cost(&self.poses(estimate), self.tracks, &estimate.landmarks);
        for frame_set in 1..self.frame_sets.len() {
            if let Some(residual) = self.imu_residual(frame_set, estimate) {
                cost += residual.norm_squared();
            }
        }
        for (_, information, residual) in self.encoder_terms(estimate) {
            cost += residual * residual * information;
        }
        cost += self.first_rows(estimate).1.norm_squared();
        cost + self.border_rows(estimate).1.norm_squared()
    }

    fn imu_residual(&self, frame_set: usize, estimate: &Estimate) -> Option<Vector15> {
        let (motion, information) = self.frame_sets[frame_set].motion.as_ref()?;
        let (from, to) = (&estimate.navigation[frame_set - 1], &estimate.navigation[frame_set]);
        Some(information * imu_factor::residual(motion, from, to, &self.gravity_in_world))
    }

    /// `((frame_set, joint), 1/σ², q − reading)` of every encoder reading, corrected by the gimbal camera's
    /// time offset.
    fn encoder_terms<'s>(&'s self, estimate: &'s Estimate) -> impl Iterator<Item = ((usize, usize), f64, f64)> + 's {
        let shift_s = estimate.shifts_s[1];
        self.frame_sets
            .iter()
            .enumerate()
            .filter_map(|(index, frame_set)| Some((index, frame_set.gimbal.as_ref()?)))
            .flat_map(move |(index, gimbal)| {
                let angles = &estimate.joints_rad[index];
                let encoder = &gimbal.encoder;
                let readings = encoder.angles_rad.iter().zip(&encoder.sigmas_rad).zip(&gimbal.reading_rate_rad_per_s);
                angles.iter().zip(readings).enumerate().map(move |(joint, (angle, ((reading, sigma), rate)))| {
                    ((index, joint), 1.0 / (sigma * sigma), wrap_angle(angle - reading - rate * shift_s))
                })
            })
    }

    /// Rows of the priors on the first frame set (Jacobian rows × 15, residual): position and heading of the gauge,
    /// biases.
    fn first_rows(&self, estimate: &Estimate) -> (DMatrix<f64>, DVector<f64>) {
        let (state, first) = (&estimate.navigation[0], &self.priors.first);
        let (gyroscope, accelerometer) = self.priors.bias_sigmas;
        let mut rows = DMatrix::zeros(10, 15);
        let mut residual = DVector::zeros(10);
        let rotation_error = so3::log(&(first.world_from_imu.rotation.inverse() * state.world_from_imu.rotation));
        // Vertical in the IMU frame of the first frame set.
        let vertical: Vector3<f64> = first.world_from_imu.rotation.inverse() * Vector3::z();
        let heading = vertical.transpose() * so3::right_jacobian_inverse(&rotation_error);
        rows.fixed_view_mut::<1, 3>(0, 0).copy_from(&(heading / GAUGE_SIGMA_RAD));
        residual[0] = vertical.dot(&rotation_error) / GAUGE_SIGMA_RAD;
        let shift = state.world_from_imu.translation_m - first.world_from_imu.translation_m;
        for axis in 0..3 {
            rows[(1 + axis, 3 + axis)] = 1.0 / GAUGE_SIGMA_M;
            residual[1 + axis] = shift[axis] / GAUGE_SIGMA_M;
            rows[(4 + axis, 9 + axis)] = 1.0 / gyroscope;
            residual[4 + axis] = state.bias.gyroscope_rad_per_s[axis] / gyroscope;
            rows[(7 + axis, 12 + axis)] = 1.0 / accelerometer;
            residual[7 + axis] = state.bias.accelerometer_m_per_s2[axis] / accelerometer;
        }
        (rows, residual)
    }

    /// Rows of the priors on the border (Jacobian rows × borders, whitened residual).
    fn border_rows(&self, estimate: &Estimate) -> (DMatrix<f64>, DVector<f64>) {
        let columns = &self.columns;
        let count = columns.borders();
        let (mut rows, mut residual) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let (translation_m, rotation_rad) = self.priors.extrinsics_sigmas;
        let change = estimate.extrinsics.minus(&self.priors.extrinsics);
        let rotation_error: Vector3<f64> = change.fixed_rows::<3>(0).into_owned();
        rows.fixed_view_mut::<3, 3>(0, 0).copy_from(&(so3::right_jacobian_inverse(&rotation_error) / rotation_rad));
        residual.fixed_rows_mut::<3>(0).copy_from(&(rotation_error / rotation_rad));
        for axis in 3..6 {
            rows[(axis, axis)] = 1.0 / translation_m;
            residual[axis] = change[axis] / translation_m;
        }
        for (column, shift_s) in
            [(Columns::STATIC_SHIFT, estimate.shifts_s[0]), (columns.gimbal_shift(), estimate.shifts_s[1])]
        {
            rows[(column, column)] = 1.0 / self.priors.time_shift_sigma_s;
            residual[column] = shift_s / self.priors.time_shift_sigma_s;
        }
        let chain = Columns::CHAIN..columns.gimbal_shift();
        rows.view_range_mut(chain.clone(), chain.clone()).copy_from(self.priors.chain.jacobian());
        residual.rows_range_mut(chain).copy_from(&self.priors.chain.residual(&estimate.chain));
        (rows, residual)
    }

    /// Information matrix of the priors on the border (borders × borders).
    pub(super) fn border_prior_information(&self, estimate: &Estimate) -> DMatrix<f64> {
        let (rows, _) = self.border_rows(estimate);
        rows.tr_mul(&rows)
    }

    pub(super) fn linearize(&self, estimate: &Estimate) -> BundleEquations {
        let poses = self.poses(estimate);
        let map =
            |view: ViewId| (view, estimate.view_map(view, &self.columns, self.frame_sets, &self.gravity_in_world));
        let maps: BTreeMap<ViewId, ViewMap> = poses.keys().map(|view| map(*view)).collect();
        let (border_rows, border_residual) = self.border_rows(estimate);
        let mut equations = BundleEquations {
            visual: visual::equations(&self.pixels, &poses, self.tracks, &estimate.landmarks),
            maps,
            imu: Vec::with_capacity(self.frame_sets.len()),
            encoders: Vec::new(),
            first: self.first_rows(estimate),
            border_hessian: border_rows.tr_mul(&border_rows),
            border_gradient: border_rows.tr_mul(&border_residual),
        };
        for frame_set in 1..self.frame_sets.len() {
            let Some(residual) = self.imu_residual(frame_set, estimate) else { continue };
            let Some((motion, information)) = &self.frame_sets[frame_set].motion else { continue };
            let (from, to) = (&estimate.navigation[frame_set - 1], &estimate.navigation[frame_set]);
            let (by_from, by_to) = imu_factor::jacobians(motion, from, to, &self.gravity_in_world);
            let mut rows = DMatrix::zeros(15, 30);
            rows.fixed_columns_mut::<15>(0).copy_from(&(information * by_from));
            rows.fixed_columns_mut::<15>(15).copy_from(&(information * by_to));
            equations.imu.push((frame_set, rows, residual));
        }
        for ((frame_set, joint), information, residual) in self.encoder_terms(estimate) {
            equations.encoders.push(EncoderEquation {
                column: frame_set * self.columns.block() + Columns::joint(joint),
                information,
                residual,
                rate: self.frame_sets[frame_set].gimbal.as_ref().map_or(0.0, |g| g.reading_rate_rad_per_s[joint]),
            });
        }
        equations
    }

    /// Column in the band of an entry of a navigation state.
    fn navigation_column(&self, frame_set: usize, entry: usize) -> usize {
        frame_set * self.columns.block() + self.columns.navigation(entry)
    }

    /// Largest number of frame sets between two observations of one landmark, at least one for the IMU factors.
    fn reach(&self) -> usize {
        let span = |track: &Track| match (track.observations.first(), track.observations.last()) {
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
        let mut border = -&equations.border_gradient;
        *matrix.corner_mut() += &equations.border_hessian;
        for (frame_set, rows, residual) in &equations.imu {
            let column = |entry: usize| self.navigation_column(frame_set - 1 + entry / 15, entry % 15);
            let hessian = rows.tr_mul(rows);
            let gradient = rows.tr_mul(residual);
            for a in 0..30 {
                band[column(a)] -= gradient[a];
                for b in 0..30 {
                    matrix.add(column(a), column(b), hessian[(a, b)]);
                }
            }
        }
        let shift = columns.gimbal_shift();
        for encoder in &equations.encoders {
            let EncoderEquation { column, information, residual, rate } = *encoder;
            matrix.add(column, column, information);
            matrix.add_border(shift, column, -rate * information);
            matrix.corner_mut()[(shift, shift)] += rate * rate * information;
            band[column] -= information * residual;
            border[shift] += rate * information * residual;
        }
        let (rows, residual) = &equations.first;
        let (hessian, gradient) = (rows.tr_mul(rows), rows.tr_mul(residual));
        for a in 0..15 {
            band[self.navigation_column(0, a)] -= gradient[a];
            for b in 0..15 {
                matrix.add(self.navigation_column(0, a), self.navigation_column(0, b), hessian[(a, b)]);
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
