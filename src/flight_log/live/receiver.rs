//! The thread that receives the messages of a server and records them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::{self, Builder, JoinHandle};

use super::address::ServerAddress;
use super::connection::{Connection, Delivery, Loss, READ};
use super::protocol::{AdvertisedTopic, MessageData, STATUS_ERROR, ServerText, read_binary, read_text, subscribe};
use super::reception::Reception;
use crate::files::LogLimits;
use crate::flight_log::writer::MessageType;
use crate::flight_log::writer::growing::GrowingLog;
use crate::flight_log::{LogError, MessageKind};

/// Waits of [`READ`] between two attempts to connect: half a second.
const RETRY_WAITS: u32 = 25;
/// Waits of [`READ`] without a message after which a reception that is to end with its server has ended: half a minute.
const IDLE_WAITS: u32 = 1500;
/// Messages that cannot be read and are reported one by one; further ones are counted.
const REPORTED: u32 = 3;
/// Largest number of times that refused subscriptions are sent again on one connection.
const REPEATED: u32 = 50;
/// Time in nanoseconds by which the server's clock may differ from the time that has passed on one connection; a larger
/// difference is a step of that clock.
const CLOCK_STEP_NS: i64 = 2_000_000_000;
/// Factor on the time that has passed without a connection, since attempts to connect take longer than their waits.
const WITHOUT_CONNECTION: i64 = 10;

/// Request to receive and record the messages of a server.
#[derive(Clone, Debug)]
pub struct ReceiverRequest {
    pub address: ServerAddress,
    /// Path of the recording, which must not exist.
    pub recording: PathBuf,
    /// Text of the rig: of the topics with images, those that it names are subscribed; all without a rig.
    pub rig: Option<String>,
    /// Topics that are subscribed in any case.
    pub topics: Vec<String>,
    /// Names and contents of files that the recording contains, such as the rig.
    pub attachments: Vec<(String, Vec<u8>)>,
    pub limits: LogLimits,
    /// True to end half a minute after the last message; otherwise the reception waits for the server until it is stopped.
    pub ends_with_server: bool,
    /// Ends the reception once it is set.
    pub stop: Arc<AtomicBool>,
}

/// The receiving thread. Dropping it ends the reception and completes the recording.
#[derive(Debug)]
pub struct LiveReceiver {
    reception: Arc<Reception>,
    thread: Option<JoinHandle<()>>,
    recording: PathBuf,
}

impl LiveReceiver {
    /// Starts to receive; the recording appears with the first topic.
    ///
    /// # Errors
    /// If no thread can be started.
    pub fn start(request: ReceiverRequest) -> Result<Self, LogError> {
        let reception = Arc::new(Reception::new(request.address.clone(), Arc::clone(&request.stop)));
        let (of_thread, path) = (Arc::clone(&reception), request.recording.clone());
        let work = move || {
            Receiver::new(&request, &of_thread).run();
            of_thread.end();
        };
        let thread = Builder::new().name("receiver".into()).spawn(work).map_err(|source| LogError::Io {
            action: "start a thread to receive messages",
            source,
            path: path.clone(),
        })?;
        Ok(Self { reception, thread: Some(thread), recording: path })
    }

    pub fn reception(&self) -> &Arc<Reception> {
        &self.reception
    }

    /// Path of the recording.
    pub fn recording(&self) -> &Path {
        &self.recording
    }

    /// Ends the reception; the recording is complete afterwards.
    pub fn finish(&mut self) {
        self.reception.close();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread leaves a recording without a footer, which is reported when it is read.
            drop(thread.join());
            self.reception.end();
        }
    }
}

impl Drop for LiveReceiver {
    fn drop(&mut self) {
        self.finish();
    }
}

struct Receiver<'a> {
    request: &'a ReceiverRequest,
    reception: &'a Reception,
    log: Option<GrowingLog>,
    /// Channels of the recording by subscription of the present connection.
    channels: BTreeMap<u32, u16>,
    /// Server's identifiers of the topics that are subscribed on the present connection.
    subscribed: BTreeSet<u64>,
    /// Server's identifiers of the topics by subscription, of those without a message on the present connection.
    unheard: BTreeMap<u32, u64>,
    /// Subscriptions that were sent again on the present connection.
    repeated: u32,
    /// Log time of the last message, 0 before the first.
    last_ns: u64,
    /// Log time minus time of the server's clock, from its steps.
    clock_offset_ns: i64,
    /// Waits since the last message.
    waits: u32,
    /// End of the last connection, until there is a message of another one.
    lost: Option<Loss>,
    /// Messages that could not be read.
    unreadable: u32,
}

impl<'a> Receiver<'a> {
    fn new(request: &'a ReceiverRequest, reception: &'a Reception) -> Self {
        Self {
            request,
            reception,
            log: None,
            channels: BTreeMap::new(),
            subscribed: BTreeSet::new(),
            unheard: BTreeMap::new(),
            repeated: 0,
            last_ns: 0,
            clock_offset_ns: 0,
            waits: 0,
            lost: None,
            unreadable: 0,
        }
    }

    /// Receives until the end of the reception, over as many connections as it takes.
    fn run(mut self) {
        let message_bytes = usize::try_from(self.request.limits.record_bytes(u64::MAX)).unwrap_or(usize::MAX);
        while !self.has_ended() {
            match Connection::open(&self.request.address, message_bytes) {
                Ok(connection) => {
                    self.reception.connected();
                    (self.channels, self.subscribed, self.unheard, self.repeated) = Default::default();
                    if let Err(error) = self.receive(connection) {
                        self.reception.report(self.last_ns, format!("the recording has ended: {error}"));
                        return;
                    }
                }
                Err(problem) => self.reception.not_connected(problem),
            }
            for _ in 0..RETRY_WAITS {
                if self.has_ended() {
                    break;
                }
                self.waits += 1;
                thread::sleep(READ);
            }
        }
        if self.unreadable > REPORTED {
            let more = self.unreadable - REPORTED;
            self.reception.report(self.last_ns, format!("{more} further messages of the server could not be read"));
        }
        if let Some(Loss { reason, .. }) = self.lost.take_if(|loss| !loss.is_closed) {
            let message = format!("the connection to {} was lost ({reason})", self.request.address);
            self.reception.report(self.last_ns, message);
        }
        if let Some(Err(error)) = self.log.take().map(GrowingLog::finish) {
            self.reception.report(self.last_ns, format!("the recording has no index: {error}"));
        }
    }

    fn has_ended(&self) -> bool {
        self.reception.is_stopped() || self.request.ends_with_server && self.waits > IDLE_WAITS
    }

    /// Receives messages until the connection is lost or the reception ends.
    ///
    /// # Errors
    /// If the recording cannot be written.
    fn receive(&mut self, mut connection: Connection) -> Result<(), LogError> {
        while !self.has_ended() {
            match connection.read() {
                Delivery::Text(text) => {
                    let subscriptions = match read_text(&text) {
                        Ok(message) => self.understand(message)?,
                        Err(problem) => {
                            self.unreadable(&problem);
                            continue;
                        }
                    };
                    if !subscriptions.is_empty()
                        && let Err(reason) = connection.send(subscribe(&subscriptions))
                    {
                        self.lose(Loss::broken(reason));
                        break;
                    }
                }
                Delivery::Binary(bytes) => match read_binary(&bytes) {
                    Ok(Some(message)) => self.record(message)?,
                    Ok(None) => {}
                    Err(problem) => self.unreadable(&problem),
                },
                Delivery::Nothing => {
                    self.waits += 1;
                    self.flush()?;
                }
                Delivery::Lost(loss) => {
                    self.lose(loss);
                    self.flush()?;
                    return Ok(());
                }
            }
        }
        self.flush()?;
        connection.close();
        Ok(())
    }

    fn lose(&mut self, loss: Loss) {
        self.reception.not_connected(loss.reason.clone());
        self.lost = Some(loss);
    }

    fn flush(&mut self) -> Result<(), LogError> {
        self.log.as_mut().map_or(Ok(()), GrowingLog::flush)
    }

    /// Reads a text of the server; returns the subscriptions that follow from it.
    fn understand(&mut self, message: ServerText) -> Result<Vec<(u32, u64)>, LogError> {
        match message {
            ServerText::Advertise { channels } => self.subscribe(&channels),
            ServerText::Unadvertise { channel_ids } => {
                for id in channel_ids {
                    self.subscribed.remove(&id);
                }
                Ok(Vec::new())
            }
            ServerText::Status { level, message } => {
                if level >= STATUS_ERROR {
                    let refused = self.refused(&message);
                    if !refused.is_empty() && self.repeated < REPEATED {
                        self.repeated += 1;
                        thread::sleep(READ);
                        return Ok(refused);
                    }
                    self.reception.report(self.last_ns, format!("the server reports: {message}"));
                }
                Ok(Vec::new())
            }
            ServerText::Other => Ok(Vec::new()),
        }
    }

    /// Subscriptions of topics that an error of the server names: a server that has just started may not know a topic yet
    /// that it has advertised.
    fn refused(&self, message: &str) -> Vec<(u32, u64)> {
        let numbers: Vec<u64> =
            message.split(|letter: char| !letter.is_ascii_digit()).filter_map(|number| number.parse().ok()).collect();
        let unheard = self.unheard.iter().map(|(subscription, topic)| (*subscription, *topic));
        unheard.filter(|(_, topic)| numbers.contains(topic)).collect()
    }

    fn subscribe(&mut self, topics: &[AdvertisedTopic]) -> Result<Vec<(u32, u64)>, LogError> {
        let mut subscriptions = Vec::new();
        for topic in topics {
            if !self.is_wanted(topic) || self.subscribed.contains(&topic.id) {
                continue;
            }
            let limits = &self.request.limits;
            let names = limits
                .check_name("the name of a topic", &topic.topic)
                .and_then(|()| limits.check_name("the name of a type", &topic.schema_name));
            let schema = names.map_err(|exceeded| exceeded.to_string()).and_then(|()| topic.schema_content());
            let schema = match schema {
                Ok(schema) if (self.channels.len() as u64) < limits.topics() => schema,
                Ok(_) => continue,
                Err(problem) => {
                    self.unreadable(&problem);
                    continue;
                }
            };
            let subscription = u32::try_from(self.channels.len()).unwrap_or(u32::MAX);
            let message_type = MessageType {
                name: &topic.schema_name,
                definition_encoding: topic.schema_language(),
                definition: schema.into(),
                message_encoding: &topic.encoding,
            };
            let channel = self.log()?.channel(&topic.topic, &message_type)?;
            self.channels.insert(subscription, channel);
            self.subscribed.insert(topic.id);
            self.unheard.insert(subscription, topic.id);
            subscriptions.push((subscription, topic.id));
        }
        Ok(subscriptions)
    }

    /// True for a topic that the program reads, except images of cameras that the rig does not have.
    fn is_wanted(&self, topic: &AdvertisedTopic) -> bool {
        let kind = MessageKind::of_channel(&topic.schema_name, &topic.encoding);
        let is_named = |rig: &String| names(rig, &topic.topic);
        self.request.topics.contains(&topic.topic)
            || self.request.rig.as_ref().is_some_and(is_named)
            || kind.is_some_and(|kind| !kind.is_image() || self.request.rig.is_none())
    }

    /// The recording, created at the first call.
    fn log(&mut self) -> Result<&mut GrowingLog, LogError> {
        let log = if let Some(log) = self.log.take() {
            log
        } else {
            let mut log = GrowingLog::create(&self.request.recording)?;
            for (name, content) in &self.request.attachments {
                log.attach(name, content)?;
            }
            log
        };
        Ok(self.log.insert(log))
    }

    fn record(&mut self, message: MessageData<'_>) -> Result<(), LogError> {
        let MessageData { subscription, log_time_ns, data } = message;
        let Some(channel) = self.channels.get(&subscription).copied() else {
            self.unreadable(&format!("a message has the unknown subscription {subscription}"));
            return Ok(());
        };
        self.unheard.remove(&subscription);
        let log_time_ns = self.log_time_ns(log_time_ns);
        self.reception.add(data.len());
        self.log()?.write(channel, log_time_ns, data)
    }

    /// Log time of a message from the time of the server's clock, without the steps of that clock. Reports a step, and an
    /// interruption that ends with this message.
    fn log_time_ns(&mut self, server_ns: u64) -> u64 {
        let mut log_time_ns = server_ns.saturating_add_signed(self.clock_offset_ns);
        let waited_ns = i64::from(self.waits).saturating_mul(READ.as_nanos() as i64);
        let lost = self.lost.take();
        let (shortest_ns, longest_ns) = match lost {
            Some(_) => (0, waited_ns.saturating_mul(WITHOUT_CONNECTION).saturating_add(CLOCK_STEP_NS)),
            None => (-CLOCK_STEP_NS, waited_ns.saturating_add(CLOCK_STEP_NS)),
        };
        let passed_ns = log_time_ns as i64 - self.last_ns as i64;
        if self.last_ns > 0 && !(shortest_ns..=longest_ns).contains(&passed_ns) {
            let expected_ns = self.last_ns.saturating_add_signed(waited_ns);
            let step_ns = log_time_ns as i64 - expected_ns as i64;
            self.clock_offset_ns -= step_ns;
            log_time_ns = expected_ns;
            let direction = if step_ns < 0 { "back" } else { "forward" };
            let message = format!(
                "the server's clock went {direction} by {:.1} s; log times go on without the step, header stamps of that \
                 clock do not",
                step_ns.abs() as f64 * 1e-9
            );
            self.reception.report(self.last_ns, message);
        }
        if let Some(Loss { reason, .. }) = lost {
            let missing_s = log_time_ns.saturating_sub(self.last_ns) as f64 * 1e-9;
            let address = &self.request.address;
            let message =
                format!("the connection to {address} was lost ({reason}); {missing_s:.1} s of messages are missing");
            self.reception.interrupted(self.last_ns, log_time_ns, message);
        }
        self.waits = 0;
        self.last_ns = self.last_ns.max(log_time_ns);
        log_time_ns
    }

    fn unreadable(&mut self, problem: &str) {
        self.unreadable += 1;
        if self.unreadable <= REPORTED {
            self.reception.report(self.last_ns, format!("a message of the server is left out: {problem}"));
        }
    }
}

/// True if a rig names a topic, whatever its format.
fn names(rig: &str, topic: &str) -> bool {
    let is_part = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == '/';
    rig.match_indices(topic).any(|(at, _)| {
        let (before, after) = (rig[..at].chars().next_back(), rig[at + topic.len()..].chars().next());
        !before.is_some_and(is_part) && !after.is_some_and(is_part)
    })
}
