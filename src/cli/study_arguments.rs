//! Arguments of the sub-commands that show a study.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::Args;
use dcvins::export::{
    STUDY_PANEL_NAMES, ScreenshotOptions, draw_study_panel, draw_study_panel_svg, study_panel_csv, write_csv,
    write_png, write_svg,
};
use dcvins::gui::study::StudyOptions;
use dcvins::sweep::OpenedStudy;

/// Filter, groups and metric of a study.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct StudyArguments {
    /// Runs of a study to show, as a condition on the columns of its table: 'seed < 3 and run = auto'.
    #[arg(long, value_name = "CONDITION", help_heading = "Options of a study")]
    pub filter: Option<String>,
    /// Grouping column, 'none' for no groups [default: the first input that varies].
    #[arg(long, value_name = "COLUMN", help_heading = "Options of a study")]
    pub group: Option<String>,
    /// Column of the metric [default: the RMS of the absolute trajectory error].
    #[arg(long, value_name = "COLUMN", help_heading = "Options of a study")]
    pub metric: Option<String>,
    /// Group from which differences are measured [default: the first one].
    #[arg(long, value_name = "GROUP", help_heading = "Options of a study")]
    pub reference: Option<String>,
    /// Condition of a success [default: status = ok].
    #[arg(long, value_name = "CONDITION", help_heading = "Options of a study")]
    pub success: Option<String>,
}

impl StudyArguments {
    pub(crate) fn options(&self) -> StudyOptions {
        StudyOptions {
            filter: self.filter.clone().unwrap_or_default(),
            group: self.group.clone(),
            metric: self.metric.clone(),
            reference: self.reference.clone(),
            success: self.success.clone(),
        }
    }

    /// Returns an error if one of these options is given for a log.
    pub(crate) fn require_none(&self, path: &Path) -> Result<()> {
        let given = [
            ("--filter", &self.filter),
            ("--group", &self.group),
            ("--metric", &self.metric),
            ("--reference", &self.reference),
            ("--success", &self.success),
        ];
        if let Some((name, _)) = given.into_iter().find(|(_, value)| value.is_some()) {
            bail!("{name} is for studies, but {} has no results.parquet", path.display());
        }
        Ok(())
    }
}

/// A panel of a study to be written to a file.
pub(crate) struct StudyScreenshot<'a> {
    pub(crate) panel: &'a str,
    pub(crate) svg: bool,
    pub(crate) csv: bool,
    pub(crate) output: &'a Path,
}

pub(crate) fn write_study_screenshot(
    study: &OpenedStudy,
    view: &StudyOptions,
    options: &ScreenshotOptions,
    screenshot: &StudyScreenshot<'_>,
) -> Result<()> {
    let StudyScreenshot { panel, svg, csv, output } = *screenshot;
    let study = study.study();
    if svg {
        let title = format!("{panel} of {}", study.name);
        write_svg(&draw_study_panel_svg(panel, study, view, options, ["clip", &title])?, output)?;
    } else {
        write_png(&draw_study_panel(panel, study, view, options)?, output)?;
    }
    if csv {
        write_csv(&study_panel_csv(panel, study, view)?, &output.with_extension("csv"))?;
    }
    Ok(())
}

/// Writes a screenshot of every panel of a study into a folder and returns the paths.
pub(crate) fn write_study_screenshots(study: &Arc<dcvins::study::view::Study>, folder: &Path) -> Result<Vec<String>> {
    let mut paths = Vec::new();
    for name in STUDY_PANEL_NAMES {
        let path = folder.join(format!("{name}.png"));
        let screenshot = draw_study_panel(name, study, &StudyOptions::default(), &ScreenshotOptions::default())?;
        write_png(&screenshot, &path)?;
        paths.push(path.display().to_string());
    }
    Ok(paths)
}
