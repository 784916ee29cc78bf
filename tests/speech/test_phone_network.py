from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion import errors, load_model, types, units
from lipmotion.hmm.network import wrap_log_likelihoods
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition import word_search
from lipmotion.speech.recognition.network import beam_search, posteriors
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.speech.recognition.word_search import phones_without_words, spoken_items
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.voice_activity import Stretch
from lipmotion.units.phones import count_phone_edits

TOKENS = ("b", "p", "iː", "uː", "l", "ŋ", "t", "͡", "ʃ", posteriors.WORD_BOUNDARY, posteriors.BLANK)
WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"


def said(*tokens: str, sure: float = 0.9) -> posteriors.PhonePosteriors:
    """Return posteriors of tokens, each probable in one row of three."""
    values = np.full((3 * len(tokens) + 1, len(TOKENS)), 1e-4)
    values[:, -1] = 0.999
    for place, token in enumerate(tokens):
        values[3 * place + 1, TOKENS.index(token)] = sure
        values[3 * place + 1, -1] = 1 - sure
    return posteriors.PhonePosteriors(np.log(values).astype(np.float32), TOKENS)


class Unigram:
    """A language model in which every word is as probable."""

    def prob(self, words: Sequence[str]) -> float:
        return -3.0 if words[0] != "plea" else -9.0


def vocabulary(**words: str) -> beam_search.EnglishWords:
    spelt = [[bytes(beam_search.SOUNDS.index(phone) for phone in phones.split())] for phones in words.values()]
    language = beam_search.LanguageModel(tuple(words), Unigram(), 1.0)
    return beam_search.EnglishWords(beam_search.word_tree(spelt, np.full(len(words), -2.0)), language)


WORDS = vocabulary(be="b iy", blue="b l uw", bee="b iy", plea="p l iy", loop="l uw p")


def test_words_that_begin_alike_share_nodes() -> None:
    tree = WORDS.tree
    assert len(tree.sound) == 1 + 10 + len(beam_search.SOUNDS)  # b-iy and b-l-uw share b; p-l-iy, l-uw-p
    ends = {place: numbers for place, numbers in tree.ends.items() if place < tree.free}
    assert sorted(ends.values()) == [[0, 2], [1], [3], [4]]
    assert tree.arcs.sum() == len(tree.target)


def test_words_are_found_in_their_order() -> None:
    words = beam_search.decoded_words(
        WORDS, beam_search.scored(said("b", "l", "uː", posteriors.WORD_BOUNDARY, "b", "iː"))
    )
    assert [word.text for word in words] in (["blue", "be"], ["blue", "bee"])
    assert words[0].first == 0 < words[0].end <= words[1].first < words[1].end


def test_the_language_decides_where_posteriors_do_not() -> None:
    likely = beam_search.decoded_words(WORDS, beam_search.scored(said("b", "l", "iː", sure=0.5)))
    assert [word.text for word in likely] in (["blue"], ["be"], ["bee"])


def test_what_is_no_word_is_phones() -> None:
    rows = said("ŋ", "p", "ŋ", "l", "ŋ", sure=0.99)
    words = beam_search.decoded_words(WORDS, beam_search.scored(rows))
    assert "".join(word.text for word in words) == ""
    assert [phone for word in words for phone in rows.phones_between(word.first, word.end)] == "ng p ng l ng".split()


def test_nothing_is_said_in_blanks() -> None:
    assert beam_search.decoded_words(WORDS, beam_search.scored(said())) == []
    assert spoken_items(said()) == []
    assert posteriors.mean_posterior([posteriors.PosteriorStretch(Stretch(0, 2), said())]) == 0


@pytest.mark.parametrize("frames", [5, 40, 41])
def test_posteriors_draw_phones_that_models_do_not_tell_apart(frames: int) -> None:
    recogniser = Recogniser(load_model().phones, "fast")
    hmm = recogniser.combined.hmm
    same = wrap_log_likelihoods(np.zeros((60, len(hmm.table.names)), np.float32))
    rows = said(*["b"] * 7, sure=0.99)
    found = [posteriors.PosteriorStretch(Stretch(10, 10 + frames), rows)]
    (part,) = phones_without_words(hmm, recogniser._loop, same, found)
    stretch, labels = part
    assert stretch == found[0].stretch
    assert labels[0].first == 10
    assert "b" in {label.phone for label in labels}
    assert phones_without_words(hmm, recogniser._loop, same, [posteriors.PosteriorStretch(Stretch(0, 2), said())]) == []


def test_a_sure_word_is_believed_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(word_search, "english_words", lambda: WORDS)
    sure, unsure, other = (
        spoken_items(rows)[0].confidence
        for rows in (said("b", "l", "uː"), said("b", "l", "uː", sure=0.6), said("b", "l", "iː", sure=0.52))
    )
    assert 0 < other < unsure < sure < 1


def test_forms_of_a_phone_are_the_same() -> None:
    assert count_phone_edits(("ax", "b", "el"), ["ah", "b", "l"]) == 0
    assert count_phone_edits(("b", "uw"), ["p", "uw", "t"]) == 2


def test_posteriors_of_phones_sum_to_one() -> None:
    phones = np.exp(said("b", "iː").of_phones)
    assert phones.sum(axis=1) == pytest.approx(np.exp(said("b", "iː").values).sum(axis=1), rel=1e-4)
    assert units.PHONES[int(phones[1].argmax())] == "b"
    assert phones[0].argmax() == len(units.PHONES)


class Loud(posteriors.PhoneRecogniser):
    """A recogniser that takes every half second for a b."""

    name: ClassVar[str] = "loud"
    tokens = TOKENS
    source = "loud 1 0"

    @classmethod
    def is_installed(cls) -> bool:
        return cls.name == "loud"

    def log_posteriors(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        rows = np.full((len(samples) // 320, len(TOKENS)), -9, np.float32)
        rows[:, -1] = 0
        rows[10::25, 0], rows[10::25, -1] = -0.1, -3
        return rows


class Absent(Loud):
    name: ClassVar[str] = "absent"


@pytest.fixture
def loud(monkeypatch: pytest.MonkeyPatch) -> str:
    registry = posteriors.PHONE_RECOGNISERS
    kinds = {"loud": Loud, "absent": Absent, "odd": dict}
    monkeypatch.setattr(type(registry), "_find", lambda _, name: kinds.get(name, posteriors.Hama))
    monkeypatch.setattr(posteriors, "installed_phone_recogniser", lambda: "loud")
    posteriors.phone_recogniser.cache_clear()
    return "loud"


def noise_after_silence(seconds: float) -> types.Audio:
    rng = np.random.default_rng(0)
    samples = rng.normal(0, 0.1, int(16_000 * seconds)).astype(np.float32)
    samples *= np.where(np.arange(len(samples)) % 8000 < 2400, 1e-3, 1).astype(np.float32)  # two syllables a second
    samples[:16_000] *= 1e-3
    return types.Audio(samples, 16_000)


def test_a_recording_has_posteriors_throughout(loud: str) -> None:
    audio = analysed(noise_after_silence(3.0))
    stretches = posteriors.posterior_stretches(loud, audio)
    whole = posteriors.recording_posteriors(loud, audio)
    assert len(whole.values) == -(-len(audio.log_energy) // 2)
    assert stretches[0].stretch.first > 0
    assert {found.token for found in posteriors.recording_posteriors(loud, audio).best_tokens} == {"b"}
    assert whole.best_tokens[0].first == stretches[0].stretch.first // 2 + 10
    assert posteriors.posterior_stretches(loud, audio) is stretches
    found = posteriors.token_posteriors(loud, audio)
    assert found.source == "loud 1 0"
    assert found.mean == pytest.approx(np.exp(-0.1), abs=1e-3)


def test_a_long_recording_is_cut(loud: str) -> None:
    found = posteriors.posterior_stretches(loud, analysed(noise_after_silence(50.0)))
    assert len(found) > 2
    assert max(each.stretch.end - each.stretch.first for each in found) <= 2000


@pytest.mark.usefixtures("loud")
def test_a_recogniser_that_is_not_installed_or_is_none_is_refused() -> None:
    with pytest.raises(errors.MissingDependencyError, match="pip install absent"):
        posteriors.phone_recogniser("absent")
    with pytest.raises(errors.InputError, match="required a class of PhoneRecogniser"):
        posteriors.phone_recogniser("odd")


def test_unsure_posteriors_leave_phones_to_the_models(monkeypatch: pytest.MonkeyPatch) -> None:
    audio = read_audio(WELCOME)
    with monkeypatch.context() as without:
        without.setattr("lipmotion.speech.recognition.recogniser.installed_phone_recogniser", lambda: None)
        alone = Recogniser(load_model().phones, "fast").recognition(audio, analysed(audio).mfcc())
    monkeypatch.setattr("lipmotion.speech.recognition.recogniser.installed_phone_recogniser", lambda: "hama")
    unsure = [posteriors.PosteriorStretch(Stretch(0, 100), said("b", "iː", sure=0.51))]
    monkeypatch.setattr("lipmotion.speech.recognition.recogniser.posterior_stretches", lambda *_: unsure)
    monkeypatch.setattr("lipmotion.speech.recognition.word_search.words_in", lambda _: ())
    found = Recogniser(load_model().phones).recognition(audio, analysed(audio).mfcc())
    assert found.units == alone.units
    assert found.posterior is None


@pytest.mark.skipif(not posteriors.Hama.is_installed(), reason="hama has no library here")
def test_the_welcome_is_understood() -> None:
    audio = read_audio(WELCOME)
    found = Recogniser(load_model().phones).recognition(audio, analysed(audio).mfcc())
    assert [span.label.text for span in found.words][:7] == "please speak and my lips will move".split()
    assert found.confidence is not None
    assert found.confidence > 0.6
    assert found.posterior is not None
    assert found.posterior > 0.8
    assert found.reliability == pytest.approx(1)
    assert {"please", "speak", "lips"} <= {span.label.word for span in found.units if span.label.phone == "p"}


@pytest.mark.skipif(not posteriors.Hama.is_installed(), reason="hama has no library here")
def test_very_short_sound_is_filled_up() -> None:
    assert posteriors.Hama().log_posteriors(np.zeros(3, np.float32)).shape[1] == len(posteriors.Hama().tokens)
    assert posteriors.Hama().source.startswith("hama ")
