//! Tests of the context menu by clicks.

use egui::{Event, Modifiers, PointerButton, Pos2, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use crate::gui::window::WindowRequest;
use crate::gui::window::tests::{Bench, SECOND_NS, bench, bench_with, commands_of};
use crate::gui::{PanelName, ReadingCursor};
use crate::session::{Command, Marker, flight_table, least_determined};
use crate::text::Named as _;

fn open(harness: &mut Harness<'static, Bench>, at: Pos2) {
    harness.event(Event::PointerMoved(at));
    harness.run_steps(2);
    for pressed in [true, false] {
        let (button, modifiers) = (PointerButton::Secondary, Modifiers::NONE);
        harness.event(Event::PointerButton { pos: at, button, pressed, modifiers });
        harness.run_steps(1);
    }
    harness.run_steps(2);
}

/// Opens the menu and clicks on the entry that starts with a text; returns the pushed commands.
fn choose(harness: &mut Harness<'static, Bench>, at: Pos2, text: &str) -> Vec<Command> {
    open(harness, at);
    commands_of(harness, |harness| {
        let mut entries = harness.query_all_by_role(Role::Button);
        let starts = |name: Option<String>| name.is_some_and(|name| name.starts_with(text));
        let entry = entries.find(|node| starts(node.accesskit_node().label()));
        entry.unwrap_or_else(|| panic!("no entry '{text}'")).click();
    })
}

#[test]
fn a_parameter_offers_its_start_a_breakpoint_and_a_fork() {
    let mut harness = bench_with(PanelName::Calibration);
    let run = harness.state().recording.runs[0].clone();
    let rows = flight_table(&harness.state().recording, &run);
    let row = least_determined(&rows).expect("a parameter that is not determined").clone();
    let name = row.name.clone();
    let place = |harness: &Harness<'static, Bench>| {
        harness
            .get_all_by_label_contains(&format!("{name} "))
            .find(|node| {
                // The sentence of the bar may name it as well.
                let node = node.accesskit_node();
                node.role() == Role::Button && node.label().is_some_and(|label| label.starts_with(&name))
            })
            .unwrap()
            .rect()
    };
    let at = place(&harness).left_center() + egui::vec2(20.0, 0.0);
    let since = format!("Go to {:.3} s: {} since then", row.since_s().unwrap(), row.verdict.name());
    let pushed = choose(&mut harness, at, &since);
    assert_eq!(pushed, [Command::Seek { stamp_ns: row.since_ns.unwrap() }]);
    assert_eq!(harness.state().selection.parameter, Some(row.parameter));
    let pushed = choose(&mut harness, at, "Clear the selection");
    assert!(pushed.is_empty() && harness.state().selection.parameter.is_none());
    let pushed = choose(&mut harness, at, &format!("Breakpoint where sigma({name}) < "));
    let [Command::AddBreakpoint(condition)] = &pushed[..] else { panic!("{pushed:?}") };
    assert_eq!(condition.text(), format!("sigma({name}) < 0.1000 deg"));
    choose(&mut harness, at, "Fork with it fixed");
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Fork").click());
    let [Command::Fork { run: 0, changes, label: None }] = &pushed[..] else { panic!("{pushed:?}") };
    assert_eq!(changes.to_string(), format!("freeze={name}"));
    choose(&mut harness, at, "Show over time");
    assert_eq!(harness.state().selection.parameter, Some(row.parameter));
    assert!(harness.query_all_by_label_contains("yaw.theta ").next().is_some(), "the plots are in front");
}

#[test]
fn a_time_takes_the_cursors_a_named_marker_and_a_fork() {
    let mut harness = bench();
    let lanes = harness.get_by_role_and_label(Role::Slider, "Timeline").rect();
    let at = lanes.left_top() + egui::vec2(0.25 * lanes.width(), 40.0);
    let stamp_ns = |pushed: Vec<Command>| match pushed[..] {
        [Command::Seek { stamp_ns }] => stamp_ns,
        _ => panic!("{pushed:?}"),
    };
    let here_ns = stamp_ns(choose(&mut harness, at, "Move the cursor here"));
    assert!((here_ns - SECOND_NS).abs() < SECOND_NS / 50, "a quarter of four seconds: {here_ns}");
    assert!(choose(&mut harness, at, "Set reading cursor A here").is_empty());
    assert_eq!(harness.state().selection.reading.cursor_ns(ReadingCursor::A), Some(here_ns));
    let pushed = choose(&mut harness, at, "Add a marker here");
    let [Command::SetMarkers(markers)] = &pushed[..] else { panic!("{pushed:?}") };
    assert_eq!(markers[..], [Marker::new(here_ns, "")]);

    // The name is typed into the list that opens, and the menu of the marker has its entries.
    let pushed = commands_of(&mut harness, |harness| {
        harness.event(Event::Text("turn".to_owned()));
        harness.key_press(egui::Key::Enter);
    });
    let [Command::SetMarkers(markers)] = &pushed[..] else { panic!("{pushed:?}") };
    assert_eq!(markers[..], [Marker::new(here_ns, "turn")]);
    harness.state_mut().window.close_dialogs();
    harness.run_steps(2);
    open(&mut harness, at);
    assert!(harness.query_by_label_contains("Marker turn ").is_some());
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Delete the marker").click());
    let [Command::SetMarkers(markers)] = &pushed[..] else { panic!("{pushed:?}") };
    assert!(markers.is_empty());

    let pushed = choose(&mut harness, at, "Fork the shown run here");
    assert_eq!(stamp_ns(pushed), here_ns);
    assert!(harness.query_by_label_contains("Fork auto at ").is_some());
}

#[test]
fn a_run_a_feature_and_a_tab_have_menus() {
    let mut harness = bench();
    let run = harness.get_by_label_contains("Run classical").rect().center();
    assert!(choose(&mut harness, run, "Show it in all panels").is_empty());
    assert_eq!(harness.state().selection.run, 1);
    choose(&mut harness, run, "Remove it");
    assert!(harness.query_by_label("Remove run classical?").is_some());
    harness.state_mut().window.close_dialogs();
    harness.run_steps(2);

    let tab = harness.get_by_label("Scene").rect().center();
    choose(&mut harness, tab, "Maximize the panel");
    assert_eq!(harness.state().window.tiles.layout.maximized(), Some(PanelName::Scene));
    let tab = harness.get_by_label("Scene").rect().center();
    choose(&mut harness, tab, "Restore all panels");
    let tab = harness.get_by_label("Scene").rect().center();
    choose(&mut harness, tab, "Close the panel");
    assert!(!harness.state().window.tiles.layout.is_visible(PanelName::Scene));
    let tab = harness.get_by_label("Image").rect().center();
    choose(&mut harness, tab, "Export the panel");
    let written = harness.state().window.requests.last();
    assert!(matches!(written, Some(WindowRequest::WritePanel(export)) if export.name.contains("image")));

    // A feature of the image, which fills its area in one direction.
    let area = harness.get_by_label_contains("Image of ").rect();
    let recording = &harness.state().recording;
    let feature = recording.runs[1].step_at(harness.state().cursor_ns).unwrap().tracks.frame().features[5];
    let [width, height] = recording.rig.cameras[0].model.resolution_px.map(|side| side as f32);
    let offset = egui::vec2(feature.uv_px.x as f32 - 0.5 * width, feature.uv_px.y as f32 - 0.5 * height);
    let at = area.center() + offset * (area.width() / width).min(area.height() / height);
    choose(&mut harness, at, "Fork without it");
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Fork").click());
    assert!(matches!(&pushed[..], [Command::Fork { changes, .. }] if changes.dropped.len() == 1), "{pushed:?}");
}
