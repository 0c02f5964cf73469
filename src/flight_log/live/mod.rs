//! Messages of a vehicle in flight: a client of Foxglove's WebSocket protocol that records what it receives.
//!
//! The recording is a log that grows under its final name, and is followed like one of any other program
//! ([`FlightLog::open_following`](super::FlightLog::open_following)): nothing that was received depends on the speed of
//! the runs.

mod address;
mod connection;
mod protocol;
mod receiver;
mod reception;
#[cfg(test)]
mod tests;

pub use self::address::ServerAddress;
pub use self::receiver::{LiveReceiver, ReceiverRequest};
pub(in crate::flight_log) use self::reception::ReceptionEvent;
pub use self::reception::{Received, Reception};
