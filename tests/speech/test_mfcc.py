import itertools
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from lipmotion import errors, types
from lipmotion.motion.predictors import PredictorTraining
from lipmotion.motion.prior_regression import EncodingRegression
from lipmotion.speech.features import mfcc as module
from lipmotion.speech.features.encoding import (
    COMPONENTS,
    LEVEL,
    WindowedEncoding,
    encode_window,
    load_encoder,
    log_mel_spectrum,
)
from lipmotion.speech.features.f0 import log_f0
from lipmotion.speech.features.mfcc import HOP, ROUNDING_SHARE, WINDOW, compute_delta, mfcc, normalise_rows
from lipmotion.testing import example
from lipmotion_faces.corpus import sound_offset
from pipeline.made import read_sound, read_welcome
from speech.made_voices import pulses, recording, vowels
from speech.mfcc_oracle import features as slow_features

RATE_HZ = 16_000
LOG_ENERGY = 12


def noise(count: int, seed: int = 0) -> NDArray[np.float32]:
    return np.random.default_rng(seed).normal(0, 0.1, count).astype(np.float32)


def features(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    return mfcc(types.Audio(samples, RATE_HZ)).values


def test_it_is_its_slow_twin(toy_sentence) -> None:
    drawn = [noise(count, seed=count) * np.linspace(0.2, 1, count, dtype=np.float32) for count in (400, 3333)]
    for samples in (*drawn, toy_sentence.audio.samples[6400:11_200]):
        np.testing.assert_allclose(
            features(samples), slow_features(samples.astype(float)), rtol=0, atol=2e-3, equal_nan=False
        )


@settings(max_examples=20)
@given(st.integers(400, 4000))
def test_the_number_of_frames(count: int) -> None:
    audio = types.Audio(noise(count), RATE_HZ)
    result = mfcc(audio)
    assert result.values.shape == (count // 160 + 1, 39)
    assert result.values.dtype == np.float32
    assert result.duration_s == audio.duration_s


def test_frame_n_is_centred_at_n_times_10_ms() -> None:
    """25 ms around a click: the frame itself and one on either side have it, and no other."""
    for frame in (0, 1, 2, 50, 98, 99, 100):
        samples = np.zeros(RATE_HZ, np.float32)
        samples[min(frame * 160, RATE_HZ - 1)] = 1
        loud = np.flatnonzero(features(samples)[:, LOG_ENERGY] > 0)
        assert loud.tolist() == [n for n in (frame - 1, frame, frame + 1) if 0 <= n <= 100]


def test_blocks_join_without_a_seam() -> None:
    samples, around = noise(160 * (module.BLOCK + 500)), slice(module.BLOCK - 100, module.BLOCK + 100)
    alone = features(samples[160 * (around.start - 20) : 160 * (around.stop + 20)])[20:-21]
    for one, other in zip(features(samples)[around].T, alone.T, strict=True):
        assert np.corrcoef(one, other)[0, 1] == pytest.approx(1, abs=1e-4)


@pytest.mark.long
@pytest.mark.parametrize(("measure", "minutes", "most"), [(lambda a: mfcc(a).values, 20, 70e6), (log_f0, 8, 20e6)])
def test_memory_beside_the_result_is_bounded(measure: Callable[[types.Audio], Any], minutes: int, most: float) -> None:
    samples = noise(minutes * 60 * RATE_HZ)
    measure(types.Audio(samples[:RATE_HZ], RATE_HZ))
    tracemalloc.start()
    result = measure(types.Audio(samples, RATE_HZ))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak - result.nbytes < most < samples.nbytes


def test_digital_silence_is_nothing_at_all_and_finite_inside_a_recording() -> None:
    for count in (400, 16_000):
        assert not features(np.zeros(count, np.float32)).any()
    samples = noise(RATE_HZ)
    samples[4000:12_000] = 0
    values = features(samples)
    assert np.isfinite(values).all()
    assert values[30:70, LOG_ENERGY].max() < values[:20, LOG_ENERGY].min() - 1
    for value, count in itertools.product((0.1, -69.07755, 1e4), (1, 2, 12_345)):  # a constant column becomes 0
        assert not normalise_rows(np.full((count, 2), value, np.float32), ROUNDING_SHARE * abs(value)).any()


@settings(max_examples=50)
@given(st.integers(5, 60), st.floats(-3, 3), st.floats(-10, 10))
def test_the_delta_of_a_ramp_is_its_slope(frames: int, slope: float, start: float) -> None:
    ramp = (start + slope * np.arange(frames)).astype(np.float32)[:, None]
    assert compute_delta(ramp)[2:-2] == pytest.approx(slope, abs=1e-4)


@pytest.mark.parametrize("measure", [mfcc, log_f0])
def test_it_says_what_is_wrong(measure: Callable[[types.Audio], object]) -> None:
    peak = "finite samples, full scale 1, found a peak of"
    wrong: list[tuple[Any, Any, str]] = [
        (noise(16_000), 44_100, "need 16000 Hz, found 44100 Hz; resample first"),
        (noise(399), RATE_HZ, r"need 400 samples of one channel, found shape \(399,\)"),
        (noise(16_000).reshape(2, 8000), RATE_HZ, r"are float32 \(2, 8000\), .* the mean of channels"),
        *((kind(noise(800).tolist()), RATE_HZ, f"are {kind.__name__}") for kind in (np.int16, np.complex128, list)),
        *((noise(800), rate_hz, f"of {rate_hz!r} Hz") for rate_hz in ("16000", None, 0)),
        (np.where(np.arange(800) == 7, np.nan, 0.1), RATE_HZ, f"{peak} nan"),
        (1e30 * noise(800), RATE_HZ, r"found a peak of \d.*e\+29"),
    ]
    for samples, rate_hz, message in wrong:
        with pytest.raises(errors.InputError, match=message):
            measure(types.Audio(samples, rate_hz))


def test_the_map_that_ships_is_linear_and_local() -> None:
    given = types.Features(np.random.default_rng(1).normal(size=(200, 39)).astype(np.float32), 2.0)
    whole = sound_offset.predict_opening_speed(given)
    assert whole.shape == (200,)
    twice = types.Features(2 * given.values, given.duration_s)
    assert sound_offset.predict_opening_speed(twice) == pytest.approx(2 * whole)
    changed = given.values.copy()
    changed[100, : sound_offset.STATIC_FEATURES] += 1
    moved = np.flatnonzero(np.abs(sound_offset.predict_opening_speed(types.Features(changed, 2.0)) - whole) > 1e-6)
    assert moved.tolist() == [100 - step for step in reversed(sound_offset.FRAME_OFFSETS)]
    assert sound_offset.measure_opening_speed(0.03 * np.arange(20.0))[3:-3] == pytest.approx(0.03, abs=1e-6)


@pytest.fixture(scope="module")
def spoken() -> NDArray[np.float32]:
    """Two seconds of vowels, and silence."""
    return recording((0.6, vowels(pulses(2.0, 120)))).samples


def test_a_tone_is_loud_in_its_band_alone() -> None:
    """The bands are Slaney's: 200/3 Hz apart in centre below 1 kHz times 0.5577 of a mel step."""
    samples = np.sin(2 * np.pi * 440 * np.arange(RATE_HZ) / RATE_HZ).astype(np.float32) / LEVEL
    spectrum = log_mel_spectrum(samples)
    assert spectrum.shape == ((RATE_HZ - WINDOW) // HOP + 1, 80)
    top = 15 + np.log(8) * 27 / np.log(6.4)
    assert np.all(spectrum.argmax(axis=1) == round(440 * 3 / 200 / (top / 81)) - 1)
    assert spectrum.min() == pytest.approx((-4.5 + 4) / 4, abs=1e-6)


def test_the_forward_pass_is_that_of_the_network() -> None:
    """The rows were computed by ONNX Runtime 1.32.0 from the published file, with activations that are not rounded.

    Smart Turn v3.2, output of the first normalisation of the third layer, every 20th row from the fifth on, its first
    eight components. With activations of eight bits, as the file has them, rows differ by a fifth of their deviation.
    """
    samples = read_welcome().samples
    padded = np.pad(samples, (0, 8 * RATE_HZ + WINDOW - HOP - len(samples)))
    rows = encode_window(log_mel_spectrum(padded.astype(np.float32))[:800], load_encoder())
    expected = np.loadtxt(Path(__file__).with_name("encoder_reference.csv"), delimiter=",")
    assert rows[5:285:20, :8] == pytest.approx(expected, abs=0.04)
    assert expected.std() > 0.4


def test_rows_do_not_depend_on_what_is_asked_for() -> None:
    """Long sound is encoded in windows that fade into each other, each computed when it is needed."""
    samples = np.random.default_rng(0).normal(0, 0.05, 14 * RATE_HZ).astype(np.float32)
    read: list[int] = []

    def take(first: int, stop: int) -> NDArray[np.float32]:
        read.append(first)
        return samples[first:stop]

    encoding = WindowedEncoding(take, len(samples))
    some = encoding.rows(700, 760)
    assert len(read) == 2  # of the windows from 0 and 6 s, between which it lies
    assert [len(encoding.rows(first, first + 9)) for first in (1300, 700, 0)] == [9, 9, 9]
    assert read[2:] == [191_800, 0, 0]  # the windows from 6 and 12 s are kept
    whole = encoding.rows(0, 1001)
    assert whole.shape == (1001, COMPONENTS)
    assert whole[700:760] == pytest.approx(some, abs=1e-2)
    steps = np.abs(np.diff(whole.astype(float), axis=0)).mean(axis=1)
    assert steps[600:800].max() < 3 * np.median(steps)  # no seam where one window fades into the next


def test_silence_around_and_gain_change_nothing(spoken: NDArray[np.float32]) -> None:
    plain = read_sound(types.Audio(spoken, RATE_HZ)).encoding.astype(float)
    later = np.concatenate([np.zeros(3 * RATE_HZ, np.float32), spoken * np.float32(0.01)])
    moved = read_sound(types.Audio(later, RATE_HZ)).encoding.astype(float)[300 : 300 + len(plain)]
    assert np.abs(moved - plain).max() < 0.02 * np.abs(plain).max()


def test_features_of_a_passage_are_those_of_the_whole(spoken: NDArray[np.float32]) -> None:
    audio = read_sound(types.Audio(spoken, RATE_HZ))
    (passage,) = audio.passages
    own = passage.audio.encoding[passage.own.start - passage.first :][: len(audio.encoding)]
    assert np.array_equal(audio.encoding[: len(own)], own)
    assert np.array_equal(audio.stretch(20, 60).encoding, audio.encoding[20:61])


def encoded_example(seed: int) -> tuple[types.Example, NDArray[np.float64]]:
    """An example whose motion is a sum of the encoding of two moments."""
    one = example(("aa", "t", "iy", "s"), seed)
    rng, frames = np.random.default_rng(seed), len(one.valid)
    steps = np.arange(frames) / 4
    rows = rng.standard_normal((frames // 4 + 2, COMPONENTS))
    encoding = np.stack([np.interp(steps, np.arange(len(rows)), column) for column in rows.T], axis=1)
    later = encoding[np.minimum(np.arange(frames) + 8, frames - 1)]
    motion = 0.3 + 0.1 * encoding[:, :2] + 0.05 * later[:, 2:4]
    return replace(one, speech=replace(one.speech, encoding=encoding.astype(np.float16))), motion


def test_a_regression_finds_a_linear_map() -> None:
    made = [encoded_example(seed) for seed in range(60)]
    training = PredictorTraining([each for each, _ in made[:58]], [motion for _, motion in made[:58]], 2)
    fitted = EncodingRegression.fit(training).predictor
    stored = EncodingRegression.from_arrays(fitted.arrays(), 2)
    for each, motion in made[58:]:
        predicted, distortion = stored.predict(each.speech)
        assert np.corrcoef(predicted[::4, 0], motion[::4, 0])[0, 1] > 0.9
        assert predicted == pytest.approx(fitted.predict(each.speech)[0], abs=5e-3)
        assert not distortion.any()


def test_speech_without_an_encoding_is_refused() -> None:
    one, motion = encoded_example(0)
    fitted = EncodingRegression.fit(PredictorTraining([one], [motion], 2)).predictor
    without = replace(one.speech, encoding=None)
    assert not fitted.can_predict(without)
    with pytest.raises(errors.InputError, match="no encoding"):
        fitted.predict(without)
    for wrong, message in (
        ({"speech": without}, "without encoding"),
        ({"valid": np.zeros_like(one.valid)}, "no frame"),
    ):
        with pytest.raises(errors.CorpusError, match=message):
            EncodingRegression.fit(PredictorTraining([replace(one, **wrong)], [motion], 2))
