//! Items of the command palette: all actions, and the content of the recording at the cursor.

use egui::Ui;

use super::fuzzy;
use crate::frontend::FeatureId;
use crate::geometry::ns_from_seconds;
use crate::gimbal::ParameterId;
use crate::gui::parameter_names::meaning_of;
use crate::gui::theme::ThemeName;
use crate::gui::timeline::SPEEDS;
use crate::gui::units::seconds;
use crate::gui::window::actions::{Action, TABLE, keys_of};
use crate::gui::window::panel_tiles::PanelTiles;
use crate::gui::{Dialog, PanelContext, PanelName};
use crate::session::RunRecord;
use crate::text::Named as _;

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Choice {
    Action(Action),
    /// Select a parameter, and go to the start of its verdict, in nanoseconds since the log began.
    Parameter(ParameterId, Option<i64>),
}

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Item {
    pub(super) name: String,
    /// Keys; empty without keys.
    pub(super) keys: &'static str,
    pub(super) choice: Choice,
}

fn item(name: impl Into<String>, action: Action) -> Item {
    Item { name: name.into(), keys: keys_of(action), choice: Choice::Action(action) }
}

/// Items that match the typed text, best first; all actions in their own order for an empty text.
pub(super) fn found(typed: &str, ui: &Ui, ctx: &PanelContext<'_>, tiles: &PanelTiles) -> Vec<Item> {
    let places = places(typed, ctx);
    let mut items = commands(ctx, tiles);
    if !typed.trim().is_empty() {
        items.extend(parameters(ui, ctx));
    }
    let mut scored: Vec<(i32, Item)> =
        items.into_iter().filter_map(|item| Some((fuzzy::score(typed, &item.name)?, item))).collect();
    // Equally good matches keep their order.
    scored.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    places.into_iter().chain(scored.into_iter().map(|(_, item)| item)).collect()
}

fn commands(ctx: &PanelContext<'_>, tiles: &PanelTiles) -> Vec<Item> {
    let listed = TABLE.iter().filter(|entry| {
        // Their effects are listed below, or are already in effect.
        !matches!(entry.action, Action::Dialog(Dialog::Palette) | Action::Dismiss | Action::SavedLayout(_))
    });
    let mut items: Vec<Item> = listed.map(|entry| item(entry.name, entry.action)).collect();
    items.push(item("Clear the selection", Action::Dismiss));
    items.extend(tiles.saved.names().enumerate().map(|(number, name)| {
        const KEYS: [&str; 9] =
            ["Ctrl+1", "Ctrl+2", "Ctrl+3", "Ctrl+4", "Ctrl+5", "Ctrl+6", "Ctrl+7", "Ctrl+8", "Ctrl+9"];
        let keys = KEYS.get(number).copied().unwrap_or_default();
        Item { keys, ..item(format!("Layout: {name}"), Action::SavedLayout(number)) }
    }));
    for panel in PanelName::all() {
        items.push(item(format!("Panel: show {}", panel.name()), Action::Show(panel)));
    }
    for panel in PanelName::all() {
        items.push(item(format!("Copy table of {} (CSV)", panel.name()), Action::CopyTable(panel)));
    }
    for panel in PanelName::movable().filter(|panel| tiles.layout.is_visible(*panel)) {
        items.push(item(format!("Panel: hide {}", panel.name()), Action::Hide(panel)));
    }
    let runs = &ctx.recording.runs;
    for (number, run) in runs.iter().enumerate() {
        items.push(item(format!("Run: show {}", run.spec.label), Action::Run(number)));
    }
    if let Some(last) = runs.last().filter(|_| runs.len() > 1) {
        items.push(item(format!("Run: remove {}…", last.spec.label), Action::RemoveRun(runs.len() - 1)));
    }
    for marker in ctx.playback.markers.iter() {
        let name = if marker.name.is_empty() { String::new() } else { format!("{}, ", marker.name) };
        let text = format!("Marker: go to {name}{} s", seconds(marker.stamp_ns));
        items.push(item(text, Action::GoTo(marker.stamp_ns)));
    }
    items.extend(SPEEDS.map(|speed| item(format!("Speed: {speed}×"), Action::Speed(speed))));
    for theme in [ThemeName::Light, ThemeName::Dark, ThemeName::Print] {
        items.push(item(format!("Theme: {}", theme.name()), Action::SetTheme(theme)));
    }
    items
}

/// Parameters of the shown run at the cursor, with the verdicts of the flight: the palette finds `weak`.
fn parameters(ui: &Ui, ctx: &PanelContext<'_>) -> Vec<Item> {
    let step = ctx.selected_run().and_then(|run| run.step_at(ctx.cursor_ns).or_else(|| run.steps.first()));
    let names = ctx.names();
    let parameters = step.into_iter().flat_map(|step| &step.report.calibration.parameters);
    let report = ctx.selected_run().map(|run| ctx.flight(ui, run)).unwrap_or_default();
    parameters
        .map(|parameter| {
            let row = report.rows.iter().find(|row| row.parameter == *parameter);
            let since_ns = row.and_then(|row| row.since_ns);
            let since = since_ns.map_or_else(String::new, |since_ns| format!(" since {} s", seconds(since_ns)));
            let verdict = row.map_or_else(String::new, |row| format!(", {}{since}", row.verdict.name()));
            let meaning = meaning_of(*parameter, &ctx.recording.rig);
            let name = format!("Parameter {}{verdict}: {meaning}", names.name(*parameter));
            Item { name, keys: "", choice: Choice::Parameter(*parameter, since_ns) }
        })
        .collect()
}

/// Times, frames and features with the typed number.
fn places(typed: &str, ctx: &PanelContext<'_>) -> Vec<Item> {
    let text = typed.trim().to_lowercase();
    let text = text.strip_prefix("go to").map_or(text.as_str(), str::trim_start);
    // `frame 12`, `time 3`, `feature 40`; `12.5 s` starts with the number.
    let word = text.split_whitespace().next().filter(|word| word.chars().all(char::is_alphabetic)).unwrap_or_default();
    let number = text[word.len()..].trim_start();
    let is = |kind: &str| kind.starts_with(word);
    let mut items = Vec::new();
    if let Some(time_s) = seconds_of(number).filter(|_| is("time")) {
        let stamp_ns = ns_from_seconds(time_s);
        if (0..=ctx.recording.duration_ns).contains(&stamp_ns) {
            items.push(item(format!("Go to {} s", seconds(stamp_ns)), Action::GoTo(stamp_ns)));
        }
    }
    let Some(number) = number.trim_start_matches('#').parse::<u64>().ok() else { return items };
    let frame = |run: &RunRecord| {
        let step = run.steps.iter().find(|step| step.report.frame_index as u64 == number)?;
        Some(step.report.stamp_ns)
    };
    if let Some(stamp_ns) = ctx.selected_run().filter(|_| is("frame")).and_then(frame) {
        items.push(item(format!("Go to frame {number} ({} s)", seconds(stamp_ns)), Action::GoTo(stamp_ns)));
    }
    let step = ctx.selected_run().and_then(|run| run.step_at(ctx.cursor_ns));
    let known = |id: FeatureId| {
        step.is_some_and(|step| step.track(id).is_some() || step.report.features.iter().any(|feature| feature.id == id))
    };
    if is("feature") && known(FeatureId(number)) {
        items.push(item(format!("Select feature {number}"), Action::Feature(FeatureId(number))));
    }
    items
}

/// Seconds of a text such as `12.5`, `12.5 s` or `1:05.2`.
fn seconds_of(text: &str) -> Option<f64> {
    let text = text.trim().strip_suffix('s').unwrap_or(text).trim();
    let (minutes, rest) = text.split_once(':').unwrap_or(("0", text));
    let time_s = 60.0 * minutes.parse::<u32>().ok().map(f64::from)? + rest.parse::<f64>().ok()?;
    (time_s.is_finite() && time_s >= 0.0).then_some(time_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_as_people_write_them() {
        for (text, time_s) in [("12.5", 12.5), ("12.5 s", 12.5), ("3s", 3.0), ("1:05.2", 65.2), ("0", 0.0)] {
            assert_eq!(seconds_of(text), Some(time_s), "{text}");
        }
        for text in ["", "s", "-3", "1:", "nan", "inf", "frame"] {
            assert_eq!(seconds_of(text), None, "{text}");
        }
    }
}
