"""Generation for one of several people: constraints in, motion out, in this person's own units."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.curve_edits import bend_through_pins, pinned_frame
from lipmotion.engines import Animator
from lipmotion.errors import InputError
from lipmotion.motion.closure import OPENING
from lipmotion.motion.generation import BLOCK_FRAMES, DOUBLE_FRAMES
from lipmotion.motion.speaker_maps import SpeakerMap, SpeakerMaps, restfulness, viseme_weights
from lipmotion.speech.recognition.recognised_speech import joined_units, placed_units
from lipmotion.types import (
    FRAME_RATE_HZ,
    WEIGHT,
    Channel,
    ChannelValue,
    Constraints,
    Explanation,
    Features,
    Generation,
    Pin,
    ReducedVariance,
    Span,
    Speech,
    SpeechPart,
    StateTrace,
    Timeline,
    Unit,
    frame_of,
)
from lipmotion.units import SILENCE

ModelT = TypeVar("ModelT")
RAMP_FRAMES = 12
"""Frames at both ends of a passage in which the mouth comes from rest, or goes there."""
NOWHERE_S = 1e6
"""Nothing that is detected or pinned lies so long before a recording."""
LONG_SILENCE_S = 10.0
"""A passage has silence before and after it; it counts as so much more."""
REST_FRAMES = 100
"""So much silence is animated to know the rest between passages."""
REACH_FRAMES = 10
"""Frames on both sides of a pin over which a value is reached that the mean person's mouth cannot take."""


def speaker_map(maps: SpeakerMaps | None, speaker: str) -> SpeakerMap | None:
    """Return the map of one speaker of a model; None for the mean person, or the only one.

    maps    : of the model (None: it was not trained on several people)
    speaker : their name; empty: the mean person
    Raises InputError: the model knows no such speaker.
    """
    if not speaker:
        return None
    if maps is None:
        raise InputError(
            f"the model tells no speakers apart, so that there is no {speaker!r}; leave the speaker out, or train on "
            "several people"
        )
    return maps.of(speaker)


def generate_for(
    person: SpeakerMap | None,
    engine: Animator[ModelT],
    learned: ModelT,
    speech: Speech,
    constraints: Constraints | None = None,
    finish: Callable[[Generation, float], Generation] = lambda generation, _: generation,
) -> Generation:
    """Return the motion of one person; pins hold exactly, and closed lips stay closed.

    person      : from ``speaker_map``
    learned     : the engine's model of motion: the mean person's
    constraints : values that the motion must take, in this person's units
    finish      : what else is done with the motion of each passage, whose time in the recording (s) is given
    Raises InputError: as the engine.
    Passages (``Speech.parts``) are animated by themselves; between them the mouth rests.
    """
    if speech.parts is not None:
        return _of_parts(partial(_generate_one, person, engine, learned), speech, constraints, finish)
    return finish(_generate_one(person, engine, learned, speech, constraints), 0.0)


def _generate_one(
    person: SpeakerMap | None,
    engine: Animator[ModelT],
    learned: ModelT,
    speech: Speech,
    constraints: Constraints | None,
) -> Generation:
    """Return the motion of one passage."""
    if person is None:
        return engine.generate(learned, speech, constraints)
    restful = restfulness(speech.units, len(speech.features.values))
    pins = constraints.pins if constraints is not None else ()
    mean = engine.generate(learned, speech, Constraints(tuple(_mean_pin(person, restful, pin) for pin in pins)))
    fitted = person.ordered(mean.motion.channels)
    visemes = viseme_weights(speech.units, len(restful))
    values = np.empty_like(mean.motion.values)
    for start in range(0, len(values), BLOCK_FRAMES):
        block = slice(start, start + BLOCK_FRAMES)
        poses = mean.motion.values[block]
        values[block] = fitted.to_person(poses + fitted.shift(poses, visemes[block]), restful[block])
    motion = replace(mean.motion, values=values)
    held = [(frame_of(pin.time_s, len(values), FRAME_RATE_HZ), motion.column(pin.channel), pin.value) for pin in pins]
    inside = [(frame, column, value) for frame, column, value in held if frame is not None]
    bend_through_pins(values, inside, REACH_FRAMES)
    bounded = [_is_never_negative(channel) for channel in motion.channels]
    values[:, bounded] = np.maximum(values[:, bounded], 0)
    return replace(mean, motion=motion, spread=_spread(mean.spread, np.square(fitted.gain)))


def _of_parts(
    generate: Callable[[Speech, Constraints], Generation],
    speech: Speech,
    constraints: Constraints | None,
    finish: Callable[[Generation, float], Generation],
) -> Generation:
    """Return motion of which each passage is generated by itself.

    generate : returns the motion of the speech of one passage
    finish   : as of ``generate_for``; to it, silence at the ends of a passage is long
    """
    parts, frames, said = speech.parts or (), len(speech.features.values), speech.posteriors
    pins = constraints.pins if constraints else ()
    silent = Features(np.zeros((REST_FRAMES, speech.features.values.shape[1]), np.float32), REST_FRAMES / FRAME_RATE_HZ)
    resting = Speech(
        silent,
        Timeline((Span(0.0, silent.duration_s, Unit(SILENCE)),)),
        None if speech.log_f0 is None else np.full(REST_FRAMES, np.nan, np.float32),
        spectrum=None if speech.spectrum is None else np.zeros((REST_FRAMES, speech.spectrum.shape[1]), np.float32),
        posteriors=None if said is None else replace(said, values=np.repeat(said.values[:1], REST_FRAMES // 2, axis=0)),
    )
    rest = finish(generate(resting, Constraints()), -NOWHERE_S)
    generations = []
    for part in parts:
        start_s = part.first / FRAME_RATE_HZ
        inside = [pin for pin in pins if part.own.start <= round(pin.time_s * FRAME_RATE_HZ) < part.own.stop]
        inside = [pin for pin in inside if 0 <= round((pin.time_s - start_s) * FRAME_RATE_HZ) < part.frames]
        shifted = Constraints(tuple(replace(pin, time_s=pin.time_s - start_s) for pin in inside))
        try:
            generation = generate(replace(part.speech, times_given=speech.times_given), shifted)
        except InputError as error:
            raise InputError(f"{error} (in the passage that begins at {start_s:.2f} s)") from error
        first, *others = generation.units
        units = generation.units
        apart = Timeline((replace(first, start_s=-LONG_SILENCE_S), *others))
        last = apart[-1]
        apart = Timeline((*apart.spans[:-1], replace(last, end_s=last.end_s + LONG_SILENCE_S)))
        generations.append(replace(finish(replace(generation, units=apart), start_s), units=units))
    dtype = np.float32 if frames > DOUBLE_FRAMES else rest.motion.values.dtype
    values = _joined(
        parts, [each.motion.values for each in generations], rest.motion.values.mean(axis=0), frames, dtype
    )
    if isinstance(rest.spread, ReducedVariance):
        reduced = [each.spread.reduced for each in generations if isinstance(each.spread, ReducedVariance)]
        spread: Any = replace(
            rest.spread, reduced=_joined(parts, reduced, rest.spread.reduced.mean(axis=0), frames, dtype)
        )
    else:
        spread = _joined(parts, [each.variance for each in generations], rest.variance.mean(axis=0), frames, dtype)
    states = tuple(dict.fromkeys(state for each in (rest, *generations) for state in each.trace.states))
    number = {state: n for n, state in enumerate(states)}
    trace = np.full(frames, number[rest.trace.states[rest.trace.frames[REST_FRAMES // 2]]], np.intp)
    for part, each in zip(parts, generations, strict=True):
        named = np.array([number[state] for state in each.trace.states], np.intp)[each.trace.frames]
        start, stop = max(part.first, 0), min(part.first + part.frames, frames)
        trace[start:stop] = named[start - part.first : stop - part.first]
    motion = replace(rest.motion, values=values)
    held = [(pinned_frame(pin, motion, is_weight=False), motion.column(pin.channel), pin.value) for pin in pins]
    bend_through_pins(values, held, REACH_FRAMES)  # those in silence; the others hold but for the way to rest
    bounded = [_is_never_negative(channel) for channel in motion.channels]
    values[:, bounded] = np.maximum(values[:, bounded], 0)
    if not isinstance(spread, ReducedVariance):
        for frame, column, _ in held:
            spread[frame, column] = 0
    end_s = speech.units[-1].end_s if len(speech.units) else speech.features.duration_s
    placed = (placed_units(each.units, part.first, part.own) for part, each in zip(parts, generations, strict=True))
    units = joined_units(placed, rest.units[0].label, end_s)
    pairs = ((part.speech.units, each.units) for part, each in zip(parts, generations, strict=True))
    if all([s.start_s for s in given] == [s.start_s for s in made] for given, made in pairs):
        units = _with_names(speech.units, units)  # the engine moved none: a phone over two passages stays one
    return replace(rest, motion=motion, spread=spread, units=units, trace=StateTrace(states, trace))


def _with_names(units: Timeline[Unit], named: Timeline[Unit]) -> Timeline[Unit]:
    """Return phones in time with the names of the engine's units that stand there."""
    starts_s = [span.start_s for span in named]
    spans = []
    for span in units:
        there = named[max(bisect_right(starts_s, (span.start_s + span.end_s) / 2) - 1, 0)].label
        spans.append(replace(span, label=replace(span.label, unit=there.unit)))
    return Timeline(tuple(spans))


def _joined(
    parts: Sequence[SpeechPart],
    rows: Sequence[NDArray[np.floating[Any]]],
    still: NDArray[np.floating[Any]],
    frames: int,
    dtype: Any,
) -> NDArray[Any]:
    """Return the rows of all passages in their places; the mouth goes to rest and comes from it beside them.

    rows  : of each passage [shape=(T', P)]
    still : the row of silence [shape=(P,)]
    """
    whole = np.tile(still, (frames, 1)).astype(dtype)
    ramp = (1 - np.cos(np.pi * np.arange(1, RAMP_FRAMES + 1) / (RAMP_FRAMES + 1))) / 2
    for part, inside in zip(parts, rows, strict=True):
        share = np.ones(part.frames)
        share[:RAMP_FRAMES], share[part.frames - RAMP_FRAMES :] = ramp, ramp[::-1]
        first, end = max(part.first, 0), min(part.first + part.frames, frames)
        chosen = slice(first - part.first, end - part.first)
        whole[first:end] += share[chosen, None] * (inside[chosen] - still)
    return whole


def explanation_for(person: SpeakerMap | None, explanation: Explanation, speech: Speech) -> Explanation:
    """Return an explanation of the mean person's motion with all channels in one person's units.

    person : from ``speaker_map``
    """
    if person is None:
        return explanation
    frames, frame = len(speech.features.values), slice(explanation.frame, explanation.frame + 1)
    channels = tuple(channel for channel in person.channels if channel.name in explanation.motion)
    fitted = person.ordered(channels)
    poses = np.array([[explanation.motion[channel.name].value for channel in channels]])
    shift = fitted.shift(poses, viseme_weights(speech.units, frames)[frame])
    added = fitted.to_person(shift, restfulness(speech.units, frames)[frame])[0]
    numbers = {channel.name: number for number, channel in enumerate(channels)}

    def mapped(values: Mapping[str, ChannelValue]) -> dict[str, ChannelValue]:
        return {name: _value(fitted, added, numbers[name], value) for name, value in values.items()}

    return replace(
        explanation,
        motion=mapped(explanation.motion),
        gaussians=tuple(replace(each, channels=mapped(each.channels)) for each in explanation.gaussians),
        regressions=tuple(replace(each, channels=mapped(each.channels)) for each in explanation.regressions),
    )


def _value(person: SpeakerMap, added: NDArray[np.float64], number: int, mean: ChannelValue) -> ChannelValue:
    gain = float(person.gain[number])
    return ChannelValue(float(added[number]) + gain * mean.value, gain * mean.deviation)


def _mean_pin(person: SpeakerMap, restful: NDArray[np.float64], pin: Pin) -> Pin:
    """Return a pin in the mean person's units; one that is not possible as it is, for the engine to refuse."""
    frame = frame_of(pin.time_s, len(restful), FRAME_RATE_HZ)
    channel = next((channel for channel in person.channels if channel.name == pin.channel), None)
    if frame is None or channel is None or (_is_never_negative(channel) and pin.value < 0):
        return pin
    value = float(person.ordered([channel]).to_mean(np.array([[pin.value]]), restful[frame : frame + 1])[0, 0])
    return replace(pin, value=max(value, 0.0) if _is_never_negative(channel) else value)


def _is_never_negative(channel: Channel) -> bool:
    return channel.name == OPENING or channel.unit == WEIGHT


def _spread(
    spread: NDArray[np.floating[Any]] | ReducedVariance, factors: NDArray[np.float64]
) -> NDArray[np.floating[Any]] | ReducedVariance:
    """Return variances of the channels times a factor each."""
    if isinstance(spread, ReducedVariance):
        return replace(spread, mixing=(spread.mixing * factors).astype(spread.mixing.dtype))
    return spread * factors
