import json
from pathlib import Path

import pytest

from lipmotion import Request, animate, load_model
from lipmotion.errors import ExportError
from lipmotion.pipeline.analysis.language import format_words, recognise_words, write_words
from lipmotion.pipeline.analysis.speech_analysis import analyse, analyse_speech
from lipmotion.speech.recognition.recognised_speech import RecognisedWord, Recognition
from lipmotion.types import Span, Timeline, Unit

WELCOME = Path(__file__).parents[2] / "examples" / "welcome.flac"


def words(*timed: tuple[float, float, str]) -> Timeline[RecognisedWord]:
    return Timeline(tuple(Span(start_s, end_s, RecognisedWord(text, 0.5)) for start_s, end_s, text in timed))


def labels(units: Timeline[Unit]) -> list[tuple[str, str]]:
    return [(span.label.phone, span.label.word) for span in units]


@pytest.fixture(scope="module")
def found() -> Recognition:
    return recognise_words(WELCOME)


def test_long_pauses_end_a_line():
    assert format_words(words((0.0, 0.3, "oh"), (0.4, 0.6, "no"), (1.2, 1.5, "yes"))) == "oh no\nyes\n"
    assert format_words(words()) == ""


@pytest.mark.parametrize("suffix", [".txt", ".JSON"])
def test_files_of_words_are_transcripts(found, tmp_path, suffix):
    path = tmp_path / f"words{suffix}"
    write_words(found.words, [path], WELCOME)
    aligned = animate(WELCOME, transcript=path).units
    assert labels(aligned) == labels(found.units)
    starts = [(a.start_s, b.start_s) for a, b in zip(aligned, found.units, strict=True)]
    assert all(abs(a - b) < 0.05 for a, b in starts)


def test_json_has_times_and_confidences(found, tmp_path):
    write_words(found.words, [tmp_path / "words.json"])
    document = json.loads((tmp_path / "words.json").read_text())
    assert document["text"].startswith("please speak")
    first = document["result"][0]
    assert set(first) == {"word", "start", "end", "conf"}
    assert 0.4 < first["start"] < first["end"] < 1.0
    assert all(0 <= word["conf"] <= 1 for word in document["result"])


def test_files_that_cannot_be_written(found, tmp_path):
    for name in ("words.srt", "words", "nowhere/words.txt"):
        with pytest.raises(ExportError):
            write_words(found.words, [tmp_path / "first.txt", tmp_path / name])
    assert not list(tmp_path.iterdir())


def test_speech_is_as_reliable_as_its_words(found):
    request, model = Request(WELCOME), load_model()
    understood = analyse_speech(model, request)
    assert understood.recognition.units == found.units
    assert understood.speech.confidence == pytest.approx(found.reliability)
    assert understood.speech.units == analyse(model, request).units
    given = analyse_speech(model, Request(WELCOME, transcript="please speak"))
    assert given.recognition is None
    assert analyse(model, Request(WELCOME, recogniser="fast")).confidence == pytest.approx(0)


@pytest.mark.long
def test_words_do_not_depend_on_the_processes(monkeypatch, found):
    monkeypatch.setattr("lipmotion.speech.recognition.word_search.SHORT_FRAMES", 0)
    assert recognise_words(WELCOME, workers=2).words == found.words
