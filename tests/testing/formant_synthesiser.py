"""A small source–filter formant synthesiser: phones and durations to sound.

A glottal pulse train and noise excite five resonances in cascade; a second noise goes through one resonance beside them
(frication). Every phone is one to three segments, each a share of its duration with fixed targets; the targets become
smooth tracks. It needs no recordings, so tests have speech whose phone times are exactly known.

Source: D. H. Klatt, "Software for a cascade/parallel formant synthesizer", JASA 67 (1980): resonators, and most figures
of the table. D. H. and L. C. Klatt, JASA 87 (1990): glottal pulse. Deviations: no nasal zero; one frication resonance.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from scipy.signal._sosfilt import _sosfilt

from lipmotion.types import Audio, Span, Timeline, Unit

Array = NDArray[np.float64]
Formants = tuple[float, float, float]

CONTROL_HZ = 320  # rate at which tracks are updated
FLOOR_DB = -70.0  # level of the background noise, in dB of full scale (root mean square)

_FORMANT_SMOOTHING_S, _LEVEL_SMOOTHING_S = 0.016, 0.004  # standard deviations
_HIGH_HZ, _HIGH_WIDTHS_HZ = (4500.0, 3500.0), (280.0, 220.0)  # F5 and F4, the same for all phones
_OPEN_SHARE, _TILT, _DECLINATION = 0.6, 0.2, 0.06  # of the glottal pulse, of its low pass, of the pitch
_GAIN = 0.12


@dataclass(frozen=True)
class TargetSegment:
    """A stretch of a phone with fixed targets.

    share            : of the phone's duration; the shares of one phone sum to 1
    formants, widths : F1–F3 and their bandwidths, Hz; None: the formants of the next segment that has some
    voicing          : level of the glottal pulses, through the formants
    aspiration       : level of the noise through the formants
    frication        : level of the noise beside them, around ``frication_hz``, ``frication_width`` Hz wide
    """

    share: float = 1.0
    formants: Formants | None = None
    widths: Formants = (70.0, 100.0, 160.0)
    voicing: float = 0.0
    aspiration: float = 0.0
    frication: float = 0.0
    frication_hz: float = 4000.0
    frication_width: float = 2000.0


PhoneTargets = tuple[TargetSegment, ...]


def _vowel(start: Formants, end: Formants | None = None) -> PhoneTargets:
    if end is None:
        return (TargetSegment(1.0, start, voicing=1.0, aspiration=0.01),)
    steady = TargetSegment(0.5, start, voicing=1.0, aspiration=0.01)
    return steady, replace(steady, formants=end, voicing=0.9)


def _sonorant(formants: Formants, widths_hz: Formants, voicing: float) -> PhoneTargets:
    return (TargetSegment(1.0, formants, widths_hz, voicing=voicing),)


def _fricative(
    formants: Formants, frication: float, frication_hz: float, frication_width: float, voicing: float = 0.0
) -> PhoneTargets:
    return (
        TargetSegment(1.0, formants, (120.0, 150.0, 200.0), voicing, 0.0, frication, frication_hz, frication_width),
    )


def _stop(
    formants: Formants, frication: float, frication_hz: float, frication_width: float, voiced: bool
) -> PhoneTargets:
    """Return closure, burst and release; a voiced stop has voicing in its closure, an unvoiced one is aspirated."""
    closure = TargetSegment(0.6, formants, (150.0, 300.0, 400.0), voicing=0.12 if voiced else 0.0)
    burst = TargetSegment(
        0.14, formants, frication=frication, frication_hz=frication_hz, frication_width=frication_width
    )
    release = (
        TargetSegment(0.26, formants, voicing=0.6)
        if voiced
        else TargetSegment(0.26, formants, (200.0, 150.0, 200.0), aspiration=0.12)
    )
    return closure, burst, release


def _affricate(
    formants: Formants, frication: float, frication_hz: float, frication_width: float, voicing: float = 0.0
) -> PhoneTargets:
    """Return a closure, then a fricative."""
    (release,) = _fricative(formants, frication, frication_hz, frication_width, voicing)
    return TargetSegment(0.4, formants, (150.0, 300.0, 400.0), voicing=voicing / 2), replace(release, share=0.6)


def _syllabic(consonant: PhoneTargets) -> PhoneTargets:
    """Return a schwa that runs into a consonant."""
    (schwa,) = _vowel(SCHWA)
    return replace(schwa, share=0.35), *(replace(each, share=0.65 * each.share) for each in consonant)


SCHWA: Formants = (500, 1400, 2450)

_KINDS: dict[str, Callable[..., PhoneTargets]] = {
    "vowel": _vowel,
    "glide": partial(_sonorant, widths_hz=(60.0, 110.0, 180.0), voicing=0.6),
    "nasal": partial(_sonorant, widths_hz=(70.0, 300.0, 350.0), voicing=0.45),
    "fricative": _fricative,
    "affricate": _affricate,
    "voiced stop": partial(_stop, voiced=True),
    "voiceless stop": partial(_stop, voiced=False),
}
_ROWS = json.loads(Path(__file__).with_name("phone_targets.json").read_text(encoding="ascii"))
PHONE_TARGETS: dict[str, PhoneTargets] = {
    "sil": (TargetSegment(),),
    "sp": (TargetSegment(),),
    "hh": (TargetSegment(widths=(200.0, 150.0, 200.0), aspiration=0.12),),
    **{phone: _KINDS[kind](*numbers) for phone, (kind, *numbers) in _ROWS.items()},
}
PHONE_TARGETS |= {f"e{phone}": _syllabic(PHONE_TARGETS[phone]) for phone in "lmn"}
"""The segments of every phone of the inventory, in order."""


def synthesise(
    phones: Sequence[tuple[str, float]], *, pitch_hz: float = 120.0, rate_hz: int = 16000, seed: int = 0
) -> tuple[Audio, Timeline[Unit]]:
    """Return synthetic speech, and the exact time of each of its phones.

    phones   : names and durations, seconds, in order
    pitch_hz : mean pitch; it falls by 12 % from start to end
    rate_hz  : sampling rate, 16,000 Hz or more
    seed     : of the noise; the same arguments give the same samples
    Returns Audio of ``round(sum of durations · rate_hz)`` samples, silence at −70 dB; and the phones in time, from 0 s.
    """
    edges_s = np.concatenate([[0.0], np.cumsum([duration_s for _, duration_s in phones])])
    noise = np.random.default_rng(seed).standard_normal((3, round(float(edges_s[-1]) * rate_hz)))
    tracks = _tracks([PHONE_TARGETS[phone] for phone, _ in phones], edges_s, rate_hz)
    count, hop = noise.shape[1], rate_hz // CONTROL_HZ
    centres = (np.arange(len(tracks.levels)) + 0.5) * hop
    voicing, aspiration, frication = (np.interp(np.arange(count), centres, level) for level in tracks.levels.T)
    pitch = pitch_hz * np.linspace(1 + _DECLINATION, 1 - _DECLINATION, count)
    opened = np.cumsum(pitch / rate_hz) % 1.0 / _OPEN_SHARE
    pulses = np.where(opened < 1, opened * (2 - 3 * opened), 0.0)
    source = voicing * lfilter([1 - _TILT], [1.0, -_TILT], pulses) + aspiration * noise[0]
    high = np.ones((len(tracks.formants), 1))
    centre = np.concatenate([high * _HIGH_HZ, tracks.formants[:, ::-1]], axis=1)
    width = np.concatenate([high * _HIGH_WIDTHS_HZ, tracks.widths[:, ::-1]], axis=1)
    a1, a2 = _poles(centre, width, rate_hz)
    zero, one = np.zeros_like(a1), np.ones_like(a1)
    voiced = _filtered(source, np.stack([1 + a1 + a2, zero, zero, one, a1, a2], axis=-1), hop)
    speech = voiced + _filtered(frication * noise[1], _frication_sections(tracks, rate_hz), hop)
    samples = _GAIN * speech + 10 ** (FLOOR_DB / 20) * noise[2]
    spans = (Span(float(a), float(b), Unit(p)) for (p, _), a, b in zip(phones, edges_s, edges_s[1:], strict=False))
    return Audio(samples.astype(np.float32), rate_hz), Timeline(tuple(spans))


class _Tracks(NamedTuple):
    """Smooth targets, one row a frame; levels of voicing, aspiration and frication, whose centre and width is Hz."""

    formants: Array
    widths: Array
    levels: Array
    frication: Array


def _tracks(sounds: Sequence[PhoneTargets], edges_s: Array, rate_hz: int) -> _Tracks:
    hop_s = (rate_hz // CONTROL_HZ) / rate_hz
    time_s = (np.arange(int(edges_s[-1] / hop_s) + 1) + 0.5) * hop_s
    segments = _with_formants([segment for sound in sounds for segment in sound])
    segment_s = [segment.share * d for sound, d in zip(sounds, np.diff(edges_s), strict=True) for segment in sound]
    which = np.minimum(np.searchsorted(np.cumsum(segment_s), time_s, side="right"), len(segments) - 1)
    formants = np.array([(segment.formants, segment.widths) for segment in segments])[which]
    levels = np.array([(segment.voicing, segment.aspiration, segment.frication) for segment in segments])[which]
    frication = np.array([(segment.frication_hz, segment.frication_width) for segment in segments])[which]
    loudness = levels[:, 2:] + 1e-9  # centre and width are means, weighted by the level, over the frication nearby
    return _Tracks(
        _smooth(formants[:, 0], _FORMANT_SMOOTHING_S),
        _smooth(formants[:, 1], _FORMANT_SMOOTHING_S),
        _smooth(levels, _LEVEL_SMOOTHING_S),
        _smooth(frication * loudness, _LEVEL_SMOOTHING_S) / _smooth(loudness, _LEVEL_SMOOTHING_S),
    )


def _with_formants(segments: Sequence[TargetSegment]) -> list[TargetSegment]:
    """Return segments of which those without formants get those of the next that has some, at the end of the last."""
    following: Formants = next((segment.formants for segment in reversed(segments) if segment.formants), SCHWA)
    filled = []
    for segment in reversed(segments):
        following = segment.formants or following
        filled.append(replace(segment, formants=following))
    return filled[::-1]


def _smooth(frames: Array, deviation_s: float) -> Array:
    return gaussian_filter1d(frames, deviation_s * CONTROL_HZ, axis=0, mode="nearest")


def _frication_sections(tracks: _Tracks, rate_hz: int) -> Array:
    """Return one band pass of unit gain at its centre, zero at 0 Hz [shape=(frames, 1, 6)]."""
    a1, a2 = _poles(tracks.frication[:, :1], tracks.frication[:, 1:], rate_hz)
    gain, zero, one = (1 - a2) / 2, np.zeros_like(a1), np.ones_like(a1)
    return np.stack([gain, zero, -gain, one, a1, a2], axis=-1)


def _poles(centre_hz: Array, width_hz: Array, rate_hz: int) -> tuple[Array, Array]:
    radius = np.exp(-np.pi * width_hz / rate_hz)
    return -2 * radius * np.cos(2 * np.pi * centre_hz / rate_hz), radius**2


def _filtered(samples: Array, sections: Array, hop: int) -> Array:
    """Return filtered samples: ``hop`` at a time with the sections of their frame; the filter state is carried over."""
    filtered, state = samples[None].copy(), np.zeros((1, sections.shape[1], 2))
    for start, frame_sections in zip(range(0, len(samples), hop), sections, strict=False):
        _sosfilt(frame_sections, filtered[:, start : start + hop], state)  # ``sosfilt`` checks longer than it works
    return filtered[0]
