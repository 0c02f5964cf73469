//! `dcvins view`: the window, or screenshots of its panels without a display.

use std::path::PathBuf;

use clap::Args;

use crate::cli::estimation_arguments::EstimationArguments;

#[derive(Args, Clone, Debug, Default)]
pub(crate) struct ViewArguments {
    /// The log, a saved session or the folder of a study; without one the window lists the sample logs and recent
    /// files.
    pub log: Option<PathBuf>,
    /// Folder of the screenshots if there is no display [default: dcvins-output/NAME].
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Start with the tour: six steps on the log, or on the sample flight without a log.
    #[arg(long)]
    pub tour: bool,
    #[command(flatten)]
    pub estimation: EstimationArguments,
}

#[cfg(feature = "gui")]
pub(crate) use window::view;

/// `dcvins view` in a build without the window.
#[cfg(not(feature = "gui"))]
pub(crate) fn view(_arguments: &ViewArguments) -> anyhow::Result<()> {
    anyhow::bail!("this program was built without the window (cargo feature 'gui'); 'dcvins run LOG --out DIR' works")
}

#[cfg(feature = "gui")]
mod window {
    use std::path::Path;
    use std::sync::Arc;

    use anyhow::Result;
    use dcvins::desktop::Machine;
    use dcvins::export::{
        self, PANEL_NAMES, RunFileOptions, ScreenshotOptions, draw_panel, is_session, read_session, write_png,
    };
    use dcvins::flight_log::ImageReader;
    use dcvins::gui::app::run_window::{WindowError, WindowOptions, run_window};
    use dcvins::gui::app::{PlayingLog, StudySource};
    use dcvins::gui::theme::ThemeName;
    use dcvins::session::{Session, SessionPlan};
    use dcvins::sweep::{OpenedStudy, is_study};
    use parking_lot::Mutex;

    use super::ViewArguments;
    use crate::cli::compute::compute;
    use crate::cli::run_summary::describe;
    use crate::cli::study_arguments::write_study_pictures;
    use crate::cli::terminal::{notify, print};

    /// Opens the window, or writes screenshots if there is no display.
    pub(crate) fn view(arguments: &ViewArguments) -> Result<()> {
        // Errors of the log or its rig are reported here, before a window opens.
        let request = |log: &Path| arguments.estimation.request(log.to_owned());
        let given = arguments.log.as_deref();
        let study = given.filter(|path| is_study(path)).map(OpenedStudy::read).transpose()?.map(Arc::new);
        let plan = given
            .filter(|path| !is_session(path) && !is_study(path))
            .map(|log| SessionPlan::open(&request(log)))
            .transpose()?;
        if let Some(path) = given.filter(|path| is_session(path)) {
            read_session(path)?;
        }
        let opened = Mutex::new(plan.clone());
        let estimation = arguments.estimation.clone();
        let open_log = move |path: &Path| {
            let mut opened = opened.lock();
            // The log of the command line is already open; other logs are opened here.
            let session = match opened.take().filter(|plan| plan.log_path == path) {
                Some(plan) => Session::start(plan),
                None if is_session(path) => {
                    let saved = read_session(path).map_err(|error| error.to_string())?;
                    let session = saved.open().map_err(|error| format!("{error}: {}", path.display()))?;
                    return Ok(Box::new(session) as Box<dyn PlayingLog>);
                }
                None => Session::open(&estimation.request(path.to_owned())),
            };
            Ok(Box::new(session.map_err(|error| error.to_string())?) as Box<dyn PlayingLog>)
        };
        let first_study = Mutex::new(study.clone().zip(arguments.log.clone()));
        let open_study = move |path: &Path| {
            // The study of the command line is already read.
            let read = first_study.lock().take().filter(|(_, of)| of == path);
            let shown = |study: Arc<OpenedStudy>| study as Arc<dyn StudySource>;
            if let Some((study, _)) = read {
                return Some(Ok(shown(study)));
            }
            let opened = is_study(path).then(|| OpenedStudy::read(path));
            opened.map(|opened| opened.map(|study| shown(Arc::new(study))).map_err(|error| error.to_string()))
        };
        let options = WindowOptions {
            log: None,
            log_path: arguments.log.clone(),
            open_log: Arc::new(open_log),
            open_study: Arc::new(open_study),
            desktop: Arc::new(Machine::new()),
            theme: ThemeName::Light,
            tour: arguments.tour,
        };
        match (run_window(options), &plan, &study) {
            (Err(WindowError::NoDisplay), Some(plan), _) => write_screenshots(plan, arguments.out.as_deref()),
            (Err(WindowError::NoDisplay), _, Some(study)) => write_study(study, arguments.out.as_deref()),
            (result, ..) => Ok(result?),
        }
    }

    /// Writes a screenshot of every panel of a study.
    fn write_study(study: &OpenedStudy, out: Option<&Path>) -> Result<()> {
        let name = study.folder().file_name().unwrap_or_else(|| study.folder().as_os_str());
        let folder = out.map_or_else(|| Path::new("dcvins-output").join(name), Path::to_path_buf);
        notify(&format!("dcvins: there is no display, so screenshots are written to {}", folder.display()));
        for path in write_study_pictures(study.study(), &folder)? {
            print(&format!("{path}\n"))?;
        }
        Ok(())
    }

    /// Writes a screenshot of every panel at the end of the log, and the files of each run.
    fn write_screenshots(plan: &SessionPlan, out: Option<&Path>) -> Result<()> {
        let stem = plan.log_path.file_stem().unwrap_or(plan.log_path.as_os_str());
        let folder = out.map_or_else(|| Path::new("dcvins-output").join(stem), Path::to_path_buf);
        notify(&format!("dcvins: there is no display, so screenshots are written to {}", folder.display()));
        let mut computation = compute(plan, None)?;
        computation.fill_in(computation.recording().last_stamp_ns());
        let recording = computation.into_recording();
        let mut images = ImageReader::new(Arc::clone(&plan.log), &plan.rig);
        let options = ScreenshotOptions::default();
        for name in PANEL_NAMES {
            let path = folder.join(format!("{name}.png"));
            write_png(&draw_panel(name, &recording, recording.last_stamp_ns(), &mut images, &options)?, &path)?;
            print(&format!("{}\n", path.display()))?;
        }
        for run in &recording.runs {
            let (folder, summary) = export::write_run(&recording, run, &folder, RunFileOptions::default())?;
            print(&describe(&folder, &summary))?;
        }
        Ok(())
    }
}
