import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import Request, load_model
from lipmotion.errors import InputError
from lipmotion.pipeline.analysis.read_request import read_units
from lipmotion.pipeline.analysis.speech_analysis import SpeechAnalysis, analyse_speech
from lipmotion.pipeline.generation import predict_outlook
from lipmotion.speech.recognition.network.posteriors import find_installed_recogniser
from lipmotion.types import Audio, Span, Timeline, Unit
from lipmotion.units import UNKNOWN_PHONES, close_gaps, is_silent
from meshes.speech import said
from pipeline.made import read_welcome

Row = tuple[float, float, str]
ROWS: list[Row] = [(0.0, 0.4, "sil"), (0.4, 0.5, "m"), (0.5, 0.7, "aa")]


def phones(units: Timeline[Unit]) -> list[tuple[float, float, str]]:
    return [(round(span.start_s, 6), round(span.end_s, 6), span.label.phone) for span in units]


def test_units_alone_without_names_of_units(tmp_path: Path) -> None:
    rows = [{"start_s": a, "end_s": b, "phone": phone} for a, b, phone in ROWS]
    again = [{**row, "word": "oh", "again": n == 1} for n, row in enumerate(rows)]
    for name, content in (("a", {"units": rows}), ("b", {"units": again})):
        (tmp_path / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    assert read_units(tmp_path / "a.json") == said(*ROWS)
    assert [span.label.again for span in read_units(tmp_path / "b.json")] == [n == 1 for n in range(len(rows))]


def test_labels_of_audacity_with_a_gap(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("0.0\t0.4\tsil\n0.5\t0.7\taa\n", encoding="utf-8")
    assert phones(read_units(tmp_path / "a.txt")) == [ROWS[0], ROWS[2]]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("b.json", '{"units": [{"start_s": 0, "phone": "m"}]}', r"b\.json: .*end_s is missing.*; export it again"),
        ("c.json", '{"phones": []}', r"c\.json: not a motion document"),
        ("b.txt", "please speak\n", r"b\.txt: holds no phones in time"),
        ("c.txt", None, r"c\.txt: no such units file"),
        ("a.wav", "RIFF", r"a\.wav: cannot read phones from '\.wav'; use one of \.json, \.npz, \.TextGrid"),
    ],
)
def test_other_files_are_no_units(tmp_path: Path, name: str, content: str | None, message: str) -> None:
    if content is not None:
        (tmp_path / name).write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_units(tmp_path / name)


@pytest.mark.parametrize(
    ("given", "end_s", "wanted"),
    [
        (
            [(0.2, 0.4, "m"), (0.5, 0.7, "aa")],
            1.0,
            [(0.0, 0.2, "sil"), (0.2, 0.4, "m"), (0.4, 0.5, "sil"), (0.5, 0.7, "aa"), (0.7, 1.0, "sil")],
        ),
        (  # gaps of rounding belong to the phone before
            [(0.0, 0.4, "sil"), (0.404, 0.5, "m"), (0.5, 0.994, "aa")],
            1.0,
            [(0.0, 0.404, "sil"), (0.404, 0.5, "m"), (0.5, 0.994, "aa")],
        ),
        (ROWS, 0.7, ROWS),
        ([(0.0, float("inf"), "aa")], 0.8, [(0.0, 0.8, "aa")]),
    ],
)
def test_gaps_are_silence(given: list[Row], end_s: float, wanted: list[Row]) -> None:
    assert phones(close_gaps(said(*given), end_s)) == wanted
    named = Timeline((Span(0.1, 0.2, Unit("", "bilabial")),))
    assert close_gaps(named, 1.0) is named


WELCOME = Path("examples/welcome.flac")


@pytest.fixture(scope="module")
def audio() -> Any:
    """Real speech of five seconds."""
    return read_welcome()


@pytest.fixture(scope="module")
def right(audio: Any) -> Timeline[Unit]:
    """Its phones in time."""
    words = WELCOME.with_suffix(".txt").read_text()
    return analyse_speech(load_model(), Request(audio, transcript=words)).speech.units


def followed(audio: Audio, units: Timeline[Unit]) -> tuple[SpeechAnalysis, float]:
    """Return speech of given phones, and the confidence in the outlook."""
    request = Request(audio, units=units)
    understood = analyse_speech(load_model(), request)
    return understood, predict_outlook(request, understood).confidence


def test_right_phones_are_followed(audio: Any, right: Timeline[Unit], caplog: pytest.LogCaptureFixture) -> None:
    written = (replace(span, label=replace(span.label, phone=span.label.phone.upper())) for span in right)
    understood, confidence = followed(audio, Timeline(tuple(written)))
    assert understood.speech.units == right
    assert confidence == pytest.approx(1)
    assert not caplog.records


needs_network = pytest.mark.skipif(find_installed_recogniser() is None, reason="no phone recogniser is installed")


@needs_network
@pytest.mark.parametrize("explicit", [False, True])
def test_phones_that_end_while_somebody_speaks(
    audio: Any, right: Timeline[Unit], explicit: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """What they leave open is recognised, what they call silence stays silent; both are named with their times."""
    half = [span for span in right if span.end_s < 2.5]
    end_s = half[-1].end_s
    silence = [Span(end_s, audio.duration_s, Unit("sil"))] if explicit else []
    understood, confidence = followed(audio, Timeline((*half, *silence)))
    units = understood.speech.units
    assert list(units)[: len(half)] == half
    spoken = [span for span in list(units)[len(half) :] if not is_silent(span.label.phone)]
    assert bool(spoken) != explicit
    assert all(span.label.confidence is not None for span in spoken)
    assert 0.3 < confidence < 0.8
    open_s = [span.start_s for span in right if span.start_s >= end_s and not is_silent(span.label.phone)]
    closed_s = max(span.end_s for span in right if not is_silent(span.label.phone))
    assert understood.fit.missing[0][0] == pytest.approx(open_s[0], abs=0.1)
    assert understood.fit.missing[-1][1] == pytest.approx(closed_s, abs=0.1)
    fits = understood.fit.of_frames(len(understood.speech.features.values))
    assert fits[: round(100 * end_s) - 10].mean() > 0.95
    assert fits[round(100 * end_s) :].mean() < 0.6
    (record,) = caplog.records
    assert "leave out speech at" in record.getMessage()
    assert ("recognised" in record.getMessage()) != explicit


@needs_network
@pytest.mark.parametrize(
    ("change", "problem"),
    [
        pytest.param(lambda units: units.shifted(0.6), "are not what is said", id="late"),
        pytest.param(lambda units: scaled(units, 0.5), "are not what is said", id="too fast"),
        pytest.param(lambda units: scaled(units, 1e-3), "seconds?", id="a thousandth"),
        pytest.param(lambda units: scaled(units, 1e3), "in milliseconds", id="milliseconds"),
        pytest.param(lambda units: scaled(units, 1e7), "in ticks of 100 ns", id="ticks"),
    ],
)
def test_phones_at_other_times_than_they_are_said(
    audio: Any,
    right: Timeline[Unit],
    change: Callable[[Timeline[Unit]], Timeline[Unit]],
    problem: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    _, confidence = followed(audio, change(right))
    assert any(problem in text for text in caplog.messages)
    assert confidence < 0.7


def scaled(units: Timeline[Unit], factor: float) -> Timeline[Unit]:
    return Timeline(tuple(Span(factor * s.start_s, factor * s.end_s, s.label) for s in units))


def test_phones_where_nothing_is_said(right: Timeline[Unit], caplog: pytest.LogCaptureFixture) -> None:
    silence = Audio(np.random.default_rng(0).normal(0, 1e-4, 5 * 16_000).astype(np.float32), 16_000)
    understood, confidence = followed(silence, right)
    assert understood.speech.units.spans[: len(right) - 1] == right.spans[: len(right) - 1]
    assert confidence < 0.2
    assert any("where nothing is said" in text for text in caplog.messages)


@pytest.mark.parametrize("known", [True, False])
def test_unknown_phones_are_those_of_the_word_or_recognised(
    audio: Any, right: Timeline[Unit], known: bool, caplog: pytest.LogCaptureFixture
) -> None:
    word = "welcome" if any(span.label.word == "welcome" for span in right) else right[1].label.word
    there = [span for span in right if span.label.word == word]
    start_s, end_s = there[0].start_s, there[-1].end_s
    unknown = Span(start_s, end_s, Unit("", UNKNOWN_PHONES, word if known else ""))
    others = [span for span in right if span.label.word != word]
    units = Timeline(tuple(sorted([*others, unknown], key=lambda span: span.start_s)))
    found = followed(audio, units)[0].speech.units
    inside = [span for span in found if start_s - 1e-6 <= span.start_s and span.end_s <= end_s + 1e-6]
    if known:
        assert [span.label.phone for span in inside] == [span.label.phone for span in there]
        assert (inside[0].start_s, inside[-1].end_s) == pytest.approx((start_s, end_s))
    else:
        assert len([span for span in inside if not is_silent(span.label.phone)]) > len(there) / 2
    assert any(f"at {start_s:.1f} " in text for text in caplog.messages)
    assert [span for span in found if span not in inside][: len(others) // 2] == others[: len(others) // 2]
