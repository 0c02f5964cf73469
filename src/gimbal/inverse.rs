//! Joint angles from the orientation of the camera (inverse kinematics of the rotation).

use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion, Vector3};

use crate::geometry::{so3, wrap_angle};

use super::frame::{Axis, ChainFrame};
use super::{ClassicalChain, DhLink};

/// Joint angles this far beyond the limits are accepted, because measurements and limits have errors.
const LIMIT_TOLERANCE_RAD: f64 = 0.035;
/// Solutions whose errors differ by less than this fit equally well.
const ALIKE_RAD: f64 = 0.05;
/// Below this margin the previous solution decides. Two perpendicular outer axes have this margin at 6° from
/// parallel; an error of the orientation then appears ten times as large in the joint angles.
const SINGULAR_MARGIN: f64 = 0.07;
/// Weight of the previous solution at the singularity, relative to the orientation's weight: small enough to pull the
/// joints that the orientation constrains by a thousandth of their motion only.
const PREVIOUS_WEIGHT: f64 = 1e-3;
/// Largest number of iterations of a solution.
const STEPS: usize = 60;
/// Iterations with a step below this have converged.
const CONVERGED_RAD: f64 = 1e-13;
/// Initial angles per joint over its range, for chains of less than three joints.
const STARTS_PER_JOINT: usize = 8;
/// Solutions closer than this are equal.
const SAME_RAD: f64 = 1e-4;

/// Inverse rotation of a chain with one to three joints within their limits.
#[derive(Clone, Debug)]
pub struct InverseChain {
    imu_from_base: UnitQuaternion<f64>,
    links: Vec<DhLink>,
    effector_from_camera: UnitQuaternion<f64>,
    /// Middle of each joint's limits, and half the distance of the limits plus the tolerance, in radians.
    ranges: Vec<(f64, f64)>,
}

/// Joint angles for an orientation of the camera.
#[derive(Clone, Debug, PartialEq)]
pub struct InverseSolution {
    /// One angle per joint in radians, without the static offsets; within half a rotation of the middle of the limits.
    pub joint_angles_rad: Vec<f64>,
    /// Remaining rotation that the joints cannot reach, in radians.
    pub unreachable_rad: f64,
    /// Smallest singular value of the joint axes (columns of unit length): 0 at a singularity.
    pub margin: f64,
    /// True if the orientation alone determines the solution, without influence of the previous one.
    pub decided: bool,
}

/// Orientation error of the camera and the joint axes, at given joint angles.
struct Pose {
    /// Rotation vector from the pose to the wanted orientation, in the camera frame.
    missing: Vector3<f64>,
    /// Unit axis of each joint in the camera frame.
    axes: Vec<Vector3<f64>>,
}

impl InverseChain {
    /// Largest number of joints that an orientation determines.
    pub const MAX_JOINTS: usize = 3;

    /// Inverse of a chain with limits (lower, upper) for each joint; `None` unless it has one to three joints.
    pub fn new(chain: &ClassicalChain, limits_rad: &[(f64, f64)]) -> Option<Self> {
        let joints = chain.links.len();
        if !(1..=Self::MAX_JOINTS).contains(&joints) || limits_rad.len() != joints {
            return None;
        }
        let range = |(lower, upper): &(f64, f64)| (0.5 * (lower + upper), 0.5 * (upper - lower) + LIMIT_TOLERANCE_RAD);
        Some(Self {
            imu_from_base: chain.imu_from_base.rotation,
            links: chain.links.clone(),
            effector_from_camera: chain.effector_from_camera.rotation,
            ranges: limits_rad.iter().map(range).collect(),
        })
    }

    /// Returns the inverse for orientations that are rotated by a constant angle about the axis of the first joint.
    pub fn with_first_joint_offset(self, offset_rad: f64) -> Self {
        let offset = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), offset_rad);
        Self { imu_from_base: self.imu_from_base * offset, ..self }
    }

    /// Joint angles for a rotation `imu_from_camera`, least squares where the joints cannot reach it.
    ///
    /// Two solutions may exist, on either side of a singularity. If only one is within the limits, and the chain is not
    /// near the singularity, it does not depend on `previous`. Otherwise the solution nearest to `previous` is
    /// returned; near the singularity it is also pulled to `previous` in the directions that the orientation does not
    /// constrain. Without a previous solution, the middle of the limits is used instead.
    pub fn solve(&self, imu_from_camera: &UnitQuaternion<f64>, previous: Option<&[f64]>) -> InverseSolution {
        let solutions = self.solutions(imu_from_camera);
        let middle: Vec<f64> = self.ranges.iter().map(|(middle, _)| *middle).collect();
        let previous = previous.filter(|angles| angles.len() == middle.len()).unwrap_or(&middle);
        let distance = |solution: &InverseSolution| {
            let joints = solution.joint_angles_rad.iter().zip(previous);
            joints.map(|(angle, before)| wrap_angle(angle - before).powi(2)).sum::<f64>()
        };
        let nearest = solutions.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let Some(nearest) = nearest.filter(|nearest| nearest.margin < SINGULAR_MARGIN) else {
            let decided = solutions.len() == 1;
            let taken = nearest.cloned().unwrap_or_else(|| self.refined(&middle, imu_from_camera, None));
            return InverseSolution { decided, ..taken };
        };
        let near_rad: Vec<f64> =
            self.ranges.iter().zip(previous).map(|(range, angle)| within(*range, *angle)).collect();
        let weight = PREVIOUS_WEIGHT * (1.0 - nearest.margin / SINGULAR_MARGIN).powi(2);
        self.refined(&near_rad, imu_from_camera, Some((&near_rad, weight)))
    }

    /// Solutions that fit equally well, in a fixed order.
    fn solutions(&self, wanted: &UnitQuaternion<f64>) -> Vec<InverseSolution> {
        let starts =
            if self.links.len() == Self::MAX_JOINTS { self.closed_form(wanted) } else { self.best_start(wanted) };
        let mut solutions: Vec<InverseSolution> = Vec::new();
        for start in starts {
            let solution = self.refined(&start, wanted, None);
            let known = solutions.iter().any(|other| {
                let pairs = other.joint_angles_rad.iter().zip(&solution.joint_angles_rad);
                pairs.into_iter().all(|(a, b)| wrap_angle(a - b).abs() < SAME_RAD)
            });
            if !known {
                solutions.push(solution);
            }
        }
        let least = solutions.iter().map(|solution| solution.unreachable_rad).fold(f64::INFINITY, f64::min);
        solutions.retain(|solution| solution.unreachable_rad < least + ALIKE_RAD);
        solutions
    }

    /// Initial angles of both solutions of three joints: with `R = Rz(ψ₁)·M(ψ₂)·Rz(ψ₃)`, `M = Rx(α₁)·Rz(ψ₂)·Rx(α₂)`,
    /// the lower right corner of `R` is `cos α₁·cos α₂ − sin α₁·sin α₂·cos ψ₂`; its last column and row then give ψ₁
    /// and ψ₃.
    fn closed_form(&self, wanted: &UnitQuaternion<f64>) -> Vec<Vec<f64>> {
        let about_x = |angle_rad: f64| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), angle_rad);
        let about_z = |angle_rad: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad);
        let alpha = |link: usize| self.links[link].alpha_rad;
        let rotation = self.imu_from_base.inverse() * wanted * self.effector_from_camera.inverse() * about_x(-alpha(2));
        let rotation: Matrix3<f64> = rotation.to_rotation_matrix().into_inner();
        let sines = alpha(0).sin() * alpha(1).sin();
        let cosine = (alpha(0).cos() * alpha(1).cos() - rotation[(2, 2)]) / sines;
        let second_rad = if cosine.is_finite() { cosine.clamp(-1.0, 1.0).acos() } else { 0.0 };
        let start = |second_rad: f64| {
            let middle = (about_x(alpha(0)) * about_z(second_rad) * about_x(alpha(1))).to_rotation_matrix();
            let first_rad = rotation[(1, 2)].atan2(rotation[(0, 2)]) - middle[(1, 2)].atan2(middle[(0, 2)]);
            let third_rad = middle[(2, 1)].atan2(middle[(2, 0)]) - rotation[(2, 1)].atan2(rotation[(2, 0)]);
            let angles = [first_rad, second_rad, third_rad].into_iter().zip(&self.links).zip(&self.ranges);
            angles.map(|((angle, link), range)| within(*range, angle - link.theta_offset_rad)).collect()
        };
        vec![start(second_rad), start(-second_rad)]
    }

    /// Best of evenly spaced angles, for one or two joints.
    fn best_start(&self, wanted: &UnitQuaternion<f64>) -> Vec<Vec<f64>> {
        let at = |(middle, half): &(f64, f64), step: usize| {
            let half = half.min(std::f64::consts::PI);
            middle + half * ((2 * step + 1) as f64 / STARTS_PER_JOINT as f64 - 1.0)
        };
        let mut starts: Vec<Vec<f64>> = vec![Vec::new()];
        for range in &self.ranges {
            let longer = |start: &Vec<f64>, step: usize| start.iter().copied().chain([at(range, step)]).collect();
            starts =
                starts.iter().flat_map(|start| (0..STARTS_PER_JOINT).map(move |step| longer(start, step))).collect();
        }
        let error = |start: &Vec<f64>| self.pose(start, wanted).missing.norm_squared();
        let best = starts.into_iter().map(|start| (error(&start), start)).min_by(|a, b| a.0.total_cmp(&b.0));
        best.into_iter().map(|(_, start)| start).collect()
    }

    fn pose(&self, angles_rad: &[f64], wanted: &UnitQuaternion<f64>) -> Pose {
        let mut frame = ChainFrame::identity();
        let mut axes_in_base = Vec::with_capacity(self.links.len());
        for (link, angle) in self.links.iter().zip(angles_rad) {
            axes_in_base.push(frame.axis(Axis::Z));
            link.extend(&mut frame, *angle);
        }
        let base_from_camera = frame.to_transform().rotation * self.effector_from_camera;
        let missing = so3::log(&(base_from_camera.inverse() * self.imu_from_base.inverse() * wanted));
        let axes = axes_in_base.iter().map(|axis| base_from_camera.inverse() * axis).collect();
        Pose { missing, axes }
    }

    /// Minimizes the squared rotation error, plus with `held` the weighted squared distance from given angles (rad),
    /// within the limits.
    fn refined(&self, start: &[f64], wanted: &UnitQuaternion<f64>, held: Option<(&[f64], f64)>) -> InverseSolution {
        let joints = self.links.len();
        let (held_rad, weight) = held.unwrap_or((start, 0.0));
        let cost = |angles: &[f64], pose: &Pose| {
            let away: f64 = angles.iter().zip(held_rad).map(|(angle, held)| (angle - held).powi(2)).sum();
            pose.missing.norm_squared() + weight * away
        };
        let mut angles = start.to_vec();
        let mut pose = self.pose(&angles, wanted);
        for _ in 0..STEPS {
            let downhill = DVector::from_fn(joints, |row, _| {
                pose.axes[row].dot(&pose.missing) + weight * (held_rad[row] - angles[row])
            });
            let free: Vec<usize> = (0..joints)
                .filter(|joint| {
                    let (middle, half) = self.ranges[*joint];
                    let beyond = angles[*joint] - middle;
                    half >= std::f64::consts::PI || beyond.abs() < half || beyond.signum() * downhill[*joint] < 0.0
                })
                .collect();
            let normal = DMatrix::from_fn(free.len(), free.len(), |row, column| {
                let held = if row == column { weight + 1e-12 } else { 0.0 };
                pose.axes[free[row]].dot(&pose.axes[free[column]]) + held
            });
            let right = DVector::from_fn(free.len(), |row, _| downhill[free[row]]);
            let Some(step) = normal.cholesky().map(|cholesky| cholesky.solve(&right)) else { break };
            let before = cost(&angles, &pose);
            let mut scale = 1.0;
            let mut moved_rad = 0.0;
            while scale > 1e-4 {
                let mut next = angles.clone();
                for (index, joint) in free.iter().enumerate() {
                    next[*joint] = clamped(self.ranges[*joint], angles[*joint] + scale * step[index]);
                }
                let next_pose = self.pose(&next, wanted);
                if cost(&next, &next_pose) <= before {
                    moved_rad = next.iter().zip(&angles).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    (angles, pose) = (next, next_pose);
                    break;
                }
                scale *= 0.5;
            }
            if moved_rad < CONVERGED_RAD {
                break;
            }
        }
        let axes = DMatrix::from_fn(joints, joints, |row, column| pose.axes[row].dot(&pose.axes[column]));
        let least = axes.symmetric_eigenvalues().min();
        InverseSolution {
            joint_angles_rad: angles.iter().zip(&self.ranges).map(|(angle, range)| around(*range, *angle)).collect(),
            unreachable_rad: pose.missing.norm(),
            margin: least.max(0.0).sqrt(),
            decided: false,
        }
    }
}

/// Equivalent angle within half a revolution of the middle of a range.
fn around((middle, _): (f64, f64), angle_rad: f64) -> f64 {
    middle + wrap_angle(angle_rad - middle)
}

/// Equivalent angle nearest to the middle of a range, clamped to the range.
fn within(range: (f64, f64), angle_rad: f64) -> f64 {
    clamped(range, around(range, angle_rad))
}

/// Clamps an angle to a range; a range of a full revolution has no limits.
fn clamped((middle, half): (f64, f64), angle_rad: f64) -> f64 {
    if half >= std::f64::consts::PI { angle_rad } else { angle_rad.clamp(middle - half, middle + half) }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;
    use crate::geometry::RigidTransform;
    use crate::gimbal::tests::random::Random;

    fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| wrap_angle(a - b).abs()).fold(0.0, f64::max)
    }

    fn rotation(chain: &ClassicalChain, angles_rad: &[f64]) -> UnitQuaternion<f64> {
        chain.imu_from_camera(angles_rad).rotation
    }

    /// Chain with perpendicular axes z, x, y or z, y, x as gimbals have them, and the camera looking along x.
    fn gimbal(order: &str, limits_deg: [f64; 6]) -> (ClassicalChain, Vec<(f64, f64)>) {
        let quarter = FRAC_PI_2;
        let angles: [(f64, f64); 3] = match order {
            "zxy" => [(quarter, quarter), (quarter, quarter), (0.0, 0.0)],
            _ => [(0.0, -quarter), (quarter, quarter), (0.0, 0.0)],
        };
        let links =
            angles.map(|(theta_offset_rad, alpha_rad)| DhLink { theta_offset_rad, alpha_rad, ..DhLink::default() });
        let chain = ClassicalChain {
            imu_from_base: RigidTransform::identity(),
            links: links.to_vec(),
            effector_from_camera: RigidTransform::identity(),
        };
        let limits = limits_deg.chunks(2).map(|pair| (pair[0].to_radians(), pair[1].to_radians())).collect();
        (chain, limits)
    }

    #[test]
    fn random_chains_return_their_joint_angles() {
        let mut random = Random::new(11);
        let mut solved = 0;
        for joints in 1..=3 {
            for _ in 0..200 {
                let chain = random.chain(joints);
                let angles = random.angles(joints);
                let limits: Vec<(f64, f64)> = angles
                    .iter()
                    .map(|angle| (angle - 1.0 + random.within(0.3), angle + 1.0 + random.within(0.3)))
                    .collect();
                let inverse = InverseChain::new(&chain, &limits).unwrap();
                let wanted = rotation(&chain, &angles);
                let solution = inverse.solve(&wanted, Some(&angles));
                let found = rotation(&chain, &solution.joint_angles_rad);
                assert!(found.angle_to(&wanted) < 1e-3, "{joints} joints: {}", found.angle_to(&wanted).to_degrees());
                if solution.margin > SINGULAR_MARGIN {
                    solved += 1;
                    let error = largest_difference(&solution.joint_angles_rad, &angles);
                    assert!(error < 1e-7, "{joints} joints, margin {}: {error}", solution.margin);
                    assert!(solution.unreachable_rad < 1e-7);
                }
            }
        }
        assert!(solved > 500, "{solved} of 600");
    }

    #[test]
    fn a_decided_solution_does_not_depend_on_the_previous_one() {
        let (chain, limits) = gimbal("zxy", [-180.0, 180.0, -25.0, 25.0, -120.0, 30.0]);
        let inverse = InverseChain::new(&chain, &limits).unwrap();
        let mut random = Random::new(3);
        for _ in 0..300 {
            let angles = [random.within(3.1), random.within(0.43), -0.785 + random.within(1.3)];
            let wanted = so3::exp(&random.vector(0.02)) * rotation(&chain, &angles);
            let alone = inverse.solve(&wanted, None);
            assert!(alone.decided && alone.margin > 0.5, "{angles:?}: {alone:?}");
            assert_eq!(inverse.solve(&wanted, Some(&random.angles(3))), alone);
            assert!(largest_difference(&alone.joint_angles_rad, &angles) < 0.06);
        }
    }

    #[test]
    fn the_part_that_the_joints_cannot_make_is_reported() {
        // Two joints, yaw and pitch, cannot compensate a roll of the camera.
        let (mut chain, mut limits) = gimbal("zyx", [-180.0, 180.0, -120.0, 30.0, 0.0, 1.0]);
        chain.links.truncate(2);
        limits.truncate(2);
        let inverse = InverseChain::new(&chain, &limits).unwrap();
        for (yaw, pitch, roll_deg) in [(0.3, -0.5, 5.0_f64), (-2.0, 0.1, -12.0), (1.0, -0.9, 20.0)] {
            // A third joint would rotate about the camera's z axis.
            let about = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll_deg.to_radians());
            let wanted = rotation(&chain, &[yaw, pitch]) * about;
            let solution = inverse.solve(&wanted, None);
            let grid =
                (0..720).flat_map(|a| (0..300).map(move |b| [f64::from(a) * 0.5 - 180.0, f64::from(b) * 0.5 - 120.0]));
            let best =
                grid.map(|at| rotation(&chain, &at.map(f64::to_radians)).angle_to(&wanted)).fold(f64::MAX, f64::min);
            assert!((solution.unreachable_rad - best).abs() < 0.005, "{} and {best}", solution.unreachable_rad);
            assert!(solution.unreachable_rad > 0.2 * roll_deg.abs().to_radians());
        }
        // One joint at its limit.
        let (chain, limits) = gimbal("zxy", [-30.0, 30.0, -25.0, 25.0, -120.0, 30.0]);
        let inverse = InverseChain::new(&chain, &limits).unwrap();
        let solution = inverse.solve(&rotation(&chain, &[50_f64.to_radians(), 0.0, 0.0]), None);
        let tolerated_rad = 30_f64.to_radians() + LIMIT_TOLERANCE_RAD;
        assert!(largest_difference(&solution.joint_angles_rad, &[tolerated_rad, 0.0, 0.0]) < 1e-9, "{solution:?}");
        assert!((solution.unreachable_rad - (50_f64.to_radians() - tolerated_rad)).abs() < 1e-9);
    }

    #[test]
    fn joint_angles_are_continuous_through_the_singularity() {
        // Yaw, pitch, roll: outer axes are parallel at a pitch of −90°.
        for limits in [[-180.0, 180.0, -170.0, 60.0, -180.0, 180.0], [-180.0, 180.0, -130.0, 60.0, -25.0, 25.0]] {
            let (chain, limits) = gimbal("zyx", limits);
            let inverse = InverseChain::new(&chain, &limits).unwrap();
            let mut random = Random::new(5);
            let mut previous: Option<Vec<f64>> = None;
            let (mut singular, mut worst_rad) = (0, 0.0_f64);
            for step in 0..900 {
                let time_s = f64::from(step) * 0.01;
                let pitch_deg = -85.0 + 30.0 * (1.4 * time_s).sin();
                let angles = [0.5 * (0.9 * time_s).sin(), pitch_deg.to_radians(), 0.2 * (1.7 * time_s).cos()];
                let wanted = so3::exp(&random.vector(5e-4)) * rotation(&chain, &angles);
                let solution = inverse.solve(&wanted, previous.as_deref());
                assert!(solution.unreachable_rad < 0.01, "{time_s} s: {solution:?}");
                let error = largest_difference(&solution.joint_angles_rad, &angles);
                if solution.margin < SINGULAR_MARGIN {
                    singular += 1;
                } else {
                    worst_rad = worst_rad.max(error);
                }
                assert!(error < 0.12, "{time_s} s, pitch {pitch_deg}: {error} of {solution:?}, {angles:?}");
                previous = Some(solution.joint_angles_rad);
            }
            assert!(singular > 60 && worst_rad < 0.012, "{singular} singular, {worst_rad} rad elsewhere");
        }
    }

    #[test]
    fn chains_without_joints_or_with_many_are_not_inverted() {
        let mut random = Random::new(1);
        for joints in [0, 4] {
            assert!(InverseChain::new(&random.chain(joints), &vec![(-PI, PI); joints]).is_none());
        }
    }
}
