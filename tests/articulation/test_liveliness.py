import numpy as np
import pytest

from formats.examples import of_motion
from lipmotion.articulation import expression, liveliness
from lipmotion.articulation.liveliness import compute_liveliness
from lipmotion.articulation.mouth import EXPRESSED, ROUND_WIDTH, find_mouth
from lipmotion.pipeline.outputs.deliver import FACTORS, deliver, with_detected, with_manners
from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import Channel, Generation, Motion, Prosody, Span, Timeline, Unit, VoiceEvent
from lipmotion.types.audio import BREATH, LAUGHTER
from lipmotion.types.delivery import MANNERS, MOODS, NEUTRAL, PLAIN, Delivery, MoodKey, format_moods, parse_moods
from meshes.speech import motion, units

MINUTE = Motion(np.full((6001, 1), 0.05), 100.0, (Channel("opening"),))
PHRASE = ((0, 3, "aa"), (3, 4, "sil"))
SAID = Timeline(tuple(Span(s + start, s + end, Unit(phone)) for s in range(0, 60, 4) for start, end, phone in PHRASE))


SILENT = Timeline((Span(0.0, 60.0, Unit("sil")),))


def frames(fps: float, end_s: float = 60.0) -> np.ndarray:
    return np.arange(int(end_s * fps) + 1) / fps


def closings(lids: np.ndarray) -> np.ndarray:
    return np.flatnonzero(np.diff((lids > 0.5).astype(int)) == 1)


def test_eyes_blink_as_people_do_and_are_open_otherwise():
    for seed in range(3):
        lids = compute_liveliness(frames(100), MINUTE, SAID, None, seed=seed).lids
        blinks = closings(lids) / 100
        assert 9 <= len(blinks) <= 30
        assert np.diff(blinks).min() > 0.3
        assert (lids == 0).mean() > 0.85
        assert lids.max() == pytest.approx(1, abs=0.02)


def test_every_blink_is_seen_at_25_frames_a_second():
    time_s = frames(25)
    for begin in np.arange(0.5, 1.5, 0.013):
        assert liveliness.lid_closure(time_s, [begin]).max() > 0.85


CURVES = ("lids", "brows", "gaze", "turn")


def test_nothing_depends_on_the_frame_rate():
    slow, fast = (compute_liveliness(frames(fps, 20), MINUTE, SAID, None) for fps in (25, 50))
    for name in CURVES:
        assert getattr(slow, name) == pytest.approx(getattr(fast, name)[::2])


def test_another_seed_gives_something_else():
    first, other = (compute_liveliness(frames(25), MINUTE, SAID, None, seed=seed) for seed in (1, 2))
    assert all(np.abs(getattr(first, name) - getattr(other, name)).max() > 0 for name in CURVES)


@pytest.mark.parametrize(("part", "curve"), [("blinks", "lids"), ("brows", "brows"), ("head", "turn")])
def test_each_part_can_be_off_and_leaves_the_others(part, curve):
    whole, without = (compute_liveliness(frames(25), MINUTE, SAID, None, **{part: on}) for on in (True, False))
    for name in CURVES:
        one, other = getattr(whole, name), getattr(without, name)
        if name == curve:
            assert np.ptp(other) < 1e-9
            assert np.ptp(one) > 3e-4
        elif not (part == "head" and name == "gaze"):
            assert np.array_equal(one, other)


def test_without_glances_the_eyes_hold_their_target_while_the_head_turns():
    moved = compute_liveliness(frames(25), MINUTE, SAID, None, gaze=False)
    assert moved.gaze == pytest.approx(-liveliness.GAZE_COUNTER_SHARE * moved.turn[:, :2])
    assert np.ptp(moved.gaze) > 0.01


def test_loud_and_high_moments_raise_the_brows_and_nod_the_head():
    time_s = frames(100)
    accent = (time_s % 2.0 > 0.9) & (time_s % 2.0 < 1.2)
    moved = compute_liveliness(time_s, MINUTE, SAID, Prosody(-30 + 20.0 * accent, 4.94 + 0.45 * accent))
    flat = compute_liveliness(time_s, MINUTE, SAID, Prosody(np.full(6001, -30.0), np.full(6001, 4.94)))
    brows, nods = (moved.brows, flat.brows, -15), (-moved.turn[:, 1], -flat.turn[:, 1], 5)
    for one, other, later in (brows, nods):
        difference, soon = one - other, np.roll(accent, later)
        assert difference[soon].mean() > difference[~soon].mean() + 0.005


def test_brows_are_level_at_rest_and_never_below():
    brows = compute_liveliness(frames(25), MINUTE, SILENT, Prosody(np.full(6001, -30.0), np.full(6001, np.nan))).brows
    assert brows.min() >= 0
    assert brows.max() < 0.01


def test_the_head_moves_slowly_and_less_in_silence():
    turn, silent = (compute_liveliness(frames(100), MINUTE, units, None).turn for units in (SAID, SILENT))
    assert np.abs(np.diff(turn, axis=0)).max() * 100 < 0.8  # radians a second
    assert 0.01 < turn.std(axis=0).max() < 0.08
    assert np.abs(turn).max() < 0.25
    assert 0 < silent.std(axis=0).max() < 0.7 * turn.std(axis=0).max()


ACTION_UNITS = {1, 2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 20, 23, 24, 25, 26, 43, 53, 54, 55, 56, 57, 58, 64}
"""Those that faces show."""
SOURCES = {"EMFACS", "Ekman2003", "Harrigan1996", "Sundelin2013", "ours"}
PROTOTYPES = {
    "happy": {6, 12}, "sad": {1, 4, 15}, "angry": {4, 5, 7, 23}, "afraid": {1, 2, 4, 5, 7, 20}, "disgusted": {9, 15},
    "surprised": {1, 2, 5, 26},
}  # fmt: skip
"""Action units without which an emotion is another one, by EMFACS."""


def test_every_mood_has_known_action_units_with_intensities_and_sources():
    table = read_shipped_table("lipmotion.articulation", "moods.csv")
    rows = [(row["mood"], int(row["action_unit"]), row["source"]) for row in table]
    assert {mood for mood, *_ in rows} == {*MOODS}
    assert len({(mood, unit) for mood, unit, _ in rows}) == len(rows)
    assert {source for *_, source in rows} == SOURCES
    assert {unit for _, unit, _ in rows} <= {*ACTION_UNITS}
    assert all(0 < size <= 1 for units in expression.read_mood_table().values() for size in units.values())
    for mood, asked in PROTOTYPES.items():
        assert asked <= {*expression.read_mood_table()[mood]}
        assert asked <= {unit for name, unit, source in rows if name == mood and source == "EMFACS"}


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
    assert not expression.list_action_units(moved)
    mouth = find_mouth(moved, units())
    assert not any(getattr(mouth, name).any() for name in EXPRESSED)
    assert not compute_liveliness(moved.time_s, moved, units(), None).units


@pytest.mark.parametrize("mood", MOODS)
def test_round_lips_stay_round_in_every_mood(mood):
    plain, mouth = (find_mouth(expression.with_moods(motion(), parse_moods(each)), units()) for each in ("", mood))
    round_ = slice(108, 122)  # in uw
    assert mouth.width[round_].max() <= plain.width[round_].max() + 0.03
    assert mouth.width[round_].max() < ROUND_WIDTH + 0.001
    for name in ("smile", "frown", "stretched", "upper_raise"):
        assert getattr(mouth, name)[round_].max() < 0.3


def test_a_smile_widens_the_mouth_at_rest_and_surprise_opens_it():
    plain, happy, surprised = (
        find_mouth(expression.with_moods(motion(), parse_moods(mood)), units()) for mood in ("", "happy", "surprised")
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
    usual = expression.read_mood_table()["sad"][1]
    assert still == pytest.approx(np.full(len(time_s), usual))
    assert 0.03 < lively.std() < 0.2
    assert lively.min() > 0.6 * usual


@pytest.fixture(scope="module")
def generation() -> Generation:
    return of_motion(motion(), units())


def test_shouted_vowels_are_more_open_and_mumbled_ones_less(generation: Generation) -> None:
    assert {*FACTORS} == {PLAIN, *MANNERS}
    gaps = {}
    for manner in FACTORS:
        found = with_manners(generation, parse_moods(manner))
        mouth = find_mouth(found.motion, found.units)
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
    before, delivery = generation.motion.values.copy(), Delivery(mood="shout, happy at 1.1")
    assert not np.array_equal(deliver(generation, delivery).motion.values[:, : before.shape[1]], before)
    assert np.array_equal(generation.motion.values, before)


@pytest.mark.parametrize(
    ("asked", "shown"),
    [
        ("", "happy at 3, neutral at 4"),
        ("sad", "sad at 0"),
        ("plain", "plain at 0, happy at 3, neutral at 4"),
        ("mumble at 1, angry at 2", "mumble at 1, angry at 2"),
    ],
)
def test_what_is_detected_is_shown_where_nothing_of_its_kind_is_asked_for(asked: str, shown: str) -> None:
    kinds = ((3, LAUGHTER, 0.9), (4.5, BREATH, 1))
    events = [VoiceEvent(start_s, start_s + 1, kind, strength) for start_s, kind, strength in kinds]
    assert format_moods(with_detected(parse_moods(asked), events)) == shown
