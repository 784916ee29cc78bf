"""Steady placing: maps of a tracked face without the noise of tracking, so that a patch placed by them sits still.

How far one half of nose and cheeks moves from frame to frame after alignment, root mean square, px of the picture,
where registration sees only the other half and so is noisier than in use:

                              tracked  Gaussian of a frame  steady  registered  registered, steady
4 clips of GRID ``val``         0.220                0.136   0.139       0.190               0.165
a talker at 512 × 384           0.505                0.305   0.339       0.228               0.211
a talker at 512 × 512           0.505                0.456   0.411       0.236               0.233
one who nods quickly, 30 fps    1.676                1.885   1.675       0.621               0.620
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.eigenlips import EYE_DISTANCE_PX, MOUTH_CORNER
from lipmotion_faces.appearance.lower_face import map_region
from lipmotion_faces.tracking.packages import import_opencv
from lipmotion_faces.tracking.track import Footage, decode_footage

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

POSITION_S, SHAPE_S = 0.04, 0.32
"""Deviations of the Gaussians in time that smooth the place of the mouth, and turn and size of the face, s."""
TRACKED_NOISE_PX, REGISTERED_NOISE_PX = 0.5, 0.2
"""Motion that smoothing takes away is given back where it is much larger than this, px of the face that looks straight
ahead: the noise of tracked and of registered maps is smaller, and nods are larger."""
ENVELOPE_S = 0.04  # over about this time the size of that motion is averaged, s
DRIFT_S = 0.4  # motion that is slower than this is taken from the tracker, and quicker motion from the pictures, s
REGION = (-42.0, 2.0, 42.0, 44.0)
"""Left, top, right and bottom of nose and cheeks, which speech hardly moves, px of the face that looks straight ahead,
from the point between the eyes."""
MAX_SAMPLES = 1.5
"""Most pixels of the region per px of a face that looks ahead; with fewer in the picture, as many as there."""
MARGIN = 3  # pixels at the edge of the region that are not compared
BLURS_PX = (3.0, 1.0)  # the pictures are registered coarsely and then finely, blurred by Gaussians of these deviations
ROUNDS = 8  # most steps of each registration; three are usual
LONGEST_STEP = 0.2  # a registration that finds a longer step, in eye distances, is not believed
FLAT_LEVELS = 0.1  # a region with a smaller standard deviation, in grey levels, has no texture to register
MOUTH = np.array([0.0, MOUTH_CORNER[1] + 28.0])  # the middle of the mouth region, px


def steady_maps(maps: Array, rate_hz: float, cuts: Sequence[int] = (), *, noise_px: float = TRACKED_NOISE_PX) -> Array:
    """Return maps of a face, smoothed over time [shape=(T, 2, 3)].

    maps    : of ``Footage.face_to_image`` or ``register_maps`` [shape=(T, 2, 3)]
    cuts    : frames before which the camera changes; nothing is smoothed over them
    noise_px : ``TRACKED_NOISE_PX``, or ``REGISTERED_NOISE_PX`` for maps of ``register_maps``
    The turn and size of the face, and the position of the mouth, are smoothed by Gaussians. What they take away is
    noise where it is small, and is taken away; where it is large, it is motion of the head, and stays: a part r is
    scaled by u² / (u² + ``noise_px``²), u its root mean square at that time.
    """
    result = np.array(maps, dtype=np.float64)
    for start, stop in pairwise([0, *cuts, len(maps)]):
        if stop - start > 1:
            scene = result[start:stop]
            turn, mouth = scene[:, :, :2], scene[:, :, :2] @ MOUTH + scene[:, :, 2]
            size = float(np.sqrt(np.abs(np.linalg.det(turn))).mean())
            reach = float(np.linalg.norm(MOUTH)) / 2  # how far an error of the turn moves a pixel of the mouth, about
            share, envelope = 1 / (size * noise_px), ENVELOPE_S * rate_hz
            turn = _remove_noise(turn.reshape(-1, 4), SHAPE_S * rate_hz, reach * share, envelope).reshape(-1, 2, 2)
            mouth = _remove_noise(mouth, POSITION_S * rate_hz, share, envelope)
            result[start:stop] = np.concatenate([turn, (mouth - turn @ MOUTH)[:, :, None]], axis=2)
    return result


def register_maps(footage: Footage) -> Array:
    """Return the maps of the face in tracked footage, corrected by the pictures [shape=(T, 2, 3)].

    The tracker lags behind quick motion of the head and trembles. Nose and cheeks of each frame, aligned by
    ``footage.face_to_image``, are registered with those of the frame before, to fractions of a pixel; the sum of these
    steps is how far the face is from where the tracker saw it. Its quick part (``DRIFT_S``) is added to the maps; the
    slow part is left out, because errors of the steps add up in it, and because a nose moves against lips when the head
    turns. Pictures that are repeated get equal maps but for that. Use ``steady_maps`` on the result.
    Source: Lucas & Kanade 1981 (registration; here with gain and offset of the light).
    Cost: the video is decoded once; about 1 ms a frame.
    Raises InputError: the video cannot be read any more.
    """
    maps = footage.face_to_image
    scale = float(np.sqrt(np.abs(np.linalg.det(maps[:, :, :2]))).mean())
    samples = min(scale, MAX_SAMPLES)
    steps = np.zeros((len(footage), 2))
    before: list[Floats] = []
    for n, (frame, to_image) in enumerate(zip(decode_footage(footage), maps, strict=True)):
        region = _blur_region(frame, to_image, samples)
        if n and n not in footage.cuts and footage.track.seen[n - 1 : n + 1].all():
            steps[n] = _step(before, region) / samples
        before = region
    steps[np.linalg.norm(steps, axis=1) > LONGEST_STEP * EYE_DISTANCE_PX] = 0
    result = maps.copy()
    for start, stop in pairwise([0, *footage.cuts, len(footage)]):
        moved = np.cumsum(steps[start:stop], axis=0)
        quick = moved - _smooth(moved, DRIFT_S * footage.rate_hz, "reflect")
        result[start:stop, :, 2] += (maps[start:stop, :, :2] @ quick[:, :, None])[:, :, 0]
    return result


def _remove_noise(rows: Array, sigma: float, share: float, envelope: float) -> Array:
    """Return smooth rows, and what smoothing takes away where it is much larger than 1 / ``share``."""
    smooth = _smooth(rows, sigma)
    rest = rows - smooth
    power = _smooth(np.square(rest * share).sum(axis=1), envelope)
    return smooth + (power / (power + 1))[:, None] * rest


def _smooth(rows: Array, sigma: float, mode: str = "nearest") -> Array:
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(rows, sigma, axis=0, mode=mode)


def _blur_region(frame: NDArray[np.uint8], to_image: Array, samples: float) -> list[Floats]:
    """Return nose and cheeks of a frame in grey, aligned, at each of ``BLURS_PX``."""
    cv2 = import_opencv()
    left, top, right, bottom = REGION
    region = cv2.warpAffine(
        cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY),
        map_region(to_image, samples, (left, top)),
        (round((right - left) * samples), round((bottom - top) * samples)),
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    ).astype(np.float32)
    return [cv2.GaussianBlur(region, (0, 0), blur) for blur in BLURS_PX]


def _step(before: Sequence[Floats], after: Sequence[Floats]) -> Array:
    """Return how far a region moved, px [shape=(2,)], but for gain and offset; 0 where nothing is more alike then."""
    if min(before[-1].std(), after[-1].std()) < FLAT_LEVELS:
        return np.zeros(2)
    step = np.zeros(2)
    for reference, moved in zip(before, after, strict=True):
        step = _register(reference, moved, step)
    reference, moved = before[-1], after[-1]
    is_better = _correlate(reference, _shift(moved, step)) >= _correlate(reference, moved)
    return step if is_better else np.zeros(2)


def _correlate(first: Floats, other: Floats) -> float:
    a, b = first - first.mean(), other - other.mean()
    return float((a * b).mean() / max(a.std() * b.std(), 1e-9))


def _register(reference: Floats, moved: Floats, step: Array) -> Array:
    """Return a step, improved by least squares on the gradients (Lucas & Kanade 1981)."""
    inner = (slice(MARGIN, -MARGIN), slice(MARGIN, -MARGIN))
    slopes: list[Array] = list(np.gradient(reference.astype(np.float64)))
    down, across = slopes
    level = reference[inner].ravel().astype(np.float64)
    terms = np.stack([across[inner].ravel(), down[inner].ravel(), level - level.mean(), np.ones(len(level))], axis=1)
    power: Array = terms.T @ terms
    if np.linalg.cond(power) > 1e12:  # no texture in one direction
        return step
    for _ in range(ROUNDS):
        difference = (_shift(moved, step)[inner] - reference[inner]).ravel().astype(np.float64)
        change = [float(value) for value in np.linalg.solve(power, terms.T @ difference)[:2]]
        step = step - np.array(change)
        if max(map(abs, change)) < 1e-3:
            break
    return step


def _shift(image: Floats, step: Array) -> Floats:
    """Return the picture whose pixel x is pixel x + step of the given one."""
    cv2 = import_opencv()
    to_source = np.array([[1, 0, step[0]], [0, 1, step[1]]])
    shifted: Floats = cv2.warpAffine(
        image,
        to_source,
        image.shape[1::-1],
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return shifted
