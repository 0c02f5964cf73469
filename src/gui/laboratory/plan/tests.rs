use egui::accesskit::Role as AccessRole;
use egui::{Key, PointerButton, Pos2, Role, pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use super::super::{LaboratoryPanel, LaboratoryView, MotionRequest};
use super::PlanView;
use crate::gui::rendering::headless::{HeadlessOptions, draw};
use crate::gui::samples::{SAMPLE_FRAMES, sample_images, sample_recording_of};
use crate::gui::tests::{keep_screenshot, with_context};
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{CsvTable as _, Panel as _, Selection};
use crate::session::{Recording, flight_table};
use crate::simulation::{MotionSplines, PrescribedMotion};
use crate::text::Named as _;

type Shown = (LaboratoryPanel, Selection);

fn sample() -> Recording {
    sample_recording_of(SAMPLE_FRAMES, &["auto"])
}

/// Panel with a planned motion and a short search.
fn panel(in_background: bool) -> LaboratoryPanel {
    let plan = PlanView { trials: 30, ..PlanView::default() };
    LaboratoryPanel { in_background, view: LaboratoryView::Plan, plan, ..LaboratoryPanel::default() }
}

fn show(ui: &mut egui::Ui, shown: &mut Shown, recording: &Recording, theme: ThemeName) {
    let theme = Theme::of(theme);
    theme.apply(ui.ctx());
    let (panel, selection) = shown;
    let end_ns = recording.last_stamp_ns();
    with_context(recording, end_ns, &mut sample_images(), selection, &theme, |ctx| panel.ui(ui, ctx));
}

fn bench(in_background: bool) -> Harness<'static, Shown> {
    let recording = sample();
    let mut harness = Harness::builder().with_size([1200.0, 760.0]).with_max_steps(4000).build_ui_state(
        move |ui, shown: &mut Shown| show(ui, shown, &recording, ThemeName::Dark),
        (panel(in_background), Selection::default()),
    );
    harness.run_steps(2);
    harness
}

fn plan<'a>(harness: &'a Harness<'static, Shown>) -> &'a PlanView {
    &harness.state().0.plan
}

fn motion(harness: &Harness<'static, Shown>) -> MotionSplines {
    plan(harness).edited.as_ref().unwrap().current().clone()
}

/// σ of all parameters after log and motion.
fn sigmas(harness: &Harness<'static, Shown>) -> Vec<f64> {
    let prediction = plan(harness).predictions.last().unwrap();
    prediction.result().parameters.iter().map(|parameter| parameter.sigma).collect()
}

/// Waits for searches and predictions on threads.
fn wait(harness: &mut Harness<'static, Shown>) {
    harness.run_steps(1);
    while plan(harness).search.is_some() || plan(harness).predictions.is_busy() {
        harness.run_steps(1);
        std::thread::yield_now();
    }
    harness.run_steps(1);
}

fn press(harness: &mut Harness<'static, Shown>, at: Pos2, pressed: bool) {
    let (button, modifiers) = (PointerButton::Primary, egui::Modifiers::NONE);
    harness.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
    harness.run_steps(1);
}

/// Drags the curve of a channel in the middle of its plot by a number of points upwards.
fn drag(harness: &mut Harness<'static, Shown>, curve: &str, up: f32, mut each: impl FnMut(&Harness<'static, Shown>)) {
    let area = harness.get_by_role_and_label(Role::Slider, curve).rect();
    let from = area.center();
    harness.event(egui::Event::PointerMoved(from));
    press(harness, from, true);
    // Shorter moves are clicks.
    for ratio in [0.7, 0.8, 0.9, 1.0] {
        let at = pos2(from.x, from.y - up * ratio);
        harness.event(egui::Event::PointerMoved(at));
        harness.run_steps(2);
        each(harness);
    }
    press(harness, pos2(from.x, from.y - up), false);
    harness.run_steps(1);
}

#[test]
fn a_drag_moves_the_curve_and_every_sigma_while_the_pointer_moves() {
    let mut harness = bench(false);
    let (before, sigmas_before) = (motion(&harness), sigmas(&harness));
    let joint = before.joint_count() - 1;
    let name = format!("Motion of {}", sample().rig.joint_names()[joint]);
    let mut seen = Vec::new();
    let middle_s = 0.5 * before.duration_s();
    let up = if before.value(joint, middle_s, 0) > 0.0 { -14.0 } else { 14.0 };
    drag(&mut harness, &name, up, |harness| seen.push(sigmas(harness)));
    assert!(seen.windows(2).all(|pair| pair[0] != pair[1]), "σ follows every move of the pointer");
    let after = motion(&harness);
    let change_rad = after.value(joint, middle_s, 0) - before.value(joint, middle_s, 0);
    assert!(change_rad * f64::from(up) > 0.5, "{change_rad}");
    assert!((0..joint).all(|other| after.value(other, middle_s, 0) == before.value(other, middle_s, 0)));
    assert_ne!(sigmas(&harness), sigmas_before);
    // The table says what has changed, until the next change.
    assert_eq!(harness.query_all_by_label_contains(", change ").count(), sigmas_before.len());
    harness.get_by_label("Undo").click();
    harness.run_steps(3);
    assert_eq!(motion(&harness), before);
    assert_eq!(sigmas(&harness), sigmas_before);
    harness.get_by_label("Redo").click();
    harness.run_steps(3);
    assert_eq!(motion(&harness), after);
    harness.get_by_label("Reset").click();
    harness.run_steps(3);
    assert_eq!(motion(&harness), before);
}

#[test]
fn keys_move_a_point_and_screen_readers_get_its_value() {
    let mut harness = bench(false);
    let before = motion(&harness);
    let described = |harness: &Harness<'static, Shown>| {
        harness.get_by_role_and_label(Role::Slider, "Motion of forward").accesskit_node().description().unwrap()
    };
    harness.get_by_role_and_label(Role::Slider, "Motion of forward").focus();
    harness.run_steps(2);
    let text = described(&harness);
    assert!(text.contains(" m at 1.5 s, limits -1.50 m to 1.50 m"), "{text}");
    for key in [Key::ArrowRight, Key::ArrowRight, Key::ArrowUp] {
        harness.key_press(key);
        harness.run_steps(2);
    }
    assert!(described(&harness).contains("at 2.5 s"), "{}", described(&harness));
    let (after, forward) = (motion(&harness), before.joint_count());
    let change_m = after.value(forward, 2.5, 0) - before.value(forward, 2.5, 0);
    assert!((change_m - 3.0 / 50.0).abs() < 0.01, "{change_m}");
    let rows = harness.query_all_by_label_contains("σ").filter(|row| {
        row.accesskit_node().role() == AccessRole::Button
            && row.accesskit_node().label().is_some_and(|text| text.contains("this log"))
    });
    assert_eq!(rows.count(), sigmas(&harness).len());
}

#[test]
fn the_log_has_the_sigma_of_the_calibration_panel() {
    let harness = bench(false);
    let recording = sample();
    let rows = flight_table(&recording, &recording.runs[0]);
    let prediction = plan(&harness).predictions.last().unwrap().clone();
    let flight = prediction.flight.as_ref().unwrap();
    for row in rows {
        let planned = flight.parameters.iter().find(|parameter| parameter.name == row.name).unwrap();
        assert!((planned.sigma / row.sigma.unwrap() - 1.0).abs() < 0.01, "{row:?} {planned:?}");
        assert!((planned.prior_sigma / row.prior_sigma.unwrap() - 1.0).abs() < 0.01, "{row:?} {planned:?}");
        assert_eq!(planned.verdict, row.verdict, "{row:?}");
    }
    // Log and motion together know more than either.
    let both = prediction.both.as_ref().unwrap();
    for ((both, flight), motion) in both.parameters.iter().zip(&flight.parameters).zip(&prediction.motion.parameters) {
        assert!(both.sigma <= flight.sigma * (1.0 + 1e-9) && both.sigma <= motion.sigma * (1.0 + 1e-9), "{both:?}");
    }
    let text = harness.query_by_label_contains("After this log and the motion");
    assert!(text.is_some(), "the table names what it is about");
}

#[test]
fn the_button_optimizes_from_here_on_a_thread_and_can_be_stopped() {
    let mut harness = bench(true);
    wait(&mut harness);
    let worst = |harness: &Harness<'static, Shown>| plan(harness).predictions.last().unwrap().result().worst_ratio;
    let (before, worst_before) = (motion(&harness), worst(&harness));
    harness.get_by_label("Optimize from here").click();
    harness.run_steps(2);
    assert!(harness.query_by_label("Stop").is_some() && plan(&harness).search.is_some());
    wait(&mut harness);
    assert!(worst(&harness) < worst_before, "{} {worst_before}", worst(&harness));
    let optimized = motion(&harness);
    assert_ne!(optimized, before);
    // One step of undo.
    harness.get_by_label("Undo").click();
    wait(&mut harness);
    assert_eq!(motion(&harness), before);
    // A search of hours ends at once, with a motion that is not worse.
    harness.state_mut().0.plan.trials = 10_000_000;
    harness.get_by_label("Optimize from here").click();
    harness.run_steps(2);
    harness.get_by_label("Stop").click();
    wait(&mut harness);
    assert!(worst(&harness) <= worst_before * (1.0 + 1e-9));
    // The moves of a person as another start.
    harness.get_by_role_and_label(Role::ComboBox, "Start").click();
    harness.run_steps(3);
    harness.get_by_label("at rest").click();
    harness.run_steps(3);
    harness.get_by_label("Begin with it").click();
    wait(&mut harness);
    let rest = motion(&harness);
    assert!((0..=40).all(|step| rest.position_m(0.5 * f64::from(step), 0).norm() < 1e-12));
}

#[test]
fn a_motion_is_saved_and_opened_and_other_joints_are_refused() {
    let mut harness = bench(false);
    harness.get_by_label("Save motion").click();
    harness.run_steps(2);
    let request = harness.state_mut().0.take_request();
    let Some(MotionRequest::Write { path, motion: written, joint_names }) = request else { panic!("{request:?}") };
    assert!(path.ends_with("motion.csv"), "{}", path.display());
    assert_eq!(written, motion(&harness));
    let samples = (0..=400).map(|step| written.sample(0.05 * f64::from(step))).collect();
    let file = PrescribedMotion { joint_names, samples };
    harness.get_by_label("Open motion").click();
    harness.run_steps(2);
    assert_eq!(harness.state_mut().0.take_request(), Some(MotionRequest::Read { path }));
    let sigmas_before = sigmas(&harness);
    harness.get_by_role_and_label(Role::ComboBox, "Start").click();
    harness.run_steps(3);
    harness.get_by_label("at rest").click();
    harness.run_steps(3);
    harness.get_by_label("Begin with it").click();
    harness.run_steps(4);
    assert_ne!(sigmas(&harness), sigmas_before);
    harness.state_mut().0.open_motion(file.clone());
    harness.run_steps(3);
    let read = motion(&harness);
    for (channel, index) in
        (0..written.channel_count()).flat_map(|it| (0..written.point_count()).map(move |at| (it, at)))
    {
        let (before, after) = (written.point(channel, index), read.point(channel, index));
        assert!((before - after).abs() < 1e-6, "{channel}, {index}: {before} {after}");
    }
    // A keyframe begins where the parallax exceeds a threshold: rounding may move one by an image.
    for (before, after) in sigmas_before.iter().zip(&sigmas(&harness)) {
        assert!((before / after - 1.0).abs() < 0.03, "{before} {after}");
    }
    assert!(harness.query_by_label("The curves are those of the file").is_some());
    let other = PrescribedMotion { joint_names: vec!["a".into(), "b".into(), "c".into()], ..file };
    harness.state_mut().0.open_motion(other);
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("it has the joints a, b, c, the rig has").is_some());
}

#[test]
fn screenshots_and_tables_have_the_planned_motion() {
    let recording = sample();
    for theme in [ThemeName::Dark, ThemeName::Light] {
        let mut shown = (panel(false), Selection::default());
        let options = HeadlessOptions { size_px: [1200, 760], pixels_per_point: 1.0, theme };
        let screenshot = draw(options, |ui| show(ui, &mut shown, &recording, theme));
        keep_screenshot(&format!("planned-motion-{}", theme.name()), &screenshot);
        let mut copy = (shown.0.view_copy(), Selection::default());
        assert!(screenshot == draw(options, |ui| show(ui, &mut copy, &recording, theme)));
    }
    let mut narrow = (panel(false), Selection::default());
    let options = HeadlessOptions { size_px: [640, 900], pixels_per_point: 1.0, theme: ThemeName::Dark };
    keep_screenshot("planned-motion-narrow", &draw(options, |ui| show(ui, &mut narrow, &recording, ThemeName::Dark)));
    let theme = Theme::of(ThemeName::Dark);
    let mut table = String::new();
    with_context(&recording, 0, &mut sample_images(), &mut Selection::default(), &theme, |ctx| {
        table = panel(false).csv_table(ctx);
    });
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][..4], ["parameter", "unit", "prior_sigma", "log_sigma"]);
    assert_eq!(rows.len(), 1 + 18);
}
