//! Plots with a strip per group: distributions, paired differences and success rates.

use std::collections::BTreeMap;

use egui::{Label, RichText, Ui};

use super::context::StudyContext;
use super::model::{StudyModel, shown_group};
use super::strips::{StripPlot, StripsFrame, StripsPlot};
use crate::gui::plot::ValueAxis;
use crate::gui::units::{counted, fixed, significant};
use crate::study::view::{Metric, Spread, Study, SuccessRate, columns, paired_differences, success_rate};

/// Strips that are recomputed when rows, groups or metric change.
#[derive(Debug, Default)]
struct Cached {
    generation: u64,
    strips: Vec<StripPlot>,
    axis: Option<ValueAxis>,
}

impl Cached {
    /// Strips and their axis, updated if necessary.
    fn read(
        &mut self,
        model: &StudyModel,
        strips: impl FnOnce() -> Vec<StripPlot>,
        axis: impl FnOnce(&[StripPlot]) -> ValueAxis,
    ) -> (&[StripPlot], ValueAxis) {
        if self.axis.is_none() || self.generation != model.generation {
            self.strips = strips();
            self.generation = model.generation;
            self.axis = Some(axis(&self.strips));
        }
        (&self.strips, self.axis.unwrap_or(ValueAxis { logarithmic: false, low: 0.0, high: 1.0 }))
    }
}

fn values(strips: &[StripPlot]) -> impl Iterator<Item = f64> {
    strips.iter().flat_map(|strip| strip.points.iter().map(|(_, value)| *value))
}

/// Unit as written after a number: with a space before it, except for degrees and percent.
pub(super) fn spaced(unit: &str) -> String {
    match unit {
        "" | "°" => unit.to_owned(),
        _ => format!(" {unit}"),
    }
}

fn hint_ui(ui: &mut Ui, ctx: &StudyContext<'_>, text: &str) {
    ui.add(Label::new(RichText::new(text).color(ctx.theme.text_weak)).wrap());
}

/// "by run"; empty without groups.
fn by_group(model: &StudyModel) -> String {
    model.group().map(|group| format!(" by {group}")).unwrap_or_default()
}

#[derive(Debug, Default)]
pub(super) struct DistributionPanel {
    cached: Cached,
    plot: StripsPlot,
}

impl DistributionPanel {
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut StudyContext<'_>) {
        let Some(metric) = ctx.metric().filter(|_| !ctx.model.arranged.rows.is_empty()) else {
            hint_ui(ui, ctx, "No run passes the filter");
            return;
        };
        let (study, model) = (ctx.study, &*ctx.model);
        let (strips, axis) =
            self.cached.read(model, || distributions(study, model, &metric), |strips| ValueAxis::over(values(strips)));
        let title = format!("{}{}", metric.title(), by_group(model));
        ui.label(RichText::new(format!("{title}: median, quartiles and every run")).small().color(ctx.theme.text_weak))
            .on_hover_text(&metric.description);
        let unit = spaced(metric.unit);
        let frame =
            StripsFrame { name: "Distributions", title: &metric.title(), unit: &unit, axis, zero: axis.low < 0.0 };
        self.plot.ui(ui, ctx, strips, &frame);
    }
}

#[cfg(test)]
impl DistributionPanel {
    /// Screen positions of the points with their rows.
    pub(super) fn places(&self) -> Vec<(egui::Pos2, usize)> {
        self.plot.places()
    }
}

/// The values of a metric by group.
pub(super) fn distributions(study: &Study, model: &StudyModel, metric: &Metric) -> Vec<StripPlot> {
    let strip = |(number, group): (usize, &crate::study::view::RowGroup)| {
        let points = metric.values(&study.runs, &group.rows);
        let spread = Spread::of(points.iter().map(|(_, value)| *value));
        let unit = spaced(metric.unit);
        let mut notes: Vec<String> = spread
            .map(|spread| {
                let quartiles = format!("{} – {}", significant(spread.q1), significant(spread.q3));
                vec![format!("{}{unit}", significant(spread.median)), quartiles]
            })
            .unwrap_or_else(|| vec!["no value".to_owned()]);
        let all = group.rows.len();
        notes.push(if points.len() == all { format!("n = {all}") } else { format!("n = {} of {all}", points.len()) });
        StripPlot {
            name: shown_group(&group.name, model.group()),
            notes,
            hover: "Median, quartiles, number of runs with a value".to_owned(),
            points,
            spread,
            interval: None,
            color: number,
        }
    };
    model.arranged.groups.iter().enumerate().map(strip).collect()
}

/// Differences of each group to the reference group on equal inputs.
#[derive(Debug, Default)]
pub(super) struct PairedPanel {
    cached: Cached,
    plot: StripsPlot,
}

impl PairedPanel {
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut StudyContext<'_>) {
        let reference = ctx.model.reference().map(str::to_owned);
        let (Some(metric), Some(group), Some(reference)) = (ctx.metric(), ctx.model.group(), reference) else {
            hint_ui(ui, ctx, "Group the runs to compare groups on equal logs, disturbances, perturbations and seeds");
            return;
        };
        if ctx.model.arranged.groups.len() < 2 {
            let text = format!("Only one group of '{group}' passes the filter: nothing to compare");
            hint_ui(ui, ctx, &text);
            return;
        }
        let (study, model) = (ctx.study, &*ctx.model);
        let (strips, axis) = self.cached.read(
            model,
            || differences(study, model, &metric, &reference),
            |strips| ValueAxis::around_zero(values(strips)),
        );
        let title = format!("{} − {}", metric.title(), shown_group(&reference, model.group()));
        let text = format!("{title}: mean difference with its 95 % interval, and every pair of runs on equal inputs");
        ui.add(Label::new(RichText::new(text).small().color(ctx.theme.text_weak)).truncate());
        if strips.iter().all(|strip| strip.points.is_empty()) {
            hint_ui(ui, ctx, "No two groups have runs on the same log, disturbance, perturbation and seed");
            return;
        }
        let unit = spaced(metric.unit);
        let frame = StripsFrame { name: "Paired differences", title: &title, unit: &unit, axis, zero: true };
        self.plot.ui(ui, ctx, strips, &frame);
    }
}

/// Differences of every group except the reference.
pub(super) fn differences(study: &Study, model: &StudyModel, metric: &Metric, reference: &str) -> Vec<StripPlot> {
    let Some(column) = model.group() else { return Vec::new() };
    let groups = &model.arranged.groups;
    let color = |name: &str| groups.iter().position(|group| group.name == name).unwrap_or_default();
    let compared = paired_differences(&study.runs, groups, column, reference, metric);
    let strip = |of: crate::study::view::GroupDifference| {
        let mut notes = Vec::new();
        let unit = spaced(metric.unit);
        if let Some(mean) = of.mean {
            let verdict = if mean.high < 0.0 {
                "▼ lower"
            } else if mean.low > 0.0 {
                "▲ higher"
            } else {
                "≈ no difference"
            };
            notes.push(format!("{verdict} {}{unit}", signed(mean.mean)));
            notes.push(format!("[{}, {}]", signed(mean.low), signed(mean.high)));
        } else {
            notes.push("too few pairs".to_owned());
        }
        let lower = 100.0 * of.below as f64 / of.pairs.len().max(1) as f64;
        notes.push(format!("{}, {} % lower", counted(of.pairs.len(), "pair"), fixed(lower, 0)));
        StripPlot {
            name: shown_group(&of.name, Some(column)),
            notes,
            hover: format!(
                "Mean of the differences, its 95 % interval (Student's t), pairs in which the value is lower than that of \
                 {reference}; {} runs have no partner or no value",
                of.unpaired
            ),
            points: of.pairs.iter().map(|pair| (pair.row, pair.difference())).collect(),
            spread: None,
            interval: of.mean.map(|mean| [mean.low, mean.mean, mean.high]),
            color: color(&of.name),
        }
    };
    compared.into_iter().map(strip).collect()
}

fn signed(value: f64) -> String {
    let text = significant(value);
    if value > 0.0 { format!("+{text}") } else { text }
}

#[derive(Debug, Default)]
pub(super) struct SuccessPanel {
    cached: Cached,
    plot: StripsPlot,
}

impl SuccessPanel {
    pub(super) fn ui(&mut self, ui: &mut Ui, ctx: &mut StudyContext<'_>) {
        if ctx.model.arranged.rows.is_empty() {
            hint_ui(ui, ctx, "No run passes the filter");
            return;
        }
        let (study, model) = (ctx.study, &*ctx.model);
        let axis = ValueAxis { logarithmic: false, low: 0.0, high: 100.0 };
        let (strips, axis) = self.cached.read(model, || success_rates(study, model), |_| axis);
        let condition = &model.success;
        let condition = if condition.filter.is_empty() { "every run" } else { &condition.text };
        let text = format!("Runs with {condition}, with the 95 % interval (Wilson)");
        ui.add(Label::new(RichText::new(text).small().color(ctx.theme.text_weak)).truncate());
        let frame = StripsFrame { name: "Success rate", title: "success [%]", unit: " %", axis, zero: false };
        self.plot.ui(ui, ctx, strips, &frame);
    }
}

pub(super) fn success_rates(study: &Study, model: &StudyModel) -> Vec<StripPlot> {
    let strip = |(number, group): (usize, &crate::study::view::RowGroup)| {
        let succeeded = |row: &&usize| model.success.filter.passes(&study.runs, **row);
        let rate = success_rate(group.rows.iter().filter(succeeded).count(), group.rows.len());
        let SuccessRate { successes, runs, rate, low, high } = rate;
        let mut failures: BTreeMap<&str, usize> = BTreeMap::new();
        for row in group.rows.iter().filter(|row| !succeeded(row)) {
            *failures.entry(study.runs.text(*row, columns::STATUS).unwrap_or("no status")).or_default() += 1;
        }
        let failures: Vec<String> = failures.into_iter().map(|(status, count)| format!("{count} {status}")).collect();
        let percent = |value: f64| fixed(100.0 * value, 1);
        StripPlot {
            name: shown_group(&group.name, model.group()),
            notes: vec![
                format!("{} %", percent(rate)),
                format!("{successes} of {runs}"),
                format!("[{}, {}]", percent(low), percent(high)),
            ],
            hover: if failures.is_empty() { String::new() } else { format!("Not: {}", failures.join(", ")) },
            points: Vec::new(),
            spread: None,
            interval: Some([100.0 * low, 100.0 * rate, 100.0 * high]),
            color: number,
        }
    };
    model.arranged.groups.iter().enumerate().map(strip).collect()
}
