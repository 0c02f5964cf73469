//! Tests of the window by keyboard alone, and of its accessible names.

use egui::accesskit::Action;
use egui::{Key, Modifiers, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::{By, NodeT as _, Queryable as _};

use super::Preset;
use super::tests::{Bench, SECOND_NS, bench, bench_of, commands_of, sample};
use crate::frontend::FeatureId;
use crate::gui::tests::parameter;
use crate::gui::theme::ThemeName;
use crate::gui::{Dialog, PanelName};
use crate::session::{Command, Marker, Markers};
use crate::text::Named as _;

/// Opens the palette, types, and presses Enter.
fn choose(harness: &mut Harness<'static, Bench>, typed: &str) -> Vec<Command> {
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    harness.run_steps(3);
    harness.event(egui::Event::Text(typed.to_owned()));
    harness.run_steps(3);
    commands_of(harness, |harness| harness.key_press(Key::Enter))
}

#[test]
fn the_palette_goes_to_times_and_frames_and_selects() {
    let mut harness = bench();
    assert_eq!(choose(&mut harness, "1.5"), [Command::Seek { stamp_ns: 3 * SECOND_NS / 2 }]);
    let step = harness.state().recording.runs[0].steps[40].clone();
    let (frame, stamp_ns) = (step.report.frame_index, step.report.stamp_ns);
    assert_eq!(choose(&mut harness, &format!("frame {frame}")), [Command::Seek { stamp_ns }]);
    let cursor_ns = harness.state().cursor_ns;
    let id = harness.state().recording.runs[0].step_at(cursor_ns).unwrap().tracks.frame().features[5].id;
    choose(&mut harness, &format!("feature {}", id.0));
    assert_eq!(harness.state().selection.feature, Some(id));
    assert_ne!(id, FeatureId(u64::MAX));
    choose(&mut harness, "parameter roll.alpha");
    assert_eq!(harness.state().selection.parameter, Some(parameter("L2.alpha")));
    choose(&mut harness, "run classical");
    assert_eq!(harness.state().selection.run, 1);
    choose(&mut harness, "theme print");
    assert_eq!(harness.state().window.settings.theme, ThemeName::Print);
    choose(&mut harness, "hide residuals");
    assert!(!harness.state().window.tiles.layout.is_visible(PanelName::Residuals));
    choose(&mut harness, "show residuals");
    assert!(harness.state().window.tiles.layout.is_visible(PanelName::Residuals));
    choose(&mut harness, "compar layout");
    assert_eq!(harness.state().window.tiles.layout.preset, Some(Preset::Comparison));
}

#[test]
fn markers_are_gone_to_listed_and_restored_by_undo() {
    let mut harness = bench();
    let one = Markers::default().with(Marker::new(SECOND_NS, "turn")).with(Marker::new(7 * SECOND_NS / 2, ""));
    harness.state_mut().playback.markers = one.clone();
    harness.run_steps(4);
    let press = |harness: &mut Harness<'static, Bench>, modifiers, key| {
        commands_of(harness, |harness| harness.key_press_modifiers(modifiers, key))
    };
    // The cursor is at 3 s.
    let next = press(&mut harness, Modifiers::NONE, Key::G);
    assert_eq!(next, [Command::Seek { stamp_ns: 7 * SECOND_NS / 2 }]);
    assert_eq!(press(&mut harness, Modifiers::SHIFT, Key::G), [Command::Seek { stamp_ns: SECOND_NS }]);
    assert_eq!(choose(&mut harness, "turn"), [Command::Seek { stamp_ns: SECOND_NS }]);

    press(&mut harness, Modifiers::SHIFT, Key::M);
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Delete the marker at 1.000 s").click());
    let [Command::SetMarkers(left)] = &pushed[..] else { panic!("{pushed:?}") };
    assert_eq!(left.len(), 1);
    harness.key_press(Key::Escape);
    harness.run_steps(4);
    assert_eq!(press(&mut harness, Modifiers::COMMAND, Key::Z), [Command::SetMarkers(one)]);
    harness.run_steps(4);
    let redo = press(&mut harness, Modifiers::COMMAND.plus(Modifiers::SHIFT), Key::Z);
    assert_eq!(redo, [Command::SetMarkers(left.clone())]);

    // A name is typed in the list; Escape discards it, Enter keeps it.
    press(&mut harness, Modifiers::SHIFT, Key::M);
    for (key, renamed) in [(Key::Escape, false), (Key::Enter, true)] {
        if harness.query_by_label("Name of the marker at 3.500 s").is_none() {
            press(&mut harness, Modifiers::SHIFT, Key::M);
        }
        harness.get_by_role_and_label(Role::TextInput, "Name of the marker at 3.500 s").focus();
        harness.run_steps(1);
        harness.event(egui::Event::Text("hover".to_owned()));
        harness.run_steps(2);
        let pushed = commands_of(&mut harness, |harness| harness.key_press(key));
        let name = match &pushed[..] {
            [Command::SetMarkers(markers)] => markers.last().map(|marker| marker.name.clone()),
            _ => None,
        };
        assert_eq!(name.as_deref(), renamed.then_some("hover"), "{key:?}: {pushed:?}");
    }
}

#[test]
fn the_palette_has_every_action_with_its_keys_and_moves_by_key() {
    let mut harness = bench();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    harness.run_steps(3);
    for entry in super::actions::TABLE {
        use super::actions::Action;
        if matches!(entry.action, Action::Dialog(Dialog::Palette) | Action::Dismiss | Action::SavedLayout(_)) {
            continue;
        }
        assert!(harness.query_all_by_label(entry.name).next().is_some(), "{}", entry.name);
        assert!(harness.query_all_by_label(entry.keys).next().is_some(), "{}", entry.keys);
    }
    let chosen = |harness: &Harness<'static, Bench>| {
        let rows = harness.query_all_by_role(Role::Button);
        let marked = rows.filter(|node| node.accesskit_node().toggled() == Some(egui::accesskit::Toggled::True));
        let names = |name: &str| super::actions::TABLE.iter().any(|entry| entry.name == name);
        marked.filter_map(|node| node.accesskit_node().label()).find(|name| names(name))
    };
    let first = chosen(&harness);
    for key in [Key::ArrowDown, Key::PageDown] {
        harness.key_press(key);
        harness.run_steps(2);
    }
    assert!(first.is_some() && chosen(&harness).is_some() && chosen(&harness) != first);
    harness.event(egui::Event::Text("qqqq".to_owned()));
    harness.run_steps(2);
    assert!(harness.query_by_label("No match").is_some());
    assert!(commands_of(&mut harness, |harness| harness.key_press(Key::Escape)).is_empty());
    assert!(harness.query_by_label("No match").is_none(), "Escape closes it");
}

#[test]
fn keys_typed_at_once_go_to_the_palette_and_not_to_the_shortcuts() {
    let mut harness = bench();
    // On a slow machine the key that opens the palette and the next one arrive in one frame.
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    harness.event(egui::Event::Text("4".to_owned()));
    harness.key_press(Key::Num4);
    harness.run_steps(3);
    assert_eq!(harness.state().window.tiles.layout.preset, Some(Preset::Overview));
    assert!(harness.query_by_label("Go to 4.000 s").is_some() || harness.query_by_label_contains("frame 4").is_some());
    harness.key_press(Key::Escape);
    harness.run_steps(3);
    // Shortcuts have no effect while a dialog is open.
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Comma);
    harness.run_steps(3);
    let pushed = commands_of(&mut harness, |harness| {
        harness.key_press(Key::Num4);
        harness.key_press(Key::B);
    });
    assert!(pushed.is_empty() && harness.state().window.tiles.layout.preset == Some(Preset::Overview), "{pushed:?}");
    harness.key_press(Key::Escape);
    harness.run_steps(3);
    harness.key_press(Key::Num4);
    harness.run_steps(3);
    assert_eq!(harness.state().window.tiles.layout.preset, Some(Preset::Scene));
}

#[test]
fn panels_get_the_focus_by_key_in_the_order_on_the_screen() {
    let mut harness = bench();
    let mut seen = Vec::new();
    for _ in 0..harness.state().window.tiles.places.len() {
        harness.key_press(Key::F6);
        harness.run_steps(2);
        seen.push(harness.state().window.tiles.focus.unwrap());
    }
    assert_eq!(seen.first(), Some(&PanelName::Image));
    assert_eq!(seen.last(), Some(&PanelName::Timeline));
    harness.key_press_modifiers(Modifiers::SHIFT, Key::F6);
    harness.run_steps(2);
    assert_eq!(harness.state().window.tiles.focus, seen.iter().rev().nth(1).copied());
    // A saved layout by key, and the notice if there is none.
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Num3);
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("No saved layout has this number").is_some());
}

/// Every clickable or focusable node has a name, in every preset and with every dialog open.
#[test]
fn everything_that_can_be_used_has_a_name() {
    let mut harness = bench();
    let check = |harness: &Harness<'static, Bench>, place: &str| {
        let usable = By::new().predicate(|node| {
            let acts = |action| node.data().supports_action(action);
            // Scroll bars report their position and are part of the content that they scroll.
            let container =
                matches!(node.role(), Role::GenericContainer | Role::Window | Role::ScrollView | Role::ScrollBar);
            (acts(Action::Click) || acts(Action::Focus)) && !container
        });
        let mut count = 0;
        for node in harness.query_all(usable) {
            let node = node.accesskit_node();
            let name = node.label().unwrap_or_default();
            assert!(
                !name.trim().is_empty(),
                "{place}: a {:?} without a name at {:?}",
                node.role(),
                node.bounding_box()
            );
            assert_ne!(node.role(), Role::Unknown, "{place}: {name}");
            count += 1;
        }
        assert!(count > 20, "{place}: {count} nodes");
    };
    for (number, key) in [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5].into_iter().enumerate() {
        harness.key_press(key);
        harness.run_steps(4);
        check(&harness, Preset::NAMES[number].1);
    }
    harness.key_press(Key::Num1);
    for panel in PanelName::movable() {
        harness.state_mut().window.tiles.layout.set_visible(panel, true);
        harness.run_steps(4);
        check(&harness, panel.title());
    }
    for (modifiers, key) in [
        (Modifiers::NONE, Key::A),
        (Modifiers::NONE, Key::F),
        (Modifiers::NONE, Key::W),
        (Modifiers::NONE, Key::F1),
        (Modifiers::SHIFT, Key::F1),
        (Modifiers::SHIFT, Key::Questionmark),
        (Modifiers::COMMAND, Key::O),
        (Modifiers::COMMAND, Key::P),
        (Modifiers::COMMAND, Key::Comma),
    ] {
        harness.key_press_modifiers(modifiers, key);
        harness.run_steps(4);
        check(&harness, &format!("{key:?}"));
        harness.state_mut().window.close_dialogs();
        harness.run_steps(2);
    }
}

#[test]
fn tab_reaches_everything_and_shows_where_it_is() {
    let mut harness = bench();
    let focused = |harness: &Harness<'static, Bench>| harness.ctx.memory(egui::Memory::focused);
    let mut wanted = Vec::new();
    for name in ["File", "Panels", "Play", "Go to end", "Timeline", "Rank", "View of the scene"] {
        harness.get_by_label(name).focus();
        harness.run_steps(1);
        wanted.push((name, focused(&harness)));
    }
    let mut before = None;
    for _ in 0..200 {
        harness.key_press(Key::Tab);
        harness.run_steps(1);
        let now = focused(&harness);
        assert!(now.is_some() && now != before, "Tab moves the focus");
        wanted.retain(|(_, id)| *id != now);
        before = now;
        if wanted.is_empty() {
            break;
        }
    }
    assert!(wanted.is_empty(), "not reached by Tab: {wanted:?}");
    harness.get_by_label("Go to end").focus();
    harness.run_steps(1);
    let pushed = commands_of(&mut harness, |harness| harness.key_press(Key::Enter));
    assert_eq!(pushed, [Command::GoToEnd]);
}

/// Painted elements describe their content to a screen reader.
#[test]
fn painted_elements_have_a_role_and_say_their_content() {
    // High enough that every section of the rank panel is open.
    let mut harness = bench_of(sample(), [1600.0, 1800.0]);
    let content = |harness: &Harness<'static, Bench>, name: &str, role: Role| {
        let mut nodes = harness.query_all(By::new().label_contains(name).predicate(move |node| node.role() == role));
        let node = nodes.next().unwrap_or_else(|| panic!("{role:?} {name}")).accesskit_node();
        assert_eq!(node.value(), node.description(), "{name}");
        node.description().unwrap_or_else(|| panic!("{name} has no description"))
    };
    let frame = harness.state().recording.runs[0].step_at(3 * SECOND_NS).unwrap().report.frame_index;
    let timeline = content(&harness, "Timeline", Role::Slider);
    assert_eq!(timeline, format!("cursor 3.000 s, frame {frame}"));
    assert!(content(&harness, "Image of auto", Role::Image).contains("frame"));
    assert!(content(&harness, "View of the scene", Role::Image).starts_with("auto"));
    assert!(content(&harness, "View of the gimbal's chain", Role::Image).contains("extrinsics error"));
    // In a low panel the section of the spectrum is initially closed.
    if harness.query_all_by_label("Singular values").all(|node| node.accesskit_node().role() != Role::Image) {
        harness.get_by_label("Singular values").click();
        harness.run_steps(4);
    }
    let ranks = content(&harness, "Singular values", Role::Image);
    assert!(ranks.starts_with("structural rank 18 of 18, informed rank"), "{ranks}");
    assert!(content(&harness, "weights", Role::Button).starts_with("direction 1 "));
    for (panel, name, part) in [
        (PanelName::Residuals, "Histogram of reprojection residuals", "median"),
        (PanelName::Residuals, "Reprojection RMS over time", " px"),
        (PanelName::Jacobian, "Jacobian blocks", "columns of blocks"),
        (PanelName::Comparison, "Difference in position over time", "classical"),
    ] {
        harness.state_mut().window.tiles.layout.set_visible(panel, true);
        harness.run_steps(4);
        let text = content(&harness, name, Role::Image);
        assert!(text.contains(part), "{name}: {text}");
    }
    // The lanes have their values as labels.
    let lanes = harness.query_all_by_role(Role::Label).filter_map(|node| node.accesskit_node().value());
    let ranks: Vec<String> = lanes.filter_map(|text| text.strip_prefix("informed rank ").map(str::to_owned)).collect();
    assert!(ranks.iter().any(|rank| rank.parse::<u32>().is_ok()), "{ranks:?}");
    // A screen reader steps the timeline.
    let pushed = commands_of(&mut harness, |harness| {
        let node = harness.get_by_role_and_label(Role::Slider, "Timeline").accesskit_node();
        let (target_node, target_tree) = node.locate();
        let request =
            egui::accesskit::ActionRequest { action: Action::Increment, target_tree, target_node, data: None };
        harness.event(egui::Event::AccessKitActionRequest(request));
    });
    assert_eq!(pushed, [Command::StepFrames(1)]);
}

/// The focus moves from the top bar through the panels, each with its tabs, to the timeline and the status bar.
#[test]
fn tab_goes_in_reading_order_and_not_to_lines() {
    let mut harness = bench();
    let places = harness.state().window.tiles.places.clone();
    let region = |rect: egui::Rect| {
        let inside = places.iter().position(|(_, place)| place.expand(1.0).contains(rect.center()));
        // The tabs are above their panel.
        let above = places.iter().position(|(panel, place)| {
            let tabs = place.translate(egui::vec2(0.0, -20.0)).with_max_y(place.top());
            *panel != PanelName::Timeline && tabs.expand(1.0).contains(rect.center())
        });
        let top = if rect.center().y < places[0].1.top() - 20.0 { Some(0) } else { None };
        inside.or(above).map(|place| place + 1).or(top).unwrap_or(places.len() + 1)
    };
    harness.get_by_label("File").focus();
    harness.run_steps(1);
    let mut seen = vec![0];
    for _ in 0..300 {
        harness.key_press(Key::Tab);
        harness.run_steps(1);
        let id = harness.ctx.memory(egui::Memory::focused).unwrap();
        let rect = harness.ctx.read_response(id).unwrap().rect;
        assert!(rect.width().min(rect.height()) >= 10.0, "a line has the focus: {rect:?}");
        let here = region(rect);
        if here == 0 && *seen.last().unwrap() > 0 {
            break;
        }
        if *seen.last().unwrap() != here {
            seen.push(here);
        }
    }
    assert!(seen.is_sorted() && seen.len() > places.len(), "{seen:?} of {places:?}");
}
