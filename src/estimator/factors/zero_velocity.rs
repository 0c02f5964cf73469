//! Zero-velocity update (ZUPT) of a stationary vehicle.
//!
//! It is soft: position equal to the position of the previous frame and zero velocity, up to the motion that the images
//! cannot resolve at the distance of the scene.

use nalgebra::Vector3;

use super::factor::{Factor, JacobianBlock, Point, Sink, WhitenedRows};
use super::kind::FactorLabel;
use crate::estimator::state::frame::Stationary;

/// Zero-velocity update of a frame in the world frame: three rows `v / σ_v`, and three rows `(p_j − p_i) / σ_p` relative
/// to the frame before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ZeroVelocityFactor {
    sigmas: Stationary,
    velocity_m_per_s: Vector3<f64>,
    /// First column of the velocity.
    velocity: usize,
    /// Translation since the previous frame, `None` if the vehicle moved in between.
    translation: Option<Translation>,
}

/// Translation between two frames.
#[derive(Clone, Copy, Debug)]
struct Translation {
    moved_m: Vector3<f64>,
    /// First columns of the positions of the earlier and of the later frame.
    positions: [usize; 2],
}

impl ZeroVelocityFactor {
    /// Factor of the frame at `slot`, `None` unless the vehicle is stationary there.
    pub(crate) fn of(point: &Point<'_>, slot: usize) -> Option<Self> {
        let sigmas = point.frames[slot].stationary?;
        let (states, layout) = (&point.at.frames, &point.layout);
        let position = |slot: usize| states[slot].navigation.world_from_imu.translation_m;
        let before = slot.checked_sub(1).filter(|before| point.frames[*before].stamp_ns >= sigmas.since_ns);
        Some(Self {
            sigmas,
            velocity_m_per_s: states[slot].navigation.velocity_m_per_s,
            velocity: layout.velocity_bias(slot).start,
            translation: before.map(|before| Translation {
                moved_m: position(slot) - position(before),
                positions: [before, slot].map(|slot| layout.pose(slot).start + 3),
            }),
        })
    }
}

impl Factor for ZeroVelocityFactor {
    fn label(&self) -> FactorLabel {
        FactorLabel::ZeroVelocity
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let slope = 1.0 / self.sigmas.velocity_sigma_m_per_s;
        for axis in 0..3 {
            let residual = [self.velocity_m_per_s[axis] * slope];
            let blocks = [JacobianBlock { start: self.velocity + axis, entries: &[slope] }];
            sink.add(self.label(), &WhitenedRows { residual: &residual, blocks: &blocks, products: None });
        }
        let Some(Translation { moved_m, positions: [before, here] }) = self.translation else { return };
        let slope = 1.0 / self.sigmas.position_sigma_m;
        for axis in 0..3 {
            let residual = [moved_m[axis] * slope];
            let blocks = [
                JacobianBlock { start: before + axis, entries: &[-slope] },
                JacobianBlock { start: here + axis, entries: &[slope] },
            ];
            sink.add(self.label(), &WhitenedRows { residual: &residual, blocks: &blocks, products: None });
        }
    }
}
