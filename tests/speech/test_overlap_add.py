"""Joining pieces of recordings: what is one stays one, and joins fit the waveform."""

from __future__ import annotations

import numpy as np

from lipmotion.speech.sound.overlap_add import REACH_S, overlapped

RATE_HZ = 16_000


def tone(hertz: float, seconds: float, phase: float = 0.0) -> np.ndarray:
    return np.sin(2 * np.pi * hertz * np.arange(int(seconds * RATE_HZ)) / RATE_HZ + phase).astype(np.float32)


def test_one_piece_is_cut_out_as_it_is() -> None:
    sound = np.random.default_rng(0).standard_normal(8000).astype(np.float32)
    joined = overlapped([sound], [(0.1, 0.3)], RATE_HZ)
    np.testing.assert_allclose(joined.samples, sound[1600:4800], atol=1e-6)
    assert joined.starts == [0]


def test_successive_pieces_of_one_recording_join_without_a_trace() -> None:
    sound = np.random.default_rng(1).standard_normal(16_000).astype(np.float32)
    joined = overlapped([sound] * 3, [(0.1, 0.3), (0.3, 0.5), (0.5, 0.8)], RATE_HZ)
    np.testing.assert_allclose(joined.samples, sound[1600:12_800], atol=1e-5)
    assert joined.starts == [0, 3200, 6400]


def test_a_tone_goes_on_in_phase() -> None:
    for phase in (1.0, 4.5):
        joined = overlapped([tone(140, 0.5), tone(140, 0.5, phase)], [(0.0, 0.25), (0.25, 0.5)], RATE_HZ)
        spectrum = np.abs(np.fft.rfft(joined.samples[:7000] * np.hanning(7000)))
        frequencies = np.fft.rfftfreq(7000, 1 / RATE_HZ)
        assert spectrum[np.abs(frequencies - 140) > 30].max() < 0.02 * spectrum.max()
        assert abs(len(joined.samples) - 8000) <= REACH_S * RATE_HZ + 1


def test_a_shifted_piece_says_so() -> None:
    marked = tone(100, 0.5, np.pi / 2)
    joined = overlapped([tone(100, 0.5), marked], [(0.0, 0.2), (0.25, 0.5)], RATE_HZ)
    begins = 0.25 + joined.shifts[1] / RATE_HZ
    place = joined.starts[1] + round((0.4 - begins) * RATE_HZ)
    np.testing.assert_allclose(joined.samples[place : place + 200], marked[6400:6600], atol=1e-5)
    assert joined.shifts[1] != 0


def test_a_short_first_piece_makes_no_click() -> None:
    joined = overlapped([np.ones(8000, np.float32)] * 2, [(0.1, 0.101), (0.2, 0.4)], RATE_HZ)
    np.testing.assert_allclose(joined.samples, 1, atol=1e-6)
