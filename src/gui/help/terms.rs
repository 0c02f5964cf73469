//! Shown quantities with their definition, unit and source.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Term {
    /// Name in the window.
    pub(crate) name: &'static str,
    /// Definition, unit and source.
    pub(crate) meaning: &'static str,
}

/// Declares the terms as constants, and a list of all.
macro_rules! terms {
    ($($constant:ident: $name:literal => $meaning:literal;)*) => {
        $(
            #[doc = concat!("The quantity `", $name, "`.")]
            pub(crate) const $constant: Term = Term { name: $name, meaning: $meaning };
        )*
        #[cfg(test)]
        pub(super) const ALL: &[Term] = &[$($constant),*];
    };
}

/// The inspector: the frame at the cursor.
pub(crate) mod frame {
    use super::Term;

    terms! {
        STAMP: "stamp, s" => "Header stamp of the image in s since the log began. The second value is the log time (time of recording) minus this stamp.";
        PHASE: "phase" => "Initializing, or tracking with a window of frames. A keyframe stays in the window, another frame is dropped with the next image.";
        RESTARTS: "restarts" => "Number of re-initializations after a failure, up to this step.";
        TRACKS: "feature tracks" => "Features that the front end tracked from the previous image, and features detected anew in this one.";
        AXES: "" => "Components along the axes of the row's frame.";
        POSITION: "position, m" => "Position of the IMU in the world of the run, m, after the solve. Axis z is up; origin and yaw come from the initialization.";
        VELOCITY: "velocity, m/s" => "Velocity of the IMU in the world of the run, m/s, after the solve.";
        ATTITUDE: "roll, pitch, yaw, °" => "Attitude of the IMU in the world of the run after the solve, as Euler angles in degrees: world_from_imu = Rz(yaw) Ry(pitch) Rx(roll).";
        ACCELEROMETER_BIAS: "accelerometer bias, m/s²" => "Estimated bias of the accelerometer in IMU axes, m/s². It is subtracted from the measured specific force.";
        GYROSCOPE_BIAS: "gyroscope bias, °/s" => "Estimated bias of the gyroscope in IMU axes, °/s. It is subtracted from the measured angular rate.";
        POSITION_ERROR: "position error, m" => "Estimate minus ground truth along the axes of the ground truth's world, m, after alignment in yaw and position.";
        ATTITUDE_ERROR: "attitude error, °" => "Rotation vector from the ground-truth attitude to the estimate in IMU axes, degrees, after alignment in yaw.";
    }
}

/// The inspector: joint angles of the newest frame.
pub(crate) mod joints {
    use super::Term;

    terms! {
        JOINT: "joint" => "Joint of the gimbal by its name in the rig, from the base to the camera.";
        ESTIMATE: "estimate, °" => "Joint angle of the newest frame after the solve, degrees, without the static offset θ₀.";
        ENCODER: "encoder, °" => "Encoder angle at the stamp of the frame, degrees, from the readings around it.";
        DIFFERENCE: "difference, °" => "Estimate minus encoder reading, degrees. Expected: about the encoder σ of the rig.";
    }
}

/// The inspector: the selected feature.
pub(crate) mod feature {
    use super::Term;

    terms! {
        POSITION: "position, px" => "Pixel (u, v) at which the front end tracked the feature in this image.";
        AGE: "track age, images" => "Number of earlier images with an observation of this feature.";
        FLOW: "flow, px" => "Distance between the feature's pixels in the previous image and in this one.";
        ANCHOR: "anchor frame" => "Number of the image whose first observation anchors the landmark's inverse depth.";
        DEPTH: "depth, m" => "Depth along the optical axis of the anchor camera, m: the reciprocal of the estimated inverse depth.";
        STATE: "state" => "Used in the solve, not used, or rejected as an outlier after the solve.";
        LANDMARK: "landmark position, m" => "Position of the landmark in the world of the run, m, from anchor pose, extrinsics and inverse depth.";
    }
}

/// The inspector: observations of the selected feature.
pub(crate) mod observations {
    use super::Term;

    terms! {
        FRAME: "frame" => "Number of the observing image in its stream.";
        U: "u, px" => "Measured column of the pixel.";
        V: "v, px" => "Measured row of the pixel.";
        BEFORE: "before, px" => "Norm of the reprojection residual (prediction − measurement) before the solve, px. None in the anchor frame.";
        AFTER: "after, px" => "Norm of the reprojection residual (prediction − measurement) after the solve, px.";
        CHI2: "χ²" => "Squared residual after the solve over the variance of a pixel. Expected value 2: two components.";
        WEIGHT: "weight" => "Weight of the robust loss after the solve: 1 = full, towards 0 = outlier.";
    }
}

/// The inspector: the block of a feature and a parameter.
pub(crate) mod block {
    use super::Term;

    terms! {
        FRAME: "frame" => "Number of the observing image in its stream.";
        RESIDUAL_U: "Δu, px" => "Column of the prediction minus column of the measurement after the solve, px.";
        RESIDUAL_V: "Δv, px" => "Row of the prediction minus row of the measurement after the solve, px.";
        CHI2: "χ²" => "Squared residual after the solve over the variance of a pixel. Expected value 2: two components.";
        SLOPE_U: "∂u" => "Derivative of the predicted column with respect to the parameter, px per shown unit, from the Jacobian of this step.";
        SLOPE_V: "∂v" => "Derivative of the predicted row with respect to the parameter, px per shown unit, from the Jacobian of this step.";
    }
}

/// The Jacobian panel: values of the selected block.
pub(crate) mod jacobian {
    use super::Term;

    terms! {
        FRAME: "frame" => "Number of the observing image in its stream.";
        U: "u, px" => "Measured column of the pixel.";
        V: "v, px" => "Measured row of the pixel.";
        RESIDUAL_U: "residual u, px" => "Column of the prediction minus column of the measurement after the solve, px.";
        RESIDUAL_V: "residual v, px" => "Row of the prediction minus row of the measurement after the solve, px.";
        WEIGHT: "robust weight" => "Weight of the robust loss after the solve: 1 = full, towards 0 = outlier.";
        SLOPE: "∂u, ∂v" => "Derivative of the predicted pixel with respect to the unknown, px per shown unit, before whitening.";
        JOINT: "joint" => "Number of the joint, from the base.";
        READING: "reading, °" => "Encoder angle at the stamp of the frame, degrees.";
        ESTIMATE: "estimate, °" => "Joint angle after the solve, degrees.";
        SIGMA: "σ, °" => "Standard deviation of the encoder angle, degrees: the encoder σ of the rig over the averaged readings.";
        RESIDUAL: "residual, σ" => "Whitened residual after the solve: in σ of the measurement.";
        ENCODER_SLOPE: "∂, σ/°" => "Derivative of the whitened residual with respect to the joint angle.";
        ROW: "row" => "Number of the scalar residual within the factor.";
        ROW_SLOPE: "∂" => "Derivative of the whitened residual with respect to the unknown, σ per shown unit.";
    }
}

/// The inspector: the selected calibration parameter.
pub(crate) mod parameter {
    use super::Term;

    terms! {
        VALUE: "value" => "Estimate after the solve of this step, in degrees, mm or ms. Column of calibration.csv.";
        SIGMA: "σ" => "Posterior standard deviation after this step: the window, the marginalization prior and the prior of the rig together.";
        PRIOR_SIGMA: "prior σ" => "Standard deviation of the rig's prior: how wrong the given value may be.";
        RATIO: "σ / prior σ" => "Posterior over prior standard deviation: 1 = the log adds nothing, 0.1 = ten times better than given.";
        INITIAL: "initial value" => "Value in the first step: that of the rig, in the parameterization of the run.";
        CHANGE: "change since the start" => "Estimate minus initial value; angles in (−180°, 180°].";
        GROUND_TRUTH: "ground truth" => "True value from NAME.truth.yaml, converted to the parameterization of the run.";
        ERROR: "error" => "Estimate minus ground truth, and its absolute value in posterior σ. Above 3 σ the estimate is inconsistent.";
        VERDICT_HERE: "at the cursor" => "Verdict from σ of this step and the required accuracy: determined by the measurements alone, given with the prior, weakly determined up to 3 times it, else not determined. Redundant: by the parameterization; unknown: the run is not trusted.";
        VERDICT: "whole flight" => "The same verdict at the end of the flight, and the time from which it holds without interruption.";
    }
}

/// The inspector: iterations of the solver.
pub(crate) mod iterations {
    use super::Term;

    terms! {
        NUMBER: "" => "Number of the iteration; keys , and . show the window after it.";
        COST_BEFORE: "cost before" => "Half the sum of all squared whitened residuals before the iteration, reprojections by their robust loss. No unit.";
        COST_AFTER: "cost after" => "The same cost after the iteration.";
        STEP_NORM: "step norm" => "Norm of the update of poses, velocities, biases, joint angles and calibration (landmarks excluded), in SI units.";
        DAMPING: "damping λ" => "Levenberg–Marquardt damping: it is raised after a rejected iteration.";
        ACCEPTED: "result" => "An iteration that does not lower the cost is rejected.";
    }
}

/// The inspector: times of the stages.
pub(crate) mod times {
    use super::Term;

    terms! {
        FRONTEND: "front end" => "Tracking and detecting features, ms. Images are decoded ahead on another thread.";
        OPTIMIZE: "optimize" => "Preintegration, prediction and solve, ms; during initialization, its attempts.";
        LINEARIZE: "linearize" => "Linearization of the window at its final estimate for the rank analysis, ms.";
        REPORT: "report" => "Collecting what the panels show, ms.";
        MARGINALIZE: "marginalize" => "Outlier rejection, switch of the parameterization and marginalization, ms.";
        OBSERVABILITY: "observability" => "Rank analysis: projection and singular values, ms.";
        TOTAL: "total" => "Processing time of the whole step, ms. A camera of 20 Hz leaves 50 ms.";
    }
}

/// The comparison: divergences of a run from the reference.
pub(crate) mod divergence {
    use super::Term;

    terms! {
        QUANTITY: "" => "Compared quantity; hover it for its definition.";
        EXACT: "first difference" => "Time of the first common frame in which the quantity differs by a single bit. Click: move the cursor there.";
        THRESHOLD: "threshold" => "Difference from which a divergence counts as notable.";
        EXCEEDED: "exceeded at" => "Time of the first common frame with a difference of at least the threshold. Click: move the cursor there.";
        AT_CURSOR: "at cursor" => "Difference between the steps of both runs at the cursor.";
        MAXIMUM: "maximum" => "Largest difference over all common frames.";
        AT: "at" => "Time of the largest difference. Click: move the cursor there.";
    }
}

/// The residuals: χ² by kind of factor.
pub(crate) mod factors {
    use super::Term;

    terms! {
        FACTOR: "factor" => "Kind of measurement or prior in the window.";
        COUNT: "residuals" => "Number of scalar residuals: two for each observation of a feature, fifteen for each IMU interval.";
        CHI2_BEFORE: "χ² before" => "Sum of the squared whitened residuals before the solve, reprojections by their robust loss. No unit.";
        CHI2_AFTER: "χ² after" => "The same sum after the solve.";
        RATIO: "χ²/residual" => "χ² after the solve over the number of residuals: about 1 where the noise of the rig is right.";
        VISUAL: "visual" => "Reprojections of features: prediction − measurement over the standard deviation of a pixel.";
        IMU: "IMU" => "Preintegrated IMU samples between two frames, whitened by the noise densities of the rig.";
        ENCODER: "encoder" => "Joint angles minus encoder readings over the encoder σ of the rig.";
        CALIBRATION_PRIOR: "calibration prior" => "Calibration minus the value of the rig over the prior σ of the rig.";
        MARGINALIZATION_PRIOR: "marginalization prior" => "Information of the frames that left the window about the frames in it.";
        GIMBAL_IMU: "gimbal IMU" => "Preintegrated samples of the IMU on the gimbal between two frames; its biases are separate unknowns.";
        ZERO_VELOCITY: "zero velocity" => "Zero-velocity update (ZUPT) of a stationary vehicle.";
    }
}

/// The status bar, the caption of the image, the scene's table, and terms that other panels show once.
pub(crate) mod window {
    use super::Term;

    terms! {
        CURSOR: "cursor" => "Position of the cursor in s since the log began. Panels show the last step at or before it.";
        DURATION: "duration" => "Time from the first to the last message of the log, s.";
        FRAME: "frame" => "Number of the image at the cursor in its camera's stream, from 0.";
        COST: "cost" => "Half the sum of all squared whitened residuals before and after the shown solver iteration. No unit.";
        CONVERGENCE: "convergence" => "Estimate ± posterior σ at the cursor, from the window and all priors. Band: ±3σ; Δ: estimate minus ground truth; shaded ends of an axis are compressed.";
        CAPTION: "caption" => "Frame number, stamp, features tracked, new, lost, rejected (front end and solve) and sliding, and the RMS and median of the reprojection residuals in px over all observations of the window.";
        CHAIN_ROW: "chain table" => "Denavit–Hartenberg parameters of the estimated chain at the cursor: joint angle q, offset θ₀ and twist α in degrees, d and a in mm.";
        CHAIN_FRAMES: "chain frames" => "Frames of the chain: I IMU, B base, J2, J3 … after each joint, E end effector, C camera. Axes x red, y green, z blue; dashed: ground truth.";
        CHAIN_ERROR: "extrinsics error" => "Distance and angle between imu_from_camera of the estimate and of the ground truth at the joint angles of the cursor.";
        SCENE_LEGEND: "scene legend" => "Distance between the estimated position at the cursor and the ground truth, m, after alignment in yaw and position. Landmarks are coloured by their height.";
        INITIALIZATION: "initialization" => "Unmet condition of the last initialization attempt; measured value and threshold are in the inspector.";
        MECHANISM: "mechanism" => "Chain of joints from the rig, or a standard one.";
        MOTION: "motion" => "Motion of vehicle and joints in the synthetic window.";
        JOINT_ANGLES: "joint angles" => "Joint angles: known, measured by encoders of this σ in degrees, or unknown.";
        POSES: "poses" => "Poses: known, or estimated from IMU samples with the noise of the rig.";
        RANKS: "ranks" => "Structural rank: directions that the measurements of the window constrain in principle. Informed rank: those with at least the information of a prior of 10° or 3 cm.";
        LEAST_OBSERVABLE: "least observable" => "Direction with the smallest singular value, by the parameters with the largest weights.";
        RANK_DEFICIT: "rank deficit" => "Unobservable directions by cause: parameterization, stationary joints, free joint angles, motion of the vehicle.";
        SINGULARITY_MARGIN: "singularity margin" => "Distance of the chain from a singularity of its parameterization: 1 far, 0 singular. The second value is that of the other minimal parameterization.";
        SPURIOUS: "spurious information" => "Information of the priors on directions that no measurement constrains, as a singular value (1: σ of 10° or 3 cm).";
        RANKS_OVER_TIME: "ranks over time" => "Informed rank of each run by step, and faint the structural rank (rank.csv).";
        ASSUMPTIONS: "assumptions" => "Synthetic window of the experiment: motion, knowledge of joint angles and poses, number of frames and landmarks. No log is used.";
        PLAN_SIGMA: "planned σ" => "Predicted σ of the calibration after a motion in a synthetic scene, divided by the prior σ. Each window of 4 s is linearized as a step of the run would be; what this log has measured is added.";
        PLAN_LIMITS: "limits of a plan" => "Limits of the planned motion, as the options of dcvins plan. The search keeps them; a dragged curve that exceeds one is red.";
        PLAN_SCENE: "scene of a plan" => "Distances of the landmarks from the camera: an assumed range, or the landmarks of the selected run at its end.";
        PLAN_WIDTH: "width of a drag" => "Half width in s of the part of the curve that a dragged point takes along.";
        PLAN_START: "start of a plan" => "Motion to begin with: everything at rest, slow waves in all joints and axes, or the best moves by hand one after the other (seconds).";
        PLAN_OPTIMIZE: "optimization of a plan" => "Searches a motion with a smaller largest σ / prior from this one, within the limits; after this log, if there is one. The best motion so far is shown; undo is one step.";
        PLAN_FILE: "file of a motion" => "CSV as dcvins plan writes it: dcvins simulate --motion FILE flies it. An existing file is not replaced.";
        IMAGE_PLANE: "residuals over the image" => "Mean reprojection residual after the solve by place in the image. A wrong focal length or distortion is a radial pattern, a wrong readout time a slope over the rows, an object without a mask a group of cells.";
        JACOBIAN_NORM: "block norm" => "Frobenius norm of a block of the whitened Jacobian: change of the residuals in σ per 10°, 3 cm, 0.1 m/s, 1 °/s, 0.1 m/s² or 10 % of the inverse depth.";
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn explanations_are_short_sentences() {
        let lists = [
            frame::ALL,
            joints::ALL,
            feature::ALL,
            observations::ALL,
            block::ALL,
            jacobian::ALL,
            parameter::ALL,
            iterations::ALL,
            times::ALL,
            divergence::ALL,
            factors::ALL,
            window::ALL,
        ];
        for list in lists {
            for (place, term) in list.iter().enumerate() {
                let sentences = term.meaning.matches(". ").count() + 1;
                assert!(sentences <= 2 && term.meaning.len() <= 260, "{}: too long", term.name);
                assert!(term.meaning.ends_with(['.', ']', '|']), "{}: {}", term.name, term.meaning);
                assert!(list[..place].iter().all(|other| other.name != term.name), "'{}' twice", term.name);
            }
        }
    }
}
