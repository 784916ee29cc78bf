from dataclasses import replace

import numpy as np
import pytest

from lipmotion.speech.recognition.recognised_speech import (
    SLIVER_FRAMES,
    AlignedWords,
    LabelledFrames,
    RecognisedWord,
    labels_of_words,
    recognition_of,
    spliced,
)
from lipmotion.speech.sound.voice_activity import Stretch
from lipmotion.types import Span, Timeline, Unit

BASE = [LabelledFrames(0, "sil"), LabelledFrames(20, "aa"), LabelledFrames(50, "t"), LabelledFrames(70, "sil")]
ALIGNED = AlignedWords(
    words=("a", "boat"),
    phones=("sil", "ax", "sp", "b", "ow", "t", "sil"),
    of_word=np.array([-1, 0, -1, 1, 1, 1, -1]),
    bounds=np.array([0, 10, 20, 22, 30, 50, 60, 80]),
    densities=np.zeros(80, np.intp),
)


def test_a_stretch_nothing_or_all_is_replaced() -> None:
    part = (Stretch(30, 60), [LabelledFrames(30, "b", 0), LabelledFrames(45, "iy", 0)])
    assert spliced(BASE, [part], 100) == [*BASE[:2], *part[1], LabelledFrames(60, "t"), BASE[3]]
    assert spliced(BASE, [], 100) == BASE
    whole = [LabelledFrames(0, "b", 0)]
    assert spliced(BASE, [(Stretch(0, 100), whole)], 100) == whole
    sliver = (Stretch(22, 69), [LabelledFrames(22, "b", 0)])
    assert SLIVER_FRAMES > 2
    assert [label.phone for label in spliced(BASE, [sliver], 100)] == ["sil", "b", "sil"]


def test_every_frame_has_one_label() -> None:
    for seed in range(5):
        draw = np.random.default_rng(seed)
        frames = 200
        base = [LabelledFrames(int(first), "aa") for first in [0, *np.unique(draw.integers(1, frames, 15))]]
        bounds = np.unique(draw.integers(0, frames + 1, 8))
        parts = [
            (Stretch(int(first), int(end)), [LabelledFrames(int(first), "b", number)])
            for number, (first, end) in enumerate(zip(bounds[::2], bounds[1::2], strict=False))
        ]
        firsts = [label.first for label in spliced(base, parts, frames)]
        assert firsts[0] == 0
        assert firsts == sorted(set(firsts))
        assert {number for _, ((_, _, number),) in parts} == {
            label.word for label in spliced(base, parts, frames) if label.word >= 0
        }


def test_labels_are_those_of_the_words_that_are_believed() -> None:
    ((frames, labels),) = labels_of_words(ALIGNED, Stretch(100, 180), np.array([True, True]), 5)
    assert frames == Stretch(100, 180)  # all
    assert [label.word for label in labels] == [-1, 5, -1, 6, 6, 6, -1]
    assert [label.first for label in labels] == [100, 110, 120, 122, 130, 150, 160]
    ((frames, labels),) = labels_of_words(ALIGNED, Stretch(100, 180), np.array([False, True]), 0)
    assert frames == Stretch(122, 160)
    assert [label.phone for label in labels] == ["b", "ow", "t"]
    assert not list(labels_of_words(ALIGNED, Stretch(100, 180), np.array([False, False]), 0))


def test_fits_are_means_over_the_frames_of_each_word() -> None:
    values = np.zeros((80, 2), np.float32)
    values[:, 1] = 1.0
    values[22:60, 1] = 3.0
    fits, fit = ALIGNED.fits(values, np.ones(80, np.intp))
    assert fits == pytest.approx([-1.0, -3.0])
    assert fit == pytest.approx(-(42 + 38 * 3) / 80)


def test_what_was_recognised() -> None:
    labels = [LabelledFrames(*each) for each in ((0, "sil"), (10, "b", 0), (20, "iy", 0), (40, "z"))]
    spans = ((0.0, 0.1, "sil", ""), (0.1, 0.2, "b", "bee"), (0.2, 0.4, "iy", "bee"), (0.4, 0.5, "z", ""))
    units = Timeline(tuple(Span(start, end, Unit(phone, word=word)) for start, end, phone, word in spans))
    found = recognition_of(units, labels, [RecognisedWord("bee", 0.8)], -7.0)
    (word,) = found.words
    assert (word.start_s, word.end_s, word.label.text) == (pytest.approx(0.1), pytest.approx(0.4), "bee")
    assert (found.word_s, found.phone_s) == pytest.approx((0.3, 0.1))
    assert found.confidence == pytest.approx(0.8)
    assert found.reliability == pytest.approx(1)
    doubtful = recognition_of(units, labels, [RecognisedWord("bee", 0.3)], -7.0)
    assert doubtful.reliability == pytest.approx(0)
    shares = [replace(found, posterior=posterior).reliability for posterior in (0.6, 0.8, 0.95)]
    assert shares == pytest.approx([0, 0.5, 1])
    wordless = recognition_of(units, [LabelledFrames(0, "sil")], [], -7.0)
    assert replace(wordless, posterior=0.575).reliability == pytest.approx(0.5)
