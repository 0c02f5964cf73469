//! Frames of the window over a recording.

use std::sync::Arc;

use dcvins::flight_log::ImageReader;
use dcvins::gui::rendering::headless::{Headless, HeadlessOptions, PaintedFrame};
use dcvins::gui::theme::{Theme, ThemeName};
use dcvins::gui::window::{MainWindow, Preset, window_ui};
use dcvins::gui::{PanelContext, Playback, Presentation, Selection};
use dcvins::painting::painter::Painter;
use dcvins::sensors::GrayImage;
use dcvins::session::{Recording, SessionPlan};
use dcvins::text::Named as _;
use egui::{Event, pos2};

use super::Table;
use super::figures::Times;
use super::shared::process::cpu_s;

const OPTIONS: HeadlessOptions =
    HeadlessOptions { size_px: [1920, 1080], pixels_per_point: 1.0, theme: ThemeName::Dark };
/// Number of frames of each preset with a moving cursor.
const PLAYED: usize = 60;
/// Number of frames of each preset with a stationary cursor.
const PAUSED: usize = 30;
/// Number of initial frames until the layout is stable.
const SETTLING: usize = 4;

/// Seconds between two frames: one frame per camera image.
const FRAME_TIME_S: f64 = 0.05;

/// Window without a screen; suggested excitation is computed on a thread, as in the real window.
pub(crate) struct Player {
    images: ImageReader,
    headless: Headless,
    painter: Painter,
    state: MainWindow,
    selection: Selection,
}

impl Player {
    pub(crate) fn new(plan: &SessionPlan) -> Self {
        let mut headless = Headless::new(OPTIONS);
        headless.set_frame_time_s(FRAME_TIME_S);
        let mut state = MainWindow::default();
        state.panels.rank.in_background = true;
        Self {
            images: ImageReader::new(Arc::clone(&plan.log), &plan.rig),
            headless,
            painter: Painter::new(),
            state,
            selection: Selection::default(),
        }
    }

    /// First image of a camera.
    pub(crate) fn first_image(&self, camera_key: &str) -> Option<Arc<GrayImage>> {
        self.images.image(camera_key, 0).ok()
    }

    /// Lays out a frame and passes its textures to the painter.
    fn lay_out(&mut self, recording: &Recording, cursor_ns: i64, events: Vec<Event>) -> PaintedFrame {
        let Self { images, headless, state, selection, .. } = self;
        let (theme, playback) = (Theme::of(OPTIONS.theme), Playback::default());
        let mut frame = headless.frame(events, |ui| {
            let commands = &mut Vec::new();
            let (images, selection) = (&mut *images, &mut *selection);
            let (playback, theme) = (&playback, &theme);
            let mut context = PanelContext {
                recording,
                cursor_ns,
                playback,
                images,
                selection,
                theme,
                commands,
                presentation: Presentation::Interactive,
            };
            window_ui(ui, state, &mut context);
        });
        self.painter.set_textures(&frame.textures);
        self.painter.free_textures(&frame.textures);
        frame.textures.clear();
        frame
    }

    /// Paints a frame and takes the changes that the window passes to the graphics adapter.
    fn paint(&mut self, frame: &PaintedFrame) {
        let background = Theme::of(OPTIONS.theme).background;
        self.painter.update(&frame.chunks, OPTIONS.size_px, OPTIONS.pixels_per_point, background);
        self.painter.changes().for_each(drop);
    }

    /// Draws one frame.
    pub(crate) fn draw(&mut self, recording: &Recording, cursor_ns: i64) {
        let frame = self.lay_out(recording, cursor_ns, Vec::new());
        self.paint(&frame);
    }

    /// Draws one frame and measures the time of its parts.
    fn measured(&mut self, recording: &Recording, cursor_ns: i64, events: Vec<Event>, times: &mut [Times; 3]) {
        let [layout, paint, whole] = times;
        whole.take(|| {
            let frame = layout.take(|| self.lay_out(recording, cursor_ns, events));
            paint.take(|| self.paint(&frame));
        });
    }
}

/// Motion of the pointer to the right over the lanes of the timeline.
fn pointer_over_timeline(number: usize) -> Event {
    let [width, height] = OPTIONS.size_px.map(|side| side as f32);
    Event::PointerMoved(pos2(width * (0.3 + 0.5 * number as f32 / PAUSED as f32), height - 60.0))
}

/// Measures every preset, with the cursor moving through the last part of the recording, and stationary at its end,
/// there also with the pointer moving over the timeline, so that all plots show the values at its time.
pub(crate) fn measure(recording: &Recording, player: &mut Player) -> Table {
    let mut table = Table::new(
        format!(
            "A frame of the window with {} runs at 1920×1080, drawn on the CPU: ms, median / 95 % / largest",
            recording.runs.len()
        ),
        &["preset", "cursor", "layout", "painting", "total", "mean CPU time"],
    );
    let steps = recording.runs.first().map_or(&[][..], |run| &run.steps);
    let stamps_ns: Vec<i64> = steps.iter().map(|step| step.report.stamp_ns).collect();
    let played = &stamps_ns[stamps_ns.len().saturating_sub(PLAYED)..];
    let Some(first_ns) = played.first().copied() else { return table };
    for preset in Preset::all() {
        player.state.tiles.arrange(preset);
        for _ in 0..SETTLING {
            player.draw(recording, first_ns);
        }
        let resting = vec![*played.last().unwrap_or(&first_ns); PAUSED];
        for (what, cursors_ns) in [("moving", played), ("stationary", &resting[..]), ("pointer moves", &resting[..])] {
            // The first frame after a seek is not measured with the stationary cursor.
            player.draw(recording, cursors_ns[0]);
            let mut times = [Times::default(), Times::default(), Times::default()];
            let before_s = cpu_s();
            for (number, cursor_ns) in cursors_ns.iter().enumerate() {
                let moved = if what == "pointer moves" { vec![pointer_over_timeline(number)] } else { Vec::new() };
                player.measured(recording, *cursor_ns, moved, &mut times);
            }
            drop(player.lay_out(recording, cursors_ns[0], vec![Event::PointerGone]));
            let cpu_ms = cpu_s().zip(before_s).map(|(after, before)| 1e3 * (after - before) / cursors_ns.len() as f64);
            let cells = times.iter().map(|times| times.cells().join(" / "));
            let cpu = cpu_ms.map_or_else(String::new, |ms| format!("{ms:.1}"));
            table.row(preset.name(), std::iter::once(what.to_owned()).chain(cells).chain([cpu]));
        }
    }
    table
}
