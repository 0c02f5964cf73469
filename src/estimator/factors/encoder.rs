//! Encoder readings of a frame: the joint angles of Eq. 7 are measured, a term that Eq. 8 does not have.

use super::factor::{Factor, JacobianBlock, Point, Sink, WhitenedRows};
use super::kind::FactorLabel;
use crate::estimator::state::calibrations::MAIN;
use crate::geometry::wrap_angle;
use crate::sensors::JointAngles;

/// Encoder readings of a frame: one row `(θ + θ̇·shift − reading) / σ` per joint.
#[derive(Clone, Debug)]
pub(crate) struct EncoderFactor<'a> {
    pub(crate) slot: usize,
    pub(crate) reading: &'a JointAngles,
    /// Joint angles θ, in radians.
    pub(crate) angles_rad: &'a [f64],
    /// Rate θ̇ of each joint at the reading, in rad/s.
    pub(crate) rates_rad_per_s: Vec<f64>,
    /// Time offset of the encoders relative to the rig, in seconds.
    pub(crate) shift_s: f64,
    /// Column of the first joint angle.
    pub(crate) joints: usize,
    /// Column of the encoders' time offset, `None` if it is not estimated.
    pub(crate) clock: Option<usize>,
}

/// Whitened residual of one joint angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EncoderResidual {
    pub(crate) residual: f64,
    /// Derivative by the joint angle, in 1/rad.
    pub(crate) by_angle: f64,
    /// Derivative by the time offset, in 1/s.
    pub(crate) by_clock: f64,
}

impl EncoderResidual {
    /// `(θ + θ̇·shift − reading) / σ`, the difference wrapped to [−π, π).
    pub(crate) fn new(angle_rad: f64, rate_rad_per_s: f64, shift_s: f64, reading_rad: f64, sigma_rad: f64) -> Self {
        let by_angle = 1.0 / sigma_rad;
        Self {
            residual: wrap_angle(angle_rad + rate_rad_per_s * shift_s - reading_rad) / sigma_rad,
            by_angle,
            by_clock: by_angle * rate_rad_per_s,
        }
    }
}

impl<'a> EncoderFactor<'a> {
    /// Factor of the frame at `slot`, `None` without joints or readings.
    pub(crate) fn of(point: &Point<'a>, slot: usize) -> Option<Self> {
        let (calibration, state) = (&point.at.calibration, &point.at.frames[slot]);
        let reading = point.frames[slot].encoder.as_ref().filter(|_| !state.joints_rad.is_empty())?;
        Some(Self {
            slot,
            reading,
            angles_rad: &state.joints_rad,
            rates_rad_per_s: (0..state.joints_rad.len()).map(|joint| state.joint_rate_rad_per_s(joint)).collect(),
            shift_s: calibration.of(MAIN).encoder_shift_s(),
            joints: point.layout.joints(slot).start,
            clock: Self::clock(point),
        })
    }

    /// Column of the encoders' time offset, `None` if it is not estimated.
    pub(crate) fn clock(point: &Point<'_>) -> Option<usize> {
        let calibration = &point.at.calibration;
        let column = calibration.of(MAIN).encoder_shift_column()?;
        Some(point.layout.calibration().start + calibration.columns(MAIN).start + column)
    }

    pub(crate) fn residuals(&self) -> impl Iterator<Item = EncoderResidual> + '_ {
        let readings = self.reading.angles_rad.iter().zip(&self.reading.sigmas_rad);
        let joints = self.angles_rad.iter().zip(&self.rates_rad_per_s);
        joints.zip(readings).map(|((angle, rate), (reading, sigma))| {
            EncoderResidual::new(*angle, *rate, self.shift_s, *reading, *sigma)
        })
    }
}

impl Factor for EncoderFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::Encoder(self.slot as u16)
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let terms: Vec<EncoderResidual> = self.residuals().collect();
        let residual: Vec<f64> = terms.iter().map(|term| term.residual).collect();
        let by_angles = diagonal(terms.iter().map(|term| term.by_angle));
        let by_clock: Vec<f64> = terms.iter().map(|term| term.by_clock).collect();
        let mut blocks = vec![JacobianBlock { start: self.joints, entries: &by_angles }];
        blocks.extend(self.clock.map(|start| JacobianBlock { start, entries: &by_clock }));
        sink.add(self.label(), &WhitenedRows { residual: &residual, blocks: &blocks, products: None });
    }
}

/// Entries of a diagonal matrix, column by column.
pub(super) fn diagonal(entries: impl ExactSizeIterator<Item = f64>) -> Vec<f64> {
    let count = entries.len();
    let mut matrix = vec![0.0; count * count];
    for (index, entry) in entries.enumerate() {
        matrix[index * (count + 1)] = entry;
    }
    matrix
}
