//! Pictures of the window over a recording.

use std::sync::Arc;

use dcvins::flight_log::ImageReader;
use dcvins::gui::rendering::headless::{Frame, Headless, HeadlessOptions};
use dcvins::gui::rendering::painter::Painter;
use dcvins::gui::theme::{Theme, ThemeName};
use dcvins::gui::window::{MainWindow, Preset, window_ui};
use dcvins::gui::{PanelContext, Playback, Presentation, Selection};
use dcvins::sensors::GrayImage;
use dcvins::session::{Recording, SessionPlan};

use super::Table;
use super::figures::Times;
use super::shared::process::cpu_s;

const OPTIONS: HeadlessOptions =
    HeadlessOptions { size_px: [1920, 1080], pixels_per_point: 1.0, theme: ThemeName::Dark };
/// Pictures of each preset while the cursor runs.
const PLAYED: usize = 60;
/// Pictures of each preset with the cursor at rest.
const PAUSED: usize = 30;
/// Pictures that are drawn first, until everything has found its place.
const SETTLING: usize = 4;

/// Seconds from picture to picture: one for each image of the camera.
const FRAME_TIME_S: f64 = 0.05;

/// A window without a screen, which leaves advice to a thread as the real one does.
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

    /// The first image of a camera.
    pub(crate) fn first_image(&self, camera_key: &str) -> Option<Arc<GrayImage>> {
        self.images.image(camera_key, 0).ok()
    }

    /// Lays out a picture and hands its textures to the painter.
    fn lay_out(&mut self, recording: &Recording, cursor_ns: i64) -> Frame {
        let Self { images, headless, state, selection, .. } = self;
        let (theme, playback) = (Theme::of(OPTIONS.theme), Playback::default());
        let mut frame = headless.frame(Vec::new(), |ui| {
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

    /// Paints a picture and takes what changed, which the window hands to the graphics adapter.
    fn paint(&mut self, frame: &Frame) {
        let background = Theme::of(OPTIONS.theme).background;
        self.painter.update(&frame.chunks, OPTIONS.size_px, OPTIONS.pixels_per_point, background);
        self.painter.changes().for_each(drop);
    }

    /// One picture.
    pub(crate) fn picture(&mut self, recording: &Recording, cursor_ns: i64) {
        let frame = self.lay_out(recording, cursor_ns);
        self.paint(&frame);
    }

    /// One picture, with the time of its parts.
    fn measured(&mut self, recording: &Recording, cursor_ns: i64, times: &mut [Times; 3]) {
        let [layout, paint, whole] = times;
        whole.take(|| {
            let frame = layout.take(|| self.lay_out(recording, cursor_ns));
            paint.take(|| self.paint(&frame));
        });
    }
}

/// Every preset, with the cursor running through the last part of the recording, and at rest at its end.
pub(crate) fn measure(recording: &Recording, player: &mut Player) -> Table {
    let mut table = Table::new(
        "A picture of the window at 1920×1080, drawn on the CPU: ms at the median / 95 % / largest",
        &["preset", "cursor", "laying out", "painting", "together", "processor time, mean"],
    );
    let steps = recording.runs.first().map_or(&[][..], |run| &run.steps);
    let stamps_ns: Vec<i64> = steps.iter().map(|step| step.report.stamp_ns).collect();
    let played = &stamps_ns[stamps_ns.len().saturating_sub(PLAYED)..];
    let Some(first_ns) = played.first().copied() else { return table };
    for preset in Preset::ALL {
        player.state.arrange(preset);
        for _ in 0..SETTLING {
            player.picture(recording, first_ns);
        }
        let resting = vec![*played.last().unwrap_or(&first_ns); PAUSED];
        for (what, cursors_ns) in [("runs", played), ("rests", &resting[..])] {
            // The first picture at another place belongs to the running cursor.
            player.picture(recording, cursors_ns[0]);
            let mut times = [Times::default(), Times::default(), Times::default()];
            let before_s = cpu_s();
            for cursor_ns in cursors_ns {
                player.measured(recording, *cursor_ns, &mut times);
            }
            let cpu_ms = cpu_s().zip(before_s).map(|(after, before)| 1e3 * (after - before) / cursors_ns.len() as f64);
            let cells = times.iter().map(|times| times.cells().join(" / "));
            let cpu = cpu_ms.map_or_else(String::new, |ms| format!("{ms:.1}"));
            table.row(preset.name(), std::iter::once(what.to_owned()).chain(cells).chain([cpu]));
        }
    }
    table
}
