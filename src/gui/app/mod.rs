//! The application of the window: it owns the session, passes time and commands to it, and draws its results.

mod departure;
mod kept_window;
mod leaving;
#[cfg(test)]
mod leaving_tests;
mod open;
mod open_request;
#[cfg(test)]
mod open_tests;
mod opening;
mod opening_cursor;
mod playing_log;
#[cfg(test)]
mod question_tests;
mod repaint;
mod report;
mod requests;
mod rig_question;
pub mod run_window;
mod sample;
#[cfg(test)]
mod session_tests;
mod shown_study;
mod software_window;
mod study;
#[cfg(test)]
mod study_tests;
#[cfg(test)]
mod tests;
mod welcome;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use egui::{CentralPanel, Frame, Ui, ViewportCommand, vec2};

use self::departure::{Departure, Work};
use self::kept_window::{KeptWindow, SHOWN_FRAMES, STORED_AFTER_S, WindowKeeper, place_on_screen};
pub use self::open_request::{OpenFailure, OpenLog, OpenProgress, OpenRequest, OpenedLog, RigQuestion};
use self::opening::Opening;
use self::opening_cursor::OpeningCursor;
use self::playing_log::Images;
pub use self::playing_log::PlayingLog;
use self::repaint::{POLL_PERIOD, until_next_poll, until_next_step};
use self::rig_question::RigPage;
use self::shown_study::ShownStudy;
pub use self::shown_study::{OpenStudy, StudySource};
use self::welcome::{Choice, Welcome};
use crate::gui::desktop::Desktop;
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::units::counted;
use crate::gui::window::{
    MainWindow, NoticeLevel, ProgressMeter, SCALES, SavedLayouts, Settings, first_scale, hide_covered_pointer,
    show_pointer, window_ui,
};
use crate::gui::{PanelContext, Presentation, Selection};
use crate::session::{Command, PlaybackSpeed, Recording, WarningLine, log_warning_lines};

/// Longest pause between two frames in seconds after which the cursor catches up; after a longer one the window was
/// hidden or the machine suspended.
const MAX_FRAME_TIME_S: f64 = 2.0;
/// Period in seconds at which the memory of the process is read.
const MEMORY_PERIOD_S: f64 = 1.0;

pub struct App {
    open_log: OpenLog,
    desktop: Arc<dyn Desktop>,
    log: Option<Box<dyn PlayingLog>>,
    /// Opens studies; `None` where this is not supported.
    open_study: Option<OpenStudy>,
    /// The open study; its runs are shown in front of it.
    study: Option<ShownStudy>,
    opening_cursor: OpeningCursor,
    /// True if the session requests a frame when it has recomputed steps.
    wakes: bool,
    /// Wall-clock time of the window's last frame in seconds, if playback ran then.
    played_s: Option<f64>,
    /// Seconds that the last frame took, layout and painting.
    frame_s: Option<f32>,
    opening: Option<Opening>,
    /// Dropped files that wait for the answer whether they replace what is open.
    replacement: Option<OpenRequest>,
    /// Page on which the rig of a log is chosen or described.
    rig_page: Option<RigPage>,
    departure: Departure,
    keeper: WindowKeeper,
    welcome: Welcome,
    /// Log on which the tour starts when it is open.
    tour_of: Option<PathBuf>,
    state: MainWindow,
    selection: Selection,
    theme: Theme,
    /// Settings in effect; `None` before the first frame.
    applied: Option<Settings>,
    progress: ProgressMeter,
    /// Number of warnings about the log that a notice has reported.
    reported_warnings: usize,
    title: String,
    memory_read_s: Option<f64>,
    /// The report that is being written.
    report: Option<Receiver<Result<PathBuf, String>>>,
}

/// Starts the diagnosis of the shown run when all runs have ended, if neither the check nor an earlier diagnosis explains
/// why its results cannot be trusted.
fn diagnose_unexplained(ctx: &mut PanelContext<'_>) {
    let is_checked = ctx.recording.check.is_some() && !ctx.recording.is_being_checked;
    let is_free = ctx.playback.diagnosis.is_none() && !ctx.recording.is_computing() && is_checked;
    let Some(run) = ctx.selected_run().filter(|run| is_free && run.diagnosis.is_none()) else { return };
    if ctx.answer(run).is_unexplained() {
        ctx.commands.push(Command::Diagnose { run: ctx.run_number() });
    }
}

impl App {
    /// Creates a window without a log; `theme` is used until the user chooses another one.
    pub fn new(open_log: OpenLog, desktop: Arc<dyn Desktop>, theme: ThemeName) -> Self {
        let mut state = MainWindow::default();
        state.status.show_times = true;
        state.panels.laboratory.in_background = true;
        state.panels.rank.in_background = true;
        state.dialogs.set_desktop(Arc::clone(&desktop));
        state.tiles.saved = SavedLayouts::from_text(&desktop.kept_layouts().unwrap_or_default());
        state.settings = Settings::from_text(&desktop.kept_settings().unwrap_or_default(), theme);
        let kept = KeptWindow::from_text(&desktop.kept_window().unwrap_or_default());
        state.tiles.arrange_for_start(kept.layout.as_ref(), &state.settings.layout);
        state.status.recent_logs = desktop.recent_logs();
        let theme = Theme::of(state.settings.theme);
        Self {
            welcome: Welcome::new(Arc::clone(&desktop)),
            open_log,
            desktop,
            log: None,
            open_study: None,
            study: None,
            opening_cursor: OpeningCursor::default(),
            wakes: false,
            played_s: None,
            frame_s: None,
            opening: None,
            replacement: None,
            rig_page: None,
            tour_of: None,
            departure: Departure::default(),
            keeper: WindowKeeper::new(kept),
            state,
            selection: Selection::default(),
            theme,
            applied: None,
            progress: ProgressMeter::default(),
            reported_warnings: 0,
            title: String::new(),
            memory_read_s: None,
            report: None,
        }
    }

    /// Shows an open session. `path` is the opened path if it differs from the log's (a saved session).
    pub fn show(&mut self, log: Box<dyn PlayingLog>, path: Option<&Path>) {
        self.desktop.remember_log(path.unwrap_or(&log.recording().log_path));
        self.state.status.recent_logs = self.desktop.recent_logs();
        self.study = None;
        self.show_session(log);
    }

    /// Shows an open session in front of the study, if there is one.
    fn show_session(&mut self, log: Box<dyn PlayingLog>) {
        let mut log = log;
        log.apply(Command::SetMemoryBudget(self.state.settings.memory_bytes()));
        log.apply(Command::SetSpeed(PlaybackSpeed(self.state.settings.speed)));
        if let Some(layout) = log.layout() {
            self.state.tiles.take_layout(layout);
        }
        self.departure.saved = Work::of(log.as_ref());
        self.state.begin_session(&log.playback().markers);
        self.welcome.stop();
        self.log = Some(log);
        self.opening_cursor = OpeningCursor::default();
        (self.wakes, self.played_s) = (false, None);
        self.selection = Selection::default();
        self.progress = ProgressMeter::default();
        self.reported_warnings = 0;
    }

    /// The session; `None` before a log is open.
    pub fn log(&self) -> Option<&dyn PlayingLog> {
        self.log.as_deref()
    }

    /// Draws one frame and executes the commands and requests of that frame.
    pub fn ui(&mut self, ui: &mut Ui) {
        self.guard_closing(ui);
        self.apply_settings(ui);
        hide_covered_pointer(ui.ctx());
        self.take_opened();
        self.take_dropped(ui);
        self.read_memory(ui);
        if self.log.is_some() {
            self.session_ui(ui);
        } else if self.study.is_some() {
            self.study_ui(ui);
        } else {
            self.welcome_ui(ui);
        }
        self.opening_dialogs_ui(ui);
        show_pointer(ui.ctx());
        self.take_requests(ui);
        self.receive_report(ui);
        self.update_title(ui);
        self.keep_window(ui);
        if self.opening.is_some() {
            ui.ctx().request_repaint_after(POLL_PERIOD);
        }
    }

    /// Applies and stores changed settings.
    fn apply_settings(&mut self, ui: &Ui) {
        let first = self.applied.is_none();
        if first && self.desktop.kept_settings().is_none() {
            let viewport = ui.input(|input| input.viewport().clone());
            self.state.settings.scale = first_scale(viewport.monitor_size, viewport.native_pixels_per_point);
        }
        // egui handles Ctrl with +, − and 0 itself.
        let zoom = ui.ctx().zoom_factor();
        if self
            .applied
            .as_ref()
            .is_some_and(|applied| applied.scale != zoom && applied.scale == self.state.settings.scale)
        {
            self.state.settings.scale = zoom.clamp(*SCALES.start(), *SCALES.end());
        }
        if self.applied.as_ref() == Some(&self.state.settings) {
            return;
        }
        let settings = self.state.settings.clone();
        if self.applied.as_ref().is_none_or(|applied| applied.theme != settings.theme) {
            self.theme = Theme::of(settings.theme);
            self.theme.apply(ui.ctx());
        }
        ui.ctx().set_zoom_factor(settings.scale);
        if let Some(log) = &mut self.log
            && self.applied.as_ref().is_none_or(|applied| applied.memory_mib != settings.memory_mib)
        {
            log.apply(Command::SetMemoryBudget(settings.memory_bytes()));
        }
        if !first && let Err(problem) = self.desktop.keep_settings(&settings.to_text()) {
            self.state.notices.show_message(NoticeLevel::Error, problem);
        }
        self.applied = Some(settings);
        ui.ctx().request_repaint();
    }

    /// Shows one notice about the warnings of the log; the list has all of them.
    fn report_warnings(&mut self, recording: &Recording) {
        let lines = log_warning_lines(&recording.warnings);
        let count = lines.len();
        if count > 0 && self.reported_warnings == 0 {
            let first = lines.first().map(WarningLine::text).unwrap_or_default();
            let text = format!("{} about the log; first: {first}\nFull list: W", counted(count, "warning"));
            self.state.notices.show_message(NoticeLevel::Warning, text);
        }
        self.reported_warnings = count;
    }

    fn session_ui(&mut self, ui: &mut Ui) {
        let Some(log) = &mut self.log else { return };
        if !self.wakes {
            let context = ui.ctx().clone();
            log.wake_with(Box::new(move || context.request_repaint()));
            self.wakes = true;
        }
        // Log time follows the wall clock: slow rendering skips frames, not time.
        let (stable_s, now_s) = ui.input(|input| (f64::from(input.stable_dt), input.time));
        let elapsed_s = self.played_s.map_or(stable_s, |before_s| now_s - before_s);
        if elapsed_s < MAX_FRAME_TIME_S {
            log.advance(elapsed_s);
        } else if log.playback().playing {
            let text = format!("Rendering stalled for {elapsed_s:.1} s; playback resumed");
            self.state.notices.show_message(NoticeLevel::Warning, text);
        }
        log.settle_shortly();
        for notice in log.take_notices() {
            self.state.notices.show_message(NoticeLevel::Warning, notice);
        }
        self.opening_cursor.update(log.as_mut(), now_s);
        let (recording, playback, generation) = (log.recording(), log.playback(), log.generation());
        self.state.status.progress = self.progress.read(&recording, Some(now_s));
        self.state.status.opening = self.opening.as_ref().map(Opening::text);
        self.state.status.study = self.study.as_ref().map(ShownStudy::name);
        self.state.panels.timeline.pace.frame(playback.playing, now_s, log.cursor_ns());
        let mut commands = Vec::new();
        self.selection.flight.compute_in_background();
        let mut context = PanelContext {
            recording: &recording,
            cursor_ns: log.cursor_ns(),
            playback: &playback,
            images: &mut Images(log.as_mut()),
            selection: &mut self.selection,
            theme: &self.theme,
            presentation: Presentation::Interactive,
            commands: &mut commands,
        };
        window_ui(ui, &mut self.state, &mut context);
        diagnose_unexplained(&mut context);
        let commanded = !commands.is_empty();
        for command in commands {
            log.apply(command);
        }
        let playback = log.playback();
        self.played_s = playback.playing.then_some(now_s);
        let computing = recording.is_computing();
        if commanded {
            ui.ctx().request_repaint();
        } else if playback.playing {
            // egui subtracts the expected duration of a frame.
            let frame = Duration::from_secs_f32(ui.input(|input| input.predicted_dt.clamp(0.0, 1.0)));
            let wait = until_next_step(&recording, log.cursor_ns(), playback.speed);
            ui.ctx().request_repaint_after(wait + frame);
        } else if playback.recomputing || playback.running_to_breakpoint {
            ui.ctx().request_repaint_after(POLL_PERIOD);
        } else if computing || log.generation() != generation {
            ui.ctx().request_repaint_after(until_next_poll(self.frame_s));
        }
        self.report_warnings(&recording);
    }

    fn read_memory(&mut self, ui: &Ui) {
        let now_s = ui.input(|input| input.time);
        if self.memory_read_s.is_none_or(|read_s| now_s - read_s >= MEMORY_PERIOD_S) {
            self.memory_read_s = Some(now_s);
            self.state.status.memory_bytes = self.desktop.resident_bytes();
        }
    }

    /// Sets the title of the window to the name of the log.
    fn update_title(&mut self, ui: &Ui) {
        let of_log = self.log.as_ref().map(|log| log.recording().log_name());
        let name = of_log.or_else(|| self.study.as_ref().map(ShownStudy::name));
        let title = name.map_or_else(|| "dcvins".to_owned(), |name| format!("{name} – dcvins"));
        if title != self.title {
            ui.ctx().send_viewport_cmd(ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }

    /// Draws the view, the manual over it and the notices, and executes the choice.
    fn welcome_ui(&mut self, ui: &mut Ui) {
        let mut cancelled = false;
        let frame = Frame::new().fill(self.theme.surface).inner_margin(20);
        let chosen = CentralPanel::no_frame().frame(frame).show(ui, |ui| {
            let opening = self.opening.as_ref();
            let mut opening_ui = opening.map(|it| |ui: &mut Ui| cancelled = it.ui(ui, &self.theme));
            let busy = opening_ui.as_mut().map(|draw| draw as &mut dyn FnMut(&mut Ui));
            self.welcome.ui(ui, &self.theme, busy)
        });
        if cancelled {
            self.opening = None;
        }
        self.state.help.welcome_ui(ui, &self.theme);
        self.state.ring.ui(ui, &self.theme);
        self.state.notices.toasts_ui(ui, &self.theme);
        if let Some(choice) = chosen.inner {
            self.take_choice(choice);
        }
    }

    fn take_choice(&mut self, choice: Choice) {
        match choice {
            Choice::Open(path) => self.open(OpenRequest::of(path)),
            Choice::Tour(path) => {
                self.tour_of = Some(path.clone());
                self.open(OpenRequest::of(path));
            }
            Choice::Manual => self.state.help.manual.show(None),
            Choice::Tutorial => self.state.help.manual.show_tutorial(),
        }
    }

    /// Starts the tour on the log that is open or being opened, else on the sample flight.
    pub fn start_tour(&mut self) {
        if self.log.is_some() {
            self.state.tour.start();
        } else if let Some(opening) = &self.opening {
            self.tour_of = Some(opening.path());
        } else if let Some(choice) = self.welcome.sample(true) {
            self.take_choice(choice);
        }
    }

    /// Gives the window its place once it is shown: before, X11 ignores the wish to be maximized, and the size of the
    /// frame is not known.
    fn place_window(&mut self, ui: &Ui, window: &winit::window::Window) {
        if self.keeper.shown > SHOWN_FRAMES {
            return;
        }
        self.keeper.shown += 1;
        if self.keeper.shown <= SHOWN_FRAMES {
            ui.request_repaint();
        } else if self.keeper.maximizes {
            ui.send_viewport_cmd(ViewportCommand::Maximized(true));
        } else {
            place_on_screen(window, false);
        }
    }

    /// Reads size, place and layout, and stores them some time after a change.
    fn keep_window(&mut self, ui: &Ui) {
        let scale = ui.zoom_factor();
        let size = ui.viewport_rect().size();
        let (mut place, now_s) = (self.keeper.kept.place, ui.input(|input| input.time));
        ui.input(|input| place.read(input.viewport(), vec2(size.x, size.y), scale));
        if place != self.keeper.kept.place || self.state.tiles.take_changed() {
            self.keeper.kept.place = place;
            self.keeper.changed_s.get_or_insert(now_s);
        }
        match self.keeper.changed_s {
            Some(changed_s) if now_s - changed_s >= STORED_AFTER_S => self.store_window(),
            Some(_) => ui.request_repaint_after(std::time::Duration::from_secs_f64(STORED_AFTER_S)),
            None => {}
        }
    }

    /// Stores size, place and layout if they have changed.
    fn store_window(&mut self) {
        if self.keeper.changed_s.take().is_none() {
            return;
        }
        self.keeper.kept.layout = self.state.tiles.last_layout_value();
        if let Err(problem) = self.desktop.keep_window(&self.keeper.kept.to_text()) {
            self.state.notices.show_message(NoticeLevel::Error, problem);
        }
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, frame: &mut eframe::Frame) {
        self.frame_s = frame.info().cpu_usage;
        Self::ui(self, ui);
        if let Some(window) = frame.winit_window() {
            self.place_window(ui, window);
        }
    }

    fn on_exit(&mut self) {
        self.store_window();
    }
}
