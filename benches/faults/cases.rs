//! The planted faults: each kind of the table with three sizes, and the time from which on it acts.

use anyhow::{Result, anyhow, ensure};
use dcvins::faults::{Fault, FaultKind, TABLE};

use crate::flights::Flight;

/// Sizes of a kind.
enum Sizes {
    /// Corrections as in the changes of a fork.
    Texts([&'static str; 3]),
    /// Values of a kind without a correction.
    Values([&'static [f64]; 3]),
    /// No flight can have it; the reason.
    None(&'static str),
}

use Sizes::{None as Not, Texts, Values};

/// Just detectable, typical and gross size of a kind; choices without a size are three different ones.
fn sizes(kind: FaultKind) -> Sizes {
    match kind {
        FaultKind::Focal => Texts(["focal:0.96", "focal:0.88", "focal:0.7"]),
        FaultKind::Zoom => Texts(["zoom:1.08:1s", "zoom:1.3:1s", "zoom:1.8:1s"]),
        FaultKind::ImageFlip => Texts(["image:mirrored", "image:flipped", "image:upside-down"]),
        FaultKind::CameraClock => Texts(["camera-shift:10ms", "camera-shift:25ms", "camera-shift:-50ms"]),
        FaultKind::EncoderClock => Texts(["joint-shift:-30ms", "joint-shift:40ms", "joint-shift:-50ms"]),
        FaultKind::JointReversed => Texts(["reversed:roll", "reversed:pitch", "reversed:yaw"]),
        FaultKind::JointsSwapped => Texts(["swapped:yaw:roll", "swapped:roll:pitch", "swapped:yaw:pitch"]),
        FaultKind::JointOffset => Texts(["offset:yaw:3deg", "offset:pitch:-10deg", "offset:yaw:35deg"]),
        FaultKind::JointScale => Texts(["joint-scale:0.9", "joint-scale:1.5", "joint-scale:57.29578"]),
        FaultKind::ImuAxes => Texts(["imu-axes:-x/-y/z", "imu-axes:y/-x/z", "imu-axes:y/x/-z"]),
        FaultKind::GyroscopeAxes => {
            Texts(["gyroscope-axes:x/y/-z", "gyroscope-axes:y/-x/z", "gyroscope-axes:-x/-y/-z"])
        }
        FaultKind::AccelerometerAxes => {
            Texts(["accelerometer-axes:-x/-y/z", "accelerometer-axes:y/-x/z", "accelerometer-axes:-x/-y/-z"])
        }
        FaultKind::GyroscopeScale => Texts(["gyroscope-scale:1.05", "gyroscope-scale:0.5", "gyroscope-scale:57.29578"]),
        FaultKind::AccelerometerScale => {
            Texts(["accelerometer-scale:1.05", "accelerometer-scale:0.5", "accelerometer-scale:9.80665"])
        }
        FaultKind::Shutter => Values([&[0.008], &[0.016], &[0.03]]),
        FaultKind::PrincipalPoint => Values([&[0.03, 0.0], &[0.08, 0.05], &[0.25, 0.0]]),
        FaultKind::Intrinsics => Values([&[1.05, 0.03, 0.0], &[1.12, 0.08, 0.05], &[1.4, 0.2, 0.0]]),
        FaultKind::Mount => Values([&[0.0, 0.035, 0.0], &[0.0, 0.0, 0.1], &[0.2, 0.2, 0.0]]),
        FaultKind::ImuNoise | FaultKind::EncoderNoise => Values([&[3.0], &[10.0], &[30.0]]),
        FaultKind::ImageRegion => Not("which images the rest of the view had is unknown"),
        FaultKind::Clocks => Not("two faults at once"),
        FaultKind::FocalPeriod => Values([&[1.015, 4.0], &[1.04, 3.0], &[1.1, 6.0]]),
        FaultKind::Radial => Values([&[-0.06], &[-0.15], &[-0.35]]),
        FaultKind::ImageOrder => Not("images are written in the order of their stamps"),
        FaultKind::JointPlay => Not("the direction of motion is unknown where readings are planted"),
        FaultKind::FocalPieces => Not("several zooms, one after the other"),
        FaultKind::CameraDrift => Not("images would have to be exposed by a clock of another rate"),
        FaultKind::Chain => Not("a distance and an angle have no direction"),
        FaultKind::ImuIntrinsics => Not("it has no values"),
        FaultKind::ImagesExchanged => Not("the topics of the rig are exchanged, which no correction does"),
        FaultKind::UnusableImu | FaultKind::UnusableJoints | FaultKind::UnusableImages => {
            Not("no correction describes the measurements")
        }
    }
}

/// True if a fault is a wrong value of the rig, which holds for the whole log.
pub(crate) fn is_of_rig(kind: FaultKind) -> bool {
    !is_of_images(kind)
        && (kind == FaultKind::Focal || kind == FaultKind::CameraClock || kind.row().correction.is_none())
}

/// True if other images have to be rendered.
pub(crate) fn is_of_images(kind: FaultKind) -> bool {
    matches!(kind, FaultKind::Zoom | FaultKind::FocalPeriod | FaultKind::ImageFlip)
}

/// A fault planted in a flight; `None` for a control.
pub(crate) struct Case {
    pub(crate) flight: Flight,
    pub(crate) fault: Option<Fault>,
}

/// Cases of all flights, controls first.
pub(crate) fn cases(flights: &[Flight]) -> Result<Vec<Case>> {
    let mut cases: Vec<Case> = flights.iter().map(|flight| Case { flight: *flight, fault: None }).collect();
    for row in TABLE {
        let faults: Vec<Fault> = match sizes(row.kind) {
            Texts(texts) => texts
                .iter()
                .map(|text| text.parse::<Fault>().map_err(|problem| anyhow!(problem)))
                .collect::<Result<_>>()?,
            Values(values) => values.iter().map(|values| Fault::new(row.kind, values)).collect(),
            Not(_) => continue,
        };
        ensure!(faults.iter().all(|fault| fault.kind == row.kind), "{} has sizes of another kind", row.key);
        for flight in flights.iter().filter(|flight| flight.has(row.sensor)) {
            for fault in &faults {
                let begins = [None, Some(flight.middle_s())];
                for since_s in begins.into_iter().take(if is_of_rig(row.kind) { 1 } else { 2 }) {
                    let fault = Fault { since_s, ..fault.clone() };
                    cases.push(Case { flight: *flight, fault: Some(fault) });
                }
            }
        }
    }
    Ok(cases)
}

/// Rows of the table that no flight has, with the reason.
pub(crate) fn left_out() -> impl Iterator<Item = (&'static str, &'static str)> {
    TABLE.iter().filter_map(|row| if let Not(reason) = sizes(row.kind) { Some((row.key, reason)) } else { None })
}

/// Fault in one word: its correction, or its kind and values.
pub(crate) fn text_of(fault: &Fault) -> String {
    if fault.kind.row().correction.is_some() {
        return fault.to_string();
    }
    fault.values.iter().fold(fault.to_string(), |all, value| format!("{all}:{value}"))
}
