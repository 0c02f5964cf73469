//! Images of 16 bits: their conversion is the same however an image is reached.

use super::*;
use crate::flight_log::ImageReader;
use crate::flight_log::images::grey_sampling::grey_levels_of_topic;
use crate::flight_log::messages::MessageKind;
use crate::flight_log::writer::LogCompression;

const TOPIC: &str = "/camera";

/// Log of 9 s with images of 16 bits; `value` gives the value of a pixel at a column in 0..64, at a time in seconds.
fn write_log(path: &Path, value: fn(u16, f64) -> u16) {
    let options = LogWriterOptions { compression: LogCompression::None, ..LogWriterOptions::default() };
    let mut writer = LogWriter::create(path, &options).unwrap();
    for millisecond in (0..9000).step_by(5) {
        let at = EPOCH_NS + millisecond * MS;
        let times = MessageTimes { stamp_ns: at, log_time_ns: at + MS };
        writer.write_imu("/imu", "imu", times, &Vector3::zeros(), &Vector3::z()).unwrap();
        if millisecond % 50 == 25 {
            let time_s = millisecond as f64 * 1e-3;
            let values = (0..HEIGHT).flat_map(|_| (0..WIDTH as u16).map(|column| value(column, time_s)));
            let data: Vec<u8> = values.flat_map(u16::to_le_bytes).collect();
            writer.write_raw_image(TOPIC, "camera", times, [WIDTH, HEIGHT], "mono16", &data).unwrap();
        }
    }
    writer.finish().unwrap();
}

fn rig() -> Rig {
    rig_from(
        &RIG.replace("  rostopic: /joints\n", "  rostopic: null\n").replace("ground_truth: {rostopic: /truth}\n", ""),
    )
}

/// Conversion and decoded images of a log, which are the same from the stream and from random access.
fn decoded(value: fn(u16, f64) -> u16) -> (FlightLog, Vec<Vec<u8>>) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("flight.mcap");
    write_log(&path, value);
    let images = |start_s: f64| {
        // A log of its own, so that nothing is known from earlier reading.
        let log = Arc::new(FlightLog::open(&path).unwrap());
        let mut stream = FrameStream::new(log, &rig(), "cam0", start_s, None).unwrap();
        let mut images = Vec::new();
        while let Some(frame) = stream.next_frame() {
            images.push((frame.index, frame.image.pixels.clone()));
        }
        images
    };
    let all = images(0.0);
    assert!(all.len() > 170, "{} images", all.len());
    let late = images(5.0);
    assert!((70..90).contains(&late.len()), "{} images", late.len());
    assert!(late.iter().all(|image| all.contains(image)), "an image depends on the start of reading");
    let reader = ImageReader::new(Arc::new(FlightLog::open(&path).unwrap()), &rig());
    for (index, pixels) in all.iter().rev() {
        assert_eq!(&reader.image("cam0", *index).unwrap().pixels, pixels, "image {index}");
    }
    let log = FlightLog::open(&path).unwrap();
    (log, all.into_iter().map(|(_, pixels)| pixels).collect())
}

#[test]
fn a_thermal_camera_keeps_its_contrast_while_its_range_drifts() {
    let value = |column: u16, time_s: f64| 29_500 + 15 * column + (100.0 * time_s) as u16;
    let (log, images) = decoded(value);
    let levels = grey_levels_of_topic(&log, TOPIC, MessageKind::Image);
    let [low, high, ..] = levels.stretched().unwrap();
    assert!((29_500.0..29_700.0).contains(&low) && (31_100.0..31_400.0).contains(&high), "{low} to {high}");
    for pixels in &images {
        let (dark, bright) = (pixels[0], pixels[WIDTH - 1]);
        assert!(dark < 60 && bright > 195, "{dark} to {bright}");
    }
    let changes = images.windows(2).map(|pair| pair[0][WIDTH / 2].abs_diff(pair[1][WIDTH / 2]));
    assert!(changes.max().unwrap() <= 3, "brightness jumps");
}

#[test]
fn a_camera_of_12_bits_keeps_its_upper_eight() {
    let (log, images) = decoded(|column, _| 64 * column + 63);
    let levels = grey_levels_of_topic(&log, TOPIC, MessageKind::Image);
    assert_eq!((levels.bits(), levels.stretched()), (12, None));
    let expected: Vec<u8> = (0..WIDTH * HEIGHT).map(|pixel| (4 * (pixel % WIDTH) + 3) as u8).collect();
    assert!(images.iter().all(|pixels| *pixels == expected));
}

#[test]
fn a_dark_first_image_does_not_saturate_the_others() {
    let (log, images) = decoded(|column, time_s| if time_s < 1.0 { column / 8 } else { 64 * column });
    assert_eq!(grey_levels_of_topic(&log, TOPIC, MessageKind::Image).bits(), 12);
    assert_eq!(images.last().unwrap()[..3], [0, 4, 8]);
}
