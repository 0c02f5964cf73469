//! Files that are no logs: rigs, stills, robot descriptions and tables, read within limits and written atomically.

mod error;
pub(crate) mod image_file;
pub(crate) mod limits;
pub(crate) mod located;
pub mod output;
pub(crate) mod rig;
pub(crate) mod scratch;
pub mod stills;
pub mod urdf;
pub mod yaml;

pub use self::error::FileError;
pub use self::limits::{LimitExceeded, LimitKind, LimitSetting, LogLimits};
pub use self::rig::RigFile;
