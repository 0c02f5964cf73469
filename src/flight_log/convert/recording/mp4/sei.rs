//! Messages of users in H.264 and H.265 video: `user_data_unregistered` of supplemental enhancement information (SEI).

use crate::flight_log::messages::VideoCodec;

/// Payload type of `user_data_unregistered` (H.264, D.1.7; H.265, D.2.7).
const UNREGISTERED: usize = 5;
/// Size of the identifier at the start of a message.
const UUID_BYTES: usize = 16;

/// Role of a unit for the search of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SeiUnit {
    /// Messages for the frame that follows, with the size of the unit's header.
    Messages {
        header_bytes: usize,
    },
    /// Slice of the frame itself: messages come before it.
    Slice,
    Other,
}

pub(super) fn sei_unit(codec: VideoCodec, header: u8) -> SeiUnit {
    match (codec, header & 0x1F, header >> 1 & 0x3F) {
        (VideoCodec::H264, 6, _) => SeiUnit::Messages { header_bytes: 1 },
        (VideoCodec::H265, _, 39) => SeiUnit::Messages { header_bytes: 2 },
        (VideoCodec::H264, 1..=5, _) | (VideoCodec::H265, _, 0..=31) => SeiUnit::Slice,
        _ => SeiUnit::Other,
    }
}

/// Contents of the messages of a unit with an identifier; a message that ends beyond the unit ends the list.
pub(super) fn unregistered(unit: &[u8], header_bytes: usize, uuid: [u8; UUID_BYTES]) -> Vec<Vec<u8>> {
    let payload = without_emulation(unit.get(header_bytes..).unwrap_or_default());
    let mut rest = payload.as_slice();
    let mut found = Vec::new();
    // The unit ends with a bit of one and zeros.
    while rest.len() > 2 {
        let Some((kind, size)) = number(&mut rest).zip(number(&mut rest)) else { break };
        let Some((message, behind)) = rest.split_at_checked(size) else { break };
        if kind == UNREGISTERED && message.starts_with(&uuid) {
            found.push(message[UUID_BYTES..].to_vec());
        }
        rest = behind;
    }
    found
}

/// Number in bytes of 255 and a last one.
fn number(rest: &mut &[u8]) -> Option<usize> {
    let mut number = 0_usize;
    loop {
        let (byte, behind) = rest.split_first()?;
        *rest = behind;
        number = number.checked_add(usize::from(*byte))?;
        if *byte != 0xFF {
            return Some(number);
        }
    }
}

/// Removes the bytes that keep start codes out of a unit: the 3 of 0, 0, 3.
fn without_emulation(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut zeros = 0;
    for byte in bytes {
        if zeros >= 2 && *byte == 3 {
            zeros = 0;
            continue;
        }
        zeros = if *byte == 0 { zeros + 1 } else { 0 };
        out.push(*byte);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const UUID: [u8; 16] = [7; 16];

    /// Unit with one message of a type.
    fn unit(kind: u8, content: &[u8]) -> Vec<u8> {
        let mut unit = vec![6, kind];
        unit.extend(std::iter::repeat_n(0xFF, content.len() / 255));
        unit.push((content.len() % 255) as u8);
        unit.extend_from_slice(content);
        unit.push(0x80);
        unit
    }

    #[test]
    fn messages_are_found_by_their_identifier() {
        let long = [&UUID[..], &[b'x'; 600]].concat();
        assert_eq!(unregistered(&unit(5, &long), 1, UUID), [vec![b'x'; 600]]);
        assert!(unregistered(&unit(4, &long), 1, UUID).is_empty());
        assert!(unregistered(&unit(5, &long), 1, [8; 16]).is_empty());
        let two = [&unit(1, b"ab")[..4], &unit(5, &[&UUID[..], b"c"].concat())[1..]].concat();
        assert!(unregistered(&two, 1, UUID).is_empty(), "the first message has two bytes, of which one is missing");
        let two = [&unit(1, b"ab")[..5], &unit(5, &[&UUID[..], b"c"].concat())[1..]].concat();
        assert_eq!(unregistered(&two, 1, UUID), [b"c".to_vec()]);
    }

    #[test]
    fn damaged_units_have_no_messages() {
        let whole = unit(5, &[&UUID[..], b"text"].concat());
        for end in 0..whole.len() - 1 {
            assert!(unregistered(&whole[..end], 1, UUID).is_empty(), "{end}");
        }
        assert!(unregistered(&[0xFF; 700], 1, UUID).is_empty());
        assert!(unregistered(&[], 2, UUID).is_empty());
    }

    #[test]
    fn bytes_against_start_codes_are_removed() {
        assert_eq!(without_emulation(&[0, 0, 3, 1, 0, 0, 3, 0, 0, 3, 3]), [0, 0, 1, 0, 0, 0, 0, 3]);
        assert_eq!(without_emulation(&[0, 3, 0, 0]), [0, 3, 0, 0]);
        assert_eq!(sei_unit(VideoCodec::H265, 39 << 1), SeiUnit::Messages { header_bytes: 2 });
        assert_eq!(sei_unit(VideoCodec::H264, 0x65), SeiUnit::Slice);
        assert_eq!(sei_unit(VideoCodec::H264, 0x67), SeiUnit::Other);
    }
}
