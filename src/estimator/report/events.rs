//! Events of a step, with the deciding value and threshold.

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// The initialization waits; the message has the reason.
    InitializationWaits,
    /// The window was initialized from motion.
    InitializedFromMotion,
    /// The window was initialized from a stationary vehicle.
    InitializedFromStationary,
    /// The frame became a keyframe or not, with the deciding value.
    KeyframeChosen,
    /// The oldest frame was marginalized.
    OldestMarginalized,
    /// The second-newest frame, no keyframe, was dropped: its visual observations are discarded, its IMU samples continue
    /// in the preintegration of the newest frame, and its encoder readings go into the prior where that holds the frame,
    /// else into the readings of the newest frame.
    SecondNewestDropped,
    /// Features were rejected as outliers after the solve.
    OutliersRejected,
    /// The vehicle is stationary.
    Stationary,
    /// The estimator failed and restarts.
    Failure,
    /// The parameterization was switched near a singularity.
    ParameterizationSwitched,
    /// Measurements were missing or unusable.
    MeasurementMissing,
}

impl EventKind {
    /// Whether the step initialized the window.
    pub fn initializes_window(self) -> bool {
        matches!(self, Self::InitializedFromMotion | Self::InitializedFromStationary)
    }

    /// Whether the event is rare enough for the event lane; nearly every frame has one of the others, which have
    /// lanes of their own or none.
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

/// The criterion by which the estimator has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FailureCause {
    /// The accelerometer bias is out of bounds.
    AccelerometerBias,
    /// The gyroscope bias is out of bounds.
    GyroscopeBias,
    /// The velocity is out of bounds.
    Velocity,
    /// The solve has moved the newest position too far.
    Correction,
    /// Too few observed landmarks for too long.
    Features,
    /// IMU samples are missing between two images.
    Imu,
}

/// An event of a step with its deciding value.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Kind of the event.
    pub kind: EventKind,
    /// Reason in one sentence, with units.
    pub message: String,
    /// Measured value, if one decided.
    pub value: Option<f64>,
    /// Threshold of the value.
    pub threshold: Option<f64>,
    /// The criterion, of a [`EventKind::Failure`].
    pub cause: Option<FailureCause>,
}

impl Event {
    /// Returns an event without a value.
    pub(crate) fn new(kind: EventKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), value: None, threshold: None, cause: None }
    }

    /// Returns an event with the deciding value and its threshold.
    pub(crate) fn decided(kind: EventKind, message: impl Into<String>, value: f64, threshold: f64) -> Self {
        Self { kind, message: message.into(), value: Some(value), threshold: Some(threshold), cause: None }
    }

    /// Returns the failure by a criterion, with the deciding value and its threshold.
    pub(crate) fn failure(cause: FailureCause, message: impl Into<String>, value: f64, threshold: f64) -> Self {
        Self { cause: Some(cause), ..Self::decided(EventKind::Failure, message, value, threshold) }
    }
}
