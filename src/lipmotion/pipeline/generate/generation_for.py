"""Generation for one of several people: constraints in, motion out, in this person's own units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.curve_edits import bend_through_pins
from lipmotion.engines import Animator
from lipmotion.errors import InputError
from lipmotion.extensions import provided
from lipmotion.motion.closure import clip_at_zero, is_never_negative
from lipmotion.motion.generation import BLOCK_FRAMES
from lipmotion.motion.speaker_maps import SpeakerMap, SpeakerMaps, restfulness, viseme_weights
from lipmotion.pipeline.generate.passages import REACH_FRAMES, generate_passages
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.types import (
    FRAME_RATE_HZ,
    ChannelValue,
    Constraints,
    Explanation,
    Generation,
    Pin,
    ReducedVariance,
    Speech,
    frame_of,
)

ModelT = TypeVar("ModelT")


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


def person_of(model: Model, request: Request) -> SpeakerMap | None:
    """Return the map of the motion that a model generates to that of the person of a request; None: it is not mapped.

    Raises as ``speaker_map`` and ``map_onto``.
    """
    person = speaker_map(model.speakers, request.speaker)
    if request.onto is None:
        if request.onto_speaker:
            raise InputError(
                f"onto the speaker {request.onto_speaker!r}, but of what? give a corpus or a model (--onto), or leave "
                "the name out"
            )
        return person
    from lipmotion.motion.transfer_map import composed

    onto = provided("map_onto")(
        model, request.onto, speaker=request.speaker, onto_speaker=request.onto_speaker, speech=request
    )
    return composed(person, onto)


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
        generate = partial(_generate_one, person, engine, learned)
        return generate_passages(generate, speech, constraints.pins if constraints else (), finish)
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
    clip_at_zero(motion)
    return replace(mean, motion=motion, spread=_spread(mean.spread, np.square(fitted.gain)))


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
    if frame is None or channel is None or (is_never_negative(channel) and pin.value < 0):
        return pin
    value = float(person.ordered([channel]).to_mean(np.array([[pin.value]]), restful[frame : frame + 1])[0, 0])
    return replace(pin, value=max(value, 0.0) if is_never_negative(channel) else value)


def _spread(
    spread: NDArray[np.floating[Any]] | ReducedVariance, factors: NDArray[np.float64]
) -> NDArray[np.floating[Any]] | ReducedVariance:
    """Return variances of the channels times a factor each."""
    if isinstance(spread, ReducedVariance):
        return replace(spread, mixing=(spread.mixing * factors).astype(spread.mixing.dtype))
    return spread * factors
