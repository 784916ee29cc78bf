from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.model import Model, load_model
from lipmotion.speech.features import analysed_audio as module
from lipmotion.speech.features import mfcc as front_end
from lipmotion.speech.features.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.features.mfcc import log_energy, mfcc
from lipmotion.speech.features.speaker_similarity import JUDGED_FRAMES, WARPS
from lipmotion.speech.recognition.agreement import agreement_score
from lipmotion.speech.recognition.general.front_end import general_features
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.testing.toy import ToySentence, toy_sentences
from lipmotion.types import Audio
from lipmotion.units import Lexicon


@pytest.fixture(scope="module")
def sentence() -> ToySentence:
    return toy_sentences(3)[0]


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> Counter[tuple[str, bytes, int]]:
    """Counts what the front end computes: by filter bank or energy, and samples."""
    counts: Counter[tuple[str, bytes, int]] = Counter()

    def counting(kind: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def counted(samples: np.ndarray, banks: Sequence[np.ndarray] = (np.zeros(0),)) -> Any:
            counts.update((kind, bank.tobytes(), len(samples)) for bank in banks)
            return function(samples, banks) if kind == "filters" else function(samples)

        return counted

    monkeypatch.setattr(front_end, "log_mels", counting("filters", front_end.log_mels))
    counted_energy = counting("energy", front_end.log_energy)
    for owner in (front_end, module):
        monkeypatch.setattr(owner, "log_energy", counted_energy)
    return counts


def test_every_kind_is_that_of_its_own_function(sentence: ToySentence) -> None:
    audio = analysed(sentence.audio)
    for warp, features in zip(WARPS, audio.mfcc_of_warps(WARPS), strict=True):
        assert np.array_equal(features.values, mfcc(sentence.audio, warp).values)
        assert features is audio.mfcc(warp)
        assert features.duration_s == sentence.audio.duration_s
    assert np.array_equal(audio.general_features, general_features(sentence.audio))
    assert np.array_equal(audio.log_energy, log_energy(sentence.audio.samples))


def test_features_that_are_known_are_not_computed(sentence: ToySentence, computed: Counter[Any]) -> None:
    features = mfcc(sentence.audio)
    computed.clear()
    assert analysed(sentence.audio, features).mfcc() is features
    assert not computed


def test_a_recording_that_keeps_its_features_stays_the_same_object(sentence: ToySentence) -> None:
    audio = analysed(sentence.audio)
    assert analysed(audio) is audio
    assert audio.samples is sentence.audio.samples
    assert audio.duration_s == sentence.audio.duration_s


def test_the_loudest_stretch(sentence: ToySentence) -> None:
    audio = analysed(sentence.audio)
    assert audio.loudest_stretch(JUDGED_FRAMES) is audio
    stretch = audio.loudest_stretch(100)
    assert stretch is audio.loudest_stretch(100)
    assert len(stretch.samples) == 16_000
    assert np.square(stretch.samples).sum() > 0.5 * np.square(audio.samples).sum()


def test_what_has_no_features() -> None:
    with pytest.raises(InputError, match="need 16000 Hz, found 44100 Hz"):
        analysed(Audio(np.zeros(44_100, np.float32), 44_100)).mfcc()


def long_audio() -> Audio:
    sentences = toy_sentences(12)
    samples = np.concatenate([sentence.audio.samples for sentence in sentences])
    assert len(samples) / 160 > JUDGED_FRAMES
    return Audio(samples, 16_000)


@pytest.mark.parametrize("kind", ["fast", "general", pytest.param("auto", marks=pytest.mark.long)])
@pytest.mark.parametrize("is_long", [False, pytest.param(True, marks=pytest.mark.long)])
def test_each_kind_is_computed_once_for_all_that_is_done_with_a_recording(
    sentence: ToySentence, kind: str, is_long: bool, computed: Counter[Any]
) -> None:
    audio: AnalysedAudio = analysed(long_audio() if is_long else sentence.audio)
    recogniser = Recogniser(load_model().phones, kind)
    recognised = recogniser.recognise(audio, audio.mfcc())
    recogniser.align_phones(audio, audio.mfcc(), recognised)
    aligned = recogniser.align(audio, audio.mfcc(), sentence.words, Lexicon())
    agreement_score(audio, aligned)
    assert set(computed.values()) == {1}
    warps = 8 if is_long else 6
    # Features at no warp and general ones; at the other warps of the recording, or of its loudest stretch and the best.
    assert sum(what == "filters" for what, *_ in computed) == (2 if kind == "general" else warps)


def test_animate_computes_each_kind_once(toy_model: Model, sentence: ToySentence, computed: Counter[Any]) -> None:
    animate(sentence.audio, model=toy_model, transcript=" ".join(sentence.words))
    assert set(computed.values()) == {1}
