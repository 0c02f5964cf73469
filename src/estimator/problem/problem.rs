//! Least-squares problem of a window: cost, normal equations, whitened rows.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Vector3, Vector6};

use crate::estimator::factors::costs::Costs;
use crate::estimator::factors::dense_equations::DenseEquations;
use crate::estimator::factors::factor::{Point, Sink};
use crate::estimator::factors::kind::FactorKind;
use crate::estimator::factors::marginal_prior::Prior;
use crate::estimator::factors::measurements::{measurements, priors};
use crate::estimator::factors::reprojection::{
    self, ReducedVisualEquations, VisualEquations, VisualFactors, VisualModel,
};
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::state::camera_pose::CameraMaps;
use crate::estimator::state::camera_view::{CameraView, Track};
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::frame::{FirstEstimateReach, Frame};
use crate::estimator::state::gimbal_imu_noise::GimbalImuNoise;
use crate::estimator::state::layout::Layout;
use crate::optimization::Landmark;

#[derive(Clone, Debug)]
pub(crate) struct CameraFactors<'a> {
    pub(crate) visual: VisualModel<'a>,
    pub(crate) tracks: &'a [Track],
    /// Columns of the calibration on which the camera's poses depend.
    pub(crate) columns: Range<usize>,
}

#[derive(Clone, Debug)]
pub(crate) struct Problem<'a> {
    pub(crate) layout: Layout,
    /// Each camera has a separate visual system of its features, with their observations by the other camera of its pair.
    pub(crate) cameras: Vec<CameraFactors<'a>>,
    pub(crate) gravity_in_world: Vector3<f64>,
    pub(crate) gimbal_imu_noise: GimbalImuNoise,
    pub(crate) frames: &'a [Frame],
    pub(crate) prior: Option<&'a Prior>,
    pub(crate) start: Option<&'a StartPrior>,
    pub(crate) first_estimate_reach: FirstEstimateReach,
    pub(crate) calibration_first_estimates: bool,
}

/// Reprojection factors of one camera.
#[derive(Clone, Debug)]
struct CameraEquations {
    visual: VisualEquations,
    maps: CameraMaps,
    columns: Range<usize>,
}

/// Normal equations at an estimate, landmarks not yet eliminated.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    cameras: Vec<CameraEquations>,
    /// Equations of all other factors.
    others: DenseEquations,
}

impl Problem<'_> {
    /// Values at which derivatives are evaluated, without landmarks: the first estimate of a state that is near enough to
    /// it, and of the calibration if configured; otherwise the values of `estimate`.
    pub(crate) fn linearization_point(&self, estimate: &Estimate) -> Estimate {
        let frames = self.frames.iter().zip(&estimate.frames);
        let reach = self.first_estimate_reach;
        let calibration = &estimate.calibration;
        Estimate {
            frames: frames.map(|(frame, current)| frame.linearization_point(current, reach)).collect(),
            calibration: if self.calibration_first_estimates {
                calibration.at_first_estimate()
            } else {
                calibration.clone()
            },
            landmarks: Vec::new(),
        }
    }

    /// Camera at the states and the calibration of an estimate.
    pub(crate) fn view<'v>(&'v self, camera: usize, estimate: &'v Estimate) -> CameraView<'v> {
        CameraView::new(&estimate.frames, &estimate.calibration, camera, &|camera| self.cameras[camera].visual.camera)
    }

    /// Factors' input: residuals at `estimate`, derivatives at `linearized`.
    pub(crate) fn point<'p>(&'p self, estimate: &'p Estimate, linearized: &'p Estimate) -> Point<'p> {
        Point {
            layout: self.layout,
            frames: self.frames,
            gravity_in_world: &self.gravity_in_world,
            gimbal_imu_noise: self.gimbal_imu_noise,
            at: estimate,
            linearized,
        }
    }

    pub(crate) fn priors(&self, point: &Point<'_>, sink: &mut impl Sink) {
        priors(point, self.prior, self.start, sink);
    }

    /// Costs by kind of factor.
    pub(crate) fn costs(&self, estimate: &Estimate) -> Costs {
        let mut costs = Costs::default();
        for (camera, (factors, landmarks)) in self.cameras.iter().zip(&estimate.landmarks).enumerate() {
            let view = self.view(camera, estimate);
            let squared = 2.0 * reprojection::cost(&factors.visual, &view, factors.tracks, landmarks);
            let observations: usize = factors.tracks.iter().map(|track| track.observations.len()).sum();
            costs.add_to(FactorKind::Visual, squared, 2 * observations);
        }
        let point = self.point(estimate, estimate);
        measurements(&point, self.frames.len(), &mut costs);
        self.priors(&point, &mut costs);
        costs
    }

    pub(crate) fn linearize(&self, estimate: &Estimate) -> NormalEquations {
        let point = self.linearization_point(estimate);
        let cameras = self
            .cameras
            .iter()
            .zip(&estimate.landmarks)
            .enumerate()
            .map(|(camera, (factors, landmarks))| {
                let current = &self.view(camera, estimate);
                let linearized = &self.view(camera, &point);
                let (model, tracks) = (&factors.visual, factors.tracks);
                CameraEquations {
                    visual: VisualFactors { model, current, linearized, tracks, landmarks }.equations(),
                    maps: CameraMaps::new(&point.frames, &point.calibration, camera),
                    columns: factors.columns.clone(),
                }
            })
            .collect();
        let others = self.other_equations(estimate, &point, self.frames.len());
        NormalEquations { cameras, others }
    }

    /// Normal equations of the measurements of the frames before `slots`, without reprojections, and of the priors;
    /// derivatives at `linearized`.
    pub(crate) fn other_equations(&self, estimate: &Estimate, linearized: &Estimate, slots: usize) -> DenseEquations {
        let mut equations = DenseEquations::zeros(self.layout.total());
        let point = self.point(estimate, linearized);
        measurements(&point, slots, &mut equations);
        self.priors(&point, &mut equations);
        equations
    }

    /// Estimate after a step.
    pub(crate) fn stepped(
        &self,
        estimate: &Estimate,
        step: &DVector<f64>,
        landmarks: &[Vec<Vector3<f64>>],
    ) -> Estimate {
        let moved = |(of_camera, deltas): (&Vec<Landmark>, &Vec<Vector3<f64>>)| {
            of_camera.iter().zip(deltas).map(|(landmark, delta)| landmark.plus(delta)).collect()
        };
        Estimate {
            frames: self
                .frames
                .iter()
                .zip(&estimate.frames)
                .enumerate()
                .map(|(slot, (frame, current))| {
                    current.stepped(frame.first_estimate.as_ref(), &step.as_slice()[self.layout.frame(slot)])
                })
                .collect(),
            calibration: estimate.calibration.stepped(&step.as_slice()[self.layout.calibration()]),
            landmarks: estimate.landmarks.iter().zip(landmarks).map(moved).collect(),
        }
    }
}

impl NormalEquations {
    /// Eliminates the landmarks of every camera.
    pub(crate) fn eliminate(&self, damping: f64) -> Vec<ReducedVisualEquations> {
        self.cameras.iter().map(|camera| camera.visual.eliminate(damping)).collect()
    }

    /// Reduced normal equations over poses, joints, velocities, biases and calibration (lower triangle).
    pub(crate) fn reduced(&self, layout: &Layout, visual: &[ReducedVisualEquations]) -> (DMatrix<f64>, DVector<f64>) {
        let mut hessian = DMatrix::default();
        let gradient = self.reduce_into(&mut hessian, layout, visual);
        (hessian, gradient)
    }

    /// [`Self::reduced`] in the memory of an earlier matrix; returns the gradient.
    pub(crate) fn reduce_into(
        &self,
        hessian: &mut DMatrix<f64>,
        layout: &Layout,
        visual: &[ReducedVisualEquations],
    ) -> DVector<f64> {
        if hessian.shape() == self.others.hessian.shape() {
            hessian.copy_from(&self.others.hessian);
        } else {
            *hessian = self.others.hessian.clone();
        }
        let mut gradient = self.others.gradient.clone();
        for (camera, visual) in self.cameras.iter().zip(visual) {
            camera.add_to(layout, visual, hessian, &mut gradient);
        }
        gradient
    }

    /// Steps of the landmarks by camera, for a step of the other unknowns.
    pub(crate) fn landmark_steps(
        &self,
        layout: &Layout,
        reduced: &[ReducedVisualEquations],
        step: &DVector<f64>,
    ) -> Vec<Vec<Vector3<f64>>> {
        self.cameras
            .iter()
            .zip(reduced)
            .map(|(camera, reduced)| {
                let steps = camera.block_steps(layout, step);
                camera.visual.substitute(reduced, |block| steps[block])
            })
            .collect()
    }
}

impl CameraEquations {
    /// Adds the normal equations of the camera poses to the normal equations of the unknowns.
    fn add_to(
        &self,
        layout: &Layout,
        visual: &ReducedVisualEquations,
        hessian: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
    ) {
        let block = |row: usize, column: usize| visual.poses.hessian.symmetric_block(row, column);
        self.maps.add_information(layout, &self.columns, block, hessian);
        for (row, camera_gradient) in visual.poses.gradient.iter().enumerate() {
            let mut part = gradient.rows_range_mut(self.maps.columns(layout, row));
            part += self.maps.own[row].tr_mul(camera_gradient);
            let mut part = gradient.rows_range_mut(self.columns.clone());
            part += self.maps.calibration[row].tr_mul(camera_gradient);
        }
    }

    /// Steps of the camera's blocks for a step of the unknowns.
    fn block_steps(&self, layout: &Layout, step: &DVector<f64>) -> Vec<Vector6<f64>> {
        (0..self.maps.blocks())
            .map(|block| {
                let moved = &self.maps.own[block] * step.rows_range(self.maps.columns(layout, block))
                    + &self.maps.calibration[block] * step.rows_range(self.columns.clone());
                Vector6::from_column_slice(moved.as_slice())
            })
            .collect()
    }
}
