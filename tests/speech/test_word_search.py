import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lipmotion import errors, load_model
from lipmotion.speech.recognition import recognised_speech, word_search
from lipmotion.speech.recognition.network.posteriors import installed_phone_recogniser
from lipmotion.speech.sound.voice_activity import Stretch, stretch_samples
from lipmotion.types import Audio
from lipmotion.units import Lexicon, is_silent
from pipeline.made import read_sound, read_welcome, recogniser_of

SAID = "please speak and my lips will move five big blue boats float by".split()


@pytest.fixture(autouse=True)
def without_a_phone_recogniser(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Words are searched by pocketsphinx where no phone recogniser is installed."""
    monkeypatch.setitem(sys.modules, "hama", None)
    installed_phone_recogniser.cache_clear()
    yield
    installed_phone_recogniser.cache_clear()


@pytest.fixture(scope="module")
def welcome() -> Audio:
    return read_welcome()


def recognition(audio: Audio, kind: str = "auto") -> recognised_speech.Recognition:
    return recogniser_of(load_model(), kind).recognition(audio, read_sound(audio).mfcc())


@cache
def of_welcome(kind: str) -> recognised_speech.Recognition:
    """Return what is recognised in the welcome, as it is."""
    return recognition(read_welcome(), kind)


def texts(found: recognised_speech.Recognition) -> list[str]:
    return [span.label.text for span in found.words]


def test_words_decide_the_phones_of_english(welcome: Audio) -> None:
    aligned = recogniser_of(load_model(), "auto").align(welcome, read_sound(welcome).mfcc(), SAID, Lexicon())
    for found in (of_welcome("auto"), of_welcome("words")):
        assert texts(found) == SAID
        assert found.word_s > 9 * found.phone_s
        spoken, wanted = (
            [span.label for span in units if not is_silent(span.label.phone)] for units in (found.units, aligned)
        )
        assert [(label.phone, label.word) for label in spoken] == [(label.phone, label.word) for label in wanted]
        assert found.confidence is not None
        assert found.confidence > 0.5


@pytest.mark.parametrize("kind", ["fast", "own"])
def test_other_kinds_do_not_search_for_words(welcome: Audio, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(word_search, "words_in")
    found = recognition(welcome, kind)
    assert texts(found) == []
    assert found.word_s == pytest.approx(0)
    assert found.confidence is None
    assert found.phone_s > 3


def test_confidences_grow_with_fit_and_posterior() -> None:
    by_fit = [word_search.score_words(fit, 0.5) for fit in np.linspace(-40, 5, 100)]
    by_posterior = [word_search.score_words(-0.5, share) for share in np.linspace(0, 1, 100)]
    assert by_fit == sorted(by_fit)
    assert by_posterior == sorted(by_posterior)
    assert 0 <= word_search.score_words(-99, 0) < 0.1
    assert 0.7 < word_search.score_words(0, 1) <= 1


def recognise_as(monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    monkeypatch.setattr(word_search, "words_in", lambda _: tuple(word_search.FoundWord(word, 0.5) for word in words))


def test_words_that_do_not_fit_are_not_believed(welcome: Audio, monkeypatch: pytest.MonkeyPatch) -> None:
    recognise_as(monkeypatch, *("thick", "zoo", "choosy", "oath", "judges", "azure", "shush"))
    found = recognition(welcome)
    assert found.word_s < found.phone_s
    assert texts(recognition(welcome, "words")) == ["thick", "zoo", "choosy", "oath", "judges", "azure", "shush"]


def test_too_many_words_are_not_believed_and_none_leave_the_phones_as_they_are(
    welcome: Audio, monkeypatch: pytest.MonkeyPatch
) -> None:
    for words in (["constitutional"] * 100, []):
        recognise_as(monkeypatch, *words)
        assert recognition(welcome).units == of_welcome("fast").units
    assert {span.label.phone for span in recognition(welcome, "words").units} == {"sil"}


def test_noise_has_no_words() -> None:
    noise = np.random.default_rng(0).normal(0, 0.1, 16_000).astype(np.float32)
    found = recognition(Audio(noise, 16_000))
    assert found.word_s < 0.3


@pytest.mark.recordings
def test_a_voice_and_words_that_the_model_knows_are_left_to_its_phones(recordings: Path) -> None:
    """The speaker and the words of the training: no language model of English expects "bin blue at f two now"."""
    grid = recordings / "grid-s1"
    for name in (grid / "val.txt").read_text().split()[:2]:
        audio = read_sound(grid / "clips" / f"{name}.mkv")
        assert recognition(audio).units == recognition(audio, "fast").units


@pytest.mark.recordings
def test_strangers_are_understood_better_with_words(recordings: Path) -> None:
    audio = read_sound(recordings / "speech-open" / "61-70968-0000.flac")
    said = (recordings / "speech-open" / "61-70968-0000.lab").read_text().lower().split()
    assert len(set(texts(recognition(audio))) & set(said)) > 0.7 * len(set(said))


@pytest.mark.recordings
def test_other_languages_have_no_confident_words(recordings: Path) -> None:
    confidence = recognition(
        read_sound(recordings / "speech-open" / "common_voice_ja_24511055.mp3"), "words"
    ).confidence
    assert confidence is not None
    assert confidence < 0.35


def test_words_of_a_sentence() -> None:
    audio = read_welcome()
    words = word_search.words_in(stretch_samples(audio, Stretch(0, len(audio.samples) // 160)))
    found = [word.text for word in words]
    assert all(0 <= word.posterior <= 1 for word in words)
    assert sum(word.posterior for word in words) > len(words) / 2
    assert {"please", "speak", "lips", "five", "big", "blue", "boats"} <= set(found)
    assert all(Lexicon().known(word) for word in found)
    assert not any(word_search.is_filler(word) or "(" in word for word in found)


def test_no_sound_has_no_words_and_the_samples_of_a_stretch_are_clipped_integers() -> None:
    assert [word_search.words_in(samples) for samples in (b"", bytes(2), bytes(320))] == [()] * 3
    audio = Audio(np.repeat(np.array([0.0, 0.5, -2.0], np.float32), 160), 16_000)
    samples = np.frombuffer(stretch_samples(audio, Stretch(1, 3)), "<i2")
    assert len(samples) == 320
    assert samples[0] == pytest.approx(16_383, abs=1)
    assert samples[-1] == -32_768
    assert all(word_search.is_filler(entry) for entry in ("<s>", "</s>", "[NOISE]", "++UH++"))
    assert not word_search.is_filler("'bout")


def test_one_recording_does_not_change_the_next() -> None:
    audio = read_welcome()
    samples = stretch_samples(audio, Stretch(0, 120))
    noise = np.random.default_rng(0).normal(0, 9000, 8_000).astype("<i2").tobytes()
    first = word_search.words_in(samples)
    word_search.words_in(noise)
    assert word_search.words_in(samples) == first


def test_without_its_language_model_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pocketsphinx", None)
    word_search._decoder.cache_clear()
    try:
        with pytest.raises(errors.MissingDependencyError, match="pip install pocketsphinx"):
            word_search.words_in(b"")
    finally:
        word_search._decoder.cache_clear()
