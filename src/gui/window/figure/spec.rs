//! Content, size and style of a figure, and the command that repeats it.

use std::ops::RangeInclusive;

use egui::{Vec2, vec2};

use super::size::{caption_height, figure_height};
use super::text::{FigureContent, FigureText};
use crate::geometry::seconds_from_ns;
use crate::gui::comparison::ComparisonView;
use crate::gui::theme::{SMALLEST_TEXT, ThemeName};
use crate::gui::{PanelName, Presentation, ShownCameras};
use crate::session::Recording;
use crate::text::{Named, command_line};

/// Sizes of figures in millimetres.
pub const FIGURE_SIDE_MM: RangeInclusive<f64> = 20.0..=1000.0;
/// Sizes of the text of axes and labels in points of 1/72 inch.
pub const FIGURE_FONT_PT: RangeInclusive<f64> = 4.0..=24.0;
/// Points of 1/72 inch in a millimetre.
const POINTS_PER_MM: f64 = 72.0 / 25.4;

/// File formats of a figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FigureFormat {
    #[default]
    Pdf,
    Svg,
    /// Pixels at 300 dpi.
    Png,
}

impl Named for FigureFormat {
    const NAMES: &'static [(Self, &'static str)] = &[(Self::Pdf, "pdf"), (Self::Svg, "svg"), (Self::Png, "png")];
}

#[derive(Clone, Debug, PartialEq)]
pub struct FigureSpec {
    pub panel: PanelName,
    /// View of the comparison; `None` for all that fit.
    pub view: Option<ComparisonView>,
    /// Index of the run in panels that show one run.
    pub run: usize,
    /// Cameras of that run in the image panel.
    pub cameras: ShownCameras,
    /// Time range of all plots in nanoseconds since the log began; `None` for the whole log.
    pub range_ns: Option<(i64, i64)>,
    /// Stamp of values that are not over time; `None` for the end of the range, without a line of the cursor.
    pub cursor_ns: Option<i64>,
    pub width_mm: f64,
    /// Height in millimetres; `None` for the height of the content.
    pub height_mm: Option<f64>,
    /// Size of the text of axes and labels in points of 1/72 inch.
    pub font_pt: f64,
    pub theme: ThemeName,
    /// Text below the panel; `None` without one, empty for the text of the content.
    pub caption: Option<String>,
}

impl FigureSpec {
    /// The shown time range.
    pub(super) fn range(&self, recording: &Recording) -> (i64, i64) {
        self.range_ns.filter(|(begin, end)| begin < end).unwrap_or_else(|| (0, recording.duration_ns.max(1)))
    }

    /// Stamp of values that are not over time.
    pub fn stamp_ns(&self, recording: &Recording) -> i64 {
        self.cursor_ns.unwrap_or_else(|| self.range(recording).1.min(recording.last_stamp_ns()))
    }

    pub(super) fn content<'a>(&self, recording: &'a Recording) -> FigureContent<'a> {
        let Self { panel, view, run, .. } = *self;
        FigureContent {
            panel,
            view,
            recording,
            run,
            range_ns: self.range(recording),
            cursor_ns: self.stamp_ns(recording),
        }
    }

    /// The text of the content, with its title.
    pub fn text(&self, recording: &Recording) -> FigureText {
        FigureText::of(&self.content(recording))
    }

    /// Text below the panel; `None` without one.
    pub(super) fn shown_caption(&self, recording: &Recording) -> Option<String> {
        let given = self.caption.as_deref()?;
        Some(if given.is_empty() { self.text(recording).caption() } else { given.to_owned() })
    }

    /// Millimetres in a point of the panel, so that labels have the size of the font.
    fn mm_per_point(&self) -> f64 {
        self.font_pt / f64::from(SMALLEST_TEXT) / POINTS_PER_MM
    }

    /// Points of 1/72 inch in a point of the panel.
    pub(super) fn scale(&self) -> f64 {
        self.font_pt / f64::from(SMALLEST_TEXT)
    }

    /// Width and height of the panel in its points, before it grows to what it shows.
    pub(in crate::gui::window) fn points(&self, recording: &Recording) -> Vec2 {
        let width = (self.width_mm / self.mm_per_point()) as f32;
        let height = self.height_mm.map_or_else(
            || {
                let caption = self.shown_caption(recording);
                let below = caption.map_or(0.0, |caption| caption_height(&caption, width));
                figure_height(&self.content(recording), Presentation::Figure, width) + below
            },
            |height_mm| (height_mm / self.mm_per_point()) as f32,
        );
        vec2(width, height)
    }

    /// Width and height in millimetres of a panel of a size in its points.
    pub(super) fn size_mm(&self, size: Vec2) -> [f64; 2] {
        let hundredths = |mm: f64| (mm * 100.0).round() / 100.0;
        let of_content_mm = || hundredths(f64::from(size.y) * self.width_mm / f64::from(size.x.max(1.0)));
        [self.width_mm, self.height_mm.unwrap_or_else(of_content_mm)]
    }

    /// The command that draws the figure of the runs of a recording into a file; `log` is the log or a saved session.
    pub fn command(&self, recording: &Recording, log: &str, output: &str) -> String {
        let mut words: Vec<String> = ["dcvins", "screenshot", log].map(str::to_owned).to_vec();
        let mut option = |name: &str, value: String| words.extend([format!("--{name}"), value]);
        if !log.ends_with(".session.json") {
            for run in &recording.runs {
                option("run", run.spec.to_string());
            }
        }
        option("panel", self.panel.name().to_owned());
        if let Some(view) = self.view {
            option("view", view.name().to_owned());
        }
        if self.run > 0 {
            option("shown-run", recording.runs.get(self.run).map_or_else(String::new, |run| run.spec.label.clone()));
        }
        if let Some(cameras) = self.cameras.name().filter(|_| self.panel == PanelName::Image) {
            option("camera", cameras.to_owned());
        }
        if let Some((begin_ns, end_ns)) = self.range_ns {
            option("from", seconds_from_ns(begin_ns).to_string());
            option("to", seconds_from_ns(end_ns).to_string());
        }
        if let Some(cursor_ns) = self.cursor_ns {
            option("at", seconds_from_ns(cursor_ns).to_string());
        }
        option("width-mm", self.width_mm.to_string());
        if let Some(height_mm) = self.height_mm {
            option("height-mm", height_mm.to_string());
        }
        option("font-pt", self.font_pt.to_string());
        option("theme", self.theme.name().to_owned());
        if let Some(caption) = &self.caption {
            option("caption", caption.clone());
        }
        option("output", output.to_owned());
        command_line(words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording_of;

    fn spec() -> FigureSpec {
        FigureSpec {
            panel: PanelName::Comparison,
            view: Some(ComparisonView::Errors),
            run: 0,
            cameras: ShownCameras::Main,
            range_ns: Some((1_500_000_000, 4_000_000_000)),
            cursor_ns: None,
            width_mm: 85.0,
            height_mm: None,
            font_pt: 8.0,
            theme: ThemeName::Print,
            caption: None,
        }
    }

    #[test]
    fn the_command_repeats_the_figure() {
        let recording = sample_recording_of(60, &["auto", "classical"]);
        let figure = spec();
        let expected = "dcvins screenshot a.mcap --run auto --run classical --panel comparison --view errors --from 1.5 \
                        --to 4 --width-mm 85 --font-pt 8 --theme print --output b.pdf";
        assert_eq!(figure.command(&recording, "a.mcap", "b.pdf"), expected);
        let figure =
            FigureSpec { run: 1, cursor_ns: Some(2_000_000_000), height_mm: Some(60.0), range_ns: None, ..figure };
        let figure = FigureSpec { caption: Some("It's".to_owned()), ..figure };
        let expected = r"dcvins screenshot a.session.json --panel comparison --view errors --shown-run classical --at 2 --width-mm 85 --height-mm 60 --font-pt 8 --theme print --caption 'It'\''s' --output b.pdf";
        assert_eq!(figure.command(&recording, "a.session.json", "b.pdf"), expected);
        let image =
            FigureSpec { panel: PanelName::Image, view: None, cameras: ShownCameras::of_name("cam1"), ..spec() };
        let command = image.command(&recording, "a.mcap", "b.pdf");
        assert!(command.contains(" --panel image --camera cam1 --from 1.5 "), "{command}");
    }

    #[test]
    fn labels_have_the_size_of_the_font() {
        let recording = sample_recording_of(60, &["auto"]);
        let size = spec().points(&recording);
        // 85 mm are 240.9 points of 1/72 inch; labels of 11 points of the panel are 8 of them.
        assert!((f64::from(size.x) - 85.0 * POINTS_PER_MM * 11.0 / 8.0).abs() < 1e-3, "{size}");
        assert_eq!(spec().size_mm(vec2(100.0, 50.0)), [85.0, 42.5]);
        let fixed = FigureSpec { height_mm: Some(60.0), ..spec() };
        let size = fixed.points(&recording);
        assert_eq!(fixed.size_mm(size), [85.0, 60.0]);
        assert_eq!(spec().stamp_ns(&recording), recording.last_stamp_ns().min(4_000_000_000));
    }
}
