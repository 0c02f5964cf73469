use std::cmp::Reverse;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::estimator::{ColumnGroup, ColumnId, Linearization};
use crate::geometry::dense;
use crate::geometry::triangular_factor::TriangularFactor;
use crate::gimbal::{Chain, ParameterId};

use super::classification::{classify, tolerance};
use super::directions::weak_directions;
use super::elimination::{column_norms, project_out};
use super::flight_sigmas::sigmas_without_prior;
use super::structure::{Measured, known_losses};
use super::{PackedFactor, RankReport};

/// Scaled singular values below this are uninformed: the posterior standard deviation exceeds 0.71 of the scale.
const INFORMED_THRESHOLD: f64 = 1.0;

/// Units of the calibration columns, so that angles and lengths are comparable.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ScalingRule {
    /// Fixed unit per dimension, the same for every rig: see [`Dimension::scale`](crate::geometry::Dimension::scale).
    #[default]
    Fixed,
    /// A standard deviation per column, such as the rig's prior: the prior then has variance 1.
    PriorSigmas(Vec<f64>),
}

impl ScalingRule {
    fn scale(&self, columns: &[ParameterId]) -> DVector<f64> {
        match self {
            Self::PriorSigmas(sigmas) if sigmas.len() == columns.len() => DVector::from_column_slice(sigmas),
            _ => DVector::from_iterator(columns.len(), columns.iter().map(|column| column.scale())),
        }
    }
}

/// Returns the ranks of a step's calibration, columns in units of 10° and 3 cm; `None` when the linearization
/// is not finite.
///
/// With the calibration columns `J_c` of the whitened rows, their scales D, and N whose rows span the complement of all
/// other columns, the ranks of `N J_c D` count its singular values s (docs/mathematics.md, section 8):
///
/// ```text
/// structural: s > 100 ε max(rows, columns) ‖J_c D‖    informed: s ≥ 1
/// ```
///
/// `chain` is the chain of the linearization's columns and `joint_angles_rad` the joint angles of each frame.
/// `joints_free` means that the angles are unknowns without encoder readings or a prior.
pub fn analyse<A: AsRef<[f64]>>(
    linearization: &Linearization,
    chain: &Chain,
    joint_angles_rad: &[A],
    joints_free: bool,
) -> Option<RankReport> {
    analyse_with_scaling(linearization, chain, joint_angles_rad, joints_free, &ScalingRule::Fixed)
}

/// [`analyse`] with other column units.
pub fn analyse_with_scaling<A: AsRef<[f64]>>(
    linearization: &Linearization,
    chain: &Chain,
    joint_angles_rad: &[A],
    joints_free: bool,
    scaling: &ScalingRule,
) -> Option<RankReport> {
    let parameters = calibration_parameters(linearization);
    let scale = scaling.scale(&parameters);
    let columns = parameters.len();
    let projected = Projected::new(linearization)?;
    let block = scaled(projected.measurements, &scale);
    let svd = dense::thin_svd(&block)?;
    let with_priors = scaled(projected.with_priors, &scale);
    let with_priors = if columns == 0 { with_priors } else { with_priors.qr().unpack_r() };
    let singular_values: Vec<f64> = svd.singular_values.iter().copied().collect();

    let reference = reference(linearization, &scale);
    let structural_threshold = structural_threshold(linearization, &scale);
    let count_above = |threshold: f64| singular_values.iter().filter(|value| **value > threshold).count();
    let rank_structural = count_above(structural_threshold);
    let rank_informed = singular_values.iter().filter(|value| **value >= INFORMED_THRESHOLD).count();
    let angles: Vec<Vec<f64>> = joint_angles_rad
        .iter()
        .map(|angles| angles.as_ref().to_vec())
        .filter(|angles| angles.len() == chain.joint_count())
        .collect();
    let fixed_parameters = &linearization.fixed_parameters;
    let deficits =
        classify(chain, &kept_columns(chain, fixed_parameters), &angles, joints_free, columns, rank_structural);
    let null_space = svd.v.columns(rank_structural, columns - rank_structural);
    let losses = known_losses(&linearization.chain, joints_free);
    let kept = kept_columns(&linearization.chain, fixed_parameters);
    let rig_prior = linearization.prior_jacobian.view((0, 0), (linearization.rig_prior_rows, columns));
    let rig_prior = scaled(rig_prior.into_owned(), &scale);
    let flight_sigmas = sigmas_without_prior(&with_priors, &rig_prior, &DMatrix::from_diagonal(&scale));
    let measured = Measured {
        scale: &scale,
        block: &block,
        null_space,
        with_priors: &with_priors,
        rig_prior: &rig_prior,
        reference,
        structural_threshold,
    };
    let known = measured.compare(losses, &kept);
    Some(RankReport {
        directions: weak_directions(&block, &svd.v, &singular_values, rank_structural, INFORMED_THRESHOLD),
        parameters,
        fixed_parameters: fixed_parameters.clone(),
        singular_values,
        singular_values_with_priors: dense::singular_values(&with_priors)?,
        posterior: PackedFactor::new(&with_priors),
        flight_sigmas,
        reference,
        structural_threshold,
        informed_threshold: INFORMED_THRESHOLD,
        rank_structural,
        rank_informed: rank_informed.min(rank_structural),
        deficit_parameterization: deficits.parameterization,
        deficit_joints: deficits.joints,
        deficit_absorbed: deficits.absorbed,
        deficit_motion: deficits.motion,
        margins: chain.margins(),
        known,
        joint_count: chain.joint_count(),
    })
}

/// Indices of the chain's columns that are estimated.
fn kept_columns(chain: &Chain, fixed_parameters: &[ParameterId]) -> Vec<usize> {
    let parameters = chain.parameters().into_iter().enumerate();
    parameters.filter(|(_, parameter)| !fixed_parameters.contains(parameter)).map(|(column, _)| column).collect()
}

/// Information matrix of the calibration columns (n × n) by measurements alone, in units of 10° and 3 cm;
/// `None` when the linearization is not finite.
pub(super) fn measured_information(linearization: &Linearization) -> Option<DMatrix<f64>> {
    let block = measured_block(linearization)?.block;
    Some(block.tr_mul(&block))
}

/// Rows of the measurements over some blocks of columns, in their order, and the calibration after them in units of 10°
/// and 3 cm; all other unknowns are projected out. `None` when the linearization is not finite.
pub(super) fn measured_rows(linearization: &Linearization, kept: &[ColumnId]) -> Option<DMatrix<f64>> {
    let measurements = &linearization.jacobian;
    if !measurements.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let is_kept = |block: &Range<usize>| {
        linearization.columns.iter().any(|column| column.start == block.start && kept.contains(&column.id))
    };
    let nuisance: Vec<usize> =
        nuisance_blocks(linearization).into_iter().filter(|block| !is_kept(block)).flatten().collect();
    let mut order = nuisance.clone();
    for id in kept {
        let block = linearization.columns.iter().find(|column| column.id == *id)?;
        order.extend(block.start..block.start + block.len);
    }
    let scale = ScalingRule::Fixed.scale(&calibration_parameters(linearization));
    order.extend(0..scale.len());
    let norms: Vec<f64> = order.iter().map(|column| measurements.column(*column).norm()).collect();
    let mut factor = TriangularFactor::new(order.len());
    factor.merge_rows(measurements, &order);
    let mut rows = project_out(factor, nuisance.len(), &norms);
    let calibration = rows.ncols() - scale.len();
    for (column, scale) in scale.iter().enumerate() {
        rows.column_mut(calibration + column).scale_mut(*scale);
    }
    Some(rows)
}

/// Calibration columns in units of 10° and 3 cm, by measurements alone, with all other unknowns projected out.
pub(super) struct MeasuredBlock {
    pub(super) block: DMatrix<f64>,
    /// Singular values at or below this are structural zeros.
    pub(super) structural_threshold: f64,
}

/// Projects all other unknowns out; `None` when the linearization is not finite.
pub(super) fn measured_block(linearization: &Linearization) -> Option<MeasuredBlock> {
    let scale = ScalingRule::Fixed.scale(&calibration_parameters(linearization));
    let block = scaled(Projected::new(linearization)?.measurements, &scale);
    Some(MeasuredBlock { structural_threshold: structural_threshold(linearization, &scale), block })
}

impl MeasuredBlock {
    /// Block of some of the calibration columns; the others are treated as known.
    pub(super) fn select(&self, linearization: &Linearization, columns: &[usize]) -> Self {
        let scale = ScalingRule::Fixed.scale(&calibration_parameters(linearization));
        let norms = linearization.calibration_column_norms.component_mul(&scale).select_rows(columns);
        Self {
            block: self.block.select_columns(columns),
            structural_threshold: tolerance(linearization.jacobian.nrows(), columns.len()) * norms.norm(),
        }
    }
}

/// Frobenius norm of the columns before projection. It replaces the spectral norm, which needs more than the column
/// norms, and exceeds it at most by the square root of the number of columns.
fn reference(linearization: &Linearization, scale: &DVector<f64>) -> f64 {
    linearization.calibration_column_norms.component_mul(scale).norm()
}

fn structural_threshold(linearization: &Linearization, scale: &DVector<f64>) -> f64 {
    tolerance(linearization.jacobian.nrows(), scale.len()) * reference(linearization, scale)
}

fn calibration_parameters(linearization: &Linearization) -> Vec<ParameterId> {
    linearization.columns.iter().filter_map(|block| block.id.parameter()).collect()
}

/// Calibration columns with all other unknowns projected out, with at least as many rows as columns.
struct Projected {
    measurements: DMatrix<f64>,
    with_priors: DMatrix<f64>,
}

impl Projected {
    fn new(linearization: &Linearization) -> Option<Self> {
        let (measurements, priors) = (&linearization.jacobian, &linearization.prior_jacobian);
        if !measurements.iter().chain(priors.iter()).all(|entry| entry.is_finite()) {
            return None;
        }
        let columns = calibration_parameters(linearization).len();
        let all_norms = column_norms(measurements, priors);
        let has_prior = |block: &Range<usize>| {
            priors.nrows() > 0 && priors.columns_range(block.clone()).iter().any(|entry| *entry != 0.0)
        };
        // Blocks without a prior come first: they are projected out once for both results.
        let (with_prior, free): (Vec<_>, Vec<_>) = nuisance_blocks(linearization).into_iter().partition(has_prior);
        let first_with_prior = free.iter().map(ExactSizeIterator::len).sum();
        let order: Vec<usize> = free.into_iter().chain(with_prior).flatten().chain(0..columns).collect();
        let norms: Vec<f64> = order.iter().map(|column| all_norms[*column]).collect();
        let nuisance = order.len() - columns;
        let mut factor = TriangularFactor::new(order.len());
        factor.merge_rows(measurements, &order);
        let mut constrained = factor.trailing(first_with_prior);
        constrained.merge_rows(priors, &order[first_with_prior..]);
        Some(Self {
            measurements: project_out(factor, nuisance, &norms),
            with_priors: project_out(constrained, nuisance - first_with_prior, &norms[first_with_prior..]),
        })
    }
}

/// Blocks of the other unknowns in an efficient order of elimination, from the newest frame back: velocities and
/// biases, which couple neighbours only, then depths, then joints and poses, which couple all blocks.
fn nuisance_blocks(linearization: &Linearization) -> Vec<Range<usize>> {
    let of = |groups: &'static [ColumnGroup]| {
        let blocks = linearization.columns.iter().filter(move |block| groups.contains(&block.id.group()));
        let mut blocks: Vec<_> = blocks.collect();
        blocks.sort_by_key(|block| (Reverse(block.id.frame()), block.start));
        blocks.into_iter().map(|block| block.start..block.start + block.len)
    };
    let mut blocks: Vec<_> = of(&[ColumnGroup::VelocityBias, ColumnGroup::GimbalImu]).collect();
    blocks.extend(of(&[ColumnGroup::InverseDepth]));
    blocks.extend(of(&[ColumnGroup::Joints, ColumnGroup::Pose]));
    blocks
}

fn scaled(mut block: DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    for (mut column, scale) in block.column_iter_mut().zip(scale) {
        column.scale_mut(*scale);
    }
    block
}
