"""The appearance of a person, learned from footage: what mouth and jaw look like, for any motion of the face.

It is stored as arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.motion.eigenlips import (
    COLOURS,
    COMPONENTS,
    MOUTH_HEIGHT,
    MOUTH_WIDTH,
    Eigenlips,
    eigenlips_from_arrays,
    eigenlips_to_arrays,
    fit_eigenlips,
)
from lipmotion.motion.frame_labels import find_runs
from lipmotion.speech.sound.pauses import QUIETEST_DB, STEP_S, measure_levels_db
from lipmotion.stats.pca import choose_evenly
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared, select_arrays
from lipmotion.types import Audio, Channel, Motion
from lipmotion_faces.appearance import candidates, lower_face, motion_map
from lipmotion_faces.appearance.camera_noise import (
    CameraNoise,
    camera_noise_from_arrays,
    camera_noise_to_arrays,
    estimate_noise,
)
from lipmotion_faces.coded_video import decode_pictures, encode_pictures

Array = NDArray[np.float64]
Values = NDArray[np.floating[Any]]
Floats = NDArray[np.float32]
Index = NDArray[np.intp]
Pictures = NDArray[np.uint8]

TRAINING_PICTURES = 980  # pictures of which the principal components are computed. Source: Xie & Liu 2007, §5
JAW_COMPONENTS = 12  # principal components of the jaw, of each colour
JAW_CANDIDATES = 120  # recorded lower faces whose detail the jaw has
JAW_OPTIONS = candidates.RefinementOptions(steadiness=0.3)
PICTURES_PER_BLOCK = 256
EDGE_PX = 3  # the jaw's pictures are its own so far beyond the part that is replaced: cloning reads its edge
LIP_DISTANCES = ("opening", "width", "outer")
"""Channels in which the mixture of recorded mouths is to be like the motion."""
DISTANCE_GAINS = np.array([1.0, 1.1, 1.0])
"""They are sought this much further from their middle, because trackers measure less width in the mixtures."""
DISTANCE_WEIGHTS = np.array([800.0, 1600.0, 800.0])
"""What one standard deviation of each among the candidates counts, beside the eigenlips, grey levels: the regression
alone shows two thirds of the width's deviation (docs/results/video.md)."""
COMPONENT_GAINS = np.tile(np.where(np.arange(COMPONENTS) < 4, 1.1, 1.6), len(COLOURS)).astype(np.float32)
"""How much mixtures are exaggerated: they vary less than mouths, the more the finer a component: teeth were grey."""
LONGEST_CLOSURE_S = 0.3
"""A closure that lasts no longer shows one recorded mouth; in pauses mouths are mixed, as they live on."""
MOUTH_RIDGE = 1e-3  # ridge of the regression of the jaw on the mouth, as a share of the variance of the mouth


@dataclass(frozen=True, eq=False)
class FootagePictures:
    """Pictures of the lower face in footage of one person, with the motion and the sound of the same frames.

    clips     : pictures of consecutive frames, clip by clip [each shape=(T, 128, 128, 3)], uint8
    motion    : of all these frames in turn, in ``channels`` [shape=(N, C)]
    levels_db : of the sound in these frames [shape=(N,)]
    chin_px   : how far the tip of the chin is below the eyes in these frames, px of the face [shape=(N,)]
    shape     : of the lower face
    scale     : samples a pixel with which the footage loses nothing
    finer     : returns the pictures of some frames with ``scale`` samples a pixel
                [shape=(n, 128 · scale, 128 · scale, 3)]
    """

    clips: tuple[Pictures, ...]
    motion: Array
    channels: tuple[Channel, ...]
    levels_db: Array
    chin_px: Array
    shape: lower_face.FaceShape
    scale: int
    finer: Callable[[Index], Pictures]


@dataclass(frozen=True, eq=False)
class FaceCodes:
    """The lower face in every frame: eigenlips, jaw [shape=(T, 3·K)], the chin below the eyes in px [shape=(T,)].

    width : of the mouth, eye distances [shape=(T,)]; None: that of the recorded mouths
    """

    mouth: Floats
    jaw: Floats
    chin_px: Floats
    width: Array | None = None

    def __len__(self) -> int:
        return len(self.mouth)


@dataclass(frozen=True, eq=False)
class Appearance:
    """The appearance of a person. All pictures are in one light.

    shape       : of the lower face
    scale       : samples a pixel
    light       : mean red, green and blue of the cheeks [shape=(3,)], grey levels
    mouth       : eigenlips of the mouth region, 72 × 56 px
    mouths      : recorded mouths, the candidates of refinement [shape=(N, 56 · scale, 72 · scale, 3)], uint8
    mouth_codes : their eigenlips [shape=(N, 90)]
    mouth_distances : their ``LIP_DISTANCES``, eye distances [shape=(N, 3)]; None in files of before
    jaw         : principal components of the lower face, 128 × 128 px, whose mouth is always the mean one
    jaws        : recorded lower faces, the candidates of the jaw [shape=(M, 128 · scale, 128 · scale, 3)], uint8
    jaw_codes   : their components [shape=(M, 3·K)]
    from_motion : regression of eigenlips, components of the jaw and place of the chin on motion of tracked points
    from_mouth  : regression of jaw and chin on 1 and the eigenlips [shape=(1 + 90, 3·K + 1)]
    from_sound  : regression of jaw and chin on 1 and the level of the sound, dB [shape=(2, 3·K + 1)]
    noise       : of the camera
    Source: Xie & Liu 2007, §5 (eigenlips), §6.1 (candidates, noise), §6.2 (jaw). Deviation: the jaw has components,
    too, so that it moves smoothly; the paper shows recorded ones.
    """

    shape: lower_face.FaceShape
    scale: int
    light: Array
    mouth: Eigenlips
    mouths: Pictures
    mouth_codes: Floats
    mouth_distances: Array | None
    jaw: Eigenlips
    jaws: Pictures
    jaw_codes: Floats
    from_motion: motion_map.MotionMap
    from_mouth: Floats
    from_sound: Floats
    noise: CameraNoise

    @cached_property
    def _refiners(self) -> dict[tuple[str, candidates.RefinementOptions], candidates.Refiner]:
        return {}

    def make_refiner(self, part: str, options: candidates.RefinementOptions) -> candidates.Refiner:
        """Return what draws the mouth or the jaw with the detail of recorded ones, cached."""
        if (part, options) not in self._refiners:
            pictures, codes = (self.mouths, self.mouth_codes) if part == "mouth" else (self.jaws, self.jaw_codes)
            space = enlarge(self.mouth if part == "mouth" else self.jaw, self.scale, options.blur_px)
            recorded = candidates.Candidates(codes, candidates.measure_details(space, pictures, codes)[0])
            self._refiners[part, options] = candidates.Refiner(space, recorded, options)
        return self._refiners[part, options]

    def predict_codes(self, motion: Motion, contact: Array | None = None) -> FaceCodes:
        """Return the lower face for motion of tracked points.

        contact : how near the lips are to touching, 0 to 1, at which they touch [shape=(T,)]; None: as they are mixed
        Raises InputError: the motion has not the channels of ``from_motion``, or values that are not finite.
        """
        values = self.from_motion.predict(motion)
        count = self.mouth_codes.shape[1]
        predicted, jaw, chin_px, measured = values[:, :count], values[:, count:-1], values[:, -1], self.mouth_distances
        if measured is None:
            return FaceCodes(candidates.draw_to_recorded(predicted, self.mouth_codes), jaw, chin_px)
        middle = measured.mean(axis=0)
        wanted = middle + DISTANCE_GAINS * (motion_map.select_channels(motion, LIP_DISTANCES) - middle)
        wanted = np.clip(wanted, measured.min(axis=0), measured.max(axis=0))
        mouth = self._mix_mouths(predicted, measured, wanted, motion.rate_hz, contact)
        return FaceCodes(mouth, jaw, chin_px, wanted[:, 1])

    def _mix_mouths(
        self, predicted: Floats, measured: Array, wanted: Array, rate_hz: float, contact: Array | None
    ) -> Floats:
        """Return recorded mouths, mixed to look as predicted and be as open and wide as wanted [shape=(T, 90)]."""
        middle = measured.mean(axis=0)
        weights = DISTANCE_WEIGHTS / np.maximum(measured.std(axis=0), motion_map.MIN_DEVIATION)
        sought, recorded = (
            np.concatenate([codes, ((distances - middle) * weights).astype(np.float32)], axis=1)
            for codes, distances in ((predicted, wanted), (self.mouth_codes, measured))
        )
        mouths = candidates.draw_to_recorded(sought, recorded)[:, : predicted.shape[1]] * COMPONENT_GAINS
        if contact is None:
            return mouths
        for first, stop in find_runs(contact >= 1).tolist():
            if stop - first > max(1, LONGEST_CLOSURE_S * rate_hz):
                continue
            closed = measured[:, 0] <= max(wanted[first:stop, 0].max(), measured[:, 0].min())
            apart = candidates.square_distances(sought[first:stop], recorded).mean(axis=0)
            pressed = self.mouth_codes[np.argmin(np.where(closed, apart, np.inf))]
            around = slice(max(first - 1, 0), stop + 1)
            mouths[around] += contact[around, None].astype(np.float32) * (pressed - mouths[around])
        return mouths

    def measure_codes(self, mouths: Pictures) -> FaceCodes:
        """Return the lower face for pictures of the mouth [shape=(T, 56, 72, 3)], uint8, in any light."""
        codes = self.mouth.project(
            lower_face.relight(mouths, self.light / np.maximum(lower_face.measure_cheek_light(mouths), 1.0))
        )
        values = codes @ self.from_mouth[1:] + self.from_mouth[0]
        return FaceCodes(codes, values[:, :-1], values[:, -1])

    def with_jaw_of_sound(self, codes: FaceCodes, levels_db: Array) -> FaceCodes:
        """Return the lower face with another jaw, for the level of the sound in each frame [shape=(T,)].

        Source: Xie & Liu 2007, §6.2: the jaw goes down about in proportion to the energy of the sound.
        """
        values = (levels_db[:, None] * self.from_sound[1] + self.from_sound[0]).astype(np.float32)
        return replace(codes, jaw=values[:, :-1], chin_px=values[:, -1])


def learn_appearance(footage: FootagePictures) -> Appearance:
    """Return the appearance of a person, in 10 s for four minutes. Raises InputError: no pictures, or other motion."""
    pictures, light, reference = _equalise_light(footage)
    mouths = pictures[(slice(None), *lower_face.find_mouth_part(1))]
    training = choose_evenly(TRAINING_PICTURES, len(pictures))
    mouth = fit_eigenlips(mouths[training], COMPONENTS)
    codes = mouth.project(mouths)
    around = pictures[training].mean(axis=0, dtype=np.float32)
    jaw = fit_eigenlips(_isolate_jaw(pictures[training], around, footage.shape), JAW_COMPONENTS)
    blocks = (pictures[start : start + PICTURES_PER_BLOCK] for start in range(0, len(pictures), PICTURES_PER_BLOCK))
    jaw_codes = np.concatenate([jaw.project(_isolate_jaw(block, around, footage.shape)) for block in blocks])
    chosen = candidates.choose_candidates(codes, candidates.CANDIDATES)
    chosen = chosen[candidates.measure_details(mouth, mouths[chosen], codes[chosen])[1] <= candidates.LARGEST_DETAIL]
    if not len(chosen):
        limit = f"by more than {candidates.LARGEST_DETAIL} grey levels"
        raise InputError(f"all pictures of the mouth differ from their eigenlips {limit}; give undamaged footage")
    chosen_jaws = candidates.choose_candidates(jaw_codes, JAW_CANDIDATES)
    names = [channel.name for channel in footage.channels]

    def read_frames(frames: Index) -> Pictures:
        if footage.scale == 1:
            return pictures[frames]
        return lower_face.relight(footage.finer(frames), reference / light[frames])

    chosen_faces = read_frames(chosen_jaws)
    jaw_and_chin = np.concatenate([jaw_codes, footage.chin_px[:, None]], axis=1)
    ends = np.cumsum([len(clip) for clip in footage.clips])[:-1]
    return Appearance(
        footage.shape,
        footage.scale,
        reference,
        mouth,
        np.ascontiguousarray(read_frames(chosen)[(slice(None), *lower_face.find_mouth_part(footage.scale))]),
        codes[chosen],
        footage.motion[chosen][:, [names.index(name) for name in LIP_DISTANCES]],
        jaw,
        _isolate_jaw(chosen_faces, chosen_faces.mean(axis=0, dtype=np.float32), footage.shape),
        jaw_codes[chosen_jaws],
        motion_map.fit_motion_map(footage.motion, footage.channels, np.concatenate([codes, jaw_and_chin], axis=1)),
        _fit_regression(codes, jaw_and_chin),
        _fit_regression(footage.levels_db[:, None], jaw_and_chin),
        estimate_noise(np.split(mouths, ends)),
    )


def _equalise_light(footage: FootagePictures) -> tuple[Pictures, Array, Array]:
    """Return all pictures in the same light, their own light [shape=(N, 3)], and that light [shape=(3,)]."""
    count = sum(len(clip) for clip in footage.clips)
    if not count or len(footage.motion) != count or len(footage.levels_db) != count:
        raise InputError(
            f"{count} pictures, {len(footage.motion)} frames of motion and {len(footage.levels_db)} of sound; required "
            "as many of each"
        )
    part = (slice(None), *lower_face.find_mouth_part(1))
    light = np.maximum(np.concatenate([lower_face.measure_cheek_light(clip[part]) for clip in footage.clips]), 1.0)
    reference = np.median(light, axis=0)
    pictures, start = np.empty((count, *footage.clips[0].shape[1:]), np.uint8), 0
    for clip in footage.clips:
        inside = slice(start, start + len(clip))
        pictures[inside] = lower_face.relight(clip, reference / light[inside])
        start += len(clip)
    return pictures, light, reference


def _isolate_jaw(pictures: Pictures, mean: Floats, shape: lower_face.FaceShape) -> Pictures:
    """Return lower faces that differ in the jaw alone: mouth and surroundings are the mean ones [shape=(H, W, 3)]."""
    from scipy.ndimage import binary_dilation

    scale = pictures.shape[1] // lower_face.HEIGHT
    other = lower_face.mark_mouth(scale) | ~binary_dilation(
        lower_face.mark_replaced(shape, scale), iterations=EDGE_PX * scale
    )
    result = pictures.copy()
    result[:, other] = np.rint(mean[other]).astype(np.uint8)
    return result


def _fit_regression(inputs: Values, targets: Values) -> Floats:
    """Return the coefficients of a ridge regression on 1 and the inputs [shape=(1 + F, V)]."""
    centre, middle = inputs.mean(axis=0, dtype=np.float64), targets.mean(axis=0, dtype=np.float64)
    x = inputs - centre
    products = x.T @ x
    products[np.diag_indices(len(products))] += MOUTH_RIDGE * np.trace(products) / len(products) + 1e-9
    slopes = np.linalg.solve(products, x.T @ (targets - middle))
    return np.concatenate([(middle - centre @ slopes)[None], slopes]).astype(np.float32)


def enlarge(eigenlips: Eigenlips, scale: int, blur_px: float = 0.0) -> Eigenlips:
    """Return eigenlips that restore larger pictures from the same coefficients, by cubic interpolation.

    scale   : pixels of the new pictures for each of the old ones, along each side
    blur_px : standard deviation of the Gaussian window that they are blurred with, px of the old ones
    With 1 and 0 they stay as they are. Otherwise their basis is no longer orthonormal: ``project`` pictures of the old
    size, with the old eigenlips.
    """
    from scipy.ndimage import gaussian_filter

    from lipmotion_faces.kernels import affine

    if scale == 1 and not blur_px:
        return eigenlips
    height, width = eigenlips.size
    middle = (0.5 / scale) - 0.5
    to_source = np.array([[1 / scale, 0, middle], [0, 1 / scale, middle]])

    def enlarge(rows: NDArray[np.float32]) -> NDArray[np.float32]:
        pictures = np.moveaxis(rows, 0, -1).reshape(-1, height, width, len(COLOURS))
        pictures = gaussian_filter(pictures, blur_px, mode="nearest", axes=(1, 2))
        pictures = affine.resample(pictures, to_source, (scale * height, scale * width))
        return np.ascontiguousarray(np.moveaxis(pictures, -1, 0)).reshape(*rows.shape[:-1], -1)

    return Eigenlips(
        np.clip(enlarge(eigenlips.mean), 0, 255),
        enlarge(eigenlips.basis),
        eigenlips.explained,
        (scale * height, scale * width),
    )


CRF = 6.0  # quality of the pictures: detail is what they are kept for
PARTS = ("mouth", "jaw", "from_motion", "noise")  # prefixes of the names of the arrays of parts
REMEDY = "build the face again"


def appearance_to_arrays(appearance: Appearance) -> dict[str, NDArray[Any]]:
    """Return the appearance of a person serialised as arrays (``APPEARANCE`` and those of ``PARTS``)."""
    parts = {
        "mouth": eigenlips_to_arrays(appearance.mouth),
        "jaw": eigenlips_to_arrays(appearance.jaw),
        "from_motion": motion_map.motion_map_to_arrays(appearance.from_motion),
        "noise": camera_noise_to_arrays(appearance.noise),
    }
    arrays = {f"{part}/{name}": array for part, inner in parts.items() for name, array in inner.items()}
    shape = appearance.shape
    return arrays | {
        "shape": np.array([shape.half_width_px, shape.bottom_px]),
        "scale": np.array(appearance.scale),
        "light": appearance.light,
        "mouths": encode_pictures(appearance.mouths, CRF),
        "mouth_codes": appearance.mouth_codes,
        "jaws": encode_pictures(appearance.jaws, CRF),
        "jaw_codes": appearance.jaw_codes,
        "from_mouth": appearance.from_mouth,
        "from_sound": appearance.from_sound,
        **({} if appearance.mouth_distances is None else {"mouth_distances": appearance.mouth_distances}),
    }


def appearance_from_arrays(arrays: Arrays) -> Appearance:
    """Deserialise the appearance of a person. Raises ModelFormatError: arrays are missing, unknown or do not fit."""
    inner = {part: select_arrays(arrays, f"{part}/") for part in PARTS}
    named = {name: array for name, array in arrays.items() if name.partition("/")[0] not in PARTS or "/" not in name}
    with format_errors("the appearance of the person", REMEDY):
        refuse_undeclared(named, APPEARANCE)
        mouth, jaw = (eigenlips_from_arrays(inner[part], REMEDY) for part in ("mouth", "jaw"))
        sizes = (mouth, (MOUTH_HEIGHT, MOUTH_WIDTH)), (jaw, (lower_face.HEIGHT, lower_face.WIDTH))
        for part, (space, size) in zip(("mouth", "jaw"), sizes, strict=True):
            if space.size != size:
                raise ValueError(f"pictures of the {part} of {space.size} px, required {size}")
        codes, jaw_codes = len(mouth.channels), len(jaw.channels)
        stored = check_arrays(named, APPEARANCE, C=codes, K=jaw_codes, F=codes + 1, J=jaw_codes + 1)
        scale = int(stored["scale"])
        half_width_px, bottom_px = stored["shape"].tolist()
        if (
            not lower_face.NARROWEST_PX <= half_width_px <= lower_face.WIDEST_PX
            or not lower_face.CORNER[1] < bottom_px < lower_face.CORNER[1] + lower_face.HEIGHT
        ):
            raise ValueError(f"a lower face of {half_width_px:g} px to {bottom_px:g} px below the eyes")
        return Appearance(
            lower_face.FaceShape(half_width_px, bottom_px),
            scale,
            stored["light"],
            mouth,
            _decode(stored["mouths"], len(stored["mouth_codes"]), MOUTH_HEIGHT * scale, MOUTH_WIDTH * scale),
            stored["mouth_codes"],
            stored.arrays.get("mouth_distances"),
            jaw,
            _decode(stored["jaws"], len(stored["jaw_codes"]), lower_face.HEIGHT * scale, lower_face.WIDTH * scale),
            stored["jaw_codes"],
            motion_map.motion_map_from_arrays(inner["from_motion"], codes + jaw_codes + 1),
            stored["from_mouth"],
            stored["from_sound"],
            camera_noise_from_arrays(inner["noise"]),
        )


APPEARANCE = {
    "shape": ArraySpec(np.float64, "2", 0, 1000),
    "scale": ArraySpec(np.intp, "", 1, lower_face.LARGEST_SCALE),
    "light": ArraySpec(np.float64, "3", 1, 255),
    "mouths": ArraySpec(np.uint8, "A", 0, 255),
    "mouth_codes": ArraySpec(np.float32, "N C", -candidates.LARGEST_COEFFICIENT, candidates.LARGEST_COEFFICIENT),
    "mouth_distances": ArraySpec(np.float64, "N 3", -100, 100, optional=True),
    "jaws": ArraySpec(np.uint8, "B", 0, 255),
    "jaw_codes": ArraySpec(np.float32, "M K", -candidates.LARGEST_COEFFICIENT, candidates.LARGEST_COEFFICIENT),
    "from_mouth": ArraySpec(np.float32, "F J", -candidates.LARGEST_COEFFICIENT, candidates.LARGEST_COEFFICIENT),
    "from_sound": ArraySpec(np.float32, "2 J", -candidates.LARGEST_COEFFICIENT, candidates.LARGEST_COEFFICIENT),
}


def _decode(data: Pictures, count: int, height: int, width: int) -> Pictures:
    pictures = decode_pictures(data)
    if pictures.shape != (count, height, width, 3):
        raise ValueError(f"pictures of shape {pictures.shape}, required ({count}, {height}, {width}, 3)")
    return pictures


def measure_levels_at(audio: Audio, times_s: Array) -> Array:
    """Return the smoothed level of a sound at some times, dB of full scale [same shape].

    times_s : rising, s [shape=(T,)]; before the first and after the last level that one is returned
    A sound of less than 10 ms has the level ``QUIETEST_DB``.
    """
    levels = measure_levels_db(audio)
    if not len(levels):
        return np.full(len(times_s), QUIETEST_DB)
    return np.interp(times_s, (np.arange(len(levels)) + 0.5) * STEP_S, levels)
