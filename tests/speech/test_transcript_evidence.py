"""Posteriors of a made-up network, which hears each phone for a frame or two between blanks."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion.speech.recognition import transcript_evidence as module
from lipmotion.speech.recognition.transcript_evidence import _best_paths, transcript_evidence
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units import PHONES

FRAME_S = 0.02
SAID = {"papa": "p aa p aa", "sees": "s iy z", "a": "ax", "fish": "f ih sh"}
OTHER = {"book": "b uh k", "away": "ax w ey", "meow": "m iy aw"}


def heard(words: list[str], sure: float = 0.9, pause: int = 10) -> NDArray[np.float64]:
    """Return the log posteriors of words: a phone in every other frame, pauses at both ends [shape=(T, 48)]."""
    phones = [phone for word in words for phone in (SAID | OTHER)[word].split()]
    names = ["", *(name for phone in phones for name in (phone, ""))]
    columns = [len(PHONES)] * pause + [PHONES.index(name) if name else len(PHONES) for name in names]
    columns += [len(PHONES)] * pause
    found = np.full((len(columns), len(PHONES) + 1), (1 - sure) / len(PHONES))
    found[np.arange(len(columns)), columns] = sure
    return np.log(found)


def transcript(words: list[str], end_s: float, word_s: float = 0.1) -> Timeline[Unit]:
    """Return words in time, one after another: what forced alignment makes of any transcript."""
    spans, at_s = [Span(0.0, 0.2, Unit("sil"))], 0.2
    for word in words:
        phones = (SAID | OTHER)[word].split()
        for phone in phones:
            spans.append(Span(at_s, at_s + word_s / len(phones), Unit(phone, word=word)))
            at_s = spans[-1].end_s
    return Timeline((*spans, Span(at_s, max(end_s, at_s + 0.1), Unit("sil"))))


def test_a_right_transcript_loses_nothing() -> None:
    found = transcript_evidence(heard([*SAID]), FRAME_S, transcript([*SAID], 1.0))
    assert found.loss == pytest.approx(0, abs=0.1)
    assert [word.word for word in found.words] == [*SAID]
    assert (found.doubtful_words, found.gaps, found.is_doubtful) == ((), (), False)


def test_another_transcript_is_doubtful() -> None:
    for words in ([*OTHER], [*SAID][::-1]):
        found = transcript_evidence(heard([*SAID]), FRAME_S, transcript(words, 1.0))
        assert found.is_doubtful


def test_the_word_that_is_not_said_has_the_loss() -> None:
    words = ["papa", "sees", "meow", "fish"]
    said = heard(["papa", "sees", "away", "fish"], sure=0.99999)
    found = transcript_evidence(said, FRAME_S, transcript(words, 1.0))
    (wrong,) = found.doubtful_words
    assert wrong.word == "meow"
    assert (wrong.start_s, wrong.end_s) == pytest.approx((0.4, 0.5))
    assert wrong.loss < 13 * found.loss
    assert all(word.loss < 1 for word in found.words if word != wrong)
    assert found.is_doubtful
    assert found.gaps == ()


def test_words_that_are_left_out_are_a_gap_in_their_place() -> None:
    whole, part = ["papa", "meow", "away", "fish"], ["papa", "fish"]
    found = transcript_evidence(heard(whole), FRAME_S, transcript(part, 1.0))
    first = 10 + 1 + 2 * 4  # pause, blank, papa
    (gap,) = found.gaps
    assert (gap.start_s, gap.end_s) == pytest.approx((first * FRAME_S, (first + 12) * FRAME_S), abs=0.03)
    nothing = transcript_evidence(heard(whole), FRAME_S, Timeline((Span(0.0, 1.0, Unit("sil")),)))
    assert len(nothing.gaps) == 1
    assert nothing.words == ()


def test_similar_phones_are_heard_for_one_another() -> None:
    """And an unsure network has no strong opinion."""
    said, spoken = (
        ["sees"],
        Timeline(tuple(Span(n / 10, (n + 1) / 10, Unit(p, word="c")) for n, p in enumerate(["z", "ih", "s"]))),
    )
    assert transcript_evidence(heard(said), FRAME_S, spoken).loss == pytest.approx(0, abs=0.1)
    wrong = transcript(["book"], 1.0)
    losses = [transcript_evidence(heard(said, sure), FRAME_S, wrong).loss for sure in (0.99, 0.5, 0.2)]
    assert losses == sorted(losses, reverse=True)
    assert losses[-1] < 1.5 < losses[0]


def test_a_long_recording_is_divided(monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["papa", "sees", "a", "fish"]
    log_posteriors = np.concatenate([heard(words)] * 3)
    piece_s = len(log_posteriors) / 3 * FRAME_S
    spans = []
    for number in range(3):
        spans += list(transcript([*SAID] if number != 1 else [*OTHER], piece_s).shifted(number * piece_s))
    whole = transcript_evidence(log_posteriors, FRAME_S, Timeline(tuple(spans)))
    monkeypatch.setattr(module, "LEAST_STRETCH_S", 0.3)
    parts = transcript_evidence(log_posteriors, FRAME_S, Timeline(tuple(spans)))
    assert parts.loss == pytest.approx(whole.loss, rel=0.05)
    assert [word[:3] for word in parts.words] == [word[:3] for word in whole.words]
    assert [word.loss > 3 for word in parts.words] == [False] * 4 + [True] * 3 + [False] * 4
    assert [gap.start_s for gap in parts.gaps] == pytest.approx([gap.start_s for gap in whole.gaps], abs=0.05)


def test_phones_that_do_not_fit_into_the_frames() -> None:
    found = transcript_evidence(heard([], pause=12), FRAME_S, transcript([*SAID] * 3, 0.5, word_s=0.02))
    assert found.loss == np.inf
    assert {word.loss for word in found.words} == {np.inf}


def test_posteriors_of_something_else_are_refused() -> None:
    with pytest.raises(ValueError, match="47 classes, required 48"):
        transcript_evidence(np.zeros((20, 47)), FRAME_S, transcript(["a"], 0.1))
    with pytest.raises(ValueError, match=r"posteriors of 0\.20 s, required 0\.60"):
        transcript_evidence(np.zeros((10, 48)), FRAME_S, transcript([*SAID], 0.7))


def test_the_best_path_is_the_best_of_all() -> None:
    """Every path of three phones, two of them the same, through five frames."""
    draw = np.random.default_rng(3)
    columns = np.array([4, 4, 9])
    spoken, silent = np.log(draw.random((5, 3))), np.log(draw.random(5))
    spoken[:, 1] = spoken[:, 0]

    def said(states: tuple[int, ...]) -> list[int]:
        return [states[t] // 2 for t in range(len(states)) if states[t] % 2 and (t == 0 or states[t - 1] != states[t])]

    def allowed(states: tuple[int, ...]) -> bool:
        steps = [b - a for a, b in pairwise(states)]
        skips = [(a, b) for a, b in pairwise(states) if b - a == 2]
        return (
            states[0] in (0, 1)
            and min(steps) >= 0
            and max(steps) <= 2
            and all(a % 2 and (a, b) != (1, 3) for a, b in skips)
        )

    best = max(
        sum(spoken[t, state // 2] if state % 2 else silent[t] for t, state in enumerate(states))
        for states in product(range(7), repeat=5)
        if allowed(states) and said(states) == [0, 1, 2]
    )
    assert _best_paths(spoken, silent, columns)[-1, -1] == pytest.approx(best)
