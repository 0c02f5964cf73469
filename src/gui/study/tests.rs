//! Tests of the view of a synthetic study: found by label, clicked, and drawn in every theme.

#[path = "../../study/view/tests/synthetic_study.rs"]
mod synthetic_study;

use std::collections::BTreeSet;
use std::sync::Arc;

use egui::{Event, Modifiers, PointerButton, Pos2, Rect, pos2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use self::synthetic_study::LOGS;
pub(crate) use self::synthetic_study::synthetic_study;
use super::parallel_axes::{default_axes, parallel_axis};
use super::strips::swarm;
use super::{StudyOptions, StudyPanel, StudyRequest, StudyState, study_panel_ui, study_ui};
use crate::gui::Presentation;
use crate::gui::plot::ValueAxis;
use crate::gui::rendering::headless::{Headless, HeadlessOptions, draw};
use crate::gui::tests::keep_screenshot;
use crate::gui::theme::{Theme, ThemeName};
use crate::study::view::Study;
use crate::text::Named as _;

fn state(seeds: usize, options: &StudyOptions) -> StudyState {
    StudyState::new(Arc::new(synthetic_study(seeds)), options).unwrap()
}

fn harness(seeds: usize) -> Harness<'static, StudyState> {
    let theme = Theme::of(ThemeName::Dark);
    let state = state(seeds, &StudyOptions::default());
    let mut harness = Harness::builder()
        .with_size([1600.0, 900.0])
        .with_context_setup(move |ctx| theme.apply(ctx))
        .build_ui_state(move |ui, state: &mut StudyState| study_ui(ui, state, &theme), state);
    harness.run_steps(3);
    harness
}

#[test]
fn a_click_on_a_run_asks_for_it() {
    let mut harness = harness(1);
    harness.get_by_label("Open auto on house, seed 0").click();
    harness.run_steps(2);
    assert_eq!(harness.state().requests, [StudyRequest::OpenRun(0)]);
}

#[test]
fn heads_sort_and_groups_close() {
    let mut harness = harness(1);
    let first_line = |harness: &Harness<'static, StudyState>| {
        let node = harness.query_all_by_label_contains("Open ").find(|node| node.rect().top() > 400.0);
        node.map(|node| node.accesskit_node().label().unwrap_or_default())
    };
    harness.get_by_label("Sort by ate_rmse_m").click();
    harness.run_steps(3);
    let model = &harness.state().model;
    assert!(model.sort.len() == 1 && !model.sort[0].descending);
    let ascending = first_line(&harness);
    harness.get_by_label("Sort by ate_rmse_m").click();
    harness.run_steps(3);
    assert!(harness.state().model.sort[0].descending);
    assert_ne!(first_line(&harness), ascending);
    harness.get_by_label("Close group auto").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Open group auto").is_some());
    assert!(harness.query_by_label("Open auto on house, seed 0").is_none());
    harness.get_by_label("Open group auto").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Close group auto").is_some());
}

#[test]
fn a_typed_filter_is_in_effect_at_once_and_a_wrong_one_is_explained() {
    let mut harness = harness(1);
    harness.get_by_label("Filter condition").focus();
    harness.run_steps(2);
    harness.get_by_label("Filter condition").type_text("log = city");
    harness.run_steps(3);
    assert_eq!(harness.state().model.arranged.rows.len(), 25);
    assert!(harness.query_by_label("25 of 200 runs").is_some());
    harness.get_by_label("Filter condition").type_text(" and ate < 1");
    harness.run_steps(3);
    assert_eq!(harness.state().model.arranged.rows.len(), 25, "the last valid filter stays in effect");
    assert!(harness.query_by_label_contains("there is no column 'ate'").is_some());
    harness.get_by_label("Clear Filter").click();
    harness.run_steps(3);
    assert_eq!(harness.state().model.arranged.rows.len(), 200);
}

#[test]
fn a_panel_fills_the_window_and_its_table_is_copied() {
    let mut harness = harness(1);
    harness.get_by_label("Maximize: Success rate").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Maximize: Runs").is_none());
    harness.get_by_label("Copy table (CSV): Success rate").click();
    harness.run_steps(2);
    let [StudyRequest::Copy(table, what)] = harness.state().requests.as_slice() else {
        panic!("{:?}", harness.state().requests)
    };
    assert_eq!(what, "Success rate: 5 rows");
    assert!(table.starts_with("group,rate_percent,low_percent,high_percent,runs\nauto,"), "{table}");
    harness.get_by_label("Show all panels: Success rate").click();
    harness.run_steps(3);
    harness.get_by_label("Parameter errors").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Error over σ of pitch.alpha").is_some(), "the least consistent one is shown first");
}

#[test]
fn a_point_under_the_pointer_opens_its_run() {
    let options = HeadlessOptions { size_px: [900, 500], pixels_per_point: 1.0, theme: ThemeName::Light };
    let theme = Theme::of(options.theme);
    let mut state = state(2, &StudyOptions::default());
    let mut headless = Headless::new(options);
    // A press that lasts a second is not a click.
    headless.set_frame_time_s(0.05);
    let mut frame = |events: Vec<Event>, state: &mut StudyState| {
        drop(headless.frame(events, |ui| {
            study_panel_ui(StudyPanel::Distributions, ui, state, &theme, Presentation::Interactive);
        }));
    };
    for _ in 0..3 {
        frame(Vec::new(), &mut state);
    }
    let (place, _) = state.distributions.places()[40];
    frame(vec![Event::PointerMoved(place)], &mut state);
    frame(Vec::new(), &mut state);
    let pointed = state.pointed.expect("a point is under the pointer");
    for pressed in [true, false] {
        let button = PointerButton::Primary;
        frame(vec![Event::PointerButton { pos: place, button, pressed, modifiers: Modifiers::NONE }], &mut state);
    }
    frame(Vec::new(), &mut state);
    assert_eq!(state.requests, [StudyRequest::OpenRun(pointed)]);
}

#[test]
fn every_value_has_a_point_of_its_own_inside_its_strip() {
    let place = Rect::from_min_size(pos2(10.0, 20.0), vec2(200.0, 40.0));
    let axis = ValueAxis { logarithmic: false, low: 0.0, high: 1.0 };
    let values: Vec<(usize, f64)> =
        (0..500).map(|row| (row, if row < 100 { 0.5 } else { row as f64 / 500.0 })).collect();
    let placed = swarm(&values, place, &axis);
    assert_eq!(placed.len(), values.len());
    let mut seen: Vec<Pos2> = placed.iter().map(|(at, _)| *at).collect();
    assert!(seen.iter().all(|at| place.contains(*at)));
    seen.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    seen.dedup();
    assert_eq!(seen.len(), values.len(), "no two points are at the same place");
}

#[test]
fn every_panel_is_drawn_in_every_theme_also_without_data() {
    let grouped = |filter: &str| StudyOptions { filter: filter.to_owned(), ..StudyOptions::default() };
    let cases: [(&str, Study, StudyOptions); 4] = [
        ("whole", synthetic_study(10), StudyOptions::default()),
        ("none", synthetic_study(1), grouped("seed < 0")),
        ("one", synthetic_study(1), grouped("log = house and run = auto and perturbation = none")),
        ("empty", Study::default(), StudyOptions::default()),
    ];
    for (case, study, options) in cases {
        let study = Arc::new(study);
        for theme_name in [ThemeName::Dark, ThemeName::Light, ThemeName::Print] {
            let theme = Theme::of(theme_name);
            for panel in StudyPanel::all() {
                for (file, size_px) in [("", [900, 500]), ("-tiny", [80, 60])] {
                    let presentation = if file.is_empty() { Presentation::Interactive } else { Presentation::Figure };
                    let mut state = StudyState::new(Arc::clone(&study), &options).unwrap();
                    let drawing = HeadlessOptions { size_px, pixels_per_point: 1.0, theme: theme_name };
                    let image = draw(drawing, |ui| study_panel_ui(panel, ui, &mut state, &theme, presentation));
                    let name = format!("study-{}-{case}-{}{file}", panel.name(), theme_name.name());
                    keep_screenshot(&name, &image);
                }
            }
            let mut state = StudyState::new(Arc::clone(&study), &options).unwrap();
            let drawing = HeadlessOptions { size_px: [1920, 1080], pixels_per_point: 1.0, theme: theme_name };
            let image = draw(drawing, |ui| study_ui(ui, &mut state, &theme));
            keep_screenshot(&format!("study-all-{case}-{}", theme_name.name()), &image);
        }
    }
}

#[test]
fn unknown_columns_of_options_are_reported() {
    let study = Arc::new(synthetic_study(1));
    let check = |options: StudyOptions, part: &str| {
        let problem = StudyState::new(Arc::clone(&study), &options).err().unwrap();
        assert!(problem.contains(part), "{problem}");
    };
    let some = |text: &str| Some(text.to_owned());
    check(
        StudyOptions { group: some("colour"), ..StudyOptions::default() },
        "unknown group 'colour': expected one of run, log",
    );
    check(
        StudyOptions { metric: some("speed"), ..StudyOptions::default() },
        "unknown metric 'speed': expected one of restarts",
    );
    check(
        StudyOptions { reference: some("best"), ..StudyOptions::default() },
        "unknown reference group 'best': expected one of auto",
    );
    check(StudyOptions { filter: "ate < 1".to_owned(), ..StudyOptions::default() }, "no column 'ate'");
}

#[test]
fn parallel_axes_place_names_and_numbers() {
    let study = synthetic_study(1);
    let names = default_axes(&study.runs);
    assert_eq!(names, ["run", "log", "perturbation", "ate_rmse_m", "pose_nees", "chain_error_m", "rank_informed"]);
    let rows: Vec<usize> = (0..study.runs.rows()).collect();
    for name in &names {
        let axis = parallel_axis(&study.runs, name, &rows).unwrap();
        assert_eq!(axis.positions.len(), rows.len());
        assert!(axis.positions.iter().flatten().all(|position| (0.0..=1.0).contains(position)), "{name}");
    }
    assert!(parallel_axis(&study.runs, "key", &rows).is_none(), "too many names");
    let axis = parallel_axis(&study.runs, "log", &rows).unwrap();
    assert_eq!(axis.positions.iter().map(|it| format!("{it:?}")).collect::<BTreeSet<_>>().len(), LOGS.len());
}
