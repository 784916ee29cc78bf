"""Which voices there are, and what they say: with fakes everywhere, with the synthesisers where they are."""

import os
import shutil
import time
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Model, errors
from lipmotion.speech.sound.acoustic_conditions import mix_noise
from lipmotion.speech.voices import installed, synthesiser
from lipmotion.units import PHONES, Lexicon, is_silent, split_words
from pipeline.made import recogniser_of

FAKED = [
    synthesiser.SyntheticVoice("kal16", "flite", "kal"),
    synthesiser.SyntheticVoice("slt", "flite", "slt"),
    synthesiser.SyntheticVoice("cmu_us_slt_arctic_hts", "festival", "slt"),
    synthesiser.SyntheticVoice("kal_diphone", "festival", "kal"),
    synthesiser.SyntheticVoice("en-us+f2", "espeak-ng", "espeak-f2"),
]
EACH = [FAKED[0], FAKED[2], FAKED[4]]
HARD = ['"Hello" \\ (sil) %s', "Hello; `ls` $HOME", "Helló"]


@pytest.mark.usefixtures("faked")
def test_voices_are_listed() -> None:
    assert installed.list_installed() == installed.list_voices()[: len(FAKED)] == tuple(FAKED)
    assert [voice.language for voice in installed.list_voices()[len(FAKED) :]] == ["de", "en", "en-gb", "en-us"]


@pytest.mark.parametrize("voice", EACH)
@pytest.mark.usefixtures("faked")
def test_any_letters_reach_the_synthesiser(voice: synthesiser.SyntheticVoice) -> None:
    lexicon = Lexicon({"helló": (("hh", "ax", "l", "ow"),)})
    assert len(list(installed.speak_sentences(HARD, voice, lexicon))) == len(HARD)


@pytest.mark.usefixtures("faked")
def test_a_voice_says_phones_in_time() -> None:
    for voice in EACH:
        audio, units, _ = next(installed.speak_sentences(["Hello"], voice))
        assert audio.rate_hz == 16_000
        assert audio.duration_s == pytest.approx(1.0)
        found = [(span.label.phone, span.label.word, round(span.start_s, 6)) for span in units]
        assert found == [
            ("sil", "", 0.0), ("hh", "hello", 0.2), ("ax", "hello", 0.3), ("l", "hello", 0.4), ("ow", "hello", 0.5),
            ("sil", "", 0.9),
        ]  # fmt: skip


def test_errors_are_clear_and_nothing_stays(faked: Path) -> None:
    for voice, text, message in (
        *((voice, "they crash", "failed with 1 .no such sound") for voice in EACH),
        *((voice, "nonsense", "nonsense") for voice in EACH),
        (FAKED[0], "no bytes", "cannot be run|nonsense"),
        (FAKED[0], "... ", "holds no word"),
        (FAKED[2], "stop here", "0 of 1 sentences"),
    ):
        with pytest.raises(errors.InputError, match=message):
            list(installed.speak_sentences([text], voice))
        assert list(faked.iterdir()) == []


def test_temporary_files_go_even_if_not_all_is_read(faked: Path) -> None:
    said = installed.speak_sentences(["hello", "hello"], FAKED[0])
    next(said)
    assert len(list(faked.iterdir())) == 1
    said.close()
    assert list(faked.iterdir()) == []


@pytest.mark.long
@pytest.mark.usefixtures("faked")
def test_voices_by_name() -> None:
    for name, full_name in (
        ("flite:slt", "flite:slt"), ("slt", "flite:slt"), ("kal_diphone", "festival:kal_diphone"),
        ("en-us+f2", "espeak-ng:en-us+f2"), ("de+f2", "espeak-ng:de+f2"),
    ):  # fmt: skip
        assert installed.find_voice(name).full_name == full_name
    for name, message in (
        ("dectalk:paul", "unknown synthesiser 'dectalk'; required one of: flite, festival, espeak-ng"),
        ("paul", "no voice 'paul' is installed; lipmotion speak --voices lists"),
        ("flite:de", "no voice 'flite:de' is installed"),
        ("de+robosoft", "no voice 'de.robosoft' is installed"),
    ):
        with pytest.raises(errors.InputError, match=message):
            installed.find_voice(name)
    with pytest.raises(errors.InputError, match="no voice 'rms' here; it has: kal16, slt"):
        next(installed.speak_sentences(["Hello"], synthesiser.SyntheticVoice("rms", "flite", "rms")))


@pytest.mark.usefixtures("bare")
def test_without_synthesisers_it_says_what_to_install() -> None:
    assert installed.list_installed() == ()
    for voice in EACH:
        with pytest.raises(errors.MissingDependencyError, match=f"apt install {voice.synthesiser}|pip install"):
            next(installed.speak_sentences(["Hello"], voice))
    for find in (installed.choose_voice, lambda: installed.find_voice("slt")):
        with pytest.raises(errors.MissingDependencyError, match=r'pip install ".*\[text\]", or: apt install flite'):
            find()
    with pytest.raises(errors.MissingDependencyError, match="flite is not installed: apt install flite"):
        installed.find_voice("flite:slt")


def test_the_default_voice_is_the_first_that_there_is(faked: Path) -> None:
    assert installed.choose_voice().full_name == "espeak-ng:en-us+f2"
    shutil.rmtree(faked.parent / "packages" / "espeakng_loader" / "espeak-ng-data")
    assert installed.choose_voice().full_name == "flite:slt"
    (faked.parent / "programs" / "flite").unlink()
    assert installed.choose_voice().full_name == "festival:cmu_us_slt_arctic_hts"


def test_a_synthesiser_that_does_not_work_is_left_out(faked: Path, caplog: pytest.LogCaptureFixture) -> None:
    (faked.parent / "programs" / "festival").write_text("#!/bin/sh\nexit 3\n")
    assert [voice.synthesiser for voice in installed.list_voices()] == ["flite", "flite", *["espeak-ng"] * 5]
    assert installed.find_voice("slt").full_name == "flite:slt"
    assert "festival is left out: festival failed with 3" in caplog.text
    with pytest.raises(errors.InputError, match="festival failed with 3"):
        installed.find_voice("festival:kal_diphone")


@pytest.mark.usefixtures("faked")
def test_a_sound_is_there_until_the_next() -> None:
    with closing(installed.speak_sentences(["hello", "hello"], FAKED[0])) as said:
        first = next(said)
        assert first.own_sound().rate_hz == 16_000
        list(said)
    with pytest.raises(errors.InputError, match="no sound that can be read"):
        first.own_sound()


def test_flite_begins_again_at_each_utterance() -> None:
    phones = installed.parse_phone_ends("pau:0.2 ay:0.5 \npau:0.1 y:0.3 \n")
    found = [(span.label, span.start_s, span.end_s) for span in phones]
    assert found == [("pau", 0, 0.2), ("ay", 0.2, 0.5), ("pau", 0.5, 0.6), ("y", 0.6, 0.8)]


@pytest.fixture(params=sorted(installed.SYNTHESISERS))
def real(request: pytest.FixtureRequest) -> synthesiser.SyntheticVoice:
    """The last voice of each synthesiser that is installed."""
    try:
        voices = installed.SYNTHESISERS[request.param].voices()
    except errors.LipMotionError:
        voices = ()
    if not voices:
        pytest.skip(f"{request.param} is not installed")
    return voices[-1]


TEXTS = ["Please put both blue bowls on the table.", "The judge measured the beige garage.", "They enjoy a good thing."]


def test_real_voices_say_what_the_dictionary_says(real: synthesiser.SyntheticVoice) -> None:
    lexicon = Lexicon()
    for text, (audio, units, _) in zip(TEXTS[:2], installed.speak_sentences(TEXTS[:2], real), strict=True):
        words = split_words(text)
        assert [span.label.word for span in units if not is_silent(span.label.phone)] != []
        assert list(dict.fromkeys(span.label.word for span in units if span.label.word)) == list(dict.fromkeys(words))
        assert {span.label.phone for span in units} <= set(PHONES)
        assert units[0].start_s == 0
        assert units[-1].end_s == pytest.approx(audio.duration_s)
        assert all(a.end_s == b.start_s for a, b in pairwise(units))
        expected = sum(len(lexicon.pronunciations(word)[0]) for word in words)
        assert sum(not is_silent(span.label.phone) for span in units) == pytest.approx(expected, abs=2)


@pytest.mark.long
def test_the_times_of_real_voices_are_those_of_the_aligner(real: synthesiser.SyntheticVoice, toy_model: Model) -> None:
    recogniser, late_s = recogniser_of(toy_model, "general"), []
    for audio, units, _ in installed.speak_sentences(TEXTS, real):
        room = mix_noise(audio, "white", 50)
        placed = recogniser.align_phones(room, units)
        said, aligned = ([span for span in part if not is_silent(span.label.phone)] for part in (units, placed))
        late_s += [a.start_s - b.start_s for a, b in zip(said, aligned, strict=True)]
    assert np.median(np.abs(late_s)) < 0.02  # two frames; flite 0.013, festival with kal 0.015
    assert abs(np.median(late_s)) < 0.02


needs_scripts = pytest.mark.skipif(os.name != "posix", reason="the programs are scripts")


@needs_scripts
@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("sleep 30 & wait", "did not end within 0 s"),
        ("kill -9 $$", "failed with -9"),
        ("printf '\\377'", "cannot be run .*utf-8"),
    ],
)
def test_a_program_that_fails_is_refused(
    script: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(synthesiser, "START_S", -4.6)
    with pytest.raises(errors.InputError, match=message):
        synthesiser.run_program([str(_program(tmp_path, script))], "a-package")


@needs_scripts
def test_what_a_program_started_ends_with_it(tmp_path: Path) -> None:
    synthesiser.run_program([str(_program(tmp_path, "(sleep 0.3; touch $0.d/late) &"))], "a-package")
    time.sleep(0.6)
    assert not list((tmp_path / "say.d").iterdir())


def _program(folder: Path, script: str) -> Path:
    path = folder / "say"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    path.with_name("say.d").mkdir()
    return path
