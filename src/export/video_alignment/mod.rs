//! Time alignment of a video with an autopilot's log, by the rotations or the specific forces that both recorded.

mod plot;

use crate::flight_log::RigOfLog as _;
use std::fmt;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use thiserror::Error;

pub use self::plot::write_alignment_plot;
use crate::files::output::folder_of;
use crate::flight_log::convert::{ConvertError, ConvertOptions, ForceAgreement, VideoClock, convert_with};
use crate::flight_log::{FlightLog, LogError};
use crate::geometry::seconds_from_ns;
use crate::log_check::{AlignmentError, AlignmentReference, ClockAlignment, align_camera};
use crate::sensors::{CameraMount, Rig};
use crate::session::camera_rotations;

/// Search range in seconds on either side of the first guess.
const SEARCH_S: f64 = 60.0;
/// Number of sections of the video with measured rotations, and the length of each in seconds.
const SECTIONS: usize = 6;
const SECTION_S: f64 = 12.0;
/// Fraction of the progress that the first conversion takes.
const CONVERTED: f64 = 0.5;

/// Alignment of a video's clock with the clock of an autopilot's log, with its evidence.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoAlignment {
    /// Clock of the video relative to the log.
    pub clock: VideoClock,
    pub evidence: AlignmentEvidence,
}

/// Measurements that agree at the offset found.
#[derive(Clone, Debug, PartialEq)]
pub enum AlignmentEvidence {
    /// Rotations of the images and of a reference; the alignment is relative to the first guess.
    Rotations { reference: AlignmentReference, alignment: Box<ClockAlignment> },
    /// Specific forces of both IMUs.
    Forces(ForceAgreement),
}

/// Reason why a video could not be aligned.
#[derive(Debug, Error)]
pub enum VideoAlignmentError {
    /// The sources cannot be converted.
    #[error(transparent)]
    Convert(#[from] ConvertError),
    /// The converted log or its rig cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// No single offset explains the rotations.
    #[error(
        "the video cannot be aligned with the log of the autopilot: {source}; give its offset with --video-offset SECONDS (by the \
         times of camera and autopilot it would be {guess_s:.3}): {path}"
    )]
    NotAligned {
        source: AlignmentError,
        /// Offset of the video from the recorded times, or with a common start.
        guess_s: f64,
        path: PathBuf,
    },
    #[error("cannot write a log for the alignment: {source}: {path}")]
    Write { source: io::Error, path: PathBuf },
}

impl fmt::Display for VideoAlignment {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let offset_sigma_s = match &self.evidence {
            AlignmentEvidence::Rotations { alignment, .. } => alignment.offset_sigma_s,
            AlignmentEvidence::Forces(found) => found.offset_sigma_s,
        };
        write!(
            out,
            "the video starts {:+.3} s after the first measurement of the autopilot's log (σ {:.1} ms), drift {:+.0} ",
            self.clock.offset_s,
            1e3 * offset_sigma_s,
            self.clock.drift_ppm,
        )?;
        let (reference, found) = match &self.evidence {
            AlignmentEvidence::Rotations { reference, alignment } => (reference, alignment),
            AlignmentEvidence::Forces(found) => {
                return write!(
                    out,
                    "ppm: the specific forces of both IMUs have a correlation of {:.2}",
                    found.correlation
                );
            }
        };
        write!(
            out,
            "± {:.0} ppm: {:.0} % of {} rotations of the images, {:.2}° each, are explained by {}, with residuals of {:.2}°",
            found.drift_sigma_ppm,
            100.0 * found.explained,
            found.rotations,
            found.rotation_deg,
            reference,
            found.residual_deg,
        )?;
        if let Some((offset_s, explained)) = found.next {
            let distance_s = offset_s - found.offset_s;
            write!(out, "; the next best, {distance_s:+.2} s from it, explains {:.0} %", 100.0 * explained.max(0.0))?;
        }
        let percent = 100.0 * (found.scale - 1.0);
        if percent.abs() > 3.0 {
            // A focal length that is too large makes rotations too small by the same ratio.
            let word = if percent < 0.0 { "long" } else { "short" };
            write!(out, "; the focal length of the rig seems to be {:.0} % too {word}", percent.abs())?;
        }
        Ok(())
    }
}

/// Estimates the time offset of a video in the autopilot's log of `options` within ±60 s of the offset found by the
/// conversion: by the rotations of the images, or by the specific forces of both IMUs where the images do not agree
/// with the autopilot's gyroscope, as on a gimbal without recorded angles. The camera model is taken from `rig`,
/// without one it is the model that the conversion assumes. Temporary files are written into the folder of `output`.
///
/// # Errors
/// If the sources cannot be converted, or the rotations do not determine a unique offset.
pub fn align_video(
    source: &Path,
    output: &Path,
    rig: Option<&Path>,
    options: &ConvertOptions,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<VideoAlignment, VideoAlignmentError> {
    let beside = folder_of(output);
    let folder = tempfile::Builder::new().prefix(".dcvins-").tempdir_in(&beside);
    let folder = folder.map_err(|source| VideoAlignmentError::Write { source, path: beside })?;
    let path = folder.path().join("first-guess.mcap");
    let report = convert_with(source, &path, options, &mut |ratio| progress(CONVERTED * ratio))?;
    let guess = report.video_clock.unwrap_or_default();
    let log = Arc::new(FlightLog::open_with(&path, &options.limits)?);
    let rig = Rig::for_log(&log, rig)?;
    let by_forces =
        report.forces.map(|found| VideoAlignment { clock: guess, evidence: AlignmentEvidence::Forces(found) });
    // Without angles of its joints, the images of a camera on a gimbal cannot be compared with the autopilot's gyroscope.
    let on_gimbal = rig.cameras.first().is_some_and(|camera| camera.mount == CameraMount::Gimbal);
    if on_gimbal
        && rig.gimbal.as_ref().is_none_or(|gimbal| gimbal.topic.is_none())
        && let Some(found) = by_forces
    {
        return Ok(found);
    }
    let camera_key = rig.cameras.first().map(|camera| camera.key.clone()).unwrap_or_default();
    let rotations = camera_rotations(&log, &rig, &camera_key, SECTIONS, SECTION_S)?;
    let aligned = align_camera(&log, &rig, &camera_key, &rotations, SEARCH_S);
    let (reference, alignment) = match (aligned, by_forces) {
        (Ok(found), _) => found,
        (Err(_), Some(found)) => return Ok(found),
        (Err(problem), None) => {
            let (guess_s, path) = (guess.offset_s, source.to_owned());
            return Err(VideoAlignmentError::NotAligned { source: problem, guess_s, path });
        }
    };
    // The log of the first guess starts at its first measurement or with the video.
    let log_start_s = if guess.offset_s < 0.0 { -guess.offset_s } else { 0.0 };
    let shift_s = seconds_from_ns(alignment.shift_ns(crate::geometry::ns_from_seconds(log_start_s + guess.offset_s)));
    let drift_ppm = guess.drift_ppm + alignment.drift_ppm;
    let clock = VideoClock { offset_s: guess.offset_s + shift_s, drift_ppm };
    let evidence = AlignmentEvidence::Rotations { reference, alignment: Box::new(alignment) };
    Ok(VideoAlignment { clock, evidence })
}
