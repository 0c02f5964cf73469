//! Normal equations of the loops: unknowns of each station, eliminated onto those common to all.

use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector, Dyn};

/// Blocks of one station: joint angles and map errors of its sets, map errors of its rigid cameras.
#[derive(Clone, Debug)]
pub(super) struct StationEquations {
    pub(super) own: DMatrix<f64>,
    /// Coupling of the station's unknowns (rows) with the common ones (columns).
    pub(super) coupling: DMatrix<f64>,
    pub(super) gradient: DVector<f64>,
}

#[derive(Clone, Debug)]
pub(super) struct StillsEquations {
    pub(super) common: DMatrix<f64>,
    pub(super) gradient: DVector<f64>,
    pub(super) stations: Vec<StationEquations>,
}

/// Steps of the common unknowns and of each station's.
pub(super) struct StillsStep {
    pub(super) common: DVector<f64>,
    pub(super) stations: Vec<DVector<f64>>,
}

/// Posterior of the unknowns.
#[derive(Clone, Debug)]
pub(super) struct StillsPosterior {
    /// Covariance of the common unknowns.
    pub(super) common: DMatrix<f64>,
    /// Variances of each station's unknowns.
    pub(super) stations: Vec<DVector<f64>>,
}

impl StationEquations {
    pub(super) fn zeros(own: usize, common: usize) -> Self {
        Self { own: DMatrix::zeros(own, own), coupling: DMatrix::zeros(own, common), gradient: DVector::zeros(own) }
    }

    fn damped(&self, damping: f64) -> Option<Cholesky<f64, Dyn>> {
        damped(&self.own, damping).cholesky()
    }
}

fn damped(matrix: &DMatrix<f64>, damping: f64) -> DMatrix<f64> {
    let mut matrix = matrix.clone();
    for index in 0..matrix.nrows() {
        matrix[(index, index)] *= 1.0 + damping;
    }
    matrix
}

impl StillsEquations {
    pub(super) fn zeros(own: &[usize], common: usize) -> Self {
        Self {
            common: DMatrix::zeros(common, common),
            gradient: DVector::zeros(common),
            stations: own.iter().map(|own| StationEquations::zeros(*own, common)).collect(),
        }
    }

    /// Solves `(H + λ diag H) δ = −g`; `None` if the equations are singular.
    pub(super) fn solve(&self, damping: f64) -> Option<StillsStep> {
        let mut reduced = damped(&self.common, damping);
        let mut gradient = self.gradient.clone();
        let mut factors = Vec::with_capacity(self.stations.len());
        for station in &self.stations {
            let factor = station.damped(damping)?;
            reduced -= station.coupling.tr_mul(&factor.solve(&station.coupling));
            gradient -= station.coupling.tr_mul(&factor.solve(&station.gradient));
            factors.push(factor);
        }
        let common = -reduced.cholesky()?.solve(&gradient);
        let own = |(station, factor): (&StationEquations, &Cholesky<f64, Dyn>)| {
            -factor.solve(&(&station.gradient + &station.coupling * &common))
        };
        let stations = self.stations.iter().zip(&factors).map(own).collect();
        Some(StillsStep { common, stations })
    }

    /// Covariance of the common unknowns and variances of the others; `weakest` has the largest σ of each common unknown,
    /// so that directions without information stay finite. `None` if the equations are singular.
    pub(super) fn posterior(&self, weakest: &DVector<f64>) -> Option<StillsPosterior> {
        let mut reduced = self.common.clone();
        for (index, sigma) in weakest.iter().enumerate() {
            reduced[(index, index)] += sigma.powi(-2);
        }
        let mut parts = Vec::with_capacity(self.stations.len());
        for station in &self.stations {
            let factor = station.damped(0.0)?;
            let solved = factor.solve(&station.coupling);
            reduced -= station.coupling.tr_mul(&solved);
            parts.push((factor.inverse(), solved));
        }
        let common = reduced.cholesky()?.inverse();
        let stations = parts.into_iter().map(|(inverse, solved)| {
            let through = &solved * &common;
            DVector::from_fn(inverse.nrows(), |row, _| inverse[(row, row)] + through.row(row).dot(&solved.row(row)))
        });
        Some(StillsPosterior { stations: stations.collect(), common })
    }
}
