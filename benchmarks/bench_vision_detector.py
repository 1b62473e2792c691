"""The detector on rendered frames: reach, range error, ghosts, and time against plain OpenCV and pupil-apriltags.

    python benchmarks/bench_vision_detector.py [--frames 20] [--bare 200]

640x480, fx = 600, tag 0.166 m, noise 5, blur 0.7 px, tilt 0 to 30 degrees. Times are of the processor, in ms a
frame. pupil-apriltags, where it is installed, runs in a process of its own: it has taken whole programs down.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from mavproxy_vision.apriltag.detector import Detector, DetectorOptions
from mavproxy_vision.camera.renderer import Look, PlacedTag, Renderer
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Mount, vector

MODEL, SIZE, MOUNT = CameraModel(), 0.166, Mount()
DISTANCES = (4, 5, 6, 7, 8, 9)
WARM_UP = 5  # frames
FAMILIES = ("36h11", "25h9", "16h5")
PUPIL = """
import sys, time, json, numpy
from pupil_apriltags import Detector
frames = numpy.load(sys.argv[1])
detector = Detector(families="tag" + sys.argv[2], nthreads=1, quad_decimate=1.0)
for frame in frames[:5]:
    detector.detect(frame)
began = time.process_time()
hits = sum(any(d.tag_id == 0 and d.hamming <= 2 for d in detector.detect(frame)) for frame in frames)
print(json.dumps([hits, (time.process_time() - began) / len(frames)]))
"""


def frames(family: str, distance: float, count: int, seed: int) -> tuple[list[Any], list[float]]:
    """Frames of a tag, and how far away it truly is in each."""
    chance = np.random.default_rng(seed)
    renderer = Renderer(MODEL, MOUNT, (PlacedTag(family, 0, SIZE, 0, 0),), Look(), seed)
    images, ranges = [], []
    for _ in range(count):
        attitude = Attitude(np.radians(chance.uniform(0, 30)), 0.0, chance.uniform(-3.1, 3.1))
        place = -(attitude.matrix @ vector(0, 0, distance))
        place[:2] += chance.uniform(-0.12, 0.12, 2) * distance
        images.append(renderer.render(place, attitude))
        ranges.append(float(np.linalg.norm(place)))
    return images, ranges


def timed(look: Callable[[Any], Any], images: list[Any]) -> tuple[list[Any], float]:
    """What it saw in each, and ms a frame; what it does but once, at first, is not counted."""
    for image in images[:WARM_UP]:
        look(image)
    began = time.process_time()
    seen = [look(image) for image in images]
    return seen, 1000 * (time.process_time() - began) / len(images)


def pupil(images: list[Any], family: str, file: str) -> tuple[float, float] | None:
    """Share of hits and ms a frame; None where it is not installed."""
    np.save(file, np.stack(images))
    command = [sys.executable, "-c", PUPIL, file, family]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return None
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
            images, ranges = frames(family, distance, count, seed=distance)
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
            shares.append(other[0] if other else float("nan"))
            millis = [near_ms, far_ms, plain_ms, other[1] if other else float("nan")]
            hits = " ".join(f"{share:5.2f}" for share in shares)
            print(
                f"{distance:3} m  {hits} | {' '.join(errors)} | {' '.join(f'{ms:6.2f}' for ms in millis)}", flush=True
            )


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
    chosen = parser.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        reach(chosen.frames, str(Path(folder, "frames.npy")))
    ghosts(chosen.bare)
    return 0


if __name__ == "__main__":
    sys.exit(main())
