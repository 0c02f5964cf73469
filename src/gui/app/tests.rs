//! Tests of the application with a log that needs no files and no threads.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, OnceLock};

use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::{App, OpenFailure, OpenLog, OpenedLog, PlayingLog};
use crate::gui::desktop::{Desktop, FigureExport, PanelExport, PathEntry, SampleProgress};
use crate::gui::laboratory::MotionRequest;
use crate::gui::samples::{FRAME_PERIOD_NS, first_tracked_frame, sample_images, sample_recording_of};
use crate::gui::theme::ThemeName;
use crate::gui::window::WindowRequest;
use crate::gui::{ImageSource as _, Playback};
use crate::session::{Command, FrameImage, Recording, Wake};
use crate::simulation::{MotionSplines, PrescribedMotion};

/// A log with finished results.
pub(super) struct SampleLog {
    recording: Arc<Recording>,
    cursor_ns: i64,
    playback: Playback,
}

impl SampleLog {
    /// Places the cursor before the first frame, as in a log whose images start after its first message.
    pub(super) fn new(path: &Path) -> Self {
        static SAMPLE: OnceLock<Recording> = OnceLock::new();
        let sample = SAMPLE.get_or_init(|| sample_recording_of(70, &["auto", "classical"]));
        let recording = Arc::new(Recording { log_path: path.to_path_buf(), ..sample.clone() });
        Self { recording, cursor_ns: -5, playback: Playback::default() }
    }
}

impl PlayingLog for SampleLog {
    fn recording(&self) -> Arc<Recording> {
        Arc::clone(&self.recording)
    }

    fn generation(&self) -> u64 {
        1
    }

    fn wake_with(&mut self, _: Wake) {}

    fn cursor_ns(&self) -> i64 {
        self.cursor_ns
    }

    fn playback(&self) -> Playback {
        self.playback.clone()
    }

    fn apply(&mut self, command: Command) {
        match command {
            Command::TogglePlay => self.playback.playing = !self.playback.playing,
            Command::Seek { stamp_ns } => self.cursor_ns = stamp_ns,
            Command::StepFrames(count) => self.cursor_ns += count * FRAME_PERIOD_NS,
            Command::GoToStart => self.cursor_ns = 0,
            Command::GoToEnd => self.cursor_ns = self.recording.duration_ns,
            Command::ToggleMarker => self.playback.markers = self.playback.markers.toggled(self.cursor_ns),
            Command::SetMarkers(markers) => self.playback.markers = markers,
            _ => {}
        }
    }

    fn advance(&mut self, elapsed_s: f64) {
        if self.playback.playing {
            self.cursor_ns += (elapsed_s * 1e9) as i64;
        }
    }

    fn settle_shortly(&mut self) {}

    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage {
        sample_images().image(camera_key, frame_index)
    }

    fn take_notices(&mut self) -> Vec<String> {
        Vec::new()
    }

    fn saved(&self, layout: Option<serde_json::Value>) -> Option<String> {
        Some(serde_json::json!({ "layout": layout, "markers": self.playback.markers.to_vec() }).to_string())
    }

    fn restores_cursor(&self) -> bool {
        false
    }

    fn layout(&self) -> Option<&serde_json::Value> {
        None
    }
}

/// A machine with a sample log, or with one that it simulates.
#[derive(Default)]
pub(super) struct TestDesktop {
    stands_alone: bool,
    remembered: Mutex<Vec<PathBuf>>,
    layouts: Mutex<Option<String>>,
    written: Mutex<Vec<PanelExport>>,
    pub(super) sessions: Mutex<Vec<String>>,
    settings: Mutex<Option<String>>,
    pub(super) window: Mutex<Option<String>>,
    /// Result of the desktop's file dialog; `None` without such a dialog.
    picked: Mutex<Option<Receiver<Vec<PathBuf>>>>,
    /// Rigs that were written, with their texts.
    pub(super) rigs: Mutex<Vec<(PathBuf, String)>>,
    /// Motions that were written, with their paths.
    pub(super) motions: Mutex<Vec<(PathBuf, PrescribedMotion)>>,
}

impl Desktop for TestDesktop {
    fn complete(&self, typed: &str) -> Vec<PathEntry> {
        let entry = |path: &str, folder| PathEntry { path: path.to_owned(), folder };
        let all = [entry("/logs/", true), entry("/logs/city.mcap", false), entry("/logs/city-2.mcap", false)];
        let depth = |path: &str| path.trim_end_matches('/').matches('/').count();
        all.into_iter()
            .filter(|it| it.path.starts_with(typed) && depth(&it.path) == typed.matches('/').count())
            .collect()
    }

    fn pick_log(&self) -> Option<Receiver<Vec<PathBuf>>> {
        self.picked.lock().unwrap().take()
    }

    fn recent_logs(&self) -> Vec<PathBuf> {
        vec![PathBuf::from("/somewhere/house.mcap")]
    }

    fn remember_log(&self, path: &Path) {
        self.remembered.lock().unwrap().push(path.to_path_buf());
    }

    fn sample_logs(&self) -> Vec<PathBuf> {
        if self.stands_alone { Vec::new() } else { vec![PathBuf::from("/samples/yard.mcap")] }
    }

    fn sample_folder(&self) -> &Path {
        Path::new("/home/samples")
    }

    fn make_sample(&self) -> Result<Receiver<SampleProgress>, String> {
        let (sender, receiver) = channel();
        let images = SampleProgress::Images { done: 3, total: 8 };
        for news in [images, SampleProgress::Done(Ok(PathBuf::from("/home/samples/garden.mcap")))] {
            sender.send(news).map_err(|error| error.to_string())?;
        }
        Ok(receiver)
    }

    fn kept_layouts(&self) -> Option<String> {
        self.layouts.lock().unwrap().clone()
    }

    fn keep_layouts(&self, text: &str) -> Result<(), String> {
        *self.layouts.lock().unwrap() = Some(text.to_owned());
        Ok(())
    }

    fn kept_settings(&self) -> Option<String> {
        self.settings.lock().unwrap().clone()
    }

    fn keep_settings(&self, text: &str) -> Result<(), String> {
        *self.settings.lock().unwrap() = Some(text.to_owned());
        Ok(())
    }

    fn kept_window(&self) -> Option<String> {
        self.window.lock().unwrap().clone()
    }

    fn keep_window(&self, text: &str) -> Result<(), String> {
        *self.window.lock().unwrap() = Some(text.to_owned());
        Ok(())
    }

    fn write_panel(&self, export: &PanelExport) -> Result<Vec<PathBuf>, String> {
        self.written.lock().unwrap().push(export.clone());
        Ok(vec![PathBuf::from(format!("/out/{}.png", export.name))])
    }

    fn write_figure(&self, export: &FigureExport) -> Result<PathBuf, String> {
        Ok(PathBuf::from(&export.path))
    }

    fn start_report(&self, name: &str, _arguments: &[String]) -> Result<Receiver<Result<PathBuf, String>>, String> {
        Err(format!("no report on {name}"))
    }

    fn write_session(&self, name: &str, text: &str) -> Result<PathBuf, String> {
        self.sessions.lock().unwrap().push(text.to_owned());
        Ok(PathBuf::from(format!("/out/{name}.session.json")))
    }

    fn write_rig(&self, path: &Path, text: &str) -> Result<PathBuf, String> {
        self.rigs.lock().unwrap().push((path.to_path_buf(), text.to_owned()));
        Ok(path.to_path_buf())
    }

    fn write_motion(&self, path: &Path, motion: &MotionSplines, joint_names: &[String]) -> Result<PathBuf, String> {
        let steps = (2.0 * motion.duration_s()).round().max(1.0) as usize;
        let times_s = (0..=steps).map(|step| motion.duration_s() * step as f64 / steps as f64);
        let samples = times_s.map(|time_s| motion.sample(time_s)).collect();
        let motion = PrescribedMotion { joint_names: joint_names.to_vec(), samples };
        self.motions.lock().unwrap().push((path.to_path_buf(), motion));
        Ok(path.to_path_buf())
    }

    fn read_motion(&self, path: &Path) -> Result<PrescribedMotion, String> {
        let motions = self.motions.lock().unwrap();
        let found = motions.iter().find(|(known, _)| known == path).map(|(_, motion)| motion.clone());
        found.ok_or_else(|| format!("no motion in {}", path.display()))
    }

    fn resident_bytes(&self) -> Option<u64> {
        Some(300 << 20)
    }
}

#[derive(Debug)]
pub(super) struct Dropped(pub(super) PathBuf);

impl egui::DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        Err("not needed".to_owned())
    }
}

/// The sample log under a path.
pub(super) fn opened_log(path: &Path) -> OpenedLog {
    OpenedLog { log: Box::new(SampleLog::new(path)), remembered: path.to_path_buf(), notices: Vec::new() }
}

/// Opens the sample log under the first path of a request.
pub(super) fn sample_opener() -> OpenLog {
    Arc::new(|request, _| Ok(opened_log(&request.sources[0])))
}

pub(super) fn app() -> (Harness<'static, App>, Arc<TestDesktop>) {
    let open: OpenLog = Arc::new(|request, _| {
        let path = request.sources.first().expect("there is a path");
        if path.extension().is_some_and(|extension| extension == "mcap") {
            Ok(opened_log(path))
        } else {
            let text = format!("this is not an MCAP file: it begins with 'hello' ({})", path.display());
            Err(OpenFailure::Problem(text))
        }
    });
    let desktop = Arc::new(TestDesktop::default());
    let app = App::new(open, Arc::clone(&desktop) as Arc<dyn Desktop>, ThemeName::Dark);
    let mut harness = Harness::builder().with_size([1400.0, 850.0]).build_ui_state(|ui, app: &mut App| app.ui(ui), app);
    harness.run_steps(2);
    (harness, desktop)
}

/// Runs frames until the condition is true; logs are opened on another thread.
#[track_caller]
pub(super) fn run_until(harness: &mut Harness<'static, App>, holds: impl Fn(&Harness<'static, App>) -> bool) {
    for _ in 0..10_000 {
        harness.run_steps(1);
        if holds(harness) {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    panic!("it never happened");
}

pub(super) fn opened(harness: &Harness<'static, App>) -> Option<PathBuf> {
    harness.state().log().map(|log| log.recording().log_path.clone())
}

#[test]
fn the_welcome_view_offers_logs_and_opens_them() {
    let (mut harness, desktop) = app();
    assert!(harness.query_by_label("Sample logs").is_some() && harness.query_by_label("Recent logs").is_some());
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    assert_eq!(opened(&harness), Some(PathBuf::from("/samples/yard.mcap")));
    assert_eq!(*desktop.remembered.lock().unwrap(), [PathBuf::from("/samples/yard.mcap")]);
    assert!(harness.query_by_label("Play").is_some());
    let first = format!("Frame {}", first_tracked_frame());
    assert!(harness.query_by_label(&first).is_some(), "the cursor goes to the first frame with an estimate");
    assert!(harness.query_by_label("300 MiB").is_some(), "the status bar shows the memory");
}

#[test]
fn a_program_that_stands_alone_simulates_its_sample_and_begins_the_tour() {
    let open: OpenLog = sample_opener();
    let desktop = Arc::new(TestDesktop { stands_alone: true, ..TestDesktop::default() });
    let app = App::new(open, desktop, ThemeName::Dark);
    let mut harness = Harness::builder().with_size([1400.0, 850.0]).build_ui_state(|ui, app: &mut App| app.ui(ui), app);
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("24 MB in /home/samples").is_some());
    harness.get_by_label("Tutorial").click();
    harness.run_steps(4);
    assert!(harness.query_by_label("1. Is the log sound?").is_some(), "documents open without a log");
    harness.key_press(Key::Escape);
    harness.run_steps(2);
    harness.get_by_label("Take the tour").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    assert_eq!(opened(&harness), Some(PathBuf::from("/home/samples/garden.mcap")));
    run_until(&mut harness, |harness| harness.query_by_label_contains("1 of 6: ").is_some());
}

#[test]
fn a_dropped_log_is_opened_and_a_wrong_file_reported() {
    let (mut harness, _) = app();
    harness.input_mut().dropped_files.push(Arc::new(Dropped(PathBuf::from("/x/notes.txt"))));
    run_until(&mut harness, |harness| harness.query_by_label_contains("this is not an MCAP file").is_some());
    assert!(opened(&harness).is_none());
    harness.get_by_label("Dismiss notice").click();
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("this is not an MCAP file").is_none());
    harness.input_mut().dropped_files.push(Arc::new(Dropped(PathBuf::from("/x/a.mcap"))));
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.input_mut().dropped_files.push(Arc::new(Dropped(PathBuf::from("/x/b.mcap"))));
    harness.run_steps(3);
    assert!(harness.query_by_label("b.mcap, instead of a.mcap").is_some());
    harness.get_by_label("Keep").click();
    harness.run_steps(3);
    assert_eq!(opened(&harness), Some(PathBuf::from("/x/a.mcap")), "nothing is replaced without an answer");
    harness.input_mut().dropped_files.push(Arc::new(Dropped(PathBuf::from("/x/b.mcap"))));
    harness.run_steps(3);
    harness.get_by_role_and_label(egui::Role::Button, "Open").click();
    run_until(&mut harness, |harness| opened(harness) == Some(PathBuf::from("/x/b.mcap")));
}

/// A window with a log and an open file dialog of the desktop; the sender gives the result of the dialog.
fn with_file_dialog() -> (Harness<'static, App>, Sender<Vec<PathBuf>>) {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    let (sender, receiver) = channel();
    *desktop.picked.lock().unwrap() = Some(receiver);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    harness.run_steps(3);
    (harness, sender)
}

#[test]
fn the_file_dialog_of_the_desktop_opens_a_log() {
    let (mut harness, sender) = with_file_dialog();
    sender.send(vec![PathBuf::from("/logs/city.mcap")]).unwrap();
    run_until(&mut harness, |harness| opened(harness) == Some(PathBuf::from("/logs/city.mcap")));
    assert!(harness.query_by_label("Path of the log").is_none(), "the path field closes with it");
}

#[test]
fn the_path_field_stays_where_the_desktop_has_no_file_dialog() {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    *desktop.picked.lock().unwrap() = Some(channel().1);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    harness.run_steps(5);
    assert!(harness.query_by_label("Path of the log").is_some());
}

#[test]
fn cancelling_the_file_dialog_closes_the_path_field_unless_it_is_in_use() {
    for (typed, stays_open) in [("", false), ("/lo", true)] {
        let (mut harness, sender) = with_file_dialog();
        if !typed.is_empty() {
            harness.event(egui::Event::Text(typed.to_owned()));
        }
        harness.run_steps(20);
        assert!(harness.query_by_label("Path of the log").is_some(), "both are open");
        sender.send(Vec::new()).unwrap();
        harness.run_steps(3);
        assert_eq!(harness.query_by_label("Path of the log").is_some(), stays_open, "{typed:?}");
    }
}

#[test]
fn the_open_dialog_completes_paths() {
    let (mut harness, _) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    harness.run_steps(3);
    harness.event(egui::Event::Text("/lo".to_owned()));
    harness.run_steps(3);
    harness.key_press(Key::Tab);
    harness.run_steps(3);
    assert!(harness.query_by_label("/logs/city.mcap").is_some(), "Tab fills in the folder and lists it");
    harness.key_press(Key::Tab);
    harness.run_steps(3);
    assert!(harness.query_all_by_value("/logs/city").next().is_some(), "Tab fills in what is common");
    harness.key_press(Key::ArrowDown);
    harness.run_steps(2);
    harness.key_press(Key::Enter);
    run_until(&mut harness, |harness| opened(harness) == Some(PathBuf::from("/logs/city.mcap")));
    assert!(harness.query_by_label("/logs/city.mcap").is_none(), "the dialog closes");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    harness.run_steps(3);
    harness.event(egui::Event::Text("/x/b.mcap".to_owned()));
    harness.run_steps(3);
    assert!(harness.query_all_by_value("/x/b.mcap").next().is_some(), "typing replaces the path of the last time");
}

#[test]
fn commands_reach_the_log_and_playing_moves_the_cursor() {
    let (mut harness, _) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    let cursor = |harness: &Harness<'static, App>| harness.state().log().unwrap().cursor_ns();
    let opened_at = cursor(&harness);
    harness.key_press(Key::ArrowRight);
    harness.run_steps(2);
    assert_eq!(cursor(&harness), opened_at + FRAME_PERIOD_NS);
    harness.key_press(Key::Space);
    harness.run_steps(10);
    assert!(cursor(&harness) > opened_at + FRAME_PERIOD_NS);
    harness.get_by_label("Pause").click();
    harness.run_steps(2);
    let before = cursor(&harness);
    harness.run_steps(5);
    assert_eq!(cursor(&harness), before);
}

#[test]
fn a_motion_is_written_and_opened_with_a_notice() {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    let path = PathBuf::from("/out/motion.csv");
    let motion = MotionSplines::at_rest(&[0.1, 0.2, 0.3], 8.0, 16);
    let joint_names = harness.state().log().unwrap().recording().rig.joint_names();
    for (request, words) in [
        (MotionRequest::Read { path: path.clone() }, "no motion in /out/motion.csv"),
        (MotionRequest::Write { path: path.clone(), motion, joint_names }, "Motion saved:"),
        (MotionRequest::Read { path }, "Motion opened:"),
    ] {
        harness.state_mut().state.requests.push(WindowRequest::Motion(request));
        harness.run_steps(3);
        assert!(harness.query_by_label_contains(words).is_some(), "{words}");
    }
    assert_eq!(desktop.motions.lock().unwrap().len(), 1);
}

#[test]
fn the_panel_clicked_last_is_written_as_screenshot_and_table() {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.key_press(Key::End);
    harness.run_steps(2);
    let written = |harness: &mut Harness<'static, App>| {
        harness.key_press_modifiers(Modifiers::COMMAND, Key::E);
        harness.run_steps(3);
        desktop.written.lock().unwrap().last().cloned().unwrap()
    };
    let image = written(&mut harness);
    assert!(image.name.starts_with("yard/image-"), "{}", image.name);
    assert!(image.table.starts_with("id,age_frames,u_px") && image.table.lines().count() > 60, "{}", image.table);
    assert!(harness.query_by_label_contains("/out/yard/image-").is_some(), "it shows the path");

    for _ in 0..harness.query_all_by_label("Dismiss notice").count() {
        harness.query_all_by_label("Dismiss notice").next().unwrap().click();
        harness.run_steps(2);
    }
    let verdict = harness.get_by_label_contains("Structural rank 18 of 18").rect().center();
    harness.event(egui::Event::PointerMoved(verdict));
    for pressed in [true, false] {
        let (button, modifiers) = (egui::PointerButton::Primary, Modifiers::NONE);
        harness.event(egui::Event::PointerButton { pos: verdict, button, pressed, modifiers });
    }
    harness.run_steps(2);
    let rank = written(&mut harness);
    assert!(rank.name.starts_with("yard/rank-"), "{}", rank.name);
    assert_eq!(rank.table.lines().count(), 19, "a line for each singular value: {}", rank.table);
    assert!(rank.table.lines().all(|line| line.matches(',').count() == 21), "{}", rank.table);
    assert!(rank.screenshot != image.screenshot && rank.screenshot.width() > 400);
}

#[test]
fn a_layout_is_kept_for_the_next_start() {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.key_press(Key::Num4);
    harness.get_by_label("Panels").click();
    harness.run_steps(2);
    let name = || egui::Role::TextInput;
    harness.get_by_role_and_label(name(), "Layout name").focus();
    harness.run_steps(1);
    harness.get_by_role_and_label(name(), "Layout name").type_text("flight");
    harness.run_steps(2);
    harness.get_by_label("Save layout").click();
    harness.run_steps(2);
    assert!(harness.query_by_label("Layout flight").is_some());
    let kept = desktop.layouts.lock().unwrap().clone().unwrap();
    assert!(kept.contains("flight"), "{kept}");
    harness.get_by_label("Delete layout flight").click();
    harness.run_steps(2);
    assert_eq!(desktop.layouts.lock().unwrap().as_deref(), Some("{}"));
}

#[test]
fn the_session_is_saved_at_a_key_with_its_layout() {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.key_press_modifiers(Modifiers::COMMAND, Key::S);
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("/out/yard.session.json").is_some());
    let sessions = desktop.sessions.lock().unwrap();
    assert!(sessions.len() == 1 && sessions[0].contains("Breakpoints"), "{sessions:?}");
}

#[test]
fn settings_hold_at_once_and_are_kept() {
    let (mut harness, desktop) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    assert_eq!(desktop.settings.lock().unwrap().as_deref(), None, "nothing was set yet");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Comma);
    harness.run_steps(3);
    let theme = harness.get_by_role_and_label(egui::Role::ComboBox, "Theme");
    theme.click();
    harness.run_steps(3);
    harness.get_by_label("print").click();
    harness.run_steps(3);
    assert_eq!(harness.ctx.theme(), egui::Theme::Light, "paper is light");
    let kept = desktop.settings.lock().unwrap().clone().unwrap();
    assert!(kept.contains("\"theme\": \"print\""), "{kept}");
    harness.get_by_label("Undo").click();
    harness.run_steps(3);
    assert_eq!(harness.ctx.theme(), egui::Theme::Dark);
    // The next start uses them.
    *desktop.settings.lock().unwrap() = Some("{\"theme\": \"light\", \"layout\": \"Scene\"}".to_owned());
    let open: OpenLog = sample_opener();
    let again = App::new(open, desktop as Arc<dyn Desktop>, ThemeName::Dark);
    assert_eq!(again.state.settings.theme, ThemeName::Light);
    assert_eq!(again.theme.name, ThemeName::Light);
}

#[test]
fn warnings_of_a_log_are_reported_once() {
    let (mut harness, _) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("1 warning about the log; first:").is_some());
    harness.get_by_label("Dismiss notice").click();
    harness.run_steps(5);
    assert!(harness.query_by_label_contains("about the log; first:").is_none());
}

#[test]
fn the_theme_changes_at_a_key() {
    let (mut harness, _) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    assert_eq!(harness.ctx.theme(), egui::Theme::Dark);
    harness.key_press(Key::T);
    harness.run_steps(2);
    assert_eq!(harness.ctx.theme(), egui::Theme::Light);
}

#[test]
fn dialogs_are_drawn() {
    use crate::gui::rendering::headless::{Headless, HeadlessOptions};
    use crate::gui::tests::keep_screenshot;
    use crate::painting::painter::Painter;

    let options = HeadlessOptions { size_px: [1366, 768], pixels_per_point: 1.0, theme: ThemeName::Dark };
    let key = |key, modifiers| egui::Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers };
    let cases = [
        ("welcome", None),
        ("add-run", Some(key(Key::A, Modifiers::NONE))),
        ("palette", Some(key(Key::P, Modifiers::COMMAND))),
        ("open", Some(key(Key::O, Modifiers::COMMAND))),
        ("shortcuts", Some(key(Key::Questionmark, Modifiers::SHIFT))),
        ("warnings", Some(key(Key::W, Modifiers::NONE))),
    ];
    for (name, event) in cases {
        let open: OpenLog = sample_opener();
        let mut app = App::new(open, Arc::new(TestDesktop::default()), ThemeName::Dark);
        let (mut headless, mut painter) = (Headless::new(options), Painter::new());
        let log_is_shown = event.is_some();
        if log_is_shown {
            app.show(Box::new(SampleLog::new(Path::new("/logs/city.mcap"))), None);
        }
        let events = event.map(|event| {
            let modifiers = if let egui::Event::Key { modifiers, .. } = &event { *modifiers } else { Modifiers::NONE };
            vec![egui::Event::ModifiersChanged(modifiers), event, egui::Event::ModifiersChanged(Modifiers::NONE)]
        });
        let mut first = headless.frame(events.unwrap_or_default(), |ui| app.ui(ui));
        painter.set_textures(&first.textures);
        first.textures.clear();
        let Ok(screenshot) = headless.screenshot(&mut painter, |ui| app.ui(ui));
        keep_screenshot(name, &screenshot);
        assert_eq!(app.log().is_some(), log_is_shown);
    }
}

#[test]
fn a_dialog_hides_the_tooltip_of_what_it_covers() {
    let (mut harness, _) = app();
    harness.get_by_label("Open yard.mcap").click();
    run_until(&mut harness, |harness| opened(harness).is_some());
    harness.run_steps(3);
    let shows =
        |harness: &Harness<'static, App>, text: &str| harness.query_all_by_label_contains(text).next().is_some();
    let hint = "yard.mcap\nrig: ";
    harness.get_by_label("yard.mcap").hover();
    harness.run_steps(8);
    assert!(shows(&harness, hint), "a tooltip of the window");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    harness.run_steps(3);
    assert!(harness.query_by_role_and_label(egui::Role::TextInput, "Path of the log").is_some());
    assert!(!shows(&harness, hint));
    // The pointer is where it was; without the dialog the tooltip is back.
    harness.key_press(Key::Escape);
    harness.run_steps(8);
    assert!(shows(&harness, hint));
}
