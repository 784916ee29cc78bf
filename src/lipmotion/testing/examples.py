"""Synthetic examples: features that tell phones apart, and motion in which every phone has a known pose.

Small enough for every test of an engine, with no recording and no recogniser in it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lipmotion.types import Channel, Example, Features, Motion, Span, Speech, Timeline, Unit

RATE_HZ = 100.0
CHANNELS = tuple(map(Channel, ("opening", "width", "x_17", "y_17", "z_17", "x_61", "y_61")))
OPENINGS = {"sil": 0.02, "p": 0.0, "b": 0.0, "m": 0.0, "aa": 0.30, "iy": 0.12, "uw": 0.08, "t": 0.10, "s": 0.07}
WIDTHS = {"sil": 0.55, "p": 0.54, "b": 0.54, "m": 0.54, "aa": 0.56, "iy": 0.62, "uw": 0.42, "t": 0.57, "s": 0.58}
PHONES = tuple(OPENINGS)
MARGIN_S = 0.6
"""Silence at both ends, long enough for the mouth to rest in it."""


def timeline(phones: Sequence[str], duration_s: float = 0.1) -> Timeline[Unit]:
    """Return phones of equal duration in seconds, between two silences of ``MARGIN_S``."""
    edges = np.cumsum([0, MARGIN_S, *(duration_s for _ in phones), MARGIN_S]).round(6).tolist()
    labels = ["sil", *phones, "sil"]
    return Timeline(tuple(Span(a, b, Unit(p)) for a, b, p in zip(edges, edges[1:], labels, strict=False)))


def speech(units: Timeline[Unit], seed: int = 0) -> Speech:
    """Return features [shape=(T, 39)] whose mean is another one for every phone, with the phones in time."""
    duration_s = units.spans[-1].end_s if len(units) else 0.5
    time_s = np.arange(int(np.floor(duration_s * RATE_HZ + 1e-9)) + 1) / RATE_HZ
    sounds = np.random.default_rng(1).normal(0, 1, (64, 39))
    values = np.random.default_rng([2, seed]).normal(0, 0.2, (len(time_s), 39))
    for span in units:
        inside = (time_s >= span.start_s) & (time_s < span.end_s)
        values[inside] += sounds[sum(map(ord, span.label.phone)) % 64]
    return Speech(Features(values.astype(np.float32), duration_s), units)


def motion(units: Timeline[Unit], frames: int, seed: int = 0, noise: float = 0.002) -> Motion:
    """Return poses joined smoothly, at 100 Hz; the points move with the distances, and ``z_17`` never moves.

    units : phones of ``PHONES``;  noise : its standard deviation, eye distances
    """
    time_s = np.arange(frames) / RATE_HZ
    pose = np.array([[OPENINGS["sil"], WIDTHS["sil"]]] * frames)
    for span in units:
        inside = (time_s >= span.start_s) & (time_s < span.end_s)
        pose[inside] = OPENINGS[span.label.phone], WIDTHS[span.label.phone]
    window = np.hanning(9) / np.hanning(9).sum()
    pose = np.stack([np.convolve(np.pad(curve, 4, "edge"), window, "valid") for curve in pose.T], axis=1)
    opening, width = (pose + np.random.default_rng([3, seed]).normal(0, noise, pose.shape)).T
    still = np.zeros(frames)
    points = [still + 0.01, -0.6 - opening, still, width / 2, -0.5 - opening / 4]
    return Motion(np.stack([opening, width, *points], axis=1), RATE_HZ, CHANNELS)


def example(phones: Sequence[str], seed: int = 0, duration_s: float = 0.1) -> Example:
    """Return the speech of some phones with its motion, all of it valid."""
    spoken = speech(timeline(phones, duration_s), seed)
    frames = len(spoken.features.values)
    return Example(f"number{seed}", spoken, motion(spoken.units, frames, seed), np.ones(frames, bool))


def examples(count: int = 12, seed: int = 0) -> list[Example]:
    """Return sentences of twelve phones, ten of them drawn at random; no lip closure first or last."""
    draw = np.random.default_rng(seed)
    spoken = [["t", *(PHONES[i] for i in draw.integers(1, len(PHONES), 10)), "aa"] for _ in range(count)]
    return [example(phones, number, 0.08 + 0.02 * (number % 3)) for number, phones in enumerate(spoken)]
