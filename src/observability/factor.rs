//! Packed upper triangular factor of an information matrix, stored with every step.

use nalgebra::DMatrix;

use crate::estimator::allocated_bytes;

/// Upper triangle `R` in single precision of the information matrix `RᵀR`.
///
/// The dynamic range of a factor is the square root of the dynamic range of the information, so that single precision
/// represents weakly and strongly observable directions together. A step's factor takes 1.2 kB at most.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PackedFactor {
    columns: usize,
    /// Row by row, from the diagonal on.
    entries: Box<[f32]>,
}

impl PackedFactor {
    /// Packs the upper triangle of a square matrix.
    pub fn new(triangle: &DMatrix<f64>) -> Self {
        let columns = triangle.ncols().min(triangle.nrows());
        let entries =
            (0..columns).flat_map(|row| (row..columns).map(move |column| triangle[(row, column)] as f32)).collect();
        Self { columns, entries }
    }

    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the information matrix `RᵀR` (n × n).
    pub fn information(&self) -> DMatrix<f64> {
        let mut triangle = DMatrix::zeros(self.columns, self.columns);
        let mut entries = self.entries.iter();
        for row in 0..self.columns {
            for column in row..self.columns {
                triangle[(row, column)] = entries.next().copied().map_or(0.0, f64::from);
            }
        }
        triangle.tr_mul(&triangle)
    }

    pub(super) fn heap_bytes(&self) -> usize {
        allocated_bytes(size_of_val(&*self.entries))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packing_keeps_the_information() {
        let matrix = DMatrix::from_fn(9, 4, |row, column| ((row * 7 + column * 3) % 11) as f64 - 4.0);
        let packed = PackedFactor::new(&matrix.clone().qr().r());
        let expected = matrix.tr_mul(&matrix);
        assert!((packed.information() - &expected).amax() < 1e-5 * expected.amax());
        assert_eq!(PackedFactor::new(&DMatrix::zeros(0, 0)).information().ncols(), 0);
    }
}
