from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion import errors, types
from lipmotion.motion.predictors import PredictorTraining
from lipmotion.motion.prior_regression import EncodingRegression
from lipmotion.speech.features import analysed_audio, mfcc
from lipmotion.speech.features.encoding import (
    COMPONENTS,
    LEVEL,
    WindowedEncoding,
    encode_window,
    log_mel_spectrum,
    shipped_encoder,
)
from lipmotion.testing import example
from pipeline.made import read_welcome
from speech.made_voices import pulses, recording, vowels

RATE_HZ = 16_000
WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"


@pytest.fixture(scope="module")
def spoken() -> NDArray[np.float32]:
    """Two seconds of vowels, and silence."""
    return recording((0.6, vowels(pulses(2.0, 120)))).samples


def test_a_tone_is_loud_in_its_band_alone() -> None:
    """The bands are Slaney's: 200/3 Hz apart in centre below 1 kHz times 0.5577 of a mel step."""
    samples = np.sin(2 * np.pi * 440 * np.arange(RATE_HZ) / RATE_HZ).astype(np.float32) / LEVEL
    spectrum = log_mel_spectrum(samples)
    assert spectrum.shape == ((RATE_HZ - mfcc.WINDOW) // mfcc.HOP + 1, 80)
    top = 15 + np.log(8) * 27 / np.log(6.4)
    assert np.all(spectrum.argmax(axis=1) == round(440 * 3 / 200 / (top / 81)) - 1)
    assert spectrum.min() == pytest.approx((-4.5 + 4) / 4, abs=1e-6)


def test_the_forward_pass_is_that_of_the_network() -> None:
    """The rows were computed by ONNX Runtime 1.32.0 from the published file, with activations that are not rounded.

    Smart Turn v3.2, output of the first normalisation of the third layer, every 20th row from the fifth on, its first
    eight components. With activations of eight bits, as the file has them, rows differ by a fifth of their deviation.
    """
    samples = read_welcome().samples
    padded = np.pad(samples, (0, 8 * RATE_HZ + mfcc.WINDOW - mfcc.HOP - len(samples)))
    rows = encode_window(log_mel_spectrum(padded.astype(np.float32))[:800], shipped_encoder())
    expected = np.loadtxt(Path(__file__).with_name("encoder_reference.csv"), delimiter=",")
    assert rows[5:285:20, :8] == pytest.approx(expected, abs=0.04)
    assert expected.std() > 0.4


def test_rows_do_not_depend_on_what_is_asked_for() -> None:
    """Long sound is encoded in windows that fade into each other, each computed when it is needed."""
    samples = np.random.default_rng(0).normal(0, 0.05, 10 * RATE_HZ).astype(np.float32)
    read: list[int] = []

    def take(first: int, stop: int) -> NDArray[np.float32]:
        read.append(first)
        return samples[first:stop]

    some = WindowedEncoding(take, len(samples)).rows(700, 760)
    assert len(read) == 2  # of the windows from 0 and 6 s, between which it lies
    whole = WindowedEncoding(take, len(samples)).rows(0, 1001)
    assert whole.shape == (1001, COMPONENTS)
    assert whole[700:760] == pytest.approx(some, abs=1e-2)
    steps = np.abs(np.diff(whole.astype(float), axis=0)).mean(axis=1)
    assert steps[600:800].max() < 3 * np.median(steps)  # no seam where one window fades into the next


def test_silence_around_and_gain_change_nothing(spoken: NDArray[np.float32]) -> None:
    plain = analysed_audio.analysed(types.Audio(spoken, RATE_HZ)).encoding.astype(float)
    later = np.concatenate([np.zeros(3 * RATE_HZ, np.float32), spoken * np.float32(0.01)])
    moved = analysed_audio.analysed(types.Audio(later, RATE_HZ)).encoding.astype(float)[300 : 300 + len(plain)]
    assert np.abs(moved - plain).max() < 0.02 * np.abs(plain).max()


def test_features_of_a_passage_are_those_of_the_whole(spoken: NDArray[np.float32]) -> None:
    audio = analysed_audio.analysed(types.Audio(spoken, RATE_HZ))
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
    with pytest.raises(errors.CorpusError, match="without encoding"):
        EncodingRegression.fit(PredictorTraining([replace(one, speech=without)], [motion], 2))
    with pytest.raises(errors.CorpusError, match="no frame"):
        EncodingRegression.fit(PredictorTraining([replace(one, valid=np.zeros_like(one.valid))], [motion], 2))
