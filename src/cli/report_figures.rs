//! The figures of a report with their captions.

use std::sync::Arc;

use anyhow::Result;
use dcvins::export::{ScreenshotOptions, draw_panel, draw_panel_svg, png_bytes};
use dcvins::flight_log::ImageReader;
use dcvins::geometry::{ns_from_seconds, seconds_from_ns};
use dcvins::gui::theme::ThemeName;
use dcvins::report::{ReportDrawing, ReportFigure};
use dcvins::session::{Computation, Recording, SessionPlan};

use super::terminal::Progress;

/// Width of every figure in points. Printed 170 mm wide, text of 11 points is then 2.6 mm high.
const WIDTH: u32 = 720;
/// Pixels per point of images and of the scene: 215 dpi in print.
const PIXELS_PER_POINT: u32 = 2;
/// Height in points of a plot in the convergence figure, which has three plots per row, and the limits of the figure.
const PLOT_HEIGHT: usize = 116;
const PLOTS_PER_ROW: usize = 3;
const MIN_CONVERGENCE_HEIGHT: usize = 240;
/// Heights in points of the rank figure without its rows, and of a row.
const RANK_HEIGHT: usize = 460;
const RANK_ROW_HEIGHT: usize = 20;
/// Largest height of a figure in points, 203 mm in print: a page of A4 or Letter with the caption.
const MAX_HEIGHT: usize = 860;
/// Colours and dashes of the runs in the print theme, in words.
const RUN_STYLES: [&str; 4] = ["blue, solid", "orange, long dashes", "green, dash-dotted", "purple, short dashes"];

struct Wanted {
    panel: &'static str,
    run: usize,
    height: u32,
    title: String,
    reading: String,
}

impl Wanted {
    /// True if the figure is drawn as SVG; images and the scene are drawn as pixels.
    fn is_plot(&self) -> bool {
        !matches!(self.panel, "image" | "scene")
    }
}

/// The figures of a report: of the whole log, then of each stamp (without one, of the end).
pub(crate) fn draw(at_s: &[f64], plan: &SessionPlan, computation: &mut Computation) -> Result<Vec<ReportFigure>> {
    let mut images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
    let end_ns = computation.recording().last_stamp_ns();
    let stamps_ns: Vec<i64> = at_s.iter().map(|at_s| ns_from_seconds(*at_s).min(end_ns)).collect();
    let stamps_ns = if stamps_ns.is_empty() { vec![end_ns] } else { stamps_ns };
    let whole = whole_log(computation.recording(), end_ns);
    let mut groups = vec![("Over the whole log".to_owned(), end_ns, whole)];
    for cursor_ns in stamps_ns {
        computation.fill_in(cursor_ns);
        let heading = format!("At {:.2} s", seconds_from_ns(cursor_ns));
        groups.push((heading, cursor_ns, at_stamp(computation.recording(), cursor_ns)));
    }
    let count: usize = groups.iter().map(|(.., wanted)| wanted.len()).sum();
    let progress = Progress::new();
    let mut figures = Vec::new();
    for (heading, cursor_ns, wanted) in groups {
        computation.fill_in(cursor_ns);
        let recording = computation.recording();
        for figure in wanted {
            let panel = figure.panel;
            progress.show(figures.len() as f64 / count as f64, || format!("drawing {panel}"));
            let scale = if figure.is_plot() { 1 } else { PIXELS_PER_POINT };
            let options = ScreenshotOptions {
                size_px: [WIDTH * scale, figure.height * scale],
                pixels_per_point: scale as f32,
                theme: ThemeName::Print,
                run: figure.run,
                ..ScreenshotOptions::default()
            };
            let drawing = if figure.is_plot() {
                let prefix = format!("clip{}-", figures.len());
                let names = [prefix.as_str(), figure.title.as_str()];
                ReportDrawing::Svg(draw_panel_svg(panel, recording, cursor_ns, &mut images, &options, names)?)
            } else {
                ReportDrawing::Png(png_bytes(&draw_panel(panel, recording, cursor_ns, &mut images, &options)?)?)
            };
            let Wanted { title, reading, .. } = figure;
            figures.push(ReportFigure { heading: heading.clone(), title, reading, drawing });
        }
    }
    Ok(figures)
}

/// Figures of the whole log, with the values at its end.
fn whole_log(recording: &Recording, end_ns: i64) -> Vec<Wanted> {
    let end_s = seconds_from_ns(end_ns);
    let truth = if recording.ground_truth_rig.is_some() { "; grey dashed line: ground truth" } else { "" };
    let error = if recording.ground_truth_rig.is_some() {
        " Δ is the error against the ground truth, also as a multiple of σ."
    } else {
        ""
    };
    let runs = styles(recording);
    let mut wanted = Vec::new();
    for (run, record) in recording.runs.iter().enumerate() {
        let parameters = record.steps.last().map_or(0, |step| step.report.calibration.parameters.len());
        if parameters == 0 {
            continue;
        }
        let rows = parameters.div_ceil(PLOTS_PER_ROW);
        let height = (PLOT_HEIGHT * rows + 24).clamp(MIN_CONVERGENCE_HEIGHT, MAX_HEIGHT);
        let label = &record.spec.label;
        wanted.push(Wanted {
            panel: "convergence",
            run,
            height: height as u32,
            title: format!("Calibration parameters of run {label} over time, 0 to {end_s:.2} s"),
            reading: format!(
                "One plot per parameter, in the order of the chain; horizontally time, vertically the value in degrees or \
                 millimetres. Lines: {runs}{truth}. Band: ±3σ of run {label}. Hatched: initializing. The strip below \
                 each plot is amber where the window at that time alone constrains the parameter less than a prior of 10° or \
                 3 cm, and red where the parameter is unobservable in it. Above each plot: value and σ at {end_s:.2} s.{error}"
            ),
        });
    }
    wanted.push(Wanted {
        panel: "residuals",
        run: 0,
        height: 480,
        title: format!("Reprojection residuals{} at {end_s:.2} s, and their RMS over time", of_run(recording, 0)),
        reading: format!(
            "Top: histogram of the residuals (prediction minus measurement, px) of the window, filled after the solve, \
             outlined before it. Middle: RMS after the solve in px over 0 to {end_s:.2} s; {runs}. Bottom: χ² by kind \
             of factor; χ² per residual is about 1 where the residuals agree with the noise of the rig."
        ),
    });
    wanted.push(Wanted {
        panel: "timeline",
        run: 0,
        height: (250 + 24 * recording.runs.len()) as u32,
        title: format!("Runs, events, ranks and features over time, 0 to {end_s:.2} s"),
        reading: format!(
            "A lane for each run: hatched while it initializes, a tick for each keyframe. Below: events, informed rank, \
             number of features, reprojection RMS in px, outliers and warnings; {runs}. The vertical line and the \
             numbers next to the lanes are at {end_s:.2} s."
        ),
    });
    wanted
}

/// Figures of one stamp.
fn at_stamp(recording: &Recording, cursor_ns: i64) -> Vec<Wanted> {
    let at_s = seconds_from_ns(cursor_ns);
    let runs = styles(recording);
    let mut wanted = Vec::new();
    let mut cameras: Vec<&str> = Vec::new();
    for (run, record) in recording.runs.iter().enumerate() {
        if cameras.contains(&record.camera_key.as_str()) {
            continue;
        }
        cameras.push(&record.camera_key);
        wanted.push(Wanted {
            panel: "image",
            run,
            height: image_height(recording, &record.camera_key),
            title: format!(
                "Image of {} at {at_s:.2} s with the features of run {}",
                record.camera_key, record.spec.label
            ),
            reading:
                "Circle: feature used in the solve; dot: tracked only; cross: rejected. Colour: age of the track in \
                      frames. Thin line: track trail. Orange line: residual after the solve (prediction minus \
                      measurement), magnified 20 times."
                    .to_owned(),
        });
    }
    let truth =
        if recording.runs.iter().any(|run| run.alignment.is_some()) { " Grey dashed: ground truth." } else { "" };
    wanted.push(Wanted {
        panel: "scene",
        run: 0,
        height: 560,
        title: format!("Trajectories, landmarks and gimbal chain at {at_s:.2} s"),
        reading: format!(
            "Trajectories: {runs}.{truth} Dots: landmarks, coloured by height. Axes: x red, y green, z blue. Inset: the \
             chain from the IMU (I) over base (B), joints (J) and end effector (E) to the camera (C), with its \
             Denavit–Hartenberg parameters, lengths in mm and angles in degrees."
        ),
    });
    for (run, record) in recording.runs.iter().enumerate() {
        let ranked = record.step_at(cursor_ns).and_then(|step| step.rank.as_ref());
        let columns = ranked.map_or(0, |rank| rank.parameters.len());
        if columns == 0 {
            continue;
        }
        wanted.push(Wanted {
            panel: "rank",
            run,
            height: (RANK_HEIGHT + RANK_ROW_HEIGHT * columns).min(MAX_HEIGHT) as u32,
            title: format!("Observability of the calibration of run {} at {at_s:.2} s", record.spec.label),
            reading: "Top: the null and uninformed directions as columns with their singular value, least observable first, \
                      and the weight of each parameter in them; orange positive, blue negative. Bars: all singular \
                      values of the window's Jacobian without the priors, on a logarithmic axis; the short lines above \
                      them include the priors. A direction below the line \"informed\" (1) is constrained less than by \
                      a prior of 10° or 3 cm, one below \"structural\" not at all. Bottom: informed rank over time, and \
                      structural rank in a lighter shade."
                .to_owned(),
        });
    }
    wanted
}

/// Height of the figure of an image with its legend, in points.
fn image_height(recording: &Recording, camera_key: &str) -> u32 {
    /// Title, legend and caption lines, and margins.
    const AROUND: u32 = 92;
    let camera = recording.rig.cameras.iter().find(|camera| camera.key == camera_key);
    let [width, height] = camera.map_or([640, 480], |camera| camera.model.resolution_px);
    let fitted = (WIDTH as usize * height).checked_div(width).unwrap_or(540) as u32;
    fitted.clamp(200, 760) + AROUND
}

/// The runs with their colours and dashes: `auto blue, solid; classical orange, long dashes`.
fn styles(recording: &Recording) -> String {
    let runs = recording.runs.iter().zip(RUN_STYLES.iter().cycle());
    runs.map(|(run, style)| format!("{} {style}", run.spec.label)).collect::<Vec<_>>().join("; ")
}

/// ` of run auto`, empty for a single run.
fn of_run(recording: &Recording, run: usize) -> String {
    match recording.runs.get(run) {
        Some(record) if recording.runs.len() > 1 => format!(" of run {}", record.spec.label),
        _ => String::new(),
    }
}
