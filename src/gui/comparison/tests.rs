//! Tests of the comparison panel by its labels.

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use super::ComparisonPanel;
use super::numbers::AGAINST_BATCH;
use super::scores::{ScoreKind, ScoreRow};
use crate::gui::samples::{sample_images, sample_recording_of};
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{Dialog, Panel as _, PanelContext, Playback, Presentation, Selection};
use crate::session::{Command, ComparedQuantity, Recording};
use crate::text::Named as _;

struct Bench {
    recording: Recording,
    cursor_ns: i64,
    selection: Selection,
    panel: ComparisonPanel,
    commands: Vec<Command>,
}

impl Bench {
    fn ui(&mut self, ui: &mut egui::Ui) {
        let theme = Theme::of(ThemeName::Dark);
        let mut context = PanelContext {
            recording: &self.recording,
            cursor_ns: self.cursor_ns,
            playback: &Playback::default(),
            images: &mut sample_images(),
            selection: &mut self.selection,
            theme: &theme,
            presentation: Presentation::Interactive,
            commands: &mut self.commands,
        };
        self.panel.ui(ui, &mut context);
    }
}

fn bench(runs: &[&str], size: [f32; 2]) -> Harness<'static, Bench> {
    let recording = sample_recording_of(120, runs);
    let cursor_ns = recording.last_stamp_ns();
    let (selection, panel) = (Selection::default(), ComparisonPanel::default());
    let bench = Bench { recording, cursor_ns, selection, panel, commands: Vec::new() };
    let mut harness = Harness::builder()
        .with_size(size)
        .with_context_setup(|ctx| Theme::of(ThemeName::Dark).apply(ctx))
        .build_ui_state(|ui, bench: &mut Bench| bench.ui(ui), bench);
    harness.run_steps(3);
    harness
}

#[test]
fn numbers_show_accuracy_and_lead_to_the_divergence() {
    let mut harness = bench(&["auto", "classical"], [900.0, 900.0]);
    let rows = harness.state().panel.scores.rows();
    assert!(rows.iter().all(|row| row.meaning.len() > 15), "{rows:?}");
    let rms = rows.iter().find(|row| row.name == "ATE RMS").unwrap();
    // Two parameterizations of one problem differ by less than the scatter of their errors.
    assert_eq!(rms.best(), None, "{rms:?}");
    let row = |values: [f64; 2]| {
        let (name, values) = ("ATE RMS".to_owned(), values.map(Some).to_vec());
        let (kind, scatters) = (ScoreKind::Exact, Vec::new());
        ScoreRow { name, meaning: "", unit: "m", kind, scatters, values, less_is_better: Some(true), decimals: None }
    };
    assert_eq!(
        [row([0.12, 0.11]), row([0.11, 0.12]), row([0.11, 0.110_000_1])].map(|row| row.best()),
        [Some(1), Some(0), None]
    );
    assert!(harness.query_all_by_label_contains(&rms.text(0)).next().is_some());
    let (first_ns, quantity) = harness.state().panel.comparisons[1].first_notable().unwrap();
    let time = format!("{} s", crate::gui::units::seconds(first_ns));
    let label = format!("First notable divergence of classical from auto: {time}");
    assert!(harness.query_by_label(&format!("First notable divergence: {} at", quantity.name())).is_some());
    harness.get_by_label(&label).click();
    harness.run_steps(2);
    assert_eq!(harness.state().commands, [Command::Seek { stamp_ns: first_ns }]);
    // With the other run as reference they diverge at the same frame.
    harness.state_mut().panel.reference = 1;
    harness.run_steps(2);
    assert!(harness.query_by_label("auto vs. classical").is_some());
    assert_eq!(harness.state().panel.comparisons[0].first_notable().map(|(stamp_ns, _)| stamp_ns), Some(first_ns));
    harness.get_by_label("Show run classical in all panels").click();
    harness.run_steps(2);
    assert_eq!(harness.state().selection.run, 1);
}

#[test]
fn a_single_run_and_an_equal_run_are_reported() {
    let mut harness = bench(&["auto"], [900.0, 700.0]);
    for label in ["Accuracy over all processed frames", "position error over time", "Nothing to compare yet"] {
        assert!(harness.query_by_label_contains(label).is_some(), "{label}");
    }
    assert!(harness.query_by_label(AGAINST_BATCH).is_none());
    harness.state_mut().recording.truth_is_batch = true;
    harness.run_steps(2);
    assert!(harness.query_by_label(AGAINST_BATCH).is_some());
    assert!(harness.query_by_label("Add run auto").is_none(), "the run itself is not offered");
    harness.get_by_label("Add run classical").click();
    harness.run_steps(2);
    assert_eq!(harness.state().commands, [Command::AddRun("classical".parse().unwrap())]);
    harness.get_by_label("Fork at the cursor…").click();
    harness.run_steps(1);
    assert_eq!(harness.state().panel.asked, Some(Dialog::Fork));
    let mut twin = harness.state().recording.runs[0].clone();
    (twin.id, twin.spec.label) = (u64::MAX, "twin".to_owned());
    harness.state_mut().recording.runs.push(twin);
    harness.run_steps(2);
    harness.get_by_label("Numbers").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("identical in all common frames").is_some());
}

#[test]
fn every_view_is_complete_and_differences_seek() {
    let mut harness = bench(&["auto", "classical"], [1500.0, 900.0]);
    for label in ["Accuracy over all processed frames", "Difference in position over time", "classical vs. auto"] {
        assert!(harness.query_by_label(label).is_some(), "{label} in the view of all");
    }
    assert_eq!(harness.query_all_by_label("Landmarks").count(), 2, "a scene for each run");
    for (view, label, count) in [
        ("Differences", "Difference in informed rank over time", 1),
        ("Images", "Before", 1),
        ("Scenes", "Landmarks", 2),
        ("Directions", "structural rank", 1),
    ] {
        harness.get_by_label(view).click();
        harness.run_steps(3);
        assert_eq!(harness.query_all_by_label(label).count(), count, "{label}");
    }
    harness.get_by_label("Differences").click();
    harness.run_steps(2);
    let plot = harness.get_by_label("Difference in position over time").rect();
    harness.state_mut().commands.clear();
    let at = plot.center();
    harness.event(egui::Event::PointerMoved(at));
    for pressed in [true, false] {
        let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
        harness.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
    }
    harness.run_steps(2);
    let Some(Command::Seek { stamp_ns }) = harness.state().commands.last() else { panic!("no seek") };
    let middle_ns = harness.state().recording.duration_ns / 2;
    assert!((stamp_ns - middle_ns).abs() < middle_ns / 20);
}

#[test]
fn sides_of_the_solve_and_selection_are_shared_by_all_images() {
    use crate::gui::image_panel::SolveSide;
    let mut harness = bench(&["auto", "classical"], [1200.0, 700.0]);
    harness.get_by_label("Images").click();
    harness.run_steps(3);
    let sides = |harness: &Harness<'static, Bench>| -> Vec<SolveSide> {
        harness.state().panel.images.panels.iter().map(|panel| panel.options.side).collect()
    };
    assert_eq!(sides(&harness), [SolveSide::After; 2]);
    harness.get_by_label("Before").click();
    harness.run_steps(4);
    assert_eq!(sides(&harness), [SolveSide::Before; 2], "the options are those of all images");
    let at = harness.state().cursor_ns;
    assert_eq!(harness.state().panel.comparisons[1].at(ComparedQuantity::Tracks, at), Some(0.0));
}

/// A trajectory of another program: the first run's trajectory in another world, alternately 5 cm too high and too low.
fn with_trajectory(recording: &mut Recording) {
    use nalgebra::{UnitQuaternion, Vector3};

    use crate::geometry::RigidTransform;
    use crate::sensors::{PoseSample, PoseTrack};
    use crate::session::TrajectoryLane;

    let world =
        RigidTransform::new(UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.8), Vector3::new(20.0, -4.0, 1.0));
    let steps = &recording.runs[0].steps;
    let samples = steps.iter().enumerate().filter_map(|(number, step)| {
        let mut pose = step.ground_truth?;
        pose.translation_m.z += if number % 2 == 0 { 0.05 } else { -0.05 };
        Some(PoseSample { stamp_ns: step.report.stamp_ns, world_from_imu: world * pose })
    });
    let actual = steps
        .iter()
        .filter_map(|step| Some(PoseSample { stamp_ns: step.report.stamp_ns, world_from_imu: step.ground_truth? }));
    let (track, actual) = (PoseTrack::new(samples.collect()), PoseTrack::new(actual.collect()));
    let lane = TrajectoryLane::new("VINS".into(), "vins.csv".into(), track, Some(&actual));
    recording.trajectories = vec![std::sync::Arc::new(lane)];
}

#[test]
fn a_trajectory_stands_beside_a_single_run() {
    let mut harness = bench(&["auto"], [1500.0, 900.0]);
    with_trajectory(&mut harness.state_mut().recording);
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("Nothing to compare yet").is_none());
    let rows = harness.state().panel.scores.rows();
    let value = |name: &str| rows.iter().find(|row| row.name == name).unwrap().values[1];
    assert!((value("ATE RMS").unwrap() - 0.05).abs() < 1e-3);
    assert!(value("restarts").is_none() && value("calibration columns").is_none());
    for label in ["VINS", "VINS vs. auto", "Difference in position over time"] {
        assert!(harness.query_by_label(label).is_some(), "{label}");
    }
    let comparison = &harness.state().panel.comparisons[1];
    assert!(comparison.column(ComparedQuantity::Position).iter().any(|apart| apart.is_finite()));
    assert!(comparison.column(ComparedQuantity::RankInformed).iter().all(|apart| apart.is_nan()));
    for view in ["Numbers", "Differences", "Images", "Scenes", "Directions"] {
        harness.get_by_label(view).click();
        harness.run_steps(3);
    }
}
