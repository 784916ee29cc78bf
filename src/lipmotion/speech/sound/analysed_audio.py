"""A recording with its acoustic features, each kind of which is computed once."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple, TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from lipmotion.hmm.loudness import average_power, find_sound_runs, find_spoken_frames, smooth_level
from lipmotion.speech.features.encoding import WindowedEncoding
from lipmotion.speech.features.mfcc import (
    GENERAL_CEPSTRA,
    HOP,
    WINDOW,
    check_samples,
    frame_count,
    general_features,
    log_energy,
    mfcc_of_warps,
    spectrum,
)
from lipmotion.speech.sound.noise_reduction import reduce_noise
from lipmotion.speech.sound.voice_activity import (
    SEPARATE_FRAMES,
    SOFTEST_DROP,
    Stretch,
    apply_gain,
    fill_gaps,
    find_passage_gain,
    find_passages,
    find_tones,
)
from lipmotion.types import Audio, Features, JoinedRows

MadeT = TypeVar("MadeT")
SILENT_FRAMES = 50
"""Frames of silence before and after the sound of each passage, recorded or not: the mouth opens before the sound."""
QUIETEST = 0.1  # so large a share of a passage, its most silent frames, say what silence is like in it
OFFSET_SHARE = 0.02  # an offset of so small a share of the level of the sound hides no pause
MOVED_FRAMES, MOVED_SHARE = 101, 0.6  # in the median over a second, rumble changes by 0.45 of the level, knocks by 7
SLOW_FRAMES, BLOCK = 11, 1 << 20  # the median over so many frames is slower than a voice; samples at a time
SPIKE_SHARE = 1e-3  # as few samples beyond full scale are damage
SILENT_ENERGY = -17.0  # the log energy between passages: 80 dB beneath their loudest moments


@dataclass(frozen=True, eq=False)
class AnalysedAudio(Audio):
    """One channel of sound at 16 kHz, and its acoustic features.

    Each kind of features is computed when it is first asked for, and kept as long as this object. The samples must not
    change. Make one for each recording (``analysed``), hand it down to everything that works on this recording, and
    drop it then: an hour takes 56 MB a kind. Every passage is analysed by itself, at a level that is the same for all
    (``speech.sound.voice_activity``); between passages, features are those of the silence beside them.
    All methods raise InputError as ``mfcc`` says.
    """

    _mfcc: dict[float, Features] = field(default_factory=dict, repr=False)
    _made: dict[Hashable, Any] = field(default_factory=dict, repr=False)

    def cached(self, name: Hashable, make: Callable[[], MadeT]) -> MadeT:
        """Return what a function makes of this recording; it is made once, and kept under a name."""
        if name not in self._made:
            self._made[name] = make()
        made: MadeT = self._made[name]
        return made

    @cached_property
    def passages(self) -> tuple[Passage, ...]:
        """The passages of the recording, in order; none where nothing can be said in it."""
        places = [(piece, stretch) for piece in self._pieces for stretch in piece.passages]
        stretches = [Stretch(piece.frame + first, piece.frame + end) for piece, (first, end) in places]
        bounds = [0, *((before.end + after.first) // 2 for before, after in pairwise(stretches)), self.frames]
        passages = []
        sounds = {id(piece): _LevelledPiece(piece.samples) for piece, _ in places}
        windows = {id(piece): WindowedEncoding(sounds[id(piece)].read, len(piece.samples)) for piece, _ in places}
        room = np.zeros(sum(end - first + 2 * SILENT_FRAMES for _, (first, end) in places) * HOP, np.float32)
        for number, (piece, (first, end)) in enumerate(places):
            level, samples = piece.energy[first:end], piece.samples[first * HOP : end * HOP]
            gain = find_passage_gain(level)
            samples = apply_gain(fill_gaps(samples, level), np.arange(len(gain)), gain)
            sound = find_spoken_frames(level)
            lead, tail = (max(SILENT_FRAMES - int(side.argmax()), 0) // 4 * 4 for side in (sound, sound[::-1]))
            # all in one array: the system gets an hour's memory back as one, not what lies between smaller ones
            place, room = np.split(room, [len(samples) + (lead + tail) * HOP])
            place[lead * HOP : lead * HOP + len(samples)] = samples
            part = _PassageAudio(place, self.rate_hz, encodings=windows[id(piece)], first=first, lead=lead, tail=tail)
            sounds[id(piece)].add(first, part.sound.samples, gain)
            own = slice(bounds[number], bounds[number + 1])
            passages.append(Passage(stretches[number].first - lead, own, part))
        return tuple(passages)

    @property
    def tones(self) -> list[Stretch]:
        """Where a steady tone covers what is said; its frames count as silence."""
        tones = {Stretch(each.frame + first, each.frame + end) for each in self._pieces for first, end in each.tones}
        return sorted(tones)

    @property
    def between_silences(self) -> list[tuple[int, AnalysedAudio]]:
        """What lies between digital silences, as far as something may be said in it: its first frame, and its sound."""
        pieces = [piece for piece in self._pieces if piece.passages]
        return [(each.frame, _Stretch(each.samples, self.rate_hz, recording=self, first=each.frame)) for each in pieces]

    @cached_property
    def _pieces(self) -> list[_Piece]:
        """What lies between digital silences, in order: each is a recording of its own, with frames of its own."""
        pieces, waiting = [], [(0, check_samples(self))]
        while waiting:
            start, samples = waiting.pop()
            heard = _heard(samples)
            start, samples = start + heard.start, samples[heard]
            if len(samples) < WINDOW:
                continue
            energy = log_energy(samples)
            if (clean := reduce_noise(samples, energy)) is not samples:
                samples, energy = clean, log_energy(clean)
            tones = find_tones(samples, energy)
            passages = [] if tones else find_passages(energy)
            cuts = _find_silences(passages, samples)
            if tones:
                waiting.append((start, samples.copy()))
            for tone in tones:
                waiting[-1][1][max(tone.first - 1, 0) * HOP : tone.end * HOP] = 0
            if cuts:  # the first part is the next one
                bounds = pairwise([0, *cuts, len(samples)])
                waiting += [(start + first, samples[first:end]) for first, end in bounds][::-1]
            else:
                frame = min((start + HOP // 2) // HOP, self.frames - len(energy))
                pieces.append(_Piece(frame, samples, energy, passages, tones))
        levels = [average_power(piece.energy).max() if piece.passages else -np.inf for piece in pieces]
        softest = max(levels, default=0) - SOFTEST_DROP
        return [piece for piece, level in zip(pieces, levels, strict=True) if level >= softest or piece.tones]

    @property
    def is_passage(self) -> bool:
        """Whether it is a passage itself, and not divided any further."""
        return any(passage.audio is self for passage in self.passages)

    @cached_property
    def frames(self) -> int:
        """T, the number of frames at 100 Hz."""
        return frame_count(self.samples)

    @property
    def recorded(self) -> slice:
        """Its frames without those of silence that was added to it."""
        return slice(0, self.frames)

    def joined(self, of_passage: Callable[[AnalysedAudio], NDArray[Any]], silence: float | None = None) -> NDArray[Any]:
        """Return features of the whole recording, joined from those of its passages [shape=(T, ...)].

        of_passage : returns the features of one
        silence    : the value between passages; None: as in the last frame of silence beside them
        """
        return np.asarray(self.joined_rows(of_passage, silence))

    def joined_rows(self, of_passage: Callable[[AnalysedAudio], NDArray[Any]], silence: Any = None) -> JoinedRows:
        """Return ``joined`` as rows that take memory within passages alone."""
        parts = [of_passage(passage.audio) for passage in self.passages]
        if not parts:
            some = of_passage(_PassageAudio(self.samples[: self.rate_hz], self.rate_hz))  # not of hours of silence
            return JoinedRows([np.broadcast_to(np.zeros_like(some[0]), (self.frames, *some.shape[1:]))])
        rows = list[NDArray[Any]]()
        for (first, own, _), part in zip(self.passages, parts, strict=True):
            between = np.asarray(part[-1] if silence is None else silence, part.dtype)
            start, stop = max(first, own.start), min(first + len(part), own.stop)
            silent = np.broadcast_to(between, (len(range(own.start, own.stop)), *part.shape[1:]))
            rows += [silent[: start - own.start], part[start - first : stop - first], silent[: own.stop - stop]]
        return JoinedRows(rows)

    def mfcc(self, warp: float = 1.0) -> Features:
        """Return the features of ``speech.features.mfcc.mfcc`` at one warp of the frequencies."""
        return self.mfcc_of_warps((warp,))[0]

    def mfcc_of_warps(self, warps: Sequence[float]) -> list[Features]:
        """Return the features of ``features.mfcc.mfcc`` at several warps; the missing ones are computed together."""
        missing = [warp for warp in warps if warp not in self._mfcc]
        if missing:
            self._mfcc.update(zip(missing, self._new_mfcc(missing), strict=True))
        return [self._mfcc[warp] for warp in warps]

    def forget_warps(self) -> None:
        """Forget the features at all warps but 1, which recognition alone takes."""
        for audio in (self, *(passage.audio for passage in self.passages)):
            for warp in audio._mfcc.keys() - {1.0}:
                del audio._mfcc[warp]

    def _new_mfcc(self, warps: Sequence[float]) -> list[Features]:
        rows = [self.joined(lambda audio: audio.mfcc(warp).values) for warp in warps]  # noqa: B023 # called at once
        return [Features(values, self.duration_s) for values in rows]

    @cached_property
    def log_energy(self) -> NDArray[np.float32]:
        """The natural logarithm of the energy of every frame [shape=(T,)], each passage at the same level."""
        return self.joined(lambda audio: audio.log_energy, SILENT_ENERGY)

    @cached_property
    def general_features(self) -> NDArray[np.float32]:
        """The features of the general models [shape=(T, 39)], as of ``features.mfcc``."""
        return self.joined(lambda audio: audio.general_features)

    @cached_property
    def spectrum(self) -> NDArray[np.float32]:
        """The normalised log mel spectrum [shape=(T, 40)], as of ``speech.features.mfcc``."""
        return self.joined(lambda audio: audio.spectrum)

    @cached_property
    def encoding(self) -> NDArray[np.float16]:
        """What the speech encoder makes of every frame [shape=(T, 64)], as of ``speech.features.encoding``."""
        return self.joined(lambda audio: audio.encoding)

    def stretch(self, first: int, stop: int) -> AnalysedAudio:
        """Return some frames of the recording, with the features that they have in the whole."""
        return _Stretch(self.samples[first * HOP : stop * HOP], self.rate_hz, recording=self, first=first)


class Passage(NamedTuple):
    """A passage of a recording."""

    first: int  # the frame of the recording in which its sound begins, with the silence before it; it may be negative
    own: slice  # frames of the recording that are nearer to it than to other passages
    audio: AnalysedAudio  # its sound, at the level of all passages, with silence before and after it


class _Piece(NamedTuple):
    """The sound between two digital silences, from a frame of the recording on; the rest is in frames of its own."""

    frame: int
    samples: NDArray[np.float32]
    energy: NDArray[np.float32]
    passages: Sequence[Stretch]
    tones: Sequence[Stretch]


class _LevelledPiece:
    """The sound of a piece at the level of all passages, of which encodings know what is around a passage."""

    def __init__(self, samples: NDArray[np.float32]) -> None:
        self._samples = samples
        self._passages: list[tuple[int, NDArray[np.float32]]] = []
        self._frames: list[int] = []
        self._gains: list[float] = []

    def add(self, first: int, samples: NDArray[np.float32], gain: NDArray[np.float64]) -> None:
        """Add the levelled samples of a passage that begins in a frame, and the gain in its frames [shape=(T,)]."""
        self._passages.append((first * HOP, samples))
        self._frames += [first, first + len(gain) - 1]
        self._gains += [float(gain[0]), float(gain[-1])]

    def read(self, first: int, stop: int) -> NDArray[np.float32]:
        """Return the samples from one to before another."""
        result = apply_gain(self._samples[first:stop], self._frames, self._gains, first)
        for start, samples in self._passages:
            begin, end = max(first, start), min(stop, start + len(samples))
            if begin < end:
                result[begin - first : end - first] = samples[begin - start : end - start]
        return result


def _heard(samples: NDArray[np.float32]) -> slice:
    """Return the samples without digital silence before and after them; none where there is nothing else."""
    sound = samples != 0
    return slice(int(sound.argmax()), len(sound) - int(sound[::-1].argmax())) if sound.any() else slice(0, 0)


def _find_silences(passages: Sequence[Stretch], samples: NDArray[np.float32]) -> list[int]:
    """Return a sample of each digital silence before, after and between passages that is long enough to part them."""
    silent = np.asarray(~samples[: len(samples) // HOP * HOP].reshape(-1, HOP).any(axis=1))
    for first, end in passages:
        silent[first:end] = False
    runs = find_sound_runs(silent, 1) if passages else []
    return [(first + end) // 2 * HOP for first, end in runs if end - first >= SEPARATE_FRAMES]


@dataclass(frozen=True, eq=False)
class _PassageAudio(AnalysedAudio):
    """The sound of one passage, with ``lead`` and ``tail`` frames of silence that have features of its quietest moment.

    ``first`` is its frame in ``encodings``, of the sound between digital silences that it is part of.
    """

    encodings: WindowedEncoding | None = None
    first: int = 0
    lead: int = 0
    tail: int = 0

    @property  # cached, it would keep itself, and an hour's sound, until the garbage is collected
    def passages(self) -> tuple[Passage, ...]:
        return (Passage(0, slice(0, self.frames), self),)

    @property
    def recorded(self) -> slice:
        return slice(self.lead, self.frames - self.tail)

    @property
    def sound(self) -> Audio:
        """What is recorded of it."""
        return Audio(self.samples[self.lead * HOP : len(self.samples) - self.tail * HOP], self.rate_hz)

    @cached_property
    def _energy(self) -> NDArray[np.float32]:
        return log_energy(check_samples(self.sound))

    def _with_silence(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Return the rows of the sound, and before and after them their mean where it is the most silent."""
        if not self.lead and not self.tail:
            return rows
        level = smooth_level(self._energy)
        silence = rows[level <= np.quantile(level, QUIETEST)].mean(axis=0)[None].astype(rows.dtype)
        return np.concatenate([np.repeat(silence, self.lead, axis=0), rows, np.repeat(silence, self.tail, axis=0)])

    def _new_mfcc(self, warps: Sequence[float]) -> list[Features]:
        features = mfcc_of_warps(self.sound, warps, self._energy)
        return [Features(self._with_silence(each.values), self.duration_s) for each in features]

    @cached_property
    def log_energy(self) -> NDArray[np.float32]:
        return self._with_silence(self._energy)

    @property  # not kept: recognition alone takes them, mostly once
    def general_features(self) -> NDArray[np.float32]:
        rows = self._with_silence(general_features(self.sound))
        rows[:, :GENERAL_CEPSTRA] -= rows[:, :GENERAL_CEPSTRA].mean(axis=0, dtype=np.float64).astype(np.float32)
        return rows  # its models were trained on sentences with silence

    @cached_property
    def spectrum(self) -> NDArray[np.float32]:
        return self._with_silence(spectrum(self.sound))

    @cached_property
    def encoding(self) -> NDArray[np.float16]:
        samples = self.sound.samples
        encodings = self.encodings or WindowedEncoding(lambda first, stop: samples[first:stop], len(samples))
        return self._with_silence(encodings.rows(self.first, self.first + len(self._energy)))


@dataclass(frozen=True, eq=False)
class _Stretch(AnalysedAudio):
    """Frames of a recording, from ``first`` on, whose features are those of the recording: normalised as these."""

    recording: AnalysedAudio = field(default=None, repr=False, kw_only=True)  # type: ignore[assignment]
    first: int = field(default=0, kw_only=True)

    @property
    def passages(self) -> tuple[Passage, ...]:
        return (Passage(0, slice(0, self.frames), self),)

    def mfcc_of_warps(self, warps: Sequence[float]) -> list[Features]:
        self.recording.mfcc_of_warps(warps)  # the spectra are computed once for all
        return super().mfcc_of_warps(warps)

    def joined(self, of_passage: Callable[[AnalysedAudio], NDArray[Any]], _: float | None = None) -> NDArray[Any]:
        return of_passage(self.recording)[self.first : self.first + len(self.samples) // HOP + 1]


def analysed(audio: Audio, features: Features | None = None) -> AnalysedAudio:
    """Return a recording that keeps its features: the same object if it already does.

    features : of the recording, from ``mfcc``, if they are known; they are not computed then
    """
    if not isinstance(audio, AnalysedAudio):
        audio = AnalysedAudio(_without_offset(audio.samples), audio.rate_hz)
    if features is not None and isinstance(features.values, np.ndarray):
        audio._mfcc.setdefault(1.0, features)
    return audio


def _without_offset(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return samples without offsets between digital silences; where one changes, without all slower than a voice."""
    if 1 < max(samples.max(initial=0), -samples.min(initial=0)) < np.inf:  # few such would make all others quiet
        few = np.count_nonzero(np.abs(samples) > 1) < SPIKE_SHARE * np.count_nonzero(samples)
        samples = np.clip(samples, -1, 1) if few else samples
    count = len(samples) // HOP
    sound, result = np.flatnonzero(samples[: count * HOP].reshape(count, HOP).any(axis=1)), samples
    for part in np.split(sound, np.flatnonzero(np.diff(sound) > SILENT_FRAMES) + 1) if len(sound) else ():
        first = part[0] * HOP
        heard = _heard(samples[first : (part[-1] + 2) * HOP])  # the next frame is silent, or not whole
        place = slice(first + heard.start, first + heard.stop)
        frames = samples[place][: (heard.stop - heard.start) // HOP * HOP].reshape(-1, HOP)
        if not len(frames):
            continue
        with np.errstate(all="ignore"):  # what is not finite is refused later
            means, powers = frames.mean(axis=1, dtype=np.float64), np.einsum("ti,ti->t", frames, frames) / HOP
            spread = powers - means**2
            quiet = np.argsort(spread, kind="stable")[: int(len(frames) * QUIETEST) + 1]
            offset, level = np.median(means[quiet]), np.median(spread[quiet])
            moved = np.ptp(scipy.ndimage.median_filter(means, MOVED_FRAMES)) if len(means) > MOVED_FRAMES else 0.0
            if MOVED_SHARE**2 * spread.mean() < moved**2 < np.inf:
                result = samples.copy() if result is samples else result
                slow, centres = scipy.ndimage.median_filter(means, SLOW_FRAMES), (np.arange(len(means)) + 0.5) * HOP
                for at in range(place.start, place.stop, BLOCK):
                    block = result[at : min(at + BLOCK, place.stop)]
                    block -= np.interp(np.arange(len(block)) + (at - place.start), centres, slow)
            elif max(level, OFFSET_SHARE**2 * powers.mean(), 0) < offset**2 < np.inf:
                result = samples.copy() if result is samples else result
                result[place] -= np.float32(offset)
    return result
