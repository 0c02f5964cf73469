//! Named directions along which a chain can be moved.

use std::str::FromStr;

use nalgebra::DVector;
use thiserror::Error;

use super::structure::known_losses;
use super::{KnownLoss, RankReport};
use crate::gimbal::{Chain, ParameterId, ParameterNames};
use crate::text::{Entry, FINITE};

/// Direction in which a chain is moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlideDirection {
    /// A null or uninformed direction of the step, the least observable first, counted from 0.
    Measured(usize),
    /// A null direction in closed form.
    Known(KnownLoss),
    Parameter(ParameterId),
}

/// Direction and amount of a change of the chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlidePosition {
    pub direction: SlideDirection,
    /// Length of the slide along the unit direction, in units of 10° and 3 cm.
    pub amount: f64,
}

/// A change as text: `1=0.5`, `base-d=1`, `yaw.alpha=-1`.
#[derive(Clone, Debug, PartialEq)]
pub struct SlideRequest {
    /// Number of a measured direction, counted from 1, name of a closed-form one, or parameter.
    pub direction: String,
    /// Length of the slide along the unit direction, in units of 10° and 3 cm.
    pub amount: f64,
}

/// Text that does not parse as a change.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "'{given}' is no direction with a value: expected DIRECTION=VALUE, as in 1=0.5 (the least observable direction by half of 10° \
     and 3 cm), base-d=1 or yaw.alpha=-1"
)]
pub struct InvalidSlide {
    pub given: String,
}

impl FromStr for SlideRequest {
    type Err = InvalidSlide;

    fn from_str(text: &str) -> Result<Self, InvalidSlide> {
        let invalid = || InvalidSlide { given: text.to_owned() };
        let entry = Entry::parse(text).ok_or_else(invalid)?.trimmed();
        let amount = entry.number(&FINITE).ok_or_else(invalid)?;
        let direction = entry.key;
        let valid = !direction.is_empty() && direction.parse::<usize>() != Ok(0);
        valid.then(|| Self { direction: direction.to_owned(), amount }).ok_or_else(invalid)
    }
}

impl SlideRequest {
    /// Resolves the direction on a rig with these parameter names; `None` for an unknown direction.
    pub fn position(&self, names: &ParameterNames) -> Option<SlidePosition> {
        let measured = self.direction.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let direction = measured
            .map(SlideDirection::Measured)
            .or_else(|| KnownLoss::parse(&self.direction).map(SlideDirection::Known))
            .or_else(|| names.parse(&self.direction).map(SlideDirection::Parameter))?;
        Some(SlidePosition { direction, amount: self.amount })
    }
}

impl SlideDirection {
    /// All directions of a step: the measured ones, then those in closed form.
    pub fn of_step(rank: &RankReport) -> Vec<Self> {
        let measured = (0..rank.directions.len()).map(Self::Measured);
        measured.chain(rank.known.iter().map(|known| Self::Known(known.loss))).collect()
    }

    /// Unit direction in the columns of the chain (dof), in units of 10° and 3 cm; `None` when the step has no such
    /// direction.
    pub fn weights(&self, rank: &RankReport, chain: &Chain) -> Option<Vec<f64>> {
        let parameters = chain.parameters();
        let unit_vector =
            |column: usize| (0..parameters.len()).map(|other| f64::from(u8::from(other == column))).collect();
        match self {
            Self::Measured(index) => {
                let weights = &rank.directions.get(*index)?.weights;
                // A fixed parameter does not move.
                let weight =
                    |parameter| rank.parameters.iter().position(|known| known == parameter).map(|it| weights[it]);
                Some(parameters.iter().map(|parameter| weight(parameter).unwrap_or(0.0)).collect())
            }
            Self::Known(loss) => {
                let known = known_losses(chain, true).into_iter();
                let (_, direction) = known.into_iter().find(|(known, _)| known == loss)?;
                let scaled =
                    DVector::from_fn(parameters.len(), |column, _| direction[column] / parameters[column].scale());
                Some(scaled.normalize().iter().copied().collect())
            }
            Self::Parameter(parameter) => parameters.iter().position(|known| known == parameter).map(unit_vector),
        }
    }
}

impl KnownLoss {
    /// Parses the name on the command line.
    fn parse(name: &str) -> Option<Self> {
        const MAX_JOINTS: usize = u8::MAX as usize;
        let ends = [Self::BaseTheta, Self::BaseD, Self::EndTheta, Self::EndD, Self::EndA, Self::EndAlpha].into_iter();
        let rigid = (0..3).flat_map(|axis| [Self::RigidRotation(axis), Self::RigidShift(axis)]);
        let joints = (0..MAX_JOINTS)
            .flat_map(|joint| [Self::FreeAngle(joint), Self::ParallelD(joint), Self::CoaxialTheta(joint)]);
        ends.chain(rigid).chain(joints).find(|loss| loss.name() == name)
    }

    /// Name on the command line: `base-d`, `free-angle-2`.
    pub fn name(self) -> String {
        let axis = |axis: usize| ["x", "y", "z"].get(axis).copied().unwrap_or("?");
        match self {
            Self::BaseTheta => "base-theta".to_owned(),
            Self::BaseD => "base-d".to_owned(),
            Self::EndTheta => "end-theta".to_owned(),
            Self::EndD => "end-d".to_owned(),
            Self::EndA => "end-a".to_owned(),
            Self::EndAlpha => "end-alpha".to_owned(),
            Self::RigidRotation(about) => format!("rigid-turn-{}", axis(about)),
            Self::RigidShift(along) => format!("rigid-shift-{}", axis(along)),
            Self::FreeAngle(joint) => format!("free-angle-{}", joint + 1),
            Self::ParallelD(link) => format!("parallel-d-{}", link + 1),
            Self::CoaxialTheta(link) => format!("coaxial-theta-{}", link + 1),
        }
    }
}
