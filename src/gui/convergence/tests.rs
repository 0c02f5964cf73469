use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::ConvergencePanel;
use crate::estimator::CalibrationPosterior;
use crate::gui::rendering::headless::{HeadlessOptions, draw};
use crate::gui::samples::{sample_images, sensor_recording};
use crate::gui::tests::{keep_screenshot, with_context};
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{Panel as _, Selection};
use crate::session::{FlightPrior, FlightSigmas, Recording};

type Shown = (ConvergencePanel, Selection);

fn show(ui: &mut egui::Ui, shown: &mut Shown) {
    show_recording(ui, shown, &sensor_recording());
}

fn show_recording(ui: &mut egui::Ui, shown: &mut Shown, recording: &Recording) {
    let theme = Theme::of(ThemeName::Dark);
    theme.apply(ui.ctx());
    let (panel, selection) = shown;
    let end_ns = recording.last_stamp_ns();
    with_context(recording, end_ns, &mut sample_images(), selection, &theme, |ctx| panel.ui(ui, ctx));
}

fn bench() -> Harness<'static, Shown> {
    let shown = (ConvergencePanel::default(), Selection::default());
    let mut harness = Harness::builder().with_size([1366.0, 600.0]).build_ui_state(show, shown);
    harness.run_steps(2);
    harness
}

#[test]
fn groups_fold_and_one_of_them_fills_the_panel() {
    let mut harness = bench();
    let plots = |harness: &Harness<'static, Shown>, name: &str| {
        harness.query_all_by_label_contains(name).map(|plot| plot.rect().height()).fold(0.0, f32::max)
    };
    let [chain, imu, clock] = ["roll.alpha ", "gyroscope.sx ", "readout "].map(|name| plots(&harness, name));
    assert!(chain > 20.0 && imu > 20.0 && clock > 20.0, "{chain} {imu} {clock}");
    harness.get_by_label("Group chain").click();
    harness.run_steps(2);
    assert_eq!(plots(&harness, "roll.alpha "), 0.0);
    assert!(plots(&harness, "gyroscope.sx ") > imu);
    harness.get_by_label("IMU (15)").click();
    harness.run_steps(2);
    assert!(plots(&harness, "gyroscope.sx ") > 2.0 * imu && plots(&harness, "readout ") == 0.0);
}

#[test]
fn a_line_names_the_flights_of_the_prior() {
    let flight = |source: &str| FlightSigmas { source: source.to_owned(), ..FlightSigmas::default() };
    let prior = FlightPrior {
        folder: "second/minimal".into(),
        cameras: Vec::new(),
        joints: Vec::new(),
        posterior: CalibrationPosterior {
            cameras: Vec::new(),
            covariance: nalgebra::DMatrix::zeros(0, 0),
            before: None,
        },
        growth: 2.0,
        history: ["rig", "first.mcap (minimal)", "second.mcap (minimal)"].map(flight).to_vec(),
    };
    let recording = Recording { prior: Some(std::sync::Arc::new(prior)), ..sensor_recording() };
    let shown = (ConvergencePanel::default(), Selection::default());
    let mut harness = Harness::builder()
        .with_size([1366.0, 600.0])
        .build_ui_state(move |ui, shown: &mut Shown| show_recording(ui, shown, &recording), shown);
    harness.run_steps(2);
    harness.get_by_label("Prior: calibration after first.mcap (minimal), then second.mcap (minimal), σ × 2");
    assert!(bench().query_by_label_contains("Prior: calibration").is_none());
}

#[test]
fn grouped_panels_are_drawn() {
    let options = HeadlessOptions { size_px: [1366, 768], pixels_per_point: 1.0, theme: ThemeName::Dark };
    let mut shown = (ConvergencePanel::default(), Selection::default());
    let all = draw(options, |ui| show(ui, &mut shown));
    keep_screenshot("convergence-groups", &all);
    shown.0.view = super::ConvergenceView::Group(crate::gimbal::ParameterGroup::Imu);
    let one = draw(options, |ui| show(ui, &mut shown));
    keep_screenshot("convergence-imu", &one);
    assert!(all != one);
}
