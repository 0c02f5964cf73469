//! Several rank reports side by side: causes of lost rank, spectra on one axis, and null and uninformed directions in one
//! heat map with a common order of rows.

use egui::{Align2, Color32, Grid, Label, Rangef, Rect, RichText, Role, Stroke, Ui, WidgetInfo};
use egui::{StrokeKind, pos2, vec2};

use super::heat_map::{paint_groups, paint_weight, strip_width};
use super::spectrum;
use crate::gimbal::{ParameterId, ParameterNames};
use crate::gui::PanelContext;
use crate::gui::parameter_names::{meaning_of, part_of};
use crate::gui::theme::{self, Theme};
use crate::gui::under_pointer::{Item, offer_item};
use crate::gui::units::counted;
use crate::observability::RankReport;

/// One report with its title.
pub(in crate::gui) struct RankColumn<'a> {
    pub(in crate::gui) title: String,
    pub(in crate::gui) color: Color32,
    pub(in crate::gui) rank: &'a RankReport,
}

/// Width of the names on the left in points, and where columns would be narrower than [`COMFORTABLE_WIDTH`].
const NAMES: f32 = 128.0;
const NARROW_NAMES: f32 = 84.0;
/// Width of a column with all its directions in points.
const COMFORTABLE_WIDTH: f32 = 140.0;
/// Minimum width of a direction with a legible sign in points.
const MIN_DIRECTION_WIDTH: f32 = 13.0;
/// Rows whose weights are all smaller are omitted where not all rows fit.
const MIN_WEIGHT_OF_ROW: f64 = 0.2;
/// Gap between two reports in points.
const GAP: f32 = 10.0;
/// Maximum width of a direction's column in points.
const MAX_COLUMN_WIDTH: f32 = 46.0;
/// Minimum width of a column with signed numbers in points.
const MIN_COLUMN_WIDTH: f32 = 36.0;
const MIN_ROW_HEIGHT: f32 = 13.0;
const MAX_ROW_HEIGHT: f32 = 20.0;

pub(in crate::gui) fn columns_ui(ui: &mut Ui, ctx: &mut PanelContext<'_>, columns: &[RankColumn<'_>]) {
    if columns.is_empty() {
        return;
    }
    let bottom = ui.max_rect().bottom();
    let (theme, names) = (*ctx.theme, ctx.names());
    let left = if is_narrow(ui.available_width(), columns.len()) { NARROW_NAMES } else { NAMES };
    let widths = [left, (ui.available_width() - left) / columns.len() as f32];
    table_ui(ui, &theme, &names, columns, widths);
    spectra_ui(ui, &theme, &names, columns, widths);
    heat_map_ui(ui, ctx, columns, widths, bottom);
}

/// True if a panel of this width has no room for all directions of `count` reports.
pub(super) fn is_narrow(width: f32, count: usize) -> bool {
    width < NAMES + COMFORTABLE_WIDTH * count as f32
}

fn table_ui(ui: &mut Ui, theme: &Theme, names: &ParameterNames, columns: &[RankColumn<'_>], [left, width]: [f32; 2]) {
    type Cell = fn(&RankReport, &ParameterNames) -> (String, bool);
    let rows: [(&str, &str, Cell); 8] = [
        ("structural rank", "Singular values above the numerical zero, of the number of columns", |rank, _| {
            let whole = rank.rank_structural == rank.parameters.len();
            (format!("{} of {}", rank.rank_structural, rank.parameters.len()), !whole)
        }),
        ("informed rank", "Singular values of 1 or more: as much information as a prior of 10° or 3 cm", |rank, _| {
            (rank.rank_informed.to_string(), false)
        }),
        ("lost: parameterization", "Rank deficit from redundant or singular parameters", |rank, _| {
            lost(rank.deficit_parameterization)
        }),
        ("lost: joints", "Rank deficit from joints that are stationary in the window", |rank, _| {
            lost(rank.deficit_joints)
        }),
        ("lost: free angles", "Rank deficit absorbed by unknown joint angles", |rank, _| lost(rank.deficit_absorbed)),
        ("lost: motion", "Rank deficit from the vehicle's motion", |rank, _| lost(rank.deficit_motion)),
        (
            "spurious information",
            "Information of the priors on unobservable directions: their number and the largest \
             singular value (1: σ of 10° or 3 cm)",
            |rank, _| {
                let claimed = rank.claimed();
                (
                    if claimed == 0 { lost(0).0 } else { format!("{claimed} dir., ≤ {:.2}", rank.spurious_gain()) },
                    claimed > 0,
                )
            },
        ),
        ("singularity margin", "Smallest margin of the parameterization: 0 = singular", |rank, names| {
            let nearest = rank.margins.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            nearest.map_or_else(
                || ("none".to_owned(), false),
                |(singularity, margin)| {
                    (
                        format!("{margin:.2} ({})", names.singularity(*singularity)),
                        *margin < crate::gimbal::SWITCH_MARGIN,
                    )
                },
            )
        }),
    ];
    Grid::new("ranks side by side").min_col_width(0.0).spacing(vec2(0.0, 1.0)).min_row_height(14.0).show(ui, |ui| {
        let cell = |ui: &mut Ui, width: f32, text: RichText| {
            ui.allocate_ui(vec2(width, 14.0), |ui| {
                ui.set_width(width);
                ui.add(Label::new(text).truncate())
            })
            .inner
        };
        cell(ui, left, RichText::new(""));
        for column in columns {
            cell(ui, width, RichText::new(&column.title).strong().color(column.color));
        }
        ui.end_row();
        for (name, meaning, of) in rows {
            cell(ui, left, RichText::new(name).color(theme.text_weak)).on_hover_text(meaning);
            for column in columns {
                let (text, bad) = of(column.rank, names);
                let color = if bad { theme.error } else { theme.text_strong };
                cell(ui, width, RichText::new(&text).monospace().color(color)).on_hover_text(text);
            }
            ui.end_row();
        }
    });
}

fn lost(count: usize) -> (String, bool) {
    if count == 0 { ("–".to_owned(), false) } else { (count.to_string(), true) }
}

fn spectra_ui(ui: &mut Ui, theme: &Theme, names: &ParameterNames, columns: &[RankColumn<'_>], [left, width]: [f32; 2]) {
    let height = (0.16 * ui.available_height()).clamp(50.0, 130.0);
    let (_, whole) = ui.allocate_space(vec2(ui.available_width(), height));
    let caption = ["singular values", "(log scale)", "line: with priors"];
    for (line, text) in caption.into_iter().enumerate() {
        let at = whole.left_top() + vec2(0.0, 2.0 + 13.0 * line as f32);
        ui.painter().text(at, Align2::LEFT_TOP, text, theme::label_font(), theme.text_weak);
    }
    let peers: Vec<&RankReport> = columns.iter().map(|column| column.rank).collect();
    for (number, column) in columns.iter().enumerate() {
        let left = whole.left() + left + number as f32 * width;
        let rect = Rect::from_min_size(pos2(left, whole.top()), vec2(width - GAP, height));
        spectrum::paint(ui, theme, names, column.rank, &peers, rect, number);
    }
}

/// Draws the null and uninformed directions, the least observable first.
fn heat_map_ui(
    ui: &mut Ui,
    ctx: &mut PanelContext<'_>,
    columns: &[RankColumn<'_>],
    [names_width, width]: [f32; 2],
    bottom: f32,
) {
    const HEADER: f32 = 14.0;
    let theme = *ctx.theme;
    let fitting = ((width - GAP) / MIN_DIRECTION_WIDTH).max(1.0) as usize;
    let shown_of = |column: &RankColumn<'_>| column.rank.directions.len().min(fitting);
    let mut parameters = parameters_of(columns);
    let room = (bottom - ui.cursor().top() - HEADER - 4.0).max(0.0);
    let all_rows = parameters.len();
    if parameters.len() as f32 * MIN_ROW_HEIGHT > room {
        let weight = |column: &RankColumn<'_>, parameter: ParameterId| {
            let entry = column.rank.parameters.iter().position(|known| *known == parameter);
            let weights = column.rank.directions.iter().take(shown_of(column));
            entry.map_or(0.0, |entry| {
                weights
                    .filter_map(|it| it.weights.get(entry))
                    .fold(0.0, |largest: f64, weight| largest.max(weight.abs()))
            })
        };
        parameters.retain(|parameter| columns.iter().any(|column| weight(column, *parameter) >= MIN_WEIGHT_OF_ROW));
    }
    let rows_omitted = all_rows - parameters.len();
    let strip = strip_width(&parameters);
    let row_height = (room / parameters.len().max(1) as f32).clamp(MIN_ROW_HEIGHT, MAX_ROW_HEIGHT);
    let size = vec2(ui.available_width(), HEADER + row_height * parameters.len() as f32);
    let (_, whole) = ui.allocate_space(size);
    let mut omitted = 0;
    for (number, column) in columns.iter().enumerate() {
        let left = whole.left() + names_width + number as f32 * width;
        let directions = &column.rank.directions[..shown_of(column)];
        omitted += column.rank.directions.len() - directions.len();
        let pitch = ((width - GAP) / directions.len().max(1) as f32).min(MAX_COLUMN_WIDTH);
        if directions.is_empty() {
            let at = pos2(left, whole.top() + HEADER);
            let galley = |text: &str| ui.painter().layout_no_wrap(text.to_owned(), theme::label_font(), theme.ok);
            let [long, short] = [galley("✔ full informed rank"), galley("✔ full")];
            let fits = long.size().x <= width - GAP;
            ui.painter().galley(at, if fits { long } else { short }, theme.ok);
        }
        for (place, direction) in directions.iter().enumerate() {
            let (mark, color) = if direction.structural { ("null", theme.error) } else { ("uninf.", theme.warn) };
            let mark = if pitch < MIN_COLUMN_WIDTH - 6.0 { &mark[..1] } else { mark };
            let at = pos2(left + (place as f32 + 0.5) * pitch, whole.top());
            ui.painter().text(at, Align2::CENTER_TOP, mark, theme::label_font(), color);
        }
        for (row, parameter) in parameters.iter().enumerate() {
            let Some(entry) = column.rank.parameters.iter().position(|known| known == parameter) else { continue };
            let top = whole.top() + HEADER + row as f32 * row_height;
            for (place, direction) in directions.iter().enumerate() {
                let cell = Rect::from_min_size(pos2(left + place as f32 * pitch, top), vec2(pitch, row_height));
                let weight = direction.weights.get(entry).copied().unwrap_or(0.0);
                let cell = cell.shrink(0.5);
                paint_weight(ui.painter(), &theme, weight, cell, cell.width() >= MIN_COLUMN_WIDTH);
            }
        }
    }
    for (row, parameter) in parameters.iter().enumerate() {
        let top = whole.top() + HEADER + row as f32 * row_height;
        let line = Rect::from_min_size(pos2(whole.left(), top), vec2(whole.width(), row_height));
        name_ui(ui, ctx, *parameter, line, strip);
    }
    if strip > 0.0 {
        let top = |row: usize| whole.top() + HEADER + row as f32 * row_height;
        let rows = parameters.iter().enumerate();
        let rows = rows.map(|(row, parameter)| (parameter.group(), Rangef::new(top(row), top(row + 1))));
        paint_groups(ui.painter(), &theme, &rows.collect::<Vec<_>>(), whole.x_range());
    }
    let directions = (omitted > 0).then(|| counted(omitted, "more observable direction"));
    let rows = (rows_omitted > 0)
        .then(|| format!("{} with |weight| < {MIN_WEIGHT_OF_ROW}", counted(rows_omitted, "parameter")));
    let notes: Vec<String> = directions.into_iter().chain(rows).collect();
    if !notes.is_empty() {
        let text = format!("Not shown: {}", notes.join(", "));
        ui.label(RichText::new(text).small().color(theme.text_weak));
    }
}

/// The parameters of all reports along the chain, without duplicates.
fn parameters_of(columns: &[RankColumn<'_>]) -> Vec<ParameterId> {
    let mut parameters: Vec<ParameterId> = Vec::new();
    for parameter in columns.iter().flat_map(|column| &column.rank.parameters) {
        if !parameters.contains(parameter) {
            parameters.push(*parameter);
        }
    }
    parameters.sort_by_key(|parameter| part_of(*parameter));
    parameters
}

fn name_ui(ui: &Ui, ctx: &mut PanelContext<'_>, parameter: ParameterId, line: Rect, indent: f32) {
    let name = ctx.names().name(parameter);
    let theme = *ctx.theme;
    let selected = ctx.selection.parameter == Some(parameter);
    let color = if selected { theme.accent } else { theme.text };
    let place = line.left_center() + vec2(indent, 0.0);
    ui.painter().text(place, Align2::LEFT_CENTER, &name, theme::label_font(), color);
    let (sense, role) = ctx.presentation.clickable(Role::Label);
    let response = ui.interact(line, ui.unique_id().with(("side by side", &name)), sense);
    response.widget_info(|| WidgetInfo::selected(role, true, selected, format!("{name} in all columns")));
    if selected || response.hovered() {
        let stroke = Stroke::new(1.0, if selected { theme.accent } else { theme.outline });
        ui.painter().rect_stroke(line, 0.0, stroke, StrokeKind::Inside);
    }
    if response.contains_pointer() {
        offer_item(ui, Item::Parameter(parameter));
    }
    if response.clicked() {
        ctx.selection.parameter = if selected { None } else { Some(parameter) };
    }
    response.on_hover_text(format!("{name}: {}", meaning_of(parameter, &ctx.recording.rig)));
}
