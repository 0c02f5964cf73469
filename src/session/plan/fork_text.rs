//! The changes of a fork as text.

use std::fmt;
use std::str::FromStr;

use super::fork_changes::{FORK_PARAMETERIZATIONS, ForkChanges, ForkError, OTHER_CAMERA};
use super::run_spec::ParameterizationChoice;
use crate::estimator::SensorColumns;

impl FromStr for ForkChanges {
    type Err = ForkError;

    fn from_str(text: &str) -> Result<Self, ForkError> {
        let mut changes = Self::default();
        let bad = |problem: String| ForkError::BadChange { text: text.to_owned(), problem };
        for item in text.split(',').map(str::trim).filter(|item| !item.is_empty()) {
            let Some((key, value)) = item.split_once('=') else {
                let choice = FORK_PARAMETERIZATIONS.into_iter().find(|choice| choice.name() == item);
                let known = FORK_PARAMETERIZATIONS.map(ParameterizationChoice::name).join(", ");
                let expected = || {
                    if ParameterizationChoice::all().any(|(name, _)| name == item) {
                        bad(format!("'{item}' uses other cameras: {OTHER_CAMERA}; add a run {item} instead"))
                    } else {
                        bad(format!("unknown parameterization '{item}', expected one of {known}"))
                    }
                };
                changes.parameterization = Some(choice.ok_or_else(expected)?);
                continue;
            };
            let quantity = |text: &str| {
                number(text).ok_or_else(|| {
                    bad(format!("{key} is '{text}', expected a number with an optional unit (deg, mrad, rad, mm, m)"))
                })
            };
            let factor = |text: &str| {
                let expected = || bad(format!("{key} is '{text}', expected a factor from 0.001 to 1000"));
                number(text).filter(|factor| (1e-3..=1e3).contains(factor)).ok_or_else(expected)
            };
            let several = || value.split('+').map(str::trim).filter(|name| !name.is_empty());
            match key.trim() {
                "estimate" => {
                    for name in several() {
                        let columns = SensorColumns::ALL.into_iter().find(|columns| columns.key() == name);
                        let known = SensorColumns::ALL.map(SensorColumns::key).join(", ");
                        let expected = || bad(format!("estimate is '{name}', expected one of {known}"));
                        changes.estimated.insert(columns.ok_or_else(expected)?);
                    }
                }
                "freeze" => changes.frozen.extend(several().map(str::to_owned)),
                "set" => {
                    for one in several_values(value) {
                        let (name, value) = one.split_once(':').ok_or_else(|| {
                            bad(format!("'{one}' has no value; expected set=PARAMETER:VALUE, as in set=yaw.alpha:1deg"))
                        })?;
                        changes.values.push((name.trim().to_owned(), quantity(value)?));
                    }
                }
                "drop" => {
                    for id in several() {
                        let expected = || bad(format!("'{id}' is not a feature id"));
                        changes.dropped.insert(id.parse().ok().ok_or_else(expected)?);
                    }
                }
                "without" => changes.without.extend(several().map(str::to_owned)),
                "camera" => return Err(bad(format!("{OTHER_CAMERA}; a run with camera={value} can be added instead"))),
                "encoder" => {
                    if value.trim() != "off" {
                        return Err(bad(format!(
                            "encoder is '{value}', expected off: a calibration that was initialized without encoder readings has \
                             no joint offsets; add a run with encoder=on instead"
                        )));
                    }
                    changes.encoder_off = true;
                }
                "joint-noise" => {
                    changes.joint_noise_rad = quantity(value)?;
                    if changes.joint_noise_rad < 0.0 {
                        return Err(bad(format!("joint-noise is '{value}', expected 0 or more")));
                    }
                }
                "imu-noise" => changes.imu_noise = factor(value)?,
                "pixel-noise" => changes.pixel_noise = factor(value)?,
                "encoder-noise" => changes.encoder_noise = factor(value)?,
                _ => {
                    let known = "estimate, freeze, set, drop, without, encoder, joint-noise, imu-noise, pixel-noise, encoder-noise";
                    return Err(bad(format!("unknown key '{key}', expected one of {known}")));
                }
            }
        }
        Ok(changes)
    }
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

/// A number with an optional unit (`deg`, `mrad`, `rad`, `mm`, `m`), in radians or metres.
fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let units = [("deg", std::f64::consts::PI / 180.0), ("mrad", 1e-3), ("rad", 1.0), ("mm", 1e-3), ("m", 1.0)];
    let unit = units.iter().find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, *factor)));
    let (digits, factor) = unit.unwrap_or((text, 1.0));
    digits.trim().parse::<f64>().ok().map(|value| value * factor).filter(|value| value.is_finite())
}

impl fmt::Display for ForkChanges {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let standard = Self::default();
        let mut items: Vec<String> = self.parameterization.iter().map(|choice| choice.name().to_owned()).collect();
        if !self.estimated.is_empty() {
            let keys: Vec<&str> = self.estimated.iter().map(|columns| columns.key()).collect();
            items.push(format!("estimate={}", keys.join("+")));
        }
        if !self.frozen.is_empty() {
            items.push(format!("freeze={}", self.frozen.join("+")));
        }
        items.extend(self.values.iter().map(|(name, value)| format!("set={name}:{value}")));
        if !self.dropped.is_empty() {
            let dropped: Vec<String> = self.dropped.iter().map(u64::to_string).collect();
            items.push(format!("drop={}", dropped.join("+")));
        }
        if !self.without.is_empty() {
            items.push(format!("without={}", self.without.iter().cloned().collect::<Vec<_>>().join("+")));
        }
        if self.encoder_off {
            items.push("encoder=off".to_owned());
        }
        let values = [
            ("joint-noise", self.joint_noise_rad, standard.joint_noise_rad),
            ("imu-noise", self.imu_noise, standard.imu_noise),
            ("pixel-noise", self.pixel_noise, standard.pixel_noise),
            ("encoder-noise", self.encoder_noise, standard.encoder_noise),
        ];
        items.extend(
            values
                .iter()
                .filter(|(_, value, default)| value != default)
                .map(|(key, value, _)| format!("{key}={value}")),
        );
        formatter.write_str(&items.join(","))
    }
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
