//! Titles and legends of figures.

use crate::geometry::seconds_from_ns;
use crate::gui::PanelName;
use crate::gui::comparison::ComparisonView;
use crate::observability::WEAKLY_DETERMINED_RATIO;
use crate::session::Recording;

/// Colours and dashes of the runs in the light and the print theme, in words.
const RUN_STYLES: [&str; 4] = ["blue, solid", "orange, long dashes", "green, dash-dotted", "purple, short dashes"];

/// Content of a figure as far as its text depends on it.
#[derive(Clone, Copy, Debug)]
pub struct FigureContent<'a> {
    pub panel: PanelName,
    /// View of the comparison; `None` for all that fit.
    pub view: Option<ComparisonView>,
    pub recording: &'a Recording,
    /// Index of the run in panels that show one run.
    pub run: usize,
    /// Shown time range in nanoseconds since the log began.
    pub range_ns: (i64, i64),
    /// Stamp of values that are not over time.
    pub cursor_ns: i64,
}

/// Caption of a figure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FigureText {
    /// Content, run and time, without a full stop.
    pub title: String,
    /// Legend in sentences: axes, units, colours, dashes.
    pub reading: String,
}

impl FigureText {
    pub fn of(content: &FigureContent<'_>) -> Self {
        let FigureContent { recording, run, .. } = *content;
        let at_s = seconds_from_ns(content.cursor_ns);
        let (begin_s, end_s) = (seconds_from_ns(content.range_ns.0), seconds_from_ns(content.range_ns.1));
        let over = if begin_s == 0.0 { format!("0 to {end_s:.2} s") } else { format!("{begin_s:.2} to {end_s:.2} s") };
        let runs = styles(recording);
        let label = recording.runs.get(run).map_or("", |record| record.spec.label.as_str());
        let (title, reading) = match content.panel {
            PanelName::Convergence => (
                format!("Calibration parameters of run {label} over time, {over}"),
                convergence(recording, label, &runs, at_s),
            ),
            PanelName::Residuals => (
                format!("Reprojection residuals{} at {at_s:.2} s, and their RMS over time", of_run(recording, run)),
                format!(
                    "Top: histogram of the residuals (prediction minus measurement, px) of the window, filled after the \
                     solve, outlined before it. Middle: RMS after the solve in px over {over}; {runs}. Bottom: χ² by \
                     kind of factor; χ² per residual is about 1 where the residuals agree with the noise of the rig."
                ),
            ),
            PanelName::Timeline => (
                format!("Runs, events, ranks and features over time, {over}"),
                format!(
                    "A lane for each run: hatched while it initializes, a tick for each keyframe. Below: events, informed \
                     rank, number of features, reprojection RMS in px, outliers and warnings; {runs}. The numbers next \
                     to the lanes are at {at_s:.2} s."
                ),
            ),
            PanelName::Comparison if content.view == Some(ComparisonView::Errors) => (
                format!("Errors against the {} over time, {over}", recording.truth_name()),
                format!(
                    "Position and attitude after alignment in yaw and position over the whole path; tilt is the angle \
                     between the verticals. Lines: {runs}. Dashed: 3σ of the estimator, of the position relative to the \
                     first estimated frame."
                ),
            ),
            PanelName::Comparison if recording.runs.len() > 1 => {
                (format!("Comparison of the runs over {over}"), format!("Differences are from the reference run. {runs}."))
            }
            PanelName::Image => (
                format!("Image of {} at {at_s:.2} s with the features of run {label}", camera_of(recording, run)),
                "Circle: feature used in the solve; dot: tracked only; cross: rejected. Colour: age of the track in \
                 frames. Thin line: track trail. Orange line: residual after the solve (prediction minus measurement), \
                 magnified 20 times."
                    .to_owned(),
            ),
            PanelName::Scene => (
                format!("Trajectories, landmarks and gimbal chain at {at_s:.2} s"),
                scene(recording, &runs),
            ),
            PanelName::Rank => (
                format!("Observability of the calibration of run {label} at {at_s:.2} s"),
                "Top: the null and uninformed directions as columns with their singular value, least observable first, \
                 and the weight of each parameter in them; orange positive, blue negative. Bars: all singular values of \
                 the window's Jacobian without the priors, on a logarithmic axis; the short lines above them include the \
                 priors. A direction below the line \"informed\" (1) is constrained less than by a prior of 10° or 3 cm, \
                 one below \"structural\" not at all. Bottom: informed rank over time, and structural rank in a lighter \
                 shade."
                    .to_owned(),
            ),
            panel => (
                format!("{}{} at {at_s:.2} s", panel.title(), of_run(recording, run)),
                format!("{runs}."),
            ),
        };
        Self { title, reading }
    }

    /// The whole caption in sentences.
    pub fn caption(&self) -> String {
        format!("{}. {}", self.title, self.reading)
    }
}

fn convergence(recording: &Recording, label: &str, runs: &str, at_s: f64) -> String {
    let known = recording.ground_truth_rig.is_some();
    let truth = if known { "; grey dashed line: ground truth" } else { "" };
    let error = if known { " Δ is the error against the ground truth, also as a multiple of σ." } else { "" };
    format!(
        "One plot per parameter, in the order of the chain; horizontally time, vertically the value in degrees or \
         millimetres. Lines: {runs}{truth}. Band: ±3σ of run {label}. Hatched, with a red strip below: the flight up to \
         then does not determine the parameter (σ over {WEAKLY_DETERMINED_RATIO} times the required accuracy); amber \
         strip: it determines it weakly (over the required accuracy); blue strip: the required accuracy is reached only \
         together with the prior. Above each plot: value and σ at {at_s:.2} s.{error}"
    )
}

fn scene(recording: &Recording, runs: &str) -> String {
    let known = recording.runs.iter().any(|run| run.alignment.is_some());
    let truth = if known { " Grey dashed: ground truth." } else { "" };
    format!(
        "Trajectories: {runs}.{truth} Dots: landmarks, coloured by height. Axes: x red, y green, z blue. Inset: the chain \
         from the IMU (I) over base (B), joints (J) and end effector (E) to the camera (C), with its Denavit–Hartenberg \
         parameters, lengths in mm and angles in degrees."
    )
}

fn camera_of(recording: &Recording, run: usize) -> &str {
    recording.runs.get(run).map_or("", |record| record.camera_key.as_str())
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
