//! The changes of a fork as text.

use std::fmt;
use std::str::FromStr;

use super::fork_changes::{FORK_PARAMETERIZATIONS, ForkChanges, ForkError, OTHER_CAMERA};
use super::run_options::{encoder_noise, imu_noise, pixel_noise};
use super::run_spec::ParameterizationChoice;
use crate::estimator::SensorParameters;
use crate::faults::Fault;
use crate::text::{Entry, Field, Key, Named as _, items, read_entry, written_items};

/// Reason why a fork cannot use encoder readings that its parent does not use.
const NO_JOINT_OFFSETS: &str = "off: a calibration that was initialized without encoder readings has no joint offsets; add a run \
                                with encoder=on instead";

impl ForkChanges {
    /// Changes other than the parameterization, in the order of the canonical text.
    pub const KEYS: &'static [Key<Self>] = &[
        Key::<Self>::new(
            "estimate",
            "GROUP+…",
            "sensor parameters estimated from here on: `timeshift`, `readout`, `intrinsics`, `imu-intrinsics`, \
             `gimbal-imu-axes`",
            Field::Other(read_estimated, |changes| joined(changes.estimated.iter().map(|columns| columns.key()))),
        )
        .labelled("", "Estimate sensors", ""),
        Key::<Self>::new(
            "freeze",
            "PARAMETER+…",
            "parameters fixed at their values, as in `freeze=yaw.alpha+yaw.d`",
            Field::Other(
                |changes, entry| {
                    changes.frozen.extend(several(entry).map(str::to_owned));
                    Ok(())
                },
                |changes| joined(&changes.frozen),
            ),
        )
        .labelled("", "Freeze parameters", ""),
        Key::<Self>::new(
            "set",
            "PARAMETER:VALUE",
            "another value (`deg`, `mrad`, `rad`, `mm`, `m`), as in `set=pitch.a:30mm`",
            Field::Other(read_values, |changes| {
                changes.values.iter().map(|(name, value)| format!("{name}:{value}")).collect()
            }),
        )
        .labelled("", "Set parameters", ""),
        Key::<Self>::new(
            "drop",
            "FEATURE+…",
            "features that are not used any more, as in `drop=12+15`",
            Field::Other(read_dropped, |changes| joined(changes.dropped.iter().map(u64::to_string))),
        )
        .labelled("", "Drop features", ""),
        Key::<Self>::new(
            "without",
            "CAMERA",
            "one camera of a `cluster` is not used any more, as in `without=cam1`",
            Field::Other(
                |changes, entry| {
                    changes.without.extend(several(entry).map(str::to_owned));
                    Ok(())
                },
                |changes| joined(&changes.without),
            ),
        )
        .labelled("", "Exclude camera", ""),
        Key::<Self>::new(
            "encoder",
            "off",
            "encoder readings are not used any more",
            Field::Switch(|changes| &mut changes.encoder),
        )
        .labelled("Use from the cursor on", "Encoder readings", ""),
        Key::<Self>::new(
            "joint-noise",
            "ANGLE",
            "standard deviation of noise added to the joint angles, as in `joint-noise=0.5deg`",
            Field::Other(read_joint_noise, |changes| vec![changes.joint_noise_rad.to_string()]),
        )
        .labelled("", "Added joint noise, σ", ""),
        imu_noise::<Self>(|changes| &mut changes.imu_noise).labelled("", "Assumed IMU noise", ""),
        pixel_noise::<Self>(|changes| &mut changes.pixel_noise).labelled("", "Assumed pixel noise", ""),
        encoder_noise::<Self>(|changes| &mut changes.encoder_noise).labelled("", "Assumed encoder noise", ""),
        Key::<Self>::new(
            "chain-prior",
            "F",
            "factor on the rig's standard deviations of the gimbal chain or of the extrinsics, from the next initialization on",
            Field::Factor(|changes| &mut changes.chain_prior, 1e-3..=1e3),
        ),
        Key::<Self>::new(
            "correct",
            "ERROR+…",
            "errors of recording or rig that are undone, as `dcvins diagnose` names them: `focal:0.77`, `reversed:yaw`, \
             `camera-shift:15ms`, `imu-axes:y/x/z`",
            Field::Other(read_corrections, |changes| joined(changes.corrections.iter().map(Fault::to_string))),
        ),
    ];
}

impl FromStr for ForkChanges {
    type Err = ForkError;

    fn from_str(text: &str) -> Result<Self, ForkError> {
        let mut changes = Self::default();
        let bad = |problem: String| ForkError::BadChange { text: text.to_owned(), problem };
        for item in items(text).map(str::trim).filter(|item| !item.is_empty()) {
            match Entry::parse(item).map(Entry::trimmed) {
                None => changes.parameterization = Some(parameterization(item).map_err(bad)?),
                Some(Entry { key: "camera", value }) => {
                    return Err(bad(format!("{OTHER_CAMERA}; a run with camera={value} can be added instead")));
                }
                Some(entry) if entry.key == "encoder" && entry.value != "off" => {
                    return Err(bad(entry.problem(NO_JOINT_OFFSETS)));
                }
                Some(entry) => read_entry(Self::KEYS, &mut changes, &entry).map_err(bad)?,
            }
        }
        Ok(changes)
    }
}

impl fmt::Display for ForkChanges {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut items: Vec<String> = self.parameterization.iter().map(|choice| choice.name().to_owned()).collect();
        items.extend(written_items(Self::KEYS, self, &Self::default()));
        formatter.write_str(&items.join(","))
    }
}

fn parameterization(name: &str) -> Result<ParameterizationChoice, String> {
    let choice = ParameterizationChoice::from_name(name);
    choice.filter(|choice| FORK_PARAMETERIZATIONS.contains(choice)).ok_or_else(|| {
        if choice.is_some() {
            return format!("'{name}' uses other cameras: {OTHER_CAMERA}; add a run {name} instead");
        }
        let known = FORK_PARAMETERIZATIONS.map(ParameterizationChoice::name).join(", ");
        format!("unknown parameterization '{name}', expected one of {known}")
    })
}

/// Texts between plus signs as one canonical text; none of no texts.
fn joined(texts: impl IntoIterator<Item = impl AsRef<str>>) -> Vec<String> {
    let texts: Vec<String> = texts.into_iter().map(|text| text.as_ref().to_owned()).collect();
    if texts.is_empty() { texts } else { vec![texts.join("+")] }
}

/// Names between plus signs.
fn several<'a>(entry: &Entry<'a>) -> impl Iterator<Item = &'a str> {
    entry.value.split('+').map(str::trim).filter(|name| !name.is_empty())
}

fn read_estimated(changes: &mut ForkChanges, entry: &Entry<'_>) -> Result<(), String> {
    for name in several(entry) {
        let columns = SensorParameters::ALL.into_iter().find(|columns| columns.key() == name);
        let known = SensorParameters::ALL.map(SensorParameters::key).join(", ");
        let expected = || format!("estimate is '{name}', expected one of {known}");
        changes.estimated.insert(columns.ok_or_else(expected)?);
    }
    Ok(())
}

fn read_values(changes: &mut ForkChanges, entry: &Entry<'_>) -> Result<(), String> {
    for one in several_values(entry.value) {
        let no_value = || format!("'{one}' has no value; expected set=PARAMETER:VALUE, as in set=yaw.alpha:1deg");
        let (name, value) = one.split_once(':').ok_or_else(no_value)?;
        changes.values.push((name.trim().to_owned(), quantity(&Entry { key: entry.key, value })?));
    }
    Ok(())
}

fn read_dropped(changes: &mut ForkChanges, entry: &Entry<'_>) -> Result<(), String> {
    for id in several(entry) {
        changes.dropped.insert(id.parse().map_err(|_not_a_number| format!("'{id}' is not a feature id"))?);
    }
    Ok(())
}

fn read_corrections(changes: &mut ForkChanges, entry: &Entry<'_>) -> Result<(), String> {
    for text in several(entry) {
        changes.corrections.push(text.parse()?);
    }
    Ok(())
}

fn read_joint_noise(changes: &mut ForkChanges, entry: &Entry<'_>) -> Result<(), String> {
    changes.joint_noise_rad = quantity(entry)?;
    if changes.joint_noise_rad < 0.0 { Err(entry.problem("0 or more")) } else { Ok(()) }
}

/// The items of `yaw.a:1e+3+yaw.d:2`; a plus sign after an exponent belongs to the number.
fn several_values(text: &str) -> Vec<String> {
    let mut items: Vec<String> = Vec::new();
    for piece in text.split('+') {
        match items.last_mut() {
            Some(last) if last.ends_with(['e', 'E']) && last.contains(':') && !piece.contains(':') => {
                last.push('+');
                last.push_str(piece);
            }
            _ => items.push(piece.trim().to_owned()),
        }
    }
    items.retain(|item| !item.is_empty());
    items
}

/// Value with an optional unit (`deg`, `mrad`, `rad`, `mm`, `m`), in radians or metres.
fn quantity(entry: &Entry<'_>) -> Result<f64, String> {
    let text = entry.value.trim();
    let units = [("deg", std::f64::consts::PI / 180.0), ("mrad", 1e-3), ("rad", 1.0), ("mm", 1e-3), ("m", 1.0)];
    let unit = units.iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, *factor)));
    let (digits, factor) = unit.unwrap_or((text, 1.0));
    let value = digits.trim().parse::<f64>().ok().map(|value| value * factor).filter(|value| value.is_finite());
    value.ok_or_else(|| entry.problem("a number with an optional unit (deg, mrad, rad, mm, m)"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes(text: &str) -> ForkChanges {
        text.parse().unwrap()
    }

    #[test]
    fn changes_are_read_and_written() {
        let text =
            "classical,freeze=yaw.alpha+yaw.d,set=pitch.a:30mm+roll.a:1e+1mm,drop=15+12,joint-noise=0.5deg,imu-noise=2";
        let read = changes(text);
        assert_eq!(read.parameterization, Some(ParameterizationChoice::Classical));
        assert_eq!(read.frozen, ["yaw.alpha", "yaw.d"]);
        assert_eq!(read.values, [("pitch.a".to_owned(), 0.03), ("roll.a".to_owned(), 0.01)]);
        assert_eq!(read.dropped.iter().copied().collect::<Vec<_>>(), [12, 15]);
        assert!((read.joint_noise_rad - 0.5_f64.to_radians()).abs() < 1e-15);
        assert_eq!((read.imu_noise, read.pixel_noise), (2.0, 1.0));
        for text in [
            text,
            "",
            "poe",
            "estimate=readout+intrinsics",
            "without=cam1,encoder=off",
            "pixel-noise=0.5,encoder-noise=3",
            "set=L1.d:-0.25",
            "chain-prior=10,correct=focal:0.77+reversed:yaw+camera-shift:-0.015s",
        ] {
            assert_eq!(changes(&changes(text).to_string()), changes(text), "{text}");
        }
    }

    #[test]
    fn rejected_changes_report_what_was_expected() {
        let check = |text: &str, words: &[&str]| {
            let message = text.parse::<ForkChanges>().unwrap_err().to_string();
            assert!(words.iter().all(|word| message.contains(word)), "{text}: {message}");
        };
        check("statik", &["'statik'", "minimal-swapped"]);
        check("static", &["'static'", "features that only its own cameras have observed", "add a run static"]);
        check("camera=cam1", &["without=cam1", "a run with camera=cam1"]);
        check("encoder=on", &["'on'", "joint offsets", "add a run with encoder=on"]);
        check("set=yaw.alpha", &["no value", "set=yaw.alpha:1deg"]);
        check("set=yaw.alpha:far", &["'far'", "number"]);
        check("estimate=shutter", &["'shutter'", "readout", "imu-intrinsics"]);
        check("drop=some", &["'some'", "feature"]);
        check("imu-noise=0", &["'0'", "factor"]);
        check("joint-noise=-1", &["'-1'", "0 or more"]);
        check("speed=3", &["unknown key 'speed'", "freeze"]);
    }
}
