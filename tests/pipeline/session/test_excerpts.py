from dataclasses import replace

import numpy as np
import pytest

from lipmotion import Edits, Model, Request, Session
from lipmotion.errors import InputError
from lipmotion.pipeline import session as session_module
from lipmotion.pipeline.analysis.speech_analysis import SpeechAnalysis
from lipmotion.pipeline.excerpts import GRID_S, LONGEST_S, MARGIN_S, find_excerpt
from lipmotion.pipeline.generation import generate_motion
from lipmotion.types import Audio, Generation, Pin, Span, Timeline, Unit
from testing.toy import ToySentence

TIMES = 12
"""How often the sentence is said in the long recording."""
UNSEEN = 0.01
"""Most by which the opening may be off until the whole is made, in eye distances: 0.6 mm."""


@pytest.fixture(scope="module")
def long_request(toy_sentence: ToySentence, toy_model: Model) -> Request:
    units = Session(Request(toy_sentence.audio, " ".join(toy_sentence.words)), model=toy_model).units()
    each_s = toy_sentence.audio.duration_s
    spans = [span for n in range(TIMES) for span in units.shifted(n * each_s)]
    sound = Audio(np.tile(toy_sentence.audio.samples, TIMES), toy_sentence.audio.rate_hz)
    spans[-1] = replace(spans[-1], end_s=sound.duration_s)
    return Request(sound, units=Timeline(tuple(spans)))


@pytest.fixture
def made_s(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The seconds of each motion that a session makes from now on."""
    lengths: list[float] = []

    def counted(*given: object) -> Generation:
        (understood,) = (each for each in given if isinstance(each, SpeechAnalysis))
        lengths.append(understood.speech.features.duration_s)
        return generate_motion(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(session_module, "generate_motion", counted)
    return lengths


def parse_number(units: Timeline[Unit], phone: str, after_s: float) -> int:
    return next(n for n, span in enumerate(units, 1) if span.label.phone == phone and span.start_s > after_s)


@pytest.mark.long
def test_around_an_edit_the_motion_is_that_of_the_whole(long_request, toy_model, made_s):
    """At the first phone, in the middle, at the last one, of a pause, with pins; one edit after another."""
    session, other = Session(long_request, model=toy_model), Session(long_request, model=toy_model)
    units, lasts_s = session.units(), long_request.recording.duration_s  # type: ignore[union-attr]
    before = session.generate().motion
    middle, edits = parse_number(units, "iy", lasts_s / 2), Edits()
    silent = parse_number(units, "sil", lasts_s / 4)
    for sentence in (
        f"phone {middle} is p",
        f"phone {middle} ends {units[middle - 1].end_s + 0.02:.3f}",
        "phone 2 is aa",
        f"phone {len(units) - 1} is m",
        f"remove phone {silent}",
        f"pin opening 0.31 at {lasts_s / 3:.2f}",
        f"pin jawOpen 0.6 at {lasts_s / 5:.2f}",
    ):
        edits = edits.then(sentence)
        made_s.clear()
        with session.sketching():
            sketch = session.generate(edits)
        assert sum(made_s) <= 2 * (2 * MARGIN_S + 2 * GRID_S + 5) < lasts_s, sentence
        whole = other.generate(edits)
        assert [span.label.phone for span in sketch.units] == [span.label.phone for span in whole.units]
        assert np.abs(sketch.motion["opening"] - whole.motion["opening"]).max() < UNSEEN, sentence
        assert sketch.motion["opening"].min() >= 0
    after = session.generate(edits)  # without sketching: the same as if nothing had been there before
    assert after.motion.values == pytest.approx(whole.motion.values, abs=1e-6)
    assert np.abs(after.motion["opening"] - before["opening"]).max() > 0.1
    with session.sketching(), pytest.raises(InputError, match="9999"):
        session.generate(edits.then("pin opening 0.1 at 9999"))


def test_what_lies_far_apart_is_made_whole():
    units, frames = Timeline(tuple(Span(n / 10, (n + 1) / 10, Unit("aa")) for n in range(600))), 6001
    assert find_excerpt(units, units, (), frames) is None
    near = find_excerpt(units, units, [Pin(30.0, "opening", 0.1), Pin(31.0, "opening", 0.1)], frames)
    assert near.frames.start % 100 == 0
    assert near.frames.start / 100 <= 30 - MARGIN_S
    assert near.frames.stop / 100 >= 31 + MARGIN_S
    far = [Pin(1.0, "opening", 0.1), Pin(2.0 + LONGEST_S, "opening", 0.1)]
    assert find_excerpt(units, units, far, frames) is None
