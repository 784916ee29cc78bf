import numpy as np
import pytest

from lipmotion.articulation import expression
from lipmotion.articulation.liveliness import compute_liveliness
from lipmotion.articulation.mouth import EXPRESSED, ROUND_WIDTH, spoken_mouth
from lipmotion.types import Channel, Motion, Prosody
from lipmotion.types.delivery import MOODS, NEUTRAL, MoodKey, parse_moods
from meshes.speech import motion, units

ACTION_UNITS = {1, 2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 20, 23, 24, 25, 26, 43, 53, 54, 55, 56, 57, 58, 64}
"""Those that faces show."""
SOURCES = {"EMFACS", "Ekman2003", "Harrigan1996", "Sundelin2013", "ours"}
PROTOTYPES = {
    "happy": {6, 12}, "sad": {1, 4, 15}, "angry": {4, 5, 7, 23}, "afraid": {1, 2, 4, 5, 7, 20}, "disgusted": {9, 15},
    "surprised": {1, 2, 5, 26},
}  # fmt: skip
"""Action units without which an emotion is another one, by EMFACS."""


def test_every_mood_has_known_action_units_with_intensities_and_sources():
    rows = expression.mood_rows()
    assert {row.mood for row in rows} == {*MOODS}
    assert len({(row.mood, row.unit) for row in rows}) == len(rows)
    assert {row.source for row in rows} == SOURCES
    for row in rows:
        assert row.unit in ACTION_UNITS
        assert 0 < row.intensity <= 1
    for mood, asked in PROTOTYPES.items():
        assert asked <= {*expression.mood_table()[mood]}
        assert asked <= {row.unit for row in rows if row.mood == mood and row.source == "EMFACS"}


def test_a_mood_comes_and_goes_smoothly_around_its_time():
    moved = expression.with_moods(motion(), parse_moods("happy:0.6 at 0.5, sad at 1.2"))
    happy, sad = moved["mood_happy"], moved["mood_sad"]
    assert happy[10] == sad[10] == 0
    assert happy[80] == pytest.approx(0.6)
    assert (happy[-1], sad[-1]) == pytest.approx((0, 1))
    assert np.abs(np.diff(moved.values[:, -2:], axis=0)).max() < 0.05
    assert (happy + sad).max() <= 1 + 1e-9


def test_from_the_start_a_mood_is_there_at_once_and_others_replace_it():
    moved = expression.with_moods(motion(), parse_moods("angry"))
    assert (moved["mood_angry"] == 1).all()
    again = expression.with_moods(moved, parse_moods("tired:0.5"))
    assert [name for name in again.names if expression.is_mood(name)] == ["mood_tired"]
    assert {name: curve[0] for name, curve in expression.read_moods(again).items()} == {"tired": 0.5}


def test_neutral_adds_nothing():
    moved = expression.with_moods(motion(), (MoodKey(0.0, NEUTRAL),))
    assert moved.names == motion().names
    assert np.array_equal(moved.values, motion().values)
    assert not expression.action_units(moved)
    mouth = spoken_mouth(moved, units())
    assert not any(getattr(mouth, name).any() for name in EXPRESSED)
    assert not compute_liveliness(moved.time_s, moved, units(), None).units


@pytest.mark.parametrize("mood", MOODS)
def test_round_lips_stay_round_in_every_mood(mood):
    plain, mouth = (spoken_mouth(expression.with_moods(motion(), parse_moods(each)), units()) for each in ("", mood))
    round_ = slice(108, 122)  # in uw
    assert mouth.width[round_].max() <= plain.width[round_].max() + 0.03
    assert mouth.width[round_].max() < ROUND_WIDTH + 0.001
    for name in ("smile", "frown", "stretched", "upper_raise"):
        assert getattr(mouth, name)[round_].max() < 0.3


def test_a_smile_widens_the_mouth_at_rest_and_surprise_opens_it():
    plain, happy, surprised = (
        spoken_mouth(expression.with_moods(motion(), parse_moods(mood)), units()) for mood in ("", "happy", "surprised")
    )
    assert happy.width[20] > plain.width[20] + 0.1
    assert happy.smile[20] > 0.8
    assert plain.contact[20]
    assert surprised.gap[20] > 0.1
    assert surprised.contact[92:96].any()  # p


def test_the_head_sinks_in_sadness_unless_it_is_still():
    time_s = np.arange(51) / 25
    sad = expression.with_moods(motion(), parse_moods("sad"))
    plain, moved, still = (
        compute_liveliness(time_s, of, units(), None, head=head)
        for of, head in ((motion(), True), (sad, True), (sad, False))
    )
    assert (moved.turn[:, 1] < plain.turn[:, 1] - 0.05).all()
    assert not still.turn.any()
    assert (moved.lids >= 0.15).all()


def test_a_mood_comes_and_goes_in_the_upper_face_and_grows_with_accents():
    time_s = np.arange(0, 60, 0.04)
    sad = expression.with_moods(Motion(np.full((6001, 1), 0.05), 100.0, (Channel("opening"),)), parse_moods("sad"))
    accent = np.arange(6001) % 300 > 200
    voice = Prosody(-40 + 25.0 * accent, 5.0 + 0.3 * accent)
    still, lively = (compute_liveliness(time_s, sad, units(), voice, brows=brows).unit(1) for brows in (False, True))
    usual = expression.mood_table()["sad"][1]
    assert still == pytest.approx(np.full(len(time_s), usual))
    assert 0.03 < lively.std() < 0.2
    assert lively.min() > 0.6 * usual


def test_channels_are_named_by_mood():
    assert expression.PREFIX + "happy" in expression.with_moods(motion(), parse_moods("happy")).names
    assert not expression.is_mood("mood_hungry")
