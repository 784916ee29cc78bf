"""Mouth and jaw of a person, for any motion, stitched into frames of the person's own footage."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion_faces.appearance import candidates, lower_face
from lipmotion_faces.appearance.camera_noise import NoiseSource
from lipmotion_faces.appearance.person import JAW_OPTIONS, Appearance, FaceCodes
from lipmotion_faces.appearance.placing import cut, feather, place
from lipmotion_faces.appearance.poisson import CloningSystem, build_cloning_system

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Picture = NDArray[np.uint8]
Pictures = NDArray[np.uint8]

BATCH = 16  # frames in memory at a time, at one sample a pixel; fewer of larger faces
FEATHER_PX = 6.0  # width of the seam, px of the face

LARGEST_DIFFERENCE = 20.0  # differences on the edge of the jaw above this are no difference of light, grey levels
STRETCH = 0.88, 1.12  # how much narrower and wider than recorded a mouth is shown


@dataclass(frozen=True)
class Background:
    """One frame of footage."""

    frame: Picture
    face_to_frame: Array  # affine map from px of the face to px of the frame [shape=(2, 3)]
    chin_px: float  # how far the tip of the chin is below the eyes, px of the face
    has_face: bool = True  # whether the person is seen; False: the frame stays as it is


@dataclass(frozen=True)
class StitchingOptions:
    """How mouth and jaw are made.

    jaw       : whether the jaw is replaced, too; False: the background's jaw stays, the mouth alone is replaced
    mouth     : how the detail of the mouth is chosen
    sharpening : by how much what is stitched in is sharpened (``sharpen``); 0: not
    average   : number of pictures over which the mouth is averaged before, odd; 1: none
    jaw_detail : how the detail of the jaw is chosen
    noise     : share of the camera's noise that is added: recorded mouths have noise of their own
    """

    jaw: bool = True
    mouth: candidates.RefinementOptions = candidates.STEADY
    sharpening: float = candidates.SHARPENING
    average: int = 1
    jaw_detail: candidates.RefinementOptions = JAW_OPTIONS
    noise: float = 0.5
    seed: int = 0


STITCHING = StitchingOptions()
AS_PRINTED = StitchingOptions(mouth=candidates.PAPER, sharpening=0, average=3, noise=1)
"""The mean of three pictures, then the nearest of 500 candidates: Xie & Liu 2007, §6.1 and Eqs. 14–16."""


@dataclass(frozen=True, eq=False)
class Stitcher:
    """Stitches the mouth and the jaw of a person into frames of footage."""

    appearance: Appearance
    options: StitchingOptions = STITCHING

    def stitch(self, codes: FaceCodes, backgrounds: Iterable[Background]) -> Iterator[Picture]:
        """Yield a frame for each of motion, a few at a time. Raises InputError: too few backgrounds."""
        codes = self._average(codes)
        mouth_chosen, factors = self._choose_mouths(codes)
        jaw_chosen = self._jaws.choose(codes.jaw)
        iterator = iter(backgrounds)
        scale = self.appearance.scale
        size = max(1, BATCH // scale)
        for first in range(0, len(codes), size):
            part = slice(first, first + size)
            batch = list(islice(iterator, len(codes.mouth[part])))
            if len(batch) < len(codes.mouth[part]):
                count = first + len(batch)
                raise InputError(f"{count} frames of background, required {len(codes)}; give longer footage")
            mouths = self._draw_mouths(codes.mouth[part], mouth_chosen[part], factors[part], first)
            maps = lower_face.map_region(np.stack([each.face_to_frame for each in batch]), scale)
            aligned = [
                cut(each.frame, to, (lower_face.HEIGHT * scale, lower_face.WIDTH * scale))
                for each, to in zip(batch, maps, strict=True)
            ]
            behind = np.clip(np.rint(np.stack(aligned)), 0, 255).astype(np.uint8)
            if self.options.jaw:
                jaws = self._jaws.refine(codes.jaw[part], jaw_chosen[part])
                chins = np.array([each.chin_px for each in batch])
                behind = lower_face.move_chin(behind, chins, codes.chin_px[part] - chins)
                behind = self._lower_face.clone(
                    lower_face.relight(jaws, self._measure_gains(behind)), behind, LARGEST_DIFFERENCE
                )
            source, mouth = behind.copy(), (slice(None), *lower_face.find_mouth_part(scale))
            source[mouth] = lower_face.relight(mouths, self._measure_gains(behind))
            patches = candidates.sharpen(self._mouth_alone.clone(source, behind), self.options.sharpening)
            for each, patch, to in zip(batch, patches, maps, strict=True):
                frame = each.frame.copy()
                if each.has_face:
                    place(frame, patch, self._weight, to)
                yield frame

    def draw_mouths(self, codes: FaceCodes) -> Iterator[Picture]:
        """Yield pictures of the mouth alone [shape=(56 · scale, 72 · scale, 3)], one for each frame of motion."""
        codes = self._average(codes)
        chosen, factors = self._choose_mouths(codes)
        for first in range(0, len(codes), BATCH):
            part = slice(first, first + BATCH)
            yield from self._draw_mouths(codes.mouth[part], chosen[part], factors[part], first)

    def _average(self, codes: FaceCodes) -> FaceCodes:
        """Return codes whose mouth is the mean of some pictures."""
        if self.options.average == 1:
            return codes
        return replace(codes, mouth=candidates.smooth_curves(codes.mouth, self.options.average).astype(np.float32))

    def _choose_mouths(self, codes: FaceCodes) -> tuple[NDArray[np.intp], Array]:
        """Return the recorded mouth of every frame and colour, and how much wider it is shown [shape=(T,)]."""
        chosen, recorded = self._mouths.choose(codes.mouth), self.appearance.mouth_distances
        if codes.width is None or recorded is None or not self._mouths.options.blur_px:
            return chosen, np.ones(len(codes))
        return chosen, np.clip(codes.width / np.maximum(recorded[chosen[:, 0], 1], 1e-6), *STRETCH)

    def _draw_mouths(self, codes: Floats, chosen: NDArray[np.intp], factors: Array, first: int) -> Pictures:
        pictures = self._mouths.refine(codes, chosen, None if (factors == 1).all() else factors)
        return self._noise.add(pictures, first) if self.options.noise else pictures

    def _measure_gains(self, behind: Pictures) -> Array:
        """Return how much lighter the footage is than the pictures of the person, in each colour [shape=(T, 3)]."""
        part = (slice(None), *lower_face.find_mouth_part(self.appearance.scale))
        return np.maximum(lower_face.measure_cheek_light(behind[part]), 1.0) / self.appearance.light

    @cached_property
    def _mouths(self) -> candidates.Refiner:
        return self.appearance.make_refiner("mouth", self.options.mouth)

    @cached_property
    def _jaws(self) -> candidates.Refiner:
        return self.appearance.make_refiner("jaw", self.options.jaw_detail)

    @cached_property
    def _noise(self) -> NoiseSource:
        noise = replace(self.appearance.noise, covariance=self.options.noise**2 * self.appearance.noise.covariance)
        return NoiseSource(noise, self._mouths.eigenlips.size, self.options.seed)

    @cached_property
    def _lower_face(self) -> CloningSystem:
        return build_cloning_system(lower_face.mark_replaced(self.appearance.shape, self.appearance.scale))

    @cached_property
    def _mouth_alone(self) -> CloningSystem:
        return build_cloning_system(lower_face.mark_mouth(self.appearance.scale))

    @cached_property
    def _weight(self) -> Floats:
        scale = self.appearance.scale
        mask = lower_face.mark_moved(scale) if self.options.jaw else lower_face.mark_mouth(scale)
        return feather(mask, FEATHER_PX * scale)
