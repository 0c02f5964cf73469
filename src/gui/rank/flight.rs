//! Verdict of the whole flight at the top of the panel; it does not depend on the cursor.

use egui::{Color32, Ui};

use super::sections::{MIN_HEIGHT_WITH_CAUSE, fact_at_ui, fact_ui, headline_ui};
use crate::gui::PanelContext;
use crate::gui::calibration::{rule, span_text};
use crate::gui::determination::look_of;
use crate::gui::units::fixed;
use crate::observability::Determination;
use crate::session::{FlightParameter, RunRecord, flight_headline, least_determined};

/// Height in points of a panel from which reason and remedy are shown too; in a lower one the heat map needs the room.
const MIN_HEIGHT_WITH_REASON: f32 = 480.0;

/// Draws the counts of the verdicts, and the least determined parameter with its start, reason and remedy; in a low panel
/// only that parameter.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, run: &RunRecord, height: f32) {
    let report = ctx.flight(ui, run);
    if report.rows.is_empty() {
        return;
    }
    let theme = *ctx.theme;
    let (span, headline) = (span_text(ctx.recording, run), flight_headline(&report.rows));
    let least = least_determined(&report.rows);
    let low = height < MIN_HEIGHT_WITH_CAUSE && least.is_some();
    if !low {
        let headline = if height < MIN_HEIGHT_WITH_CAUSE { short_headline(&report.rows) } else { headline.clone() };
        headline_ui(ui, &theme, worst_look(&report.rows, ctx), &span, &headline, &rule(ctx, &report.rows));
    }
    let Some(least) = least else { return };
    let name = if low { format!("{span} ") } else { "Least determined: ".to_owned() };
    let ratio = least.of_required().map_or_else(String::new, |ratio| format!(" ({} × required)", fixed(ratio, 1)));
    let line = format!("{} {}{ratio}", look_of(least.verdict, &theme).0, least.name);
    let meaning = format!("{headline}\nLeast determined: {}, {}", least.name, least.verdict_text());
    if fact_at_ui(ui, ctx, &name, &line, least.since_ns, &meaning) {
        ctx.selection.parameter = Some(least.parameter);
    }
    if height >= MIN_HEIGHT_WITH_REASON {
        fact_ui(ui, &theme, "Why: ", &least.reason, theme.text);
        if !least.remedy.is_empty() {
            fact_ui(ui, &theme, "What helps: ", &least.remedy, theme.text);
        }
    }
}

/// Number of parameters that are accurate enough, and of all others by verdict: `12 accurate enough, 12 redundant`.
fn short_headline(rows: &[FlightParameter]) -> String {
    let (met, others): (Vec<FlightParameter>, Vec<FlightParameter>) =
        rows.iter().cloned().partition(|row| row.verdict.is_met());
    let others = flight_headline(&others);
    let others = others.split_once(": ").map(|(_, counts)| counts).filter(|counts| !counts.is_empty());
    let met = (!met.is_empty()).then(|| format!("{} accurate enough", met.len()));
    met.as_deref().into_iter().chain(others).collect::<Vec<_>>().join(", ")
}

/// Look of the worst verdict of some rows.
fn worst_look(rows: &[FlightParameter], ctx: &PanelContext<'_>) -> (&'static str, Color32) {
    let has = |verdict: Determination| rows.iter().any(|row| row.verdict == verdict);
    let order = [
        Determination::Unknown,
        Determination::NotDetermined,
        Determination::WeaklyDetermined,
        Determination::Redundant,
        Determination::Initializing,
    ];
    look_of(order.into_iter().find(|verdict| has(*verdict)).unwrap_or(Determination::Determined), ctx.theme)
}
