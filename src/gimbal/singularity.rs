//! Margins to the charts' locks, and which chart suits a mechanism.

use super::chain::Form;
use super::conversion::end_block;
use super::frame::Frame;
use super::{Chain, ClassicalChain, Parameterization};

/// A minimal chart whose margin at the base or at the end falls below this is left for a better one.
pub const SWITCH_MARGIN: f64 = 0.3;

/// Margins that differ by less than this (two angles of about 2.6° at the best place of both charts) are no reason to
/// prefer the unprinted chart.
const TIE: f64 = 1e-3;

/// The minimal form in the chart with the larger margin at the base and at the end; the printed one where both are
/// equally far from their locks.
pub fn auto_parameterization(classical: &ClassicalChain) -> Parameterization {
    let Some(last) = classical.links.last() else { return Parameterization::Minimal };
    let base = Frame::of(&classical.imu_from_base).rotation;
    let end = end_block(last, &classical.effector_from_camera).rotation;
    let margin_xy = base[(1, 2)].hypot(base[(2, 2)]);
    let margin_yx = base[(0, 2)].hypot(base[(2, 2)]);
    let margin_printed = end[(0, 1)].hypot(end[(1, 1)]);
    let margin_swapped = end[(0, 0)].hypot(end[(1, 0)]);
    Parameterization::minimal(margin_yx > margin_xy + TIE, margin_swapped > margin_printed + TIE)
}

/// Where a chart is singular.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Singularity {
    /// In the base block of a minimal form.
    Base,
    /// In the end block of a minimal form.
    End,
    /// Where the joint axes at both ends of this link, counted from 0, are parallel.
    ParallelAxes(u8),
}

impl Chain {
    /// Margins to the singularities of its chart, 1 far away and 0 when singular; of parallel axes the absolute sine of
    /// the link's twist.
    ///
    /// The classical form has only those of parallel axes, `poe` and a rigid camera none.
    pub fn margins(&self) -> Vec<(Singularity, f64)> {
        let twists = |links: &[super::DhLink]| -> Vec<(Singularity, f64)> {
            let middle = links.len().saturating_sub(1);
            let margin = |index: usize| (Singularity::ParallelAxes(index as u8), links[index].alpha_rad.sin().abs());
            (0..middle).map(margin).collect()
        };
        match &self.form {
            Form::Classical(chain) => twists(&chain.links),
            Form::Minimal(chain) => {
                let end_angle_rad = if self.parameterization.end_swapped() {
                    chain.beta_rad
                } else {
                    chain.links.last().map_or(0.0, |link| link.alpha_rad)
                };
                let mut margins = vec![
                    (Singularity::Base, chain.base_angles_rad[1].cos().abs()),
                    (Singularity::End, end_angle_rad.cos().abs()),
                ];
                margins.extend(twists(&chain.links));
                margins
            }
            Form::Poe(_) | Form::Rigid(_) => vec![],
        }
    }

    /// The chart to switch to when this minimal one has come closer than [`SWITCH_MARGIN`] to a lock of its base or end
    /// and another one is farther away; `None` to stay, also for the forms that have no charts.
    pub fn should_switch(&self) -> Option<Parameterization> {
        let Form::Minimal(_) = self.form else { return None };
        let close = self.margins().iter().take(2).any(|(_, margin)| *margin < SWITCH_MARGIN);
        let better = if close { auto_parameterization(&self.to_classical()) } else { self.parameterization };
        (better != self.parameterization).then_some(better)
    }
}
