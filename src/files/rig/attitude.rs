//! `gimbal.source` of a rig: an attitude in place of joint angles, read and written.

use super::fields::Field;
use crate::files::FileError;
use crate::gimbal::{ClassicalChain, InverseChain};
use crate::sensors::{AngleUnit, AttitudeFrame, AttitudeMessage, AttitudeSource, BodyAxes, EulerAngles, NamedAxes};
use crate::text::Named;

const TYPES: &str = "quaternion, pose, euler, tf, mavros or px4";
const FRAMES: &str = "body, vehicle (levelled, x towards the heading) or earth";
const FRAMES_BY_FLAGS: &str = "body, vehicle, earth, or flags (by the flags of each message)";
const BODY_AXES: &str = "frd (forward, right, down; earth: NED) or flu (forward, left, up; earth: ENU)";
const NAMED_AXES: &str = "three letters of f b l r u d, right-handed, such as flu, frd or rdf";
const ORDER: &str = "rotations in their order from the frame to the gimbal with the fields that hold them, such as yaw=z roll=x pitch=y, a field with the \
     sign of its angle (pitch=-y)";
const VEHICLE: &str = "the topic of the vehicle's attitude (QuaternionStamped, PoseStamped, Odometry, TransformStamped, Imu or px4's \
                       VehicleAttitude)";

pub(crate) fn read(source: &Field<'_>) -> Result<(String, AttitudeSource), FileError> {
    source.keys("a mapping with topic, type, frame, axes, …")?;
    let topic = source.field("topic").text("the topic of the gimbal's attitude")?.to_owned();
    let message = read_message(source)?;
    let by_flags = matches!(message, AttitudeMessage::Mavros | AttitudeMessage::Px4);
    let frame = match source.field("frame").optional() {
        None if by_flags => AttitudeFrame::Flags,
        _ => {
            let expected = if by_flags { FRAMES_BY_FLAGS } else { FRAMES };
            one_of(&source.field("frame"), expected, |frame| by_flags || *frame != AttitudeFrame::Flags)?
        }
    };
    let axes = match source.field("axes").optional() {
        // These messages are defined in FRD.
        None if by_flags => BodyAxes::Frd,
        _ => one_of(&source.field("axes"), BODY_AXES, |_| true)?,
    };
    let vehicle = source.field("vehicle").optional();
    let vehicle_topic = vehicle.map(|topic| topic.text(VEHICLE).map(str::to_owned)).transpose()?;
    if vehicle_topic.is_none() && frame != AttitudeFrame::Body {
        let expected = format!("{VEHICLE}, since frame is {}", frame.name());
        return Err(source.field("vehicle").unexpected(&expected));
    }
    let vehicle_axes = source.field("vehicle_axes").optional();
    let vehicle_axes = vehicle_axes.map(|field| one_of(&field, BODY_AXES, |_| true)).transpose()?;
    let gimbal_axes = source.field("gimbal_axes").optional().map(|field| named_axes(&field)).transpose()?;
    let imu_axes = source.field("imu_axes").optional().map(|field| named_axes(&field)).transpose()?;
    let imu_axes = imu_axes.unwrap_or(NamedAxes::FLU);
    let offset = source.field("first_joint_offset");
    let first_joint_offset_rad = if offset.is_present() {
        offset.in_radians(offset.number("an angle in rad")?, std::f64::consts::TAU)?
    } else {
        0.0
    };
    let chain = source.field("chain").optional().map(|chain| read_chain(&chain).map(Box::new)).transpose()?;
    let source = AttitudeSource {
        message,
        frame,
        axes,
        gimbal_axes,
        imu_axes,
        vehicle_topic,
        vehicle_axes,
        first_joint_offset_rad,
        chain,
    };
    Ok((topic, source))
}

fn read_chain(chain: &Field<'_>) -> Result<ClassicalChain, FileError> {
    let links = chain.field("links").list("a list of links with theta_offset, d, a and alpha")?;
    Ok(ClassicalChain {
        imu_from_base: chain.field("T_I_B").transform()?,
        links: links.iter().take(InverseChain::MAX_JOINTS + 1).map(Field::link).collect::<Result<_, _>>()?,
        effector_from_camera: chain.field("T_E_C").transform()?,
    })
}

fn read_message(source: &Field<'_>) -> Result<AttitudeMessage, FileError> {
    let name = source.field("type").text(TYPES)?;
    let message = match name {
        "quaternion" => AttitudeMessage::Quaternion,
        "pose" => AttitudeMessage::Pose,
        "mavros" => AttitudeMessage::Mavros,
        "px4" => AttitudeMessage::Px4,
        "euler" => {
            let order = source.field("order");
            let order = EulerAngles::parse_order(order.text(ORDER)?).ok_or_else(|| order.unexpected(ORDER))?;
            let unit = one_of(&source.field("unit"), &AngleUnit::alternatives(), |_| true)?;
            AttitudeMessage::Euler(EulerAngles { order, unit })
        }
        "tf" => {
            let frame = |key: &str, expected: &str| source.field(key).text(expected).map(str::to_owned);
            let parent = frame("parent", "the name of the frame that the attitude is relative to")?;
            AttitudeMessage::Transforms { parent, child: frame("child", "the name of the gimbal's frame")? }
        }
        _ => return Err(source.field("type").unexpected(TYPES)),
    };
    for (key, kind) in [("order", "euler"), ("unit", "euler"), ("parent", "tf"), ("child", "tf")] {
        if kind != name && source.field(key).is_present() {
            return Err(source.field(key).error(format!("has no meaning with type {name}, only with {kind}")));
        }
    }
    Ok(message)
}

fn named_axes(field: &Field<'_>) -> Result<NamedAxes, FileError> {
    field.text(NAMED_AXES)?.parse().map_err(|()| field.unexpected(NAMED_AXES))
}

fn one_of<N: Named>(field: &Field<'_>, expected: &str, allowed: impl Fn(&N) -> bool) -> Result<N, FileError> {
    N::from_name(field.text(expected)?).filter(allowed).ok_or_else(|| field.unexpected(expected))
}

/// Keys and values of a source in the order of a rig, without its chain; texts without quotes.
pub(crate) fn entries(topic: &str, source: &AttitudeSource) -> Vec<(&'static str, String)> {
    let mut entries = vec![("topic", topic.to_owned()), ("type", source.message.name().to_owned())];
    entries.push(("frame", source.frame.name().to_owned()));
    entries.push(("axes", source.axes.name().to_owned()));
    if let Some(axes) = source.gimbal_axes {
        entries.push(("gimbal_axes", axes.to_string()));
    }
    if source.imu_axes != NamedAxes::FLU {
        entries.push(("imu_axes", source.imu_axes.to_string()));
    }
    match &source.message {
        AttitudeMessage::Euler(angles) => {
            entries.push(("order", angles.order_text()));
            entries.push(("unit", angles.unit.name().to_owned()));
        }
        AttitudeMessage::Transforms { parent, child } => {
            entries.push(("parent", parent.clone()));
            entries.push(("child", child.clone()));
        }
        _ => {}
    }
    if let Some(topic) = &source.vehicle_topic {
        entries.push(("vehicle", topic.clone()));
    }
    if let Some(axes) = source.vehicle_axes {
        entries.push(("vehicle_axes", axes.name().to_owned()));
    }
    if source.first_joint_offset_rad != 0.0 {
        entries.push(("first_joint_offset", format!("{:?}", source.first_joint_offset_rad)));
    }
    entries
}
