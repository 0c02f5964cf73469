//! Calibration values of a chain by parameter: ground truth and other runs in the parameterization of the shown run.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{PI, TAU};

use crate::geometry::Dimension;
use crate::gimbal::{Chain, ClassicalChain, NearestForm, ParameterId, ParameterPart, Parameterization, Quantity};
use crate::session::{Recording, RunRecord};

pub(crate) type ParameterValues = BTreeMap<ParameterId, f64>;

/// The values of a chain in a parameterization.
pub(crate) fn parameter_values(classical: &ClassicalChain, conversion: &NearestForm) -> ParameterValues {
    let values = conversion.values_of(&Chain::from_classical(classical, Parameterization::Classical));
    values.into_iter().map(|(parameter, value)| (parameter, parameter.principal_value(value))).collect()
}

/// Values by parameter, angles in (−π, π].
pub(crate) fn principal_values(parameters: &[ParameterId], values: &[f64]) -> ParameterValues {
    let entries = parameters.iter().zip(values);
    entries.map(|(parameter, value)| (*parameter, parameter.principal_value(*value))).collect()
}

/// The ground-truth values in the parameterization of a run at a step; angles differ from the estimate by less than
/// π.
///
/// Returns `None` when the ground truth is not known.
pub(crate) fn true_values(recording: &Recording, run: &RunRecord, stamp_ns: i64) -> Option<ParameterValues> {
    let calibration = &run.step_at(stamp_ns).or_else(|| run.steps.first())?.report.calibration;
    let ground_truth = recording.ground_truth_rig.as_ref()?;
    let mut values: ParameterValues = run.values_in(ground_truth, &recording.rig, calibration)?.into_iter().collect();
    let estimate = principal_values(&calibration.parameters, &calibration.values);
    unwrap_towards(&mut values, &estimate);
    Some(values)
}

/// Replaces angles by equivalent ones nearest to a reference: multiples of 2π are added, and rotation vectors may be
/// replaced by the complementary rotation about the opposite axis.
pub(crate) fn unwrap_towards(values: &mut ParameterValues, reference: &ParameterValues) {
    let parts: BTreeSet<ParameterPart> = values.keys().map(|parameter| parameter.part).collect();
    let rotation_vector = |part: ParameterPart| Quantity::ROTATION.map(|quantity| ParameterId { part, quantity });
    let blocks: Vec<ParameterPart> =
        parts.into_iter().filter(|part| rotation_vector(*part).iter().all(|axis| values.contains_key(axis))).collect();
    for block in &blocks {
        let axes = rotation_vector(*block);
        let of = |from: &ParameterValues| axes.map(|axis| from.get(&axis).copied().unwrap_or(f64::NAN));
        let (vector, wanted) = (of(values), of(reference));
        let angle = vector.iter().map(|entry| entry * entry).sum::<f64>().sqrt();
        if angle.is_nan() || angle <= 0.5 * PI || wanted.iter().any(|entry| !entry.is_finite()) {
            continue;
        }
        let other = vector.map(|entry| entry * (1.0 - TAU / angle));
        let distance = |vector: &[f64; 3]| vector.iter().zip(&wanted).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        if distance(&other) < distance(&vector) {
            values.extend(axes.into_iter().zip(other));
        }
    }
    for (parameter, value) in values.iter_mut() {
        // The local rotations of `poe` are components of a rotation vector as well.
        let is_local = matches!(parameter.quantity, Quantity::Wx | Quantity::Wy);
        let angle = parameter.dimension() == Dimension::Angle && !is_local && !blocks.contains(&parameter.part);
        if let (true, Some(reference)) = (angle, reference.get(parameter).filter(|reference| reference.is_finite())) {
            *value += TAU * ((reference - *value) / TAU).round();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::ParameterNames;
    use crate::gui::samples::sample_recording;

    #[test]
    fn ground_truth_has_the_names_of_the_run_and_is_near_its_end() {
        let recording = sample_recording();
        let raw = |rig: &crate::sensors::Rig, parameter: ParameterId| {
            let chain = Chain::from_classical(&rig.chain_of_camera("cam0").unwrap(), Parameterization::Classical);
            let place = chain.parameters().iter().position(|known| *known == parameter).unwrap();
            (chain.values()[place], parameter.scale())
        };
        for run in &recording.runs {
            let end = &run.steps.last().unwrap().report;
            let ground_truth = true_values(&recording, run, end.stamp_ns).unwrap();
            assert_eq!(ground_truth.len(), end.calibration.parameters.len());
            if end.calibration.parameterization == Parameterization::Classical {
                // The test compares with the equivalent values nearest to the rig's; the drawn run has no real
                // estimator.
                let true_rig = recording.ground_truth_rig.as_ref().unwrap();
                let squared = |value: &dyn Fn(ParameterId) -> f64| -> f64 {
                    let gap = |parameter: ParameterId| {
                        let (given, scale) = raw(&recording.rig, parameter);
                        (value(parameter) - given) / scale
                    };
                    ground_truth.keys().map(|parameter| gap(*parameter).powi(2)).sum()
                };
                let (converted, written) =
                    (squared(&|parameter| ground_truth[&parameter]), squared(&|parameter| raw(true_rig, parameter).0));
                assert!(converted < written, "{converted} is farther from the rig than {written}");
                continue;
            }
            for (parameter, value) in end.calibration.parameters.iter().zip(&end.calibration.values) {
                let ground_truth = ground_truth[parameter];
                assert!((ground_truth - value).abs() < 0.01, "{parameter:?}: {ground_truth} and {value}");
            }
        }
    }

    #[test]
    fn angles_are_unwrapped_towards_the_reference() {
        let id = |name: &str| ParameterNames::default().parse(name).unwrap();
        let named = |entries: &[(&str, f64)]| -> ParameterValues {
            entries.iter().map(|(name, value)| (id(name), *value)).collect()
        };
        let mut values = named(&[("L1.theta", 3.1), ("L1.d", 9.0), ("I.rx", -3.1)]);
        unwrap_towards(&mut values, &named(&[("L1.theta", -3.15), ("L1.d", 0.0), ("I.rx", 3.0)]));
        assert!((values[&id("L1.theta")] - (3.1 - TAU)).abs() < 1e-12);
        assert_eq!(values[&id("L1.d")], 9.0);
        assert!((values[&id("I.rx")] - (TAU - 3.1)).abs() < 1e-12);

        let mut block = named(&[("IB.rx", 3.12), ("IB.ry", 0.0), ("IB.rz", 0.0)]);
        unwrap_towards(&mut block, &named(&[("IB.rx", -3.13), ("IB.ry", 0.01), ("IB.rz", 0.0)]));
        assert!((block[&id("IB.rx")] - (3.12 - TAU)).abs() < 1e-12);
        let before = block.clone();
        unwrap_towards(&mut block, &ParameterValues::new());
        assert_eq!(block, before);
    }
}
