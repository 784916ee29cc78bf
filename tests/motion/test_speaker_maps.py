from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError, ModelFormatError
from lipmotion.motion import speaker_maps
from lipmotion.motion.closure import find_closable_ranges
from lipmotion.motion.frame_labels import is_away_from_speech, list_speech_intervals
from lipmotion.motion.speaker_estimation import RANGE_PRIOR_S, add_habits, map_to_mean_person
from lipmotion.motion.speaker_maps import compose_maps
from lipmotion.types import Channel, Example, Features, Motion, Span, Speech, Timeline, Unit
from lipmotion_faces.transfer import REST_PRIOR_S, count_speech_s, fit_transfer_map
from testing.toy import toy_motion, toy_sentences

GAIN, OFFSET, PARTED = np.array([0.5, 1.4, 0.8]), np.array([0.03, -0.2, 0.1]), np.array([0.05, 0.0, 0.05])
"""How ben's opening, width and outer differ from anna's, and by how much the lips part at rest."""
POINTS = tuple(Channel(f"{axis}_{number}") for number in (13, 14) for axis in "xyz")


def spoken(units: Timeline[Unit], motion: Motion) -> Example:
    frames = len(motion.values)
    speech = Speech(Features(np.zeros((frames, 39), np.float32), frames / 100), units)
    return Example("one", speech, motion, np.ones(frames, bool))


def anna(count: int = 6) -> list[Example]:
    sentences = toy_sentences(max(count, 3))[:count]
    return [spoken(sentence.units, toy_motion(sentence.units, 100.0)) for sentence in sentences]


def changed(example: Example, values: np.ndarray) -> Example:
    return replace(example, motion=replace(example.motion, values=values))


def resting_open(examples: list[Example]) -> list[Example]:
    """The same words from a mouth of another size that rests open."""
    return [changed(each, OFFSET + GAIN * each.motion.values + PARTED * restful(each)[:, None]) for each in examples]


def ben(count: int = 6) -> list[Example]:
    return resting_open(anna(count))


def restful(example: Example) -> np.ndarray:
    return speaker_maps.measure_restfulness(example.speech.units, len(example.motion.values))


def both(*groups: Sequence[Example]) -> tuple[list[list[Example]], speaker_maps.SpeakerMaps]:
    examples = [example for group in groups for example in group]
    names = [name for name, group in zip(("anna", "ben", "cleo"), groups, strict=False) for _ in group]
    mapped, maps = map_to_mean_person(examples, names)
    parts = iter(mapped)
    return [[next(parts) for _ in group] for group in groups], maps


def poses(examples: Sequence[Example]) -> np.ndarray:
    return np.concatenate([example.motion.values for example in examples])


def at_rest(examples: Sequence[Example]) -> np.ndarray:
    return np.median(poses(examples)[np.concatenate([restful(each) >= 1 for each in examples])], axis=0)


def least_openings(example: Example) -> list[float]:
    values = example.motion.values
    return [values[frames, 0].min() for frames in find_closable_ranges(example.speech.units, len(values))]


def closed(examples: Sequence[Example]) -> float:
    return float(np.median([opening for each in examples for opening in least_openings(each)]))


def test_closed_lips_and_rest_poses_are_the_same_for_all() -> None:
    assert abs(closed(anna()) - closed(ben())) > 0.02
    assert np.abs(at_rest(anna()) - at_rest(ben())).min() > 0.01
    (first, second), maps = both(anna(), ben())
    assert closed(first) == pytest.approx(closed(second), abs=2e-3)
    np.testing.assert_allclose(at_rest(first), at_rest(second), atol=1e-9)
    mean = 0.5 * (closed(anna()) + closed(ben()))
    assert closed(first) == pytest.approx(mean, abs=2e-3)
    np.testing.assert_allclose(np.mean([np.log(person.gain) for person in maps.values()], axis=0), 0, atol=1e-9)


def test_a_map_and_its_inverse() -> None:
    _, maps = both(anna(), ben())
    restful = np.linspace(0, 1, 50)
    values = np.random.default_rng(0).normal(size=(50, 3))
    for person in maps.values():
        np.testing.assert_allclose(person.to_person(person.to_mean(values, restful), restful), values, atol=1e-12)
    assert np.abs(maps["anna"].to_person(values, restful) - values).max() > 0.01


def test_restfulness_grows_with_the_distance_from_speech_and_weights_of_visemes_fade() -> None:
    units = toy_sentences(3)[0].units
    speech_s, times = list_speech_intervals(units), np.arange(250) / 100
    distance = np.array([max(0.0, min(max(a - t, t - b) for a, b in speech_s)) for t in times])
    found = speaker_maps.measure_restfulness(units, 250)
    near, far = distance < speaker_maps.NEAR_SPEECH_S, distance > speaker_maps.FAR_FROM_SPEECH_S
    assert near.any()
    assert far.any()
    assert np.abs(found[near]).max() < 1e-12
    assert found[far].min() > 1 - 1e-12
    assert np.diff(found[np.argsort(distance, kind="stable")]).min() > -1e-9
    assert (is_away_from_speech(times, speech_s, speaker_maps.FAR_FROM_SPEECH_S) == far).all()
    weights = speaker_maps.weigh_viseme_classes(units, 250)
    assert np.abs(weights.sum(axis=1) + found - 1).max() < 1e-9
    assert 0 < np.abs(np.diff(weights, axis=0)).max() < 0.3
    unknown = Timeline((Span(0.0, 1.0, Unit("", "a group")),))
    assert np.abs(speaker_maps.weigh_viseme_classes(unknown, 100)).max() < 1e-12


def test_points_share_a_gain_for_each_axis() -> None:
    shape, size = np.random.default_rng(1).normal(size=6), np.array([1.5, 0.6, 1.0, 1.1, 0.7, 0.9])

    def with_points(example: Example, person: bool) -> Example:
        movement = example.motion.values[:, [1, 0, 0, 1, 0, 0]] * np.array([1, 1, 0.3, -1, -1, 0.2])
        values = np.concatenate([example.motion.values, shape + size * movement if person else movement], axis=1)
        return replace(example, motion=Motion(values, 100.0, (*example.motion.channels, *POINTS)))

    (first, second), maps = both(*([with_points(each, person) for each in anna()] for person in (False, True)))
    for person in maps.values():
        assert person.gain[3:6] == pytest.approx(person.gain[6:])
    assert maps["ben"].gain[4] < 0.9
    assert maps["ben"].gain[3] > 1.1
    np.testing.assert_allclose(at_rest(first)[3:], at_rest(second)[3:], atol=1e-9)


def test_a_channel_that_somebody_does_not_move_is_not_stretched() -> None:
    still = [changed(each, each.motion.values * [1, 1e-6, 1]) for each in anna()]
    _, maps = both(anna(), still)
    for person in maps.values():
        assert person.gain[1] == pytest.approx(1)
        assert np.isfinite(person.offset).all()


def test_people_without_silence_or_without_speech() -> None:
    talk = []
    for each in ben():
        (start_s, _), *_, (_, end_s) = list_speech_intervals(each.speech.units)
        spans = [Span(s.start_s - start_s, s.end_s - start_s, s.label) for s in each.speech.units if s.label.word]
        values = each.motion.values[int(np.ceil(start_s * 100)) : int(end_s * 100)]
        talk.append(spoken(Timeline(tuple(spans)), replace(each.motion, values=values)))
    silent = Timeline((Span(0.0, 1.0, Unit("sil", "sil")),))
    mute = [spoken(silent, Motion(np.full((100, 3), 0.3), 100.0, anna()[0].motion.channels))]
    (_, second, third), maps = both(anna(), talk, mute)
    assert np.isfinite([(person.offset, person.gain, person.rest) for person in maps.values()]).all()
    assert closed(second) == pytest.approx(closed(both(anna(), talk, mute)[0][0]), abs=2e-3)
    np.testing.assert_allclose(poses(third), np.tile(poses(third)[0], (100, 1)), atol=1e-12)


def test_unseen_frames_change_nothing() -> None:
    def with_unseen(example: Example, value: float) -> Example:
        values, valid = example.motion.values.copy(), example.valid.copy()
        values[60:90], valid[60:90] = value, False
        return replace(example, motion=replace(example.motion, values=values), valid=valid)

    _, one = both([with_unseen(each, 0.0) for each in anna()], ben())
    _, other = both([with_unseen(each, 9.0) for each in anna()], ben())
    stored = (speaker_maps.speakers_to_arrays(each).values() for each in (one, other))
    assert all(np.array_equal(array, same) for array, same in zip(*stored, strict=True))


def test_speakers_by_name_and_channels_in_another_order() -> None:
    mapped, maps = map_to_mean_person([*anna(), *ben(), *anna(3)], ["anna"] * 6 + ["ben"] * 6 + [""] * 3)
    assert len(mapped) == 15
    assert list(maps) == ["anna", "ben"]  # those without a name are one person more
    person = maps["ben"]
    np.testing.assert_allclose(person.reorder(person.channels[::-1]).gain, person.gain[::-1])
    with pytest.raises(InputError, match="'jaw'"):
        person.reorder((Channel("jaw"),))


def test_habits_are_what_is_left_in_each_viseme() -> None:
    examples, names = [*anna(), *ben()], ["anna"] * 6 + ["ben"] * 6
    mapped, maps = map_to_mean_person(examples, names)
    planted = np.zeros((len(speaker_maps.VISEME_NAMES), 3))
    planted[speaker_maps.VISEME_NAMES.index("lr1"), 1], planted[speaker_maps.VISEME_NAMES.index("al"), 2] = 0.1, -0.2
    generated = [each.motion.values.copy() for each in mapped]
    for each, values in zip(mapped[6:], generated[6:], strict=True):
        values[:] -= speaker_maps.weigh_viseme_classes(each.speech.units, len(values)) @ planted
    found = add_habits(maps, mapped, names, generated)
    np.testing.assert_allclose(found["anna"].habits, 0, atol=1e-12)
    habits = found["ben"].habits
    assert 0.05 < habits[speaker_maps.VISEME_NAMES.index("lr1"), 1] < 0.1
    assert -0.2 < habits[speaker_maps.VISEME_NAMES.index("al"), 2] < -0.05
    assert np.abs(habits[:, 0]).max() < 1e-12
    one = mapped[-1]
    visemes = speaker_maps.weigh_viseme_classes(one.speech.units, len(one.motion.values))
    shift = found["ben"].shift(one.motion.values, visemes)
    assert np.abs(shift).max() > 0.03
    assert np.abs(shift[restful(one) >= 1]).max() < 1e-12
    closed_lips = one.motion.values[:, 0] <= found["ben"].lips[0] + 1e-9  # rounding
    assert closed_lips.any()
    assert np.abs(shift[closed_lips]).max() < 1e-6


def test_maps_are_stored_and_damaged_ones_are_refused() -> None:
    maps = both(anna(3), ben(3))[1]
    arrays = speaker_maps.speakers_to_arrays(maps)
    again = speaker_maps.speakers_from_arrays(arrays)
    for array, same in zip(arrays.values(), speaker_maps.speakers_to_arrays(again).values(), strict=True):
        assert np.array_equal(array, same)
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
        with pytest.raises(ModelFormatError, match="table of speakers"):
            speaker_maps.speakers_from_arrays(arrays | {name: value})
    for name in ("channels", "names", "gain", "offset", "rest", "habits", "lips"):
        with pytest.raises(ModelFormatError, match=name):
            speaker_maps.speakers_from_arrays({other: array for other, array in arrays.items() if other != name})


def test_wrong_phones_of_one_clip_do_not_keep_the_lips_of_a_person_open() -> None:
    clip, labels = ben(3)[0], []
    for span in clip.speech.units:
        middle_s = 0.5 * (span.start_s + span.end_s)
        if span.label.phone == "aa":  # an m that was recognised where the mouth is open
            labels.append(Span(middle_s - 0.03, middle_s - 0.01, Unit("m")))
        else:
            labels.append(replace(span, label=Unit("t" if span.label.phone in ("p", "b", "m") else span.label.phone)))
    recognised = replace(clip, speech=replace(clip.speech, units=Timeline(tuple(labels))))
    assert closed([recognised]) > closed([clip]) + 0.02
    _, maps = both(anna(), [recognised])
    shut = np.full((1, 3), maps["ben"].lips[0])
    assert maps["ben"].to_person(shut, np.zeros(1))[0, 0] == pytest.approx(closed([clip]), abs=0.01)


def random_map(seed: int, habits: float = 0.0) -> speaker_maps.SpeakerMap:
    rng = np.random.default_rng(seed)
    channels = anna(1)[0].motion.channels
    gain, offset, rest = rng.uniform(0.5, 2, 3), rng.normal(size=3), rng.normal(size=3)
    return speaker_maps.SpeakerMap(channels, gain, offset, rest, habits * rng.normal(size=(13, 3)), (0.0, 0.1))


def test_motion_of_the_source_becomes_that_of_the_target() -> None:
    examples = anna()
    wanted = resting_open(examples)
    person = fit_transfer_map(examples, wanted)
    for mine, theirs in zip(examples, wanted, strict=True):
        mapped = person.to_person(mine.motion.values, restful(mine))
        before = np.abs(mine.motion.values - theirs.motion.values).mean(axis=0)
        assert (np.abs(mapped - theirs.motion.values).mean(axis=0) < 0.25 * before).all()


@pytest.mark.parametrize("count", [1, 6])
def test_the_rest_pose_counts_by_the_seconds_of_silence(count: int) -> None:
    """With S seconds the way from the map of speech to the target's rest pose counts S / (S + 0.5)."""
    examples = anna(count)
    wanted = resting_open(examples)
    person = fit_transfer_map(examples, wanted)
    silences = [restful(each) > 1 - 1e-9 for each in examples]
    silence_s = sum(map(np.count_nonzero, silences)) / 100
    for mine, theirs, silence in zip(examples, wanted, silences, strict=True):
        from_speech = person.offset + person.gain * np.median(mine.motion.values[silence], axis=0)
        way = np.median(theirs.motion.values[silence], axis=0) - from_speech
        np.testing.assert_allclose(person.rest, silence_s / (silence_s + REST_PRIOR_S) * way, atol=5e-3)
        assert np.abs(way).max() > 0.04


def test_closed_lips_stay_closed() -> None:
    examples = anna()
    person = fit_transfer_map(examples, resting_open(examples))
    for each in examples:
        mapped = changed(each, person.to_person(each.motion.values, restful(each)))
        np.testing.assert_allclose(least_openings(mapped), OFFSET[0], atol=0.01)


def test_gains_grow_with_the_seconds_of_speech() -> None:
    """With S seconds of speech the logarithm counts S / (S + 2)."""
    examples = anna()
    for count in (1, 6):
        some = examples[:count]
        person = fit_transfer_map(some, resting_open(some))
        trust = count_speech_s(some) / (count_speech_s(some) + RANGE_PRIOR_S)
        np.testing.assert_allclose(np.log(person.gain) / trust, np.log(GAIN), atol=0.05)


def test_gains_have_limits() -> None:
    examples = anna()
    wild = [replace(each, motion=replace(each.motion, values=12 * each.motion.values)) for each in examples]
    assert fit_transfer_map(examples, wild).gain.max() == pytest.approx(4.0)
    assert fit_transfer_map(wild, examples).gain.min() == pytest.approx(0.25)


def test_two_maps_one_after_the_other() -> None:
    rng = np.random.default_rng(3)
    values, rest, weights = rng.normal(size=(40, 3)), rng.uniform(size=40), rng.uniform(size=(40, 13))
    first, second = random_map(0, habits=0.1), random_map(1)
    both = compose_maps(first, second)
    shifted = values + first.shift(values, weights)
    wanted = second.to_person(first.to_person(shifted, rest), rest)
    np.testing.assert_allclose(both.to_person(values + both.shift(values, weights), rest), wanted, atol=1e-12)
    assert compose_maps(None, second) is second
