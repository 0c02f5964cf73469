//! Drawing of figures as PDF, SVG or pixels, and of one panel without the window around it.

use std::cell::RefCell;

use egui::{CentralPanel, Frame, Label, Panel, RichText, Ui, Vec2};
use image::RgbaImage;

use super::spec::{FigureFormat, FigureSpec};
use crate::gui::desktop::DrawnFigure;
use crate::gui::rendering::{headless, headless::HeadlessOptions};
use crate::gui::theme::{PANEL_MARGIN, Theme};
use crate::gui::window::panels::Panels;
use crate::gui::{ImageSource, PanelContext, PanelName, Playback, Presentation, Selection};
use crate::observability::SlidePosition;
use crate::session::Recording;
use crate::text::Named as _;

/// Pixels per point at which vectors are laid out: positions are rounded to pixels.
const VECTOR_PIXELS_PER_POINT: f32 = 4.0;
/// Pixels per inch of a PNG.
const DPI: f64 = 300.0;
/// Largest side in pixels.
const MAX_SIDE_PX: f32 = 16_384.0;
/// Largest side in pixels that follows from the content.
const MAX_CONTENT_SIDE_PX: f32 = 8192.0;

/// Recording and state of the window that a figure shows.
pub struct FigureInput<'a> {
    pub recording: &'a Recording,
    pub images: &'a mut dyn ImageSource,
    pub playback: &'a Playback,
    /// Selection of which time range, run and cameras are replaced.
    pub selection: Selection,
    /// Panels with their views.
    pub panels: Panels,
}

impl<'a> FigureInput<'a> {
    /// Input with panels in their initial state and the chain of the shown run moved by `slide`.
    pub fn new(
        recording: &'a Recording,
        images: &'a mut dyn ImageSource,
        playback: &'a Playback,
        slide: Option<SlidePosition>,
    ) -> Self {
        let selection = Selection { slide, ..Selection::default() };
        Self { recording, images, playback, selection, panels: Panels::default() }
    }
}

impl FigureSpec {
    /// Draws the figure; `description` is kept in the metadata of PDF and SVG files. `None` if a font cannot be embedded
    /// in a PDF.
    pub fn draw(&self, format: FigureFormat, description: &str, input: FigureInput<'_>) -> Option<DrawnFigure> {
        let text = self.text(input.recording);
        let texts = [text.title.as_str(), description];
        match format {
            FigureFormat::Pdf => self.with_ui(VECTOR_PIXELS_PER_POINT, input, |options, size_mm, ui| {
                headless::pdf_of(options, size_mm, texts, ui).map(DrawnFigure::File)
            }),
            FigureFormat::Svg => self.with_ui(VECTOR_PIXELS_PER_POINT, input, |options, size_mm, ui| {
                Some(DrawnFigure::File(headless::svg_in_mm(options, size_mm, texts, ui).into_bytes()))
            }),
            FigureFormat::Png => Some(DrawnFigure::Pixels(self.pixels((self.scale() * DPI / 72.0) as f32, input))),
        }
    }

    /// Draws the figure as pixels at a resolution in pixels per point of the panel.
    pub(in crate::gui::window) fn pixels(&self, pixels_per_point: f32, input: FigureInput<'_>) -> RgbaImage {
        self.with_ui(pixels_per_point, input, |options, _, ui| headless::draw(options, ui))
    }

    /// Calls a function with the options, the size in millimetres, and the user interface of the figure.
    fn with_ui<T>(
        &self,
        pixels_per_point: f32,
        input: FigureInput<'_>,
        draw: impl FnOnce(HeadlessOptions, [f64; 2], &mut dyn FnMut(&mut Ui)) -> T,
    ) -> T {
        let FigureInput { recording, images, playback, mut selection, panels } = input;
        let theme = Theme::of(self.theme);
        let cursor_ns = self.stamp_ns(recording);
        (selection.run, selection.visible_ns) = (self.run, self.range_ns);
        selection.cameras = self.cameras.clone();
        let caption = self.shown_caption(recording);
        let panels = RefCell::new(panels);
        panels.borrow_mut().comparison.view = self.view;
        let presentation = if self.cursor_ns.is_some() { Presentation::Figure } else { Presentation::FigureOfRange };
        let mut ui = |ui: &mut Ui| {
            // Commands of the panel have no effect.
            let commands = &mut Vec::new();
            let (images, selection) = (&mut *images, &mut selection);
            let ctx = &mut PanelContext {
                recording,
                cursor_ns,
                playback,
                images,
                selection,
                theme: &theme,
                presentation,
                commands,
            };
            if let Some(caption) = &caption {
                let frame = Frame::new().fill(theme.surface).inner_margin(PANEL_MARGIN);
                let below = Panel::bottom("caption").resizable(false).show_separator_line(false).frame(frame);
                below.show(ui, |ui| ui.add(Label::new(RichText::new(caption).color(theme.text)).wrap()));
            }
            alone_ui(self.panel, ui, &mut panels.borrow_mut(), ctx);
        };
        let options_of = |size: Vec2| {
            let side = |points: f32| (points * pixels_per_point).round().clamp(16.0, MAX_SIDE_PX) as u32;
            HeadlessOptions { size_px: [side(size.x), side(size.y)], pixels_per_point, theme: self.theme }
        };
        let size = self.points(recording);
        let options = match self.height_mm {
            Some(_) => options_of(size),
            None => complete(self.panel, options_of(size), &panels, &mut ui),
        };
        let drawn = Vec2::new(options.size_px[0] as f32, options.size_px[1] as f32);
        draw(options, self.size_mm(drawn), &mut ui)
    }
}

/// Draws one panel into all of `ui`.
pub fn alone_ui(panel: PanelName, ui: &mut Ui, panels: &mut Panels, ctx: &mut PanelContext<'_>) {
    let frame = Frame::new().fill(ctx.theme.surface).inner_margin(PANEL_MARGIN);
    ctx.move_chain();
    CentralPanel::no_frame().frame(frame).show(ui, |ui| panels.get(panel).ui(ui, ctx));
}

/// Options with the size at which tables and plots of a figure that would scroll are shown completely.
pub(crate) fn complete(
    panel: PanelName,
    options: HeadlessOptions,
    panels: &RefCell<Panels>,
    ui: &mut dyn FnMut(&mut Ui),
) -> HeadlessOptions {
    if panel != PanelName::Comparison {
        return options;
    }
    headless::svg_of(options, "clip", panel.name(), ui);
    let wanted = panels.borrow().comparison.figure_size * options.pixels_per_point;
    panels.borrow_mut().drop_textures();
    let [width, height] = options.size_px;
    let side = |least: u32, wanted: f32| least.max(wanted.ceil().min(MAX_CONTENT_SIDE_PX) as u32);
    HeadlessOptions { size_px: [side(width, wanted.x), side(height, wanted.y)], ..options }
}
