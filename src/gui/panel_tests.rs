//! Every panel is drawn at stamps with missing data; nothing may panic. The screenshots can be kept for inspection.

use egui::Ui;

use super::rendering::headless::{HeadlessOptions, draw};
use super::samples::{sample_images, sample_recording, sample_recording_of};
use super::tests::{keep_screenshot, with_context};
use super::theme::{Theme, ThemeName};
use super::{PanelContext, Selection};
use crate::gimbal::tests::parameter;
use crate::session::Recording;

const SECOND_NS: i64 = 1_000_000_000;

/// Draws a panel at a stamp and keeps the screenshot.
fn screenshot(
    name: &str,
    recording: &Recording,
    cursor_ns: i64,
    size_px: [u32; 2],
    theme: ThemeName,
    selection: &Selection,
    mut show: impl FnMut(&mut Ui, &mut PanelContext<'_>),
) {
    let mut selection = selection.clone();
    let colors = Theme::of(theme);
    let image = draw(HeadlessOptions { size_px, pixels_per_point: 1.0, theme }, |ui| {
        let frame = egui::Frame::new().fill(colors.surface).inner_margin(super::theme::PANEL_MARGIN);
        frame.show(ui, |ui| {
            with_context(recording, cursor_ns, &mut sample_images(), &mut selection, &colors, |ctx| show(ui, ctx));
        });
    });
    keep_screenshot(name, &image);
}

/// Recordings and stamps that lack data that a panel may rely on.
fn cases_with_missing_data() -> Vec<(&'static str, Recording, i64)> {
    let whole = sample_recording_of(70, &["auto", "classical"]);
    let mut no_runs = whole.clone();
    no_runs.runs.clear();
    let mut no_steps = whole.clone();
    for run in &mut no_steps.runs {
        run.steps.clear();
        run.alignment = None;
    }
    let mut no_ground_truth = whole.clone();
    no_ground_truth.ground_truth_rig = None;
    for run in &mut no_ground_truth.runs {
        run.alignment = None;
        for step in &mut run.steps {
            std::sync::Arc::make_mut(step).ground_truth = None;
        }
    }
    let mut rigid = whole.clone();
    std::sync::Arc::make_mut(&mut rigid.rig).gimbal = None;
    rigid.ground_truth_rig = None;
    for step in rigid.runs.iter_mut().flat_map(|run| &mut run.steps) {
        let step = std::sync::Arc::make_mut(step);
        let calibration = &mut step.report.calibration;
        calibration.parameters.clear();
        calibration.values.clear();
        calibration.sigmas.clear();
        calibration.prior_sigmas.clear();
        calibration.margins.clear();
        calibration.classical.links.clear();
        for frame in &mut step.report.window {
            frame.joint_angles_rad.clear();
            frame.encoder_angles_rad = None;
            frame.encoder_sigmas_rad = None;
        }
        step.rank = None;
    }
    let mut single_stamp = whole.clone();
    single_stamp.duration_ns = 0;
    let end_ns = whole.duration_ns;
    vec![
        ("no-runs", no_runs, end_ns),
        ("no-steps", no_steps, end_ns),
        ("no-truth", no_ground_truth, end_ns),
        ("rigid", rigid, end_ns),
        ("instant", single_stamp, 0),
        ("initializing", whole.clone(), SECOND_NS),
        ("before", whole.clone(), -5),
        ("after", whole, 9 * end_ns),
    ]
}

/// Draws a panel as usual, then in every case, large and tiny.
fn check<P: Default>(name: &str, size_px: [u32; 2], mut ui: impl FnMut(&mut P, &mut Ui, &mut PanelContext<'_>)) {
    let recording = sample_recording();
    let selection = Selection { parameter: Some(parameter("L2.alpha")), ..Selection::default() };
    let second = Selection { run: 1, ..Selection::default() };
    let mut shown = |file: &str, cursor_ns: i64, size_px: [u32; 2], theme: ThemeName, selection: &Selection| {
        let mut panel = P::default();
        screenshot(&format!("{name}-{file}"), &recording, cursor_ns, size_px, theme, selection, |panel_ui, ctx| {
            ui(&mut panel, panel_ui, ctx);
        });
    };
    shown("dark", 9 * SECOND_NS, size_px, ThemeName::Dark, &selection);
    shown("light", 9 * SECOND_NS, size_px, ThemeName::Light, &selection);
    shown("print", 9 * SECOND_NS, size_px, ThemeName::Print, &second);
    shown("second", 4 * SECOND_NS, size_px, ThemeName::Dark, &second);
    shown("tiny", 9 * SECOND_NS, [90, 40], ThemeName::Dark, &selection);
    for (case, recording, cursor_ns) in cases_with_missing_data() {
        let mut panel = P::default();
        let file = format!("{name}-{case}");
        screenshot(&file, &recording, cursor_ns, size_px, ThemeName::Dark, &Selection::default(), |panel_ui, ctx| {
            ui(&mut panel, panel_ui, ctx);
        });
    }
}

#[test]
fn convergence_is_drawn_in_every_case() {
    check("convergence", [1400, 420], super::convergence::ConvergencePanel::ui);
}

#[test]
fn rank_is_drawn_in_every_case() {
    check("rank", [480, 520], super::rank::RankPanel::ui);
}

#[test]
fn the_jacobian_is_drawn_in_every_case() {
    check("jacobian", [900, 520], super::jacobian::JacobianPanel::ui);
}

#[test]
fn residuals_are_drawn_in_every_case() {
    check("residuals", [480, 420], super::residuals::ResidualsPanel::ui);
}

#[test]
fn the_window_is_drawn_in_every_case() {
    use super::window::{Preset, WindowState, window_ui};
    check("window", [1920, 1080], |state: &mut WindowState, ui, ctx| window_ui(ui, state, ctx));
    check("window-small", [1366, 768], |state: &mut WindowState, ui, ctx| window_ui(ui, state, ctx));
    for preset in [Preset::Calibration, Preset::FrontEnd, Preset::Scene] {
        let mut state = WindowState::default();
        state.arrange(preset);
        let (recording, selection) = (sample_recording(), Selection::default());
        let name = format!("window-{preset:?}");
        screenshot(&name, &recording, 9 * SECOND_NS, [1920, 1080], ThemeName::Dark, &selection, |ui, ctx| {
            window_ui(ui, &mut state, ctx);
        });
    }
}

#[test]
fn the_timeline_is_drawn_in_every_case() {
    check("timeline", [1900, 190], super::timeline::TimelinePanel::ui);
}

#[test]
fn the_inspector_is_drawn_in_every_case() {
    check("inspector", [480, 700], |panel: &mut super::inspector::InspectorPanel, ui, ctx| {
        let run = ctx.recording.runs.first();
        let step = run.and_then(|run| run.step_at(ctx.cursor_ns));
        ctx.selection.feature = step.and_then(|step| Some(step.report.features.first()?.id));
        panel.ui(ui, ctx);
    });
}

/// Prints the computing time of a screenshot of the whole window: `cargo test --release --lib time_of_a -- --ignored
/// --nocapture`.
#[test]
#[ignore = "a measurement, not a test"]
#[expect(clippy::disallowed_methods, clippy::print_stdout, reason = "it measures and says so")]
fn time_of_a_window_frame() {
    use super::rendering::headless::Headless;
    use super::rendering::painter::Painter;
    use super::window::{WindowState, window_ui};
    use std::time::Instant;

    let recording = sample_recording_of(2400, &["auto", "classical"]);
    let options = HeadlessOptions { size_px: [1920, 1080], pixels_per_point: 1.0, theme: ThemeName::Dark };
    let (mut headless, mut painter) = (Headless::new(options), Painter::new());
    let (mut state, mut selection, mut images) = (WindowState::default(), Selection::default(), sample_images());
    let theme = Theme::of(ThemeName::Dark);
    let mut times_ms: Vec<[f64; 2]> = Vec::new();
    for number in 0..60 {
        let begin = Instant::now();
        let mut frame = headless.frame(Vec::new(), |ui| {
            let cursor_ns = 100 * SECOND_NS + number * SECOND_NS / 20;
            with_context(&recording, cursor_ns, &mut images, &mut selection, &theme, |ctx| {
                window_ui(ui, &mut state, ctx);
            });
        });
        let drawn = Instant::now();
        painter.set_textures(&frame.textures);
        painter.paint(&frame.primitives, options.size_px, 1.0, theme.background);
        frame.textures.clear();
        let painted = Instant::now();
        times_ms.push([drawn - begin, painted - drawn].map(|time| time.as_secs_f64() * 1e3));
    }
    for (part, name) in ["interface and tessellation", "CPU painter"].into_iter().enumerate() {
        let mut part_ms: Vec<f64> = times_ms[5..].iter().map(|times| times[part]).collect();
        part_ms.sort_by(f64::total_cmp);
        println!(
            "{name}: first {:.1} ms, median {:.1} ms, worst {:.1} ms",
            times_ms[0][part], part_ms[27], part_ms[54]
        );
    }
}
