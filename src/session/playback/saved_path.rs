//! Paths in a saved session: as text, or as bytes if a Unix path is not valid UTF-8.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Representation of a path in JSON.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Text(String),
    Bytes { unix_bytes: Vec<u8> },
}

impl From<&Path> for Written {
    fn from(path: &Path) -> Self {
        #[cfg(unix)]
        if path.to_str().is_none() {
            use std::os::unix::ffi::OsStrExt as _;
            return Self::Bytes { unix_bytes: path.as_os_str().as_bytes().to_vec() };
        }
        Self::Text(path.to_string_lossy().into_owned())
    }
}

impl From<Written> for PathBuf {
    fn from(written: Written) -> Self {
        match written {
            Written::Text(text) => Self::from(text),
            #[cfg(unix)]
            Written::Bytes { unix_bytes } => {
                use std::os::unix::ffi::OsStringExt as _;
                Self::from(std::ffi::OsString::from_vec(unix_bytes))
            }
            #[cfg(not(unix))]
            Written::Bytes { unix_bytes } => Self::from(String::from_utf8_lossy(&unix_bytes).into_owned()),
        }
    }
}

pub(super) fn serialize<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    Written::from(path).serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<PathBuf, D::Error> {
    Written::deserialize(deserializer).map(PathBuf::from)
}

/// The same representation for an optional path.
pub(super) mod optional {
    use super::{Deserialize as _, Deserializer, PathBuf, Serialize as _, Serializer, Written};

    #[expect(clippy::ref_option, reason = "the signature that serde calls")]
    pub(in super::super) fn serialize<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
        path.as_deref().map(Written::from).serialize(serializer)
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<PathBuf>, D::Error> {
        Ok(Option::<Written>::deserialize(deserializer)?.map(PathBuf::from))
    }
}

/// The same representation for a list of paths.
pub(super) mod several {
    use super::{Deserialize as _, Deserializer, PathBuf, Serialize as _, Serializer, Written};

    pub(in super::super) fn serialize<S: Serializer>(paths: &[PathBuf], serializer: S) -> Result<S::Ok, S::Error> {
        paths.iter().map(|path| Written::from(path.as_path())).collect::<Vec<_>>().serialize(serializer)
    }

    pub(in super::super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<PathBuf>, D::Error> {
        Ok(Vec::<Written>::deserialize(deserializer)?.into_iter().map(PathBuf::from).collect())
    }
}
