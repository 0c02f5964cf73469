//! One calibration parameter at the cursor.

use egui::{RichText, Ui};

use super::rows::rows_ui;
use crate::gimbal::ParameterId;
use crate::gui::PanelContext;
use crate::gui::derived::chain_values::true_values;
use crate::gui::help::terms::parameter as terms;
use crate::gui::parameter_names::meaning_of;
use crate::gui::units::fixed;
use crate::session::{RunRecord, StepRecord};
use crate::table::align_numbers;
use crate::text::Named as _;

pub(super) fn ui(ui: &mut Ui, ctx: &PanelContext<'_>, run: &RunRecord, step: &StepRecord, parameter: ParameterId) {
    let theme = ctx.theme;
    ui.add(egui::Label::new(RichText::new(meaning_of(parameter, &ctx.recording.rig)).color(theme.text)).wrap());
    let calibration = &step.report.calibration;
    let Some(index) = calibration.index_of(parameter) else {
        let text = format!("Not a parameter of run {} in this step", run.spec.label);
        ui.label(RichText::new(text).color(theme.text_weak));
        return;
    };
    let entry = |values: &[f64]| values.get(index).copied().unwrap_or(f64::NAN);
    let shown = parameter.shown();
    let (value, sigma, prior) =
        (entry(&calibration.values), entry(&calibration.sigmas), entry(&calibration.prior_sigmas));
    let mut rows = vec![
        (terms::VALUE, vec![shown.value(run.shown_value(parameter, value), sigma)]),
        (terms::SIGMA, vec![shown.sigma(sigma)]),
        (terms::PRIOR_SIGMA, vec![shown.sigma(prior)]),
        (terms::RATIO, vec![fixed(sigma / prior, 3)]),
    ];
    let begin = run.steps.first().map(|first| &first.report.calibration);
    let begin = begin.and_then(|first| first.values.get(first.index_of(parameter)?));
    if let Some(begin) = begin {
        rows.push((terms::INITIAL, vec![shown.value(parameter.principal_value(*begin), sigma)]));
        rows.push((terms::CHANGE, vec![shown.value(parameter.principal_value(value - begin), sigma)]));
    }
    let ground_truth =
        true_values(ctx.recording, run, ctx.cursor_ns).and_then(|ground_truth| ground_truth.get(&parameter).copied());
    if let Some(ground_truth) = ground_truth {
        rows.push((
            terms::GROUND_TRUTH,
            vec![shown.value(parameter.value_near(run.shown_value(parameter, value), ground_truth), sigma)],
        ));
        let error = parameter.principal_value(value - ground_truth);
        let ratio = fixed(error.abs() / sigma, 1);
        rows.push((terms::ERROR, vec![format!("{} ({ratio} σ)", shown.value(error, sigma))]));
    }
    align_numbers(rows.iter_mut().flat_map(|(_, values)| values));
    let report = ctx.flight(ui, run);
    let here = report.history.verdict(parameter, report.history.row_at(step.report.stamp_ns));
    rows.push((terms::VERDICT_HERE, vec![here.name().to_owned()]));
    let flight = report.rows.iter().find(|row| row.parameter == parameter);
    if let Some(flight) = flight {
        let since = flight.since_s().map_or_else(String::new, |since_s| format!(" since {} s", fixed(since_s, 2)));
        rows.push((terms::VERDICT, vec![format!("{}{since}", flight.verdict.name())]));
    }
    rows_ui(ui, theme, "parameter", rows);
    let texts = flight.map(|flight| [("Why: ", &flight.reason), ("What helps: ", &flight.remedy)]);
    for (head, text) in texts.into_iter().flatten().filter(|(_, text)| !text.is_empty()) {
        ui.add(egui::Label::new(RichText::new(format!("{head}{text}")).color(theme.text)).wrap());
    }
}
