//! Subtitles that SIYI's gimbal cameras write into their videos: text with the angles of the gimbal and the position.
//!
//! Fields and angles as `MAVProxy` reads them (`modules/lib/siyi_video.py`): roll and pitch from the horizon, yaw from the
//! vehicle, in degrees.

use super::mp4::{Payload, Video};
use super::recorded::{GimbalAttitude, GimbalFrame, Recorded, from_euler};
use crate::flight_log::trajectory::geodesy::Geodetic;

/// Name of the format in the report.
const FORMAT: &str = "SIYI subtitles";
const GIMBAL: &str = "SIYI gb_roll, gb_pitch, gb_yaw";
/// Largest time between a subtitle and the frame that it counts.
const MAX_DISTANCE_NS: i64 = 25_000_000;

/// Content of a subtitle.
#[derive(Clone, Debug, PartialEq)]
struct SiyiSubtitle {
    /// Number of the video frame.
    frame: usize,
    /// Roll, pitch and yaw of the gimbal.
    angles_deg: [f64; 3],
    /// Latitude and longitude in degrees, altitude in metres.
    place: Option<[f64; 3]>,
    zoom: Option<f64>,
}

/// Reads the subtitles, in nanoseconds since the start of the video; `None` if none is SIYI's.
pub(super) fn read(subtitles: &[Payload], video: &Video) -> Option<Recorded> {
    let mut recorded = Recorded::new(FORMAT, "");
    let mut zooms = Vec::new();
    let mut count = 0;
    for payload in subtitles {
        let Some(subtitle) = text(&payload.bytes).and_then(parse) else {
            recorded.leave(FORMAT, "no text with SIYI's fields");
            continue;
        };
        count += 1;
        let frame_ns = video.frames.get(subtitle.frame).map(|frame| frame.presented_ns);
        let Some(time_ns) =
            frame_ns.filter(|at| at.saturating_sub(payload.start_ns).saturating_abs() <= MAX_DISTANCE_NS)
        else {
            recorded.leave(GIMBAL, "at another time than the frame that it counts");
            continue;
        };
        if let Some(frame_from_camera) = from_euler(subtitle.angles_deg.map(f64::to_radians)) {
            let attitude = GimbalAttitude { frame: GimbalFrame::Vehicle, frame_from_camera };
            recorded.gimbal.push((3, 0), GIMBAL, time_ns, attitude);
        }
        let place = subtitle.place.and_then(|[latitude, longitude, up]| Geodetic::from_deg(latitude, longitude, up));
        if let Some(place) = place {
            recorded.fixes.push((5, 0), "SIYI latitude, longitude, abs_alt", time_ns, place);
        }
        zooms.extend(subtitle.zoom);
    }
    if count == 0 {
        return None;
    }
    zooms.sort_by(f64::total_cmp);
    if let (Some(least), Some(most)) = (zooms.first(), zooms.last())
        && most > least
    {
        recorded.notes.push(format!("the camera zooms ({least}× to {most}×): a rig has one camera model"));
    }
    Some(recorded)
}

/// Text of a sample of a `tx3g` track: its length in two bytes, then UTF-8; boxes of style may follow.
fn text(sample: &[u8]) -> Option<&str> {
    let (length, rest) = sample.split_at_checked(2)?;
    let length = usize::from(u16::from_be_bytes([length[0], length[1]]));
    std::str::from_utf8(rest.get(..length)?).ok()
}

/// Reads `DATE stream->FrameCnt:N …` with `name:value` between commas and line ends.
fn parse(text: &str) -> Option<SiyiSubtitle> {
    let frame = text.split_once("FrameCnt:")?.1.split(|letter: char| !letter.is_ascii_digit()).next()?;
    let field = |name: &str| {
        let pieces = text.split(['\n', '\r', ',']).filter_map(|piece| piece.trim().split_once(':'));
        pieces
            .filter(|(key, _)| key.rsplit(char::is_whitespace).next() == Some(name))
            .map(|(_, value)| value.trim())
            .next()
    };
    let number = |name: &str| field(name)?.parse::<f64>().ok().filter(|number| number.is_finite());
    let angles_deg = [number("gb_roll")?, number("gb_pitch")?, number("gb_yaw")?];
    let place = || {
        let latitude_deg = coordinate_deg(field("latitude")?, ['N', 'S'])?;
        Some([latitude_deg, coordinate_deg(field("longitude")?, ['E', 'W'])?, number("abs_alt")?])
    };
    let zoom = number("mix_ratio").filter(|zoom| *zoom > 0.0);
    Some(SiyiSubtitle { frame: frame.parse().ok()?, angles_deg, place: place(), zoom })
}

/// Degrees of a coordinate such as `N35°21′43.1″`; `None` for another format.
fn coordinate_deg(text: &str, [positive, negative]: [char; 2]) -> Option<f64> {
    let mut letters = text.chars();
    let sign = match letters.next()? {
        letter if letter == positive => 1.0,
        letter if letter == negative => -1.0,
        _ => return None,
    };
    let (degrees, rest) = letters.as_str().split_once('°')?;
    let (minutes, rest) = rest.split_once(['′', '\''])?;
    let (seconds, rest) = rest.split_once(['″', '"'])?;
    let [degrees, minutes, seconds] = [degrees, minutes, seconds].map(|number| number.parse::<f64>().ok());
    let (minutes, seconds) = (minutes?, seconds?);
    let valid = rest.trim().is_empty() && (0.0..60.0).contains(&minutes) && (0.0..60.0).contains(&seconds);
    valid.then_some(sign * (degrees? + minutes / 60.0 + seconds / 3600.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "2026-05-01_10-11-12 stream->FrameCnt:42 \nlatitude:S35°21′43.2″, longitude:E149°9′54″\n\
                        rel_alt:650.0, abs_alt:650.0\ngb_yaw:-12.5, gb_pitch:-30.0, gb_roll:0.5\nmix_ratio:2.0";

    #[test]
    fn fields_are_read() {
        let subtitle = parse(TEXT).unwrap();
        assert_eq!((subtitle.frame, subtitle.angles_deg, subtitle.zoom), (42, [0.5, -30.0, -12.5], Some(2.0)));
        let [latitude, longitude, altitude] = subtitle.place.unwrap();
        assert!((latitude + 35.362).abs() < 1e-9 && (longitude - 149.165).abs() < 1e-9 && altitude == 650.0);
        let sample = [&[0, 5][..], b"abc", b"de", b"style"].concat();
        assert_eq!(text(&sample), Some("abcde"));
    }

    #[test]
    fn other_texts_are_refused() {
        for bad in ["", "a subtitle", "FrameCnt:1", "FrameCnt:x gb_roll:1"] {
            assert_eq!(parse(bad), None, "{bad}");
        }
        assert_eq!(parse(&TEXT.replace("-30.0", "nan")), None);
        assert_eq!(parse(&TEXT.replace("S35°", "X35°")).unwrap().place, None);
        for bad in ["N35", "N35°61′0″", "N35°1′0", "E1°1′1″", "°′″"] {
            assert_eq!(coordinate_deg(bad, ['N', 'S']), None, "{bad}");
        }
        assert_eq!((text(&[0, 9, b'a']), text(&[0]), text(&[0, 1, 0xFF])), (None, None, None));
    }
}
