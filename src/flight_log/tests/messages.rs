use super::super::grey_levels::Narrowing;
use super::super::messages::{self, MessageKind};
use super::*;
use crate::files::LogLimits;
use crate::files::image_file::ImageProblem;
use crate::flight_log::images::decoding::{self, WideValues};
use crate::flight_log::messages::cdr::{CdrReader, CdrWriter};
use crate::flight_log::writer::testing as encode;

/// Image of a message within the usual limits, or a description of the problem.
fn decode_image(kind: MessageKind, message: &[u8], narrowing: Narrowing) -> Result<GrayImage, String> {
    let limits = LogLimits::default();
    decoding::decode_image(kind, message, narrowing, &limits, None).map_err(|problem| problem.to_string())
}

/// Converts the little-endian bytes of a message with 4- and 8-byte numbers after a header to big-endian.
fn imu_big_endian(stamp: (i32, u32), frame: &str, numbers: &[f64]) -> Vec<u8> {
    let mut out = vec![0, 0, 0, 0];
    out.extend(stamp.0.to_be_bytes());
    out.extend(stamp.1.to_be_bytes());
    out.extend((frame.len() as u32 + 1).to_be_bytes());
    out.extend(frame.as_bytes());
    out.push(0);
    out.resize((out.len() - 4).next_multiple_of(8) + 4, 0);
    out.extend(numbers.iter().flat_map(|number| number.to_be_bytes()));
    out
}

#[test]
fn imu_messages_read_in_both_byte_orders() {
    let (rate, force) = (Vector3::new(0.1, -0.2, 0.3), Vector3::new(1.0, 2.0, -9.81));
    for frame in ["", "imu", "imu_link", "base/imu_0"] {
        let little = encode::imu(EPOCH_NS, frame, &rate, &force);
        let mut numbers = vec![0.0; 37];
        numbers[13..16].copy_from_slice(rate.as_slice());
        numbers[25..28].copy_from_slice(force.as_slice());
        let big = imu_big_endian((1_700_000_000, 250_000_000), frame, &numbers);
        for message in [little, big] {
            let imu = messages::read_imu(&message).unwrap();
            assert_eq!(imu.stamp_ns, EPOCH_NS);
            assert_eq!((imu.angular_velocity_rad_per_s, imu.specific_force_m_per_s2), (rate, force));
        }
    }
}

#[test]
fn messages_cut_anywhere_are_errors_with_an_offset() {
    let whole = encode::imu(EPOCH_NS, "imu", &Vector3::zeros(), &Vector3::zeros());
    let needed = whole.len() - 72; // the last covariance is not read
    for kept in 0..needed {
        let error = messages::read_imu(&whole[..kept]).unwrap_err();
        assert!(error.offset <= kept + 8, "{error}");
    }
    assert!(messages::read_imu(&whole[..needed]).is_ok());
    let image = encode::image(EPOCH_NS, "camera", [4, 2], "mono8", &[7; 8]);
    for kept in 0..image.len() {
        assert!(messages::read_image(&image[..kept]).is_err());
    }
}

#[test]
fn foreign_encapsulations_and_absurd_lengths_are_refused() {
    let error = CdrReader::new(&[0, 7, 0, 0, 1]).unwrap_err().to_string();
    assert!(error.contains("encapsulation 0x00 0x07 instead of plain CDR"), "{error}");
    let mut out = CdrWriter::new();
    out.u32(u32::MAX);
    let message = out.finish();
    let error = CdrReader::new(&message).unwrap().read_f64_sequence().unwrap_err().to_string();
    assert!(error.contains("4294967295 elements in a message of 8 bytes at byte 4"), "{error}");
}

#[test]
fn raw_images_of_every_encoding_become_grey() {
    let decode = |encoding: &str, data: &[u8]| {
        let message = encode::image(0, "camera", [2, 2], encoding, data);
        decode_image(MessageKind::Image, &message, Narrowing::default())
    };
    for encoding in ["mono8", "8UC1"] {
        assert_eq!(decode(encoding, &[1, 2, 3, 4]).unwrap().pixels, [1, 2, 3, 4]);
    }
    assert_eq!(decode("mono16", &[9, 1, 9, 2, 9, 3, 9, 4]).unwrap().pixels, [1, 2, 3, 4]);
    let rgb = [255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
    assert_eq!(decode("rgb8", &rgb).unwrap().pixels, [76, 150, 29, 255]);
    assert_eq!(decode("bgr8", &rgb).unwrap().pixels, [29, 150, 76, 255]);
    assert_eq!(decode("bayer_rggb8", &[255, 0, 0, 0]).unwrap().pixels, [76; 4], "mirrored at the sides");
    let message = encode::image(0, "camera", [1, 1], "bayer_rggb8", &[9]);
    let problem = decode_image(MessageKind::Image, &message, Narrowing::default()).unwrap_err();
    assert!(problem.contains("bayer_rggb8 image of 1×1 pixels"));
    assert!(decode("32FC1", &[0; 16]).unwrap_err().contains("not gray values"));
    assert!(decode("\u{1b}[2J", &[0; 4]).unwrap_err().contains(r#""\u{1b}[2J" is not read: expected mono8"#));
    assert!(decode("mono8", &[0; 2]).unwrap_err().contains("2 bytes with 1 per row for 2×2 mono8"));
}

#[test]
fn values_of_wide_images_are_read_before_their_conversion() {
    let values = [0_u16, 29_500, 30_520, 65_535];
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let gray = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 2, values.to_vec()).unwrap();
    let rgb: Vec<u16> = values.iter().flat_map(|value| [*value; 3]).collect();
    let color = image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(2, 2, rgb).unwrap();
    let png = |image: image::DynamicImage| {
        let mut data = std::io::Cursor::new(Vec::new());
        image.write_to(&mut data, image::ImageFormat::Png).unwrap();
        (
            MessageKind::CompressedImage,
            encode::compressed_image(0, "camera", "16UC1; png compressed", &data.into_inner()),
        )
    };
    let stretched = Narrowing::Range { low: 29_500.0, high: 30_520.0 };
    for (kind, message) in
        [(MessageKind::Image, encode::image(0, "camera", [2, 2], "16UC1", &bytes)), png(gray.into()), png(color.into())]
    {
        let found = decoding::wide_values(kind, &message, &LogLimits::default());
        assert_eq!(found, Some(WideValues::Of(values.to_vec())));
        assert_eq!(decode_image(kind, &message, stretched).unwrap().pixels, [0, 16, 239, 255]);
        assert_eq!(decode_image(kind, &message, Narrowing::default()).unwrap().pixels, [0, 115, 119, 255]);
    }
    let wide_values = |message: &[u8]| decoding::wide_values(MessageKind::Image, message, &LogLimits::default());
    assert_eq!(wide_values(&encode::image(0, "camera", [2, 2], "mono8", &[1, 2, 3, 4])), Some(WideValues::Narrow));
    assert_eq!(wide_values(&encode::image(0, "camera", [2, 2], "mono16", &[1, 2, 3, 4])), None);
}

#[test]
fn compressed_images_are_known_by_their_bytes() {
    let folder = TempDir::new().unwrap();
    let original = image_at(0, [WIDTH, HEIGHT]);
    let gray = image::GrayImage::from_raw(WIDTH as u32, HEIGHT as u32, original.pixels.clone()).unwrap();
    for (format, bound) in [("jpeg", 6), ("png", 0)] {
        let path = folder.path().join(format!("image.{format}"));
        gray.save(&path).unwrap();
        let data = std::fs::read(&path).unwrap();
        let message = encode::compressed_image(0, "camera", "mono8; compressed", &data);
        let decoded = decode_image(MessageKind::CompressedImage, &message, Narrowing::default()).unwrap();
        assert_eq!((decoded.width, decoded.height), (WIDTH, HEIGHT));
        let worst = decoded.pixels.iter().zip(&original.pixels).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst <= bound, "{format}: {worst}");
        let cut = encode::compressed_image(0, "camera", format, &data[..data.len() / 3]);
        let cut = decode_image(MessageKind::CompressedImage, &cut, Narrowing::default());
        assert!(cut.is_err() || format == "jpeg", "a JPEG may be completed in grey");
    }
    let text = encode::compressed_image(0, "camera", "jpeg", b"not an image");
    assert!(
        decode_image(MessageKind::CompressedImage, &text, Narrowing::default())
            .unwrap_err()
            .contains("neither JPEG nor PNG")
    );
}

#[test]
fn poses_of_every_kind_read_back() {
    let pose = true_pose(700 * MS);
    let messages = [
        (MessageKind::Odometry, encode::odometry(EPOCH_NS, &encode::Odometry::at_rest("world", "imu", pose))),
        (MessageKind::PoseStamped, encode::pose_stamped(EPOCH_NS, "world", &pose)),
        (MessageKind::TransformStamped, encode::transform_stamped(EPOCH_NS, "world", "imu", &pose)),
    ];
    for (kind, message) in messages {
        let read = messages::read_pose(kind, &message).unwrap();
        assert_eq!(read.stamp_ns, EPOCH_NS);
        assert!(read.pose.unwrap().minus(&pose).norm() < 1e-14);
    }
    let nowhere = RigidTransform::new(pose.rotation, Vector3::new(f64::NAN, 0.0, 0.0));
    let message = encode::pose_stamped(EPOCH_NS, "world", &nowhere);
    assert_eq!(messages::read_pose(MessageKind::PoseStamped, &message).unwrap().pose, None);
}

#[test]
fn joint_states_read_back() {
    let names = ["roll".to_owned(), "yaw".to_owned()];
    let message = encode::joint_state(EPOCH_NS, &names, &[0.25, -1.5]);
    let joints = messages::read_joint_state(&message).unwrap();
    assert_eq!(
        (joints.stamp_ns, joints.names, joints.positions_rad),
        (EPOCH_NS, vec!["roll", "yaw"], vec![0.25, -1.5])
    );
}

#[test]
fn an_image_is_not_decoded_when_its_header_claims_too_much() {
    let frame = image_at(0, [WIDTH, HEIGHT]);
    let gray = image::GrayImage::from_raw(WIDTH as u32, HEIGHT as u32, frame.pixels).unwrap();
    for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg] {
        let mut data = std::io::Cursor::new(Vec::new());
        gray.write_to(&mut data, format).unwrap();
        let mut data = data.into_inner();
        let (at, bytes_per_side) = match format {
            image::ImageFormat::Png => (16, 4),
            // Height before width, after marker, length and precision.
            _ => (data.windows(2).position(|pair| pair == [0xFF, 0xC0]).unwrap() + 5, 2),
        };
        let expect = |data: &[u8], expected_px: Option<[usize; 2]>| {
            let message = encode::compressed_image(0, "camera", "", data);
            let (kind, narrowing, limits) = (MessageKind::CompressedImage, Narrowing::default(), LogLimits::default());
            decoding::decode_image(kind, &message, narrowing, &limits, expected_px)
        };
        assert!(expect(&data, Some([WIDTH, HEIGHT])).is_ok());
        assert_eq!(expect(&data, Some([1, 1])).unwrap_err(), ImageProblem::OtherResolution([WIDTH, HEIGHT]));
        let mut claim = |side: usize| {
            for place in [at, at + bytes_per_side] {
                data[place..place + bytes_per_side].copy_from_slice(&(side as u64).to_be_bytes()[8 - bytes_per_side..]);
            }
            if format == image::ImageFormat::Png {
                let checksum = crc32fast::hash(&data[12..29]);
                data[29..33].copy_from_slice(&checksum.to_be_bytes());
            }
            expect(&data, None).unwrap_err().to_string()
        };
        let problem = claim(65_500);
        assert!(
            problem.contains("4290250000 pixels, more than the limit") && problem.contains("image-pixels="),
            "{problem}"
        );
        let problem = claim(5000);
        assert!(problem.contains("a header of 5000×5000 pixels"), "{problem}");
    }
    let raw = encode::image(0, "camera", [60_000, 60_000], "mono8", &[0; 16]);
    assert!(
        decode_image(MessageKind::Image, &raw, Narrowing::default()).unwrap_err().contains("--limit image-pixels=")
    );
}

#[test]
fn joints_without_positions_are_described_by_their_content() {
    let check = |positions: &[f64], velocities: &[f64], efforts: &[f64], expected: &str| {
        let mut out = CdrWriter::new();
        out.i32(1);
        out.u32(0);
        out.string("base");
        out.strings(&["yaw".to_owned(), "roll".to_owned()]);
        for values in [positions, velocities, efforts] {
            out.f64_sequence(values);
        }
        let bytes = out.finish();
        let message = messages::read_joint_state(&bytes).unwrap();
        let problem = if message.lacks_positions() { message.length_problem() } else { String::new() };
        assert_eq!(problem, expected);
    };
    check(&[0.1, 0.2], &[], &[], "");
    check(&[0.1], &[], &[], "it names 2 joints and has 1 positions");
    check(&[], &[0.1, 0.2], &[], "it has velocities of 2 joints but no positions");
    check(&[], &[], &[1.0, 2.0], "it has efforts of 2 joints but no positions");
    check(&[], &[0.1, 0.2], &[1.0, 2.0], "it has velocities and efforts of 2 joints but no positions");
}
