//! The 3D scene: the flight in the world, and a close-up of the gimbal's chain.
//!
//! `world.rs` and `chain.rs` build the scene, `camera.rs` and `layout.rs` project it, and `cpu.rs` or `gpu.rs` draws
//! it.

mod camera;
mod canvas;
mod chain;
mod cpu;
mod csv;
mod gpu;
mod layout;
mod model;
mod overlay;
mod pipelines;
#[cfg(test)]
mod tests;
mod tube;
mod world;

use egui::{Rect, Response, Role, Sense, Ui, Vec2, WidgetInfo, pos2, vec2};
use nalgebra::Vector3;

use self::camera::{Orbit, OrbitCamera, SceneView, Viewport, frame};
use self::canvas::Canvas;
use self::chain::{ChainModel, ChainPose};
use self::layout::lay_out;
use self::overlay::LegendLine;
use self::world::{LaneView, RunView, Trajectories, WorldBuilder, WorldOptions, framing_points_m, ground_height_m};
use super::help::terms::{Term, window};
use super::widgets::describe;
use super::{Panel, PanelContext};
use crate::camera::CameraModel;
use crate::sensors::Rig;
use crate::session::RunRecord;

/// Content on which the view of the world is centred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Follow {
    #[default]
    Trajectory,
    Vehicle,
}

/// Ratio of the view's distance from the vehicle to its distance from the whole trajectory.
const VEHICLE_DISTANCE_RATIO: f64 = 0.3;
/// Rotation of the view in radians per point of dragging.
const ROTATION_PER_POINT_RAD: f64 = 0.008;
/// Width of the table of the chain's links in points.
const TABLE_WIDTH: f32 = 256.0;
/// Width in points of the legend that shows a tooltip.
const LEGEND_WIDTH: f32 = 220.0;
/// Height of the axes and the scale below the legend in points.
const GIZMO_ROOM: f32 = 105.0;
/// Smallest panel size with a close-up.
const CLOSE_UP_FROM: Vec2 = vec2(280.0, 160.0);
/// Height in points of title and chain above a table of links, at least.
const MIN_CHAIN_HEIGHT: f32 = 150.0;

/// Shown parts of the scene and its viewpoints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gui) struct SceneLook {
    follow: Follow,
    chain: bool,
    options: WorldOptions,
    world: Orbit,
    /// Viewpoint of the close-up, `None` before the user has rotated it.
    close_up: Option<Orbit>,
}

impl Default for SceneLook {
    fn default() -> Self {
        let options = WorldOptions { landmarks: true, keyframes: true, image: true, tube: true };
        Self { follow: Follow::Trajectory, chain: true, options, world: default_world_orbit(), close_up: None }
    }
}

/// State of the scene panel: options and viewpoints.
pub struct ScenePanel {
    pub(in crate::gui) look: SceneLook,
    /// Position of the close-up; see [`close_up_rect`].
    close_up_place: Vec2,
    world_canvas: Canvas,
    close_up_canvas: Canvas,
    trajectories: Trajectories,
}

impl Default for ScenePanel {
    fn default() -> Self {
        Self {
            look: SceneLook::default(),
            close_up_place: Vec2::splat(1.0),
            world_canvas: Canvas::new("world"),
            close_up_canvas: Canvas::new("close-up"),
            trajectories: Trajectories::default(),
        }
    }
}

fn default_world_orbit() -> Orbit {
    Orbit::from_direction(Vector3::new(-0.45, -0.75, 0.55))
}

impl Panel for ScenePanel {
    fn ui(&mut self, ui: &mut Ui, context: &mut PanelContext<'_>) {
        if !context.presentation.is_figure() {
            self.controls_ui(ui);
        }
        let (area, response) =
            ui.allocate_exact_size(ui.available_size().max(Vec2::splat(16.0)), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "View of the scene"));
        let area = on_pixels(area, ui.pixels_per_point());
        let has_room = area.width() >= CLOSE_UP_FROM.x && area.height() >= CLOSE_UP_FROM.y;
        let chain = (self.look.chain && has_room).then(|| chain_model(context)).flatten();
        let close_up = chain.as_ref().map(|_| close_up_rect(area, self.close_up_place, ui.pixels_per_point()));
        self.world_ui(ui, area, close_up, &response, context);
        if let (Some(chain), Some(rect)) = (chain, close_up) {
            self.close_up_ui(ui, rect, &chain, context);
            if !context.presentation.is_figure() {
                self.move_close_up(ui, area, rect);
            }
        }
    }

    fn view_copy(&self) -> Self {
        Self { look: self.look, close_up_place: self.close_up_place, ..Self::default() }
    }
}

impl ScenePanel {
    fn controls_ui(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            ui.selectable_value(&mut self.look.follow, Follow::Trajectory, "Trajectory")
                .on_hover_text("View of all trajectories");
            ui.selectable_value(&mut self.look.follow, Follow::Vehicle, "Vehicle")
                .on_hover_text("View that follows the vehicle");
            if ui.button("Fit").on_hover_text("Reset the view (double-click)").clicked() {
                self.look.world = default_world_orbit();
                self.look.close_up = None;
            }
            if ui.button("Top").on_hover_text("View from above").clicked() {
                self.look.world = Orbit::from_direction(Vector3::new(0.0, -0.01, 1.0));
            }
            ui.separator();
            ui.checkbox(&mut self.look.options.landmarks, "Landmarks")
                .on_hover_text("Landmarks of the shown run, coloured by height");
            ui.checkbox(&mut self.look.options.keyframes, "Keyframes").on_hover_text("Camera frusta of the keyframes in the window");
            ui.checkbox(&mut self.look.options.image, "Image").on_hover_text("The image of the shown run inside of its frustum");
            ui.checkbox(&mut self.look.options.tube, "±3σ")
                .on_hover_text("Three standard deviations of the position around the trajectory of the shown run, relative to its first frame");
            ui.checkbox(&mut self.look.chain, "Chain").on_hover_text("The gimbal chain as an inset");
        });
    }

    fn world_ui(
        &mut self,
        ui: &Ui,
        area: Rect,
        close_up: Option<Rect>,
        response: &Response,
        context: &mut PanelContext<'_>,
    ) {
        let theme = context.theme;
        let scale = ui.pixels_per_point();
        let places = self.trajectories.read(context.recording);
        let runs = context.recording.runs.iter().zip(places).enumerate();
        let views: Vec<RunView<'_>> =
            runs.map(|(number, (run, places))| RunView::new(number, run, places, context.cursor_ns)).collect();
        let first = context.recording.runs.first();
        let lanes = context.recording.trajectories.iter().enumerate();
        let lanes: Vec<LaneView<'_>> =
            lanes.map(|(number, lane)| LaneView::new(number, lane, first, context.cursor_ns)).collect();
        let points = framing_points_m(&views, &lanes);
        // Lines of the legend in the upper left corner: one per run and trajectory, one for the ground truth, one for
        // the landmarks.
        let key = overlay::LINE_HEIGHT * (views.len() + lanes.len() + 2) as f32;
        let viewport = world_viewport(area, close_up, key.min(0.22 * area.height()), scale);
        let mut framing = frame(&points, self.look.world.towards, &viewport);
        if self.look.follow == Follow::Vehicle
            && let Some(at) = views.get(context.selection.run).and_then(RunView::position_m)
        {
            framing = OrbitCamera { target_m: at, distance_m: framing.distance_m * VEHICLE_DISTANCE_RATIO, ..framing };
        }
        let view = SceneView::new(self.look.world.applied(framing), viewport);
        let mut lines = legend_lines(&views, &lanes, context.cursor_ns, context.recording.truth_name(), theme);
        if context.recording.position_truth.is_some() {
            let text = "ground truth, positions of the antenna".to_owned();
            lines.push(LegendLine { style: theme.ground_truth_style(), text });
        }
        describe(response, &lines.iter().map(|line| line.text.as_str()).collect::<Vec<_>>().join(", "));
        navigate(ui, response, &mut self.look.world, default_world_orbit(), &view);
        let view = SceneView::new(self.look.world.applied(framing), viewport);

        let mut builder = WorldBuilder::new(theme, self.look.options, view.camera.distance_m);
        let spacing_m = builder.ground(&points);
        if let Some(first) = views.first() {
            builder.ground_truth(first);
        }
        if let Some(truth) = &context.recording.position_truth {
            builder.true_positions(truth, context.cursor_ns);
        }
        for lane in &lanes {
            builder.lane(lane);
        }
        for run in &views {
            let camera = camera_of(&context.recording.rig, run.run);
            let is_selected = run.number == context.selection.run;
            let image = (is_selected && self.look.options.image)
                .then(|| run.newest())
                .flatten()
                .and_then(|frame| context.images.image(&run.run.camera_key, frame.frame_index).ready());
            if is_selected {
                builder.details(run, camera, ground_height_m(&points));
            }
            builder.run(run, camera, image);
        }
        let drawing = lay_out(&builder.scene, &view, scale, theme.plot_background);
        let drawing = self.world_canvas.show(ui, area, drawing);
        let painter = ui.painter_at(area);
        overlay::labels(&painter, area, scale, &drawing.labels, theme.plot_background);
        let key = overlay::legend(&painter, area, theme, &lines, builder.height_range_m);
        let legend = Rect::from_min_size(area.min, vec2(LEGEND_WIDTH.min(area.width()), key));
        explain(ui, legend, "scene legend", window::SCENE_LEGEND);
        overlay::scale_bar(&painter, area, scale, theme, &view, &format!(", grid {spacing_m} m"));
        // In a low panel the legend covers the space of the axes.
        if area.height() > key + GIZMO_ROOM {
            overlay::gizmo(&painter, area.left_bottom() + vec2(34.0, -62.0), theme, &view);
        }
    }

    /// Moves the close-up with a drag of its title.
    fn move_close_up(&mut self, ui: &Ui, area: Rect, rect: Rect) {
        let title = Rect::from_min_size(rect.min, vec2(rect.width(), overlay::LINE_HEIGHT + 4.0));
        let handle = ui.interact(title, ui.scope_id().with("close-up title"), Sense::DRAG);
        let drag = handle.drag_delta();
        if handle.dragged() && drag != Vec2::ZERO {
            let free = (area.size() - rect.size()).max(Vec2::splat(1.0));
            self.close_up_place = (self.close_up_place + drag / free).clamp(Vec2::ZERO, Vec2::splat(1.0));
        }
        handle.on_hover_cursor(egui::CursorIcon::Grab).on_hover_text(window::CHAIN_FRAMES.meaning);
    }

    fn close_up_ui(&mut self, ui: &Ui, rect: Rect, chain: &ChainModel, context: &PanelContext<'_>) {
        let theme = context.theme;
        let scale = ui.pixels_per_point();
        let response = ui.interact(rect, ui.scope_id().with("close-up"), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, "View of the gimbal's chain"));
        let painter = ui.painter_at(rect.expand(1.0));
        painter.rect_filled(rect, 0.0, theme.surface);
        // A small close-up has no table; the inspector has its values.
        let table_height = overlay::chain_table_height(chain);
        let with_table = rect.width() >= TABLE_WIDTH && rect.height() >= table_height + MIN_CHAIN_HEIGHT;
        let table_height = if with_table { table_height } else { 0.0 };
        let title = Rect::from_min_size(rect.min, vec2(rect.width(), overlay::LINE_HEIGHT + 4.0));
        let view_rect = Rect::from_min_max(title.left_bottom(), rect.max - vec2(0.0, table_height));
        let view_rect = on_pixels(view_rect, scale);
        let viewport = Viewport::close_up(size_px(view_rect, scale));
        let home = Orbit::from_direction(close_up_direction(context));
        let mut orbit = self.look.close_up.unwrap_or(home);
        let framing = frame(&chain.framing_points_m(), orbit.towards, &viewport);
        let view = SceneView::new(orbit.applied(framing), viewport);
        navigate(ui, &response, &mut orbit, home, &view);
        self.look.close_up = (orbit != home).then_some(orbit);
        let view = SceneView::new(orbit.applied(framing), viewport);
        let drawing = lay_out(&chain.scene(theme), &view, scale, theme.surface);
        let drawing = self.close_up_canvas.show(ui, view_rect, drawing);
        overlay::labels(&painter, view_rect, scale, &drawing.labels, theme.surface);
        overlay::scale_bar(&painter, view_rect, scale, theme, &view, "");
        let label = context.selected_run().map_or("", |run| run.spec.label.as_str());
        let kind = if chain.has_joints() { "Gimbal chain" } else { "Extrinsics" };
        let text = match &chain.ground_truth {
            Some(_) if chain.moved => format!("{kind}, {label}, moved; estimate dashed"),
            Some(_) => format!("{kind}, {label}; ground truth dashed"),
            None => format!("{kind}, {label}"),
        };
        let at = title.left_center() + vec2(8.0, 0.0);
        let font = super::theme::label_font();
        let width = painter.layout_no_wrap(text.clone(), font.clone(), theme.text_strong).size().x;
        let shown = if width + 12.0 < title.width() { text.clone() } else { format!("{kind}, {label}") };
        painter.text(at, egui::Align2::LEFT_CENTER, shown, font, theme.text_strong);
        let error = overlay::camera_error_text(chain);
        describe(&response, &error.map_or_else(|| text.clone(), |error| format!("{text}; {error}")));
        if with_table {
            let table = Rect::from_min_max(view_rect.left_bottom(), rect.max);
            overlay::chain_table(&painter, table, theme, chain);
            let (mut values, mut error) = (table, table);
            if chain.camera_error.is_some() {
                values.max.y -= overlay::LINE_HEIGHT;
                error.min.y = values.max.y;
                explain(ui, error, "chain error", window::CHAIN_ERROR);
            }
            explain(ui, values, "chain values", window::CHAIN_ROW);
        }
        let outline = egui::Stroke::new(1.0, theme.outline);
        painter.rect_stroke(rect, 0.0, outline, egui::StrokeKind::Inside);
    }
}

/// Adds a tooltip with the definition of `term` to a painted rectangle.
fn explain(ui: &Ui, rect: Rect, name: &str, term: Term) {
    ui.interact(rect, ui.scope_id().with(name), Sense::hover()).on_hover_text(term.meaning);
}

/// The runs in order, then the trajectories, then the ground truth.
fn legend_lines(
    views: &[RunView<'_>],
    lanes: &[LaneView<'_>],
    cursor_ns: i64,
    truth_name: &str,
    theme: &super::theme::Theme,
) -> Vec<LegendLine> {
    let mut lines: Vec<LegendLine> = views
        .iter()
        .map(|view| {
            let label = &view.run.spec.label;
            let text = match (view.error_m(), view.newest(), view.run.alignment) {
                (Some(error_m), ..) => match view.sigma_m() {
                    Some(sigma_m) => format!("{label}, position error {error_m:.2} m, 3σ {:.2} m", 3.0 * sigma_m),
                    None => format!("{label}, position error {error_m:.2} m"),
                },
                (None, None, _) => format!("{label}, initializing"),
                (None, Some(_), None) if view.has_ground_truth() => format!("{label}, not aligned with ground truth"),
                _ => label.clone(),
            };
            LegendLine { style: theme.run(view.number), text }
        })
        .collect();
    lines.extend(lanes.iter().map(|view| {
        let label = &view.lane.label;
        let error = view.lane.error_m(cursor_ns);
        let text = error.map_or_else(|| label.clone(), |error_m| format!("{label}, position error {error_m:.2} m"));
        LegendLine { style: theme.trajectory(view.number), text }
    }));
    if views.first().is_some_and(RunView::has_ground_truth) {
        lines.push(LegendLine { style: theme.ground_truth_style(), text: truth_name.to_owned() });
    }
    lines
}

/// The chain of the selected run at the cursor.
fn chain_model(context: &PanelContext<'_>) -> Option<ChainModel> {
    let (run, step) = context.selected_step()?;
    let estimate = &step.report.calibration.classical;
    let joint_names = context.recording.rig.joint_names();
    let angles_rad = step.report.newest().map_or(&[][..], |frame| &frame.joint_angles_rad);
    if let Some(slide) = context.moved_chain(step.report.stamp_ns) {
        let model = ChainModel::at(angles_rad, &slide.chain, Some(estimate), &joint_names);
        return Some(ChainModel { moved: true, camera_error: Some(slide.camera_moves), ..model });
    }
    let true_chain = context.recording.ground_truth_rig.as_ref().and_then(|rig| rig.chain_of_camera(&run.camera_key));
    let true_chain = true_chain.filter(|ground_truth| ground_truth.links.len() == estimate.links.len());
    Some(ChainModel::at(angles_rad, estimate, true_chain.as_ref(), &joint_names))
}

/// Direction of the close-up's viewpoint, from the rig's chain, so that it does not depend on the cursor.
fn close_up_direction(context: &PanelContext<'_>) -> Vector3<f64> {
    let camera_key = context.selected_run().map_or("", |run| run.camera_key.as_str());
    ChainPose::best_direction(&context.recording.rig.chain_of_camera(camera_key).unwrap_or_default())
}

fn camera_of<'a>(rig: &'a Rig, run: &RunRecord) -> Option<&'a CameraModel> {
    rig.cameras.iter().find(|camera| camera.key == run.camera_key).map(|camera| &camera.model)
}

/// Rounds a rectangle's edges to whole pixels.
fn on_pixels(rect: Rect, pixels_per_point: f32) -> Rect {
    let snap = |coordinate: f32| (coordinate * pixels_per_point).round() / pixels_per_point;
    Rect::from_min_max(pos2(snap(rect.min.x), snap(rect.min.y)), pos2(snap(rect.max.x), snap(rect.max.y)))
}

/// Width and height of a rectangle in pixels.
fn size_px(rect: Rect, pixels_per_point: f32) -> [u32; 2] {
    [rect.width(), rect.height()].map(|side| (side * pixels_per_point).round().max(1.0) as u32)
}

/// Viewport of the whole area; framing uses the region to the left of the close-up and below the legend.
fn world_viewport(area: Rect, close_up: Option<Rect>, key_height: f32, pixels_per_point: f32) -> Viewport {
    let size_px = size_px(area, pixels_per_point);
    // The larger part beside the close-up.
    let (left, right) = match close_up {
        Some(rect) if area.right() - rect.right() > rect.left() - area.left() => (rect.right(), area.right()),
        Some(rect) => (area.left(), rect.left()),
        None => (area.left(), area.right()),
    };
    let frame_px = [
        (left - area.left()) * pixels_per_point,
        key_height * pixels_per_point,
        (right - area.left()) * pixels_per_point,
        area.height() * pixels_per_point,
    ];
    Viewport::world(size_px, frame_px.map(f64::from))
}

/// Rectangle of the close-up: a fifth of the view at most. `place` is its position in the free space, from (0, 0) in the
/// upper left corner to (1, 1) in the lower right one.
fn close_up_rect(area: Rect, place: Vec2, pixels_per_point: f32) -> Rect {
    const INSET: f32 = 6.0;
    let size = vec2((0.4 * area.width()).min(420.0), (0.5 * area.height()).min(420.0));
    let free = area.size() - size - Vec2::splat(2.0 * INSET);
    let corner = area.min + Vec2::splat(INSET) + free * place;
    on_pixels(Rect::from_min_size(corner, size), pixels_per_point)
}

/// Navigation by pointer: dragging rotates, with Shift or another button it shifts, the wheel zooms, a double click
/// resets the view.
fn navigate(ui: &Ui, response: &Response, orbit: &mut Orbit, home: Orbit, view: &SceneView) {
    if response.double_clicked() {
        *orbit = home;
    }
    let scale = f64::from(ui.pixels_per_point());
    let drag = response.drag_delta();
    let drag = [f64::from(drag.x), f64::from(drag.y)];
    let shifts = ui.input(|input| input.modifiers.shift) || !response.dragged_by(egui::PointerButton::Primary);
    if response.dragged() && shifts {
        orbit.shift_m += view.drag_m(drag.map(|points| points * scale));
    } else if response.dragged() {
        orbit.rotate(-drag[0] * ROTATION_PER_POINT_RAD, drag[1] * ROTATION_PER_POINT_RAD);
    }
    if response.hovered() {
        let factor = ui.input(|input| input.zoom_delta() * (input.smooth_scroll_delta().y * 0.004).exp());
        orbit.zoom_by(f64::from(factor));
    }
}
