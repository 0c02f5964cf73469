//! Images of one camera: decoding, gaps, and copies of the image before.

use std::sync::Arc;

use super::super::grey_levels::GreyLevels;
use super::super::log::relative_ns;
use super::super::messages::{self, MessageKind};
use super::super::video::VideoStream;
use super::super::{FlightLog, LogError, WarningKind};
use super::gaps::GapWatch;
use super::ordered::{Decoder, MessageSource, OrderedSamples};
use super::read_context::{ReadContext, Refusal};
use crate::files::image_file::ImageProblem;
use crate::flight_log::images::copies::CopyJudge;
use crate::flight_log::images::decoding::decode_image;
use crate::flight_log::images::grey_sampling::grey_levels_of_topic;
use crate::flight_log::stamps::clock::StampClock;
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use crate::sensors::{CameraRig, GrayImage};

/// Image message that is not decoded yet.
pub(super) struct PendingImage {
    pub(super) number: usize,
    pub(super) log_time_ns: i64,
    content: ImageContent,
}

/// Images are decoded on demand, video frames in the order of their messages.
enum ImageContent {
    Message(Vec<u8>),
    Decoded(GrayImage),
}

/// Topic of a camera with its expected rate and size.
pub(super) struct CameraStream {
    images: OrderedSamples<PendingImage>,
    /// Number of images in the log, when it was opened.
    count: usize,
    pub(super) topic: String,
    pub(super) key: String,
    pub(super) shift_ns: i64,
    kind: MessageKind,
    grey_levels: Arc<GreyLevels>,
    resolution_px: [usize; 2],
    gaps: GapWatch,
    /// Image that was decoded last.
    previous: Option<Arc<GrayImage>>,
    copies: CopyJudge,
}

impl CameraStream {
    /// Reads the images with log times at or after `from_ns` since the start of the log.
    pub(super) fn new(log: &FlightLog, camera: &CameraRig, from_ns: i64) -> Result<Self, LogError> {
        let info = log.require_topic(&format!("{}.rostopic", camera.key), &camera.topic, &MessageKind::IMAGES)?;
        let kind = info.kind.unwrap_or(MessageKind::Image);
        let images = if kind.is_video() {
            let decoder = video_decoder(log, kind, camera);
            OrderedSamples::new(log, &camera.topic, from_ns, true, decoder).starting_at_keyframe(log, kind)
        } else {
            let decoder = image_decoder(kind, log.epoch_ns(), StampClock::of_rig(camera.use_log_time));
            OrderedSamples::new(log, &camera.topic, from_ns, true, decoder)
        };
        Ok(Self {
            images,
            count: info.count as usize,
            topic: camera.topic.clone(),
            key: camera.key.clone(),
            shift_ns: ns_from_seconds(camera.timeshift_cam_imu_s),
            kind,
            grey_levels: grey_levels_of_topic(log, &camera.topic, kind),
            resolution_px: camera.model.resolution_px,
            gaps: GapWatch::new(WarningKind::ImageGap, &camera.topic, camera.rate_hz),
            previous: None,
            copies: CopyJudge::default(),
        })
    }

    /// Number of images in the log; of a log that is being written, so far.
    pub(super) fn count(&mut self, context: &ReadContext) -> usize {
        if context.log.is_followed() { self.images.count(&context.log) } else { self.count }
    }

    /// Next image with its stamp since the start of the log, in camera time.
    pub(super) fn next(&mut self, context: &mut ReadContext) -> Option<(i64, PendingImage)> {
        self.images.next(context)
    }

    /// Reports the gap before an image.
    pub(super) fn check_gap(&mut self, context: &mut ReadContext, stamp_ns: i64) {
        self.gaps.push(context, stamp_ns);
    }

    /// Reports the last gaps.
    pub(super) fn finish(&mut self, context: &mut ReadContext) {
        self.gaps.finish(context);
    }

    /// Decoded image, or `None` and a warning with the reason why it is skipped. An image of one grey value shows nothing
    /// and is no copy.
    pub(super) fn decode(
        &mut self,
        context: &mut ReadContext,
        stamp_ns: i64,
        pending: PendingImage,
        rotates: bool,
    ) -> Option<Arc<GrayImage>> {
        let number = pending.number;
        let image = self.decode_any(context, stamp_ns, pending)?;
        let varies = image.pixels.first().is_some_and(|first| image.pixels.iter().any(|pixel| pixel != first));
        if self.copies.is_copy(varies && self.previous.as_ref() == Some(&image), rotates) {
            let message = self.skipped(number, stamp_ns, "it is a copy of the image before");
            context.warn(WarningKind::ImageCopy, &self.topic, stamp_ns, message);
            return None;
        }
        self.previous = Some(Arc::clone(&image));
        Some(image)
    }

    /// Decoded image, also if it is a copy of the image before; `None` and a warning if it cannot be decoded.
    pub(super) fn decode_any(
        &self,
        context: &mut ReadContext,
        stamp_ns: i64,
        pending: PendingImage,
    ) -> Option<Arc<GrayImage>> {
        let decoded = match pending.content {
            ImageContent::Decoded(image) => Ok(image),
            ImageContent::Message(message) => {
                let limits = context.log.file().limits();
                let narrowing = self.grey_levels.at(pending.log_time_ns);
                decode_image(self.kind, &message, narrowing, limits, Some(self.resolution_px))
            }
        };
        let problem = match decoded {
            Ok(image) => return Some(Arc::new(image)),
            Err(problem) => problem,
        };
        let kind = match problem {
            ImageProblem::OtherResolution(_) => WarningKind::ImageSize,
            ImageProblem::Unreadable(_) => WarningKind::ImageUnreadable,
        };
        let problem = problem_text(problem, self.resolution_px, &self.key);
        context.warn(kind, &self.topic, stamp_ns, self.skipped(pending.number, stamp_ns, &problem));
        None
    }

    /// Text of a warning about an image that is skipped.
    fn skipped(&self, number: usize, stamp_ns: i64, problem: &str) -> String {
        format!("{}: image {number} at {:.3} s skipped: {problem}", self.topic, seconds_from_ns(stamp_ns))
    }
}

/// Description of a problem with a camera's image.
fn problem_text(problem: ImageProblem, resolution_px: [usize; 2], key: &str) -> String {
    match problem {
        ImageProblem::OtherResolution([width, height]) => {
            format!("it has {width}×{height} pixels, {}×{} in the rig for {key}", resolution_px[0], resolution_px[1])
        }
        ImageProblem::Unreadable(problem) => problem,
    }
}

/// Decodes the frames of a video topic; a skipped number is an unreadable message.
fn video_decoder(log: &FlightLog, kind: MessageKind, camera: &CameraRig) -> Decoder<PendingImage> {
    let (epoch_ns, limits) = (log.epoch_ns(), log.file().limits().clone());
    let (resolution_px, key) = (camera.model.resolution_px, camera.key.clone());
    let clock = StampClock::of_rig(camera.use_log_time);
    let mut stream = VideoStream::default();
    Box::new(move |source: MessageSource<'_>| {
        let packet = messages::read_video_packet(kind, source.data).map_err(|error| Refusal::not_decodable(&error));
        let packet = packet.inspect_err(|_| stream.lose_message())?;
        let image = stream.decode(source.number, &packet, &limits, Some(resolution_px)).map_err(|problem| Refusal {
            reason: "the frame cannot be decoded",
            detail: problem_text(problem, resolution_px, &key),
        })?;
        let content = ImageContent::Decoded(image);
        Ok((clock.stamp_ns(packet.stamp_ns, source.position.log_time_ns), pending(&source, epoch_ns, content)))
    })
}

fn image_decoder(kind: MessageKind, epoch_ns: i64, clock: StampClock) -> Decoder<PendingImage> {
    Box::new(move |source: MessageSource<'_>| {
        let stamp_ns = messages::stamp_ns(kind, source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let content = ImageContent::Message(source.data.to_vec());
        Ok((clock.stamp_ns(stamp_ns, source.position.log_time_ns), pending(&source, epoch_ns, content)))
    })
}

fn pending(source: &MessageSource<'_>, epoch_ns: i64, content: ImageContent) -> PendingImage {
    let log_time_ns = relative_ns(i64::try_from(source.position.log_time_ns).unwrap_or(i64::MAX), epoch_ns);
    PendingImage { number: source.number, log_time_ns, content }
}
