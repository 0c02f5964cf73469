//! Places of fields in messages of PX4, which move between its releases, by the definition in the log.

use super::MessageKind;

/// Kind of a message with an attitude, and the places of its fields if they differ between logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AttitudeLayout {
    pub(crate) kind: MessageKind,
    /// Offset of the quaternion from the end of the encapsulation header, in bytes; 0 for messages of ROS.
    pub(super) rotation: usize,
    /// Offset of the flags of a gimbal's attitude, as [`Self::rotation`].
    pub(super) flags: usize,
}

impl AttitudeLayout {
    /// Layout by the definition of the type in the log; by the current release of PX4 if that is empty.
    ///
    /// # Errors
    /// The field that a message of PX4 lacks.
    pub(crate) fn of(kind: MessageKind, definition: &str) -> Result<Self, String> {
        let current = match kind {
            MessageKind::Px4GimbalAttitude => {
                include_str!("../../../assets/messages/px4_msgs/GimbalDeviceAttitudeStatus.msg")
            }
            MessageKind::Px4VehicleAttitude => include_str!("../../../assets/messages/px4_msgs/VehicleAttitude.msg"),
            _ => return Ok(Self { kind, rotation: 0, flags: 0 }),
        };
        let definition = if definition.trim().is_empty() { current } else { definition };
        let place = |field: &str, kind: &str| {
            place_of(definition, field, kind)
                .ok_or_else(|| format!("its definition in the log has no '{kind} {field}'"))
        };
        if place("timestamp", "uint64")? > 0 {
            return Err("its definition in the log does not begin with 'uint64 timestamp'".to_owned());
        }
        let has_flags = kind == MessageKind::Px4GimbalAttitude;
        let flags = if has_flags { place("device_flags", "uint16")? } else { 0 };
        Ok(Self { kind, rotation: place("q", "float32[4]")?, flags })
    }
}

/// Offset in bytes of a field with this type in a definition (`.msg`) of numbers and arrays of a fixed length, aligned as in
/// CDR; `None` if it has no such field, or one of variable size before it.
fn place_of(definition: &str, name: &str, of_type: &str) -> Option<usize> {
    let mut offset = 0_usize;
    // Types that others need follow after a line of equals signs.
    for line in definition.lines().take_while(|line| !line.starts_with("===")) {
        let mut words = line.split('#').next().unwrap_or_default().split_whitespace();
        let (Some(field_type), Some(field)) = (words.next(), words.next()) else { continue };
        // A constant takes no place.
        if field.contains('=') || words.next().is_some_and(|word| word.starts_with('=')) {
            continue;
        }
        let (number, count) = match field_type.split_once('[') {
            // Short enough that no offset overflows, whatever the definition says.
            Some((number, count)) => (number, usize::from(count.strip_suffix(']')?.parse::<u16>().ok()?)),
            None => (field_type, 1),
        };
        let size = size_of_number(number)?;
        offset = offset.next_multiple_of(size);
        if field == name {
            return (field_type == of_type).then_some(offset);
        }
        offset += size * count;
    }
    None
}

fn size_of_number(name: &str) -> Option<usize> {
    match name {
        "bool" | "byte" | "char" | "int8" | "uint8" => Some(1),
        "int16" | "uint16" => Some(2),
        "int32" | "uint32" | "float32" => Some(4),
        "int64" | "uint64" | "float64" => Some(8),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_where_the_definition_in_the_log_has_them() {
        let places =
            |kind, definition: &str| AttitudeLayout::of(kind, definition).map(|layout| (layout.rotation, layout.flags));
        let (gimbal, vehicle) = (MessageKind::Px4GimbalAttitude, MessageKind::Px4VehicleAttitude);
        assert_eq!((places(vehicle, ""), places(gimbal, " ")), (Ok((16, 0)), Ok((12, 10))));
        let old = "# attitude\nuint64 timestamp # µs\nuint32 VERSION = 1\nfloat32 rollspeed\nfloat32 pitchspeed\n\
                   float32 yawspeed\nfloat32[4] q\n===\nMSG: other\nfloat32[4] q";
        assert_eq!(places(vehicle, old), Ok((20, 0)));
        let aligned = "uint64 timestamp\nuint8 target_system\nuint16 device_flags\nuint8 other\nfloat32[4] q\n";
        assert_eq!(places(gimbal, aligned), Ok((16, 10)));
        for (definition, lacks) in [
            ("uint64 timestamp\nfloat64[4] q\n", "has no 'float32[4] q'"),
            ("uint64 timestamp\nstring name\nfloat32[4] q\n", "has no 'float32[4] q'"),
            ("uint64 timestamp_sample\nuint64 timestamp\nfloat32[4] q\n", "does not begin with 'uint64 timestamp'"),
            ("float32[4] q\n", "has no 'uint64 timestamp'"),
            ("uint64 timestamp\nuint8[18446744073709551607] a\nfloat32[4] q\n", "has no 'float32[4] q'"),
        ] {
            assert!(places(vehicle, definition).unwrap_err().ends_with(lacks), "{definition}");
        }
        assert_eq!(places(MessageKind::Imu, "nothing"), Ok((0, 0)));
    }
}
