//! Tests of the window by pointer: zooming, panning, dragging tabs, copying.

use egui::{
    Event, Key, Modifiers, MouseWheelSource, MouseWheelUnit, OutputCommand, PointerButton, Pos2, Role, TouchPhase,
};
use egui::{Vec2, pos2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::Preset;
use super::tests::{Bench, SECOND_NS, bench, bench_with};
use crate::gui::PanelName;
use crate::session::Command;

fn press(pos: Pos2, button: PointerButton, pressed: bool) -> Event {
    Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE }
}

fn click(harness: &mut Harness<'static, Bench>, at: Pos2, button: PointerButton) {
    harness.event(Event::PointerMoved(at));
    for pressed in [true, false] {
        harness.event(press(at, button, pressed));
        harness.run_steps(1);
    }
    harness.run_steps(2);
}

fn drag(harness: &mut Harness<'static, Bench>, button: PointerButton, from: Pos2, to: Pos2) {
    harness.event(Event::PointerMoved(from));
    harness.run_steps(1);
    harness.event(press(from, button, true));
    harness.run_steps(1);
    for step in 1..=5 {
        harness.event(Event::PointerMoved(from + (to - from) * (step as f32 / 5.0)));
        harness.run_steps(1);
    }
    harness.event(press(to, button, false));
    harness.run_steps(3);
}

fn scroll(harness: &mut Harness<'static, Bench>, at: Pos2, delta: Vec2, modifiers: Modifiers) {
    harness.event(Event::PointerMoved(at));
    harness.event(Event::ModifiersChanged(modifiers));
    harness.event(Event::MouseWheel {
        unit: MouseWheelUnit::Point,
        delta,
        phase: TouchPhase::Move,
        source: MouseWheelSource::Unknown,
        modifiers,
    });
    harness.run_steps(20);
    harness.event(Event::ModifiersChanged(Modifiers::NONE));
    harness.run_steps(2);
}

fn visible_s(harness: &Harness<'static, Bench>) -> Option<(f64, f64)> {
    let range = harness.state().selection.visible_ns;
    range.map(|(begin_ns, end_ns)| (begin_ns as f64 * 1e-9, end_ns as f64 * 1e-9))
}

/// The plot of the first parameter, which does not scroll in the overview, and the timeline.
const PLOTS: [&str; 2] = ["I.rx", "Timeline"];

/// Position in a plot by fractions of its size.
fn place_in(harness: &Harness<'static, Bench>, plot: &str, x: f32, y: f32) -> Pos2 {
    let rect = harness.query_all_by_label_contains(plot).next().unwrap().rect();
    rect.min + vec2(x, y) * rect.size()
}

#[test]
fn plots_and_timeline_zoom_and_pan_alike() {
    let mut harness = bench_with(PanelName::Convergence);
    for plot in PLOTS {
        harness.state_mut().selection.visible_ns = None;
        harness.run_steps(2);
        let at = |harness: &Harness<'static, Bench>, x: f32| place_in(harness, plot, x, 0.6);
        // The whole log of 4 s is shown; a quarter of it is to the left of the pointer.
        let pointer = at(&harness, 0.25);
        scroll(&mut harness, pointer, vec2(0.0, 120.0), Modifiers::NONE);
        let (begin_s, end_s) = visible_s(&harness).unwrap_or_else(|| panic!("{plot} zooms"));
        let fraction = (1.0 - begin_s) / (end_s - begin_s);
        assert!(end_s - begin_s < 3.0 && (fraction - 0.25).abs() < 0.02, "{plot}: {begin_s} to {end_s}");
        // Horizontal scrolling to the left shows later times.
        scroll(&mut harness, pointer, vec2(-60.0, 0.0), Modifiers::NONE);
        let (later_s, later_end_s) = visible_s(&harness).unwrap();
        assert!(later_s > begin_s && (later_end_s - later_s - (end_s - begin_s)).abs() < 1e-6, "{plot}");
        scroll(&mut harness, pointer, vec2(0.0, -40.0), Modifiers::COMMAND);
        let (wide_s, wide_end_s) = visible_s(&harness).unwrap();
        assert!(wide_end_s - wide_s > later_end_s - later_s, "{plot}");
        // In one frame: a frame of the test takes a quarter of a second.
        let double = [true, false, true, false].map(|pressed| press(pointer, PointerButton::Primary, pressed));
        harness.input_mut().events.extend(double);
        harness.run_steps(3);
        harness.state_mut().commands_mut().clear();
        assert_eq!(visible_s(&harness), None, "{plot}: a double click shows the whole log");
        // A range with the secondary button.
        let (from, to) = (at(&harness, 0.25), at(&harness, 0.75));
        drag(&mut harness, PointerButton::Secondary, from, to);
        let (begin_s, end_s) = visible_s(&harness).unwrap_or_else(|| panic!("{plot} zooms to a range"));
        assert!((begin_s - 1.0).abs() < 0.05 && (end_s - 3.0).abs() < 0.05, "{plot}: {begin_s} to {end_s}");
        // On the timeline a drag moves the cursor, so the middle button pans there.
        let button = if plot == "Timeline" { PointerButton::Middle } else { PointerButton::Primary };
        drag(&mut harness, button, from, to);
        let (panned_s, panned_end_s) = visible_s(&harness).unwrap();
        assert!((panned_s - 0.0).abs() < 0.05 && (panned_end_s - 2.0).abs() < 0.05, "{plot}: {panned_s}");
        let commands = std::mem::take(harness.state_mut().commands_mut());
        assert!(commands.is_empty(), "{plot}: panning moves no cursor: {commands:?}");
    }
}

#[test]
fn a_click_on_a_plot_moves_the_cursor_and_a_drag_on_the_timeline_too() {
    let mut harness = bench();
    harness.key_press(Key::Num3);
    harness.run_steps(3);
    let at = place_in(&harness, "Reprojection RMS over time", 0.5, 0.5);
    harness.state_mut().commands_mut().clear();
    click(&mut harness, at, PointerButton::Primary);
    let commands = std::mem::take(harness.state_mut().commands_mut());
    let Some(Command::Seek { stamp_ns }) = commands.last() else { panic!("{commands:?}") };
    assert!((stamp_ns - 2 * SECOND_NS).abs() < SECOND_NS / 20);
    let (from, to) = (place_in(&harness, "Timeline", 0.2, 0.5), place_in(&harness, "Timeline", 0.75, 0.5));
    drag(&mut harness, PointerButton::Primary, from, to);
    let commands = std::mem::take(harness.state_mut().commands_mut());
    let Some(Command::Seek { stamp_ns }) = commands.last() else { panic!("{commands:?}") };
    assert!((stamp_ns - 3 * SECOND_NS).abs() < SECOND_NS / 20 && commands.len() > 3);
    // By key, about the cursor.
    harness.key_press(Key::Plus);
    harness.run_steps(2);
    let (begin_s, end_s) = visible_s(&harness).unwrap();
    assert!(begin_s < 3.0 && end_s > 3.0 && end_s - begin_s < 3.0, "{begin_s} to {end_s}");
    harness.key_press(Key::Minus);
    harness.run_steps(2);
    assert_eq!(visible_s(&harness), None);
}

fn place_of(harness: &Harness<'static, Bench>, panel: PanelName) -> egui::Rect {
    harness.state().window.tiles.places.iter().find(|(known, _)| *known == panel).unwrap().1
}

#[test]
fn tabs_and_their_bars_are_dragged_and_put_back_by_undo() {
    let mut harness = bench();
    let title = harness.get_by_role_and_label(Role::Button, "Residuals").rect().center();
    let target = place_of(&harness, PanelName::Rank).center();
    drag(&mut harness, PointerButton::Primary, title, target);
    let shown = |harness: &Harness<'static, Bench>, panel: PanelName| {
        harness.state().window.tiles.places.iter().any(|(known, _)| *known == panel)
    };
    assert!(
        shown(&harness, PanelName::Residuals),
        "it was behind the calibration table, now it has a place of its own"
    );
    assert!(place_of(&harness, PanelName::Residuals).left() > 1000.0, "on the right, beside the rank");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_steps(3);
    assert!(!shown(&harness, PanelName::Residuals));
    harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    harness.run_steps(3);
    assert!(shown(&harness, PanelName::Residuals));
    harness.key_press(Key::Num1);
    harness.run_steps(3);

    // Dragging the empty part of a tab bar moves all its tabs; here the tabs of the convergence to the right edge of
    // the inspector.
    let (convergence, inspector) =
        (place_of(&harness, PanelName::Calibration), place_of(&harness, PanelName::Inspector));
    let bar = pos2(convergence.right() - 60.0, convergence.top() - 10.0);
    drag(&mut harness, PointerButton::Primary, bar, inspector.center());
    assert!(place_of(&harness, PanelName::Calibration).left() > 1000.0, "{:?}", harness.state().window.tiles.places);
    let titles = ["Residuals", "Jacobian", "Laboratory", "Comparison"];
    let on_the_right = |title: &&str| harness.query_all_by_label(title).any(|node| node.rect().left() > 1000.0);
    assert!(titles.iter().all(on_the_right));
}

#[test]
fn settings_and_layout_are_undone_and_redone_by_key() {
    let mut harness = bench();
    let preset = |harness: &Harness<'static, Bench>| harness.state().window.tiles.layout.preset;
    let undo = |harness: &mut Harness<'static, Bench>, modifiers: Modifiers| {
        harness.key_press_modifiers(Modifiers::COMMAND | modifiers, Key::Z);
        harness.run_steps(3);
    };
    let theme = harness.state().window.settings.theme;
    for key in [Key::Num4, Key::T, Key::Num2] {
        harness.key_press(key);
        harness.run_steps(3);
    }
    assert_eq!(preset(&harness), Some(Preset::Calibration));
    undo(&mut harness, Modifiers::NONE);
    assert_eq!(preset(&harness), Some(Preset::Scene));
    assert_ne!(harness.state().window.settings.theme, theme);
    undo(&mut harness, Modifiers::NONE);
    assert!(preset(&harness) == Some(Preset::Scene) && harness.state().window.settings.theme == theme);
    undo(&mut harness, Modifiers::NONE);
    assert_eq!(preset(&harness), Some(Preset::Overview));
    undo(&mut harness, Modifiers::NONE);
    assert!(harness.query_by_label("Nothing to undo").is_some());
    for _ in 0..3 {
        undo(&mut harness, Modifiers::SHIFT);
    }
    assert!(preset(&harness) == Some(Preset::Calibration) && harness.state().window.settings.theme != theme);
}

/// Text that a frame copies.
fn copied(harness: &mut Harness<'static, Bench>, act: impl FnOnce(&mut Harness<'static, Bench>)) -> Option<String> {
    act(harness);
    let mut text = None;
    for _ in 0..3 {
        harness.run_steps(1);
        let commands = &harness.output().platform_output.commands;
        let copy = commands.iter().find_map(|command| match command {
            OutputCommand::CopyText(text) => Some(text.clone()),
            _ => None,
        });
        text = text.or(copy);
    }
    text
}

#[test]
fn the_value_under_the_pointer_or_the_table_is_copied() {
    let mut harness = bench_with(PanelName::Convergence);
    // A plot offers the value of its parameter.
    let cell = place_in(&harness, "I.rx", 0.5, 0.5);
    harness.event(Event::PointerMoved(cell));
    harness.run_steps(2);
    let value = copied(&mut harness, |harness| harness.event(Event::Copy)).unwrap();
    assert!(value.starts_with("I.rx ") && value.contains('±') && value.contains('°'), "{value}");
    assert!(harness.query_by_label_contains("Copied: I.rx").is_some());
    // A painted or written text is a value, too.
    let verdict = harness.get_by_label_contains("Structural rank 18 of 18").rect();
    harness.event(Event::PointerMoved(verdict.left_center() + vec2(20.0, 0.0)));
    harness.run_steps(2);
    let value = copied(&mut harness, |harness| harness.event(Event::Copy)).unwrap();
    assert!(value.contains("tructural rank 18 of 18"), "{value}");
    // Without a value, the table of the focused panel is copied.
    harness.state_mut().window.tiles.focus = Some(PanelName::Rank);
    harness.event(Event::PointerGone);
    harness.run_steps(2);
    let table = copied(&mut harness, |harness| harness.event(Event::Copy)).unwrap();
    assert_eq!(table.lines().count(), 19, "{table}");
    assert!(harness.query_by_label("Copied the table of Rank: 18 rows (CSV)").is_some());
    click(&mut harness, cell, PointerButton::Secondary);
    assert!(harness.query_by_label("Copy value").is_some());
    let table = copied(&mut harness, |harness| harness.get_by_label("Copy table (CSV)").click()).unwrap();
    assert!(table.starts_with("time_s,") || table.contains("I.rx"), "{}", &table[..80.min(table.len())]);
    assert!(harness.query_by_label("Copy value").is_none(), "the menu closes");
}

#[test]
fn a_tab_focuses_its_panel_and_a_double_click_maximizes_it() {
    let mut harness = bench();
    let tab = |harness: &Harness<'static, Bench>, name: &str| {
        // Buttons of the layouts have the same names.
        let mut tabs = harness.query_all_by_role_and_label(Role::Button, name).map(|node| node.rect());
        let tab = tabs.find(|rect| rect.top() > 28.0).unwrap_or_else(|| panic!("no tab {name}"));
        tab.left_center() + vec2(12.0, 0.0)
    };
    let at = tab(&harness, "Scene");
    click(&mut harness, at, PointerButton::Primary);
    assert_eq!(harness.state().window.tiles.focus, Some(PanelName::Scene));
    let double_click = |harness: &mut Harness<'static, Bench>, at: Pos2| {
        harness.event(Event::PointerMoved(at));
        harness.run_steps(4);
        // In one frame: the frames of the harness are longer than the pause between two clicks.
        let clicks = [true, false, true, false].map(|pressed| press(at, PointerButton::Primary, pressed));
        harness.input_mut().events.extend(clicks);
        harness.run_steps(4);
    };
    let at = tab(&harness, "Scene");
    double_click(&mut harness, at);
    assert_eq!(harness.state().window.tiles.layout.maximized(), Some(PanelName::Scene));
    let shown = |harness: &Harness<'static, Bench>| harness.state().window.tiles.places.len();
    assert_eq!(shown(&harness), 2, "the panel and the timeline");
    let at = tab(&harness, "Scene");
    double_click(&mut harness, at);
    assert_eq!(harness.state().window.tiles.layout.maximized(), None);
    assert!(shown(&harness) > 4);
    // By key, and another layout restores the panels.
    for _ in 0..2 {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::M);
        harness.run_steps(3);
    }
    assert!(shown(&harness) > 4);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::M);
    harness.run_steps(3);
    assert_eq!(shown(&harness), 2);
    harness.key_press(Key::Num2);
    harness.run_steps(3);
    assert!(shown(&harness) > 4);
    // The size of a maximized panel is no change that undo reverts.
    assert_eq!(harness.state().window.tiles.layout.preset, Some(Preset::Calibration));
}
