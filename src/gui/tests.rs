#[path = "../gimbal/tests/named.rs"]
mod named;

pub(crate) use self::named::parameter;
use super::theme::Theme;
use super::{ImageSource, PanelContext, Playback, Presentation, Selection};
use crate::gui::samples::{first_tracked_frame, sample_images, sample_recording};
use crate::session::Recording;

#[test]
fn the_sample_is_consistent() {
    let recording = sample_recording();
    assert_eq!(recording.runs.len(), 2);
    let run = &recording.runs[0];
    let step = run.step_at(recording.duration_ns).expect("the sample has steps");
    let newest = step.report.newest().expect("it tracks by then");
    assert!(step.report.features.len() > 60, "{} features", step.report.features.len());
    assert_eq!(newest.frame_index, step.report.frame_index);
    assert!(run.steps[first_tracked_frame() - 1].report.newest().is_none());
    // The aligned estimate is near the ground truth.
    let aligned = run.alignment.expect("aligned") * newest.world_from_imu;
    let error_m = (aligned.translation_m - step.ground_truth.expect("truth").translation_m).norm();
    assert!(error_m < 1.0, "{error_m} m off");
    let image = sample_images().image("cam0", step.report.frame_index).ready().expect("an image");
    assert_eq!(image.pixels.len(), image.width * image.height);
}

/// Stores a screenshot for inspection in the folder of the environment variable `DCVINS_SCREENSHOTS`.
pub(crate) fn keep_screenshot(name: &str, screenshot: &image::RgbaImage) {
    if let Some(folder) = std::env::var_os("DCVINS_SCREENSHOTS") {
        screenshot.save(std::path::Path::new(&folder).join(format!("{name}.png"))).unwrap();
    }
}

/// Calls a function with a panel context without playback; commands are dropped.
pub(crate) fn with_context(
    recording: &Recording,
    cursor_ns: i64,
    images: &mut dyn ImageSource,
    selection: &mut Selection,
    theme: &Theme,
    show: impl FnOnce(&mut PanelContext<'_>),
) {
    let (playback, mut commands) = (Playback::default(), Vec::new());
    let commands = &mut commands;
    let presentation = Presentation::Interactive;
    let playback = &playback;
    show(&mut PanelContext { recording, cursor_ns, playback, images, selection, theme, presentation, commands });
}
