"""Projects of Papagayo are read as it reads them, and show the cues frame by frame."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from formats.cue_examples import result, spoken
from formats.test_cue_files import shown_by_opentoonz
from lipmotion import CueSheet
from lipmotion.articulation.cue_sheets import choose_cues
from lipmotion.formats.cues import CUE_FORMATS
from lipmotion.formats.papagayo import UNKNOWN
from lipmotion.testing.toy import ToySentence
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units.visemes import SHAPES

Word = tuple[str, int, int, list[tuple[int, str]]]


def read(text: str) -> tuple[dict[str, str], list[tuple[str, int, int, list[Word]]]]:
    """Read line by line, and parts of lines at spaces; what is indented is stripped, as Papagayo does."""
    lines = iter(text.splitlines())
    assert next(lines) == "lipsync version 1"
    about = {name: next(lines).strip() for name in ("sound", "fps", "frames", "voices", "voice", "text")}
    phrases = []
    for _ in range(int(next(lines))):
        said, first, last = next(lines).strip(), int(next(lines)), int(next(lines))
        words: list[Word] = []
        for _ in range(int(next(lines))):
            word, start, end, count = next(lines).split()
            shapes = [next(lines).split() for _ in range(int(count))]
            words.append((word, int(start), int(end), [(int(frame), name) for frame, name in shapes]))
        phrases.append((said, first, last, words))
    assert next(lines, None) is None
    return about, phrases


def shown(phrases: list[tuple[str, int, int, list[Word]]], frame: int) -> str:
    """Return what Papagayo shows in a frame: the last shape of the word that the frame is in, else rest."""
    for _, first, last, words in phrases:
        if first <= frame <= last:
            for _, start, end, shapes in words:
                if start <= frame <= end:
                    return next((name for at, name in reversed(shapes) if frame >= at), "rest")
    return "rest"


def said(sentence: ToySentence) -> Timeline[Unit]:
    """Return the units with a word for every three phones that are no silence."""
    spans, count = [], 0
    for span in sentence.units:
        count += span.label.phone != "sil"
        word = "" if span.label.phone == "sil" else f"word{count // 3}"
        spans.append(replace(span, label=replace(span.label, word=word)))
    return Timeline(tuple(spans))


@pytest.mark.parametrize("fps", [12.0, 25.0])
def test_every_frame_shows_the_cue(toy_sentence: ToySentence, fps: float) -> None:
    sheet = choose_cues(result(said(toy_sentence)), fps)
    about, phrases = read(CUE_FORMATS["pgo"].text(sheet, "a b.wav"))
    assert (about["sound"], about["fps"], about["voices"]) == ("a b.wav", f"{fps:.0f}", "1")
    frames = shown_by_opentoonz(CUE_FORMATS["dat"].text(sheet, ""))
    assert int(about["frames"]) == pytest.approx(len(frames), abs=1)
    assert [shown(phrases, frame).lower() for frame in range(len(frames))] == frames
    words = [word for *_, words in phrases for word, *_ in words]
    assert {part for word in words for part in word.split("-")} <= {f"word{n}" for n in range(99)} | {UNKNOWN}
    assert len(words) > 1


def test_words_follow_each_other(toy_sentence: ToySentence) -> None:
    _, phrases = read(CUE_FORMATS["pgo"].text(choose_cues(result(said(toy_sentence))), "a.wav"))
    for text, first, last, words in phrases:
        assert text == " ".join(word for word, *_ in words)
        assert (words[0][1], words[-1][2]) == (first, last)
        assert all(after[1] == before[2] + 1 for before, after in pairwise(words))
        assert all(start <= end and shapes[0][0] == start for _, start, end, shapes in words)


def test_words_of_less_than_a_frame_are_joined() -> None:
    base = spoken("b aa b aa b")
    words = Timeline(tuple(Span(0.3 + 0.01 * n, 0.31 + 0.01 * n, f"w{n}") for n in range(4)))
    sheet = replace(choose_cues(base), words=words)
    _, phrases = read(CUE_FORMATS["pgo"].text(sheet, ""))
    found = [word for *_, words in phrases for word, *_ in words]
    assert len(found) < 4
    assert "-".join(found) == "w0-w1-w2-w3"


def test_speech_without_words_and_nothing_at_all() -> None:
    _, phrases = read(CUE_FORMATS["pgo"].text(choose_cues(spoken("b aa b")), ""))
    assert [word for *_, words in phrases for word, *_ in words] == [UNKNOWN]
    about, nothing = read(
        CUE_FORMATS["pgo"].text(CueSheet(Timeline((Span(0.0, 0.0, "X"),)), 24.0, "ABCDEFX"), "line\nbreak")
    )
    assert (nothing, about["sound"]) == ([], "line break")


def test_a_character_without_rest_has_no_gaps() -> None:
    sheet = choose_cues(spoken("b aa b"), optional="")
    _, phrases = read(CUE_FORMATS["pgo"].text(sheet, ""))
    assert {shown(phrases, frame) for frame in range(20)} <= {shape.blair for shape in SHAPES.values()} - {"rest"}


@pytest.mark.parametrize(("fps", "whole"), [(29.97, 30), (12.5, 13)])
def test_times_stay_at_a_rate_that_is_not_whole(fps: float, whole: int) -> None:
    """After ten minutes, 29.97 frames a second would be 18 frames behind 30."""
    times_s = [frame / fps for frame in (0, 1, *range(int(600 * fps), int(600 * fps) + 6))]
    starts = [math.ceil(time_s * 100) / 100 for time_s in times_s]
    spans = [Span(start, end, "XADAXADA"[n]) for n, (start, end) in enumerate(pairwise([*starts, 601.0]))]
    about, phrases = read(CUE_FORMATS["pgo"].text(CueSheet(Timeline(tuple(spans)), fps, "ABCDEFX"), "a.wav"))
    assert about["fps"] == str(whole)
    for span in spans:
        assert shown(phrases, int(span.start_s * whole)) == SHAPES[span.label].blair
