import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from children import run_child
from lipmotion import errors, types
from lipmotion.errors import InputError, MissingDependencyError
from lipmotion.speech.voices import espeak
from lipmotion.speech.voices.installed import find_voice, speak_sentences
from lipmotion.speech.voices.inventory_phones import assign_words, convert_phones
from lipmotion.speech.voices.synthesiser import ARPABET_PHONES, ESPEAK_PHONES
from lipmotion.types import Audio, Span, Timeline, languages
from lipmotion.units import PHONES, Lexicon, is_silent

INSTALLED = espeak.find_wheel() is not None
SENTENCES = {
    "de": ("Die schöne Köchin möchte fünf süße Äpfel.", "die schöne köchin möchte fünf süße äpfel"),
    "fr": ("Une belle huître, bon vin blanc.", "une belle huître bon vin blanc"),
    "pt": ("O coração não é pão.", "o coração não é pão"),
}


def test_voices_are_those_of_the_data(faked: Path) -> None:
    assert [voice.name for voice in espeak.ESPEAK_NG.voices()] == ["en-us+f2"]
    assert [voice.name for voice in espeak.ESPEAK_NG.others()] == ["de", "en", "en-gb", "en-us"]
    shutil.rmtree(faked.parent / "packages" / espeak.WHEEL / "espeak-ng-data")
    assert (espeak.ESPEAK_NG.voices(), espeak.ESPEAK_NG.others()) == ((), ())


@pytest.mark.usefixtures("faked")
def test_another_language_keeps_its_words_and_takes_the_nearest_phones(caplog: pytest.LogCaptureFixture) -> None:
    _, units, _ = next(speak_sentences(["«Hällo!»"], find_voice("espeak-ng:de+f2")))
    assert [(span.label.phone, span.label.word) for span in units] == [
        ("sil", ""), ("hh", "hällo"), ("ax", "hällo"), ("l", "hällo"), ("ow", "hällo"), ("sil", ""),
    ]  # fmt: skip
    assert caplog.text == ""


@pytest.mark.usefixtures("faked")
def test_phones_that_no_table_has_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    _, units, _ = next(speak_sentences(["strange"], find_voice("de")))
    assert units[4].label.phone == "ax"
    assert "no table has, shown as the nearest or as ax: ꙮ" in caplog.text


def written(*places: int, text: str) -> list[str]:
    phones = Timeline(tuple(Span(n / 10, (n + 1) / 10, "a") for n in range(len(places))))
    return [f"{span.start_s} {span.label}" for span in espeak._spell_words(phones, places, text)]


def test_words_are_found_by_their_places() -> None:
    assert written(0, 0, 4, 8, 12, text="one two-six ten") == ["0.0 one", "0.2 two-six", "0.4 ten"]
    assert written(0, 0, 7, text="on the red ball") == ["0.0 on the", "0.2 red ball"]  # said together
    assert written(3, 3, text="- one -") == ["0.0 - one -"]


def test_a_library_that_is_none_is_said_so(tmp_path: Path) -> None:
    (tmp_path / "no.so").write_text("no library")
    done = run_child(espeak.PROGRAM, text=json.dumps({"library": str(tmp_path / "no.so"), "data": str(tmp_path)}))
    assert done.returncode == 1
    assert "install espeakng-loader again" in done.stderr


@pytest.mark.skipif(not INSTALLED, reason="the package espeakng-loader is not installed")
class TestPackage:
    """The library of the Python package."""

    @pytest.mark.parametrize("language", ["de", *(pytest.param(each, marks=pytest.mark.long) for each in ("fr", "pt"))])
    def test_other_languages(self, language: str, caplog: pytest.LogCaptureFixture) -> None:
        text, words = SENTENCES[language]
        audio, units, _ = next(speak_sentences([text], find_voice(language)))
        said = [span.label.word for span in units if not is_silent(span.label.phone)]
        assert list(dict.fromkeys(said)) == words.split()
        assert units[-1].end_s == pytest.approx(audio.duration_s)
        assert caplog.text == ""

    def test_numbers_and_signs_have_the_words_that_are_said(self) -> None:
        _, units, _ = next(speak_sentences(["It cost 42 euros, mother-in-law."], find_voice("espeak-ng:en-us+f2")))
        said = dict.fromkeys(span.label.word for span in units if span.label.word)
        assert list(said) == "it cost forty two euros mother in law".split()


RATE_HZ = 16_000


def sound(*silences: tuple[float, float], duration_s: float = 1.0) -> Audio:
    """Return a tone with holes."""
    samples = np.sin(np.arange(round(duration_s * RATE_HZ)) * 0.2 + 1).astype(np.float32)
    samples[np.abs(samples) < 0.1] = 0.1
    for start_s, end_s in silences:
        samples[round(start_s * RATE_HZ) : round(end_s * RATE_HZ)] = 0
    return Audio(samples, RATE_HZ)


def starts(labels: list[tuple[str, float]], audio: Audio) -> list[float]:
    return [round(span.start_s, 4) for span in espeak.correct_times(labels, audio)]


def test_a_stop_begins_with_its_closure() -> None:
    for stop in ("p", "t2", "k", "tS", "b", "d", "g", "dZ"):
        assert starts([("a", 0.1), (stop, 0.4), ("i:", 0.5)], sound((0.35, 0.42))) == [0.1, 0.35, 0.5]
    assert starts([("a", 0.1), ("p", 0.4)], sound((0.2, 0.4))) == [0.1, 0.34]  # a long silence is not all closure
    for before, label in (("a", "s"), ("a", "m"), ("_:", "p"), ("_", "k")):  # other silences stay
        assert starts([(before, 0.1), (label, 0.4)], sound((0.35, 0.4))) == [0.1, 0.4]
    # it never reaches past the phone before, and without silence or at the start it stays
    assert starts([("a", 0.1), ("s", 0.38), ("t", 0.4)], sound((0.35, 0.4))) == [0.1, 0.38, 0.38]
    assert starts([("a", 0.1), ("b", 0.4)], sound()) == [0.1, 0.4]
    assert starts([("a", 0.0), ("b", 0.0)], sound()) == [0.0, 0.0]
    assert starts([("a", 0.1), ("p", 0.5)], Audio(np.zeros(RATE_HZ, np.float32), RATE_HZ)) == [0.1, 0.5]


def test_an_l_that_is_late_gets_its_share_of_the_vowel_and_the_last_lasts_to_the_end() -> None:
    assert starts([("OI", 0.1), ("l", 0.29), ("d", 0.3)], sound()) == [0.1, 0.21, 0.3]
    assert starts([("OI", 0.1), ("l", 0.2), ("d", 0.3)], sound()) == [0.1, 0.2, 0.3]
    assert starts([("t", 0.1), ("l", 0.29), ("d", 0.3)], sound()) == [0.1, 0.29, 0.3]
    phones = espeak.correct_times([("a", 0.1), ("s", 0.5)], sound())
    assert [(span.label, span.end_s) for span in phones] == [("a", 0.5), ("s", 1.0)]


WORDS = {
    "es": {"lobo": "l ow v ow", "cigüeña": "th iy g uw eh n aa"}, "fr": {"rue": "hh uw", "l'œuf": "l ao f"},
    "de": {"schöne": "sh ow n ax", "12": "t s v ao l f"}, "ja": {"ふゆ": "f uh y uh"}, "ko": {"밥을": "p aa p ix l"},
    "zh": {"吗": "m aa", "个": "k ax"}, "ru": {"мир": "m iy r"},
}  # fmt: skip


@pytest.mark.usefixtures("bare")
def test_without_rules_only_the_users_words_are_pronounced() -> None:
    lexicon = espeak.LanguageLexicon({"perro": (("p", "eh", "r", "ow"),)}, "es")
    assert lexicon.with_words(("perro", "perro")) is lexicon
    with pytest.raises(MissingDependencyError, match=re.escape("no pronunciation of 'gato' in Spanish: install")):
        lexicon.with_words(("perro", "gato"))


@pytest.mark.usefixtures("bare")
def test_letters_of_another_script_are_refused() -> None:
    for language, word in (("ja", "東京"), ("es", "привет"), ("zh", "こ")):
        with pytest.raises(InputError, match="no rules say how"):
            espeak.LanguageLexicon({}, language).pronunciations(word)


@pytest.mark.skipif(not INSTALLED, reason="the package espeakng-loader is not installed")
class TestRules:
    """The rules of espeak-ng, of the Python package."""

    @pytest.mark.parametrize("language", ["es", *(pytest.param(each, marks=pytest.mark.long) for each in [*WORDS][1:])])
    def test_rules_of_the_language(self, language: str) -> None:
        words = WORDS[language]
        lexicon = espeak.LanguageLexicon({}, language).with_words(tuple(words))
        assert {word: " ".join(lexicon.pronunciations(word)[0]) for word in words} == words

    @pytest.mark.long
    def test_every_language_has_a_voice(self) -> None:
        for language in languages.LANGUAGES.keys() - {languages.ENGLISH}:
            phones = espeak.LanguageLexicon({}, language).pronunciations("2")[0]
            assert phones
            assert {*phones} <= {*PHONES}


LEXICON = Lexicon({"butter": (("b", "ah", "t", "axr"),), "is": (("ix", "z"),), "it": (("ih", "t"),)})


def timeline(*labels: tuple[str, float, float]) -> types.Timeline[str]:
    return types.Timeline(tuple(types.Span(start, end, label) for label, start, end in labels))


def test_unstressed_vowels_are_reduced_and_words_known() -> None:
    said = "b ah dh t er ih z ih t".split()  # dh: nobody's
    wanted = {"butter": "b ah dh t axr", "is": "ix z", "it": "ih t"}
    units = [types.Unit(phone, word=word) for word, phones in wanted.items() for phone in phones.split()]
    assert assign_words(said, [*wanted], LEXICON) == units


def test_a_word_that_is_said_again_is_known_as_such() -> None:
    for phones, words, again in (
        ("ih t ih z ix t", ["it", "is", "it"], [False] * 6),
        ("ih t ax t", ["it", "it"], [False, False, True, False]),
    ):
        assert [unit.again for unit in assign_words(phones.split(), words, LEXICON)] == again


def test_pauses_are_named_by_place_and_length() -> None:
    said = timeline(
        ("pau", 0.0, 0.1), ("ih", 0.1, 0.2), ("pau", 0.2, 0.35), ("t", 0.35, 0.4), ("pau", 0.4, 0.65), ("ih", 0.65, 1.0)
    )
    units = convert_phones(said, ARPABET_PHONES, ["it"], LEXICON, 1.1)
    assert [span.label.phone for span in units] == ["sil", "ih", "sp", "t", "sil", "ih", "sil"]
    assert [span.start_s for span in units] == pytest.approx([0, 0.1, 0.2, 0.35, 0.4, 0.65, 1.0])
    assert units[-1].end_s == pytest.approx(1.1)
    for label, message in (("xx", "'xx', which is no phone"), ("pau", "no phone; give")):
        with pytest.raises(errors.InputError, match=message):
            convert_phones(timeline((label, 0.0, 0.1)), ARPABET_PHONES, ["it"], LEXICON, 0.2)


def test_what_is_not_covered_is_silent_what_is_too_late_is_cut_and_parts_of_a_label_join() -> None:
    said = timeline(("ih", 0.1, 0.2), ("t", 0.3, 0.6), ("t", 0.7, 0.8))
    units = convert_phones(said, ARPABET_PHONES, ["it"], LEXICON, 0.5)
    found = [(span.label.phone, span.start_s, span.end_s) for span in units]
    assert found == [("sil", 0.0, 0.1), ("ih", 0.1, 0.2), ("sp", 0.2, 0.3), ("t", 0.3, 0.5)]
    said = timeline(("A@", 0.0, 0.2), (";", 0.2, 0.3), ("t", 0.3, 0.3), ("z", 0.3, 0.4))
    units = convert_phones(said, ESPEAK_PHONES, ["is"], LEXICON, 0.4)
    found = [(span.label.phone, span.start_s, span.end_s) for span in units]
    assert found == [("aa", 0.0, 0.1), ("r", 0.1, pytest.approx(0.3)), ("z", 0.3, 0.4)]


def test_tables_lead_to_the_inventory() -> None:
    for table in (ARPABET_PHONES, ESPEAK_PHONES):
        assert {phone for phones in table.values() for phone in phones} <= set(PHONES)
    spoken = {phone for phones in ESPEAK_PHONES.values() for phone in phones}
    assert set(PHONES) - spoken == {"sp"}
