//! Null and uninformed directions as weights by parameter.

use nalgebra::{DMatrix, DVector};

use super::CalibrationDirection;

/// A parameter can lead a null direction when its projection is at least this fraction of the largest one. The
/// first such parameter in column order leads, so that the choice is stable from frame to frame.
const LEADING_RATIO: f64 = 0.5;

/// Projections below this are rounding errors of the elimination.
const ROUNDING: f64 = 1e-8;

/// Returns the directions with a singular value below `informed_threshold`, the least observable first.
///
/// `block` is the scaled, projected calibration block and `v` its right singular vectors by descending singular
/// value.
/// Any basis of the structural null space is equivalent. The returned one has as few parameters per direction
/// as elimination finds: each direction has a leading parameter that is absent from the others.
pub(super) fn weak_directions(
    block: &DMatrix<f64>,
    v: &DMatrix<f64>,
    singular_values: &[f64],
    rank_structural: usize,
    informed_threshold: f64,
) -> Vec<CalibrationDirection> {
    let columns = singular_values.len();
    let null_space = v.columns(rank_structural, columns - rank_structural).into_owned();
    let mut directions: Vec<_> = eliminated_basis(null_space)
        .into_iter()
        .map(|direction| CalibrationDirection {
            singular_value: (block * &direction).norm(),
            structural: true,
            weights: direction.iter().copied().collect(),
        })
        .collect();
    for index in (0..rank_structural).rev() {
        if singular_values[index] < informed_threshold {
            directions.push(CalibrationDirection {
                singular_value: singular_values[index],
                structural: false,
                weights: signed(v.column(index).into_owned()).iter().copied().collect(),
            });
        }
    }
    directions
}

/// Basis of the same space by Gauss–Jordan elimination on the parameters, as unit vectors in the order of their leading
/// parameters.
fn eliminated_basis(mut basis: DMatrix<f64>) -> Vec<DVector<f64>> {
    let (rows, columns) = basis.shape();
    let mut leaders: Vec<(usize, usize)> = Vec::with_capacity(columns);
    // Norm of each parameter's projection on the directions without a leading parameter.
    for step in 0..columns {
        let open = basis.columns(step, columns - step);
        let projection = |row: usize| open.row(row).norm();
        let free: Vec<usize> = (0..rows).filter(|row| leaders.iter().all(|(leader, _)| leader != row)).collect();
        let largest = free.iter().map(|row| projection(*row)).fold(0.0, f64::max);
        let Some(leader) = free.into_iter().find(|row| projection(*row) >= LEADING_RATIO * largest) else { break };
        // Rotate the open directions so that only the first one moves the leading parameter.
        let along = open.row(leader).transpose() / projection(leader);
        let mut mirror = along;
        mirror[0] += if mirror[0] < 0.0 { -1.0 } else { 1.0 };
        let square = mirror.norm_squared();
        let mut open = basis.columns_mut(step, columns - step);
        let reflected = &open * &mirror * (2.0 / square);
        open -= reflected * mirror.transpose();
        leaders.push((leader, step));
    }
    // Back substitution: eliminate each leading parameter from the directions before it.
    for &(leader, step) in leaders.iter().rev() {
        for earlier in 0..step {
            let factor = basis[(leader, earlier)] / basis[(leader, step)];
            let column = basis.column(step) * factor;
            basis.column_mut(earlier).axpy(-1.0, &column, 1.0);
        }
    }
    leaders.sort_unstable();
    leaders
        .into_iter()
        .map(|(leader, step)| {
            let column = basis.column(step).normalize();
            let sign = if column[leader] < 0.0 { -1.0 } else { 1.0 };
            column.map(|weight| if weight.abs() < ROUNDING { 0.0 } else { weight * sign })
        })
        .collect()
}

/// Returns the direction with a positive largest weight, so that its sign is stable from frame to frame.
fn signed(direction: DVector<f64>) -> DVector<f64> {
    let largest =
        direction.iter().fold(0.0_f64, |largest, weight| if weight.abs() > largest.abs() { *weight } else { largest });
    if largest < 0.0 { -direction } else { direction }
}
