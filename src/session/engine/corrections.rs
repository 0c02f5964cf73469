//! Corrections of a fork, applied to the measurements of its steps.

use nalgebra::{Matrix3, Vector2};

use crate::camera::CameraModel;
use crate::frontend::{TrackedFeature, TrackedFrame};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::sensors::{ImuSample, JointAngles, Rig};
use crate::session::plan::{ForkError, ImageFlip, ImageHalf, MeasurementCorrection};

/// Steps of a fork with another offset of a joint whose readings are not used.
const UNREAD_STEPS: usize = 2;

/// Corrections with the joints and the camera that they change.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MeasurementCorrections {
    /// Model of the main camera in the rig; `None` without a correction of its images.
    camera: Option<CameraModel>,
    image: Vec<ImageCorrection>,
    joints: Vec<JointCorrection>,
    /// `imu_from_recorded` of angular velocities and specific forces, where they are corrected.
    imu: Option<[Matrix3<f64>; 2]>,
    /// Additions to the time offsets of cameras and encoders, in seconds.
    camera_shift_s: f64,
    joint_shift_s: f64,
    /// Stamp of the first step of the fork; `None` before it.
    start_ns: Option<i64>,
    /// Number of steps from then on without joint angles: readings within a change of an offset are in between.
    unread: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum ImageCorrection {
    Focal(f64),
    /// Factor, and the seconds over which it is reached.
    Zoom(f64, f64),
    Flip(ImageFlip),
    Ignored(ImageHalf),
}

/// Correction of readings by the indices of their joints.
#[derive(Clone, Copy, Debug, PartialEq)]
enum JointCorrection {
    Reversed(usize),
    Swapped(usize, usize),
    Offset(usize, f64),
    Scale(f64),
}

impl MeasurementCorrections {
    /// The corrections of a fork. `camera_key` is the key of the main camera.
    ///
    /// # Errors
    /// If the rig has no such joint.
    pub(super) fn of(corrections: &[MeasurementCorrection], rig: &Rig, camera_key: &str) -> Result<Self, ForkError> {
        let names = rig.joint_names();
        let joint = |name: &String| {
            names.iter().position(|known| known == name).ok_or_else(|| ForkError::BadChange {
                text: format!("correct=…:{name}"),
                problem: format!("the rig has no joint '{name}'; it has: {}", names.join(", ")),
            })
        };
        let mut found = Self::default();
        for correction in corrections {
            match correction {
                MeasurementCorrection::Focal(factor) => found.image.push(ImageCorrection::Focal(*factor)),
                MeasurementCorrection::Zoom(factor, over_s) => {
                    found.image.push(ImageCorrection::Zoom(*factor, *over_s));
                }
                MeasurementCorrection::Image(flip) => found.image.push(ImageCorrection::Flip(*flip)),
                MeasurementCorrection::Ignored(half) => found.image.push(ImageCorrection::Ignored(*half)),
                MeasurementCorrection::CameraShift(shift_s) => found.camera_shift_s += shift_s,
                MeasurementCorrection::JointShift(shift_s) => found.joint_shift_s += shift_s,
                MeasurementCorrection::Reversed(name) => found.joints.push(JointCorrection::Reversed(joint(name)?)),
                MeasurementCorrection::Swapped(first, second) => {
                    found.joints.push(JointCorrection::Swapped(joint(first)?, joint(second)?));
                }
                MeasurementCorrection::Offset(name, offset) => {
                    found.joints.push(JointCorrection::Offset(joint(name)?, *offset));
                    found.unread = UNREAD_STEPS;
                }
                MeasurementCorrection::JointScale(factor) => found.joints.push(JointCorrection::Scale(*factor)),
                MeasurementCorrection::ImuAxes(axes) => found.rotate([axes.matrix(), axes.matrix()]),
                MeasurementCorrection::GyroscopeAxes(axes) => found.rotate([axes.matrix(), Matrix3::identity()]),
                MeasurementCorrection::AccelerometerAxes(axes) => found.rotate([Matrix3::identity(), axes.matrix()]),
                MeasurementCorrection::GyroscopeScale(factor) => {
                    found.rotate([Matrix3::identity() * *factor, Matrix3::identity()]);
                }
                MeasurementCorrection::AccelerometerScale(factor) => {
                    found.rotate([Matrix3::identity(), Matrix3::identity() * *factor]);
                }
            }
        }
        if !found.image.is_empty() {
            found.camera = rig.camera(camera_key).ok().map(|camera| camera.model.clone());
        }
        Ok(found)
    }

    /// Adds the corrections of a fork to those of its parent.
    pub(super) fn add(&mut self, other: Self) {
        self.camera = other.camera.or_else(|| self.camera.take());
        self.image.extend(other.image);
        self.joints.extend(other.joints);
        if let Some(matrices) = other.imu {
            self.rotate(matrices);
        }
        self.camera_shift_s += other.camera_shift_s;
        self.joint_shift_s += other.joint_shift_s;
        (self.start_ns, self.unread) = (None, other.unread);
    }

    fn rotate(&mut self, [gyroscope, accelerometer]: [Matrix3<f64>; 2]) {
        let [before, of_force] = self.imu.unwrap_or_else(|| [Matrix3::identity(); 2]);
        self.imu = Some([gyroscope * before, accelerometer * of_force]);
    }

    /// Takes note of the next step; true if its joint angles are not used.
    pub(super) fn begin_step(&mut self, stamp_ns: i64) -> bool {
        self.start_ns.get_or_insert(stamp_ns);
        let unread = self.unread > 0;
        self.unread = self.unread.saturating_sub(1);
        unread
    }

    pub(super) fn camera_shift_ns(&self) -> i64 {
        ns_from_seconds(self.camera_shift_s)
    }

    /// The main camera's tracks, `None` without a correction of images; features outside the domain of the camera model
    /// are dropped.
    ///
    /// Positions are those at which the rig's camera would see the same directions: with a focal length `F` times the
    /// rig's, their errors are `1/F` times those in the image.
    pub(super) fn tracks(&self, tracks: &TrackedFrame) -> Option<TrackedFrame> {
        let camera = self.camera.as_ref()?;
        let features = tracks.features.iter().filter_map(|feature| {
            let uv_px = self.place(camera, feature.uv_px, tracks.stamp_ns)?;
            let previous_uv_px = feature.previous_uv_px.and_then(|uv_px| self.place(camera, uv_px, tracks.stamp_ns));
            let bearing = camera.unproject(&uv_px)?;
            Some(TrackedFeature { uv_px, previous_uv_px, bearing, ..*feature })
        });
        Some(TrackedFrame { features: features.collect(), ..tracks.clone() })
    }

    fn place(&self, camera: &CameraModel, uv_px: Vector2<f64>, stamp_ns: i64) -> Option<Vector2<f64>> {
        let [width, height] = camera.resolution_px.map(|size| size as f64);
        self.image.iter().try_fold(uv_px, |uv_px, correction| match correction {
            ImageCorrection::Focal(factor) => with_focal_factor(camera, *factor, &uv_px),
            ImageCorrection::Zoom(factor, over_s) => {
                let since_s = self.start_ns.map_or(0.0, |start_ns| seconds_from_ns(stamp_ns - start_ns));
                let reached = if *over_s > 0.0 { (since_s / over_s).clamp(0.0, 1.0) } else { 1.0 };
                with_focal_factor(camera, 1.0 + (factor - 1.0) * reached, &uv_px)
            }
            ImageCorrection::Flip(flip) => {
                let (left, top) = (width - 1.0 - uv_px.x, height - 1.0 - uv_px.y);
                Some(match flip {
                    ImageFlip::Mirrored => Vector2::new(left, uv_px.y),
                    ImageFlip::Flipped => Vector2::new(uv_px.x, top),
                    ImageFlip::UpsideDown => Vector2::new(left, top),
                })
            }
            ImageCorrection::Ignored(half) => (!half.contains(&uv_px, camera.resolution_px)).then_some(uv_px),
        })
    }

    /// Corrected samples, `None` without a correction of the IMU.
    pub(super) fn imu(&self, samples: &[ImuSample]) -> Option<Vec<ImuSample>> {
        let [gyroscope, accelerometer] = self.imu?;
        let corrected = samples.iter().map(|sample| ImuSample {
            stamp_ns: sample.stamp_ns,
            angular_velocity_rad_per_s: gyroscope * sample.angular_velocity_rad_per_s,
            specific_force_m_per_s2: accelerometer * sample.specific_force_m_per_s2,
        });
        Some(corrected.collect())
    }

    /// Corrects the readings at an image; shifts follow the parabola of each joint.
    pub(super) fn joint_angles(&self, angles: &mut JointAngles) {
        let count = angles.angles_rad.len();
        for correction in &self.joints {
            match *correction {
                JointCorrection::Reversed(joint) if joint < count => scale(angles, joint, -1.0),
                JointCorrection::Scale(factor) => (0..count).for_each(|joint| scale(angles, joint, factor)),
                JointCorrection::Offset(joint, offset_rad) if joint < count => angles.angles_rad[joint] += offset_rad,
                JointCorrection::Swapped(first, second) if first.max(second) < count => swap(angles, first, second),
                JointCorrection::Reversed(_) | JointCorrection::Offset(..) | JointCorrection::Swapped(..) => {}
            }
        }
        let after_s = self.camera_shift_s - self.joint_shift_s;
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

    pub(super) fn changes_joints(&self) -> bool {
        !self.joints.is_empty() || self.camera_shift_s != self.joint_shift_s
    }
}

/// Pixel at which the rig's camera sees the direction of a pixel of a camera with other focal lengths.
fn with_focal_factor(camera: &CameraModel, factor: f64, uv_px: &Vector2<f64>) -> Option<Vector2<f64>> {
    let [fx, fy, cx, cy, k1, k2] = camera.intrinsics();
    let corrected = camera.with_intrinsics([fx * factor, fy * factor, cx, cy, k1, k2]).ok()?;
    camera.project(&corrected.unproject(uv_px)?)
}

fn scale(angles: &mut JointAngles, joint: usize, factor: f64) {
    angles.angles_rad[joint] *= factor;
    if let Some(rate) = angles.rates_rad_per_s.get_mut(joint) {
        *rate *= factor;
    }
    if let Some(fit) = angles.motion_fits.get_mut(joint) {
        fit.acceleration_rad_per_s2 *= factor;
    }
}

fn swap(angles: &mut JointAngles, first: usize, second: usize) {
    let lists =
        [&mut angles.angles_rad, &mut angles.sigmas_rad, &mut angles.lasting_sigmas_rad, &mut angles.rates_rad_per_s];
    for list in lists {
        if first.max(second) < list.len() {
            list.swap(first, second);
        }
    }
    if first.max(second) < angles.motion_fits.len() {
        angles.motion_fits.swap(first, second);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frontend::FeatureId;
    use crate::sensors::JointMotionFit;
    use crate::simulation::{SyntheticOptions, synthetic_tracks};

    fn corrections(texts: &[&str]) -> Result<(MeasurementCorrections, Rig), ForkError> {
        let flight = synthetic_tracks(&SyntheticOptions { duration_s: 0.1, ..SyntheticOptions::default() });
        let all: Vec<MeasurementCorrection> = texts.iter().map(|text| text.parse().unwrap()).collect();
        Ok((MeasurementCorrections::of(&all, &flight.given_rig, "cam0")?, flight.given_rig))
    }

    fn frame(rig: &Rig, uv_px: Vector2<f64>, stamp_ns: i64) -> TrackedFrame {
        let bearing = rig.cameras[0].model.unproject(&uv_px).unwrap();
        let feature = TrackedFeature { id: FeatureId(1), age: 0, uv_px, previous_uv_px: None, bearing };
        TrackedFrame { stamp_ns, features: vec![feature], ..TrackedFrame::default() }
    }

    #[test]
    fn directions_are_those_of_the_corrected_camera() {
        let (found, rig) = corrections(&["focal:0.5"]).unwrap();
        let camera = &rig.cameras[0].model;
        let [fx, _, cx, cy, ..] = camera.intrinsics();
        let tracks = found.tracks(&frame(&rig, Vector2::new(cx + 0.1 * fx, cy), 0)).unwrap();
        let bearing = tracks.features[0].bearing;
        assert!((bearing.x / bearing.z - 0.2).abs() < 1e-9, "{bearing}");
        let (mut zoom, _) = corrections(&["zoom:2:1s"]).unwrap();
        assert!(!zoom.begin_step(5_000_000_000));
        let later = zoom.tracks(&frame(&rig, Vector2::new(cx + 0.3 * fx, cy), 5_500_000_000)).unwrap();
        let bearing = later.features[0].bearing;
        assert!((bearing.x / bearing.z - 0.2).abs() < 1e-9, "{bearing}");
        let (none, _) = corrections(&["camera-shift:5ms"]).unwrap();
        assert_eq!(none.tracks(&frame(&rig, Vector2::new(cx, cy), 0)), None);
        let (half, _) = corrections(&["ignored:left"]).unwrap();
        assert!(half.tracks(&frame(&rig, Vector2::new(10.0, cy), 0)).unwrap().features.is_empty());
    }

    #[test]
    fn joints_are_corrected_with_their_rates() {
        let rig = corrections(&[]).unwrap().1;
        let name = rig.joint_names()[1].clone();
        let (mut found, _) = corrections(&[&format!("reversed:{name}"), "joint-shift:0.02s"]).unwrap();
        let fit = JointMotionFit { acceleration_rad_per_s2: 3.0, ..JointMotionFit::UNKNOWN };
        let mut angles = JointAngles {
            angles_rad: vec![0.1, 0.2, 0.3],
            rates_rad_per_s: vec![0.0, 1.0, 0.0],
            motion_fits: vec![JointMotionFit::UNKNOWN, fit, JointMotionFit::UNKNOWN],
            ..JointAngles::default()
        };
        assert!(found.changes_joints() && !found.begin_step(0));
        found.joint_angles(&mut angles);
        assert_eq!((angles.angles_rad[0], angles.angles_rad[2]), (0.1, 0.3));
        assert!((angles.angles_rad[1] - (-0.2 + 0.02 - 0.5 * 3.0 * 0.02 * 0.02)).abs() < 1e-12, "{angles:?}");
        assert!((angles.rates_rad_per_s[1] - (-1.0 + 0.06)).abs() < 1e-12, "{angles:?}");
        let unknown = corrections(&["offset:elbow:1deg"]).unwrap_err().to_string();
        assert!(unknown.contains("no joint 'elbow'") && unknown.contains(&name), "{unknown}");
        let (mut offset, _) = corrections(&[&format!("offset:{name}:1deg")]).unwrap();
        assert_eq!([0, 1, 2].map(|stamp_ns| offset.begin_step(stamp_ns)), [true, true, false]);
    }

    #[test]
    fn samples_are_rotated_in_the_order_of_the_forks() {
        let (mut found, _) = corrections(&["imu-axes:y/x/z"]).unwrap();
        found.add(corrections(&["accelerometer-scale:2"]).unwrap().0);
        let sample = ImuSample {
            stamp_ns: 0,
            angular_velocity_rad_per_s: nalgebra::Vector3::new(1.0, 2.0, 3.0),
            specific_force_m_per_s2: nalgebra::Vector3::new(4.0, 5.0, 6.0),
        };
        let corrected = found.imu(&[sample]).unwrap()[0];
        assert_eq!(corrected.angular_velocity_rad_per_s, nalgebra::Vector3::new(2.0, 1.0, 3.0));
        assert_eq!(corrected.specific_force_m_per_s2, nalgebra::Vector3::new(10.0, 8.0, 12.0));
    }
}
