//! Test of the question that the program exists for, by clicks on the sample log: which parameter is badly determined,
//! why, since when, and what fixes it.

use egui::{Event, Modifiers, PointerButton, Pos2, Rect, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use super::App;
use super::session_tests::{all_finished, runs, window_over_garden};
use super::tests::run_until;
use crate::gui::painted_texts::painted_texts;
use crate::gui::units::fixed;
use crate::session::{FlightParameter, flight_table, least_determined};

/// Texts that are completely on the screen.
fn visible_texts(harness: &Harness<'static, App>) -> Vec<String> {
    let painted = painted_texts(harness).into_iter();
    let visible = painted.filter(|painted| painted.clip.expand(1.0).contains_rect(painted.rect()));
    visible.map(|painted| painted.text().to_owned()).collect()
}

/// A mouse with a counter of its clicks.
#[derive(Default)]
struct Mouse {
    clicks: usize,
}

impl Mouse {
    fn click(&mut self, harness: &mut Harness<'static, App>, at: Pos2, button: PointerButton) {
        self.clicks += 1;
        harness.event(Event::PointerMoved(at));
        harness.run_steps(2);
        for pressed in [true, false] {
            harness.event(Event::PointerButton { pos: at, button, pressed, modifiers: Modifiers::NONE });
            harness.run_steps(1);
        }
        harness.run_steps(3);
    }

    fn click_on(&mut self, harness: &mut Harness<'static, App>, label: &str) {
        let at = harness.get_by_role_and_label(Role::Button, label).rect().center();
        self.click(harness, at, PointerButton::Primary);
    }
}

/// Row of the calibration table.
fn row_rect(harness: &Harness<'static, App>, least: &FlightParameter) -> Rect {
    let start = format!("{} {}", least.name, least.verdict_text());
    let mut rows = harness.query_all_by_role(Role::Button);
    let is_row = |name: Option<String>| name.is_some_and(|name| name.starts_with(&start));
    rows.find(|node| is_row(node.accesskit_node().label())).expect("a row of the table").rect()
}

#[test]
fn parameter_reason_start_and_remedy_are_there_without_a_click_and_a_fork_takes_four() {
    let mut harness = window_over_garden("auto", 8.0);
    run_until(&mut harness, all_finished);
    let mut mouse = Mouse::default();
    let recording = harness.state().log().unwrap().recording();
    let rows = flight_table(&recording, &recording.runs[0]);
    let least = least_determined(&rows).expect("some parameter is not determined").clone();
    assert!(!least.reason.is_empty() && !least.remedy.is_empty() && least.since_ns.is_some(), "{least:?}");

    // No click: the row of the least determined parameter, as soon as the motions have been computed.
    let since = format!("{} s", fixed(least.since_s().unwrap(), 2));
    let answers = [least.name.as_str(), &since, &least.reason, &least.remedy];
    let missing = |harness: &Harness<'static, App>| {
        let texts = visible_texts(harness);
        answers.iter().filter(|answer| !texts.iter().any(|text| text == **answer)).count()
    };
    run_until(&mut harness, |harness| missing(harness) == 0);
    assert_eq!(mouse.clicks, 0);

    // One click on the row: the start of the verdict, with the parameter selected in all panels.
    let row = row_rect(&harness, &least);
    mouse.click(&mut harness, row.left_center() + egui::vec2(30.0, 0.0), PointerButton::Primary);
    assert_eq!(harness.state().log().unwrap().cursor_ns(), least.since_ns.unwrap());
    assert_eq!(harness.state().selection.parameter, Some(least.parameter));
    assert!(harness.query_by_label(&format!("Parameter {}", least.name)).is_some(), "the inspector shows it");
    assert_eq!(mouse.clicks, 1);

    // Three clicks: a fork from there without the parameter.
    let row = row_rect(&harness, &least);
    mouse.click(&mut harness, row.left_center() + egui::vec2(30.0, 0.0), PointerButton::Secondary);
    mouse.click_on(&mut harness, "Fork with it fixed…");
    mouse.click_on(&mut harness, "Fork");
    run_until(&mut harness, |harness| runs(harness).len() == 2 && all_finished(harness));
    let runs = runs(&harness);
    let origin = runs[1].origin.as_ref().unwrap();
    assert_eq!(origin.changes.to_string(), format!("freeze={}", least.name));
    assert_eq!(origin.stamp_ns, least.since_ns.unwrap());
    assert_eq!(mouse.clicks, 4);
}
