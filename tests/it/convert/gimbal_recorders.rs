//! Small videos of gimbal cameras, for the tests of `convert` and the seeds of its fuzz targets: telemetry in SEI messages,
//! subtitles and motion tracks, and fragments.

use super::recorders::{Track, describe_records, floats, mp4_box, put_record};

/// Identifier of the messages of `AP_CameraGimbal`.
const UUID: [u8; 16] = [0x8d, 0x64, 0x6b, 0x4e, 0x55, 0x6f, 0x4a, 0x90, 0x8b, 0x7c, 0x35, 0xe6, 0x29, 0x51, 0x03, 0x21];

fn words(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_be_bytes()).collect()
}

/// Puts a message of a user before the units of a sample of H.264 with length prefixes.
pub(crate) fn with_message(sample: &mut Vec<u8>, text: &str) {
    let content = [&UUID[..], text.as_bytes()].concat();
    let mut payload = vec![5];
    payload.extend(std::iter::repeat_n(0xFF, content.len() / 255));
    payload.push((content.len() % 255) as u8);
    payload.extend(content);
    payload.push(0x80);
    let mut unit = vec![6];
    let mut zeros = 0;
    for byte in payload {
        if zeros == 2 && byte <= 3 {
            unit.push(3);
            zeros = 0;
        }
        zeros = if byte == 0 { zeros + 1 } else { 0 };
        unit.push(byte);
    }
    let mut out = (unit.len() as u32).to_be_bytes().to_vec();
    out.extend(unit);
    out.append(sample);
    *sample = out;
}

/// A track of subtitles that last 50 ms each.
pub(crate) fn subtitle_track(texts: &[String]) -> Track<'static> {
    let sample = |text: &String| [&(text.len() as u16).to_be_bytes()[..], text.as_bytes()].concat();
    track(b"text", b"tx3g", 50, texts.iter().map(sample).collect())
}

/// A track of CAMM packets that last 5 ms each.
pub(crate) fn motion_track(packets: &[(u16, Vec<u8>)]) -> Track<'static> {
    let sample = |(kind, content): &(u16, Vec<u8>)| [&[0, 0], &kind.to_le_bytes()[..], content].concat();
    track(b"meta", b"camm", 5, packets.iter().map(sample).collect())
}

fn track(handler: &'static [u8; 4], kind: &[u8; 4], duration: u32, samples: Vec<Vec<u8>>) -> Track<'static> {
    let description = mp4_box(kind, &[&[0; 8]]);
    Track { handler, description, timescale: 1000, duration, delays: Vec::new(), samples, media_start: 0 }
}

/// A fragmented movie, one frame of its track per fragment; the tables of `moov` are empty.
///
/// The data of every second fragment begin relative to the fragment, those of the others at a byte of the file; size and
/// duration stand in the run or are defaults.
pub(crate) fn fragmented(track: &Track<'_>) -> Vec<u8> {
    let table = [
        mp4_box(b"stsd", &[&words(&[0, 1]), &track.description]),
        mp4_box(b"stts", &[&words(&[0, 0])]),
        mp4_box(b"stsc", &[&words(&[0, 0])]),
        mp4_box(b"stsz", &[&words(&[0, 0, 0])]),
        mp4_box(b"stco", &[&words(&[0, 0])]),
    ];
    let media = [
        mp4_box(b"mdhd", &[&words(&[0, 0, 0, track.timescale, 0, 0])]),
        mp4_box(b"hdlr", &[&words(&[0, 0]), track.handler, &[0; 13]]),
        mp4_box(b"minf", &[&mp4_box(b"stbl", &[&table.concat()])]),
    ];
    let header = mp4_box(b"tkhd", &[&words(&[0, 0, 0, 1]), &[0; 68]]);
    let extends = mp4_box(b"mvex", &[&mp4_box(b"trex", &[&words(&[0, 1, 1, track.duration, 0, 0])])]);
    let tables = mp4_box(
        b"moov",
        &[
            &mp4_box(b"mvhd", &[&words(&[0, 0, 0, 1000, 0])]),
            &mp4_box(b"trak", &[&header, &mp4_box(b"mdia", &[&media.concat()])]),
            &extends,
        ],
    );
    let mut out = [mp4_box(b"ftyp", &[b"iso5", &[0; 4], b"iso5"]), tables].concat();
    for (number, sample) in track.samples.iter().enumerate() {
        let (time, size) = (number as u32 * track.duration, sample.len() as u32);
        let time = mp4_box(b"tfdt", &[&words(&[0, time])]);
        let build = |data: u32| {
            let (header, run) = if number % 2 == 0 {
                // Defaults of the movie, the size in the run, data relative to the fragment.
                (words(&[0x02_0000, 1]), words(&[0x201, 1, data, size]))
            } else {
                // The size as a default of the fragment, data from a byte of the file.
                (words(&[0x11, 1, 0, out.len() as u32 + data, size]), words(&[0x100, 1, track.duration]))
            };
            let traf = [mp4_box(b"tfhd", &[&header]), time.clone(), mp4_box(b"trun", &[&run])].concat();
            mp4_box(b"moof", &[&mp4_box(b"mfhd", &[&words(&[0, number as u32])]), &mp4_box(b"traf", &[&traf])])
        };
        let fragment = build(build(0).len() as u32 + 8);
        out.extend(fragment);
        out.extend(mp4_box(b"mdat", &[sample]));
    }
    out
}

/// A `DataFlash` log of `AP_CameraGimbal`: angles at 10 Hz, position and UTC.
pub(crate) fn camera_log(samples: usize, angles_deg: [f64; 3]) -> Vec<u8> {
    let mut out = Vec::new();
    let types = [
        (133, "GIMB", "QQffffff", "TimeUS,SampleUS,Roll,Pitch,Yaw,RollRate,PitchRate,YawRate", 43),
        (132, "ATT", "QIBffffff", "TimeUS,BootMS,Src,Roll,Pitch,Yaw,RollRate,PitchRate,YawRate", 40),
        (131, "POS", "QILLfffff", "TimeUS,BootMS,Lat,Lng,Alt,RelAlt,VN,VE,VD", 43),
        (142, "TIME", "QQ", "TimeUS,UTC", 19),
    ];
    describe_records(&mut out, &types);
    let mut record = |kind: u8, content: &[&[u8]]| put_record(&mut out, kind, content);
    for index in 0..samples as u64 {
        let time = (2_000_000 + 100_000 * index).to_le_bytes();
        // Measured 20 ms before.
        let sampled = (1_980_000 + 100_000 * index).to_le_bytes();
        record(133, &[&time, &sampled, &floats(&angles_deg), &floats(&[0.0; 3])]);
        record(132, &[&time, &[0; 4], &[1], &floats(&[2.0, -4.0, 90.0]), &floats(&[f64::NAN, f64::NAN, 0.0])]);
        let place = [470_000_000_i32, 80_000_000].map(i32::to_le_bytes).concat();
        record(131, &[&time, &[0; 4], &place, &floats(&[500.0, 10.0, 0.0, 0.0, 0.0])]);
        record(142, &[&time, &(1_717_977_602_000_000 + 100_000 * index).to_le_bytes()]);
    }
    out
}
