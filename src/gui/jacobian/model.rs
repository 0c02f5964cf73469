//! The blocks of one step's Jacobian and their rectangles, as fractions of width and height.

use std::sync::Arc;

use crate::camera::CameraModel;
use crate::estimator::{ColumnBlock, ColumnId, JacobianFactor, StepJacobian};
use crate::geometry::Dimension;
use crate::gimbal::{ParameterGroup, ParameterId, ParameterNames};
use crate::gui::units::{Shown, counted};
use crate::sensors::Rig;
use crate::session::{RunRecord, StepRecord};
use crate::text::Named as _;

/// Maximum number of decades of the colour map.
const MAX_DECADES: f64 = 6.0;

/// Label of the calibration columns if they are of one group.
pub(super) const ONE_GROUP: &str = "calibration";

/// A row or a column of blocks, or a group of them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ColumnStrip {
    pub(super) name: String,
    /// Start and end as fractions of the axis.
    pub(super) begin: f32,
    pub(super) end: f32,
}

/// The rows or columns of one axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MatrixAxis {
    pub(super) strips: Vec<ColumnStrip>,
    pub(super) groups: Vec<ColumnStrip>,
}

/// The block matrix of one step.
#[derive(Clone, Debug)]
pub(super) struct JacobianModel {
    /// Kept so that its address stays unique.
    pub(super) step: Arc<StepRecord>,
    pub(super) jacobian: StepJacobian,
    pub(super) rows: MatrixAxis,
    pub(super) columns: MatrixAxis,
    /// Exponents of the norms with the first and last colour.
    pub(super) decades: (f64, f64),
    pub(super) joint_count: usize,
}

/// Cameras of a run in the order of its features, the main camera first.
pub(in crate::gui) fn cameras<'a>(rig: &'a Rig, run: &RunRecord, step: &StepRecord) -> Vec<&'a CameraModel> {
    let rigid = step.report.calibration.further_cameras.iter().map(|camera| &camera.key);
    let keys = std::iter::once(&run.camera_key).chain(rigid);
    keys.map_while(|key| rig.camera(key).ok()).map(|camera| &camera.model).collect()
}

impl JacobianModel {
    /// Number of rows and columns, and the range of the norms, in words.
    pub(super) fn summary(&self) -> String {
        let rows = counted(self.rows.strips.len(), "row");
        let columns = counted(self.columns.strips.len(), "column");
        format!("{rows} and {columns} of blocks, norms from 1e{:.0} to 1e{:.0}", self.decades.0, self.decades.1)
    }

    /// The matrix of a step; `None` if it has no linearization.
    pub(super) fn of_step(rig: &Rig, names: &ParameterNames, run: &RunRecord, step: &Arc<StepRecord>) -> Option<Self> {
        let jacobian = step.report.jacobian(&cameras(rig, run, step))?;
        let norms = jacobian.rows.iter().flat_map(|row| &row.norms).map(|(_, norm)| f64::from(*norm).log10());
        let (low, high) =
            norms.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), power| (low.min(power), high.max(power)));
        if !(low.is_finite() && high.is_finite()) {
            return None;
        }
        let high = high.ceil();
        let low = low.floor().max(high - MAX_DECADES).min(high - 1.0);
        Some(Self {
            step: Arc::clone(step),
            rows: rows_of(&jacobian),
            columns: columns_of(&jacobian, names),
            jacobian,
            decades: (low, high),
            joint_count: step.report.newest().map_or(0, |newest| newest.joint_angles_rad.len()),
        })
    }

    /// Position of a norm in the colour map, 0 to 1.
    pub(super) fn color_fraction(&self, norm: f32) -> f64 {
        let (low, high) = self.decades;
        ((f64::from(norm).log10() - low) / (high - low)).clamp(0.0, 1.0)
    }

    /// Norm of a block, 0 for an empty one.
    pub(super) fn norm(&self, row: usize, column: usize) -> f32 {
        let row = self.jacobian.rows.get(row).map_or(&[][..], |row| &row.norms);
        row.iter().find(|(known, _)| usize::from(*known) == column).map_or(0.0, |(_, norm)| *norm)
    }
}

impl MatrixAxis {
    /// Index of the row or column at a fraction of the axis.
    pub(super) fn at(&self, fraction: f32) -> Option<usize> {
        self.strips.iter().position(|strip| strip.begin <= fraction && fraction < strip.end)
    }

    /// Lays out rows or columns, given the name, group and weight of each: group after group, within a group in order.
    fn lay_out(strips: impl Iterator<Item = (String, usize, f32)>, group_names: &[String]) -> Self {
        let strips: Vec<_> = strips.collect();
        let total: f32 = strips.iter().map(|(_, _, weight)| weight).sum();
        let mut order: Vec<usize> = (0..strips.len()).collect();
        order.sort_by_key(|index| strips[*index].1);
        let placed = strips.iter().map(|(name, _, _)| ColumnStrip { name: name.clone(), begin: 0.0, end: 0.0 });
        let mut axis = Self { strips: placed.collect(), groups: Vec::new() };
        let mut at = 0.0;
        for index in order {
            let (_, group, weight) = strips[index];
            let (begin, end) = (at, at + weight / total);
            at = end;
            let group_name = group_names.get(group).cloned().unwrap_or_default();
            match axis.groups.last_mut().filter(|last| last.name == group_name) {
                Some(last) => last.end = end,
                None => axis.groups.push(ColumnStrip { name: group_name, begin, end }),
            }
            (axis.strips[index].begin, axis.strips[index].end) = (begin, end);
        }
        axis
    }
}

pub(in crate::gui) fn name_of(factor: &JacobianFactor) -> String {
    match factor {
        JacobianFactor::Feature(id) => format!("feature {}", id.0),
        JacobianFactor::Imu { from, to } => format!("IMU {from} to {to}"),
        JacobianFactor::GimbalImu { from, to } => format!("gimbal IMU {from} to {to}"),
        JacobianFactor::Encoder(frame) => format!("encoders {frame}"),
        JacobianFactor::ZeroVelocity => "zero velocity".to_owned(),
        JacobianFactor::CalibrationPrior => "rig prior".to_owned(),
        JacobianFactor::MarginalizationPrior => "marginalization prior".to_owned(),
    }
}

/// Lays out features at the top, the other factors below; each group has a minimum height.
fn rows_of(jacobian: &StepJacobian) -> MatrixAxis {
    /// Fractions of the height for visual, IMU and encoder rows and priors.
    const HEIGHT_RATIOS: [f32; 4] = [0.62, 0.15, 0.13, 0.1];
    let group_of = |factor: &JacobianFactor| match factor {
        JacobianFactor::Feature(_) => 0,
        JacobianFactor::Imu { .. } | JacobianFactor::GimbalImu { .. } => 1,
        JacobianFactor::Encoder(_) => 2,
        JacobianFactor::ZeroVelocity | JacobianFactor::CalibrationPrior | JacobianFactor::MarginalizationPrior => 3,
    };
    let mut counts = [0_usize; 4];
    for row in &jacobian.rows {
        counts[group_of(&row.factor)] += 1;
    }
    let names = [
        counted(counts[0], "feature"),
        counted(counts[1], "IMU interval"),
        counted(counts[2], "encoder frame"),
        "priors".to_owned(),
    ];
    let strips = jacobian.rows.iter().map(|row| {
        let group = group_of(&row.factor);
        (name_of(&row.factor), group, HEIGHT_RATIOS[group] / counts[group].max(1) as f32)
    });
    MatrixAxis::lay_out(strips, &names)
}

/// Lays out the columns: wide for the calibration, so that they can be read one by one, narrow for the states of the
/// frames. The calibration is split by the group of its parameters if it has several.
pub(super) fn columns_of(jacobian: &StepJacobian, names: &ParameterNames) -> MatrixAxis {
    let states = ["joints", "poses", "velocities, biases", "depth"];
    let mut groups: Vec<String> =
        ParameterGroup::all().map(ParameterGroup::name).chain(states).map(str::to_owned).collect();
    let parameters = || jacobian.columns.iter().filter_map(|block| block.id.parameter());
    if parameters().all(|parameter| Some(parameter.group()) == parameters().next().map(ParameterId::group)) {
        groups[..ParameterGroup::NAMES.len()].fill(ONE_GROUP.to_owned());
    }
    let states = ParameterGroup::NAMES.len();
    let strips = jacobian.columns.iter().map(|block| {
        let (group, weight) = match block.id {
            ColumnId::Calibration(parameter) => {
                let place = ParameterGroup::all().position(|group| group == parameter.group());
                (place.unwrap_or(0), 3.0)
            }
            ColumnId::Joints(_) => (states, 1.0),
            ColumnId::Pose(_) => (states + 1, 1.2),
            ColumnId::VelocityBias(_) | ColumnId::GimbalImu(_) => (states + 2, 1.2),
            ColumnId::InverseDepth => (states + 3, 4.0),
        };
        (column_name(block.id, names), group, weight)
    });
    MatrixAxis::lay_out(strips, &groups)
}

pub(in crate::gui) fn column_name(id: ColumnId, names: &ParameterNames) -> String {
    match id {
        ColumnId::Calibration(parameter) => names.name(parameter),
        ColumnId::Joints(frame) => format!("joints {frame}"),
        ColumnId::Pose(frame) => format!("pose {frame}"),
        ColumnId::VelocityBias(frame) => format!("velocity-bias {frame}"),
        ColumnId::GimbalImu(frame) => format!("gimbal velocity-bias {frame}"),
        ColumnId::InverseDepth => "inverse depth".to_owned(),
    }
}

/// Names and shown units of the columns of a block of joints: angles, then with a rolling shutter rates and
/// accelerations.
pub(super) fn joint_columns(columns: usize, joint_count: usize) -> Vec<(String, &'static str)> {
    let joints = joint_count.clamp(1, columns.max(1));
    let derivatives = [("", "°"), ("'", "(°/s)"), ("''", "(°/s²)")];
    let of = |column: usize| {
        let (mark, unit) = derivatives.get(column / joints).copied().unwrap_or_default();
        (format!("q{}{mark}", column % joints + 1), unit)
    };
    (0..columns).map(of).collect()
}

/// Text of one per shown unit, `px/mm`; per one if the quantity has no unit.
pub(super) fn per(unit: &str, shown: Shown) -> String {
    format!("{unit}/{}", if shown.unit.is_empty() { "1" } else { shown.unit.trim() })
}

/// Unit of a column in which the norms are given.
pub(super) fn unit_text(block: &ColumnBlock, joint_count: usize) -> &'static str {
    match block.id {
        ColumnId::Calibration(parameter) => match (parameter.group(), parameter.dimension()) {
            (ParameterGroup::Imu, Dimension::Angle) => "σ per 0.01 rad",
            (ParameterGroup::Imu, _) => "σ per 1 %",
            (_, Dimension::Angle) => "σ per 10°",
            (_, Dimension::Length) => "σ per 3 cm",
            (_, Dimension::Time) => "σ per 20 ms",
            (_, Dimension::Pixel) => "σ per 10 px",
            (_, Dimension::Ratio) => "σ per 0.1",
        },
        ColumnId::Joints(_) if block.len > joint_count => "σ per 10°, 10 °/s and 10 °/s²",
        ColumnId::Joints(_) => "σ per 10°",
        ColumnId::Pose(_) => "σ per 10° and 3 cm",
        ColumnId::VelocityBias(_) | ColumnId::GimbalImu(_) => "σ per 0.1 m/s, 1 °/s and 0.1 m/s²",
        ColumnId::InverseDepth => "σ per 10 % of the inverse depth",
    }
}
