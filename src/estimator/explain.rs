//! Jacobian of a step in blocks: rows by factor, columns by unknowns.

use std::borrow::Cow;
use std::collections::BTreeMap;

use nalgebra::{DMatrix, Vector3};

use crate::camera::CameraModel;
use crate::estimator::factors::reprojection::{Anchor, RobustWeight, VisualModel, whitened};
use crate::estimator::report::jacobian_source::block_norms;
use crate::estimator::report::{FeatureReport, JacobianFactor, JacobianRow, JacobianSource, StepReport};
use crate::estimator::state::camera_pose::{self, CameraCalibration, CameraMaps};
use crate::estimator::state::camera_view::{CameraView, ROLLING_BLOCKS, TrackObservation};
use crate::estimator::state::columns::{ColumnBlock, ColumnId, FrameId, scales_of};
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::{Layout, POSE, VELOCITY_BIAS};
use crate::frontend::FeatureId;
use crate::optimization::{BlockTerm, CameraPose, Landmark, RobustLoss};

#[derive(Clone, Debug, PartialEq)]
pub struct StepJacobian {
    /// Calibration, joint angles, poses, velocities and biases, then the inverse depths as one block: each feature
    /// has a separate column, which no other feature's rows use.
    pub columns: Vec<ColumnBlock>,
    /// Features in the report's order, then the other factors.
    pub rows: Vec<JacobianRow>,
}

/// Rows of one feature, two per observation.
#[derive(Clone, Debug, PartialEq)]
pub struct FeatureRows {
    /// Observing frame of each observation.
    pub frames: Vec<FrameId>,
    /// Whitened rows by the columns of the step, the feature's inverse depth last: residuals over their standard
    /// deviations with robust weights, per radian, metre and 1/m.
    pub rows: DMatrix<f64>,
}

impl StepReport {
    /// Blocks of the Jacobian, `None` without a stored source; `cameras` are the main camera, then the rigid ones.
    pub fn jacobian(&self, cameras: &[&CameraModel]) -> Option<StepJacobian> {
        let writer = Writer::new(self, cameras)?;
        let mut rows = Vec::with_capacity(self.features.len());
        for (index, feature) in self.features.iter().enumerate() {
            let Some(written) = writer.feature(index, feature) else { continue };
            rows.push(writer.row_of(feature, &written));
        }
        let numbers: Vec<FrameId> = self.window.iter().map(|frame| FrameId(frame.frame_index)).collect();
        rows.extend(writer.source.rows(&numbers));
        Some(StepJacobian { columns: writer.columns, rows })
    }

    /// Rows of one feature; `cameras` as for [`Self::jacobian`].
    pub fn feature_rows(&self, cameras: &[&CameraModel], id: FeatureId) -> Option<FeatureRows> {
        let writer = Writer::new(self, cameras)?;
        let index = self.features.iter().position(|feature| feature.id == id)?;
        writer.feature(index, &self.features[index])
    }
}

/// Camera with its poses at the states of the window.
struct WindowCamera<'a> {
    model: VisualModel<'a>,
    current: CameraView<'a>,
    linearized: CameraView<'a>,
    maps: CameraMaps,
    /// First column and number of columns of the camera's calibration.
    start: usize,
    columns: usize,
}

struct Writer<'a> {
    report: &'a StepReport,
    source: &'a JacobianSource,
    layout: Layout,
    columns: Vec<ColumnBlock>,
    cameras: Vec<WindowCamera<'a>>,
    /// Landmark positions in the world, in metres.
    places_m: BTreeMap<FeatureId, Vector3<f64>>,
}

impl<'a> Writer<'a> {
    fn new(report: &'a StepReport, cameras: &[&'a CameraModel]) -> Option<Self> {
        let source = report.jacobian_source.as_ref()?;
        let frames = report.window.len();
        let joints = report.window.first().map_or(0, |frame| frame.joint_angles_rad.len());
        let states = source.frames(joints);
        if !source.describes(&report.calibration.parameters)
            || states.len() != frames
            || cameras.len() < source.chains.len()
        {
            return None;
        }
        let first = states.first();
        let layout = Layout {
            frames,
            joints,
            joint_motion: first.map_or(0, |state| state.joint_motion.len()),
            moving_rows: first.is_some_and(FrameState::has_moving_rows),
            gimbal_imu: report.window.first().and_then(|frame| frame.gimbal_imu).map_or(0, |_| VELOCITY_BIAS),
            calibration: if source.calibrated { report.calibration.parameters.len() } else { 0 },
        };
        let numbers: Vec<FrameId> = report.window.iter().map(|frame| FrameId(frame.frame_index)).collect();
        let mut columns = layout.blocks(&report.calibration.parameters, &numbers);
        let start = columns.last().map_or(0, |last| last.start + last.len);
        columns.push(ColumnBlock { id: ColumnId::InverseDepth, start, len: 1 });
        let mut start = 0;
        let cameras = (0..source.chains.len())
            .map(|camera| {
                let camera = window_camera(report, source, &states, camera, cameras, start);
                start = camera.start + camera.columns;
                camera
            })
            .collect();
        let places_m = report.landmarks.iter().map(|landmark| (landmark.id, landmark.position_m)).collect();
        Some(Self { report, source, layout, columns, cameras, places_m })
    }

    /// Rows of a feature; `None` when its camera or an anchor observation is missing.
    fn feature(&self, index: usize, feature: &FeatureReport) -> Option<FeatureRows> {
        let camera = self.cameras.get(feature.id.camera())?;
        let slot_of = |number: usize| self.report.window.iter().position(|frame| frame.frame_index == number);
        let anchor = slot_of(feature.anchor_frame_index)?;
        let width = self.columns.last().map_or(0, |last| last.start + last.len);
        let mut rows = DMatrix::zeros(2 * (feature.observations.len() + feature.matched.len()), width);
        let mut frames = Vec::new();
        let anchored = feature.observations.iter().find(|seen| seen.frame_index == feature.anchor_frame_index)?;
        let anchored = TrackObservation { slot: anchor, matched: false, uv_px: anchored.measured_px };
        let landmark = self.landmark(index, feature, &camera.current.pose(anchor, &anchored.uv_px))?;
        let anchor = Anchor::new(&camera.current, &camera.linearized, &anchored);
        let matched = feature.matched.iter().map(|seen| (true, seen));
        for (matched, seen) in feature.observations.iter().map(|seen| (false, seen)).chain(matched) {
            let Some(slot) = slot_of(seen.frame_index) else { continue };
            let observation = TrackObservation { slot, matched, uv_px: seen.measured_px };
            // Stored residuals are rounded: take the robust weight of the step instead of recomputing it.
            let weight = RobustWeight::Known(seen.robust_weight);
            let mut target = rows.rows_mut(2 * frames.len(), 2);
            let written = match camera.current.blocks_per_image() {
                1 => self.write::<1>(&mut target, camera, &anchor, &landmark, &observation, weight),
                _ => self.write::<ROLLING_BLOCKS>(&mut target, camera, &anchor, &landmark, &observation, weight),
            };
            if written.is_some() {
                frames.push(FrameId(seen.frame_index));
            }
        }
        let height = 2 * frames.len();
        Some(FeatureRows { frames, rows: rows.resize_vertically(height, 0.0) })
    }

    /// Landmark of a feature in its anchor's camera: from its position in the world, or from the stored bearing if
    /// rejected.
    fn landmark(&self, index: usize, feature: &FeatureReport, anchor: &CameraPose) -> Option<Landmark> {
        let rejected = self.source.rejected.iter().find(|(place, _)| *place as usize == index);
        if let Some((_, bearing)) = rejected {
            let bearing = Vector3::from(*bearing).cast::<f64>().normalize();
            return Some(Landmark { bearing, inverse_distance: feature.inverse_depth_per_m * bearing.z });
        }
        let position_m = self.places_m.get(&feature.id)?;
        let point = anchor.rotation.tr_mul(&(position_m - anchor.position_m));
        Some(Landmark { bearing: point.normalize(), inverse_distance: point.norm().recip() })
    }

    /// Writes the rows of an observation by a camera with `N` blocks per frame; `None` if the observation has no rows.
    fn write<const N: usize>(
        &self,
        rows: &mut nalgebra::DMatrixViewMut<'_, f64>,
        camera: &WindowCamera<'_>,
        anchor: &Anchor<'_>,
        landmark: &Landmark,
        observation: &TrackObservation,
        weight: RobustWeight,
    ) -> Option<()> {
        let term: BlockTerm<usize, N> = whitened(&camera.model, anchor, landmark, observation, weight)?;
        rows.column_mut(rows.ncols() - 1).copy_from(&term.by_landmark.column(2));
        let layout = &self.layout;
        let (joints, count) = (layout.calibration, layout.joint_block());
        let poses = joints + count * layout.frames;
        let velocities = poses + POSE * layout.frames;
        for (block, by_block) in term.blocks() {
            let mut by_calibration = rows.columns_mut(camera.start, camera.columns);
            by_calibration += by_block * &camera.maps.calibration[*block];
            let of_frame = camera.maps.columns(layout, *block);
            if of_frame.is_empty() {
                continue;
            }
            let slot = of_frame.start / layout.frame_len();
            let by_frame = by_block * &camera.maps.own[*block];
            let mut add = |place: usize, from: usize, count: usize| {
                let mut target = rows.columns_mut(place, count);
                target += by_frame.columns(from, count);
            };
            add(poses + POSE * slot, 0, POSE);
            add(joints + count * slot, POSE, count);
            add(velocities + VELOCITY_BIAS * slot, POSE + count, of_frame.len() - POSE - count);
        }
        Some(())
    }

    fn row_of(&self, feature: &FeatureReport, written: &FeatureRows) -> JacobianRow {
        let mut scales = scales_of(&self.columns);
        if let Some(last) = scales.last_mut() {
            // The scale of an inverse depth is relative: a tenth of its value.
            *last = ColumnId::InverseDepth.scale(0) * feature.inverse_depth_per_m.abs();
        }
        let norms = block_norms(&written.rows, &self.columns, &scales);
        JacobianRow { factor: JacobianFactor::Feature(feature.id), height: written.rows.nrows(), norms }
    }
}

fn window_camera<'a>(
    report: &'a StepReport,
    source: &'a JacobianSource,
    states: &[FrameState],
    camera: usize,
    models: &[&'a CameraModel],
    start: usize,
) -> WindowCamera<'a> {
    let model = models[camera];
    let (sigma_px, landmark_model) = (source.pixel_sigmas_px[camera], source.landmark_model);
    // The robust weights are known.
    let visual =
        VisualModel { camera: model, sigma_px, loss: RobustLoss::None, track_loss: RobustLoss::None, landmark_model };
    if let Some(exact) = &source.exact {
        let ((now, current), (then, linearized)) = (&exact.current, &exact.linearized);
        let columns = linearized.pose_columns(camera);
        let given = |camera: usize| models[camera];
        return WindowCamera {
            model: visual,
            current: CameraView::new(now, current, camera, &given),
            linearized: CameraView::new(then, linearized, camera, &given),
            maps: CameraMaps::new(then, linearized, camera),
            start: columns.start,
            columns: columns.len(),
        };
    }
    let chain = &source.chains[camera];
    let clocks = source.clocks.get(camera).copied().unwrap_or_default();
    let [then_s, now_s] = clocks.shifts_s;
    let sensor = CameraCalibration {
        chain: Cow::Borrowed(chain),
        mounted: None,
        camera,
        columns: if source.calibrated { chain.dof() + clocks.count } else { 0 },
        shift_s: then_s,
        shift_column: (source.calibrated && clocks.count > 0).then(|| chain.dof()),
        rolling: false,
        readout_s: 0.0,
        readout_column: None,
        intrinsics: 0..0,
    };
    let columns = sensor.columns;
    let maps = CameraMaps::of_sensors(states, std::slice::from_ref(&sensor));
    let linearized = CameraView::of_sensor(Cow::Owned(states.to_vec()), sensor, Cow::Borrowed(model), false);
    let rigid = camera.checked_sub(1).and_then(|rigid| report.calibration.further_cameras.get(rigid));
    let now = report.window.iter().zip(states).map(|(frame, state)| {
        let mut state = state.clone();
        state.navigation.world_from_imu = frame.world_from_imu;
        state.navigation.velocity_m_per_s = frame.velocity_m_per_s;
        state.joints_rad.clone_from(&frame.joint_angles_rad);
        let seen = camera_pose::state_at(&state, &state.rates.exposure(camera, now_s));
        let imu_from_observer = match rigid {
            Some(rigid) => rigid.base_from_camera,
            // Without a time offset the reported camera pose applies.
            None if now_s == 0.0 => frame.imu_from_camera,
            None => {
                // Motion of the joints during the time offset, with the chain of the first estimate: nearly the same.
                let moved =
                    chain.imu_from_camera(&state.joints_rad).inverse() * chain.imu_from_camera(&seen.joints_rad);
                frame.imu_from_camera * moved
            }
        };
        CameraPose::from(seen.navigation.world_from_imu * imu_from_observer)
    });
    let current = CameraView::of_poses(now.collect(), model);
    WindowCamera { model: visual, current, linearized, maps, start, columns }
}
