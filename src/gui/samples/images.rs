//! Images for the tests of panels: a shaded checkerboard that moves from frame to frame.

use std::sync::Arc;

use crate::gui::ImageSource;
use crate::sensors::GrayImage;
use crate::session::FrameImage;

const SIZE_PX: [usize; 2] = [640, 480];
/// Size of a field of the checkerboard in pixels.
const FIELD_PX: usize = 40;

/// The image of `cam0` at any frame.
#[derive(Default)]
pub(crate) struct SampleImages {
    /// The image that was asked for last, with its frame.
    last: Option<(usize, Arc<GrayImage>)>,
}

pub(crate) fn sample_images() -> SampleImages {
    SampleImages::default()
}

fn checkerboard(frame_index: usize) -> GrayImage {
    let [width, height] = SIZE_PX;
    let brightness = |row: usize, column: usize| {
        let field = (row / FIELD_PX + (column + frame_index) / FIELD_PX) % 2;
        (60 + 80 * field + 100 * row / height) as u8
    };
    let pixels = (0..width * height).map(|index| brightness(index / width, index % width)).collect();
    GrayImage { width, height, pixels }
}

impl ImageSource for SampleImages {
    fn image(&mut self, camera_key: &str, frame_index: usize) -> FrameImage {
        if camera_key != "cam0" {
            return FrameImage::Missing;
        }
        let known = self.last.take().filter(|(known, _)| *known == frame_index);
        let (_, image) = self.last.insert(known.unwrap_or_else(|| (frame_index, Arc::new(checkerboard(frame_index)))));
        FrameImage::Ready(Arc::clone(image))
    }
}
