"""Processor time per image that OpenCV needs on one thread to decode the JPEG images of a log and to track 150 corners.

`unit.py LOG` prints milliseconds per image, the mean over the images of all cameras. The front end is that of VINS-Fusion with its options: calcOpticalFlowPyrLK
with windows of 21x21 pixels and a maximum level of 3, back again from the found positions with a maximum level of 1, and
goodFeaturesToTrack for the missing corners in addition to the tracked ones. Reading the log is not counted.
"""

import sys
import time

import cv2
import numpy as np
from mcap.reader import make_reader

CORNERS = 150
QUALITY = 0.01
MIN_DISTANCE_PX = 30
WINDOW_PX = (21, 21)
MAX_LEVEL = 3
MAX_LEVEL_BACK = 1
MAX_BACK_ERROR_PX = 0.5
STEPS_BACK = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 30, 0.01)


def jpeg_images(log):
    """The JPEG bytes of compressed images by topic, in the order of the log."""
    images = {}
    with open(log, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if schema.name.endswith("CompressedImage"):
                jpeg = message.data[message.data.index(b"\xff\xd8") :]
                images.setdefault(channel.topic, []).append(np.frombuffer(jpeg, np.uint8))
    if not images:
        sys.exit(f"{log}: no compressed images")
    return images


def track(previous, image, corners):
    """The positions of corners of the previous image in this one; those that are lost are left out."""
    if len(corners) == 0:
        return corners
    found, status, _ = cv2.calcOpticalFlowPyrLK(previous, image, corners, None, winSize=WINDOW_PX, maxLevel=MAX_LEVEL)
    back, status_back, _ = cv2.calcOpticalFlowPyrLK(
        image,
        previous,
        found,
        corners.copy(),
        winSize=WINDOW_PX,
        maxLevel=MAX_LEVEL_BACK,
        criteria=STEPS_BACK,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    error_px = np.linalg.norm(back - corners, axis=2).ravel()
    is_good = (status.ravel() == 1) & (status_back.ravel() == 1) & (error_px <= MAX_BACK_ERROR_PX)
    height, width = image.shape
    x, y = found[:, 0, 0], found[:, 0, 1]
    return found[is_good & (x >= 1) & (y >= 1) & (x < width - 1) & (y < height - 1)]


def fill_up(image, corners):
    """The corners with new ones at a distance from them, up to the wanted number."""
    missing = CORNERS - len(corners)
    if missing <= 0:
        return corners
    mask = np.full(image.shape, 255, np.uint8)
    for x, y in corners[:, 0]:
        cv2.circle(mask, (int(round(x)), int(round(y))), MIN_DISTANCE_PX, 0, -1)
    new = cv2.goodFeaturesToTrack(image, missing, QUALITY, MIN_DISTANCE_PX, mask=mask)
    return corners if new is None else np.concatenate([corners, new.reshape(-1, 1, 2)])


def decode_and_track(images):
    """Tracks corners through the images of one camera."""
    previous, corners = None, np.empty((0, 1, 2), np.float32)
    for data in images:
        image = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
        if previous is not None:
            corners = track(previous, image, corners)
        corners = fill_up(image, corners)
        previous = image


def main():
    cameras = jpeg_images(sys.argv[1])
    cv2.setNumThreads(1)
    begin_s = time.process_time()
    for images in cameras.values():
        decode_and_track(images)
    print((time.process_time() - begin_s) * 1e3 / sum(map(len, cameras.values())))


main()
