//! Singularity margins of the minimal parameterizations, and the choice between these parameterizations.

use super::conversion::end_block;
use super::form::Form;
use super::frame::ChainFrame;
use super::{Chain, ClassicalChain, Parameterization, Singularity};

/// A minimal parameterization is replaced when its margin at base or end falls below this.
pub const SWITCH_MARGIN: f64 = 0.3;

/// Margins that differ by less than this (two angles of about 2.6° at the best margin) count as equal: the
/// printed parameterization is preferred.
const TIE: f64 = 1e-3;

/// Returns the minimal parameterization with the largest margins at base and end; the printed one when margins
/// are equal.
pub fn auto_parameterization(classical: &ClassicalChain) -> Parameterization {
    let Some(last) = classical.links.last() else { return Parameterization::Minimal };
    let base = ChainFrame::of(&classical.imu_from_base).rotation;
    let end = end_block(last, &classical.effector_from_camera).rotation;
    let margin_xy = base[(1, 2)].hypot(base[(2, 2)]);
    let margin_yx = base[(0, 2)].hypot(base[(2, 2)]);
    let margin_printed = end[(0, 1)].hypot(end[(1, 1)]);
    let margin_swapped = end[(0, 0)].hypot(end[(1, 0)]);
    Parameterization::minimal(margin_yx > margin_xy + TIE, margin_swapped > margin_printed + TIE)
}

impl Chain {
    /// Returns the margins to the singularities, 0 when singular and 1 at the largest distance; for parallel axes
    /// the absolute sine of the link's twist.
    ///
    /// The classical parameterization has margins of parallel axes only, `poe` and rigid cameras have none.
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

    /// Returns the parameterization to switch to when the margin of base or end is below [`SWITCH_MARGIN`] and
    /// another minimal parameterization has a larger one; `None` otherwise, and for parameterizations that are not
    /// minimal.
    pub fn should_switch(&self) -> Option<Parameterization> {
        let Form::Minimal(_) = self.form else { return None };
        let close = self.margins().iter().take(2).any(|(_, margin)| *margin < SWITCH_MARGIN);
        let better = if close { auto_parameterization(&self.to_classical()) } else { self.parameterization };
        (better != self.parameterization).then_some(better)
    }
}
