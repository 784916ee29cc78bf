import numpy as np
import pytest

from formats.examples import of_motion
from lipmotion.articulation import rest
from lipmotion.articulation.contact import CLOSED_OPENING
from lipmotion.articulation.mouth import find_mouth
from lipmotion.articulation.rest import REST, rest_in_pauses
from lipmotion.types import Channel, Generation, Motion, Span, Timeline, Unit, VoiceEvent
from lipmotion.types.audio import BREATH, LAUGHTER
from meshes.speech import said

SILENCE = Timeline((Span(0.0, 0.2, Unit("sil")), Span(0.2, 1.0, Unit("aa"))))


def motion(opening: list[float], name: str = "opening") -> Motion:
    return Motion(np.array(opening)[:, None], 10.0, (Channel(name),))


def rests(*given) -> list[int]:
    return np.flatnonzero(rest.find_rest_frames(*given)).tolist()


def test_silence_is_rest_unless_it_is_open_and_else_the_most_closed_frames_are():
    assert rests(motion([0.01] * 2 + [0.1] * 9), SILENCE) == [0, 1]
    opening = [rest.LARGEST_REST + 0.02] * 2 + [0.1] * 8 + [0.0]
    assert rests(motion(opening), SILENCE) == rests(motion(opening), Timeline(())) == [10]


def test_where_no_opening_is_known_silence_counts_or_else_everything():
    weights = motion([0.0] * 11, "jawOpen")
    assert rests(weights, SILENCE) == [0, 1]
    assert rests(weights, Timeline(())) == [*range(11)]
    assert rests(weights, Timeline(()), np.array([0.1] * 10 + [0.0])) == [10]


TIME_S = np.arange(301) / 100


def generation(units: Timeline[Unit], opening: float = 0.1) -> Generation:
    values = np.column_stack([np.full(301, opening), np.where(TIME_S < 0.3, 0.5, 0.55)])
    return of_motion(Motion(values, 100.0, (Channel("opening"), Channel("width"))), units)


LINE = said((0, 0.4, "sil"), (0.4, 1.0, "aa"), (1.0, 1.5, "sp"), (1.5, 2.0, "aa"), (2.0, 2.15, "sp"), (2.15, 2.9, "eh"),
            (2.9, 3.0, "sil"))  # fmt: skip


def test_the_mouth_rests_in_pauses_and_at_both_ends_and_goes_on_in_short_ones():
    weight = rest.weigh_pauses(LINE, TIME_S)
    assert weight[:25] == pytest.approx(1)
    assert weight[122:136] == pytest.approx(1)
    assert weight[300] == pytest.approx(1)
    assert not weight[40:100].any()
    assert not weight[150:290].any()
    assert np.abs(np.diff(weight)).max() < 0.2


def test_nothing_moves_earlier_than_the_opening_time_before_a_phrase():
    moved = rest_in_pauses(generation(LINE), REST)
    opening = moved.motion["opening"]
    for start_s in (0.4, 1.5):
        before = opening[round((start_s - 0.2) * 100) : round((start_s - rest.OPENING_S) * 100)]
        assert np.ptp(before) < 1e-9
        assert before.max() <= CLOSED_OPENING
        assert opening[round(start_s * 100) - 4] >= rest.BREATH_GAP - 1e-9
    assert opening[60] == pytest.approx(0.1)
    mouth = find_mouth(moved.motion, LINE)
    assert mouth.contact[[0, 20, 125, 135, 300]].all()
    assert not mouth.contact[200:289].any()


def test_before_a_phrase_that_begins_with_closed_lips_they_stay_closed():
    units = said((0, 1, "sil"), (1, 1.2, "m"), (1.2, 2.5, "aa"), (2.5, 3.0, "sil"))
    given = generation(units)
    given.motion.values[110, 0] = 0
    opening = rest_in_pauses(given, REST).motion["opening"]
    assert opening[30:111].max() <= CLOSED_OPENING < opening[111] - 0.08
    assert rest_in_pauses(given, REST, [0.95]).motion["opening"][95] == pytest.approx(0.1)


def test_natural_pauses_and_motion_without_pauses_stay_as_they_are():
    for units, style in ((LINE, rest.NATURAL), (said((0, 3, "aa")), REST), (Timeline(()), REST)):
        given = generation(units)
        assert rest_in_pauses(given, style) is given


def test_a_pin_in_a_pause_holds_and_all_silence_is_rest():
    moved = rest_in_pauses(generation(LINE), REST, [1.25])
    assert moved.motion["opening"][125] == pytest.approx(0.1)
    assert moved.motion["opening"][20] <= CLOSED_OPENING
    assert rest_in_pauses(generation(said((0, 3, "sil"))), REST).motion["opening"].max() <= CLOSED_OPENING


def test_short_pauses_are_shared_by_the_phones_beside_them():
    shared = rest.share_short_pauses(LINE)
    assert [span.label.phone for span in shared] == ["sil", "aa", "sp", "aa", "eh", "sil"]
    assert shared[3].end_s == pytest.approx(2.075)
    assert shared[4].start_s == pytest.approx(2.075)
    assert shared[2] == LINE[2]


LAUGH = VoiceEvent(0.4, 1.4, LAUGHTER, 0.9, ((0.5, 1.0), (0.7, 0.5), (1.3, 0.5)))
QUIET = said((0, 2.0, "sil"), (2.0, 2.6, "aa"), (2.6, 3.0, "sil"))


def test_a_breath_that_is_detected_parts_the_lips_and_they_close_after_it():
    opening = rest_in_pauses(generation(QUIET), REST, events=[VoiceEvent(0.8, 1.2, BREATH, 1.0)]).motion["opening"]
    assert opening[90:111] == pytest.approx(rest.INHALING_GAP)
    assert opening[[60, 140]].max() <= CLOSED_OPENING
    assert np.abs(np.diff(opening[60:140])).max() < 0.01


def test_laughter_opens_the_mouth_with_its_calls_and_leaves_speech_alone():
    opening = rest_in_pauses(generation(QUIET), REST, events=[LAUGH]).motion["opening"]
    assert opening[50] == pytest.approx(rest.LAUGH_GAP, rel=0.02)
    assert opening[100] == pytest.approx(rest.LAUGH_SHARE * rest.LAUGH_GAP, rel=0.02)
    assert opening[100] < opening[70] < opening[50]
    assert opening[160] <= CLOSED_OPENING
    assert opening[210:250] == pytest.approx(0.1)
    assert rest_in_pauses(generation(LINE), REST, events=[LAUGH]).motion["opening"][45:95] == pytest.approx(0.1)


def test_what_opens_with_the_mouth_in_speech_opens_with_it_in_laughter():
    plain = generation(QUIET)
    values = plain.motion.values.copy()
    values[:, 0] = np.where((TIME_S > 2.1) & (TIME_S < 2.5), 0.2, 0.0)
    values[:, 1] = 0.6 - 0.5 * values[:, 0]
    moving = of_motion(Motion(values, 100.0, plain.motion.channels), QUIET)
    moved = rest_in_pauses(moving, REST, events=[LAUGH]).motion
    assert moved["width"][50] == pytest.approx(0.6 - 0.5 * moved["opening"][50], abs=1e-6)
    assert rest_in_pauses(moving, rest.NATURAL, events=[LAUGH]) is moving
