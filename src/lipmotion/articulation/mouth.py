"""The mouth in every frame, as all faces, meshes and curve sets show it: from motion and phones to one set of curves.

Lengths are in eye distances (the distance between the outer corners of the eyes).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import GAP, close_lips, read_edited, read_gap, sample_pictures
from lipmotion.articulation.expression import list_action_units
from lipmotion.articulation.lip_points import LEFT_CORNER, RIGHT_CORNER
from lipmotion.articulation.phone_targets import GESTURES, OVAL, PURSED_PRESS, SAID, TIP_OUT, TIP_UP, gesture_curves
from lipmotion.articulation.rest import find_rest_frames, measure_at_rest
from lipmotion.errors import InputError, shorten_list
from lipmotion.types import Motion, Timeline, Unit
from lipmotion.types.motion import compute_frame_times

Curve = NDArray[np.float64]

TUCKED_GAP = (0.05, 0.072)  # range of the gap while the lower lip is on the upper teeth, which are seen
TONGUE_GAP = (0.05, 0.1)  # range of the gap while the tongue is between the teeth
PURSED_GAP = (0.04, 0.05)  # range of the gap of w: a small hole
ROUND_GAPS, TEETH_GAPS = (0.06, 0.085), (0.045, 0.1)
"""Range of the gap of wholly protruded lips, and where both rows of teeth are seen."""
ROUND_WIDTH, PURSED_WIDTH, SPREAD_WIDTH, OVAL_WIDTH = 0.89, 0.82, 1.05, 0.97
"""Protruded lips and those of w are at most so wide, spread ones at least, those of an oval mouth at most."""
OVAL_GAPS = (0.06, 0.16)
"""The gap at which an opening begins to be an oval, and at which it is one, where the phone asks for it."""
SPREAD_GAP, SPREAD_FROM = 0.1, 0.45
"""Wholly spread lips are apart by this gap and a third of what was measured beyond it: ee is not aa. Lips count as
spread from the second value on."""
WIDTH_REACH = 0.3  # changes of width approach this
LIP_SPEED = 2.0  # the gap changes no faster than this beside f and v, in eye distances a second (27 cm/s on a face)
PRESS_S = 0.03  # within this time from the first contact the lips are wholly pressed together
TUCKED_CHIN_SHARE = 0.6  # share of its drop by which the chin rises while the lower lip is on the teeth
LARGEST_UPPER_RISE, UPPER_RATE = 0.058, 5.2
"""The upper lip rises by at most the first length (5 mm), for small gaps by the product of both times the gap."""
JAW_SHARE = 0.85  # share of the lower lip's way that the chin goes: the lip also turns outwards
MIN_CHIN_DROP_SHARE = 0.75
"""Least drop of the chin, as a share of the usual one: trackers of small jaws, and models of them, show less."""
ROUND_SHARE = 0.15
"""Share of a smile, of corners pulled down or apart, and of a raised lip that is left on wholly protruded lips."""
PARTED_ROUND_SHARE = 0.75  # share by which a mood parts protruded lips less than others
SMILE_WIDTH, STRETCH_WIDTH, DROPPED_WIDTH = 0.16, 0.16, -0.14
"""A full smile, lips stretched in fear, and lips over a dropped jaw are so much wider than at rest."""
PARTED_GAP, DROPPED_GAP, RAISED_GAP = 0.05, 0.19, 0.05
"""Gaps of a mouth at rest that a mood parts, whose jaw it drops, and whose upper lip it raises."""
TIGHT_FULLNESS = 0.3  # tightened and pressed lips are thinner by this share
EXPRESSED = ("smile", "frown", "stretched", "upper_raise", "chin_raise", "tight")
"""What a mood does to the mouth beside its gap and its width."""
CORNERS = (f"x_{RIGHT_CORNER}", f"x_{LEFT_CORNER}")  # where the lip corners are across, in motion that has points
DRAWN = ("opening", "width", "outer", "y_152", *GESTURES)  # the channels of motion that are used


@dataclass(frozen=True, eq=False)
class SpokenMouth:
    """The mouth in F frames; each curve has the shape (F,)."""

    rate_hz: float  # frames per second; frame n is at ``n / rate_hz`` seconds
    gap: Curve  # distance between the inner lips; 0 where they touch, else at least ``contact.MIN_GAP``
    width: Curve  # distance of the lip corners, relative to the rest pose
    fullness: Curve  # thickness of the lips, relative to the rest pose
    jaw: Curve  # drop of the chin
    # the articulatory channels, 0 to 1 (docs/articulation.md)
    tongue: Curve
    tuck: Curve
    protrusion: Curve
    spread: Curve
    press: Curve
    teeth: Curve
    pursed: Curve  # how far protruded lips leave only a small hole, as in w, 0 to 1
    oval: Curve  # how far the opening is tall and narrow, as in aa, 0 to 1
    # what a mood does to corners, lips and chin, 0 to 1, as far as phones leave it free (``articulation.expression``)
    smile: Curve
    frown: Curve
    stretched: Curve
    upper_raise: Curve
    chin_raise: Curve
    tight: Curve

    @property
    def free(self) -> Curve:
        """How far the lips are free to part, 0 to 1: 0 in p, b and m."""
        return np.asarray(np.clip(1 - 2 * self.press, 0, 1))

    @property
    def contact(self) -> NDArray[np.bool_]:
        """The frames in which the lips touch [shape=(F,)]."""
        return np.asarray(self.gap == 0)

    @property
    def closing(self) -> Curve:
        """How far the lips are pressed together in p, b and m, 0 to 1 [shape=(F,)]; less where contact begins."""
        frames = np.arange(len(self.gap))
        before = np.maximum.accumulate(np.where(self.contact, -np.inf, frames))
        after = np.minimum.accumulate(np.where(self.contact, np.inf, frames)[::-1])[::-1]
        inside_s = np.minimum(frames - before, after - frames) / self.rate_hz
        return np.asarray(np.clip(2 * self.press - 1, 0, 1) * np.clip(inside_s / PRESS_S, 0, 1))

    @property
    def between_teeth(self) -> Curve:
        """How far the tip of the tongue is between the teeth, 0 to 1 [shape=(F,)]."""
        return np.clip((self.tongue - TIP_UP) / (TIP_OUT - TIP_UP), 0, 1)

    def with_corners(self, up: Curve, down: Curve) -> SpokenMouth:
        """Return the same mouth whose corners are raised and lowered further, 0 to 1 [each shape=(F,)]."""
        return replace(self, smile=np.minimum(self.smile + up, 1), frown=np.minimum(self.frown + down, 1))

    def at(self, fps: float) -> SpokenMouth:
        """Return the same mouth at another frame rate, to its last frame, with the contact of ``show_contact``."""
        if abs(fps - self.rate_hz) < 1e-9:
            return self
        time_s = compute_frame_times(len(self.gap), self.rate_hz, fps)
        rows = np.stack(list(self._curves().values()), axis=1)
        sampled = sample_pictures(rows, self.contact, self.rate_hz, time_s)
        return SpokenMouth(fps, *(np.ascontiguousarray(column) for column in sampled.T))

    def within(self, frames: slice) -> SpokenMouth:
        """Return the mouth in some frames alone."""
        return SpokenMouth(self.rate_hz, *(curve[frames] for curve in self._curves().values()))

    def rows(self) -> Iterator[dict[str, float]]:
        """Yield the values of every frame by the names of the curves."""
        curves = self._curves()
        for values in np.stack(list(curves.values()), axis=1).tolist():
            yield dict(zip(curves, values, strict=True))

    def _curves(self) -> dict[str, Curve]:
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "rate_hz"}


def find_mouth(motion: Motion, units: Timeline[Unit], fps: float | None = None) -> SpokenMouth:
    """Return the mouth of a motion and its phones in every frame.

    motion : needs ``opening``. ``width``, ``outer`` and the chin ``y_152`` are used where it has them, against the rest
             pose; articulatory channels that it lacks follow from the phones. With a channel ``lip_gap``, which motion
             of rigs has, phones say of the gap only that p, b and m close the lips
    units  : phones in time; may be empty
    fps    : frames per second, to the end of the motion; None: those of the motion
    In every p, b and m the lips touch (``contact.close_lips``).
    Raises InputError: no channel ``opening``, no frames, values that are not finite, fps not positive, or lips without
    width or thickness at rest.
    """
    check_spoken(motion, motion.rate_hz if fps is None else fps)
    rest, opening = find_rest_frames(motion, units), motion["opening"].astype(np.float64)
    weights = gesture_curves(units, motion.time_s, [name for name in SAID if name not in motion.names])
    weights |= {name: np.clip(motion[name].astype(np.float64), 0, 1) for name in {*SAID} & {*motion.names}}
    # w has half the press of p, with protruded lips: a hole that is almost closed
    weights["pursed"] = np.clip(weights["lip_press"] / (0.8 * PURSED_PRESS), 0, 1) * weights["protrusion"]
    weights["pursed"] *= np.clip((0.75 - weights["lip_press"]) / 0.15, 0, 1)
    mood, gap = list_action_units(motion), read_gap(motion)
    parting = ((25, PARTED_GAP), (26, DROPPED_GAP), (10, RAISED_GAP))
    if any(unit in mood for unit, _ in parting):  # where the lips are free, hardly where they are far apart
        wanted = sum(length * mood[unit] for unit, length in parting if unit in mood)
        free = np.clip(1 - 2 * weights["lip_press"], 0, 1) * (1 - PARTED_ROUND_SHARE * weights["protrusion"])
        gap = gap + free * wanted * np.clip(1 - gap / (2 * DROPPED_GAP), 0, 1)
    if GAP not in motion.names:
        gap += (1 - read_edited(motion, "opening")) * (_articulate(gap, weights, motion.time_s) - gap)
    gap = close_lips(gap, motion, units)
    expressed = _express(mood, weights)
    weights[OVAL] = weights[OVAL] * np.clip((gap - OVAL_GAPS[0]) / (OVAL_GAPS[1] - OVAL_GAPS[0]), 0, 1)
    width, fullness = _widen(motion, rest, weights | expressed), 1 - 0.4 * np.clip(opening, 0, 0.4)
    if "outer" in motion.names:
        thickness = (motion["outer"] - motion["opening"]).astype(np.float64)
        at_rest = measure_at_rest("thickness of the lips (outer - opening)", thickness, rest)
        fullness = np.clip(thickness / at_rest, 0.75, 1.25)
    jaw = usual = measure_jaw_drop(gap)
    if "y_152" in motion.names:  # as tracked (point 152, y upwards), within limits that suit the gap
        chin = motion["y_152"].astype(np.float64)
        jaw = np.clip(np.median(chin[rest]) - chin, MIN_CHIN_DROP_SHARE * usual, 1.15 * usual + 0.01)
    mouth = SpokenMouth(
        motion.rate_hz,
        gap,
        width,
        fullness * (1 - TIGHT_FULLNESS * expressed["tight"]),
        jaw * (1 - TUCKED_CHIN_SHARE * weights["lip_tuck"]),
        *(weights[name] for name in (*GESTURES, "pursed", OVAL)),
        **{name: expressed[name] for name in EXPRESSED},
    )
    return mouth if fps is None else mouth.at(fps)


def check_spoken(motion: Motion, fps: float) -> None:
    """Raise InputError if no mouth can be made of motion: no ``opening``, no frames, or values that are not finite."""
    if not 0 < fps < np.inf:
        raise InputError(f"the frame rate is {fps}, required more than 0")
    if "opening" not in motion.names:
        names = shorten_list(motion.names, 6) or "no channels"
        raise InputError(f"no channel 'opening' to draw a face from; the motion has: {names}")
    if not len(motion.values):
        raise InputError("the motion has no frames; there is nothing to draw")
    for name in (*DRAWN, GAP):
        if name in motion.names and not np.isfinite(motion[name]).all():
            raise InputError(f"the channel {name!r} has values that are not finite; interpolate missing frames first")


def weigh_upper(gap: Any) -> Any:
    """Return how far the upper lip rises for a gap; the rest of the gap is the lower lip's. Source: GRID speaker 1."""
    return LARGEST_UPPER_RISE * (1 - np.exp(-UPPER_RATE * np.asarray(gap)))


def measure_jaw_drop(gap: Any) -> Any:
    """Return how far the chin drops for a gap."""
    return JAW_SHARE * (np.asarray(gap) - weigh_upper(gap))


def _express(mood: dict[int, Curve], weights: dict[str, Curve]) -> dict[str, Curve]:
    """Return what a mood does to the mouth, as far as protruded and tucked lips leave it free [each shape=(T,)]."""
    none = np.zeros(len(weights["protrusion"]))
    free = 1 - (1 - ROUND_SHARE) * np.clip(weights["protrusion"], 0, 1)
    lifted = free * (1 - 0.5 * weights["lip_tuck"])
    return {
        "smile": mood.get(12, none) * free,
        "frown": mood.get(15, none) * free,
        "stretched": np.maximum(mood.get(20, none), 0.5 * mood.get(14, none)) * free,
        "upper_raise": np.maximum(mood.get(10, none), 0.5 * mood.get(9, none)) * lifted,
        "chin_raise": mood.get(17, none) * lifted,
        "tight": np.maximum(mood.get(23, none), mood.get(24, none)) * free,
        "dropped": mood.get(26, none) * free,
    }


def _articulate(gap: Curve, weights: dict[str, Curve], time_s: Curve) -> Curve:
    """Return a gap that suits what is said beside p, b and m: teeth on the lip, the tongue out, a round hole."""
    press, tuck, pursed = weights["lip_press"], weights["lip_tuck"], weights["pursed"]
    free = (1 - press) * np.clip(gap / 0.03, 0, 1)
    bared = np.maximum(2 * weights["teeth"] - 1, 0)
    for weight, low in ((bared, TEETH_GAPS[0]), (weights["protrusion"] ** 2 * (1 - pursed), ROUND_GAPS[0])):
        gap = gap + free * weight * (np.maximum(gap, low) - gap)
    spread = np.clip((weights["spread"] - SPREAD_FROM) / (1 - SPREAD_FROM), 0, 1) * (1 - weights["protrusion"])
    protruded = np.clip(4 * weights["protrusion"] - 3, 0, 1)  # oo, not oh
    for weight, high in ((spread * 2 / 3, SPREAD_GAP), (protruded, ROUND_GAPS[1]), (bared**2, TEETH_GAPS[1])):
        gap = gap - weight * np.maximum(gap - high, 0)
    between = np.clip((weights["tongue"] - TIP_UP) / (TIP_OUT - TIP_UP), 0, 1)
    apart = np.clip((0.75 - press) / 0.15, 0, 1)  # also where they were tracked as closed
    for weight, (low, high) in ((pursed, PURSED_GAP), (between * apart, TONGUE_GAP), (tuck * apart, TUCKED_GAP)):
        gap = gap + weight * (np.clip(gap, low, high) - gap)
    at_tucks = np.where(tuck > 0.5, gap, np.inf)  # the lip can reach every tucked frame at ``LIP_SPEED``
    after = np.minimum.accumulate(at_tucks - LIP_SPEED * time_s) + LIP_SPEED * time_s
    before = np.minimum.accumulate((at_tucks + LIP_SPEED * time_s)[::-1])[::-1] - LIP_SPEED * time_s
    return np.minimum(gap, np.minimum(after, before))


def _widen(motion: Motion, rest: NDArray[np.bool_], weights: dict[str, Curve]) -> Curve:
    change = -0.25 * np.clip(motion["opening"].astype(np.float64), 0, 0.4)
    if "width" in motion.names:
        across = motion["width"].astype(np.float64)
        change = across / measure_at_rest("width", across, rest) - 1
    elif {*CORNERS} <= {*motion.names}:
        across = (motion[CORNERS[1]] - motion[CORNERS[0]]).astype(np.float64)
        change = across / measure_at_rest("distance of the lip corners", across, rest) - 1
    width = 1 + WIDTH_REACH * np.tanh(change / WIDTH_REACH)
    for name, wider in (("smile", SMILE_WIDTH), ("stretched", STRETCH_WIDTH), ("dropped", DROPPED_WIDTH)):
        width = width + wider * weights[name]
    free = width
    for name, limit in (("protrusion", ROUND_WIDTH), ("pursed", PURSED_WIDTH), (OVAL, OVAL_WIDTH)):
        width = width + weights[name] * (np.minimum(width, limit) - width)
    spread = weights["spread"] * (1 - weights["protrusion"])
    width = width + spread * (np.maximum(width, SPREAD_WIDTH) - width)
    return np.asarray(width + read_edited(motion, "width") * (free - width))
