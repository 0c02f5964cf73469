//! Which images of a run's cameras become frames, by the stamps at the start of the log.

use std::sync::Arc;

use crate::flight_log::{FlightLog, LogError, image_stamps};
use crate::geometry::ns_from_seconds;
use crate::sensors::{CameraMount, CameraRig};

/// Largest difference of stamps of images that are triggered together. At an angular rate of 3 rad/s the vehicle rotates
/// by 0.1° in that time, about one pixel.
pub(super) const TOGETHER_NS: i64 = 500_000;
/// Number of images of each camera, from the time on at which all have one, that are compared.
const COMPARED_IMAGES: usize = 40;
/// Ratio of images with another one of the same moment from which on the cameras count as triggered together.
const TOGETHER: f64 = 0.5;
/// Ratio of rates from which on a gimballed camera is so much faster than each rigid one that frames lie at its images.
const FASTER: f64 = 1.5;
/// Largest time between the images of one frame: over longer times the noise of the gyroscope counts.
const MAX_REACH_NS: i64 = 120_000_000;
/// Reach of a frame as a ratio of the interval between frames.
const REACH: f64 = 0.6;

/// Camera at whose images frames lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::session) struct FrameCamera {
    /// Index among the cameras of the run.
    pub(in crate::session) camera: usize,
    /// Largest time between a frame and an image that belongs to it, in nanoseconds.
    pub(in crate::session) reach_ns: i64,
}

impl FrameCamera {
    /// Camera at whose images the frames of a run lie: the fastest rigid one, or the gimballed one if it is clearly faster.
    /// With an IMU on the gimbal, whose motion between two frames depends on the joints, it is the gimballed one.
    ///
    /// `None` if the images of all cameras have the same stamps, or never overlap in time.
    ///
    /// # Errors
    /// If the log lacks the topic of a camera.
    pub(in crate::session) fn of_run(
        log: &Arc<FlightLog>,
        cameras: &[&CameraRig],
        start_s: f64,
        has_gimbal_imu: bool,
    ) -> Result<Option<Self>, LogError> {
        if cameras.len() < 2 {
            return Ok(None);
        }
        let from_ns = ns_from_seconds(start_s);
        let first = |camera: &&CameraRig| Ok(image_stamps(log, camera, from_ns)?.find(|stamp_ns| *stamp_ns >= from_ns));
        let firsts: Vec<Option<i64>> = cameras.iter().map(first).collect::<Result<_, LogError>>()?;
        let Some(overlap_ns) = firsts.iter().flatten().max() else { return Ok(None) };
        let compared = |camera: &&CameraRig| -> Result<Stamps, LogError> {
            let stamps = image_stamps(log, camera, *overlap_ns)?.filter(|stamp_ns| *stamp_ns >= *overlap_ns);
            Ok(Stamps(stamps.take(COMPARED_IMAGES).collect()))
        };
        let stamps: Vec<Stamps> = cameras.iter().map(compared).collect::<Result<_, _>>()?;
        let mounts: Vec<Mount> = cameras.iter().map(|camera| Mount::of(camera)).collect();
        Ok(Self::by_stamps(&stamps, &mounts, has_gimbal_imu))
    }

    fn by_stamps(stamps: &[Stamps], mounts: &[Mount], has_gimbal_imu: bool) -> Option<Self> {
        let interval = |camera: usize| stamps[camera].interval_ns().map(|interval_ns| (interval_ns, camera));
        let fastest =
            |mount: Mount| (0..stamps.len()).filter(|camera| mounts[*camera] == mount).filter_map(interval).min();
        let camera = match (fastest(Mount::Imu), fastest(Mount::Gimbal)) {
            (Some((rigid_ns, _)), Some((gimballed_ns, camera)))
                if has_gimbal_imu || gimballed_ns as f64 * FASTER < rigid_ns as f64 =>
            {
                camera
            }
            (Some((_, camera)), _) | (None, Some((_, camera))) => camera,
            (None, None) => return None,
        };
        let is_apart = |other: &Stamps| other.together(&stamps[camera]).is_some_and(|ratio| ratio < TOGETHER);
        let apart = stamps.iter().any(is_apart);
        let reach_ns = (stamps[camera].interval_ns()? as f64 * REACH) as i64;
        apart.then_some(Self { camera, reach_ns: reach_ns.min(MAX_REACH_NS) })
    }
}

/// Mount of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mount {
    /// Rigid, with a pose relative to the IMU.
    Imu,
    /// On the gimbal, with a pose by its chain.
    Gimbal,
    /// On another camera; no frames lie at its images.
    Camera,
}

impl Mount {
    fn of(camera: &CameraRig) -> Self {
        match (&camera.relative_prior, &camera.mount) {
            (Some(_), _) => Self::Camera,
            (None, CameraMount::Gimbal) => Self::Gimbal,
            (None, CameraMount::Static { .. }) => Self::Imu,
        }
    }
}

/// Stamps of a camera's images on the IMU's clock, in ascending order.
struct Stamps(Vec<i64>);

impl Stamps {
    /// Median interval, `None` without one.
    fn interval_ns(&self) -> Option<i64> {
        let mut intervals: Vec<i64> = self.0.windows(2).map(|pair| pair[1] - pair[0]).collect();
        intervals.sort_unstable();
        intervals.get(intervals.len() / 2).copied()
    }

    /// Ratio of the images within the time of the other ones that have one of the same moment among them; of a faster
    /// camera, of the other's images. `None` if they do not overlap.
    fn together(&self, other: &Self) -> Option<f64> {
        let ratio = |some: &[i64], all: &[i64]| {
            let (first, last) = (*all.first()?, *all.last()?);
            let within = || some.iter().filter(|stamp_ns| (first..=last).contains(stamp_ns));
            let has_partner = |stamp_ns: &&i64| all.iter().any(|other_ns| (*stamp_ns - other_ns).abs() <= TOGETHER_NS);
            let count = within().count();
            (count > 0).then(|| within().filter(has_partner).count() as f64 / count as f64)
        };
        ratio(&self.0, &other.0).into_iter().chain(ratio(&other.0, &self.0)).reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamps(interval_ms: f64, phase_ms: f64) -> Stamps {
        Stamps((0..40).map(|number| ((f64::from(number) * interval_ms + phase_ms) * 1e6) as i64).collect())
    }

    fn chosen(gimballed: Stamps, rigid: Stamps, has_gimbal_imu: bool) -> Option<(usize, f64)> {
        let found = FrameCamera::by_stamps(&[gimballed, rigid], &[Mount::Gimbal, Mount::Imu], has_gimbal_imu)?;
        Some((found.camera, found.reach_ns as f64 * 1e-6))
    }

    #[test]
    fn frames_lie_at_the_rigid_camera_unless_the_gimballed_one_is_clearly_faster() {
        assert_eq!(chosen(stamps(100.0, 0.0), stamps(100.0, 0.3), false), None);
        assert_eq!(chosen(stamps(100.0, 0.0), stamps(50.0, 0.0), false), None, "every second image has a partner");
        assert_eq!(chosen(stamps(25.0, 0.0), stamps(50.0, 0.0), false), None);
        assert_eq!(chosen(stamps(100.0, 0.0), stamps(100.0, 50.0), false), Some((1, 60.0)));
        assert_eq!(chosen(stamps(50.0, 0.0), stamps(66.7, 11.0), false).unwrap().0, 1);
        assert_eq!(chosen(stamps(20.0, 0.0), stamps(100.0, 9.0), false), Some((0, 12.0)));
        assert_eq!(chosen(stamps(100.0, 0.0), stamps(33.0, 9.0), true), Some((0, 60.0)));
        assert_eq!(chosen(stamps(500.0, 0.0), stamps(400.0, 90.0), false), Some((1, 120.0)));
    }

    #[test]
    fn cameras_whose_images_do_not_overlap_need_no_frames_at_one_of_them() {
        assert_eq!(chosen(stamps(50.0, 0.0), stamps(50.0, 10_000.0), false), None);
        assert_eq!(chosen(Stamps(Vec::new()), stamps(50.0, 0.0), false), None);
    }
}
