//! One connection to a server.

use std::io;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::time::Duration;

use tungstenite::client::{ClientRequestBuilder, client_with_config};
use tungstenite::handshake::HandshakeError;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

use super::address::ServerAddress;
use super::protocol::SUBPROTOCOLS;

/// Time after which an attempt to connect has failed.
const CONNECT: Duration = Duration::from_secs(2);
/// Time for which a connection waits for a message.
pub(super) const READ: Duration = Duration::from_millis(20);

/// Connection to a server that has accepted one of the subprotocols.
pub(super) struct Connection(WebSocket<TcpStream>);

/// Outcome of waiting for a message.
pub(super) enum Delivery {
    Text(String),
    Binary(tungstenite::Bytes),
    /// No message within [`READ`].
    Nothing,
    /// The connection is lost.
    Lost(Loss),
}

/// End of a connection.
#[derive(Clone, Debug)]
pub(super) struct Loss {
    pub(super) reason: String,
    /// True if the server has ended it as the protocol asks for.
    pub(super) is_closed: bool,
}

impl Loss {
    pub(super) fn broken(reason: String) -> Self {
        Self { reason, is_closed: false }
    }
}

impl Connection {
    /// Connects to a server; a message may have `message_bytes` at most.
    ///
    /// # Errors
    /// With the reason, if no server answers, or if it has no common subprotocol.
    pub(super) fn open(address: &ServerAddress, message_bytes: usize) -> Result<Self, String> {
        let text = |error: io::Error| error.to_string();
        let mut problem = "the host has no address".to_owned();
        let mut stream = None;
        for found in (address.host.as_str(), address.port).to_socket_addrs().map_err(text)? {
            match TcpStream::connect_timeout(&found, CONNECT) {
                Ok(open) => {
                    stream = Some(open);
                    break;
                }
                Err(error) => problem = error.to_string(),
            }
        }
        let stream = stream.ok_or(problem)?;
        stream.set_nodelay(true).and_then(|()| stream.set_read_timeout(Some(CONNECT))).map_err(text)?;
        stream.set_write_timeout(Some(CONNECT)).map_err(text)?;
        let uri = address.to_string().parse().map_err(|error| format!("it is no address ({error})"))?;
        let request = SUBPROTOCOLS
            .iter()
            .fold(ClientRequestBuilder::new(uri), |request, protocol| request.with_sub_protocol(*protocol));
        let config =
            WebSocketConfig::default().max_message_size(Some(message_bytes)).max_frame_size(Some(message_bytes));
        let (socket, _) = client_with_config(request, stream, Some(config)).map_err(|error| match error {
            HandshakeError::Failure(error) => format!("it is no server of Foxglove's protocol ({error})"),
            HandshakeError::Interrupted(_) => "the server does not answer".to_owned(),
        })?;
        socket.get_ref().set_read_timeout(Some(READ)).map_err(text)?;
        Ok(Self(socket))
    }

    /// Sends a text message to the server.
    pub(super) fn send(&mut self, text: String) -> Result<(), String> {
        self.0.send(Message::text(text)).map_err(|error| error.to_string())
    }

    /// Waits for a message, for [`READ`] at most.
    pub(super) fn read(&mut self) -> Delivery {
        match self.0.read() {
            Ok(Message::Text(text)) => Delivery::Text(text.as_str().to_owned()),
            Ok(Message::Binary(bytes)) => Delivery::Binary(bytes),
            Ok(Message::Close(_)) => {
                Delivery::Lost(Loss { reason: "the server has closed it".to_owned(), is_closed: true })
            }
            Ok(_) => Delivery::Nothing,
            Err(tungstenite::Error::Io(error))
                if matches!(
                    error.kind(),
                    io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted
                ) =>
            {
                Delivery::Nothing
            }
            Err(error) => Delivery::Lost(Loss::broken(error.to_string())),
        }
    }

    /// Tells the server that the connection ends.
    pub(super) fn close(mut self) {
        // A server that is gone needs no message.
        drop(self.0.close(None).and_then(|()| self.0.flush()));
    }
}
