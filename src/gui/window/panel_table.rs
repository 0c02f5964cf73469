//! What a panel shows, as a table of comma-separated values: seconds, radians, metres and pixels, whatever is on screen.

use std::fmt::Write as _;

use super::{PanelName, Panels};
use crate::geometry::seconds_from_ns;
use crate::gui::PanelContext;
use crate::gui::chain_values::true_values;
use crate::gui::events::name_of;
use crate::gui::residuals::rms_px;
use crate::observability::RankReport;
use crate::session::{RunRecord, StepRecord};

/// A table that grows row by row.
pub(super) struct Table {
    pub(super) text: String,
}

impl Table {
    pub(super) fn new(columns: &[&str]) -> Self {
        let mut table = Self { text: String::new() };
        table.row(columns.iter().map(|name| (*name).to_owned()));
        table
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        for (number, cell) in cells.into_iter().enumerate() {
            if number > 0 {
                self.text.push(',');
            }
            if cell.contains([',', '"', '\n']) {
                write!(self.text, "\"{}\"", cell.replace('"', "\"\"")).expect("writing into a string cannot fail");
            } else {
                self.text.push_str(&cell);
            }
        }
        self.text.push('\n');
    }
}

/// A number with all its digits, nothing when it is not finite.
pub(super) fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

pub(super) fn seconds(stamp_ns: i64) -> String {
    format!("{:.9}", seconds_from_ns(stamp_ns))
}

/// The table of a panel.
pub(super) fn table_of(panel: PanelName, panels: &mut Panels, ctx: &PanelContext<'_>) -> String {
    let Some(run) = ctx.recording.runs.get(ctx.selection.run) else { return String::new() };
    match panel {
        PanelName::Image => features(run, ctx.cursor_ns),
        PanelName::Scene => trajectories(ctx),
        PanelName::Convergence => calibration(run, ctx),
        PanelName::Rank => directions(run, ctx.cursor_ns),
        PanelName::Jacobian => jacobian(run, ctx),
        PanelName::Residuals => residuals(ctx),
        PanelName::Inspector => state(run, ctx.cursor_ns),
        PanelName::Laboratory => spectra(panels.laboratory.ranks(ctx)),
        PanelName::Comparison => super::comparison_table::table_of(&mut panels.comparison, ctx),
        PanelName::Breakpoints => hits(ctx),
        PanelName::Timeline => lanes(ctx),
    }
}

/// The features of the image at the cursor.
fn features(run: &RunRecord, cursor_ns: i64) -> String {
    let mut table = Table::new(&[
        "id",
        "age_frames",
        "u_px",
        "v_px",
        "residual_before_u_px",
        "residual_before_v_px",
        "residual_after_u_px",
        "residual_after_v_px",
        "chi2",
        "weight",
        "depth_m",
        "rejected",
    ]);
    let Some(step) = run.step_at(cursor_ns) else { return table.text };
    for feature in &step.tracks.features {
        let solved = step.report.features.iter().find(|solved| solved.id == feature.id);
        let here = solved
            .and_then(|solved| solved.observations.iter().find(|seen| seen.frame_index == step.report.frame_index));
        let vector = |residual: Option<nalgebra::Vector2<f64>>| {
            let [u, v] = residual.map_or([f64::NAN; 2], |residual| [residual.x, residual.y]);
            [number(u), number(v)]
        };
        let [before_u, before_v] = vector(here.and_then(|seen| seen.residual_before_px));
        let [after_u, after_v] = vector(here.and_then(|seen| seen.residual_after_px));
        table.row([
            feature.id.0.to_string(),
            feature.age.to_string(),
            number(feature.uv_px.x),
            number(feature.uv_px.y),
            before_u,
            before_v,
            after_u,
            after_v,
            number(here.map_or(f64::NAN, |seen| seen.chi2)),
            number(here.map_or(f64::NAN, |seen| seen.robust_weight)),
            number(solved.map_or(f64::NAN, |solved| 1.0 / solved.inverse_depth_per_m)),
            solved.map_or_else(String::new, |solved| solved.rejected.to_string()),
        ]);
    }
    table.text
}

/// Positions of all runs up to the cursor, laid on the truth as in the scene, and the truth.
fn trajectories(ctx: &PanelContext<'_>) -> String {
    let mut table = Table::new(&["t_s", "run", "x_m", "y_m", "z_m", "truth_x_m", "truth_y_m", "truth_z_m"]);
    for run in &ctx.recording.runs {
        let aligned = run.alignment.unwrap_or_default();
        for step in run.steps.iter().take_while(|step| step.report.stamp_ns <= ctx.cursor_ns) {
            let estimate = step.report.newest().map(|frame| aligned.transform(&frame.world_from_imu.translation_m));
            let truth = step.truth.map(|pose| pose.translation_m);
            let places = [estimate, truth];
            let coordinates =
                places.iter().flat_map(|at| at.map_or([f64::NAN; 3], |at| [at.x, at.y, at.z]).map(number));
            table.row([seconds(step.report.stamp_ns), run.spec.label.clone()].into_iter().chain(coordinates));
        }
    }
    table.text
}

/// The calibration of the shown run over the whole recording, with the truth in the columns of the cursor's chart.
fn calibration(run: &RunRecord, ctx: &PanelContext<'_>) -> String {
    let truth = true_values(ctx.recording, run, ctx.cursor_ns).unwrap_or_default();
    let mut names: Vec<(&String, &str)> = Vec::new();
    for calibration in run.steps.iter().map(|step| &step.report.calibration) {
        for (name, unit) in calibration.names.iter().zip(&calibration.units) {
            if !names.iter().any(|(known, _)| *known == name) {
                names.push((name, unit));
            }
        }
    }
    let mut columns = vec!["t_s".to_owned()];
    for (name, unit) in &names {
        columns.extend(["", "_sigma", "_truth"].map(|part| format!("{name}{part}_{unit}")));
    }
    let mut table = Table { text: String::new() };
    table.row(columns);
    for step in run.steps.iter().filter(|step| step.report.newest().is_some()) {
        let calibration = &step.report.calibration;
        let cells = names.iter().flat_map(|(name, _)| {
            let index = calibration.names.iter().position(|known| known == *name);
            let entry = |values: &[f64]| index.and_then(|index| values.get(index)).copied().unwrap_or(f64::NAN);
            let truth = truth.get(*name).copied().unwrap_or(f64::NAN);
            [entry(&calibration.values), entry(&calibration.sigmas), truth].map(number)
        });
        table.row(std::iter::once(seconds(step.report.stamp_ns)).chain(cells));
    }
    table.text
}

/// Singular values of the step at the cursor, and each null or weak direction as weights by parameter name.
fn directions(run: &RunRecord, cursor_ns: i64) -> String {
    let Some(rank) = run.step_at(cursor_ns).and_then(|step| step.rank.as_ref()) else { return String::new() };
    let mut table = Table { text: String::new() };
    let heads = ["number", "singular_value", "singular_value_with_priors", "kind"].map(str::to_owned);
    table.row(heads.into_iter().chain(rank.names.iter().cloned()));
    for (index, value) in rank.singular_values.iter().enumerate() {
        // Directions come weakest first, singular values largest first.
        let direction = rank.directions.get(rank.singular_values.len() - 1 - index);
        let kind = direction.map_or("informed", |direction| if direction.structural { "null" } else { "weak" });
        let with_priors = rank.singular_values_with_priors.get(index).copied().unwrap_or(f64::NAN);
        let weights = (0..rank.names.len()).map(|column| {
            let weight = direction.and_then(|direction| direction.weights.get(column));
            number(weight.copied().unwrap_or(f64::NAN))
        });
        let heads = [(index + 1).to_string(), number(*value), number(with_priors), kind.to_owned()];
        table.row(heads.into_iter().chain(weights));
    }
    table.text
}

/// Each form's singular values and directions.
fn spectra(forms: Vec<(String, RankReport)>) -> String {
    let mut table = Table::new(&["form", "kind", "number", "singular_value", "parameter", "weight"]);
    for (form, rank) in forms {
        for (index, value) in rank.singular_values.iter().enumerate() {
            let number = (index + 1).to_string();
            let cells = [form.clone(), "singular value".to_owned(), number, self::number(*value)];
            table.row(cells.into_iter().chain([String::new(), String::new()]));
        }
        for (index, direction) in rank.directions.iter().enumerate() {
            let kind = if direction.structural { "null" } else { "weak" };
            for (name, weight) in rank.names.iter().zip(&direction.weights).filter(|(_, weight)| **weight != 0.0) {
                table.row([
                    form.clone(),
                    kind.to_owned(),
                    (index + 1).to_string(),
                    number(direction.singular_value),
                    name.clone(),
                    number(*weight),
                ]);
            }
        }
    }
    table.text
}

/// Norms of the Jacobian's blocks, as the Jacobian panel counts them; zeros are left empty.
fn jacobian(run: &RunRecord, ctx: &PanelContext<'_>) -> String {
    let Some(step) = run.step_at(ctx.cursor_ns) else { return String::new() };
    let cameras = crate::gui::jacobian::cameras(&ctx.recording.rig, run, step);
    let Some(jacobian) = step.report.jacobian(&cameras) else { return String::new() };
    let mut table = Table { text: String::new() };
    let heads = ["residuals", "rows"].map(str::to_owned).into_iter();
    table.row(heads.chain(jacobian.columns.iter().map(|block| block.name.clone())));
    for row in &jacobian.rows {
        let norm = |column: usize| row.norms.iter().find(|(known, _)| usize::from(*known) == column);
        let cells =
            (0..jacobian.columns.len()).map(|column| norm(column).map_or_else(String::new, |it| it.1.to_string()));
        let heads = [crate::gui::jacobian::name_of(&row.factor), row.height.to_string()];
        table.row(heads.into_iter().chain(cells));
    }
    table.text
}

/// Reprojection RMS and χ² by kind of factor, for every step of every run.
fn residuals(ctx: &PanelContext<'_>) -> String {
    let solved = |step: &&std::sync::Arc<StepRecord>| !step.report.window.is_empty();
    let mut factors: Vec<&'static str> = Vec::new();
    for summary in ctx.recording.runs.iter().flat_map(|run| &run.steps).flat_map(|step| &step.report.residuals) {
        if !factors.contains(&summary.factor) {
            factors.push(summary.factor);
        }
    }
    let mut columns = ["t_s", "run", "rms_before_px", "rms_after_px"].map(str::to_owned).to_vec();
    for factor in &factors {
        let factor = factor.replace(' ', "_");
        columns.extend(["count", "chi2_before", "chi2_after"].map(|part| format!("{factor}_{part}")));
    }
    let mut table = Table { text: String::new() };
    table.row(columns);
    for run in &ctx.recording.runs {
        for step in run.steps.iter().filter(solved) {
            let report = &step.report;
            let heads = [
                seconds(report.stamp_ns),
                run.spec.label.clone(),
                number(report.reprojection_rms_before_px),
                number(rms_px(report)),
            ];
            let cells = factors.iter().flat_map(|factor| {
                let summary = report.residuals.iter().find(|summary| summary.factor == *factor);
                summary.map_or_else(Default::default, |summary| {
                    [summary.count.to_string(), number(summary.chi2_before), number(summary.chi2_after)]
                })
            });
            table.row(heads.into_iter().chain(cells));
        }
    }
    table.text
}

/// The state of the newest frame at the cursor.
fn state(run: &RunRecord, cursor_ns: i64) -> String {
    let mut table = Table::new(&["quantity", "unit", "value"]);
    let Some(step) = run.step_at(cursor_ns) else { return table.text };
    let mut say = |quantity: &str, unit: &str, value: f64| {
        table.row([quantity.to_owned(), unit.to_owned(), number(value)]);
    };
    say("time", "s", seconds_from_ns(step.report.stamp_ns));
    say("frame", "", step.report.frame_index as f64);
    if let Some(newest) = step.report.newest() {
        let rotation = newest.world_from_imu.rotation;
        let vectors = [
            ("position", "m", newest.world_from_imu.translation_m),
            ("velocity", "m/s", newest.velocity_m_per_s),
            ("accelerometer bias", "m/s2", newest.accelerometer_bias_m_per_s2),
            ("gyroscope bias", "rad/s", newest.gyroscope_bias_rad_per_s),
        ];
        for (name, unit, vector) in vectors {
            for (axis, value) in ["x", "y", "z"].into_iter().zip(vector.iter()) {
                say(&format!("{name} {axis}"), unit, *value);
            }
        }
        for (name, value) in ["x", "y", "z", "w"].into_iter().zip(rotation.coords.iter()) {
            say(&format!("attitude q{name}"), "", *value);
        }
        for (joint, angle) in newest.joint_angles_rad.iter().enumerate() {
            say(&format!("joint {}", joint + 1), "rad", *angle);
        }
    }
    let calibration = &step.report.calibration;
    for (index, name) in calibration.names.iter().enumerate() {
        let unit = calibration.units.get(index).copied().unwrap_or_default();
        say(name, unit, calibration.values.get(index).copied().unwrap_or(f64::NAN));
        say(&format!("{name} sigma"), unit, calibration.sigmas.get(index).copied().unwrap_or(f64::NAN));
    }
    table.text
}

/// Every hit of every breakpoint, by breakpoint and run.
fn hits(ctx: &PanelContext<'_>) -> String {
    let mut table = Table::new(&["condition", "enabled", "run", "t_s"]);
    for breakpoint in ctx.playback.breakpoints.list() {
        for run in &ctx.recording.runs {
            for stamp_ns in breakpoint.hits_ns(run) {
                let (text, enabled) = (breakpoint.condition.text().to_owned(), breakpoint.enabled.to_string());
                table.row([text, enabled, run.spec.label.clone(), seconds(stamp_ns)]);
            }
        }
    }
    table.text
}

/// The lanes: a row for every step of every run, and below it one for each of its notable events and of the log's warnings.
fn lanes(ctx: &PanelContext<'_>) -> String {
    const FIGURES: [&str; 7] =
        ["phase", "keyframe", "features", "reprojection_rms_px", "rank_informed", "rank_structural", "rejected"];
    const EVENT: [&str; 4] = ["event", "value", "threshold", "message"];
    let mut rows: Vec<(i64, Vec<String>)> = Vec::new();
    let event_row = |run: &str, event: [String; EVENT.len()]| -> Vec<String> {
        std::iter::once(run.to_owned()).chain(FIGURES.map(|_| String::new())).chain(event).collect()
    };
    for warning in &ctx.recording.warnings {
        let cells = ["warning".to_owned(), String::new(), String::new(), warning.message.clone()];
        rows.push((warning.stamp_ns, event_row("", cells)));
    }
    for run in &ctx.recording.runs {
        for step in &run.steps {
            let (report, label) = (&step.report, &run.spec.label);
            let rank = step.rank.as_ref().filter(|rank| !rank.names.is_empty());
            let figures = [
                report.phase.name().to_owned(),
                report.keyframe.to_string(),
                step.tracks.features.len().to_string(),
                number(rms_px(report)),
                rank.map_or_else(String::new, |rank| rank.rank_informed.to_string()),
                rank.map_or_else(String::new, |rank| rank.rank_structural.to_string()),
                report.counts.rejected.to_string(),
            ];
            let nothing = EVENT.map(|_| String::new());
            let cells = std::iter::once(label.clone()).chain(figures).chain(nothing);
            rows.push((report.stamp_ns, cells.collect()));
            for event in report.events.iter().filter(|event| event.kind.is_notable()) {
                let figure = |value: Option<f64>| number(value.unwrap_or(f64::NAN));
                let told = [
                    name_of(event.kind).to_owned(),
                    figure(event.value),
                    figure(event.threshold),
                    event.message.clone(),
                ];
                rows.push((report.stamp_ns, event_row(label, told)));
            }
        }
    }
    rows.sort_by_key(|(stamp_ns, _)| *stamp_ns);
    let heads: Vec<&str> = ["t_s", "run"].into_iter().chain(FIGURES).chain(EVENT).collect();
    let mut table = Table::new(&heads);
    for (stamp_ns, cells) in rows {
        table.row(std::iter::once(seconds(stamp_ns)).chain(cells));
    }
    table.text
}
