//! Null and uninformed directions by parameter name: a heat map with the signed weights as text, its rows in groups.

use egui::epaint::TextShape;
use egui::{Align2, Painter, Rangef, Rect, RichText, Role, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

use crate::gimbal::{ParameterGroup, ParameterId};
use crate::gui::PanelContext;
use crate::gui::parameter_names::{meaning_of, part_of};
use crate::gui::theme::{self, Theme, label_font};
use crate::gui::under_pointer::{Item, offer_item};
use crate::gui::units::{counted, fixed, significant};
use crate::gui::widgets::describe;
use crate::observability::{CalibrationDirection, RankReport, parameters_of};
use crate::session::FlightParameter;
use crate::text::Named as _;

const HEADER_HEIGHT: f32 = 28.0;
/// Height in points of the header of narrow columns, whose numbers are vertical.
const UPRIGHT_HEADER_HEIGHT: f32 = 46.0;
const MAX_ROW_HEIGHT: f32 = 22.0;
const MIN_ROW_HEIGHT: f32 = 12.0;
/// Row height in points from which rows without weights are shown too.
const COMFORTABLE_ROW_HEIGHT: f32 = 16.0;
/// Height in points of the line about rows and columns that are not shown.
const NOTE_HEIGHT: f32 = 16.0;
/// Number of rows shown whatever the height of the panel.
const MIN_ROWS: usize = 3;
/// Minimum width of a column with signed numbers in points.
const NUMBER_WIDTH: f32 = 48.0;
/// Minimum width in points of a column whose singular value fits between its neighbours.
const HEAD_WIDTH: f32 = 44.0;
const MAX_COLUMN_WIDTH: f32 = 84.0;
const MIN_COLUMN_WIDTH: f32 = 15.0;
/// Smaller weights have no text in their cell.
const MIN_SHOWN_WEIGHT: f64 = 0.05;
/// Range of the width of the names in points.
const NAME_WIDTHS: std::ops::RangeInclusive<f32> = 40.0..=130.0;

/// Draws the heat map in the first of the `heights`, in points, if all parameters fit into it, else in the second with
/// the first of the rows by `importance`.
pub(super) fn ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, rank: &RankReport, importance: &[usize], heights: [f32; 2]) {
    let theme = *ctx.theme;
    if rank.directions.is_empty() {
        ui.label(RichText::new("No null or uninformed direction").color(theme.text_weak));
        return;
    }
    let names = ctx.names();
    let name_width = |parameter: &ParameterId| {
        ui.painter().layout_no_wrap(names.name(*parameter), theme::label_font(), theme.text).size().x
    };
    let widest = rank.parameters.iter().map(name_width).fold(0.0, f32::max);
    let strip = strip_width(&rank.parameters);
    let name_width = strip + (widest + 8.0).clamp(*NAME_WIDTHS.start(), *NAME_WIDTHS.end());
    let width = ui.available_width();
    let room = (width - name_width).max(MIN_COLUMN_WIDTH);
    let count = rank.directions.len().min((room / MIN_COLUMN_WIDTH) as usize).max(1);
    let pitch = (room / count as f32).min(MAX_COLUMN_WIDTH);
    let directions = &rank.directions[..count];

    let header_height = if pitch >= HEAD_WIDTH { HEADER_HEIGHT } else { UPRIGHT_HEADER_HEIGHT };
    let Rows { rows, row_height, omitted } =
        Rows::of(rank, directions, importance, heights.map(|height| height - header_height));
    let (_, rect) = ui.allocate_space(vec2(width, header_height + row_height * rows.len() as f32));

    for (column, direction) in directions.iter().enumerate() {
        let left = rect.left() + name_width + column as f32 * pitch;
        let cell = Rect::from_min_size(pos2(left, rect.top()), vec2(pitch, header_height));
        header(ui, ctx, rank, direction, column, cell);
    }
    for (place, row) in rows.iter().enumerate() {
        let top = rect.top() + header_height + place as f32 * row_height;
        let line = Rect::from_min_size(pos2(rect.left(), top), vec2(name_width + pitch * count as f32, row_height));
        row_ui(ui, ctx, rank.parameters[*row], *row, directions, line, [strip, name_width, pitch]);
    }
    if strip > 0.0 {
        let top = |place: usize| rect.top() + header_height + place as f32 * row_height;
        let range = |place: usize| Rangef::new(top(place), top(place + 1));
        let rows = rows.iter().enumerate().map(|(place, row)| (rank.parameters[*row].group(), range(place)));
        let across = Rangef::new(rect.left(), rect.left() + name_width + pitch * count as f32);
        paint_groups(ui.painter(), &theme, &rows.collect::<Vec<_>>(), across);
    }
    let mut notes = Vec::new();
    if let Some(largest) = omitted {
        let left_out = rank.parameters.len() - rows.len();
        // Rounded up, so that it bounds all of them.
        let bound = ((100.0 * largest).floor() + 1.0) / 100.0;
        notes.push(format!("{} with |weight| < {}", counted(left_out, "parameter"), fixed(bound, 2)));
    }
    if count < rank.directions.len() {
        notes.push(counted(rank.directions.len() - count, "more observable direction"));
    }
    if !notes.is_empty() {
        ui.label(RichText::new(format!("Not shown: {}", notes.join(", "))).small().color(theme.text_weak));
    }
}

struct Rows {
    /// Indices of the parameters, in chain order.
    rows: Vec<usize>,
    row_height: f32,
    /// Largest |weight| of the parameters that are not shown; `None` if all are.
    omitted: Option<f64>,
}

impl Rows {
    /// All rows if they fit comfortably into the first of the `heights`; else the first ones by `importance` that fit into
    /// the second.
    fn of(rank: &RankReport, directions: &[CalibrationDirection], importance: &[usize], heights: [f32; 2]) -> Self {
        let height_of =
            |height: f32, count: usize| (height / count.max(1) as f32).clamp(MIN_ROW_HEIGHT, MAX_ROW_HEIGHT);
        let all = rank.parameters.len();
        let sorted = |mut rows: Vec<usize>| {
            rows.sort_by_key(|row| (part_of(rank.parameters[*row]), *row));
            rows
        };
        if COMFORTABLE_ROW_HEIGHT * all as f32 <= heights[0] {
            let rows = sorted((0..all).collect());
            return Self { rows, row_height: height_of(heights[0], all), omitted: None };
        }
        let [preferred, most] = heights.map(|height| height - NOTE_HEIGHT);
        let fitting = ((most / MIN_ROW_HEIGHT) as usize).clamp(MIN_ROWS.min(all), all);
        let rows = sorted(importance.iter().copied().take(fitting).collect());
        let weight = |row: usize| {
            let weights = directions.iter().map(|direction| weight_of(direction, row));
            weights.fold(0.0, f64::max)
        };
        let omitted = (0..all).filter(|row| !rows.contains(row)).map(weight).reduce(f64::max);
        let row_height = height_of(preferred, rows.len());
        Self { rows, row_height, omitted }
    }
}

fn weight_of(direction: &CalibrationDirection, row: usize) -> f64 {
    direction.weights.get(row).copied().unwrap_or(0.0).abs()
}

/// All columns of a step by importance: the parameters by which its least observable direction is named, then the
/// others from the least determined one of the flight on, so that a low map keeps its rows while the cursor moves.
pub(super) fn important_rows(rank: &RankReport, flight: &[FlightParameter]) -> Vec<usize> {
    /// Number and smallest weight of the parameters by which the headline names a direction.
    const NAMED: (usize, f64) = (3, 0.2);
    let ratio = |row: &usize| {
        let of = flight.iter().find(|known| rank.parameters.get(*row) == Some(&known.parameter));
        of.and_then(FlightParameter::of_required).unwrap_or(0.0)
    };
    let mut others: Vec<usize> = (0..rank.parameters.len()).collect();
    let mut rows: Vec<usize> = Vec::new();
    if let Some(direction) = rank.least_observable_direction() {
        let weight = |row: &usize| weight_of(direction, *row);
        others.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
        rows = others.iter().copied().filter(|row| weight(row) >= NAMED.1).take(NAMED.0).collect();
    }
    others.retain(|row| !rows.contains(row));
    others.sort_by(|a, b| ratio(b).total_cmp(&ratio(a)).then(a.cmp(b)));
    rows.extend(others);
    rows
}

/// Paints the number and the singular value of a direction.
fn header(
    ui: &Ui,
    ctx: &PanelContext<'_>,
    rank: &RankReport,
    direction: &CalibrationDirection,
    column: usize,
    cell: Rect,
) {
    let theme = ctx.theme;
    let color = if direction.structural { theme.error } else { theme.warn };
    let painter = ui.painter();
    let mark = direction.kind();
    let value = if direction.structural { "0".to_owned() } else { significant(direction.singular_value) };
    let small = theme::number_font();
    if cell.width() >= HEAD_WIDTH {
        let top = cell.center_top();
        let short = if direction.structural { mark } else { "uninf." };
        painter.text(top, Align2::CENTER_TOP, short, theme::label_font(), color);
        painter.text(top + vec2(0.0, 13.0), Align2::CENTER_TOP, value, small, theme.text_weak);
    } else {
        let galley = painter.layout_no_wrap(value, small, color);
        let foot = cell.center_bottom() - vec2(0.5 * galley.size().y, 2.0);
        painter.add(TextShape::new(foot, galley, color).with_angle(-std::f32::consts::FRAC_PI_2));
    }
    let response = ui.interact(cell, ui.unique_id().with(("direction", column)), Sense::hover());
    let named = parameters_of(&ctx.names(), &rank.parameters, direction, 6);
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, format!("{mark} direction {named}")));
    response.on_hover_text(format!(
        "{mark} direction, singular value {} (1: σ of 10° or 3 cm)\n{named}",
        significant(direction.singular_value)
    ));
}

fn row_ui(
    ui: &Ui,
    ctx: &mut PanelContext<'_>,
    parameter: ParameterId,
    row: usize,
    directions: &[CalibrationDirection],
    line: Rect,
    [strip_width, name_width, pitch]: [f32; 3],
) {
    let theme = *ctx.theme;
    let name = ctx.names().name(parameter);
    let painter = ui.painter();
    let selected = ctx.selection.parameter == Some(parameter);
    let color = if selected { theme.accent } else { theme.text };
    let place = line.left_center() + vec2(strip_width, 0.0);
    painter.text(place, Align2::LEFT_CENTER, &name, theme::label_font(), color);
    for (column, direction) in directions.iter().enumerate() {
        let weight = direction.weights.get(row).copied().unwrap_or(0.0);
        let left = line.left() + name_width + column as f32 * pitch;
        let cell = Rect::from_min_size(pos2(left, line.top()), vec2(pitch, line.height())).shrink(0.5);
        paint_weight(painter, &theme, weight, cell, pitch >= NUMBER_WIDTH);
    }
    let (sense, role) = ctx.presentation.clickable(Role::Label);
    let response = ui.interact(line, ui.unique_id().with(("row", &name)), sense);
    response.widget_info(|| WidgetInfo::selected(role, true, selected, format!("{name} weights")));
    let weights = directions.iter().map(|direction| direction.weights.get(row).copied().unwrap_or(0.0));
    let weights = weights.enumerate().map(|(number, weight)| format!("direction {} {weight:+.2}", number + 1));
    describe(&response, &weights.collect::<Vec<_>>().join(", "));
    if selected || response.hovered() {
        let stroke = Stroke::new(1.0, if selected { theme.accent } else { theme.outline });
        painter.rect_stroke(line, 0.0, stroke, StrokeKind::Inside);
    }
    if response.contains_pointer() {
        offer_item(ui, Item::Parameter(parameter));
    }
    if response.clicked() {
        ctx.selection.parameter = if selected { None } else { Some(parameter) };
    }
    response.on_hover_text(format!(
        "{name}: {}\nWeights in the unit right singular vectors, columns scaled by 10° and 3 cm",
        meaning_of(parameter, &ctx.recording.rig)
    ));
}

/// Paints the cell of a weight: as a number if there is room for it, else the sign of a large weight.
pub(super) fn paint_weight(painter: &Painter, theme: &Theme, weight: f64, cell: Rect, numbers: bool) {
    let ground = theme.diverging(weight);
    painter.rect_filled(cell, 1.0, ground);
    let text = if weight.abs() >= MIN_SHOWN_WEIGHT && numbers {
        format!("{weight:+.2}")
    } else if weight.abs() >= 0.2 {
        if weight < 0.0 { "−" } else { "+" }.to_owned()
    } else {
        return;
    };
    painter.text(cell.center(), Align2::CENTER_CENTER, text, theme::number_font(), Theme::text_on(ground));
}

/// Width of the names of groups in points.
const STRIP_WIDTH: f32 = 15.0;

/// Width in points of the group names; 0 if all parameters are of one group.
pub(super) fn strip_width(parameters: &[ParameterId]) -> f32 {
    let several = parameters.windows(2).any(|pair| pair[0].group() != pair[1].group());
    if several { STRIP_WIDTH } else { 0.0 }
}

/// Paints the name of each group upwards at the left end of its rows if it fits, and lines between groups; `rows` are
/// in order from top to bottom.
pub(super) fn paint_groups(painter: &Painter, theme: &Theme, rows: &[(ParameterGroup, Rangef)], across: Rangef) {
    for (number, chunk) in rows.chunk_by(|(a, _), (b, _)| a == b).enumerate() {
        let [(group, first), .., (_, last)] = chunk else {
            // A name rarely fits into a single row; only the line is drawn.
            separator(painter, theme, number, chunk.first().map_or(0.0, |(_, row)| row.min), across);
            continue;
        };
        separator(painter, theme, number, first.min, across);
        let range = Rangef::new(first.min, last.max);
        let galley = painter.layout_no_wrap(group.name().to_owned(), label_font(), theme.text_weak);
        if galley.size().x <= range.span() {
            let foot =
                pos2(across.min + 0.5 * (STRIP_WIDTH - galley.size().y) - 1.0, range.center() + 0.5 * galley.size().x);
            painter.add(TextShape::new(foot, galley, theme.text_weak).with_angle(-std::f32::consts::FRAC_PI_2));
        }
    }
}

fn separator(painter: &Painter, theme: &Theme, number: usize, y: f32, across: Rangef) {
    if number > 0 {
        painter.hline(across, y, Stroke::new(1.0, theme.text_weak));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::sample_recording;
    use crate::session::flight_table;

    #[test]
    fn a_low_map_keeps_its_rows_and_has_those_of_the_headline() {
        let recording = sample_recording();
        let run = &recording.runs[0];
        let flight = flight_table(&recording, run);
        let ranks: Vec<&RankReport> = run.steps.iter().filter_map(|step| step.rank.as_ref()).collect();
        let low = [60.0, 8.0 * MIN_ROW_HEIGHT + NOTE_HEIGHT];
        let mut without_named = Vec::new();
        for rank in ranks {
            let importance = important_rows(rank, &flight);
            assert_eq!(importance.len(), rank.parameters.len());
            let shown = Rows::of(rank, &rank.directions, &importance, low).rows;
            assert_eq!(shown.len(), 8);
            assert!(shown.is_sorted_by_key(|row| (part_of(rank.parameters[*row]), *row)), "{shown:?}");
            let Some(direction) = rank.least_observable_direction() else { continue };
            let leading = direction.leading(&rank.parameters);
            assert!(shown.iter().any(|row| Some(rank.parameters[*row]) == leading), "{leading:?} is named");
            let named = shown.iter().filter(|row| weight_of(direction, **row) < 0.2);
            without_named.push(named.copied().collect::<Vec<usize>>());
        }
        // The other rows are those that the flight determines least, whatever the step.
        let worst = important_rows(run.steps.last().unwrap().rank.as_ref().unwrap(), &flight);
        let largest = without_named.iter().flatten().map(|row| worst.iter().position(|it| it == row)).max();
        assert!(largest.flatten() < Some(11), "{largest:?}");
    }
}
