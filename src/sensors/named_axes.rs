//! Axes named by their directions, seen from a vehicle.

use std::fmt;
use std::str::FromStr;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::text::Named;

/// Axes of a body, x forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyAxes {
    /// Forward, right, down; with north, east, down as earth frame.
    Frd,
    /// Forward, left, up; with east, north, up as earth frame.
    Flu,
}

/// Names in a rig.
impl Named for BodyAxes {
    const NAMES: &'static [(Self, &'static str)] = &[(Self::Frd, "frd"), (Self::Flu, "flu")];
}

impl BodyAxes {
    /// Rotates vectors from these axes to forward, left, up.
    pub fn flu_from_axes(self) -> UnitQuaternion<f64> {
        NamedAxes::from(self).flu_from_axes()
    }

    /// Rotates vectors from the earth frame of these axes to east, north, up.
    pub fn enu_from_earth(self) -> UnitQuaternion<f64> {
        match self {
            Self::Frd => rotation_of(&Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0)),
            Self::Flu => UnitQuaternion::identity(),
        }
    }
}

/// Right-handed axes by the directions of x, y and z: `flu`, `frd`, `rdf` (a camera's).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NamedAxes([Direction; 3]);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Forward,
    Back,
    Left,
    Right,
    Up,
    Down,
}

impl Direction {
    const ALL: [Self; 6] = [Self::Forward, Self::Back, Self::Left, Self::Right, Self::Up, Self::Down];

    fn letter(self) -> char {
        match self {
            Self::Forward => 'f',
            Self::Back => 'b',
            Self::Left => 'l',
            Self::Right => 'r',
            Self::Up => 'u',
            Self::Down => 'd',
        }
    }

    fn in_flu(self) -> Vector3<f64> {
        match self {
            Self::Forward => Vector3::x(),
            Self::Back => -Vector3::x(),
            Self::Left => Vector3::y(),
            Self::Right => -Vector3::y(),
            Self::Up => Vector3::z(),
            Self::Down => -Vector3::z(),
        }
    }
}

impl NamedAxes {
    /// Forward, left, up: body axes of ROS.
    pub const FLU: Self = Self([Direction::Forward, Direction::Left, Direction::Up]);
    /// Forward, right, down: body axes of `MAVLink`.
    pub const FRD: Self = Self([Direction::Forward, Direction::Right, Direction::Down]);
    /// Right, down, forward: camera axes.
    pub const RDF: Self = Self([Direction::Right, Direction::Down, Direction::Forward]);

    fn matrix(self) -> Matrix3<f64> {
        Matrix3::from_columns(&self.0.map(Direction::in_flu))
    }

    /// Rotates vectors from these axes to forward, left, up.
    pub fn flu_from_axes(self) -> UnitQuaternion<f64> {
        rotation_of(&self.matrix())
    }
}

impl From<BodyAxes> for NamedAxes {
    fn from(axes: BodyAxes) -> Self {
        match axes {
            BodyAxes::Frd => Self::FRD,
            BodyAxes::Flu => Self::FLU,
        }
    }
}

impl fmt::Display for NamedAxes {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let letters: String = self.0.map(Direction::letter).iter().collect();
        formatter.write_str(&letters)
    }
}

impl FromStr for NamedAxes {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let direction = |letter: char| Direction::ALL.into_iter().find(|direction| direction.letter() == letter);
        let directions: Vec<Direction> = text.chars().map(direction).collect::<Option<_>>().ok_or(())?;
        let axes = Self(<[Direction; 3]>::try_from(directions).map_err(|_count| ())?);
        if axes.matrix().determinant() > 0.5 { Ok(axes) } else { Err(()) }
    }
}

fn rotation_of(matrix: &Matrix3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*matrix))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_named_by_their_directions() {
        for (text, x_in_flu) in [("flu", Vector3::x()), ("rdf", -Vector3::y()), ("frd", Vector3::x())] {
            let axes: NamedAxes = text.parse().unwrap();
            assert_eq!(axes.to_string(), text);
            assert!((axes.flu_from_axes() * Vector3::x() - x_in_flu).norm() < 1e-15);
        }
        assert!((NamedAxes::RDF.flu_from_axes() * Vector3::z() - Vector3::x()).norm() < 1e-15);
        assert!((BodyAxes::Frd.enu_from_earth() * Vector3::x() - Vector3::y()).norm() < 1e-15, "north");
        for text in ["fru", "ff", "fflu", "flx", "fbu", "FLU", ""] {
            assert!(text.parse::<NamedAxes>().is_err(), "{text}");
        }
        let mut right_handed = 0;
        for x in "fblrud".chars() {
            for y in "fblrud".chars() {
                right_handed += "fblrud".chars().filter(|z| format!("{x}{y}{z}").parse::<NamedAxes>().is_ok()).count();
            }
        }
        assert_eq!(right_handed, 24);
    }
}
