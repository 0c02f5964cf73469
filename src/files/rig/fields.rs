//! Reader of a located document by fields, so that every error names the field, its value and the expected one.

use std::path::Path;

use nalgebra::{Matrix3, Matrix4};

use crate::files::FileError;
use crate::files::located::{Content, Located};
use crate::geometry::RigidTransform;
use crate::gimbal::DhLink;
use crate::text::{nearest_name, printable, shortened};

/// Largest distance of a rotation block from orthonormal (largest entry of `RᵀR − I`); Kalibr writes 1e-16,
/// hand-written files are rounded.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// Longest name of a topic, frame or joint in a rig.
const MAX_TEXT_BYTES: usize = 1024;
/// A joint offset or twist beyond a full revolution is an angle in degrees.
const MAX_OFFSET_RAD: f64 = std::f64::consts::TAU;

/// Field of a rig, present or not.
#[derive(Clone, Debug)]
pub(crate) struct Field<'a> {
    path: String,
    value: Option<&'a Located>,
    /// Mapping that contains the field, or would contain it.
    parent: Option<&'a Located>,
    /// Line of its key, or of its mapping for a missing field; 0 if unknown.
    line: usize,
    file: &'a Path,
}

impl<'a> Field<'a> {
    /// Whole document as a field.
    pub(crate) fn root(value: &'a Located, file: &'a Path) -> Self {
        Self { path: String::new(), value: Some(value), parent: None, line: 0, file }
    }

    /// Field of this mapping, present or not; reading it reports a missing one.
    pub(crate) fn field(&self, key: &str) -> Self {
        let path = if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) };
        let value = self.value.and_then(|value| value.get(key));
        let line = value.map_or(self.line, |value| value.key_line);
        Self { path, value: value.filter(|value| !value.is_null()), parent: self.value, line, file: self.file }
    }

    /// True if this mapping has a field, null or not, by its path (`gimbal.links[0].alpha`).
    pub(super) fn has_path(&self, path: &str) -> bool {
        let mut value = self.value;
        for step in path.split('.') {
            let (key, indices) = step.split_once('[').unwrap_or((step, ""));
            value = value.and_then(|value| value.get(key));
            for index in indices.split('[').filter(|index| !index.is_empty()) {
                let index = index.strip_suffix(']').and_then(|index| index.parse::<usize>().ok());
                value = value.and_then(|value| value.list()?.get(index?));
            }
        }
        value.is_some()
    }

    /// True if the field is present and not null.
    pub(crate) fn is_present(&self) -> bool {
        self.value.is_some()
    }

    /// The field if it is present and not null.
    pub(crate) fn optional(self) -> Option<Self> {
        self.is_present().then_some(self)
    }

    pub(crate) fn error(&self, problem: impl Into<String>) -> FileError {
        let field = if self.path.is_empty() { "the rig" } else { &self.path };
        FileError::of_field(field, problem, self.line, self.file)
    }

    /// Error `holds X, expected Y`, or `missing, expected Y`.
    pub(crate) fn unexpected(&self, expected: &str) -> FileError {
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
        let siblings = self.parent?.mapping()?.iter().filter(|(_, value)| !value.is_null());
        let (distance, nearest) = nearest_name(key, siblings.map(|(key, _)| key.as_str()))?;
        (1..=MAX_EDIT_DISTANCE).contains(&distance).then_some(nearest)
    }

    /// Checks an angle of this field: beyond `largest_rad` it looks like degrees.
    pub(super) fn in_radians(&self, angle: f64, largest_rad: f64) -> Result<f64, FileError> {
        if angle.abs() <= largest_rad {
            return Ok(angle);
        }
        let radians = angle.to_radians();
        Err(self.error(format!(
            "holds {angle}, which looks like degrees; expected radians, at most {largest_rad:.4} ({angle}° are {radians:.6})"
        )))
    }

    pub(crate) fn list(&self, expected: &str) -> Result<Vec<Self>, FileError> {
        let items = self.value.and_then(Located::list).ok_or_else(|| self.unexpected(expected))?;
        let item = |(index, value): (usize, &'a Located)| {
            let path = format!("{}[{index}]", self.path);
            Self { path, value: Some(value), parent: None, line: value.key_line, file: self.file }
        };
        Ok(items.iter().enumerate().map(item).collect())
    }

    pub(crate) fn keys(&self, expected: &str) -> Result<Vec<&'a str>, FileError> {
        let mapping = self.value.and_then(Located::mapping).ok_or_else(|| self.unexpected(expected))?;
        Ok(mapping.keys().map(String::as_str).collect())
    }

    /// Text of this field, without control characters.
    pub(crate) fn text(&self, expected: &str) -> Result<&'a str, FileError> {
        let text = self.value.and_then(Located::text).ok_or_else(|| self.unexpected(expected))?;
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

    /// True or false of this field; false if it is missing.
    pub(crate) fn flag(&self) -> Result<bool, FileError> {
        match self.value {
            None => Ok(false),
            Some(value) => value.bool().ok_or_else(|| self.unexpected("true or false")),
        }
    }

    /// Value as a finite number; otherwise an error that says what is `expected`.
    pub(crate) fn number(&self, expected: &str) -> Result<f64, FileError> {
        let number = self.value.and_then(Located::number).and_then(|number| number.value);
        number.ok_or_else(|| self.unexpected(expected))
    }

    /// Number greater than zero.
    pub(crate) fn positive(&self, expected: &str) -> Result<f64, FileError> {
        let number = self.number(expected)?;
        if number > 0.0 { Ok(number) } else { Err(self.unexpected(expected)) }
    }

    pub(super) fn not_negative(&self, expected: &str) -> Result<f64, FileError> {
        let number = self.number(expected)?;
        if number >= 0.0 { Ok(number) } else { Err(self.unexpected(expected)) }
    }

    /// Finite numbers, any count.
    pub(crate) fn numbers(&self, expected: &str) -> Result<Vec<f64>, FileError> {
        let items = self.list(expected)?;
        items.iter().map(|item| item.number("a number")).collect()
    }

    /// Exactly `N` finite numbers.
    pub(super) fn exactly<const N: usize>(&self, expected: &str) -> Result<[f64; N], FileError> {
        let numbers = self.numbers(expected)?;
        <[f64; N]>::try_from(numbers.as_slice())
            .map_err(|_wrong_count| self.error(format!("{} numbers, expected {expected}", numbers.len())))
    }

    /// 3×3 matrix, row by row.
    pub(super) fn matrix3(&self) -> Result<Matrix3<f64>, FileError> {
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
    pub(crate) fn rotation(&self) -> Result<Matrix3<f64>, FileError> {
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
    pub(crate) fn transform(&self) -> Result<RigidTransform, FileError> {
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

    /// Link of a chain in this mapping.
    pub(super) fn link(&self) -> Result<DhLink, FileError> {
        let angle = |key: &str| {
            let angle_rad = self.field(key).number("an angle in rad")?;
            self.field(key).in_radians(angle_rad, MAX_OFFSET_RAD)
        };
        let length = |key: &str| self.field(key).number("a length in m");
        Ok(DhLink {
            theta_offset_rad: angle("theta_offset")?,
            d_m: length("d")?,
            a_m: length("a")?,
            alpha_rad: angle("alpha")?,
        })
    }
}

fn describe(value: &Located) -> String {
    match &value.content {
        Content::Null => "nothing".into(),
        Content::Bool(value) => format!("holds {value}"),
        Content::Number(number) => format!("holds {}", number.text),
        Content::Text(text) | Content::Time(text) => format!("holds the text '{}'", shortened(text, 60)),
        Content::List(items) => format!("holds a list of {}", items.len()),
        Content::Mapping(_) => "holds a mapping".into(),
    }
}
