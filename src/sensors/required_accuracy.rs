//! Accuracy that the calibration must reach.

use std::collections::BTreeMap;

use crate::geometry::Dimension;
use crate::gimbal::{ParameterId, ParameterNames, ParameterPart};
use crate::table::Shown;
use crate::text::{Entry, items, printable, shortened};

/// Largest standard deviation with which a calibration parameter is known well enough.
#[derive(Clone, Debug, PartialEq)]
pub struct RequiredAccuracy {
    /// Of lengths, in metres.
    pub translation_m: f64,
    /// Of angles, in radians.
    pub rotation_rad: f64,
    /// Of single parameters, in the unit of their dimension.
    pub parameters: BTreeMap<ParameterId, f64>,
}

impl Default for RequiredAccuracy {
    /// 5 mm and 0.1°.
    fn default() -> Self {
        Self { translation_m: 0.005, rotation_rad: 0.1_f64.to_radians(), parameters: BTreeMap::new() }
    }
}

/// Required accuracy of the other parameters, each with about the effect of 0.1° on the rays of a camera: a millisecond at
/// 1.7 rad/s, a pixel at a focal length of 570 px, two thousandths of a rotation of 50°.
const TIME_S: f64 = 1e-3;
const PIXELS: f64 = 1.0;
const RATIO: f64 = 2e-3;

/// Units of a written accuracy with their sizes in metres, radians, seconds, pixels or as a ratio.
const UNITS: [(Dimension, &str, f64); 9] = [
    (Dimension::Length, "mm", 1e-3),
    (Dimension::Length, "cm", 1e-2),
    (Dimension::Length, "m", 1.0),
    (Dimension::Angle, "deg", std::f64::consts::PI / 180.0),
    (Dimension::Angle, "°", std::f64::consts::PI / 180.0),
    (Dimension::Angle, "rad", 1.0),
    (Dimension::Time, "ms", 1e-3),
    (Dimension::Time, "s", 1.0),
    (Dimension::Pixel, "px", 1.0),
];

impl RequiredAccuracy {
    /// Largest standard deviation of a parameter, in the unit of its dimension.
    pub fn of(&self, parameter: ParameterId) -> f64 {
        self.parameters.get(&parameter).copied().unwrap_or_else(|| self.of_dimension(parameter.dimension()))
    }

    fn of_dimension(&self, dimension: Dimension) -> f64 {
        match dimension {
            Dimension::Length => self.translation_m,
            Dimension::Angle => self.rotation_rad,
            Dimension::Time => TIME_S,
            Dimension::Pixel => PIXELS,
            Dimension::Ratio => RATIO,
        }
    }

    /// Accuracy that σ have to reach before they are multiplied by a factor: lengths, angles and single parameters divided
    /// by it.
    #[must_use]
    pub fn divided(mut self, factor: f64) -> Self {
        let own = self.parameters.values_mut().chain([&mut self.translation_m, &mut self.rotation_rad]);
        own.for_each(|sigma| *sigma /= factor);
        self
    }

    /// Dimension that a key sets, `translation`, `rotation` or the name of a parameter of the rig.
    ///
    /// # Errors
    /// For the name of no parameter.
    pub fn dimension_of(key: &str, names: &ParameterNames) -> Result<Dimension, String> {
        match key {
            "translation" => Ok(Dimension::Length),
            "rotation" => Ok(Dimension::Angle),
            _ => parameter(key, names).map(ParameterId::dimension),
        }
    }

    /// Sets the standard deviation of a key, in the unit of its dimension.
    ///
    /// # Errors
    /// For the name of no parameter.
    pub fn set(&mut self, key: &str, sigma: f64, names: &ParameterNames) -> Result<(), String> {
        match key {
            "translation" => self.translation_m = sigma,
            "rotation" => self.rotation_rad = sigma,
            _ => {
                self.parameters.insert(parameter(key, names)?, sigma);
            }
        }
        Ok(())
    }

    /// This accuracy with the values of a text such as `translation=5mm,rotation=0.1deg,pitch.a=2mm`; numbers without a unit
    /// are in metres, radians, seconds, pixels or a ratio.
    ///
    /// # Errors
    /// For an unknown parameter, and for a value that is not a positive number in a unit of its dimension.
    pub fn with(&self, text: &str, names: &ParameterNames) -> Result<Self, String> {
        let mut changed = self.clone();
        for item in items(text) {
            let expected = "translation=5mm, rotation=0.1deg or the name of a parameter, as in pitch.a=2mm";
            let entry = Entry::parse(item).ok_or_else(|| format!("'{item}' has no value, expected {expected}"))?;
            let Entry { key, value } = entry.trimmed();
            let dimension = Self::dimension_of(key, names)?;
            changed.set(key, sigma(value, dimension).map_err(|problem| format!("{key}: {problem}"))?, names)?;
        }
        Ok(changed)
    }

    /// All values as a text for [`Self::with`].
    pub fn to_text(&self, names: &ParameterNames) -> String {
        let own = self.parameters.iter().map(|(parameter, sigma)| format!(",{}={sigma}", names.name(*parameter)));
        format!("translation={},rotation={}{}", self.translation_m, self.rotation_rad, own.collect::<String>())
    }

    /// The accuracy of some parameters in words: `5 mm and 0.1°`.
    pub fn text_for(&self, parameters: impl IntoIterator<Item = ParameterId>) -> String {
        let (mut dimensions, mut own) = (Vec::new(), 0);
        for parameter in parameters {
            if self.parameters.contains_key(&parameter) {
                own += 1;
            } else if !dimensions.contains(&parameter.dimension()) {
                dimensions.push(parameter.dimension());
            }
        }
        dimensions.sort_by_key(|dimension| (*dimension != Dimension::Length, *dimension));
        let texts = dimensions.into_iter().map(|dimension| shown(self.of_dimension(dimension), dimension));
        let own = match own {
            0 => None,
            1 => Some("the own accuracy of 1 parameter".to_owned()),
            _ => Some(format!("the own accuracy of {own} parameters")),
        };
        and(&texts.chain(own).collect::<Vec<_>>())
    }

    /// The accuracy of one parameter in words: `5 mm`.
    pub fn text_of(&self, parameter: ParameterId) -> String {
        shown(self.of(parameter), parameter.dimension())
    }
}

/// Parameter with a name; an error for a joint or camera that the rig does not have.
fn parameter(name: &str, names: &ParameterNames) -> Result<ParameterId, String> {
    let exists = |parameter: &ParameterId| match parameter.part {
        ParameterPart::Link(link) => usize::from(link) < names.joints.len(),
        ParameterPart::Exponential(place) => usize::from(place) <= names.joints.len(),
        ParameterPart::ImuFromCamera(camera) | ParameterPart::Camera(camera) => {
            usize::from(camera) <= names.cameras.len()
        }
        _ => true,
    };
    let expected = "translation, rotation or a parameter of the rig, as in IB.tx or timeshift";
    let unknown = || format!("'{}' is no parameter, expected {expected}", printable(&shortened(name, 60)));
    names.parse(name).filter(exists).ok_or_else(unknown)
}

/// Positive number with a unit of a dimension or without a unit.
fn sigma(text: &str, dimension: Dimension) -> Result<f64, String> {
    let units = || UNITS.into_iter().filter(|(of, ..)| *of == dimension);
    let with_unit = units().find_map(|(_, unit, size)| Some((text.strip_suffix(unit)?, size)));
    let (digits, size) = with_unit.unwrap_or((text, 1.0));
    let value = digits.trim().parse::<f64>().ok().map(|value| value * size);
    value.filter(|value| value.is_finite() && *value > 0.0).ok_or_else(|| {
        let units: Vec<&str> = units().map(|(_, unit, _)| unit).collect();
        let in_units = if units.is_empty() { String::new() } else { format!(" in {}", units.join(", ")) };
        format!("'{text}' is no positive number{in_units}")
    })
}

/// Value with its unit and at most three decimals, without zeros at its end.
fn shown(sigma: f64, dimension: Dimension) -> String {
    let shown = Shown::of(dimension);
    format!("{}{}", (sigma * shown.factor * 1e3).round() / 1e3, shown.unit)
}

/// Words with commas and an `and` before the last.
fn and(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> ParameterNames {
        ParameterNames { joints: ["yaw", "pitch"].map(str::to_owned).to_vec(), cameras: Vec::new() }
    }

    #[test]
    fn values_have_units_of_their_dimension() {
        let text = "translation=2cm, rotation=0.2deg,pitch.a=0.002,timeshift=3ms";
        let required = RequiredAccuracy::default().with(text, &names()).unwrap();
        let of = |name: &str| required.of(names().parse(name).unwrap());
        assert_eq!([of("yaw.d"), of("pitch.a"), of("timeshift")], [0.02, 0.002, 0.003]);
        assert!((of("yaw.alpha") - 0.2_f64.to_radians()).abs() < 1e-15);
        assert_eq!(of("fx"), PIXELS);
        let some = ["yaw.alpha", "yaw.d", "fx"].map(|name| names().parse(name).unwrap());
        assert_eq!(required.text_for(some), "20 mm, 0.2° and 1 px");
        let all = [some.as_slice(), &[names().parse("pitch.a").unwrap()]].concat();
        assert_eq!(required.text_for(all), "20 mm, 0.2°, 1 px and the own accuracy of 1 parameter");
        assert_eq!(RequiredAccuracy::default().with(&required.to_text(&names()), &names()), Ok(required));
        assert_eq!(RequiredAccuracy::default().with("", &names()).unwrap(), RequiredAccuracy::default());
    }

    #[test]
    fn every_other_text_is_an_error() {
        for (text, word) in [
            ("translation", "has no value"),
            ("translation=0", "'0' is no positive number in mm, cm, m"),
            ("translation=-1mm", "no positive number"),
            ("translation=NaN", "no positive number"),
            ("translation=inf", "no positive number"),
            ("translation=1deg", "'1deg' is no positive number in mm"),
            ("roll.a=1mm", "'roll.a' is no parameter"),
            ("L3.a=1mm", "'L3.a' is no parameter"),
            ("X3.wx=1deg", "'X3.wx' is no parameter"),
            ("cam2.tx=1mm", "'cam2.tx' is no parameter"),
        ] {
            let problem = RequiredAccuracy::default().with(text, &names()).unwrap_err();
            assert!(problem.contains(word), "{text}: {problem}");
        }
    }
}
