use std::collections::BTreeMap;

use crate::geometry::SplitMix64;
use crate::study::{Cell, PairedVerdict, SUCCESS, StudyTable, baseline_table, compare, runs_table};

/// A study of 4 logs × 5 seeds: errors differ between logs by a factor of ten, and between two studies by noise of this
/// relative size. ATE is multiplied by `factor`, NEES divided by its square.
fn study(noise: f64, factor: f64, random: &mut SplitMix64) -> StudyTable {
    let mut normal = || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
    let mut table = runs_table();
    for log in 0..4 {
        for seed in 0..5 {
            let hard = 0.05 * 10_f64.powf(f64::from(log) / 3.0) * (1.0 + 0.3 * f64::from(seed));
            let ate_m = hard * factor * (noise * normal()).exp();
            let nees = 6.0 * factor.powi(-2) * (noise * normal()).exp();
            table
                .push([
                    ("log", format!("flight {log}").into()),
                    ("seed", Cell::Integer(seed.into())),
                    ("run", "auto".into()),
                    ("status", "ok".into()),
                    ("ate_rmse_m", ate_m.into()),
                    ("pose_nees", nees.into()),
                ])
                .unwrap();
        }
    }
    table
}

fn tolerances(metrics: &[&str]) -> BTreeMap<String, f64> {
    metrics.iter().map(|metric| ((*metric).to_owned(), 0.1)).collect()
}

/// Number of `count` repetitions in which the verdict on a metric is worse.
fn times_worse(metric: &str, noise: f64, factor: f64, count: u64) -> u64 {
    let worse = |seed: &u64| {
        let mut random = SplitMix64::new(*seed);
        let old = study(noise, 1.0, &mut random);
        let new = study(noise, factor, &mut random);
        let comparison = compare(&old, &new, &tolerances(&[metric])).unwrap();
        comparison.fails()
    };
    (0..count).filter(worse).count() as u64
}

#[test]
fn a_planted_regression_is_found_and_a_harmless_change_is_not() {
    // A harmless change: results differ by 10 % from run to run, in both directions.
    assert_eq!(times_worse("ate_rmse_m", 0.10, 1.0, 200), 0);
    // 30 % worse on average under the same noise.
    assert_eq!(times_worse("ate_rmse_m", 0.10, 1.3, 200), 200);
    // 5 % worse is within the tolerance of 10 %.
    assert!(times_worse("ate_rmse_m", 0.05, 1.05, 200) <= 1);
    // With noise of a factor of two, 20 pairs cannot resolve 10 %; few false alarms remain.
    assert!(times_worse("ate_rmse_m", 0.5, 1.0, 200) <= 10);
    // An estimator that doubles its σ is too conservative by a factor of four in NEES.
    assert_eq!(times_worse("pose_nees", 0.2, 2.0, 200), 200);
    assert_eq!(times_worse("pose_nees", 0.1, 1.0, 200), 0);
}

#[test]
fn equal_studies_are_unchanged_and_an_exact_change_has_no_interval() {
    let mut random = SplitMix64::new(1);
    let old = study(0.1, 1.0, &mut random);
    let same = compare(&old, &old, &tolerances(&["ate_rmse_m"])).unwrap();
    assert!(!same.fails());
    assert_eq!((same.metrics[0].interval, same.metrics[0].pairs), (Some([1.0, 1.0]), 20));
    let text = same.to_string();
    assert!(
        text.contains("Study: not worse than the baseline") && text.contains("| `ate_rmse_m` | larger | 10 % | 20 |"),
        "{text}"
    );
    let better =
        compare(&study(0.0, 1.0, &mut random), &study(0.0, 0.5, &mut random), &tolerances(&["ate_rmse_m"])).unwrap();
    assert_eq!((better.metrics[0].verdict, better.fails()), (PairedVerdict::Better, false));
}

#[test]
fn a_run_that_fails_now_is_a_regression() {
    let mut random = SplitMix64::new(1);
    let old = study(0.0, 1.0, &mut random);
    let mut new = old.select(&(1..20).collect::<Vec<_>>());
    let failed =
        [("log", "flight 0".into()), ("seed", Cell::Integer(0)), ("run", "auto".into()), ("status", "crashed".into())];
    new.push(failed).unwrap();
    let comparison = compare(&old, &new, &tolerances(&["ate_rmse_m"])).unwrap();
    assert!(comparison.fails());
    assert_eq!(comparison.newly_failed, ["flight 0, seed 0, auto"]);
    assert_eq!(comparison.metrics.last().unwrap().metric, SUCCESS);
    assert_eq!((comparison.pairs, comparison.metrics[0].pairs), (20, 19));
    let mut tolerant = tolerances(&["ate_rmse_m"]);
    tolerant.insert(SUCCESS.to_owned(), 0.1);
    assert!(!compare(&old, &new, &tolerant).unwrap().fails());
    assert!(!compare(&new, &old, &tolerances(&[])).unwrap().fails());
}

#[test]
fn what_cannot_be_compared_is_said() {
    let mut random = SplitMix64::new(1);
    let old = study(0.1, 1.0, &mut random);
    let problem = |old: &StudyTable, new: &StudyTable, metric: &str| {
        compare(old, new, &tolerances(&[metric])).unwrap_err().to_string()
    };
    assert!(problem(&old, &old, "ate").starts_with("tolerance 'ate': the table of runs has no column of numbers"));
    assert!(problem(&old, &old, "status").contains("ate_rmse_m"));
    assert!(problem(&runs_table(), &old, "ate_rmse_m").starts_with("no run of the study is in the baseline"));
    assert!(problem(&StudyTable::default(), &old, "ate_rmse_m").starts_with("the baseline has no column 'log'"));
    let two = old.select(&[0, 1]);
    let few = compare(&two, &two, &tolerances(&["ate_rmse_m"])).unwrap();
    assert_eq!((few.metrics[0].verdict, few.fails()), (PairedVerdict::TooFewPairs, true));
}

/// A table with one run of each specification; its ATE is 1 m times its number.
fn runs(specs: &[&str]) -> StudyTable {
    let mut table = runs_table();
    for (place, spec) in specs.iter().enumerate() {
        let ate_m = Cell::Number(1.0 + place as f64);
        let cells = [("log", "a".into()), ("run", (*spec).into()), ("status", "ok".into()), ("ate_rmse_m", ate_m)];
        table.push(cells).unwrap();
    }
    table
}

#[test]
fn runs_are_paired_by_the_meaning_of_their_settings_and_then_by_name() {
    let check = |old: &[&str], new: &[&str], pairs: usize, other_settings: usize| {
        let found = compare(&runs(old), &runs(new), &tolerances(&[])).unwrap();
        assert_eq!((found.pairs, found.other_settings), (pairs, other_settings), "{old:?} {new:?}");
    };
    let normalized = |text: &str| text.parse::<crate::session::RunSpec>().unwrap().to_string();
    check(&["auto"], &[&normalized("auto:window=10")], 1, 0);
    check(&["auto:name=before"], &["auto:name=after"], 1, 0);
    check(&["auto:encoder=off,window=8"], &["auto:window=8,encoder=off"], 1, 0);
    check(&["auto"], &["auto:pixel-noise=2,name=auto"], 1, 1);
    // A run is in one pair; equal settings come before equal names.
    check(&["auto", "auto:window=8"], &["auto:window=8,name=auto", "auto:name=a"], 2, 0);
    check(&["auto"], &["auto", "auto:name=a"], 1, 0);
    // A specification that this version cannot parse is paired literally.
    check(&["neural:depth=3"], &["neural:depth=3"], 1, 0);
    let unpaired = compare(&runs(&["auto"]), &runs(&["auto:window=8"]), &tolerances(&[])).unwrap_err();
    assert!(unpaired.to_string().contains("the settings or the name of the run"), "{unpaired}");
    let other = compare(&runs(&["auto"]), &runs(&["auto:pixel-noise=2,name=auto"]), &tolerances(&[])).unwrap();
    assert!(other.to_string().contains("1 pairs are of runs with one name and different settings"), "{other}");
}

#[test]
fn a_baseline_is_compared_and_names_no_machine() {
    let mut random = SplitMix64::new(1);
    let runs = study(0.1, 1.0, &mut random);
    let baseline = baseline_table(&runs).unwrap();
    for column in ["key", "log_path", "program", "wall_s", "step_ms", "step_p95_ms", "real_time_factor", "message"] {
        assert!(runs.column(column).is_some() && baseline.column(column).is_none(), "{column}");
    }
    assert_eq!((baseline.rows(), baseline.number(3, "pose_nees")), (runs.rows(), runs.number(3, "pose_nees")));
    let same = compare(&baseline, &runs, &tolerances(&["ate_rmse_m", "pose_nees"])).unwrap();
    assert_eq!((same.pairs, same.fails(), same.other_logs), (20, false, 0));
}
