"""By how much one recording of a sound is later than another one, from claps or beeps in both, or from all of it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.speech.features.mfcc import compute_delta
from lipmotion.speech.sound.pauses import STEP_S, average_powers
from lipmotion.types import Audio, Features

CLAP, BEEP = "clap", "beep"
CLAP_STEP_S = 0.001
"""Distance of the levels in which claps are looked for."""
BEFORE_S, RISE_S = 0.06, 0.004
"""A clap is louder within ``RISE_S`` than everything in ``BEFORE_S`` before it..."""
MIN_RISE_DB = 18.0
"""...by this much..."""
DECAY_S, MIN_DECAY_DB = (0.15, 0.25), 15.0
"""...and between these times after it, it has become this much quieter."""
MIN_LEVEL_DB = -15.0
"""Claps have at least this level against the loudest millisecond of the recording."""
APART_S = 0.3
"""Where several marks are nearer to each other, the strongest counts."""
MAX_MARKS = 20
"""Most marks of a kind that are kept, the strongest."""
BEEP_FRAME_S, BEEP_STEP_S = 0.032, 0.008
MIN_TONE_SHARE = 0.9
"""Share of the energy of a beep that is in three neighbouring bands of its spectrum (96 Hz at 16 kHz)."""
MIN_BEEP_S, MIN_BEEP_HZ = 0.1, 500.0
MIN_BEEP_LEVEL_DB = -30.0
"""Beeps have at least this level against the loudest frame."""
FLOOR = 1e-10
BLOCK = 4096
"""Frames whose spectrum is computed at once."""


@dataclass(frozen=True)
class SoundMark:
    """A clap or a beep.

    time_s      : when it begins
    kind        : ``clap`` or ``beep``
    strength_db : how much it stands out
    hertz       : pitch of a beep, else 0
    """

    time_s: float
    kind: str
    strength_db: float
    hertz: float = 0.0


def find_marks(audio: Audio) -> tuple[SoundMark, ...]:
    """Return the claps and beeps of a recording, by time; there may be none, or sounds that only resemble them."""
    marks = [*_find_claps(audio), *_find_beeps(audio)]
    return tuple(sorted(marks, key=lambda mark: mark.time_s))


def _find_claps(audio: Audio) -> list[SoundMark]:
    from scipy.ndimage import maximum_filter1d

    sharp = np.diff(audio.samples, prepend=audio.samples[:1])  # claps are brighter than speech
    power = average_powers(sharp, round(CLAP_STEP_S * audio.rate_hz))
    before, rise = round(BEFORE_S / CLAP_STEP_S), round(RISE_S / CLAP_STEP_S)
    early, late = (round(time_s / CLAP_STEP_S) for time_s in DECAY_S)
    if len(power) < before + late + 1:
        return []
    level = 10 * np.log10(power + FLOOR)
    loudest_before = maximum_filter1d(level, before, origin=(before - 1) // 2, mode="nearest")
    peak = maximum_filter1d(level, rise, origin=-(rise // 2), mode="nearest")
    sums = np.concatenate([[0.0], np.cumsum(power)])
    begin = np.minimum(np.arange(len(power)) + early, len(power) - 1)
    end = np.minimum(np.arange(len(power)) + late, len(power))
    after = 10 * np.log10((sums[end] - sums[begin]) / np.maximum(end - begin, 1) + FLOOR)
    rises = peak[1:] - loudest_before[:-1]
    decays = (peak - after)[1:]
    good = (rises >= MIN_RISE_DB) & (decays >= MIN_DECAY_DB) & (peak[1:] >= level.max() + MIN_LEVEL_DB)
    strength = np.minimum(rises, decays)
    frames = np.flatnonzero(good)
    strongest: list[int] = []
    for frame in frames[np.argsort(-strength[frames], kind="stable")].tolist():
        if all(abs(frame - other) >= APART_S / CLAP_STEP_S for other in strongest):
            strongest.append(frame)
    return [SoundMark((n + 1) * CLAP_STEP_S, CLAP, float(strength[n])) for n in strongest[:MAX_MARKS]]


def _find_beeps(audio: Audio) -> list[SoundMark]:
    size, step = round(BEEP_FRAME_S * audio.rate_hz), round(BEEP_STEP_S * audio.rate_hz)
    count = (len(audio.samples) - size) // step + 1
    if count < 1:
        return []
    windows = np.lib.stride_tricks.sliding_window_view(audio.samples, size)[::step]
    tone, hertz, level = np.zeros(count), np.zeros(count), np.zeros(count)
    taper = np.hanning(size).astype(np.float32)
    for start in range(0, count, BLOCK):
        frames = slice(start, min(start + BLOCK, count))
        power = np.abs(np.fft.rfft(windows[frames] * taper, axis=1)) ** 2
        bands = power[:, 1:-1] + power[:, :-2] + power[:, 2:]
        best = bands.argmax(axis=1)
        level[frames] = power.sum(axis=1)
        tone[frames] = bands[np.arange(len(best)), best] / (level[frames] + FLOOR)
        hertz[frames] = (best + 1) / BEEP_FRAME_S
    level = 10 * np.log10(level + FLOOR)
    good = (tone >= MIN_TONE_SHARE) & (hertz >= MIN_BEEP_HZ) & (level >= level.max() + MIN_BEEP_LEVEL_DB)
    same = np.concatenate([[False], good[1:] & good[:-1] & (np.abs(np.diff(hertz)) <= 1.01 / BEEP_FRAME_S), [False]])
    starts = np.flatnonzero(same[1:] & ~same[:-1])
    ends = np.flatnonzero(same[:-1] & ~same[1:])
    least = MIN_BEEP_S / BEEP_STEP_S
    long = [(first, last) for first, last in zip(starts.tolist(), ends.tolist(), strict=True) if last - first >= least]
    marks = []
    for first, last in long:
        frames = slice(first, last + 1)
        time_s, pitch = (first * step + size / 2) / audio.rate_hz, float(np.median(hertz[frames]))
        marks.append(SoundMark(time_s, BEEP, float(level[frames].mean()), pitch))
    return sorted(marks, key=lambda mark: -mark.strength_db)[:MAX_MARKS]


Array = NDArray[np.float64]

ALIKE = "the sound of both"
MIN_OVERLAP_SHARE = 0.5
"""Share of the shorter recording that the other one must cover, where levels are compared."""
SAME_S = 0.03
"""Marks whose offsets differ by less are of one offset."""
SAME_PITCH_HZ = 40.0
"""Beeps whose pitches differ by less are the same beep."""
MIN_LEVEL_CORRELATION, MIN_MARGIN, PEAK_S = 0.5, 0.1, 0.25
"""Least correlation of levels at which the sounds alone decide, by how much it must exceed all others, and how far from
the best an offset is another one."""
MIN_MARK_CORRELATION = 0.15
"""Marks alone decide, without any likeness of the sounds, only where no other offset is possible."""
WAVEFORM_CORRELATION = 0.3
"""Where sounds around beeps correlate by this much, their waveforms are more exact than the beginnings of beeps."""
MARK_SCORE = 0.3
"""What each of up to two marks at one offset counts, besides the correlation."""
FINE_S, FINE_MARK_S, FINE_BEEP_S = 0.06, 0.01, 0.003
"""How far the fine search goes around the coarse offset: of whole sounds, of claps, and of sounds around beeps."""
FINE_WINDOW_S = 20.0
MARK_WINDOW_S = (0.03, 0.12)
"""What is compared before and after a clap, or looked at around the beginning of a beep."""
SMOOTH_S, PLATEAU_S = 0.004, (0.04, 0.1)
"""The loudness of a beep is smoothed over the first; the second is the part of it whose loudness is its own."""


@dataclass(frozen=True)
class SoundOffset:
    """The offset of a recording from another one of the same sounds.

    late_s : what sounds at t in the first sounds at t + ``late_s`` in the second
    how    : ``clap``, ``beep``, or ``the sound of both``
    alike  : correlation of the levels at this offset, −1 to 1
    """

    late_s: float
    how: str
    alike: float


def measure_offset(first: Audio, second: Audio) -> SoundOffset:
    """Return by how much the second recording is later than the first.

    first, second : the same sounds, recorded by two machines that began at different times; at the same rate
    A clap or a beep in both is found, and checked against all of the sound; without one, the levels of both are
    compared at every offset. Then it is refined by the waveforms to a fraction of a millisecond.
    Raises InputError: neither tells: no clap and no beep in both, and sounds that are not alike.
    """
    if first.rate_hz != second.rate_hz:
        raise InputError(f"sounds of {first.rate_hz} and {second.rate_hz} Hz, required one rate")
    levels = _measure_levels(first), _measure_levels(second)
    likeness = _Likeness(*levels)
    hypotheses = _pair_marks(find_marks(first), find_marks(second))
    best_s, best, second_best = likeness.find_best()
    candidates = [
        (likeness.score(late_s) + MARK_SCORE * min(len(pairs), 2), late_s, pairs) for late_s, pairs in hypotheses
    ]
    certain = best >= MIN_LEVEL_CORRELATION and best - second_best >= MIN_MARGIN
    if candidates:
        score, late_s, pairs = max(candidates, key=lambda each: each[0])
        alike = likeness.score(late_s)
        alone = len(candidates) == 1 or len(pairs) > 1
        if not (certain and best > score) and (alike >= MIN_MARK_CORRELATION or alone):
            kind = pairs[0][0].kind
            lates_s = []
            for one, other in pairs:
                if kind == BEEP:  # its waves are all alike
                    lates_s.append(_find_beginning(second, other) - _find_beginning(first, one))
                else:
                    span_s = one.time_s - MARK_WINDOW_S[0], one.time_s + MARK_WINDOW_S[1]
                    lates_s.append(_match(first, second, span_s, other.time_s - one.time_s, FINE_MARK_S))
            fine_s = float(np.median(lates_s))
            if kind == BEEP and alike >= WAVEFORM_CORRELATION:
                fine_s = _refine(first, second, fine_s, FINE_BEEP_S)
            return SoundOffset(fine_s, kind, alike)
    if certain:
        return SoundOffset(_refine(first, second, best_s, FINE_S), ALIKE, best)
    marks = f"{len(candidates)} offsets fit claps or beeps" if candidates else "no clap and no beep is in both"
    raise InputError(
        f"the offset of the two sounds is not clear: {marks}, and their levels correlate by {best:.2f} at most, "
        f"required {MIN_LEVEL_CORRELATION}; give the offset (--offset-ms, or offsets.csv)"
    )


class _Likeness:
    """Correlation of two rows of levels at every offset that leaves ``MIN_OVERLAP_SHARE`` of both."""

    def __init__(self, first: Array, second: Array) -> None:
        from scipy.signal import fftconvolve

        ones = np.ones(len(first)), np.ones(len(second))
        flipped, ones_flipped = first[::-1], ones[0][::-1]
        count = np.maximum(fftconvolve(ones[1], ones_flipped), 1e-9)
        sums = fftconvolve(ones[1], flipped), fftconvolve(second, ones_flipped)
        squares = fftconvolve(ones[1], flipped**2), fftconvolve(second**2, ones_flipped)
        spread = [np.maximum(square - total**2 / count, 1e-9) for square, total in zip(squares, sums, strict=True)]
        scores = (fftconvolve(second, flipped) - sums[0] * sums[1] / count) / np.sqrt(spread[0] * spread[1])
        long = MIN_OVERLAP_SHARE * min(len(first), len(second))
        # a short overlap is alike by chance; it counts less
        self.scores = np.where(count >= long, scores * np.sqrt(1 - long / (2 * np.maximum(count, long))), 0.0)
        self.zero = len(first) - 1

    def score(self, late_s: float) -> float:
        """Return the correlation near an offset; 0 where there is no overlap."""
        middle = self.zero + round(late_s / STEP_S)
        near = self.scores[max(middle - 1, 0) : max(middle + 2, 0)]
        return float(near.max()) if len(near) else 0.0

    def find_best(self) -> tuple[float, float, float]:
        """Return the best offset in seconds, its correlation, and the highest one elsewhere."""
        top = int(self.scores.argmax())
        away = np.abs(np.arange(len(self.scores)) - top) > PEAK_S / STEP_S
        return (top - self.zero) * STEP_S, float(self.scores[top]), float(self.scores[away].max(initial=-1.0))


def _measure_levels(audio: Audio) -> Array:
    """Return the level of every 10 ms, without what is quieter than the quiet tenth [shape=(N,)]."""
    power = average_powers(audio.samples, round(STEP_S * audio.rate_hz))
    if not len(power):
        raise InputError(f"{audio.duration_s * 1000:.0f} ms of sound, required more than {STEP_S * 1000:.0f}")
    levels = np.log10(power + 1e-10)
    levels = np.maximum(levels, np.percentile(levels, 10))
    return levels - levels.mean()


def _pair_marks(
    first: tuple[SoundMark, ...], second: tuple[SoundMark, ...]
) -> list[tuple[float, list[tuple[SoundMark, SoundMark]]]]:
    """Return offsets at which marks of both fall together, each with the pairs of marks that do."""
    pairs = [
        (one, other)
        for one in first
        for other in second
        if one.kind == other.kind and abs(one.hertz - other.hertz) <= SAME_PITCH_HZ
    ]
    pairs.sort(key=lambda pair: pair[1].time_s - pair[0].time_s)
    groups: list[list[tuple[SoundMark, SoundMark]]] = []
    for pair in pairs:
        late_s = pair[1].time_s - pair[0].time_s
        if groups and late_s - (groups[-1][0][1].time_s - groups[-1][0][0].time_s) <= SAME_S:
            groups[-1].append(pair)
        else:
            groups.append([pair])
    return [(float(np.median([b.time_s - a.time_s for a, b in group])), group) for group in groups]


def _find_beginning(audio: Audio, beep: SoundMark) -> float:
    """Return when a beep has first half of its loudness."""
    rate = audio.rate_hz
    begin = round((beep.time_s - MARK_WINDOW_S[1]) * rate)
    samples = _cut(audio.samples, begin, round((beep.time_s + MARK_WINDOW_S[1]) * rate))
    turned = samples * np.exp(-2j * np.pi * beep.hertz * np.arange(len(samples)) / rate)
    width = round(SMOOTH_S * rate)
    loudness = np.abs(np.convolve(turned, np.hanning(width + 2), mode="same"))
    own = [round((MARK_WINDOW_S[1] + time_s) * rate) for time_s in PLATEAU_S]
    return (begin + int(np.argmax(loudness >= 0.5 * np.median(loudness[own[0] : own[1]])))) / rate


def _refine(first: Audio, second: Audio, late_s: float, reach_s: float) -> float:
    """Return an offset, refined around its coarse value by the loudest part of what both have."""
    low, high = max(0.0, -late_s), min(first.duration_s, second.duration_s - late_s)
    if high - low > FINE_WINDOW_S:
        size = round(STEP_S * first.rate_hz)
        power = first.samples[round(low * first.rate_hz) : round(high * first.rate_hz)].astype(np.float64) ** 2
        sums = np.concatenate([[0.0], np.cumsum(power[: len(power) // size * size].reshape(-1, size).sum(axis=1))])
        width = round(FINE_WINDOW_S / STEP_S)
        low += int((sums[width:] - sums[:-width]).argmax()) * STEP_S
        high = low + FINE_WINDOW_S
    return _match(first, second, (low, high), late_s, reach_s)


def _match(first: Audio, second: Audio, span_s: tuple[float, float], late_s: float, reach_s: float) -> float:
    """Return the offset at which the waveforms of a span agree best, within ``reach_s`` of a coarse one.

    The spectra are whitened: rooms and microphones change how loud each frequency is, not its time.
    Source: Knapp and Carter 1976, "The generalized correlation method for estimation of time delay" (PHAT).
    """
    rate = first.rate_hz
    begin, end = (round(time_s * rate) for time_s in span_s)
    shift, reach = round(late_s * rate), round(reach_s * rate)
    one = _cut(first.samples, begin, end)
    other = _cut(second.samples, begin + shift - reach, end + shift + reach)
    size = 1 << int(np.ceil(np.log2(len(one) + len(other))))
    cross = np.fft.rfft(other, size) * np.conj(np.fft.rfft(one, size))
    cross /= np.abs(cross) + 0.05 * np.abs(cross).mean() + 1e-20
    scores = np.fft.irfft(cross, size)[: 2 * reach + 1]
    return (shift - reach + int(scores.argmax())) / rate


def _cut(samples: NDArray[np.float32], begin: int, end: int) -> Array:
    """Return the samples from ``begin`` to ``end``; where there are none, silence."""
    inner = samples[max(begin, 0) : max(end, 0)].astype(np.float64)
    front = max(0, min(-begin, end - begin))
    return np.pad(inner, (front, max(0, end - begin - front - len(inner))))


STATIC_FEATURES = 13
"""The first columns of the features, which are used: c1–c12 and log energy; their context holds the deltas."""
FRAME_OFFSETS = tuple(range(-15, 16, 3))
"""The context of a frame, in frames from it: 150 ms before and after."""
WEIGHTS = "lip-speed.json"


def predict_opening_speed(features: Features) -> Array:
    """Return the predicted opening speed of the lips [shape=(T,)], in arbitrary units.

    It is of no use as lip motion; the shift at which it correlates best with tracked lips is the offset of the video.
    """
    return stack_context(features) @ _load_weights()


def measure_opening_speed(opening: Array) -> Array:
    """Return the opening speed of measured lips: the slope over ±2 frames [shape=(T,)].

    opening : of the lips, frame by frame [shape=(T,)]
    """
    return compute_delta(opening.astype(np.float32)[:, None])[:, 0].astype(float)


def stack_context(features: Features) -> Array:
    """Return the static features of every frame and its context [shape=(T, 143)]; the ends are repeated."""
    static = features.values[:, :STATIC_FEATURES].astype(float)
    frames = np.arange(len(static))[:, None] + np.array(FRAME_OFFSETS)
    return static[np.clip(frames, 0, len(static) - 1)].reshape(len(static), -1)


@cache
def _load_weights() -> Array:
    """Return the shipped weights of the prediction [shape=(143,)]."""
    content = json.loads((resources.files("lipmotion") / "models" / WEIGHTS).read_text(encoding="utf-8"))
    return np.array(content["weights"])
