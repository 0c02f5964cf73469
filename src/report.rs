//! `dcvins report`: the runs computed, their pictures drawn, and the page written.

use std::path::{Path, PathBuf};

use anyhow::Result;
use dcvins::export::{ReportOptions, write_report};
use dcvins::session::SessionPlan;

use crate::arguments::ReportArguments;
use crate::commands::{compute, print};

/// `dcvins report`.
pub(crate) fn report(arguments: &ReportArguments) -> Result<()> {
    let plan = SessionPlan::open(&arguments.estimation.request(arguments.log.clone()))?;
    let recording = compute(&plan, None)?;
    let options = ReportOptions {
        command: command_line(std::env::args()),
        inputs: inputs(arguments),
        #[cfg(feature = "gui")]
        pictures: pictures::draw(arguments, &plan, &recording)?,
        #[cfg(not(feature = "gui"))]
        pictures: Vec::new(),
    };
    let page = write_report(&recording, &arguments.output, &options)?;
    print(&format!("{}\n", page.display()))?;
    let failed: Vec<&str> = recording.runs.iter().filter_map(|run| run.error.as_deref()).collect();
    if failed.is_empty() { Ok(()) } else { anyhow::bail!("{}", failed.join("; ")) }
}

/// The log, and the rig and the truth where they are files of their own.
fn inputs(arguments: &ReportArguments) -> Vec<PathBuf> {
    let beside = |given: Option<&PathBuf>, extension: &str| {
        let beside = || Some(arguments.log.with_extension(extension)).filter(|path| path.is_file());
        given.cloned().or_else(beside)
    };
    let rig = beside(arguments.estimation.rig.as_ref(), "rig.yaml");
    let truth = beside(arguments.estimation.truth.as_ref(), "truth.yaml");
    [Some(arguments.log.clone()), rig, truth].into_iter().flatten().collect()
}

/// The command as it can be typed again; the program by its name alone, wherever it lies.
fn command_line(mut words: impl Iterator<Item = String>) -> String {
    let program = words.next().unwrap_or_default();
    let program = Path::new(&program).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let plain = |word: &str| {
        !word.is_empty() && word.chars().all(|letter| letter.is_alphanumeric() || "/._-:=,+".contains(letter))
    };
    let quoted = words.map(|word| if plain(&word) { word } else { format!("'{}'", word.replace('\'', "'\\''")) });
    std::iter::once(program).chain(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(feature = "gui")]
mod pictures {
    use std::sync::Arc;

    use anyhow::Result;
    use dcvins::export::{PictureOptions, ReportPicture, draw_panel, png_bytes};
    use dcvins::flight_log::ImageReader;
    use dcvins::geometry::{ns_from_seconds, seconds_from_ns};
    use dcvins::gui::theme::ThemeName;
    use dcvins::session::{Recording, SessionPlan};

    use crate::arguments::ReportArguments;

    /// Panels that show one instant, with their sizes in pixels and what they show.
    const INSTANT: [(&str, [u32; 2], &str); 3] = [
        ("image", [1280, 900], "Tracks and residuals in the image"),
        ("scene", [1280, 900], "Trajectory, landmarks and the chain"),
        ("rank", [1280, 900], "Ranks, singular values and the directions that are lost"),
    ];
    /// Panels that show the whole flight.
    const WHOLE: [(&str, [u32; 2], &str); 3] = [
        ("convergence", [1680, 1200], "Every calibration parameter with three sigmas and the truth"),
        ("residuals", [1280, 800], "Residuals"),
        ("timeline", [1680, 480], "Events, ranks, features and gaps"),
    ];

    /// The pictures of a report: the whole flight, then each instant (without one, the end).
    pub(super) fn draw(
        arguments: &ReportArguments,
        plan: &SessionPlan,
        recording: &Recording,
    ) -> Result<Vec<ReportPicture>> {
        let mut images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
        let mut pictures = Vec::new();
        let end_ns = recording.last_stamp_ns();
        let mut draw = |heading: &str, panels: &[(&str, [u32; 2], &str)], cursor_ns| -> Result<()> {
            for (panel, size_px, caption) in panels {
                let options =
                    PictureOptions { size_px: *size_px, theme: ThemeName::Print, ..PictureOptions::default() };
                let picture = draw_panel(panel, recording, cursor_ns, &mut images, &options)?;
                let caption = format!("{caption}, at {:.2} s", seconds_from_ns(cursor_ns));
                pictures.push(ReportPicture { heading: heading.to_owned(), caption, png: png_bytes(&picture)? });
            }
            Ok(())
        };
        draw("The whole flight", &WHOLE, end_ns)?;
        let instants: Vec<i64> = arguments.at.iter().map(|at_s| ns_from_seconds(*at_s).min(end_ns)).collect();
        let instants = if instants.is_empty() { vec![end_ns] } else { instants };
        for cursor_ns in instants {
            draw(&format!("At {:.2} s", seconds_from_ns(cursor_ns)), &INSTANT, cursor_ns)?;
        }
        Ok(pictures)
    }
}

#[cfg(test)]
mod tests {
    use super::command_line;

    #[test]
    fn commands_can_be_typed_again() {
        let words = ["/usr/bin/dcvins", "report", "my log.mcap", "--run", "auto:name=it's", ""].map(str::to_owned);
        assert_eq!(command_line(words.into_iter()), r"dcvins report 'my log.mcap' --run 'auto:name=it'\''s' ''");
    }
}
