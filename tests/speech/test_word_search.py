import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion import errors, load_model, types, units
from lipmotion.hmm.network import wrap_log_likelihoods
from lipmotion.speech.recognition import recognised_speech, word_search
from lipmotion.speech.recognition.network import beam_search, posteriors
from lipmotion.speech.recognition.network.posteriors import find_installed_recogniser
from lipmotion.speech.recognition.word_search import list_spoken, list_wordless
from lipmotion.speech.sound.acoustic_conditions import mix_noise
from lipmotion.speech.sound.voice_activity import Stretch, read_stretch
from lipmotion.types import Audio
from lipmotion.units import Lexicon, is_silent, lexicon
from pipeline.made import read_sound, read_welcome, recogniser_of

SAID = "please speak and my lips will move five big blue boats float by".split()


@pytest.fixture
def without_a_phone_recogniser(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Words are searched by pocketsphinx, and read by rules, where ``hama`` is not installed."""
    monkeypatch.setitem(sys.modules, "hama", None)
    cached = [find_installed_recogniser, lexicon._network, lexicon.pronounce_by_network, word_search._load_decoder]
    cached.append(beam_search.load_english)  # as large as the decoder, of the same words
    for each in cached:
        each.cache_clear()
    yield
    for each in cached:
        each.cache_clear()


@pytest.fixture
def welcome(without_a_phone_recogniser: None) -> Audio:  # noqa: ARG001
    return read_welcome()


def recognition(audio: Audio, kind: str = "auto") -> recognised_speech.Recognition:
    return recogniser_of(load_model(), kind).recognise(audio)


def texts(found: recognised_speech.Recognition) -> list[str]:
    return [span.label.text for span in found.words]


@pytest.mark.long
def test_words_decide_the_phones_of_english(welcome: Audio) -> None:
    aligned = recogniser_of(load_model(), "auto").align(welcome, SAID, Lexicon())
    found = recognition(welcome)
    assert texts(found) == SAID
    assert found.word_s > 9 * found.phone_s
    spoken, wanted = (
        [span.label for span in units if not is_silent(span.label.phone)] for units in (found.units, aligned)
    )
    assert [(label.phone, label.word) for label in spoken] == [(label.phone, label.word) for label in wanted]
    assert (found.confidence or 0) > 0.5


@pytest.mark.parametrize("kind", ["fast", "own"])
def test_other_kinds_do_not_search_for_words(welcome: Audio, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(word_search, "spot_words")
    found = recognition(welcome, kind)
    assert texts(found) == []
    assert found.word_s == pytest.approx(0)
    assert found.confidence is None
    assert found.phone_s > 3


def recognise_as(monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
    monkeypatch.setattr(word_search, "spot_words", lambda _: tuple(word_search.FoundWord(word, 0.5) for word in words))


def test_words_that_do_not_fit_are_not_believed(welcome: Audio, monkeypatch: pytest.MonkeyPatch) -> None:
    recognise_as(monkeypatch, *("thick", "zoo", "choosy", "oath", "judges", "azure", "shush"))
    found = recognition(welcome)
    assert found.word_s < found.phone_s


def test_too_many_words_are_not_believed_and_none_leave_the_phones_as_they_are(
    welcome: Audio, monkeypatch: pytest.MonkeyPatch
) -> None:
    for words in (["constitutional"] * 100, []):
        recognise_as(monkeypatch, *words)
        assert recognition(welcome).units == recognition(welcome, "fast").units


@pytest.mark.usefixtures("without_a_phone_recogniser")
def test_noise_has_no_words() -> None:
    noise = np.random.default_rng(0).normal(0, 0.1, 16_000).astype(np.float32)
    found = recognition(Audio(noise, 16_000))
    assert found.word_s < 0.3


@pytest.mark.recordings
@pytest.mark.usefixtures("without_a_phone_recogniser")
def test_a_voice_and_words_that_the_model_knows_are_left_to_its_phones(recordings: Path) -> None:
    """The speaker and the words of the training: no language model of English expects "bin blue at f two now"."""
    grid = recordings / "grid-s1"
    for name in (grid / "val.txt").read_text().split()[1:3]:  # the first is less like its speaker: -4.0
        audio = read_sound(grid / "clips" / f"{name}.mkv")
        assert recognition(audio).units == recognition(audio, "fast").units


@pytest.mark.recordings
@pytest.mark.usefixtures("without_a_phone_recogniser")
def test_strangers_are_understood_better_with_words(recordings: Path) -> None:
    folder = recordings / "speech-open"
    said = {*(folder / "61-70968-0000.lab").read_text().lower().split()}
    assert len({*texts(recognition(read_sound(folder / "61-70968-0000.flac")))} & said) > 0.7 * len(said)


def test_words_of_a_sentence() -> None:
    audio = read_welcome()
    words = word_search.spot_words(read_stretch(audio, Stretch(0, len(audio.samples) // 160)))
    found = [word.text for word in words]
    assert all(0 <= word.posterior <= 1 for word in words)
    assert sum(word.posterior for word in words) > len(words) / 2
    assert {"please", "speak", "lips", "five", "big", "blue", "boats"} <= set(found)
    assert all(Lexicon().known(word) for word in found)
    assert not any({"<", "[", "+", "("} & set(word) for word in found)


def test_no_sound_has_no_words_and_the_samples_of_a_stretch_are_clipped_integers() -> None:
    assert [word_search.spot_words(samples) for samples in (b"", bytes(2), bytes(320))] == [()] * 3
    audio = Audio(np.repeat(np.array([0.0, 0.5, -2.0], np.float32), 160), 16_000)
    samples = np.frombuffer(read_stretch(audio, Stretch(1, 3)), "<i2")
    assert len(samples) == 320
    assert samples[0] == pytest.approx(16_383, abs=1)
    assert samples[-1] == -32_768


def test_one_recording_does_not_change_the_next() -> None:
    audio = read_welcome()
    samples = read_stretch(audio, Stretch(0, 120))
    noise = np.random.default_rng(0).normal(0, 9000, 8_000).astype("<i2").tobytes()
    first = word_search.spot_words(samples)
    word_search.spot_words(noise)
    assert word_search.spot_words(samples) == first


def test_without_its_language_model_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pocketsphinx", None)
    word_search._load_decoder.cache_clear()
    try:
        with pytest.raises(errors.MissingDependencyError, match="pip install pocketsphinx"):
            word_search.spot_words(b"")
    finally:
        word_search._load_decoder.cache_clear()


TOKENS = ("b", "p", "iː", "uː", "l", "ŋ", "t", "͡", "ʃ", posteriors.WORD_BOUNDARY, posteriors.BLANK)


def said(*tokens: str, sure: float = 0.9) -> posteriors.PhonePosteriors:
    """Return posteriors of tokens, each probable in one row of three."""
    values = np.full((3 * len(tokens) + 1, len(TOKENS)), 1e-4)
    values[:, -1] = 0.999
    for place, token in enumerate(tokens):
        values[3 * place + 1, TOKENS.index(token)] = sure
        values[3 * place + 1, -1] = 1 - sure
    return posteriors.PhonePosteriors(np.log(values).astype(np.float32), TOKENS)


def vocabulary(**words: str) -> beam_search.EnglishWords:
    """Return words that are as probable after all others, all but one."""
    spelt = [[bytes(beam_search.SOUNDS.index(phone) for phone in phones.split())] for phones in words.values()]
    tree, names = beam_search.build_word_tree(spelt, np.full(len(words), -2.0)), tuple(words)
    return beam_search.EnglishWords(tree, names, lambda word, _: -2.4 if names[word] != "plea" else -7.2)


WORDS = vocabulary(be="b iy", blue="b l uw", bee="b iy", plea="p l iy", loop="l uw p")


def decode(rows: posteriors.PhonePosteriors) -> list[beam_search.DecodedWord]:
    return beam_search.decode_words(WORDS, beam_search.score_stretch(rows))


def test_words_are_found_in_their_order() -> None:
    words = decode(said("b", "l", "uː", posteriors.WORD_BOUNDARY, "b", "iː"))
    assert [word.text for word in words] in (["blue", "be"], ["blue", "bee"])
    assert words[0].first == 0 < words[0].end <= words[1].first < words[1].end


def test_the_language_decides_where_posteriors_do_not() -> None:
    assert [word.text for word in decode(said("b", "l", "iː", sure=0.5))] in (["blue"], ["be"], ["bee"])


def test_what_is_no_word_is_phones() -> None:
    rows = said("ŋ", "p", "ŋ", "l", "ŋ", sure=0.99)
    words = decode(rows)
    assert "".join(word.text for word in words) == ""
    assert [phone for word in words for phone in rows.phones_between(word.first, word.end)] == "ng p ng l ng".split()


def test_nothing_is_said_in_blanks() -> None:
    assert decode(said()) == list_spoken(said()) == []
    assert posteriors.mean_posterior([posteriors.PosteriorStretch(Stretch(0, 2), said())]) == 0


@pytest.mark.parametrize("frames", [5, 40, 41])
def test_posteriors_draw_phones_that_models_do_not_tell_apart(frames: int) -> None:
    recogniser = recogniser_of(load_model(), "fast")
    hmm = recogniser.combined.hmm
    same = wrap_log_likelihoods(np.zeros((60, len(hmm.table.names)), np.float32))
    rows = said(*["b"] * 7, sure=0.99)
    found = [posteriors.PosteriorStretch(Stretch(10, 10 + frames), rows)]
    (part,) = list_wordless(hmm, recogniser._loop, same, found)
    stretch, labels = part
    assert stretch == found[0].stretch
    assert labels[0].first == 10
    assert "b" in {label.phone for label in labels}
    assert list_wordless(hmm, recogniser._loop, same, [posteriors.PosteriorStretch(Stretch(0, 2), said())]) == []


def test_posteriors_of_phones_sum_to_one() -> None:
    phones = np.exp(said("b", "iː").of_phones)
    assert phones.sum(axis=1) == pytest.approx(np.exp(said("b", "iː").values).sum(axis=1), rel=1e-4)
    assert units.PHONES[int(phones[1].argmax())] == "b"
    assert phones[0].argmax() == len(units.PHONES)


class Loud:
    """A phone recogniser that takes every half second for a b."""

    tokens = TOKENS
    source = "loud 1 0"

    def log_posteriors(self, samples: NDArray[np.float32]) -> NDArray[np.float32]:
        rows = np.full((len(samples) // 320, len(TOKENS)), -9, np.float32)
        rows[:, -1] = 0
        rows[10::25, 0], rows[10::25, -1] = -0.1, -3
        return rows


@pytest.fixture
def loud(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posteriors, "load_phone_recogniser", Loud)


def noise_after_silence(seconds: float) -> types.Audio:
    rng = np.random.default_rng(0)
    samples = rng.normal(0, 0.1, int(16_000 * seconds)).astype(np.float32)
    samples *= np.where(np.arange(len(samples)) % 8000 < 2400, 1e-3, 1).astype(np.float32)  # two syllables a second
    samples[:16_000] *= 1e-3
    return types.Audio(samples, 16_000)


@pytest.mark.usefixtures("loud")
def test_a_recording_has_posteriors_throughout() -> None:
    audio = read_sound(noise_after_silence(3.0))
    stretches = posteriors.find_stretches(audio)
    whole = posteriors.read_posteriors(audio)
    assert len(whole.values) == -(-len(audio.log_energy) // 2)
    assert stretches[0].stretch.first > 0
    assert {found.token for found in posteriors.read_posteriors(audio).best_tokens} == {"b"}
    assert whole.best_tokens[0].first == stretches[0].stretch.first // 2 + 10
    assert posteriors.find_stretches(audio) is stretches
    found = posteriors.infer_posteriors(audio)
    assert found.source == "loud 1 0"
    assert found.mean == pytest.approx(np.exp(-0.1), abs=1e-3)


@pytest.mark.usefixtures("loud")
def test_a_long_recording_is_cut() -> None:
    stretches = posteriors.find_stretches(read_sound(noise_after_silence(50.0)))
    assert len(stretches) > 2
    assert max(each.stretch.end - each.stretch.first for each in stretches) <= 2000


needs_hama = pytest.mark.skipif(find_installed_recogniser() is None, reason="hama has no library here")


@needs_hama
def test_unsure_posteriors_leave_phones_to_the_models(request: pytest.FixtureRequest) -> None:
    noisy = read_sound(mix_noise(read_welcome(), "white", -5))
    found = recogniser_of(load_model(), "auto").recognise(noisy)
    request.getfixturevalue("without_a_phone_recogniser")
    alone = recogniser_of(load_model(), "auto").recognise(noisy)
    assert found.units == alone.units
    assert found.posterior is None


@needs_hama
def test_the_welcome_is_understood() -> None:
    audio = read_welcome()
    found = recogniser_of(load_model(), "auto").recognise(audio)
    assert [span.label.text for span in found.words][:7] == "please speak and my lips will move".split()
    assert (found.confidence or 0) > 0.6
    assert (found.posterior or 0) > 0.8
    assert found.reliability == pytest.approx(1)
    assert {"please", "speak", "lips"} <= {span.label.word for span in found.units if span.label.phone == "p"}


@needs_hama
def test_very_short_sound_is_filled_up() -> None:
    hama = posteriors.load_phone_recogniser()
    assert hama.log_posteriors(np.zeros(3, np.float32)).shape[1] == len(hama.tokens)
    assert hama.source.startswith("hama ")
