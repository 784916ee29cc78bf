from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.examples import result, spoken, timeline
from lipmotion import CueSheet
from lipmotion.articulation import cue_sheets
from lipmotion.articulation.cue_sheets import choose_cues, list_phone_shapes
from lipmotion.types import Channel, Generation, Motion, Timeline, Unit
from lipmotion.units import LIP_CLOSING, PHONES, VISEMES, is_silent
from lipmotion.units.phones import SHAPES
from testing.toy import ToySentence

FRAME_RATES = [12.0, 24.0, 25.0, 30.0, 60.0]


def shapes(sheet: CueSheet) -> str:
    return "".join(cue.label for cue in sheet.cues)


def is_seen(sheet: CueSheet, shape: str, start_s: float, end_s: float) -> bool:
    """Return whether a shape is shown during a phone, or one frame before or after it."""
    reach_s = 1 / sheet.fps
    shown = (cue for cue in sheet.cues if cue.label == shape)
    return any(cue.start_s < end_s + reach_s and cue.end_s > start_s - reach_s for cue in shown)


def check(sheet: CueSheet, duration_s: float, hold: int) -> None:
    """Check all cues: no gaps, no equal neighbours, the whole recording, the hold."""
    cues = sheet.cues.spans
    assert cues[0].start_s == 0
    assert duration_s - 0.0101 < cues[-1].end_s <= duration_s + 1e-9
    assert all(before.end_s == after.start_s and before.label != after.label for before, after in pairwise(cues))
    frames = [int(sheet.fps * cue.start_s) for cue in cues]
    assert all(after - before >= hold for before, after in pairwise(frames))
    assert len(cues) == 1 or (cues[-1].end_s - cues[-1].start_s) * sheet.fps > hold - 1.7
    assert set(shapes(sheet)) <= set(sheet.drawn)


def random_result(seed: int, phones: int, channels: str) -> Generation:
    rng = np.random.default_rng(seed)
    units = timeline([(str(rng.choice(PHONES)), float(rng.uniform(0.01, 0.2))) for _ in range(phones)])
    names = tuple(map(Channel, channels.split()))
    values = np.cumsum(rng.normal(0, 0.05, (int(units[-1].end_s * 100) + 1, len(names))), axis=0)
    return result(units, Motion(values, 100.0, names))


def with_values(generation: Generation, values: np.ndarray) -> Generation:
    return replace(generation, motion=replace(generation.motion, values=values))


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    phones=st.integers(1, 25),
    fps=st.sampled_from(FRAME_RATES),
    hold=st.integers(1, 6),
    optional=st.sampled_from(["GHX", "", "G", "HX"]),
    channels=st.sampled_from(["opening width", "opening", "width opening jaw", "jaw"]),
)
def test_random_phones_and_motion(seed: int, phones: int, fps: float, hold: int, optional: str, channels: str) -> None:
    generation = random_result(seed, phones, channels)
    sheet = choose_cues(generation, fps, hold, optional)
    check(sheet, generation.units[-1].end_s, hold)
    for span in generation.units:
        if span.label.phone in LIP_CLOSING:
            assert is_seen(sheet, "A", span.start_s, span.end_s)


def test_where_no_phone_is_known_the_motion_decides_whether_lips_meet() -> None:
    known = spoken("p aa p aa", 0.2)
    labels = [span.label if is_silent(span.label.phone) else Unit("", "some") for span in known.units]
    spans = tuple(replace(span, label=label) for span, label in zip(known.units, labels, strict=True))
    assert shapes(choose_cues(replace(known, units=Timeline(spans)), 24.0)) == "XADADX"


def test_shapes_of_words() -> None:
    words = {"p aa p aa": "XADADX", "m uw": "XAFX", "f aa v": "XGDGX", "w iy": "XFBX", "s": "XBX", "b ow": "XAEFX"}
    for said, wanted in (words | {"l aa": "XHDX"}).items():
        assert shapes(choose_cues(spoken(said, 0.17))) == wanted, said


def test_what_moves_in_silence_does_not_open_the_mouth() -> None:
    generation = spoken("b aa b")
    noise = np.abs(np.random.default_rng(3).normal(0, 0.2, generation.motion.values.shape))
    first, *_, last = choose_cues(with_values(generation, generation.motion.values + noise)).cues
    assert (first.label, last.label) == ("X", "X")
    assert first.end_s == pytest.approx(0.3, abs=0.09)


def test_p_b_m_win_over_f_v_where_there_is_no_room_for_both() -> None:
    crowded = choose_cues(spoken("aa b v b aa", 0.04), 24.0, 3)
    assert "G" not in shapes(crowded)
    assert "A" in shapes(crowded)
    assert "G" in shapes(choose_cues(spoken("aa b v b aa", 0.13), 24.0, 3))


def test_a_shape_is_there_with_its_sound_or_a_frame_before() -> None:
    starts = [cue.start_s for cue in choose_cues(spoken("s aa s aa s", 0.2)).cues if cue.label == "D"]
    for start_s, sound_s in zip(starts, (0.5, 0.9), strict=True):
        assert sound_s - 0.09 < start_s < sound_s + 0.01


@pytest.mark.parametrize(("vowel", "wide", "narrow"), [("ah", "D", "C"), ("ix", "C", "B")])
def test_the_mouth_opens_as_far_as_the_motion_does(vowel: str, wide: str, narrow: str) -> None:
    """The phones are the same; in the second vowel the mouth hardly opens."""
    generation = spoken(f"s {vowel} s {vowel} s", 0.2)
    values, time_s = generation.motion.values.copy(), generation.motion.time_s
    values[(time_s > 0.45) & (time_s < 0.75), 0] *= 2
    values[(time_s > 0.85) & (time_s < 1.15), 0] *= 0.7
    sheet = choose_cues(with_values(generation, values))
    for at_s, shape in ((0.6, wide), (1.0, narrow)):
        assert [c.label for c in sheet.cues if c.start_s < at_s < c.end_s] == [shape]


def test_the_size_of_the_face_does_not_matter(toy_sentence: ToySentence) -> None:
    generation = result(toy_sentence.units)
    assert choose_cues(with_values(generation, generation.motion.values * 40)) == choose_cues(generation)


@pytest.mark.parametrize("pause_s", [0.6, 5.0])
def test_how_far_one_line_opens_the_mouth_says_nothing_of_another(pause_s: float) -> None:
    """The second line's lips move a third as far, as those of a softer voice."""
    said = [(phone, 0.25) for phone in "s ah s ae n aa s iy".split()]
    units = timeline([("sil", 0.5), *said, ("sil", pause_s), *said, ("sil", 0.5)])
    both = result(units)
    values, second = both.motion.values.copy(), both.motion.time_s > 2.5 + pause_s / 2
    values[second] /= 3
    cues = choose_cues(with_values(both, values)).cues
    first, other = ([cue.label for cue in cues if cue.label != "X" and (cue.start_s > 2.6) == late] for late in (0, 1))
    assert len({*first}) >= 3
    assert first == other


def test_shapes_that_are_not_drawn() -> None:
    generation = spoken("b aa f aa l aa", 0.2)
    assert shapes(choose_cues(generation)) == "XADGDHDX"
    assert shapes(choose_cues(generation, optional="")) == "ADADCDA"
    assert choose_cues(generation, optional="GH").rest == "A"


def test_no_time_at_all_and_less_than_the_hold() -> None:
    for frames in (0, 1):
        motion = Motion(np.zeros((frames, 1)), 100.0, (Channel("opening"),))
        (cue,) = choose_cues(result(Timeline(()), motion)).cues
        assert (cue.start_s, cue.end_s, cue.label) == (0.0, 0.0, "X")
    for duration_s in (0.01, 0.05, 0.09):
        (cue,) = choose_cues(result(timeline([("b", duration_s)])), 24.0, 4).cues
        assert (cue.start_s, cue.end_s, cue.label) == (0.0, duration_s, "A")


def test_the_usual_hold_is_two_frames_at_24() -> None:
    said = result(timeline([("b", 0.06), ("iy", 0.06), ("f", 0.06), ("aa", 0.06), ("m", 0.06), ("uw", 0.06)] * 4))
    for fps, frames in zip((1, 12, 24, 25, 30, 48, 60), (1, 1, 2, 2, 3, 4, 5), strict=True):
        assert choose_cues(said, fps).rows == choose_cues(said, fps, frames).rows
        assert fps < 24 or choose_cues(said, fps).rows != choose_cues(said, fps, frames + 1).rows


def test_phones_outside_the_motion() -> None:
    """A phone that was moved beyond the end, and one of another inventory."""
    units = Timeline((*timeline([("b", 0.2), ("blorp", 0.2)]).spans, *timeline([("b", 0.1)]).shifted(0.9)))
    sheet = choose_cues(result(units, Motion(np.full((41, 1), 0.2), 100.0, (Channel("opening"),))))
    check(sheet, 1.0, 2)
    assert sheet.cues.spans[-1].label == "A"


def test_every_phone_but_h_has_shapes_whose_parts_are_the_whole() -> None:
    assert set(PHONES) - {*cue_sheets.read_phone_shapes()} == {"hh"}
    assert {*cue_sheets.read_phone_shapes()} <= set(PHONES)
    assert "A" not in list_phone_shapes("a phone of another language")[0].best
    for phone in PHONES:
        assert sum(look.share for look in list_phone_shapes(phone)) == pytest.approx(1)
        for look in list_phone_shapes(phone):
            assert look.best
            assert set(look.best + look.allowed) <= set(SHAPES)
            assert not set(look.best) & set(look.allowed)


def test_the_special_shapes_belong_to_their_sounds() -> None:
    silent = {phone for phone in PHONES if is_silent(phone)}
    for shape, phones in (("A", set(LIP_CLOSING)), ("G", set(VISEMES["ld"])), ("H", {"l", "el"}), ("X", silent)):
        assert {phone for phone in PHONES if any(shape in look.best for look in list_phone_shapes(phone))} == phones


RATES = [1, 10, 12, 15, 23.976, 24, 25, 29.97, 30, 48, 50, 59.94, 60]


def test_times_in_hundredths_lead_back_to_their_frames() -> None:
    """Also where the time is rounded, as the Blender add-ons do."""
    for fps in RATES:
        times_s = [cue_sheets.frame_to_seconds(frame, fps) for frame in range(2_000)]
        assert [int(fps * float(f"{time_s:.2f}")) for time_s in times_s] == list(range(2_000))
        assert fps >= 50 or [round(fps * time_s) for time_s in times_s] == list(range(2_000))
        assert all(before < after for before, after in pairwise(times_s))
        assert max(time_s - frame / fps for frame, time_s in enumerate(times_s)) < 0.0201
    for fps, hundredths in ((25, 4), (50, 2), (20, 5)):  # a time in whole hundredths is not rounded up
        exact = [frame * hundredths / 100 for frame in range(200) if int(fps * (frame * hundredths / 100)) == frame]
        assert {*np.round(exact, 9)} <= {round(cue_sheets.frame_to_seconds(frame, fps), 9) for frame in range(200)}


def test_the_last_frame_begins_before_the_end() -> None:
    for fps in RATES:
        for end_s in [0.0, 0.01, 0.04, 0.05, 0.5, 1.0, 2.97, 3.0, 10.0, 60.0]:
            frames = cue_sheets.count_cue_frames(end_s, fps)
            assert frames == pytest.approx(end_s * fps, abs=1.7)
            assert not frames or cue_sheets.frame_to_seconds(frames - 1, fps) < end_s
