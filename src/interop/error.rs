use thiserror::Error;

use crate::sensors::UnknownCamera;

/// Reason why a rig cannot be written as the configuration of another program.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ConfigurationError {
    /// The rig has no such camera.
    #[error(transparent)]
    Camera(#[from] UnknownCamera),
    #[error(
        "{camera} is {model}, which {program} lacks; it takes {takes}. Calibrate the camera with one of these models (Kalibr \
         fits any of its own to the same images), or undistort its images and describe them as pinhole with none"
    )]
    Lens {
        camera: String,
        /// Projection and distortion of the camera in Kalibr's names.
        model: String,
        program: &'static str,
        takes: &'static str,
    },
    #[error("{program} takes {}, {given} were requested", cameras(*most))]
    TooManyCameras { program: &'static str, most: usize, given: usize },
    #[error("--camera {camera} is given twice")]
    CameraTwice { camera: String },
    #[error("the rig has no joint '{name}'; {}", joints(available))]
    UnknownJoint { name: String, available: Vec<String> },
    #[error("the angle of joint '{name}' is given twice")]
    JointTwice { name: String },
    #[error("{name}={angle_deg} lies beyond the joint's limits, {:.1}° to {:.1}°", limits_deg.0, limits_deg.1)]
    BeyondLimits { name: String, angle_deg: f64, limits_deg: (f64, f64) },
    #[error("{given} joint angles, expected {expected} as in the rig")]
    AngleCount { given: usize, expected: usize },
    #[error("the rig has no camera on a gimbal, so there are no joint angles to take from a log")]
    NoGimbal,
    #[error(
        "the log has no joint angles within 1 s after {time_s} s; give another time with --at, or the angles with --joints"
    )]
    NoAngles {
        /// In seconds since the log began.
        time_s: f64,
    },
    /// The log could not be read.
    #[error("{0}")]
    Log(String),
    /// A mask could not be encoded.
    #[error("{0}")]
    Mask(String),
}

fn cameras(count: usize) -> String {
    if count == 1 { "one camera".to_owned() } else { format!("at most {count} cameras") }
}

fn joints(names: &[String]) -> String {
    if names.is_empty() { "it has no gimbal".to_owned() } else { format!("its joints are {}", names.join(", ")) }
}
