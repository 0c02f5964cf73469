//! MP4 files, also fragmented ones: the frames of their video with their times, and the payloads of their telemetry.

mod annex_b;
mod boxes;
mod fragments;
mod sei;
mod track;

use std::path::Path;

use super::super::ConvertError;
use super::candidates::Samples;
use super::recorded::rate_hz;
use crate::files::LogLimits;
use crate::flight_log::container::file::LogFile;
use crate::flight_log::messages::VideoCodec;
use annex_b::UnitFormat;
use boxes::{FileBox, child, children, descendant, file_boxes, u32_at, u64_at};
use fragments::Fragments;
use sei::{SeiUnit, sei_unit, unregistered};
use track::{MovieTrack, Sample};

/// Seconds from 1904, the origin of MP4 times, to the epoch.
const EPOCH_1904_S: u64 = 2_082_844_800;

/// Number of frames without a message of users after which none is expected.
const SEARCHED_FRAMES: usize = 300;
/// Number of bytes at the start of a frame in which messages of users are searched: they come before its slices.
const SEARCHED_BYTES: usize = 16_384;

/// Frame of a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct VideoFrame {
    /// Time of exposure, in nanoseconds since the start of the video.
    pub(super) presented_ns: i64,
    /// Time of the message in the log: in the order of decoding, never before the exposure.
    pub(super) decoded_ns: i64,
    start: usize,
    length: usize,
}

#[derive(Debug)]
pub(super) struct Video {
    file: LogFile,
    format: UnitFormat,
    pub(super) codec: VideoCodec,
    pub(super) resolution_px: [usize; 2],
    pub(super) frames: Vec<VideoFrame>,
    has_reordered_frames: bool,
}

/// Payload of a telemetry sample with its time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Payload {
    /// Nanoseconds from the start of the video to its first sample, and to the next payload.
    pub(super) start_ns: i64,
    pub(super) end_ns: i64,
    pub(super) bytes: Vec<u8>,
}

/// Content of a file.
#[derive(Debug)]
pub(super) struct Movie {
    pub(super) video: Video,
    /// Telemetry of `GoPro` (GPMF).
    pub(super) telemetry: Vec<Payload>,
    /// Camera motion metadata (CAMM).
    pub(super) motion: Vec<Payload>,
    /// Subtitles (`tx3g`), one payload per text.
    pub(super) subtitles: Vec<Payload>,
    /// Start of the recording by the camera's clock, in nanoseconds since the epoch.
    pub(super) created_ns: Option<i64>,
    /// Version of a `GoPro`'s firmware.
    pub(super) firmware: Option<String>,
    pub(super) notes: Vec<String>,
}

/// True if a file begins like an MP4 or `QuickTime` file.
pub(in super::super) fn is_movie(start: &[u8]) -> bool {
    start
        .get(4..8)
        .is_some_and(|kind| [b"ftyp", b"moov", b"mdat", b"wide", b"skip", b"free"].iter().any(|name| *name == kind))
}

/// Opens a file and reads its tables.
pub(super) fn open(path: &Path, limits: &LogLimits) -> Result<Movie, ConvertError> {
    let file = LogFile::open(path, limits)?;
    let unreadable = |problem: String| ConvertError::unreadable(problem, path);
    let found = file_boxes(&file).map_err(unreadable)?;
    let Some(moov) = found.iter().find(|found| &found.kind == b"moov") else {
        return Err(unreadable(
            "the MP4 has no moov box, the table of its frames: the recording was not closed (power lost, card removed) or \
             the copy is incomplete; copy it again, let the camera repair it, or rebuild the table with untrunc and an \
             intact recording of the same camera"
                .to_owned(),
        ));
    };
    let table = file.read(moov.start..moov.end).map_err(|problem| unreadable(format!("the moov box: {problem}")))?;
    let mut notes = Vec::new();
    let header = child(&table, b"mvhd").unwrap_or_default();
    let (created_s, movie_timescale) = if header.first() == Some(&1) {
        (u64_at(header, 4), u32_at(header, 20))
    } else {
        (u32_at(header, 4).map(u64::from), u32_at(header, 12))
    };
    let created_s = created_s.and_then(|created_s| i64::try_from(created_s.checked_sub(EPOCH_1904_S)?).ok());
    let firmware = descendant(&table, &[b"udta", b"FIRM"]).map(|text| String::from_utf8_lossy(text).into_owned());
    let max_samples = limits.messages(file.len() as u64);
    let traks = children(&table).filter(|(kind, _)| kind == b"trak");
    let mut tracks: Vec<MovieTrack<'_>> =
        traks.filter_map(|(_, trak)| track::read(trak, movie_timescale.unwrap_or(1), max_samples)).collect();
    add_fragments(&file, &found, &table, &mut tracks, max_samples, &mut notes).map_err(unreadable)?;
    let [telemetry, motion, subtitles] =
        [(b"gpmd", "telemetry"), (b"camm", "camera motion metadata"), (b"tx3g", "subtitles")]
            .map(|(kind, name)| payloads(&tracks, kind, name, &file, &mut notes));
    let (track, format, resolution_px) = video_track(&tracks).map_err(unreadable)?;
    let (frames, has_reordered_frames) = frames(track, file.len(), &mut notes);
    if frames.is_empty() {
        return Err(unreadable(format!("the video has no frame within the file; {}", notes.join("; "))));
    }
    if !track.is_upright {
        notes.push("the video is marked for rotated display; its frames are used as stored".to_owned());
    }
    if track.edits > 1 {
        notes.push(format!("the video has an edit list of {} parts; only its first time is applied", track.edits));
    }
    let codec = format.codec;
    let video = Video { file, format, codec, resolution_px, frames, has_reordered_frames };
    let created_ns = created_s.and_then(|created_s| created_s.checked_mul(1_000_000_000));
    Ok(Movie { video, telemetry, motion, subtitles, created_ns, firmware, notes })
}

/// The first video track that can be read, how its units are stored, and its resolution.
fn video_track<'a>(tracks: &'a [MovieTrack<'a>]) -> Result<(&'a MovieTrack<'a>, UnitFormat, [usize; 2]), String> {
    let mut others = Vec::new();
    for track in tracks.iter().filter(|track| &track.handler == b"vide") {
        let (kind, description) = track.description;
        let read = track::visual(description).and_then(|(resolution_px, boxes)| {
            let format = match &kind {
                b"avc1" | b"avc3" => UnitFormat::avc(child(boxes, b"avcC")?),
                b"hvc1" | b"hev1" => UnitFormat::hevc(child(boxes, b"hvcC")?),
                _ => None,
            };
            Some((track, format?, resolution_px))
        });
        if let Some(read) = read {
            return Ok(read);
        }
        others.push(String::from_utf8_lossy(&kind).into_owned());
    }
    Err(if others.is_empty() {
        "the MP4 has no video track".to_owned()
    } else {
        format!(
            "unsupported video type {:?}; expected H.264 (avc1) or H.265 (hvc1, hev1): \
             re-encode it with 'ffmpeg -i IN.mp4 -map 0 -c:v libx264 -bf 0 -c:d copy -copy_unknown OUT.mp4'",
            others.join(", ")
        )
    })
}

/// The frames that lie in the file, and whether they are shown in another order than decoded.
fn frames(track: &MovieTrack<'_>, file_bytes: usize, notes: &mut Vec<String>) -> (Vec<VideoFrame>, bool) {
    // Frames that depend on later ones are written when the last of these is decoded.
    let delay_ns = track.samples.iter().map(|sample| sample.presented_ns.saturating_sub(sample.decoded_ns)).max();
    let delay_ns = delay_ns.unwrap_or(0);
    let mut lost = track.undescribed;
    let mut frames = Vec::with_capacity(track.samples.len());
    // Frames do not overlap: together they cannot be longer than the file.
    let mut budget = file_bytes;
    for sample in &track.samples {
        match place(sample, file_bytes).filter(|(_, length)| *length <= budget) {
            Some((start, length)) => {
                budget -= length;
                let decoded_ns = sample.decoded_ns.saturating_add(delay_ns);
                frames.push(VideoFrame { presented_ns: sample.presented_ns, decoded_ns, start, length });
            }
            None => lost += 1,
        }
    }
    if lost > 0 {
        let all = track.samples.len() as u64 + track.undescribed;
        notes.push(format!("{lost} of {all} frames are lost: beyond the end of the file (truncated) or not described"));
    }
    let reordered = frames.windows(2).any(|pair| pair[1].presented_ns < pair[0].presented_ns);
    (frames, reordered)
}

/// Position and length of a sample that lies in the file.
fn place(sample: &Sample, file_bytes: usize) -> Option<(usize, usize)> {
    let (start, length) = (usize::try_from(sample.start).ok()?, usize::try_from(sample.length).ok()?);
    (length > 0 && start.checked_add(length)? <= file_bytes).then_some((start, length))
}

/// Adds the samples of the fragments to the samples of the tables.
fn add_fragments(
    file: &LogFile,
    boxes: &[FileBox],
    moov: &[u8],
    tracks: &mut [MovieTrack<'_>],
    max_samples: u64,
    notes: &mut Vec<String>,
) -> Result<(), String> {
    let Some(mut fragments) = Fragments::new(moov, tracks, max_samples) else { return Ok(()) };
    for fragment in boxes.iter().filter(|found| &found.kind == b"moof") {
        // A recording that was not closed ends within a fragment.
        if fragment.end > file.len() {
            notes.push("the last fragment is incomplete (power lost, or the copy is incomplete)".to_owned());
            continue;
        }
        let content = file.read(fragment.start..fragment.end).map_err(|problem| format!("a moof box: {problem}"))?;
        fragments.add(&content, fragment.at as u64, tracks);
    }
    if fragments.undescribed > 0 {
        notes.push(format!("{} samples or fragments are damaged, or more than the limit", fragments.undescribed));
    }
    Ok(())
}

/// The payloads of the first track with a type of description.
fn payloads(
    tracks: &[MovieTrack<'_>],
    kind: &[u8; 4],
    name: &str,
    file: &LogFile,
    notes: &mut Vec<String>,
) -> Vec<Payload> {
    let Some(track) = tracks.iter().find(|track| &track.description.0 == kind) else { return Vec::new() };
    let mut payloads = Vec::new();
    let mut lost = track.undescribed;
    // Together they cannot be longer than the file.
    let mut budget = file.len();
    for sample in &track.samples {
        let read = place(sample, file.len()).filter(|(_, length)| *length <= budget).and_then(|(start, length)| {
            budget -= length;
            file.read(start..start + length).ok()
        });
        match read {
            Some(bytes) => payloads.push(Payload {
                start_ns: sample.presented_ns,
                end_ns: sample.presented_ns.saturating_add(sample.duration_ns),
                bytes,
            }),
            None => lost += 1,
        }
    }
    if lost > 0 {
        notes.push(format!("{lost} payloads of {name} are lost: beyond the end of the file (truncated)"));
    }
    payloads
}

impl Video {
    /// Frame in Annex B.
    pub(super) fn access_unit(&self, number: usize) -> Result<Vec<u8>, String> {
        let VideoFrame { start, length, .. } = self.frames[number];
        self.format.access_unit(&self.file.read(start..start + length)?)
    }

    /// Calls a function with the time and the content of every message of users with an identifier
    /// (`user_data_unregistered`), in the order of the frames; the search ends after many frames without one.
    pub(super) fn each_message(&self, uuid: [u8; 16], mut take: impl FnMut(i64, &[u8])) {
        let mut found = 0_usize;
        for (number, frame) in self.frames.iter().enumerate() {
            if found == 0 && number >= SEARCHED_FRAMES {
                return;
            }
            let length = frame.length.min(SEARCHED_BYTES);
            let Ok(start) = self.file.read(frame.start..frame.start + length) else { continue };
            for unit in self.format.units(&start).map_while(Result::ok) {
                match sei_unit(self.codec, unit[0]) {
                    SeiUnit::Messages { header_bytes } => {
                        for content in unregistered(unit, header_bytes, uuid) {
                            found += 1;
                            take(frame.presented_ns, &content);
                        }
                    }
                    SeiUnit::Slice => break,
                    SeiUnit::Other => {}
                }
            }
        }
    }

    /// Description such as `h264, 854×480, 29.97 fps`.
    pub(super) fn description(&self) -> String {
        let times: Samples<()> = self.frames.iter().map(|frame| (frame.decoded_ns, ())).collect();
        let [width, height] = self.resolution_px;
        let order = if self.has_reordered_frames { "; with B-frames, in the order of decoding" } else { "" };
        format!("{}, {width}×{height}, {:.2} fps{order}", self.codec.name(), rate_hz(&times))
    }

    /// First and last time of the frames in nanoseconds since the start of the video.
    pub(super) fn span_ns(&self) -> (i64, i64) {
        let times = || self.frames.iter().map(|frame| frame.presented_ns);
        (times().min().unwrap_or(0), times().max().unwrap_or(0))
    }
}
