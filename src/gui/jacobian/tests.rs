use std::sync::LazyLock;

use egui::{PointerButton, pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::model::JacobianModel;
use super::paint::rect_of;
use super::{JacobianPanel, PanZoom};
use crate::estimator::{ColumnBlock, ColumnGroup, ColumnId, JacobianFactor};
use crate::gui::rendering::headless::{HeadlessOptions, draw};
use crate::gui::samples::{SAMPLE_FRAMES, first_tracked_frame, sample_images, sample_recording_of};
use crate::gui::tests::parameter;
use crate::gui::tests::{keep_screenshot, with_context};
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{Panel as _, Selection};
use crate::session::Recording;
use crate::text::Named as _;

type Shown = (JacobianPanel, Selection);

/// The sample with the run `classical` first.
fn sample() -> &'static Recording {
    static SAMPLE: LazyLock<Recording> = LazyLock::new(|| sample_recording_of(SAMPLE_FRAMES, &["classical", "auto"]));
    &SAMPLE
}

fn show(ui: &mut egui::Ui, shown: &mut Shown, recording: &Recording, theme: ThemeName) {
    let theme = Theme::of(theme);
    theme.apply(ui.ctx());
    let (panel, selection) = shown;
    let end_ns = recording.last_stamp_ns();
    with_context(recording, end_ns, &mut sample_images(), selection, &theme, |ctx| panel.ui(ui, ctx));
}

fn bench() -> Harness<'static, Shown> {
    let mut harness = Harness::builder().with_size([1000.0, 700.0]).build_ui_state(
        |ui, shown: &mut Shown| show(ui, shown, sample(), ThemeName::Dark),
        (JacobianPanel::default(), Selection::default()),
    );
    harness.run_steps(2);
    harness
}

fn model() -> JacobianModel {
    let recording = sample();
    let run = &recording.runs[0];
    JacobianModel::of_step(&recording.rig, &recording.rig.parameter_names(), run, run.steps.last().unwrap()).unwrap()
}

fn click(harness: &mut Harness<'static, Shown>, at: egui::Pos2) {
    harness.event(egui::Event::PointerMoved(at));
    for pressed in [true, false] {
        let modifiers = egui::Modifiers::NONE;
        harness.event(egui::Event::PointerButton { pos: at, button: PointerButton::Primary, pressed, modifiers });
    }
    harness.run_steps(3);
}

/// Centre of a block on the screen, in the layout of the test.
fn middle(harness: &Harness<'static, Shown>, row: usize, column: usize) -> egui::Pos2 {
    let area = harness.get_by_label("Jacobian blocks").rect();
    rect_of(&model(), PanZoom::default().place(area, area.size()), row, column).center()
}

#[test]
fn axes_are_whole_and_in_order() {
    let model = model();
    for axis in [&model.rows, &model.columns] {
        for strips in [&axis.strips, &axis.groups] {
            assert!(strips[0].begin == 0.0 && (strips.last().unwrap().end - 1.0).abs() < 1e-5);
            assert!(strips.windows(2).all(|two| two[0].end == two[1].begin));
        }
        for (index, strip) in axis.strips.iter().enumerate() {
            assert_eq!(axis.at(0.5 * (strip.begin + strip.end)), Some(index));
        }
        assert_eq!((axis.at(-0.1), axis.at(1.1)), (None, None));
    }
    assert_eq!(model.rows.strips.len(), model.jacobian.rows.len());
    assert_eq!(model.columns.strips.len(), model.jacobian.columns.len());
    let names: Vec<&str> = model.columns.groups.iter().map(|group| group.name.as_str()).collect();
    assert_eq!(names, ["calibration", "joints", "poses", "velocities, biases", "depth"]);
}

#[test]
fn columns_are_in_groups_and_joints_have_rates() {
    let mut jacobian = model().jacobian;
    // A time offset between the columns of the chain, like the main camera's time offset before a rigid camera.
    let place = 4;
    for (column, name) in [(place, "readout"), (place + 1, "gyroscope.sx"), (place + 2, "fx")] {
        jacobian.columns[column].id = ColumnId::Calibration(parameter(name));
    }
    let columns = super::model::columns_of(&jacobian, &crate::gimbal::ParameterNames::default());
    let names: Vec<&str> = columns.groups.iter().map(|group| group.name.as_str()).collect();
    assert_eq!(names[..4], ["chain", "camera", "IMU", "clocks"]);
    let begin = |column: usize| columns.strips[column].begin;
    assert!(
        begin(place + 3) < begin(place + 2) && begin(place + 2) < begin(place + 1) && begin(place + 1) < begin(place)
    );
    for (index, strip) in columns.strips.iter().enumerate() {
        assert_eq!(columns.at(0.5 * (strip.begin + strip.end)), Some(index));
    }
    let labels = |count: usize| super::model::joint_columns(count, 3).into_iter().map(|(name, _)| name);
    assert_eq!(labels(3).collect::<Vec<_>>(), ["q1", "q2", "q3"]);
    assert_eq!(labels(9).skip(3).collect::<Vec<_>>(), ["q1'", "q2'", "q3'", "q1''", "q2''", "q3''"]);
    let block = ColumnBlock { id: ColumnId::Calibration(parameter("accelerometer.mxy")), start: 0, len: 1 };
    assert_eq!(super::model::unit_text(&block, 3), "σ per 1 %");
}

#[test]
fn a_click_selects_feature_and_parameter_and_shows_their_values() {
    let mut harness = bench();
    let model = model();
    let column =
        model.jacobian.columns.iter().position(|block| block.id.parameter() == Some(parameter("L2.alpha"))).unwrap();
    let JacobianFactor::Feature(id) = model.jacobian.rows[3].factor else { panic!("features come first") };
    let at = middle(&harness, 3, column);
    click(&mut harness, at);
    let selection = &harness.state().1;
    assert_eq!((selection.feature, selection.parameter), (Some(id), Some(parameter("L2.alpha"))));
    assert_eq!(middle(&harness, 3, column), at, "the block stays under the pointer");
    assert!(harness.query_by_label_contains(&format!("feature {} × roll.alpha: ", id.0)).is_some());
    assert!(harness.query_by_label("∂u, px/°").is_some());
    // A parameter selected in another panel is shown as a column, with the rows of the largest norms.
    harness.state_mut().1 = Selection { parameter: Some(parameter("L1.alpha")), ..Selection::default() };
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("yaw.alpha: non-zero in ").is_some());
    // An IMU factor with respect to a pose is selected only here.
    let is_imu = |factor: &JacobianFactor| matches!(factor, JacobianFactor::Imu { .. });
    let row = model.jacobian.rows.iter().position(|row| is_imu(&row.factor)).unwrap();
    let pose = model.jacobian.columns.iter().position(|block| block.id.group() == ColumnGroup::Pose).unwrap();
    let at = middle(&harness, row, pose);
    click(&mut harness, at);
    let selection = &harness.state().1;
    assert_eq!((selection.feature, selection.parameter), (None, None));
    assert!(harness.query_by_label_contains("15 × 6").is_some());
    assert!(harness.query_by_label_contains("All factors of this kind").is_some());
}

#[test]
fn the_matrix_zooms_and_steps_without_a_linearization_are_reported() {
    for theme in [ThemeName::Dark, ThemeName::Light] {
        let selection = Selection { parameter: Some(parameter("L2.alpha")), ..Selection::default() };
        let mut shown = (JacobianPanel::default(), selection);
        let options = HeadlessOptions { size_px: [1000, 640], pixels_per_point: 1.0, theme };
        let whole = draw(options, |ui| show(ui, &mut shown, sample(), theme));
        keep_screenshot(&format!("jacobian-flown-{}", theme.name()), &whole);
        shown.0.view = PanZoom { zoom: 6.0, centre: egui::vec2(0.15, 0.3) };
        let near = draw(options, |ui| show(ui, &mut shown, sample(), theme));
        keep_screenshot(&format!("jacobian-near-{}", theme.name()), &near);
        assert!(whole != near);
    }
    let place = PanZoom { zoom: 2.0, centre: egui::vec2(0.25, 0.5) }
        .place(egui::Rect::from_min_max(pos2(0.0, 0.0), pos2(100.0, 50.0)), egui::vec2(100.0, 50.0));
    assert_eq!(place, egui::Rect::from_min_max(pos2(0.0, -25.0), pos2(200.0, 75.0)));

    let recording = sample_recording_of(first_tracked_frame(), &["auto"]);
    let mut harness = Harness::builder().with_size([400.0, 300.0]).build_ui_state(
        move |ui, shown: &mut Shown| show(ui, shown, &recording, ThemeName::Dark),
        (JacobianPanel::default(), Selection::default()),
    );
    harness.run_steps(2);
    assert!(harness.query_by_label("No linearization in this step").is_some());
}

#[test]
fn the_matrix_keeps_its_size_when_the_step_lacks_the_selected_feature() {
    let mut harness = bench();
    let size = |harness: &mut Harness<'static, Shown>, selection: Selection| {
        harness.state_mut().1 = selection;
        harness.run_steps(2);
        harness.get_by_label("Jacobian blocks").rect()
    };
    let step = sample().runs[0].steps.last().unwrap();
    let parameter = Some(parameter("L2.alpha"));
    let feature = step.report.features.first().map(|feature| feature.id);
    let missing = Some(crate::frontend::FeatureId(u64::from(u32::MAX)));
    let with = size(&mut harness, Selection { feature, parameter, ..Selection::default() });
    let without = size(&mut harness, Selection { feature: missing, parameter, ..Selection::default() });
    assert_eq!(with, without);
}
