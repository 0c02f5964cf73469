//! Simulation of the sample flight on this machine.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};

use egui::{ProgressBar, RichText, Ui};

use crate::gui::desktop::{Desktop, SampleProgress};
use crate::gui::theme::Theme;

struct Simulation {
    news: Receiver<SampleProgress>,
    images: Option<(usize, usize)>,
}

/// State of the sample flight: the running simulation, or the error of the last one.
#[derive(Default)]
pub(super) struct SampleFlight {
    simulation: Option<Simulation>,
    problem: Option<String>,
}

impl SampleFlight {
    pub(super) fn start(&mut self, desktop: &Arc<dyn Desktop>) {
        match desktop.make_sample() {
            Ok(news) => (self.simulation, self.problem) = (Some(Simulation { news, images: None }), None),
            Err(problem) => self.problem = Some(problem),
        }
    }

    pub(super) fn is_running(&self) -> bool {
        self.simulation.is_some()
    }

    /// Reads the progress and returns the finished log.
    pub(super) fn receive(&mut self) -> Option<PathBuf> {
        let simulation = self.simulation.as_mut()?;
        let result = loop {
            match simulation.news.try_recv() {
                Ok(SampleProgress::Images { done, total }) => simulation.images = Some((done, total)),
                Ok(SampleProgress::Done(result)) => break result,
                Err(TryRecvError::Empty) => return None,
                Err(TryRecvError::Disconnected) => break Err("the simulation stopped".to_owned()),
            }
        };
        self.simulation = None;
        result.map_err(|problem| self.problem = Some(problem)).ok()
    }

    /// Draws the progress with a button to cancel, or the error of the last simulation.
    pub(super) fn ui(&mut self, ui: &mut Ui, theme: &Theme) {
        if let Some(simulation) = &self.simulation {
            let (done, total) = simulation.images.unwrap_or((0, 1));
            let text = match simulation.images {
                Some((done, total)) => format!("Simulating the sample flight: image {done} of {total}"),
                None => "Simulating the sample flight: planning the path".to_owned(),
            };
            let mut cancelled = false;
            ui.horizontal(|ui| {
                let bar = ProgressBar::new(done as f32 / total.max(1) as f32).desired_width(420.0);
                let bar = ui.add(bar.text(RichText::new(&text).small()));
                bar.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ProgressIndicator, true, &text));
                cancelled = ui.button("Cancel").clicked();
            });
            if cancelled {
                self.simulation = None;
            }
        } else if let Some(problem) = &self.problem {
            ui.add(egui::Label::new(RichText::new(format!("✖ {problem}")).color(theme.error)).wrap());
        }
    }
}
