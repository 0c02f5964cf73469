//! Mean residuals over the image: as a vector field, by distance from the principal point, and by image row.

use std::sync::Arc;

use egui::{Align2, Color32, Painter, Rect, RichText, Role, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2};
use nalgebra::Vector2;

use super::histogram::round_up;
use crate::gui::PanelContext;
use crate::gui::help::terms::window;
use crate::gui::plot::{
    PlotArea, TIME_GUTTER, decimals_of_step, paint_between, paint_ground, paint_hatch, paint_line, paint_value_axis,
    ticks, within_gutters,
};
use crate::gui::theme::{CURVE_WIDTH, RunStyle, Theme, label_font, mix, number_font};
use crate::gui::units::{counted, fixed};
use crate::gui::widgets::describe;
use crate::session::{ImageResiduals, MeanResidual, ResidualSum, RunRecord, StepRecord};

/// Number of columns of the grid over the image.
const COLUMNS: usize = 12;
/// Number of bins of the profiles.
const BINS: usize = 12;
/// Smallest number of residuals of a shown mean.
const MIN_COUNT: usize = 8;
/// Number of standard errors from which a mean is drawn as significant.
const SIGNIFICANT: f64 = 2.0;
/// Height of the profiles below the fields, at most, in points.
const MAX_PROFILE_HEIGHT: f32 = 150.0;
const TITLE_HEIGHT: f32 = 15.0;

/// Means of residuals over the image.
#[derive(Debug)]
pub(super) struct ImageMeans {
    pub(super) cells: Vec<ResidualSum>,
    total: ResidualSum,
    by_radius: Vec<Option<MeanResidual>>,
    by_row: Vec<Option<MeanResidual>>,
}

/// Geometry of an image and its grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ImageGeometry {
    pub(super) size_px: [usize; 2],
    center_px: Vector2<f64>,
    /// Distance from the principal point to the farthest corner in pixels.
    reach_px: f64,
    pub(super) rows: usize,
}

impl ImageGeometry {
    /// Image of the main camera of a run; `None` if the rig lacks the camera.
    pub(super) fn of(ctx: &PanelContext<'_>, run: &RunRecord) -> Option<Self> {
        let camera = ctx.recording.rig.camera(&run.camera_key).ok()?;
        let size_px = camera.model.resolution_px;
        let [_, _, cx, cy] = camera.model.intrinsics_px;
        let center_px = Vector2::new(cx, cy);
        let [width, height] = size_px.map(|side| side.max(1) as f64);
        let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
        let reach_px = corners.map(|(x, y)| (Vector2::new(x, y) - center_px).norm()).into_iter().fold(1.0, f64::max);
        let rows = ((height / width * COLUMNS as f64).round() as usize).clamp(1, 4 * COLUMNS);
        Some(Self { size_px, center_px, reach_px, rows })
    }

    /// Ranges of u and v of a cell in pixels.
    pub(super) fn cell_px(&self, index: usize) -> [[f64; 2]; 2] {
        let range = |number: usize, count: usize, size: usize| {
            [number, number + 1].map(|edge| edge as f64 / count as f64 * size as f64)
        };
        [range(index % COLUMNS, COLUMNS, self.size_px[0]), range(index / COLUMNS, self.rows, self.size_px[1])]
    }
}

impl ImageMeans {
    pub(super) fn of(residuals: &ImageResiduals, frame: &ImageGeometry) -> Self {
        Self {
            cells: residuals.grid(frame.size_px, COLUMNS, frame.rows),
            total: residuals.total(),
            by_radius: residuals.by_radius(frame.center_px, frame.reach_px, BINS),
            by_row: residuals.by_row(frame.size_px[1], BINS),
        }
    }

    /// Length in pixels that nine of ten significant mean vectors do not exceed.
    fn most_px(&self) -> f64 {
        let mut lengths: Vec<f64> =
            self.cells.iter().filter_map(significant_px).map(|mean_px| mean_px.norm()).collect();
        lengths.sort_by(f64::total_cmp);
        lengths.get((0.9 * lengths.len() as f64) as usize).or_else(|| lengths.last()).copied().unwrap_or(0.0)
    }
}

/// Mean of a cell in pixels if it has enough residuals and is not explained by their scatter.
fn significant_px(cell: &ResidualSum) -> Option<Vector2<f64>> {
    let mean_px = cell.mean_px().filter(|_| cell.count >= MIN_COUNT)?;
    (mean_px.norm() > SIGNIFICANT * cell.error_px()).then_some(mean_px)
}

/// Cached means of one step and of the flight up to the last step of its run.
#[derive(Debug, Default)]
pub(super) struct ImagePlane {
    cached: Option<Cached>,
}

#[derive(Debug)]
struct Cached {
    step: Arc<StepRecord>,
    run: u64,
    steps: usize,
    frame: ImageGeometry,
    window: ImageMeans,
    flight: ImageMeans,
}

impl ImagePlane {
    /// Draws the fields and the profiles into a height in points.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        ctx: &PanelContext<'_>,
        run: &RunRecord,
        step: &Arc<StepRecord>,
        height: f32,
    ) {
        const GAP: f32 = 10.0;
        let Some(frame) = ImageGeometry::of(ctx, run) else { return };
        self.read(run, step, frame);
        let Some(cached) = &self.cached else { return };
        let theme = ctx.theme;
        let top = ui.cursor().top();
        let caption = "Mean residual over the image, prediction − measurement";
        ui.label(RichText::new(caption).color(theme.text)).on_hover_text(window::IMAGE_PLANE.meaning);
        let below = height - (ui.cursor().top() - top);
        let (_, rect) = ui.allocate_space(vec2(ui.available_width(), below.max(120.0)));
        let profiles = (0.4 * rect.height()).min(MAX_PROFILE_HEIGHT);
        let (fields, profiles) = rect.split_top_bottom_at_y(rect.bottom() - profiles);
        let scale_px = round_up(cached.window.most_px().max(cached.flight.most_px()).max(0.02));
        let (left, right) = fields.split_left_right_at_fraction(0.5);
        let count = |means: &ImageMeans| counted(means.total.count, "residual");
        let field = |means: &ImageMeans, name: &str, rect: Rect| {
            let title = format!("{name}, {}", count(means));
            Field { means, frame: &cached.frame, scale_px, theme }.ui(ui, &title, rect);
        };
        field(&cached.window, "window at the cursor", left.with_max_x(left.right() - 0.5 * GAP));
        field(&cached.flight, "whole flight so far", right.with_min_x(right.left() + 0.5 * GAP));
        let (left, right) = profiles.split_left_right_at_fraction(0.5);
        let style = theme.run(ctx.selection.run);
        let profile = |title: &str, of: fn(&ImageMeans) -> &[Option<MeanResidual>], reach: f64, rect: Rect| {
            let means = [of(&cached.window), of(&cached.flight)];
            Profile { title, means, reach_px: reach, style, theme }.ui(ui, rect);
        };
        let (by_radius, by_row) =
            ("radial, by distance from the principal point, px", "along the image motion, by image row, px");
        let height_px = cached.frame.size_px[1] as f64;
        let rect = left.with_max_x(left.right() - 0.5 * GAP);
        profile(by_radius, |means| &means.by_radius, cached.frame.reach_px, rect);
        profile(by_row, |means| &means.by_row, height_px, right.with_min_x(right.left() + 0.5 * GAP));
    }

    fn read(&mut self, run: &RunRecord, step: &Arc<StepRecord>, frame: ImageGeometry) {
        let known = self.cached.take().filter(|cached| cached.run == run.id && cached.frame == frame);
        let (same_step, same_flight) = known
            .as_ref()
            .map_or((false, false), |cached| (Arc::ptr_eq(&cached.step, step), cached.steps == run.steps.len()));
        let (mut window, mut flight) = known.map_or((None, None), |cached| (Some(cached.window), Some(cached.flight)));
        let window = window.take().filter(|_| same_step);
        let flight = flight.take().filter(|_| same_flight);
        self.cached = Some(Cached {
            step: Arc::clone(step),
            run: run.id,
            steps: run.steps.len(),
            frame,
            window: window.unwrap_or_else(|| ImageMeans::of(&ImageResiduals::of_window(&step.report), &frame)),
            flight: flight.unwrap_or_else(|| ImageMeans::of(&run.image_residuals, &frame)),
        });
    }
}

/// Vector field over the image.
struct Field<'a> {
    means: &'a ImageMeans,
    frame: &'a ImageGeometry,
    /// Length in pixels of an arrow as wide as a cell.
    scale_px: f64,
    theme: &'a Theme,
}

impl Field<'_> {
    fn ui(&self, ui: &Ui, title: &str, rect: Rect) {
        let theme = self.theme;
        let painter = ui.painter_at(rect);
        painter.text(rect.left_top(), Align2::LEFT_TOP, title, label_font(), theme.text_weak);
        let room = Rect::from_min_max(rect.min + vec2(0.0, TITLE_HEIGHT), rect.max - vec2(0.0, TITLE_HEIGHT + 2.0));
        if room.width() < 24.0 || room.height() < 24.0 {
            return;
        }
        let [width, height] = self.frame.size_px.map(|side| side.max(1) as f32);
        let points = (room.width() / width).min(room.height() / height);
        let image = Rect::from_min_size(room.min, vec2(width, height) * points);
        paint_ground(&painter, theme, image);
        let pitch = image.width() / COLUMNS as f32;
        let place = |index: usize| {
            let [u, v] = self.frame.cell_px(index).map(|range| range.map(|at| at as f32 * points));
            Rect::from_min_max(image.min + vec2(u[0], v[0]), image.min + vec2(u[1], v[1]))
        };
        for (index, cell) in self.means.cells.iter().enumerate() {
            let at = place(index);
            match cell.mean_px().filter(|_| cell.count >= MIN_COUNT) {
                None => paint_hatch(&painter, at.shrink(0.5), theme.hatch),
                Some(mean_px) if significant_px(cell).is_some() => {
                    let fraction = (mean_px.norm() / self.scale_px).min(1.0) as f32;
                    painter.rect_filled(at, 0.0, mix(theme.plot_background, theme.accent, 0.5 * fraction));
                }
                Some(_) => {}
            }
        }
        for (index, cell) in self.means.cells.iter().enumerate() {
            let Some(mean_px) = cell.mean_px().filter(|_| cell.count >= MIN_COUNT) else { continue };
            let color = if significant_px(cell).is_some() { theme.text_strong } else { theme.outline };
            let arrow = vec2(mean_px.x as f32, mean_px.y as f32) * (pitch / self.scale_px as f32);
            paint_arrow(&painter, place(index).center(), arrow, color);
        }
        let center = self.frame.center_px;
        let center = image.min + vec2(center.x as f32, center.y as f32) * points;
        for arm in [vec2(4.0, 0.0), vec2(0.0, 4.0)] {
            painter.line_segment([center - arm, center + arm], Stroke::new(1.0, theme.error));
        }
        painter.rect_stroke(image, 0.0, Stroke::new(1.0, theme.outline), egui::StrokeKind::Inside);
        // The scale, as an arrow as wide as a cell.
        let foot = image.left_bottom() + vec2(2.0, 9.0);
        paint_arrow(&painter, foot, vec2(pitch, 0.0), theme.text_strong);
        let text = format!("{} px · grey: within {SIGNIFICANT:.0} standard errors", short(self.scale_px));
        painter.text(foot + vec2(pitch + 6.0, 0.0), Align2::LEFT_CENTER, text, label_font(), theme.text_weak);

        let response = ui.interact(image, ui.unique_id().with(title), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, format!("Mean residuals: {title}")));
        describe(&response, &format!("nine of ten significant means below {} px", fixed(self.means.most_px(), 3)));
        if let Some(pointer) = response.hover_pos() {
            let index = (0..self.means.cells.len()).find(|index| place(*index).contains(pointer));
            if let Some(text) = index.map(|index| self.cell_text(index)) {
                response.on_hover_text_at_pointer(text);
            }
        }
    }

    fn cell_text(&self, index: usize) -> String {
        let cell = &self.means.cells[index];
        let [u, v] = self.frame.cell_px(index).map(|[from, to]| format!("{from:.0} to {to:.0} px"));
        let mean = cell.mean_px().map_or_else(String::new, |mean_px| {
            let [u, v] = [mean_px.x, mean_px.y].map(|mean| fixed(mean, 3));
            format!("\nmean u {u} px, v {v} px, standard error {} px", fixed(cell.error_px(), 3))
        });
        format!("u {u}, v {v}: {}{mean}", counted(cell.count, "residual"))
    }
}

/// Length in pixels without superfluous decimals.
fn short(length_px: f64) -> String {
    fixed(length_px, decimals_of_step(length_px))
}

/// Draws an arrow that begins at `from`; one without a length is a dot.
fn paint_arrow(painter: &Painter, from: egui::Pos2, arrow: egui::Vec2, color: Color32) {
    let length = arrow.length();
    if length < 1.5 {
        painter.circle_filled(from, 1.0, color);
        return;
    }
    let (to, along) = (from + arrow, arrow / length);
    painter.line_segment([from, to], Stroke::new(1.2, color));
    let head = (0.35 * length).clamp(2.0, 5.0);
    let side = vec2(-along.y, along.x) * 0.5 * head;
    let foot = to - along * head;
    painter.add(Shape::convex_polygon(vec![to, foot + side, foot - side], color, Stroke::NONE));
}

/// Mean residual over one coordinate of the image.
struct Profile<'a> {
    title: &'a str,
    /// Means by bin in the window and in the flight.
    means: [&'a [Option<MeanResidual>]; 2],
    /// Coordinate at the right end in pixels.
    reach_px: f64,
    style: RunStyle,
    theme: &'a Theme,
}

impl Profile<'_> {
    fn ui(&self, ui: &Ui, rect: Rect) {
        let theme = self.theme;
        let painter = ui.painter_at(rect);
        painter.text(rect.left_top(), Align2::LEFT_TOP, self.title, label_font(), theme.text_weak);
        let plot = within_gutters(rect.with_min_y(rect.top() + TITLE_HEIGHT), TIME_GUTTER);
        if plot.height() < 12.0 || plot.width() < 24.0 {
            return;
        }
        let [window, flight] = self.means.map(shown);
        let reach = |means: &[(f64, MeanResidual)]| {
            means.iter().map(|(_, mean)| mean.mean_px.abs() + 2.0 * mean.error_px).fold(0.0, f64::max)
        };
        let high = (1.1 * reach(&window).max(reach(&flight))).max(0.02);
        let area = PlotArea { rect: plot, begin_ns: 0, end_ns: 1, low: -high, high, middle: None };
        paint_ground(&painter, theme, plot);
        paint_value_axis(&painter, theme, &area, 1.0);
        let x = |fraction: f64| plot.left() + fraction as f32 * plot.width();
        let (marks, step) = ticks(0.0, self.reach_px, ((plot.width() / 50.0) as usize).max(1));
        for mark in marks {
            let at = pos2(x(mark / self.reach_px), plot.bottom());
            painter.vline(at.x, plot.y_range(), Stroke::new(1.0, theme.grid));
            let text = fixed(mark, decimals_of_step(step));
            let galley = painter.layout_no_wrap(text, number_font(), theme.text_weak);
            let left = (at.x - 0.5 * galley.size().x).min(plot.right() - galley.size().x);
            painter.galley(pos2(left, at.y + 2.0), galley, theme.text_weak);
        }
        painter.hline(plot.x_range(), area.y(0.0), Stroke::new(1.0, theme.text_weak));
        let inner = painter.with_clip_rect(plot.intersect(painter.clip_rect()));
        let band = flight.iter().map(|(fraction, mean)| {
            [-2.0, 2.0].map(|side| pos2(x(*fraction), area.y(mean.mean_px + side * mean.error_px)))
        });
        paint_between(&inner, band, self.style.color.gamma_multiply(0.22));
        let line = |means: &[(f64, MeanResidual)]| -> Vec<egui::Pos2> {
            means.iter().map(|(fraction, mean)| pos2(x(*fraction), area.y(mean.mean_px))).collect()
        };
        paint_line(&inner, &line(&window), RunStyle { color: theme.text_weak, dashes: &[3.0, 2.0] }, 1.0);
        let solid = RunStyle { dashes: &[], ..self.style };
        paint_line(&inner, &line(&flight), solid, CURVE_WIDTH);
        let response = ui.interact(plot, ui.unique_id().with(self.title), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, format!("Mean residual {}", self.title)));
        response.on_hover_text("Solid: whole flight with ±2 standard errors; dashed: window at the cursor");
    }
}

/// Bins with enough residuals: center as a fraction of the range, and mean.
fn shown(means: &[Option<MeanResidual>]) -> Vec<(f64, MeanResidual)> {
    let center = |bin: usize| (bin as f64 + 0.5) / means.len() as f64;
    let known = means.iter().enumerate().filter_map(|(bin, mean)| Some((center(bin), (*mean)?)));
    known.filter(|(_, mean)| mean.count >= MIN_COUNT).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::samples::{sample_images, sample_recording_of};
    use crate::gui::tests::with_context;
    use crate::gui::{PanelContext, Selection};

    #[test]
    fn the_means_of_a_step_and_of_the_flight_count_their_residuals() {
        let recording = sample_recording_of(80, &["auto"]);
        let run = &recording.runs[0];
        let step = run.steps.last().unwrap();
        let show = |ctx: &mut PanelContext<'_>| {
            let frame = ImageGeometry::of(ctx, run).unwrap();
            let mut plane = ImagePlane::default();
            plane.read(run, step, frame);
            let cached = plane.cached.take().unwrap();
            let features = || step.report.features.iter().filter(|feature| !feature.rejected);
            let seen = features().flat_map(|feature| feature.observations.iter().collect::<Vec<_>>());
            let expected = seen.filter(|seen| seen.residual_after_px.is_some_and(|it| it.norm().is_finite())).count();
            assert_eq!(cached.window.total.count, expected);
            assert_eq!(cached.window.cells.iter().map(|cell| cell.count).sum::<usize>(), expected);
            // Each image is counted once in the flight.
            assert!(cached.flight.total.count > 1000, "{}", cached.flight.total.count);
            assert!(cached.flight.total.mean_px().unwrap().norm() < 0.05);
        };
        let (mut selection, theme) = (Selection::default(), Theme::default());
        with_context(&recording, recording.last_stamp_ns(), &mut sample_images(), &mut selection, &theme, show);
    }
}
