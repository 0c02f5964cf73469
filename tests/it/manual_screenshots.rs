//! Screenshots of the documents: every panel, every layout, the dialogs and the welcome view, drawn from the sample log
//! and compared with `docs/images` byte for byte.
//!
//! `UPDATE_SCREENSHOTS=1 cargo test --release --test it manual_screenshots` redraws them; see `docs/images/README.md`.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, LazyLock};

use dcvins::export::{ScreenshotOptions, draw_panel, draw_study_panel, read_motion};
use dcvins::flight_log::ImageReader;
use dcvins::geometry::ns_from_seconds;
use dcvins::gui::app::{App, OpenFailure, OpenLog};
use dcvins::gui::desktop::{Desktop, FigureExport, PanelExport, PathEntry, SampleProgress};
use dcvins::gui::rendering::headless::{self, Headless, HeadlessOptions};
use dcvins::gui::study::{StudyOptions, StudyPanel};
use dcvins::gui::theme::{Theme, ThemeName};
use dcvins::gui::window::{MainWindow, Preset, window_ui};
use dcvins::gui::{Dialog, PanelContext, PanelName, Playback, Presentation, Selection};
use dcvins::painting::painter::Painter;
use dcvins::session::breakpoints::Breakpoints;
use dcvins::session::{self, Recording, SessionPlan, SessionRequest};
use dcvins::simulation::{MotionSplines, PrescribedMotion};
use dcvins::study::view::Study;
use dcvins::text::Named as _;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, Rgba, RgbaImage};
use rayon::prelude::*;

use crate::study_sample;

/// Cursor of all screenshots in seconds: the vehicle is in flight, and some directions are uninformed.
const AT_S: f64 = 6.0;
/// Runs of all screenshots.
const RUNS: [&str; 2] = ["auto", "classical"];
/// Conditions in the screenshot of the breakpoints.
const BREAKPOINTS: [&str; 3] = ["rank_informed < 12", "sigma(roll.alpha) < 0.5deg", "event(outliers)"];
/// Maximum total size of all screenshots, in bytes.
const MOST_BYTES: u64 = 3_400_000;
/// Environment variable with which the test replaces the screenshots.
const UPDATE: &str = "UPDATE_SCREENSHOTS";
/// Colour that marks different pixels.
const DIFFERENT: Rgba<u8> = Rgba([255, 0, 255, 255]);

/// Content of a screenshot.
#[derive(Clone, Copy, Debug)]
enum Subject {
    Panel(PanelName),
    /// Planned motion in the laboratory.
    PlannedMotion,
    Layout(Preset),
    Dialog(Dialog),
    Shortcuts,
    Welcome,
    /// Panel of a study; `None` for the whole view.
    Study(Option<StudyPanel>),
}

fn subjects() -> Vec<Subject> {
    let dialogs = [Dialog::AddRun, Dialog::Fork, Dialog::Palette, Dialog::Settings];
    let panels = PanelName::all().map(Subject::Panel);
    let layouts = Preset::all().map(Subject::Layout);
    let dialogs = dialogs.into_iter().map(Subject::Dialog);
    let study = StudyPanel::all().map(Some).chain([None]).map(Subject::Study);
    let others = [Subject::PlannedMotion, Subject::Shortcuts, Subject::Welcome];
    panels.chain(layouts).chain(dialogs).chain(others).chain(study).collect()
}

impl Subject {
    /// File name of the screenshot.
    fn file(self) -> String {
        let name = |kind: &str, name: &str| format!("{kind}-{}.png", name.to_lowercase().replace(' ', "-"));
        match self {
            Self::Panel(panel) => name("panel", panel.name()),
            Self::PlannedMotion => "planned-motion.png".to_owned(),
            Self::Layout(preset) => name("layout", preset.name()),
            Self::Dialog(dialog) => name("dialog", &format!("{dialog:?}")),
            Self::Shortcuts => name("dialog", "shortcuts"),
            Self::Welcome => "welcome.png".to_owned(),
            Self::Study(panel) => name("study", panel.map_or("all", StudyPanel::name)),
        }
    }

    fn size_px(self) -> [u32; 2] {
        match self {
            Self::Panel(PanelName::Scene) => [800, 500],
            Self::Panel(PanelName::Calibration) => [1200, 420],
            Self::Panel(PanelName::Convergence) => [1200, 480],
            Self::Panel(PanelName::Rank) => [480, 860],
            Self::Panel(PanelName::Jacobian) => [900, 560],
            Self::Panel(PanelName::Image) => [500, 420],
            Self::Panel(PanelName::Residuals) => [1100, 480],
            Self::Panel(PanelName::Inspector) => [440, 480],
            Self::Panel(PanelName::Laboratory) => [1100, 760],
            Self::PlannedMotion => [1100, 600],
            Self::Panel(PanelName::Comparison) => [1200, 800],
            Self::Panel(PanelName::Breakpoints) => [480, 160],
            Self::Panel(PanelName::Timeline) => [1200, 210],
            Self::Layout(_) | Self::Dialog(_) | Self::Shortcuts | Self::Study(None) => [1366, 768],
            Self::Welcome => [1000, 640],
            Self::Study(Some(StudyPanel::Runs | StudyPanel::Parallel)) => [900, 400],
            Self::Study(Some(_)) => [760, 320],
        }
    }

    fn draw(self, sample: &Sample) -> RgbaImage {
        let Sample { plan, recording, playback } = sample;
        let (cursor_ns, mut images) = (ns_from_seconds(AT_S), ImageReader::new(Arc::clone(&plan.log), &plan.rig));
        let size_px = self.size_px();
        let options = HeadlessOptions { size_px, pixels_per_point: 1.0, theme: ThemeName::Light };
        let mut panel = |name: &str, options: ScreenshotOptions| {
            // The manual describes the panels of the window, with their toolbars.
            let options = ScreenshotOptions { size_px, presentation: Presentation::Interactive, ..options };
            draw_panel(name, recording, cursor_ns, &mut images, &options).expect("the screenshot is drawn")
        };
        match self {
            Self::Panel(name @ PanelName::Breakpoints) => {
                panel(name.name(), ScreenshotOptions { playback: playback.clone(), ..Default::default() })
            }
            Self::Panel(name) => panel(name.name(), ScreenshotOptions::default()),
            Self::PlannedMotion => {
                let motion = read_motion(&root().join("tests/data/planned_motion.csv")).expect("the motion is read");
                let options = ScreenshotOptions { motion: Some(motion), ..Default::default() };
                panel(PanelName::Laboratory.name(), options)
            }
            Self::Layout(layout) => panel("all", ScreenshotOptions { layout, ..Default::default() }),
            Self::Dialog(_) | Self::Shortcuts => {
                let (mut state, mut selection) = (MainWindow::default(), Selection::default());
                match self {
                    Self::Dialog(dialog) => state.dialogs.show(dialog),
                    _ => state.dialogs.shortcuts_open = true,
                }
                let theme = Theme::of(options.theme);
                let mut headless = Headless::new(options);
                let Ok(window) = headless.screenshot(&mut Painter::new(), |ui| {
                    let context = &mut PanelContext {
                        recording,
                        cursor_ns,
                        playback: &Playback::default(),
                        images: &mut images,
                        selection: &mut selection,
                        theme: &theme,
                        presentation: Presentation::Interactive,
                        commands: &mut Vec::new(),
                    };
                    window_ui(ui, &mut state, context);
                });
                cut_to_dialog(&window, headless.context())
            }
            Self::Welcome => {
                let open: OpenLog =
                    Arc::new(|request, _| Err(OpenFailure::Problem(format!("{} is not opened here", request.names()))));
                let mut app = App::new(open, Arc::new(Paper), options.theme);
                headless::draw(options, |ui| app.ui(ui))
            }
            Self::Study(panel) => {
                let options = ScreenshotOptions {
                    size_px,
                    presentation: Presentation::Interactive,
                    ..ScreenshotOptions::default()
                };
                let [runs, parameters] = study_sample::tables(study_sample::SEEDS);
                let study = Arc::new(Study { name: "gimbal-mounts".to_owned(), runs, parameters });
                let name = panel.map_or("all", StudyPanel::name);
                draw_study_panel(name, &study, &StudyOptions::default(), &options).expect("the screenshot is drawn")
            }
        }
    }
}

/// Crop of a window (one pixel per point) to its dialog.
fn cut_to_dialog(window: &RgbaImage, context: &egui::Context) -> RgbaImage {
    let dialogs = context.memory(|memory| {
        let layers = memory.areas().visible_layer_ids();
        let above = layers.into_iter().filter(|layer| layer.order != egui::Order::Background);
        above.filter_map(|layer| memory.area_rect(layer.id)).fold(egui::Rect::NOTHING, egui::Rect::union)
    });
    let [left, top] = [dialogs.left(), dialogs.top()].map(|side| side.floor().max(0.0) as u32);
    let [right, bottom] = [dialogs.right(), dialogs.bottom()].map(|side| side.ceil() as u32);
    let size = [right.min(window.width()) - left, bottom.min(window.height()) - top];
    image::imageops::crop_imm(window, left, top, size[0], size[1]).to_image()
}

/// Desktop of the screenshots: the same files on every machine, and nothing is written.
struct Paper;

impl Desktop for Paper {
    fn complete(&self, _typed: &str) -> Vec<PathEntry> {
        Vec::new()
    }

    fn pick_log(&self) -> Option<Receiver<Vec<PathBuf>>> {
        None
    }

    fn recent_logs(&self) -> Vec<PathBuf> {
        vec![PathBuf::from("/home/you/flights/yard.mcap")]
    }

    fn remember_log(&self, _path: &Path) {}

    fn sample_logs(&self) -> Vec<PathBuf> {
        vec![PathBuf::from("/usr/share/dcvins/sample_logs/garden.mcap")]
    }

    fn kept_layouts(&self) -> Option<String> {
        None
    }

    fn keep_layouts(&self, _text: &str) -> Result<(), String> {
        Ok(())
    }

    fn kept_settings(&self) -> Option<String> {
        None
    }

    fn keep_settings(&self, _text: &str) -> Result<(), String> {
        Ok(())
    }

    fn kept_window(&self) -> Option<String> {
        None
    }

    fn keep_window(&self, _text: &str) -> Result<(), String> {
        Ok(())
    }

    fn write_panel(&self, _export: &PanelExport) -> Result<Vec<PathBuf>, String> {
        Ok(Vec::new())
    }

    fn write_figure(&self, export: &FigureExport) -> Result<PathBuf, String> {
        Ok(PathBuf::from(&export.path))
    }

    fn start_report(&self, name: &str, _arguments: &[String]) -> Result<Receiver<Result<PathBuf, String>>, String> {
        Err(format!("no report on {name}"))
    }

    fn write_session(&self, name: &str, _text: &str) -> Result<PathBuf, String> {
        Ok(PathBuf::from(name))
    }

    fn write_rig(&self, path: &Path, _text: &str) -> Result<PathBuf, String> {
        Ok(path.to_path_buf())
    }

    fn write_motion(&self, path: &Path, _motion: &MotionSplines, _joints: &[String]) -> Result<PathBuf, String> {
        Ok(path.to_path_buf())
    }

    fn read_motion(&self, path: &Path) -> Result<PrescribedMotion, String> {
        Err(format!("no motion in {}", path.display()))
    }

    fn sample_folder(&self) -> &Path {
        Path::new("/home/you/.local/share/dcvins")
    }

    fn make_sample(&self) -> Result<Receiver<SampleProgress>, String> {
        Err("the machine of the screenshots has no disk".to_owned())
    }

    fn resident_bytes(&self) -> Option<u64> {
        None
    }
}

/// Data of all screenshots.
struct Sample {
    plan: SessionPlan,
    recording: Recording,
    /// With breakpoints.
    playback: Playback,
}

/// Sample log, computed once.
fn sample() -> Sample {
    let specs = RUNS.map(|spec| spec.parse().expect("the specifications of tests are valid"));
    let log_path = root().join("sample_logs/garden.mcap");
    let request = SessionRequest { log_path, specs: specs.into(), ..SessionRequest::default() };
    let plan = SessionPlan::open(&request).expect("the sample log opens");
    let computation = session::compute(&plan, &mut |_| {});
    let recording = computation.expect("the sample log is computed").into_recording();
    let mut breakpoints = Breakpoints::default();
    for condition in BREAKPOINTS {
        breakpoints.add(condition.parse().expect("the conditions of tests are valid"));
    }
    breakpoints.read(&recording);
    let playback = Playback { breakpoints: Arc::new(breakpoints), ..Playback::default() };
    Sample { plan, recording, playback }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Folder of the screenshots, part of the repository.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| root().join("docs/images"));

/// Names of the PNG files in the folder of the screenshots.
fn committed() -> BTreeSet<String> {
    let entries = fs::read_dir(&*FOLDER).expect("the folder can be listed");
    let paths = entries.map(|entry| entry.expect("the entry can be read").path());
    let screenshots = paths.filter(|path| path.extension().is_some_and(|extension| extension == "png"));
    screenshots.filter_map(|path| path.file_name().map(|name| name.to_string_lossy().into_owned())).collect()
}

/// Screenshot as a PNG, optimized for size: large areas of one colour compress best without filters.
fn encoded(screenshot: &RgbaImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::NoFilter);
    // Screenshots are opaque.
    let opaque = DynamicImage::from(screenshot.clone()).to_rgb8();
    opaque.write_with_encoder(encoder).expect("the screenshot is encoded");
    bytes
}

/// Difference between two images of one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Difference {
    pixels: usize,
    /// Left, top, right and bottom of the smallest rectangle around the different pixels, last row and column included.
    bounds: [u32; 4],
}

impl Difference {
    /// `None` for equal images.
    fn between(expected: &RgbaImage, actual: &RgbaImage) -> Option<Self> {
        let mut found: Option<Self> = None;
        for ((x, y, expected), actual) in expected.enumerate_pixels().zip(actual.pixels()) {
            if expected == actual {
                continue;
            }
            let Self { pixels, bounds: [left, top, right, bottom] } =
                found.unwrap_or(Self { pixels: 0, bounds: [x, y, x, y] });
            let bounds = [left.min(x), top.min(y), right.max(x), bottom.max(y)];
            found = Some(Self { pixels: pixels + 1, bounds });
        }
        found
    }

    /// The expected image, faded, with the different pixels marked.
    fn screenshot(expected: &RgbaImage, actual: &RgbaImage) -> RgbaImage {
        let faded = |channel: u8| 192 + channel / 4;
        RgbaImage::from_fn(expected.width(), expected.height(), |x, y| {
            let Rgba([red, green, blue, _]) = *expected.get_pixel(x, y);
            if expected.get_pixel(x, y) == actual.get_pixel(x, y) {
                Rgba([faded(red), faded(green), faded(blue), 255])
            } else {
                DIFFERENT
            }
        })
    }
}

/// Compares an image with the file of its name in `folder`; the error describes the difference. If they differ, the new
/// image and the differences are written to `kept`.
fn compare(name: &str, actual: &RgbaImage, [folder, kept]: [&Path; 2]) -> Result<(), String> {
    let bytes = encoded(actual);
    let committed = fs::read(folder.join(name)).unwrap_or_default();
    if committed == bytes {
        return Ok(());
    }
    fs::create_dir_all(kept).expect("the folder of the build can be written");
    fs::write(kept.join(name), bytes).expect("the folder of the build can be written");
    if committed.is_empty() {
        return Err("missing".to_owned());
    }
    let expected = match image::load_from_memory(&committed) {
        Ok(expected) => expected.to_rgba8(),
        Err(error) => return Err(format!("cannot be decoded: {error}")),
    };
    let ((width, height), now) = (expected.dimensions(), actual.dimensions());
    if (width, height) != now {
        return Err(format!("has {width}×{height} pixels, drawn anew {}×{}", now.0, now.1));
    }
    let Some(Difference { pixels, bounds: [left, top, right, bottom] }) = Difference::between(&expected, actual) else {
        return Err("has the same pixels and another encoding".to_owned());
    };
    let file = kept.join(name.replace(".png", ".difference.png"));
    Difference::screenshot(&expected, actual).save(file).expect("the folder of the build can be written");
    let total = width * height;
    Err(format!("{pixels} of {total} pixels differ, between ({left}, {top}) and ({right}, {bottom})"))
}

#[test]
fn screenshots_of_the_documents_are_those_of_the_program() {
    let sample = sample();
    let update = std::env::var_os(UPDATE).is_some_and(|value| !value.is_empty());
    let kept = Path::new(env!("CARGO_TARGET_TMPDIR")).join("screenshots");
    let subjects = subjects();
    let differences: Vec<String> = subjects
        .par_iter()
        .filter_map(|subject| {
            let (name, screenshot) = (subject.file(), subject.draw(&sample));
            if update {
                fs::write(FOLDER.join(name), encoded(&screenshot)).expect("docs/images can be written");
                return None;
            }
            compare(&name, &screenshot, [&FOLDER, &kept]).err().map(|difference| format!("{name}: {difference}"))
        })
        .collect();
    let drawn: BTreeSet<String> = subjects.iter().map(|subject| subject.file()).collect();
    let mut text = String::new();
    for difference in &differences {
        writeln!(text, "  {difference}").expect("a string can be written");
    }
    for stale in committed().difference(&drawn) {
        writeln!(text, "  {stale}: no screenshot has this name, delete the file").expect("a string can be written");
    }
    assert!(
        text.is_empty(),
        "screenshots in docs/images differ from what the program draws:\n{text}\
         new screenshots and differences: {}\n\
         if the change is meant: {UPDATE}=1 cargo test --release --test it manual_screenshots",
        kept.display()
    );
}

#[test]
fn screenshots_are_small_and_every_one_is_in_a_document() {
    let mut documents = fs::read_to_string(root().join("README.md")).unwrap();
    documents += &fs::read_to_string(root().join("docs/manual.md")).unwrap();
    let names = committed();
    let unused: Vec<&String> = names.iter().filter(|name| !documents.contains(&format!("images/{name})"))).collect();
    assert!(unused.is_empty(), "in no document: {unused:?}");
    let bytes: u64 = names.iter().map(|name| fs::metadata(FOLDER.join(name)).unwrap().len()).sum();
    assert!(bytes <= MOST_BYTES, "the screenshots have {bytes} bytes together, more than {MOST_BYTES}");
}

#[test]
fn differences_are_counted_and_located() {
    let screenshot = RgbaImage::from_fn(40, 30, |x, y| Rgba([x as u8, y as u8, 7, 255]));
    let check = |changed: &[[u32; 2]], expected: Option<Difference>| {
        let mut other = screenshot.clone();
        for [x, y] in changed {
            other.get_pixel_mut(*x, *y).0[2] = 8;
        }
        assert_eq!(Difference::between(&screenshot, &other), expected, "{changed:?}");
        let marked = Difference::screenshot(&screenshot, &other);
        let count = marked.pixels().filter(|pixel| **pixel == DIFFERENT).count();
        assert_eq!(count, changed.len());
    };
    check(&[], None);
    check(&[[39, 0]], Some(Difference { pixels: 1, bounds: [39, 0, 39, 0] }));
    check(&[[12, 9], [3, 20], [4, 4]], Some(Difference { pixels: 3, bounds: [3, 4, 12, 20] }));
}

#[test]
fn files_are_compared_byte_for_byte() {
    let (folder, kept) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let screenshot = RgbaImage::from_fn(40, 30, |x, y| Rgba([x as u8, y as u8, 7, 255]));
    let check = |expected: Result<(), &str>| {
        let found = compare("a.png", &screenshot, [folder.path(), kept.path()]);
        assert_eq!(found, expected.map_err(str::to_owned));
    };
    check(Err("missing"));
    assert_eq!(fs::read(kept.path().join("a.png")).unwrap(), encoded(&screenshot));
    let write = |other: &RgbaImage| fs::write(folder.path().join("a.png"), encoded(other)).unwrap();
    write(&screenshot);
    check(Ok(()));
    let mut changed = screenshot.clone();
    changed.put_pixel(5, 6, DIFFERENT);
    write(&changed);
    check(Err("1 of 1200 pixels differ, between (5, 6) and (5, 6)"));
    let marked = image::open(kept.path().join("a.difference.png")).unwrap().to_rgba8();
    assert_eq!(*marked.get_pixel(5, 6), DIFFERENT);
    write(&RgbaImage::new(30, 40));
    check(Err("has 30×40 pixels, drawn anew 40×30"));
    screenshot.save(folder.path().join("a.png")).unwrap();
    check(Err("has the same pixels and another encoding"));
    fs::write(folder.path().join("a.png"), "text").unwrap();
    assert!(compare("a.png", &screenshot, [folder.path(), kept.path()]).unwrap_err().starts_with("cannot be decoded"));
}
