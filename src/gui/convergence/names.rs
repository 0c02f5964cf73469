//! Order of the parameters along the chain, and their meanings.

use crate::gimbal::{ParameterId, ParameterPart, Quantity};
use crate::sensors::Rig;

/// The part of the chain that a parameter belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ChainPart {
    /// Between the IMU and the first joint.
    Base,
    /// A link, counted from 1.
    Link(usize),
    /// Between the last joint and the camera, and time offsets.
    End,
    /// The extrinsics of a second, rigid camera.
    Rigid,
}

/// The part of the chain that a parameter belongs to.
pub(crate) fn part_of(parameter: ParameterId) -> ChainPart {
    match parameter.part {
        ParameterPart::ImuFromBase | ParameterPart::Base => ChainPart::Base,
        ParameterPart::Link(link) => ChainPart::Link(usize::from(link) + 1),
        part if part.camera() > 0 => ChainPart::Rigid,
        _ => ChainPart::End,
    }
}

/// A short heading for a part of the chain.
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

/// The meaning of a parameter in words.
pub(crate) fn meaning_of(parameter: ParameterId, rig: &Rig) -> String {
    let part = part_of(parameter);
    let kind = match parameter.quantity {
        Quantity::Theta => "joint offset θ₀, added to the encoder angle",
        Quantity::D => "DH offset d along the joint axis",
        Quantity::A => "DH link length a",
        Quantity::Alpha => "DH twist α about the link",
        Quantity::Beta => "rotation β about the camera's y axis",
        Quantity::Y => "translation along the camera's y axis",
        Quantity::Rx => "rotation about x",
        Quantity::Ry => "rotation about y",
        Quantity::Rz => "rotation about z",
        Quantity::Tx => "translation along x",
        Quantity::Ty => "translation along y",
        Quantity::Tz => "translation along z",
        Quantity::Wx | Quantity::Wy => "local rotation of the product of exponentials",
        Quantity::Vx | Quantity::Vy => "local translation of the product of exponentials",
        Quantity::Timeshift => "time offset, t_imu = t_sensor + timeshift",
        Quantity::Readout => "readout time of the rolling shutter, from the first row to the last",
        Quantity::Fx => "focal length in x",
        Quantity::Fy => "focal length in y",
        Quantity::Cx => "principal point in x",
        Quantity::Cy => "principal point in y",
        Quantity::K1 => "first coefficient of the lens distortion",
        Quantity::K2 => "second coefficient of the lens distortion",
        Quantity::Sx | Quantity::Sy | Quantity::Sz => "scale error of an axis",
        Quantity::Mxy | Quantity::Mxz | Quantity::Myz => "misalignment of two axes",
    };
    let place = match part {
        _ if parameter == ParameterId::ENCODER_TIMESHIFT => "joint encoders".to_owned(),
        _ if matches!(parameter.part, ParameterPart::Gyroscope) => "gyroscope".to_owned(),
        _ if matches!(parameter.part, ParameterPart::Accelerometer) => "accelerometer".to_owned(),
        ChainPart::Rigid if matches!(parameter.part, ParameterPart::Camera(_)) => {
            rig.parameter_names().part(parameter.part)
        }
        _ if matches!(parameter.part, ParameterPart::Camera(_)) => "camera".to_owned(),
        ChainPart::Base => "IMU to gimbal base".to_owned(),
        ChainPart::Link(number) => match joint_name(number, rig) {
            Some(joint) => format!("link {number}, joint {joint}"),
            None => format!("link {number}"),
        },
        ChainPart::End if parameter.part == ParameterPart::EffectorFromCamera => "end effector to camera".to_owned(),
        ChainPart::End => "end of the chain".to_owned(),
        ChainPart::Rigid => format!("IMU to rigid {}", rig.parameter_names().part(parameter.part)),
    };
    format!("{kind} ({place})")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::ParameterNames;
    use crate::gui::samples::sample_recording_of;

    fn id(name: &str) -> ParameterId {
        ParameterNames::default().parse(name).unwrap()
    }

    #[test]
    fn names_sort_along_the_chain() {
        let mut names = ["EC.rx", "L2.a", "L10.d", "IB.tx", "L3.beta"];
        names.sort_by_key(|name| part_of(id(name)));
        assert_eq!(names, ["IB.tx", "L2.a", "L3.beta", "L10.d", "EC.rx"]);
    }

    #[test]
    fn meanings_name_the_joint() {
        let rig = sample_recording_of(1, &["auto"]).rig;
        assert_eq!(meaning_of(id("L2.alpha"), &rig), "DH twist α about the link (link 2, joint roll)");
        assert_eq!(meaning_of(id("L7.d"), &rig), "DH offset d along the joint axis (link 7)");
        assert_eq!(heading_of(part_of(id("I.rx")), &rig), "base");
        assert_eq!(meaning_of(id("timeshift"), &rig), "time offset, t_imu = t_sensor + timeshift (camera)");
    }
}
