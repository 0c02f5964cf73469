//! `dcvins convert`: conversion of datasets and bags into logs, and of logs into EuRoC folders.

use dcvins::flight_log::RigOfLog as _;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use dcvins::export::{self, VideoAlignmentError};
use dcvins::flight_log::FlightLog;
use dcvins::flight_log::convert::{self, AutopilotLog, AutopilotLogKind, ConvertError, ConvertOptions, VideoClock};
use dcvins::sensors::Rig;

use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::prepared_log::prepare;
use crate::cli::shared_arguments::LimitArguments;
use crate::cli::terminal::{Progress, notify, print_report};

#[derive(Args, Clone, Debug)]
pub(crate) struct ConvertArguments {
    /// A EuRoC/ASL folder (with mav0), a ROS 1 bag, a ROS 2 bag (its folder, one .db3 or one .mcap), an MP4 video (H.264 or
    /// H.265; with GoPro's telemetry, or with a log of the autopilot), or a log of an autopilot alone (.ulg, .bin, .tlog).
    /// With --to euroc, a flight log or any of these.
    pub source: PathBuf,
    /// Further bags that continue a ROS 1 bag, in the order of time (`NAME_1.bag`, `NAME_2.bag`, …).
    pub splits: Vec<PathBuf>,
    /// The log to write; the rig, where the source describes one, gets the same name with .rig.yaml. With --to euroc,
    /// the folder that gets mav0.
    #[arg(short, long, visible_alias = "out", value_name = "LOG.mcap|DIR")]
    pub output: PathBuf,
    /// Format of the written log.
    #[arg(long = "to", value_enum, value_name = "FORMAT", default_value = "mcap")]
    pub format: ConvertedFormat,
    /// With --to euroc: the rig of the log; default: next to the log or attached to it.
    #[arg(long, value_name = "FILE")]
    pub rig: Option<PathBuf>,
    /// With --to euroc: a camera of the rig, in the order of cam0, cam1, … [default: all; rigid cameras before those on
    /// a gimbal].
    #[arg(long = "camera", value_name = "KEY")]
    pub cameras: Vec<String>,
    /// PX4's ULog of the flight in the video.
    #[arg(long, value_name = "LOG.ulg", group = "autopilot_log")]
    pub ulog: Option<PathBuf>,
    /// ArduPilot's DataFlash log of the flight in the video.
    #[arg(long, value_name = "LOG.bin", group = "autopilot_log")]
    pub dataflash: Option<PathBuf>,
    /// The telemetry log (MAVLink) of the flight in the video.
    #[arg(long, value_name = "LOG.tlog", group = "autopilot_log")]
    pub tlog: Option<PathBuf>,
    /// Start of the video minus the first measurement of the autopilot's log. Default: estimated by comparing the
    /// rotations of the images with the gyroscope, up to 60 s from the times recorded by camera and autopilot.
    #[arg(long, value_name = "SECONDS", requires = "autopilot_log", allow_hyphen_values = true, value_parser = offset)]
    pub video_offset: Option<f64>,
    /// Take this record of the autopilot's log instead of the one that is chosen, by its name in the report, such as
    /// "MNT[1]", or "system 2" for another vehicle of a telemetry log. Can be repeated.
    #[arg(long, value_name = "NAME")]
    pub take: Vec<String>,
    /// Overwrite any existing file with the name of the log, or any mav0. Without it, only a log written by this command,
    /// or a mav0 that it wrote from the same log, is replaced; an edited rig next to the log is always kept.
    #[arg(long)]
    pub force: bool,
    /// Print the converted and skipped topics as JSON.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub limits: LimitArguments,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ConvertedFormat {
    /// A flight log (MCAP).
    Mcap,
    /// A folder in EuRoC's (ASL) format, for other estimators.
    Euroc,
}

/// Largest offset of a video from the start of the autopilot's log, in seconds (about four months).
const MAX_OFFSET_S: f64 = 1e7;

/// Parses the offset of a video.
fn offset(text: &str) -> std::result::Result<f64, String> {
    let offset_s = text.parse::<f64>().ok().filter(|offset_s| offset_s.abs() <= MAX_OFFSET_S);
    offset_s.ok_or_else(|| format!("expected seconds from -{MAX_OFFSET_S} to {MAX_OFFSET_S}, such as -2.35"))
}

impl ConvertArguments {
    fn options(&self) -> ConvertOptions {
        let logs = [
            (AutopilotLogKind::Ulog, &self.ulog),
            (AutopilotLogKind::DataFlash, &self.dataflash),
            (AutopilotLogKind::Tlog, &self.tlog),
        ];
        let mut given = logs.into_iter().filter_map(|(kind, path)| Some(AutopilotLog { kind, path: path.clone()? }));
        ConvertOptions {
            limits: self.limits.limits(),
            splits: self.splits.clone(),
            autopilot: given.next(),
            video_clock: self.video_offset.map(|offset_s| VideoClock { offset_s, drift_ppm: 0.0 }),
            take: self.take.clone(),
        }
    }
}

pub(crate) fn convert(arguments: &ConvertArguments) -> Result<ExitOutcome> {
    match arguments.format {
        ConvertedFormat::Mcap if arguments.rig.is_some() || !arguments.cameras.is_empty() => {
            bail!("--rig and --camera are for --to euroc: a log has all cameras, and its rig lies next to it")
        }
        ConvertedFormat::Mcap => convert_to_log(arguments),
        ConvertedFormat::Euroc => convert_to_euroc(arguments),
    }
}

/// Writes a log, or the log that a recording is converted to, as a EuRoC folder.
fn convert_to_euroc(arguments: &ConvertArguments) -> Result<ExitOutcome> {
    let options = arguments.options();
    if options.video_clock.is_some() || !options.take.is_empty() {
        bail!("--video-offset and --take are for a conversion into a log: convert it first, then that log --to euroc");
    }
    let limits = &options.limits;
    let folder = &arguments.output;
    let same = |source: &PathBuf| source.canonicalize().ok().is_some_and(|it| folder.canonicalize().ok() == Some(it));
    if same(&arguments.source) {
        return Err(ConvertError::OntoItself { path: folder.clone() }.into());
    }
    let autopilot = options.autopilot.iter().map(|log| log.path.clone());
    let sources: Vec<PathBuf> =
        std::iter::once(arguments.source.clone()).chain(options.splits.clone()).chain(autopilot).collect();
    let prepared = prepare(&sources, arguments.rig.as_deref(), limits)?;
    export::check_euroc_folder(folder, &prepared.log, arguments.force)?;
    let interrupt = Interrupt::watch()?;
    let log = Arc::new(FlightLog::open_with(&prepared.log, limits)?);
    let rig = Rig::for_log(&log, arguments.rig.as_deref().or(prepared.rig.as_deref()))?;
    let progress = Progress::new();
    let written = export::write_euroc(&log, &rig, &arguments.cameras, folder, &mut |ratio| {
        progress.show(ratio, String::new);
        interrupt.control_flow()
    })?;
    drop(progress);
    if let Some(report) = written {
        return print_report(&report, arguments.json).map(|()| ExitOutcome::Success);
    }
    notify(&format!("dcvins: {}", ConvertError::Interrupted { path: folder.clone() }));
    Ok(ExitOutcome::Interrupted)
}

/// Converts a dataset, a bag or a recording into a log.
fn convert_to_log(arguments: &ConvertArguments) -> Result<ExitOutcome> {
    let interrupt = Interrupt::watch()?;
    export::check_converted_log(&arguments.output, arguments.force)?;
    let progress = Progress::new();
    let mut options = arguments.options();
    let mut aligned = None;
    if options.autopilot.is_some() && options.video_clock.is_none() {
        let rig = Some(arguments.output.with_extension("rig.yaml")).filter(|rig| rig.is_file());
        let found = export::align_video(&arguments.source, &arguments.output, rig.as_deref(), &options, &mut |ratio| {
            progress.show(0.5 * ratio, || "aligning the video".to_owned());
            interrupt.control_flow()
        });
        match found {
            Ok(found) => options.video_clock = Some(aligned.insert(found).clock),
            Err(VideoAlignmentError::Convert(error @ ConvertError::Interrupted { .. })) => {
                notify(&format!("dcvins: {error}"));
                return Ok(ExitOutcome::Interrupted);
            }
            Err(error) => return Err(error.into()),
        }
    }
    let converted = convert::convert_with(&arguments.source, &arguments.output, &options, &mut |ratio| {
        progress.show(ratio, String::new);
        interrupt.control_flow()
    });
    drop(progress);
    match converted {
        Ok(mut report) => {
            if let Some(aligned) = &aligned {
                let plot = arguments.output.with_extension("alignment.svg");
                let drawn = export::write_alignment_plot(aligned, &plot)?;
                let drawing = if drawn { format!(": {}", plot.display()) } else { String::new() };
                report.notes.insert(0, format!("{aligned}{drawing}"));
            }
            print_report(&report, arguments.json).map(|()| ExitOutcome::Success)
        }
        Err(error @ ConvertError::Interrupted { .. }) => {
            notify(&format!("dcvins: {error}"));
            Ok(ExitOutcome::Interrupted)
        }
        Err(error) => Err(error.into()),
    }
}
