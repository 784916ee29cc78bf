"""Liveliness: what a speaking head does beside speaking: blinks, glances, raised brows, nods and sway.

All faces, meshes and curve sets have the same.

Everything follows from the phones in time, the loudness and pitch of the voice, and one seed; nothing depends on the
frame rate. Accents, where the voice is loud and high, raise the brows and nod the head; blinks prefer the ends of
phrases; the eyes leave the listener at the beginning of some phrases, and stay on him while the head turns.

Sources: blinks and phrases, A. R. Bentivoglio et al., "Analysis of blink rate patterns in normal subjects", Movement
Disorders 12, 1997 (26 a minute in conversation; here fewer, as a drawn face blinks too much sooner); brows with pitch,
C. Cavé et al., "About the relationship between eyebrow movements and F0 variations", ICSLP 1996; nods with accents,
H. P. Graf et al., "Visual prosody: facial movements accompanying speech", FG 2002. The sizes are ours, set by eye.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.articulation.expression import list_action_units
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import FRAME_RATE_HZ, Motion, Prosody, Timeline, Unit
from lipmotion.units import group_words, is_silent

Curve = NDArray[np.float64]
Spans = list[tuple[float, float]]  # starts and ends, s
Aim = tuple[float, float]  # to the left and upwards, rad

BLINK_S, MEAN_BLINK_S, MIN_BLINK_S = 0.24, 4.1, 1.1  # duration of a blink; mean and least time between two
FIRST_BLINK_S, SHUT_S = (1.0, 2.6), 0.08
"""Between these times the first blink comes; the eyes are shut so long after one begins."""
NEAR_BORDER_S = 0.06  # eyes are shut within this time of the border of a word, or in a pause
PHRASE_PAUSE_S = 0.15  # a pause of at least this duration ends a phrase
SACCADE_S = 0.05  # duration of a movement of the eyes
LARGEST_GLANCE = (0.2, 0.08)  # the furthest that the eyes turn to the side, and up or down, in radians
BROW_RAISE = 0.03  # for a strong accent, in eye distances
BROW_LEAD_S = 0.2  # brows rise so long before an accent, as those of tracked talkers do (docs/expression.md)
GAZE_COUNTER_SHARE = 0.85  # the eyes turn against the head by this part of its way, and so hold their target
SWAY, SWAY_HZ = (0.034, 0.016, 0.018), (0.08, 0.45)
"""Deviations of the slow turning of the head in speech, to the side, up and down, to a shoulder, in radians; and the
slowest and fastest parts of it."""
NOD_RAD, PHRASE_FALL_RAD = 0.045, 0.03
"""How far the head nods with a strong accent, and how much lower a phrase ends than it begins, in radians."""
STILL_SHARE = 0.35  # share of the turning of the head that is left in silence
MOOD_TURNS = [list(map(float, row.values())) for row in read_shipped_table("lipmotion.articulation", "mood_turns.csv")]
"""Action units, and how far the head turns for each to its left, upwards and to its left shoulder, in radians."""
MOOD_WANDER, MOOD_ACCENT = 0.13, 0.3
"""How far a mood comes and goes in the upper face, and how much stronger it is in a strong accent."""
MOOD_GAZE_RAD = 0.22  # how far the eyes look down for the action unit 64, in radians
DROOPING_LIDS = 0.75  # how far the eyes are closed by the action unit 43
UPPER_FACE_UNITS = {"inner": 1, "outer": 2, "lowered": 4, "wide": 5, "squint": 7, "cheek": 6, "sneer": 9}
"""The action units of the parts of ``UpperFace``."""


class UpperFace(NamedTuple):
    """What a mood does to brows, lids, cheeks and nose in one frame, each 0 to 1."""

    inner: float = 0.0  # the inner ends of the brows are raised
    outer: float = 0.0  # their outer ends are raised
    lowered: float = 0.0  # the brows are lowered and drawn together
    wide: float = 0.0  # the upper lids are raised
    squint: float = 0.0  # the lids are tightened: the lower ones raised, the upper ones lowered a little
    cheek: float = 0.0  # the cheeks are raised
    sneer: float = 0.0  # the nose is wrinkled


CALM = UpperFace()


@dataclass(frozen=True, eq=False)
class Liveliness:
    """Movements beside the mouth's, in F frames; all of them follow from ``given``, where that says it."""

    lids: Curve  # how far the eyes are closed, 0 to 1 [shape=(F,)]
    brows: Curve  # how far the brows are raised, in eye distances [shape=(F,)]
    gaze: Curve  # of the eyes against the head, to the character's left and upwards, in radians [shape=(F, 2)]
    turn: Curve  # of the head to its left, upwards and to its left shoulder, in radians [shape=(F, 3)]
    # what a mood does to brows, lids, cheeks and nose: its action units of ``UPPER_FACE_UNITS``, 0 to 1
    # [each shape=(F,)]; where blendshapes are given, also 12 and 15, the corners of the lips
    units: Mapping[int, Curve] = field(default_factory=dict)
    # weights that the motion itself has for blendshapes beside the mouth, by ARKit's names, 0 to 1 [each shape=(F,)]
    given: Mapping[str, Curve] = field(default_factory=dict)

    @property
    def upper_face(self) -> list[UpperFace]:
        """What a mood does beside the mouth in every frame."""
        if not self.units:
            return [CALM] * len(self.lids)
        rows = np.stack([self.unit(UPPER_FACE_UNITS[name]) for name in UpperFace._fields], axis=1).tolist()
        return [UpperFace(*row) for row in rows]

    def unit(self, number: int) -> Curve:
        """Return an action unit, 0 to 1 [shape=(F,)]; 0 where nothing asks for it."""
        return self.units.get(number, np.zeros(len(self.lids)))


def compute_liveliness(  # noqa: PLR0913
    time_s: Curve,
    motion: Motion,
    units: Timeline[Unit],
    prosody: Prosody | None,
    *,
    seed: int = 0,
    blinks: bool = True,
    gaze: bool = True,
    brows: bool = True,
    head: bool = True,
) -> Liveliness:
    """Return the movements beside the mouth's at the times of pictures, in seconds.

    motion  : needs ``opening`` where the prosody is not known
    prosody : of the speech; None: accents are where the mouth opens far
    Each of ``blinks``, ``gaze``, ``brows``, ``head`` that is off leaves the others as they are; without ``gaze`` the
    eyes still hold their target while the head turns.
    """
    still, end_s = np.zeros(len(time_s)), float(time_s[-1]) if len(time_s) else 0.0
    spoken = find_phrases(units)
    accent = _find_accents(motion, prosody)
    if len(units):
        accent = accent * _find_talking(spoken, np.arange(len(accent)) / FRAME_RATE_HZ)
    turn = np.zeros((len(time_s), 3))
    if head:
        turn = _turn_head(time_s, accent, _find_talking(spoken, time_s), spoken, np.random.default_rng([seed, 1]))
    words = [(span.start_s, span.end_s) for span in group_words(units) if span.label]
    lids = lid_closure(time_s, blink_times(end_s, spoken, words, np.random.default_rng([seed, 2]))) if blinks else still
    aim = _aim_eyes(time_s, end_s, spoken, np.random.default_rng([seed, 3])) if gaze else np.zeros((len(time_s), 2))
    raised = _raise_brows(time_s, accent, spoken, np.random.default_rng([seed, 4])) if brows else still
    mood, eyes = list_action_units(motion, time_s), aim - GAZE_COUNTER_SHARE * turn[:, :2]
    if mood and brows:  # it comes and goes in the upper face, and grows with accents
        slow = np.tanh(sway(time_s, np.random.default_rng([seed, 5]), 0.06, 0.3))
        accented = _at(_smooth(accent, 0.2), time_s + BROW_LEAD_S) - 0.4
        lively = 1 + MOOD_WANDER * slow + MOOD_ACCENT * accented
        mood |= {unit: np.clip(mood[unit] * lively, 0, 1) for unit in UPPER_FACE_UNITS.values() if unit in mood}
    for unit, *angles in MOOD_TURNS:
        if head and unit in mood:
            turned = mood[int(unit)][:, None] * np.array(angles)  # the eyes hold their target
            turn, eyes = turn + turned, eyes - GAZE_COUNTER_SHARE * turned[:, :2]
    if 64 in mood:
        eyes[:, 1] -= MOOD_GAZE_RAD * mood[64]
    if 43 in mood:
        lids = np.maximum(lids, DROOPING_LIDS * mood[43])
    units_shown = {unit: mood[unit] for unit in UPPER_FACE_UNITS.values() if unit in mood}
    return Liveliness(lids, raised, eyes, turn, units_shown)


def find_phrases(units: Timeline[Unit], pause_s: float = PHRASE_PAUSE_S) -> Spans:
    """Return start and end, in seconds, of every stretch of speech without a pause of ``pause_s``."""
    phrases = Spans()
    for span in units:
        if not is_silent(span.label.phone):
            if phrases and span.start_s - phrases[-1][1] < pause_s:
                phrases[-1] = phrases[-1][0], span.end_s
            else:
                phrases.append((span.start_s, span.end_s))
    return phrases


def blink_times(end_s: float, spoken: Spans, words: Spans, rng: np.random.Generator) -> list[float]:
    """Return when blinks begin, in seconds: at random, rather at the end of a phrase, never in the middle of a word."""
    ends = np.array([end for _, end in spoken] or [-np.inf])
    starts_s, ends_s = np.array(words).reshape(-1, 2).T

    def is_in_word(begin: float) -> bool:
        shut = begin + SHUT_S
        return bool(np.any((starts_s + NEAR_BORDER_S < shut) & (shut < ends_s - NEAR_BORDER_S)))

    begins: list[float] = []
    at = float(rng.uniform(*FIRST_BLINK_S))
    while at < end_s:
        near = ends[np.abs(ends - at) < 0.7]
        chosen = float(near[0]) - 0.05 if len(near) and rng.random() < 0.7 else at
        if is_in_word(chosen):
            borders = np.concatenate([starts_s, ends_s])
            chosen = float(borders[np.abs(borders - chosen - SHUT_S).argmin()]) - SHUT_S
        if chosen >= FIRST_BLINK_S[0] and (not begins or chosen > begins[-1] + MIN_BLINK_S):
            begins.append(chosen)
            if rng.random() < 0.1 and not is_in_word(chosen + 0.34):  # a double blink
                begins.append(chosen + 0.34)
        at += MIN_BLINK_S + float(rng.gamma(2.0, (MEAN_BLINK_S - MIN_BLINK_S) / 2))
    return begins


def lid_closure(time_s: Curve, blink_s: list[float]) -> Curve:
    """Return how far the eyes are closed at each time, 0..1 [shape=(T,)]; the lids fall faster than they rise."""
    closed = np.zeros(len(time_s))
    for begin in blink_s:
        first, last = np.searchsorted(time_s, (begin, begin + BLINK_S))
        share = (time_s[first:last] - begin) / BLINK_S
        shut = np.clip(np.where(share < 0.38, share / 0.3, (1 - share) / 0.55), 0, 1)
        closed[first:last] = np.maximum(closed[first:last], np.sin(shut * np.pi / 2) ** 2)
    return closed


def _smooth(curve: Curve, deviation_s: float) -> Curve:
    """Return a curve at 100 Hz smoothed by a Gaussian; the ends are repeated."""
    return scipy.ndimage.gaussian_filter1d(curve, deviation_s * FRAME_RATE_HZ, mode="nearest")


def _find_accents(motion: Motion, prosody: Prosody | None) -> Curve:
    """Return how strongly the voice is accented at 100 Hz, about 0 to 1 [shape=(T,)]."""
    if prosody is None or len(prosody.level_db) < 2:
        opening = motion.resampled(FRAME_RATE_HZ)["opening"].astype(float)
        loud = _smooth(opening, 0.07) / max(float(np.percentile(opening, 95)), 0.05)
        return np.clip(loud - 0.45, 0, 1) * 1.2
    level = _smooth(np.maximum(prosody.level_db, prosody.level_db.max() - 40), 0.05)
    loud = np.clip((level - (level.max() - 18)) / 18, 0, 1)
    voiced = np.isfinite(prosody.log_f0)
    if voiced.sum() < 10:
        return 0.7 * np.clip(loud - 0.4, 0, 1)
    pitch = np.where(voiced, prosody.log_f0, 0.0).astype(float)
    centre, spread = float(np.median(pitch[voiced])), max(float(pitch[voiced].std()), 0.05)
    weight = _smooth(voiced.astype(float), 0.06)
    high = _smooth(np.where(voiced, (pitch - centre) / spread, 0), 0.06) / np.maximum(weight, 0.2)
    return np.clip(0.35 * np.clip(high, -1, 2.5) + 0.8 * loud - 0.45, 0, 1.2)


def _at(curve: Curve, time_s: Curve) -> Curve:
    return np.interp(time_s, np.arange(len(curve)) / FRAME_RATE_HZ, curve)


def _find_talking(spoken: Spans, time_s: Curve) -> Curve:
    """Return 1 in phrases and 0 away from them, with soft edges [shape=(N,)]."""
    level = np.zeros(len(time_s))
    for begin, end in spoken:
        first, last = np.searchsorted(time_s, (begin - 0.6, end + 0.9))
        near = time_s[first:last]
        rise = np.clip((near - begin + 0.6) / 0.6, 0, 1) * np.clip((end + 0.9 - near) / 0.9, 0, 1)
        level[first:last] = np.maximum(level[first:last], smooth_step(rise))
    return level


def sway(time_s: Curve, rng: np.random.Generator, slowest_hz: float, fastest_hz: float) -> Curve:
    """Return smooth noise of about unit deviation: five sines of random frequencies and phases [shape=(N,)]."""
    rates = np.exp(rng.uniform(np.log(slowest_hz), np.log(fastest_hz), 5))
    phases = rng.uniform(0, 2 * np.pi, 5)
    strengths = 1 / np.sqrt(rates / slowest_hz)
    waves = np.sin(2 * np.pi * rates[:, None] * time_s + phases[:, None])
    return np.asarray(strengths @ waves / np.sqrt(np.sum(strengths**2) / 2))


def _turn_head(time_s: Curve, accent: Curve, talking: Curve, spoken: Spans, rng: np.random.Generator) -> Curve:
    lively = STILL_SHARE + (1 - STILL_SHARE) * talking
    yaw, pitch, roll = (size * sway(time_s, rng, *SWAY_HZ) for size in SWAY)
    nod = _at(_smooth(accent, 0.11), time_s + 0.04)
    tilt = np.zeros(len(time_s))
    for begin, end in spoken:  # every phrase has its own pose, and ends a little lower
        side, about = rng.normal(0, 1, 2).clip(-1.6, 1.6)
        first, last = np.searchsorted(time_s, (begin - 0.5, end + 0.8))
        near = time_s[first:last]
        rise = smooth_step(np.clip((near - begin + 0.5) / 0.7, 0, 1) * np.clip((end + 0.8 - near) / 0.8, 0, 1))
        roll[first:last] += 0.9 * SWAY[2] * side * rise
        yaw[first:last] += 0.9 * SWAY[0] * about * rise
        tilt[first:last] += rise * (np.clip((near - begin) / max(end - begin, 0.1), 0, 1) - 0.5)
    return np.stack([lively * yaw, lively * pitch - NOD_RAD * nod - PHRASE_FALL_RAD * tilt, lively * roll], axis=1)


def _raise_brows(time_s: Curve, accent: Curve, spoken: Spans, rng: np.random.Generator) -> Curve:
    raised = BROW_RAISE * _at(_smooth(accent, 0.1), time_s + BROW_LEAD_S)
    raised += 0.003 * (1 + np.tanh(sway(time_s, rng, 0.05, 0.3)))
    for begin, _ in spoken:  # some phrases begin with raised brows
        strength = float(rng.uniform(-0.6, 1.0))
        if strength > 0:
            first, last = np.searchsorted(time_s, (begin - 0.25, begin + 0.75))
            wave = np.sin(np.pi * np.clip((time_s[first:last] - begin + 0.25) / 1.0, 0, 1)) ** 2
            raised[first:last] += 0.6 * BROW_RAISE * strength * wave
    return raised


def draw_fixation(rng: np.random.Generator, last: Aim, at_border: bool) -> tuple[Aim, float]:
    """Return where the eyes look next, to the left and upwards, radians, and for how long, seconds.

    last      : where they look now: who looks away looks back
    at_border : a phrase begins, where they rather leave the listener
    """
    if abs(last[0]) < 0.04 and rng.random() < (0.5 if at_border else 0.14):
        side = float(rng.choice([-1.0, 1.0]))
        far, high = float(rng.uniform(0.45, 1)), float(rng.uniform(-0.6, 1))
        return (side * LARGEST_GLANCE[0] * far, LARGEST_GLANCE[1] * high), float(rng.uniform(0.35, 0.9))
    return (float(rng.normal(0, 0.018)), float(rng.normal(0, 0.012))), float(rng.uniform(0.5, 2.0))


def _aim_eyes(time_s: Curve, end_s: float, spoken: Spans, rng: np.random.Generator) -> Curve:
    """Return where the eyes look, to the left and upwards in radians [shape=(F, 2)]: steps between fixations."""
    moments, targets = [0.0], [(0.0, 0.0)]
    begins = np.array([begin for begin, _ in spoken] or [np.inf])
    at = float(rng.uniform(0.4, 1.2))
    while at < end_s:
        target, stay = draw_fixation(rng, targets[-1], np.abs(begins - at).min() < 0.8)
        moments.append(at)
        targets.append(target)
        at += stay
    steps, begun_s = np.array(targets), np.array(moments)
    last = np.maximum(np.searchsorted(begun_s, time_s, "right") - 1, 0)  # every fixation is longer than a movement
    before, share = steps[np.maximum(last - 1, 0)], smooth_step((time_s - begun_s[last]) / SACCADE_S)
    return np.asarray(before + share[:, None] * (steps[last] - before))
