//! Time from the file to the first frame.

use std::fs;
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context as _, Result};
use dcvins::session::{Session, Stopwatch};

use super::figures::mib;
use super::frames::Player;
use super::{Arguments, Table};

/// Measures the opening of the log, its first image, and the window with its first step.
pub(crate) fn measure(arguments: &Arguments) -> Result<Table> {
    let size = fs::metadata(&arguments.log).with_context(|| format!("cannot open {}", arguments.log.display()))?.len();
    let watch = Stopwatch::start();
    let ms = || format!("{:.1}", watch.elapsed_ms());
    let plan = arguments.plan()?;
    let opened = ms();
    let mut player = Player::new(&plan);
    player.first_image(&plan.runs[0].1).context("the log has no image of the first run's camera")?;
    let image = ms();
    let session = Session::start(plan)?;
    while session.recording().runs.iter().all(|run| run.steps.is_empty() && !run.finished) {
        sleep(Duration::from_micros(200));
    }
    let recording = session.recording();
    player.draw(&recording, recording.last_stamp_ns());
    let mut table = Table::new(format!("Opening a log of {}", mib(size as usize)), &["from the command to", "ms"]);
    table.row("the opened log", [opened]);
    table.row("its first image", [image]);
    table.row("the first frame of the window with a step", [ms()]);
    Ok(table)
}
