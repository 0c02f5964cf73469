//! A log or a study that is being opened on another thread.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use egui::{Button, ProgressBar, RichText, Ui};

use super::open_request::{OpenFailure, OpenProgress, OpenRequest, OpenedLog};
use super::playing_log::PlayingLog;
use super::shown_study::StudySource;
use crate::gui::theme::Theme;

/// Smallest change of the completed fraction that is sent to the window.
const PROGRESS_STEP: f64 = 0.002;

/// Result of a thread that opens a path.
pub(super) enum Opened {
    /// A log or a saved session.
    Log(OpenedLog),
    Study(Arc<dyn StudySource>),
    /// A run of the open study, with comparable runs.
    RunOfStudy(Box<dyn PlayingLog>),
}

/// Message of the thread.
pub(super) enum OpeningNews {
    Progress(OpenProgress),
    Done(Result<Opened, OpenFailure>),
}

/// Callback that takes the progress; it breaks when nobody waits any more.
pub(super) type ShowProgress<'a> = dyn FnMut(OpenProgress) -> ControlFlow<()> + 'a;

/// The thread as the window sees it; dropping it stops a conversion.
pub(super) struct Opening {
    pub(super) request: OpenRequest,
    news: Receiver<OpeningNews>,
    pub(super) progress: Option<OpenProgress>,
}

impl Opening {
    /// Starts the thread `open-log`.
    ///
    /// # Errors
    /// When it cannot be started.
    pub(super) fn start(
        request: OpenRequest,
        open: impl FnOnce(&mut ShowProgress<'_>) -> Result<Opened, OpenFailure> + Send + 'static,
    ) -> Result<Self, String> {
        let (sender, news) = channel();
        let work = move || {
            let mut shown: Option<(String, Option<f64>)> = None;
            let result = open(&mut |progress| {
                let changed = shown.as_ref().is_none_or(|(text, ratio)| {
                    let moved =
                        progress.ratio.zip(*ratio).is_some_and(|(now, shown)| (now - shown).abs() >= PROGRESS_STEP);
                    *text != progress.text || moved
                });
                if !changed {
                    return ControlFlow::Continue(());
                }
                shown = Some((progress.text.clone(), progress.ratio));
                match sender.send(OpeningNews::Progress(progress)) {
                    Ok(()) => ControlFlow::Continue(()),
                    Err(_) => ControlFlow::Break(()),
                }
            });
            // The receiver has been dropped if another log was requested meanwhile.
            drop(sender.send(OpeningNews::Done(result)));
        };
        let thread = std::thread::Builder::new().name("open-log".to_owned()).spawn(work);
        thread.map_err(|error| format!("Cannot start a thread: {error}"))?;
        Ok(Self { request, news, progress: None })
    }

    /// Reads the messages of the thread and returns its result once.
    pub(super) fn receive(&mut self) -> Option<Result<Opened, OpenFailure>> {
        loop {
            match self.news.try_recv() {
                Ok(OpeningNews::Progress(progress)) => self.progress = Some(progress),
                Ok(OpeningNews::Done(result)) => return Some(result),
                Err(TryRecvError::Empty) => return None,
                Err(TryRecvError::Disconnected) => {
                    let text = format!("Cannot open {}: the loader thread stopped", self.request.names());
                    return Some(Err(OpenFailure::Problem(text)));
                }
            }
        }
    }

    /// First path, for the tour and the status bar.
    pub(super) fn path(&self) -> PathBuf {
        self.request.sources.first().cloned().unwrap_or_default()
    }

    /// Present work in a few words.
    pub(super) fn text(&self) -> String {
        match &self.progress {
            Some(OpenProgress { text, ratio: Some(ratio) }) => format!("{text}: {:.0} %", 100.0 * ratio),
            Some(OpenProgress { text, ratio: None }) => text.clone(),
            None => format!("Opening {}", self.request.names()),
        }
    }

    /// Draws the progress; returns true if the opening is cancelled.
    pub(super) fn ui(&self, ui: &mut Ui, theme: &Theme) -> bool {
        let text = self.text();
        let ratio = self.progress.as_ref().and_then(|progress| progress.ratio);
        if let Some(ratio) = ratio {
            let bar = ui.add(ProgressBar::new(ratio as f32).desired_width(420.0));
            bar.widget_info(|| {
                egui::WidgetInfo::labeled(egui::Role::ProgressIndicator, true, "Progress of the conversion")
            });
        } else {
            ui.spinner();
        }
        ui.label(RichText::new(text).color(theme.text));
        if ratio.is_some() {
            let hint = "The converted log is kept in the cache folder: next time it opens at once";
            ui.label(RichText::new(hint).color(theme.text_weak));
        }
        ui.add_space(4.0);
        ui.add(Button::new("Cancel opening")).clicked()
    }
}
