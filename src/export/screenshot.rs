//! Screenshots and figures of panels without a window: the same bytes on every machine.

use std::cell::RefCell;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use egui::Ui;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _, RgbaImage};
use thiserror::Error;

use super::error::ExportError;
use crate::files::output;
use crate::gui::comparison::ComparisonView;
use crate::gui::desktop::DrawnFigure;
use crate::gui::rendering::headless::{self, HeadlessOptions};
use crate::gui::rendering::offscreen::{Offscreen, OffscreenError};
use crate::gui::study::StudyPanel;
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::window::{
    FigureFormat, FigureInput, FigureSpec, MainWindow, Panels, Preset, alone_ui, complete, panel_table, window_ui,
};
use crate::gui::{ImageSource, PanelContext, PanelName, Playback, Presentation, Selection, ShownCameras};
use crate::observability::SlidePosition;
use crate::session::Recording;
use crate::simulation::PrescribedMotion;
use crate::text::Named as _;

/// Name of the whole window, and of the whole view of a study.
pub(super) const WHOLE: &str = "all";

/// [`WHOLE`], then the names of the panels.
const fn with_whole<Panel, const COUNT: usize>(panels: &[(Panel, &'static str)]) -> [&'static str; COUNT] {
    let mut names = [WHOLE; COUNT];
    let mut index = 0;
    while index < panels.len() {
        names[index + 1] = panels[index].1;
        index += 1;
    }
    names
}

pub const PANEL_NAMES: [&str; PanelName::NAMES.len() + 1] = with_whole(PanelName::NAMES);

pub const STUDY_PANEL_NAMES: [&str; StudyPanel::NAMES.len() + 1] = with_whole(StudyPanel::NAMES);

/// Largest side of a screenshot in pixels.
const MAX_SIDE_PX: u32 = 16_384;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Renderer {
    /// The CPU painter: needs no driver, and gives the same bytes on every machine.
    #[default]
    Cpu,
    /// A graphics adapter through wgpu, as in the window.
    Wgpu,
}

/// Size, theme and renderer of a screenshot.
#[derive(Clone, Debug, PartialEq)]
pub struct ScreenshotOptions {
    /// Width and height in pixels.
    pub size_px: [u32; 2],
    /// Pixels per point: 1 as on an ordinary screen, 2 for twice the size.
    pub pixels_per_point: f32,
    pub theme: ThemeName,
    pub renderer: Renderer,
    /// Index of the run in panels that show one run.
    pub run: usize,
    /// Cameras of that run in the image panel.
    pub cameras: ShownCameras,
    /// Direction and distance by which the chain of that run is moved.
    pub slide: Option<SlidePosition>,
    /// Layout of the whole window.
    pub layout: Preset,
    /// Markers, breakpoints and state of playback of a saved session.
    pub playback: Playback,
    /// Time range of all plots in nanoseconds since the log began; `None` for the whole log.
    pub visible_ns: Option<(i64, i64)>,
    /// View of the comparison panel; `None` for all views that fit.
    pub view: Option<ComparisonView>,
    /// Planned motion that the laboratory shows; `None` for a listed one.
    pub motion: Option<PrescribedMotion>,
    /// Presentation of a single panel: as a figure or with its controls; the whole window always has its controls.
    pub presentation: Presentation,
}

impl Default for ScreenshotOptions {
    fn default() -> Self {
        Self {
            size_px: [1920, 1080],
            pixels_per_point: 1.0,
            theme: ThemeName::Light,
            renderer: Renderer::Cpu,
            run: 0,
            cameras: ShownCameras::Main,
            slide: None,
            layout: Preset::default(),
            playback: Playback::default(),
            visible_ns: None,
            view: None,
            motion: None,
            presentation: Presentation::Figure,
        }
    }
}

impl ScreenshotOptions {
    fn open_motion(&self, panels: &mut Panels) {
        if let Some(motion) = &self.motion {
            panels.laboratory.open_motion(motion.clone());
        }
    }
}

/// Reason why a screenshot cannot be made.
#[derive(Debug, Error)]
pub enum ScreenshotError {
    #[error("unknown panel '{name}': expected one of {}", PANEL_NAMES.join(", "))]
    UnknownPanel { name: String },
    #[error("unknown panel '{name}' of a study: expected one of {}", STUDY_PANEL_NAMES.join(", "))]
    UnknownStudyPanel { name: String },
    /// Filter, groups or metric of a study are invalid.
    #[error("{problem}")]
    StudyOptions { problem: String },
    #[error("a screenshot of {width}×{height} pixels cannot be drawn: expected 16 to {MAX_SIDE_PX} each way")]
    Size { width: u32, height: u32 },
    #[error("a scale of {scale} cannot be drawn: expected 0.25 to 8 pixels per point")]
    Scale { scale: f32 },
    #[error("cannot embed the fonts of the window in a PDF: write an SVG instead")]
    Font,
    /// The graphics adapter could not paint it.
    #[error(transparent)]
    Graphics(#[from] OffscreenError),
    #[error("cannot encode the screenshot as PNG: {source}")]
    Encode { source: image::ImageError },
    #[error(transparent)]
    Write(#[from] ExportError),
}

/// Draws one panel, or the whole window, for a recording at a cursor.
pub fn draw_panel(
    name: &str,
    recording: &Recording,
    cursor_ns: i64,
    images: &mut dyn ImageSource,
    options: &ScreenshotOptions,
) -> Result<RgbaImage, ScreenshotError> {
    with_panel(name, recording, cursor_ns, images, options, |headless, ui| match options.renderer {
        Renderer::Cpu => Ok(headless::draw(headless, ui)),
        Renderer::Wgpu => Ok(Offscreen::open()?.draw(headless, ui)?),
    })
}

/// The same panel as an SVG drawing; images and the 3D scene are embedded as pixels.
///
/// `prefix` is prepended to the ids of its elements, so that one page can contain several; `title` is its title.
pub fn draw_panel_svg(
    name: &str,
    recording: &Recording,
    cursor_ns: i64,
    images: &mut dyn ImageSource,
    options: &ScreenshotOptions,
    [prefix, title]: [&str; 2],
) -> Result<String, ScreenshotError> {
    with_panel(name, recording, cursor_ns, images, options, |headless, ui| {
        Ok(headless::svg_of(headless, prefix, title, ui))
    })
}

/// The values of a panel as CSV; of the options run, cameras, slide and motion have an effect.
///
/// # Errors
/// If no single panel has this name.
pub fn panel_csv(
    name: &str,
    recording: &Recording,
    cursor_ns: i64,
    images: &mut dyn ImageSource,
    options: &ScreenshotOptions,
) -> Result<String, ScreenshotError> {
    let panel = PanelName::from_name(name);
    let panel = panel.ok_or_else(|| ScreenshotError::UnknownPanel { name: name.to_owned() })?;
    let theme = Theme::of(options.theme);
    let (run, slide, cameras) = (options.run, options.slide, options.cameras.clone());
    let mut selection = Selection { run, cameras, slide, ..Selection::default() };
    let playback = Playback { playing: false, ..options.playback.clone() };
    let (selection, commands, playback, theme) = (&mut selection, &mut Vec::new(), &playback, &theme);
    let presentation = options.presentation;
    let ctx = &mut PanelContext { recording, cursor_ns, playback, images, selection, theme, presentation, commands };
    let mut panels = Panels::default();
    options.open_motion(&mut panels);
    Ok(panel_table(panel, &mut panels, ctx))
}

/// Passes the panel's user interface to a function that draws it.
fn with_panel<T>(
    name: &str,
    recording: &Recording,
    cursor_ns: i64,
    images: &mut dyn ImageSource,
    options: &ScreenshotOptions,
    draw: impl FnOnce(HeadlessOptions, &mut dyn FnMut(&mut Ui)) -> Result<T, ScreenshotError>,
) -> Result<T, ScreenshotError> {
    let panel = PanelName::from_name(name);
    if panel.is_none() && name != WHOLE {
        return Err(ScreenshotError::UnknownPanel { name: name.to_owned() });
    }
    check(options)?;
    let theme = Theme::of(options.theme);
    let mut window = MainWindow::default();
    window.tiles.arrange(options.layout);
    options.open_motion(&mut window.panels);
    let panels = RefCell::new(Panels::default());
    panels.borrow_mut().comparison.view = options.view;
    options.open_motion(&mut panels.borrow_mut());
    let (run, slide, visible_ns) = (options.run, options.slide, options.visible_ns);
    let cameras = options.cameras.clone();
    let mut selection = Selection { run, cameras, visible_ns, slide, ..Selection::default() };
    let playback = Playback { playing: false, ..options.playback.clone() };
    let presentation = if panel.is_some() { options.presentation } else { Presentation::Interactive };
    let mut ui = |ui: &mut Ui| {
        // Commands of the panel have no effect.
        let commands = &mut Vec::new();
        let selection = &mut selection;
        let images = &mut *images;
        let (playback, theme) = (&playback, &theme);
        let context =
            &mut PanelContext { recording, cursor_ns, playback, images, selection, theme, presentation, commands };
        match panel {
            Some(panel) => alone_ui(panel, ui, &mut panels.borrow_mut(), context),
            None => window_ui(ui, &mut window, context),
        }
    };
    let ScreenshotOptions { size_px, pixels_per_point, theme, .. } = *options;
    let headless = HeadlessOptions { size_px, pixels_per_point, theme };
    let headless = match panel {
        Some(panel) if presentation.is_figure() => complete(panel, headless, &panels, &mut ui),
        _ => headless,
    };
    draw(headless, &mut ui)
}

pub(super) fn check(options: &ScreenshotOptions) -> Result<(), ScreenshotError> {
    let [width, height] = options.size_px;
    if [width, height].iter().any(|side| !(16..=MAX_SIDE_PX).contains(side)) {
        return Err(ScreenshotError::Size { width, height });
    }
    let scale = options.pixels_per_point;
    if (0.25..=8.0).contains(&scale) { Ok(()) } else { Err(ScreenshotError::Scale { scale }) }
}

/// Encodes an opaque image as PNG, always with the same settings.
pub fn png_bytes(screenshot: &RgbaImage) -> Result<Vec<u8>, ScreenshotError> {
    let rgb: Vec<u8> = screenshot.pixels().flat_map(|pixel| [pixel.0[0], pixel.0[1], pixel.0[2]]).collect();
    let mut bytes = Cursor::new(Vec::new());
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive);
    encoder
        .write_image(&rgb, screenshot.width(), screenshot.height(), ExtendedColorType::Rgb8)
        .map_err(|source| ScreenshotError::Encode { source })?;
    Ok(bytes.into_inner())
}

/// Writes an image as PNG and creates its folder if necessary.
pub fn write_png(screenshot: &RgbaImage, path: &Path) -> Result<(), ScreenshotError> {
    write_screenshot(&png_bytes(screenshot)?, path)
}

/// Writes a drawing as SVG and creates its folder if necessary.
pub fn write_svg(drawing: &str, path: &Path) -> Result<(), ScreenshotError> {
    write_screenshot(drawing.as_bytes(), path)
}

/// Writes a table of comma-separated values and creates its folder if necessary.
pub fn write_csv(table: &str, path: &Path) -> Result<(), ScreenshotError> {
    write_screenshot(table.as_bytes(), path)
}

/// Writes an encoded screenshot or its table, and creates its folder if necessary.
pub fn write_screenshot(bytes: &[u8], path: &Path) -> Result<(), ScreenshotError> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        fs::create_dir_all(folder).map_err(ExportError::write(folder))?;
    }
    Ok(output::write_file(path, bytes).map_err(ExportError::write(path))?)
}

/// Draws a figure; `command` is the command that repeats it. It is kept with the caption in the metadata of PDF and SVG
/// files.
///
/// # Errors
/// If the figure cannot be encoded.
pub fn figure_bytes(
    spec: &FigureSpec,
    format: FigureFormat,
    command: &str,
    input: FigureInput<'_>,
) -> Result<Vec<u8>, ScreenshotError> {
    let description = format!("{} Command: {command}", spec.text(input.recording).caption());
    match spec.draw(format, &description, input) {
        Some(DrawnFigure::File(bytes)) => Ok(bytes),
        Some(DrawnFigure::Pixels(pixels)) => png_bytes(&pixels),
        None => Err(ScreenshotError::Font),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::gui::samples::{sample_images, sample_recording};
    use crate::gui::tests::keep_screenshot;

    #[test]
    fn every_panel_is_drawn_twice_alike() {
        let recording = sample_recording();
        let mut seen: Vec<Vec<u8>> = Vec::new();
        for name in PANEL_NAMES {
            let options = ScreenshotOptions { size_px: [800, 500], ..ScreenshotOptions::default() };
            let draw = || {
                let screenshot = draw_panel(name, &recording, 5_500_000_000, &mut sample_images(), &options).unwrap();
                let size = [screenshot.width(), screenshot.height()];
                // The comparison of several runs is as large as its tables and plots.
                let grows = name == "comparison" && size[0] >= 800 && size[1] > 500;
                assert!(size == options.size_px || grows, "{name}: {size:?}");
                png_bytes(&screenshot).unwrap()
            };
            let bytes = draw();
            assert!(bytes == draw(), "two screenshots of '{name}' differ");
            assert!(!seen.contains(&bytes), "'{name}' looks like another panel");
            assert!(image::load_from_memory(&bytes).is_ok(), "{name}");
            seen.push(bytes);
        }
    }

    #[test]
    fn the_table_of_the_timeline_holds_every_step_and_every_event() {
        let recording = sample_recording();
        let images = &mut sample_images();
        let table = panel_csv("timeline", &recording, 5_500_000_000, images, &ScreenshotOptions::default()).unwrap();
        let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
        let column = |name: &str| rows[0].iter().position(|head| *head == name).unwrap();
        let (run, phase, event) = (column("run"), column("phase"), column("event"));
        let (informed, features) = (column("rank_informed"), column("features"));
        for record in &recording.runs {
            let of_run: Vec<_> = rows.iter().filter(|row| row[run] == record.spec.label).collect();
            let steps: Vec<_> = of_run.iter().filter(|row| !row[phase].is_empty()).collect();
            assert_eq!(steps.len(), record.steps.len(), "{}", record.spec.label);
            for (row, step) in steps.iter().zip(&record.steps) {
                assert_eq!(row[features], step.feature_count().to_string());
                let rank = step.rank.as_ref().filter(|rank| !rank.parameters.is_empty());
                assert_eq!(row[informed], rank.map_or_else(String::new, |rank| rank.rank_informed.to_string()));
            }
            let events = record.steps.iter().flat_map(|step| &step.report.events);
            let notable = events.filter(|event| event.kind.is_notable()).count();
            assert_eq!(of_run.iter().filter(|row| !row[event].is_empty()).count(), notable);
        }
        assert!(rows.iter().skip(1).any(|row| !row[event].is_empty()), "{table}");
    }

    #[test]
    fn every_panel_is_drawn_as_lines_and_texts_twice_alike() {
        let recording = sample_recording();
        let words = [
            ("all", "Convergence"),
            ("image", "tracked"),
            ("scene", "position error"),
            ("convergence", "±3σ"),
            ("rank", "informed rank over time"),
            ("residuals", "reprojection RMS after the solve, px"),
            ("timeline", "features"),
        ];
        for name in PANEL_NAMES {
            for (theme, ground) in [(ThemeName::Light, "light"), (ThemeName::Dark, "dark"), (ThemeName::Print, "print")]
            {
                let options = ScreenshotOptions { size_px: [1200, 800], theme, ..ScreenshotOptions::default() };
                let draw = || {
                    let images = &mut sample_images();
                    draw_panel_svg(name, &recording, 5_500_000_000, images, &options, ["p", "a & b"]).unwrap()
                };
                let svg = draw();
                assert!(svg == draw(), "two drawings of '{name}' differ");
                assert!(svg.starts_with("<svg xmlns") && svg.ends_with("</svg>\n"), "{name}, {ground}");
                assert!(svg.contains("<title>a &amp; b</title>") && svg.contains("<text"), "{name}, {ground}");
                let size = r#"width="1200" height="800" viewBox="0 0 1200 800""#;
                assert!(svg.contains(size) || name == "comparison", "{name}, {ground}");
                for (_, word) in words.iter().filter(|(panel, _)| *panel == name) {
                    assert!(svg.contains(word), "'{name}' does not say '{word}' as text");
                }
            }
        }
    }

    #[test]
    fn the_window_has_its_size_at_any_scale() {
        let recording = sample_recording();
        for (theme, scale, size_px) in [
            (ThemeName::Dark, 1.0, [1920, 1080]),
            (ThemeName::Light, 1.0, [1920, 1080]),
            (ThemeName::Print, 1.5, [2400, 1350]),
        ] {
            let options = ScreenshotOptions { size_px, pixels_per_point: scale, theme, ..ScreenshotOptions::default() };
            let screenshot = draw_panel("all", &recording, 5_500_000_000, &mut sample_images(), &options).unwrap();
            keep_screenshot(&format!("all-{}", theme.name()), &screenshot);
            assert_eq!([screenshot.width(), screenshot.height()], size_px);
        }
    }

    #[test]
    fn rejections_report_what_was_expected() {
        let recording = sample_recording();
        let draw = |name: &str, size_px, scale| {
            let options = ScreenshotOptions { size_px, pixels_per_point: scale, ..ScreenshotOptions::default() };
            draw_panel(name, &recording, 0, &mut sample_images(), &options).unwrap_err().to_string()
        };
        let text = draw("images", [640, 480], 1.0);
        assert!(text.starts_with("unknown panel 'images': expected one of all, image, scene"), "{text}");
        let text = draw("image", [0, 480], 1.0);
        assert!(text.starts_with("a screenshot of 0×480 pixels cannot be drawn"), "{text}");
        for scale in [0.0, -1.0, f32::NAN, 100.0] {
            assert!(draw("image", [640, 480], scale).contains("pixels per point"));
        }
    }

    #[test]
    fn files_are_written_into_new_folders() {
        let folder = tempfile::tempdir().unwrap();
        let screenshot = RgbaImage::from_pixel(20, 30, image::Rgba([1, 2, 3, 255]));
        let path = folder.path().join("a/b/screenshot.png");
        write_png(&screenshot, &path).unwrap();
        assert_eq!(fs::read(&path).unwrap(), png_bytes(&screenshot).unwrap());
        let error = write_png(&screenshot, &path.join("below-a-file.png")).unwrap_err().to_string();
        assert!(error.starts_with("cannot write"), "{error}");
    }
}
