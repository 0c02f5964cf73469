//! Information gain of the newest image about the calibration, and its attribution to motions.
//!
//! The marginal information of the calibration in the window is compared with the information of the same window
//! without
//! the factors of the newest image: its observations, IMU interval, encoder readings and zero-velocity update.
//! With the covariances P and P' of a parameter with and without them the gain is `½ log₂(P'/P)` bits. They add
//! `G = JcᵀU·UᵀJc`, where `U` is an orthonormal basis of the new rows orthogonal to all states.
//! Up to a rigid motion of the scene, the calibration columns of the observations are zero without motion in
//! the window. With motion they are a sum over motions ([`crate::estimator::problem::motion_parts`]), and so is `G`: each motion
//! contributes the symmetric `½(JmᵀU·UᵀJc + JcᵀU·UᵀJm)`, which is also its Shapley value. The remainder comes
//! from the marginalization prior, that is, from images that have left the window.

use nalgebra::DMatrix;

use super::motion_parts::motion_parts;
use super::problem::Problem;
use crate::estimator::factors::encoder::{EncoderFactor, EncoderResidual};
use crate::estimator::factors::projected_rows::ProjectedRows;
use crate::estimator::state::allocation::allocated_bytes;
use crate::estimator::state::camera_pose::CameraMaps;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::layout::Layout;
use crate::geometry::seconds_from_ns;
use crate::optimization::{Cholesky, DIAGONAL_FLOOR};

/// Motion of the IMU along or about one of its axes, or of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Motion {
    /// Translation along an axis of the IMU, 0 to 2.
    Translation(usize),
    /// Rotation about an axis of the IMU, 0 to 2.
    Rotation(usize),
    Joint(usize),
}

impl Motion {
    /// Motions of a vehicle with this number of joints, in table order.
    pub fn all(joints: usize) -> impl Iterator<Item = Self> {
        (0..3).map(Self::Translation).chain((0..3).map(Self::Rotation)).chain((0..joints).map(Self::Joint))
    }

    /// Name in tables and files; joints by their names, if given.
    pub fn name(self, joint_names: &[String]) -> String {
        self.named(["move", "turn"], joint_names)
    }

    /// Label in the window: `trans x`, `rot z`; joints as in [`Self::name`].
    pub fn label(self, joint_names: &[String]) -> String {
        self.named(["trans", "rot"], joint_names)
    }

    fn named(self, [translation, rotation]: [&str; 2], joint_names: &[String]) -> String {
        let axis = |axis: usize| ["x", "y", "z"].get(axis).copied().unwrap_or("?");
        match self {
            Self::Translation(along) => format!("{translation} {}", axis(along)),
            Self::Rotation(about) => format!("{rotation} {}", axis(about)),
            Self::Joint(joint) => joint_names.get(joint).cloned().unwrap_or_else(|| format!("joint {}", joint + 1)),
        }
    }
}

/// Information gain of the newest image about each free calibration parameter, attributed to the motions of the window.
#[derive(Clone, Debug, PartialEq)]
pub struct InformationGain {
    /// Time since the previous image, in seconds.
    pub interval_s: f64,
    pub joints: usize,
    /// Gain per free calibration column: `log₂` of the ratio of the standard deviations without and with the image.
    bits: Box<[f32]>,
    /// Contribution of each motion in bits, column by column, in the order of [`Motion::all`].
    by_motion: Box<[f32]>,
}

impl InformationGain {
    /// `bits` has the gain per free calibration column, `by_motion` the contribution of each motion, column by column
    /// in the order of [`Motion::all`].
    pub(crate) fn new(interval_s: f64, joints: usize, bits: Vec<f32>, by_motion: Vec<f32>) -> Self {
        Self { interval_s, joints, bits: bits.into(), by_motion: by_motion.into() }
    }

    pub fn columns(&self) -> usize {
        self.bits.len()
    }

    /// Gain about a parameter in bits per second; one bit halves the standard deviation.
    pub fn bits_per_s(&self, column: usize) -> f64 {
        f64::from(self.bits[column]) / self.interval_s
    }

    /// Contribution of each motion to [`Self::bits_per_s`]. A negative value reduces the contribution of other motions,
    /// as the joints of a stabilized gimbal do.
    pub fn by_motion_per_s(&self, column: usize) -> impl Iterator<Item = f64> + '_ {
        let motions = 6 + self.joints;
        let parts = self.by_motion.get(motions * column..motions * (column + 1)).unwrap_or_default();
        parts.iter().map(|part| f64::from(*part) / self.interval_s)
    }

    /// Remainder of [`Self::bits_per_s`]: the newest image confirms information of images that have left the window.
    pub fn earlier_per_s(&self, column: usize) -> f64 {
        self.bits_per_s(column) - self.by_motion_per_s(column).sum::<f64>()
    }

    pub(crate) fn heap_bytes(&self) -> usize {
        allocated_bytes(size_of_val(&*self.bits)) + allocated_bytes(size_of_val(&*self.by_motion))
    }
}

/// Relative decrease of the variance below which a gain is a rounding error.
const ROUNDING: f64 = 1e-10;

/// Information of one camera's observations at the final estimate, with and without the newest image.
#[derive(Debug)]
pub(crate) struct CameraInformation {
    maps: CameraMaps,
    /// Information matrix of the camera's blocks (6 columns each), landmarks eliminated.
    with: DMatrix<f64>,
    without: DMatrix<f64>,
}

impl CameraInformation {
    pub(crate) fn new(projected: &ProjectedRows, maps: CameraMaps) -> Self {
        let poses = 6 * maps.blocks();
        let squared = |rows: &DMatrix<f64>| {
            let rows = rows.columns(0, poses);
            rows.transpose() * rows
        };
        let with = squared(&projected.rows);
        let without = &with - squared(&projected.newest_rows);
        Self { maps, with, without }
    }
}

/// Response of the unknowns to the calibration, with or without the factors of the newest frame.
struct Answer {
    /// Covariance of the free calibration.
    covariance: DMatrix<f64>,
    /// Derivative of the states and the calibration (columns of the layout) with respect to the free calibration
    /// columns: least-squares response of the other unknowns.
    response: DMatrix<f64>,
}

impl Answer {
    /// `free` are the calibration columns that are not fixed.
    fn new(hessian: &DMatrix<f64>, layout: &Layout, free: &[usize]) -> Option<Self> {
        let mut order = layout.elimination_order();
        order.truncate(layout.calibration().start);
        order.extend_from_slice(free);
        let factor = Cholesky::ordered(hessian, order, |diagonal| diagonal + DIAGONAL_FLOOR)?;
        let mut response = factor.leading_response(free.len(), hessian.nrows());
        for (index, column) in free.iter().enumerate() {
            response[(*column, index)] = 1.0;
        }
        Some(Self { covariance: factor.trailing_covariance(free.len()), response })
    }
}

impl Problem<'_> {
    /// Information gain of the newest image; `None` without free calibration columns, with a single frame, or when a
    /// matrix is not positive definite.
    pub(crate) fn information_gain(
        &self,
        estimate: &Estimate,
        cameras: &[CameraInformation],
    ) -> Option<InformationGain> {
        let layout = self.layout;
        let (interval_s, free) = self.newest_interval(estimate)?;
        let newest = layout.frames - 1;
        let linearized = self.linearization_point(estimate);
        let answer = |slots: usize| {
            let mut hessian = self.other_equations(estimate, &linearized, slots).hessian;
            for (camera, information) in cameras.iter().enumerate() {
                let poses = if slots == layout.frames { &information.with } else { &information.without };
                let block = |row: usize, column: usize| poses.fixed_view::<6, 6>(6 * row, 6 * column).into_owned();
                information.maps.add_information(&layout, &self.cameras[camera].columns, block, &mut hessian);
            }
            Answer::new(&hessian, &layout, &free)
        };
        let (with, without) = (answer(layout.frames)?, answer(newest)?);
        let covariance = &with.covariance;
        let motion_terms = self.motion_terms(estimate, &linearized, cameras, [&with, &without], &free);
        // Diagonal of `P·G·P`.
        let before = without.covariance.clone().cholesky()?;
        let kept = covariance * before.solve(covariance);
        let motions = 6 + layout.joints;
        let mut bits = Vec::with_capacity(free.len());
        let mut by_motion = Vec::with_capacity(free.len() * motions);
        for column in 0..free.len() {
            let variance = covariance[(column, column)];
            let gained = variance - kept[(column, column)];
            let gained_bits = 0.5 * (without.covariance[(column, column)] / variance).log2();
            let counts = gained_bits.is_finite() && gained_bits > 0.0 && gained > ROUNDING * variance;
            let bits_per_variance = if counts { gained_bits / gained } else { 0.0 };
            bits.push(if counts { gained_bits as f32 } else { 0.0 });
            by_motion.extend((0..motions).map(|motion| (bits_per_variance * motion_terms[(motion, column)]) as f32));
        }
        Some(InformationGain::new(interval_s, layout.joints, bits, by_motion))
    }

    /// Zero gain, for an image that is dropped; `None` without free calibration columns or with a single frame.
    pub(crate) fn no_information_gain(&self, estimate: &Estimate) -> Option<InformationGain> {
        let (interval_s, free) = self.newest_interval(estimate)?;
        let joints = self.layout.joints;
        Some(InformationGain::new(interval_s, joints, vec![0.0; free.len()], vec![0.0; free.len() * (6 + joints)]))
    }

    /// Time since the previous image in seconds, and the free columns of the calibration; `None` without free
    /// columns or with a single frame.
    fn newest_interval(&self, estimate: &Estimate) -> Option<(f64, Vec<usize>)> {
        let newest = self.layout.frames.checked_sub(1).filter(|newest| *newest > 0)?;
        let interval_s = seconds_from_ns(self.frames[newest].stamp_ns - self.frames[newest - 1].stamp_ns);
        let first = self.layout.calibration().start;
        let frozen = estimate.calibration.frozen_columns();
        let free: Vec<usize> = self.layout.calibration().filter(|column| !frozen.contains(&(column - first))).collect();
        (!free.is_empty() && interval_s > 0.0).then_some((interval_s, free))
    }

    /// Diagonals of `P·Gm·P` (motions × free parameters).
    fn motion_terms(
        &self,
        estimate: &Estimate,
        linearized: &Estimate,
        cameras: &[CameraInformation],
        [with, without]: [&Answer; 2],
        free: &[usize],
    ) -> DMatrix<f64> {
        let layout = self.layout;
        let mut motion_terms = DMatrix::zeros(6 + layout.joints, free.len());
        // Effect of each motion on all parameters, for a change of one of them.
        let (with_p, without_p) = (&with.response * &with.covariance, &without.response * &with.covariance);
        for (camera, information) in cameras.iter().enumerate() {
            let maps = &information.maps;
            let columns = self.cameras[camera].columns.clone();
            let moved = |answer: &DMatrix<f64>| camera_moves(layout, maps, &columns, answer);
            let force = &information.with * moved(&with_p) - &information.without * moved(&without_p);
            let own = with_p.rows_range(columns.clone());
            let sensors = linearized.calibration.sensor_models(camera);
            for (motion, moves) in
                motion_parts(&linearized.frames, &sensors, maps, layout.joints).into_iter().enumerate()
            {
                let moves = moves * own;
                for column in 0..free.len() {
                    motion_terms[(motion, column)] += moves.column(column).dot(&force.column(column));
                }
            }
        }
        self.encoder_clock_parts(estimate, &with_p, &without_p, &mut motion_terms);
        motion_terms
    }

    /// Adds the contribution that readings of moving joints make to the encoders' time offset.
    fn encoder_clock_parts(
        &self,
        estimate: &Estimate,
        with: &DMatrix<f64>,
        without: &DMatrix<f64>,
        motion_terms: &mut DMatrix<f64>,
    ) {
        let point = self.point(estimate, estimate);
        let Some(clock) = EncoderFactor::clock(&point) else { return };
        let newest = self.layout.frames - 1;
        for slot in 0..self.layout.frames {
            let joints = self.layout.joints(slot).start;
            let Some(encoder) = EncoderFactor::of(&point, slot) else { continue };
            for (joint, EncoderResidual { by_angle, by_clock, .. }) in encoder.residuals().enumerate() {
                let row = |answer: &DMatrix<f64>| answer.row(joints + joint) * by_angle + answer.row(clock) * by_clock;
                let force = if slot == newest { row(with) } else { row(with) - row(without) };
                for column in 0..force.len() {
                    motion_terms[(6 + joint, column)] += by_clock * with[(clock, column)] * force[column];
                }
            }
        }
    }
}

/// Changes of the camera's blocks (6 rows each) for changes of the unknowns.
fn camera_moves(
    layout: Layout,
    maps: &CameraMaps,
    calibration: &std::ops::Range<usize>,
    unknowns: &DMatrix<f64>,
) -> DMatrix<f64> {
    let mut moves = DMatrix::zeros(6 * maps.blocks(), unknowns.ncols());
    for block in 0..maps.blocks() {
        let moved = &maps.own[block] * unknowns.rows_range(maps.columns(&layout, block))
            + &maps.calibration[block] * unknowns.rows_range(calibration.clone());
        moves.rows_mut(6 * block, 6).copy_from(&moved);
    }
    moves
}
