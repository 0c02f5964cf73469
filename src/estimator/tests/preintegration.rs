use nalgebra::{SVector, UnitQuaternion, Vector3};

use crate::estimator::factors::imu;
use crate::estimator::state::navigation::{ImuBias, Matrix15, NavigationState, Vector15};
use crate::estimator::state::preintegration::Preintegration;
use crate::geometry::{RigidTransform, ns_from_seconds, so3};
use crate::sensors::{ImuNoise, ImuSample};

const NOISE: ImuNoise = ImuNoise {
    accelerometer_noise_density: 0.004,
    accelerometer_random_walk: 0.006,
    gyroscope_noise_density: 3.4e-4,
    gyroscope_random_walk: 3.9e-5,
};

fn bias() -> ImuBias {
    ImuBias {
        gyroscope_rad_per_s: Vector3::new(0.004, -0.007, 0.002),
        accelerometer_m_per_s2: Vector3::new(-0.3, 0.15, 0.25),
    }
}

/// Strong motion of a multirotor: true angular velocity and specific force at `t_s`.
fn motion(t_s: f64) -> (Vector3<f64>, Vector3<f64>) {
    let w = Vector3::new(1.5 * (3.0 * t_s).sin(), 1.2 * (2.0 * t_s + 0.4).cos(), 0.8 * (1.3 * t_s).sin());
    let a = Vector3::new(2.0 * (2.5 * t_s).cos(), 1.5 * (3.1 * t_s).sin(), 9.81 + 2.0 * (1.7 * t_s).cos());
    (w, a)
}

fn samples(duration_s: f64, rate_hz: f64) -> Vec<ImuSample> {
    let count = (duration_s * rate_hz).round() as i64;
    (0..=count)
        .map(|k| {
            let (w, a) = motion(k as f64 / rate_hz);
            ImuSample {
                stamp_ns: ns_from_seconds(k as f64 / rate_hz),
                angular_velocity_rad_per_s: w + bias().gyroscope_rad_per_s,
                specific_force_m_per_s2: a + bias().accelerometer_m_per_s2,
                unmeasured_s: 0.0,
            }
        })
        .collect()
}

/// The same motion by Euler integration with a thousand times smaller steps.
fn fine_increment(duration_s: f64) -> (UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>) {
    let steps = (duration_s * 400_000.0).round() as usize;
    let h = duration_s / steps as f64;
    let (mut r, mut p, mut v) = (UnitQuaternion::identity(), Vector3::zeros(), Vector3::zeros());
    for k in 0..steps {
        let (w, a) = motion((k as f64 + 0.5) * h);
        let half = r * so3::exp(&(w * (0.5 * h)));
        p += v * h + half * a * (0.5 * h * h);
        v += half * a * h;
        r = UnitQuaternion::new_normalize((r * so3::exp(&(w * h))).into_inner());
    }
    (r, p, v)
}

#[test]
fn agrees_with_fine_integration() {
    for duration_s in [0.05, 0.5, 1.0] {
        let coarse = Preintegration::from_samples(NOISE, bias(), &samples(duration_s, 200.0));
        let (r, p, v) = fine_increment(duration_s);
        let increment = coarse.increment();
        assert!((coarse.duration_s() - duration_s).abs() < 1e-12);
        assert!(so3::log(&(increment.rotation.inverse() * r)).norm() < 3e-5 * duration_s, "rotation, {duration_s} s");
        assert!((increment.position_m - p).norm() < 1e-4 * duration_s * duration_s, "position, {duration_s} s");
        assert!((increment.velocity_m_per_s - v).norm() < 2e-4 * duration_s, "velocity, {duration_s} s");
    }
}

/// Preintegration of a second without the samples within a gap; with the interpolated ones of images in it, if there are
/// any.
fn over_gap(from_s: f64, gap_s: f64, images: usize) -> Preintegration {
    let (from_ns, to_ns) = (ns_from_seconds(from_s), ns_from_seconds(from_s + gap_s));
    let mut measured = samples(from_s + gap_s + 0.1, 200.0);
    measured.retain(|sample| sample.stamp_ns <= from_ns || sample.stamp_ns >= to_ns);
    measured.retain(|sample| sample.stamp_ns >= from_ns - 100_000_000);
    let after = measured.iter().position(|sample| sample.stamp_ns >= to_ns).unwrap();
    let (before, next) = (measured[after - 1], measured[after]);
    let step_ns = (next.stamp_ns - before.stamp_ns) / (images as i64 + 1);
    let between: Vec<ImuSample> =
        (1..=images as i64).map(|image| before.interpolated(&next, before.stamp_ns + image * step_ns)).collect();
    measured.splice(after..after, between);
    Preintegration::from_samples(NOISE, bias(), &measured)
}

#[test]
fn the_covariance_of_a_gap_contains_its_error() {
    for (gap_s, least) in [(0.1, 0.0), (0.4, 0.005), (0.8, 0.02)] {
        let (mut sum, mut count) = (0.0, 0);
        for begin in 0..40 {
            let from_s = 0.2 + 0.1 * f64::from(begin);
            let found = over_gap(from_s, gap_s, 0);
            let duration_s = found.duration_s();
            let all = samples(from_s + gap_s + 0.1, 200.0);
            let first_ns = found.samples()[0].stamp_ns;
            let whole: Vec<ImuSample> = all.into_iter().filter(|sample| sample.stamp_ns >= first_ns).collect();
            let truth = Preintegration::from_samples(NOISE, bias(), &whole);
            assert!((truth.duration_s() - duration_s).abs() < 1e-9);
            let (found_motion, true_motion) = (found.increment(), truth.increment());
            let rotation = so3::log(&(found_motion.rotation.inverse() * true_motion.rotation));
            let velocity = true_motion.velocity_m_per_s - found_motion.velocity_m_per_s;
            for axis in 0..3 {
                sum += rotation[axis].powi(2) / found.covariance()[(axis, axis)];
                sum += velocity[axis].powi(2) / found.covariance()[(6 + axis, 6 + axis)];
                count += 2;
            }
        }
        let mean = sum / f64::from(count);
        assert!((least..1.5).contains(&mean), "squared error relative to the variance {mean:.3} in gaps of {gap_s} s");
    }
}

#[test]
fn images_within_a_gap_do_not_change_its_covariance() {
    let (alone, with_images) = (over_gap(0.5, 0.6, 0), over_gap(0.5, 0.6, 11));
    assert_eq!(with_images.samples().len(), alone.samples().len() + 11);
    for row in [0, 1, 2, 6, 7, 8] {
        let (one, other) = (alone.covariance()[(row, row)], with_images.covariance()[(row, row)]);
        assert!((one / other - 1.0).abs() < 0.2, "row {row}: {one:.4} and {other:.4}");
    }
    let without = Preintegration::from_samples(NOISE, bias(), &samples(0.7, 200.0));
    assert!(alone.covariance()[(0, 0)] > 100.0 * without.covariance()[(0, 0)]);
}

#[test]
fn extending_equals_integrating_at_once() {
    let all = samples(0.2, 200.0);
    let whole = Preintegration::from_samples(NOISE, bias(), &all);
    let mut parts = Preintegration::from_samples(NOISE, bias(), &all[..=12]);
    parts.extend(&all[12..]);
    assert_eq!(whole.increment(), parts.increment());
    assert_eq!(whole.covariance(), parts.covariance());
    parts.reintegrate(ImuBias::default());
    parts.reintegrate(bias());
    assert_eq!(whole.increment(), parts.increment());
}

#[test]
fn invalid_imu_samples_are_skipped() {
    let all = samples(0.05, 200.0);
    let mut broken = all.clone();
    broken.insert(3, ImuSample { specific_force_m_per_s2: Vector3::repeat(f64::NAN), ..all[3] });
    broken.insert(6, all[1]);
    let clean = Preintegration::from_samples(NOISE, bias(), &all);
    let kept = Preintegration::from_samples(NOISE, bias(), &broken);
    assert_eq!(clean.increment(), kept.increment());
    assert!(Preintegration::new(NOISE, bias()).square_root_information().is_none());
}

#[test]
fn bias_jacobian_meets_central_differences() {
    let all = samples(0.4, 200.0);
    let at = |change: &SVector<f64, 6>| {
        let shifted = ImuBias {
            gyroscope_rad_per_s: bias().gyroscope_rad_per_s + change.fixed_rows::<3>(0),
            accelerometer_m_per_s2: bias().accelerometer_m_per_s2 + change.fixed_rows::<3>(3),
        };
        *Preintegration::from_samples(NOISE, shifted, &all).increment()
    };
    let nominal = Preintegration::from_samples(NOISE, bias(), &all);
    let step = 1e-5;
    for column in 0..6 {
        let mut change = SVector::<f64, 6>::zeros();
        change[column] = step;
        let (up, down) = (at(&change), at(&-change));
        let phi = (so3::log(&(nominal.increment().rotation.inverse() * up.rotation))
            - so3::log(&(nominal.increment().rotation.inverse() * down.rotation)))
            / (2.0 * step);
        let p = (up.position_m - down.position_m) / (2.0 * step);
        let v = (up.velocity_m_per_s - down.velocity_m_per_s) / (2.0 * step);
        let analytic = nominal.bias_jacobian().column(column).into_owned();
        assert!((analytic.fixed_rows::<3>(0) - phi).amax() < 1e-8, "rotation, column {column}");
        assert!((analytic.fixed_rows::<3>(3) - p).amax() < 1e-8, "position, column {column}");
        assert!((analytic.fixed_rows::<3>(6) - v).amax() < 1e-8, "velocity, column {column}");
    }
}

/// Increments with sampled white noise and random walks scatter as their covariance predicts.
#[test]
fn covariance_is_that_of_drawn_noise() {
    let mut random = crate::estimator::tests::Noise::new(7);
    let clean = samples(0.3, 200.0);
    let nominal = Preintegration::from_samples(NOISE, bias(), &clean);
    let h: f64 = 0.005;
    let draws = 4000;
    let mut scatter = Matrix15::zeros();
    for _ in 0..draws {
        let mut noisy = clean.clone();
        let (mut walk_g, mut walk_a) = (Vector3::zeros(), Vector3::zeros());
        for sample in &mut noisy {
            sample.angular_velocity_rad_per_s += walk_g + random.vector() * (NOISE.gyroscope_noise_density / h.sqrt());
            sample.specific_force_m_per_s2 += walk_a + random.vector() * (NOISE.accelerometer_noise_density / h.sqrt());
            walk_g += random.vector() * (NOISE.gyroscope_random_walk * h.sqrt());
            walk_a += random.vector() * (NOISE.accelerometer_random_walk * h.sqrt());
        }
        let drawn = Preintegration::from_samples(NOISE, bias(), &noisy);
        let mut error = Vector15::zeros();
        let back = nominal.increment().rotation.inverse();
        error.fixed_rows_mut::<3>(0).copy_from(&so3::log(&(back * drawn.increment().rotation)));
        error.fixed_rows_mut::<3>(3).copy_from(&(drawn.increment().position_m - nominal.increment().position_m));
        error
            .fixed_rows_mut::<3>(6)
            .copy_from(&(drawn.increment().velocity_m_per_s - nominal.increment().velocity_m_per_s));
        error.fixed_rows_mut::<3>(9).copy_from(&walk_g);
        error.fixed_rows_mut::<3>(12).copy_from(&walk_a);
        scatter += error * error.transpose() / draws as f64;
    }
    for k in 0..15 {
        let ratio = scatter[(k, k)] / nominal.covariance()[(k, k)];
        assert!((0.88..1.12).contains(&ratio), "variance {k}: drawn over predicted {ratio}");
    }
    // In samples the walk has the opposite sign of the bias error in the transition.
    for (row, column) in [(6, 12), (3, 6), (7, 13), (0, 9)] {
        let scale = (nominal.covariance()[(row, row)] * nominal.covariance()[(column, column)]).sqrt();
        let sign = if column >= 9 { -1.0 } else { 1.0 };
        let difference = (sign * scatter[(row, column)] - nominal.covariance()[(row, column)]) / scale;
        assert!(difference.abs() < 0.06, "correlation {row},{column}: {difference}");
    }
}

fn states() -> (NavigationState, NavigationState) {
    let from = NavigationState {
        world_from_imu: RigidTransform::new(so3::exp(&Vector3::new(0.3, -0.4, 1.1)), Vector3::new(1.0, -2.0, 3.0)),
        velocity_m_per_s: Vector3::new(0.5, 1.5, -0.3),
        bias: ImuBias {
            gyroscope_rad_per_s: bias().gyroscope_rad_per_s + Vector3::new(0.01, 0.02, -0.015),
            accelerometer_m_per_s2: bias().accelerometer_m_per_s2 + Vector3::new(0.1, -0.05, 0.07),
        },
    };
    let preintegration = Preintegration::from_samples(NOISE, bias(), &samples(0.3, 200.0));
    let to = preintegration.predict(&from, &Vector3::new(0.0, 0.0, -9.81));
    let disturb = Vector15::from_fn(|row, _| 0.05 * ((row * 7 % 5) as f64 - 2.0));
    (from, to.plus(&disturb))
}

#[test]
fn prediction_leaves_no_residual() {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let preintegration = Preintegration::from_samples(NOISE, bias(), &samples(0.3, 200.0));
    let (from, _) = states();
    let to = preintegration.predict(&from, &gravity);
    assert!(imu::residual(&preintegration, &from, &to, &gravity, None).amax() < 1e-13);
}

#[test]
fn factor_jacobians_meet_central_differences() {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let preintegration = Preintegration::from_samples(NOISE, bias(), &samples(0.3, 200.0));
    let (from, to) = states();
    let [by_from, by_to, _] = imu::jacobians(&preintegration, &from, &to, &gravity, None);
    let step = 1e-6;
    for column in 0..15 {
        let mut delta = Vector15::zeros();
        delta[column] = step;
        let at =
            |from: &NavigationState, to: &NavigationState| imu::residual(&preintegration, from, to, &gravity, None);
        let numeric_from = (at(&from.plus(&delta), &to) - at(&from.plus(&-delta), &to)) / (2.0 * step);
        let numeric_to = (at(&from, &to.plus(&delta)) - at(&from, &to.plus(&-delta))) / (2.0 * step);
        assert!((by_from.column(column) - numeric_from).amax() < 1e-7, "from, column {column}");
        assert!((by_to.column(column) - numeric_to).amax() < 1e-7, "to, column {column}");
    }
}
