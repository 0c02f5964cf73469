//! Comparison panel: one run against the ground truth, or up to four runs at one cursor, as tables, as differences over
//! time, and as images and scenes side by side.

mod columns;
mod csv;
mod errors;
mod numbers;
mod over_time;
mod row;
pub(crate) mod scores;
mod side_by_side;
mod single;
#[cfg(test)]
mod tests;

use egui::containers::scroll_area::ScrollAreaOutput;
use egui::{Rect, RichText, ScrollArea, Ui, UiBuilder, Vec2, vec2};

use self::errors::Errors;
pub(in crate::gui) use self::numbers::POSES_ONLY;
use self::over_time::OverTime;
use self::scores::Scores;
use self::side_by_side::{Scenes, SideBySideImages};
use self::single::Single;
use super::rank;
use super::theme::PANEL_MARGIN;
use super::widgets::{choice_ui, empty_ui};
use super::{Dialog, Panel, PanelContext};
use crate::session::Comparison;
use crate::text::Named;

/// Panel size from which all views are shown at once.
const MIN_SIZE_FOR_ALL: Vec2 = vec2(960.0, 430.0);
/// Width from which the two tables are side by side.
const MIN_WIDTH_FOR_BOTH_TABLES: f32 = 860.0;
/// Height from which scenes are shown below the images.
const MIN_HEIGHT_FOR_SCENES: f32 = 760.0;

/// Views of the panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparisonView {
    All,
    Numbers,
    OverTime,
    Errors,
    Images,
    Scenes,
    Directions,
}

impl Named for ComparisonView {
    const NAMES: &'static [(Self, &'static str)] = &[
        (Self::All, "all"),
        (Self::Numbers, "numbers"),
        (Self::OverTime, "differences"),
        (Self::Errors, "errors"),
        (Self::Images, "images"),
        (Self::Scenes, "scenes"),
        (Self::Directions, "directions"),
    ];
}

impl ComparisonView {
    /// Label of its button, and its tooltip.
    const fn label(self) -> [&'static str; 2] {
        match self {
            Self::All => ["All", "All views that fit into the panel"],
            Self::Numbers => ["Numbers", "Accuracy of all runs and first divergences"],
            Self::OverTime => ["Differences", "Differences from the reference over time"],
            Self::Errors => ["Errors", "Errors of each run against the ground truth over time, with 3σ"],
            Self::Images => ["Images", "The image of each run"],
            Self::Scenes => ["Scenes", "The scene of each run"],
            Self::Directions => ["Directions", "Ranks, spectra and lost directions with common rows"],
        }
    }
}

/// State of the comparison panel: reference run, view, and the cached comparisons.
#[derive(Default)]
pub struct ComparisonPanel {
    pub reference: usize,
    /// Chosen view; `None` until the user chooses.
    pub view: Option<ComparisonView>,
    scores: Scores,
    comparisons: Vec<Comparison>,
    over_time: OverTime,
    errors: Errors,
    images: SideBySideImages,
    scenes: Scenes,
    single: Single,
    /// Size in points at which a figure would show everything; zero in the window and for one run.
    pub(in crate::gui) figure_size: Vec2,
    /// Dialog requested in the last frame; the window takes it.
    pub asked: Option<Dialog>,
}

impl Panel for ComparisonPanel {
    fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        let runs = &ctx.recording.runs;
        if runs.is_empty() {
            empty_ui(ui, "No runs");
            return;
        }
        self.read(ctx);
        let errors_only = ctx.presentation.is_figure() && self.view == Some(ComparisonView::Errors);
        if runs.len() == 1 && ctx.recording.trajectories.is_empty() && !errors_only {
            self.asked = self.single.ui(ui, ctx, &self.scores);
            return;
        }
        let top = ui.cursor().top();
        let view = self.controls_ui(ui, ctx);
        let (room, controls_height) = (ui.available_size(), ui.cursor().top() - top);
        self.figure_size = Vec2::ZERO;
        match view {
            ComparisonView::All if room.x >= MIN_SIZE_FOR_ALL.x && room.y >= MIN_SIZE_FOR_ALL.y => self.all_ui(ui, ctx),
            ComparisonView::All | ComparisonView::Numbers => self.numbers_ui(ui, ctx, Vec2::splat(1.0)),
            ComparisonView::OverTime => self.over_time_ui(ui, ctx, Vec2::splat(1.0)),
            ComparisonView::Errors => {
                self.errors.read(ctx);
                if let Some(shown) = self.errors.ui(ui, ctx) {
                    self.measure(ctx, &shown, Vec2::splat(1.0));
                }
            }
            ComparisonView::Images => self.images.ui(ui, ctx),
            ComparisonView::Scenes => self.scenes.ui(ui, ctx),
            ComparisonView::Directions => rank::all_runs_ui(ui, ctx),
        }
        if self.figure_size != Vec2::ZERO {
            self.figure_size += vec2(0.0, controls_height) + Vec2::splat(2.0 * f32::from(PANEL_MARGIN));
        }
    }

    fn view_copy(&self) -> Self {
        let (images, scenes) = (self.images.view_copy(), self.scenes.view_copy());
        Self { reference: self.reference, view: self.view, images, scenes, ..Self::default() }
    }
}

impl ComparisonPanel {
    /// Compares all runs, then all trajectories, with the reference run; the comparison of the reference itself is empty.
    fn read(&mut self, ctx: &PanelContext<'_>) {
        let (runs, trajectories) = (&ctx.recording.runs, &ctx.recording.trajectories);
        self.reference = self.reference.min(runs.len().saturating_sub(1));
        self.comparisons.resize_with(runs.len() + trajectories.len(), Comparison::default);
        if let Some(reference) = runs.get(self.reference) {
            let (of_runs, of_trajectories) = self.comparisons.split_at_mut(runs.len());
            for (comparison, run) in of_runs.iter_mut().zip(runs) {
                comparison.read(reference, run);
            }
            for (comparison, lane) in of_trajectories.iter_mut().zip(trajectories) {
                comparison.read_trajectory(reference, lane);
            }
        }
        self.scores.read(ctx.recording);
    }

    /// Selectors of reference and view; in a figure only the reference.
    fn controls_ui(&mut self, ui: &mut Ui, ctx: &PanelContext<'_>) -> ComparisonView {
        let mut view = self.view.unwrap_or(ComparisonView::All);
        // Errors are against the ground truth, not the reference.
        if ctx.presentation.is_figure() && view == ComparisonView::Errors {
            return view;
        }
        ui.horizontal_wrapped(|ui| {
            let name = RichText::new("Reference").color(ctx.theme.text_weak);
            let label =
                |run: &usize| ctx.recording.runs.get(*run).map_or_else(String::new, |run| run.spec.label.clone());
            if ctx.presentation.is_figure() {
                ui.label(name);
                ui.label(RichText::new(label(&self.reference)).color(ctx.theme.run(self.reference).color));
                return;
            }
            choice_ui(ui, name, 110.0, &mut self.reference, 0..ctx.recording.runs.len(), label)
                .on_hover_text("Reference run of all differences");
            ui.separator();
            for choice in ComparisonView::all() {
                let [name, hover] = choice.label();
                let response = ui.selectable_label(view == choice, name);
                if response.on_hover_text(hover).clicked() {
                    self.view = Some(choice);
                    view = choice;
                }
            }
        });
        view
    }

    /// Notes the content of a figure that takes a fraction of its width and height.
    fn measure<R>(&mut self, ctx: &PanelContext<'_>, shown: &ScrollAreaOutput<R>, fraction: Vec2) {
        if ctx.presentation.is_figure() {
            self.figure_size = self.figure_size.max(shown.content_size / fraction + vec2(0.0, 8.0));
        }
    }

    fn numbers_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, fraction: Vec2) {
        let wide = ui.available_width() >= MIN_WIDTH_FOR_BOTH_TABLES;
        let shown = ScrollArea::both().id_salt("numbers").auto_shrink(false).show(ui, |ui| {
            let accuracy = |ui: &mut Ui, ctx: &mut PanelContext<'_>| {
                ui.vertical(|ui| numbers::accuracy_ui(ui, ctx, &self.scores));
            };
            let divergences = |ui: &mut Ui, ctx: &mut PanelContext<'_>| {
                ui.vertical(|ui| numbers::divergences_ui(ui, ctx, self.reference, &self.comparisons));
            };
            if wide {
                ui.horizontal_top(|ui| {
                    accuracy(ui, ctx);
                    ui.add_space(24.0);
                    divergences(ui, ctx);
                });
            } else {
                accuracy(ui, ctx);
                ui.add_space(6.0);
                divergences(ui, ctx);
            }
        });
        self.measure(ctx, &shown, fraction);
    }

    fn over_time_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, fraction: Vec2) {
        if let Some(shown) = self.over_time.ui(ui, ctx, self.reference, &self.comparisons) {
            self.measure(ctx, &shown, fraction);
        }
    }

    /// Draws tables on the left; differences and images on the right.
    fn all_ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>) {
        const GAP: f32 = 10.0;
        /// Fractions of the panel for the numbers and, beside them, for the differences over time.
        const NUMBERS_WIDTH: f32 = 0.44;
        const OVER_TIME_HEIGHT: f32 = 0.42;
        let all = ui.available_rect_before_wrap();
        ui.advance_cursor_after_rect(all);
        let (left, right) = all.split_left_right_at_fraction(NUMBERS_WIDTH);
        let (above, below) = right.split_top_bottom_at_fraction(OVER_TIME_HEIGHT);
        let scenes = all.height() >= MIN_HEIGHT_FOR_SCENES;
        let (images, scene) = below.split_top_bottom_at_fraction(if scenes { 0.5 } else { 1.0 });
        let mut at = |rect: Rect, draw: &mut dyn FnMut(&mut Ui, &mut PanelContext<'_>)| {
            ui.scope_builder(UiBuilder::new().max_rect(rect.shrink2(vec2(0.0, 2.0))), |ui| {
                ui.set_clip_rect(ui.clip_rect().intersect(rect));
                draw(ui, ctx);
            });
        };
        // The gap is a part of the left fraction.
        let numbers = vec2(NUMBERS_WIDTH * (1.0 - GAP / left.width().max(1.0)), 1.0);
        at(left.with_max_x(left.right() - GAP), &mut |ui, ctx| self.numbers_ui(ui, ctx, numbers));
        at(above, &mut |ui, ctx| self.over_time_ui(ui, ctx, vec2(1.0 - NUMBERS_WIDTH, OVER_TIME_HEIGHT)));
        at(images, &mut |ui, ctx| self.images.ui(ui, ctx));
        if scenes {
            at(scene, &mut |ui, ctx| self.scenes.ui(ui, ctx));
        }
    }

    /// Accuracy of all runs.
    pub(in crate::gui) fn scores(&self) -> &Scores {
        &self.scores
    }
}
