//! Essential matrices from five bearing pairs (Nistér, "An efficient solution to the five-point relative pose
//! problem").
//!
//! Bearings are unit vectors in their cameras; `bearing_jᵀ · E · bearing_i = 0` with `E = [t]^·R` for
//! `camera_j_from_camera_i = (R, t)`.

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::polynomial::real_roots;

/// Exponents of x, y, z of the ten monomials up to degree two.
const MONOMIALS_2: [[u8; 3]; 10] =
    [[2, 0, 0], [1, 1, 0], [1, 0, 1], [1, 0, 0], [0, 2, 0], [0, 1, 1], [0, 1, 0], [0, 0, 2], [0, 0, 1], [0, 0, 0]];

/// Exponents of the twenty monomials up to degree three; the last ten are the blocks of x, y and 1 with falling powers
/// of z.
const MONOMIALS_3: [[u8; 3]; 20] = [
    [3, 0, 0],
    [0, 3, 0],
    [2, 1, 0],
    [1, 2, 0],
    [2, 0, 1],
    [2, 0, 0],
    [0, 2, 1],
    [0, 2, 0],
    [1, 1, 1],
    [1, 1, 0],
    [1, 0, 2],
    [1, 0, 1],
    [1, 0, 0],
    [0, 1, 2],
    [0, 1, 1],
    [0, 1, 0],
    [0, 0, 3],
    [0, 0, 2],
    [0, 0, 1],
    [0, 0, 0],
];

/// Exponents of the linear monomials x, y, z, 1.
const MONOMIALS_1: [[u8; 3]; 4] = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]];

/// Index of each product `left[a]·right[b]` in `products`.
const fn product_table<const A: usize, const B: usize, const N: usize>(
    left: &[[u8; 3]; A],
    right: &[[u8; 3]; B],
    products: &[[u8; 3]; N],
) -> [[usize; B]; A] {
    let mut table = [[0; B]; A];
    let mut a = 0;
    while a < A {
        let mut b = 0;
        while b < B {
            let mut n = 0;
            while n < N {
                if products[n][0] == left[a][0] + right[b][0]
                    && products[n][1] == left[a][1] + right[b][1]
                    && products[n][2] == left[a][2] + right[b][2]
                {
                    table[a][b] = n;
                }
                n += 1;
            }
            b += 1;
        }
        a += 1;
    }
    table
}

const PRODUCTS_1_1: [[usize; 4]; 4] = product_table(&MONOMIALS_1, &MONOMIALS_1, &MONOMIALS_2);
const PRODUCTS_2_1: [[usize; 4]; 10] = product_table(&MONOMIALS_2, &MONOMIALS_1, &MONOMIALS_3);

type Linear = SVector<f64, 4>;
type Quadratic = SVector<f64, 10>;
type Cubic = SVector<f64, 20>;

fn add_product_1_1(sum: &mut Quadratic, a: &Linear, b: &Linear, factor: f64) {
    for i in 0..4 {
        for j in 0..4 {
            sum[PRODUCTS_1_1[i][j]] += factor * a[i] * b[j];
        }
    }
}

fn add_product_2_1(sum: &mut Cubic, a: &Quadratic, b: &Linear, factor: f64) {
    for i in 0..10 {
        for j in 0..4 {
            sum[PRODUCTS_2_1[i][j]] += factor * a[i] * b[j];
        }
    }
}

/// Up to ten essential matrices that satisfy five pairs `(bearing_i, bearing_j)`, each of unit Frobenius norm.
pub(super) fn five_point(pairs: &[(Vector3<f64>, Vector3<f64>); 5]) -> Vec<Matrix3<f64>> {
    let mut constraints = SMatrix::<f64, 9, 5>::zeros();
    for (column, (bearing_i, bearing_j)) in pairs.iter().enumerate() {
        for row in 0..3 {
            for col in 0..3 {
                constraints[(3 * row + col, column)] = bearing_j[row] * bearing_i[col];
            }
        }
    }
    let Some(basis) = complement(&constraints) else { return Vec::new() };
    let Some(rows) = eliminate(polynomial_constraints(&basis)) else { return Vec::new() };

    // Rows 4 to 9 have the leading terms x²z, x², y²z, y², xyz, xy: subtracting z times the second of each pair from
    // the first leaves three equations linear in x and y, whose coefficients are polynomials in z.
    let mut equations = [[[0.0_f64; 5]; 3]; 3];
    for (equation, (upper, lower)) in equations.iter_mut().zip([(4, 5), (6, 7), (8, 9)]) {
        for (block, start, length) in [(0, 10, 3), (1, 13, 3), (2, 16, 4)] {
            // Within a block the columns hold falling powers of z.
            for offset in 0..length {
                let power = length - 1 - offset;
                equation[block][power] += rows[(upper, start + offset)];
                equation[block][power + 1] -= rows[(lower, start + offset)];
            }
        }
    }
    let determinant = determinant_polynomial(&equations);
    let mut solutions = Vec::new();
    for z in real_roots(&determinant) {
        let at: Matrix3<f64> = Matrix3::from_fn(|row, col| {
            crate::estimator::initialization::polynomial::evaluate(&equations[row][col], z)
        });
        let rows: [Vector3<f64>; 3] = [0, 1, 2].map(|row| at.row(row).transpose());
        let candidates = [rows[0].cross(&rows[1]), rows[0].cross(&rows[2]), rows[1].cross(&rows[2])];
        let Some(null) = candidates.iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared())) else {
            continue;
        };
        if null.z.abs() < 1e-12 * null.norm() || !null.norm().is_finite() {
            continue;
        }
        let weights = SVector::<f64, 4>::new(null.x / null.z, null.y / null.z, z, 1.0);
        let entries = basis * weights;
        let essential = Matrix3::from_fn(|row, col| entries[3 * row + col]);
        let norm = essential.norm();
        if norm.is_finite() && norm > 0.0 {
            solutions.push(essential / norm);
        }
    }
    solutions
}

/// Orthonormal basis of the complement of five columns, `None` when they are (nearly) dependent.
fn complement(columns: &SMatrix<f64, 9, 5>) -> Option<SMatrix<f64, 9, 4>> {
    let mut reduced = *columns;
    let mut reflectors = [SVector::<f64, 9>::zeros(); 5];
    for k in 0..5 {
        let mut v = SVector::<f64, 9>::zeros();
        for row in k..9 {
            v[row] = reduced[(row, k)];
        }
        let norm = v.norm();
        if norm < 1e-10 {
            return None;
        }
        v[k] += norm.copysign(v[k]);
        v.normalize_mut();
        for col in k..5 {
            let dot = 2.0 * v.dot(&reduced.column(col));
            for row in k..9 {
                reduced[(row, col)] -= dot * v[row];
            }
        }
        reflectors[k] = v;
    }
    let mut basis = SMatrix::<f64, 9, 4>::zeros();
    for col in 0..4 {
        let mut e = SVector::<f64, 9>::zeros();
        e[5 + col] = 1.0;
        for v in reflectors.iter().rev() {
            e -= v * (2.0 * v.dot(&e));
        }
        basis.set_column(col, &e);
    }
    Some(basis)
}

/// `det E = 0` and `2·E·Eᵀ·E − tr(E·Eᵀ)·E = 0` for `E = x·X + y·Y + z·Z + W`, as rows over [`MONOMIALS_3`].
fn polynomial_constraints(basis: &SMatrix<f64, 9, 4>) -> SMatrix<f64, 10, 20> {
    let entry = |row: usize, col: usize| -> Linear { basis.row(3 * row + col).transpose() };
    let mut square = [[Quadratic::zeros(); 3]; 3];
    for row in 0..3 {
        for col in 0..3 {
            for k in 0..3 {
                add_product_1_1(&mut square[row][col], &entry(row, k), &entry(col, k), 1.0);
            }
        }
    }
    let trace = square[0][0] + square[1][1] + square[2][2];
    for (index, row) in square.iter_mut().enumerate() {
        row[index] -= trace * 0.5;
    }
    let mut constraints = SMatrix::<f64, 10, 20>::zeros();
    for row in 0..3 {
        for col in 0..3 {
            let mut cubic = Cubic::zeros();
            for k in 0..3 {
                add_product_2_1(&mut cubic, &square[row][k], &entry(k, col), 1.0);
            }
            constraints.set_row(3 * row + col, &cubic.transpose());
        }
    }
    let mut determinant = Cubic::zeros();
    for (a, b, c) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let mut minor = Quadratic::zeros();
        add_product_1_1(&mut minor, &entry(1, b), &entry(2, c), 1.0);
        add_product_1_1(&mut minor, &entry(1, c), &entry(2, b), -1.0);
        add_product_2_1(&mut determinant, &minor, &entry(0, a), 1.0);
    }
    constraints.set_row(9, &determinant.transpose());
    constraints
}

/// Gauss–Jordan elimination of the first ten columns with row pivoting, `None` when they are singular.
fn eliminate(mut rows: SMatrix<f64, 10, 20>) -> Option<SMatrix<f64, 10, 20>> {
    for pivot in 0..10 {
        let best = (pivot..10).max_by(|&a, &b| rows[(a, pivot)].abs().total_cmp(&rows[(b, pivot)].abs()))?;
        if rows[(best, pivot)].abs() < 1e-12 {
            return None;
        }
        rows.swap_rows(pivot, best);
        let factor = 1.0 / rows[(pivot, pivot)];
        for col in pivot..20 {
            rows[(pivot, col)] *= factor;
        }
        for other in 0..10 {
            let weight = rows[(other, pivot)];
            if other != pivot && weight != 0.0 {
                for col in pivot..20 {
                    let shift = weight * rows[(pivot, col)];
                    rows[(other, col)] -= shift;
                }
            }
        }
    }
    Some(rows)
}

/// Determinant of a 3 × 3 matrix of polynomials in z (degrees 3, 3, 4 by column): eleven coefficients.
fn determinant_polynomial(m: &[[[f64; 5]; 3]; 3]) -> [f64; 11] {
    let mut determinant = [0.0; 11];
    for (a, b, c) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
        let mut minor = [0.0; 9];
        for i in 0..5 {
            for j in 0..5 {
                minor[i + j] += m[1][b][i] * m[2][c][j] - m[1][c][i] * m[2][b][j];
            }
        }
        // Degrees 3 + 3 + 4 at most: the products beyond 10 are zero by construction.
        for i in 0..5 {
            for j in 0..9 {
                if i + j < 11 {
                    determinant[i + j] += m[0][a][i] * minor[j];
                }
            }
        }
    }
    determinant
}

/// The four relative poses `(R, t)`, with unit `t`, of an essential matrix.
pub(super) fn decompose(essential: &Matrix3<f64>) -> Option<[(UnitQuaternion<f64>, Vector3<f64>); 4]> {
    let svd = essential.try_svd(true, true, f64::EPSILON, 200)?;
    let (mut u, mut v_t) = (svd.u?, svd.v_t?);
    // nalgebra does not guarantee an order: move the smallest singular value to the last place.
    let smallest = (0..3).min_by(|&a, &b| svd.singular_values[a].total_cmp(&svd.singular_values[b]))?;
    u.swap_columns(smallest, 2);
    v_t.swap_rows(smallest, 2);
    if u.determinant() < 0.0 {
        u.column_mut(2).neg_mut();
    }
    if v_t.determinant() < 0.0 {
        v_t.row_mut(2).neg_mut();
    }
    let quarter_rotation = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let direction: Vector3<f64> = u.column(2).into_owned();
    let rotation = |w: Matrix3<f64>| {
        UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(u * w * v_t))
    };
    let (first, second) = (rotation(quarter_rotation), rotation(quarter_rotation.transpose()));
    Some([(first, direction), (first, -direction), (second, direction), (second, -direction)])
}
