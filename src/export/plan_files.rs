//! Files of a planned motion: `plan.json`, `plan.txt`, `sigma.csv`, `motion.csv`, `joint_trajectory.yaml`, for a searched
//! motion `listed.csv`, and with a place missions of autopilots.

use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::ExportError;
use super::existing::read_index;
use super::folder_files::{json_text, remove_others, write_files};
use super::mission::{Mission, MissionStart, joint_trajectory};
use super::motion_csv::motion_csv;
use crate::files::output;
use crate::gimbal::ClassicalChain;
use crate::observability::laboratory::{HandPlan, MotionPlan, PlanTable, PlannedParameter, SigmaRow};
use crate::simulation::MotionSplines;
use crate::table::{Column, csv};
use crate::text::{printable, shortened};

const INDEX: &str = "plan.json";
const TEXT: &str = "plan.txt";
const SIGMAS: &str = "sigma.csv";
const MOTION: &str = "motion.csv";
/// Best listed motion, repeated.
const LISTED: &str = "listed.csv";
const JOINT_TRAJECTORY: &str = "joint_trajectory.yaml";
/// Missions of ArduPilot and PX4, and what they do not express.
const MISSION_FILES: [&str; 3] = ["mission.waypoints", "mission.plan", "mission.txt"];
const PLAN_FILES: [&str; 9] =
    [INDEX, TEXT, SIGMAS, MOTION, JOINT_TRAJECTORY, LISTED, MISSION_FILES[0], MISSION_FILES[1], MISSION_FILES[2]];
/// Key of the index whose value names the rig.
const RIG_KEY: &str = "rig";

/// A plan with the settings it was made with.
#[derive(Clone, Debug, Serialize)]
pub struct PlanReport {
    pub rig: String,
    /// Specification of the run that estimates the calibration.
    pub run: String,
    pub parameterization: String,
    pub criterion: &'static str,
    /// Nearest and farthest distance of the scene.
    pub scene_m: (f64, f64),
    pub seed: u64,
    #[serde(flatten)]
    pub plan: PlannedFlight,
}

/// A searched motion or moves by hand.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum PlannedFlight {
    Motion(Box<MotionPlan>),
    ByHand(HandPlan),
}

impl PlannedFlight {
    fn table(&self) -> &PlanTable {
        match self {
            Self::Motion(plan) => &plan.table,
            Self::ByHand(plan) => &plan.table,
        }
    }

    fn motion(&self) -> &MotionSplines {
        match self {
            Self::Motion(plan) => &plan.motion,
            Self::ByHand(plan) => &plan.motion,
        }
    }

    fn sigmas(&self) -> &[SigmaRow] {
        match self {
            Self::Motion(plan) => &plan.sigmas,
            Self::ByHand(plan) => &plan.sigmas,
        }
    }
}

impl Display for PlanReport {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            out,
            "{}: {}, {}, scene from {} to {} m, criterion {}",
            printable(&self.rig),
            self.run,
            self.parameterization,
            self.scene_m.0,
            self.scene_m.1,
            self.criterion
        )?;
        match &self.plan {
            PlannedFlight::Motion(plan) => {
                writeln!(out, "planned motion of {:.0} s", plan.duration_s)?;
                plan.fmt(out)
            }
            PlannedFlight::ByHand(plan) => plan.fmt(out),
        }
    }
}

/// Checks that a plan may be written into a folder: existing files of a plan must belong to the same rig.
///
/// # Errors
/// If the folder cannot be written or, without `force`, contains another plan or files of the same names.
pub fn check_plan_folder(folder: &Path, rig: &str, force: bool) -> Result<(), ExportError> {
    output::check_folder(folder).map_err(ExportError::write(folder))?;
    let Some(found) = PLAN_FILES.iter().find(|name| folder.join(name).exists()).filter(|_| !force) else {
        return Ok(());
    };
    let index = read_index(&folder.join(INDEX));
    let problem = match index.as_ref().and_then(|index| index.get(RIG_KEY)).and_then(serde_json::Value::as_str) {
        Some(other) if other == rig => return Ok(()),
        Some(other) => format!("the folder holds a plan for the rig '{}'", shortened(other, 80)),
        None => format!("the folder holds '{found}' and no {INDEX} that names its rig"),
    };
    Err(ExportError::Existing { problem, path: folder.to_owned() })
}

/// Writes the files of a plan and returns their paths; the listed motion and the missions of an earlier plan are removed if
/// this one has none. Missions begin at a place with a chain of the gimbal.
///
/// # Errors
/// If the folder or a file cannot be written.
pub fn write_plan(
    report: &PlanReport,
    joint_names: &[String],
    mission: Option<(&ClassicalChain, MissionStart)>,
    folder: &Path,
) -> Result<Vec<PathBuf>, ExportError> {
    let json = json_text(report, &folder.join(INDEX))?;
    let mut files =
        vec![(INDEX, json), (TEXT, report.to_string()), (SIGMAS, sigma_csv(report.plan.table(), report.plan.sigmas()))];
    let motion = report.plan.motion();
    files.push((MOTION, motion_csv(motion, joint_names)));
    files.push((JOINT_TRAJECTORY, joint_trajectory(motion, joint_names)));
    if let Some((chain, start)) = mission {
        let mission = Mission::new(motion, chain, start);
        let plan = json_text(&mission.plan(), &folder.join(MISSION_FILES[1]))?;
        files.extend(MISSION_FILES.into_iter().zip([mission.waypoints(), plan, mission.to_string()]));
    }
    if let PlannedFlight::Motion(plan) = &report.plan {
        files.extend(plan.listed.as_ref().map(|listed| (LISTED, motion_csv(&listed.motion, joint_names))));
    }
    let paths = write_files(files, folder)?;
    remove_others(&[&MISSION_FILES[..], &[LISTED]].concat(), &paths, folder)?;
    Ok(paths)
}

/// Predicted σ over time, one row per time and parameter.
fn sigma_csv(table: &PlanTable, rows: &[SigmaRow]) -> String {
    let of_time = |row: &SigmaRow| {
        let sigmas = row.sigmas.iter().copied().zip(&table.parameters);
        let time_s = row.time_s;
        sigmas.map(move |((sigma, ratio), parameter)| (time_s, parameter, sigma, ratio)).collect::<Vec<_>>()
    };
    csv(&sigma_columns(), rows.iter().flat_map(of_time))
}

/// Columns of time, parameter, σ and ratio.
fn sigma_columns<'a>() -> [Column<'a, (f64, &'a PlannedParameter, f64, f64)>; 5] {
    type SigmaColumn<'a> = Column<'a, (f64, &'a PlannedParameter, f64, f64)>;
    [
        SigmaColumn::new("t_s", |(time_s, ..)| *time_s).means("s", "time of the motion"),
        SigmaColumn::new("parameter", |(_, parameter, ..)| parameter.name.as_str()).means("", "name of the parameter"),
        SigmaColumn::new("unit", |(_, parameter, ..)| parameter.dimension.unit()).means("", "unit of sigma"),
        SigmaColumn::new("sigma", |(_, _, sigma, _)| *sigma).means("", "predicted standard deviation"),
        SigmaColumn::new("ratio", |(.., ratio)| *ratio).means("", "sigma over prior sigma"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::documented_tests::documented;

    #[test]
    fn the_documents_list_the_columns() {
        let table = documented(&sigma_columns());
        assert!(include_str!("../../docs/formats.md").contains(&table), "docs/formats.md lacks the table:\n{table}");
    }
}
