//! What one picture of the whole window costs on the CPU: laying it out, and painting it.
//!
//! `cargo bench --bench window` plays the sample log at 1920×1080 with two runs, the cursor moving one frame per picture.
//! Another log is named with `WINDOW_BENCH_LOG`.

use std::path::PathBuf;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use dcvins::flight_log::ImageReader;
use dcvins::gui::headless::{Frame, Headless, HeadlessOptions};
use dcvins::gui::painter::Painter;
use dcvins::gui::theme::{Theme, ThemeName};
use dcvins::gui::window::{WindowState, window_ui};
use dcvins::gui::{PanelContext, Playback, Selection};
use dcvins::session::{self, Recording, SessionPlan, SessionRequest};

const OPTIONS: HeadlessOptions =
    HeadlessOptions { size_px: [1920, 1080], pixels_per_point: 1.0, theme: ThemeName::Dark };

/// A window that plays a recording round and round.
struct Player {
    recording: Recording,
    images: ImageReader,
    headless: Headless,
    painter: Painter,
    state: WindowState,
    selection: Selection,
    /// Cursors of the pictures, and which comes next.
    stamps_ns: Vec<i64>,
    next: usize,
}

impl Player {
    fn new() -> Self {
        let sample = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("sample_logs/garden.mcap");
        let log_path = std::env::var_os("WINDOW_BENCH_LOG").map_or(sample, PathBuf::from);
        let specs = ["auto", "classical"].map(|name| name.parse().expect("the name of a run")).to_vec();
        let request = SessionRequest { log_path, specs, ..SessionRequest::default() };
        let plan = SessionPlan::open(&request).expect("the log opens");
        let recording = session::compute(&plan, None, &mut |_| {}).expect("the log is computed");
        let images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
        let tracked = recording.runs[0].steps.iter().filter(|step| !step.report.window.is_empty());
        let stamps_ns = tracked.map(|step| step.report.stamp_ns).collect();
        let mut player = Self {
            recording,
            images,
            headless: Headless::new(OPTIONS),
            painter: Painter::new(),
            state: WindowState::default(),
            selection: Selection::default(),
            stamps_ns,
            next: 0,
        };
        for _ in 0..4 {
            player.lay_out();
        }
        player
    }

    /// Lays out the next picture and hands its textures to the painter.
    fn lay_out(&mut self) -> Frame {
        let cursor_ns = self.stamps_ns[self.next % self.stamps_ns.len()];
        self.next += 1;
        let Self { recording, images, headless, state, selection, .. } = self;
        let (theme, playback) = (Theme::of(OPTIONS.theme), Playback::default());
        let mut frame = headless.frame(Vec::new(), |ui| {
            let commands = &mut Vec::new();
            let selection = &mut *selection;
            let images = &mut *images;
            let playback = &playback;
            let theme = &theme;
            let mut context = PanelContext { recording, cursor_ns, playback, images, selection, theme, commands };
            window_ui(ui, state, &mut context);
        });
        self.painter.set_textures(&frame.textures);
        self.painter.free_textures(&frame.textures);
        frame.textures.clear();
        frame
    }

    fn paint(&self, frame: &Frame) -> image::RgbaImage {
        let background = Theme::of(OPTIONS.theme).background;
        self.painter.paint(&frame.primitives, OPTIONS.size_px, OPTIONS.pixels_per_point, background)
    }
}

fn window(criterion: &mut Criterion) {
    let mut player = Player::new();
    let mut group = criterion.benchmark_group("window 1920x1080, all panels");
    group.sample_size(40);
    group.bench_function("lay out", |bencher| bencher.iter(|| player.lay_out()));
    let frame = player.lay_out();
    group.bench_function("paint", |bencher| bencher.iter(|| player.paint(&frame)));
    group.bench_function("whole picture", |bencher| {
        bencher.iter(|| {
            let frame = player.lay_out();
            player.paint(&frame)
        });
    });
    group.finish();
}

criterion_group!(benches, window);
criterion_main!(benches);
