//! Parser of `--tolerance KEY=RATIO`.

use std::collections::BTreeMap;
use std::str::FromStr;

use dcvins::study::StudyPlan;
use dcvins::text::Entry;

/// Metrics that are compared if neither the plan nor the command line names one.
const STANDARD: [(&str, f64); 1] = [("ate_rmse_m", 0.1)];

/// Allowed relative change of a metric.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tolerance {
    metric: String,
    ratio: f64,
}

impl FromStr for Tolerance {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let entry = Entry::parse(text).filter(|entry| !entry.key.is_empty());
        entry
            .and_then(|entry| Some(Self { metric: entry.key.to_owned(), ratio: entry.number(&(0.0..=f64::MAX))? }))
            .ok_or_else(|| "expected COLUMN=RATIO with a ratio from 0 up, as in ate_rmse_m=0.1".to_owned())
    }
}

/// Tolerances of the command line, else of the plan, else the defaults.
pub(super) fn tolerances(plan: &StudyPlan, given: &[Tolerance]) -> BTreeMap<String, f64> {
    let standard = || STANDARD.map(|(metric, ratio)| (metric.to_owned(), ratio)).into();
    match (given, plan.tolerances.is_empty()) {
        ([], true) => standard(),
        ([], false) => plan.tolerances.clone(),
        _ => given.iter().map(|tolerance| (tolerance.metric.clone(), tolerance.ratio)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_is_a_column_and_a_ratio() {
        let tolerance: Tolerance = "ate_rmse_m=0.1".parse().unwrap();
        assert_eq!((tolerance.metric.as_str(), tolerance.ratio), ("ate_rmse_m", 0.1));
        for wrong in ["ate_rmse_m", "=0.1", "ate_rmse_m=-0.1", "ate_rmse_m=a", "ate_rmse_m=inf"] {
            assert!(wrong.parse::<Tolerance>().is_err(), "{wrong}");
        }
    }
}
