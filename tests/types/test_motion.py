import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lipmotion import types
from lipmotion.errors import InputError
from lipmotion.types import Channel, Motion, Span, Timeline, Unit, values
from lipmotion.types.delivery import MoodKey, format_moods, parse_moods, sort_moods
from lipmotion.types.values import SchemaError, number, parse_number, parse_whole, text

CHANNELS = (Channel("opening"), Channel("jaw", "degrees"))


def motion(rows: int = 11, rate_hz: float = 10.0) -> Motion:
    """Two straight lines: what lies between frames is known."""
    return Motion(np.arange(rows)[:, None] * np.array([1.0, -2.0]), rate_hz, CHANNELS)


def test_frames_have_times_and_channels_have_names() -> None:
    curves = motion()
    assert curves.time_s == pytest.approx(np.arange(11) / 10)
    assert curves.names == ("opening", "jaw")
    assert curves["jaw"] == pytest.approx(-2 * np.arange(11))
    assert Channel("opening").unit == types.EYE_DISTANCE
    with pytest.raises(InputError, match="no motion channel 'width' among 2: opening, jaw"):
        _ = curves["width"]


def test_it_says_what_does_not_fit() -> None:
    for changes, message in (
        ({"values": np.zeros((3, 1))}, r"shape \(3, 1\), required unmasked \(T, 2\)"),
        ({"values": np.zeros(3)}, r"shape \(3,\), required unmasked \(T, 2\)"),
        ({"rate_hz": 0.0}, "rate is 0.0 Hz, required more than 0"),
        ({"values": np.ma.masked_less(np.zeros((3, 2)), 1)}, r"required unmasked \(T, 2\)"),
        ({"rate_hz": float("nan")}, "rate is nan Hz"),
        ({"channels": (Channel("opening"), Channel("opening", "mm"))}, "names repeat: opening, opening"),
    ):
        good = {"values": np.zeros((3, 2)), "rate_hz": 25.0, "channels": CHANNELS}
        with pytest.raises(InputError, match=message):
            Motion(**(good | changes))


@settings(max_examples=50)
@given(st.integers(1, 30), st.floats(1, 120), st.lists(st.floats(-1, 5), max_size=20), st.integers(0, 1000))
def test_at_is_what_numpy_interpolates(rows: int, rate_hz: float, time_s: list[float], seed: int) -> None:
    curves = Motion(np.random.default_rng(seed).normal(size=(rows, 2)), rate_hz, CHANNELS)
    found = curves.at(np.array(time_s))
    for column, name in enumerate(curves.names):
        assert found[:, column] == pytest.approx(np.interp(time_s, curves.time_s, curves[name]), abs=1e-9)


@settings(max_examples=50)
@given(st.integers(1, 300), st.sampled_from([24.0, 25.0, 29.97, 30.0, 60.0, 100.0]), st.floats(1, 1000))
def test_resampling_keeps_the_duration_and_the_values(rows: int, rate_hz: float, new_hz: float) -> None:
    curves = motion(rows, rate_hz)
    again = curves.resampled(new_hz)
    last_s = curves.time_s[-1]
    assert again.rate_hz == new_hz
    assert again.channels == curves.channels
    assert again.time_s[-1] <= last_s + 1e-6
    assert again.time_s[-1] + 1 / new_hz > last_s - 1e-6
    np.testing.assert_allclose(
        again["opening"], np.minimum(again.time_s * rate_hz, rows - 1), rtol=0, atol=1e-6, equal_nan=False
    )


def test_whole_multiples_keep_the_last_frame() -> None:
    for rows in range(1, 200):
        assert len(motion(rows, 100.0).resampled(50.0).values) == (rows - 1) // 2 + 1
        assert len(motion(rows, 25.0).resampled(100.0).values) == 4 * (rows - 1) + 1
    for rate_hz in (0.0, -25.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match=f"rate is {rate_hz} Hz, required more than 0"):
            motion().resampled(rate_hz)


def test_a_name_is_no_formula_of_a_spreadsheet() -> None:
    for name in ("=1+1", "+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1", " =1", "＝1", "\u3000＠x", "-x" * 500):
        with pytest.raises(InputError, match="a spreadsheet's formula, required another beginning") as caught:
            Channel(name)
        assert len(str(caught.value)) < 250
    for name in ("opening", "p12.x", "jaw-open", "Mouth Open (L)", "blendShape1.a=b", "öffnen", "", "_x", "|a|b"):
        assert Channel(name).name == name


def generation(frames: int = 101) -> types.Generation:
    """A second of a line, its variance the square of the frame's number, ten states."""
    line = np.arange(frames, dtype=float)[:, None]
    units = Timeline((Span(0.0, 1.0, Unit("aa")),))
    trace = types.StateTrace(tuple(f"state {number}" for number in range(10)), np.minimum(np.arange(frames) // 10, 9))
    return types.Generation(Motion(line, 100.0, (Channel("opening"),)), line**2, units, trace)


def test_all_parts_come_at_the_new_rate_and_the_state_is_that_of_the_nearest_frame() -> None:
    result = generation().resampled(25.0)
    assert result.motion.rate_hz == 25.0
    assert result.motion["opening"] == pytest.approx(np.arange(0, 101, 4))
    assert result.variance == pytest.approx(np.arange(0, 101, 4)[:, None] ** 2)
    assert result.units == generation().units
    assert result.trace.states == generation().trace.states
    assert result.trace.frames.tolist() == [min(frame // 10, 9) for frame in range(0, 101, 4)]
    for rate_hz in (24.0, 29.97, 60.0, 100.0, 441.0):
        before, after = generation(), generation().resampled(rate_hz)
        assert len(after.trace.frames) == len(after.variance) == len(after.motion.values)
        for time_s, state in zip(after.motion.time_s, after.trace.frames, strict=True):
            nearest = np.abs(before.motion.time_s - time_s)
            assert state in before.trace.frames[nearest <= nearest.min() + 1e-9]


def test_variance_that_follows_from_few_dimensions_is_kept_as_such() -> None:
    reduced, mixing = np.arange(202.0).reshape(101, 2), np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 2.0]])
    channels = tuple(map(Channel, ("opening", "width", "outer")))
    plain = generation()
    motion = Motion(np.zeros((101, 3)), 100.0, channels)
    small = types.Generation(motion, types.ReducedVariance(reduced, mixing), plain.units, plain.trace)
    large = types.Generation(motion, reduced @ mixing, plain.units, plain.trace)
    for change in (lambda g: g, lambda g: g.selected(["outer", "width"]), lambda g: g.resampled(29.97)):
        assert isinstance(change(small).spread, types.ReducedVariance)
        assert change(small).variance == pytest.approx(change(large).variance)
    assert small.variance_of(slice(3, 5)) == pytest.approx(large.variance[3:5])


def test_pins_and_times_are_numbers() -> None:
    wrong: Any
    for wrong in ("soon", None, [0.1], 1j, np.array([0.5]), 10**400):
        with pytest.raises(InputError, match=r"the time of a pin is .*, required a number"):
            types.Pin(wrong, "opening", 0.1)
        with pytest.raises(InputError, match=r"the value of a pin is .*, required a number"):
            types.Pin(0.5, "opening", wrong)
    for wrong in ("soon", None, [0.1], 1j, 10**400):
        with pytest.raises(InputError, match=r"the phone 'p' lasts from .* to .*, required seconds"):
            Timeline((Span(wrong, wrong, Unit("p")),))
    pin = types.Pin(0.5, "opening", 0.1)
    pins: Any
    for pins in (7, None, pin, "pins", [(0.5, "opening", 0.1)], [pin, None], iter([pin])):
        with pytest.raises(InputError, match="required pins"):
            types.Constraints(pins)


NAN = float("nan")


def timeline(*edges_s: tuple[float, float]) -> Timeline[str]:
    return Timeline(tuple(Span(start_s, end_s, f"at {start_s}") for start_s, end_s in edges_s))


def test_it_says_which_span_is_wrong_and_rounding_is_no_overlap() -> None:
    for edges_s, message in (
        ([(1, 0.5)], r"'at 1' ends at 0.5 s, before its start at 1 s"),
        ([(0, 1), (0.9, 2)], r"'at 0.9' starts at 0.9 s, before the previous span ends \(1 s\)"),
        ([(1, 2), (0, 0.5)], r"'at 0' starts at 0 s"),
        ([(NAN, 1)], "ends at 1 s"),
        ([(0, NAN)], "ends at nan s"),
    ):
        with pytest.raises(InputError, match=message):
            timeline(*edges_s)
    assert len(timeline((0, 0.1 + 0.2), (0.3, 1))) == 2


def test_a_phone_is_named_as_users_know_it() -> None:
    spans = (Span(0.0, 0.5, Unit("d", "sil-d+m")), Span(0.4, 0.6, Unit("m", "d-m+ih", "midnight")))
    with pytest.raises(InputError, match=r"^the phone 'm' starts at 0.4 s, before the previous span ends \(0.5 s\)"):
        Timeline(spans)
    with pytest.raises(InputError, match=r"^the unit 'bilabial' ends at 0\.5 s"):
        Timeline((Span(1.0, 0.5, Unit("", "bilabial")),))


MEMBERS = {"at": values.items(number(-1, 1), 2, 2), "count": values.whole(0, 9), "kind": values.one_of(["a", 1])}
POINT = values.members(MEMBERS, ["at"])
DEEP: list = []
for _ in range(5000):
    DEEP = [DEEP]


def test_what_fits_is_taken_out_in_its_type() -> None:
    found = POINT({"at": [1, 0.5], "count": 3, "kind": 1, "unknown": DEEP})
    assert found == {"at": [1.0, 0.5], "count": 3, "kind": 1}
    assert isinstance(found["at"][0], float)
    assert values.members({"a": values.if_fits(text(2)), "b": values.truth})({"a": "long", "b": True}) == {"b": True}
    assert values.items(values.if_fits(values.whole(0, 1)))([0, "x", 1]) == [0, 1]
    assert values.any_members(values.whole(0, 1))({"x": 1, "": 0}) == {"x": 1, "": 0}


def test_what_does_not_fit_is_named_with_its_place() -> None:
    for message, value in {
        "at is missing, required a value": {},
        "at[1] is 2, required a number from -1 to 1": {"at": [0, 2]},
        "at[0] is true, required a number": {"at": [True, 0]},
        "at[0] is 1000": {"at": [10**400, 0]},
        "at is a list of 3, required a list of 2 items": {"at": [0, 0, 0]},
        "at is an object, required a list": {"at": {"0": 0}},
        "count is 1.0, required a whole number from 0 to 9": {"at": [0, 0], "count": 1.0},
        "count is null": {"at": [0, 0], "count": None},
        "count is a list": {"at": [0, 0], "count": DEEP},
        "kind is true, required one of a, 1": {"at": [0, 0], "kind": True},
        "kind is an object": {"at": [0, 0], "kind": {}},
        "the document is a list, required an object": [],
    }.items():
        with pytest.raises(SchemaError) as refused:
            POINT(value)
        assert str(refused.value).startswith(message)
        assert len(str(refused.value)) < 300
    with pytest.raises(SchemaError, match=r"^a\.b\[1\]\.at\[0\] is 5"):
        values.members({"a": values.any_members(values.items(POINT))})({"a": {"b": [{"at": [0, 0]}, {"at": [5, 0]}]}})


def test_numbers_in_texts_are_of_plain_digits() -> None:
    assert parse_number(" -1.5e3 ") == pytest.approx(-1500)
    assert parse_whole("+12") == 12
    for written in ("1_0", "٣", "nan", "1e999", "9" * 400, "0x1", "", "1,5"):
        with pytest.raises(InputError, match="required a number"):
            parse_number(written)
    for written in ("1_0", "٣", "9" * 5000, "1.0", ""):
        with pytest.raises(InputError, match="required a whole number"):
            parse_whole(written)


def test_texts_and_paths_that_no_file_holds() -> None:
    assert values.path("a/\udce9.wav") == "a/\udce9.wav"  # a name that is no UTF-8
    for wrong in ("a\0b", "\ud800", "x" * 5000, "a/" + "é" * 200, 7, None):
        with pytest.raises(SchemaError):
            values.path(wrong)
    for wrong in ("\ud800", "x" * 5000, 10**400, float("nan")):
        with pytest.raises(SchemaError):
            text(1000)(wrong)
    for wrong in (10**400, float("inf"), "1", True, None):
        with pytest.raises(SchemaError):
            number()(wrong)


def test_a_value_is_made_of_its_fields_alone() -> None:
    pair = values.value_of(complex, {"real": number(), "imag": values.optional(number())}, ["real"])
    assert pair({"real": 1, "imag": 2}) == complex(1, 2)
    for wrong in ({}, {"real": 1, "other": 2}, [1, 2]):
        with pytest.raises(SchemaError):
            pair(wrong)


@dataclass(frozen=True)
class Example(types.Configuration):
    count: int = types.option(3, types.Rule(least=1))
    odd: int = types.option(5, types.Rule(least=1, odd=True))
    mixtures: int = types.option(4, types.Rule(power_of_two=True))
    weight: float = types.option(0.5, types.Rule(above=0))
    kind: str = types.option("soft", types.Rule(choices=("soft", "hard")))
    on: bool = True
    free: str = "anything"

    aliases: ClassVar[Mapping[str, str]] = {"how_many": "count"}
    removed: ClassVar[Mapping[str, Any]] = {"steps": 0}
    hints: ClassVar[Mapping[str, str]] = {"amount": "say count"}


WRONG_OPTIONS = json.loads(Path(__file__).with_name("wrong_options.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("options", "words"), WRONG_OPTIONS)
def test_a_value_that_is_not_allowed(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as error:
        Example.parsed(options)
    assert words in str(error.value)


def test_options_come_back_and_texts_are_parsed_as_their_types() -> None:
    one = Example.parsed({"how_many": 7, "weight": 2, "steps": 0})
    assert (one.count, one.weight) == (7, 2)
    assert Example.parsed(one.as_mapping()) == one
    assert Example.parsed({}) == Example()
    for given_texts, options in (
        (["count=4", "weight=2", "kind=hard"], {"count": 4, "weight": 2.0, "kind": "hard"}),
        (["on=no"], {"on": False}), (["on=TRUE"], {"on": True}), (["free=a=b"], {"free": "a=b"}),
        (["how_many=2"], {"count": 2}), ([], {}),
    ):  # fmt: skip
        assert Example.values_of(given_texts) == options


def test_texts_that_cannot_be_parsed() -> None:
    for setting, words in (
        ("count", "the setting 'count' has no value; required NAME=VALUE"),
        ("count=four", "count is 'four', required a whole number"),
        ("on=perhaps", "on is 'perhaps', required true or false"),
        ("weight=much", "weight is 'much', required a number"),
        ("no=1", "no option 'no'; there are: count"),
    ):
        with pytest.raises(InputError, match=words):
            Example.values_of([setting])


def test_a_text_of_moods_is_read_and_written():
    keys = parse_moods("sad at 2.5, Happy:0.7, neutral at 4")
    assert keys == (MoodKey(0.0, "happy", 0.7), MoodKey(2.5, "sad"), MoodKey(4.0, "neutral"))
    assert parse_moods(format_moods(keys)) == keys
    assert parse_moods("") == ()
    exact = (MoodKey(2e-05, "sad", 1e-05), MoodKey(7201.2345, "happy"))
    assert parse_moods(format_moods(exact)) == exact


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("hapy", "is it happy"),
        ("happy:1.2", "required 0 to 1"),
        ("happy:-0.5", "required 0 to 1"),
        ("happy at -1", "required 0 or more"),
        ("happy sad", "with commas"),
        ("happy:", "required MOOD"),
    ],
)
def test_other_texts_are_refused(text, said):
    with pytest.raises(InputError, match=said):
        parse_moods(text)
    with pytest.raises(InputError, match=said):
        types.Delivery(mood=text)


def test_of_two_moods_at_one_time_the_last_holds_but_a_manner_may_begin_with_a_mood():
    keys = sort_moods([MoodKey(1.0, "sad"), MoodKey(0.0, "happy"), MoodKey(1.0, "angry")])
    assert keys == (MoodKey(0.0, "happy"), MoodKey(1.0, "angry"))
    assert [key.label for key in parse_moods("whisper, sad:0.5, mumble")] == ["sad:0.5", "mumble"]


CURVE = np.array([0.0, 0.1, 0.2, 0.1])
CERTAIN, UNCERTAIN = np.zeros(4), np.full(4, 2e-3)


def test_a_known_voice_is_as_sure_as_its_variance_and_movements_of_a_stranger_less_than_his_mean() -> None:
    known = types.SpeechKnowledge(voice=1.0, phones=0.0)
    np.testing.assert_allclose(known.confidence(CURVE, CERTAIN), 1)
    np.testing.assert_allclose(known.confidence(CURVE, UNCERTAIN), 1 / (1 + 8 * 2e-3 / CURVE.var()))
    confidence = types.SpeechKnowledge(voice=0.0, phones=1.0).confidence(CURVE, CERTAIN)
    assert confidence[0] == pytest.approx(confidence[2])
    assert confidence[0] < confidence[1]


@pytest.mark.parametrize("better", [{"voice": 0.5, "phones": 0.5}, {"voice": 0.2, "phones": 0.9}])
def test_knowing_more_makes_sure(better: dict[str, float]) -> None:
    worse = types.SpeechKnowledge(voice=0.2, phones=0.5).confidence(CURVE, UNCERTAIN)
    assert (types.SpeechKnowledge(**better).confidence(CURVE, UNCERTAIN) > worse).all()


def test_motion_of_other_words_is_not_sure_whoever_speaks_and_one_that_stands_still_is() -> None:
    for voice in (0.0, 1.0):
        other = types.SpeechKnowledge(voice, 1.0, fit=0.0).confidence(CURVE, CERTAIN)
        assert 1 / other - 1 / types.SpeechKnowledge(voice, 1.0).confidence(CURVE, CERTAIN) == pytest.approx(0.5)
    still = types.SpeechKnowledge(voice=0.0, phones=1.0).confidence(np.full(5, 0.1, np.float32), np.full(5, -1e-12))
    assert (still > 0.5).all()
