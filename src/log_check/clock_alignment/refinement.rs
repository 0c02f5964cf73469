//! Offset, drift, rotation, scale and bias by robust least squares on rotation vectors.

use nalgebra::{Const, SMatrix, SVector, UnitQuaternion, Vector3};
use serde::Serialize;

use super::super::statistics::median;
use super::series::{MIN_ROTATIONS, PairRotation, RotationReference};
use crate::geometry::{best_rotation, consecutive_correlation, ns_from_seconds, seconds_from_ns, so3};
use crate::optimization::{NormalEquations, gauss_newton};

/// Prior standard deviation of the drift between two quartz clocks.
const DRIFT_SIGMA: f64 = 1e-4;
/// Prior standard deviation of the scale: a focal length from a field of view is known to some tenths.
pub(crate) const SCALE_SIGMA: f64 = 0.3;
/// Smallest and largest scale.
const SCALE_RANGE: [f64; 2] = [0.3, 3.0];
/// Prior standard deviation of the gyroscope's bias: a consumer sensor has up to 5 °/s.
pub(crate) const BIAS_SIGMA_RAD_PER_S: f64 = 0.09;
/// Prior standard deviation of the bias of orientations, which have none.
const NO_BIAS_SIGMA_RAD_PER_S: f64 = 1e-6;
/// Most iterations of the least squares.
const ITERATIONS: usize = 20;
/// Update of the offset below which the iterations end.
const CONVERGED_S: f64 = 1e-7;
/// Largest update of the offset in one iteration.
const MAX_UPDATE_S: f64 = 0.05;
/// Step of the central difference by time, in seconds.
const DIFFERENCE_S: f64 = 0.004;
/// Huber's threshold in standard deviations.
const HUBER: f64 = 1.345;
/// Largest correlation of consecutive residuals; the variance then grows to 39 times its value.
const MAX_CORRELATION: f64 = 0.95;
/// Ratio of a normal distribution's standard deviation to the median norm of three such residuals.
const SIGMA_PER_MEDIAN_NORM: f64 = 1.0 / 1.538;

/// Unknowns: offset, drift, rotation (3), scale, bias of the reference (3).
const UNKNOWNS: usize = 9;
type Information = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// Best solution near one offset.
pub(super) struct Refined {
    pub(super) offset_s: f64,
    pub(super) explained: f64,
    drift: f64,
    middle_s: f64,
    camera_from_body: UnitQuaternion<f64>,
    scale: f64,
    /// Bias of the gyroscope, in rad/s.
    bias: Vector3<f64>,
    bias_sigma_rad_per_s: f64,
    covariance: Information,
    residual_rad: f64,
    rotations: usize,
}

/// Measured rotation vector (camera frame) and its prediction (body frame of the reference).
struct Row {
    measured: Vector3<f64>,
    predicted: Vector3<f64>,
    derivative: Derivative,
    since_middle_s: f64,
    interval_s: f64,
}

/// Source of the derivatives of a prediction: noise in them would bias the solution and make its σ too small.
enum Derivative {
    /// The reference: derivative of the prediction by the offset, body frame.
    Reference(Vector3<f64>),
    /// The images, as for a noisy reference: derivative of the measured rotation by the offset, camera frame.
    Images(Vector3<f64>),
}

/// Refines an offset; `None` if too few rotations overlap, or without convergence.
pub(super) fn refine(measured: &[PairRotation], reference: &RotationReference, offset_s: f64) -> Option<Refined> {
    let middles = measured.iter().map(PairRotation::middle_s);
    let (first_s, last_s) =
        middles.fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), middle| (first.min(middle), last.max(middle)));
    let middle_s = 0.5 * (first_s + last_s);
    let mut state = Refined {
        offset_s,
        explained: 0.0,
        drift: 0.0,
        middle_s,
        camera_from_body: UnitQuaternion::identity(),
        scale: 1.0,
        bias: Vector3::zeros(),
        bias_sigma_rad_per_s: if reference.is_noisy() { NO_BIAS_SIGMA_RAD_PER_S } else { BIAS_SIGMA_RAD_PER_S },
        covariance: Information::zeros(),
        residual_rad: 0.0,
        rotations: 0,
    };
    let first_rows = state.rows(measured, reference);
    state.camera_from_body = constant_rotation(&first_rows)?;
    let mut rows = Vec::new();
    let linearize = |state: &Refined| {
        rows = state.rows(measured, reference);
        (rows.len() >= MIN_ROTATIONS).then(|| state.normal_equations(&rows))
    };
    let mut converged = false;
    gauss_newton(&mut state, ITERATIONS, linearize, |state, step| {
        converged = state.update(step).abs() < CONVERGED_S;
        converged
    })?;
    if !converged {
        rows = state.rows(measured, reference);
    }
    state.finish(&rows)?;
    Some(state)
}

impl Refined {
    fn rows(&self, measured: &[PairRotation], reference: &RotationReference) -> Vec<Row> {
        let row = |pair: &PairRotation| {
            let since_middle_s = pair.middle_s() - self.middle_s;
            let shift_ns = ns_from_seconds(self.offset_s + self.drift * since_middle_s);
            let at = |extra_ns: i64| {
                reference.rotation(pair.from_ns + shift_ns + extra_ns, pair.to_ns + shift_ns + extra_ns)
            };
            let derivative = if reference.is_noisy() {
                Derivative::Images(pair.by_shift)
            } else {
                let step_ns = ns_from_seconds(DIFFERENCE_S);
                Derivative::Reference((at(step_ns)? - at(-step_ns)?) / (2.0 * DIFFERENCE_S))
            };
            let interval_s = pair.interval_s();
            let predicted = at(0)? + self.bias * interval_s;
            Some(Row { measured: pair.rotation, predicted, derivative, since_middle_s, interval_s })
        };
        measured.iter().filter_map(row).collect()
    }

    fn residual(&self, row: &Row) -> Vector3<f64> {
        row.measured - self.scale * (self.camera_from_body * row.predicted)
    }

    /// Standard deviation of a coordinate of the residuals, from their median norm.
    fn sigma_rad(&self, rows: &[Row]) -> f64 {
        let norms: Vec<f64> = rows.iter().map(|row| self.residual(row).norm()).collect();
        (SIGMA_PER_MEDIAN_NORM * median(&norms)).max(1e-9)
    }

    /// Weight of a residual by Huber's loss.
    fn weight(residual: &Vector3<f64>, sigma_rad: f64) -> f64 {
        (HUBER * 3.0_f64.sqrt() * sigma_rad / residual.norm().max(1e-12)).min(1.0)
    }

    fn jacobian(&self, row: &Row) -> SMatrix<f64, 3, UNKNOWNS> {
        let (rotated, by_offset) = match row.derivative {
            Derivative::Reference(by_offset) => {
                (self.camera_from_body * row.predicted, self.scale * (self.camera_from_body * by_offset))
            }
            Derivative::Images(by_offset) => (row.measured / self.scale, by_offset),
        };
        let mut jacobian = SMatrix::<f64, 3, UNKNOWNS>::zeros();
        jacobian.set_column(0, &by_offset);
        jacobian.set_column(1, &(by_offset * row.since_middle_s));
        jacobian.fixed_view_mut::<3, 3>(0, 2).copy_from(&(-self.scale * so3::hat(&rotated)));
        jacobian.set_column(5, &rotated);
        let by_bias = self.camera_from_body.to_rotation_matrix().into_inner() * (self.scale * row.interval_s);
        jacobian.fixed_view_mut::<3, 3>(0, 6).copy_from(&by_bias);
        jacobian
    }

    /// Normal equations in units of the residuals' variance, with the prior of the drift.
    fn normal_equations(&self, rows: &[Row]) -> NormalEquations<Const<UNKNOWNS>> {
        let sigma_rad = self.sigma_rad(rows);
        let mut equations = NormalEquations::zeros(Const);
        for row in rows {
            let residual = self.residual(row);
            let jacobian = self.jacobian(row);
            let weight = Self::weight(&residual, sigma_rad) / (sigma_rad * sigma_rad);
            equations.hessian += weight * jacobian.transpose() * jacobian;
            equations.gradient -= weight * jacobian.transpose() * residual;
        }
        equations.add_diagonal(1, self.drift, DRIFT_SIGMA.powi(-2));
        equations.add_diagonal(5, self.scale - 1.0, SCALE_SIGMA.powi(-2));
        for axis in 0..3 {
            equations.add_diagonal(6 + axis, self.bias[axis], self.bias_sigma_rad_per_s.powi(-2));
            // With rotations about one axis only, the rotation about that axis is unobservable.
            equations.add_diagonal(2 + axis, 0.0, 1.0);
        }
        equations
    }

    /// Moves the unknowns by a step; returns the update of the offset in seconds.
    fn update(&mut self, step: &SVector<f64, UNKNOWNS>) -> f64 {
        let damping = (MAX_UPDATE_S / step[0].abs().max(1e-12)).min(1.0);
        let step = step * damping;
        self.offset_s += step[0];
        self.drift += step[1];
        self.camera_from_body = so3::plus_left(&self.camera_from_body, &Vector3::new(step[2], step[3], step[4]));
        self.scale = (self.scale + step[5]).clamp(SCALE_RANGE[0], SCALE_RANGE[1]);
        self.bias += Vector3::new(step[6], step[7], step[8]);
        step[0]
    }

    fn finish(&mut self, rows: &[Row]) -> Option<()> {
        if rows.len() < MIN_ROTATIONS {
            return None;
        }
        let sigma_rad = self.sigma_rad(rows);
        let information = self.normal_equations(rows).hessian;
        // Residuals of consecutive images may be correlated; the variance grows accordingly.
        let residuals: Vec<Vector3<f64>> = rows.iter().map(|row| self.residual(row)).collect();
        let correlation = consecutive_correlation(&residuals, MAX_CORRELATION);
        self.covariance = information.try_inverse()? * ((1.0 + correlation) / (1.0 - correlation));
        let weighted = |value: &dyn Fn(&Row) -> f64| -> f64 {
            rows.iter().map(|row| Self::weight(&self.residual(row), sigma_rad) * value(row)).sum()
        };
        let left = weighted(&|row| self.residual(row).norm_squared());
        let all = weighted(&|row| row.measured.norm_squared());
        self.explained = 1.0 - left / all.max(1e-30);
        self.residual_rad = median(&residuals.iter().map(Vector3::norm).collect::<Vec<_>>());
        self.rotations = rows.len();
        Some(())
    }

    pub(super) fn alignment(
        &self,
        measured: &[PairRotation],
        reference: &RotationReference,
        next: Option<(f64, f64)>,
        correlation: Vec<(f64, f64)>,
    ) -> ClockAlignment {
        let speed = |pair: &PairRotation| {
            let shift_s = self.offset_s + self.drift * (pair.middle_s() - self.middle_s);
            let shift_ns = ns_from_seconds(shift_s);
            let predicted = reference.rotation(pair.from_ns + shift_ns, pair.to_ns + shift_ns)?;
            let [images, reference] =
                [pair.rotation.norm(), self.scale * predicted.norm()].map(|angle_rad| angle_rad / pair.interval_s());
            Some((pair.middle_s() + shift_s, images, reference))
        };
        let rotations: Vec<f64> = measured.iter().map(|pair| pair.rotation.norm()).collect();
        ClockAlignment {
            offset_s: self.offset_s,
            offset_sigma_s: self.covariance[(0, 0)].sqrt(),
            drift_ppm: self.drift * 1e6,
            drift_sigma_ppm: self.covariance[(1, 1)].sqrt() * 1e6,
            middle_s: self.middle_s,
            explained: self.explained,
            next,
            camera_from_body_rad: so3::log(&self.camera_from_body).into(),
            scale: self.scale,
            rotations: self.rotations,
            rotation_deg: median(&rotations).to_degrees(),
            residual_deg: self.residual_rad.to_degrees(),
            correlation,
            speeds: measured.iter().filter_map(speed).collect(),
        }
    }
}

/// Constant rotation with the best fit to the rows.
fn constant_rotation(rows: &[Row]) -> Option<UnitQuaternion<f64>> {
    let pairs: Vec<_> = rows.iter().map(|row| (row.predicted, row.measured)).collect();
    best_rotation(&pairs).filter(|_| rows.len() >= MIN_ROTATIONS).map(|(rotation, _)| rotation)
}

/// Times of the camera on the clock of the reference: `t_reference = t_camera + offset + drift · (t_camera − middle)`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClockAlignment {
    /// Offset at the middle, in seconds.
    pub offset_s: f64,
    pub offset_sigma_s: f64,
    /// Drift of the reference's clock against the camera's, 10⁻⁶.
    pub drift_ppm: f64,
    pub drift_sigma_ppm: f64,
    /// Middle of the image rotations on the camera's clock, in seconds.
    pub middle_s: f64,
    /// Ratio of the squared rotations of the images that the reference explains, at most 1.
    pub explained: f64,
    /// Next offset and the ratio that it explains, if there is one.
    pub next: Option<(f64, f64)>,
    /// Rotation from the reference's body frame to the camera frame, as a rotation vector in radians.
    pub camera_from_body_rad: [f64; 3],
    /// Ratio of the rotations of the images to the rotations of the reference; below 1 if the focal length is too long.
    pub scale: f64,
    /// Number of image rotations that overlap with the reference.
    pub rotations: usize,
    /// Median rotation between two images, in degrees.
    pub rotation_deg: f64,
    /// Median residual of a rotation, in degrees.
    pub residual_deg: f64,
    /// Correlation of the angular speeds by offset in seconds.
    #[serde(skip)]
    pub correlation: Vec<(f64, f64)>,
    /// Angular speeds in rad/s of images and reference, by time on the reference's clock in seconds.
    #[serde(skip)]
    pub speeds: Vec<(f64, f64, f64)>,
}

impl ClockAlignment {
    /// Time in nanoseconds to add to a stamp of the camera.
    pub fn shift_ns(&self, camera_ns: i64) -> i64 {
        let since_middle_s = seconds_from_ns(camera_ns) - self.middle_s;
        ns_from_seconds(self.offset_s + self.drift_ppm * 1e-6 * since_middle_s)
    }
}
