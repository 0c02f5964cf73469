use egui::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::LaboratoryPanel;
use crate::gimbal::Parameterization;
use crate::gui::rendering::headless::{HeadlessOptions, draw};
use crate::gui::samples::{sample_images, sample_recording_of};
use crate::gui::tests::{keep_screenshot, with_context};
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{Panel as _, Selection};
use crate::observability::laboratory::{LaboratoryForm, LaboratoryMotion, LaboratorySetup, Mechanism};
use crate::session::Recording;
use crate::text::Named as _;

fn show(ui: &mut egui::Ui, panel: &mut LaboratoryPanel, recording: &Recording, theme: ThemeName) {
    let theme = Theme::of(theme);
    theme.apply(ui.ctx());
    let (mut selection, end_ns) = (Selection::default(), recording.duration_ns);
    with_context(recording, end_ns, &mut sample_images(), &mut selection, &theme, |ctx| panel.ui(ui, ctx));
}

fn bench(in_background: bool) -> Harness<'static, LaboratoryPanel> {
    let recording = sample_recording_of(40, &["auto"]);
    let panel = LaboratoryPanel { in_background, ..LaboratoryPanel::default() };
    let mut harness = Harness::builder()
        .with_size([1000.0, 800.0])
        .with_max_steps(2000)
        .build_ui_state(move |ui, panel: &mut LaboratoryPanel| show(ui, panel, &recording, ThemeName::Dark), panel);
    harness.run_steps(2);
    harness
}

/// Selects an entry of a list by the label of the list.
fn choose(harness: &mut Harness<'static, LaboratoryPanel>, list: &str, entry: &str) {
    harness.get_by_role_and_label(Role::ComboBox, list).click();
    harness.run_steps(3);
    harness.get_by_label(entry).click();
    harness.run_steps(3);
}

#[test]
fn a_column_has_the_colour_of_the_run_with_its_parameterization_only() {
    let theme = Theme::of(ThemeName::Dark);
    let colors = |runs: &[&str]| {
        let (recording, mut selection) = (sample_recording_of(40, runs), Selection::default());
        let mut colors = Vec::new();
        with_context(&recording, 0, &mut sample_images(), &mut selection, &theme, |ctx| {
            colors.extend(["classical", "minimal"].map(|form| super::color_of(form, ctx)));
        });
        colors
    };
    assert_eq!(colors(&["auto"]), [theme.text, theme.text]);
    assert_eq!(colors(&["auto", "classical"]), [theme.run(1).color, theme.text]);
}

#[test]
fn experiments_have_the_results_of_the_command() {
    let mut harness = bench(false);
    // The rig's mechanism with aggressive motion: rank is lost only by the parameterization.
    assert!(harness.query_by_label("18 of 24").is_some());
    assert_eq!(harness.query_all_by_label("18 of 18").count(), 2);
    // Another mechanism and motion, with the results of the command line.
    choose(&mut harness, "Mechanism", "yaw-roll-pitch-ideal");
    choose(&mut harness, "Motion", "hover");
    let mechanism = Mechanism::named("yaw-roll-pitch-ideal").unwrap();
    let setup = LaboratorySetup { motion: LaboratoryMotion::Hover, ..LaboratorySetup::new(mechanism) };
    let classical = setup.run(LaboratoryForm::whole(Parameterization::Classical)).unwrap().rank;
    assert!(classical.rank_structural < 18, "hover constrains less than every motion");
    let text = format!("{} of 24", classical.rank_structural);
    assert!(harness.query_by_label(&text).is_some(), "{text}");
    assert!(harness.query_by_label_contains(LaboratoryMotion::Hover.meaning()).is_some());
    harness.get_by_role_and_label(Role::CheckBox, "classical").click();
    harness.run_steps(3);
    assert!(harness.query_by_label(&text).is_none());
    for parameterization in ["minimal", "minimal-swapped"] {
        harness.get_by_role_and_label(Role::CheckBox, parameterization).click();
        harness.run_steps(3);
    }
    assert!(harness.query_by_label("No parameterization selected").is_some());
}

#[test]
fn in_the_window_results_appear_one_by_one() {
    let mut harness = bench(true);
    while harness.state().worker.is_busy() {
        harness.run_steps(1);
        std::thread::yield_now();
    }
    harness.run_steps(1);
    assert!(harness.query_by_label("18 of 24").is_some());
    assert_eq!(harness.query_all_by_label("18 of 18").count(), 2);
}

#[test]
fn screenshots_wait_for_their_experiments() {
    let recording = sample_recording_of(40, &["auto"]);
    for theme in [ThemeName::Dark, ThemeName::Light] {
        let mut panel = LaboratoryPanel::default();
        let options = HeadlessOptions { size_px: [1200, 760], pixels_per_point: 1.0, theme };
        let screenshot = draw(options, |ui| show(ui, &mut panel, &recording, theme));
        keep_screenshot(&format!("laboratory-{}", theme.name()), &screenshot);
        let mut copy = panel.view_copy();
        assert!(screenshot == draw(options, |ui| show(ui, &mut copy, &recording, theme)));
    }
}
