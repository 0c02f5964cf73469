//! Joint whose angles alone explain that a camera on the gimbal disagrees with other sources: what remains of the differences
//! beside rotations about its axis is noise.

use nalgebra::Vector3;

use super::compared::Compared;
use super::comparison::{AGREEING_MISFIT, LARGEST_MISFIT, root_mean_square};
use super::pair::Pair;
use super::source::Source;
use crate::geometry::{ns_from_seconds, seconds_from_ns, so3};
use crate::gimbal::{Chain, Parameterization};
use crate::log_check::rotations::data::{JOINED_S, MeasuredRotation, joined};

/// Difference of a rotation from its prediction, camera frame, in radians, with the directions of the joints' axes.
struct Difference {
    time_s: f64,
    rotation: Vector3<f64>,
    axes: Vec<Vector3<f64>>,
}

impl Compared<'_> {
    /// The pairs with the wrong joint in place of the images of a camera on the gimbal that disagree with the gyroscope;
    /// `None` unless it is one joint alone.
    pub(super) fn of_joint(&self, images: &Source, pairs: &[Pair]) -> Option<Vec<Pair>> {
        let Source::Images { camera_key, with_joints: true } = images else { return None };
        let pair =
            pairs.iter().find(|pair| pair.sources.contains(images) && pair.sources.contains(&Source::Gyroscope))?;
        let differences = self.differences(camera_key)?;
        let interval = pair.fit.disagrees?;
        let inside = |it: &&Difference| {
            interval.since_s.is_none_or(|since_s| it.time_s >= since_s)
                && interval.until_s.is_none_or(|until_s| it.time_s <= until_s)
        };
        // Two axes remain beside the one of a joint: as many standard deviations as of three axes.
        let misfit = |joint: usize| {
            let beside = |it: &Difference| {
                let axis = it.axes[joint];
                (it.rotation - axis * axis.dot(&it.rotation)).norm() / (2.0_f64.sqrt() * pair.fit.noise)
            };
            root_mean_square(&differences.iter().filter(inside).map(beside).collect::<Vec<_>>())
        };
        let names = self.rig.joint_names();
        let misfits: Vec<f64> = (0..names.len()).map(misfit).collect();
        let explained = |misfit: &f64| *misfit < AGREEING_MISFIT;
        let joint = misfits.iter().position(explained)?;
        let others = misfits.iter().enumerate().filter(|(other, _)| *other != joint);
        if others.clone().next().is_none()
            || others.clone().any(|(_, misfit)| *misfit < LARGEST_MISFIT * misfits[joint])
        {
            return None;
        }
        let of_joint = Source::Joint { joint: names[joint].clone(), camera_key: camera_key.clone() };
        let replaced = |source: &Source| if source == images { of_joint.clone() } else { source.clone() };
        let replace = |pair: &Pair| Pair { sources: pair.sources.each_ref().map(replaced), ..pair.clone() };
        Some(pairs.iter().map(replace).collect())
    }

    fn differences(&self, camera_key: &str) -> Option<Vec<Difference>> {
        let camera = self.rig.camera(camera_key).ok()?;
        let classical = self.rig.chain_of_camera(camera_key)?;
        let chain = Chain::from_classical(&classical, Parameterization::Classical);
        let difference = |rotation: &MeasuredRotation| {
            let shift_ns = ns_from_seconds(camera.timeshift_cam_imu_s);
            let stamps_ns = [rotation.rotation.from_ns, rotation.rotation.to_ns].map(|stamp_ns| stamp_ns + shift_ns);
            let [from, to] = stamps_ns.map(|stamp_ns| Some(chain.linearize(&self.survey.joint_angles_at(stamp_ns)?)));
            let (from, to) = (from?, to?);
            let [from_s, to_s] = stamps_ns.map(seconds_from_ns);
            let of_imu = self.imu_facts.gyroscope.rotation_between(from_s, to_s)?;
            let predicted = to.imu_from_camera.rotation.inverse() * of_imu * from.imu_from_camera.rotation;
            let axes = to.by_joints.column_iter().map(|column| column.fixed_rows::<3>(0).into_owned().normalize());
            Some(Difference {
                time_s: 0.5 * (from_s + to_s),
                rotation: so3::log(&rotation.rotation.second_from_first) - so3::log(&predicted),
                axes: axes.collect(),
            })
        };
        Some(joined(self.measured.get(camera_key)?, JOINED_S).iter().filter_map(difference).collect())
    }
}
