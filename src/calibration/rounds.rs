//! Bundle adjustment in rounds: triangulate, adjust, drop outliers, estimate the pixel noise.

use nalgebra::{DMatrix, Vector3};

use super::bundle::{Bundle, Priors};
use super::frame_sets::FrameSet;
use super::solver::{Covariances, adjust, covariances};
use super::state::{BundleEstimate, Camera, Columns};
use super::visual::{BundleTrack, PixelModel};
use super::{CalibrationError, CalibrationOptions, observations};
use crate::camera::CameraModel;
use crate::estimator::PoseCovariance;
use crate::geometry::{MEDIAN_PLANAR_LENGTH, median};
use crate::optimization::RobustLoss;

/// Standard deviation of a tracked pixel coordinate before residuals are available.
const INITIAL_SIGMA_PX: f64 = 1.0;
/// Smallest standard deviation of a tracked pixel coordinate.
const MIN_SIGMA_PX: f64 = 0.05;
/// Range of the quadratic part of the robust loss, in standard deviations.
const HUBER_SIGMAS: f64 = 1.5;

/// Common input of the rounds of one stage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage<'a> {
    pub(super) name: &'static str,
    pub(super) cameras: [&'a CameraModel; 2],
    pub(super) gravity_in_world: Vector3<f64>,
    pub(super) priors: &'a Priors,
    pub(super) options: &'a CalibrationOptions,
    /// Compute the covariances of the poses.
    pub(super) pose_covariances: bool,
}

#[derive(Clone, Debug)]
pub(super) struct StageResult {
    pub(super) estimate: BundleEstimate,
    pub(super) tracks: Vec<BundleTrack>,
    /// Standard deviation of a pixel coordinate by camera, estimated from the residuals.
    pub(super) sigma_px: [f64; 2],
    pub(super) iterations: usize,
    /// Covariance of the border's unknowns (borders × borders).
    pub(super) covariance: DMatrix<f64>,
    /// Covariance of the pose of each frame set; empty if the stage does not compute them.
    pub(super) pose_covariances: Vec<PoseCovariance>,
    /// Information matrix of the priors on the border (borders × borders).
    pub(super) prior_information: DMatrix<f64>,
    /// Lengths of the reprojection residuals by camera, in pixels.
    pub(super) residuals_px: [Vec<f64>; 2],
}

impl StageResult {
    /// Column layout of the unknowns.
    pub(super) fn columns(&self) -> Columns {
        columns(&self.estimate)
    }
}

fn columns(estimate: &BundleEstimate) -> Columns {
    Columns { frame_sets: estimate.navigation.len(), joints: estimate.chain.joint_count(), chain: estimate.chain.dof() }
}

impl Stage<'_> {
    fn pixels(&self, sigma_px: [f64; 2]) -> PixelModel<'_> {
        PixelModel { cameras: self.cameras, sigma_px, loss: RobustLoss::Huber(HUBER_SIGMAS) }
    }

    fn bundle<'b>(
        &'b self,
        frame_sets: &'b [FrameSet],
        columns: Columns,
        tracks: &'b [BundleTrack],
        sigma_px: [f64; 2],
    ) -> Bundle<'b> {
        Bundle {
            columns,
            frame_sets,
            gravity_in_world: self.gravity_in_world,
            priors: self.priors,
            pixels: self.pixels(sigma_px),
            tracks,
        }
    }

    /// Adjusts all unknowns to all tracks in rounds; an error of `on_round`, called before each round, stops it.
    pub(super) fn run(
        &self,
        frame_sets: &mut [FrameSet],
        all_tracks: &[BundleTrack],
        start: BundleEstimate,
        on_round: &mut dyn FnMut(usize) -> Result<(), CalibrationError>,
    ) -> Result<StageResult, CalibrationError> {
        let singular = || CalibrationError::Singular { stage: self.name };
        let columns = columns(&start);
        let mut estimate = start;
        let mut sigma_px = [INITIAL_SIGMA_PX; 2];
        let mut iterations = 0;
        let mut kept: Vec<BundleTrack> = Vec::new();
        let rounds = self.options.rounds.max(1);
        for round in 0..=rounds {
            on_round(round)?;
            Self::reintegrate(frame_sets, &estimate);
            let poses = self.bundle(frame_sets, columns, all_tracks, sigma_px).poses(&estimate);
            let (tracks, landmarks) = observations::triangulated(all_tracks.to_vec(), &poses, self.options);
            // The first poses are inaccurate: outliers now may be inliers later.
            let limit = if round == 0 { 30.0 / INITIAL_SIGMA_PX } else { self.options.outlier_sigmas };
            let pixels = self.pixels(sigma_px);
            let (tracks, landmarks) =
                observations::without_outliers(tracks, &landmarks, &poses, &pixels, limit, self.options);
            estimate.landmarks = landmarks;
            let bundle = self.bundle(frame_sets, columns, &tracks, sigma_px);
            let adjusted = adjust(&bundle, estimate, self.options).ok_or_else(singular)?;
            iterations += adjusted.iterations;
            estimate = adjusted.estimate;
            let poses = bundle.poses(&estimate);
            for camera in [Camera::Static, Camera::Gimbal] {
                let lengths =
                    observations::residual_lengths_px(&tracks, &estimate.landmarks, &poses, &bundle.pixels, camera);
                if let Some(median) = median(lengths) {
                    sigma_px[usize::from(camera == Camera::Gimbal)] = (median / MEDIAN_PLANAR_LENGTH).max(MIN_SIGMA_PX);
                }
            }
            kept = tracks;
        }
        let bundle = self.bundle(frame_sets, columns, &kept, sigma_px);
        let found = covariances(&bundle, &estimate, self.pose_covariances).ok_or_else(singular)?;
        let Covariances { border: covariance, poses: pose_covariances } = found;
        let poses = bundle.poses(&estimate);
        let residuals_px = [Camera::Static, Camera::Gimbal].map(|camera| {
            observations::residual_lengths_px(&kept, &estimate.landmarks, &poses, &bundle.pixels, camera)
        });
        let prior_information = bundle.border_prior_information(&estimate);
        Ok(StageResult {
            estimate,
            tracks: kept,
            sigma_px,
            iterations,
            covariance,
            pose_covariances,
            prior_information,
            residuals_px,
        })
    }

    fn reintegrate(frame_sets: &mut [FrameSet], estimate: &BundleEstimate) {
        for index in 0..frame_sets.len() {
            let before = index.checked_sub(1).map(|before| estimate.navigation[before].bias);
            frame_sets[index].reintegrate(before.as_ref(), &estimate.navigation[index].bias);
        }
    }
}
