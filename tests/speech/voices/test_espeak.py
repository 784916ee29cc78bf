"""espeak-ng: which library speaks, what it says in other languages, and the words that it tells."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from children import Done, run_child
from lipmotion.speech.voices import espeak
from lipmotion.speech.voices.espeak import ESPEAK_NG
from lipmotion.speech.voices.installed import speak_sentences, voice_named
from lipmotion.types import Span, Timeline
from lipmotion.units import is_silent

from . import fakes

INSTALLED = espeak.wheel_folder() is not None
SENTENCES = {
    "de": ("Die schöne Köchin möchte fünf süße Äpfel.", "die schöne köchin möchte fünf süße äpfel"),
    "fr": ("Une belle huître, bon vin blanc.", "une belle huître bon vin blanc"),
    "pt": ("O coração não é pão.", "o coração não é pão"),
}


@pytest.fixture
def wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A Python package with a library and data, which is not loaded."""
    folder = tmp_path / "espeakng_loader"
    fakes.install_data(folder / "espeak-ng-data")
    (folder / "libespeak-ng.so").touch()
    spec = SimpleNamespace(submodule_search_locations=[str(folder)])
    monkeypatch.setattr(espeak, "find_spec", lambda _: spec)
    return folder


def test_the_package_comes_before_the_system(wheel: Path) -> None:
    assert espeak.wheel_folder() == wheel
    assert espeak._library() == {"library": str(wheel / "libespeak-ng.so"), "data": str(wheel)}
    assert [voice.name for voice in ESPEAK_NG.voices()] == ["en-us+f2"]
    assert [voice.name for voice in ESPEAK_NG.others()] == ["de", "en", "en-gb", "en-us"]


def test_a_package_without_its_data_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = SimpleNamespace(submodule_search_locations=[str(tmp_path)])
    monkeypatch.setattr(espeak, "find_spec", lambda _: spec)
    assert espeak.wheel_folder() is None


@pytest.mark.usefixtures("faked")
def test_the_system_tells_where_its_data_are() -> None:
    assert espeak._library() == {}
    assert [voice.name for voice in ESPEAK_NG.others()] == ["de", "en", "en-gb", "en-us"]


def test_a_library_without_data_has_no_voices(faked: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(espeak, "PROGRAM", [str(faked.parent / "programs" / "flite"), "-lv"])
    assert (ESPEAK_NG.voices(), ESPEAK_NG.others()) == ((), ())


@pytest.mark.usefixtures("faked")
def test_another_language_keeps_its_words_and_takes_the_nearest_phones(caplog: pytest.LogCaptureFixture) -> None:
    _, units = next(speak_sentences(["«Hällo!»"], voice_named("espeak-ng:de+f2")))
    assert [(span.label.phone, span.label.word) for span in units] == [
        ("sil", ""), ("hh", "hällo"), ("ax", "hällo"), ("l", "hällo"), ("ow", "hällo"), ("sil", ""),
    ]  # fmt: skip
    assert caplog.text == ""


@pytest.mark.usefixtures("faked")
def test_phones_that_no_table_has_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    _, units = next(speak_sentences(["strange"], voice_named("de")))
    assert units[4].label.phone == "ax"
    assert "no table has, shown as the nearest or as ax: ꙮ" in caplog.text


def written(*places: int, text: str) -> list[str]:
    phones = Timeline(tuple(Span(n / 10, (n + 1) / 10, "a") for n in range(len(places))))
    return [f"{span.start_s} {span.label}" for span in espeak._written_words(phones, places, text)]


def test_words_are_found_by_their_places() -> None:
    assert written(0, 0, 4, 8, 12, text="one two-six ten") == ["0.0 one", "0.2 two-six", "0.4 ten"]


def test_a_word_that_is_said_with_the_one_before_belongs_to_it() -> None:
    assert written(0, 0, 7, text="on the red ball") == ["0.0 on the", "0.2 red ball"]
    assert written(3, 3, text="- one -") == ["0.0 - one -"]


def run_events(task: dict[str, object]) -> Done:
    return run_child(espeak.PROGRAM, text=json.dumps(task))


def test_a_library_that_is_none_is_said_so(tmp_path: Path) -> None:
    (tmp_path / "no.so").write_text("no library")
    done = run_events({"library": str(tmp_path / "no.so")})
    assert done.returncode == 1
    assert "no.so is installed; apt install libespeak-ng1" in done.stderr


@pytest.mark.skipif(not INSTALLED, reason="the package espeakng-loader is not installed")
class TestPackage:
    """The library of the Python package."""

    def test_it_is_of_the_version_that_the_times_are_right_for(self) -> None:
        done = run_events(dict(espeak._library()))
        assert json.loads(done.stdout)["version"].startswith("1.52")

    @pytest.mark.parametrize("language", ["de", *(pytest.param(each, marks=pytest.mark.long) for each in ("fr", "pt"))])
    def test_other_languages(self, language: str, caplog: pytest.LogCaptureFixture) -> None:
        text, words = SENTENCES[language]
        audio, units = next(speak_sentences([text], voice_named(language)))
        said = [span.label.word for span in units if not is_silent(span.label.phone)]
        assert list(dict.fromkeys(said)) == words.split()
        assert units[-1].end_s == pytest.approx(audio.duration_s)
        assert caplog.text == ""

    def test_numbers_and_signs_have_the_words_that_are_said(self) -> None:
        _, units = next(speak_sentences(["It cost 42 euros, mother-in-law."], voice_named("espeak-ng:en-us+f2")))
        said = dict.fromkeys(span.label.word for span in units if span.label.word)
        assert list(said) == "it cost forty two euros mother in law".split()

    def test_letters_of_other_scripts_are_said_somehow(self) -> None:
        _, units = next(speak_sentences(["שלום 12345678901234567890"], voice_named("espeak-ng:en-us+f2")))
        assert len(units) > 40
