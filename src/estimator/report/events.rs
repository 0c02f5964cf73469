//! What happened in a step: events with the value and the threshold that decided.

/// What kind of event a step reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventKind {
    /// An attempt to initialize that has to wait; the message says for what.
    InitializationWaits,
    /// The window was initialized from motion.
    InitializedFromMotion,
    /// The window was initialized from standstill.
    InitializedFromStationary,
    /// The frame became a keyframe (or did not); the value is the deciding figure.
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
    /// The estimator failed and starts again.
    Failure,
    /// The parameterization was switched near a singularity.
    ParameterizationSwitched,
    /// Measurements were missing or unusable.
    MeasurementMissing,
}

impl EventKind {
    /// Whether the step made the first window.
    pub fn initializes_window(self) -> bool {
        matches!(self, Self::InitializedFromMotion | Self::InitializedFromStationary)
    }

    /// Whether it is rare enough to jump to, and for the lane of events; nearly every frame has one of the others, which
    /// have lanes of their own or none.
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

/// Something that happened in a step, with the figure that decided it.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// What kind.
    pub kind: EventKind,
    /// Why, in one sentence, with units.
    pub message: String,
    /// The measured value, when one decided.
    pub value: Option<f64>,
    /// The threshold that it was compared with.
    pub threshold: Option<f64>,
}

impl Event {
    /// An event that no value decided.
    pub(crate) fn new(kind: EventKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), value: None, threshold: None }
    }

    /// An event with the value that decided it and the threshold of that.
    pub(crate) fn decided(kind: EventKind, message: impl Into<String>, value: f64, threshold: f64) -> Self {
        Self { kind, message: message.into(), value: Some(value), threshold: Some(threshold) }
    }
}
