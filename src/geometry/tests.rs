use nalgebra::{Matrix3, Matrix4, Vector3, Vector6};

use super::{RigidTransform, SplitMix64, median, so3, tangent_basis, ticks};

/// Rotation vectors from tiny to just under half a revolution.
fn rotation_vectors() -> Vec<Vector3<f64>> {
    let axes = [Vector3::x(), Vector3::new(0.3, -0.5, 0.8), Vector3::new(-0.7, 0.1, -0.2)];
    let angles = [0.0, 1e-10, 1e-5, 0.9e-4, 1.1e-4, 0.01, 0.7, 2.0, 3.1];
    axes.iter().flat_map(|axis| angles.iter().map(move |angle| axis.normalize() * *angle)).collect()
}

fn transforms() -> Vec<RigidTransform> {
    rotation_vectors()
        .iter()
        .enumerate()
        .map(|(index, phi)| RigidTransform::new(so3::exp(phi), Vector3::new(index as f64, -0.5, 0.25 * index as f64)))
        .collect()
}

#[test]
fn logarithm_inverts_the_exponential() {
    for phi in rotation_vectors() {
        assert!((so3::log(&so3::exp(&phi)) - phi).norm() < 1e-12, "{phi:?}");
    }
}

#[test]
fn right_jacobian_meets_central_differences() {
    let step = 1e-6;
    for phi in rotation_vectors() {
        let analytic = so3::right_jacobian(&phi);
        for axis in 0..3 {
            let mut shift = Vector3::zeros();
            shift[axis] = step;
            let numeric = (so3::log(&(so3::exp(&phi).inverse() * so3::exp(&(phi + shift))))
                - so3::log(&(so3::exp(&phi).inverse() * so3::exp(&(phi - shift)))))
                / (2.0 * step);
            assert!((analytic.column(axis) - numeric).norm() < 1e-9, "{phi:?} column {axis}");
        }
        let product = analytic * so3::right_jacobian_inverse(&phi);
        assert!((product - Matrix3::identity()).amax() < 1e-9, "{phi:?}");
    }
}

/// Power series of the right Jacobian, `Σ (−[φ]^)ⁿ/(n + 1)!`, and of its inverse with Bernoulli numbers, both accurate to
/// rounding up to 0.4 rad.
fn right_jacobian_series(phi: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let k = so3::hat(phi);
    let mut term = Matrix3::identity();
    let mut sum = term;
    for n in 1..20 {
        term = term * -k / f64::from(n + 1);
        sum += term;
    }
    const COEFFICIENTS: [f64; 6] =
        [1.0 / 12.0, 1.0 / 720.0, 1.0 / 30_240.0, 1.0 / 1_209_600.0, 1.0 / 47_900_160.0, 691.0 / 1_307_674_368_000.0];
    let factor = COEFFICIENTS.iter().rev().fold(0.0, |sum, coefficient| coefficient + sum * phi.norm_squared());
    (sum, Matrix3::identity() + k * 0.5 + k * k * factor)
}

#[test]
fn right_jacobians_meet_their_stated_accuracy() {
    let axes =
        [Vector3::x(), Vector3::new(0.3, -0.5, 0.8), Vector3::new(-0.7, 0.1, -0.2), Vector3::new(0.0, 1.0, -1.0)];
    for step in 0..=760 {
        let angle_rad = 1e-8 * 10.0_f64.powf(f64::from(step) / 100.0);
        for axis in &axes {
            let phi = axis.normalize() * angle_rad;
            let (jacobian, inverse) = right_jacobian_series(&phi);
            let error = (so3::right_jacobian(&phi) - jacobian).amax();
            let bound = match angle_rad {
                small if small < 1e-4 => 4.2e-14,
                large if large > 0.01 => 1e-14,
                _ => 1e-12,
            };
            assert!(error <= bound, "{angle_rad} rad: {error} over {bound}");
            let error = (so3::right_jacobian_inverse(&phi) - inverse).amax();
            assert!(error <= 1e-15, "{angle_rad} rad: {error} in the inverse");
        }
    }
}

#[test]
fn rigid_transform_obeys_the_manifold_laws() {
    let deltas = [Vector6::new(0.1, -0.2, 0.3, 1.0, 2.0, -0.4), Vector6::new(1e-7, 0.0, 2e-7, 0.0, 1e-8, 0.0)];
    for x in transforms() {
        assert!(x.plus(&Vector6::zeros()).minus(&x).norm() < 1e-14);
        for delta in &deltas {
            assert!((x.plus(delta).minus(&x) - delta).norm() < 1e-12);
        }
        for y in transforms() {
            let rebuilt = x.plus(&y.minus(&x));
            assert!((rebuilt.to_matrix() - y.to_matrix()).amax() < 1e-12);
        }
    }
}

#[test]
fn transforms_convert_to_matrices_and_invalid_ones_are_refused() {
    for x in transforms() {
        let back = RigidTransform::from_matrix(&x.to_matrix(), 1e-9).unwrap();
        assert!((back.to_matrix() - x.to_matrix()).amax() < 1e-12);
        assert!(((x * x.inverse()).to_matrix() - Matrix4::identity()).amax() < 1e-12);
    }
    assert!(RigidTransform::from_matrix(&(Matrix4::identity() * 1.1), 1e-6).is_none());
    let mut mirror = Matrix4::identity();
    mirror[(0, 0)] = -1.0;
    assert!(RigidTransform::from_matrix(&mirror, 1e-6).is_none());
}

#[test]
fn rows_are_split_by_a_column_space_even_with_dependent_columns() {
    use super::dense::{split_by_column_space, thin_svd, to_faer};
    let entry =
        |row: usize, column: usize| ((row * row * 7 + column * 13 + row * column * 5 + 5) % 31) as f64 / 31.0 - 0.5;
    let mut spanning = nalgebra::DMatrix::from_fn(12, 5, entry);
    let repeated = spanning.column(0) + spanning.column(2);
    spanning.set_column(3, &repeated);
    let rest = nalgebra::DMatrix::from_fn(12, 4, |row, column| entry(row, column + 9));
    let mut transformed = to_faer(&rest);
    let rank = split_by_column_space(to_faer(&spanning).as_ref(), transformed.as_mut(), 1e-11);
    assert_eq!(rank, 4);
    // The remaining rows have the Gram matrix of the part orthogonal to the columns.
    let svd = thin_svd(&spanning).unwrap();
    let basis = svd.u.columns(0, 4);
    let outside = &rest - basis * basis.tr_mul(&rest);
    let left = nalgebra::DMatrix::from_fn(12 - rank, 4, |row, column| transformed[(rank + row, column)]);
    assert!((left.tr_mul(&left) - outside.tr_mul(&outside)).amax() < 1e-13);
    let product = &svd.u * nalgebra::DMatrix::from_diagonal(&svd.singular_values) * svd.v.transpose();
    assert!((product - spanning).amax() < 1e-14);
}

#[test]
fn principal_angles_lie_above_minus_pi_and_up_to_pi() {
    use super::principal_angle;
    use std::f64::consts::PI;
    for angle in [0.0, 0.1, -2.5, 3.13, PI, -PI + 1e-15] {
        assert_eq!(principal_angle(angle), angle, "{angle}");
    }
    assert_eq!(principal_angle(-PI), PI);
    assert!((principal_angle((-267.7_f64).to_radians()).to_degrees() - 92.3).abs() < 1e-12);
    assert!((principal_angle(7.0 * PI) - PI).abs() < 1e-14);
}

#[test]
fn wrap_angle_maps_to_one_revolution() {
    use super::wrap_angle;
    use std::f64::consts::{PI, TAU};
    for angle in [0.0, 1e-300, -1e-17, 0.1, -2.5, 3.13, -PI, -PI + 1e-15] {
        assert_eq!(wrap_angle(angle).to_bits(), angle.to_bits(), "{angle}");
    }
    assert_eq!(wrap_angle(PI), -PI);
    for revolutions in -3..=3 {
        for angle in [-3.0, -0.5, 0.0, 0.7, 3.1] {
            assert!(
                (wrap_angle(angle + f64::from(revolutions) * TAU) - angle).abs() < 1e-14,
                "{angle} and {revolutions} revolutions"
            );
        }
    }
}

#[test]
fn tangent_basis_is_orthonormal_and_right_handed() {
    let mut random = SplitMix64::new(6);
    for _ in 0..100 {
        let direction = Vector3::from_fn(|_, _| random.next_unit() - 0.5).normalize();
        let basis = tangent_basis(&direction);
        assert!((basis.tr_mul(&basis) - nalgebra::Matrix2::identity()).amax() < 1e-14);
        assert!(basis.tr_mul(&direction).norm() < 1e-14);
        assert!((basis.column(0).cross(&basis.column(1)) - direction).norm() < 1e-14);
    }
}

#[test]
fn median_of_an_even_count_is_the_upper_one() {
    assert_eq!(median([]), None);
    assert_eq!(median([3.0]), Some(3.0));
    assert_eq!(median([4.0, 1.0, 3.0, 2.0]), Some(3.0));
    assert_eq!(median([5.0, -1.0, 2.0]), Some(2.0));
}

#[test]
fn ticks_are_round() {
    assert_eq!(ticks(0.0, 10.0, 5), (vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0], 2.0));
    assert_eq!(ticks(-0.3, 0.35, 3).0, [0.0]);
    assert_eq!(ticks(1.0, 1.0, 4).0, [0.0; 0]);
    assert_eq!(ticks(f64::NAN, 1.0, 4).0, [0.0; 0]);
}
