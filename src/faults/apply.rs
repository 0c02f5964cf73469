//! Correction of measurements by faults: samples, joint angles, pixels and bearings, stamps. The inverse of a fault plants it.

use std::f64::consts::TAU;

use nalgebra::{Vector2, Vector3};

use super::fault::{Choice, Fault, ImageFlip};
use super::table::{Change, FaultKind, Sensor};
use crate::camera::{CameraModel, Distortion};
use crate::sensors::{ImuSample, JointAngles};

/// Pinhole intrinsics relative to the rig's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensChange {
    /// Ratio of the true focal length to the rig's.
    pub focal: f64,
    /// Offset of the true principal point in units of the rig's focal length.
    pub centre: [f64; 2],
    /// Coefficient `λ` of the distortion that the rig lacks, by the division model (Fitzgibbon, "Simultaneous linear estimation
    /// of multiple view geometry and lens distortion", CVPR 2001): `x_true = x / (1 + λ r²)`. About `k1` of a radial model.
    pub radial: f64,
}

/// True angle of a joint from readings: `scale · reading(source) + offset_rad`, and `play_rad` times the direction of motion,
/// from −1 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMap {
    /// Joint of the rig under whose name the readings are recorded.
    pub source: usize,
    pub scale: f64,
    pub offset_rad: f64,
    pub play_rad: f64,
}

impl LensChange {
    pub const NONE: Self = Self { focal: 1.0, centre: [0.0; 2], radial: 0.0 };

    /// Camera with these intrinsics from one with the rig's. A distortion that the rig lacks is added to `k1`, which equals the
    /// division model to first order; to lenses without such a coefficient none is added.
    pub fn camera(&self, rig: &CameraModel) -> CameraModel {
        let mut camera = rig.clone();
        match &mut camera.distortion {
            Distortion::None if self.radial != 0.0 => {
                camera.distortion = Distortion::Radtan([self.radial, 0.0, 0.0, 0.0]);
            }
            Distortion::Radtan([k1, ..]) => *k1 += self.radial,
            _ => {}
        }
        let [fx, fy, cx, cy] = rig.intrinsics_px;
        let [dx, dy] = self.centre;
        camera.intrinsics_px = [fx * self.focal, fy * self.focal, cx + dx * fx, cy + dy * fy];
        camera
    }

    /// Bearing with these intrinsics from one with the rig's.
    pub fn bearing(&self, bearing: &Vector3<f64>) -> Vector3<f64> {
        let [x, y] = [0, 1].map(|axis| (bearing[axis] - self.centre[axis] * bearing.z) / self.focal);
        let z = bearing.z;
        // In units of z: x / (1 + λ r²) : 1 = x : 1 + λ r².
        let z = if self.radial == 0.0 || z <= 0.0 { z } else { z * (1.0 + self.radial * (x * x + y * y) / (z * z)) };
        Vector3::new(x, y, z).normalize()
    }

    /// Approximate rotation vector with these intrinsics from one with the rig's: a shorter focal length widens rotations
    /// across the optical axis.
    pub fn rotation(&self, rotation: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(rotation.x / self.focal, rotation.y / self.focal, rotation.z)
    }
}

impl Fault {
    /// The fault that undoes this one as a correction: as a correction it plants this fault into sound measurements.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let mut inverse = self.clone();
        match self.kind {
            FaultKind::Zoom => inverse.values[0] = self.value(0).recip(),
            // With r' = −r + offset follows r = −r' + offset.
            FaultKind::JointReversed => {}
            FaultKind::JointsSwapped => {
                inverse.joints = self.joints.chunks(2).rev().flatten().cloned().collect();
            }
            FaultKind::Intrinsics => {
                let [focal, x, y] = [0, 1, 2].map(|number| self.value(number));
                inverse.values = vec![focal.recip(), -x / focal, -y / focal];
            }
            _ => {
                for (number, value) in inverse.values.iter_mut().enumerate() {
                    let is_ratio = self.kind.row().change(number) == Change::Ratio;
                    *value = if is_ratio { value.recip() } else { -*value };
                }
            }
        }
        inverse.choice = self.axes().map(|axes| Choice::Axes(axes.inverse())).or(self.choice);
        inverse
    }

    /// True if the correction changes measurements of this sensor.
    pub fn corrects(&self, sensor: Sensor) -> bool {
        let row = self.kind.row();
        row.sensor == sensor && row.correction.is_some() && self.kind != FaultKind::CameraClock
    }

    /// Corrected angular velocity in rad/s.
    pub fn angular_velocity(&self, rate: &Vector3<f64>) -> Vector3<f64> {
        match (self.kind, self.axes()) {
            (FaultKind::ImuAxes | FaultKind::GyroscopeAxes, Some(axes)) => axes.apply(rate),
            (FaultKind::GyroscopeScale, _) => rate * self.value(0),
            _ => *rate,
        }
    }

    /// Corrected specific force in m/s².
    pub fn specific_force(&self, force: &Vector3<f64>) -> Vector3<f64> {
        match (self.kind, self.axes()) {
            (FaultKind::ImuAxes | FaultKind::AccelerometerAxes, Some(axes)) => axes.apply(force),
            (FaultKind::AccelerometerScale, _) => force * self.value(0),
            _ => *force,
        }
    }

    pub fn imu_sample(&self, sample: &ImuSample) -> ImuSample {
        ImuSample {
            stamp_ns: sample.stamp_ns,
            angular_velocity_rad_per_s: self.angular_velocity(&sample.angular_velocity_rad_per_s),
            specific_force_m_per_s2: self.specific_force(&sample.specific_force_m_per_s2),
            unmeasured_s: sample.unmeasured_s,
        }
    }

    /// Seconds to add to a stamp of the camera, in seconds since the log began, beyond the rig's time offset.
    pub fn camera_shift_s(&self, stamp_s: f64) -> f64 {
        match self.kind {
            FaultKind::CameraClock => self.value(0),
            FaultKind::CameraDrift => self.value(0) + self.value(1) * stamp_s,
            _ => 0.0,
        }
    }

    /// Seconds to add to the stamps of joint angles beyond the rig's time offset.
    pub fn joint_shift_s(&self) -> f64 {
        if self.kind == FaultKind::EncoderClock { self.value(0) } else { 0.0 }
    }

    /// Intrinsics of the camera relative to the rig's.
    pub fn lens(&self) -> LensChange {
        match self.kind {
            FaultKind::Focal => LensChange { focal: self.value(0), ..LensChange::NONE },
            FaultKind::PrincipalPoint => LensChange { centre: [self.value(0), self.value(1)], ..LensChange::NONE },
            FaultKind::Intrinsics => {
                LensChange { focal: self.value(0), centre: [self.value(1), self.value(2)], ..LensChange::NONE }
            }
            FaultKind::Radial => LensChange { radial: self.value(0), ..LensChange::NONE },
            _ => LensChange::NONE,
        }
    }

    /// Ratio of the true focal length to the rig's, `since_s` seconds after a change began.
    pub fn focal_factor(&self, since_s: f64) -> f64 {
        match self.kind {
            FaultKind::Zoom => {
                let (factor, over_s) = (self.value(0), self.value(1));
                let reached = if over_s > 0.0 { (since_s / over_s).clamp(0.0, 1.0) } else { 1.0 };
                1.0 + (factor - 1.0) * reached
            }
            FaultKind::FocalPeriod => 1.0 + (self.value(0) - 1.0) * (TAU * since_s / self.value(1)).sin(),
            _ => self.lens().focal,
        }
    }

    /// Pixel at which the rig's camera would see the direction of a pixel, `since_s` seconds after a change began; `None`
    /// if it is not used or outside of the camera's domain.
    pub fn pixel(&self, camera: &CameraModel, uv_px: Vector2<f64>, since_s: f64) -> Option<Vector2<f64>> {
        let [width, height] = camera.resolution_px.map(|size| size as f64);
        let (left, top) = (width - 1.0 - uv_px.x, height - 1.0 - uv_px.y);
        match (self.kind, self.choice) {
            (FaultKind::Focal | FaultKind::Zoom, _) => {
                let lens = LensChange { focal: self.focal_factor(since_s), ..LensChange::NONE };
                camera.project(&lens.camera(camera).unproject(&uv_px)?)
            }
            (_, Some(Choice::Flip(ImageFlip::Mirrored))) => Some(Vector2::new(left, uv_px.y)),
            (_, Some(Choice::Flip(ImageFlip::Flipped))) => Some(Vector2::new(uv_px.x, top)),
            (_, Some(Choice::Flip(ImageFlip::UpsideDown))) => Some(Vector2::new(left, top)),
            (_, Some(Choice::Half(half))) => (!half.contains(&uv_px, camera.resolution_px)).then_some(uv_px),
            _ => Some(uv_px),
        }
    }

    /// Changes the maps of the joints with these names.
    fn change_maps(&self, names: &[String], maps: &mut [JointMap]) {
        let places: Vec<usize> =
            self.joints.iter().filter_map(|joint| names.iter().position(|name| name == joint)).collect();
        match self.kind {
            FaultKind::JointReversed => {
                for (number, place) in places.into_iter().enumerate() {
                    let JointMap { source, scale, offset_rad, play_rad } = maps[place];
                    let offset_rad = self.value(number) - offset_rad;
                    maps[place] = JointMap { source, scale: -scale, offset_rad, play_rad: -play_rad };
                }
            }
            FaultKind::JointsSwapped => places.chunks_exact(2).for_each(|pair| maps.swap(pair[0], pair[1])),
            FaultKind::JointOffset => places.into_iter().for_each(|place| maps[place].offset_rad += self.value(0)),
            FaultKind::JointPlay => places.into_iter().for_each(|place| maps[place].play_rad += self.value(0)),
            FaultKind::JointScale => {
                let is_faulty = |place: usize| self.joints.is_empty() || places.contains(&place);
                for (_, map) in maps.iter_mut().enumerate().filter(|(place, _)| is_faulty(*place)) {
                    map.scale *= self.value(0);
                    map.offset_rad *= self.value(0);
                }
            }
            _ => {}
        }
    }
}

/// Checks that all joints of faults are among these names.
///
/// # Errors
/// The first joint that is not.
pub fn check_joints(faults: &[Fault], names: &[String]) -> Result<(), String> {
    match faults.iter().flat_map(|fault| &fault.joints).find(|joint| !names.contains(joint)) {
        Some(joint) => Err(format!("the rig has no joint '{joint}'; it has: {}", names.join(", "))),
        None => Ok(()),
    }
}

/// Maps of the readings of joints with these names, after all faults in their order.
pub fn joint_maps<'a>(faults: impl IntoIterator<Item = &'a Fault>, names: &[String]) -> Vec<JointMap> {
    let mut maps: Vec<JointMap> =
        (0..names.len()).map(|source| JointMap { source, scale: 1.0, offset_rad: 0.0, play_rad: 0.0 }).collect();
    faults.into_iter().for_each(|fault| fault.change_maps(names, &mut maps));
    maps
}

/// Corrects the angles of joints with these names at an image; shifts of the stamps of image and angles follow the parabola
/// of each joint.
pub fn correct_joint_angles(faults: &[Fault], names: &[String], angles: &mut JointAngles) {
    let given = angles.clone();
    let count = given.angles_rad.len();
    for (joint, map) in joint_maps(faults, names).into_iter().enumerate() {
        let JointMap { source, scale, offset_rad, .. } = map;
        let is_changed = source != joint || scale != 1.0 || offset_rad != 0.0;
        if !is_changed || joint.max(source) >= count {
            continue;
        }
        angles.angles_rad[joint] = scale * given.angles_rad[source] + offset_rad;
        take(&mut angles.sigmas_rad, &given.sigmas_rad, joint, source, 1.0);
        take(&mut angles.lasting_sigmas_rad, &given.lasting_sigmas_rad, joint, source, 1.0);
        take(&mut angles.rates_rad_per_s, &given.rates_rad_per_s, joint, source, scale);
        if let (Some(fit), Some(of_source)) = (angles.motion_fits.get_mut(joint), given.motion_fits.get(source)) {
            *fit = *of_source;
            fit.acceleration_rad_per_s2 *= scale;
        }
    }
    let after_s = faults.iter().map(|fault| fault.camera_shift_s(0.0) - fault.joint_shift_s()).sum::<f64>();
    if after_s == 0.0 {
        return;
    }
    for joint in 0..count {
        let rate = angles.rates_rad_per_s.get(joint).copied().unwrap_or(0.0);
        let acceleration = angles.motion_fits.get(joint).map_or(0.0, |fit| fit.acceleration_rad_per_s2);
        angles.angles_rad[joint] += after_s * (rate + 0.5 * after_s * acceleration);
        if let Some(rate) = angles.rates_rad_per_s.get_mut(joint) {
            *rate += after_s * acceleration;
        }
    }
}

/// Takes the value of another joint times a factor, where both lists have it.
fn take(to: &mut [f64], from: &[f64], joint: usize, source: usize, factor: f64) {
    if let (Some(to), Some(from)) = (to.get_mut(joint), from.get(source)) {
        *to = factor * from;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn names() -> Vec<String> {
        ["yaw", "roll", "pitch"].map(str::to_owned).to_vec()
    }

    #[test]
    fn the_inverse_of_a_fault_plants_it() {
        let sample = ImuSample {
            stamp_ns: 7,
            angular_velocity_rad_per_s: Vector3::new(0.1, 0.2, 0.3),
            specific_force_m_per_s2: Vector3::new(1.0, 2.0, 9.0),
            unmeasured_s: 0.0,
        };
        let angles = JointAngles { angles_rad: vec![0.1, 0.2, 0.3], ..JointAngles::default() };
        for text in [
            "gyroscope-scale:0.5",
            "accelerometer-scale:9.8",
            "imu-axes:y/-x/z",
            "gyroscope-axes:z/x/y",
            "accelerometer-axes:x/-y/z",
            "reversed:roll",
            "swapped:yaw:pitch",
            "offset:pitch:0.2rad",
            "joint-scale:57.3",
        ] {
            let fault: Fault = text.parse().unwrap();
            let restored = fault.imu_sample(&fault.inverse().imu_sample(&sample));
            assert!((restored.angular_velocity_rad_per_s - sample.angular_velocity_rad_per_s).norm() < 1e-12, "{text}");
            assert!((restored.specific_force_m_per_s2 - sample.specific_force_m_per_s2).norm() < 1e-12, "{text}");
            let mut planted = angles.clone();
            correct_joint_angles(&[fault.inverse()], &names(), &mut planted);
            correct_joint_angles(&[fault], &names(), &mut planted);
            let pairs = planted.angles_rad.iter().zip(&angles.angles_rad);
            assert!(pairs.fold(0.0, |sum, (one, other)| sum + (one - other).abs()) < 1e-12, "{text}: {planted:?}");
        }
        let lens = Fault::new(FaultKind::Intrinsics, &[1.2, 0.1, -0.05]);
        let bearing = Vector3::new(0.2, 0.1, 1.0).normalize();
        let restored = lens.lens().bearing(&lens.inverse().lens().bearing(&bearing));
        assert!((restored - bearing).norm() < 1e-12, "{restored}");
    }

    #[test]
    fn pairs_of_joints_are_exchanged_one_after_the_other() {
        let swapped =
            Fault::from(FaultKind::JointsSwapped).of_joints(&["yaw", "pitch", "roll", "pitch"].map(str::to_owned));
        let sources: Vec<usize> = joint_maps([&swapped], &names()).iter().map(|map| map.source).collect();
        assert_eq!(sources, [2, 0, 1]);
    }
}
