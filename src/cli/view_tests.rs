//! Test of the window from the first start to a restored session, by keys and clicks on the sample log: open, step, trace
//! a parameter to a feature and back, compare, export, close, restore.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use dcvins::desktop::Machine;
use dcvins::gui::app::{App, OpenLog};
use dcvins::gui::theme::ThemeName;
use dcvins::session::Recording;
use egui::{Event, Key, Modifiers, Role, ViewportCommand, ViewportEvent, ViewportId};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use super::estimation_arguments::EstimationArguments;
use super::open_log::open_log;

type Window = Harness<'static, App>;

/// The window of the program on a machine whose files are in one folder.
fn window(folder: &Path) -> Window {
    let open: OpenLog =
        Arc::new(|request, progress| open_log(request, &EstimationArguments::default(), None, progress));
    let app = App::new(open, Arc::new(Machine::in_folder(folder)), ThemeName::Light);
    let mut harness =
        Harness::builder().with_size([1920.0, 1080.0]).build_ui_state(|ui, app: &mut App| app.ui(ui), app);
    harness.run_steps(2);
    harness
}

fn run_until(harness: &mut Window, what: &str, holds: impl Fn(&Window) -> bool) {
    for _ in 0..20_000 {
        harness.run_steps(1);
        if holds(harness) {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    panic!("it never happened: {what}");
}

fn recording(harness: &Window) -> Option<Arc<Recording>> {
    harness.state().log().map(|log| log.recording())
}

fn cursor_ns(harness: &Window) -> i64 {
    harness.state().log().unwrap().cursor_ns()
}

fn is_computed(harness: &Window, runs: usize) -> bool {
    recording(harness).is_some_and(|recording| {
        recording.runs.len() == runs && recording.runs.iter().all(|run| run.finished) && !recording.is_being_checked
    })
}

/// Clicks the first button whose name begins with a text; returns its name.
fn click(harness: &mut Window, begin: &str) -> String {
    let name = {
        let mut buttons = harness.query_all_by_role(Role::Button);
        let name = |label: Option<String>| label.filter(|label| label.starts_with(begin));
        let found = buttons.find_map(|node| Some((name(node.accesskit_node().label())?, node)));
        let (name, button) = found.unwrap_or_else(|| panic!("no button {begin}"));
        button.click();
        name
    };
    harness.run_steps(4);
    name
}

/// Exported files with their contents.
fn exported(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let files = fs::read_dir(folder.join("output/garden")).unwrap().map(|entry| entry.unwrap().path());
    let files = files.filter(|path| path.extension().is_some_and(|ending| ending != "json"));
    files.map(|path| (path.clone(), fs::read(&path).unwrap())).collect()
}

/// Closes the window; true if it stays open with a question.
fn close(harness: &mut Window) -> bool {
    let viewports = &mut harness.input_mut().viewports;
    viewports.get_mut(&ViewportId::ROOT).unwrap().events.push(ViewportEvent::Close);
    harness.step();
    let commands = &harness.output().viewport_output[&ViewportId::ROOT].commands;
    let asks = commands.contains(&ViewportCommand::CancelClose);
    harness.run_steps(3);
    asks
}

#[test]
fn a_log_is_opened_stepped_traced_compared_exported_closed_and_restored() {
    let folder = tempfile::tempdir().unwrap();
    let log = Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
    let mut harness = window(folder.path());

    // Open: the path is typed into the field of the first page.
    harness.get_by_role_and_label(Role::TextInput, "Path of the log").click();
    harness.run_steps(2);
    harness.event(Event::Text(log.display().to_string()));
    harness.run_steps(2);
    harness.key_press(Key::Enter);
    run_until(&mut harness, "the run is computed", |harness| is_computed(harness, 1));

    // Step: forth and back between the last two images.
    harness.run_steps(3);
    let last_ns = cursor_ns(&harness);
    harness.key_press(Key::ArrowLeft);
    harness.run_steps(3);
    let before_ns = cursor_ns(&harness);
    assert!((1..100_000_000).contains(&(last_ns - before_ns)), "{before_ns} to {last_ns}");
    harness.key_press(Key::ArrowRight);
    harness.run_steps(3);
    assert_eq!(cursor_ns(&harness), last_ns);

    // Trace: a parameter, the feature that depends most on it, and the parameters of that feature.
    let row = click(&mut harness, "yaw.alpha ");
    assert!(row.contains("determined"), "{row}");
    run_until(&mut harness, "the parameter is shown", |harness| {
        harness.query_by_label("Parameter yaw.alpha").is_some()
    });
    let link = click(&mut harness, "feature ");
    let id = link.split(' ').nth(1).unwrap();
    assert!(harness.query_by_label(&format!("Feature {id}")).is_some(), "{link}");
    assert!(
        harness
            .query_all_by_role(Role::Button)
            .any(|node| { node.accesskit_node().label().is_some_and(|label| label.starts_with("yaw.alpha (")) })
    );

    // Compare with a second run, which keeps its place and colour.
    harness.key_press(Key::Num5);
    harness.run_steps(4);
    click(&mut harness, "Add run classical");
    run_until(&mut harness, "both runs are computed", |harness| is_computed(harness, 2));
    run_until(&mut harness, "both runs are compared", |harness| {
        harness.query_by_label("Show run classical in all panels").is_some()
    });

    // Export what is shown, without the selection, which a session does not keep.
    harness.key_press(Key::Escape);
    harness.run_steps(3);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::E);
    run_until(&mut harness, "the panel is written", |_| {
        folder.path().join("output/garden").is_dir() && exported(folder.path()).len() == 3
    });
    let first = exported(folder.path());
    assert!(first.values().all(|content| content.len() > 200), "{:?}", first.keys());

    // Close: a marker would be lost, so the window asks; then it closes.
    harness.key_press(Key::M);
    harness.run_steps(3);
    let labels = |harness: &Window| -> Vec<String> {
        recording(harness).unwrap().runs.iter().map(|run| run.spec.label.clone()).collect()
    };
    let markers = |harness: &Window| harness.state().log().unwrap().playback().markers.to_vec();
    let before = (labels(&harness), cursor_ns(&harness), markers(&harness));
    assert_eq!((before.0.as_slice(), before.2.len()), (["auto", "classical"].map(str::to_owned).as_slice(), 1));
    assert!(close(&mut harness), "the window asks");
    click(&mut harness, "Save");
    assert!(!close(&mut harness), "the session is saved");
    drop(harness);
    for path in first.keys() {
        fs::remove_file(path).unwrap();
    }

    // Restore: the session is the first of the recent files, with its runs, place, layout and figures.
    let mut harness = window(folder.path());
    click(&mut harness, "Open garden.session.json");
    run_until(&mut harness, "the session is computed", |harness| is_computed(harness, 2));
    run_until(&mut harness, "the comparison is restored", |harness| {
        harness.query_by_label("Show run classical in all panels").is_some()
    });
    harness.run_steps(3);
    assert_eq!((labels(&harness), cursor_ns(&harness), markers(&harness)), before);
    click(&mut harness, "Show run auto in all panels");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::E);
    run_until(&mut harness, "the panel is written again", |_| exported(folder.path()).len() == 3);
    for ((path, before), after) in first.iter().zip(exported(folder.path()).values()) {
        assert!(before == after, "{} differs in the restored session", path.display());
    }
}
