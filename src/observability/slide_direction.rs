//! Directions along which a chain can be moved, by name.

use std::str::FromStr;

use nalgebra::DVector;
use thiserror::Error;

use super::classification::{ROTATION_SCALE_RAD, TRANSLATION_SCALE_M};
use super::structure::known_losses;
use super::{KnownLoss, RankReport};
use crate::gimbal::Chain;

/// Which way a chain is moved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SlideDirection {
    /// A null or weak direction of the step, weakest first, counted from 0.
    Measured(usize),
    /// One that is known to be lost (`base-d`), or a parameter alone (`L2.alpha`).
    Named(String),
}

/// Which way a chain is moved, and how far.
#[derive(Clone, Debug, PartialEq)]
pub struct SlidePosition {
    /// Which way.
    pub direction: SlideDirection,
    /// How far, in units of 10° and 3 cm along the unit direction.
    pub amount: f64,
}

/// A position that is not written as one.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error(
    "'{given}' is no direction with a value: expected DIRECTION=VALUE, as in 1=0.5 (the weakest direction by half of 10° \
     and 3 cm), base-d=1 or L2.alpha=-1"
)]
pub struct InvalidSlide {
    /// What was given.
    pub given: String,
}

impl FromStr for SlidePosition {
    type Err = InvalidSlide;

    fn from_str(text: &str) -> Result<Self, InvalidSlide> {
        let invalid = || InvalidSlide { given: text.to_owned() };
        let (direction, amount) = text.split_once('=').ok_or_else(invalid)?;
        let amount: f64 = amount.trim().parse().ok().filter(|amount: &f64| amount.is_finite()).ok_or_else(invalid)?;
        let direction = match direction.trim() {
            "" => return Err(invalid()),
            name => match name.parse::<usize>() {
                Ok(0) => return Err(invalid()),
                Ok(number) => SlideDirection::Measured(number - 1),
                Err(_) => SlideDirection::Named(name.to_owned()),
            },
        };
        Ok(Self { direction, amount })
    }
}

impl SlideDirection {
    /// All that a step offers: the measured ones, then the known ones.
    pub fn of_step(rank: &RankReport) -> Vec<Self> {
        let measured = (0..rank.directions.len()).map(Self::Measured);
        measured.chain(rank.known.iter().map(|known| Self::Named(known.loss.name()))).collect()
    }

    /// The unit direction in the columns of the chain, in units of 10° and 3 cm; `None` when the step has no such direction.
    pub fn weights(&self, rank: &RankReport, chain: &Chain) -> Option<Vec<f64>> {
        let units = chain.parameter_units();
        match self {
            Self::Measured(index) => {
                let weights = &rank.directions.get(*index)?.weights;
                // A parameter that is held stays.
                let weight = |name: &String| rank.names.iter().position(|known| known == name).map(|it| weights[it]);
                Some(chain.parameter_names().iter().map(|name| weight(name).unwrap_or(0.0)).collect())
            }
            Self::Named(name) => {
                let mut known = known_losses(chain, true).into_iter();
                if let Some((_, direction)) = known.find(|(loss, _)| loss.name() == *name) {
                    let scale = |column: usize| scale_of(units[column]);
                    let scaled = DVector::from_fn(units.len(), |column, _| direction[column] / scale(column));
                    return Some(scaled.normalize().iter().copied().collect());
                }
                let column = chain.parameter_names().iter().position(|known| known == name)?;
                Some((0..units.len()).map(|other| f64::from(u8::from(other == column))).collect())
            }
        }
    }
}

/// What 1 means in a column of this unit.
pub(super) fn scale_of(unit: &str) -> f64 {
    if unit == "rad" { ROTATION_SCALE_RAD } else { TRANSLATION_SCALE_M }
}

impl KnownLoss {
    /// Its name on the command line: `base-d`, `free-angle-2`.
    pub fn name(self) -> String {
        let axis = |axis: usize| ["x", "y", "z"].get(axis).copied().unwrap_or("?");
        match self {
            Self::BaseTheta => "base-theta".to_owned(),
            Self::BaseD => "base-d".to_owned(),
            Self::EndTheta => "end-theta".to_owned(),
            Self::EndD => "end-d".to_owned(),
            Self::EndA => "end-a".to_owned(),
            Self::EndAlpha => "end-alpha".to_owned(),
            Self::RigidTurn(about) => format!("rigid-turn-{}", axis(about)),
            Self::RigidShift(along) => format!("rigid-shift-{}", axis(along)),
            Self::FreeAngle(joint) => format!("free-angle-{}", joint + 1),
            Self::ParallelD(link) => format!("parallel-d-{}", link + 1),
            Self::CoaxialTheta(link) => format!("coaxial-theta-{}", link + 1),
        }
    }
}
