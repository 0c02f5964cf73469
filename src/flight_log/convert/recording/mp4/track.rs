//! Tracks of an MP4 file: position, decoding time and display time of each sample.

use super::boxes::{child, descendant, u16_at, u32_at, u64_at};

/// Sample of a track: a video frame, or a payload of telemetry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Sample {
    /// Start in the file; the end may lie beyond the file.
    pub(super) start: u64,
    pub(super) length: u64,
    /// Nanoseconds since the start of the movie.
    pub(super) decoded_ns: i64,
    pub(super) presented_ns: i64,
    pub(super) duration_ns: i64,
}

/// Relation of a track's times to the movie's times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TrackClock {
    /// Units of the track's times in one second.
    timescale: i128,
    /// First displayed time in these units.
    media_start: i64,
    /// Delay of the track in the movie.
    delay_ns: i64,
}

impl TrackClock {
    /// Converts a time of the track to nanoseconds since the start of the movie.
    pub(super) fn in_ns(self, units: i64) -> Option<i64> {
        let time_ns = i128::from(units.saturating_sub(self.media_start)) * 1_000_000_000 / self.timescale;
        i64::try_from(time_ns).ok()?.checked_add(self.delay_ns)
    }
}

#[derive(Clone, Debug)]
pub(super) struct MovieTrack<'a> {
    /// Number of the track, 0 without a header.
    pub(super) id: u32,
    pub(super) clock: TrackClock,
    /// Decoding time behind the last sample of the tables, in units of the track.
    pub(super) end: u64,
    /// Such as `vide`, `soun`, `meta`.
    pub(super) handler: [u8; 4],
    /// Type and content of the first sample description.
    pub(super) description: ([u8; 4], &'a [u8]),
    pub(super) samples: Vec<Sample>,
    /// Number of samples in the tables without a position or a time.
    pub(super) undescribed: u64,
    /// True if the track is displayed as it is stored, without rotation.
    pub(super) is_upright: bool,
    /// Number of parts of the edit list; only the first is applied.
    pub(super) edits: usize,
}

/// Reads a `trak` box; `None` when a table is missing. `max_samples` bounds what the tables may announce.
pub(super) fn read(trak: &[u8], movie_timescale: u32, max_samples: u64) -> Option<MovieTrack<'_>> {
    let media = child(trak, b"mdia")?;
    let handler: [u8; 4] = child(media, b"hdlr")?.get(8..12)?.try_into().ok()?;
    let header = child(media, b"mdhd")?;
    // Version 1 has times of 64 bits.
    let timescale = if header.first() == Some(&1) { u32_at(header, 20)? } else { u32_at(header, 12)? };
    let table = descendant(media, &[b"minf", b"stbl"])?;
    let descriptions = child(table, b"stsd")?;
    let size = u32_at(descriptions, 8)? as usize;
    let kind: [u8; 4] = descriptions.get(12..16)?.try_into().ok()?;
    let description = (kind, descriptions.get(16..8_usize.checked_add(size)?)?);
    let places = places(table, max_samples)?;
    let (edits, delay_ns, media_start) = edits(trak, movie_timescale);
    let clock = TrackClock { timescale: i128::from(timescale).max(1), media_start, delay_ns };
    let mut durations = runs(child(table, b"stts")?);
    let mut delays = runs(child(table, b"ctts").unwrap_or_default());
    let mut samples = Vec::with_capacity(places.places.len());
    let mut decoded = 0_i64;
    for (start, length) in &places.places {
        let Some(duration) = durations.next() else { break };
        // Offsets are signed in version 1; in version 0 they are below 2³¹ in practice.
        let presented = decoded.saturating_add(i64::from(delays.next().unwrap_or(0).cast_signed()));
        let end = decoded.saturating_add(i64::from(duration));
        let (Some(decoded_ns), Some(presented_ns), Some(end_ns)) =
            (clock.in_ns(decoded), clock.in_ns(presented), clock.in_ns(end))
        else {
            break;
        };
        let duration_ns = end_ns.saturating_sub(decoded_ns);
        samples.push(Sample { start: *start, length: *length, decoded_ns, presented_ns, duration_ns });
        decoded = end;
    }
    let undescribed = places.announced.saturating_sub(samples.len() as u64);
    let header = child(trak, b"tkhd");
    let is_upright = header.is_none_or(is_upright);
    let id = header.and_then(|header| u32_at(header, if header.first() == Some(&1) { 20 } else { 12 })).unwrap_or(0);
    let end = u64::try_from(decoded).unwrap_or(0);
    Some(MovieTrack { id, clock, end, handler, description, samples, undescribed, is_upright, edits })
}

/// Positions of samples in the file.
struct Places {
    /// First byte and length of each sample.
    places: Vec<(u64, u64)>,
    /// Number of samples by the table of sizes.
    announced: u64,
}

/// Computes positions from the tables of sizes (`stsz`), samples per chunk (`stsc`) and chunks (`stco`, `co64`).
fn places(table: &[u8], max_samples: u64) -> Option<Places> {
    let sizes = child(table, b"stsz")?;
    let (uniform, announced) = (u32_at(sizes, 4)?, u64::from(u32_at(sizes, 8)?));
    let size = |number: u64| match uniform {
        0 => u32_at(sizes, usize::try_from(number).ok()?.checked_mul(4)?.checked_add(12)?),
        size => Some(size),
    };
    let (offsets, width) = match child(table, b"stco") {
        Some(offsets) => (offsets, 4),
        None => (child(table, b"co64")?, 8),
    };
    let offsets = offsets.get(8..)?.chunks_exact(width);
    let mut runs = child(table, b"stsc")?.get(8..)?.chunks_exact(12).peekable();
    let mut per_chunk = 0;
    let mut places = Vec::new();
    'chunks: for (number, offset) in offsets.enumerate() {
        while let Some(run) = runs.next_if(|run| u32_at(run, 0).is_some_and(|first| first as usize <= number + 1)) {
            per_chunk = u32_at(run, 4)?;
        }
        let mut at = if width == 4 { u64::from(u32_at(offset, 0)?) } else { u64_at(offset, 0)? };
        for _ in 0..per_chunk {
            let number = places.len() as u64;
            if number >= announced.min(max_samples) {
                break 'chunks;
            }
            let Some(length) = size(number) else { break 'chunks };
            places.push((at, u64::from(length)));
            at = at.saturating_add(u64::from(length));
        }
    }
    Some(Places { places, announced })
}

/// Values of a table of runs (number of samples, value).
fn runs(table: &[u8]) -> impl Iterator<Item = u32> {
    let pairs = table.get(8..).unwrap_or_default().chunks_exact(8);
    pairs.flat_map(|pair| {
        let (count, value) = (u32_at(pair, 0).unwrap_or(0), u32_at(pair, 4).unwrap_or(0));
        std::iter::repeat_n(value, count as usize)
    })
}

/// Number of parts of the edit list, delay of the track in nanoseconds, and first displayed media time.
fn edits(trak: &[u8], movie_timescale: u32) -> (usize, i64, i64) {
    let Some(list) = descendant(trak, &[b"edts", b"elst"]) else { return (0, 0, 0) };
    let is_long = list.first() == Some(&1);
    let entries = list.get(8..).unwrap_or_default().chunks_exact(if is_long { 20 } else { 12 });
    let (mut parts, mut delay_ns, mut media_start) = (0, 0_i64, 0);
    for entry in entries {
        let (duration, start) = if is_long {
            (u64_at(entry, 0).unwrap_or(0), u64_at(entry, 8).unwrap_or(0).cast_signed())
        } else {
            let start = u32_at(entry, 4).unwrap_or(0).cast_signed();
            (u64::from(u32_at(entry, 0).unwrap_or(0)), i64::from(start))
        };
        if start >= 0 {
            if parts == 0 {
                media_start = start;
            }
            parts += 1;
        } else if parts == 0 {
            let empty_ns = u128::from(duration) * 1_000_000_000 / u128::from(movie_timescale.max(1));
            delay_ns = delay_ns.saturating_add(i64::try_from(empty_ns).unwrap_or(i64::MAX));
        }
    }
    (parts, delay_ns, media_start)
}

/// True if the matrix of a track header has no rotation.
fn is_upright(header: &[u8]) -> bool {
    let matrix = if header.first() == Some(&1) { 52 } else { 40 };
    let entry = |index: usize| u32_at(header, matrix + 4 * index).map(u32::cast_signed);
    match (entry(0), entry(1), entry(3), entry(4)) {
        (Some(a), Some(b), Some(c), Some(d)) => b == 0 && c == 0 && a >= 0 && d >= 0,
        _ => true,
    }
}

/// Width and height of a visual sample description, and the boxes after its fields.
pub(super) fn visual(description: &[u8]) -> Option<([usize; 2], &[u8])> {
    // After size and type: reserved (6), index (2), fields (16), width, height, fields (50).
    let (width, height) = (u16_at(description, 24)?, u16_at(description, 26)?);
    Some(([usize::from(width), usize::from(height)], description.get(78..)?))
}
