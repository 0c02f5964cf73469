//! Problems of a log that did not stop reading, with the kind by which they are counted.

/// Kind of a problem. Warnings with one kind and one subject are shown as one line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum WarningKind {
    /// The file is truncated or damaged.
    Damage,
    /// A chunk cannot be read.
    DamagedChunk,
    /// Header stamps of another clock, or without stamp.
    Stamps,
    /// Topics beyond the limit.
    Topics,
    /// No topic has messages that are read.
    NothingRead,
    /// Reading stopped before the end of the log.
    ReadingStopped,
    /// Messages are dropped for this reason.
    Dropped(&'static str),
    /// Intervals without IMU samples.
    ImuGap,
    /// Time intervals without images.
    ImageGap,
    /// Copies of the image before.
    ImageCopy,
    /// Images of another size than the rig's.
    ImageSize,
    /// Images that cannot be decoded or tracked.
    ImageUnreadable,
    /// Images of a camera on a gimbal without joint angles.
    NoJointAngles,
    /// Images before the first IMU sample.
    ImageBeforeImu,
    /// Images after the last IMU sample.
    ImageAfterImu,
    /// A camera without any IMU sample.
    NoImu,
    /// The ground truth of the rig is not in the log.
    NoGroundTruth,
    /// Several readings of a joint with one stamp.
    RepeatedReading,
    /// Attitudes that the joints cannot reach.
    UnreachableAttitude,
    /// Attitudes of the gimbal without one of the vehicle.
    NoVehicleAttitude,
    /// Interruptions of the connection to a vehicle in flight, and messages that could not be recorded.
    Reception,
    /// Images that are left out because the run is too far behind a vehicle in flight.
    LeftOut,
}

impl WarningKind {
    /// Noun in the plural for what [`LogWarning::count`] counts.
    pub fn counted(self) -> &'static str {
        match self {
            Self::Dropped(_) => "messages",
            Self::ImuGap | Self::ImageGap => "gaps",
            Self::ImageCopy
            | Self::ImageSize
            | Self::ImageUnreadable
            | Self::NoJointAngles
            | Self::ImageBeforeImu
            | Self::ImageAfterImu
            | Self::LeftOut => "images",
            Self::DamagedChunk => "chunks",
            Self::UnreachableAttitude | Self::NoVehicleAttitude => "intervals",
            _ => "warnings",
        }
    }
}

/// Size of a problem; warnings of one kind have one unit.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub enum Magnitude {
    /// Number of messages or images.
    Count(usize),
    Seconds(f64),
    Radians(f64),
}

/// Problem of the log that did not stop reading.
#[derive(Clone, Debug, PartialEq)]
pub struct LogWarning {
    pub kind: WarningKind,
    /// Topic that the problem concerns; empty for the file.
    pub subject: String,
    /// Time of the problem, in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    /// Time of its end, as for `stamp_ns`.
    pub last_ns: i64,
    /// Number of messages, images, gaps, … as named by [`WarningKind::counted`].
    pub count: usize,
    /// Size by which the worst of several is found; `None` if all are equally bad.
    pub magnitude: Option<Magnitude>,
    /// Problem, its location, and its treatment.
    pub message: String,
}

impl LogWarning {
    /// Warning about one event without a size.
    pub fn new(kind: WarningKind, subject: &str, stamp_ns: i64, message: String) -> Self {
        Self { kind, subject: subject.to_owned(), stamp_ns, last_ns: stamp_ns, count: 1, magnitude: None, message }
    }

    pub fn with_magnitude(self, magnitude: Magnitude) -> Self {
        Self { magnitude: Some(magnitude), ..self }
    }

    /// Sets the time of the end.
    pub fn until(self, last_ns: i64) -> Self {
        Self { last_ns, ..self }
    }

    /// Sets the number of messages or images up to an end; it is the size, too.
    pub fn with_count(self, count: usize, last_ns: i64) -> Self {
        Self { count, last_ns, magnitude: Some(Magnitude::Count(count)), ..self }
    }
}
