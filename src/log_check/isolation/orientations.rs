//! Orientation of the vehicle's IMU over time, by each source that measures rotation.

use nalgebra::UnitQuaternion;

use super::compared::{Compared, Poses};
use super::source::Source;
use crate::geometry::{ns_from_seconds, seconds_from_ns, so3};
use crate::log_check::rotations::data::MeasuredRotation;
use crate::log_check::statistics::median;
use crate::sensors::{AngularRates, CameraMount, CameraRig};

/// Orientations farther apart are not interpolated, in seconds.
const MAX_GAP_S: f64 = 0.3;
/// Step between the orientations of the IMU on the gimbal, in seconds.
const GIMBAL_STEP_S: f64 = 0.05;

/// Orientation at one time.
#[derive(Clone, Copy, Debug)]
struct Node {
    time_s: f64,
    /// `fixed_from_imu`, up to a constant rotation on either side and a new one for each segment.
    orientation: UnitQuaternion<f64>,
    /// Orientations of different segments are not compared.
    segment: usize,
    /// Variance that has accumulated since the first one, and variance of this one alone, per axis in rad².
    accumulated_rad2: f64,
    variance_rad2: f64,
}

/// Orientations of the IMU by one source, ordered by time.
#[derive(Clone, Debug)]
pub(super) struct Orientations {
    pub(super) source: Source,
    nodes: Vec<Node>,
}

impl Orientations {
    /// Orientations of all sources of a log; sources without measurements are omitted.
    pub(super) fn all(compared: &Compared<'_>) -> Vec<Self> {
        let cameras = compared.rig.cameras.iter();
        let images = cameras.filter_map(|camera| Self::of_images(compared, camera, &camera.key));
        let all = [Some(Self::of_gyroscope(compared)), Self::of_truth(compared.poses), Self::of_attitude(compared)];
        let mut found: Vec<Self> = all.into_iter().flatten().chain(images).collect();
        found.extend(Self::of_gimbal_imu(compared));
        found.retain(|it| !it.nodes.is_empty());
        found
    }

    pub(super) fn of_gyroscope(compared: &Compared<'_>) -> Self {
        let noise_rad2_per_s = compared.rig.imu.noise.gyroscope_noise_density.powi(2);
        let gyroscope = &compared.imu_facts.gyroscope;
        let node = |time_s: f64| Some((time_s, gyroscope.orientation_at(time_s)?, noise_rad2_per_s * time_s, 0.0));
        let times_s = compared.imu_facts.samples.iter().map(|sample| seconds_from_ns(sample.stamp_ns));
        Self::of_nodes(Source::Gyroscope, times_s.filter_map(node))
    }

    pub(super) fn of_truth(poses: &Poses) -> Option<Self> {
        let nodes = poses.iter().map(|(stamp_ns, pose)| (seconds_from_ns(*stamp_ns), pose.rotation, 0.0, 0.0));
        (!poses.is_empty()).then(|| Self::of_nodes(Source::GroundTruth, nodes))
    }

    fn of_attitude(compared: &Compared<'_>) -> Option<Self> {
        let source = compared.rig.gimbal.as_ref()?.attitude.as_ref()?;
        let topic = compared.rig.vehicle_topic()?;
        let attitudes = compared.survey.attitude.as_ref()?.vehicle_in_enu(source);
        let nodes = attitudes.into_iter().map(|(stamp_ns, rotation)| (seconds_from_ns(stamp_ns), rotation, 0.0, 0.0));
        Some(Self::of_nodes(Source::Attitude(topic.to_owned()), nodes))
    }

    /// Rotations of the images of `images_key` as if a camera had taken them.
    pub(super) fn of_images(compared: &Compared<'_>, camera: &CameraRig, images_key: &str) -> Option<Self> {
        let measured = compared.measured.get(images_key).filter(|measured| !measured.is_empty())?;
        let source =
            Source::Images { camera_key: camera.key.clone(), with_joints: camera.mount == CameraMount::Gimbal };
        let mut found = Self { source, nodes: Vec::new() };
        let (mut orientation, mut accumulated_rad2, mut segment) = (UnitQuaternion::identity(), 0.0, 0);
        let mut last_ns = None;
        for MeasuredRotation { rotation, covariance_rad2, .. } in measured {
            if last_ns != Some(rotation.from_ns) {
                segment += 1;
                found.push_image(compared, camera, (rotation.from_ns, orientation), accumulated_rad2, &mut segment);
            }
            orientation *= rotation.second_from_first.inverse();
            accumulated_rad2 += covariance_rad2.trace() / 3.0;
            found.push_image(compared, camera, (rotation.to_ns, orientation), accumulated_rad2, &mut segment);
            last_ns = Some(rotation.to_ns);
        }
        Some(found)
    }

    /// Adds the orientation of the IMU with that of a camera at the stamp of an image, `fixed_from_camera`.
    fn push_image(
        &mut self,
        compared: &Compared<'_>,
        camera: &CameraRig,
        (stamp_ns, orientation): (i64, UnitQuaternion<f64>),
        accumulated_rad2: f64,
        segment: &mut usize,
    ) {
        let time_s = seconds_from_ns(stamp_ns) + camera.timeshift_cam_imu_s;
        match imu_from_camera(compared, camera, time_s) {
            Some((imu_from_camera, variance_rad2)) => self.nodes.push(Node {
                time_s,
                orientation: orientation * imu_from_camera.inverse(),
                segment: *segment,
                accumulated_rad2,
                variance_rad2,
            }),
            None => *segment += 1,
        }
    }

    fn of_gimbal_imu(compared: &Compared<'_>) -> Option<Self> {
        let imu = compared.rig.gimbal_imu.as_ref().filter(|_| !compared.survey.gimbal_imu.is_empty())?;
        let camera = compared.rig.cameras.iter().find(|camera| camera.mount == CameraMount::Gimbal)?;
        let rates = AngularRates::new(compared.survey.gimbal_imu.iter().map(|sample| {
            let time_s = seconds_from_ns(sample.stamp_ns) + imu.timeshift_s;
            (time_s, imu.camera_from_imu.rotation * sample.angular_velocity_rad_per_s)
        }));
        let noise_rad2_per_s = imu.sensor.noise.gyroscope_noise_density.powi(2);
        let (first_s, last_s) = rates.range_s()?;
        let steps = ((last_s - first_s) / GIMBAL_STEP_S) as usize;
        let node = |step: usize| {
            let time_s = first_s + step as f64 * GIMBAL_STEP_S;
            let (imu_from_camera, variance_rad2) = imu_from_camera(compared, camera, time_s)?;
            let orientation = rates.orientation_at(time_s)? * imu_from_camera.inverse();
            Some((time_s, orientation, noise_rad2_per_s * time_s, variance_rad2))
        };
        Some(Self::of_nodes(Source::GimbalImu, (0..=steps).filter_map(node)))
    }

    /// Orientations with their accumulated and own variances; a gap begins a new segment.
    pub(super) fn of_nodes(source: Source, nodes: impl Iterator<Item = (f64, UnitQuaternion<f64>, f64, f64)>) -> Self {
        let mut found: Vec<Node> = Vec::new();
        for (time_s, orientation, accumulated_rad2, variance_rad2) in nodes {
            let segment = match found.last() {
                Some(last) if time_s <= last.time_s => continue,
                Some(last) => last.segment + usize::from(time_s - last.time_s > MAX_GAP_S),
                None => 0,
            };
            found.push(Node { time_s, orientation, segment, accumulated_rad2, variance_rad2 });
        }
        Self { source, nodes: found }
    }

    /// Median time between orientations in seconds.
    pub(super) fn spacing_s(&self) -> f64 {
        median(&self.nodes.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect::<Vec<_>>())
    }

    /// Consecutive intervals of at least `length_s` between orientations of one segment.
    pub(super) fn intervals_s(&self, length_s: f64) -> Vec<[f64; 2]> {
        let mut intervals = Vec::new();
        let mut start: Option<&Node> = None;
        for node in &self.nodes {
            match start.filter(|start| start.segment == node.segment) {
                Some(from) if node.time_s - from.time_s >= length_s => {
                    intervals.push([from.time_s, node.time_s]);
                    start = Some(node);
                }
                Some(_) => {}
                None => start = Some(node),
            }
        }
        intervals
    }

    /// Rotation `second_from_first` of the IMU between two times with its variance per axis in rad².
    pub(super) fn rotation_between(&self, from_s: f64, to_s: f64) -> Option<(UnitQuaternion<f64>, f64)> {
        let (from, to) = (self.at(from_s)?, self.at(to_s)?);
        let variance_rad2 = to.accumulated_rad2 - from.accumulated_rad2 + from.variance_rad2 + to.variance_rad2;
        (from.segment == to.segment).then(|| (to.orientation.inverse() * from.orientation, variance_rad2))
    }

    /// Orientation at a time, on the shortest rotation between its neighbours.
    fn at(&self, time_s: f64) -> Option<Node> {
        let after = self.nodes.partition_point(|node| node.time_s < time_s);
        let to = self.nodes.get(after)?;
        let Some(from) = after.checked_sub(1).and_then(|before| self.nodes.get(before)) else {
            return (to.time_s <= time_s).then_some(*to);
        };
        if to.segment != from.segment {
            return (to.time_s <= time_s).then_some(*to);
        }
        let fraction = (time_s - from.time_s) / (to.time_s - from.time_s);
        let step = so3::log(&(from.orientation.inverse() * to.orientation));
        let between = |from: f64, to: f64| from + fraction * (to - from);
        Some(Node {
            time_s,
            orientation: so3::plus(&from.orientation, &(step * fraction)),
            segment: to.segment,
            accumulated_rad2: between(from.accumulated_rad2, to.accumulated_rad2),
            variance_rad2: between(from.variance_rad2, to.variance_rad2),
        })
    }
}

/// Orientation `imu_from_camera` at a time with its variance per axis in rad², by the joint angles for a camera on the
/// gimbal.
pub(super) fn imu_from_camera(
    compared: &Compared<'_>,
    camera: &CameraRig,
    time_s: f64,
) -> Option<(UnitQuaternion<f64>, f64)> {
    let chain = compared.rig.chain_of_camera(&camera.key)?;
    if chain.links.is_empty() {
        return Some((chain.imu_from_camera(&[]).rotation, 0.0));
    }
    let fitted = compared.survey.fitted_angles_at(ns_from_seconds(time_s))?;
    let angles_rad: Vec<f64> = fitted.iter().map(|angle| angle.angle_rad).collect();
    let variances = fitted.iter().zip(&compared.joint_noise_ratios).map(|(angle, ratio)| angle.variance_rad2 * ratio);
    let variance_rad2 = variances.sum::<f64>() / 3.0;
    Some((chain.imu_from_camera(&angles_rad).rotation, variance_rad2))
}
