//! `dcvins screenshot`: one panel at one or several stamps.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use clap::{Args, ValueEnum};
use dcvins::export::{
    CachedFile, PANEL_NAMES, Renderer, STUDY_PANEL_NAMES, ScreenshotOptions, check_log, check_screenshot, draw_panel,
    draw_panel_svg, figure_bytes, is_session, open_session, panel_csv, png_bytes, read_motion, write_screenshot,
};
use dcvins::flight_log::ImageReader;
use dcvins::geometry::{ns_from_seconds, seconds_from_ns};
use dcvins::gui::app::PlayingLog;
use dcvins::gui::theme::ThemeName;
use dcvins::gui::window::{FigureFormat, FigureInput, Preset};
use dcvins::gui::{ImageSource, PanelName, Playback, Presentation};
use dcvins::observability::{SlidePosition, SlideRequest};
use dcvins::session::{Computation, Recording, Session, SessionPlan};
use dcvins::simulation::PrescribedMotion;
use dcvins::sweep::{OpenedStudy, is_study};
use dcvins::text::{Named as _, log_name};

use crate::cli::compute::compute;
use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::exit::ExitOutcome;
use crate::cli::figure_arguments::FigureArguments;
use crate::cli::interrupt::Interrupt;
use crate::cli::log_checking::beside_check;
use crate::cli::prepared_log::{prepared_log, prepared_session};
use crate::cli::report::own_command_line;
use crate::cli::result_cache::{CacheArguments, CachedResult};
use crate::cli::shared_arguments::{seconds, sides};
use crate::cli::study_arguments::{StudyArguments, StudyScreenshot, write_study_screenshot};
use crate::cli::terminal::{notify, print};

#[derive(Args, Clone, Debug)]
pub(crate) struct ScreenshotArguments {
    /// The log, a recording that is converted into the cache folder first, a saved session (LOG.session.json) with its
    /// forks and breakpoints, or the folder of a study.
    pub log: PathBuf,
    /// Seconds since the first message of the log; may be given several times, then the time is part of the file names
    /// [default: the end of the log, or of --to].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub at: Vec<f64>,
    /// Period of the screenshots, from the start to the end of the log (or from --start, for --duration).
    #[arg(long, value_name = "SECONDS", value_parser = period)]
    pub every: Option<f64>,
    /// Panel to draw; `all`: the whole window.
    #[arg(long, value_name = "NAME", default_value = "all")]
    pub panel: String,
    /// Layout of the whole window, as with keys 1 to 5: overview, calibration, front end, scene, comparison.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=5))]
    pub layout: u8,
    /// The file to write: a PNG, an SVG with the extension .svg, or a PDF with the extension .pdf.
    #[arg(short, long, visible_alias = "out", value_name = "FILE.png")]
    pub output: PathBuf,
    /// File format, if it does not follow from the extension.
    #[arg(long, value_enum)]
    pub format: Option<FormatArgument>,
    /// Also write the values of the panel as CSV, next to the screenshot.
    #[arg(long)]
    pub csv: bool,
    /// Size of the screenshot in pixels.
    #[arg(long, value_name = "WxH", default_value = "1920x1080", value_parser = size)]
    pub size: [usize; 2],
    /// Pixels per point: 2 draws everything twice as large.
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = scale)]
    pub scale: f32,
    /// Colours; of a figure for a paper print, otherwise light, if none are given.
    #[arg(long, value_enum)]
    pub theme: Option<ThemeArgument>,
    /// Renderer: cpu needs no driver and gives the same bytes on every machine, wgpu uses a graphics adapter.
    #[arg(long, value_enum, default_value_t = RendererArgument::Cpu)]
    pub renderer: RendererArgument,
    /// Move the first run's chain along a direction: its number in the rank panel (1 is the least observable), a
    /// closed-form null direction (base-d, end-theta, …) or a parameter by name; VALUE in units of 10° and 3 cm. Scene
    /// and image show the moved chain.
    #[arg(long, value_name = "DIRECTION=VALUE")]
    pub slide: Option<SlideRequest>,
    /// Motion that the laboratory shows as the planned one with its predicted σ: a CSV file as `dcvins plan` writes it.
    #[arg(long, value_name = "FILE.csv")]
    pub motion: Option<PathBuf>,
    /// Draw a single panel with its buttons and selectors, as in the window, instead of as a figure.
    #[arg(long)]
    pub controls: bool,
    /// Overwrite any existing file with the name of the screenshot. Without it, only PNG, SVG and CSV files are
    /// replaced.
    #[arg(long)]
    pub force: bool,
    #[command(flatten)]
    pub figure: FigureArguments,
    #[command(flatten)]
    pub study: StudyArguments,
    #[command(flatten)]
    pub estimation: EstimationArguments,
    #[command(flatten)]
    pub cache: CacheArguments,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatArgument {
    /// Portable Network Graphics, pixels.
    Png,
    /// Scalable Vector Graphics, shapes.
    Svg,
    /// Portable Document Format, one page of the size of the figure.
    Pdf,
}

impl FormatArgument {
    const fn of_figure(self) -> FigureFormat {
        match self {
            Self::Png => FigureFormat::Png,
            Self::Svg => FigureFormat::Svg,
            Self::Pdf => FigureFormat::Pdf,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum RendererArgument {
    /// The program's own painter.
    Cpu,
    /// A graphics adapter, through wgpu.
    Wgpu,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ThemeArgument {
    /// Dark text on a light background.
    Light,
    /// Light text on a dark background.
    Dark,
    /// Colours for print on white paper.
    Print,
}

fn period(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && *value >= 1e-3);
    value.ok_or_else(|| "expected seconds, a number from 0.001 up".to_owned())
}

fn scale(text: &str) -> Result<f32, String> {
    let value = text.parse::<f32>().ok().filter(|value| (0.25..=8.0).contains(value));
    value.ok_or_else(|| "expected a number from 0.25 to 8".to_owned())
}

fn size(text: &str) -> Result<[usize; 2], String> {
    sides(text, 64..=8192).ok_or_else(|| "expected WIDTHxHEIGHT, each from 64 to 8192, as in 1920x1080".to_owned())
}

/// Maximum number of screenshots of one command; more are probably due to a mistyped period.
const MAX_SCREENSHOTS: usize = 100_000;

impl ScreenshotArguments {
    /// True if the screenshot has a size on paper.
    fn is_of_paper(&self, format: FormatArgument) -> bool {
        self.figure.has_paper_size() || format == FormatArgument::Pdf
    }
}

pub(crate) fn screenshot(arguments: &ScreenshotArguments) -> Result<ExitOutcome> {
    if is_study(&arguments.log) {
        return of_study(arguments);
    }
    arguments.study.require_none(&arguments.log)?;
    if !PANEL_NAMES.contains(&arguments.panel.as_str()) {
        bail!("unknown panel '{}': expected one of {}", arguments.panel, PANEL_NAMES.join(", "));
    }
    if arguments.csv && arguments.panel == "all" {
        bail!("--csv writes the values of one panel: name the panel with --panel");
    }
    let format = format_of(arguments)?;
    let shows_motion = ["all", PanelName::Laboratory.name()].contains(&arguments.panel.as_str());
    let is_of_paper = arguments.is_of_paper(format);
    if arguments.motion.is_some() && (!shows_motion || is_of_paper) {
        bail!("--motion is shown by the laboratory as PNG or SVG: give --panel laboratory, without a size on paper");
    }
    let range_ns = arguments.figure.range_ns()?;
    let (log, estimation) = prepared_log(std::slice::from_ref(&arguments.log), &arguments.estimation)?;
    let arguments = &ScreenshotArguments { log, estimation, ..arguments.clone() };
    let mut shown = Shown::open(arguments)?;
    let instants = Instants::of(arguments, &shown, range_ns)?;
    let stamps_ns = &instants.stamps_ns;
    let several = stamps_ns.len() > 1;
    let path_at = |cursor_ns| if several { numbered(&arguments.output, cursor_ns) } else { arguments.output.clone() };
    for cursor_ns in stamps_ns {
        let path = path_at(*cursor_ns);
        check_screenshot(&path, arguments.force)?;
        if arguments.csv {
            check_screenshot(&path.with_extension("csv"), arguments.force)?;
        }
    }
    let interrupt = Interrupt::watch()?;
    let stopped = |written: usize| {
        notify(&format!("dcvins: interrupted; {written} of {} screenshots are written", stamps_ns.len()));
        Ok(ExitOutcome::Interrupted)
    };
    let mut cached = shown.cached(arguments, format);
    if let Some(files) = cached.as_ref().and_then(CachedResult::load) {
        let paths: Vec<PathBuf> = stamps_ns.iter().map(|cursor_ns| path_at(*cursor_ns)).collect();
        write_known(&files, &paths, arguments.csv)?;
        return Ok(ExitOutcome::Success);
    }
    let mut computation = shown.compute(&interrupt, (arguments.panel == "all").then_some(&arguments.cache))?;
    if interrupt.is_set() {
        return stopped(0);
    }
    let slide = slide_position(arguments, computation.recording())?;
    let playback = shown.playback();
    let run = arguments.figure.run(computation.recording())?;
    let cameras = arguments.figure.cameras(computation.recording())?;
    let view = arguments.figure.view;
    let motion = shown.motion.clone();
    let options = ScreenshotOptions {
        slide,
        run,
        cameras,
        view,
        motion,
        visible_ns: range_ns,
        playback,
        ..drawing_options(arguments)
    };
    for (number, cursor_ns) in stamps_ns.iter().copied().enumerate() {
        if interrupt.is_set() {
            return stopped(number);
        }
        computation.fill_in(cursor_ns);
        let recording = computation.recording();
        let path = path_at(cursor_ns);
        let at_ns = (!instants.is_assumed).then_some(cursor_ns);
        let drawn = draw(arguments, format, recording, shown.images(), &options, (cursor_ns, at_ns))?;
        let mut written = vec![(path.clone(), drawn)];
        if arguments.csv {
            let table = panel_csv(&arguments.panel, recording, cursor_ns, shown.images(), &options)?;
            written.push((path.with_extension("csv"), table.into_bytes()));
        }
        for (path, content) in written {
            write_screenshot(&content, &path)?;
            if let Some(cached) = &mut cached {
                cached.add(log_name(&path), content);
            }
        }
        if several {
            print(&format!("{}\n", path.display()))?;
        }
    }
    if let Some(cached) = cached {
        cached.store();
    }
    Ok(ExitOutcome::Success)
}

/// Writes screenshots from the cache, with their tables if they have some; several paths are printed.
fn write_known(files: &[CachedFile], paths: &[PathBuf], with_tables: bool) -> Result<()> {
    let mut files = files.iter();
    for path in paths {
        let table = with_tables.then(|| path.with_extension("csv"));
        for (path, (_, content)) in [Some(path), table.as_ref()].into_iter().flatten().zip(&mut files) {
            write_screenshot(content, path)?;
        }
        if paths.len() > 1 {
            print(&format!("{}\n", path.display()))?;
        }
    }
    Ok(())
}

/// Times of the screenshots of one command, in nanoseconds since the log began.
struct Instants {
    /// In order and different from each other, at least one.
    stamps_ns: Vec<i64>,
    /// True without `--at` and `--every`: the end of the range, or of what is computed.
    is_assumed: bool,
}

impl Instants {
    fn of(arguments: &ScreenshotArguments, shown: &Shown, range_ns: Option<(i64, i64)>) -> Result<Self> {
        let log_end_ns = shown.log_end_ns;
        let begin_ns = ns_from_seconds(shown.start_s).min(log_end_ns);
        let end_ns =
            shown.duration_s.map_or(log_end_ns, |duration_s| log_end_ns.min(begin_ns + ns_from_seconds(duration_s)));
        if arguments.at.iter().any(|at_s| ns_from_seconds(*at_s) > log_end_ns) {
            notify(&format!("dcvins: the log ends at {:.3} s: the last step is drawn", seconds_from_ns(log_end_ns)));
        }
        let mut stamps_ns: Vec<i64> = arguments.at.iter().map(|at_s| ns_from_seconds(*at_s).min(log_end_ns)).collect();
        if let Some(period_s) = arguments.every {
            let period_ns = ns_from_seconds(period_s).max(1);
            let count = ((end_ns - begin_ns) / period_ns) as usize + 1;
            if count > MAX_SCREENSHOTS {
                bail!("--every {period_s}: {count} screenshots, more than {MAX_SCREENSHOTS}; give a longer period");
            }
            stamps_ns.extend((0..count).map(|number| begin_ns + number as i64 * period_ns));
        }
        let range_end_ns = range_ns.map(|(_, to_ns)| to_ns.min(log_end_ns));
        let is_assumed = stamps_ns.is_empty();
        if is_assumed {
            stamps_ns.push(range_end_ns.unwrap_or(end_ns));
        }
        stamps_ns.sort_unstable();
        stamps_ns.dedup();
        Ok(Self { stamps_ns, is_assumed })
    }
}

/// Direction and distance of --slide.
fn slide_position(arguments: &ScreenshotArguments, recording: &Recording) -> Result<Option<SlidePosition>> {
    let Some(request) = &arguments.slide else { return Ok(None) };
    let position = request.position(&recording.rig.parameter_names());
    let position = position.with_context(|| {
        let direction = &request.direction;
        format!("unknown direction '{direction}': expected a number, a name such as base-d, or a parameter")
    })?;
    Ok(Some(position))
}

/// Draws the panel at a position of the cursor into a file of a format; the second stamp is the one of --at or --every.
fn draw(
    arguments: &ScreenshotArguments,
    format: FormatArgument,
    recording: &Recording,
    images: &mut dyn ImageSource,
    options: &ScreenshotOptions,
    (cursor_ns, at_ns): (i64, Option<i64>),
) -> Result<Vec<u8>> {
    let panel = &arguments.panel;
    if arguments.is_of_paper(format) {
        let spec = arguments.figure.spec(panel, options.theme, at_ns, recording)?;
        let input = FigureInput::new(recording, images, &options.playback, options.slide);
        return Ok(figure_bytes(&spec, format.of_figure(), &own_command_line(), input)?);
    }
    Ok(match format {
        FormatArgument::Png => png_bytes(&draw_panel(panel, recording, cursor_ns, images, options)?)?,
        FormatArgument::Svg | FormatArgument::Pdf => {
            let time_s = seconds_from_ns(cursor_ns);
            let title = format!("{panel} of {} at {time_s:.3} s", log_name(&recording.log_path));
            draw_panel_svg(panel, recording, cursor_ns, images, options, ["clip", &title])?.into_bytes()
        }
    })
}

/// Size, theme and renderer.
fn drawing_options(arguments: &ScreenshotArguments) -> ScreenshotOptions {
    ScreenshotOptions {
        size_px: arguments.size.map(|side| side as u32),
        pixels_per_point: arguments.scale,
        theme: match arguments.theme {
            Some(ThemeArgument::Dark) => ThemeName::Dark,
            Some(ThemeArgument::Print) => ThemeName::Print,
            None if arguments.figure.has_paper_size() => ThemeName::Print,
            None | Some(ThemeArgument::Light) => ThemeName::Light,
        },
        renderer: match arguments.renderer {
            RendererArgument::Cpu => Renderer::Cpu,
            RendererArgument::Wgpu => Renderer::Wgpu,
        },
        layout: Preset::all().nth(usize::from(arguments.layout) - 1).unwrap_or_default(),
        presentation: if arguments.controls { Presentation::Interactive } else { Presentation::Figure },
        ..ScreenshotOptions::default()
    }
}

/// Screenshot of a panel of a study, or of its whole view.
fn of_study(arguments: &ScreenshotArguments) -> Result<ExitOutcome> {
    if !arguments.at.is_empty() || arguments.every.is_some() || !arguments.estimation.runs.is_empty() {
        bail!("{} is a study: leave --at, --every and --run out", arguments.log.display());
    }
    if arguments.motion.is_some() {
        bail!("{} is a study: leave --motion out", arguments.log.display());
    }
    if !STUDY_PANEL_NAMES.contains(&arguments.panel.as_str()) {
        bail!("unknown panel '{}' of a study: expected one of {}", arguments.panel, STUDY_PANEL_NAMES.join(", "));
    }
    if arguments.csv && arguments.panel == "all" {
        bail!("--csv writes the values of one panel: name the panel with --panel");
    }
    if arguments.figure.has_paper_size() || arguments.figure.from.is_some() || arguments.figure.view.is_some() {
        bail!("{} is a study: leave --from, --to, --view and the sizes on paper out", arguments.log.display());
    }
    let format = format_of(arguments)?;
    if format == FormatArgument::Pdf {
        bail!("a PDF shows a panel of a log; write an SVG of the panel of a study");
    }
    let svg = format == FormatArgument::Svg;
    check_screenshot(&arguments.output, arguments.force)?;
    if arguments.csv {
        check_screenshot(&arguments.output.with_extension("csv"), arguments.force)?;
    }
    let study = OpenedStudy::read(&arguments.log)?;
    let screenshot = StudyScreenshot { panel: &arguments.panel, svg, csv: arguments.csv, output: &arguments.output };
    write_study_screenshot(&study, &arguments.study.options(), &drawing_options(arguments), &screenshot)?;
    Ok(ExitOutcome::Success)
}

/// The requested format, else the format of the file's extension, else PNG.
fn format_of(arguments: &ScreenshotArguments) -> Result<FormatArgument> {
    let extension = arguments.output.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let named = match extension.as_deref() {
        Some("svg") => Some(FormatArgument::Svg),
        Some("png") => Some(FormatArgument::Png),
        Some("pdf") => Some(FormatArgument::Pdf),
        _ => None,
    };
    if named.is_none() && arguments.format.is_none() && extension.is_some() {
        bail!(
            "the extension of {} is none of .png, .svg and .pdf: rename it or give --format; --csv also writes the panel's values",
            arguments.output.display()
        );
    }
    let format = arguments.format.or(named).unwrap_or(FormatArgument::Png);
    if named.is_some_and(|named| named != format) {
        bail!("--format and the name of {} contradict each other: leave one out", arguments.output.display());
    }
    let vectors = format != FormatArgument::Png || arguments.figure.has_paper_size();
    if vectors && arguments.renderer == RendererArgument::Wgpu {
        bail!("SVG, PDF and figures for papers are written without a graphics adapter: leave out --renderer wgpu");
    }
    Ok(format)
}

/// The source of a screenshot: a log to be computed, or a saved session with its forks and breakpoints.
struct Shown {
    source: Source,
    log_end_ns: i64,
    start_s: f64,
    duration_s: Option<f64>,
    /// Motion of `--motion`, with the joints of the rig.
    motion: Option<PrescribedMotion>,
}

enum Source {
    Log(Box<SessionPlan>, ImageReader),
    Saved(Box<Session>),
}

impl Shown {
    fn open(arguments: &ScreenshotArguments) -> Result<Self> {
        let (source, start_s, duration_s) = if is_session(&arguments.log) {
            arguments.estimation.check_for_session()?;
            let saved = prepared_session(&arguments.log, &arguments.estimation.limits.limits())?;
            let (start_s, duration_s) = (saved.start_s, saved.duration_s);
            (Source::Saved(Box::new(open_session(&saved, &arguments.log)?)), start_s, duration_s)
        } else {
            let plan = SessionPlan::open(&arguments.estimation.request(arguments.log.clone())?)?;
            let images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
            let (start_s, duration_s) = (plan.start_s, plan.duration_s);
            (Source::Log(Box::new(plan), images), start_s, duration_s)
        };
        let (log_end_ns, joint_names) = match &source {
            Source::Log(plan, _) => (plan.log.duration_ns(), plan.rig.joint_names()),
            Source::Saved(session) => (session.recording().duration_ns, session.recording().rig.joint_names()),
        };
        let motion = |path: &PathBuf| {
            let with_path = || format!("the motion {}", path.display());
            read_motion(path)?.with_joints(&joint_names).map_err(anyhow::Error::msg).with_context(with_path)
        };
        let motion = arguments.motion.as_ref().map(motion).transpose()?;
        Ok(Self { source, log_end_ns, start_s, duration_s, motion })
    }

    /// Cache entry of the screenshots; `None` for a saved session, and for a graphics adapter, because two adapters
    /// draw different images.
    fn cached(&self, arguments: &ScreenshotArguments, format: FormatArgument) -> Option<CachedResult> {
        let Source::Log(plan, _) = &self.source else { return None };
        if arguments.renderer == RendererArgument::Wgpu {
            return None;
        }
        // The output path does not affect the images; figures have the command in their metadata.
        let options =
            ScreenshotArguments { output: PathBuf::new(), format: Some(format), force: false, ..arguments.clone() };
        let command = if arguments.is_of_paper(format) { own_command_line() } else { String::new() };
        let motion = &self.motion;
        arguments.cache.result_of(
            &format!("{options:?}{motion:?}{command}"),
            &arguments.log,
            &arguments.estimation,
            plan,
        )
    }

    /// Computes the runs to their end, as the window does, so that its panels have the same values. For the whole window,
    /// the log is checked as well.
    fn compute(&mut self, interrupt: &Interrupt, checked_with: Option<&CacheArguments>) -> Result<Computation> {
        match &mut self.source {
            Source::Log(plan, _) => {
                plan.interrupted = interrupt.flag();
                let Some(cache) = checked_with else { return compute(plan) };
                let (computed, checked) = beside_check(plan, cache, || compute(plan));
                let mut computation = computed?;
                computation.set_check(checked);
                Ok(computation)
            }
            Source::Saved(session) => {
                session.finish();
                if let Some(cache) = checked_with {
                    session.check_log(|log, rig| check_log(cache.cache().as_ref(), log, rig));
                }
                session.take_notices().iter().for_each(|notice| notify(&format!("dcvins: {notice}")));
                Ok(session.computation())
            }
        }
    }

    fn images(&mut self) -> &mut dyn ImageSource {
        match &mut self.source {
            Source::Log(_, images) => images,
            Source::Saved(session) => &mut **session,
        }
    }

    fn playback(&self) -> Playback {
        match &self.source {
            Source::Log(..) => Playback::default(),
            Source::Saved(session) => PlayingLog::playback(&**session),
        }
    }
}

/// `rank.png` at 12.5 s becomes `rank-0012.500.png`: the names sort by time.
fn numbered(path: &Path, cursor_ns: i64) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{:08.3}.", seconds_from_ns(cursor_ns)));
    name.push(path.extension().unwrap_or_else(|| "png".as_ref()));
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_a_sequence_sort_by_time() {
        let name = |cursor_ns| numbered(Path::new("out/rank.png"), cursor_ns).to_string_lossy().into_owned();
        assert_eq!(name(12_500_000_000), "out/rank-0012.500.png");
        assert_eq!(name(0), "out/rank-0000.000.png");
        assert!(name(9_999_000_000) < name(10_000_000_000) && name(999_000_000_000) < name(1_000_000_000_000));
    }
}
