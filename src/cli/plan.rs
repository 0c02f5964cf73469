//! `dcvins plan`: the motion that calibrates a rig, within the limits of its joints and of the vehicle.

use dcvins::files::RigFile as _;
use std::fmt::{self, Display, Formatter};
use std::ops::RangeInclusive;
use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use dcvins::export::{self, MissionStart, PlanReport, PlannedFlight};
use dcvins::gimbal::ParameterId;
use dcvins::observability::laboratory::{
    EnteredLimits, MotionPlanError, PLAN_DURATION_S, PLAN_SECONDS, PlanCriterion, PlanOptions, SCENE_M, Situation,
    plan_by_hand, plan_motion, scene_distances_m,
};
use dcvins::sensors::Rig;
use dcvins::session::{self, RunSpec};

use crate::cli::exit::ExitOutcome;
use crate::cli::interrupt::Interrupt;
use crate::cli::shared_arguments::within;
use crate::cli::terminal::{Progress, notify, print_report};

const SLOW: EnteredLimits = EnteredLimits::SLOW;

#[derive(Args, Clone, Debug)]
pub(crate) struct PlanArguments {
    /// The rig; its prior is the uncertainty before the motion.
    #[arg(value_name = "RIG")]
    pub rig: PathBuf,
    /// Folder for plan.json, plan.txt, tables of σ and of the motion, and a trajectory of the joints for ROS 2.
    #[arg(short = 'o', long, visible_alias = "output", value_name = "DIR")]
    pub out: PathBuf,
    /// The run that will estimate the calibration, as for `dcvins run`: NAME[:key=value,…].
    #[arg(long, value_name = "SPEC", default_value = "auto")]
    pub run: RunSpec,
    /// Duration of the motion.
    #[arg(long, value_name = "SECONDS", default_value_t = PLAN_SECONDS, value_parser = duration)]
    pub duration: f64,
    /// Quantity that the search minimizes.
    #[arg(long, value_enum, default_value_t = Criterion::Worst)]
    pub criterion: Criterion,
    /// Parameters that matter, such as pitch.d [default: all].
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    pub parameters: Vec<String>,
    /// Only moves with words, for a person who moves the vehicle: a list of steps instead of curves.
    #[arg(long)]
    pub by_hand: bool,
    /// Largest rotation of a joint to either side of its middle, in degrees; the rig's ranges hold too.
    #[arg(long, value_name = "DEG", default_value_t = SLOW.joint_range_deg, value_parser = angle)]
    pub joint_range_deg: f64,
    /// Largest rate of a joint, in degrees per second.
    #[arg(long, value_name = "DEG/S", default_value_t = SLOW.joint_rate_deg_per_s, value_parser = rate)]
    pub joint_rate_deg: f64,
    /// Largest acceleration of a joint, in degrees per second squared.
    #[arg(long, value_name = "DEG/S²", default_value_t = SLOW.joint_acceleration_deg_per_s2, value_parser = rate)]
    pub joint_acceleration_deg: f64,
    /// Largest speed of the vehicle, in metres per second.
    #[arg(long, value_name = "M/S", default_value_t = SLOW.speed_m_per_s, value_parser = linear)]
    pub speed: f64,
    /// Largest acceleration of the vehicle, in metres per second squared.
    #[arg(long, value_name = "M/S²", default_value_t = SLOW.acceleration_m_per_s2, value_parser = linear)]
    pub acceleration: f64,
    /// Largest distances from the start: forward or back, sideways, up or down, in metres.
    #[arg(long = "box", value_name = "X,Y,Z", default_value_t = Numbers(SLOW.reach_m), value_parser = reach)]
    pub reach: Numbers<3>,
    /// Largest rotation of the vehicle about the vertical to either side, in degrees.
    #[arg(long, value_name = "DEG", default_value_t = SLOW.heading_deg, value_parser = angle)]
    pub heading_deg: f64,
    /// Largest rate of that rotation, in degrees per second.
    #[arg(long, value_name = "DEG/S", default_value_t = SLOW.heading_rate_deg_per_s, value_parser = rate)]
    pub heading_rate_deg: f64,
    /// Nearest and farthest distance of the scene, in metres.
    #[arg(long, value_name = "NEAR,FAR", default_value_t = Numbers(SCENE_M), value_parser = distance)]
    pub distance: Numbers<2>,
    /// Number of motions from which the search starts.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=64))]
    pub starts: u16,
    /// Number of changes that are tried from each start.
    #[arg(long, value_name = "N", default_value_t = 1500, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub trials: u32,
    /// Seed of the random numbers of the search.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Also write the motion as missions of ArduPilot and PX4 that begin here: latitude and longitude in degrees, height above
    /// home in metres [default: 10], heading in degrees from north [default: 0].
    #[arg(long, value_name = "LAT,LON,HEIGHT,HEADING", allow_hyphen_values = true)]
    pub home: Option<MissionStart>,
    /// Overwrite any existing files. Without it, only a plan for a rig of the same name is replaced.
    #[arg(long)]
    pub force: bool,
    /// Print plan.json instead of the text.
    #[arg(long)]
    pub json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Criterion {
    /// The largest ratio of σ to the prior's σ.
    Worst,
    /// The largest ratio of σ to the required accuracy of the rig.
    Required,
    /// The determinant of the covariance.
    Determinant,
}

/// Numbers between commas, the values of `--box` and `--distance`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Numbers<const N: usize>([f64; N]);

impl<const N: usize> Display for Numbers<N> {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        out.write_str(&self.0.map(|number| number.to_string()).join(","))
    }
}

impl<const N: usize> Numbers<N> {
    /// Numbers that are each within a range.
    fn within(text: &str, range: &RangeInclusive<f64>) -> Option<Self> {
        let parse = |number: &str| number.trim().parse::<f64>().ok().filter(|value| range.contains(value));
        let numbers: Option<Vec<f64>> = text.split(',').map(parse).collect();
        numbers.and_then(|numbers| <[f64; N]>::try_from(numbers).ok()).map(Self)
    }
}

fn duration(text: &str) -> Result<f64, String> {
    let [shortest_s, longest_s] = PLAN_DURATION_S;
    within(text, shortest_s..=longest_s, "seconds")
}

fn angle(text: &str) -> Result<f64, String> {
    within(text, 1.0..=180.0, "degrees")
}

fn rate(text: &str) -> Result<f64, String> {
    within(text, 1.0..=10_000.0, "degrees per second, or per second squared,")
}

fn linear(text: &str) -> Result<f64, String> {
    within(text, 0.01..=100.0, "metres per second, or per second squared,")
}

fn reach(text: &str) -> Result<Numbers<3>, String> {
    let expected = || "expected three lengths from 0.01 to 100 metres, as in 1.5,1.5,1".to_owned();
    Numbers::within(text, &(0.01..=100.0)).ok_or_else(expected)
}

fn distance(text: &str) -> Result<Numbers<2>, String> {
    let distances = Numbers::within(text, &(0.2..=1000.0)).filter(|Numbers([near, far])| near <= far);
    distances.ok_or_else(|| "expected the nearest and the farthest distance, 0.2 to 1000 metres, as in 4,12".to_owned())
}

pub(crate) fn plan(arguments: &PlanArguments) -> Result<ExitOutcome> {
    let rig = Rig::from_file(&arguments.rig)?;
    export::check_plan_folder(&arguments.out, &rig.name, arguments.force)?;
    let situation = session::situation_before_flight(&rig, &arguments.run, scene_distances_m(arguments.distance.0))?;
    let options = arguments.options(&situation)?;
    let interrupt = Interrupt::watch()?;
    let progress = Progress::new();
    let planned = if arguments.by_hand {
        plan_by_hand(&situation, &options).map(PlannedFlight::ByHand)
    } else {
        let watch = |ratio: f64| {
            progress.show(ratio, || "searching the motion".to_owned());
            interrupt.control_flow()
        };
        plan_motion(&situation, &options, &watch).map(|plan| PlannedFlight::Motion(Box::new(plan)))
    };
    drop(progress);
    let plan = match planned {
        Err(error @ MotionPlanError::Interrupted) => {
            notify(&format!("dcvins: {error}"));
            return Ok(ExitOutcome::Interrupted);
        }
        planned => planned?,
    };
    let report = PlanReport {
        rig: rig.name.clone(),
        run: arguments.run.label.clone(),
        parameterization: situation.chain.parameterization().to_string(),
        criterion: match arguments.criterion {
            Criterion::Worst => "worst",
            Criterion::Required => "required",
            Criterion::Determinant => "determinant",
        },
        scene_m: arguments.distance.0.into(),
        seed: arguments.seed,
        plan,
    };
    let joint_names: Vec<String> = situation.joints.iter().map(|joint| joint.name.clone()).collect();
    let chain = situation.chain.to_classical();
    let mission = arguments.home.map(|start| (&chain, start));
    let written = export::write_plan(&report, &joint_names, mission, &arguments.out)?;
    print_report(&report, arguments.json)?;
    for path in written {
        notify(&path.display().to_string());
    }
    Ok(ExitOutcome::Success)
}

impl PlanArguments {
    fn options(&self, situation: &Situation) -> Result<PlanOptions> {
        let limits = EnteredLimits {
            joint_range_deg: self.joint_range_deg,
            joint_rate_deg_per_s: self.joint_rate_deg,
            joint_acceleration_deg_per_s2: self.joint_acceleration_deg,
            speed_m_per_s: self.speed,
            acceleration_m_per_s2: self.acceleration,
            reach_m: self.reach.0,
            heading_deg: self.heading_deg,
            heading_rate_deg_per_s: self.heading_rate_deg,
        };
        Ok(PlanOptions {
            duration_s: self.duration,
            criterion: match self.criterion {
                Criterion::Worst => PlanCriterion::Worst,
                Criterion::Required => PlanCriterion::Required,
                Criterion::Determinant => PlanCriterion::Determinant,
            },
            parameters: self.chosen(situation)?,
            limits: limits.around(situation),
            starts: usize::from(self.starts),
            trials: self.trials as usize,
            seed: self.seed,
        })
    }

    /// Parameters that `--parameters` names.
    fn chosen(&self, situation: &Situation) -> Result<Vec<ParameterId>> {
        let known = situation.chain.parameters();
        let mut chosen = Vec::new();
        for name in &self.parameters {
            let Some(parameter) = known.iter().find(|parameter| situation.names.name(**parameter) == *name) else {
                let names: Vec<String> = known.iter().map(|parameter| situation.names.name(*parameter)).collect();
                bail!("--parameters names '{name}', the run estimates {}", names.join(", "));
            };
            chosen.push(*parameter);
        }
        Ok(chosen)
    }
}
