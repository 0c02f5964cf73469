//! Ranks and null directions of the chain on the real mechanism, by parameterization and knowledge of the angles.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::fit::StillsFit;
use super::loops::StillsLoops;
use super::observed::SetRows;
use crate::estimator::{ColumnBlock, ColumnId, FrameId, Linearization};
use crate::gimbal::{Chain, ParameterNames, Parameterization};
use crate::observability::{RankReport, analyse, parameters_of};
use crate::optimization::square_root_information;
use crate::text::Named as _;

/// Knowledge of the joint angles in an analysis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleKnowledge {
    /// Encoder readings without error.
    Known,
    /// Readings with the estimated noise of the encoders.
    Encoder,
    /// Unknown angles in every set.
    Free,
}

impl AngleKnowledge {
    const ALL: [Self; 3] = [Self::Known, Self::Encoder, Self::Free];

    pub const fn name(self) -> &'static str {
        match self {
            Self::Known => "known",
            Self::Encoder => "encoder",
            Self::Free => "free",
        }
    }
}

/// Largest number of parameters that name a direction.
const NAMED: usize = 4;

/// Ranks of one parameterization with one knowledge of the angles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StillsRank {
    pub parameterization: &'static str,
    pub angles: AngleKnowledge,
    /// Number of parameters of the chain.
    pub columns: usize,
    pub rank_structural: usize,
    /// Number of directions with σ below 10° and 3 cm.
    pub rank_informed: usize,
    /// Redundant directions of the parameterization.
    pub redundant: usize,
    /// Directions absorbed by free joint angles.
    pub absorbed: usize,
    /// Structural null directions by their largest parameters.
    pub null_directions: Vec<String>,
    /// Directions that are observable but uninformed, the least observable first.
    pub uninformed_directions: Vec<String>,
    /// Largest first, in units of 10° and 3 cm.
    pub singular_values: Vec<f64>,
}

/// Ranks at a solution for every parameterization; analyses that are not finite are missing.
pub(super) fn ranks(fit: &StillsFit<'_>, names: &ParameterNames) -> Vec<StillsRank> {
    let mut ranks = Vec::new();
    for parameterization in Parameterization::all() {
        let chain = fit.state.chain.in_parameterization(parameterization);
        for angles in AngleKnowledge::ALL {
            let free = angles == AngleKnowledge::Free;
            let linearization = linearization(fit, &chain, angles);
            let used: Vec<&Vec<f64>> = used_sets(fit, angles).map(|place| &fit.state.joints_rad[place]).collect();
            let report = analyse(&linearization, &chain, &used, free);
            ranks.extend(report.map(|report| summary(&report, parameterization, angles, names)));
        }
    }
    ranks
}

fn summary(
    report: &RankReport,
    parameterization: Parameterization,
    angles: AngleKnowledge,
    names: &ParameterNames,
) -> StillsRank {
    let directions = |structural: bool| {
        let directions = report.directions.iter().filter(|direction| direction.structural == structural);
        directions.map(|direction| parameters_of(names, &report.parameters, direction, NAMED)).collect()
    };
    let deficit = report.deficit();
    StillsRank {
        parameterization: parameterization.name(),
        angles,
        columns: report.parameters.len(),
        rank_structural: report.rank_structural,
        rank_informed: report.rank_informed,
        redundant: deficit.parameterization,
        absorbed: deficit.absorbed,
        null_directions: directions(true),
        uninformed_directions: directions(false),
        singular_values: report.singular_values.clone(),
    }
}

/// Places of the sets of an analysis: readings that are taken as exact must be right.
fn used_sets<'a>(fit: &'a StillsFit<'_>, angles: AngleKnowledge) -> impl Iterator<Item = usize> + 'a {
    let known = angles == AngleKnowledge::Known;
    (0..fit.wrong.len()).filter(move |place| !(known && fit.wrong[*place]))
}

/// Rows of all loops, whitened by the noise of pixels and map, then the rows of the readings.
fn linearization(fit: &StillsFit<'_>, chain: &Chain, angles: AngleKnowledge) -> Linearization {
    let (loops, state) = (&fit.loops, &fit.state);
    let (dof, joints, further) = (chain.dof(), chain.joint_count(), state.further.len());
    let used: Vec<usize> = used_sets(fit, angles).collect();
    let blocks = if angles == AngleKnowledge::Known { 0 } else { used.len() };
    let column_of = |place: usize| used.iter().position(|it| *it == place).map(|index| dof + joints * index);
    let columns = dof + joints * blocks + 6 * further;
    let mut jacobian = DMatrix::zeros(0, columns);
    for (station, places) in loops.stations.iter().enumerate() {
        let places: Vec<usize> = places.iter().copied().filter(|place| used.contains(place)).collect();
        let sets: Vec<SetRows> = places
            .iter()
            .map(|place| loops.sets[*place].rows(chain, &state.further, &state.joints_rad[*place]))
            .collect();
        let rows: usize = sets.iter().map(|set| set.residual.len()).sum();
        let mut block = DMatrix::zeros(rows, columns);
        let mut top = 0;
        for (place, set) in places.iter().zip(&sets) {
            let height = set.residual.len();
            block.view_mut((top, 0), (height, dof)).copy_from(&set.by_chain);
            if let Some(column) = column_of(*place).filter(|_| blocks > 0) {
                block.view_mut((top, column), (height, joints)).copy_from(&set.by_joints);
            }
            block.view_mut((top, columns - 6 * further), (height, 6 * further)).copy_from(&set.by_further);
            top += height;
        }
        let whitened = map_whitening(loops, state.rigid_map[station].len(), &places, rows).map(|it| it * &block);
        jacobian = stacked(&jacobian, &whitened.unwrap_or(block));
    }
    if angles == AngleKnowledge::Encoder {
        let readings = used.iter().filter(|place| !fit.wrong[**place]).flat_map(|place| {
            let column = column_of(*place).unwrap_or(dof);
            (0..joints).map(move |joint| (column + joint, loops.noise.encoder_rad[joint]))
        });
        let readings: Vec<(usize, f64)> = readings.collect();
        let mut rows = DMatrix::zeros(readings.len(), columns);
        for (row, (column, sigma)) in readings.into_iter().enumerate() {
            rows[(row, column)] = 1.0 / sigma;
        }
        jacobian = stacked(&jacobian, &rows);
    }
    let calibration = chain.parameters().into_iter().enumerate();
    let mut ids: Vec<ColumnBlock> = calibration
        .map(|(start, parameter)| ColumnBlock { id: ColumnId::Calibration(parameter), start, len: 1 })
        .collect();
    let joint_blocks = (0..blocks).map(|index| (ColumnId::Joints(FrameId(index)), dof + joints * index, joints));
    let poses =
        (0..further).map(|index| (ColumnId::Pose(FrameId(blocks + index)), dof + joints * blocks + 6 * index, 6));
    ids.extend(joint_blocks.chain(poses).map(|(id, start, len)| ColumnBlock { id, start, len }));
    Linearization {
        columns: ids,
        fixed_parameters: Vec::new(),
        calibration_column_norms: DVector::from_fn(dof, |column, _| jacobian.column(column).norm()),
        prior_jacobian: DMatrix::zeros(0, columns),
        rig_prior_rows: 0,
        chain: chain.clone(),
        jacobian,
    }
}

/// `W` that whitens the rows of the sets of one station by the errors of the map: `WᵀW = (I + D·P·Dᵀ)⁻¹`.
fn map_whitening(loops: &StillsLoops<'_>, cameras: usize, places: &[usize], rows: usize) -> Option<DMatrix<f64>> {
    let mut by_station = DMatrix::zeros(rows, 6 * cameras);
    let mut covariance = DMatrix::identity(rows, rows);
    let mut top = 0;
    for place in places {
        let set = loops.sets[*place];
        let height = set.by_gimbal_map.nrows();
        let by_gimbal = &set.by_gimbal_map * loops.noise.set_position_m;
        let mut block = covariance.view_mut((top, top), (height, height));
        block += &by_gimbal * by_gimbal.transpose();
        for ((camera, _), by_map) in set.rigid.iter().zip(&set.by_rigid_map) {
            for coordinate in 0..6 {
                let column = by_map.column(coordinate) * loops.rigid_map_sigma(coordinate);
                by_station.view_mut((top, 6 * camera + coordinate), (height, 1)).copy_from(&column);
            }
        }
        top += height;
    }
    covariance += &by_station * by_station.transpose();
    square_root_information(covariance)
}

fn stacked(above: &DMatrix<f64>, below: &DMatrix<f64>) -> DMatrix<f64> {
    let mut whole = DMatrix::zeros(above.nrows() + below.nrows(), below.ncols());
    whole.rows_mut(0, above.nrows()).copy_from(above);
    whole.rows_mut(above.nrows(), below.nrows()).copy_from(below);
    whole
}
