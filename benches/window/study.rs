//! Costs of the view of a large study: opening it, and every frame.

use std::sync::Arc;

use anyhow::{Result, anyhow};
use dcvins::gui::rendering::headless::{Headless, HeadlessOptions};
use dcvins::gui::study::{StudyOptions, StudyState, study_ui};
use dcvins::gui::theme::{Theme, ThemeName};
use dcvins::painting::painter::Painter;
use dcvins::study::view::Study;
use egui::{Event, pos2};

use super::Table;
use super::figures::Times;
use super::study_sample;

const OPTIONS: HeadlessOptions =
    HeadlessOptions { size_px: [1920, 1080], pixels_per_point: 1.0, theme: ThemeName::Dark };
const DRAWN: usize = 40;

/// Measures a simulated study with at least `runs` runs.
pub(crate) fn measure(runs: usize) -> Result<Table> {
    let theme = Theme::of(OPTIONS.theme);
    let [sample, _] = study_sample::tables(study_sample::SEEDS);
    let runs_per_seed = sample.rows() / study_sample::SEEDS as usize;
    let [results, parameters] = study_sample::tables(runs.div_ceil(runs_per_seed) as i64);
    let count = results.rows();
    let study = Arc::new(Study { name: "sample".to_owned(), runs: results, parameters });
    let mut table = Table::new(
        format!("The view of a study of {count} runs at 1920×1080, on the CPU: ms, median / 95 % / largest"),
        &["", "layout", "with painting"],
    );
    let mut state = StudyState::new(Arc::clone(&study), &StudyOptions::default()).map_err(|error| anyhow!(error))?;
    let mut headless = Headless::new(OPTIONS);
    let mut painter = Painter::new();
    let mut measure = |state: &mut StudyState, events: Vec<Event>, [layout, whole]: &mut [Times; 2]| {
        whole.take(|| {
            let frame = layout.take(|| headless.frame(events, |ui| study_ui(ui, state, &theme)));
            painter.set_textures(&frame.textures);
            painter.free_textures(&frame.textures);
            drop(painter.paint(&frame.chunks, OPTIONS.size_px, OPTIONS.pixels_per_point, theme.background));
        });
    };
    let cells = |times: &[Times; 2]| times.iter().map(|times| times.cells().join(" / ")).collect::<Vec<_>>();

    let mut times = <[Times; 2]>::default();
    measure(&mut state, Vec::new(), &mut times);
    table.row("first frame", cells(&times));
    measure(&mut state, Vec::new(), &mut <[Times; 2]>::default());
    let mut times = <[Times; 2]>::default();
    for _ in 0..DRAWN {
        measure(&mut state, Vec::new(), &mut times);
    }
    table.row("stationary", cells(&times));
    let mut times = <[Times; 2]>::default();
    for number in 0..DRAWN {
        let pointer = Event::PointerMoved(pos2(140.0 + 8.0 * number as f32, 150.0));
        measure(&mut state, vec![pointer], &mut times);
    }
    table.row("pointer over the points", cells(&times));
    let mut times = <[Times; 2]>::default();
    for number in 0..DRAWN {
        let filter = format!("ate_rmse_m < {}", 0.2 + 0.01 * number as f64);
        let options = StudyOptions { filter, ..StudyOptions::default() };
        state = StudyState::new(Arc::clone(&study), &options).map_err(|error| anyhow!(error))?;
        measure(&mut state, Vec::new(), &mut times);
    }
    table.row("filter changed", cells(&times));
    Ok(table)
}
