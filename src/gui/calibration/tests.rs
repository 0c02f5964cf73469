use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::CalibrationPanel;
use crate::gui::samples::{sample_images, sample_recording, sensor_recording};
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{Panel as _, PanelContext, Playback, Presentation, Selection};
use crate::observability::Determination;
use crate::session::{Command, FlightParameter, Recording, flight_table, least_determined};

struct Shown {
    panel: CalibrationPanel,
    recording: Recording,
    cursor_ns: i64,
    selection: Selection,
    commands: Vec<Command>,
}

fn bench(recording: Recording, size: [f32; 2]) -> Harness<'static, Shown> {
    let (panel, selection) = (CalibrationPanel::default(), Selection::default());
    let cursor_ns = recording.last_stamp_ns();
    let shown = Shown { panel, recording, cursor_ns, selection, commands: Vec::new() };
    let mut harness = Harness::builder().with_size(size).build_ui_state(show, shown);
    harness.run_steps(2);
    harness
}

fn show(ui: &mut egui::Ui, shown: &mut Shown) {
    let theme = Theme::of(ThemeName::Dark);
    theme.apply(ui.ctx());
    let mut context = PanelContext {
        recording: &shown.recording,
        cursor_ns: shown.cursor_ns,
        playback: &Playback::default(),
        images: &mut sample_images(),
        selection: &mut shown.selection,
        theme: &theme,
        presentation: Presentation::Interactive,
        commands: &mut shown.commands,
    };
    shown.panel.ui(ui, &mut context);
}

/// Tops of the rows by name, from top to bottom.
fn order(harness: &Harness<'static, Shown>, rows: &[FlightParameter]) -> Vec<String> {
    let mut places: Vec<(f32, String)> = rows
        .iter()
        .filter_map(|row| {
            let text = format!("{} {}", row.name, row.verdict_text());
            let top = harness.query_all_by_label_contains(&text).map(|node| node.rect().top()).next();
            top.map(|top| (top, row.name.clone()))
        })
        .collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    places.into_iter().map(|(_, name)| name).collect()
}

#[test]
fn the_worst_parameter_is_on_top_and_a_click_goes_to_its_time() {
    let recording = sample_recording();
    let rows = flight_table(&recording, &recording.runs[0]);
    let worst = least_determined(&rows).expect("some parameter is not determined").clone();
    let mut harness = bench(recording, [1366.0, 900.0]);
    assert_eq!(order(&harness, &rows).first(), Some(&worst.name));
    harness.get_by_label_contains(&format!("{} {}", worst.name, worst.verdict_text())).click();
    harness.run_steps(2);
    assert_eq!(harness.state().selection.parameter, Some(worst.parameter));
    let since = Command::Seek { stamp_ns: worst.since_ns.unwrap() };
    assert_eq!(harness.state().commands, [since]);
    // The verdicts of the flight do not depend on the cursor.
    let before = order(&harness, &rows);
    harness.state_mut().cursor_ns /= 2;
    harness.run_steps(2);
    assert_eq!(order(&harness, &rows), before);
}

#[test]
fn rows_are_sorted_and_filtered() {
    let recording = sensor_recording();
    let rows = flight_table(&recording, &recording.runs[0]);
    let mut harness = bench(recording, [1366.0, 2000.0]);
    assert_eq!(order(&harness, &rows).len(), rows.len());
    harness.get_by_label("Sort by σ / prior").click();
    harness.run_steps(2);
    let sorted = order(&harness, &rows);
    let ratio = |name: &String| rows.iter().find(|row| row.name == *name).unwrap().ratio.unwrap();
    assert!(sorted.is_sorted_by(|a, b| ratio(a) >= ratio(b)), "{sorted:?}");
    harness.get_by_label("Sort by σ / prior").click();
    harness.run_steps(2);
    assert_eq!(order(&harness, &rows).first(), sorted.last());

    harness.state_mut().panel.filter = "Weakly".to_owned();
    harness.run_steps(2);
    let weak = rows.iter().filter(|row| row.verdict == Determination::WeaklyDetermined).count();
    let shown = order(&harness, &rows);
    assert!(weak > 0 && shown.len() < rows.len() && shown.len() >= weak, "{shown:?}");
    harness.state_mut().panel.filter = "no such text".to_owned();
    harness.run_steps(2);
    assert!(harness.query_by_label("No parameter contains this text").is_some());
}

#[test]
fn a_required_accuracy_is_compared_when_its_field_is_left() {
    let mut harness = bench(sample_recording(), [1366.0, 900.0]);
    let field = "Required accuracy of lengths: σ with which they are known well enough";
    harness.get_by_label(field).focus();
    harness.run_steps(2);
    harness.key_press(egui::Key::ArrowUp);
    harness.run_steps(2);
    assert_eq!(harness.state().commands, [], "not before the field is left");
    harness.key_press(egui::Key::Tab);
    harness.run_steps(2);
    let [Command::RequireAccuracy(required)] = &harness.state().commands[..] else {
        panic!("{:?}", harness.state().commands)
    };
    let before = harness.state().recording.rig.required_accuracy.clone();
    assert!(required.translation_m > before.translation_m && required.translation_m < 2.0 * before.translation_m);
    assert_eq!(required.rotation_rad, before.rotation_rad);
    // The verdicts follow.
    let met = |recording: &Recording| {
        flight_table(recording, &recording.runs[0]).iter().filter(|row| row.verdict.is_met()).count()
    };
    let mut recording = harness.state().recording.clone();
    let with_default = met(&recording);
    std::sync::Arc::make_mut(&mut recording.rig).required_accuracy.translation_m = 10.0;
    std::sync::Arc::make_mut(&mut recording.rig).required_accuracy.rotation_rad = 10.0;
    assert!(met(&recording) > with_default, "{with_default}");
}
