//! Parameter names: their order along the chain and what they mean.

use crate::sensors::Rig;

/// Where a parameter belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ChainPart {
    /// Between the IMU and the first joint.
    Base,
    /// A link, counted from 1.
    Link(usize),
    /// Between the last joint and the camera, and what else there is.
    End,
    /// The mount of a rigid camera that is watched beside the gimballed one.
    Rigid,
}

/// The part of the chain that a parameter's name (`I.rx`, `L2.alpha`, `EC.tz`) speaks of.
pub(crate) fn part_of(name: &str) -> ChainPart {
    let head = name.split('.').next().unwrap_or(name);
    match head {
        "I" | "IB" => ChainPart::Base,
        _ if head.starts_with("cam") => ChainPart::Rigid,
        _ => match head.strip_prefix('L').and_then(|number| number.parse().ok()) {
            Some(number) => ChainPart::Link(number),
            None => ChainPart::End,
        },
    }
}

/// A short heading of a part.
pub(crate) fn heading_of(part: ChainPart, rig: &Rig) -> String {
    match part {
        ChainPart::Base => "base".to_owned(),
        ChainPart::Link(number) => joint_name(number, rig).unwrap_or("link").to_owned(),
        ChainPart::End => "camera".to_owned(),
        ChainPart::Rigid => "rigid".to_owned(),
    }
}

fn joint_name(number: usize, rig: &Rig) -> Option<&str> {
    let joints = &rig.gimbal.as_ref()?.joints;
    joints.get(number.checked_sub(1)?).map(|joint| joint.name.as_str())
}

/// What a parameter means, in words.
pub(crate) fn meaning_of(name: &str, rig: &Rig) -> String {
    let (head, tail) = name.split_once('.').unwrap_or((name, ""));
    let part = part_of(name);
    let kind = match (part, tail) {
        (ChainPart::Link(_), "theta") => "constant added to the encoder's angle",
        (ChainPart::Link(_), "d") => "shift along the joint's axis",
        (ChainPart::Link(_), "a") => "shift along the link",
        (ChainPart::Link(_), "alpha") => "twist about the link, towards the next axis",
        (_, "beta") => "turn about the camera's y axis at the end of the chain",
        (_, "y") => "shift along the camera's y axis at the end of the chain",
        (_, "rx") => "rotation about x",
        (_, "ry") => "rotation about y",
        (_, "rz") => "rotation about z",
        (_, "tx") => "translation along x",
        (_, "ty") => "translation along y",
        (_, "tz") => "translation along z",
        (_, "wx" | "wy" | "wz") => "small rotation of the chart-free form",
        (_, "vx" | "vy" | "vz") => "small translation of the chart-free form",
        _ => "calibration parameter",
    };
    let place = match part {
        ChainPart::Base => "IMU to gimbal base".to_owned(),
        ChainPart::Link(number) => match joint_name(number, rig) {
            Some(joint) => format!("link {number}, joint {joint}"),
            None => format!("link {number}"),
        },
        ChainPart::End if head == "EC" => "effector to camera".to_owned(),
        ChainPart::End => "end of the chain".to_owned(),
        ChainPart::Rigid => format!("IMU to the rigid {head}"),
    };
    format!("{kind} ({place})")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::sample_recording::sample_recording_of;

    #[test]
    fn names_sort_along_the_chain() {
        let mut names = ["EC.rx", "L2.a", "L10.d", "IB.tx", "L3.beta"];
        names.sort_by_key(|name| part_of(name));
        assert_eq!(names, ["IB.tx", "L2.a", "L3.beta", "L10.d", "EC.rx"]);
    }

    #[test]
    fn meanings_name_the_joint() {
        let rig = sample_recording_of(1, &["auto"]).rig;
        assert_eq!(meaning_of("L2.alpha", &rig), "twist about the link, towards the next axis (link 2, joint roll)");
        assert_eq!(meaning_of("L7.d", &rig), "shift along the joint's axis (link 7)");
        assert_eq!(heading_of(part_of("I.rx"), &rig), "base");
        assert_eq!(meaning_of("odd", &rig), "calibration parameter (end of the chain)");
    }
}
