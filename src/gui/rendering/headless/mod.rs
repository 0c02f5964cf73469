//! Runs egui without a window and paints the result, on the CPU or with [`Offscreen`](crate::gui::rendering::offscreen).

#[cfg(test)]
mod tests;

use std::sync::Arc;

use egui::{FullOutput, RawInput, Rect, TexturesDelta, Ui, Vec2, ViewportId, ViewportInfo};
use image::RgbaImage;

use crate::gui::theme::{Theme, ThemeName, fonts};
use crate::painting::FramePainter;
use crate::painting::chunks::{Chunk, Tessellation};
use crate::painting::painter::Painter;
use crate::painting::vector::{Drawing, Textures, elements};
use crate::painting::{pdf, svg};

/// Frames before the screenshot, in which layouts, scroll areas and plot ranges settle.
const SETTLING_FRAMES: usize = 3;
/// Default time between two frames in seconds, long enough for every animation to end.
const FRAME_TIME_S: f64 = 1.0;

/// Size and theme of a screenshot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadlessOptions {
    /// Width and height of the screenshot in pixels.
    pub size_px: [u32; 2],
    /// Pixels per point: 1 on an ordinary screen, 2 for print.
    pub pixels_per_point: f32,
    pub theme: ThemeName,
}

/// Output of egui for one frame.
pub struct PaintedFrame {
    /// Meshes of the frame, in points.
    pub chunks: Vec<Arc<Chunk>>,
    /// New, changed and freed textures.
    pub textures: TexturesDelta,
}

/// An egui context without a window; it uses egui's embedded fonts, never the system's fonts.
pub struct Headless {
    context: egui::Context,
    options: HeadlessOptions,
    tessellation: Tessellation,
    /// Time between frames, and elapsed time, in seconds.
    frame_time_s: f64,
    time_s: f64,
}

impl Headless {
    pub fn new(options: HeadlessOptions) -> Self {
        let context = egui::Context::default();
        Theme::of(options.theme).apply(&context);
        Self { context, options, tessellation: Tessellation::default(), frame_time_s: FRAME_TIME_S, time_s: 0.0 }
    }

    /// The context, for setup before the first frame.
    pub fn context(&self) -> &egui::Context {
        &self.context
    }

    /// Sets the time between frames, as in a window; by default every animation ends between two frames.
    pub fn set_frame_time_s(&mut self, frame_time_s: f64) {
        self.frame_time_s = frame_time_s;
    }

    /// Runs one frame with input events.
    pub fn frame(&mut self, events: Vec<egui::Event>, ui: impl FnMut(&mut Ui)) -> PaintedFrame {
        let output = self.run(events, ui);
        let chunks = self.tessellation.chunks(&self.context, output.shapes, output.pixels_per_point);
        PaintedFrame { chunks, textures: output.textures_delta }
    }

    fn run(&mut self, events: Vec<egui::Event>, ui: impl FnMut(&mut Ui)) -> FullOutput {
        let scale = self.options.pixels_per_point;
        let size = Vec2::new(self.options.size_px[0] as f32, self.options.size_px[1] as f32) / scale;
        let viewport = ViewportInfo { native_pixels_per_point: Some(scale), ..ViewportInfo::default() };
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(egui::Pos2::ZERO, size)),
            viewports: std::iter::once((ViewportId::ROOT, viewport)).collect(),
            max_texture_side: Some(8192),
            time: Some(self.time_s),
            focused: true,
            events,
            ..RawInput::default()
        };
        self.time_s += self.frame_time_s;
        self.context.run_ui(input, ui)
    }

    /// Runs the user interface until it has settled and returns it as elements, with a title and a description.
    fn drawing(&mut self, [title, description]: [&str; 2], mut ui: impl FnMut(&mut Ui)) -> Drawing {
        let mut textures = Textures::default();
        let mut shapes = Vec::new();
        for _ in 0..SETTLING_FRAMES {
            let mut output = self.run(Vec::new(), &mut ui);
            textures.set(&output.textures_delta);
            textures.free(&output.textures_delta);
            output.textures_delta.clear();
            shapes = output.shapes;
        }
        let HeadlessOptions { size_px, pixels_per_point, theme } = self.options;
        let size = Vec2::new(size_px[0] as f32, size_px[1] as f32) / pixels_per_point;
        let elements = elements(&shapes, size);
        let background = Theme::of(theme).background;
        Drawing { elements, textures, size, background, title: title.to_owned(), description: description.to_owned() }
    }

    /// Runs the user interface until it has settled and paints it over the theme's background.
    pub fn screenshot<P: FramePainter>(
        &mut self,
        painter: &mut P,
        mut ui: impl FnMut(&mut Ui),
    ) -> Result<RgbaImage, P::Error> {
        for _ in 1..SETTLING_FRAMES {
            let mut frame = self.frame(Vec::new(), &mut ui);
            painter.set_textures(&frame.textures);
            painter.free_textures(&frame.textures);
            frame.textures.clear();
        }
        let mut frame = self.frame(Vec::new(), &mut ui);
        painter.set_textures(&frame.textures);
        let background = Theme::of(self.options.theme).background;
        let image = painter.paint(&frame.chunks, self.options.size_px, self.options.pixels_per_point, background);
        painter.free_textures(&frame.textures);
        frame.textures.clear();
        image
    }
}

/// A screenshot of a user interface, painted on the CPU.
pub fn draw(options: HeadlessOptions, ui: impl FnMut(&mut Ui)) -> RgbaImage {
    let Ok(screenshot) = Headless::new(options).screenshot(&mut Painter::new(), ui);
    screenshot
}

/// A user interface as an SVG drawing of the size in pixels.
///
/// `title` is the title of the drawing; `prefix` is the prefix of the ids of its elements, so that one page can hold
/// several drawings.
pub fn svg_of(options: HeadlessOptions, prefix: &str, title: &str, ui: impl FnMut(&mut Ui)) -> String {
    let drawing = Headless::new(options).drawing([title, ""], ui);
    svg::document(&drawing, &options.size_px.map(|side| side.to_string()), prefix)
}

/// A user interface as an SVG drawing of a size in millimetres, with a title and a description.
pub fn svg_in_mm(options: HeadlessOptions, size_mm: [f64; 2], texts: [&str; 2], ui: impl FnMut(&mut Ui)) -> String {
    let drawing = Headless::new(options).drawing(texts, ui);
    svg::document(&drawing, &size_mm.map(|side_mm| format!("{}mm", (side_mm * 1e3).round() / 1e3)), "clip")
}

/// A user interface as a PDF of one page of a size in millimetres, with a title and a description; `None` if a font
/// cannot be embedded.
pub fn pdf_of(
    options: HeadlessOptions,
    size_mm: [f64; 2],
    texts: [&str; 2],
    ui: impl FnMut(&mut Ui),
) -> Option<Vec<u8>> {
    /// Points of 1/72 inch in a millimetre.
    const POINTS_PER_MM: f64 = 72.0 / 25.4;
    let drawing = Headless::new(options).drawing(texts, ui);
    pdf::document(&drawing, size_mm.map(|side_mm| (side_mm * POINTS_PER_MM) as f32), &fonts())
}
