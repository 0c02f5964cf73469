//! Telemetry in a video: of the camera, of a Karma drone, and of the gimbal and vehicle that a gimbal camera knows.

use super::mp4::Movie;
use super::recorded::Recorded;
use super::{camera_gimbal, camm, gpmf, siyi};

/// Telemetry of a video, in nanoseconds since its start.
#[derive(Debug)]
pub(super) struct VideoTelemetry {
    /// Sensors of the camera itself (`GoPro`, CAMM).
    pub(super) camera: Recorded,
    pub(super) drone: Option<Recorded>,
    /// Attitudes and positions that a gimbal camera writes into its video.
    pub(super) gimbal: Option<Recorded>,
    /// Letter of a `GoPro`'s field of view.
    pub(super) field_of_view: Option<String>,
    /// Recorded horizontal field of view in degrees.
    pub(super) horizontal_deg: Option<f64>,
    /// True for an IMU of the camera whose axes are not known.
    pub(super) has_unknown_axes: bool,
}

pub(super) fn read(movie: &Movie) -> VideoTelemetry {
    let gpmf::Telemetry { mut camera, drone, field_of_view } = gpmf::read(&movie.telemetry);
    let motion = camm::read(&movie.motion);
    let has_unknown_axes = camera.imus.is_empty() && motion.as_ref().is_some_and(|motion| !motion.imus.is_empty());
    if let Some(motion) = motion {
        if camera.count() == 0 {
            camera.format = motion.format;
        }
        camera.append(motion);
    }
    let (mut gimbal, horizontal_deg) =
        camera_gimbal::read(&movie.video).map_or((None, None), |(recorded, deg)| (Some(recorded), deg));
    if let Some(subtitles) = siyi::read(&movie.subtitles, &movie.video) {
        match &mut gimbal {
            Some(gimbal) => gimbal.append(subtitles),
            None => gimbal = Some(subtitles),
        }
    }
    VideoTelemetry { camera, drone, gimbal, field_of_view, horizontal_deg, has_unknown_axes }
}
