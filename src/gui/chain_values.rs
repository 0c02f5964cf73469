//! Calibration values of a chain by parameter name: the truth and other runs, told in the columns of the run on screen.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use crate::gimbal::{Chain, ClassicalChain, NearestForm, Parameterization};
use crate::session::{Recording, RunRecord};

/// Values by parameter name.
pub(crate) type NamedValues = BTreeMap<String, f64>;

/// The values of a chain in a form.
pub(crate) fn named_values(classical: &ClassicalChain, form: &NearestForm) -> NamedValues {
    let chain = form.of(&Chain::from_classical(classical, Parameterization::Classical));
    chain.parameter_names().into_iter().zip(chain.values().iter().copied()).collect()
}

/// The true values in the columns of a run, as they were named at a step, turned to lie nearest to the estimate.
///
/// `None` when the truth is not known.
pub(crate) fn true_values(recording: &Recording, run: &RunRecord, stamp_ns: i64) -> Option<NamedValues> {
    let calibration = &run.step_at(stamp_ns).or_else(|| run.steps.first())?.report.calibration;
    let truth = recording.truth_rig.as_ref()?;
    let mut values: NamedValues = run.values_in(truth, &recording.rig, calibration)?.into_iter().collect();
    let estimate: NamedValues = calibration.names.iter().cloned().zip(calibration.values.iter().copied()).collect();
    turn_towards(&mut values, &estimate);
    Some(values)
}

/// Replaces angles by equal ones that lie nearest to a reference: whole turns are added, and rotation vectors may go the
/// other way round.
pub(crate) fn turn_towards(values: &mut NamedValues, reference: &NamedValues) {
    let blocks: Vec<String> = values
        .keys()
        .filter_map(|name| name.strip_suffix(".rz"))
        .map(str::to_owned)
        .filter(|b| is_block(values, b))
        .collect();
    for block in &blocks {
        let names = ["rx", "ry", "rz"].map(|axis| format!("{block}.{axis}"));
        let at = |from: &NamedValues, axis: usize| from.get(&names[axis]).copied().unwrap_or(f64::NAN);
        let vector = [0, 1, 2].map(|axis| at(values, axis));
        let wanted = [0, 1, 2].map(|axis| at(reference, axis));
        let angle = vector.iter().map(|entry| entry * entry).sum::<f64>().sqrt();
        if angle.is_nan() || angle <= 0.5 * PI || wanted.iter().any(|entry| !entry.is_finite()) {
            continue;
        }
        let other = vector.map(|entry| entry * (1.0 - TAU / angle));
        let distance = |vector: &[f64; 3]| vector.iter().zip(&wanted).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        if distance(&other) < distance(&vector) {
            for (name, entry) in names.iter().zip(other) {
                values.insert(name.clone(), entry);
            }
        }
    }
    for (name, value) in values.iter_mut() {
        let tail = name.rsplit('.').next().unwrap_or(name);
        let in_block = name.split('.').next().is_some_and(|head| blocks.iter().any(|block| block == head));
        let angle = matches!(tail, "theta" | "alpha" | "beta" | "rx" | "ry") && !in_block;
        if let (true, Some(reference)) = (angle, reference.get(name).filter(|reference| reference.is_finite())) {
            *value += TAU * ((reference - *value) / TAU).round();
        }
    }
}

/// Whether a name's head has a whole rotation vector.
fn is_block(values: &NamedValues, head: &str) -> bool {
    ["rx", "ry", "rz"].iter().all(|axis| values.contains_key(&format!("{head}.{axis}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::sample_recording::sample_recording_of;

    #[test]
    fn the_truth_has_the_names_of_the_run_and_lies_near_its_end() {
        let recording = sample_recording_of(240, &["auto", "classical"]);
        let raw = |rig: &crate::sensors::Rig, name: &str| {
            let chain = Chain::from_classical(&rig.chain_of_camera("cam0").unwrap(), Parameterization::Classical);
            let place = chain.parameter_names().iter().position(|known| known == name).unwrap();
            (chain.values()[place], if chain.parameter_units()[place] == "rad" { 0.17 } else { 0.03 })
        };
        for run in &recording.runs {
            let end = &run.steps.last().unwrap().report;
            let truth = true_values(&recording, run, end.stamp_ns).unwrap();
            assert_eq!(truth.len(), end.calibration.names.len());
            if end.calibration.parameterization == "classical" {
                // Of the equivalent numbers those nearest to the rig's are told, and the drawn run is none of an estimator.
                let true_rig = recording.truth_rig.as_ref().unwrap();
                let squared = |value: &dyn Fn(&str) -> f64| -> f64 {
                    let gap = |name: &String| {
                        let (given, scale) = raw(&recording.rig, name);
                        (value(name) - given) / scale
                    };
                    truth.keys().map(|name| gap(name).powi(2)).sum()
                };
                let (told, written) = (squared(&|name| truth[name]), squared(&|name| raw(true_rig, name).0));
                assert!(told < written, "{told} is farther from the rig than {written}");
                continue;
            }
            for (name, value) in end.calibration.names.iter().zip(&end.calibration.values) {
                assert!((truth[name] - value).abs() < 0.01, "{name}: {} and {value}", truth[name]);
            }
        }
    }

    #[test]
    fn angles_are_turned_towards_the_reference() {
        let named = |entries: &[(&str, f64)]| -> NamedValues {
            entries.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
        };
        let mut values = named(&[("L1.theta", 3.1), ("L1.d", 9.0), ("I.rx", -3.1)]);
        turn_towards(&mut values, &named(&[("L1.theta", -3.15), ("L1.d", 0.0), ("I.rx", 3.0)]));
        assert!((values["L1.theta"] - (3.1 - TAU)).abs() < 1e-12);
        assert_eq!(values["L1.d"], 9.0);
        assert!((values["I.rx"] - (TAU - 3.1)).abs() < 1e-12);

        let mut block = named(&[("IB.rx", 3.12), ("IB.ry", 0.0), ("IB.rz", 0.0)]);
        turn_towards(&mut block, &named(&[("IB.rx", -3.13), ("IB.ry", 0.01), ("IB.rz", 0.0)]));
        assert!((block["IB.rx"] - (3.12 - TAU)).abs() < 1e-12);
        let before = block.clone();
        turn_towards(&mut block, &NamedValues::new());
        assert_eq!(block, before);
    }
}
