//! Strip under the answer while a log is being written: the move that is flown next, with a picture of joints and vehicle
//! (now and target), and the parameters that are not yet as accurate as required.

use std::f64::consts::{FRAC_PI_2, PI};

use egui::{
    Align2, Color32, Label, Pos2, Rect, RichText, Role, Sense, Shape, Stroke, Ui, Vec2, WidgetInfo, pos2, vec2,
};
use nalgebra::{Rotation3, Vector3};

use crate::geometry::{seconds_from_ns, vertical_angle};
use crate::gui::PanelContext;
use crate::gui::derived::flight::NeededMotion;
use crate::gui::theme::{self, Theme};
use crate::gui::units::fixed;
use crate::observability::laboratory::SufficientMotion;
use crate::sensors::Joint;
use crate::session::{FlightParameter, RunRecord, StepRecord};
use crate::simulation::{MotionSample, MotionSplines};

/// Height of the strip in points.
pub(super) const HEIGHT: f32 = 104.0;
const WORDS_WIDTH: f32 = 380.0;
/// Size of the words of the move in points, as large as the sentence of the bar above.
const MOVE_SIZE: f32 = 17.0;
/// Side of the picture of one joint, and of the vehicle from above, in points.
const PICTURE: f32 = 84.0;
/// Width of the picture of the vehicle's height in points.
const HEIGHT_WIDTH: f32 = 26.0;
const LABEL_HEIGHT: f32 = 14.0;
/// Width of the list of parameters in points; it is left out where there is less.
const LIST_WIDTH: f32 = 250.0;
const LISTED: usize = 5;
const BAR_WIDTH: f32 = 70.0;
/// Time by which the target is ahead of the motion, in seconds: about what a person needs to follow it.
const LEAD_S: f64 = 0.4;
/// Rotation of a joint within a move below which it is not drawn as moving, in radians.
const LEAST_ROTATION_RAD: f64 = 0.01;
/// Distance from the start that the picture of the vehicle shows in any case, in metres.
const LEAST_REACH_M: f64 = 0.5;
/// Number of points of a drawn path or arc.
const POINTS: usize = 40;

/// Moves of a motion at a time since its beginning.
#[derive(Debug, PartialEq)]
struct Progress<'a> {
    words: &'a str,
    /// Remaining time of the move.
    left_s: f64,
    /// Beginning and end of the move, since the beginning of the motion.
    interval_s: [f64; 2],
    next: Option<&'a (String, f64)>,
}

impl<'a> Progress<'a> {
    /// The move of a motion at a time; the last one after its end.
    fn of(motion: &'a SufficientMotion, time_s: f64) -> Option<Self> {
        let mut begin_s = 0.0;
        for (number, (words, duration_s)) in motion.moves.iter().enumerate() {
            let end_s = begin_s + duration_s;
            if time_s < end_s || number + 1 == motion.moves.len() {
                let left_s = (end_s - time_s).max(0.0);
                let next = motion.moves.get(number + 1);
                return Some(Self { words, left_s, interval_s: [begin_s, end_s], next });
            }
            begin_s = end_s;
        }
        None
    }

    fn times_s(&self) -> impl Iterator<Item = f64> + use<> {
        let [begin_s, end_s] = self.interval_s;
        (0..=POINTS).map(move |point| begin_s + (end_s - begin_s) * point as f64 / POINTS as f64)
    }
}

/// Where the vehicle is relative to the beginning of a motion, forward, left and up, and its heading since then.
struct VehicleNow {
    position_m: Vector3<f64>,
    heading_rad: f64,
}

impl VehicleNow {
    fn between(start: &StepRecord, now: &StepRecord) -> Option<Self> {
        let (start, now) = (start.report.newest()?.world_from_imu, now.report.newest()?.world_from_imu);
        let level = Rotation3::from_euler_angles(0.0, 0.0, -vertical_angle(&start.rotation));
        Some(Self {
            position_m: level * (now.translation_m - start.translation_m),
            heading_rad: vertical_angle(&(now.rotation * start.rotation.inverse())),
        })
    }
}

/// Draws the strip of a run's next motion.
pub(super) fn ui(ui: &mut Ui, ctx: &PanelContext<'_>, run: &RunRecord, needed: &NeededMotion) {
    let Some(now) = run.steps.last() else { return };
    let time_s = seconds_from_ns((now.report.stamp_ns - needed.known_ns).max(0));
    let Some(progress) = Progress::of(&needed.motion, time_s) else { return };
    let theme = ctx.theme;
    let flown = Flown { progress, motion: &needed.motion.motion, time_s, theme };
    ui.horizontal(|ui| {
        words_ui(ui, &flown.progress, theme);
        let joints = ctx.recording.rig.gimbal.iter().flat_map(|gimbal| &gimbal.joints);
        let angles_rad = now.report.newest().map_or(&[][..], |newest| &newest.joint_angles_rad);
        for (number, (joint, angle_rad)) in joints.zip(angles_rad).enumerate() {
            flown.joint_ui(ui, (number, joint), *angle_rad);
        }
        if let Some(vehicle) = VehicleNow::between(&needed.after, now) {
            flown.vehicle_ui(ui, &vehicle);
        }
        if ui.available_width() > LIST_WIDTH {
            parameters_ui(ui, &ctx.flight(ui, run).rows, theme);
        }
    });
}

fn words_ui(ui: &mut Ui, progress: &Progress<'_>, theme: &Theme) {
    ui.allocate_ui_with_layout(vec2(WORDS_WIDTH, HEIGHT - 8.0), egui::Layout::top_down(egui::Align::Min), |ui| {
        ui.set_min_width(WORDS_WIDTH);
        let now = format!("Now: {}", progress.words);
        ui.label(RichText::new(now).size(MOVE_SIZE).strong().color(theme.accent));
        ui.label(RichText::new(format!("{} s left", fixed(progress.left_s.ceil(), 0))).color(theme.text));
        if let Some((words, duration_s)) = progress.next {
            let next = format!("then {words} for {} s", fixed(*duration_s, 0));
            ui.add(Label::new(RichText::new(&next).color(theme.text_weak)).truncate()).on_hover_text(next);
        }
    });
}

/// Square or rectangle of a picture above its label.
fn picture(ui: &mut Ui, size: Vec2, label: &str, accessible: String, theme: &Theme) -> Rect {
    let (rect, response) = ui.allocate_exact_size(vec2(size.x, size.y + LABEL_HEIGHT), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, accessible.clone()));
    response.on_hover_text(accessible);
    let below = pos2(rect.center().x, rect.bottom());
    ui.painter().text(below, Align2::CENTER_BOTTOM, label, theme::label_font(), theme.text);
    Rect::from_min_size(rect.min, size)
}

/// A motion that is being flown, with the time since its beginning.
struct Flown<'a> {
    progress: Progress<'a>,
    motion: &'a MotionSplines,
    time_s: f64,
    theme: &'a Theme,
}

impl Flown<'_> {
    /// Angle of a joint at a time; at rest after the end of the motion.
    fn angle_rad(&self, joint: usize, time_s: f64) -> f64 {
        self.motion.value(joint, time_s.clamp(0.0, self.motion.duration_s()), 0)
    }

    fn pose(&self, time_s: f64) -> MotionSample {
        self.motion.sample(time_s.clamp(0.0, self.motion.duration_s()))
    }

    /// Draws a joint as a dial: zero at the top, positive angles to the left, its range, the range of the move, the present
    /// angle as a needle, and the target as a dot.
    fn joint_ui(&self, ui: &mut Ui, (number, joint): (usize, &Joint), angle_rad: f64) {
        let theme = self.theme;
        let target_rad = self.angle_rad(number, self.time_s + LEAD_S);
        let [now, target] = [angle_rad, target_rad].map(|angle| fixed(angle.to_degrees(), 0));
        let label = format!("{} {now}° → {target}°", joint.name);
        let accessible = format!("Joint {}: now {now}°, target {target}°", joint.name);
        let rect = picture(ui, Vec2::splat(PICTURE - LABEL_HEIGHT), &label, accessible, theme);
        let (center, radius) = (rect.center(), 0.5 * rect.width() - 6.0);
        let at = |angle: f64| {
            let direction = -angle - FRAC_PI_2;
            center + radius * vec2(direction.cos() as f32, direction.sin() as f32)
        };
        let arc = |[low, high]: [f64; 2]| -> Vec<Pos2> {
            (0..=POINTS).map(|point| at(low + (high - low) * point as f64 / POINTS as f64)).collect()
        };
        let painter = ui.painter();
        let (low, high) = joint.limits_rad;
        painter.add(Shape::line(arc([low.max(-PI), high.min(PI)]), Stroke::new(2.0, theme.outline)));
        let angles = || self.progress.times_s().map(|time_s| self.angle_rad(number, time_s));
        let [low, high] = [angles().fold(f64::INFINITY, f64::min), angles().fold(f64::NEG_INFINITY, f64::max)];
        let moves = high - low > LEAST_ROTATION_RAD;
        if moves {
            painter.add(Shape::line(arc([low, high]), Stroke::new(5.0, theme.accent.gamma_multiply(0.5))));
        }
        painter.line_segment([center, at(angle_rad)], Stroke::new(2.5, theme.text_strong));
        painter.circle_filled(center, 3.0, theme.text_strong);
        painter.circle_filled(at(target_rad), 5.0, if moves { theme.accent } else { theme.text_weak });
    }

    /// Draws the vehicle from above, forward at the top, and its height beside it: path of the move, present pose and target.
    fn vehicle_ui(&self, ui: &mut Ui, now: &VehicleNow) {
        let theme = self.theme;
        let target = self.pose(self.time_s + LEAD_S);
        let path: Vec<Vector3<f64>> = self.progress.times_s().map(|time_s| self.pose(time_s).position_m).collect();
        let ends = [now.position_m, target.position_m];
        let reach_m = path.iter().chain(&ends).map(|point| point.amax()).fold(LEAST_REACH_M, f64::max);
        let away = fixed((target.position_m - now.position_m).norm(), 2);
        let turn = fixed((target.heading_rad - now.heading_rad).to_degrees(), 0);
        let accessible = format!("Vehicle from above and its height: the target is {away} m away, rotated by {turn}°");
        let size = vec2(PICTURE + HEIGHT_WIDTH, PICTURE - LABEL_HEIGHT);
        let rect = picture(ui, size, &format!("vehicle, {away} m to go"), accessible, theme);
        let above = Rect::from_center_size(rect.center() - vec2(0.5 * HEIGHT_WIDTH, 0.0), Vec2::splat(rect.height()));
        let beside = Rect::from_min_size(pos2(above.right() + 10.0, above.top()), vec2(10.0, above.height()));
        let scale = (0.5 * f64::from(above.height()) - 7.0) / reach_m;
        let place = |point: &Vector3<f64>| above.center() - vec2((point.y * scale) as f32, (point.x * scale) as f32);
        let level = |point: &Vector3<f64>| beside.center() - vec2(0.0, (point.z * scale) as f32);
        let painter = ui.painter();
        for rect in [above, beside] {
            painter.rect_stroke(rect, 2.0, Stroke::new(1.0, theme.outline), egui::StrokeKind::Inside);
        }
        let stroke = Stroke::new(3.0, theme.accent.gamma_multiply(0.5));
        painter.add(Shape::line(path.iter().map(place).collect(), stroke));
        painter.add(Shape::line(path.iter().map(level).collect(), stroke));
        let target = VehicleNow { position_m: target.position_m, heading_rad: target.heading_rad };
        for (pose, radius, color) in [(&target, 5.0, theme.accent), (now, 3.5, theme.text_strong)] {
            let (sine, cosine) = pose.heading_rad.sin_cos();
            let at = place(&pose.position_m);
            painter.line_segment([at, at - 12.0 * vec2(sine as f32, cosine as f32)], Stroke::new(2.0, color));
            painter.circle_filled(at, radius, color);
            painter.circle_filled(level(&pose.position_m), radius.min(4.0), color);
        }
    }
}

/// Lists the parameters that are farthest from the required accuracy, each with its σ, the required one, and a bar that is full
/// when it is reached.
fn parameters_ui(ui: &mut Ui, rows: &[FlightParameter], theme: &Theme) {
    let mut lacking: Vec<(&FlightParameter, f64)> = rows
        .iter()
        .filter_map(|row| {
            Some((row, row.sigma? / row.required)).filter(|(row, ratio)| row.verdict.is_improvable() && *ratio > 1.0)
        })
        .collect();
    lacking.sort_by(|a, b| b.1.total_cmp(&a.1));
    ui.vertical(|ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        for (row, ratio) in lacking.into_iter().take(LISTED) {
            let shown = row.parameter.shown();
            let sigma = row.sigma.map_or_else(String::new, |sigma| shown.sigma(sigma));
            let text = format!("{}  ± {sigma}, wanted {}", row.name, shown.sigma(row.required));
            ui.horizontal(|ui| {
                bar_ui(ui, 1.0 / ratio as f32, theme.accent, theme);
                ui.label(RichText::new(text).font(theme::number_font()).color(theme.text));
            });
        }
    });
}

fn bar_ui(ui: &mut Ui, fraction: f32, color: Color32, theme: &Theme) {
    let (rect, _) = ui.allocate_exact_size(vec2(BAR_WIDTH, 8.0), Sense::hover());
    ui.painter().rect_filled(rect, 2.0, theme.surface_raised);
    ui.painter().rect_filled(rect.with_max_x(rect.left() + fraction.clamp(0.0, 1.0) * BAR_WIDTH), 2.0, color);
}

#[cfg(test)]
mod tests {
    use egui_kittest::kittest::Queryable as _;

    use super::*;
    use crate::gui::rendering::headless::{HeadlessOptions, draw};
    use crate::gui::tests::keep_screenshot;
    use crate::gui::theme::ThemeName;
    use crate::gui::window::tests::{bench_of, sample};

    #[test]
    fn the_move_at_a_time_has_its_remaining_seconds_and_the_next_one() {
        let moves = [("yaw", 4.0), ("up", 8.0)].map(|(words, duration_s)| (words.to_owned(), duration_s));
        let motion = MotionSplines::at_rest(&[0.0], 12.0, 24);
        let motion = SufficientMotion { moves: moves.to_vec(), motion, remaining: None };
        let at = |time_s| Progress::of(&motion, time_s).expect("there are moves");
        let first = at(1.5);
        assert_eq!((first.words, first.left_s, first.interval_s), ("yaw", 2.5, [0.0, 4.0]));
        assert_eq!(first.next.map(|(words, _)| words.as_str()), Some("up"));
        let second = at(4.0);
        assert_eq!((second.words, second.left_s, second.next), ("up", 8.0, None));
        let times_s: Vec<f64> = second.times_s().collect();
        assert_eq!((times_s[0], times_s[POINTS]), (4.0, 12.0));
        assert_eq!((at(13.0).words, at(13.0).left_s), ("up", 0.0));
        assert_eq!(Progress::of(&SufficientMotion { moves: Vec::new(), ..motion.clone() }, 0.0), None);
    }

    #[test]
    fn joints_vehicle_and_lacking_parameters_are_shown_while_the_log_is_being_written() {
        let mut recording = sample();
        recording.runs.truncate(1);
        let labels = ["Now: ", "Joint ", "Vehicle from above", ", wanted "];
        let shown = |recording: &crate::session::Recording| {
            let harness = bench_of(recording.clone(), [1600.0, 900.0]);
            labels.map(|label| harness.query_all_by_label_contains(label).count())
        };
        assert_eq!(shown(&recording), [0; 4]);
        (recording.is_being_written, recording.runs[0].finished) = (true, false);
        assert_eq!(shown(&recording), [1, 3, 1, LISTED]);
        let mut harness = bench_of(recording.clone(), [1600.0, 900.0]);
        let options = HeadlessOptions { size_px: [1600, 900], pixels_per_point: 1.0, theme: ThemeName::Dark };
        let picture = draw(options, |ui| harness.state_mut().ui(ui));
        keep_screenshot("guidance", &picture);
        let accent = Theme::of(ThemeName::Dark).accent.to_array();
        let strip = picture.enumerate_pixels().filter(|(_, y, _)| (60..60 + HEIGHT as u32).contains(y));
        // The targets of three joints, of the vehicle and of its height, and the bars of the parameters.
        assert!(strip.filter(|(.., pixel)| pixel.0 == accent).count() > 400);
        // With a requirement that is reached, nothing is to be flown.
        let required = &mut std::sync::Arc::make_mut(&mut recording.rig).required_accuracy;
        (required.translation_m, required.rotation_rad) = (10.0, 10.0);
        assert_eq!(shown(&recording), [0; 4]);
    }
}
