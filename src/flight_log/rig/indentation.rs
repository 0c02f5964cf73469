//! Rig files whose lines have lost their indentation, as by copying from a web page.

use std::path::Path;

use super::super::LogError;
use super::keys;

/// Returns an error if a key of a camera, an IMU or a gimbal is not indented below it, so that it does not belong to
/// it. `text` is the text of the file.
pub(super) fn check(text: &str, file: &Path) -> Result<(), LogError> {
    let mut mapping: Option<&str> = None;
    // Number of brackets that are open at the start of a line.
    let mut open = 0_usize;
    for (number, line) in (1..).zip(text.lines()) {
        let content = line.split(" #").next().unwrap_or_default().trim_end();
        let is_inside = open > 0;
        for letter in content.chars() {
            match letter {
                '[' | '{' => open += 1,
                ']' | '}' => open = open.saturating_sub(1),
                _ => {}
            }
        }
        if is_inside || !content.starts_with(|letter: char| letter.is_ascii_alphabetic()) {
            continue;
        }
        let Some((key, value)) = content.split_once(':') else { continue };
        let key = key.trim_end();
        if keys::is_of_root(key) {
            mapping = value.trim().is_empty().then_some(key);
        } else if let Some(mapping) = mapping.filter(|mapping| keys::is_of_mapping(key, mapping)) {
            return Err(LogError::Rig {
                field: mapping.to_owned(),
                problem: format!(
                    "the lines under {mapping}: are not indented (line {number}: '{key}'), so that they do not belong to it; \
                     indent all of them by the same number of spaces"
                ),
                path: file.to_owned(),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(text: &str) -> Option<String> {
        check(text, Path::new("some.yaml")).err().map(|error| error.to_string())
    }

    #[test]
    fn lost_indentation_is_reported_with_its_line() {
        let expected = "cam0: the lines under cam0: are not indented (line 2: 'T_cam_imu'), so that they do not belong to it; \
                        indent all of them by the same number of spaces: some.yaml";
        let text =
            "cam0:\nT_cam_imu:\n- [0.0, 1.0]\n- [1.0, 0.0]\ncamera_model: pinhole\ncam1:\nT_cam_imu:\n- [1, 0]\n";
        assert_eq!(problem(text).unwrap(), expected);
        assert_eq!(problem(&text.replace('\n', "\r\n")).unwrap(), expected);
        let last = problem("imu0:\n  rostopic: /imu\nupdate_rate: 200.0\n").unwrap();
        assert!(last.starts_with("imu0: the lines under imu0: are not indented (line 3: 'update_rate')"), "{last}");
        let gimbal = problem("rig_version: 1\ngimbal: # the chain\nrostopic: /joints\n").unwrap();
        assert!(gimbal.contains("line 3: 'rostopic'"), "{gimbal}");
    }

    #[test]
    fn indented_and_flat_files_are_left_alone() {
        for text in [
            "cam0:\n  T_cam_imu:\n  - [0.0, 1.0]\n  rostopic: /cam\nimu0: {rostopic: /imu,\nupdate_rate: 200.0}\n",
            "rostopic: /imu\nupdate_rate: 200.0\n",
            "gimbal:\nground_truth: {rostopic: /truth}\nassumed:\n",
            "cam0:\n  T_cam_imu: [[1, 0],\n[0, 1]]\n",
            "",
        ] {
            assert_eq!(problem(text), None, "{text}");
        }
    }
}
