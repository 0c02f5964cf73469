use thiserror::Error;

use crate::sensors::UnknownCamera;

/// Why a rig cannot be written as the configuration of another program.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ConfigurationError {
    /// The rig has no such camera.
    #[error(transparent)]
    Camera(#[from] UnknownCamera),
    /// The program cannot project through this lens.
    #[error(
        "{camera} is {model}, which {program} lacks; it takes {takes}. Calibrate the camera with one of these models (Kalibr \
         fits any of its own to the same images), or undistort its images and describe them as pinhole with none"
    )]
    Lens {
        /// Key of the camera.
        camera: String,
        /// Its projection and distortion in Kalibr's names.
        model: String,
        /// The program.
        program: &'static str,
        /// What the program takes.
        takes: &'static str,
    },
    /// More cameras than the program takes.
    #[error("{program} takes {}, {given} were asked for", cameras(*most))]
    TooManyCameras {
        /// The program.
        program: &'static str,
        /// How many it takes.
        most: usize,
        /// How many were asked for.
        given: usize,
    },
    /// A camera was named twice.
    #[error("--camera {camera} is given twice")]
    CameraTwice {
        /// Key of the camera.
        camera: String,
    },
    /// No joint of this name.
    #[error("the rig has no joint '{name}'; {}", joints(available))]
    UnknownJoint {
        /// What was asked for.
        name: String,
        /// Joints of the rig.
        available: Vec<String>,
    },
    /// A joint was named twice.
    #[error("the angle of joint '{name}' is given twice")]
    JointTwice {
        /// Its name.
        name: String,
    },
    /// An angle beyond the joint's limits.
    #[error("{name}={angle_deg} lies beyond the joint's limits, {:.1}° to {:.1}°", limits_deg.0, limits_deg.1)]
    BeyondLimits {
        /// Name of the joint.
        name: String,
        /// The angle in degrees.
        angle_deg: f64,
        /// Lower and upper limit in degrees.
        limits_deg: (f64, f64),
    },
    /// The number of angles is not that of the joints.
    #[error("{given} joint angles, expected {expected} as in the rig")]
    AngleCount {
        /// How many were given.
        given: usize,
        /// How many joints there are.
        expected: usize,
    },
    /// Measured angles were asked for, and no camera is on a gimbal.
    #[error("the rig has no camera on a gimbal, so there are no joint angles to take from a log")]
    NoGimbal,
    /// The log has no joint angles at that time.
    #[error(
        "the log has no joint angles within 1 s after {time_s} s; give another time with --at, or the angles with --joints"
    )]
    NoAngles {
        /// Seconds since the log began.
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
