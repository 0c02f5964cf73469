//! Alternative interpretations of a gimbal's attitude.

use crate::flight_log::rig::attitude::entries;
use crate::log_check::permutations::permutations;
use crate::sensors::{AngleUnit, AttitudeFrame, AttitudeMessage, AttitudeSource, BodyAxes, GimbalRig, NamedAxes};
use crate::text::Named as _;

/// Interpretations that differ from `source` in one property, grouped by property.
pub(super) fn changes(source: &AttitudeSource, has_vehicle: bool) -> Vec<Vec<AttitudeSource>> {
    let with = |change: &dyn Fn(&mut AttitudeSource)| {
        let mut other = source.clone();
        change(&mut other);
        other
    };
    let flagged = matches!(source.message, AttitudeMessage::Mavros | AttitudeMessage::Px4);
    let frames = AttitudeFrame::all().filter(|frame| match frame {
        AttitudeFrame::Body => true,
        AttitudeFrame::Vehicle | AttitudeFrame::Earth => has_vehicle,
        AttitudeFrame::Flags => has_vehicle && flagged,
    });
    let mut all = vec![
        frames.map(|frame| with(&|other| other.frame = frame)).collect::<Vec<_>>(),
        BodyAxes::all().map(|axes| with(&|other| other.axes = axes)).collect(),
        [None, Some(NamedAxes::RDF)].into_iter().map(|axes| with(&|other| other.gimbal_axes = axes)).collect(),
        [NamedAxes::FLU, NamedAxes::FRD, NamedAxes::RDF]
            .into_iter()
            .map(|axes| with(&|other| other.imu_axes = axes))
            .collect(),
    ];
    if has_vehicle {
        let given = source.vehicle_axes.unwrap_or(source.axes);
        let axes = BodyAxes::all().filter(|axes| *axes != given);
        all.push(axes.map(|axes| with(&|other| other.vehicle_axes = Some(axes))).collect());
    }
    if let AttitudeMessage::Euler(angles) = &source.message {
        let count = angles.order.len();
        let orders = permutations(count).into_iter().map(|order| {
            let mut other = angles.clone();
            other.order = order.iter().map(|index| angles.order[*index]).collect();
            other
        });
        let fields = permutations(count).into_iter().map(|order| {
            let mut other = angles.clone();
            for (rotation, index) in other.order.iter_mut().zip(order) {
                rotation.field = angles.order[index].field;
            }
            other
        });
        let signs = (0..1_usize << count).map(|signs| {
            let mut other = angles.clone();
            for (index, rotation) in other.order.iter_mut().enumerate() {
                rotation.negative ^= signs >> index & 1 == 1;
            }
            other
        });
        let units = AngleUnit::all().map(|unit| {
            let mut other = angles.clone();
            other.unit = unit;
            other
        });
        let message = |angles| with(&|other| other.message = AttitudeMessage::Euler(Clone::clone(&angles)));
        all.push(orders.map(message).collect());
        all.push(fields.map(message).collect());
        all.push(signs.map(message).collect());
        all.push(units.map(message).collect());
    }
    for sources in &mut all {
        sources.retain(|other| other != source);
    }
    all
}

/// Entries of `gimbal.source` in which another interpretation differs.
pub(super) fn difference(gimbal: &GimbalRig, source: &AttitudeSource, other: &AttitudeSource) -> String {
    let topic = gimbal.topic.as_deref().unwrap_or_default();
    let (given, other) = (entries(topic, source), entries(topic, other));
    let mut changed: Vec<String> =
        other.iter().filter(|entry| !given.contains(entry)).map(|(key, value)| format!("{key}: {value}")).collect();
    for (key, _) in given.iter().filter(|(key, _)| !other.iter().any(|(kept, _)| kept == key)) {
        changed.push(if *key == "imu_axes" { "imu_axes: flu".to_owned() } else { format!("no {key}") });
    }
    changed.join(", ")
}
