//! Arguments of the commands that follow a log while it is written or received.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::SystemTime;

use anyhow::{Context as _, Result, anyhow, bail};
use clap::Args;
use dcvins::files::RigFile as _;
use dcvins::flight_log::FollowOptions;
use dcvins::flight_log::live::{LiveReceiver, ReceiverRequest, ServerAddress};
use dcvins::sensors::Rig;
use dcvins::session::{SessionError, SessionPlan, SessionRequest, TrajectorySource};
use dcvins::text::utc;

use crate::cli::estimation_arguments::EstimationArguments;
use crate::cli::shared_arguments::seconds;

/// Delay from which on images of a server are left out by default, in seconds.
const DEFAULT_DELAY_S: f64 = 2.0;

/// Arguments of `run` and `view` about a log that is followed.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct FollowArguments {
    /// Follow a log that another program is writing: the run begins with its first seconds and ends with its footer, half a
    /// minute after the last message, or at Ctrl+C.
    #[arg(long, conflicts_with_all = ["start", "duration"])]
    pub follow: bool,
    /// Recording of what a server (ws://HOST:PORT) sends, as MCAP [default: HOST-PORT-DATE.mcap in the folder of the results].
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Leave out images, but no other messages, where a run would be more than this behind the newest message; none
    /// leaves out nothing [default: 2 for a server, none for a file].
    #[arg(long, value_name = "SECONDS|none", value_parser = longest_delay)]
    pub max_delay: Option<LongestDelay>,
}

/// Value of `--max-delay`; `None` inside for `none`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LongestDelay(Option<f64>);

fn longest_delay(text: &str) -> Result<LongestDelay, String> {
    if text == "none" {
        return Ok(LongestDelay(None));
    }
    let value = seconds(text).ok().filter(|value| *value > 0.0);
    value.map(|value| LongestDelay(Some(value))).ok_or_else(|| "expected seconds above 0, or none".to_owned())
}

/// A log that is followed. Dropping it ends a reception and completes its recording.
#[derive(Debug)]
pub(crate) struct FollowedLog {
    pub log: PathBuf,
    pub options: FollowOptions,
    /// The receiver of a server that writes the log.
    pub receiver: Option<LiveReceiver>,
}

impl FollowArguments {
    /// True if a source is followed.
    pub(crate) fn applies_to(&self, source: &Path) -> bool {
        self.follow || server_text(source).is_some()
    }

    /// Begins to follow a source, a file or the address of a server; recordings are written to `folder` by default.
    /// With `ends_with_server` a reception ends half a minute after the last message.
    ///
    /// # Errors
    /// If the address, the rig or the path of the recording cannot be used.
    pub(crate) fn open(
        &self,
        source: &Path,
        estimation: &EstimationArguments,
        folder: &Path,
        stop: Arc<AtomicBool>,
        ends_with_server: bool,
    ) -> Result<FollowedLog> {
        let Some(text) = server_text(source) else {
            if self.record.is_some() {
                bail!("--record is for the messages of a server (ws://HOST:PORT); '{}' is a file", source.display());
            }
            let longest_delay_s = self.max_delay.and_then(|LongestDelay(delay_s)| delay_s);
            let options = FollowOptions { stop, reception: None, longest_delay_s };
            return Ok(FollowedLog { log: source.to_owned(), options, receiver: None });
        };
        if estimation.start > 0.0 || estimation.duration.is_some() {
            bail!("--start and --duration need a complete log: use them on the recording of {text}");
        }
        let address: ServerAddress = text.parse().map_err(|problem: String| anyhow!(problem))?;
        let recording = self.record.clone().unwrap_or_else(|| free_name(folder, &address));
        if recording.exists() {
            bail!("the recording exists already; name another one with --record: {}", recording.display());
        }
        let RecordedRig { text: rig, attachments } = rig_of_recording(estimation, &recording)?;
        let receiver = LiveReceiver::start(ReceiverRequest {
            address,
            recording: recording.clone(),
            rig,
            topics: topics(estimation),
            attachments,
            limits: estimation.limits.limits(),
            ends_with_server,
            stop,
        })?;
        let longest_delay_s = self.max_delay.map_or(Some(DEFAULT_DELAY_S), |LongestDelay(delay_s)| delay_s);
        let options = FollowOptions::of_reception(receiver.reception(), longest_delay_s);
        Ok(FollowedLog { log: recording, options, receiver: Some(receiver) })
    }
}

impl FollowedLog {
    /// Opens the log as soon as it has three seconds of messages.
    ///
    /// # Errors
    /// If it cannot be opened, with the reason why nothing was received.
    pub(crate) fn plan(&self, request: &SessionRequest) -> Result<SessionPlan> {
        let request = SessionRequest { following: Some(self.options.clone()), ..request.clone() };
        SessionPlan::open(&request).map_err(|error| self.explained(error))
    }

    fn explained(&self, error: SessionError) -> anyhow::Error {
        let Some(receiver) = &self.receiver else { return error.into() };
        let reception = receiver.reception();
        let (address, received) = (reception.address(), reception.received());
        let ended = reception.events().pop();
        match (reception.problem(), ended) {
            (_, Some(event)) => anyhow!("{address}: {event}"),
            (Some(problem), None) if received.connections == 0 => {
                anyhow!(
                    "{address}: no connection within half a minute ({problem}); start foxglove_bridge on the vehicle"
                )
            }
            _ if received.messages == 0 => anyhow!("{address}: no message of the rig's topics within half a minute"),
            _ => error.into(),
        }
    }
}

/// The address of a server as it was typed, `None` for a file.
fn server_text(source: &Path) -> Option<&str> {
    source.to_str().filter(|text| ServerAddress::is_meant_by(text))
}

/// Rig of a recording.
struct RecordedRig {
    /// Text of the rig, `None` without one.
    text: Option<String>,
    /// Files that make the recording a log of its own: the rig, its masks and the ground truth.
    attachments: Vec<(String, Vec<u8>)>,
}

fn rig_of_recording(estimation: &EstimationArguments, recording: &Path) -> Result<RecordedRig> {
    let stem = recording.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let read = |path: &Path| std::fs::read(path).with_context(|| format!("cannot read {}", path.display()));
    let (mut text, mut attachments) = (None, Vec::new());
    for (path, ending) in [(&estimation.rig, "rig.yaml"), (&estimation.ground_truth, "truth.yaml")] {
        let Some(path) = path else { continue };
        let content = read(path)?;
        if ending == "rig.yaml" {
            text = Some(String::from_utf8_lossy(&content).into_owned());
        }
        attachments.push((format!("{stem}.{ending}"), content));
        // Intrinsics may be missing that the server's topics contain.
        let masks = Rig::from_file(path).map(|rig| rig.cameras).unwrap_or_default();
        for mask in masks.into_iter().filter_map(|camera| camera.mask) {
            let beside = path.with_file_name(&mask.file);
            if !attachments.iter().any(|(name, _)| *name == mask.file) {
                attachments.push((mask.file, read(&beside)?));
            }
        }
    }
    Ok(RecordedRig { text, attachments })
}

/// Topics of trajectories that the command line names.
fn topics(estimation: &EstimationArguments) -> Vec<String> {
    let sources = estimation.trajectories.iter().map(|spec| &spec.source).chain(&estimation.truth_trajectory);
    sources
        .filter_map(|source| match source {
            TrajectorySource::Topic(topic) => Some(topic.clone()),
            TrajectorySource::File(_) => None,
        })
        .collect()
}

/// Path of a recording that does not exist yet.
fn free_name(folder: &Path, address: &ServerAddress) -> PathBuf {
    #[expect(clippy::disallowed_methods, reason = "the name of a recording tells when it was made")]
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let date = utc(i64::try_from(now.as_nanos()).unwrap_or(0)).unwrap_or_default();
    let stem = format!("{}-{}", address.file_name(), date.replace(' ', "T").replace(':', ""));
    let names = (1..).map(|number: u32| if number == 1 { stem.clone() } else { format!("{stem}-{number}") });
    let paths = names.map(|name| folder.join(format!("{name}.mcap")));
    paths.into_iter().find(|path| !path.exists()).unwrap_or_else(|| folder.join("received.mcap"))
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        follow: FollowArguments,
        #[command(flatten)]
        estimation: EstimationArguments,
    }

    fn opened(arguments: &[&str], source: &str, folder: &Path) -> Result<FollowedLog> {
        let line = Line::try_parse_from([&["dcvins"], arguments].concat())?;
        assert!(line.follow.applies_to(Path::new(source)));
        line.follow.open(Path::new(source), &line.estimation, folder, Arc::default(), true)
    }

    #[test]
    fn a_server_is_recorded_under_a_new_name_with_its_rig() {
        let folder = tempfile::tempdir().unwrap();
        let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/sample_logs/garden.rig.yaml");
        let address: ServerAddress = "ws://127.0.0.1:9".parse().unwrap();
        let first = free_name(folder.path(), &address);
        assert!(first.file_name().unwrap().to_str().unwrap().starts_with("127.0.0.1-9-20"), "{}", first.display());
        let followed = opened(&["--rig", rig], "ws://127.0.0.1:9", folder.path()).unwrap();
        assert_eq!(followed.options.longest_delay_s, Some(DEFAULT_DELAY_S));
        assert!(followed.log.starts_with(folder.path()) && !followed.log.exists());
        std::fs::write(&first, "").unwrap();
        assert_ne!(free_name(folder.path(), &address), first);
        let estimation = Line::try_parse_from(["dcvins", "--rig", rig]).unwrap().estimation;
        let recorded = rig_of_recording(&estimation, Path::new("a/live.mcap")).unwrap();
        assert!(recorded.text.unwrap().contains("/gimbal_camera/image_raw/compressed"));
        assert_eq!(recorded.attachments[0].0, "live.rig.yaml");
    }

    #[test]
    fn what_a_source_cannot_do_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let existing = folder.path().join("there.mcap");
        std::fs::write(&existing, "").unwrap();
        let existing = existing.to_str().unwrap();
        let cases: [(&[&str], &str, &str); 5] = [
            (&["--follow", "--record", "x.mcap"], "flight.mcap", "--record is for the messages of a server"),
            (&["--record", existing], "ws://127.0.0.1", "exists already"),
            (&[], "wss://host:1", "only connections without encryption"),
            (&["--start", "3"], "ws://host", "need a complete log"),
            (&["--max-delay", "0"], "ws://host", "expected seconds above 0, or none"),
        ];
        for (arguments, source, expected) in cases {
            let error = opened(arguments, source, folder.path()).unwrap_err().to_string();
            assert!(error.contains(expected), "{arguments:?} {source}: {error}");
        }
        let all = opened(&["--follow", "--max-delay", "none"], "flight.mcap", folder.path()).unwrap();
        assert_eq!(all.options.longest_delay_s, None);
        let some = opened(&["--follow", "--max-delay", "1.5"], "flight.mcap", folder.path()).unwrap();
        assert_eq!(some.options.longest_delay_s, Some(1.5));
    }
}
