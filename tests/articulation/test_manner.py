import numpy as np
import pytest

from formats.examples import of_motion
from lipmotion.articulation.mouth import spoken_mouth
from lipmotion.pipeline.outputs.deliver import FACTORS, with_detected, with_manners
from lipmotion.types import Generation, VoiceEvent
from lipmotion.types.audio import BREATH, LAUGHTER, SHOUT, WHISPER
from lipmotion.types.delivery import MANNERS, PLAIN, format_moods, parse_moods
from meshes.speech import motion, units


@pytest.fixture(scope="module")
def generation() -> Generation:
    return of_motion(motion(), units())


def test_shouted_vowels_are_more_open_and_mumbled_ones_less(generation: Generation) -> None:
    assert {*FACTORS} == {PLAIN, *MANNERS}
    gaps = {}
    for manner in FACTORS:
        found = with_manners(generation, parse_moods(manner))
        mouth = spoken_mouth(found.motion, found.units)
        assert mouth.contact[55]  # m
        assert mouth.contact[95]  # p
        gaps[manner] = float(mouth.gap[75])
    assert gaps["mumble"] < gaps["whisper"] < 0.7 * gaps[PLAIN] < 0.8 * 0.7 * gaps["shout"]


def test_a_manner_holds_until_the_next_and_moods_do_not_count(generation: Generation) -> None:
    found = with_manners(generation, parse_moods("shout at 1.05, sad at 1.1, plain at 1.2"))
    change = np.abs(found.motion.values - generation.motion.values).max(axis=1)
    assert change[:90].max() == 0
    assert change[115] > 0
    assert change[-20:].max() == 0
    assert with_manners(generation, parse_moods("happy")) is generation


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        ("", "whisper:0.5 at 1, plain at 2, happy at 3, neutral at 4, shout:0.8 at 5, plain at 6"),
        ("sad", "sad at 0, whisper:0.5 at 1, plain at 2, shout:0.8 at 5, plain at 6"),
        ("plain", "plain at 0, happy at 3, neutral at 4"),
        ("mumble at 1, angry at 2", "mumble at 1, angry at 2"),
    ],
)
def test_what_is_detected_is_shown_where_nothing_of_its_kind_is_asked_for(asked: str, shown: str) -> None:
    kinds = ((1, WHISPER, 0.5), (3, LAUGHTER, 0.9), (4.5, BREATH, 1), (5, SHOUT, 0.8))
    events = [VoiceEvent(start_s, start_s + 1, kind, strength) for start_s, kind, strength in kinds]
    assert format_moods(with_detected(parse_moods(asked), events)) == shown
