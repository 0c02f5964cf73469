//! `dcvins view`: the window, or screenshots of its panels without a display.

use std::path::PathBuf;

use clap::Args;

use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::follow_arguments::FollowArguments;

#[derive(Args, Clone, Debug, Default)]
pub(crate) struct ViewArguments {
    /// The log, a saved session or the folder of a study; the address of a Foxglove WebSocket server, ws://HOST:PORT, whose
    /// messages are recorded and shown meanwhile; or a recording that 'dcvins convert' reads, which is converted
    /// into the cache folder first. Several files form one log: a video and the log of its autopilot, the parts of a
    /// split bag, and a rig. Without one the window lists the sample logs and recent files.
    #[arg(value_name = "SOURCE")]
    pub sources: Vec<PathBuf>,
    /// Folder of the screenshots if there is no display [default: dcvins-output/NAME].
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Start with the tour: six steps on the log, or on the sample flight without a log.
    #[arg(long, conflicts_with = "follow")]
    pub tour: bool,
    #[command(flatten)]
    pub follow: FollowArguments,
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
    use std::path::{Path, PathBuf};
    use std::sync::Arc;

    use anyhow::{Result, bail};
    use dcvins::desktop::Machine;
    use dcvins::export::{
        self, LogSources, PANEL_NAMES, RunFileOptions, ScreenshotOptions, draw_panel, is_session, read_session,
        write_png,
    };
    use dcvins::flight_log::{ImageReader, LogError};
    use dcvins::gui::app::run_window::{WindowError, WindowOptions, run_window};
    use dcvins::gui::app::{OpenLog, OpenRequest, StudySource};
    use dcvins::gui::theme::ThemeName;
    use dcvins::session::{SessionError, SessionPlan, SessionRequest};
    use dcvins::sweep::{OpenedStudy, is_study};
    use parking_lot::Mutex;

    use super::ViewArguments;
    use crate::cli::compute::compute;
    use crate::cli::estimation_arguments::EstimationArguments;
    use crate::cli::open_log::open_log;
    use crate::cli::prepared_log::prepared_log;
    use crate::cli::run_summary::describe;
    use crate::cli::study_arguments::write_study_screenshots;
    use crate::cli::terminal::{notify, print};

    /// Opens the window, or writes screenshots if there is no display.
    pub(crate) fn view(arguments: &ViewArguments) -> Result<()> {
        // Errors of the sources, of a log or of its rig are reported here, before a window opens. A recording is converted
        // in the window, with its progress; a missing rig is asked for there.
        let given = arguments.sources.first().map(PathBuf::as_path);
        let followed = given.filter(|source| arguments.follow.applies_to(source)).map(|source| {
            let folder = Path::new("dcvins-output");
            arguments.follow.open(source, &arguments.estimation, folder, Arc::default(), false)
        });
        let followed = followed.transpose()?;
        let given = followed.as_ref().map_or(given, |followed| Some(&followed.log));
        let alone = given.filter(|_| arguments.sources.len() == 1);
        let study = alone.filter(|path| is_study(path)).map(OpenedStudy::read).transpose()?.map(Arc::new);
        if study.is_none() && given.is_some() && followed.is_none() {
            let sources = LogSources::gather(&arguments.sources, &arguments.estimation.limits.limits())?;
            if is_session(&sources.main) {
                arguments.estimation.check_for_session()?;
                read_session(&sources.main)?;
            } else if sources.kind.is_none() {
                check_log(&sources, &arguments.estimation)?;
            }
        }
        let estimation = arguments.estimation.clone();
        let following = followed.as_ref().map(|followed| (followed.log.clone(), followed.options.clone()));
        let open_log: OpenLog =
            Arc::new(move |request, progress| open_log(request, &estimation, following.as_ref(), progress));
        let first_study = Mutex::new(study.clone().zip(given.map(Path::to_owned)));
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
        let sources =
            followed.as_ref().map_or_else(|| arguments.sources.clone(), |followed| vec![followed.log.clone()]);
        let options = WindowOptions {
            log: None,
            request: given.is_some().then_some(OpenRequest { sources, rig: None }),
            open_log,
            open_study: Arc::new(open_study),
            desktop: Arc::new(Machine::new()),
            theme: ThemeName::Light,
            tour: arguments.tour,
        };
        match (run_window(options), &study, alone) {
            (Err(WindowError::NoDisplay), Some(study), _) => write_study(study, arguments.out.as_deref()),
            (Err(WindowError::NoDisplay), None, _) if followed.as_ref().is_some_and(|it| it.receiver.is_some()) => {
                bail!("there is no display: use 'dcvins run {}'", arguments.sources[0].display())
            }
            (Err(WindowError::NoDisplay), None, _) if given.is_some() => without_display(arguments),
            (result, ..) => Ok(result?),
        }
    }

    /// Reports an error of a log or of its rig; a log without a rig is none, since the window asks for one.
    fn check_log(sources: &LogSources, estimation: &EstimationArguments) -> Result<()> {
        let rig_path = sources.rig.clone().or_else(|| estimation.rig.clone());
        let request = SessionRequest { rig_path, ..estimation.request(sources.main.clone())? };
        match SessionPlan::open(&request) {
            Err(SessionError::Log(LogError::NoRig { .. })) | Ok(_) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    /// Writes screenshots of a log or a recording, for a machine without a display.
    fn without_display(arguments: &ViewArguments) -> Result<()> {
        if let [path] = arguments.sources.as_slice()
            && is_session(path)
        {
            return Err(WindowError::NoDisplay.into());
        }
        let (log, estimation) = prepared_log(&arguments.sources, &arguments.estimation)?;
        write_screenshots(&SessionPlan::open(&estimation.request(log)?)?, arguments.out.as_deref())
    }

    /// Writes a screenshot of every panel of a study.
    fn write_study(study: &OpenedStudy, out: Option<&Path>) -> Result<()> {
        let name = study.folder().file_name().unwrap_or_else(|| study.folder().as_os_str());
        let folder = out.map_or_else(|| Path::new("dcvins-output").join(name), Path::to_path_buf);
        notify(&format!("dcvins: there is no display, so screenshots are written to {}", folder.display()));
        for path in write_study_screenshots(study.study(), &folder)? {
            print(&format!("{path}\n"))?;
        }
        Ok(())
    }

    /// Writes a screenshot of every panel at the end of the log, and the files of each run.
    fn write_screenshots(plan: &SessionPlan, out: Option<&Path>) -> Result<()> {
        let stem = plan.log_path.file_stem().unwrap_or(plan.log_path.as_os_str());
        let folder = out.map_or_else(|| Path::new("dcvins-output").join(stem), Path::to_path_buf);
        notify(&format!("dcvins: there is no display, so screenshots are written to {}", folder.display()));
        let mut computation = compute(plan)?;
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
