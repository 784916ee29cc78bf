"""Maps from the motion of one person to that of another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.motion.closure import find_closable_ranges
from lipmotion.motion.speaker_maps import RANGE_PRIOR_S, SpeakerMap, measure_restfulness
from lipmotion.motion.transfer_map import REST_PRIOR_S, compose_maps, count_speech_s, fit_transfer_map, select_channels
from lipmotion.testing.toy import toy_motion, toy_sentences
from lipmotion.types import Channel, Example, Features, Motion, Span, Speech, Timeline, Unit

GAIN, OFFSET, PARTED = np.array([0.5, 1.4, 0.8]), np.array([0.03, -0.2, 0.1]), np.array([0.05, 0.0, 0.05])
"""How the target's opening, width and outer differ from the source's, and by how much the lips part at rest."""


def source(count: int = 6) -> list[Example]:
    examples = []
    for sentence in toy_sentences(max(count, 3))[:count]:
        motion = toy_motion(sentence.units, 100.0)
        frames = len(motion.values)
        speech = Speech(Features(np.zeros((frames, 39), np.float32), frames / 100), sentence.units)
        examples.append(Example(sentence.name, speech, motion, np.ones(frames, bool)))
    return examples


def restful(example: Example) -> np.ndarray:
    return measure_restfulness(example.speech.units, len(example.motion.values))


def target(examples: list[Example]) -> list[Example]:
    changed = [OFFSET + GAIN * each.motion.values + PARTED * restful(each)[:, None] for each in examples]
    return [
        replace(each, motion=replace(each.motion, values=values))
        for each, values in zip(examples, changed, strict=True)
    ]


def random_map(seed: int, habits: float = 0.0) -> SpeakerMap:
    rng = np.random.default_rng(seed)
    channels = source(1)[0].motion.channels
    gain, offset, rest = rng.uniform(0.5, 2, 3), rng.normal(size=3), rng.normal(size=3)
    return SpeakerMap(channels, gain, offset, rest, habits * rng.normal(size=(13, 3)), (0.0, 0.1))


def test_motion_of_the_source_becomes_that_of_the_target() -> None:
    examples = source()
    wanted = target(examples)
    person = fit_transfer_map(examples, wanted)
    for mine, theirs in zip(examples, wanted, strict=True):
        mapped = person.to_person(mine.motion.values, restful(mine))
        before = np.abs(mine.motion.values - theirs.motion.values).mean(axis=0)
        after = np.abs(mapped - theirs.motion.values).mean(axis=0)
        assert (after < 0.25 * before).all()


@pytest.mark.parametrize("count", [1, 6])
def test_the_rest_pose_counts_by_the_seconds_of_silence(count: int) -> None:
    """With S seconds the way from the map of speech to the target's rest pose counts S / (S + 0.5)."""
    examples = source(count)
    wanted = target(examples)
    person = fit_transfer_map(examples, wanted)
    silences = [restful(each) > 1 - 1e-9 for each in examples]
    silence_s = sum(map(np.count_nonzero, silences)) / 100
    for mine, theirs, silence in zip(examples, wanted, silences, strict=True):
        from_speech = person.offset + person.gain * np.median(mine.motion.values[silence], axis=0)
        way = np.median(theirs.motion.values[silence], axis=0) - from_speech
        np.testing.assert_allclose(person.rest, silence_s / (silence_s + REST_PRIOR_S) * way, atol=5e-3)
        assert np.abs(way).max() > 0.04


def test_closed_lips_stay_closed() -> None:
    examples = source()
    person = fit_transfer_map(examples, target(examples))
    for each in examples:
        mapped = person.to_person(each.motion.values, restful(each))
        for frames in find_closable_ranges(each.speech.units, len(mapped)):
            assert mapped[frames, 0].min() == pytest.approx(OFFSET[0], abs=0.01)


def test_gains_grow_with_the_seconds_of_speech() -> None:
    """With S seconds of speech the logarithm counts S / (S + 2)."""
    examples = source()
    for count in (1, 6):
        some = examples[:count]
        person = fit_transfer_map(some, target(some))
        trust = count_speech_s(some) / (count_speech_s(some) + RANGE_PRIOR_S)
        np.testing.assert_allclose(np.log(person.gain) / trust, np.log(GAIN), atol=0.05)


def test_gains_have_limits() -> None:
    examples = source()
    wild = [replace(each, motion=replace(each.motion, values=12 * each.motion.values)) for each in examples]
    assert fit_transfer_map(examples, wild).gain.max() == pytest.approx(4.0)
    assert fit_transfer_map(wild, examples).gain.min() == pytest.approx(0.25)


def test_frames_that_were_not_measured_do_not_matter() -> None:
    examples = source()
    wanted = target(examples)
    hidden = []
    for each in wanted:
        valid, values = each.valid.copy(), each.motion.values.copy()
        valid[20:40], values[20:40] = False, 1e3
        hidden.append(replace(each, valid=valid, motion=replace(each.motion, values=values)))
    mine = [replace(each, valid=other.valid) for each, other in zip(examples, hidden, strict=True)]
    left_out = fit_transfer_map(mine, hidden)
    np.testing.assert_allclose(left_out.gain, fit_transfer_map(examples, wanted).gain, rtol=0.2)
    assert np.abs(left_out.offset).max() < 1


def test_two_maps_one_after_the_other() -> None:
    rng = np.random.default_rng(3)
    values, rest, weights = rng.normal(size=(40, 3)), rng.uniform(size=40), rng.uniform(size=(40, 13))
    first, second = random_map(0, habits=0.1), random_map(1)
    both = compose_maps(first, second)
    shifted = values + first.shift(values, weights)
    wanted = second.to_person(first.to_person(shifted, rest), rest)
    np.testing.assert_allclose(both.to_person(values + both.shift(values, weights), rest), wanted, atol=1e-12)
    assert compose_maps(None, second) is second


def test_channels_in_the_order_of_a_model() -> None:
    motion = Motion(np.arange(6.0).reshape(2, 3), 100.0, tuple(map(Channel, ("a", "b", "c"))))
    assert select_channels(motion, (Channel("c"), Channel("a")), "x").values.tolist() == [[2.0, 0.0], [5.0, 3.0]]
    with pytest.raises(InputError, match=r"x: .*no channel 'jaw' in the unit 'weight'.*1 of 2 are missing.*lipmotion"):
        select_channels(motion, (Channel("a"), Channel("jaw", "weight")), "x")


def test_seconds_of_measured_speech() -> None:
    units = Timeline((Span(0.0, 0.5, Unit("sil")), Span(0.5, 1.0, Unit("aa")), Span(1.0, 2.0, Unit("sil"))))
    motion = Motion(np.zeros((200, 1)), 100.0, (Channel("opening"),))
    valid = np.ones(200, bool)
    valid[80:] = False
    example = Example("x", Speech(Features(np.zeros((200, 39), np.float32), 2.0), units), motion, valid)
    assert count_speech_s([example]) == pytest.approx(0.3, abs=0.011)
