"""The detector on rendered frames: reach, range error, ghosts, and time against plain OpenCV and pupil-apriltags.

    python benchmarks/bench_vision_detector.py [--frames 20] [--bare 200] [--poor]

640x480, fx = 600, tag 0.166 m, noise 5, blur 0.7 px, tilt 0 to 30 degrees; poor pictures have a tag of 0.30 m, and a
motion, little light or a soft lens. Times are of the processor, in ms a frame. pupil-apriltags, if it is installed,
runs in a process of its own: it has taken whole programs down.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from mavproxy_vision.apriltag.detector import Detector, DetectorOptions, motion
from mavproxy_vision.camera.renderer import Look, PlacedTag, Renderer
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector

MODEL, SIZE, MOUNT = CameraModel(), 0.166, Mount()
DISTANCES = (4, 5, 6, 7, 8, 9)
SHARP = Look()
POOR_SIZE = 0.30  # m
# By name: the look, and the motion in px.
POOR = {
    "motion of 3 px": (SHARP, 3.0),
    "motion of 5 px": (SHARP, 5.0),
    "8 % of the light": (Look(exposure=0.08, noise=3.0), 0.0),
    "5 % of the light": (Look(exposure=0.05, noise=3.0), 0.0),
    "a soft lens": (Look(blur=1.3), 0.0),
}
FAMILIES = ("36h11", "25h9", "16h5")
PUPIL = """
import sys, time, json, numpy
from pupil_apriltags import Detector
frames = numpy.load(sys.argv[1])
detector = Detector(families="tag" + sys.argv[2], nthreads=1, quad_decimate=float(sys.argv[3]))
for frame in frames[:5]:
    detector.detect(frame)
began = time.process_time()
hits = sum(any(d.tag_id == 0 and d.hamming <= 2 for d in detector.detect(frame)) for frame in frames)
print(json.dumps([hits, (time.process_time() - began) / len(frames)]))
"""


def frames(
    family: str, distance: float, count: int, *, size: float = SIZE, look: Look = SHARP, moved: float = 0.0
) -> tuple[list[Any], list[float]]:
    """Frames of a tag, through a motion of `moved` px in any direction, and how far away it truly is in each."""
    seed = round(distance)
    chance = np.random.default_rng(seed)
    still = replace(look, noise=0.0) if moved else look  # the noise is not blurred by the motion
    renderer = Renderer(MODEL, MOUNT, (PlacedTag(family, 0, size, 0, 0),), still, seed)
    images, ranges = [], []
    for _ in range(count):
        attitude = Attitude(np.radians(chance.uniform(0, 30)), 0.0, chance.uniform(-3.1, 3.1))
        place = -(attitude.matrix @ vector(0, 0, distance))
        place[:2] += chance.uniform(-0.12, 0.12, 2) * distance
        image = renderer.render(place, attitude)
        if moved:
            blurred = cv2.filter2D(image, cv2.CV_32F, motion(moved, chance.uniform(0, np.pi)))
            image = np.clip(blurred + chance.normal(0, look.noise, image.shape), 0, 255).astype(np.uint8)
        images.append(image)
        ranges.append(float(np.linalg.norm(place)))
    return images, ranges


def timed(look: Callable[[Any], Any], images: list[Any]) -> tuple[list[Any], float]:
    """What it saw in each, and ms a frame; what it does but once for a size of tags, at first, is not counted."""
    for image in images:
        look(image)
    began = time.process_time()
    seen = [look(image) for image in images]
    return seen, 1000 * (time.process_time() - began) / len(images)


def pupil(images: list[Any], family: str, file: str, decimate: float = 1.0) -> tuple[float, float]:
    """Share of hits and ms a frame; NaN where it is not installed."""
    np.save(file, np.stack(images))
    command = [sys.executable, "-c", PUPIL, file, family, str(decimate)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return float("nan"), float("nan")
    hits, seconds = json.loads(done.stdout)
    return hits / len(images), 1000 * seconds


def reach(count: int, file: str) -> None:
    """Hits, range error and time by family and distance."""
    for family in FAMILIES:
        plain = cv2.aruco.ArucoDetector(
            cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_APRILTAG_{family}"))
        )
        ours = Detector(MODEL, DetectorOptions((family,), {0: SIZE}))
        far = Detector(MODEL, DetectorOptions((family,), {0: SIZE}, far=True))
        print(f"\n{family:6} hits: default, far, plain, pupil | range error: default, far (m) | ms: the same four")
        for distance in DISTANCES:
            images, ranges = frames(family, distance, count)
            near_seen, near_ms = timed(ours.detect, images)
            far_seen, far_ms = timed(far.detect, images)
            plain_seen, plain_ms = timed(plain.detectMarkers, images)
            other = pupil(images, family, file)
            errors = []
            for seen in (near_seen, far_seen):
                off = [one[0].distance - true for one, true in zip(seen, ranges, strict=True) if one]
                errors.append(f"{np.mean(off):+.3f}" if off else "   -  ")
            shares = [sum(map(bool, seen)) / count for seen in (near_seen, far_seen)]
            shares.append(sum(ids is not None for _, ids, _ in plain_seen) / count)
            shares.append(other[0])
            millis = [near_ms, far_ms, plain_ms, other[1]]
            hits = " ".join(f"{share:5.2f}" for share in shares)
            print(
                f"{distance:3} m  {hits} | {' '.join(errors)} | {' '.join(f'{ms:6.2f}' for ms in millis)}", flush=True
            )


def poor(count: int, file: str) -> None:
    """Hits and time in poor pictures; pupil-apriltags with and without a halved picture."""
    print("\n36h11, poor pictures: hits: default, far, pupil, pupil decimate 2 | ms: the same four")
    options = DetectorOptions(("36h11",), {0: POOR_SIZE})
    for name, (look, moved) in POOR.items():
        for distance in (6, 8, 10):
            images, _ = frames("36h11", distance, count, size=POOR_SIZE, look=look, moved=moved)
            found = []
            for chosen in (options, replace(options, far=True)):
                seen, ms = timed(Detector(MODEL, chosen).detect, images)
                found.append((sum(map(bool, seen)) / count, ms))
            found += [pupil(images, "36h11", file, decimate) for decimate in (1.0, 2.0)]
            hits, millis = (" ".join(f"{one[part]:6.2f}" for one in found) for part in (0, 1))
            print(f"{name:18} {distance:3} m  {hits} | {millis}", flush=True)


def ghosts(count: int) -> None:
    """Tags seen where there are none."""
    chance = np.random.default_rng(77)
    renderer = Renderer(MODEL, MOUNT, (), Look(), 5)
    detectors = {name: Detector(MODEL, DetectorOptions((name,), {0: SIZE})) for name in (*FAMILIES, "36h10")}
    false_frames = dict.fromkeys(detectors, 0)
    for _ in range(count):
        place = vector(*chance.uniform(-60, 60, 2), -chance.uniform(0.5, 15))
        image = renderer.render(place, Attitude(*chance.uniform(-0.4, 0.4, 2), chance.uniform(-3.1, 3.1)))
        for name, detector in detectors.items():
            false_frames[name] += bool(detector.detect(image))
    print(f"\nfalse frames of {count} without a tag: {false_frames}")


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--bare", type=int, default=200)
    parser.add_argument("--poor", action="store_true", help="poor pictures only")
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder, "frames.npy"))
        if not chosen.poor:
            reach(chosen.frames, file)
        poor(chosen.frames, file)
    if not chosen.poor:
        ghosts(chosen.bare)
    return 0


if __name__ == "__main__":
    sys.exit(main())
