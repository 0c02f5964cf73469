//! Measurements in the axes of another frame than their own: angular rates in the world, joint angles relative to the horizon.

use nalgebra::{UnitQuaternion, Vector3};

use super::compared::Compared;
use super::comparison::{AGREEING_MISFIT, LARGEST_MISFIT};
use super::orientations::Orientations;
use super::pair::Pair;
use super::rotation;
use super::source::Source;
use super::statement::{Statement, misfits_text};
use crate::faults::{Area, Fault, FaultKind, Severity};
use crate::geometry::seconds_from_ns;
use crate::sensors::{AngularRates, CameraMount};

/// Ratio of the misfit in another frame to the misfit as recorded up to which they agree.
const FRAME_RATIO: f64 = 0.1;

impl Compared<'_> {
    /// Statement about a suspected source that agrees with another one if its measurements belong to another frame.
    pub(super) fn other_frame(&self, suspected: &[&Source], pairs: &[Pair]) -> Option<Statement> {
        suspected.iter().find_map(|source| match source {
            Source::Gyroscope => self.rates_in_world(pairs),
            Source::Images { camera_key, with_joints: true } => self.joints_by_horizon(source, camera_key, pairs),
            _ => None,
        })
    }

    /// Angular rates with the axes of the world.
    fn rates_in_world(&self, pairs: &[Pair]) -> Option<Statement> {
        // Rates of the world multiply from the left: the inverse of the orientation by the reversed rates.
        // A bias measured at rest is no constant there.
        let samples = self.imu_facts.samples.iter();
        let reversed = AngularRates::new(
            samples.map(|sample| (seconds_from_ns(sample.stamp_ns), -sample.angular_velocity_rad_per_s)),
        );
        let noise_rad2_per_s = self.rig.imu.noise.gyroscope_noise_density.powi(2);
        let node =
            |time_s: f64| Some((time_s, reversed.orientation_at(time_s)?.inverse(), noise_rad2_per_s * time_s, 0.0));
        let times_s = self.imu_facts.samples.iter().map(|sample| seconds_from_ns(sample.stamp_ns));
        let in_world = Orientations::of_nodes(Source::Gyroscope, times_s.filter_map(node));
        let misfits = self.agreement_with(&in_world, &Source::Gyroscope, pairs)?;
        Some(Statement::of_cause(
            (Severity::Error, Area::Imu),
            "the angular rates have the axes of the world, not of the IMU".to_owned(),
            misfits_text("the gyroscope", "in the axes of the world", misfits),
            "publish the angular velocity in the axes of the IMU, as sensor_msgs/Imu requires: rotate it by the inverse of the \
             orientation"
                .to_owned(),
            vec![Source::Gyroscope],
            Some(FaultKind::UnusableImu.into()),
        ))
    }

    /// Joint angles of roll and pitch relative to the horizon: camera and joints give the heading of the vehicle alone.
    fn joints_by_horizon(&self, images: &Source, camera_key: &str, pairs: &[Pair]) -> Option<Statement> {
        let camera = self.rig.cameras.iter().find(|it| it.key == *camera_key && it.mount == CameraMount::Gimbal)?;
        let by_joints = Orientations::of_images(self, camera, camera_key)?;
        let given = pairs.iter().find(|pair| {
            pair.sources.contains(images) && pair.sources.contains(&Source::Gyroscope) && pair.fit.disagrees.is_some()
        })?;
        let (_, fit, _) = rotation::compare(&by_joints, &self.heading()?)?;
        let agrees = given.fit.misfit > LARGEST_MISFIT && fit.disagrees.is_none() && fit.misfit < AGREEING_MISFIT;
        agrees.then(|| {
            Statement::of_cause(
                (Severity::Error, Area::Encoders),
                "the joint angles are relative to the horizon, not to the vehicle".to_owned(),
                misfits_text(
                    &images.name(),
                    "with the heading of the vehicle alone",
                    [given.fit.misfit, fit.misfit],
                ),
                "record the readings of the encoders, or record the attitude of the gimbal and name it in gimbal.source"
                    .to_owned(),
                vec![images.clone()],
                Some(Fault::from(FaultKind::UnusableJoints)),
            )
        })
    }

    /// Orientation of the vehicle without its roll and pitch, by the gyroscope from the vertical at one time on.
    fn heading(&self) -> Option<Orientations> {
        let (stamp_ns, force) = self.imu_facts.up?;
        let gyroscope = &self.imu_facts.gyroscope;
        let up_in_imu = force.try_normalize(1e-6)?;
        let fixed_from_imu = gyroscope.orientation_at(seconds_from_ns(stamp_ns))?;
        let up_in_fixed = fixed_from_imu * up_in_imu;
        let world_from_fixed = UnitQuaternion::rotation_between(&up_in_fixed, &Vector3::z())?;
        let noise_rad2_per_s = self.rig.imu.noise.gyroscope_noise_density.powi(2);
        let node = |time_s: f64| {
            let world_from_imu = world_from_fixed * gyroscope.orientation_at(time_s)?;
            let heading_rad = world_from_imu.euler_angles().2;
            let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading_rad);
            Some((time_s, heading, noise_rad2_per_s * time_s, 0.0))
        };
        let times_s = self.imu_facts.samples.iter().map(|sample| seconds_from_ns(sample.stamp_ns));
        Some(Orientations::of_nodes(Source::Gyroscope, times_s.filter_map(node)))
    }

    /// Misfits of a source with one that it disagrees with, as recorded and as given here; `None` unless they agree then.
    fn agreement_with(&self, changed: &Orientations, source: &Source, pairs: &[Pair]) -> Option<[f64; 2]> {
        let disagreeing = pairs.iter().filter(|pair| pair.sources.contains(source) && pair.fit.disagrees.is_some());
        let sharpest = disagreeing.min_by(|one, other| one.fit.noise.total_cmp(&other.fit.noise))?;
        let other = sharpest.sources.iter().find(|it| *it != source)?;
        let other = Orientations::all(self).into_iter().find(|it| it.source == *other)?;
        let (_, fit, _) = rotation::compare(changed, &other)?;
        // Rates in the world have no constant bias.
        let agrees = sharpest.fit.misfit > LARGEST_MISFIT && fit.misfit < FRAME_RATIO * sharpest.fit.misfit;
        agrees.then_some([sharpest.fit.misfit, fit.misfit])
    }
}
