//! Faults as text in the changes of a fork: `NAME:PART:PART` with the values that undo them.

use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use super::fault::{Choice, Fault, ImageFlip, ImageHalf};
use super::table::{LONGEST_SHIFT_S, Part, TABLE};
use crate::text::Named as _;

impl fmt::Display for Fault {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = self.kind.row();
        let Some(correction) = &row.correction else { return out.write_str(row.key) };
        out.write_str(correction.name)?;
        let (mut values, mut joints) = (self.values.iter(), self.joints.iter());
        for part in correction.parts {
            out.write_str(":")?;
            match part {
                Part::Factor => write!(out, "{}", values.next().unwrap_or(&1.0))?,
                Part::Shift | Part::Duration => write!(out, "{}s", values.next().unwrap_or(&0.0))?,
                Part::Angle => write!(out, "{}rad", values.next().unwrap_or(&0.0))?,
                Part::Joint => out.write_str(joints.next().map_or("", |joint| joint))?,
                Part::Flip | Part::Half | Part::Axes => match self.choice {
                    Some(Choice::Flip(flip)) => out.write_str(flip.name())?,
                    Some(Choice::Half(half)) => out.write_str(half.name())?,
                    Some(Choice::Axes(axes)) => write!(out, "{axes}")?,
                    None => {}
                },
            }
        }
        Ok(())
    }
}

impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let corrections = || TABLE.iter().filter_map(|row| Some((row.kind, row.correction.as_ref()?)));
        let unknown = || {
            let forms: Vec<String> = corrections().map(|(_, it)| format!("{}:{}", it.name, it.example)).collect();
            format!("'{text}' is no correction; expected one of {}", forms.join(", "))
        };
        let (name, value) = text.split_once(':').ok_or_else(unknown)?;
        let (kind, correction) = corrections().find(|(_, it)| it.name == name).ok_or_else(unknown)?;
        let texts: Vec<&str> = value.rsplitn(correction.parts.len(), ':').collect();
        if texts.len() < correction.parts.len() {
            return Err(unknown());
        }
        let mut fault = Self::from(kind);
        for (part, text) in correction.parts.iter().zip(texts.into_iter().rev()) {
            match part {
                Part::Factor => fault.values.push(factor(text)?),
                Part::Shift => {
                    let expected = "a time of at most 50 ms, as in 15ms";
                    fault.values.push(quantity(text, &SECONDS, LONGEST_SHIFT_S, expected)?);
                }
                Part::Duration => {
                    let duration_s = quantity(text, &SECONDS, 60.0, "a time of at most 60 s, as in 1s")?;
                    fault.values.push(duration_s.max(0.0));
                }
                Part::Angle => {
                    fault.values.push(quantity(text, &RADIANS, 10.0, "an angle of at most 10 rad, as in 20deg")?);
                }
                Part::Joint => fault.joints.push(text.to_owned()),
                Part::Flip => fault.choice = Some(Choice::Flip(ImageFlip::from_name(text).ok_or_else(unknown)?)),
                Part::Half => fault.choice = Some(Choice::Half(ImageHalf::from_name(text).ok_or_else(unknown)?)),
                Part::Axes => fault.choice = Some(Choice::Axes(text.parse()?)),
            }
        }
        Ok(fault)
    }
}

/// Units with their sizes.
const SECONDS: [(&str, f64); 2] = [("ms", 1e-3), ("s", 1.0)];
const RADIANS: [(&str, f64); 3] = [("deg", PI / 180.0), ("mrad", 1e-3), ("rad", 1.0)];

fn factor(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|factor| (1e-3..=1e3).contains(factor));
    value.ok_or_else(|| format!("'{text}' is no factor from 0.001 to 1000"))
}

/// Number with a unit, of at most `largest` in the unit of size 1.
fn quantity(text: &str, units: &[(&str, f64)], largest: f64, expected: &str) -> Result<f64, String> {
    let found = units.iter().find_map(|(unit, size)| Some((text.strip_suffix(unit)?, *size)));
    let value = found.and_then(|(digits, size)| digits.trim().parse::<f64>().ok().map(|value| value * size));
    value.filter(|value| value.abs() <= largest).ok_or_else(|| format!("'{text}' is not {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::FaultKind;

    #[test]
    fn corrections_are_read_as_they_are_written() {
        for text in [
            "focal:0.77",
            "zoom:1.5:1.25s",
            "image:upside-down",
            "ignored:top",
            "camera-shift:0.015s",
            "joint-shift:-0.03s",
            "reversed:yaw",
            "swapped:yaw:pitch",
            "offset:yaw:0.35rad",
            "joint-scale:57.3",
            "imu-axes:y/x/-z",
            "gyroscope-axes:-x/y/z",
            "accelerometer-axes:z/x/y",
            "gyroscope-scale:0.5",
            "accelerometer-scale:9.81",
        ] {
            assert_eq!(text.parse::<Fault>().unwrap().to_string(), text);
        }
        assert_eq!("camera-shift:15ms".parse(), Ok(Fault::new(FaultKind::CameraClock, &[0.015])));
        for (text, word) in [
            ("focus:2", "'focus:2' is no correction"),
            ("focal:0", "'0' is no factor"),
            ("focal:NaN", "no factor"),
            ("camera-shift:2s", "at most 50 ms"),
            ("imu-axes:x/x/z", "no axes"),
            ("offset:yaw", "no correction"),
        ] {
            let problem = text.parse::<Fault>().unwrap_err();
            assert!(problem.contains(word), "{text}: {problem}");
        }
        let listed = "zoom".parse::<Fault>().unwrap_err();
        assert!(listed.contains("focal:FACTOR, zoom:FACTOR:1s, image:mirrored|flipped|upside-down"), "{listed}");
    }
}
