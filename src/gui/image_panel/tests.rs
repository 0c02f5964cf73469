use std::sync::Arc;

use egui_kittest::Harness;
use egui_kittest::kittest::{AccessKitNode, Queryable as _};
use nalgebra::{Vector2, Vector3};

use super::ImagePanel;
use super::model::{ImageModel, SolveSide, description};
use super::paint::{ImagePlacement, tint};
use crate::estimator::{FeatureReport, FurtherCameraEstimate};
use crate::frontend::TrackedFrame;
use crate::geometry::RigidTransform;
use crate::gui::rendering::headless::{HeadlessOptions, draw};
use crate::gui::samples::{FRAME_PERIOD_NS, first_tracked_frame, sample_images, sample_recording_of};
use crate::gui::tests::{keep_screenshot, with_context};
use crate::gui::theme::{Theme, ThemeName};
use crate::gui::{CsvTable as _, ImageSource, Panel as _, Selection, ShownCameras};
use crate::sensors::{CameraMask, CameraMount, CameraRig, ChainPrior, GrayImage, ImageMask};
use crate::session::{FrameImage, Recording, StepImage, StepRecord};

/// A recording of 80 frames with tracking in the last one.
fn recording() -> Recording {
    sample_recording_of(80, &["auto"])
}

fn show(ui: &mut egui::Ui, panel: &mut ImagePanel, recording: &Recording, cursor_ns: i64, selection: &mut Selection) {
    let theme = Theme::of(ThemeName::Dark);
    theme.apply(ui.ctx());
    with_context(recording, cursor_ns, &mut sample_images(), selection, &theme, |context| panel.ui(ui, context));
}

#[test]
fn the_caption_is_that_of_the_step_at_or_before_the_cursor() {
    let recording = recording();
    let model = ImageModel::at(&recording.rig, &recording.runs[0], 0, 70 * FRAME_PERIOD_NS + 30_000_000).unwrap();
    assert_eq!(model.image_index, 70);
    let step = &recording.runs[0].steps[70];
    let statistics = step.tracks.statistics;
    let rejected = statistics.rejected + step.report.features.iter().filter(|feature| feature.rejected).count();
    let slides = |feature: &&FeatureReport| feature.slides() && !feature.rejected;
    let sliding = step.report.features.iter().filter(slides).count();
    let expected = format!(
        "frame 70 · 3.500 s · reprojection RMS {:.2} px · tracked {} · before the solve {:.2} px · median {:.2} px · \
         new {} · lost {} · rejected {rejected} · sliding {sliding}",
        step.report.reprojection_rms_after_px,
        statistics.tracked,
        step.report.reprojection_rms_before_px,
        step.report.reprojection_median_after_px,
        statistics.detected,
        statistics.lost,
    );
    assert_eq!(model.caption(), expected);
    assert_eq!(model.fitting_caption(|_| true), expected);
    let short = model.fitting_caption(|text| text.chars().count() < 60);
    assert!(expected.starts_with(&short) && short.contains("RMS") && short.chars().count() < 60, "{short}");
    assert_eq!(model.fitting_caption(|_| false), "frame 70");
    let waiting =
        ImageModel::at(&recording.rig, &recording.runs[0], 0, (first_tracked_frame() as i64 - 1) * FRAME_PERIOD_NS)
            .unwrap();
    assert!(waiting.caption().contains(" · initializing · "), "{}", waiting.caption());
    assert!(ImageModel::at(&recording.rig, &recording.runs[0], 0, -1).is_none());
}

#[test]
fn marks_have_the_values_of_the_report() {
    let recording = recording();
    let is_rejected = |step: &&Arc<StepRecord>| {
        let followed = |id| step.track(id).is_some();
        step.report.features.iter().any(|feature| feature.rejected && followed(feature.id))
    };
    let step = recording.runs[0].steps.iter().rfind(is_rejected).expect("the estimator rejects outliers");
    let model = ImageModel::at(&recording.rig, &recording.runs[0], 0, step.report.stamp_ns).unwrap();
    assert_eq!(model.marks.len(), step.tracks.count);
    let solved = model.marks.iter().filter(|mark| mark.solved.is_some()).count();
    let followed = |id| step.track(id).is_some();
    assert_eq!(solved, step.report.features.iter().filter(|feature| followed(feature.id)).count());
    for mark in &model.marks {
        assert_eq!(mark.trail_px.len(), (mark.age as usize).min(4), "trail of {:?}", mark.id);
        if let Some(earlier) = mark.trail_px.first() {
            assert_eq!(Some(*earlier), step.track(mark.id).unwrap().previous_uv_px);
        }
    }
    let rejected = model.marks.iter().find(|mark| mark.solved.is_some_and(|solved| solved.rejected)).unwrap();
    let text = description(rejected);
    assert!(text.contains(&format!("feature {}", rejected.id.0)) && text.contains("outlier, rejected"), "{text}");
    let sliding = model.marks.iter().find(|mark| mark.solved.is_some_and(|solved| solved.slides)).unwrap();
    assert!(
        sliding.solved.unwrap().observation.unwrap().robust_weight < 0.5 && description(sliding).contains("slides")
    );
    let fresh = model.marks.iter().find(|mark| mark.solved.is_none()).unwrap();
    assert!(description(fresh).contains("not used in the solve"));
}

#[test]
fn pixel_centres_have_integer_coordinates() {
    let rect = egui::Rect::from_min_size(egui::pos2(100.0, 50.0), egui::vec2(1280.0, 960.0));
    let place = ImagePlacement { rect, size_px: [640, 480] };
    assert_eq!(place.position(&Vector2::new(0.0, 0.0)), egui::pos2(101.0, 51.0));
    assert_eq!(place.position(&Vector2::new(-0.5, -0.5)), rect.min);
    assert_eq!(place.position(&Vector2::new(639.5, 479.5)), rect.max);
    assert_eq!(place.scale(), 2.0);
}

#[test]
fn controls_are_found_by_label_and_work() {
    let recording = recording();
    let end_ns = recording.duration_ns;
    let mut harness = Harness::builder().with_size([900.0, 700.0]).build_ui_state(
        move |ui, (panel, selection)| show(ui, panel, &recording, end_ns, selection),
        (ImagePanel::default(), Selection::default()),
    );
    harness.run();
    assert_eq!(harness.state().0.options.side, SolveSide::After);
    harness.get_by_label("Before").click();
    harness.get_by_label("Ids").click();
    harness.get_by_label("Trails").click();
    harness.run();
    let options = harness.state().0.options;
    assert_eq!((options.side, options.ids, options.trails), (SolveSide::Before, true, false));
    harness.get_by_label_contains("frame 79 · 3.950 s");
}

/// The recording with a second camera, a stereo pair with the first, which has an image in every second step only.
fn with_second_camera(mut recording: Recording) -> Recording {
    let rig = Arc::make_mut(&mut recording.rig);
    let first = rig.cameras[0].clone();
    let first_from_camera = RigidTransform { translation_m: Vector3::x() * 0.1, ..RigidTransform::identity() };
    let mount = CameraMount::Static { imu_from_camera: first_from_camera };
    rig.cameras[0].mount = CameraMount::Static { imu_from_camera: RigidTransform::identity() };
    let relative_prior = Some(ChainPrior::RELATIVE);
    let [key, topic] = ["cam1", "/cam1/image"].map(str::to_owned);
    rig.cameras.push(CameraRig { key, mount, first_from_camera, relative_prior, topic, ..first });
    for (number, step) in recording.runs[0].steps.iter_mut().enumerate() {
        let step = Arc::make_mut(step);
        step.report.calibration.further_cameras.push(FurtherCameraEstimate {
            key: "cam1".to_owned(),
            number: 1,
            base: Some("cam0".to_owned()),
            base_from_camera: first_from_camera,
        });
        let mut tracks = (*step.tracks.frame()).clone();
        let further = TrackedFrame { features: tracks.features.split_off(tracks.features.len() / 2), ..tracks.clone() };
        tracks.matched = tracks.features.iter().take(3).copied().collect();
        let has_image = number.is_multiple_of(2);
        step.further_images.push(StepImage {
            index: has_image.then_some(1000 + number),
            tracks: Arc::new(if has_image { further } else { TrackedFrame::default() }).into(),
        });
        step.tracks = Arc::new(tracks).into();
    }
    recording
}

#[test]
fn cameras_of_a_run_are_shown_alone_or_side_by_side() {
    let recording = with_second_camera(recording());
    let end_ns = recording.duration_ns;
    let steps = &recording.runs[0].steps;
    let [last, before] = [&steps[79], &steps[78]];
    assert!(last.image(1).is_none());
    assert_eq!(before.image(1).unwrap().0, 1078);
    let further = &before.further_images[0].tracks.frame().features;
    assert_eq!(before.feature_count(), before.tracks.count + further.len());
    let id = further[0].id.of_camera(1);
    assert_eq!(before.track(id), Some(further[0]));

    // The last image of the camera, with its own features and those that the other camera of the pair tracks.
    let model = ImageModel::at(&recording.rig, &recording.runs[0], 1, end_ns).unwrap();
    assert_eq!((model.image_index, model.camera_key.as_str()), (1078, "cam1"));
    assert!(model.caption().starts_with("cam1 1078 · "), "{}", model.caption());
    let (matched, own): (Vec<_>, Vec<_>) = model.marks.iter().partition(|mark| mark.matched);
    assert_eq!((own.len(), matched.len()), (further.len(), 3));
    assert!(own.iter().all(|mark| mark.id.camera() == 1) && matched.iter().all(|mark| mark.id.camera() == 0));
    assert!(description(matched[0]).contains("other camera of the stereo pair"));

    let table = |cameras| {
        let mut selection = Selection { cameras, ..Selection::default() };
        let theme = Theme::of(ThemeName::Dark);
        let mut table = String::new();
        with_context(&recording, end_ns, &mut sample_images(), &mut selection, &theme, |context| {
            table = ImagePanel::default().csv_table(context);
        });
        table
    };
    let rows = |table: &str, key: &str| table.lines().filter(|line| line.starts_with(&format!("{key},"))).count();
    let all = table(ShownCameras::All);
    assert_eq!([rows(&all, "cam0"), rows(&all, "cam1")], [last.tracks.count, further.len() + 3]);
    assert_eq!(rows(&table(ShownCameras::Main), "cam1"), 0);
    assert_eq!(rows(&table(ShownCameras::of_name("cam1")), "cam0"), 0);

    let shown = recording.clone();
    let mut harness = Harness::builder().with_size([900.0, 700.0]).build_ui_state(
        move |ui, (panel, selection)| show(ui, panel, &shown, end_ns, selection),
        (ImagePanel::default(), Selection::default()),
    );
    harness.run();
    let image =
        |harness: &Harness<'_, _>, key: &str| harness.query_by_label(&format!("Image of {key} of auto")).is_some();
    assert_eq!([image(&harness, "cam0"), image(&harness, "cam1")], [true, false]);
    harness.get_by_label("cam1").click();
    harness.run();
    assert_eq!([image(&harness, "cam0"), image(&harness, "cam1")], [false, true]);
    harness.get_by_label("All").click();
    harness.run();
    assert_eq!([image(&harness, "cam0"), image(&harness, "cam1")], [true, true]);
    let rect = |key: &str| harness.get_by_label(&format!("Image of {key} of auto")).rect();
    assert!(!rect("cam0").intersects(rect("cam1").shrink(1.0)));
    harness.get_by_label("cam0").click();
    harness.run();
    assert_eq!(harness.state().1.cameras, ShownCameras::Main);
}

#[test]
fn a_click_selects_the_feature_under_it() {
    let recording = recording();
    let end_ns = recording.duration_ns;
    let model = ImageModel::at(&recording.rig, &recording.runs[0], 0, end_ns).unwrap();
    let mut harness = Harness::builder().with_size([900.0, 700.0]).build_ui_state(
        move |ui, (panel, selection)| show(ui, panel, &recording, end_ns, selection),
        (ImagePanel::default(), Selection::default()),
    );
    harness.run();
    // The image fills width or height of its area; the position of a feature is found by trying positions.
    let area = harness.ctx.globally_used_rect();
    // The tooltip is also the accessible description of the image.
    let tooltip = |node: &AccessKitNode<'_>| node.description().is_some_and(|text| text.contains("residual after"));
    let mut found = None;
    'search: for row in 0..60 {
        for column in 0..60 {
            let at = area.lerp_inside(egui::vec2(column as f32 / 59.0, 0.1 + 0.7 * row as f32 / 59.0));
            harness.hover_at(at);
            harness.step();
            if harness.query_by(tooltip).is_some() {
                found = Some(at);
                break 'search;
            }
        }
    }
    let at = found.expect("some place shows a feature's description");
    harness.drag_at(at);
    harness.drop_at(at);
    harness.run();
    let selected = harness.state().1.feature.expect("the click selected it");
    assert!(model.marks.iter().any(|mark| mark.id == selected));
}

#[test]
fn missing_runs_frames_and_images_are_reported() {
    struct NoImages;
    impl ImageSource for NoImages {
        fn image(&mut self, _: &str, _: usize) -> FrameImage {
            FrameImage::Missing
        }
    }
    let check = |recording: &Recording, run: usize, cursor_ns: i64, expected: &str| {
        let recording = recording.clone();
        let mut harness = Harness::builder().with_size([700.0, 500.0]).build_ui(move |ui| {
            let theme = Theme::of(ThemeName::Light);
            let mut selection = Selection { run, ..Selection::default() };
            with_context(&recording, cursor_ns, &mut NoImages, &mut selection, &theme, |context| {
                ImagePanel::default().ui(ui, context);
            });
        });
        harness.run();
        harness.get_by_label_contains(expected);
    };
    let recording = recording();
    check(&Recording { runs: Vec::new(), ..recording.clone() }, 0, 0, "No runs");
    check(&recording, 0, -1, "No image at or before the cursor");
    check(&recording, 0, i64::MAX, "frame 79");
    // A selection beyond the last run shows the last run.
    check(&recording, 7, i64::MAX, "frame 79");
}

#[test]
fn screenshots_repeat_and_show_the_image() {
    let recording = recording();
    let options = HeadlessOptions { size_px: [900, 760], pixels_per_point: 1.0, theme: ThemeName::Dark };
    let screenshot = |cursor_ns| {
        let mut panel = ImagePanel::default();
        draw(options, |ui| show(ui, &mut panel, &recording, cursor_ns, &mut Selection::default()))
    };
    let late = screenshot(recording.duration_ns);
    keep_screenshot("image", &late);
    assert!(late == screenshot(recording.duration_ns));
    assert!(late != screenshot(60 * FRAME_PERIOD_NS));
}

#[test]
fn a_mask_is_tinted_and_can_be_hidden() {
    let mut recording = recording();
    let rig = Arc::make_mut(&mut recording.rig);
    let [width, height] = rig.cameras[0].model.resolution_px;
    let pixels = (0..width * height).map(|index| if index % width < width / 2 { 255 } else { 0 }).collect();
    let image = ImageMask::from_image(&GrayImage { width, height, pixels });
    rig.cameras[0].mask = Some(CameraMask { file: "cam0.mask.png".to_owned(), image: image.clone() });
    let end_ns = recording.duration_ns;
    let mut harness = Harness::builder().with_size([900.0, 700.0]).build_ui_state(
        move |ui, (panel, selection)| show(ui, panel, &recording, end_ns, selection),
        (ImagePanel::default(), Selection::default()),
    );
    harness.run();
    assert!(harness.state().0.options.mask);
    harness.get_by_label("Mask").click();
    harness.run();
    assert!(!harness.state().0.options.mask);

    let mut tinted = egui::ColorImage::from_gray([width, height], &vec![90; width * height]);
    let plain = tinted.clone();
    tint(&mut tinted, &image);
    for (index, (pixel, before)) in tinted.pixels.iter().zip(&plain.pixels).enumerate() {
        assert_eq!(pixel == before, !image.is_masked(index % width, index / width));
        assert!(pixel == before || pixel.r() > pixel.b());
    }
}

#[test]
fn a_moved_chain_belongs_to_its_run_only() {
    use crate::observability::{SlideDirection, SlidePosition};

    let recording = sample_recording_of(80, &["auto", "classical"]);
    let slide = Some(SlidePosition { direction: SlideDirection::Measured(0), amount: 0.5 });
    let mut selection = Selection { slide, ..Selection::default() };
    let theme = Theme::of(ThemeName::Dark);
    with_context(&recording, recording.last_stamp_ns(), &mut sample_images(), &mut selection, &theme, |context| {
        context.move_chain();
        let stamp_ns = recording.runs[0].steps.last().unwrap().report.stamp_ns;
        assert!(context.moved_chain(stamp_ns).is_some());
        // The other run has a step with the same stamp.
        context.selection.run = 1;
        assert_eq!(recording.runs[1].steps.last().unwrap().report.stamp_ns, stamp_ns);
        assert!(context.moved_chain(stamp_ns).is_none());
    });
}
