//! Images for a window that must not block: images of videos are decoded on a separate thread.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use parking_lot::{Condvar, Mutex};

use crate::flight_log::ImageReader;
use crate::sensors::GrayImage;
use crate::session::plan::SessionError;

/// Longest time that a window waits for an image or a recomputed step; the next image of a video is decoded within it, so
/// that playback shows every image.
pub(super) const WINDOW_WAIT: Duration = Duration::from_millis(25);
/// Number of decoded images that are kept, enough for all panels of a window.
const DELIVERED: usize = 8;

/// Decoding state of a frame's image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameImage {
    Ready(Arc<GrayImage>),
    /// Decoding is in progress: request the image again a little later.
    Decoding,
    /// The image is missing or cannot be decoded.
    Missing,
}

impl FrameImage {
    /// The decoded image, `None` in the other states.
    pub fn ready(self) -> Option<Arc<GrayImage>> {
        match self {
            Self::Ready(image) => Some(image),
            Self::Decoding | Self::Missing => None,
        }
    }
}

type Key = (String, usize);

/// Images of a log. In a log without videos each image is decoded alone, so images are read synchronously; a video is
/// decoded from its last keyframe on, which can take longer than a window may wait.
#[derive(Debug)]
pub(super) struct BackgroundImages {
    reader: Arc<ImageReader>,
    worker: Option<Worker>,
}

#[derive(Debug)]
struct Worker {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<ImageQueue>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct ImageQueue {
    /// Last requested image of each camera that is not delivered yet, the oldest request first.
    wanted: Vec<Key>,
    /// Delivered images, ready or missing, the most recently used last.
    delivered: Vec<(Key, FrameImage)>,
    ended: bool,
}

impl BackgroundImages {
    /// Starts the thread if the log has a video.
    pub(super) fn start(reader: ImageReader) -> Result<Self, SessionError> {
        let reader = Arc::new(reader);
        let worker = reader.has_video().then(|| Worker::start(Arc::clone(&reader))).transpose()?;
        Ok(Self { reader, worker })
    }

    /// Image of a camera; for a video, only if it is decoded within a few milliseconds.
    pub(super) fn image(&self, camera_key: &str, index: usize) -> FrameImage {
        self.image_within(camera_key, index, Some(WINDOW_WAIT))
    }

    /// Image of a camera; blocks until it is decoded.
    pub(super) fn decoded_image(&self, camera_key: &str, index: usize) -> FrameImage {
        self.image_within(camera_key, index, None)
    }

    fn image_within(&self, camera_key: &str, index: usize, time: Option<Duration>) -> FrameImage {
        match &self.worker {
            Some(worker) => worker.image(camera_key, index, time),
            None => self.reader.image(camera_key, index).map_or(FrameImage::Missing, FrameImage::Ready),
        }
    }
}

impl Worker {
    fn start(reader: Arc<ImageReader>) -> Result<Self, SessionError> {
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("video".into()).spawn(move || of_thread.decode(&reader));
        Ok(Self { shared, thread: Some(thread.map_err(|source| SessionError::Thread { source })?) })
    }

    fn image(&self, camera_key: &str, index: usize, time: Option<Duration>) -> FrameImage {
        let key = (camera_key.to_owned(), index);
        let mut state = self.shared.state.lock();
        if state.delivered(&key).is_none() {
            state.want(key.clone());
            self.shared.changed.notify_all();
            let decoding = |state: &mut ImageQueue| state.wanted.contains(&key);
            match time {
                Some(time) => {
                    self.shared.changed.wait_while_for(&mut state, decoding, time);
                }
                None => self.shared.changed.wait_while(&mut state, decoding),
            }
        }
        state.delivered(&key).unwrap_or(FrameImage::Decoding)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.shared.state.lock().ended = true;
        self.shared.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            // The thread has already printed its panic; nothing else has to be done.
            let _printed = thread.join();
        }
    }
}

impl Shared {
    /// Decodes requested images until the session ends. A newer request for a camera cancels the decoding of an older
    /// one.
    fn decode(&self, reader: &ImageReader) {
        loop {
            let mut state = self.state.lock();
            self.changed.wait_while(&mut state, |state| state.wanted.is_empty() && !state.ended);
            if state.ended {
                return;
            }
            let key = state.wanted[0].clone();
            drop(state);
            let is_wanted = || {
                let state = self.state.lock();
                !state.ended && state.wanted.contains(&key)
            };
            if reader.decode_before(&key.0, key.1, &is_wanted) {
                let image = reader.image(&key.0, key.1).map_or(FrameImage::Missing, FrameImage::Ready);
                self.state.lock().deliver(key, image);
                self.changed.notify_all();
            }
        }
    }
}

impl ImageQueue {
    /// Delivered image, `None` if there is none.
    fn delivered(&mut self, key: &Key) -> Option<FrameImage> {
        let found = self.delivered.iter().position(|(delivered, _)| delivered == key)?;
        let entry = self.delivered.remove(found);
        self.delivered.push(entry.clone());
        Some(entry.1)
    }

    /// Requests an image; replaces the previous request for the same camera.
    fn want(&mut self, key: Key) {
        self.wanted.retain(|(camera, _)| *camera != key.0);
        self.wanted.push(key);
    }

    fn deliver(&mut self, key: Key, image: FrameImage) {
        self.wanted.retain(|wanted| *wanted != key);
        self.delivered.push((key, image));
        let surplus = self.delivered.len().saturating_sub(DELIVERED);
        self.delivered.drain(..surplus);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_log::tests::video::{crc32, sample_video};

    /// Requests an image until it is decoded, as a window does at every frame.
    fn shown(images: &BackgroundImages, index: usize) -> Option<Arc<GrayImage>> {
        loop {
            match images.image("cam0", index) {
                FrameImage::Ready(image) => return Some(image),
                FrameImage::Decoding => {}
                FrameImage::Missing => return None,
            }
        }
    }

    #[test]
    fn a_window_sees_the_images_of_a_video_in_any_order() {
        let folder = tempfile::TempDir::new().unwrap();
        let (log, rig, expected) = sample_video(folder.path());
        let images = BackgroundImages::start(ImageReader::new(log, &rig)).unwrap();
        assert!(images.worker.is_some());
        for index in [0, 1, 2, 23, 22, 7, 15, 8, 23] {
            assert_eq!(crc32(&shown(&images, index).unwrap()), expected[index], "{index}");
            assert_eq!(images.decoded_image("cam0", index).ready().map(|image| crc32(&image)), Some(expected[index]));
        }
        assert_eq!(shown(&images, 24), None);
        assert_eq!(images.decoded_image("cam7", 0), FrameImage::Missing);
    }

    #[test]
    fn a_newer_request_replaces_an_older_one() {
        let state = |wanted: &[(&str, usize)]| ImageQueue {
            wanted: wanted.iter().map(|(camera, index)| ((*camera).to_owned(), *index)).collect(),
            ..ImageQueue::default()
        };
        let mut waiting = state(&[("cam0", 3), ("cam1", 9)]);
        waiting.want(("cam0".to_owned(), 4));
        assert_eq!(waiting.wanted, state(&[("cam1", 9), ("cam0", 4)]).wanted);
        waiting.deliver(("cam0".to_owned(), 4), FrameImage::Missing);
        assert_eq!(waiting.wanted, state(&[("cam1", 9)]).wanted);
        assert_eq!(waiting.delivered(&("cam0".to_owned(), 4)), Some(FrameImage::Missing));
        for index in 0..DELIVERED {
            waiting.deliver(("cam1".to_owned(), index), FrameImage::Missing);
        }
        assert_eq!(waiting.delivered(&("cam0".to_owned(), 4)), None, "only the last ones are kept");
    }
}
