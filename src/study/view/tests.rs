//! Tests on a synthetic study.

use std::collections::BTreeSet;

use super::*;
pub(crate) mod synthetic_study;

use self::synthetic_study::*;

fn count(study: &Study, text: &str) -> usize {
    let filter = RowFilter::parse(text, &study.runs).unwrap_or_else(|problem| panic!("{problem}"));
    (0..study.runs.rows()).filter(|row| filter.passes(&study.runs, *row)).count()
}

#[test]
fn conditions_choose_rows() {
    let study = synthetic_study(2);
    let rows = study.runs.rows();
    assert_eq!(rows, 400);
    for (text, expected) in [
        ("", rows),
        ("run = auto", 80),
        ("run == 'auto'", 80),
        ("run = \"auto:encoder=off\"", 80),
        ("run = minimal-swapped", 80),
        ("run != auto", 320),
        ("run contains AUTO", 160),
        ("not encoder", 80),
        ("encoder = off", 80),
        ("encoder = on and log = house", 40),
        ("(log = house or log = city) and seed = 0", 50),
        ("seed >= 1", 200),
        ("not (seed >= 1)", 200),
        ("2 * seed + 1 > 2", 200),
        ("-(seed) < 0", 200),
        ("(seed + 1) * 2 = 4", 200),
        ("(encoder)", 320),
        ("log = run", 0),
        ("log > house", 5 * 5 * 2 * 2),
    ] {
        assert_eq!(count(&study, text), expected, "{text}");
    }
    let with_value = count(&study, "has(ate_rmse_m)");
    assert_eq!(with_value, count(&study, "status = ok"));
    // An empty cell is neither below nor above.
    assert_eq!(count(&study, "ate_rmse_m < 0.1") + count(&study, "ate_rmse_m >= 0.1"), with_value);
    assert_eq!(count(&study, "chain_error_m < 2 mm"), count(&study, "chain_error_m < 0.002"));
    assert_eq!(count(&study, "chain_error_rad < 0.2deg"), count(&study, "chain_error_rad < 0.003490658503988659"));
    assert!(count(&study, "ate_rmse_m < 0.1 and run = auto") > 0);
}

#[test]
fn wrong_conditions_say_what_and_where() {
    let study = synthetic_study(1);
    for (text, column, part) in [
        ("ate < 0.1", 1, "there is no column 'ate'"),
        ("ate_rms_m < 0.1", 1, "did you mean 'ate_rmse_m'?"),
        ("ate_rmse_m", 1, "this is a number; compare it, as in 'ate_rmse_m < 0.1'"),
        ("ate_rmse_m < run", 14, "'run' holds text"),
        ("run", 4, "this is a text"),
        ("run =", 6, "expected a text"),
        ("encoder = maybe", 11, "on or off"),
        ("seed = 1)", 9, "unmatched closing bracket"),
        ("(seed = 1", 10, "expected ')'"),
        ("seed = 1 run = auto", 10, "expected 'and', 'or'"),
        ("seed < 1 ; seed", 10, "has no meaning"),
        ("has(nothing)", 5, "there is no column 'nothing'"),
        ("seed <", 7, "expected the name of a column or a number"),
    ] {
        let problem = RowFilter::parse(text, &study.runs).unwrap_err();
        assert!(problem.message.contains(part) && problem.column == column, "{text}: {problem:?}");
    }
    let deep = format!("{}seed = 1", "not ".repeat(100));
    assert!(RowFilter::parse(&deep, &study.runs).unwrap_err().message.contains("nested"));
    let long = vec!["seed = 1"; 500].join(" and ");
    assert!(RowFilter::parse(&long, &study.runs).unwrap_err().message.contains("operators"));
    assert!(RowFilter::parse(&"(".repeat(20_000), &study.runs).unwrap_err().message.contains("too long"));
}

#[test]
fn rows_are_sorted_and_grouped_by_values() {
    let study = synthetic_study(12);
    let key = |column: &str, descending| SortKey { column: column.to_owned(), descending };
    let all = RowFilter::default();
    for descending in [false, true] {
        let rows = arrange(&study.runs, &all, &[key("ate_rmse_m", descending)], None).rows;
        let values: Vec<Option<f64>> = rows.iter().map(|row| study.runs.number(*row, "ate_rmse_m")).collect();
        let known: Vec<f64> = values.iter().flatten().copied().collect();
        assert!(known.is_sorted_by(|a, b| if descending { a >= b } else { a <= b }));
        let first_empty = values.iter().position(Option::is_none).unwrap();
        assert!(values[first_empty..].iter().all(Option::is_none), "empty cells come last");
    }
    let arranged = arrange(&study.runs, &all, &[key("run", false), key("seed", true)], Some("seed"));
    let names: Vec<&str> = arranged.groups.iter().map(|group| group.name.as_str()).collect();
    assert_eq!(names, ["0", "1", "2", "3", "4", "5", "6", "7", "8", "9", "10", "11"], "numbers by value");
    assert_eq!(arranged.groups.iter().map(|group| group.rows.len()).sum::<usize>(), study.runs.rows());
    let seeds: Vec<i64> = arranged.rows[..480].iter().map(|row| study.runs.integer(*row, "seed").unwrap()).collect();
    assert!(seeds.is_sorted_by(|a, b| a >= b), "the second key orders equal rows");
    let filter = RowFilter::parse("seed < 0", &study.runs).unwrap();
    assert!(arrange(&study.runs, &filter, &[], None).groups.is_empty());
    let offered = group_columns(&study.runs);
    assert_eq!(offered[..2], ["run", "log"]);
    for name in ["key", "message", "ate_rmse_m", "disturbance", "peak_memory_bytes"] {
        assert!(!offered.contains(&name.to_owned()), "{name}");
    }
}

#[test]
fn paired_differences_find_what_the_noise_of_flights_hides() {
    let study = synthetic_study(4);
    let metric = metrics(&study.runs).into_iter().find(|metric| metric.column == "ate_rmse_m").unwrap();
    let arranged = arrange(&study.runs, &RowFilter::default(), &[], Some("run"));
    let found = paired_differences(&study.runs, &arranged.groups, "run", "auto", &metric);
    assert_eq!(found.len(), 4);
    for of in &found {
        let mean = of.mean.unwrap();
        assert!(mean.low > 0.0 || of.name == "minimal-swapped", "{}: {mean:?}", of.name);
        assert_eq!(of.pairs.len() + of.unpaired, 160);
        for pair in &of.pairs {
            let partner = (0..study.runs.rows()).find(|row| {
                study.runs.text(*row, "run") == Some("auto")
                    && ["log", "perturbation", "seed"]
                        .iter()
                        .all(|name| study.runs.cell(*row, name) == study.runs.cell(pair.row, name))
            });
            assert_eq!(study.runs.number(partner.unwrap(), "ate_rmse_m"), Some(pair.reference));
        }
    }
    // By a key of the specification, runs of both values are averaged.
    let arranged = arrange(&study.runs, &RowFilter::default(), &[], Some("encoder"));
    let found = paired_differences(&study.runs, &arranged.groups, "encoder", "true", &metric);
    assert!(found.len() == 1 && found[0].name == "false" && !found[0].pairs.is_empty());
    assert!(paired_differences(&study.runs, &arranged.groups, "encoder", "nothing", &metric).is_empty());
}

#[test]
fn wilson_intervals_are_those_of_the_literature() {
    // Newcombe 1998, table I: 81/263, 15/148, 0/20, 1/29, without continuity correction.
    for ((successes, runs), [low, high]) in [
        ((81, 263), [0.2553, 0.3662]),
        ((15, 148), [0.0624, 0.1605]),
        ((0, 20), [0.0, 0.1611]),
        ((1, 29), [0.0061, 0.1718]),
    ] {
        let rate = success_rate(successes, runs);
        assert!((rate.low - low).abs() < 5e-5 && (rate.high - high).abs() < 5e-5, "{rate:?}");
    }
    assert_eq!((success_rate(0, 0).low, success_rate(0, 0).high), (0.0, 1.0));
    assert_eq!(success_rate(7, 7).high, 1.0);
}

#[test]
fn quantiles_are_those_of_numpy() {
    // numpy.quantile([1, 2, 4, 8, 16, 32], [0.25, 0.5, 0.75])
    let spread = Spread::of([8.0, 1.0, 32.0, 4.0, f64::NAN, 2.0, 16.0]).unwrap();
    assert_eq!((spread.count, spread.min, spread.max), (6, 1.0, 32.0));
    assert_eq!((spread.q1, spread.median, spread.q3), (2.5, 6.0, 14.0));
    assert_eq!(Spread::of([3.0]).unwrap().q1, 3.0);
    assert_eq!(Spread::of([]), None);
}

#[test]
fn parameter_errors_show_a_sigma_that_is_too_small() {
    let study = synthetic_study(4);
    let rows: Vec<usize> = (0..study.runs.rows()).collect();
    let found = parameter_errors(&study, &study.run_of_parameter_rows(), &rows);
    assert_eq!(found.len(), PARAMETERS.len());
    for of in &found {
        let expected = if of.name == "pitch.alpha" { 2.0 } else { 1.0 };
        assert!((of.ratio_rms - expected).abs() < 0.12 * expected, "{}: {}", of.name, of.ratio_rms);
        assert!(of.ratio_mean.abs() < 0.2 && of.within_1 <= of.within_3);
        let verdict = if expected > 1.0 { SigmaVerdict::TooSmall } else { SigmaVerdict::Consistent };
        assert_eq!(of.verdict(), verdict, "{}", of.name);
        // One run alone is no evidence about σ unless its error is very large.
        let of_one =
            |ratio_rms: f64| ParameterErrors { points: of.points[..1].to_vec(), ratio_rms, ..of.clone() }.verdict();
        let verdicts = [0.1, 2.4, 3.5].map(of_one);
        assert_eq!(verdicts, [SigmaVerdict::Consistent, SigmaVerdict::Consistent, SigmaVerdict::TooSmall]);
    }
    assert_eq!((found[0].unit, found[1].unit, found[5].unit), ("°", "mm", "ms"));
    assert!((found[1].sigma_median - 1.0).abs() < 0.1, "millimetres: {}", found[1].sigma_median);
    assert!(parameter_errors(&study, &study.run_of_parameter_rows(), &[]).is_empty());
}

#[test]
fn comparable_runs_have_equal_log_rig_errors_and_seed() {
    let study = synthetic_study(3);
    let rows = comparable_rows(&study.runs, 7, 4);
    assert_eq!((rows.len(), rows[0]), (4, 7));
    let specs: BTreeSet<&str> = rows.iter().map(|row| study.runs.text(*row, "run").unwrap()).collect();
    assert_eq!(specs.len(), 4, "each specification once");
    for column in ["log", "perturbation", "seed"] {
        assert!(rows.iter().all(|row| study.runs.cell(*row, column) == study.runs.cell(7, column)), "{column}");
    }
    assert_eq!(study.title_of(7), "classical on house, seed 1");
}

#[test]
fn the_columns_of_the_view_are_columns_of_the_tables() {
    let (runs, parameters) = (crate::study::runs_table(), crate::study::parameters_table());
    let run_columns = [
        columns::KEY,
        columns::LOG,
        columns::DISTURBANCE,
        columns::PERTURBATION,
        columns::SEED,
        columns::RUN,
        columns::STATUS,
        columns::MESSAGE,
        columns::WORST_FRAME_S,
        columns::ATE,
    ];
    assert!(run_columns.iter().all(|name| runs.place(name).is_some()));
    let parameter_columns = [columns::KEY, columns::PARAMETER, columns::UNIT, columns::SIGMA, columns::ERROR];
    assert!(parameter_columns.iter().all(|name| parameters.place(name).is_some()));
}
