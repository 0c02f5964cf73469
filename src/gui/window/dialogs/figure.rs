//! Dialog "Figure for a paper": panel, time range, size, font and format, with a preview and the command that repeats it.

use egui::{Button, ColorImage, DragValue, Grid, Image, Label, RichText, ScrollArea, TextEdit, Ui, vec2};
use egui::{TextureHandle, TextureOptions};

use super::modal::{Modal, accept_or_cancel_ui};
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::gui::comparison::ComparisonView;
use crate::gui::desktop::FigureExport;
use crate::gui::theme::ThemeName;
use crate::gui::widgets::choice_ui;
use crate::gui::window::figure::{FIGURE_FONT_PT, FIGURE_SIDE_MM, FigureFormat, FigureInput, FigureSpec};
use crate::gui::window::panels::Panels;
use crate::gui::window::request::WindowRequest;
use crate::gui::{PanelContext, PanelName, ReadingCursor, ShownCameras};
use crate::session::Recording;
use crate::text::Named as _;

/// Widths of one and of two columns of a page in millimetres.
const COLUMNS_MM: [f64; 2] = [85.0, 175.0];
/// Size of the preview in points.
const PREVIEW: egui::Vec2 = vec2(470.0, 440.0);
/// Width of the fields in points.
const FIELDS_WIDTH: f32 = 330.0;

/// State of the dialog.
#[derive(Default)]
pub(in crate::gui::window) struct FigureDialog {
    spec: Option<FigureSpec>,
    format: FigureFormat,
    preview: Option<Preview>,
}

/// The last preview with what it shows.
struct Preview {
    spec: FigureSpec,
    computed_ns: i64,
    texture: TextureHandle,
}

impl FigureDialog {
    /// Starts with a panel as it is shown: the size and style of the last figure, the run and the time range of the
    /// window.
    pub(in crate::gui::window) fn start(&mut self, panel: PanelName, panels: &Panels, ctx: &PanelContext<'_>) {
        let last = self.spec.take().unwrap_or_else(first_spec);
        let view = panels.comparison.view.filter(|_| panel == PanelName::Comparison);
        let (run, range_ns) = (ctx.selection.run, ctx.selection.visible_ns);
        let cameras = ctx.selection.cameras.clone();
        self.spec = Some(FigureSpec { panel, view, run, cameras, range_ns, cursor_ns: None, caption: None, ..last });
        self.preview = None;
    }

    /// Draws the dialog; returns true if it stays open.
    pub(super) fn ui(
        &mut self,
        ui: &Ui,
        ctx: &mut PanelContext<'_>,
        panels: &Panels,
        requests: &mut Vec<WindowRequest>,
    ) -> bool {
        let Self { spec, format, preview } = self;
        let spec = spec.get_or_insert_with(first_spec);
        let theme = *ctx.theme;
        let modal = Modal { name: "figure", title: "Figure for a paper", width: FIELDS_WIDTH + PREVIEW.x + 20.0 };
        let contents = modal.ui(ui, &theme, |ui| {
            ui.add_space(4.0);
            ui.horizontal_top(|ui| {
                ui.vertical(|ui| {
                    ui.set_width(FIELDS_WIDTH);
                    fields_ui(ui, spec, format, ctx);
                });
                ui.add_space(10.0);
                ui.vertical(|ui| {
                    ui.set_min_size(PREVIEW);
                    preview_ui(ui, spec, preview, panels, ctx);
                });
            });
            let path = path_of(spec, *format, ctx.recording);
            let command = spec.command(ctx.recording, &log_of(ctx.recording), &path);
            command_ui(ui, ctx, &command);
            ui.add_space(6.0);
            if accept_or_cancel_ui(ui, "Save", true) {
                let input = input_of(panels, ctx);
                let description = format!("{} Command: {command}", spec.text(input.recording).caption());
                if let Some(figure) = spec.draw(*format, &description, input) {
                    requests.push(WindowRequest::WriteFigure(Box::new(FigureExport { path, figure })));
                }
            }
        });
        contents.1
    }
}

/// The figure before the first choice.
fn first_spec() -> FigureSpec {
    FigureSpec {
        panel: PanelName::Convergence,
        view: None,
        run: 0,
        cameras: ShownCameras::Main,
        range_ns: None,
        cursor_ns: None,
        width_mm: COLUMNS_MM[0],
        height_mm: None,
        font_pt: 8.0,
        theme: ThemeName::Print,
        caption: None,
    }
}

fn fields_ui(ui: &mut Ui, spec: &mut FigureSpec, format: &mut FigureFormat, ctx: &PanelContext<'_>) {
    Grid::new("figure").num_columns(2).spacing(vec2(10.0, 6.0)).show(ui, |ui| {
        chosen_ui(ui, "Panel", &mut spec.panel, PanelName::all().map(|panel| (panel, panel.title())));
        if spec.panel == PanelName::Comparison {
            let mut view = spec.view.unwrap_or(ComparisonView::All);
            chosen_ui(ui, "View", &mut view, ComparisonView::all().map(|view| (view, view.name())));
            spec.view = Some(view);
        } else {
            spec.view = None;
        }
        let runs = &ctx.recording.runs;
        if runs.len() > 1 {
            let labels = runs.iter().enumerate().map(|(run, record)| (run, record.spec.label.as_str()));
            chosen_ui(ui, "Run", &mut spec.run, labels);
        }
        range_ui(ui, spec, ctx);
        let name = ui.label("Width");
        ui.horizontal(|ui| {
            let drag = DragValue::new(&mut spec.width_mm).range(FIGURE_SIDE_MM).speed(0.5).suffix(" mm");
            ui.add(drag).labelled_by(name.id);
            for (width_mm, text) in COLUMNS_MM.into_iter().zip(["One column", "Two columns"]) {
                if ui.selectable_label(spec.width_mm == width_mm, text).clicked() {
                    spec.width_mm = width_mm;
                }
            }
        });
        ui.end_row();
        ui.label("Height");
        ui.horizontal(|ui| {
            let mut of_content = spec.height_mm.is_none();
            ui.checkbox(&mut of_content, "Of the content");
            match (&mut spec.height_mm, of_content) {
                (Some(height_mm), false) => {
                    ui.add(DragValue::new(height_mm).range(FIGURE_SIDE_MM).speed(0.5).suffix(" mm"));
                }
                (height_mm, true) => *height_mm = None,
                (height_mm, false) => *height_mm = Some(60.0),
            }
        });
        ui.end_row();
        let name = ui.label("Font size");
        let drag = DragValue::new(&mut spec.font_pt).range(FIGURE_FONT_PT).speed(0.1).max_decimals(1).suffix(" pt");
        ui.add(drag).labelled_by(name.id).on_hover_text("Size of axes and labels on paper");
        ui.end_row();
        let themes = [ThemeName::Print, ThemeName::Light, ThemeName::Dark].map(|theme| (theme, theme.name()));
        chosen_ui(ui, "Theme", &mut spec.theme, themes);
        let formats = [
            (FigureFormat::Pdf, "PDF (vectors, fonts embedded)"),
            (FigureFormat::Svg, "SVG (vectors)"),
            (FigureFormat::Png, "PNG (300 dpi)"),
        ];
        chosen_ui(ui, "Format", format, formats);
    });
    if matches!(spec.panel, PanelName::Image | PanelName::Scene) && *format != FigureFormat::Png {
        let text = "Camera images and the 3D scene are embedded as pixels; marks, texts and axes are vectors.";
        ui.add(Label::new(RichText::new(text).color(ctx.theme.text_weak)).wrap());
    }
    caption_ui(ui, spec, ctx);
}

/// A row with a list to choose from.
fn chosen_ui<'a, T: Copy + PartialEq>(
    ui: &mut Ui,
    label: &str,
    value: &mut T,
    choices: impl IntoIterator<Item = (T, &'a str)>,
) {
    let choices: Vec<(T, &str)> = choices.into_iter().collect();
    let text = |value: &T| choices.iter().find(|(choice, _)| choice == value).map_or("", |(_, text)| text).to_owned();
    choice_ui(ui, label, 210.0, value, choices.iter().map(|(choice, _)| *choice), text);
    ui.end_row();
}

/// The time range by numbers, by what the window shows and by the reading cursors.
fn range_ui(ui: &mut Ui, spec: &mut FigureSpec, ctx: &PanelContext<'_>) {
    let whole_ns = (0, ctx.recording.duration_ns.max(1));
    let (begin_ns, end_ns) = spec.range_ns.unwrap_or(whole_ns);
    let [mut begin_s, mut end_s] = [begin_ns, end_ns].map(seconds_from_ns);
    let last_s = seconds_from_ns(whole_ns.1);
    let name = ui.label("Time");
    let changed = ui.horizontal(|ui| {
        let drag = |value| DragValue::new(value).speed(0.05).max_decimals(3).suffix(" s").range(0.0..=last_s);
        let begin = ui.add(drag(&mut begin_s)).labelled_by(name.id).changed();
        ui.label("to");
        ui.add(drag(&mut end_s)).changed() || begin
    });
    ui.end_row();
    if changed.inner && begin_s < end_s {
        spec.range_ns = Some((ns_from_seconds(begin_s), ns_from_seconds(end_s)));
    }
    ui.label("");
    ui.horizontal(|ui| {
        if ui.button("Whole log").clicked() {
            spec.range_ns = None;
        }
        let shown = ctx.selection.visible_ns;
        if ui.add_enabled(shown.is_some(), Button::new("As shown")).on_hover_text("Range of the plots").clicked() {
            spec.range_ns = shown;
        }
        let [a_ns, b_ns] = ReadingCursor::ALL.map(|cursor| ctx.selection.reading.cursor_ns(cursor));
        let between = a_ns.zip(b_ns).map(|(a_ns, b_ns)| (a_ns.min(b_ns), a_ns.max(b_ns)));
        let between = between.filter(|(begin_ns, end_ns)| begin_ns < end_ns);
        let button = ui.add_enabled(between.is_some(), Button::new("A to B"));
        if button.on_hover_text("Range between the reading cursors (C, V)").clicked() {
            spec.range_ns = between;
        }
    });
    ui.end_row();
    ui.label("Values");
    let mut at_cursor = spec.cursor_ns.is_some();
    let text = format!("At the cursor, {:.3} s", seconds_from_ns(ctx.cursor_ns));
    ui.checkbox(&mut at_cursor, text).on_hover_text("Otherwise those at the end of the range, without the cursor line");
    spec.cursor_ns = at_cursor.then_some(ctx.cursor_ns);
    ui.end_row();
}

fn caption_ui(ui: &mut Ui, spec: &mut FigureSpec, ctx: &PanelContext<'_>) {
    let mut shown = spec.caption.is_some();
    ui.checkbox(&mut shown, "Caption below the panel")
        .on_hover_text("Always part of the metadata of PDF and SVG files");
    let legend = spec.text(ctx.recording).caption();
    match (&mut spec.caption, shown) {
        (Some(caption), true) => {
            ScrollArea::vertical().id_salt("caption").max_height(96.0).show(ui, |ui| {
                ui.add(TextEdit::multiline(caption).hint_text(legend).desired_width(f32::INFINITY));
            });
        }
        (caption, true) => *caption = Some(String::new()),
        (caption, false) => {
            *caption = None;
            ScrollArea::vertical().id_salt("legend").max_height(96.0).show(ui, |ui| {
                ui.add(Label::new(RichText::new(legend).color(ctx.theme.text_weak)).wrap().selectable(true));
            });
        }
    }
}

/// The figure, drawn again after a change.
fn preview_ui(
    ui: &mut Ui,
    spec: &FigureSpec,
    preview: &mut Option<Preview>,
    panels: &Panels,
    ctx: &mut PanelContext<'_>,
) {
    let computed_ns = if ctx.recording.is_finished() { ctx.recording.computed_ns() } else { 0 };
    if preview.as_ref().is_none_or(|known| known.spec != *spec || known.computed_ns != computed_ns) {
        // A pixel of the screen for each pixel, as far as the preview is not larger than its place.
        let points = spec.points(ctx.recording);
        let fit = (PREVIEW.x / points.x).min(PREVIEW.y / points.y).min(1.5) * ui.ctx().pixels_per_point();
        let pixels = spec.pixels(fit.clamp(0.3, 4.0), input_of(panels, ctx));
        let size = [pixels.width() as usize, pixels.height() as usize];
        let image = ColorImage::from_rgba_unmultiplied(size, pixels.as_raw());
        let texture = ui.ctx().load_texture("figure", image, TextureOptions::LINEAR);
        *preview = Some(Preview { spec: spec.clone(), computed_ns, texture });
    }
    if let Some(Preview { texture, .. }) = preview {
        ui.add(Image::new(&*texture).max_size(PREVIEW).corner_radius(0.0)).on_hover_text("Preview");
    }
}

fn input_of<'a>(panels: &Panels, ctx: &'a mut PanelContext<'_>) -> FigureInput<'a> {
    let PanelContext { recording, playback, selection, images, .. } = ctx;
    FigureInput { recording, images: &mut **images, playback, selection: selection.clone(), panels: panels.views() }
}

fn command_ui(ui: &mut Ui, ctx: &PanelContext<'_>, command: &str) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("Command that repeats the figure").color(ctx.theme.text_weak));
        if ui.small_button("Copy").clicked() {
            ui.copy_text(command.to_owned());
        }
        if has_forks(ctx.recording) {
            ui.label(RichText::new("needs the saved session (Ctrl+S)").color(ctx.theme.warn));
        }
    });
    ui.add(Label::new(RichText::new(command).monospace().color(ctx.theme.text)).wrap().selectable(true));
}

fn has_forks(recording: &Recording) -> bool {
    recording.runs.iter().any(|run| run.origin.is_some())
}

/// The log, or with forks the saved session, as the command names it.
fn log_of(recording: &Recording) -> String {
    if has_forks(recording) {
        let stem = recording.log_stem();
        format!("dcvins-output/{stem}/{stem}.session.json")
    } else {
        recording.log_path.display().to_string()
    }
}

/// Path of the file, with its extension.
fn path_of(spec: &FigureSpec, format: FigureFormat, recording: &Recording) -> String {
    let view = spec.view.map_or_else(String::new, |view| format!("-{}", view.name()));
    let range = spec.range_ns.map_or_else(String::new, |(begin_ns, end_ns)| {
        format!("-{:.2}-{:.2}s", seconds_from_ns(begin_ns), seconds_from_ns(end_ns))
    });
    let (stem, panel, width_mm) = (recording.log_stem(), spec.panel.name(), spec.width_mm);
    format!("dcvins-output/{stem}/{panel}{view}{range}-{width_mm}mm.{}", format.name())
}
