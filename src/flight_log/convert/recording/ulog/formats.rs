//! Message formats of a `ULog`: fields and their offsets in a message.

use std::collections::BTreeMap;

use super::super::scalar::Scalar;

/// Largest nesting of formats; PX4 has at most three levels.
const MAX_DEPTH: usize = 8;

/// Field in a format's declaration.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Declared {
    type_name: String,
    count: usize,
    name: String,
}

/// Number, or array of numbers, of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Field {
    scalar: Scalar,
    count: usize,
    /// In bytes from the start of the message's fields.
    offset: usize,
}

/// Offsets and types of a message's numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct MessageLayout(BTreeMap<String, Field>);

impl MessageLayout {
    /// Values of a field with `N` numbers, `None` if the message has no such field or ends before it.
    pub(super) fn numbers<const N: usize>(&self, message: &[u8], name: &str) -> Option<[f64; N]> {
        let field = self.0.get(name).filter(|field| field.count == N)?;
        let mut numbers = [0.0; N];
        for (index, number) in numbers.iter_mut().enumerate() {
            *number = field.scalar.little_endian(message, field.offset + index * field.scalar.size())?;
        }
        Some(numbers)
    }

    /// Value of a field with one number.
    pub(super) fn number(&self, message: &[u8], name: &str) -> Option<f64> {
        self.numbers::<1>(message, name).map(|[number]| number)
    }
}

fn scalar(type_name: &str) -> Option<Scalar> {
    Some(match type_name {
        "int8_t" => Scalar::I8,
        "uint8_t" | "bool" | "char" => Scalar::U8,
        "int16_t" => Scalar::I16,
        "uint16_t" => Scalar::U16,
        "int32_t" => Scalar::I32,
        "uint32_t" => Scalar::U32,
        "int64_t" => Scalar::I64,
        "uint64_t" => Scalar::U64,
        "float" => Scalar::F32,
        "double" => Scalar::F64,
        _ => return None,
    })
}

/// Formats of a log by name.
#[derive(Clone, Debug, Default)]
pub(super) struct Formats(BTreeMap<String, Vec<Declared>>);

impl Formats {
    /// Adds a format by its text, `name:float[3] gyro;uint64_t time;`.
    pub(super) fn declare(&mut self, text: &str) -> Result<(), String> {
        let (name, fields) = text.split_once(':').ok_or_else(|| "a format without a name".to_owned())?;
        let mut declared = Vec::new();
        for field in fields.split(';').map(str::trim).filter(|field| !field.is_empty()) {
            let problem = || format!("format {name:?} has the field {field:?}");
            let (type_name, field_name) = field.split_once(' ').ok_or_else(problem)?;
            let (type_name, count) = match type_name.split_once('[') {
                Some((type_name, count)) => {
                    (type_name, count.trim_end_matches(']').parse::<u16>().ok().ok_or_else(problem)?)
                }
                None => (type_name, 1),
            };
            declared.push(Declared {
                type_name: type_name.to_owned(),
                count: usize::from(count),
                name: field_name.trim().to_owned(),
            });
        }
        self.0.insert(name.to_owned(), declared);
        Ok(())
    }

    /// Offsets of the numbers of a format; `None` for a format that is not declared or has no determined size.
    pub(super) fn layout(&self, name: &str) -> Option<MessageLayout> {
        let mut sizes = BTreeMap::new();
        let mut layout = MessageLayout::default();
        let mut offset: usize = 0;
        for field in self.0.get(name)? {
            if let Some(scalar) = scalar(&field.type_name) {
                layout.0.insert(field.name.clone(), Field { scalar, count: field.count, offset });
            }
            let Some(size) = self.size(&field.type_name, MAX_DEPTH, &mut sizes) else { break };
            offset = offset.checked_add(size.checked_mul(field.count)?)?;
        }
        Some(layout)
    }

    /// Size of a type in bytes. `sizes` contains the sizes computed before.
    fn size<'a>(
        &'a self,
        type_name: &'a str,
        depth: usize,
        sizes: &mut BTreeMap<&'a str, Option<usize>>,
    ) -> Option<usize> {
        if let Some(scalar) = scalar(type_name) {
            return Some(scalar.size());
        }
        if let Some(size) = sizes.get(type_name) {
            return *size;
        }
        // A format that contains itself has no size.
        sizes.insert(type_name, None);
        let fields = self.0.get(type_name).filter(|_| depth > 0)?;
        let mut sum: usize = 0;
        for field in fields {
            let size = self.size(&field.type_name, depth - 1, sizes)?;
            sum = sum.checked_add(size.checked_mul(field.count)?)?;
        }
        sizes.insert(type_name, Some(sum));
        Some(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_lie_behind_those_before_them() {
        let mut formats = Formats::default();
        formats.declare("outer:uint64_t timestamp;inner[2] parts;float[3] xyz;uint8_t[5] _padding0;").unwrap();
        formats.declare("inner:int16_t a;bool b").unwrap();
        let layout = formats.layout("outer").unwrap();
        let mut message = 7_u64.to_le_bytes().to_vec();
        message.extend([0; 6]);
        message.extend([1.5_f32, -2.0, 3.0].iter().flat_map(|value| value.to_le_bytes()));
        assert_eq!(layout.number(&message, "timestamp"), Some(7.0));
        assert_eq!(layout.numbers::<3>(&message, "xyz"), Some([1.5, -2.0, 3.0]));
        assert_eq!(layout.number(&message, "xyz"), None);
        assert_eq!(layout.numbers::<3>(&message[..20], "xyz"), None);
        assert_eq!(formats.layout("none"), None);
    }

    #[test]
    fn formats_that_contain_themselves_have_no_size() {
        let mut formats = Formats::default();
        formats.declare("loop:uint64_t timestamp;loop[60000] inside;float x").unwrap();
        let layout = formats.layout("loop").unwrap();
        assert!(layout.number(&[0; 64], "timestamp").is_some() && layout.number(&[0; 64], "x").is_none());
        assert!(formats.declare("no name").is_err() && formats.declare("a:float[x] b").is_err());
    }
}
