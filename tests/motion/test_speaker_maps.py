from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.motion.closure import find_closable_ranges
from lipmotion.motion.rest import is_away_from_speech, list_speech_intervals
from lipmotion.motion.speaker_maps import (
    FAR_FROM_SPEECH_S,
    NEAR_SPEECH_S,
    VISEME_NAMES,
    SpeakerMaps,
    add_habits,
    map_to_mean_person,
    measure_restfulness,
    speakers_from_arrays,
    speakers_to_arrays,
    weigh_visemes,
)
from lipmotion.testing.toy import toy_motion, toy_sentences
from lipmotion.types import Channel, Example, Features, Motion, Span, Speech, Timeline, Unit

GAIN, OFFSET = np.array([0.5, 1.4, 0.8]), np.array([0.03, -0.2, 0.1])
"""How ben's opening, width and outer differ from anna's."""
POINTS = tuple(Channel(f"{axis}_{number}") for number in (13, 14) for axis in "xyz")


def spoken(units: Timeline[Unit], motion: Motion, frames: int | None = None) -> Example:
    count = len(motion.values) if frames is None else frames
    speech = Speech(Features(np.zeros((count, 39), np.float32), count / 100), units)
    return Example("one", speech, replace(motion, values=motion.values[:count]), np.ones(count, bool))


def anna(count: int = 6) -> list[Example]:
    return [spoken(sentence.units, toy_motion(sentence.units, 100.0)) for sentence in toy_sentences(count)]


def changed(example: Example, values: np.ndarray) -> Example:
    return replace(example, motion=replace(example.motion, values=values))


def ben(count: int = 6) -> list[Example]:
    """The same words from a mouth of another size that rests open."""
    return [
        changed(
            each,
            OFFSET
            + GAIN * each.motion.values
            + np.array([0.05, 0, 0.05]) * measure_restfulness(each.speech.units, len(each.motion.values))[:, None],
        )
        for each in anna(count)
    ]


def both(*groups: Sequence[Example]) -> tuple[list[list[Example]], SpeakerMaps]:
    examples = [example for group in groups for example in group]
    names = [name for name, group in zip(("anna", "ben", "cleo"), groups, strict=False) for _ in group]
    mapped, maps = map_to_mean_person(examples, names)
    parts = iter(mapped)
    return [[next(parts) for _ in group] for group in groups], maps


def poses(examples: Sequence[Example]) -> np.ndarray:
    return np.concatenate([example.motion.values for example in examples])


def at_rest(examples: Sequence[Example]) -> np.ndarray:
    frames = [measure_restfulness(each.speech.units, len(each.motion.values)) >= 1 for each in examples]
    return np.median(poses(examples)[np.concatenate(frames)], axis=0)


def closed(examples: Sequence[Example]) -> float:
    return float(
        np.median(
            [
                each.motion.values[frames, 0].min()
                for each in examples
                for frames in find_closable_ranges(each.speech.units, len(each.motion.values))
            ]
        )
    )


def test_people_become_alike() -> None:
    (first, second), _ = both(anna(), ben())
    before = np.abs(poses(anna()) - poses(ben())).mean(axis=0)
    after = np.abs(poses(first) - poses(second)).mean(axis=0)
    assert (after < 0.25 * before).all()
    spread = poses(first).std(axis=0) / poses(second).std(axis=0)
    np.testing.assert_allclose(spread, 1, atol=0.2)


def test_closed_lips_and_rest_poses_are_the_same_for_all() -> None:
    assert abs(closed(anna()) - closed(ben())) > 0.02
    assert np.abs(at_rest(anna()) - at_rest(ben())).min() > 0.01
    (first, second), maps = both(anna(), ben())
    assert closed(first) == pytest.approx(closed(second), abs=2e-3)
    np.testing.assert_allclose(at_rest(first), at_rest(second), atol=1e-9)
    mean = 0.5 * (closed(anna()) + closed(ben()))
    assert closed(first) == pytest.approx(mean, abs=2e-3)
    assert np.isclose(np.log(maps.gain).mean(axis=0), 0, atol=1e-9).all()


def test_a_map_and_its_inverse() -> None:
    _, maps = both(anna(), ben())
    restful = np.linspace(0, 1, 50)
    values = np.random.default_rng(0).normal(size=(50, 3))
    for name in maps.names:
        person = maps.of(name)
        np.testing.assert_allclose(person.to_person(person.to_mean(values, restful), restful), values, atol=1e-12)
    assert np.abs(maps.of("anna").to_person(values, restful) - values).max() > 0.01


def test_restfulness_grows_with_the_distance_from_speech() -> None:
    units = toy_sentences(3)[0].units
    speech_s = list_speech_intervals(units)
    times = np.arange(250) / 100
    distance = [max(0.0, min(max(a - t, t - b) for a, b in speech_s)) for t in times]
    found = measure_restfulness(units, 250)
    near, far = np.array(distance) < NEAR_SPEECH_S, np.array(distance) > FAR_FROM_SPEECH_S
    assert near.any()
    assert far.any()
    assert np.abs(found[near]).max() < 1e-12
    assert found[far].min() > 1 - 1e-12
    between = ~near & ~far
    order = np.argsort(np.array(distance)[between], kind="stable")
    assert np.diff(found[between][order]).min() > -1e-9
    assert (is_away_from_speech(times, speech_s, FAR_FROM_SPEECH_S) == far).all()


def test_points_share_a_gain_for_each_axis() -> None:
    rng = np.random.default_rng(1)
    shape, size = rng.normal(size=6), np.array([1.5, 0.6, 1.0, 1.1, 0.7, 0.9])

    def with_points(example: Example, person: bool) -> Example:
        movement = example.motion.values[:, [1, 0, 0, 1, 0, 0]] * np.array([1, 1, 0.3, -1, -1, 0.2])
        points = shape + size * movement if person else movement
        values = np.concatenate([example.motion.values, points], axis=1)
        return replace(example, motion=Motion(values, 100.0, (*example.motion.channels, *POINTS)))

    (first, second), maps = both(
        [with_points(each, False) for each in anna()], [with_points(each, True) for each in anna()]
    )
    for axis in range(3):
        columns = [3 + axis, 6 + axis]
        assert np.ptp(maps.gain[:, columns], axis=1).max() < 1e-12
    assert maps.of("ben").gain[4] < 0.9
    assert maps.of("ben").gain[3] > 1.1
    np.testing.assert_allclose(at_rest(first)[3:], at_rest(second)[3:], atol=1e-9)


def test_a_channel_that_somebody_does_not_move_is_not_stretched() -> None:
    still = [changed(each, each.motion.values * [1, 1e-6, 1]) for each in anna()]
    _, maps = both(anna(), still)
    np.testing.assert_allclose(maps.gain[:, 1], 1)
    assert np.isfinite(maps.offset).all()


def test_people_without_silence_or_without_speech() -> None:
    talk = []
    for each in ben():
        start_s, end_s = list_speech_intervals(each.speech.units)[0][0], list_speech_intervals(each.speech.units)[-1][1]
        first, stop = int(np.ceil(start_s * 100)), int(end_s * 100)
        spans = [Span(s.start_s - start_s, s.end_s - start_s, s.label) for s in each.speech.units if s.label.word]
        motion = replace(each.motion, values=each.motion.values[first:stop])
        talk.append(spoken(Timeline(tuple(spans)), motion))
    silent = Timeline((Span(0.0, 1.0, Unit("sil", "sil")),))
    mute = [spoken(silent, Motion(np.full((100, 3), 0.3), 100.0, anna()[0].motion.channels))]
    (_, second, third), maps = both(anna(), talk, mute)
    assert np.isfinite([maps.offset, maps.gain, maps.rest]).all()
    assert closed(second) == pytest.approx(closed(both(anna(), talk, mute)[0][0]), abs=2e-3)
    np.testing.assert_allclose(poses(third), np.tile(poses(third)[0], (100, 1)), atol=1e-12)


def test_unseen_frames_change_nothing() -> None:
    def with_unseen(example: Example, value: float) -> Example:
        values, valid = example.motion.values.copy(), example.valid.copy()
        values[60:90], valid[60:90] = value, False
        return replace(example, motion=replace(example.motion, values=values), valid=valid)

    _, one = both([with_unseen(each, 0.0) for each in anna()], ben())
    _, other = both([with_unseen(each, 9.0) for each in anna()], ben())
    for array, same in zip(speakers_to_arrays(one).values(), speakers_to_arrays(other).values(), strict=True):
        assert np.array_equal(array, same)


def test_speakers_without_a_name_are_one_person_more() -> None:
    examples = [*anna(), *ben(), *anna(3)]
    mapped, maps = map_to_mean_person(examples, ["anna"] * 6 + ["ben"] * 6 + [""] * 3)
    assert maps.names == ("anna", "ben")
    assert len(mapped) == 15


def test_an_unknown_name_lists_the_others() -> None:
    _, maps = both(anna(), ben())
    with pytest.raises(InputError, match="no speaker 'cleo', only: anna, ben"):
        maps.of("cleo")


def test_channels_in_another_order() -> None:
    _, maps = both(anna(), ben())
    person = maps.of("ben")
    turned = person.reorder(person.channels[::-1])
    np.testing.assert_allclose(turned.gain, person.gain[::-1])
    with pytest.raises(InputError, match="'jaw'"):
        person.reorder((Channel("jaw"),))


def test_habits_are_what_is_left_in_each_viseme() -> None:
    examples, names = [*anna(), *ben()], ["anna"] * 6 + ["ben"] * 6
    mapped, maps = map_to_mean_person(examples, names)
    planted = np.zeros((len(VISEME_NAMES), 3))
    planted[VISEME_NAMES.index("lr1"), 1], planted[VISEME_NAMES.index("al"), 2] = 0.1, -0.2
    generated = [
        each.motion.values
        - (weigh_visemes(each.speech.units, len(each.motion.values)) @ planted if name == "ben" else 0.0)
        for each, name in zip(mapped, names, strict=True)
    ]
    found = add_habits(maps, mapped, names, generated)
    np.testing.assert_allclose(found.of("anna").habits, 0, atol=1e-12)
    habits = found.of("ben").habits
    assert 0.05 < habits[VISEME_NAMES.index("lr1"), 1] < 0.1
    assert -0.2 < habits[VISEME_NAMES.index("al"), 2] < -0.05
    assert np.abs(habits[:, 0]).max() < 1e-12
    one = mapped[-1]
    visemes = weigh_visemes(one.speech.units, len(one.motion.values))
    shift = found.of("ben").shift(one.motion.values, visemes)
    assert np.abs(shift).max() > 0.03
    restful = measure_restfulness(one.speech.units, len(shift)) >= 1
    assert np.abs(shift[restful]).max() < 1e-12
    closed_lips = one.motion.values[:, 0] <= found.lips[0] + 1e-9  # rounding
    assert closed_lips.any()
    assert np.abs(shift[closed_lips]).max() < 1e-6


def test_weights_of_visemes_fade() -> None:
    units = toy_sentences(3)[0].units
    weights = weigh_visemes(units, 250)
    assert np.abs(weights.sum(axis=1) + measure_restfulness(units, 250) - 1).max() < 1e-9
    assert 0 < np.abs(np.diff(weights, axis=0)).max() < 0.3
    unknown = Timeline((Span(0.0, 1.0, Unit("", "a group")),))
    assert np.abs(weigh_visemes(unknown, 100)).max() < 1e-12


def test_maps_are_stored() -> None:
    _, maps = both(anna(), ben())
    again = speakers_from_arrays(speakers_to_arrays(maps))
    assert (again.names, again.channels) == (maps.names, maps.channels)
    for array, same in zip(speakers_to_arrays(maps).values(), speakers_to_arrays(again).values(), strict=True):
        assert np.array_equal(array, same)


def test_damaged_maps_are_refused() -> None:
    for name, value in (
        ("gain", np.full((2, 3), 5.0)),
        ("gain", np.full((2, 3), np.nan)),
        ("gain", np.ones((3, 3))),
        ("offset", np.ones((2, 2))),
        ("rest", np.full((2, 3), np.inf)),
        ("habits", np.ones((2, 12, 3))),
        ("lips", np.array([-0.1, 0.2])),
        ("names", np.array(["anna", "anna"])),
        ("names", np.array(["anna", ""])),
        ("names", np.array([1, 2])),
        ("channels", np.array([["a", "b"]] * 3)),
        ("more", np.ones(2)),
    ):
        arrays = speakers_to_arrays(both(anna(3), ben(3))[1])
        with pytest.raises(ModelFormatError, match="table of speakers"):
            speakers_from_arrays(arrays | {name: value})


def test_missing_arrays_are_refused() -> None:
    for name in ("channels", "names", "gain", "offset", "rest", "habits", "lips"):
        arrays = speakers_to_arrays(both(anna(3), ben(3))[1])
        del arrays[name]
        with pytest.raises(ModelFormatError, match=name):
            speakers_from_arrays(arrays)


def test_wrong_phones_of_one_clip_do_not_keep_the_lips_of_a_person_open() -> None:
    clip = ben(3)[0]
    labels = []
    for span in clip.speech.units:
        middle_s = 0.5 * (span.start_s + span.end_s)
        if span.label.phone == "aa":  # an m that was recognised where the mouth is open
            labels.append(Span(middle_s - 0.03, middle_s - 0.01, Unit("m")))
        else:
            labels.append(replace(span, label=Unit("t" if span.label.phone in ("p", "b", "m") else span.label.phone)))
    recognised = replace(clip, speech=replace(clip.speech, units=Timeline(tuple(labels))))
    opened = [clip.motion.values[f, 0].min() for f in find_closable_ranges(recognised.speech.units, 10_000)]
    assert np.median(opened) > closed([clip]) + 0.02
    _, maps = both(anna(), [recognised])
    shut = np.full((1, 3), maps.lips[0])
    person = maps.of("ben").to_person(shut, np.zeros(1))[0, 0]
    assert person == pytest.approx(closed([clip]), abs=0.01)
