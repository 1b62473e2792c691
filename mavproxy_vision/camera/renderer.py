"""Renders a camera's frame: textured ground with tags, through the camera model. Pure except for its noise.

The ground is the plane down = 0 of a local NED frame whose origin is `home`.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mavproxy_vision.apriltag.families import marker_image
from mavproxy_vision.apriltag.tag_layout import FAMILIES
from mavproxy_vision.geometry.camera_model import CameraModel
from mavproxy_vision.geometry.frames import Attitude, Matrix, Mount, Vector

Image = NDArray[np.uint8]

TILE = 1024  # pixels of the ground's texture, which repeats
TILE_METRES = 8.0
PIXELS_PER_CELL = 16  # of a tag's own image
FINE = 160  # pixels along a tag's side; a smaller tag is drawn larger and then averaged down
NEAREST = 0.02  # m; the smallest height of the lens above the ground
NOISE_FRAMES = 8


@dataclass(frozen=True)
class PlacedTag:
    """A tag on the ground: family, id, side of its black square (m), position north and east of home (m), and the
    heading (degrees) in which its top points; on a vehicle with that system id the position is the vehicle's."""

    family: str
    id: int
    size: float
    north: float
    east: float
    heading: float = 0.0
    carrier: int = 0


@dataclass(frozen=True)
class Look:
    """The quality of the camera's pictures.

    Attributes:
        noise: standard deviation, on a scale of 0 to 255.
        blur: sigma in pixels.
        exposure: factor for the brightness.
        occlusion: share (0 to 1) of every tag that is covered.
    """

    noise: float = 5.0
    blur: float = 0.7
    exposure: float = 1.0
    occlusion: float = 0.0


class Renderer:
    """Renders frames. One thread at a time.

    Args:
        model: the camera.
        mount: how the camera is mounted on the vehicle.
        tags: the tags on the ground.
        look: noise, blur, exposure.
        seed: for the ground and the noise.
    """

    def __init__(
        self, model: CameraModel, mount: Mount, tags: tuple[PlacedTag, ...], look: Look, seed: int = 0
    ) -> None:
        self.model, self.mount, self.tags, self.look = model, mount, tags, look
        self._random = np.random.default_rng(seed)
        self._ground = pyramid(ground_texture(seed))  # here, because it would delay the first frame
        self._images = {(tag.family, tag.id): marker_image(tag.family, tag.id, PIXELS_PER_CELL) for tag in tags}
        self._maps = distortion_maps(model) if any(model.distortion) else None

    @functools.cached_property
    def _noise(self) -> NDArray[np.float32]:
        shape = (NOISE_FRAMES, self.model.height, self.model.width)
        return self._random.standard_normal(shape, np.float32)

    def render(self, position: Vector, attitude: Attitude) -> Image:
        """The frame, shape (height, width), 0 to 255, from `position` (m NED from home) with that attitude."""
        lens = position + self.mount.lens(attitude)
        lens[2] = min(lens[2], -NEAREST)
        to_camera = self.mount.in_ned(attitude).T
        image = self._draw_ground(lens, to_camera)
        for tag in self.tags:
            self._draw_tag(image, tag, lens, to_camera)
        if self._maps is not None:
            image = cv2.remap(image, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return self._expose(image)

    def _homography(self, lens: Vector, to_camera: Matrix) -> Matrix:
        """From (north, east, 1) on the ground to pixels."""
        shifted = np.array([[1.0, 0.0, -lens[0]], [0.0, 1.0, -lens[1]], [0.0, 0.0, -lens[2]]])
        homography: Matrix = self.model.matrix @ to_camera @ shifted
        return homography

    def _draw_ground(self, lens: Vector, to_camera: Matrix) -> Image:
        per_pixel = -lens[2] / self.model.fx
        level = int(np.clip(math.log2(max(per_pixel / (TILE_METRES / TILE), 1e-9)), 0, len(self._ground) - 1))
        texture = self._ground[level]
        # The texture's origin is near the vehicle, so that single precision is enough far from home, too.
        base = np.round(lens[:2] / TILE_METRES) * TILE_METRES
        near = lens - np.array([base[0], base[1], 0.0])
        scale = TILE_METRES / texture.shape[0]
        metres = np.array([[0.0, -scale, 0.0], [scale, 0.0, 0.0], [0.0, 0.0, 1.0]])
        ground_to_pixel = self._homography(near, to_camera) @ metres
        size = (self.model.width, self.model.height)
        drawn: Any = cv2.warpPerspective(texture, ground_to_pixel, size, borderMode=cv2.BORDER_WRAP)
        return np.asarray(drawn, np.uint8)

    def _draw_tag(self, image: Image, tag: PlacedTag, lens: Vector, to_camera: Matrix) -> None:
        picture = self._images[tag.family, tag.id]
        to_pixel = self._homography(lens, to_camera) @ self._to_ground(tag, picture.shape[0])
        edge = picture.shape[0] - 0.5
        corners = np.array([[-0.5, -0.5, 1], [edge, -0.5, 1], [edge, edge, 1], [-0.5, edge, 1]]).T
        projected = to_pixel @ corners
        if (projected[2] <= 1e-6).any():
            return  # behind the camera
        pixels = projected[:2] / projected[2]
        low = np.maximum(np.floor(pixels.min(axis=1)) - 2, 0).astype(int)
        high = np.minimum(np.ceil(pixels.max(axis=1)) + 3, [self.model.width, self.model.height]).astype(int)
        if (low >= high).any():
            return
        side = max(float(np.linalg.norm(pixels[:, 1] - pixels[:, 0])), 1.0)
        self._paste(image, picture, to_pixel, (low, high), int(np.clip(round(2 * FINE / side), 2, 10)))

    def _to_ground(self, tag: PlacedTag, side: int) -> Matrix:
        """From a pixel of the tag's picture to (north, east, 1) in m from home."""
        cells = FAMILIES[tag.family][0]
        scale = tag.size / cells / PIXELS_PER_CELL
        middle = (side - 1) / 2
        c, s = math.cos(math.radians(tag.heading)), math.sin(math.radians(tag.heading))
        # In the picture x points to the tag's right and y to its bottom.
        right, bottom = (-s, c), (-c, -s)
        return np.array(
            [
                [right[0] * scale, bottom[0] * scale, tag.north - (right[0] + bottom[0]) * scale * middle],
                [right[1] * scale, bottom[1] * scale, tag.east - (right[1] + bottom[1]) * scale * middle],
                [0.0, 0.0, 1.0],
            ]
        )

    def _paste(self, image: Image, picture: Image, to_pixel: Matrix, box: tuple[Any, Any], fine: int) -> None:
        low, high = box
        width, height = (int(n) for n in high - low)
        if width * height * fine * fine > 4_000_000:
            fine = 2 if width * height < 1_000_000 else 1
        # A fine pixel U is the pixel u = (U + 0.5) / fine - 0.5: pixel centres have whole coordinates.
        zoom = np.array(
            [
                [fine, 0.0, (0.5 - low[0]) * fine - 0.5],
                [0.0, fine, (0.5 - low[1]) * fine - 0.5],
                [0.0, 0.0, 1.0],
            ]
        )
        size = (width * fine, height * fine)
        visible = picture if not self.look.occlusion else covered(picture, self.look.occlusion)
        drawn: Any = cv2.warpPerspective(visible, zoom @ to_pixel, size, flags=cv2.INTER_LINEAR)
        full = np.full_like(picture, 255)
        mask: Any = cv2.warpPerspective(full, zoom @ to_pixel, size, flags=cv2.INTER_LINEAR)
        if fine > 1:
            drawn = cv2.resize(drawn, (width, height), interpolation=cv2.INTER_AREA)
            mask = cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA)
        area = image[low[1] : high[1], low[0] : high[0]]
        # Outside the mask the ground stays. White is paper in daylight, not 255.
        blend = area * (1.0 - mask / 255.0) + (0.80 * drawn + 20.0 * (mask / 255.0))
        area[:] = blend.astype(np.uint8)

    def _expose(self, image: Image) -> Image:
        look = self.look
        if look.blur > 0:
            image = np.asarray(cv2.GaussianBlur(image, (0, 0), look.blur), np.uint8)
        if look.exposure == 1.0 and look.noise == 0:
            return image
        out = image.astype(np.float32) * np.float32(look.exposure)
        if look.noise > 0:
            frame = self._noise[int(self._random.integers(NOISE_FRAMES))]
            shift = int(self._random.integers(self.model.width * self.model.height))
            out += np.float32(look.noise) * np.roll(frame.ravel(), shift).reshape(frame.shape)
        exposed: Any = cv2.convertScaleAbs(np.maximum(out, 0.0))
        return np.asarray(exposed, np.uint8)


def covered(picture: Image, share: float) -> Image:
    """The tag's picture with `share` of it covered in dark grey."""
    picture_copy: Image = picture.copy()
    picture_copy[:, : round(share * picture.shape[1])] = 60
    return picture_copy


@functools.lru_cache(maxsize=2)
def ground_texture(seed: int) -> Image:
    """Grass and gravel: noise of several scales that repeats at the edges, shape (TILE, TILE)."""
    random = np.random.default_rng(seed)
    total = np.zeros((TILE, TILE), np.float32)
    for octave in range(2, 10):
        cells = 2**octave
        coarse = random.normal(0.0, 1.0, (cells, cells)).astype(np.float32)
        around = np.pad(coarse, 2, mode="wrap")
        scale = TILE // cells
        large = cv2.resize(around, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        total += large[2 * scale : 2 * scale + TILE, 2 * scale : 2 * scale + TILE] * 0.85 ** (octave - 2)
    spread = (total - total.mean()) / total.std()
    texture: Image = np.clip(105 + 28 * spread, 15, 215).astype(np.uint8)
    return texture


def pyramid(texture: Image, levels: int = 6) -> list[Image]:
    """The texture at full, half, quarter … size; it prevents aliasing from great heights."""
    textures = [texture]
    for _ in range(levels - 1):
        half = textures[-1].shape[0] // 2
        textures.append(np.asarray(cv2.resize(textures[-1], (half, half), interpolation=cv2.INTER_AREA), np.uint8))
    return textures


def distortion_maps(model: CameraModel) -> tuple[Any, Any]:
    """Maps for cv2.remap that turn an ideal frame into a distorted one."""
    v, u = np.mgrid[0 : model.height, 0 : model.width].astype(np.float32)
    pixels = np.stack([u.ravel(), v.ravel()], axis=1).reshape(-1, 1, 2)
    ideal = cv2.undistortPoints(pixels, model.matrix, model.coefficients, P=model.matrix)
    grid = ideal.reshape(model.height, model.width, 2).astype(np.float32)
    return grid[..., 0], grid[..., 1]
