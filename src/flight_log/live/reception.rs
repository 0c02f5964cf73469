//! State of a reception, which the receiver writes and the window and the commands read.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use parking_lot::Mutex;

use super::address::ServerAddress;

/// Largest delay of the log time of a message after its header stamp, in nanoseconds.
const DELAY_NS: u64 = 500_000_000;

/// Amount that was received.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Received {
    pub messages: u64,
    /// Size of the messages.
    pub bytes: u64,
    /// Number of connections to the server.
    pub connections: u32,
}

/// Event of a reception, at a log time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::flight_log) struct ReceptionEvent {
    /// Log time of the last message before it, in nanoseconds since the epoch.
    pub(in crate::flight_log) log_time_ns: u64,
    pub(in crate::flight_log) message: String,
}

/// Reception of the messages of a server.
#[derive(Debug)]
pub struct Reception {
    address: ServerAddress,
    /// Set from outside to end it.
    stop: Arc<AtomicBool>,
    /// Set when its receiver is closed.
    is_closed: AtomicBool,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    received: Received,
    /// Reason why there is no connection now; `None` while there is one, and before the first attempt.
    problem: Option<String>,
    events: Vec<ReceptionEvent>,
    /// Log times of the last message before an interruption and of the first one after it.
    interruptions: Vec<(u64, u64)>,
    /// Number of events that have been taken.
    taken: usize,
    is_over: bool,
}

impl Reception {
    pub(super) fn new(address: ServerAddress, stop: Arc<AtomicBool>) -> Self {
        Self { address, stop, is_closed: AtomicBool::new(false), state: Mutex::default() }
    }

    pub fn address(&self) -> &ServerAddress {
        &self.address
    }

    /// Messages received so far.
    pub fn received(&self) -> Received {
        self.state.lock().received
    }

    /// Reason why there is no connection now, `None` while there is one.
    pub fn problem(&self) -> Option<String> {
        self.state.lock().problem.clone()
    }

    /// True when the recording is closed.
    pub fn is_over(&self) -> bool {
        self.state.lock().is_over
    }

    /// The flag that ends it.
    pub fn stop_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.stop)
    }

    /// Events since the last call.
    pub(in crate::flight_log) fn take_events(&self) -> Vec<ReceptionEvent> {
        let mut state = self.state.lock();
        let new = state.events[state.taken..].to_vec();
        state.taken = state.events.len();
        new
    }

    /// All events as texts.
    pub fn events(&self) -> Vec<String> {
        self.state.lock().events.iter().map(|event| event.message.clone()).collect()
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.is_closed.load(Ordering::Relaxed)
    }

    pub(super) fn close(&self) {
        self.is_closed.store(true, Ordering::Relaxed);
    }

    pub(super) fn connected(&self) {
        let mut state = self.state.lock();
        state.received.connections += 1;
        state.problem = None;
    }

    pub(super) fn not_connected(&self, problem: String) {
        self.state.lock().problem = Some(problem);
    }

    pub(super) fn add(&self, bytes: usize) {
        let mut state = self.state.lock();
        state.received.messages += 1;
        state.received.bytes += bytes as u64;
    }

    pub(super) fn report(&self, log_time_ns: u64, message: String) {
        self.state.lock().events.push(ReceptionEvent { log_time_ns, message });
    }

    /// Adds an interruption of the messages, between two log times.
    pub(super) fn interrupted(&self, from_ns: u64, to_ns: u64, message: String) {
        self.state.lock().interruptions.push((from_ns, to_ns));
        self.report(from_ns, message);
    }

    /// True if the messages were interrupted between two log times, up to a tolerance for the delays of messages.
    pub(in crate::flight_log) fn was_interrupted(&self, from_ns: u64, to_ns: u64) -> bool {
        let is_near = |one: u64, other: u64| one.abs_diff(other) <= DELAY_NS;
        self.state.lock().interruptions.iter().any(|(from, to)| is_near(*from, from_ns) && is_near(*to, to_ns))
    }

    pub(super) fn end(&self) {
        self.state.lock().is_over = true;
    }
}
