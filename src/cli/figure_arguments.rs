//! Options of `dcvins screenshot` for figures of papers.

use anyhow::{Result, bail};
use clap::Args;
use dcvins::geometry::{ns_from_seconds, seconds_from_ns};
use dcvins::gui::comparison::ComparisonView;
use dcvins::gui::theme::ThemeName;
use dcvins::gui::window::{FIGURE_FONT_PT, FIGURE_SIDE_MM, FigureSpec};
use dcvins::gui::{PanelName, ShownCameras};
use dcvins::session::Recording;
use dcvins::text::Named as _;

use crate::cli::shared_arguments::{seconds, within};

/// Width of a figure without --width-mm: the text of an A4 page.
const DEFAULT_WIDTH_MM: f64 = 175.0;
/// Size of the text without --font-pt.
const DEFAULT_FONT_PT: f64 = 8.0;

#[derive(Args, Clone, Debug)]
pub(crate) struct FigureArguments {
    /// Start of the time range of all plots, in seconds since the first message of the log.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, requires = "to")]
    pub from: Option<f64>,
    /// End of the time range of all plots; without --at, values are shown at this time.
    #[arg(long, value_name = "SECONDS", value_parser = seconds, requires = "from")]
    pub to: Option<f64>,
    /// Width of a figure for a paper in millimetres, for example 85 or 175 for one or two columns; with it the panel is
    /// drawn without the cursor line (unless --at is given) and PNGs have 300 dpi.
    #[arg(long, value_name = "MM", value_parser = side_mm, conflicts_with_all = ["size", "scale", "controls"])]
    pub width_mm: Option<f64>,
    /// Height of a figure in millimetres [default: height of the content].
    #[arg(long, value_name = "MM", value_parser = side_mm, conflicts_with_all = ["size", "scale", "controls"])]
    pub height_mm: Option<f64>,
    /// Size of the labels of a figure in points (default: 8).
    #[arg(long, value_name = "PT", value_parser = font_pt, conflicts_with_all = ["size", "scale", "controls"])]
    pub font_pt: Option<f64>,
    /// Text below a figure; without a text the legend of the panel.
    #[arg(long, value_name = "TEXT", num_args = 0..=1, default_missing_value = "")]
    pub caption: Option<String>,
    /// View of the comparison panel: all, numbers, differences, errors, images, scenes or directions.
    #[arg(long, value_name = "NAME", value_parser = view)]
    pub view: Option<ComparisonView>,
    /// Run of panels that show one run, by its name.
    #[arg(long, value_name = "NAME")]
    pub shown_run: Option<String>,
    /// Camera of that run whose image the image panel shows, or `all` [default: the main camera].
    #[arg(long, value_name = "KEY|all")]
    pub camera: Option<String>,
}

fn side_mm(text: &str) -> Result<f64, String> {
    within(text, FIGURE_SIDE_MM, "millimetres")
}

fn font_pt(text: &str) -> Result<f64, String> {
    within(text, FIGURE_FONT_PT, "points")
}

fn view(text: &str) -> Result<ComparisonView, String> {
    ComparisonView::from_name(text).ok_or_else(|| format!("expected {}", ComparisonView::alternatives()))
}

impl FigureArguments {
    /// True if an option asks for a figure with a size on paper.
    pub(crate) fn has_paper_size(&self) -> bool {
        self.width_mm.is_some() || self.height_mm.is_some() || self.font_pt.is_some() || self.caption.is_some()
    }

    /// Time range of all plots in nanoseconds since the log began; `None` for the whole log.
    pub(crate) fn range_ns(&self) -> Result<Option<(i64, i64)>> {
        let (Some(from_s), Some(to_s)) = (self.from, self.to) else { return Ok(None) };
        if from_s >= to_s {
            bail!("--from {from_s} --to {to_s}: the range ends before it begins; give --from below --to");
        }
        Ok(Some((ns_from_seconds(from_s), ns_from_seconds(to_s))))
    }

    /// Index of the run that panels of one run show.
    pub(crate) fn run(&self, recording: &Recording) -> Result<usize> {
        let Some(name) = &self.shown_run else { return Ok(0) };
        let labels: Vec<&str> = recording.runs.iter().map(|run| run.spec.label.as_str()).collect();
        match labels.iter().position(|label| label == name) {
            Some(run) => Ok(run),
            None => bail!("--shown-run {name}: expected one of {}", labels.join(", ")),
        }
    }

    /// Cameras of the image panel.
    pub(crate) fn cameras(&self, recording: &Recording) -> Result<ShownCameras> {
        let Some(name) = &self.camera else { return Ok(ShownCameras::Main) };
        let run = &recording.runs[self.run(recording)?];
        let keys = run.last_camera_keys();
        match ShownCameras::of_name(name) {
            ShownCameras::Key(key) if !keys.contains(&key.as_str()) => {
                bail!("--camera {name}: run {} has {}; give one of them or all", run.spec.label, keys.join(", "))
            }
            cameras => Ok(cameras),
        }
    }

    /// The figure of a panel; `cursor_ns` is the stamp of --at or --every.
    pub(crate) fn spec(
        &self,
        panel: &str,
        theme: ThemeName,
        cursor_ns: Option<i64>,
        recording: &Recording,
    ) -> Result<FigureSpec> {
        let Some(panel) = PanelName::from_name(panel) else {
            bail!("a figure shows one panel: name it with --panel, one of {}", PanelName::names());
        };
        let end_s = seconds_from_ns(recording.duration_ns);
        if self.from.is_some_and(|from_s| from_s >= end_s) {
            bail!("--from {} is after the end of the log at {end_s:.3} s", self.from.unwrap_or_default());
        }
        Ok(FigureSpec {
            panel,
            view: self.view,
            run: self.run(recording)?,
            cameras: self.cameras(recording)?,
            range_ns: self.range_ns()?,
            cursor_ns,
            width_mm: self.width_mm.unwrap_or(DEFAULT_WIDTH_MM),
            height_mm: self.height_mm,
            font_pt: self.font_pt.unwrap_or(DEFAULT_FONT_PT),
            theme,
            caption: self.caption.clone(),
        })
    }
}
