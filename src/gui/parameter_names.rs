//! Order of the parameters along the chain, and their meanings.

use crate::gimbal::{ParameterGroup, ParameterId, ParameterPart, Quantity};
use crate::sensors::Rig;

/// Part of the calibration to which a parameter belongs, in the order of [`ParameterGroup::NAMES`].
///
/// [`ParameterGroup::NAMES`]: crate::gimbal::ParameterGroup
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum CalibrationPart {
    /// Between the IMU and the first joint.
    Base,
    /// A link, counted from 1.
    Link(usize),
    /// Between the last joint and the camera.
    End,
    /// The extrinsics of a rigid camera besides the main one, by its number.
    Rigid(u8),
    /// The intrinsics of a camera by its number.
    Camera(u8),
    Gyroscope,
    Accelerometer,
    /// The orientation of the IMU on the gimbal.
    GimbalImu,
    /// Time offsets and readout times.
    Clocks,
}

/// Place of a parameter along the chain, then of the other parts.
pub(crate) fn place_of(parameter: ParameterId) -> impl Ord {
    (part_of(parameter), parameter)
}

pub(crate) fn part_of(parameter: ParameterId) -> CalibrationPart {
    match (parameter.group(), parameter.part) {
        (ParameterGroup::Clocks, _) => CalibrationPart::Clocks,
        (_, ParameterPart::Camera(camera)) => CalibrationPart::Camera(camera),
        (_, ParameterPart::Gyroscope) => CalibrationPart::Gyroscope,
        (_, ParameterPart::Accelerometer) => CalibrationPart::Accelerometer,
        (_, ParameterPart::GimbalImu) => CalibrationPart::GimbalImu,
        (_, ParameterPart::ImuFromBase | ParameterPart::Base) => CalibrationPart::Base,
        (_, ParameterPart::Link(link)) => CalibrationPart::Link(usize::from(link) + 1),
        (_, ParameterPart::ImuFromCamera(camera)) if camera > 0 => CalibrationPart::Rigid(camera),
        _ => CalibrationPart::End,
    }
}

pub(crate) fn heading_of(part: CalibrationPart, rig: &Rig) -> String {
    match part {
        CalibrationPart::Base => "base".to_owned(),
        CalibrationPart::Link(number) => joint_name(number, rig).unwrap_or("link").to_owned(),
        CalibrationPart::End | CalibrationPart::Camera(0) => "camera".to_owned(),
        CalibrationPart::Rigid(camera) => {
            let names = rig.parameter_names();
            let several = names.cameras.len() > 1;
            if several { names.part(ParameterPart::ImuFromCamera(camera)) } else { "rigid".to_owned() }
        }
        CalibrationPart::Camera(camera) => rig.parameter_names().part(ParameterPart::Camera(camera)),
        CalibrationPart::Gyroscope => "gyro".to_owned(),
        CalibrationPart::Accelerometer => "accel".to_owned(),
        CalibrationPart::GimbalImu => "imu1".to_owned(),
        CalibrationPart::Clocks => "clocks".to_owned(),
    }
}

fn joint_name(number: usize, rig: &Rig) -> Option<&str> {
    let joints = &rig.gimbal.as_ref()?.joints;
    joints.get(number.checked_sub(1)?).map(|joint| joint.name.as_str())
}

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
        Quantity::Sx => "scale error of the x axis",
        Quantity::Sy => "scale error of the y axis",
        Quantity::Sz => "scale error of the z axis",
        Quantity::Mxy => "misalignment, part of the measured y in x",
        Quantity::Mxz => "misalignment, part of the measured z in x",
        Quantity::Myz => "misalignment, part of the measured z in y",
    };
    let names = rig.parameter_names();
    let place = match (part, parameter.part) {
        (_, ParameterPart::Encoder) => "joint encoders".to_owned(),
        (_, ParameterPart::Gyroscope) => "gyroscope".to_owned(),
        (_, ParameterPart::Accelerometer) => "accelerometer".to_owned(),
        (_, ParameterPart::GimbalImu) => "IMU on the gimbal".to_owned(),
        (_, part @ ParameterPart::Camera(_)) => names.part(part),
        (CalibrationPart::Base, _) => "IMU to gimbal base".to_owned(),
        (CalibrationPart::Link(number), _) => match joint_name(number, rig) {
            Some(joint) => format!("link {number}, joint {joint}"),
            None => format!("link {number}"),
        },
        (_, ParameterPart::EffectorFromCamera) => "end effector to camera".to_owned(),
        (CalibrationPart::Rigid(_), part) => format!("IMU to rigid {}", names.part(part)),
        _ => "end of the chain".to_owned(),
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
        let mut names = ["readout", "accelerometer.sx", "cam1.fx", "gyroscope.rx", "fx", "cam1.tx", "L1.d", "IB.tx"];
        names.sort_by_key(|name| part_of(id(name)));
        let groups = names.map(|name| id(name).group());
        assert!(groups.is_sorted(), "{names:?}");
        assert_eq!(names[2..], ["cam1.tx", "fx", "cam1.fx", "gyroscope.rx", "accelerometer.sx", "readout"]);
    }

    #[test]
    fn meanings_name_the_joint() {
        let rig = sample_recording_of(1, &["auto"]).rig;
        assert_eq!(meaning_of(id("L2.alpha"), &rig), "DH twist α about the link (link 2, joint roll)");
        assert_eq!(meaning_of(id("L7.d"), &rig), "DH offset d along the joint axis (link 7)");
        assert_eq!(heading_of(part_of(id("I.rx")), &rig), "base");
        assert_eq!(meaning_of(id("timeshift"), &rig), "time offset, t_imu = t_sensor + timeshift (camera)");
        assert_eq!(
            meaning_of(id("accelerometer.mxz"), &rig),
            "misalignment, part of the measured z in x (accelerometer)"
        );
        assert_eq!(meaning_of(id("gyroscope.rx"), &rig), "rotation about x (gyroscope)");
        assert_eq!(heading_of(part_of(id("fx")), &rig), "camera");
    }
}
