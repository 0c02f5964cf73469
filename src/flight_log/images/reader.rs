use std::sync::Arc;

use parking_lot::Mutex;

use super::decoding::decode_image;
use super::grey_sampling::grey_levels_of_topic;
use crate::flight_log::container::{BlockCache, TopicIndex};
use crate::flight_log::grey_levels::GreyLevels;
use crate::flight_log::log::relative_ns;
use crate::flight_log::messages::{MessageKind, read_video_packet, stamp_ns};
use crate::flight_log::stamps::clock::StampClock;
use crate::flight_log::video::{VideoStream, keyframe_before};
use crate::flight_log::{FlightLog, LogError};
use crate::geometry::seconds_from_ns;
use crate::sensors::{GrayImage, Rig, UnknownCamera};

/// Number of cached blocks, so that adjacent images do not decompress their chunk again.
const BLOCKS: usize = 2;
/// Number of cached images of topics whose images do not depend on each other.
const IMAGES: usize = 8;
/// Pixels of the cached frames of all videos, so that stepping back within a group of pictures decodes it only once.
const VIDEO_PIXELS: usize = 64 << 20;

/// Random access to the images of a log by camera and number.
#[derive(Debug)]
pub struct ImageReader {
    log: Arc<FlightLog>,
    cameras: Vec<CameraImages>,
    cache: Mutex<ImageCache>,
}

#[derive(Debug)]
struct CameraImages {
    key: String,
    topic: String,
    kind: MessageKind,
    grey_levels: Arc<GreyLevels>,
    clock: StampClock,
    count: usize,
}

#[derive(Debug)]
struct ImageCache {
    /// Index of messages by camera.
    topics: Vec<TopicIndex>,
    blocks: BlockCache,
    /// Cached images by camera and index; the most recently used is the last.
    images: Vec<((usize, usize), Arc<GrayImage>)>,
    /// State of each camera's video decoder.
    streams: Vec<VideoStream>,
    /// Cached video frames by camera and index; the most recently used is the last.
    frames: Vec<((usize, usize), VideoFrame)>,
}

/// Decoded video frame, or a description of the problem.
type VideoFrame = Result<Arc<GrayImage>, String>;

impl ImageReader {
    /// Indexes the images of all cameras of a rig whose topics are in the log.
    pub fn new(log: Arc<FlightLog>, rig: &Rig) -> Self {
        let cameras: Vec<CameraImages> = rig
            .cameras
            .iter()
            .filter_map(|camera| {
                let info = log.topic(&camera.topic)?;
                let kind = info.kind.filter(|kind| kind.is_image())?;
                let (key, topic) = (camera.key.clone(), camera.topic.clone());
                let grey_levels = grey_levels_of_topic(&log, &topic, kind);
                let clock = StampClock::of_rig(camera.use_log_time);
                Some(CameraImages { key, topic, kind, grey_levels, clock, count: info.count as usize })
            })
            .collect();
        let topics = cameras.iter().map(|camera| log.topic_index(&camera.topic)).collect();
        let streams = cameras.iter().map(|_| VideoStream::default()).collect();
        let cache = ImageCache {
            topics,
            blocks: BlockCache::new(BLOCKS),
            images: Vec::with_capacity(IMAGES + 1),
            streams,
            frames: Vec::new(),
        };
        Self { log, cameras, cache: Mutex::new(cache) }
    }

    /// Number of images of a camera in the log, damaged ones included; 0 for a camera that is not in the log.
    pub fn count(&self, camera_key: &str) -> usize {
        self.cameras.iter().find(|camera| camera.key == camera_key).map_or(0, |camera| camera.count)
    }

    /// True if a camera's images are a video, where decoding one image can require all images since its keyframe.
    pub fn has_video(&self) -> bool {
        self.cameras.iter().any(|camera| camera.kind.is_video())
    }

    /// Decodes the video frames that an image depends on, while `go_on` returns true. Returns true if
    /// [`image`](Self::image) is fast then, as for all images that do not depend on others.
    pub fn decode_before(&self, camera_key: &str, index: usize, go_on: &dyn Fn() -> bool) -> bool {
        let Ok(number) = self.number_of(camera_key) else { return true };
        let camera = &self.cameras[number];
        if !camera.kind.is_video() || index >= camera.count {
            return true;
        }
        self.cache.lock().decode_frames(&self.log, number, camera.kind, index, go_on)
    }

    /// Numbers and stamps (header stamps, or log times by the rig) of a camera's images in the order of the stamps, in nanoseconds since the start of the
    /// log;
    /// images with unreadable stamps are left out.
    pub fn stamps_ns(&self, camera_key: &str) -> Vec<(usize, i64)> {
        let Ok(number) = self.number_of(camera_key) else { return Vec::new() };
        let camera = &self.cameras[number];
        let mut cache = self.cache.lock();
        let ImageCache { topics, blocks, .. } = &mut *cache;
        let stamp_ns = |index: usize| {
            let position = topics[number].get(&self.log.index(), self.log.file(), index)?;
            let (block, message) = self.log.message(blocks, position)?;
            let stamp_ns = stamp_ns(camera.kind, block.bytes(&message.data)).ok()?;
            let stamp_ns = camera.clock.stamp_ns(stamp_ns, position.log_time_ns);
            Some((index, relative_ns(stamp_ns, self.log.epoch_ns())))
        };
        let mut stamps: Vec<(usize, i64)> = (0..camera.count).filter_map(stamp_ns).collect();
        stamps.sort_by_key(|(_, stamp_ns)| *stamp_ns);
        stamps
    }

    fn number_of(&self, camera_key: &str) -> Result<usize, UnknownCamera> {
        self.cameras.iter().position(|camera| camera.key == camera_key).ok_or_else(|| {
            let available = self.cameras.iter().map(|camera| camera.key.clone()).collect();
            UnknownCamera { key: camera_key.to_owned(), available }
        })
    }

    /// Returns an image of a camera, numbered as in [`SensorFrame::index`](crate::flight_log::SensorFrame::index).
    pub fn image(&self, camera_key: &str, index: usize) -> Result<Arc<GrayImage>, LogError> {
        let number = self.number_of(camera_key)?;
        let camera = &self.cameras[number];
        let mut cache = self.cache.lock();
        let position = cache.topics[number].get(&self.log.index(), self.log.file(), index);
        let position = position.ok_or_else(|| LogError::NoSuchImage {
            topic: camera.topic.clone(),
            index,
            count: camera.count,
            path: self.log.path().to_owned(),
        })?;
        let key = (number, index);
        if let Some(image) = cached(&mut cache.images, key) {
            return Ok(image);
        }
        let bad = |problem: String| LogError::BadMessage {
            topic: camera.topic.clone(),
            second: seconds_from_ns(self.log.since_start(position.log_time_ns)),
            byte: self.log.index().blocks[position.block].bytes.start,
            problem,
            path: self.log.path().to_owned(),
        };
        if camera.kind.is_video() {
            return cache.frame(&self.log, number, camera.kind, index).map_err(bad);
        }
        let Some((block, message)) = self.log.message(&mut cache.blocks, position) else {
            let block = cache.blocks.get(self.log.file(), &self.log.index().blocks, position.block);
            let damage = block.and_then(|block| block.damage.clone());
            return Err(bad(damage.unwrap_or_else(|| "the index points to no message".into())));
        };
        let data = block.bytes(&message.data);
        let narrowing = camera.grey_levels.at(self.log.since_start(position.log_time_ns));
        let image = decode_image(camera.kind, data, narrowing, self.log.file().limits(), None);
        let image = Arc::new(image.map_err(|problem| bad(problem.to_string()))?);
        if cache.images.len() == IMAGES {
            cache.images.remove(0);
        }
        cache.images.push((key, Arc::clone(&image)));
        Ok(image)
    }
}

/// Returns a cached entry by camera and index, and makes it the most recently used one.
fn cached<V: Clone>(entries: &mut Vec<((usize, usize), V)>, key: (usize, usize)) -> Option<V> {
    let found = entries.iter().position(|(cached, _)| *cached == key)?;
    let entry = entries.remove(found);
    entries.push(entry.clone());
    Some(entry.1)
}

impl ImageCache {
    fn frame(&mut self, log: &FlightLog, camera: usize, kind: MessageKind, index: usize) -> VideoFrame {
        self.decode_frames(log, camera, kind, index, &|| true);
        cached(&mut self.frames, (camera, index)).unwrap_or_else(|| Err("it is not a frame of a video".to_owned()))
    }

    /// Decodes a video up to frame `index`, starting at the last decoded frame or at the keyframe, while `go_on`
    /// returns true.
    /// Returns true if the frame is cached.
    fn decode_frames(
        &mut self,
        log: &FlightLog,
        camera: usize,
        kind: MessageKind,
        index: usize,
        go_on: &dyn Fn() -> bool,
    ) -> bool {
        if cached(&mut self.frames, (camera, index)).is_some() {
            return true;
        }
        let stands = self.streams[camera].next();
        let first = stands.filter(|next| *next == index).unwrap_or_else(|| {
            let keyframe = keyframe_before(log, &mut self.topics[camera], kind, index);
            stands.filter(|next| (keyframe..=index).contains(next)).unwrap_or(keyframe)
        });
        for number in first..=index {
            if !go_on() {
                return false;
            }
            let frame = self.next_frame(log, camera, kind, number).map(Arc::new);
            self.frames.push(((camera, number), frame));
            self.release();
        }
        true
    }

    /// Decodes message `number`, which follows the last decoded one.
    fn next_frame(
        &mut self,
        log: &FlightLog,
        camera: usize,
        kind: MessageKind,
        number: usize,
    ) -> Result<GrayImage, String> {
        let position = self.topics[camera].get(&log.index(), log.file(), number);
        let message = position.and_then(|position| log.message(&mut self.blocks, position));
        let stream = &mut self.streams[camera];
        let Some((block, message)) = message else {
            stream.lose_message();
            return Err("it is in a damaged chunk".into());
        };
        let packet = read_video_packet(kind, block.bytes(&message.data)).map_err(|error| error.to_string());
        let packet = packet.inspect_err(|_| stream.lose_message())?;
        stream.decode(number, &packet, log.file().limits(), None).map_err(|problem| problem.to_string())
    }

    /// Drops the least recently used frames.
    fn release(&mut self) {
        let pixels = |entry: &VideoFrame| entry.as_ref().map_or(1, |image| image.pixels.len());
        let mut held: usize = self.frames.iter().map(|(_, frame)| pixels(frame)).sum();
        let mut released = 0;
        while held > VIDEO_PIXELS && released + 1 < self.frames.len() {
            held -= pixels(&self.frames[released].1);
            released += 1;
        }
        self.frames.drain(..released);
    }
}
