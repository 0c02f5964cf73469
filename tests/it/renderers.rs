//! Screenshots from the CPU painter and from a graphics adapter (also a software Vulkan), compared within a tolerance.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use dcvins::export::{Renderer, ScreenshotError, ScreenshotOptions, draw_panel};
use dcvins::flight_log::ImageReader;
use dcvins::geometry::ns_from_seconds;
use dcvins::gui::rendering::offscreen::{Offscreen, OffscreenError};
use dcvins::gui::theme::ThemeName;
use dcvins::session::{self, SessionPlan, SessionRequest};
use image::RgbaImage;

/// A pixel counts as different if a channel differs by more than this, of 255.
const NOTICEABLE: u8 = 16;
/// Maximum ratio of different pixels: edges of lines, where the sample positions of both differ slightly.
const MOST_DIFFERENT: f64 = 0.005;
/// Largest mean difference of a channel, of 255.
const MOST_MEAN: f64 = 0.25;

/// Difference between two screenshots of one size.
#[derive(Clone, Copy, Debug)]
struct Difference {
    /// Ratio of pixels with a channel that differs by more than [`NOTICEABLE`].
    different: f64,
    /// Mean over all pixels and channels, of 255.
    mean: f64,
}

impl Difference {
    fn between(a: &RgbaImage, b: &RgbaImage) -> Self {
        assert_eq!(a.dimensions(), b.dimensions());
        let (mut different, mut sum) = (0, 0);
        for (a, b) in a.pixels().zip(b.pixels()) {
            let apart = [0, 1, 2].map(|channel| a.0[channel].abs_diff(b.0[channel]));
            different += u64::from(apart.iter().any(|channel| *channel > NOTICEABLE));
            sum += apart.iter().map(|channel| u64::from(*channel)).sum::<u64>();
        }
        let pixels = a.pixels().len() as f64;
        Self { different: different as f64 / pixels, mean: sum as f64 / (3.0 * pixels) }
    }

    fn is_tolerable(&self) -> bool {
        self.different <= MOST_DIFFERENT && self.mean <= MOST_MEAN
    }
}

/// Prints a line immediately, whether or not the test passes.
fn report(text: &str) {
    // Errors are ignored: without standard error there is no output.
    drop(writeln!(std::io::stderr(), "{text}"));
}

fn sample_log() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap")
}

/// Fails without an adapter; run by `cargo test --release --test it -- --ignored renderers`.
#[test]
#[ignore = "needs a Vulkan adapter, for example Mesa's software one (Debian: mesa-vulkan-drivers)"]
fn cpu_and_graphics_adapter_draw_the_same_panels() {
    let adapter = Offscreen::open().unwrap_or_else(|error| panic!("{error}"));
    report(&format!("comparing the CPU's panels with those of {}", adapter.adapter()));
    drop(adapter);
    let request = SessionRequest { log_path: sample_log(), ..SessionRequest::default() };
    let plan = SessionPlan::open(&request).expect("the sample log opens");
    let cursor_ns = ns_from_seconds(5.0);
    let recording = session::compute(&plan, &mut |_| {}).expect("the sample log is computed").into_recording();
    let mut images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
    let mut draw = |panel: &str, renderer, options: ScreenshotOptions| {
        let options = ScreenshotOptions { renderer, ..options };
        draw_panel(panel, &recording, cursor_ns, &mut images, &options).expect("the screenshot is drawn")
    };
    let cases = [
        ("all", ThemeName::Light, [1920, 1080], 1.0),
        ("all", ThemeName::Dark, [1366, 768], 1.0),
        ("image", ThemeName::Dark, [900, 700], 1.5),
        ("scene", ThemeName::Light, [900, 700], 1.0),
        ("convergence", ThemeName::Print, [1400, 500], 2.0),
    ];
    let mut screenshots = Vec::new();
    for (panel, theme, size_px, pixels_per_point) in cases {
        let options = ScreenshotOptions { size_px, pixels_per_point, theme, ..ScreenshotOptions::default() };
        let (cpu, wgpu) = (draw(panel, Renderer::Cpu, options.clone()), draw(panel, Renderer::Wgpu, options));
        let difference = Difference::between(&cpu, &wgpu);
        report(&format!(
            "  {panel} {}×{}: {:.3} % of the pixels off by more than {NOTICEABLE}, mean {:.3} of 255",
            size_px[0],
            size_px[1],
            100.0 * difference.different,
            difference.mean
        ));
        assert!(difference.is_tolerable(), "{panel} at {size_px:?}: {difference:?}");
        screenshots.push(cpu);
    }
    // Check of the measure: it distinguishes a panel from itself shifted by a pixel, and from an empty one.
    let scene = &screenshots[3];
    let shifted = RgbaImage::from_fn(scene.width(), scene.height(), |x, y| *scene.get_pixel(x.saturating_sub(1), y));
    assert!(!Difference::between(scene, &shifted).is_tolerable());
    let empty = RgbaImage::from_pixel(scene.width(), scene.height(), *scene.get_pixel(450, 350));
    assert!(!Difference::between(scene, &empty).is_tolerable());
    // Exceeds the limit of all adapters.
    let options = ScreenshotOptions { size_px: [16_384, 64], renderer: Renderer::Wgpu, ..ScreenshotOptions::default() };
    match draw_panel("rank", &recording, cursor_ns, &mut images, &options) {
        Ok(screenshot) => assert_eq!(screenshot.dimensions(), (16_384, 64)),
        Err(ScreenshotError::Graphics(error @ OffscreenError::TooLarge { .. })) => {
            assert!(error.to_string().contains("use --renderer cpu"), "{error}");
        }
        Err(error) => panic!("{error}"),
    }
}

#[test]
#[cfg_attr(not(target_os = "linux"), ignore = "hides the Vulkan drivers by variables of the Linux loader")]
fn without_an_adapter_the_error_names_the_cpu_renderer() {
    let folder = tempfile::tempdir().unwrap();
    let screenshot = folder.path().join("screenshot.png");
    let mut command = Command::new(env!("CARGO_BIN_EXE_dcvins"));
    command.env("DCVINS_CACHE_DIR", "");
    command.args(["screenshot", "--at", "0.5", "--panel", "timeline", "--renderer", "wgpu", "--size", "320x200", "-o"]);
    command.arg(&screenshot).arg(sample_log());
    // No Vulkan driver can be found.
    command.env("WGPU_BACKEND", "vulkan");
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        command.env(variable, folder.path().join("no-driver.json"));
    }
    let output = command.output().expect("the program starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    let remedy = message.contains("no graphics adapter: ") && message.contains("; use --renderer cpu");
    assert!(remedy && !message.contains("panicked") && !screenshot.exists(), "{message}");
}
