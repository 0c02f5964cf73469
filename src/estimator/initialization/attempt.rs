//! One attempt to initialize.

use nalgebra::{UnitQuaternion, Vector3};

use super::alignment::{Alignment, AlignmentInput, VectorPrior, align, align_rotations, median_distance};
use super::bearing::level;
use super::checks::{Checklist, Shown};
use super::refinement::{RefinedInitialization, RefinedState, Refinement, RefinementInput};
use super::selection::{guessed_rotations, select_views};
use super::stereo::from_stereo;
use super::structure::{
    Structure, StructureFailure, StructureLimits, ViewPair, collect_tracks, common_bearings, rank_pairs, reconstruct,
    thin_out,
};
use super::visual_problem::{between, mean_square};
use super::{
    InitializationDiagnostics, InitializationFrame, InitializationInput, InitializationOptions, InitializationOrigin,
    InitializationOutcome, InitializationSolution, InitializedFrame, InitializedLandmark, StationaryEstimate,
    StationaryPolicy, stationary,
};
use crate::estimator::state::navigation::ImuBias;
use crate::estimator::state::preintegration::Preintegration;
use crate::geometry::{RigidTransform, seconds_from_ns};

/// Iteration limits of the refinement: before outlier landmarks are dropped, and after.
const REFINEMENT_ROUNDS: [usize; 2] = [10, 25];
/// A landmark with an observation beyond this many standard deviations is dropped between the two refinements.
const OUTLIER_SIGMAS: f64 = 4.0;
/// Change of the gyroscope bias that triggers a new integration of the intervals.
const REINTEGRATE_RAD_PER_S: f64 = 0.003;

/// Tries to initialize from the given frames.
pub fn try_initialize(input: &InitializationInput<'_>, options: &InitializationOptions) -> InitializationOutcome {
    let mut still = Checklist::default();
    let stationary = stationary::detect(input, &mut still);
    if let (Some(stationary), StationaryPolicy::InitializeAtOnce) = (&stationary, options.stationary_policy) {
        return from_stationary(input, stationary, still);
    }
    let mut of_pair = Checklist::default();
    if let Some(mut solution) = from_stereo(input, options, stationary.as_ref(), &mut of_pair) {
        solution.passed = of_pair.passed;
        return InitializationOutcome::Initialized(Box::new(solution));
    }
    let mut checklist = Checklist::default();
    match from_motion(input, options, stationary.or(input.stationary).as_ref(), &mut checklist) {
        Some(mut solution) => {
            solution.passed = checklist.passed;
            InitializationOutcome::Initialized(Box::new(solution))
        }
        None => InitializationOutcome::Waiting {
            reasons: [of_pair.failed, checklist.failed].concat(),
            passed: [of_pair.passed, checklist.passed].concat(),
            stationary,
        },
    }
}

/// Solution of a stationary vehicle: gravity along the mean specific force, accelerometer bias only along it (the
/// observable part).
fn from_stationary(
    input: &InitializationInput<'_>,
    stationary: &StationaryEstimate,
    checklist: Checklist,
) -> InitializationOutcome {
    let force = stationary.specific_force_m_per_s2;
    let excess = 1.0 - input.gravity_m_per_s2 / force.norm();
    let world_from_imu = RigidTransform::new(level(&-force), Vector3::zeros());
    let frames = input
        .frames
        .iter()
        .filter(|frame| stationary.stamp_ns - frame.stamp_ns <= 1_000_000_000)
        .map(|frame| InitializedFrame {
            frame_index: frame.frame_index,
            stamp_ns: frame.stamp_ns,
            world_from_imu,
            velocity_m_per_s: Vector3::zeros(),
            imu_from_camera: frame.imu_from_camera,
        })
        .collect();
    InitializationOutcome::Initialized(Box::new(InitializationSolution {
        origin: InitializationOrigin::Stationary,
        frames,
        bias: ImuBias {
            gyroscope_rad_per_s: stationary.gyroscope_bias_rad_per_s,
            accelerometer_m_per_s2: force * excess,
        },
        landmarks: Vec::new(),
        diagnostics: InitializationDiagnostics {
            gyroscope_bias_sigma_rad_per_s: stationary.gyroscope_bias_sigma_rad_per_s,
            ..InitializationDiagnostics::default()
        },
        passed: checklist.passed,
    }))
}

fn from_motion(
    input: &InitializationInput<'_>,
    options: &InitializationOptions,
    stationary: Option<&StationaryEstimate>,
    checklist: &mut Checklist,
) -> Option<InitializationSolution> {
    let at_rest = stationary.map(|stationary| VectorPrior {
        mean: stationary.gyroscope_bias_rad_per_s,
        sigma: stationary.gyroscope_bias_sigma_rad_per_s.max(5e-4),
    });
    let found = input
        .bias
        .map(|bias| VectorPrior { mean: bias.mean.gyroscope_rad_per_s, sigma: bias.gyroscope_sigma_rad_per_s.max() });
    let known = [at_rest, found].into_iter().flatten().min_by(|one, other| one.sigma.total_cmp(&other.sigma));
    let gyroscope_prior =
        known.unwrap_or_else(|| VectorPrior { mean: Vector3::zeros(), sigma: options.gyroscope_bias_sigma_rad_per_s });
    let rotations = guessed_rotations(input.frames, &gyroscope_prior.mean);
    let selected = select_views(input.frames, &rotations, options);
    let count = selected.len() as f64;
    checklist.at_least("views", "number of views", count, options.min_views as f64, Shown::Plain(""));
    let span = match (selected.first(), selected.last()) {
        (Some(&first), Some(&last)) => seconds_from_ns(input.frames[last].stamp_ns - input.frames[first].stamp_ns),
        _ => 0.0,
    };
    checklist.at_least(
        "window",
        "time between the first and the last view",
        span,
        options.shortest_window_s,
        Shown::Plain(" s"),
    );
    let views: Vec<_> = selected.iter().map(|&index| input.frames[index].features).collect();
    let guesses: Vec<_> = selected.iter().map(|&index| rotations[index]).collect();
    let mut tracks = collect_tracks(&views);
    let pairs = rank_pairs(&tracks, &guesses, options.min_common_features);
    let common = (1..views.len()).map(|view| common_bearings(&tracks, view - 1, view).len()).min().unwrap_or(0);
    let min_common = options.min_common_features as f64;
    checklist.at_least(
        "features",
        "features in common between neighbouring views",
        common as f64,
        min_common,
        Shown::Plain(""),
    );
    let parallax_rad = pairs.first().map_or(0.0, |pair: &ViewPair| pair.fit.median_parallax_rad);
    let subject = "parallax of the best pair of views, rotation compensated";
    checklist.at_least("parallax", subject, parallax_rad, options.min_parallax_rad, Shown::Degrees);
    let excitation = excitation(input.frames, &selected, &rotations);
    let subject = "σ of the acceleration between views";
    checklist.at_least("excitation", subject, excitation, options.min_excitation_m_per_s2, Shown::Plain(" m/s²"));
    if !checklist.all_passed() {
        return None;
    }

    thin_out(&mut tracks, views.len(), options.max_landmarks);
    let structure = structure_of(&tracks, &pairs, &guesses, input, options, checklist)?;
    let kept: Vec<usize> = structure.views.iter().map(|&view| selected[view]).collect();
    let problem = AttemptedProblem { input, options, kept: &kept, structure: &structure, gyroscope_prior };
    let (alignment, increments) = problem.align(checklist)?;
    let refined = problem.refine(&alignment, &increments, checklist)?;
    Some(problem.solution(&refined, parallax_rad))
}

/// Standard deviation of the mean specific force between neighbouring views, in m/s², in a frame that does not rotate.
fn excitation(frames: &[InitializationFrame<'_>], selected: &[usize], camera_rotations: &[UnitQuaternion<f64>]) -> f64 {
    let forces: Vec<Vector3<f64>> = selected
        .windows(2)
        .filter_map(|pair| {
            let &[from, to] = pair else { return None };
            let (mut sum, mut count) = (Vector3::zeros(), 0.0);
            for index in from + 1..=to {
                let rotation = camera_rotations[index] * frames[index].imu_from_camera.rotation.inverse();
                for sample in frames[index].imu {
                    sum += rotation * sample.specific_force_m_per_s2;
                    count += 1.0;
                }
            }
            (count > 0.0).then(|| sum / count)
        })
        .collect();
    let count = forces.len().max(1) as f64;
    let mean = forces.iter().sum::<Vector3<f64>>() / count;
    (forces.iter().map(|force| (force - mean).norm_squared()).sum::<f64>() / count).sqrt()
}

fn structure_of(
    tracks: &crate::estimator::initialization::structure::Tracks,
    pairs: &[ViewPair],
    guesses: &[UnitQuaternion<f64>],
    input: &InitializationInput<'_>,
    options: &InitializationOptions,
    checklist: &mut Checklist,
) -> Option<Structure> {
    let limits = StructureLimits {
        bearing_sigma_rad: options.bearing_sigma_rad,
        rotation_sigma_rad: (options.extrinsics_rotation_noise_rad * 1.5)
            .hypot(0.5 * options.extrinsics_rotation_sigma_rad)
            .hypot(0.02),
        min_landmarks: options.min_landmarks,
        min_views: options.min_views,
        min_inlier_ratio: options.min_inlier_ratio,
        seed: input.frames.last()?.frame_index as u64,
    };
    let plain = Shown::Plain("");
    match reconstruct(tracks, pairs, guesses, &limits) {
        Ok(structure) => {
            let subject = "landmarks with a depth";
            checklist.at_least(
                "landmarks",
                subject,
                structure.landmarks.len() as f64,
                limits.min_landmarks as f64,
                plain,
            );
            let newest = structure.views.last().is_some_and(|&last| last + 1 == guesses.len());
            checklist.at_least("newest view", "newest views with a pose", f64::from(u8::from(newest)), 1.0, plain);
            checklist.all_passed().then_some(structure)
        }
        Err(StructureFailure::NoRelativePose { inlier_ratio }) => {
            let subject = "ratio of features consistent with a relative pose";
            checklist.at_least("relative pose", subject, inlier_ratio, limits.min_inlier_ratio, Shown::Percent);
            None
        }
        Err(StructureFailure::FewLandmarks { landmarks }) => {
            let subject = "landmarks with a depth";
            checklist.at_least("landmarks", subject, landmarks as f64, limits.min_landmarks as f64, plain);
            None
        }
        Err(StructureFailure::FewViews { views }) => {
            let subject = "views with a pose";
            checklist.at_least("placed views", subject, views as f64, limits.min_views as f64, plain);
            None
        }
    }
}

/// Bound that the mean square of `count` standard normal variables exceeds with probability 0.001 (quantile of χ² over
/// its degrees of freedom, by the Wilson–Hilferty cube root).
fn upper_mean_square(count: usize) -> f64 {
    const NORMAL_QUANTILE: f64 = 3.09;
    let ratio = 2.0 / (9.0 * count.max(1) as f64);
    (1.0 - ratio + NORMAL_QUANTILE * ratio.sqrt()).powi(3)
}

/// Reconstructed views with the data of the metric part.
struct AttemptedProblem<'a> {
    input: &'a InitializationInput<'a>,
    options: &'a InitializationOptions,
    /// Frame indices of the views.
    kept: &'a [usize],
    structure: &'a Structure,
    gyroscope_prior: VectorPrior,
}

impl AttemptedProblem<'_> {
    fn extrinsics(&self) -> Vec<RigidTransform> {
        self.kept.iter().map(|&index| self.input.frames[index].imu_from_camera).collect()
    }

    /// Preintegrated motion between neighbouring views, linearized at `bias`.
    fn increments(&self, bias: ImuBias) -> Vec<Preintegration> {
        self.kept
            .windows(2)
            .map(|pair| {
                let mut increment = Preintegration::new(self.input.imu_noise, bias);
                if let &[from, to] = pair {
                    for frame in &self.input.frames[from + 1..=to] {
                        increment.extend(frame.imu);
                    }
                }
                increment
            })
            .collect()
    }

    fn accelerometer_prior(&self) -> VectorPrior {
        match &self.input.bias {
            Some(bias) => {
                VectorPrior { mean: bias.mean.accelerometer_m_per_s2, sigma: bias.accelerometer_sigma_m_per_s2.max() }
            }
            None => VectorPrior { mean: Vector3::zeros(), sigma: self.options.accelerometer_bias_sigma_m_per_s2 },
        }
    }

    fn alignment_input<'b>(
        &'b self,
        extrinsics: &'b [RigidTransform],
        increments: &'b [Preintegration],
    ) -> AlignmentInput<'b> {
        AlignmentInput {
            cameras: &self.structure.poses,
            imu_from_camera: extrinsics,
            increments,
            median_distance: median_distance(
                self.structure.landmarks.iter().map(|tracked| tracked.landmark.inverse_distance),
            ),
            bearing_sigma_rad: self.options.bearing_sigma_rad,
            gravity_m_per_s2: self.input.gravity_m_per_s2,
            extrinsics_rotation_sigma_rad: self.options.extrinsics_rotation_sigma_rad,
            extrinsics_rotation_noise_rad: self.options.extrinsics_rotation_noise_rad,
            gyroscope_bias: self.gyroscope_prior,
            accelerometer_bias: self.accelerometer_prior(),
        }
    }

    fn align(&self, checklist: &mut Checklist) -> Option<(Alignment, Vec<Preintegration>)> {
        let extrinsics = self.extrinsics();
        let mut bias =
            ImuBias { gyroscope_rad_per_s: self.gyroscope_prior.mean, accelerometer_m_per_s2: Vector3::zeros() };
        let mut increments = self.increments(bias);
        let rotation = align_rotations(&self.alignment_input(&extrinsics, &increments));
        let subject = "rotation alignments of gyroscope and images found";
        checklist.at_least("rotations", subject, f64::from(u8::from(rotation.is_some())), 1.0, Shown::Plain(""));
        let rotation = rotation?;
        if (rotation.gyroscope_bias - bias.gyroscope_rad_per_s).norm() > REINTEGRATE_RAD_PER_S {
            bias.gyroscope_rad_per_s = rotation.gyroscope_bias;
            increments = self.increments(bias);
        }
        let alignment = align(&self.alignment_input(&extrinsics, &increments), &rotation);
        let scale = alignment.as_ref().map_or(0.0, |alignment| alignment.scale);
        let subject = "scale of the reconstruction by the linear alignment";
        let positive = checklist.at_least("linear scale", subject, scale, 1e-3, Shown::Plain(" m"));
        alignment.filter(|_| positive).map(|alignment| (alignment, increments))
    }

    fn refine(
        &self,
        alignment: &Alignment,
        increments: &[Preintegration],
        checklist: &mut Checklist,
    ) -> Option<RefinedInitialization> {
        let options = self.options;
        let extrinsics = self.extrinsics();
        let input = RefinementInput {
            imu_from_camera: &extrinsics,
            increments,
            bearing_sigma_rad: options.bearing_sigma_rad,
            extrinsics_rotation_sigma_rad: options.extrinsics_rotation_sigma_rad,
            extrinsics_rotation_noise_rad: options.extrinsics_rotation_noise_rad,
            extrinsics_translation_sigma_m: options.extrinsics_translation_sigma_m,
            gyroscope_bias: self.gyroscope_prior,
            accelerometer_bias: self.accelerometer_prior(),
        };
        let refinement = Refinement::new(&input)?;
        let start = RefinedState::new(&input, alignment, &self.structure.landmarks);
        let mut refined = refinement.run(start, REFINEMENT_ROUNDS[0]);
        let before = refined.state.landmarks.len();
        let cameras = between(&refined.state.cameras(&extrinsics));
        refined.state.landmarks.retain(|landmark| landmark.fits(&cameras, options.bearing_sigma_rad, OUTLIER_SIGMAS));
        let rounds = refined.rounds;
        let mut refined = refinement.run(refined.state, REFINEMENT_ROUNDS[1]);
        refined.rounds += rounds;

        let subject = "refinements converged";
        checklist.at_least("converged", subject, f64::from(u8::from(refined.converged)), 1.0, Shown::Plain(""));
        let ratio = refined.state.landmarks.len() as f64 / before.max(1) as f64;
        let subject = "ratio of landmarks with positive depth and small residuals";
        checklist.at_least("positive depth", subject, ratio, options.min_inlier_ratio, Shown::Percent);
        let cameras = refined.state.cameras(&extrinsics);
        let rms = mean_square(&refined.state.landmarks, &cameras, options.bearing_sigma_rad).sqrt();
        let subject = "reprojection RMS in σ";
        checklist.at_most("reprojection", subject, rms, options.max_reprojection_sigmas, Shown::Plain(""));
        let subject = "mean square of the whitened IMU residuals";
        let value = refined.imu_mean_square;
        let chance = upper_mean_square(9 * increments.len());
        let limit = options.imu_noise_factor.powi(2) * chance;
        checklist.at_most("IMU residual", subject, value, limit, Shown::Plain(""));

        refined.sigmas = refinement.sigmas(&refined.state);
        let sigmas = refined.sigmas;
        let or_far = |value: Option<f64>| value.unwrap_or(f64::INFINITY);
        let scale = or_far(sigmas.map(|sigmas| sigmas.scale));
        let subject = "σ of the scale";
        checklist.at_most("scale", subject, scale, options.max_scale_sigma, Shown::Percent);
        let velocity = or_far(sigmas.map(|sigmas| sigmas.velocity_m_per_s));
        let subject = "σ of the velocity";
        checklist.at_most("velocity", subject, velocity, options.max_velocity_sigma_m_per_s, Shown::Plain(" m/s"));
        let gravity = or_far(sigmas.map(|sigmas| sigmas.gravity_rad));
        let subject = "σ of the gravity direction";
        checklist.at_most("gravity", subject, gravity, options.max_gravity_sigma_rad, Shown::Degrees);
        checklist.all_passed().then_some(refined)
    }

    /// The refined state, rotated such that gravity is vertical.
    fn solution(&self, refined: &RefinedInitialization, parallax_rad: f64) -> InitializationSolution {
        let state = &refined.state;
        let given = self.extrinsics();
        let extrinsics = state.imu_from_camera(&given);
        let upright = RigidTransform::new(level(&state.gravity), Vector3::zeros());
        let world_from_camera: Vec<RigidTransform> =
            state.cameras(&given).iter().map(|camera| upright * *camera).collect();
        let frames = self
            .kept
            .iter()
            .enumerate()
            .map(|(view, &index)| InitializedFrame {
                frame_index: self.input.frames[index].frame_index,
                stamp_ns: self.input.frames[index].stamp_ns,
                world_from_imu: upright * state.poses[view],
                velocity_m_per_s: upright.rotation * state.velocities[view],
                imu_from_camera: extrinsics[view],
            })
            .collect();
        let mut landmarks: Vec<InitializedLandmark> = state
            .landmarks
            .iter()
            .filter_map(|landmark| {
                let depth_m = landmark.landmark.bearing.z / landmark.landmark.inverse_distance;
                (depth_m > 0.0).then_some(())?;
                Some(InitializedLandmark {
                    id: landmark.id,
                    anchor_frame_index: self.input.frames[self.kept[landmark.anchor]].frame_index,
                    position_m: landmark.position(&world_from_camera)?,
                    inverse_depth_per_m: 1.0 / depth_m,
                    views: landmark.observations.len(),
                })
            })
            .collect();
        landmarks.sort_by_key(|landmark| landmark.id);
        let sigmas = refined.sigmas.unwrap_or_default();
        let square = mean_square(&state.landmarks, &state.cameras(&given), self.options.bearing_sigma_rad);
        InitializationSolution {
            origin: InitializationOrigin::Motion,
            frames,
            bias: state.bias,
            landmarks,
            diagnostics: InitializationDiagnostics {
                scale_sigma: sigmas.scale,
                velocity_sigma_m_per_s: sigmas.velocity_m_per_s,
                gravity_sigma_rad: sigmas.gravity_rad,
                gyroscope_bias_sigma_rad_per_s: sigmas.gyroscope_bias_rad_per_s,
                accelerometer_bias_sigma_m_per_s2: sigmas.accelerometer_bias_m_per_s2,
                reprojection_rms_rad: square.sqrt() * self.options.bearing_sigma_rad,
                imu_mean_square: refined.imu_mean_square,
                parallax_rad,
                refinement_rounds: refined.rounds,
            },
            passed: Vec::new(),
        }
    }
}
