//! Writer of small ROS 1 bags, after the description of the format.

use std::io::Write as _;

/// Compression of the chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    Bz2,
    Lz4,
}

/// Seconds and nanoseconds, 4 bytes each.
pub(super) fn time(stamp_ns: i64) -> Vec<u8> {
    let parts = [stamp_ns / 1_000_000_000, stamp_ns % 1_000_000_000];
    parts.iter().flat_map(|part| (*part as u32).to_le_bytes()).collect()
}

pub(super) fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

/// `std_msgs/Header` with a sequence number that the conversion must drop.
pub(super) fn header(stamp_ns: i64, frame_id: &str) -> Vec<u8> {
    [&77_u32.to_le_bytes()[..], &time(stamp_ns), &text(frame_id)].concat()
}

pub(super) fn f64s(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

pub(super) fn f64_sequence(values: &[f64]) -> Vec<u8> {
    [&(values.len() as u32).to_le_bytes()[..], &f64s(values)].concat()
}

/// A record of a header's fields and data.
pub(super) fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut header = Vec::new();
    for (name, value) in fields {
        let entry = [name.as_bytes(), b"=", value].concat();
        header.extend((entry.len() as u32).to_le_bytes());
        header.extend(entry);
    }
    [&(header.len() as u32).to_le_bytes()[..], &header, &(data.len() as u32).to_le_bytes(), data].concat()
}

/// Message for a bag.
pub(super) struct Message {
    pub(super) topic: &'static str,
    pub(super) message_type: &'static str,
    pub(super) time_ns: i64,
    pub(super) data: Vec<u8>,
}

/// A bag of several messages per chunk; `encryptor` is empty for a plain one.
pub(super) fn bag(messages: &[Message], per_chunk: usize, compression: Compression, encryptor: &str) -> Vec<u8> {
    let mut bag = b"#ROSBAG V2.0\n".to_vec();
    let fields: [(&str, &[u8]); 5] = [
        ("op", &[3]),
        ("index_pos", &0_u64.to_le_bytes()),
        ("conn_count", &0_u32.to_le_bytes()),
        ("chunk_count", &0_u32.to_le_bytes()),
        ("encryptor", encryptor.as_bytes()),
    ];
    bag.extend(record(&fields, &[b' '; 64]));
    let mut topics: Vec<&str> = Vec::new();
    for chunk in messages.chunks(per_chunk) {
        let mut plain = Vec::new();
        for message in chunk {
            let known = topics.iter().position(|topic| *topic == message.topic);
            let id = known.unwrap_or(topics.len()) as u32;
            if known.is_none() {
                topics.push(message.topic);
                let connection = [("topic", message.topic), ("type", message.message_type), ("md5sum", "*")];
                let connection = connection.map(|(name, value)| [name, "=", value].concat());
                let data: Vec<u8> = connection.iter().flat_map(|entry| text(entry)).collect();
                let fields: [(&str, &[u8]); 3] =
                    [("op", &[7]), ("conn", &id.to_le_bytes()), ("topic", message.topic.as_bytes())];
                plain.extend(record(&fields, &data));
            }
            let time = time(message.time_ns);
            plain.extend(record(&[("op", &[2]), ("conn", &id.to_le_bytes()), ("time", &time)], &message.data));
        }
        let (name, packed) = pack(&plain, compression);
        let fields: [(&str, &[u8]); 3] =
            [("op", &[5]), ("compression", name.as_bytes()), ("size", &(plain.len() as u32).to_le_bytes())];
        bag.extend(record(&fields, &packed));
        bag.extend(record(&[("op", &[4]), ("ver", &1_u32.to_le_bytes())], &[0; 12]));
    }
    bag
}

fn pack(plain: &[u8], compression: Compression) -> (&'static str, Vec<u8>) {
    match compression {
        Compression::None => ("none", plain.to_vec()),
        Compression::Bz2 => {
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::best());
            encoder.write_all(plain).expect("a vector takes every byte");
            ("bz2", encoder.finish().expect("a vector takes every byte"))
        }
        Compression::Lz4 => {
            let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).expect("the encoder starts");
            encoder.write_all(plain).expect("a vector takes every byte");
            let (packed, result) = encoder.finish();
            result.expect("a vector takes every byte");
            ("lz4", packed)
        }
    }
}
