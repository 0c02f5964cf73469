use std::sync::Arc;

use parking_lot::Mutex;

use super::container::{BlockCache, TopicIndex};
use super::image_decoding::{BitDepth, decode_image};
use super::messages::MessageKind;
use super::{FlightLog, LogError};
use crate::geometry::seconds_from_ns;
use crate::sensors::{GrayImage, Rig, UnknownCamera};

/// Number of cached blocks, so that adjacent images do not decompress their chunk again.
const BLOCKS: usize = 2;
/// Number of cached images.
const IMAGES: usize = 8;

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
    depth: BitDepth,
    count: usize,
}

#[derive(Debug)]
struct ImageCache {
    /// Messages by camera.
    topics: Vec<TopicIndex>,
    blocks: BlockCache,
    /// Cached images by camera and index; the most recently used is the last.
    images: Vec<((usize, usize), Arc<GrayImage>)>,
}

impl ImageReader {
    /// Finds the images of all cameras of a rig that the log has.
    pub fn new(log: Arc<FlightLog>, rig: &Rig) -> Self {
        let cameras: Vec<CameraImages> = rig
            .cameras
            .iter()
            .filter_map(|camera| {
                let info = log.topic(&camera.topic)?;
                let kind = info.kind.filter(|kind| kind.is_image())?;
                let (key, topic) = (camera.key.clone(), camera.topic.clone());
                let depth = BitDepth::of_topic(&log, &topic, kind);
                Some(CameraImages { key, topic, kind, depth, count: info.count as usize })
            })
            .collect();
        let topics = cameras.iter().map(|camera| log.topic_index(&camera.topic)).collect();
        let cache = ImageCache { topics, blocks: BlockCache::new(BLOCKS), images: Vec::with_capacity(IMAGES + 1) };
        Self { log, cameras, cache: Mutex::new(cache) }
    }

    /// Number of images of a camera in the log, damaged ones included; 0 for a camera that is not in the log.
    pub fn count(&self, camera_key: &str) -> usize {
        self.cameras.iter().find(|camera| camera.key == camera_key).map_or(0, |camera| camera.count)
    }

    /// One image of one camera, numbered as in [`SensorFrame::index`](super::SensorFrame::index).
    pub fn image(&self, camera_key: &str, index: usize) -> Result<Arc<GrayImage>, LogError> {
        let number = self.cameras.iter().position(|camera| camera.key == camera_key).ok_or_else(|| {
            let available = self.cameras.iter().map(|camera| camera.key.clone()).collect();
            UnknownCamera { key: camera_key.to_owned(), available }
        })?;
        let camera = &self.cameras[number];
        let mut cache = self.cache.lock();
        let position = cache.topics[number].get(self.log.index(), self.log.file(), index);
        let position = position.ok_or_else(|| LogError::NoSuchImage {
            topic: camera.topic.clone(),
            index,
            count: camera.count,
            path: self.log.path().to_owned(),
        })?;
        let key = (number, index);
        if let Some(found) = cache.images.iter().position(|(cached, _)| *cached == key) {
            let entry = cache.images.remove(found);
            let image = Arc::clone(&entry.1);
            cache.images.push(entry);
            return Ok(image);
        }
        let bad = |problem: String| LogError::BadMessage {
            topic: camera.topic.clone(),
            second: seconds_from_ns(self.log.since_start(position.log_time_ns)),
            byte: self.log.index().blocks[position.block].bytes.start,
            problem,
            path: self.log.path().to_owned(),
        };
        let Some((block, message)) = self.log.message(&mut cache.blocks, position) else {
            let block = cache.blocks.get(self.log.file(), &self.log.index().blocks, position.block);
            let damage = block.and_then(|block| block.damage.clone());
            return Err(bad(damage.unwrap_or_else(|| "the index points to no message".into())));
        };
        let data = block.bytes(&message.data);
        let image = decode_image(camera.kind, data, camera.depth, self.log.file().limits(), None);
        let image = Arc::new(image.map_err(|problem| bad(problem.to_string()))?);
        if cache.images.len() == IMAGES {
            cache.images.remove(0);
        }
        cache.images.push((key, Arc::clone(&image)));
        Ok(image)
    }
}
