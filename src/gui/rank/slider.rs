//! Slider that moves the chain along a null or uninformed direction: the scene shows the moved chain, the image the change of
//! the reprojections.

use egui::{ComboBox, Label, RichText, Role, Slider, Ui, WidgetInfo};

use crate::gimbal::ParameterId;
use crate::gui::PanelContext;
use crate::gui::units::{fixed, significant};
use crate::observability::{
    CalibrationDirection, ChainSlide, RankReport, SlideDirection, SlidePosition, chain_of_step, parameters_of_weights,
};
use crate::session::StepRecord;

/// Maximum displacement, in units of 10° and 3 cm along the unit direction.
const MAX_DISPLACEMENT: f64 = 2.0;
/// Period of the animation in seconds.
const PERIOD_S: f64 = 4.0;
/// Largest change of the reprojections in pixels that counts as zero.
const ZERO_CHANGE_PX: f64 = 0.1;
/// Minimum width of the slider and maximum width of the direction selector, in points.
const MIN_SLIDER_WIDTH: f32 = 70.0;
const MAX_CHOICE_WIDTH: f32 = 300.0;
/// Number of parameters whose changes are listed.
const CHANGES_SHOWN: usize = 4;

#[derive(Debug, Default)]
pub(super) struct SliderUi {
    playing: bool,
    /// True if the chain was moved in the last frame.
    moved: bool,
}

impl SliderUi {
    /// Draws the slider, which sets the position in the selection, and its effect.
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, step: &StepRecord) {
        let Some(rank) = &step.rank else { return };
        let Some(chain) = chain_of_step(&step.report, rank) else { return };
        let mut directions = SlideDirection::of_step(rank);
        let position = ctx.selection.slide;
        // A reset elsewhere ends the animation.
        self.playing &= !(self.moved && position.is_none());
        directions.extend(position.iter().map(|position| position.direction).filter(|it| is_other(it, rank)));
        let selected = ctx.selection.parameter.map(SlideDirection::Parameter).into_iter();
        directions.extend(selected.filter(|it| is_other(it, rank)));
        directions.dedup();
        let Some(first) = directions.first().copied() else { return };
        let (names, parameters) = (ctx.names(), chain.parameters());
        let label = |direction: &SlideDirection| {
            let weights = direction.weights(rank, &chain).unwrap_or_default();
            let kind = match direction {
                SlideDirection::Measured(index) => {
                    let kind = rank.directions.get(*index).map_or("", CalibrationDirection::kind);
                    format!("{kind} {}", index + 1)
                }
                SlideDirection::Parameter(parameter) => return format!("{} only", names.name(*parameter)),
                SlideDirection::Known(loss) if is_other(direction, rank) => return format!("{} only", loss.name()),
                SlideDirection::Known(_) => "closed form".to_owned(),
            };
            let moved = parameters_of_weights(&names, &parameters, &weights, 2);
            format!("{kind}: {}", if moved.is_empty() { "no parameter of the chain" } else { &moved })
        };

        let mut direction = position.as_ref().map_or(first, |position| position.direction);
        let mut amount = position.map_or(0.0, |position| position.amount);
        if ctx.presentation.is_figure() {
            if let Some(slide) = ctx.moved_chain(step.report.stamp_ns) {
                let text = format!("Chain moved along {} by {}", label(&direction), signed(amount));
                ui.add(Label::new(RichText::new(text).color(ctx.theme.text)).wrap());
                outcome_ui(ui, ctx, slide, &parameters);
            }
            return;
        }
        ui.horizontal(|ui| {
            let (sign, name) =
                if self.playing { ("⏸", "Pause the animation") } else { ("▶", "Animate the direction") };
            let play = ui.small_button(sign).on_hover_text("Moves the chain back and forth along the direction");
            play.widget_info(|| WidgetInfo::labeled(Role::Button, true, name));
            if play.clicked() {
                self.playing = !self.playing;
            }
            let along = ui.label(RichText::new("Direction").color(ctx.theme.text_weak));
            let width = (ui.available_width() - MIN_SLIDER_WIDTH - 24.0).clamp(60.0, MAX_CHOICE_WIDTH);
            let text = label(&direction);
            let combo = ComboBox::from_id_salt("direction of the slider").selected_text(text.as_str()).width(width);
            let chosen = ui.scope(|ui| {
                ui.set_max_width(width);
                combo.truncate().show_ui(ui, |ui| {
                    for choice in directions {
                        let text = label(&choice);
                        ui.selectable_value(&mut direction, choice, text);
                    }
                })
            });
            let chosen = chosen.inner;
            chosen.response.clone().on_hover_text(text);
            chosen.response.labelled_by(along.id);
            ui.spacing_mut().slider_width = (ui.available_width() - 12.0).max(MIN_SLIDER_WIDTH);
            let slider = Slider::new(&mut amount, -MAX_DISPLACEMENT..=MAX_DISPLACEMENT).show_value(false);
            let slider = ui.add(slider).on_hover_text(
                "Displacement of the chain along this direction, up to 20° and 6 cm, with the vehicle's poses fixed; \
                 double-click: zero",
            );
            let slider = slider.labelled_by(along.id);
            if slider.double_clicked() {
                amount = 0.0;
            }
            if slider.dragged() {
                self.playing = false;
            }
        });
        if self.playing {
            let time_s = ui.input(|input| input.time);
            amount = MAX_DISPLACEMENT * (std::f64::consts::TAU * time_s / PERIOD_S).sin();
            ui.ctx().request_repaint();
        }
        let untouched = ctx.selection.slide.is_none() && amount == 0.0 && !self.playing;
        let unchosen = SlideDirection::of_step(rank).first() == Some(&direction);
        ctx.selection.slide = (!(untouched && unchosen)).then_some(SlidePosition { direction, amount });
        self.moved = ctx.selection.slide.is_some();
        if let Some(slide) = ctx.moved_chain(step.report.stamp_ns) {
            outcome_ui(ui, ctx, slide, &parameters);
        }
    }
}

/// True if the direction is not one of the step's.
fn is_other(direction: &SlideDirection, rank: &RankReport) -> bool {
    !SlideDirection::of_step(rank).contains(direction)
}

/// Draws the changes of reprojections and parameters.
fn outcome_ui(ui: &mut Ui, ctx: &PanelContext<'_>, slide: &ChainSlide, parameters: &[ParameterId]) {
    let names = ctx.names();
    let stays = slide.largest_px <= ZERO_CHANGE_PX;
    let (mark, color) = if stays { ("✔", ctx.theme.ok) } else { ("✖", ctx.theme.warn) };
    let (finite, first_order) = (significant(slide.largest_px), significant(slide.largest_first_order_px));
    let verdict = if stays { "unchanged" } else { "changed" };
    let text = format!("{mark} Reprojections {verdict}: at most {finite} px ({first_order} px to first order)");
    ui.add(Label::new(RichText::new(text).color(color)).wrap());
    let mut moved: Vec<usize> = (0..slide.changes.len().min(parameters.len())).collect();
    let scaled = |column: &usize| (slide.changes[*column] / parameters[*column].scale()).abs();
    moved.sort_by(|a, b| scaled(b).total_cmp(&scaled(a)));
    let changes = moved.iter().take(CHANGES_SHOWN).filter(|column| scaled(column) > 1e-3).map(|column| {
        let shown = parameters[*column].shown();
        format!("{} {}{}", names.name(parameters[*column]), signed(slide.changes[*column] * shown.factor), shown.unit)
    });
    let text = changes.collect::<Vec<_>>().join(", ");
    ui.add(Label::new(RichText::new(text).small().color(ctx.theme.text_weak)).wrap());
}

fn signed(value: f64) -> String {
    let text = fixed(value.abs(), 1);
    if value < 0.0 { format!("−{text}") } else { format!("+{text}") }
}
