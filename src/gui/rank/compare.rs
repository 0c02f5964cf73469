//! All runs at the cursor side by side, and the better of the two minimal parameterizations.

use egui::{RichText, ScrollArea, Ui};

use super::columns::{RankColumn, columns_ui, is_narrow};
use crate::gimbal::{Chain, Parameterization, SWITCH_MARGIN, Singularity};
use crate::gui::PanelContext;
use crate::gui::help::terms::window;
use crate::observability::RankReport;
use crate::session::{Command, MAX_RUNS, RunRecord, RunSpec, StepRecord};
use crate::text::Named as _;

pub(super) const WIDTH_OF_A_RUN: f32 = 300.0;

/// Number of runs with a rank at the cursor.
pub(super) fn comparable(ctx: &PanelContext<'_>) -> usize {
    ranked(ctx).count()
}

fn ranked<'a>(ctx: &PanelContext<'a>) -> impl Iterator<Item = (usize, &'a RunRecord, &'a StepRecord, &'a RankReport)> {
    let cursor_ns = ctx.cursor_ns;
    ctx.recording.runs.iter().enumerate().filter_map(move |(number, run)| {
        let step = run.step_at(cursor_ns)?;
        let rank = step.rank.as_ref().filter(|rank| !rank.parameters.is_empty())?;
        Some((number, run, step.as_ref(), rank))
    })
}

pub(in crate::gui) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>) {
    let theme = *ctx.theme;
    let ranked: Vec<_> = ranked(ctx).collect();
    ScrollArea::vertical().id_salt("all runs").auto_shrink(false).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 3.0;
        let narrow = is_narrow(ui.available_width(), ranked.len());
        let margins_ui = |ui: &mut Ui, ctx: &mut PanelContext<'_>| {
            for (number, run, step, _) in &ranked {
                singularity_ui(ui, ctx, *number, run, step);
            }
        };
        // The wrapped lines of a narrow panel are below the columns.
        if !narrow {
            margins_ui(ui, ctx);
        }
        let columns: Vec<RankColumn<'_>> = ranked
            .iter()
            .map(|(number, run, _, rank)| RankColumn {
                title: run.spec.label.clone(),
                color: theme.run(*number).color,
                rank,
            })
            .collect();
        columns_ui(ui, ctx, &columns);
        if narrow {
            margins_ui(ui, ctx);
        }
    });
}

/// Shows the singularity margin of a minimal run, and offers the other end block if no run uses it.
pub(super) fn singularity_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    number: usize,
    run: &RunRecord,
    step: &StepRecord,
) {
    let calibration = &step.report.calibration;
    let own = calibration.parameterization;
    let other = match own {
        Parameterization::Minimal => Parameterization::MinimalSwapped,
        Parameterization::MinimalSwapped => Parameterization::Minimal,
        _ => return,
    };
    let margin_of = |parameterization: Parameterization| {
        let chain = Chain::from_classical(&calibration.classical, parameterization);
        chain.margins().into_iter().find(|(singularity, _)| *singularity == Singularity::End).map(|(_, margin)| margin)
    };
    let (Some(here), Some(there)) = (margin_of(own), margin_of(other)) else { return };
    let taken = run.spec.parameterization.switches_parameterization(&ctx.recording.rig);
    ui.horizontal_wrapped(|ui| {
        let color = if here < SWITCH_MARGIN { ctx.theme.error } else { ctx.theme.text };
        let text = format!(
            "{}: singularity margin {here:.2} (end link; 0 = singular). {other}: {there:.2}{}",
            run.spec.label,
            if taken { format!(". Switches below {SWITCH_MARGIN:.2}") } else { String::new() }
        );
        ui.label(RichText::new(text).color(color)).on_hover_text(window::SINGULARITY_MARGIN.meaning);
        let is_there = ctx.recording.runs.iter().any(|run| {
            let newest = run.step_at(ctx.cursor_ns);
            newest.is_some_and(|step| step.report.calibration.parameterization == other)
        });
        let spec =
            other.name().parse::<RunSpec>().ok().filter(|_| !taken && !is_there && ctx.recording.runs.len() < MAX_RUNS);
        let spec = spec.filter(|_| !ctx.presentation.is_figure());
        if let Some(spec) = spec {
            let spec = RunSpec { encoder: run.spec.encoder, calibrate: run.spec.calibrate, ..spec };
            let button = ui.small_button(format!("Add run {other}"));
            let button = button.on_hover_text(format!(
                "Adds a run with run {}'s options and the other end block of the chain",
                number + 1
            ));
            if button.clicked() {
                ctx.commands.push(Command::AddRun(spec));
            }
        }
    });
}
