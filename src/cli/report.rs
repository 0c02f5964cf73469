//! `dcvins report`: runs the estimators, draws the figures and writes the page.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use dcvins::export::{self, ReportOptions, write_report};
use dcvins::log_check::{self, CheckReport};
use dcvins::session::{SessionPlan, image_rotations};

use crate::cli::compute::compute;
use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::exit::Outcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::run::{interrupted, is_initialized};
use crate::cli::terminal::{Progress, notify, print};
use crate::cli::value_parsers::seconds;

/// `dcvins report`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ReportArguments {
    /// The log.
    pub log: PathBuf,
    /// Folder for report.html, report.json and the files of each run.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// A time of the figures, in seconds since the first message of the log; may be given several times [default: the
    /// end].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub at: Vec<f64>,
    /// Overwrite whatever is in the folder. Without it a report replaces only a report on a log of the same name and its runs.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub estimation: EstimationArguments,
}

/// Runs `dcvins report`.
pub(crate) fn report(arguments: &ReportArguments) -> Result<Outcome> {
    let plan = SessionPlan::open(&arguments.estimation.request(arguments.log.clone()))?;
    let labels: Vec<&str> = plan.runs.iter().map(|(spec, _)| spec.label.as_str()).collect();
    export::check_report_folder(&arguments.output, &labels, &arguments.log, arguments.force)?;
    let interrupt = Interrupt::watch()?;
    let plan = SessionPlan { interrupted: interrupt.flag(), ..plan.clone() };
    #[cfg_attr(not(feature = "gui"), expect(unused_mut, reason = "only figures need steps recomputed"))]
    let mut computation = compute(&plan, None)?;
    if interrupt.is_set() && computation.recording().runs.iter().all(|run| run.steps.is_empty()) {
        notify("dcvins: interrupted before the first step; nothing is written");
        return Ok(Outcome::Interrupted);
    }
    let options = ReportOptions {
        command: command_line(std::env::args_os().map(|word| word.to_string_lossy().into_owned())),
        check: Some(check(&plan)),
        inputs: inputs(arguments),
        #[cfg(feature = "gui")]
        figures: figures::draw(arguments, &plan, &mut computation)?,
        #[cfg(not(feature = "gui"))]
        figures: Vec::new(),
    };
    let recording = computation.recording();
    let page = write_report(recording, &arguments.output, &options)?;
    print(&format!("{}\n", page.display()))?;
    let failed: Vec<&str> = recording.runs.iter().filter_map(|run| run.error.as_deref()).collect();
    if !failed.is_empty() {
        anyhow::bail!("{}", failed.join("; "));
    }
    if interrupt.is_set() {
        notify(&interrupted(recording));
        return Ok(Outcome::Interrupted);
    }
    Ok(if recording.runs.iter().all(is_initialized) { Outcome::Success } else { Outcome::NeverInitialized })
}

/// Findings about the log and its rig.
fn check(plan: &SessionPlan) -> CheckReport {
    let _progress = Progress::spinner("checking the log");
    let rotations = image_rotations(&plan.log, &plan.rig);
    log_check::check(&plan.log, Ok(&plan.rig), &rotations)
}

/// Paths of the log, and of the rig and its ground truth where they are separate files.
fn inputs(arguments: &ReportArguments) -> Vec<PathBuf> {
    let beside = |given: Option<&PathBuf>, extension: &str| {
        let beside = || Some(arguments.log.with_extension(extension)).filter(|path| path.is_file());
        given.cloned().or_else(beside)
    };
    let rig = beside(arguments.estimation.rig.as_ref(), "rig.yaml");
    let ground_truth = beside(arguments.estimation.ground_truth.as_ref(), "truth.yaml");
    [Some(arguments.log.clone()), rig, ground_truth].into_iter().flatten().collect()
}

/// The command line in a form that can be typed again, with the program's name without its folder.
fn command_line(mut words: impl Iterator<Item = String>) -> String {
    let program = words.next().unwrap_or_default();
    let program = Path::new(&program).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let plain = |word: &str| {
        !word.is_empty() && word.chars().all(|letter| letter.is_alphanumeric() || "/._-:=,+".contains(letter))
    };
    let quoted = words.map(|word| if plain(&word) { word } else { format!("'{}'", word.replace('\'', "'\\''")) });
    std::iter::once(program).chain(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(feature = "gui")]
mod figures {
    use std::sync::Arc;

    use anyhow::Result;
    use dcvins::export::{ReportDrawing, ReportFigure, ScreenshotOptions, draw_panel, draw_panel_svg, png_bytes};
    use dcvins::flight_log::ImageReader;
    use dcvins::geometry::{ns_from_seconds, seconds_from_ns};
    use dcvins::gui::theme::ThemeName;
    use dcvins::session::{Computation, SessionPlan};

    use super::ReportArguments;
    use crate::cli::terminal::Progress;

    /// A panel of the report.
    struct Shown {
        panel: &'static str,
        size_px: [u32; 2],
        caption: &'static str,
        /// Whether it is drawn as SVG; images and the scene are drawn as pixels.
        plot: bool,
    }

    const fn shown(panel: &'static str, size_px: [u32; 2], caption: &'static str, plot: bool) -> Shown {
        Shown { panel, size_px, caption, plot }
    }

    /// Panels that show one stamp.
    const STAMP_PANELS: [Shown; 3] = [
        shown("image", [1280, 900], "Image with feature tracks and residuals", false),
        shown("scene", [1280, 900], "Trajectory, landmarks and gimbal chain", false),
        shown("rank", [1280, 900], "Ranks, singular values and null directions", true),
    ];
    /// Panels that show the whole log.
    const LOG_PANELS: [Shown; 3] = [
        shown("convergence", [1680, 1200], "Calibration parameters with ±3σ and ground truth", true),
        shown("residuals", [1280, 800], "Reprojection residuals, and χ² by factor", true),
        shown("timeline", [1680, 480], "Events, informed rank, features and warnings", true),
    ];

    /// The figures of a report: of the whole log, then of each stamp (without one, of the end).
    pub(super) fn draw(
        arguments: &ReportArguments,
        plan: &SessionPlan,
        computation: &mut Computation,
    ) -> Result<Vec<ReportFigure>> {
        let mut images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
        let mut figures = Vec::new();
        let end_ns = computation.recording().last_stamp_ns();
        let stamps_ns: Vec<i64> = arguments.at.iter().map(|at_s| ns_from_seconds(*at_s).min(end_ns)).collect();
        let stamps_ns = if stamps_ns.is_empty() { vec![end_ns] } else { stamps_ns };
        let count = LOG_PANELS.len() + stamps_ns.len() * STAMP_PANELS.len();
        let progress = Progress::new();
        let mut draw = |heading: &str, panels: &[Shown], cursor_ns| -> Result<()> {
            computation.fill_in(cursor_ns);
            let recording = computation.recording();
            for Shown { panel, size_px, caption, plot } in panels {
                progress.show(figures.len() as f64 / count as f64, || format!("drawing {panel}"));
                let options =
                    ScreenshotOptions { size_px: *size_px, theme: ThemeName::Print, ..ScreenshotOptions::default() };
                let caption = format!("{caption}, at {:.2} s", seconds_from_ns(cursor_ns));
                let drawing = if *plot {
                    let prefix = format!("clip{}-", figures.len());
                    let names = [prefix.as_str(), caption.as_str()];
                    ReportDrawing::Svg(draw_panel_svg(panel, recording, cursor_ns, &mut images, &options, names)?)
                } else {
                    let screenshot = draw_panel(panel, recording, cursor_ns, &mut images, &options)?;
                    ReportDrawing::Png(png_bytes(&screenshot)?)
                };
                figures.push(ReportFigure { heading: heading.to_owned(), caption, drawing });
            }
            Ok(())
        };
        draw("Whole log", &LOG_PANELS, end_ns)?;
        for cursor_ns in stamps_ns {
            draw(&format!("At {:.2} s", seconds_from_ns(cursor_ns)), &STAMP_PANELS, cursor_ns)?;
        }
        Ok(figures)
    }
}

#[cfg(test)]
mod tests {
    use super::command_line;

    #[test]
    fn commands_can_be_typed_again() {
        let words = ["/usr/bin/dcvins", "report", "my log.mcap", "--run", "auto:name=it's", ""].map(str::to_owned);
        assert_eq!(command_line(words.into_iter()), r"dcvins report 'my log.mcap' --run 'auto:name=it'\''s' ''");
    }
}
