use std::sync::Arc;

use super::{Breakpoints, Condition, StepContext};
use crate::estimator::{Event, EventKind, FactorKind, IterationReport, ResidualSummary};
use crate::observability::RankReport;
use crate::sensors::Rig;
use crate::session::record::{Recording, RunRecord, StepRecord};
use crate::session::tests::memory::recorded;
use crate::session::tests::parameter;
use crate::simulation::{SyntheticOptions, synthetic_tracks};

/// A run over a synthetic flight with its rig.
fn sample() -> &'static (Rig, RunRecord) {
    static SAMPLE: std::sync::OnceLock<(Rig, RunRecord)> = std::sync::OnceLock::new();
    SAMPLE.get_or_init(|| {
        let flight = synthetic_tracks(&SyntheticOptions { duration_s: 4.0, ..SyntheticOptions::default() });
        let run = recorded(&flight, "auto");
        (flight.given_rig, run)
    })
}

fn condition(text: &str) -> Condition {
    text.parse().unwrap_or_else(|problem| panic!("{problem}"))
}

/// Two made-up steps with simple numbers.
fn steps() -> [StepRecord; 2] {
    let (_, run) = sample();
    let mut step = StepRecord::clone(run.steps.last().unwrap());
    let report = &mut step.report;
    report.reprojection_rms_after_px = 0.4;
    report.residuals = vec![
        ResidualSummary { factor: FactorKind::Visual, count: 200, chi2_before: 900.0, chi2_after: 100.0 },
        ResidualSummary { factor: FactorKind::CalibrationPrior, count: 18, chi2_before: 9.0, chi2_after: 9.0 },
    ];
    let iteration = |cost_before, cost_after, accepted| IterationReport {
        cost_before,
        cost_after,
        damping: 1e-6,
        step_norm: 0.1,
        accepted,
    };
    report.iterations = vec![iteration(100.0, 60.0, true), iteration(60.0, 75.0, false), iteration(60.0, 50.0, true)];
    report.events = vec![Event {
        kind: EventKind::OldestMarginalized,
        message: String::new(),
        value: None,
        threshold: None,
        cause: None,
    }];
    let sigma = report.calibration.parameters.iter().position(|known| *known == parameter("L1.alpha")).unwrap();
    report.calibration.sigmas[sigma] = 0.01;
    let rank: &mut RankReport = step.rank.as_mut().unwrap();
    (rank.rank_structural, rank.rank_informed) = (17, 12);
    rank.singular_values[0] = 250.0;
    let mut before = step.clone();
    before.rank.as_mut().unwrap().rank_structural = 18;
    before.report.reprojection_rms_after_px = 0.25;
    [before, step]
}

fn holds(text: &str) -> Option<bool> {
    let (rig, _) = sample();
    let [before, step] = steps();
    condition(text).holds(&StepContext { step: &step, previous: Some(&before), names: &rig.parameter_names() })
}

#[test]
fn conditions_are_read_and_evaluated() {
    let joint = sample().0.gimbal.as_ref().unwrap().joints[0].name.clone();
    for (text, expected) in [
        ("rank < 18", true),
        ("rank < 17", false),
        ("rank <= 17 and rank_informed == 12", true),
        ("rank > 18 or features > 3", true),
        ("not rank < 18", false),
        ("not (rank > 18 or rank_informed > 15) and rms < 0.5 px", true),
        // `and` binds before `or`.
        ("true or false and false", true),
        ("(true or false) and false", false),
        ("rank + 1 == 18 and 2 * 3 + 4 == 10 and 2 * (3 + 4) == 14 and 7 - 2 - 1 == 4 and 8 / 4 / 2 == 1", true),
        ("-rank == -17 and abs(-3) == 3 and min(2, 3) == 2 and max(2, 3) == 3", true),
        ("chi2 == 109 and chi2(visual) == 100 and chi2(calibration_prior) == 9 and nis(visual) == 0.5", true),
        ("cost == 50 and cost_before == 100 and cost_rise == 25% and rejected_iterations == 1", true),
        ("event(marginalized) && !event(failure)", true),
        ("sigma(L1.alpha) > 0.5deg && sigma(L1.alpha) < 0.6 deg", true),
        ("rise(rank) < 0 and rise(rms) > 0.14", true),
        ("singular(1) == 2.5e2 and tracking and not initializing", true),
        ("1 != 2 and 1 ≤ 1 and 3 mm == 0.003", true),
    ] {
        assert_eq!(holds(text), Some(expected), "{text}");
    }
    assert_eq!(holds(&format!("sigma(\"{joint}.alpha\") == 0.01 and sigma({joint}.alpha) == 0.01")), Some(true));
    assert_eq!(holds(&format!("abs(joint({joint})) < 4")), Some(true));
}

#[test]
fn missing_values_make_no_condition_true() {
    let (rig, _) = sample();
    let [_, mut step] = steps();
    step.rank = None;
    let check = |text: &str, expected: Option<bool>| {
        let found = condition(text).holds(&StepContext { step: &step, previous: None, names: &rig.parameter_names() });
        assert_eq!(found, expected, "{text}");
    };
    check("rank < 18", None);
    check("not rank < 18", None);
    check("rank < 18 or true", Some(true));
    check("true or rank < 18", Some(true));
    check("rank < 18 and true", None);
    check("rank < 18 and false", Some(false));
    check("rise(rms) > 0", None);
    check("singular(1) > 0", None);
    check("sigma(L9.alpha) > 0", None);
    check("1 / 0 > 0", None);
}

#[test]
fn mistakes_are_reported_with_their_column() {
    let check = |text: &str, column: usize, words: &[&str]| {
        let problem = text.parse::<Condition>().unwrap_err();
        assert_eq!(problem.column, column, "{problem}");
        assert!(words.iter().all(|word| problem.message.contains(word)), "{problem}");
        let shown = problem.to_string();
        let caret = shown.lines().last().unwrap();
        assert_eq!(caret, format!("  {}^", " ".repeat(column - 1)));
    };
    check("", 1, &["missing"]);
    check("rank <", 7, &["ends here"]);
    check("rank", 1, &["number", "compare"]);
    check("rnak < 18", 1, &["'rnak'", "mean 'rank'"]);
    check("features < 40 and speeed > 2", 19, &["mean 'speed'"]);
    check("colour < 40", 1, &["'colour'", "rank_informed", "sigma"]);
    check("rank < 18 or", 13, &["ends here"]);
    check("rank < 18 features > 2", 11, &["'and', 'or'"]);
    check("(rank < 18", 11, &["')'", "column 1"]);
    check("rank < 18)", 10, &["unmatched closing bracket"]);
    check("1 < rank < 18", 10, &["chain"]);
    check("rank = 18", 6, &["=="]);
    check("rank < 18 and tracking + 1 > 2", 15, &["true or false"]);
    check("keyframe and rank", 14, &["compare"]);
    check("sigma > 1", 1, &["sigma(yaw.alpha)"]);
    check("sigma() > 1", 7, &["name"]);
    check("sigma(yaw.alpha > 1", 17, &["')'", "column 1"]);
    check("event(explosion)", 7, &["'explosion'", "marginalized"]);
    check("event(failur)", 7, &["mean 'failure'"]);
    check("chi2(imus) > 1", 6, &["mean 'imu'"]);
    check("lost(money) > 1", 6, &["motion"]);
    check("singular(0) > 1", 10, &["from 1"]);
    check("rank(3) > 1", 5, &["no brackets"]);
    check("sigma(a) > 3 furlongs", 14, &["'furlongs'", "deg"]);
    check("rank < 1.2.3", 8, &["1.2.3"]);
    check("rank # 3", 6, &["'#'"]);
    check("sigma(\"yaw) > 1", 7, &["quote"]);
    check("σ < 3", 1, &["'σ'"]);
    check(&format!("{}true", "(".repeat(200)), 62, &["60 deep"]);
    check(&format!("{}true", "not ".repeat(100_000)), 245, &["60 deep"]);
}

#[test]
fn names_that_no_run_has_are_found() {
    let (rig, run) = sample();
    let (names, parameters) = (rig.parameter_names(), &run.steps.last().unwrap().report.calibration.parameters);
    let unknown = |text: &str| condition(text).unknown_names(&names, parameters);
    let joint = &rig.gimbal.as_ref().unwrap().joints[0].name;
    assert_eq!(
        unknown(&format!("sigma(L1.alpha) > 1 and value({}) > 0", names.name(parameters[0]))),
        Vec::<String>::new()
    );
    assert_eq!(unknown(&format!("sigma({joint}.alpha) > 1 and joint({joint}) > 0")), Vec::<String>::new());
    assert_eq!(unknown("sigma(L1.alfa) > 1 and joint(wheel) > 0 or sigma(L1.alfa) < 0"), ["L1.alfa", "wheel"]);
}

#[test]
fn values_of_a_condition_are_reported_with_their_text() {
    let (rig, _) = sample();
    let [before, step] = steps();
    let names = rig.parameter_names();
    let context = StepContext { step: &step, previous: Some(&before), names: &names };
    let texts: Vec<String> = condition("rank < 18 or rise(rms) > 0.1 and rank > chi2(imu) + 2")
        .values(&context)
        .iter()
        .map(ToString::to_string)
        .collect();
    assert_eq!(texts, ["rank = 17", "rise(rms) = 0.1500", "rms = 0.4000", "chi2(imu) is missing"]);
}

/// A recording of one run with these ranks in its steps.
fn recording_of(ranks: &[usize]) -> Recording {
    let (rig, run) = sample();
    let last = run.steps.last().unwrap();
    let steps = ranks.iter().enumerate().map(|(number, rank)| {
        let mut step = StepRecord::clone(last);
        step.rank.as_mut().unwrap().rank_structural = *rank;
        step.report.stamp_ns = 1000 * number as i64;
        Arc::new(step)
    });
    let mut run = RunRecord::new("auto".parse().unwrap(), "cam0".to_owned());
    run.steps = steps.collect();
    Recording {
        log_path: "made-up.mcap".into(),
        rig: Arc::new(rig.clone()),
        ground_truth_rig: None,
        duration_ns: 1_000_000,
        start_ns: 0,
        epoch_ns: 0,
        prior: None,
        runs: vec![run],
        truth_is_batch: false,
        position_truth: None,
        trajectories: Vec::new(),
        check: None,
        agreement: Arc::default(),
        is_being_checked: false,
        is_being_written: false,
        interruption: None,
        warnings: Vec::new(),
        memory_budget_bytes: usize::MAX,
    }
}

#[test]
fn breakpoints_are_hit_where_they_become_true_as_the_run_grows() {
    let whole = recording_of(&[18, 17, 17, 18, 16, 18, 18, 17]);
    let mut growing = whole.clone();
    growing.runs[0].steps.truncate(2);
    let mut breakpoints = Breakpoints::default();
    breakpoints.add(condition("rank < 18"));
    breakpoints.add(condition("rank < 17"));
    assert!(breakpoints.is_behind(&growing));
    breakpoints.read(&growing);
    assert!(!breakpoints.is_behind(&growing) && breakpoints.is_behind(&whole));
    breakpoints.read(&whole);
    let run = &whole.runs[0];
    let hits: Vec<i64> = breakpoints.list()[0].hits_ns(run).collect();
    assert_eq!(hits, [1000, 4000, 7000]);
    assert_eq!(breakpoints.list()[1].hit_count(run), 1);
    let at = |hit: Option<super::Hit>| hit.map(|hit| (hit.stamp_ns, hit.breakpoint));
    assert_eq!(at(breakpoints.next_after(&whole, 1000)), Some((4000, 0)));
    assert_eq!(at(breakpoints.last_before(&whole, 4000)), Some((1000, 0)));
    assert_eq!(at(breakpoints.next_after(&whole, 7000)), None);
    let first = breakpoints.next_after(&whole, -1).unwrap();
    assert!(breakpoints.describe(&whole, first).starts_with("rank < 18 in auto at 0.000 s, frame "));
    assert!(breakpoints.describe(&whole, first).ends_with(": rank = 17"));
    breakpoints.enable(0, false);
    assert_eq!(at(breakpoints.next_after(&whole, 0)), Some((4000, 1)));
    breakpoints.change(1, condition("rank == 17"));
    breakpoints.read(&whole);
    assert_eq!(breakpoints.list()[1].hit_count(run), 2);
    breakpoints.toggle(condition("rank == 17"));
    breakpoints.toggle(condition("frame == 3"));
    let texts: Vec<&str> = breakpoints.list().iter().map(|breakpoint| breakpoint.condition.text()).collect();
    assert_eq!(texts, ["rank < 18", "frame == 3"]);
    // Another run at the same index is evaluated from its first step.
    let other = recording_of(&[17, 18]);
    breakpoints.read(&other);
    assert_eq!(breakpoints.list()[0].hits_ns(&other.runs[0]).collect::<Vec<_>>(), [0]);
}

#[test]
fn a_condition_is_bounded() {
    let problem = |text: String| text.parse::<Condition>().unwrap_err().to_string();
    let chain = |terms: usize| vec!["keyframe"; terms].join(" and ");
    let message = problem(chain(200_000));
    assert!(message.starts_with("column 1: the condition is too long: 2599995 bytes, expected"), "{message}");
    assert!(message.len() < 300, "{message}");
    for text in [chain(20_000), format!("{} > 1", vec!["1"; 600].join("+"))] {
        let message = problem(text);
        assert!(message.starts_with("column 1: the condition is too long: more than 500 operators"), "{message}");
        assert!(message.len() < 300, "{message}");
    }
    chain(300).parse::<Condition>().unwrap();
}
