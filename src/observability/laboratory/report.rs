//! Report of one experiment: a table with one column per parameterization, then the directions and the spectrum of
//! each.

use std::fmt;

use serde::Serialize;

use super::{FRAME_PERIOD_S, LaboratoryResult, LaboratorySetup, PIXEL_SIGMA_PX};
use crate::estimator::{JointKnowledge, PoseKnowledge};
use crate::gimbal::ParameterNames;
use crate::observability::{CalibrationDirection, Deficit};
use crate::table::text::{TextTable, left, right};
use crate::text::Named as _;

/// Results of an experiment in several parameterizations.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LaboratoryReport {
    pub mechanism: String,
    pub joint_count: usize,
    pub motion: String,
    pub motion_meaning: String,
    /// Names of the joints that do not move.
    pub frozen_joints: Vec<String>,
    /// Source of the joint angles, with its σ.
    pub joint_angles: String,
    pub poses: String,
    /// True with an IMU that moves with the camera.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub gimbal_imu: bool,
    pub frames: usize,
    /// Time between frames, in seconds.
    pub frame_period_s: f64,
    pub landmarks: usize,
    pub pixel_sigma_px: f64,
    /// Sets of sensor columns; `None` without columns of sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub columns: Option<String>,
    /// Readout time of the rolling shutter, in seconds; `None` without columns of sensors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub readout_s: Option<f64>,
    /// Parameterizations in the requested order.
    pub forms: Vec<FormReport>,
}

/// Results of one parameterization.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FormReport {
    pub form: String,
    pub names: Vec<String>,
    pub rank_structural: usize,
    pub rank_informed: usize,
    /// Number of unobservable columns by cause.
    pub deficit: Deficit,
    /// Singular values, scaled by 10° and 3 cm, largest first.
    pub singular_values: Vec<f64>,
    /// Singular values at or below this are structural zeros.
    pub structural_threshold: f64,
    /// Directions with a smaller singular value are uninformed.
    pub informed_threshold: f64,
    pub margins: Vec<Margin>,
    /// Null and uninformed directions, least observable first.
    pub directions: Vec<DirectionReport>,
    /// Null directions in closed form, compared with the measurement.
    pub known: Vec<KnownReport>,
}

/// A null direction in closed form, compared with the measurement.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KnownReport {
    /// Reason in one sentence with its equation.
    pub reason: String,
    /// Response of the window relative to the reference of the rank rule.
    pub response: f64,
    /// True if the measurement confirms the direction.
    pub agrees: bool,
}

/// Singularity margin of the parameterization.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margin {
    #[serde(rename = "lock")]
    pub singularity: String,
    /// 0 when singular, 1 at the largest distance.
    pub margin: f64,
}

/// A null or uninformed direction.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DirectionReport {
    /// True if structurally unobservable, false if only uninformed.
    pub null: bool,
    pub singular_value: f64,
    pub parameters: Vec<ParameterWeight>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterWeight {
    pub name: String,
    /// Weight in the unit direction, columns scaled by 10° and 3 cm.
    pub weight: f64,
}

/// Smaller weights are omitted.
const SMALLEST_WEIGHT: f64 = 0.005;

impl LaboratoryReport {
    /// Collects the results of an experiment.
    pub fn new(setup: &LaboratorySetup, results: &[LaboratoryResult]) -> Self {
        let joint_name = |joint: &usize| {
            let known = setup.mechanism.joints.get(*joint);
            known.map_or_else(|| format!("joint {}", joint + 1), |joint| joint.name.clone())
        };
        Self {
            mechanism: setup.mechanism.name.clone(),
            joint_count: setup.mechanism.chain.joint_count(),
            motion: setup.motion.name().to_owned(),
            motion_meaning: setup.motion.meaning().to_owned(),
            frozen_joints: setup.frozen.iter().map(joint_name).collect(),
            joint_angles: match setup.joints {
                JointKnowledge::Known => "known".to_owned(),
                JointKnowledge::Encoder(sigma_rad) => format!("from encoders, σ {:.3}°", sigma_rad.to_degrees()),
                JointKnowledge::Unknown => "unknown".to_owned(),
            },
            poses: match setup.poses {
                PoseKnowledge::Known => "known",
                PoseKnowledge::Imu { biases_known: true, .. } => "from the IMU, its biases known",
                PoseKnowledge::Imu { biases_known: false, .. } => "from the IMU, its biases unknown",
            }
            .to_owned(),
            gimbal_imu: setup.gimbal_imu,
            frames: setup.frames,
            frame_period_s: FRAME_PERIOD_S,
            landmarks: setup.landmarks,
            pixel_sigma_px: PIXEL_SIGMA_PX,
            columns: setup.columns.any().then(|| setup.columns.to_string()),
            readout_s: setup.columns.any().then_some(setup.readout_s),
            forms: results.iter().map(|result| FormReport::new(result, &setup.mechanism.names)).collect(),
        }
    }
}

impl FormReport {
    fn new(result: &LaboratoryResult, names: &ParameterNames) -> Self {
        let rank = &result.rank;
        let columns: Vec<String> = rank.parameters.iter().map(|parameter| names.name(*parameter)).collect();
        Self {
            form: result.form.name(),
            directions: rank.directions.iter().map(|it| DirectionReport::new(it, &columns)).collect(),
            names: columns,
            rank_structural: rank.rank_structural,
            rank_informed: rank.rank_informed,
            deficit: result.rank.deficit(),
            singular_values: rank.singular_values.clone(),
            structural_threshold: rank.structural_threshold,
            informed_threshold: rank.informed_threshold,
            margins: rank
                .margins
                .iter()
                .map(|(singularity, margin)| Margin { singularity: names.singularity(*singularity), margin: *margin })
                .collect(),
            known: rank
                .known
                .iter()
                .map(|known| KnownReport {
                    reason: known.loss.reason(rank.joint_count, names),
                    response: known.response,
                    agrees: known.agrees,
                })
                .collect(),
        }
    }
}

impl DirectionReport {
    fn new(direction: &CalibrationDirection, names: &[String]) -> Self {
        let mut parameters: Vec<ParameterWeight> = names
            .iter()
            .zip(&direction.weights)
            .filter(|(_, weight)| weight.abs() >= SMALLEST_WEIGHT)
            .map(|(name, weight)| ParameterWeight { name: name.clone(), weight: *weight })
            .collect();
        parameters.sort_by(|a, b| b.weight.abs().total_cmp(&a.weight.abs()));
        Self { null: direction.structural, singular_value: direction.singular_value, parameters }
    }
}

impl fmt::Display for DirectionReport {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 8;
        for (place, entry) in self.parameters.iter().take(SHOWN).enumerate() {
            let sign = match (place, entry.weight < 0.0) {
                (0, false) => "",
                (0, true) => "−",
                (_, false) => " + ",
                (_, true) => " − ",
            };
            write!(out, "{sign}{:.2} {}", entry.weight.abs(), entry.name)?;
        }
        if self.parameters.len() > SHOWN {
            write!(out, " and {} smaller weights", self.parameters.len() - SHOWN)?;
        }
        Ok(())
    }
}

impl fmt::Display for LaboratoryReport {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.joint_count == 1 { "" } else { "s" };
        writeln!(out, "mechanism  {} ({} joint{plural})", self.mechanism, self.joint_count)?;
        writeln!(out, "motion     {}: {}", self.motion, self.motion_meaning)?;
        if !self.frozen_joints.is_empty() {
            writeln!(out, "           {} fixed", self.frozen_joints.join(", "))?;
        }
        let second = if self.gimbal_imu { ", an IMU that moves with the camera" } else { "" };
        writeln!(out, "measured   joint angles {}, poses {}{second}", self.joint_angles, self.poses)?;
        if let Some(columns) = &self.columns {
            writeln!(out, "columns    {columns}, readout {:.0} ms", 1e3 * self.readout_s.unwrap_or_default())?;
        }
        writeln!(
            out,
            "window     {} frames every {} s, {} landmarks, pixel σ {} px; columns scaled by 10° and 3 cm\n",
            self.frames, self.frame_period_s, self.landmarks, self.pixel_sigma_px
        )?;
        write!(out, "{}", self.by_form())?;
        for form in &self.forms {
            writeln!(out, "\n{form}")?;
        }
        Ok(())
    }
}

impl LaboratoryReport {
    /// Ranks and deficits with a column per parameterization.
    fn by_form(&self) -> TextTable {
        /// Label, and the text of a form.
        type Row<'a> = (&'a str, &'a dyn Fn(&FormReport) -> String);
        let least_observable = |form: &FormReport| {
            let least = form.rank_structural.checked_sub(1).map(|index| form.singular_values[index]);
            least.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"))
        };
        let least_margin = |form: &FormReport| {
            let least = form.margins.iter().min_by(|a, b| a.margin.total_cmp(&b.margin));
            least.map_or_else(|| "-".to_owned(), |margin| format!("{:.2}", margin.margin))
        };
        let rows: [Row<'_>; 9] = [
            ("columns", &|form| form.names.len().to_string()),
            ("structural rank", &|form| form.rank_structural.to_string()),
            ("informed rank", &|form| form.rank_informed.to_string()),
            ("lost to the parameterization", &|form| form.deficit.parameterization.to_string()),
            ("lost to stationary joints", &|form| form.deficit.joints.to_string()),
            ("absorbed by free angles", &|form| form.deficit.absorbed.to_string()),
            ("lost to the motion", &|form| form.deficit.motion.to_string()),
            ("smallest singular value > 0", &least_observable),
            ("least singularity margin", &least_margin),
        ];
        let forms = self.forms.iter().map(|form| right(form.form.as_str(), form.form.len().max(9) + 2));
        let rows = rows.map(|(label, cell)| [label.to_owned()].into_iter().chain(self.forms.iter().map(cell)));
        TextTable::new([left("", 30)].into_iter().chain(forms), rows).not_indented()
    }
}

impl fmt::Display for FormReport {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "{}", self.form)?;
        if self.directions.is_empty() {
            writeln!(out, "  no null or uninformed direction")?;
        }
        for direction in &self.directions {
            let (mark, value) = if direction.null {
                ("null", String::new())
            } else {
                ("uninformed", format!("{:.3}  ", direction.singular_value))
            };
            writeln!(out, "  {mark}  {value}{direction}")?;
        }
        for known in &self.known {
            let mark = if known.agrees { "confirmed" } else { "NOT CONFIRMED" };
            writeln!(out, "  {mark}  {}", known.reason)?;
        }
        let values: Vec<String> = self
            .singular_values
            .iter()
            .map(|value| if *value <= self.structural_threshold { "0".to_owned() } else { format!("{value:.3}") })
            .collect();
        let lines: Vec<String> = values.chunks(12).map(|part| part.join(" ")).collect();
        write!(out, "  singular values  {}", lines.join("\n                   "))?;
        write!(out, "  (0: at most {:.0e})", self.structural_threshold)
    }
}
