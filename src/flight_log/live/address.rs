use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

/// Port of `foxglove_bridge` and of Foxglove's servers by default.
const DEFAULT_PORT: u16 = 8765;
const SCHEME: &str = "ws://";

/// Address of a server of Foxglove's WebSocket protocol, `ws://HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerAddress {
    /// Name or address of the host, one of IPv6 without brackets.
    pub host: String,
    pub port: u16,
}

impl ServerAddress {
    /// True for a text that is meant as the address of a server, also for one that is refused.
    pub fn is_meant_by(text: &str) -> bool {
        text.starts_with(SCHEME) || text.starts_with("wss://")
    }

    /// Name of the server in a file name, as in `10.0.0.2-8765`.
    pub fn file_name(&self) -> String {
        let safe = |letter: char| if letter.is_alphanumeric() || letter == '.' { letter } else { '-' };
        format!("{}-{}", self.host.chars().map(safe).collect::<String>(), self.port)
    }
}

impl FromStr for ServerAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let refused =
            |problem: &str| Err(format!("'{text}': {problem}; expected ws://HOST:PORT, as ws://10.0.0.2:8765"));
        let Some(rest) = text.strip_prefix(SCHEME) else {
            return refused("only connections without encryption (ws://) are supported");
        };
        let rest = rest.strip_suffix('/').unwrap_or(rest);
        let bracketed = rest.strip_prefix('[').and_then(|rest| rest.split_once(']'));
        let (host, port) = match bracketed {
            Some((host, port)) => (host, port.strip_prefix(':')),
            None => rest.split_once(':').map_or((rest, None), |(host, port)| (host, Some(port))),
        };
        if host.is_empty() || host.contains(['/', '?', '#', '@', ' ']) {
            return refused("no name or address of a host");
        }
        let Ok(port) = port.map_or(Ok(DEFAULT_PORT), str::parse) else { return refused("the port is no number") };
        Ok(Self { host: host.to_owned(), port })
    }
}

impl Display for ServerAddress {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { host, port } = self;
        if host.contains(':') { write!(f, "{SCHEME}[{host}]:{port}") } else { write!(f, "{SCHEME}{host}:{port}") }
    }
}
