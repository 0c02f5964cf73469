//! Events of a step, with the deciding value and threshold.

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// The initialization waits; the message has the reason.
    InitializationWaits,
    /// The window was initialized from motion.
    InitializedFromMotion,
    /// The window was initialized from a stationary vehicle.
    InitializedFromStationary,
    /// Keyframe decision on the frame, with the deciding value.
    KeyframeChosen,
    /// The oldest frame was marginalized.
    OldestMarginalized,
    /// The second-newest frame was dropped because it is no keyframe: its visual observations are discarded, its IMU
    /// samples continue in the preintegration of the newest frame, and its encoder readings go into the prior if that
    /// contains the frame, else into the readings of the newest frame.
    SecondNewestDropped,
    /// Features were rejected as outliers after the solve.
    OutliersRejected,
    Stationary,
    /// The estimator failed and restarts.
    Failure,
    /// The parameterization was switched near a singularity.
    ParameterizationSwitched,
    /// Measurements were missing or unusable.
    MeasurementMissing,
}

impl EventKind {
    /// True if the step initialized the window.
    pub fn initializes_window(self) -> bool {
        matches!(self, Self::InitializedFromMotion | Self::InitializedFromStationary)
    }

    /// True if the event is rare enough for the event lane; nearly every frame has one of the others, which have
    /// another lane or none.
    pub fn is_notable(self) -> bool {
        match self {
            Self::InitializedFromMotion
            | Self::InitializedFromStationary
            | Self::Stationary
            | Self::Failure
            | Self::ParameterizationSwitched
            | Self::MeasurementMissing => true,
            Self::InitializationWaits
            | Self::KeyframeChosen
            | Self::OldestMarginalized
            | Self::SecondNewestDropped
            | Self::OutliersRejected => false,
        }
    }
}

/// Criterion by which the estimator failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FailureCause {
    /// Accelerometer bias out of bounds.
    AccelerometerBias,
    /// Gyroscope bias out of bounds.
    GyroscopeBias,
    Velocity,
    /// Correction of the newest position by the solve too large.
    Correction,
    /// Too few observed landmarks for too long.
    Features,
    /// IMU samples missing between two images.
    Imu,
}

/// An event of a step with its deciding value.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    pub kind: EventKind,
    /// One sentence with units.
    pub message: String,
    /// Deciding value, `None` without one.
    pub value: Option<f64>,
    /// Limit that `value` is compared with.
    pub threshold: Option<f64>,
    /// Criterion of a [`EventKind::Failure`], `None` for other events.
    pub cause: Option<FailureCause>,
}

impl Event {
    /// Event without a value.
    pub(crate) fn new(kind: EventKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), value: None, threshold: None, cause: None }
    }

    pub(crate) fn decided(kind: EventKind, message: impl Into<String>, value: f64, threshold: f64) -> Self {
        Self { kind, message: message.into(), value: Some(value), threshold: Some(threshold), cause: None }
    }

    /// Failure by a criterion, with the deciding value and its threshold.
    pub(crate) fn failure(cause: FailureCause, message: impl Into<String>, value: f64, threshold: f64) -> Self {
        Self { cause: Some(cause), ..Self::decided(EventKind::Failure, message, value, threshold) }
    }
}
