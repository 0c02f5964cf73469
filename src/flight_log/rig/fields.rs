//! Reader of a YAML tree by fields, so that every error names the field, its value and the expected one.

use std::path::Path;

use nalgebra::{Matrix3, Matrix4};
use serde_json::Value;

use super::super::LogError;
use super::super::text::{nearest_name, printable, shortened};
use crate::geometry::RigidTransform;

/// Largest distance of a rotation block from orthonormal (largest entry of `RᵀR − I`); Kalibr writes 1e-16,
/// hand-written files are rounded.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Longest name of a topic, frame or joint in a rig.
const MAX_TEXT_BYTES: usize = 1024;

/// Field of a rig, present or not.
#[derive(Clone, Debug)]
pub(super) struct Field<'a> {
    path: String,
    value: Option<&'a Value>,
    /// Mapping that contains the field, or would contain it.
    parent: Option<&'a Value>,
    file: &'a Path,
}

impl<'a> Field<'a> {
    /// Whole document as a field.
    pub(super) fn root(value: &'a Value, file: &'a Path) -> Self {
        Self { path: String::new(), value: Some(value), parent: None, file }
    }

    /// Field of this mapping, present or not; reading it reports a missing one.
    pub(super) fn field(&self, key: &str) -> Self {
        let path = if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) };
        let value = self.value.and_then(|value| value.get(key)).filter(|value| !value.is_null());
        Self { path, value, parent: self.value, file: self.file }
    }

    /// True if this mapping has a field, null or not, by its path (`gimbal.links[0].alpha`).
    pub(super) fn has_path(&self, path: &str) -> bool {
        let mut value = self.value;
        for step in path.split('.') {
            let (key, indices) = step.split_once('[').unwrap_or((step, ""));
            value = value.and_then(|value| value.get(key));
            for index in indices.split('[').filter(|index| !index.is_empty()) {
                let index = index.strip_suffix(']').and_then(|index| index.parse::<usize>().ok());
                value = value.and_then(|value| value.get(index?));
            }
        }
        value.is_some()
    }

    /// True if the field is present and not null.
    pub(super) fn is_present(&self) -> bool {
        self.value.is_some()
    }

    /// The field if it is present and not null.
    pub(super) fn optional(self) -> Option<Self> {
        self.is_present().then_some(self)
    }

    pub(super) fn error(&self, problem: impl Into<String>) -> LogError {
        let field = if self.path.is_empty() { "the rig" } else { &self.path };
        LogError::Rig { field: field.to_owned(), problem: problem.into(), path: self.file.to_owned() }
    }

    /// Error `holds X, expected Y`, or `missing, expected Y`.
    pub(super) fn unexpected(&self, expected: &str) -> LogError {
        match self.value {
            None => {
                let found = self.nearest_sibling().map(|key| format!("; the key '{}' is unknown", shortened(key, 40)));
                self.error(format!("missing, expected {expected}{}", found.unwrap_or_default()))
            }
            Some(value) => self.error(format!("{}, expected {expected}", describe(value))),
        }
    }

    /// Key in the same mapping that looks like a misspelling of the missing one.
    fn nearest_sibling(&self) -> Option<&'a str> {
        /// Largest number of characters changed by a misspelling.
        const MAX_EDIT_DISTANCE: usize = 2;
        let key = self.path.rsplit('.').next()?;
        let siblings = self.parent?.as_object()?.iter().filter(|(_, value)| !value.is_null());
        let (distance, nearest) = nearest_name(key, siblings.map(|(key, _)| key.as_str()))?;
        (1..=MAX_EDIT_DISTANCE).contains(&distance).then_some(nearest)
    }

    /// Checks an angle of this field: beyond `largest_rad` it looks like degrees.
    pub(super) fn in_radians(&self, angle: f64, largest_rad: f64) -> Result<f64, LogError> {
        if angle.abs() <= largest_rad {
            return Ok(angle);
        }
        let radians = angle.to_radians();
        Err(self.error(format!(
            "holds {angle}, which looks like degrees; expected radians, at most {largest_rad:.4} ({angle}° are {radians:.6})"
        )))
    }

    pub(super) fn list(&self, expected: &str) -> Result<Vec<Self>, LogError> {
        let items = self.value.and_then(Value::as_array).ok_or_else(|| self.unexpected(expected))?;
        let item = |(index, value)| {
            let path = format!("{}[{index}]", self.path);
            Self { path, value: Some(value), parent: None, file: self.file }
        };
        Ok(items.iter().enumerate().map(item).collect())
    }

    pub(super) fn keys(&self, expected: &str) -> Result<Vec<&'a str>, LogError> {
        let mapping = self.value.and_then(Value::as_object).ok_or_else(|| self.unexpected(expected))?;
        Ok(mapping.keys().map(String::as_str).collect())
    }

    /// Text of this field, without control characters.
    pub(super) fn text(&self, expected: &str) -> Result<&'a str, LogError> {
        let text = self.value.and_then(Value::as_str).ok_or_else(|| self.unexpected(expected))?;
        if text.len() > MAX_TEXT_BYTES {
            return Err(self.error(format!("{} bytes of text, expected at most {MAX_TEXT_BYTES}", text.len())));
        }
        if text != printable(text) {
            return Err(
                self.error(format!("holds '{}', expected text without control characters", shortened(text, 60)))
            );
        }
        Ok(text)
    }

    /// Finite number.
    /// True or false of this field; false if it is missing.
    pub(super) fn flag(&self) -> Result<bool, LogError> {
        match self.value.filter(|value| !value.is_null()) {
            None => Ok(false),
            Some(value) => value.as_bool().ok_or_else(|| self.unexpected("true or false")),
        }
    }

    pub(super) fn number(&self, expected: &str) -> Result<f64, LogError> {
        let number = self.value.and_then(Value::as_f64).filter(|number| number.is_finite());
        number.ok_or_else(|| self.unexpected(expected))
    }

    /// Number greater than zero.
    pub(super) fn positive(&self, expected: &str) -> Result<f64, LogError> {
        let number = self.number(expected)?;
        if number > 0.0 { Ok(number) } else { Err(self.unexpected(expected)) }
    }

    pub(super) fn not_negative(&self, expected: &str) -> Result<f64, LogError> {
        let number = self.number(expected)?;
        if number >= 0.0 { Ok(number) } else { Err(self.unexpected(expected)) }
    }

    /// Finite numbers, any count.
    pub(super) fn numbers(&self, expected: &str) -> Result<Vec<f64>, LogError> {
        let items = self.list(expected)?;
        items.iter().map(|item| item.number("a number")).collect()
    }

    /// Exactly `N` finite numbers.
    pub(super) fn exactly<const N: usize>(&self, expected: &str) -> Result<[f64; N], LogError> {
        let numbers = self.numbers(expected)?;
        <[f64; N]>::try_from(numbers.as_slice())
            .map_err(|_wrong_count| self.error(format!("{} numbers, expected {expected}", numbers.len())))
    }

    /// 3×3 matrix, row by row.
    pub(super) fn matrix3(&self) -> Result<Matrix3<f64>, LogError> {
        const EXPECTED: &str = "3 rows of 3 numbers";
        let rows = self.list(EXPECTED)?;
        if rows.len() != 3 {
            return Err(self.error(format!("{} rows, expected {EXPECTED}", rows.len())));
        }
        let mut matrix = Matrix3::zeros();
        for (index, row) in rows.iter().enumerate() {
            matrix.row_mut(index).copy_from_slice(&row.exactly::<3>("3 numbers, a row of a matrix")?);
        }
        Ok(matrix)
    }

    /// Rotation as a 3×3 matrix, row by row.
    pub(super) fn rotation(&self) -> Result<Matrix3<f64>, LogError> {
        let matrix = self.matrix3()?;
        let defect = (matrix.transpose() * matrix - Matrix3::identity()).amax();
        if defect <= ROTATION_TOLERANCE && matrix.determinant() > 0.0 {
            return Ok(matrix);
        }
        Err(self.error(format!(
            "has determinant {:.4} and is {defect:.2e} from orthonormal, expected a rotation (determinant +1, within \
             {ROTATION_TOLERANCE:.0e})",
            matrix.determinant()
        )))
    }

    /// Rigid transform as a 4×4 matrix, row by row.
    pub(super) fn transform(&self) -> Result<RigidTransform, LogError> {
        const EXPECTED: &str = "4 rows of 4 numbers, a homogeneous matrix";
        let rows = self.list(EXPECTED)?;
        if rows.len() != 4 {
            return Err(self.error(format!("{} rows, expected {EXPECTED}", rows.len())));
        }
        let mut matrix = Matrix4::zeros();
        for (index, row) in rows.iter().enumerate() {
            let numbers = row.exactly::<4>("4 numbers, a row of a homogeneous matrix")?;
            matrix.row_mut(index).copy_from_slice(&numbers);
        }
        RigidTransform::from_matrix(&matrix, ROTATION_TOLERANCE).ok_or_else(|| {
            let block = matrix.fixed_view::<3, 3>(0, 0).into_owned();
            let defect = (block.transpose() * block - nalgebra::Matrix3::identity()).amax();
            self.error(format!(
                "the upper left 3×3 block has determinant {:.4} and is {defect:.2e} from orthonormal, the last row is {:?}; \
                 expected a rotation (determinant +1, within {ROTATION_TOLERANCE:.0e}) and the row [0, 0, 0, 1]",
                block.determinant(),
                matrix.row(3).iter().copied().collect::<Vec<_>>()
            ))
        })
    }
}

fn describe(value: &Value) -> String {
    match value {
        Value::Null => "nothing".into(),
        Value::Bool(value) => format!("holds {value}"),
        Value::Number(number) => format!("holds {number}"),
        Value::String(text) => format!("holds the text '{}'", shortened(text, 60)),
        Value::Array(items) => format!("holds a list of {}", items.len()),
        Value::Object(_) => "holds a mapping".into(),
    }
}
