//! A job of a study: one run of the estimator, one bundle adjustment or one trajectory of another program, named by the
//! hash of its inputs.

use std::fmt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::perturbation::RigPerturbation;
use super::recipe::FlightRecipe;
use crate::session::{RunSpec, TrajectorySpec};
use crate::text::Named;

/// Version of the rules by which keys are made; another version gives other keys.
const KEY_RULES: u32 = 1;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedLog {
    /// Name in the tables.
    pub name: String,
    pub path: PathBuf,
    /// SHA-256 of its content, in hexadecimal.
    pub sha256: String,
    /// Path of the rig; `None` if it is next to the log or inside it.
    pub rig: Option<PathBuf>,
    /// SHA-256 of the rig file that is used, with its masks; empty if the rig is inside the log.
    pub rig_sha256: String,
    /// Path of the ground-truth rig; `None` if it is next to the log or inside it.
    pub truth: Option<PathBuf>,
    /// SHA-256 of the ground-truth file that is used; empty if it is inside the log or unknown.
    pub truth_sha256: String,
    /// Seconds to skip at the start.
    pub start_s: f64,
    /// Seconds to process from there, `None` for the rest.
    pub duration_s: Option<f64>,
    /// Length of the log in seconds, to estimate the time of a job.
    pub length_s: f64,
    /// Trajectories of other programs on this log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trajectories: Vec<StudyTrajectory>,
}

/// A trajectory of another program on a recorded log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StudyTrajectory {
    /// Source and name in the tables.
    #[serde(with = "as_text")]
    pub spec: TrajectorySpec,
    /// SHA-256 of its file; empty for a topic of the log.
    pub sha256: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedFlight {
    pub recipe: FlightRecipe,
    /// Disturbances in addition to the recipe's.
    pub disturb: Vec<String>,
    pub seed: u64,
}

impl SimulatedFlight {
    /// Name of the flight's folder: the hash of everything that determines the bytes of its log.
    pub fn id(&self) -> String {
        let text = serde_json::to_string(self).expect("plain values have a JSON text");
        hex(&Sha256::digest(format!("flight {KEY_RULES} {text}"))[..8])
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobLog {
    Recorded(Box<RecordedLog>),
    /// A simulated log, which is rendered once for all jobs.
    Simulated(Box<SimulatedFlight>),
}

impl JobLog {
    /// Name in the tables.
    pub fn name(&self) -> &str {
        match self {
            Self::Recorded(log) => &log.name,
            Self::Simulated(flight) => &flight.recipe.name,
        }
    }

    /// Processed duration in seconds, `None` if it is unknown before the log exists.
    pub fn duration_s(&self) -> Option<f64> {
        match self {
            Self::Recorded(log) => {
                let rest_s = (log.length_s - log.start_s).max(0.0);
                Some(log.duration_s.map_or(rest_s, |duration_s| duration_s.min(rest_s)))
            }
            Self::Simulated(flight) => flight.recipe.duration_s,
        }
    }
}

/// Cameras of a bundle adjustment over the whole log, the limit for runs with the tracks of the same cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bundle {
    /// Static camera and gimbal camera.
    Both,
    Static,
}

impl Named for Bundle {
    const NAMES: &'static [(Self, &'static str)] = &[(Self::Both, "bundle"), (Self::Static, "static-bundle")];
}

/// Subject that a job evaluates on its log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobSubject {
    Run(#[serde(with = "as_text")] RunSpec),
    Trajectory(StudyTrajectory),
    Bundle(Bundle),
}

impl JobSubject {
    /// Name in the tables.
    pub fn label(&self) -> &str {
        match self {
            Self::Run(spec) => &spec.label,
            Self::Trajectory(trajectory) => &trajectory.spec.label,
            Self::Bundle(bundle) => bundle.name(),
        }
    }

    /// False for a trajectory of another program, which is read in negligible time and memory.
    pub fn computes(&self) -> bool {
        !matches!(self, Self::Trajectory(_))
    }

    /// The specification of the run, `None` for others.
    pub fn run(&self) -> Option<&RunSpec> {
        match self {
            Self::Run(spec) => Some(spec),
            Self::Trajectory(_) | Self::Bundle(_) => None,
        }
    }
}

/// The normalized specification of a run; `trajectory:LABEL` and `offline:LABEL` are never run specifications.
impl fmt::Display for JobSubject {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Run(spec) => spec.fmt(formatter),
            Self::Trajectory(trajectory) => write!(formatter, "trajectory:{}", trajectory.spec.label),
            Self::Bundle(bundle) => write!(formatter, "offline:{}", bundle.name()),
        }
    }
}

/// One run specification, one bundle adjustment, or one trajectory of another program, on one log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StudyJob {
    pub study: String,
    pub log: JobLog,
    pub disturbance: String,
    pub perturbation: RigPerturbation,
    /// Seed, `None` if nothing is random.
    pub seed: Option<u64>,
    pub subject: JobSubject,
}

/// A specification as its normalized text.
mod as_text {
    use std::fmt::Display;
    use std::str::FromStr;

    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    pub(super) fn serialize<T: Display, S: Serializer>(spec: &T, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(spec)
    }

    pub(super) fn deserialize<'de, T, D>(deserializer: D) -> Result<T, D::Error>
    where
        T: FromStr<Err: Display>,
        D: Deserializer<'de>,
    {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}

/// Inputs of a job that determine its results, without paths.
#[derive(Serialize)]
struct KeyInputs<'a> {
    rules: u32,
    program: &'a str,
    log: &'a str,
    content: [&'a str; 3],
    span: Option<(f64, Option<f64>)>,
    disturbance: &'a str,
    perturbation: &'a RigPerturbation,
    seed: Option<u64>,
    spec: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    trajectory: Option<String>,
}

impl StudyJob {
    /// SHA-256 of the inputs, in hexadecimal: content of log and rig, normalized specification, perturbation, seed and
    /// program. File paths are not included.
    pub fn key(&self, program: &str) -> String {
        let flight;
        let (content, span) = match &self.log {
            JobLog::Recorded(log) => {
                ([log.sha256.as_str(), &log.rig_sha256, &log.truth_sha256], Some((log.start_s, log.duration_s)))
            }
            JobLog::Simulated(simulated) => {
                flight = simulated.id();
                ([flight.as_str(), "", ""], None)
            }
        };
        let inputs = KeyInputs {
            rules: KEY_RULES,
            program,
            log: self.log.name(),
            content,
            span,
            disturbance: &self.disturbance,
            perturbation: &self.perturbation,
            seed: self.seed,
            spec: self.subject.to_string(),
            trajectory: match &self.subject {
                JobSubject::Run(_) | JobSubject::Bundle(_) => None,
                JobSubject::Trajectory(StudyTrajectory { spec, sha256 }) if sha256.is_empty() => {
                    Some(spec.source.to_string())
                }
                JobSubject::Trajectory(StudyTrajectory { sha256, .. }) => Some(sha256.clone()),
            },
        };
        let text = serde_json::to_string(&inputs).expect("plain values have a JSON text");
        hex(&Sha256::digest(text))
    }

    /// One line of text: log, levels, seed and specification.
    pub fn describe(&self) -> String {
        let mut parts = vec![self.log.name().to_owned()];
        let levels = [&self.disturbance, &self.perturbation.name];
        parts.extend(levels.into_iter().filter(|name| *name != "none").cloned());
        parts.extend(self.seed.map(|seed| format!("seed {seed}")));
        parts.push(self.subject.to_string());
        parts.join(", ")
    }
}

pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().concat()
}

#[derive(Clone, Debug, PartialEq)]
pub struct KeyedJob {
    /// Key of the job, see [`StudyJob::key`].
    pub key: String,
    pub job: StudyJob,
}
