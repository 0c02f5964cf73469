//! Tests of the window by its labels.

use std::sync::Arc;

use egui::{Key, Modifiers, Role};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use super::{MainWindow, Preset, window_ui};
use crate::estimator::{FactorKind, StepWarning};
use crate::gui::samples::{sample_images, sample_recording_of};
use crate::gui::tests::parameter;
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{PanelContext, PanelName, Playback, Presentation, Selection};
use crate::observability::{Determination, SlideRequest};
use crate::session::breakpoints::Breakpoints;
use crate::session::{
    Command, ForkChanges, ForkOrigin, PlaybackSpeed, Recording, RunWarning, flight_headline, flight_table,
    least_determined,
};

pub(super) const SECOND_NS: i64 = 1_000_000_000;

/// A window with the sample, and the pushed commands.
pub(super) struct Bench {
    pub(super) recording: Recording,
    pub(super) cursor_ns: i64,
    pub(super) playback: Playback,
    pub(super) selection: Selection,
    pub(super) window: MainWindow,
    commands: Vec<Command>,
}

impl Bench {
    /// Commands pushed since they were last taken.
    pub(super) fn commands_mut(&mut self) -> &mut Vec<Command> {
        &mut self.commands
    }

    pub(super) fn ui(&mut self, ui: &mut egui::Ui) {
        let theme = Theme::of(ThemeName::Dark);
        let mut context = PanelContext {
            recording: &self.recording,
            cursor_ns: self.cursor_ns,
            playback: &self.playback,
            images: &mut sample_images(),
            selection: &mut self.selection,
            theme: &theme,
            presentation: Presentation::Interactive,
            commands: &mut self.commands,
        };
        window_ui(ui, &mut self.window, &mut context);
        // The application applies commands before the next frame, which the history of the markers relies on.
        if let Some(Command::SetMarkers(markers)) = self.commands.last() {
            self.playback.markers = markers.clone();
        }
    }
}

/// Computed once, because it takes longer than all other tests.
pub(super) fn sample() -> Recording {
    static SAMPLE: std::sync::OnceLock<Recording> = std::sync::OnceLock::new();
    SAMPLE.get_or_init(|| sample_recording_of(80, &["auto", "classical"])).clone()
}

pub(super) fn bench() -> Harness<'static, Bench> {
    bench_of(sample(), [1600.0, 900.0])
}

/// A window in which a panel is in front.
pub(super) fn bench_with(panel: PanelName) -> Harness<'static, Bench> {
    let mut harness = bench();
    harness.state_mut().window.tiles.layout.set_visible(panel, true);
    harness.run_steps(3);
    harness
}

/// A window of a size in points with a recording.
pub(super) fn bench_of(recording: Recording, size: [f32; 2]) -> Harness<'static, Bench> {
    let bench = Bench {
        recording,
        cursor_ns: 3 * SECOND_NS,
        playback: Playback::default(),
        selection: Selection::default(),
        window: MainWindow::default(),
        commands: Vec::new(),
    };
    let mut harness = Harness::builder()
        .with_size(size)
        .with_max_steps(20)
        .with_context_setup(|ctx| Theme::of(ThemeName::Dark).apply(ctx))
        .build_ui_state(|ui, bench: &mut Bench| bench.ui(ui), bench);
    harness.run_steps(3);
    harness
}

/// Executes a function and returns the commands that it pushed.
pub(super) fn commands_of(
    harness: &mut Harness<'static, Bench>,
    act: impl FnOnce(&Harness<'static, Bench>),
) -> Vec<Command> {
    harness.state_mut().commands.clear();
    act(harness);
    harness.run_steps(3);
    std::mem::take(&mut harness.state_mut().commands)
}

#[test]
fn the_transport_pushes_commands() {
    let mut harness = bench();
    for (label, command) in [
        ("Play", Command::TogglePlay),
        ("Step", Command::StepFrames(1)),
        ("Step back", Command::StepFrames(-1)),
        ("Next event", Command::JumpToEvent { forward: true }),
        ("Previous event", Command::JumpToEvent { forward: false }),
        ("Go to start", Command::GoToStart),
        ("Go to end", Command::GoToEnd),
        ("Marker", Command::ToggleMarker),
        ("Loop", Command::SetLoop(Some((0, 4 * SECOND_NS)))),
    ] {
        let pushed = commands_of(&mut harness, |harness| harness.get_by_label(label).click());
        assert_eq!(pushed, [command], "{label}");
    }
    harness.state_mut().playback.playing = true;
    harness.run_steps(2);
    assert!(harness.query_by_label("Play").is_none());
    assert_eq!(commands_of(&mut harness, |harness| harness.get_by_label("Pause").click()), [Command::TogglePlay]);
}

#[test]
fn the_speed_is_chosen_from_a_list() {
    let mut harness = bench();
    commands_of(&mut harness, |harness| {
        let combo = harness.get_all_by_role(Role::ComboBox).find(|node| node.value().as_deref() == Some("1×"));
        combo.unwrap().click();
    });
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("0.25×").click());
    assert_eq!(pushed, [Command::SetSpeed(PlaybackSpeed(0.25))]);
}

#[test]
fn keys_push_the_same_commands() {
    let mut harness = bench();
    for (modifiers, key, command) in [
        (Modifiers::NONE, Key::Space, Command::TogglePlay),
        (Modifiers::NONE, Key::ArrowRight, Command::StepFrames(1)),
        (Modifiers::NONE, Key::ArrowLeft, Command::StepFrames(-1)),
        (Modifiers::SHIFT, Key::ArrowRight, Command::StepFrames(10)),
        (Modifiers::SHIFT, Key::ArrowLeft, Command::StepFrames(-10)),
        (Modifiers::COMMAND, Key::ArrowRight, Command::JumpToEvent { forward: true }),
        (Modifiers::COMMAND, Key::ArrowLeft, Command::JumpToEvent { forward: false }),
        (Modifiers::NONE, Key::Period, Command::StepIteration { forward: true }),
        (Modifiers::NONE, Key::Comma, Command::StepIteration { forward: false }),
        (Modifiers::NONE, Key::Home, Command::GoToStart),
        (Modifiers::NONE, Key::End, Command::GoToEnd),
        (Modifiers::NONE, Key::M, Command::ToggleMarker),
        (Modifiers::ALT, Key::ArrowRight, Command::StepTime { by_ns: SECOND_NS }),
        (Modifiers::ALT.plus(Modifiers::SHIFT), Key::ArrowLeft, Command::StepTime { by_ns: -SECOND_NS / 10 }),
        (Modifiers::NONE, Key::K, Command::JumpToKeyframe { run: 0, forward: true }),
        (Modifiers::SHIFT, Key::K, Command::JumpToKeyframe { run: 0, forward: false }),
        (Modifiers::NONE, Key::CloseBracket, Command::SetSpeed(PlaybackSpeed(2.0))),
        (Modifiers::NONE, Key::OpenBracket, Command::SetSpeed(PlaybackSpeed(0.5))),
        (Modifiers::NONE, Key::B, Command::ToggleBreakpointHere),
        (Modifiers::NONE, Key::N, Command::RunToBreakpoint { forward: true }),
        (Modifiers::SHIFT, Key::N, Command::RunToBreakpoint { forward: false }),
        (Modifiers::NONE, Key::L, Command::SetLoop(Some((0, 4 * SECOND_NS)))),
    ] {
        let pushed = commands_of(&mut harness, |harness| harness.key_press_modifiers(modifiers, key));
        assert_eq!(pushed, [command], "{key:?}");
    }
    harness.key_press(Key::Num3);
    harness.run_steps(3);
    assert_eq!(harness.state().window.tiles.layout.preset, Some(Preset::FrontEnd));
    harness.key_press(Key::T);
    harness.run_steps(2);
    assert_eq!(harness.state().window.settings.theme, ThemeName::Light);
}

#[test]
fn a_click_on_the_timeline_seeks_there() {
    let mut harness = bench();
    let lanes = harness.get_by_label("Timeline").rect();
    let middle = lanes.center();
    let pushed = commands_of(&mut harness, |harness| {
        harness.event(egui::Event::PointerMoved(middle));
        for pressed in [true, false] {
            let button = egui::PointerButton::Primary;
            harness.event(egui::Event::PointerButton { pos: middle, button, pressed, modifiers: Modifiers::NONE });
        }
    });
    let Some(Command::Seek { stamp_ns }) = pushed.last() else { panic!("{pushed:?}") };
    assert!((stamp_ns - 2 * SECOND_NS).abs() < SECOND_NS / 50, "{stamp_ns}");
}

#[test]
fn shift_and_drag_sets_the_range_to_loop_over() {
    let mut harness = bench();
    let lanes = harness.get_by_label("Timeline").rect();
    let at = |fraction: f32| egui::pos2(lanes.left() + fraction * lanes.width(), lanes.center().y);
    let button = |pos, pressed| egui::Event::PointerButton {
        pos,
        button: egui::PointerButton::Primary,
        pressed,
        modifiers: Modifiers::SHIFT,
    };
    harness.state_mut().commands.clear();
    harness.event(egui::Event::ModifiersChanged(Modifiers::SHIFT));
    harness.event(egui::Event::PointerMoved(at(0.25)));
    harness.event(button(at(0.25), true));
    for fraction in [0.3, 0.5] {
        harness.event(egui::Event::PointerMoved(at(fraction)));
    }
    harness.event(button(at(0.5), false));
    harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    harness.run_steps(2);
    let commands = &harness.state().commands;
    let Some(Command::SetLoop(Some((begin_ns, end_ns)))) = commands.last() else { panic!("{commands:?}") };
    assert!((begin_ns - SECOND_NS).abs() < SECOND_NS / 5 && (end_ns - 2 * SECOND_NS).abs() < SECOND_NS / 20);
    assert!(!commands.iter().any(|command| matches!(command, Command::Seek { .. })), "{commands:?}");
}

#[test]
fn a_run_is_added_through_the_dialog() {
    let mut harness = bench();
    commands_of(&mut harness, |harness| harness.get_by_label("Add run…").click());
    assert!(harness.query_by_label("--run classical").is_some());
    harness.get_by_label("Encoder readings").click();
    harness.run_steps(2);
    assert!(harness.query_by_label("--run classical:encoder=off").is_some());
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Add run").click());
    let Some(Command::AddRun(spec)) = pushed.first() else { panic!("{pushed:?}") };
    assert_eq!(spec.to_string(), "classical:encoder=off");
    assert!(harness.query_by_label("Encoder readings").is_none(), "the dialog closes");
}

/// A window with the breakpoints panel in front.
fn breakpoints_bench(conditions: &[&str]) -> Harness<'static, Bench> {
    let mut harness = bench();
    let state = harness.state_mut();
    state.window.tiles.layout.set_visible(PanelName::Breakpoints, true);
    let mut breakpoints = Breakpoints::default();
    for condition in conditions {
        breakpoints.add(condition.parse().unwrap());
    }
    breakpoints.read(&state.recording);
    state.playback.breakpoints = Arc::new(breakpoints);
    harness.run_steps(3);
    harness
}

#[test]
fn a_breakpoint_is_typed_and_its_mistakes_are_marked() {
    let mut harness = breakpoints_bench(&[]);
    let type_text = |harness: &mut Harness<'static, Bench>, text: &str| {
        harness.get_by_role_and_label(Role::TextInput, "Condition").focus();
        harness.run_steps(1);
        harness.get_by_role_and_label(Role::TextInput, "Condition").type_text(text);
        harness.run_steps(2);
    };
    type_text(&mut harness, "rank < 18 or");
    assert!(harness.query_by_label_contains("Column 13: the condition ends here").is_some());
    assert!(harness.query_by_label("rank < 18 or\n            ^").is_some());
    assert!(harness.get_by_label("Add breakpoint").accesskit_node().is_disabled());
    type_text(&mut harness, " features < 40");
    assert!(harness.query_by_label_contains("Column").is_none());
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Add breakpoint").click());
    let [Command::AddBreakpoint(condition)] = pushed.as_slice() else { panic!("{pushed:?}") };
    assert_eq!(condition.text(), "rank < 18 or features < 40");
    // While the user types, B and N are letters.
    harness.get_by_role_and_label(Role::TextInput, "Condition").focus();
    harness.run_steps(1);
    let pushed = commands_of(&mut harness, |harness| harness.key_press(Key::N));
    assert!(pushed.is_empty(), "{pushed:?}");
}

#[test]
fn breakpoints_show_their_hits_and_can_be_changed() {
    let mut harness = breakpoints_bench(&["tracking", "frame == 7"]);
    assert_eq!(harness.query_all_by_label("auto 1 hit").count(), 2);
    assert_eq!(harness.query_all_by_label("classical 1 hit").count(), 2);
    for (label, command) in [
        ("Next hit", Command::RunToBreakpoint { forward: true }),
        ("Previous hit", Command::RunToBreakpoint { forward: false }),
        ("tracking", Command::EnableBreakpoint { number: 0, enabled: false }),
        ("Remove frame == 7", Command::RemoveBreakpoint(1)),
    ] {
        let pushed = commands_of(&mut harness, |harness| harness.get_by_label(label).click());
        assert_eq!(pushed, [command], "{label}");
    }
    commands_of(&mut harness, |harness| harness.get_by_label("Edit tracking").click());
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Change breakpoint").click());
    assert_eq!(pushed, [Command::ChangeBreakpoint { number: 0, condition: "tracking".parse().unwrap() }]);
}

#[test]
fn a_fork_is_made_by_key_and_label_and_has_a_lane() {
    let mut harness = bench();
    harness.key_press(Key::F);
    harness.run_steps(3);
    assert!(harness.query_by_label("Fork auto at 3.000 s").is_some());
    assert!(harness.query_by_label("No changes").is_some());
    commands_of(&mut harness, |harness| {
        let combo = harness.get_all_by_role(Role::ComboBox).find(|node| node.value().as_deref() == Some("unchanged"));
        combo.unwrap().click();
    });
    harness.get_by_role_and_label(Role::Button, "classical").click();
    harness.run_steps(2);
    let type_text = |harness: &mut Harness<'static, Bench>, label: &str, text: &str| {
        harness.get_by_role_and_label(Role::TextInput, label).focus();
        harness.run_steps(1);
        harness.get_by_role_and_label(Role::TextInput, label).type_text(text);
        harness.run_steps(2);
    };
    type_text(&mut harness, "Freeze parameters", "yaw.d");
    type_text(&mut harness, "Drop features", "twelve");
    assert!(harness.query_by_label_contains("'twelve' is not a feature id").is_some());
    assert!(harness.get_by_label("Fork").accesskit_node().is_disabled());
    harness.get_by_role_and_label(Role::TextInput, "Drop features").focus();
    harness.run_steps(1);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.run_steps(1);
    type_text(&mut harness, "Drop features", "12");
    assert!(harness.query_by_label("classical,freeze=yaw.d,drop=12").is_some());
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("Fork").click());
    let changes: ForkChanges = "classical,freeze=yaw.d,drop=12".parse().unwrap();
    assert_eq!(pushed, [Command::Fork { run: 0, changes: changes.clone(), label: None }]);

    // The lane shows the fork's origin.
    let state = harness.state_mut();
    let parent = state.recording.runs[0].id;
    let origin = ForkOrigin { parent, step: 60, stamp_ns: 3 * SECOND_NS, changes };
    state.recording.runs[1].origin = Some(origin);
    harness.run_steps(2);
    harness.get_by_label_contains("Run classical").hover();
    harness.run_steps(8);
    assert!(harness.query_by_label_contains("fork at 3.000 s: classical,freeze=yaw.d,drop=12").is_some());
}

#[test]
fn the_dialog_rejects_what_the_command_line_rejects() {
    let mut harness = bench();
    commands_of(&mut harness, |harness| harness.get_by_label("Add run…").click());
    harness.get_by_role_and_label(Role::TextInput, "Name").focus();
    harness.run_steps(1);
    harness.get_by_role_and_label(Role::TextInput, "Name").type_text("a/b");
    harness.run_steps(2);
    assert!(harness.get_by_label("Add run").accesskit_node().is_disabled());
    let pushed = commands_of(&mut harness, |harness| harness.key_press(Key::Escape));
    assert!(pushed.is_empty());
}

#[test]
fn while_the_user_types_keys_are_letters() {
    let mut harness = bench();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    harness.run_steps(3);
    let pushed = commands_of(&mut harness, |harness| {
        harness.event(egui::Event::Text("loop".to_owned()));
        harness.key_press(Key::L);
    });
    assert!(pushed.is_empty(), "{pushed:?}");
    assert!(harness.query_by_label("Loop over the visible time range").is_some());
    assert!(harness.query_by_label("Go to start").is_some_and(|node| node.accesskit_node().role() == Role::Button));
    let pushed = commands_of(&mut harness, |harness| harness.key_press(Key::Enter));
    assert_eq!(pushed, [Command::SetLoop(Some((0, 4 * SECOND_NS)))]);
    assert!(harness.query_by_label("Loop over the visible time range").is_none(), "the palette closes");
}

#[test]
fn panels_show_names_and_values() {
    let mut harness = bench_with(PanelName::Convergence);
    let step = harness.state().recording.runs[0].step_at(3 * SECOND_NS).unwrap().clone();
    let names = harness.state().recording.rig.parameter_names();
    for parameter in &step.report.calibration.parameters {
        let name = names.name(*parameter);
        assert!(harness.query_all_by_label_contains(&format!("{name} ")).next().is_some(), "{name}");
    }
    let rank = step.rank.as_ref().unwrap();
    let headline = format!("Structural rank 18 of 18, informed rank {}", rank.rank_informed);
    assert!(harness.query_by_label_contains(&headline).is_some());
    assert!(harness.query_by_label(&format!("Frame {}", step.report.frame_index)).is_some());
    assert!(harness.query_by_label_contains("Run auto ATE").is_some());
    let position = step.report.newest().unwrap().world_from_imu.translation_m;
    let shown = crate::gui::units::fixed(position.x, 3);
    assert!(harness.query_all_by_label(&shown).next().is_some(), "position {shown}");

    harness.get_by_label_contains("Run classical").click();
    harness.run_steps(3);
    assert_eq!(harness.state().selection.run, 1);
    assert!(harness.query_by_label_contains("Structural rank 18 of 24: 6 unobservable").is_some());
    assert!(harness.query_all_by_label_contains("EC.rx ").next().is_some());
}

#[test]
fn the_palette_finds_parameters_by_their_verdict() {
    let mut harness = bench();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    harness.run_steps(2);
    harness.event(egui::Event::Text("weakly".to_owned()));
    harness.run_steps(3);
    let run = &harness.state().recording.runs[0];
    let rows = flight_table(&harness.state().recording, run);
    let first = rows.iter().find(|row| row.verdict == Determination::WeaklyDetermined).expect("a weak parameter");
    let since = format!("since {:.3} s", first.since_s().unwrap());
    let entry = format!("Parameter {}, weakly determined {since}", first.name);
    let entry = harness.get_by_label_contains(&entry).accesskit_node().label().unwrap();
    let field = |harness: &Harness<'static, Bench>| harness.get_by_role_and_label(Role::TextInput, "Command").rect();
    let before = field(&harness);
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label(&entry).click());
    assert_eq!(pushed, [Command::Seek { stamp_ns: first.since_ns.unwrap() }]);
    assert_eq!(harness.state().selection.parameter, Some(first.parameter));
    // The palette stays in its place whatever it finds.
    for typed in ["w", "qqqq"] {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
        harness.run_steps(3);
        harness.event(egui::Event::Text(typed.to_owned()));
        harness.run_steps(3);
        assert_eq!(field(&harness), before, "{typed}");
        harness.key_press(Key::Escape);
        harness.run_steps(3);
    }
}

/// The verdict of the flight stays while the cursor moves, and a click on its time moves the cursor there.
#[test]
fn the_verdict_of_the_flight_does_not_depend_on_the_cursor() {
    let mut harness = bench();
    let rows = flight_table(&harness.state().recording, &harness.state().recording.runs[0]);
    let least = least_determined(&rows).expect("some parameter is not determined").clone();
    let line = format!(
        "{} ({:.1} × required) since {:.2} s",
        least.name,
        least.of_required().unwrap(),
        least.since_s().unwrap()
    );
    for cursor_ns in [SECOND_NS, 3 * SECOND_NS, 4 * SECOND_NS] {
        harness.state_mut().cursor_ns = cursor_ns;
        harness.run_steps(3);
        let headline = flight_headline(&rows);
        assert!(harness.query_all_by_label_contains(&headline).count() > 0, "{headline} at {cursor_ns}");
        let label = harness.query_all_by_label_contains(&line).count();
        assert_eq!(label, 1, "{line} at {cursor_ns}");
    }
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label_contains(&line).click());
    assert_eq!(pushed, [Command::Seek { stamp_ns: least.since_ns.unwrap() }]);
    assert_eq!(harness.state().selection.parameter, Some(least.parameter));
}

#[test]
fn a_drag_on_the_parameters_of_the_timeline_shows_what_a_stretch_brought() {
    let mut harness = bench();
    harness.get_by_label("Parameters over time").click();
    harness.run_steps(4);
    let columns = harness.state().recording.runs[0].steps[79].report.calibration.parameters.len();
    let rows: Vec<egui::Rect> = harness
        .query_all_by_label_contains(" at the cursor")
        .map(|row| row.rect())
        .filter(|row| row.height() < 20.0)
        .collect();
    assert_eq!(rows.len(), columns);
    let timeline = harness.get_by_label("Timeline").rect();
    let (y, width) = (rows[3].center().y, timeline.width());
    let at = |fraction: f32| egui::pos2(timeline.left() + fraction * width, y);
    let pushed = commands_of(&mut harness, |_| {});
    assert!(pushed.is_empty());
    let press = |pos, pressed| egui::Event::PointerButton {
        pos,
        button: egui::PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    harness.event(egui::Event::PointerMoved(at(0.7)));
    harness.run_steps(1);
    harness.event(press(at(0.7), true));
    harness.run_steps(1);
    for fraction in [0.75, 0.85, 0.95] {
        harness.event(egui::Event::PointerMoved(at(fraction)));
        harness.run_steps(1);
    }
    harness.event(press(at(0.95), false));
    harness.run_steps(4);
    assert!(harness.query_by_label("σ before → after").is_some());
    assert!(harness.query_by_label_contains("Vehicle: path ").is_some());
    let commands = std::mem::take(&mut harness.state_mut().commands);
    assert!(commands.is_empty(), "a drag on the rows does not move the cursor: {commands:?}");
}

#[test]
fn a_parameter_is_selected_everywhere() {
    let mut harness = bench_with(PanelName::Convergence);
    let label = |harness: &Harness<'static, Bench>| {
        let mut nodes = harness.query_all_by_label_contains("roll.alpha -");
        nodes.next().and_then(|node| node.accesskit_node().label()).unwrap()
    };
    let text = label(&harness);
    harness.get_by_label(&text).click();
    harness.run_steps(3);
    assert_eq!(harness.state().selection.parameter, Some(parameter("L2.alpha")));
    assert!(harness.query_by_label("Parameter roll.alpha").is_some());
    harness.get_by_label("Clear selection").click();
    harness.run_steps(2);
    assert_eq!(harness.state().selection, Selection::default());
}

#[test]
fn the_chain_slides_from_the_rank_panel() {
    let mut harness = bench();
    assert_eq!(harness.state().selection.slide, None);
    harness.get_by_label("Animate the direction").click();
    harness.run_steps(4);
    let amount = |harness: &Harness<'static, Bench>| harness.state().selection.slide.map(|slide| slide.amount);
    let first = amount(&harness).expect("it slides");
    harness.run_steps(3);
    assert_ne!(amount(&harness), Some(first), "it goes on");
    harness.get_by_label("Pause the animation").click();
    harness.run_steps(2);
    let before = amount(&harness);
    harness.run_steps(2);
    assert_eq!(amount(&harness), before);
    let names = harness.state().recording.rig.parameter_names();
    // Along a known unobservable direction the reprojections do not change; along a single parameter they do.
    harness.state_mut().selection.run = 1;
    for (position, said) in [("base-d=1", "Reprojections unchanged"), ("roll.alpha=1", "Reprojections changed")] {
        harness.state_mut().selection.slide = position.parse::<SlideRequest>().unwrap().position(&names);
        harness.run_steps(2);
        assert!(harness.query_by_label_contains(said).is_some(), "{position}");
    }
    let chosen = |text: &str| harness.get_all_by_role(Role::ComboBox).any(|node| node.value().as_deref() == Some(text));
    assert!(chosen("roll.alpha only"));
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    assert_eq!(harness.state().selection.slide, None);
    // The bar of the answer names the moved chain whatever panels are open, and moves it back.
    assert!(harness.query_by_label("Chain moved: reset").is_none());
    harness.get_by_label("Animate the direction").click();
    harness.run_steps(4);
    harness.get_by_label("Chain moved: reset").click();
    harness.run_steps(4);
    assert_eq!(harness.state().selection.slide, None, "the animation ends, too");
}

#[test]
fn warnings_are_listed_and_lead_to_their_time() {
    let mut harness = bench();
    harness.get_by_label("⚠ 1 warning").click();
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("no IMU sample for 0.034 s").is_some());
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("6.000 s").click());
    assert_eq!(pushed, [Command::Seek { stamp_ns: 6 * SECOND_NS }]);
    let warning = RunWarning {
        warning: StepWarning {
            factor: FactorKind::Encoder,
            inconsistency: "Joint angles inconsistent",
            mean_square: 1.9,
            limit: 1.6,
            averaged_s: 4.0,
            cause: "check noise densities".to_owned(),
        },
        first_ns: 4 * SECOND_NS,
        last_ns: 8 * SECOND_NS,
        steps: 80,
    };
    harness.state_mut().recording.runs[1].warnings.push(warning);
    harness.run_steps(2);
    assert!(harness.query_by_label("⚠ 2 warnings").is_some());
    assert!(harness.query_by_label("classical: Joint angles inconsistent (χ²/dof 1.90 > 1.60 over 4 s): check noise densities (80 steps, 4.000–8.000 s)").is_some());
    let pushed = commands_of(&mut harness, |harness| harness.get_by_label("4.000 s").click());
    assert_eq!(pushed, [Command::Seek { stamp_ns: 4 * SECOND_NS }]);
}

#[test]
fn a_run_that_stopped_is_reported() {
    let mut harness = bench();
    harness.state_mut().recording.runs[1].error = Some("the log ends in a damaged chunk".to_owned());
    harness.run_steps(2);
    assert!(harness.query_by_label("✖ Run classical stopped: the log ends in a damaged chunk").is_some());
}

#[test]
fn panels_can_be_hidden_and_brought_back() {
    let mut harness = bench();
    let toggle = |harness: &mut Harness<'static, Bench>| {
        harness.get_by_label("Panels").click();
        harness.run_steps(2);
        harness.get_by_role_and_label(Role::CheckBox, "Inspector").click();
        harness.run_steps(2);
        harness.key_press(Key::Escape);
        harness.run_steps(2);
    };
    toggle(&mut harness);
    assert!(harness.query_by_label("Frame 60").is_none());
    toggle(&mut harness);
    assert!(harness.query_by_label("Frame 60").is_some());
}

#[test]
fn every_panel_explains_itself_and_leads_to_its_section() {
    let mut harness = bench();
    for panel in [PanelName::Rank, PanelName::Timeline, PanelName::Image] {
        harness.get_by_label(&format!("What is this? {}", panel.title())).click();
        harness.run_steps(3);
        harness.get_by_label(&format!("Open manual: {}", panel.title())).click();
        harness.run_steps(6);
        assert!(harness.state().window.help.manual.is_open(), "{panel:?}");
        let heading = harness.query_all_by_label(panel.title()).any(|node| node.accesskit_node().role() == Role::Label);
        assert!(heading, "{panel:?}");
        harness.key_press(Key::Escape);
        harness.run_steps(3);
        assert!(!harness.state().window.help.manual.is_open(), "Escape closes the manual");
    }
    harness.state_mut().window.tiles.focus = Some(PanelName::Scene);
    harness.key_press(Key::F1);
    harness.run_steps(3);
    assert!(harness.query_by_label("Open manual: Scene").is_some());
    harness.key_press(Key::Enter);
    harness.run_steps(3);
    assert!(harness.state().window.help.manual.is_open(), "the popup of a key has the focus");
}

#[test]
fn a_question_mark_shows_every_shortcut() {
    let mut harness = bench();
    harness.key_press(Key::Questionmark);
    harness.run_steps(3);
    for entry in super::actions::TABLE {
        assert!(harness.query_all_by_label(entry.name).next().is_some(), "{}", entry.name);
        assert!(harness.query_all_by_label(entry.keys).next().is_some(), "{}", entry.keys);
    }
}

#[test]
fn every_sign_has_a_glyph() {
    // A missing glyph panics here; in the window it would be an empty box.
    let mut harness =
        Harness::builder().with_context_setup(|ctx| Theme::of(ThemeName::Dark).apply(ctx)).build_ui(|ui| {
            ui.label("°±²·×αβθλρσχΔ₀–—…→∂≤≥ℹ−■▶◀☀⚑⚠✔✖⏩⏪⏭⏮⏸📁🔁");
            ui.monospace("→ °±×σχ–");
        });
    harness.run();
    assert!(harness.query_by_label("→ °±×σχ–").is_some());
}
