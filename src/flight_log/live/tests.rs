//! The receiver with a server in the same process.

use std::fs;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::thread;
use std::time::Duration;

use tungstenite::handshake::server::{Request, Response};
use tungstenite::{Message, WebSocket, accept_hdr};

use super::protocol::{MessageData, ServerText, read_binary, read_text, subscribe};
use super::*;
use crate::files::LogLimits;
use crate::flight_log::container::{ContainerIndex, DecodedBlock};
use crate::flight_log::{FlightLog, FollowOptions, RigOfLog as _, WarningKind};
use crate::sensors::Rig;

const RIG: &str = include_str!("../../../sample_logs/garden.rig.yaml");

/// Message of the sample log: topic, log time and content.
type Sent = (String, u64, Vec<u8>);

fn sample() -> FlightLog {
    FlightLog::open(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../sample_logs/garden.mcap"))).unwrap()
}

/// All messages of a log in the order of log times.
fn messages(log: &FlightLog) -> Vec<Sent> {
    let index = log.index();
    let mut messages = Vec::new();
    for block in &index.blocks {
        let decoded = DecodedBlock::decode(log.file(), block);
        for message in &decoded.messages {
            let topic = index.channels[&message.channel_id].topic.clone();
            messages.push((topic, message.log_time_ns, decoded.bytes(&message.data).to_vec()));
        }
    }
    messages.sort_by_key(|(topic, time, _)| (*time, topic.clone()));
    messages
}

/// Text with which a server advertises the topics of a log.
fn advertise(log: &FlightLog) -> (String, Vec<String>) {
    let index = log.index();
    let topics: Vec<String> = index.channels.values().map(|channel| channel.topic.clone()).collect();
    let channels: Vec<_> = index
        .channels
        .values()
        .enumerate()
        .map(|(number, channel)| {
            serde_json::json!({
                "id": 100 + number, "topic": channel.topic, "encoding": channel.encoding,
                "schemaName": channel.schema_name, "schemaEncoding": "ros2msg", "schema": channel.definition.as_deref(),
            })
        })
        .collect();
    (serde_json::json!({ "op": "advertise", "channels": channels }).to_string(), topics)
}

/// A connection of a client, with the subscriptions by number of the topic.
struct Client(WebSocket<TcpStream>, Vec<Option<u32>>);

impl Client {
    /// Waits for a client and advertises topics to it.
    fn greet(listener: &TcpListener, advertise: &str) -> WebSocket<TcpStream> {
        let (stream, _) = listener.accept().unwrap();
        #[expect(clippy::result_large_err, reason = "the type of the callback")]
        let choose = |request: &Request, mut response: Response| {
            let offered = request.headers()["sec-websocket-protocol"].to_str().unwrap();
            assert_eq!(offered, "foxglove.sdk.v1, foxglove.websocket.v1");
            response.headers_mut().insert("sec-websocket-protocol", "foxglove.websocket.v1".parse().unwrap());
            Ok(response)
        };
        let mut socket = accept_hdr(stream, choose).unwrap();
        socket.send(Message::text(r#"{"op":"serverInfo","name":"test","capabilities":[]}"#)).unwrap();
        socket.send(Message::text(advertise.to_owned())).unwrap();
        socket
    }

    /// [`Self::greet`], then reads what the client subscribes.
    fn accept(listener: &TcpListener, advertise: &str, topics: usize) -> Self {
        let mut socket = Self::greet(listener, advertise);
        let reply: serde_json::Value = serde_json::from_str(socket.read().unwrap().to_text().unwrap()).unwrap();
        assert_eq!(reply["op"], "subscribe");
        let mut subscribed = vec![None; topics];
        for subscription in reply["subscriptions"].as_array().unwrap() {
            let topic = subscription["channelId"].as_u64().unwrap() as usize - 100;
            subscribed[topic] = Some(subscription["id"].as_u64().unwrap() as u32);
        }
        Self(socket, subscribed)
    }

    fn send(&mut self, topics: &[String], messages: &[Sent]) {
        for (topic, time, data) in messages {
            let number = topics.iter().position(|known| known == topic).unwrap();
            let Some(subscription) = self.1[number] else { continue };
            let bytes = [&[1][..], &subscription.to_le_bytes(), &time.to_le_bytes(), data].concat();
            self.0.write(Message::binary(bytes)).unwrap();
        }
        self.0.flush().unwrap();
    }

    fn close(mut self) {
        self.0.close(None).unwrap();
        while self.0.read().is_ok() {}
    }
}

fn receiver(port: u16, recording: &Path, rig: Option<&str>) -> LiveReceiver {
    let attachments = rig.map(|rig| ("x.rig.yaml".to_owned(), rig.as_bytes().to_vec()));
    LiveReceiver::start(ReceiverRequest {
        address: ServerAddress { host: "127.0.0.1".into(), port },
        recording: recording.to_owned(),
        rig: rig.map(str::to_owned),
        topics: Vec::new(),
        attachments: attachments.into_iter().collect(),
        limits: LogLimits::default(),
        ends_with_server: false,
        stop: std::sync::Arc::default(),
    })
    .unwrap()
}

fn listener() -> (TcpListener, u16) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    (listener, port)
}

fn wait_until(is_so: impl Fn() -> bool) {
    for _ in 0..1000 {
        if is_so() {
            return;
        }
        thread::sleep(Duration::from_millis(10));
    }
    panic!("not within ten seconds");
}

#[test]
fn addresses_have_a_host_and_a_port() {
    let parsed = |text: &str| text.parse::<ServerAddress>();
    assert_eq!(parsed("ws://10.0.0.2:9000").unwrap().to_string(), "ws://10.0.0.2:9000");
    assert_eq!(parsed("ws://drone.local/").unwrap(), ServerAddress { host: "drone.local".into(), port: 8765 });
    assert_eq!(parsed("ws://[fe80::1]:80").unwrap().to_string(), "ws://[fe80::1]:80");
    assert_eq!(parsed("ws://[fe80::1]").unwrap().file_name(), "fe80--1-8765");
    for wrong in ["wss://host:1", "ws://", "ws://host:port", "ws://host:70000", "ws://a b", "ws://a/b", "http://a"] {
        assert!(parsed(wrong).unwrap_err().contains("ws://HOST:PORT"), "{wrong}");
    }
    assert!(ServerAddress::is_meant_by("wss://host") && !ServerAddress::is_meant_by("flight.mcap"));
}

#[test]
fn messages_of_the_protocol_are_read() {
    let text = r#"{"op":"advertise","channels":[{"id":3,"topic":"/video","encoding":"protobuf","schemaName":"foxglove.X","schema":"3q2+7w=="}]}"#;
    let Ok(ServerText::Advertise { channels }) = read_text(text) else { panic!("{:?}", read_text(text)) };
    assert_eq!((channels[0].id, channels[0].schema_language()), (3, "protobuf"));
    assert_eq!(channels[0].schema_content().unwrap(), [0xde, 0xad, 0xbe, 0xef]);
    assert_eq!(read_text(r#"{"op":"connectionGraphUpdate","x":1}"#), Ok(ServerText::Other));
    assert_eq!(
        read_text(r#"{"op":"unadvertise","channelIds":[1]}"#),
        Ok(ServerText::Unadvertise { channel_ids: vec![1] })
    );
    assert!(read_text("{").unwrap_err().contains("1 bytes"));
    let bytes = [1, 7, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 42];
    assert_eq!(read_binary(&bytes), Ok(Some(MessageData { subscription: 7, log_time_ns: 9, data: &[42] })));
    assert_eq!(read_binary(&[2, 0]), Ok(None), "the time");
    assert!(read_binary(&bytes[..12]).unwrap_err().contains("12 bytes"));
    let text: serde_json::Value = serde_json::from_str(&subscribe(&[(0, 5)])).unwrap();
    assert_eq!(text, serde_json::json!({ "op": "subscribe", "subscriptions": [{ "id": 0, "channelId": 5 }] }));
}

#[test]
fn a_recording_has_every_message_of_the_rig_and_the_rig() {
    let log = sample();
    let sent: Vec<Sent> = messages(&log).into_iter().take(3000).collect();
    let (text, topics) = advertise(&log);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/live.mcap");
    let (listener, port) = listener();
    // The rig without its static camera.
    let rig = RIG.replace("/static_camera/image_raw/compressed", "/static_camera/other");
    let mut receiver = receiver(port, &path, Some(&rig));
    let mut client = Client::accept(&listener, &text, topics.len());
    client.send(&topics, &sent);
    client.close();
    wait_until(|| receiver.reception().problem().is_some());
    receiver.finish();
    assert!(receiver.reception().is_over());
    let wanted: Vec<Sent> =
        sent.into_iter().filter(|(topic, ..)| topic != "/static_camera/image_raw/compressed").collect();
    let recorded = FlightLog::open(&path).unwrap();
    assert!(recorded.index().from_summary, "the recording is complete");
    assert!(wanted.iter().any(|(topic, ..)| topic.contains("image")));
    assert_eq!(receiver.reception().received().messages, wanted.len() as u64);
    assert!(messages(&recorded) == wanted, "{} messages of {}", messages(&recorded).len(), wanted.len());
    let place = recorded.index().attachments[0].clone();
    assert_eq!(ContainerIndex::attachment(recorded.file(), &place).unwrap(), rig.as_bytes());
}

#[test]
fn a_connection_that_breaks_is_resumed_in_one_log_with_one_warning() {
    let log = sample();
    let sent = messages(&log);
    let (text, topics) = advertise(&log);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("live.mcap");
    let (listener, port) = listener();
    let mut receiver = receiver(port, &path, None);
    // Four seconds, an interruption of one, then the rest.
    let at_s = |message: &Sent| (message.1 - sent[0].1) as f64 * 1e-9;
    let (first, rest): (Vec<Sent>, Vec<Sent>) = sent.iter().cloned().partition(|message| at_s(message) < 4.0);
    let rest: Vec<Sent> = rest.into_iter().filter(|message| at_s(message) > 5.0).collect();
    let followed = thread::scope(|scope| {
        scope.spawn(|| {
            let mut client = Client::accept(&listener, &text, topics.len());
            client.send(&topics, &first);
            // Without the handshake at the end, as of a server that is killed.
            drop(client);
            let mut client = Client::accept(&listener, &text, topics.len());
            client.send(&topics, &rest);
            client.close();
        });
        let options = FollowOptions::of_reception(receiver.reception(), None);
        let log = std::sync::Arc::new(FlightLog::open_following(&path, &LogLimits::default(), options).unwrap());
        scope.spawn(|| {
            wait_until(|| receiver.reception().received().messages == (first.len() + rest.len()) as u64);
            receiver.finish();
        });
        let rig =
            Rig::for_log(&log, Some(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../sample_logs/garden.rig.yaml")));
        let mut stream = crate::flight_log::FrameStream::new(log, &rig.unwrap(), "cam0", 0.0, None).unwrap();
        let mut warnings: Vec<_> =
            std::iter::from_fn(|| stream.next_frame()).flat_map(|frame| frame.warnings).collect();
        warnings.extend_from_slice(stream.remaining_warnings());
        warnings
    });
    let of_connection: Vec<_> = followed.iter().filter(|warning| warning.kind == WarningKind::Reception).collect();
    let [warning] = of_connection.as_slice() else { panic!("{followed:?}") };
    assert!(warning.message.contains("1.0 s of messages are missing"), "{}", warning.message);
    assert!((warning.stamp_ns - 4_000_000_000).abs() < 50_000_000, "{}", warning.stamp_ns);
    assert_eq!(receiver.reception().received().connections, 2);
    assert!(messages(&FlightLog::open(&path).unwrap()) == [first, rest].concat());
}

#[test]
fn log_times_go_on_without_a_step_of_the_servers_clock() {
    let log = sample();
    let (text, topics) = advertise(&log);
    let sent: Vec<Sent> = messages(&log).into_iter().take(2000).collect();
    // After 600 messages one hour forward, after 1200 two hours back.
    let shift_ns = |number: usize| [0, 3_600_000_000_000, -3_600_000_000_000][number / 600 % 3];
    let stepped: Vec<Sent> = sent
        .iter()
        .take(1800)
        .enumerate()
        .map(|(number, (topic, time, data))| {
            (topic.clone(), time.saturating_add_signed(shift_ns(number)), data.clone())
        })
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("live.mcap");
    let (listener, port) = listener();
    let mut receiver = receiver(port, &path, None);
    let mut client = Client::accept(&listener, &text, topics.len());
    client.send(&topics, &stepped);
    client.close();
    wait_until(|| receiver.reception().problem().is_some());
    receiver.finish();
    let recorded = messages(&FlightLog::open(&path).unwrap());
    assert_eq!(recorded.len(), 1800);
    for ((_, time, _), (_, expected, _)) in recorded.iter().zip(&sent) {
        assert!(time.abs_diff(*expected) < 100_000_000, "{time} for {expected}");
    }
    let events = receiver.reception().events();
    assert_eq!(events.len(), 2, "{events:?}");
    assert!(events[0].contains("forward by 3600.") && events[1].contains("back by 7200."), "{events:?}");
}

#[test]
fn what_cannot_be_read_is_left_out_with_a_warning() {
    let log = sample();
    let sent: Vec<Sent> = messages(&log).into_iter().take(50).collect();
    let (text, topics) = advertise(&log);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("live.mcap");
    let (listener, port) = listener();
    let mut receiver = receiver(port, &path, None);
    let mut client = Client::accept(&listener, &text, topics.len());
    client.0.send(Message::text(r#"{"op":"status","level":2,"message":"Unknown channel ID: 101"}"#)).unwrap();
    let again = client.0.read().unwrap().to_text().unwrap().to_owned();
    assert_eq!(again, subscribe(&[(client.1[1].unwrap(), 101)]));
    client.send(&topics, &sent[..20]);
    client.0.send(Message::binary(vec![1, 0, 0])).unwrap();
    client.0.send(Message::text("no JSON")).unwrap();
    client.0.send(Message::binary([&[1][..], &999_u32.to_le_bytes(), &5_u64.to_le_bytes()].concat())).unwrap();
    client.0.send(Message::binary(vec![1])).unwrap();
    client.0.send(Message::text(r#"{"op":"status","level":2,"message":"disk almost full"}"#)).unwrap();
    client.send(&topics, &sent[20..]);
    client.close();
    wait_until(|| receiver.reception().problem().is_some());
    receiver.finish();
    let events = receiver.reception().events();
    for part in
        ["3 bytes", "7 bytes cannot be read", "subscription 999", "the server reports: disk almost full", "1 further"]
    {
        assert_eq!(events.iter().filter(|event| event.contains(part)).count(), 1, "{part}: {events:?}");
    }
    assert!(messages(&FlightLog::open(&path).unwrap()) == sent);
}

#[test]
fn a_recording_that_cannot_be_written_ends_the_reception() {
    let log = sample();
    let (text, _) = advertise(&log);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "not a folder").unwrap();
    let (listener, port) = listener();
    let receiver = receiver(port, &folder.path().join("file/live.mcap"), None);
    thread::scope(|scope| {
        scope.spawn(|| {
            let mut socket = Client::greet(&listener, &text);
            while socket.read().is_ok() {}
        });
        wait_until(|| receiver.reception().is_over());
    });
    let events = receiver.reception().events();
    assert!(events[0].starts_with("the recording has ended: cannot create the recording"), "{events:?}");
}

#[test]
fn a_server_that_is_not_there_is_named() {
    let (listener, port) = listener();
    drop(listener);
    let folder = tempfile::tempdir().unwrap();
    let mut receiver = receiver(port, &folder.path().join("live.mcap"), None);
    wait_until(|| receiver.reception().problem().is_some());
    let problem = receiver.reception().problem().unwrap();
    assert!(problem.to_lowercase().contains("refused"), "{problem}");
    receiver.finish();
    assert!(receiver.reception().is_over() && !folder.path().join("live.mcap").exists());
}
