use crate::study::{Cell, StudyPlan, StudyTable, runs_table};

/// A plan whose tables have these keys.
fn plan(keys: &str) -> StudyPlan {
    StudyPlan::from_toml(&format!("[[flights]]\nexperiment = \"T3\"\n[[tables]]\ntitle = \"Errors\"\n{keys}")).unwrap()
}

/// Two logs, two runs, three seeds: the second run has twice the error, and none on the second log with seed 3.
fn runs() -> StudyTable {
    let mut table = runs_table();
    for (log, scale) in [("t1", 1.0), ("t|2", 10.0)] {
        for (label, factor) in [("auto", 1.0), ("static", 2.0)] {
            for seed in 1..=3 {
                let failed = (log, label, seed) == ("t|2", "static", 3);
                let ate_m = (!failed).then_some(0.01 * scale * factor * f64::from(seed));
                table
                    .push([
                        ("log", log.into()),
                        ("label", label.into()),
                        ("run", label.into()),
                        ("seed", Cell::Integer(seed.into())),
                        ("status", if failed { "failed" } else { "ok" }.into()),
                        ("ate_rmse_m", ate_m.into()),
                        ("restarts", Cell::Integer(seed.into())),
                    ])
                    .unwrap();
            }
        }
    }
    table
}

fn check(keys: &str, expected: &[&str]) {
    let text = plan(keys).tables_text(&runs());
    assert_eq!(text.lines().collect::<Vec<_>>(), expected, "{text}");
}

#[test]
fn groups_have_statistics_and_values_from_elsewhere() {
    check(
        r#"rows = ["log", "label"]
        columns = [{ column = "ate_rmse_m", digits = 2 }, { column = "restarts", statistic = "sum", digits = 0 }]
        references = [{ title = "paper", row = ["t1", "static"], value = "0.384" }]"#,
        &[
            "Errors",
            "",
            "| log | label | runs | without a result | paper | ate_rmse_m | restarts |",
            "| --- | --- | --- | --- | --- | --- | --- |",
            "| t1 | auto | 3 | 0 |  | 0.02 [0.01, 0.03] | 6 |",
            "| t1 | static | 3 | 0 | 0.384 | 0.04 [0.02, 0.06] | 6 |",
            "| t/2 | auto | 3 | 0 |  | 0.20 [0.10, 0.30] | 6 |",
            "| t/2 | static | 3 | 1 |  | 0.40 [0.20, 0.40] | 3 |",
        ],
    );
}

#[test]
fn ratios_are_of_runs_that_are_otherwise_equal() {
    check(
        r#"rows = ["label"]
        only = { label = ["static"] }
        against = { label = "auto" }
        columns = [
          { column = "ate_rmse_m", title = "ratio", statistic = "ratio", digits = 1 },
          { column = "ate_rmse_m", title = "mean, mm", statistic = "mean", factor = 1000, digits = 0 },
          { column = "pose_nees", title = "NEES" },
        ]"#,
        &[
            "Errors",
            "",
            "| label | runs | without a result | ratio | mean, mm | NEES |",
            "| --- | --- | --- | --- | --- | --- |",
            "| static | 6 | 1 | 2.0 [2.0, 2.0] | 144 [20, 400] | – |",
        ],
    );
}
