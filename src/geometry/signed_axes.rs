//! Permutations and signs of axes: which of them a matrix is nearest to, and how they read.

use std::fmt;
use std::str::FromStr;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Largest angle between an axis and its nearest signed axis, in radians.
const TOLERANCE_RAD: f64 = 0.35;
const NAMES: [&str; 3] = ["x", "y", "z"];

/// Axes of one frame as signed axes of another: axis `i` is `sign(i)` times axis `source(i)` of the other frame, as
/// `(source, negative)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SignedAxes([(usize, bool); 3]);

impl SignedAxes {
    /// All signed permutations, the identity first: 24 of a right-handed and 24 of a left-handed frame.
    pub fn all() -> impl Iterator<Item = Self> {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]];
        ORDERS.into_iter().flat_map(|order| {
            (0..8_usize).map(move |signs| Self([0, 1, 2].map(|axis| (order[axis], signs >> axis & 1 == 1))))
        })
    }

    /// The nearest signed axes of a matrix with orthonormal rows; `None` if one of its axes is farther
    /// than 20° from each.
    pub fn nearest(matrix: &Matrix3<f64>) -> Option<Self> {
        let row = |axis: usize| {
            let row = matrix.row(axis).transpose();
            let source = row.iamax();
            ((source, row[source] < 0.0), row[source].abs())
        };
        let rows = [0, 1, 2].map(row);
        let near = rows.iter().all(|(_, cosine)| *cosine > TOLERANCE_RAD.cos());
        let axes = Self(rows.map(|(axis, _)| axis));
        (near && axes.matrix().determinant().abs() > 0.5).then_some(axes)
    }

    /// Matrix (3 × 3) from the other frame to this one.
    pub fn matrix(&self) -> Matrix3<f64> {
        let mut matrix = Matrix3::zeros();
        for (axis, (source, is_negative)) in self.0.into_iter().enumerate() {
            matrix[(axis, source)] = if is_negative { -1.0 } else { 1.0 };
        }
        matrix
    }

    pub fn is_left_handed(&self) -> bool {
        self.matrix().determinant() < 0.0
    }

    pub fn is_identity(&self) -> bool {
        self.matrix() == Matrix3::identity()
    }

    pub fn apply(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.matrix() * vector
    }

    /// Axes of this frame in the other frame, from the other frame's axes in this one.
    pub fn inverse(&self) -> Self {
        let mut inverse = self.0;
        for (axis, (source, is_negative)) in self.0.into_iter().enumerate() {
            inverse[source] = (axis, is_negative);
        }
        Self(inverse)
    }

    /// The axes with all signs reversed.
    pub fn negated(&self) -> Self {
        Self(self.0.map(|(source, is_negative)| (source, !is_negative)))
    }

    /// These axes or their negative, whichever changes fewer axes: gravity alone cannot tell them apart.
    pub fn simpler(&self) -> Self {
        let changes = |axes: &Self| (0..3).filter(|axis| axes.0[*axis] != (*axis, false)).count();
        let negated = self.negated();
        if changes(&negated) < changes(self) { negated } else { *self }
    }

    /// Signed axes in words, such as "x and y swapped" or "z reversed".
    pub fn describe(&self) -> String {
        let moved: Vec<usize> = (0..3).filter(|axis| self.0[*axis].0 != *axis).collect();
        let reversed: Vec<&str> = (0..3).filter(|axis| self.0[*axis].1).map(|axis| NAMES[axis]).collect();
        let signs = match reversed.as_slice() {
            [] => String::new(),
            [one] => format!("{one} reversed"),
            [one, two] => format!("{one} and {two} reversed"),
            _ => "all axes reversed".to_owned(),
        };
        match (moved.as_slice(), reversed.is_empty()) {
            ([], true) => "axes as they should be".to_owned(),
            ([], false) => signs,
            ([first, second], true) => format!("{} and {} swapped", NAMES[*first], NAMES[*second]),
            _ => {
                let written =
                    self.0.map(|(source, negative)| format!("{}{}", if negative { "−" } else { "" }, NAMES[source]));
                format!("(x, y, z) recorded as ({})", written.join(", "))
            }
        }
    }
}

/// Three names with their signs, such as `y/x/-z`.
impl fmt::Display for SignedAxes {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let texts =
            self.0.map(|(source, is_negative)| format!("{}{}", if is_negative { "-" } else { "" }, NAMES[source]));
        out.write_str(&texts.join("/"))
    }
}

impl FromStr for SignedAxes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::all().find(|axes| axes.to_string() == text.trim());
        found.ok_or_else(|| format!("'{text}' are no axes; expected three, as in y/x/-z"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_signed_permutation_is_the_nearest_one_of_its_matrix() {
        let all: Vec<SignedAxes> = SignedAxes::all().collect();
        assert_eq!(all.len(), 48);
        assert_eq!(all.iter().filter(|axes| axes.is_left_handed()).count(), 24);
        assert!(all[0].is_identity());
        for axes in all {
            let turned = nalgebra::Rotation3::from_euler_angles(0.1, -0.1, 0.05).matrix() * axes.matrix();
            assert_eq!(SignedAxes::nearest(&turned), Some(axes));
        }
        let between = nalgebra::Rotation3::from_euler_angles(0.0, 0.0, 0.8);
        assert_eq!(SignedAxes::nearest(between.matrix()), None);
    }

    #[test]
    fn the_words_name_what_was_exchanged() {
        let of = |rows: [[f64; 3]; 3]| SignedAxes::nearest(&Matrix3::from(rows).transpose()).unwrap().describe();
        assert_eq!(of([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), "x and y swapped");
        assert_eq!(of([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]), "z reversed");
        assert_eq!(of([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), "(x, y, z) recorded as (y, −x, z)");
    }

    #[test]
    fn half_of_the_signed_axes_are_left_handed() {
        let others = SignedAxes::all().skip(1).collect::<Vec<_>>();
        assert_eq!(others.len(), 47);
        assert_eq!(others.iter().filter(|axes| axes.is_left_handed()).count(), 24);
        let swapped: SignedAxes = "y/x/z".parse().unwrap();
        assert_eq!(swapped.matrix() * nalgebra::Vector3::new(1.0, 2.0, 3.0), nalgebra::Vector3::new(2.0, 1.0, 3.0));
    }
}
