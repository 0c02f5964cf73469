//! Items of `GoPro` telemetry: a key of four letters, a type, the size of a sample, their number, the samples.

use super::super::scalar::Scalar;

/// Number of bytes before the samples of an item.
const HEADER_BYTES: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Item<'a> {
    pub(super) key: [u8; 4],
    /// Type letter; 0 for items within an item, `?` for samples whose fields `TYPE` lists.
    pub(super) kind: u8,
    /// Size of a sample in bytes.
    size: usize,
    pub(super) count: usize,
    pub(super) data: &'a [u8],
}

/// Items in the content of another or of a payload; the last one is an error if the rest is no item.
pub(super) fn items(content: &[u8]) -> impl Iterator<Item = Result<Item<'_>, String>> {
    let mut rest = content;
    std::iter::from_fn(move || {
        // Payloads may be padded with zeros.
        if rest.iter().all(|byte| *byte == 0) {
            return None;
        }
        let at = content.len() - rest.len();
        let Some((item, behind)) = next(rest) else {
            rest = &[];
            return Some(Err(format!("the item at byte {at} is longer than what holds it ({} bytes)", content.len())));
        };
        rest = behind;
        Some(Ok(item))
    })
}

fn next(rest: &[u8]) -> Option<(Item<'_>, &[u8])> {
    let (header, behind) = rest.split_at_checked(HEADER_BYTES)?;
    let (size, count) = (usize::from(header[5]), usize::from(u16::from_be_bytes([header[6], header[7]])));
    let (data, _) = behind.split_at_checked(size * count)?;
    // Padding of the last item may be missing.
    let behind = behind.get((size * count).next_multiple_of(4)..).unwrap_or_default();
    Some((Item { key: [header[0], header[1], header[2], header[3]], kind: header[4], size, count, data }, behind))
}

/// Number type of a letter, and the divisor of its numbers.
fn scalar(letter: u8) -> Option<(Scalar, f64)> {
    Some(match letter {
        b'b' => (Scalar::I8, 1.0),
        b'B' => (Scalar::U8, 1.0),
        b's' => (Scalar::I16, 1.0),
        b'S' => (Scalar::U16, 1.0),
        b'l' => (Scalar::I32, 1.0),
        b'L' => (Scalar::U32, 1.0),
        b'j' => (Scalar::I64, 1.0),
        b'J' => (Scalar::U64, 1.0),
        b'f' => (Scalar::F32, 1.0),
        b'd' => (Scalar::F64, 1.0),
        b'q' => (Scalar::I32, 65_536.0),
        b'Q' => (Scalar::I64, 4_294_967_296.0),
        _ => return None,
    })
}

impl Item<'_> {
    pub(super) fn text(&self) -> String {
        let end = self.data.iter().position(|byte| *byte == 0).unwrap_or(self.data.len());
        // Latin-1: `m/s²`.
        self.data[..end].iter().map(|byte| char::from(*byte)).collect()
    }

    pub(super) fn numbers(&self) -> Vec<f64> {
        let Some((scalar, divisor)) = scalar(self.kind) else { return Vec::new() };
        let number = |bytes: &[u8]| scalar.big_endian(bytes, 0).map(|number| number / divisor);
        self.data.chunks_exact(scalar.size()).filter_map(number).collect()
    }

    /// Numbers of each sample divided by their scales; `letters` is the content of `TYPE`. Samples with text are left
    /// out.
    pub(super) fn rows(&self, letters: &str, scales: &[f64]) -> impl Iterator<Item = Vec<f64>> {
        let fields: Vec<(Scalar, f64)> = match self.kind {
            b'?' => letters.bytes().map_while(scalar).collect(),
            kind => scalar(kind).map(|field| vec![field; self.size / field.0.size()]).unwrap_or_default(),
        };
        let scales = scales.to_vec();
        let scale = move |index: usize| {
            let scale = if scales.len() == 1 { scales.first() } else { scales.get(index) };
            scale.copied().filter(|scale| *scale != 0.0).unwrap_or(1.0)
        };
        self.data.chunks_exact(self.size.max(1)).map(move |sample| {
            let mut at = 0;
            let mut row = Vec::with_capacity(fields.len());
            for (index, (scalar, divisor)) in fields.iter().enumerate() {
                let Some(number) = scalar.big_endian(sample, at) else { break };
                row.push(number / divisor / scale(index));
                at += scalar.size();
            }
            row
        })
    }
}

/// Properties of a stream's samples: name, units, scale and times.
#[derive(Debug, Default)]
pub(super) struct Properties {
    pub(super) scales: Vec<f64>,
    pub(super) letters: String,
    pub(super) name: String,
    pub(super) axes: String,
    /// UTC (`GPSU`), and kind of the fix (`GPSF`).
    pub(super) utc_ns: Option<i64>,
    pub(super) fix: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_scaled() {
        let bytes = [b"ACCL".as_slice(), &[b's', 6, 0, 2], &[0, 10, 0, 20, 0xFF, 0xFE, 0, 1, 0, 2, 0, 3]].concat();
        let item = items(&bytes).next().unwrap().unwrap();
        let rows: Vec<Vec<f64>> = item.rows("", &[2.0]).collect();
        assert_eq!(rows, [vec![5.0, 10.0, -1.0], vec![0.5, 1.0, 1.5]]);
        assert_eq!((item.key, item.count, item.numbers().len()), (*b"ACCL", 2, 6));
        let bytes = [b"LNED".as_slice(), &[b'?', 6, 0, 1], &[0, 0, 3, 0xE8, 0, 5, 9, 9]].concat();
        let item = items(&bytes).next().unwrap().unwrap();
        assert_eq!(item.rows("Ls", &[1000.0, 10.0]).collect::<Vec<_>>(), [vec![1.0, 0.5]]);
    }

    #[test]
    fn items_end_with_their_container() {
        let bytes = [b"STNM".as_slice(), &[b'c', 1, 0, 3], b"abc\0", b"LONG", &[b'L', 4, 1, 0], &[1]].concat();
        let found: Vec<_> = items(&bytes).collect();
        assert_eq!(found[0].as_ref().unwrap().text(), "abc");
        assert_eq!(found[1], Err("the item at byte 12 is longer than what holds it (21 bytes)".to_owned()));
        assert_eq!(found.len(), 2);
        assert_eq!(items(&[0; 12]).count(), 0);
    }
}
