"""Damaged pictures: repeated ones, and dark, blurred and smeared mouths beside all others of the same person.

Video that lost data is predicted from pictures that are not there: the mouth smears, until the next key picture repairs
it at once. Such a mouth is unlike any other of the person, as a rare one is too, but a rare one comes and goes slowly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.frame_labels import find_runs
from lipmotion.stats.pca import choose_evenly
from lipmotion_faces.tracking.packages import import_opencv

Pictures = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Floats = NDArray[np.float32]
Damage = dict[str, Mask]  # masks of pictures [shape=(T,)] by the kind of damage

REPEATED_SHARE = 0.12
"""A picture repeats the one before if it differs less than this share of how much most pictures (75 %) do: decoders add
noise to repeated ones (H.264: up to 0.1 where they are frozen, up to 0.4 where single ones are doubled, most of which
are not found; 93 clips of GRID: at most 1 picture of 6,882 is below)."""
LARGEST_SHARE = 1 / 3
"""Where more pictures repeat the one before, they are drawn and may stay as they are (toy faces: half of them)."""
FROZEN_S = 0.2
"""Pictures that repeat one another for so long are frozen; single ones are doubled, as by changed frame rates."""
JUMP = 1.5
"""The picture after frozen ones differs at least this much more than most; people who stand still differ less."""
MAX_COMPARED = 4000  # mouths of a person that each one is compared with, spread evenly
MIN_COMPARED = 500  # with fewer mouths, no one can say what is unlike the others
APART_S = 10.0  # a mouth is compared with other clips, and with its own from so far away on: smears last seconds
SIZE, FINE_PX, COARSE_PX = (24, 18), 1.0, 5.0
"""Size of a compared mouth, and the details in it: between these two standard deviations, px of the mouth region."""
MIN_CONTRAST = 20.0  # mouths with less contrast than this have none: of noise nothing can be compared
UNLIKE, REPAIR = 2.5, 4.5
"""A mouth is unlike all others at this multiple of the median of one less the best correlation; it is smeared, if the
next one is not, and is lower by the second multiple (GRID s1: 7 clips of 524, each repaired at a key picture)."""
MIN_USUAL = 0.01  # smallest median that counts: in footage of a still mouth it is 0
MIN_SMEARED = 2  # pictures that are smeared, at least: a mouth may be unlike others for one
SHARPNESS, BLUR_FRAMES = 0.7, 5
"""Mouths are blurred if the median of so many in a row has less than this share of the person's sharpness (GRID s1:
0.68 in one damaged clip, at least 0.8 in the others)."""
DARKNESS = 0.4  # mouths are dark below this share of the person's light (GRID s1: 0.85 and more)


def find_repeated(changes: Sequence[float], rate_hz: float) -> tuple[Mask, Mask]:
    """Return which pictures repeat the one before, and which are frozen, among them [both shape=(T,)].

    changes : mean difference of each picture from the one before, grey levels; of the first, infinity
    """
    known = [change for change in changes if np.isfinite(change)] or [0.0]
    repeated = np.array(changes) < REPEATED_SHARE * np.percentile(known, 75)
    repeated &= repeated.mean() < LARGEST_SHARE
    frozen = np.zeros(len(repeated), bool)
    for start, stop in find_runs(repeated).tolist():
        jumps = stop < len(repeated) and changes[stop] >= JUMP * np.percentile(known, 75)
        frozen[start:stop] = jumps and stop - start >= FROZEN_S * rate_hz
        repeated[start:stop] = frozen[start:stop] | (stop - start == 1)
    return repeated, frozen


def describe_damage(damage: Damage, times_s: NDArray[np.float64]) -> tuple[str, ...]:
    """Return notes on damaged pictures at some times: what is damaged, from when to when."""
    texts = {
        kind: ", ".join(f"{times_s[start]:.2f} to {times_s[stop - 1]:.2f} s" for start, stop in find_runs(mask))
        for kind, mask in damage.items()
    }
    return tuple(f"{kind} pictures: {text}" for kind, text in texts.items() if text)


def find_damaged(
    clips: Sequence[Callable[[], Pictures]], seen: Sequence[Mask], rate_hz: Sequence[float], *, is_one: bool = True
) -> list[Damage]:
    """Return, for each clip of one person, which mouths are dark, blurred and smeared.

    clips   : each returns the mouth pictures of a clip [shape=(T, 56, 72, 3)]; it is called twice, one after the other
    seen    : in which frames of each clip the mouth is seen [shape=(T,)]
    rate_hz : frame rate of each clip
    is_one  : False: who is in them is not known; light and sharpness are compared within each clip
    Returns masks [shape=(T,)] by the kind of damage. Where there is too little to compare with, nothing is smeared.
    """
    if not clips:
        return []
    places = np.array([(n, frame) for n, mask in enumerate(seen) for frame in np.flatnonzero(mask)]).reshape(-1, 2)
    places = places[choose_evenly(MAX_COMPARED, len(places))]
    looks, bank = [], []
    for number, clip in enumerate(clips):
        *look, details = _describe(clip())
        looks.append(look)
        bank.append(details[places[places[:, 0] == number, 1]])
    unlike = []
    for number, (clip, rate) in enumerate(zip(clips, rate_hz, strict=True)):
        own_frames = np.where(places[:, 0] == number, places[:, 1], -(10**9))
        unlike.append(_measure_unlikeness(_describe(clip())[2], np.concatenate(bank), own_frames, APART_S * rate))
    usual = max(_find_median(unlike, seen), MIN_USUAL)
    result = []
    for number, (mask, values) in enumerate(zip(seen, unlike, strict=True)):
        others = slice(None) if is_one else slice(number, number + 1)
        light, sharpness = (_find_median([look[part] for look in looks[others]], seen[others]) for part in (0, 1))
        lights, sharp = looks[number]
        padded = np.pad(sharp, BLUR_FRAMES // 2, "edge")
        steady = np.median(np.lib.stride_tricks.sliding_window_view(padded, BLUR_FRAMES), axis=-1)
        dark, blurred = lights < DARKNESS * light, steady < SHARPNESS * sharpness
        masks = {"dark": dark, "blurred": blurred, "smeared": _find_smeared(values / usual)}
        result.append({kind: mask & which for kind, which in masks.items()})
    return result


def _find_median(values: Sequence[Floats], masks: Sequence[Mask]) -> float:
    some = np.concatenate([each[mask] for each, mask in zip(values, masks, strict=True)])
    return float(np.median(some)) if len(some) else 0.0


def _find_smeared(unlike: Floats) -> Mask:
    """Return which mouths are unlike all others until they are repaired at once."""
    result = np.zeros(len(unlike), bool)
    for start, stop in find_runs(unlike > UNLIKE).tolist():
        if stop < len(unlike) and stop - start >= MIN_SMEARED and unlike[stop - 1] - unlike[stop] >= REPAIR:
            result[start:stop] = True
    return result


def _measure_unlikeness(mouths: Floats, bank: Floats, frames: NDArray[np.intp], apart: float) -> Floats:
    """Return one less the best correlation of each mouth with those of a bank not near it in its own clip; 0: few."""
    is_near = np.abs(np.arange(len(mouths))[:, None] - frames) < apart
    if not len(mouths) or (~is_near).sum(axis=1).min() < MIN_COMPARED:
        return np.zeros(len(mouths), np.float32)
    return np.asarray(1 - np.where(is_near, -1, mouths @ bank.T).max(axis=1))


def _describe(mouths: Pictures) -> tuple[Floats, Floats, Floats]:
    """Return light, sharpness [shape=(T,)] and details [shape=(T, 432), of length 1] of mouths."""
    cv2 = import_opencv()
    light, sharpness, details = [], [], []
    for mouth in mouths:
        grey = mouth.mean(axis=-1, dtype=np.float32)
        fine, coarse = (cv2.GaussianBlur(grey, (0, 0), width) for width in (FINE_PX, COARSE_PX))
        detail = cv2.resize(fine - coarse, SIZE, interpolation=cv2.INTER_AREA).ravel()
        detail -= detail.mean()
        light.append(grey.mean())
        sharpness.append(np.abs(cv2.Laplacian(grey, cv2.CV_32F)).mean() / max(float(grey.mean()), 1.0))
        details.append(detail / max(float(np.linalg.norm(detail)), MIN_CONTRAST))
    return np.array(light), np.array(sharpness), np.array(details, np.float32)
