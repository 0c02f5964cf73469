use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// Reason why a robot description cannot be used; the path comes last.
#[derive(Debug, Error)]
pub enum UrdfError {
    #[error("cannot read the robot description: {source}: {}", path.display())]
    Read { source: io::Error, path: PathBuf },
    #[error("no URDF: {problem}: {}", path.display())]
    Syntax { problem: String, path: PathBuf },
    #[error("a macro file of xacro ({found}), not a URDF: write the URDF with 'xacro {0} > robot.urdf' first: {0}", path.display())]
    Xacro { found: String, path: PathBuf },
    #[error("joint '{joint}': {problem}: {}", path.display())]
    Joint { joint: String, problem: String, path: PathBuf },
    #[error("no link '{link}'; it has {}: {}", available.join(", "), path.display())]
    NoLink { link: String, available: Vec<String>, path: PathBuf },
    #[error("links '{from}' and '{to}' are not connected by joints: {}", path.display())]
    NotConnected { from: String, to: String, path: PathBuf },
    #[error(
        "joint '{joint}' between '{from}' and '{to}' is {joint_type}: the chain from the IMU to the camera has rotating and fixed \
         joints only: {}",
        path.display()
    )]
    NotRotating { joint: String, joint_type: &'static str, from: String, to: String, path: PathBuf },
    #[error(
        "no robot description on '{topic}'; {}: {}",
        if available.is_empty() { "the log has no std_msgs/msg/String".to_owned() }
        else { format!("topics of std_msgs/msg/String: {}", available.join(", ")) },
        path.display()
    )]
    NoTopic { topic: String, available: Vec<String>, path: PathBuf },
    #[error("the joints of the rig are {}, those between the links are {}: {}", list(rig), list(urdf), path.display())]
    OtherJoints { rig: Vec<String>, urdf: Vec<String>, path: PathBuf },
    #[error(
        "the pose of link '{link}' on joint '{joint}' differs from the calibration and has no joint of its own that could be \
         changed: add a link with a fixed joint at '{link}': {}",
        path.display()
    )]
    NothingToChange { link: String, joint: String, path: PathBuf },
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
