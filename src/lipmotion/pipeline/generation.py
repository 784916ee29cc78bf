"""Motion of understood speech: of one of several people, in this person's own units, and what to expect of it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.curve_edits import bend_through_pins, find_pinned_frame
from lipmotion.articulation.pauses import rest_in_pauses
from lipmotion.articulation.symmetry import make_symmetrical
from lipmotion.engines import Animator
from lipmotion.errors import InputError
from lipmotion.extensions import provided
from lipmotion.motion.closure import clip_at_zero, is_never_negative
from lipmotion.motion.generation import BLOCK_FRAMES, DOUBLE_FRAMES
from lipmotion.motion.speaker_maps import SpeakerMap, SpeakerMaps, measure_restfulness, weigh_visemes
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.pipeline.understand.read_request import lexicon_of
from lipmotion.pipeline.understand.spoken_language import confidence_of
from lipmotion.pipeline.understand.transcribe import is_other_language
from lipmotion.pipeline.understand.understood_speech import UnderstoodSpeech
from lipmotion.speech.recognition.agreement import LEAST_FITTING_SHARE
from lipmotion.speech.recognition.recognised_speech import NOISY_DB, joined_units, placed_units
from lipmotion.speech.recognition.recogniser import FULL_WEIGHT_SCORE, own_model_weight
from lipmotion.speech.voices.pronunciations import MAPPED_CONFIDENCE
from lipmotion.types import (
    FRAME_RATE_HZ,
    ChannelValue,
    Constraints,
    Explanation,
    Features,
    Generation,
    Outlook,
    Pin,
    ReducedVariance,
    Span,
    Speech,
    SpeechKnowledge,
    SpeechPart,
    StateTrace,
    Timeline,
    Unit,
    frame_of,
)
from lipmotion.types.generation import SURE_CONFIDENCE
from lipmotion.types.languages import ENGLISH
from lipmotion.units import SILENCE, group_words
from lipmotion.units.mood_tags import time_moods

ModelT = TypeVar("ModelT")
TRANSCRIPT = "the words that are spoken (--transcript)"
OWN_MODEL = "recordings of this person (lipmotion adapt for the sound alone, lipmotion train with video)"
WHOLE_TRANSCRIPT = "a transcript of all that is said, and of nothing else"
LESS_NOISE = "a recording with less noise"
RAMP_FRAMES = 12
"""Frames beside a passage in which the mouth comes from rest, or goes there; within it, where another one is near."""
NOWHERE_S = 1e6
"""Nothing that is detected or pinned lies so long before a recording."""
LONG_SILENCE_S = 10.0
"""A passage has silence before and after it; it counts as so much more."""
REST_FRAMES = 100
"""So much silence is animated to know the rest between passages."""
REACH_FRAMES = 10
"""Frames on both sides of a pin over which a value is reached that motion does not take by itself."""


def generation_of(
    request: Request,
    person: SpeakerMap | None,
    model: Model,
    understood: UnderstoodSpeech,
    constraints: Constraints | None = None,
) -> Generation:
    """Return the motion of understood speech, with pauses and asymmetry as asked for, and what to expect of it.

    person : of ``person_of``
    Raises InputError: a constraint is not usable.
    """

    def finish(generation: Generation, start_s: float) -> Generation:
        pinned_s = [pin.time_s - start_s for pin in constraints.pins] if constraints else []
        if request.onto is None:
            generation = replace(generation, motion=make_symmetrical(generation.motion, request.asymmetry))
        events = [event.shifted(-start_s) for event in understood.events]
        return rest_in_pauses(generation, request.pauses, pinned_s, events)

    paused = generate_for(person, model.engine, model.learned, understood.speech, constraints, finish)
    speech, fit = understood.speech, understood.fit
    fits = fit.of_frames(len(speech.features.values)) if fit else 1.0
    knowledge = SpeechKnowledge(speech.voice, float(np.mean(speech.confidence)), fits)
    moods = time_moods(understood.tags, speech.units)
    told = replace(paused, moods=moods, events=understood.events, about=model.about, knowledge=knowledge)
    return replace(told, outlook=outlook_of(request, understood))


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
    from lipmotion.motion.transfer_map import compose_maps

    onto = provided("map_onto")(
        model, request.onto, speaker=request.speaker, onto_speaker=request.onto_speaker, speech=request
    )
    return compose_maps(person, onto)


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
    restful = measure_restfulness(speech.units, len(speech.features.values))
    pins = constraints.pins if constraints is not None else ()
    mean = engine.generate(learned, speech, Constraints(tuple(_mean_pin(person, restful, pin) for pin in pins)))
    fitted = person.reorder(mean.motion.channels)
    visemes = weigh_visemes(speech.units, len(restful))
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
    fitted = person.reorder(channels)
    poses = np.array([[explanation.motion[channel.name].value for channel in channels]])
    shift = fitted.shift(poses, weigh_visemes(speech.units, frames)[frame])
    added = fitted.to_person(shift, measure_restfulness(speech.units, frames)[frame])[0]
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
    value = float(person.reorder([channel]).to_mean(np.array([[pin.value]]), restful[frame : frame + 1])[0, 0])
    return replace(pin, value=max(value, 0.0) if is_never_negative(channel) else value)


def _spread(
    spread: NDArray[np.floating[Any]] | ReducedVariance, factors: NDArray[np.float64]
) -> NDArray[np.floating[Any]] | ReducedVariance:
    """Return variances of the channels times a factor each."""
    if isinstance(spread, ReducedVariance):
        return replace(spread, mixing=(spread.mixing * factors).astype(spread.mixing.dtype))
    return spread * factors


def outlook_of(request: Request, understood: UnderstoodSpeech) -> Outlook:
    """Return what to expect of the motion of some speech."""
    found, speech = understood.recognition, understood.speech
    if understood.is_without_speech:
        return Outlook("no speech", 0.0, None, understood.range_db, ())
    if found is None:
        is_used = speech.units_known if understood.fit is None else not understood.fit.is_doubtful
        words = "given units" if request.units is not None else "transcript" if is_used else "own model"
        share = understood.fit.share if understood.fit else 1.0
        if words == "transcript" and (known := _known_share(request, understood)) < 1:
            words, share = "mapped transcript", share * known
        return Outlook(words, share, 1.0 if words == "own model" else None, understood.range_db, _advice(understood))
    words = "words" if found.word_s > found.phone_s else "phones"
    voice = own_model_weight(found.similarity) if found.similarity is not None else None
    return Outlook(words, confidence_of(found), voice, understood.range_db, _advice(understood))


def _known_share(request: Request, understood: UnderstoodSpeech) -> float:
    """Return how sure the phones of a transcript are, 0 to 1: 1 for English, less for what is mapped to English."""
    if request.language != ENGLISH:
        return MAPPED_CONFIDENCE
    said, lexicon = [span.label for span in group_words(understood.speech.units)], lexicon_of(request)
    words = [word for word in said if word]
    return sum(map(lexicon.known, words)) / len(words) if is_other_language(words, lexicon) else 1.0


def _advice(understood: UnderstoodSpeech) -> tuple[str, ...]:
    """Return what would help, the most helpful first: before all else the words, where they are not sure."""
    found, advice = understood.recognition, []
    if understood.fit is not None and understood.fit.share < LEAST_FITTING_SHARE:
        advice.append(WHOLE_TRANSCRIPT)
    if found is not None and confidence_of(found) < SURE_CONFIDENCE:
        advice.append(TRANSCRIPT)
    if understood.range_db < NOISY_DB:
        advice.append(LESS_NOISE)
    if found is not None and (found.similarity is None or found.similarity < FULL_WEIGHT_SCORE):
        advice.append(OWN_MODEL)
    return tuple(advice)


def generate_passages(
    generate: Callable[[Speech, Constraints], Generation],
    speech: Speech,
    pins: Sequence[Pin],
    finish: Callable[[Generation, float], Generation],
) -> Generation:
    """Return motion of which each passage (``Speech.parts``) is generated by itself.

    generate : returns the motion of the speech of one passage
    finish   : what else is done with that motion, whose time in the recording (s) is given; to it, silence at the ends
               of a passage is long
    Raises InputError: as ``generate``, with the time of the passage.
    """
    frames, parts = len(speech.features.values), speech.parts or ()
    rest = finish(generate(_silent_speech(speech), Constraints()), -NOWHERE_S)
    made = [_generate_passage(generate, part, speech.times_given, pins, finish) for part in parts]
    dtype = np.dtype(np.float32) if frames > DOUBLE_FRAMES else rest.motion.values.dtype
    values = _join_rows(parts, [each.motion.values for each in made], rest.motion.values, np.empty((frames, 0), dtype))
    values = np.require(values, None, "W")
    spread = _join_spread(parts, made, rest, np.empty((frames, 0), dtype))
    motion = replace(rest.motion, values=values)
    held = [(find_pinned_frame(pin, motion, is_weight=False), motion.column(pin.channel), pin.value) for pin in pins]
    bend_through_pins(values, held, REACH_FRAMES)  # those in silence; the others hold but for the way to rest
    clip_at_zero(motion)
    if held and isinstance(spread, ReducedVariance):
        spread = replace(spread, reduced=np.require(spread.reduced, None, "W"))
        for frame, column, _ in held:
            spread.reduced[frame, spread.mixing[:, column] > 0] = 0
    units, trace = _join_units(speech, parts, made, rest.units[0].label), _join_traces(parts, made, rest, frames)
    return replace(rest, motion=motion, spread=spread, units=units, trace=trace)


def _silent_speech(speech: Speech) -> Speech:
    """Return ``REST_FRAMES`` of silence, with everything that some speech has."""
    silent = Features(np.zeros((REST_FRAMES, speech.features.values.shape[1]), np.float32), REST_FRAMES / FRAME_RATE_HZ)
    said = speech.posteriors
    return Speech(
        silent,
        Timeline((Span(0.0, silent.duration_s, Unit(SILENCE)),)),
        None if speech.log_f0 is None else np.full(REST_FRAMES, np.nan, np.float32),
        spectrum=None if speech.spectrum is None else np.zeros((REST_FRAMES, speech.spectrum.shape[1]), np.float32),
        posteriors=None if said is None else replace(said, values=np.repeat(said.values[:1], REST_FRAMES // 2, axis=0)),
        encoding=None if speech.encoding is None else np.zeros((REST_FRAMES, speech.encoding.shape[1]), np.float16),
    )


def _generate_passage(
    generate: Callable[[Speech, Constraints], Generation],
    part: SpeechPart,
    times_given: bool,
    pins: Sequence[Pin],
    finish: Callable[[Generation, float], Generation],
) -> Generation:
    """Return the motion of a passage, with the pins that lie in it."""
    start_s = part.first / FRAME_RATE_HZ
    inside = [pin for pin in pins if part.inside.start <= round(pin.time_s * FRAME_RATE_HZ) < part.inside.stop]
    shifted = Constraints(tuple(replace(pin, time_s=pin.time_s - start_s) for pin in inside))
    try:
        generation = generate(replace(part.speech, times_given=times_given), shifted)
    except InputError as error:
        raise InputError(f"{error} (in the passage that begins at {start_s:.2f} s)") from error
    spans = list(generation.units)
    spans[0] = replace(spans[0], start_s=-LONG_SILENCE_S)
    spans[-1] = replace(spans[-1], end_s=spans[-1].end_s + LONG_SILENCE_S)
    return replace(finish(replace(generation, units=Timeline(tuple(spans))), start_s), units=generation.units)


def _join_rows(
    parts: Sequence[SpeechPart],
    rows: Sequence[NDArray[np.floating[Any]]],
    rest: NDArray[np.floating[Any]],
    like: NDArray[np.floating[Any]],
) -> NDArray[Any]:
    """Return the rows of all passages in their places; the mouth goes to rest and comes from it beside them.

    rows : of each passage [shape=(T', P)]
    rest : those of silence [shape=(REST_FRAMES, P)]
    like : as long as the result, of its type [shape=(T, 0)]
    Without passages all rows are one in memory, which may not be changed: silence may last for hours.
    """
    still = rest.mean(axis=0)
    if not parts:
        return np.broadcast_to(still.astype(like.dtype), (len(like), len(still)))
    whole = np.empty((len(like), len(still)), like.dtype)
    whole[:] = still
    ramp = (1 - np.cos(np.pi * np.arange(1, RAMP_FRAMES + 1) / (RAMP_FRAMES + 1))) / 2
    edges = [-NOWHERE_S, *(edge for part in parts for edge in (part.first, part.first + part.frames)), NOWHERE_S]
    rooms = [after - before >= 2 * RAMP_FRAMES for before, after in zip(edges[::2], edges[1::2], strict=True)]
    for part, inside, *is_room in zip(parts, rows, rooms, rooms[1:], strict=False):
        lead, tail = (RAMP_FRAMES if room else 0 for room in is_room)  # outside, where nobody else speaks there
        moved = np.pad(inside, ((lead, tail), (0, 0)), "edge") - still
        moved[:RAMP_FRAMES] *= ramp[:, None]
        moved[-RAMP_FRAMES:] *= ramp[::-1, None]
        start = part.first - lead
        first, end = max(start, 0), min(start + len(moved), len(like))
        whole[first:end] += moved[first - start : end - start]
    return whole


def _join_spread(
    parts: Sequence[SpeechPart], made: Sequence[Generation], rest: Generation, like: NDArray[np.floating[Any]]
) -> Any:
    """Return the variances of all passages in their places; they are kept reduced where those of the rest are."""
    if not isinstance(rest.spread, ReducedVariance):
        return _join_rows(parts, [each.variance for each in made], rest.variance, like)
    reduced = [each.spread.reduced for each in made if isinstance(each.spread, ReducedVariance)]
    return replace(rest.spread, reduced=_join_rows(parts, reduced, rest.spread.reduced, like))


def _join_traces(parts: Sequence[SpeechPart], made: Sequence[Generation], rest: Generation, frames: int) -> StateTrace:
    """Return the states of all passages in their places, and that of rest between them."""
    states = tuple(dict.fromkeys(state for each in (rest, *made) for state in each.trace.states))
    number = {state: n for n, state in enumerate(states)}
    trace = np.full(frames, number[rest.trace.states[rest.trace.frames[REST_FRAMES // 2]]], np.intp)
    for part, each in zip(parts, made, strict=True):
        named = np.array([number[state] for state in each.trace.states], np.intp)[each.trace.frames]
        start, stop = max(part.first, 0), min(part.first + part.frames, frames)
        trace[start:stop] = named[start - part.first : stop - part.first]
    return StateTrace(states, trace)


def _join_units(
    speech: Speech, parts: Sequence[SpeechPart], made: Sequence[Generation], silence: Unit
) -> Timeline[Unit]:
    """Return the phones of all passages, as the engine names them and places them in time, and silence between."""
    end_s = speech.units[-1].end_s if len(speech.units) else speech.features.duration_s
    placed = (placed_units(each.units, part.first, part.own) for part, each in zip(parts, made, strict=True))
    units = joined_units(placed, silence, end_s)
    pairs = [(part.speech.units, each.units) for part, each in zip(parts, made, strict=True)]
    if any([span.start_s for span in given] != [span.start_s for span in moved] for given, moved in pairs):
        return units
    starts_s = [span.start_s for span in units]  # the engine moved none: a phone over two passages stays one
    spans = []
    for span in speech.units:
        there = units[max(bisect_right(starts_s, (span.start_s + span.end_s) / 2) - 1, 0)].label
        spans.append(replace(span, label=replace(span.label, unit=there.unit)))
    return Timeline(tuple(spans))
