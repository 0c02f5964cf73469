//! Information gain of the images in the last second: bits per second by parameter and by motion.

use std::sync::Arc;

use egui::{CollapsingHeader, Color32, Grid, Label, RichText, TextStyle, Ui, vec2};

use crate::estimator::Motion;
use crate::gimbal::ParameterNames;
use crate::gui::PanelContext;
use crate::gui::parameter_names::{meaning_of, part_of};
use crate::gui::theme::{Theme, number_font};
use crate::gui::under_pointer::{Item, offer_item};
use crate::gui::units::fixed;
use crate::observability::{InformationRate, information_rate};
use crate::session::{RunRecord, StepRecord};

/// Interval before the cursor over which the gain is summed, in nanoseconds.
const RATE_INTERVAL_NS: i64 = 1_000_000_000;
/// Smallest shown contribution in bits per second.
const MIN_SHOWN: f64 = 0.005;

/// The cached sums of one step.
#[derive(Debug, Default)]
pub(super) struct InformationUi {
    cached: Option<(Arc<StepRecord>, Option<InformationRate>)>,
}

impl InformationUi {
    /// Draws one line, and the table if it is open.
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord, step: &Arc<StepRecord>) {
        if !self.cached.as_ref().is_some_and(|(known, _)| Arc::ptr_eq(known, step)) {
            self.cached = Some((Arc::clone(step), rate_before(run, step)));
        }
        let Some((_, Some(rate))) = &self.cached else { return };
        let joints = ctx.recording.rig.joint_names();
        let headlines = headlines(rate, &ctx.names(), &joints);
        let title = RichText::new(fitting(ui, &headlines)).color(ctx.theme.text);
        if ctx.presentation.is_figure() {
            ui.label(title);
            return;
        }
        let header = CollapsingHeader::new(title).id_salt("information");
        let shown = header.show(ui, |ui| table_ui(ui, ctx, rate, &joints));
        shown.header_response.on_hover_text(&headlines[0]);
    }
}

/// Information rate over the last second up to a step.
fn rate_before(run: &RunRecord, step: &StepRecord) -> Option<InformationRate> {
    let stamp_ns = step.report.stamp_ns;
    let begin = run.index_at(stamp_ns - RATE_INTERVAL_NS).map_or(0, |before| before + 1);
    let end = run.index_at(stamp_ns).map_or(0, |last| last + 1);
    information_rate(run.steps[begin..end].iter().filter_map(|step| step.gain()))
}

/// The longest headline that fits, else the shortest; a wider one would widen all content below.
fn fitting<'a>(ui: &Ui, headlines: &'a [String; 3]) -> &'a str {
    let font = TextStyle::Button.resolve(ui.style());
    let room = ui.available_width() - ui.spacing().indent - 2.0 * ui.spacing().button_padding.x;
    let width = |text: &String| ui.painter().layout_no_wrap(text.clone(), font.clone(), Color32::WHITE).size().x;
    headlines.iter().find(|text| width(text) <= room).unwrap_or(&headlines[2])
}

/// Three headlines: complete, without the parameter of the largest gain, and the sum alone.
fn headlines(rate: &InformationRate, names: &ParameterNames, joints: &[String]) -> [String; 3] {
    let main_motion = rate
        .leading(None)
        .map_or_else(String::new, |(motion, part)| format!(", mostly from {} ({part:.2})", motion.label(joints)));
    let fastest = (0..rate.parameters.len())
        .max_by(|a, b| rate.parameters[*a].bits_per_s.total_cmp(&rate.parameters[*b].bits_per_s))
        .filter(|fastest| rate.parameters[*fastest].bits_per_s > 0.0);
    let fastest = fastest.map_or_else(String::new, |fastest| {
        let parameter = &rate.parameters[fastest];
        let by = rate
            .leading(Some(fastest))
            .map_or_else(String::new, |(motion, _)| format!(" from {}", motion.label(joints)));
        format!("; largest: {} {:.2}{by}", names.name(parameter.parameter), parameter.bits_per_s)
    });
    let total = format!("Information gain, last {:.1} s: {:.2} bit/s", rate.duration_s, rate.total());
    [format!("{total}{main_motion}{fastest}"), format!("{total}{main_motion}"), total]
}

fn table_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, rate: &InformationRate, joints: &[String]) {
    let (theme, names) = (*ctx.theme, ctx.names());
    ui.label(
        RichText::new(
            "bit/s by parameter (one bit halves σ): total, attributed to each motion, and from earlier images",
        )
        .small()
        .color(theme.text_weak),
    );
    let mut order: Vec<usize> = (0..rate.parameters.len()).collect();
    order.sort_by_key(|index| part_of(rate.parameters[*index].parameter));
    let parts = rate.parameters.iter().flat_map(|parameter| &parameter.by_motion);
    let largest = parts.fold(0.0_f64, |largest, part| largest.max(part.abs()));
    Grid::new("information by motion").spacing(vec2(4.0, 0.0)).min_col_width(0.0).min_row_height(13.0).show(ui, |ui| {
        for head in ["", "total"] {
            ui.label(RichText::new(head).small().color(theme.text_weak));
        }
        for motion in &rate.motions {
            ui.label(RichText::new(motion.label(joints)).small().color(theme.text_weak))
                .on_hover_text(meaning_of_motion(*motion, joints));
        }
        let earlier = ui.label(RichText::new("earlier").small().color(theme.text_weak));
        earlier.on_hover_text("Gain in bit/s from observations of landmarks whose earlier frames have left the window (marginalization prior)");
        ui.end_row();
        for index in order {
            let parameter = &rate.parameters[index];
            let name = names.name(parameter.parameter);
            let selected = ctx.selection.parameter == Some(parameter.parameter);
            let color = if selected { theme.accent } else { theme.text };
            let (sense, _) = ctx.presentation.clickable(egui::Role::Label);
            let label = Label::new(RichText::new(name).small().color(color)).sense(sense);
            let response = ui.add(label).on_hover_text(meaning_of(parameter.parameter, &ctx.recording.rig));
            if response.contains_pointer() {
                offer_item(ui, Item::Parameter(parameter.parameter));
            }
            if response.clicked() {
                ctx.selection.parameter = if selected { None } else { Some(parameter.parameter) };
            }
            number_ui(ui, &theme, parameter.bits_per_s, 0.0);
            for part in parameter.by_motion.iter().chain([&parameter.earlier]) {
                number_ui(ui, &theme, *part, if largest > 0.0 { part / largest } else { 0.0 });
            }
            ui.end_row();
        }
    });
}

/// A number whose background shows its sign and magnitude.
fn number_ui(ui: &mut Ui, theme: &Theme, number: f64, ratio: f64) {
    let text = if number.abs() < MIN_SHOWN { "·".to_owned() } else { fixed(number, 2) };
    // Right-aligned, which aligns signs and decimal points.
    let mut text = RichText::new(format!("{text:>5}")).font(number_font()).color(theme.text_strong);
    if ratio.abs() >= 0.05 {
        let ground = theme.diverging(ratio);
        text = text.color(Theme::text_on(ground)).background_color(ground);
    }
    ui.add(Label::new(text));
}

fn meaning_of_motion(motion: Motion, joints: &[String]) -> String {
    let axis = |axis: usize| ["x", "y", "z"].get(axis).copied().unwrap_or("?");
    match motion {
        Motion::Translation(along) => {
            format!("Gain in bit/s from the vehicle's translation along the {} axis of the IMU", axis(along))
        }
        Motion::Rotation(about) => {
            format!("Gain in bit/s from the vehicle's rotation about the {} axis of the IMU", axis(about))
        }
        Motion::Joint(_) => format!("Gain in bit/s from the rotation of joint {}", motion.name(joints)),
    }
}
