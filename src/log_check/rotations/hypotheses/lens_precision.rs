//! Values of a lens measured by the rotations of its camera within their noise, with standard deviations: a stabilized
//! camera hardly turns, so that its rotations may agree with a wrong lens.

use super::fit::Fitter;
use crate::faults::{Fault, FaultKind};
use crate::gimbal::ClassicalChain;
use crate::log_check::rotations::data::RotationData;
use crate::log_check::statistics::SIGNIFICANT_SIGMAS;

/// Kinds of wrong lenses with a name, and the unit of a difference.
const LENS: [(FaultKind, &str, &str); 3] = [
    (FaultKind::Focal, "focal length", "of its value"),
    (FaultKind::PrincipalPoint, "principal point", "focal lengths"),
    (FaultKind::Radial, "radial distortion", "of its coefficient"),
];
/// Number of standard deviations from which on the rotations contradict a value: derivatives come from noisy images.
const CONTRADICTED_SIGMAS: f64 = 5.0;
/// Ratio of the difference to the smallest one that makes results useless from which on it is worth a finding.
const SMALLEST_DIFFERENCE: f64 = 0.5;

/// Value of a lens as the rotations of its camera measure it.
#[derive(Clone, Debug)]
pub(in crate::log_check) struct LensValue {
    /// Lens that the rotations measure.
    pub(super) fault: Fault,
    pub(in crate::log_check) name: &'static str,
    unit: &'static str,
    sigma: f64,
    /// Largest difference from the rig.
    difference: f64,
    /// The same in standard deviations.
    pub(super) sigmas: f64,
    /// Smallest difference that makes results useless.
    useless: f64,
}

/// Fault of a kind with the values of the rig's lens.
fn right_lens(kind: FaultKind) -> Fault {
    match kind {
        FaultKind::Focal => Fault::new(kind, &[1.0]),
        FaultKind::PrincipalPoint => Fault::new(kind, &[0.0, 0.0]),
        _ => Fault::new(kind, &[0.0]),
    }
}

impl LensValue {
    /// Values of a camera's lens, each one fitted alone, by at most some hundred of its rotations.
    pub(super) fn measured(data: &RotationData<'_>, chain: &ClassicalChain) -> Vec<Self> {
        let few = data.thinned();
        let fitter = Fitter::new(&few, chain, f64::INFINITY);
        // Information grows with the number of rotations.
        let share = (few.measured.len() as f64 / data.measured.len() as f64).sqrt();
        let of_value = |(kind, name, unit): (FaultKind, &'static str, &'static str)| {
            let mut fault = right_lens(kind);
            let values = fitter.linear_values(&fault)?;
            for (number, (change, _)) in values.iter().enumerate() {
                fault.change(number, *change);
            }
            let largest = |of: &dyn Fn(&(f64, f64)) -> f64| values.iter().map(of).fold(0.0, f64::max);
            Some(Self {
                fault,
                name,
                unit,
                sigma: share * largest(&|(_, sigma)| *sigma),
                difference: largest(&|(change, _)| change.abs()),
                sigmas: largest(&|(change, sigma)| change.abs() / sigma),
                useless: kind.row().useless?,
            })
        };
        LENS.into_iter().filter_map(of_value).collect()
    }

    /// True if rotations exclude the value of the rig.
    pub(super) fn is_contradicted(&self) -> bool {
        self.sigmas > CONTRADICTED_SIGMAS && self.difference > SMALLEST_DIFFERENCE * self.useless
    }

    /// True if rotations do not exclude an error that makes results useless.
    pub(super) fn is_unverified(&self) -> bool {
        self.difference + SIGNIFICANT_SIGMAS * self.sigma > self.useless
    }

    /// Name, standard deviation and unit.
    pub(in crate::log_check) fn precision(&self) -> String {
        format!("{} to ±{:.2} {}", self.name, self.sigma, self.unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn focal_length(difference: f64, sigma: f64) -> LensValue {
        let fault = Fault::new(FaultKind::Focal, &[1.0 + difference]);
        let (name, unit) = ("focal length", "of its value");
        LensValue { fault, name, unit, sigma, difference, sigmas: difference / sigma, useless: 0.05 }
    }

    #[test]
    fn a_value_is_contradicted_verified_or_neither() {
        let state = |value: &LensValue| (value.is_contradicted(), value.is_unverified());
        assert_eq!(state(&focal_length(0.003, 0.001)), (false, false));
        assert_eq!(state(&focal_length(0.12, 0.013)), (true, true));
        // A stabilized camera hides an error of a twentieth; a known small one is no fault.
        assert_eq!(state(&focal_length(0.01, 0.03)), (false, true));
        assert_eq!(state(&focal_length(0.01, 0.001)), (false, false));
        assert_eq!(focal_length(0.01, 0.03).precision(), "focal length to ±0.03 of its value");
    }
}
