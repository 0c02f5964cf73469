//! Scene in the world frame: ground, trajectories, landmarks, cameras and the vehicle.

use std::sync::Arc;

use egui::Color32;
use nalgebra::{Matrix3, Vector2, Vector3};

use super::camera::round_length;
use super::chain::axis_colors;
use super::model::{Dot, ImageQuad, SceneModel};
use super::tube;
use crate::camera::CameraModel;
use crate::estimator::{FrameStateReport, LandmarkReport};
use crate::geometry::RigidTransform;
use crate::gui::derived::follow::{RunTables, StepTable};
use crate::gui::theme::{Theme, mix};
use crate::sensors::GrayImage;
use crate::session::{PositionTruth, Recording, RunRecord, TrajectoryLane};

/// Maximum number of points of a drawn trajectory.
const MAX_TRAJECTORY_POINTS: usize = 4000;
/// Maximum number of earlier steps whose landmarks are shown.
const MAX_LANDMARK_STEPS: usize = 128;
/// Maximum number of drawn landmarks.
const MAX_LANDMARKS: usize = 20_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct WorldOptions {
    pub(super) landmarks: bool,
    /// Show camera frusta of the keyframes in the window.
    pub(super) keyframes: bool,
    /// Show the newest image in the camera's frustum.
    pub(super) image: bool,
    /// Show three standard deviations of the position around the trajectory of the selected run.
    pub(super) tube: bool,
}

/// Columns of a run's table: estimated position, ground-truth position, then the upper triangle of the covariance of
/// the estimated position; NaN where unknown.
const PLACES: usize = 12;
const ESTIMATE: usize = 0;
const GROUND_TRUTH: usize = 3;
const COVARIANCE: usize = 6;

/// Estimated and ground-truth positions of each run with their covariances, read step by step, so that a long recording
/// is not read again for every frame.
#[derive(Debug, Default)]
pub(super) struct Trajectories {
    tables: RunTables,
}

impl Trajectories {
    /// Reads the new steps; one table per run.
    pub(super) fn read(&mut self, recording: &Recording) -> &[StepTable] {
        self.tables.read::<PLACES>(&recording.runs, |step| {
            let estimate = step.report.newest().map(|frame| frame.world_from_imu.translation_m);
            let ground_truth = step.ground_truth.map(|pose| pose.translation_m);
            let [estimate, ground_truth] =
                [estimate, ground_truth].map(|at| at.unwrap_or_else(|| Vector3::repeat(f64::NAN)));
            let covariance = step.report.newest_pose_covariance.map(|covariance| covariance.position_m2());
            let covariance = covariance.unwrap_or_else(|| Matrix3::repeat(f64::NAN));
            let mut row = [f64::NAN; PLACES];
            row[ESTIMATE..GROUND_TRUTH].copy_from_slice(estimate.as_slice());
            row[GROUND_TRUTH..COVARIANCE].copy_from_slice(ground_truth.as_slice());
            for (cell, place) in row[COVARIANCE..].iter_mut().zip(UPPER) {
                *cell = covariance[place];
            }
            row
        })
    }
}

/// Rows and columns of the upper triangle.
const UPPER: [(usize, usize); PLACES - COVARIANCE] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// A run of the recording up to the cursor, aligned with the ground truth.
pub(super) struct RunView<'a> {
    pub(super) number: usize,
    pub(super) run: &'a RunRecord,
    /// Positions of all its steps.
    places: &'a StepTable,
    /// Number of steps at or before the cursor.
    shown: usize,
    aligned: RigidTransform,
}

impl<'a> RunView<'a> {
    pub(super) fn new(number: usize, run: &'a RunRecord, places: &'a StepTable, cursor_ns: i64) -> Self {
        let shown = places.stamps_ns.partition_point(|stamp_ns| *stamp_ns <= cursor_ns);
        Self { number, run, places, shown, aligned: run.alignment.unwrap_or_default() }
    }

    /// The same run with all its steps.
    fn whole(&self) -> Self {
        Self { shown: self.places.stamps_ns.len(), ..*self }
    }

    fn step(&self) -> Option<&'a Arc<crate::session::StepRecord>> {
        self.run.step(self.shown.checked_sub(1)?)
    }

    /// The newest frame at the cursor, `None` while the run does not track.
    pub(super) fn newest(&self) -> Option<&'a FrameStateReport> {
        self.step()?.report.newest()
    }

    /// Distance between the aligned run and the ground truth at the cursor in metres.
    pub(super) fn error_m(&self) -> Option<f64> {
        self.run.position_error_m(self.step()?)
    }

    /// Standard deviation of the position at the cursor in metres, relative to the first estimated frame.
    pub(super) fn sigma_m(&self) -> Option<f64> {
        self.step()?.report.newest_pose_covariance.map(|covariance| covariance.position_sigma_m())
    }

    /// Aligned position of the vehicle at the cursor.
    pub(super) fn position_m(&self) -> Option<Vector3<f64>> {
        Some((self.aligned * self.newest()?.world_from_imu).translation_m)
    }

    pub(super) fn has_ground_truth(&self) -> bool {
        self.places.columns[GROUND_TRUTH][..self.shown].iter().any(|x| x.is_finite())
    }

    /// Aligned positions in metres, interrupted where the run was not tracking.
    fn trajectory_m(&self) -> Vec<Vec<Vector3<f64>>> {
        broken_line(self.shown, |step| self.aligned.transform(&self.place(ESTIMATE, step)))
    }

    fn ground_truth_m(&self) -> Vec<Vec<Vector3<f64>>> {
        broken_line(self.shown, |step| self.place(GROUND_TRUTH, step))
    }

    /// The 3σ tube around the estimated positions.
    fn tube_m(&self) -> Vec<Vec<Vector3<f64>>> {
        let rotation = self.aligned.rotation.to_rotation_matrix();
        let covariance_m2 = |step: usize| {
            let mut covariance = Matrix3::zeros();
            for (column, (row, other)) in UPPER.into_iter().enumerate() {
                let value = self.places.columns[COVARIANCE + column][step];
                (covariance[(row, other)], covariance[(other, row)]) = (value, value);
            }
            rotation.matrix() * covariance * rotation.matrix().transpose()
        };
        let is_known =
            |step: usize| [ESTIMATE, COVARIANCE].iter().all(|column| self.places.columns[*column][step].is_finite());
        let place = |step: usize| is_known(step).then(|| self.aligned.transform(&self.place(ESTIMATE, step)));
        tube::outline(self.shown, place, covariance_m2)
    }

    fn place(&self, column: usize, step: usize) -> Vector3<f64> {
        let [x, y, z] = [0, 1, 2].map(|axis| self.places.columns[column + axis][step]);
        Vector3::new(x, y, z)
    }
}

/// A trajectory of another program up to the cursor, in the world of the scene.
pub(super) struct LaneView<'a> {
    pub(super) number: usize,
    pub(super) lane: &'a TrajectoryLane,
    /// Number of its poses at or before the cursor.
    shown: usize,
    world_from_own: RigidTransform,
}

impl<'a> LaneView<'a> {
    /// `run` is the first run of the recording; without ground truth its world is the world of the scene.
    pub(super) fn new(number: usize, lane: &'a TrajectoryLane, run: Option<&RunRecord>, cursor_ns: i64) -> Self {
        let shown = lane.track.samples().partition_point(|sample| sample.stamp_ns <= cursor_ns);
        Self { number, lane, shown, world_from_own: lane.world_from_own(run) }
    }

    fn lines_m(&self, count: usize) -> Vec<Vec<Vector3<f64>>> {
        let samples = self.lane.track.samples();
        broken_line(count, |index| self.world_from_own.transform(&samples[index].world_from_imu.translation_m))
    }
}

/// Positions of `steps` steps as lines, interrupted where they are not finite. Long lines are thinned by a power of
/// two, so that the drawn points do not change with every step.
fn broken_line(steps: usize, position: impl Fn(usize) -> Vector3<f64>) -> Vec<Vec<Vector3<f64>>> {
    let mut stride = 1;
    while steps / stride > MAX_TRAJECTORY_POINTS {
        stride *= 2;
    }
    let mut lines = vec![Vec::new()];
    let last = steps.checked_sub(1).filter(|last| !last.is_multiple_of(stride));
    for step in (0..steps).step_by(stride).chain(last) {
        let point = position(step);
        if !point.iter().all(|coordinate| coordinate.is_finite()) {
            if lines.last().is_some_and(|line| !line.is_empty()) {
                lines.push(Vec::new());
            }
        } else if let Some(line) = lines.last_mut() {
            line.push(point);
        }
    }
    lines.retain(|line| !line.is_empty());
    lines
}

/// Points that a view of the flight must contain: all trajectories over the whole recording.
pub(super) fn framing_points_m(views: &[RunView<'_>], lanes: &[LaneView<'_>]) -> Vec<Vector3<f64>> {
    let whole = views.iter().map(RunView::whole);
    let lines = whole.flat_map(|run| run.trajectory_m().into_iter().chain(run.ground_truth_m()));
    let lines = lines.chain(lanes.iter().flat_map(|lane| lane.lines_m(lane.lane.track.samples().len())));
    let mut points: Vec<Vector3<f64>> = lines.flatten().collect();
    if let Some((low, high)) = bounds(&points) {
        // A short trajectory, such as hover, still gets a view of some metres.
        let room = Vector3::new(1.0, 1.0, 0.5) * (1.5 - (high - low).norm()).max(0.0);
        points.extend([low - room, high + room]);
    }
    points
}

fn bounds(points: &[Vector3<f64>]) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let first = *points.first()?;
    Some(points.iter().fold((first, first), |(low, high), point| (low.inf(point), high.sup(point))))
}

/// Height of the grid: zero, or the lowest point if the flight goes below.
pub(super) fn ground_height_m(points: &[Vector3<f64>]) -> f64 {
    points.iter().map(|point| point.z).fold(0.0, f64::min)
}

/// Builds the scene of the world. Objects without a physical size scale with `view_distance_m`.
pub(super) struct WorldBuilder<'a> {
    pub(super) theme: &'a Theme,
    pub(super) options: WorldOptions,
    pub(super) view_distance_m: f64,
    pub(super) scene: SceneModel,
    /// Heights in metres of the first and the last colour of the landmarks.
    pub(super) height_range_m: Option<(f64, f64)>,
}

impl<'a> WorldBuilder<'a> {
    pub(super) fn new(theme: &'a Theme, options: WorldOptions, view_distance_m: f64) -> Self {
        Self { theme, options, view_distance_m, scene: SceneModel::default(), height_range_m: None }
    }

    /// Draws a square grid under the flight; returns its spacing in metres.
    pub(super) fn ground(&mut self, points_m: &[Vector3<f64>]) -> f64 {
        let Some((low, high)) = bounds(points_m) else { return 1.0 };
        let extent_m = (high.x - low.x).max(high.y - low.y);
        let spacing_m = round_length(extent_m / 6.0);
        let height_m = ground_height_m(points_m);
        let cells = |from: f64, to: f64| ((from / spacing_m).floor() as i64 - 1)..=((to / spacing_m).ceil() as i64 + 1);
        let (columns, rows) = (cells(low.x, high.x), cells(low.y, high.y));
        let color = mix(self.theme.grid, self.theme.outline, 0.35);
        let strong = mix(self.theme.grid, self.theme.outline, 1.0);
        let ink = |index: i64| if index.rem_euclid(5) == 0 { strong } else { color };
        let place = |column: i64, row: i64| Vector3::new(column as f64 * spacing_m, row as f64 * spacing_m, height_m);
        for column in columns.clone() {
            let (from, to) = (place(column, *rows.start()), place(column, *rows.end()));
            self.scene.segment(from, to, ink(column), 1.0);
        }
        for row in rows.clone() {
            let (from, to) = (place(*columns.start(), row), place(*columns.end(), row));
            self.scene.segment(from, to, ink(row), 1.0);
        }
        spacing_m
    }

    /// Draws the ground-truth trajectory up to the cursor.
    pub(super) fn ground_truth(&mut self, view: &RunView<'_>) {
        let style = self.theme.ground_truth_style();
        for line in view.ground_truth_m() {
            self.scene.line(line, style.color, 1.5, style.dashes);
        }
    }

    /// Draws the antenna positions up to the cursor, where these are the ground truth.
    pub(super) fn true_positions(&mut self, truth: &PositionTruth, cursor_ns: i64) {
        let shown = truth.samples.partition_point(|sample| sample.stamp_ns <= cursor_ns);
        let style = self.theme.ground_truth_style();
        for line in broken_line(shown, |index| truth.samples[index].position_m) {
            self.scene.line(line, style.color, 1.5, style.dashes);
        }
    }

    /// Draws a run's trajectory and its newest camera.
    pub(super) fn run(&mut self, view: &RunView<'_>, camera: Option<&CameraModel>, image: Option<Arc<GrayImage>>) {
        let style = self.theme.run(view.number);
        for line in view.trajectory_m() {
            self.scene.line(line, style.color, 2.0, style.dashes);
        }
        let Some(frame) = view.newest() else { return };
        let world_from_imu = view.aligned * frame.world_from_imu;
        let world_from_camera = world_from_imu * frame.imu_from_camera;
        self.scene.label(world_from_imu.translation_m, view.run.spec.label.clone(), style.color);
        self.scene.axes(&world_from_imu, 0.05 * self.view_distance_m, axis_colors(self.theme), 2.5);
        if let Some(camera) = camera {
            let depth_m = if image.is_some() { 0.13 } else { 0.08 } * self.view_distance_m;
            let image = image.filter(|_| self.options.image);
            self.frustum(&world_from_camera, camera, depth_m, style.color, 1.8, image);
        }
    }

    /// Draws a trajectory of another program with its newest pose.
    pub(super) fn lane(&mut self, view: &LaneView<'_>) {
        let style = self.theme.trajectory(view.number);
        for line in view.lines_m(view.shown) {
            self.scene.line(line, style.color, 2.0, style.dashes);
        }
        let newest = view.shown.checked_sub(1).and_then(|index| view.lane.track.samples().get(index));
        let Some(newest) = newest else { return };
        let world_from_imu = view.world_from_own * newest.world_from_imu;
        self.scene.label(world_from_imu.translation_m, view.lane.label.clone(), style.color);
        self.scene.axes(&world_from_imu, 0.03 * self.view_distance_m, axis_colors(self.theme), 1.5);
    }

    /// Draws details of the selected run: window, landmarks, height above the ground.
    pub(super) fn details(&mut self, view: &RunView<'_>, camera: Option<&CameraModel>, ground_height_m: f64) {
        let Some(step) = view.step() else { return };
        if self.options.landmarks {
            self.landmarks(view);
        }
        let color = self.theme.run(view.number).color;
        let faint = mix(self.theme.plot_background, color, 0.5);
        if self.options.keyframes
            && let Some((_, older)) = step.report.window.split_last()
        {
            for frame in older {
                let world_from_imu = view.aligned * frame.world_from_imu;
                self.dot(world_from_imu.translation_m, color, if frame.keyframe { 3.0 } else { 2.0 });
                if let Some(camera) = camera.filter(|_| frame.keyframe) {
                    let pose = world_from_imu * frame.imu_from_camera;
                    self.frustum(&pose, camera, 0.03 * self.view_distance_m, faint, 1.0, None);
                }
            }
        }
        if self.options.tube {
            for line in view.tube_m() {
                self.scene.line(line, faint, 1.0, &[]);
            }
        }
        if let Some(frame) = view.newest() {
            let at = (view.aligned * frame.world_from_imu).translation_m;
            let foot = Vector3::new(at.x, at.y, ground_height_m);
            self.scene.line(vec![at, foot], faint, 1.0, &[2.0, 3.0]);
            self.dot(foot, faint, 2.5);
        }
    }

    fn dot(&mut self, position_m: Vector3<f64>, color: Color32, radius: f32) {
        self.scene.dots.push(Dot { position_m, color, radius });
    }

    /// Draws the landmarks of the step at the cursor, and paler the landmarks of earlier steps; viridis over their
    /// height.
    fn landmarks(&mut self, view: &RunView<'_>) {
        let steps = &view.run.steps[..view.shown];
        let Some(now) = view.step() else { return };
        let mut stride = 4;
        while steps.len() / stride > MAX_LANDMARK_STEPS {
            stride *= 2;
        }
        let mut latest: Vec<(u64, usize, Vector3<f64>)> = Vec::new();
        let mut take = |age: usize, landmarks: &[LandmarkReport]| {
            latest.extend(landmarks.iter().map(|landmark| (landmark.id.0, age, landmark.position_m)));
        };
        take(0, &now.report.landmarks);
        for (index, step) in steps.iter().enumerate().rev().filter(|(index, _)| index.is_multiple_of(stride)) {
            take(steps.len() - index, &step.report.landmarks);
        }
        latest.sort_by_key(|(id, age, _)| (*id, *age));
        latest.dedup_by_key(|(id, _, _)| *id);
        latest.retain(|(_, _, position)| position.iter().all(|coordinate| coordinate.is_finite()));
        latest.sort_by_key(|(id, age, _)| (*age > 0, std::cmp::Reverse(*id)));
        latest.truncate(MAX_LANDMARKS);
        for (_, _, position) in &mut latest {
            *position = view.aligned.transform(position);
        }
        self.height_range_m = height_range_m(latest.iter().map(|(_, _, position)| position.z));
        let Some((low_m, high_m)) = self.height_range_m else { return };
        for (_, age, position_m) in latest {
            let color = self.theme.height_color((position_m.z - low_m) / (high_m - low_m).max(1e-6));
            if age == 0 {
                self.dot(position_m, color, 2.0);
            } else {
                self.dot(position_m, mix(self.theme.plot_background, color, 0.6), 1.3);
            }
        }
    }

    /// Draws a camera's frustum, with the image at its far end.
    fn frustum(
        &mut self,
        world_from_camera: &RigidTransform,
        camera: &CameraModel,
        depth_m: f64,
        color: Color32,
        width: f32,
        image: Option<Arc<GrayImage>>,
    ) {
        let corners_m = frustum_corners(camera).map(|corner| world_from_camera.transform(&(corner * depth_m)));
        let apex = world_from_camera.translation_m;
        for (index, corner) in corners_m.iter().enumerate() {
            self.scene.segment(apex, *corner, color, width);
            self.scene.segment(*corner, corners_m[(index + 1) % 4], color, width);
        }
        // A small triangle marks the upper side of the image.
        let [left, right] = [corners_m[0], corners_m[1]];
        let above = (corners_m[0] - corners_m[3]) * 0.18 + (left + right) * 0.5;
        self.scene.line(vec![left + (right - left) * 0.35, above, left + (right - left) * 0.65], color, width, &[]);
        if let Some(image) = image {
            self.scene.images.push(ImageQuad { corners_m, image });
        }
    }
}

/// Range of heights of most landmarks in metres.
fn height_range_m(heights_m: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let mut heights: Vec<f64> = heights_m.collect();
    heights.sort_by(f64::total_cmp);
    let last = heights.len().checked_sub(1)?;
    Some((heights[last / 50], heights[last - last / 50]))
}

/// Corners of the image at unit depth in the camera frame: top left, top right, bottom right, bottom left.
fn frustum_corners(camera: &CameraModel) -> [Vector3<f64>; 4] {
    let [width, height] = camera.resolution_px.map(|side| side as f64 - 0.5);
    let [fx, fy, cx, cy] = camera.intrinsics_px;
    [(-0.5, -0.5), (width, -0.5), (width, height), (-0.5, height)].map(|(u, v)| {
        let bearing = camera.unproject(&Vector2::new(u, v)).filter(|bearing| bearing.z > 0.1);
        // Wide lenses have corners behind the image plane; there the corner of the pinhole model is used.
        bearing.map_or_else(|| Vector3::new((u - cx) / fx, (v - cy) / fy, 1.0), |bearing| bearing / bearing.z)
    })
}
