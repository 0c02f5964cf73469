//! Decompression of chunks and messages, within the limits of the log.

use std::borrow::Cow;
use std::io::{ErrorKind, Read};

use super::file::ZSTD_MAGIC;
use crate::files::{LimitExceeded, LimitKind, LogLimits};

/// Decompresses a chunk as far as possible, at most `claimed` bytes; the second value is the error that stopped it
/// early.
pub(super) fn unpack_chunk(compression: &str, data: &[u8], claimed: usize) -> (Vec<u8>, Option<String>) {
    let mut records = Vec::new();
    if let Err(error) = records.try_reserve_exact(claimed) {
        return (records, Some(format!("{claimed} bytes do not fit into memory: {error}")));
    }
    // One byte more shows that a chunk is larger than declared.
    let limit = claimed as u64 + 1;
    let problem = match compression {
        "zstd" => match zstd::Decoder::with_buffer(data) {
            Ok(decoder) => read_up_to(decoder, limit, &mut records),
            Err(error) => Some(error.to_string()),
        },
        "lz4" => unpack_lz4(data, limit, &mut records),
        other => Some(format!("compressed with {other:?}, expected zstd or lz4")),
    };
    (records, problem)
}

/// Decompresses consecutive LZ4 frames.
fn unpack_lz4(mut data: &[u8], limit: u64, records: &mut Vec<u8>) -> Option<String> {
    while !data.is_empty() && (records.len() as u64) < limit {
        let mut decoder = match lz4::Decoder::new(data) {
            Ok(decoder) => decoder,
            Err(error) => return Some(error.to_string()),
        };
        let problem = read_up_to(&mut decoder, limit - records.len() as u64, records);
        let (rest, finished) = decoder.finish();
        if problem.is_some() {
            return problem;
        }
        if let Err(error) = finished
            && (records.len() as u64) < limit
        {
            return Some(error.to_string());
        }
        if rest.len() == data.len() {
            return Some("the decompressor makes no progress".into());
        }
        data = rest;
    }
    None
}

/// Appends the output of a decoder, at most `limit` bytes; returns the error that stopped it, if any.
fn read_up_to(decoder: impl Read, limit: u64, bytes: &mut Vec<u8>) -> Option<String> {
    let error = decoder.take(limit).read_to_end(bytes).err()?;
    Some(if error.kind() == ErrorKind::UnexpectedEof { "it ends early".into() } else { error.to_string() })
}

/// Decompresses a message if it is compressed: rosbag2 can compress every message separately
/// (`compression_mode: MESSAGE`). No message in CDR begins like a frame of Zstandard.
pub(crate) fn unpack_message<'a>(data: &'a [u8], limits: &LogLimits) -> Result<Cow<'a, [u8]>, String> {
    if !data.starts_with(&ZSTD_MAGIC) {
        return Ok(data.into());
    }
    let allowed = limits.record_bytes(data.len() as u64);
    let decoder = zstd::Decoder::with_buffer(data).map_err(|error| error.to_string())?;
    let mut message = Vec::new();
    if let Some(problem) = read_up_to(decoder, allowed.saturating_add(1), &mut message) {
        return Err(format!("a message cannot be decompressed: {problem}"));
    }
    if message.len() as u64 > allowed {
        let kind = LimitKind::RecordBytes;
        // The size is unknown; the error suggests twice the limit.
        let exceeded = LimitExceeded { kind, subject: "a compressed message", found: 2 * allowed, allowed };
        return Err(exceeded.to_string());
    }
    Ok(message.into())
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn lz4(plain: &[u8]) -> Vec<u8> {
        let mut encoder = lz4::EncoderBuilder::new().build(Vec::new()).unwrap();
        encoder.write_all(plain).unwrap();
        let (packed, result) = encoder.finish();
        result.unwrap();
        packed
    }

    #[test]
    fn chunks_of_several_frames_are_unpacked() {
        let parts: [Vec<u8>; 2] = [(0..100_000_u32).map(|n| (n % 251) as u8).collect(), vec![7; 5000]];
        let plain = parts.concat();
        let zstd = parts.each_ref().map(|part| zstd::encode_all(&part[..], 1).unwrap()).concat();
        let lz4 = parts.each_ref().map(|part| lz4(part)).concat();
        for (name, packed) in [("zstd", zstd), ("lz4", lz4)] {
            assert_eq!(unpack_chunk(name, &packed, plain.len()), (plain.clone(), None), "{name}");
            let (more, _) = unpack_chunk(name, &packed, plain.len() - 1);
            assert_eq!(more.len(), plain.len(), "{name}: one byte more than claimed");
            let (cut, problem) = unpack_chunk(name, &packed[..packed.len() / 2], plain.len());
            assert!(problem.is_some() && plain.starts_with(&cut), "{name}: {problem:?}");
        }
        assert!(unpack_chunk("snappy", &[1, 2], 10).1.unwrap().contains("\"snappy\", expected zstd or lz4"));
    }

    #[test]
    fn messages_under_zstandard_are_unpacked_within_the_limit() {
        let limits = LogLimits::default();
        assert_eq!(unpack_message(&[0, 1, 0, 0, 5], &limits).unwrap(), &[0, 1, 0, 0, 5][..]);
        let plain = vec![3; 100_000];
        let packed = zstd::encode_all(&plain[..], 1).unwrap();
        assert_eq!(unpack_message(&packed, &limits).unwrap(), plain);
        assert!(unpack_message(&packed[..packed.len() - 3], &limits).unwrap_err().contains("cannot be decompressed"));
        let bomb = zstd::encode_all(std::io::repeat(0).take(40 << 20), 1).unwrap();
        let problem = unpack_message(&bomb, &limits).unwrap_err();
        assert!(problem.contains("more than the limit of 33554432") && problem.contains("record-bytes="), "{problem}");
    }
}
