//! Mechanism suggested by the names of the joints in a log.

use super::{GimbalAxis, MechanismAxes};
use crate::flight_log::{FlightLog, MessageKind, messages};

/// Largest number of joints of a message that is taken for a gimbal's: robots publish the joints of arms and wheels
/// too.
const MOST_JOINTS: usize = 4;

/// Axes in the order of the joints of the first readable `JointState` message; `None` if a name suggests no axis or an
/// axis is repeated.
pub fn suggested_mechanism(log: &FlightLog) -> Option<MechanismAxes> {
    let topic = log.topics_of(&[MessageKind::JointState]).into_iter().next()?;
    let axes = log.find_message(&topic, |data| {
        let message = messages::read_joint_state(data).ok()?;
        let axes: Option<Vec<GimbalAxis>> = message.names.iter().map(|name| GimbalAxis::of_joint(name)).collect();
        axes.filter(|axes| !axes.is_empty() && axes.len() <= MOST_JOINTS)
    })?;
    let repeated = axes.iter().enumerate().any(|(place, axis)| axes[..place].contains(axis));
    (!repeated).then_some(MechanismAxes(axes))
}
