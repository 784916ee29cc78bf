from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion.errors import InputError
from lipmotion.hmm.align import PlacedWord, SpokenWord
from lipmotion.kernels.paths import Windows
from lipmotion.speech.recognition import anchors
from lipmotion.types import TimedTranscript, TimedWord, TranscriptLine


def line(text: str, start_s: float | None = None, end_s: float | None = None) -> TranscriptLine:
    return TranscriptLine(tuple(TimedWord(word) for word in text.split()), start_s, end_s)


def transcript(*lines: TranscriptLine) -> TimedTranscript:
    return TimedTranscript(lines)


def test_words_have_the_times_of_their_line_or_their_own():
    timed = TranscriptLine((TimedWord("c"), TimedWord("d", 4.5, 4.75), TimedWord("e")), 4.0, 5.0)
    found = anchors.find_anchors(transcript(line("a b", 1.0, 2.0), timed, line("f")))
    nan = np.nan
    np.testing.assert_allclose(found.start_s, [1.0, 1.0, 4.0, 4.5, nan, nan])
    np.testing.assert_allclose(found.end_s, [2.0, 2.0, nan, 4.75, 5.0, nan])
    line_s, word_s = anchors.LINE_TOLERANCE_S, anchors.WORD_TOLERANCE_S
    assert found.tolerance_s.tolist() == [line_s, line_s, line_s, word_s, line_s, line_s]
    assert found.groups.tolist() == [0, 0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("lines", "first", "end"),
    [
        ([line("a b", 2.0, 3.0), line("c", 5.0, 6.0)], [150, 150, 450], [351, 351, 651]),
        # words without times lie between those that have some
        (
            [line("a"), line("b", 2.0, 3.0), line("c d"), line("e", 8.0, 9.0), line("f")],
            [0, 150, 150, 150, 750, 750],
            [351, 351, 951, 951, 951, 3000],
        ),
        # no word may begin before those ahead of it
        ([line("a", 5.0, 9.0), line("b", 6.0, 7.0), line("c", 5.5, 20.0)], [450, 550, 550], [751, 751, 2051]),
    ],
)
def test_windows_are_the_times_and_the_tolerance(lines: list[TranscriptLine], first: list[int], end: list[int]):
    found = anchors.find_anchors(transcript(*lines))
    windows = anchors.make_windows(found, found.tolerance_s, 3000)
    assert (windows.first.tolist(), windows.end.tolist()) == (first, end)


times = st.one_of(st.none(), st.floats(-5, 40))


@given(spans=st.lists(st.tuples(times, times), min_size=1, max_size=12), frames=st.integers(10, 3000))
@settings(max_examples=50)
def test_windows_of_any_times_are_in_order_and_hold_what_is_known(spans, frames):
    found = anchors.find_anchors(transcript(*(line("a b", start_s, end_s) for start_s, end_s in spans)))
    least = np.full(len(found.start_s), 3, np.intp)
    windows, tolerance_s = anchors.find_windows(found, found.tolerance_s, least, 3, frames)
    assert np.all(np.diff(windows.first) >= 0)
    assert np.all(np.diff(windows.end) >= 0)
    assert np.all(tolerance_s >= found.tolerance_s)
    assert windows.first.min() >= 0
    assert windows.end.max() <= frames
    if np.all(tolerance_s < np.inf):  # one word after another fits
        at = 3
        for first, end in zip(windows.first, windows.end, strict=True):
            at = max(at, first) + 3
            assert at <= min(end, frames - 3)


def test_windows_without_room_are_widened_where_it_lacks():
    crowded = [line("a", 1.0, 2.0), line(" ".join("b" * 100), 20.0, 20.5), line("c", 60.0, 61.0)]
    found = anchors.find_anchors(transcript(*crowded))
    least = np.full(102, 9, np.intp)
    windows, tolerance_s = anchors.find_windows(found, found.tolerance_s, least, 3, 10_000)
    assert tolerance_s[50] > 4
    assert tolerance_s[0] <= tolerance_s[50]
    assert windows.end[100] - windows.first[1] >= 900


def found_words(*starts: int, fits: Sequence[float] | None = None) -> list[PlacedWord]:
    silence = PlacedWord(SpokenWord(-1, 0, ("sil",)), 0, -1.0)
    words = [
        PlacedWord(SpokenWord(word, 0, ("a",)), start, fit)
        for word, (start, fit) in enumerate(zip(starts, fits or [-1.0] * len(starts), strict=True))
    ]
    return [silence, *words]


class Search:
    """A search that finds the words at true places, as far as their windows allow; elsewhere they fit badly."""

    def __init__(self, starts: list[int], elsewhere: float = -8.0):
        self.starts = np.array(starts)
        self.elsewhere = elsewhere
        self.asked: list[Windows] = []

    def __call__(self, windows: Windows) -> list[PlacedWord]:
        self.asked.append(windows)
        starts = np.clip(self.starts, windows.first, windows.end - 1)
        return found_words(*starts, fits=np.where(starts == self.starts, -1.0, self.elsewhere).tolist())


def aligned(search: Search, frames: int = 12_000) -> list[int]:
    found = anchors.find_anchors(
        transcript(*(line("a", 10.0 * n, 10.0 * n + 1) for n in range(1, len(search.starts) + 1)))
    )
    placed, _ = anchors.align_within(found, np.full(len(search.starts), 3, np.intp), 3, frames, search)
    return [item.start for item in placed[1:]]


def test_times_that_fit_are_used_at_once(caplog):
    search = Search([1000 * n for n in range(1, 11)])
    assert aligned(search) == search.starts.tolist()
    assert len(search.asked) == 1
    assert not caplog.records


@pytest.mark.parametrize("late", [-350, 450])
def test_a_time_that_is_wrong_is_widened_until_the_word_fits(late, caplog):
    starts = [1000 * n for n in range(1, 11)]
    starts[4] += late
    search = Search(starts)
    assert aligned(search) == starts
    assert 2 < len(search.asked) < 9
    first = np.array([windows.first for windows in search.asked])
    assert (first[-1] != first[0]).tolist() == [n == 4 for n in range(10)]
    assert not caplog.records


def test_a_word_that_presses_stays_where_it_does_not_fit_better_elsewhere():
    """As beside speech that is not in the transcript."""
    starts = [1000 * n for n in range(1, 11)]
    starts[4] += 350
    found = aligned(search := Search(starts, elsewhere=-0.9))
    assert found[:4] + found[5:] == starts[:4] + starts[5:]
    assert found[4] == search.asked[0].end[4] - 1


def test_a_time_far_off_is_reported(caplog):
    starts = [1000 * n for n in range(1, 11)]
    starts[4:7] = [start - 950 for start in starts[4:7]]
    found = aligned(Search(starts, elsewhere=-9.0), frames=anchors.FREE_FRAMES + 1)
    assert found[:4] == starts[:4]
    (record,) = caplog.records
    message = "at 3 of the 10 times of the transcript the words do not fit the sound, first at 50.00 s; check them"
    assert record.getMessage() == message


def test_times_of_something_else_are_not_used(caplog):
    starts = [1000 * n - 950 for n in range(1, 11)]
    assert aligned(Search(starts)) == starts
    (record,) = caplog.records
    assert record.getMessage() == "the times of the transcript do not fit the sound; they are not used"
    caplog.clear()
    assert aligned(Search(starts), frames=anchors.FREE_FRAMES + 1) != starts  # too long for that
    assert "at 10 of the 10 times" in caplog.text


def test_lines_after_the_end_are_left_out(caplog):
    lines = line("a", 1.0, 2.0), line("b"), line("c", 10.5, 12.0), line("d", 11.5, 12.0)
    assert anchors.leave_out_late_lines(transcript(*lines), 10.0).words == ("a", "b", "c")
    (record,) = caplog.records
    assert "goes on after the recording ends at 10.00 s; its last 1 lines are left out" in record.getMessage()
    with pytest.raises(InputError, match=r"begins at 20\.00 s, the recording ends at 10\.00 s; give the transcript"):
        anchors.leave_out_late_lines(transcript(line("a", 20.0, 22.0)), 10.0)
