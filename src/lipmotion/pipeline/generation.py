"""Motion of analysed speech: of one of several people, in this person's own units, and what to expect of it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.articulation.contact import smooth_step
from lipmotion.articulation.lip_points import make_symmetrical
from lipmotion.articulation.rest import REST, rest_in_pauses
from lipmotion.engines import Animator
from lipmotion.errors import InputError
from lipmotion.extensions import load_provided
from lipmotion.motion.closure import clip_at_zero, is_never_negative
from lipmotion.motion.generation import BLOCK_FRAMES, DOUBLE_FRAMES, bend_through_pins, find_pinned_frame
from lipmotion.motion.network_steps import STEP
from lipmotion.motion.speaker_maps import SpeakerMap, SpeakerMaps, measure_restfulness, weigh_viseme_classes
from lipmotion.pipeline.analysis.language import weigh_words
from lipmotion.pipeline.analysis.read_request import read_lexicon
from lipmotion.pipeline.analysis.speech_analysis import SpeechAnalysis
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import Request
from lipmotion.speech.recognition.recognised_speech import NOISY_DB, join_units, place_units
from lipmotion.speech.recognition.recogniser import FULL_WEIGHT_SCORE, weigh_own_model
from lipmotion.types import (
    FRAME_RATE_HZ,
    ChannelValue,
    Constraints,
    Explanation,
    Features,
    Generation,
    Outlook,
    Pin,
    PriorOutput,
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
from lipmotion.units.spoken_text import time_moods

ModelT = TypeVar("ModelT")
TRANSCRIPT = "the words that are spoken (--transcript)"
OWN_MODEL = "recordings of this person (lipmotion adapt for the sound alone, lipmotion train with video)"
WHOLE_TRANSCRIPT = "a transcript of all that is said, and of nothing else"
LESS_NOISE = "a recording with less noise"
MAPPED_CONFIDENCE = 0.8
"""Most confidence in words of another language: their phones are the nearest ones of English, on which models are
trained. 0.80 of the phones of espeak-ng's sentences in nine languages are phones of English as well
(docs/results/languages.md)."""
RAMP_FRAMES = 12
"""Frames beside a passage in which the mouth comes from rest, or goes there; within it, where another one is near."""
NOWHERE_S = 1e6  # nothing that is detected or pinned lies so long before a recording
LONG_SILENCE_S = 10.0  # silence before and after a passage counts as so much longer
SETTLING_FRAMES = 100  # the same between rest poses, so slowly that nobody sees it
REST_FRAMES = 100  # so much silence is animated to know the rest between passages
REACH_FRAMES = 10  # frames on both sides of a pin over which a value is reached that motion does not take by itself


def generate_motion(
    request: Request,
    person: SpeakerMap | None,
    model: Model,
    analysis: SpeechAnalysis,
    constraints: Constraints | None = None,
) -> Generation:
    """Return the motion of analysed speech, with the pauses and asymmetry of the request, and its outlook.

    person : of ``find_person``
    Raises InputError: a constraint is not usable.
    """

    def finish(generation: Generation, start_s: float) -> Generation:
        pinned_s = [pin.time_s - start_s for pin in constraints.pins] if constraints else []
        if request.onto is None:
            generation = replace(generation, motion=make_symmetrical(generation.motion, request.asymmetry))
        events = [event.shifted(-start_s) for event in analysis.events]
        return rest_in_pauses(generation, request.pauses, pinned_s, events)

    speech, fit = analysis.speech, analysis.fit
    generation = generate_for(person, model.engine, model.learned, speech, constraints, finish, request.pauses == REST)
    fits = fit.of_frames(len(speech.features.values)) if fit else 1.0
    return replace(
        generation,
        moods=time_moods(analysis.tags, speech.units),
        events=analysis.events,
        about=model.about,
        knowledge=SpeechKnowledge(speech.voice, float(np.mean(speech.confidence)), fits),
        outlook=predict_outlook(request, analysis),
    )


def find_speaker_map(maps: SpeakerMaps | None, speaker: str) -> SpeakerMap | None:
    """Return the map of a speaker; None: of the mean person (no name), or the only one. Raises InputError: unknown."""
    if not speaker:
        return None
    if maps is None:
        raise InputError(f"the model tells no speakers apart, so that there is no {speaker!r}; leave the speaker out")
    if speaker not in maps:
        raise InputError(f"the model knows no speaker {speaker!r}, required one of: {', '.join(maps)}, or none")
    return maps[speaker]


def find_person(model: Model, request: Request) -> SpeakerMap | None:
    """Return the map of the motion that a model generates to that of the person of a request; None: it is not mapped.

    Raises as ``find_speaker_map`` and ``map_onto``.
    """
    person = find_speaker_map(model.speakers, request.speaker)
    if request.onto is None:
        if request.onto_speaker:
            name = request.onto_speaker
            raise InputError(f"onto the speaker {name!r}, but of what? give a corpus or a model (--onto), or no name")
        return person
    from lipmotion.motion.speaker_maps import compose_maps

    onto = load_provided("map_onto")(
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
    resting: bool = False,
) -> Generation:
    """Return the motion of one person; pins hold exactly, and closed lips stay closed.

    person      : from ``find_speaker_map``
    learned     : the engine's model of motion: the mean person's
    constraints : values that the motion must take, in this person's units
    finish, resting : as of ``generate_passages``
    Raises InputError: as the engine.
    Passages (``Speech.parts``) are animated by themselves; between them the mouth rests.
    """
    if speech.parts is not None:
        generate = partial(_generate_one, person, engine, learned)
        return generate_passages(generate, speech, constraints.pins if constraints else (), finish, resting)
    return finish(_generate_one(person, engine, learned, speech, constraints), 0.0)


def _generate_one(
    person: SpeakerMap | None,
    engine: Animator[ModelT],
    learned: ModelT,
    speech: Speech,
    constraints: Constraints | None,
) -> Generation:
    if person is None:
        return engine.generate(learned, speech, constraints)
    restful = measure_restfulness(speech.units, len(speech.features.values))
    pins = constraints.pins if constraints is not None else ()

    def to_mean_person(pin: Pin) -> Pin:
        """Return a pin in the mean person's units; one that is not possible as it is, for the engine to refuse."""
        frame = frame_of(pin.time_s, len(restful), FRAME_RATE_HZ)
        channel = next((channel for channel in person.channels if channel.name == pin.channel), None)
        if frame is None or channel is None or (is_never_negative(channel) and pin.value < 0):
            return pin
        value = float(person.reorder([channel]).to_mean(np.array([[pin.value]]), restful[frame : frame + 1])[0, 0])
        return replace(pin, value=max(value, 0.0) if is_never_negative(channel) else value)

    mean = engine.generate(learned, speech, Constraints(tuple(map(to_mean_person, pins))))
    fitted = person.reorder(mean.motion.channels)
    visemes = weigh_viseme_classes(speech.units, len(restful))
    values = np.empty_like(mean.motion.values)
    for start in range(0, len(values), BLOCK_FRAMES):
        block = slice(start, start + BLOCK_FRAMES)
        poses = mean.motion.values[block]
        values[block] = fitted.to_person(poses + fitted.shift(poses, visemes[block]), restful[block])
    motion = replace(mean.motion, values=values)
    places = [(frame_of(pin.time_s, len(values), FRAME_RATE_HZ), motion.column(pin.channel), pin.value) for pin in pins]
    bend_through_pins(
        values, [(frame, column, value) for frame, column, value in places if frame is not None], REACH_FRAMES
    )
    clip_at_zero(motion)
    factors, spread = np.square(fitted.gain), mean.spread
    if isinstance(spread, ReducedVariance):
        spread = replace(spread, mixing=(spread.mixing * factors).astype(spread.mixing.dtype))
    else:
        spread = spread * factors
    return replace(mean, motion=motion, spread=spread)


def map_explanation(person: SpeakerMap | None, explanation: Explanation, speech: Speech) -> Explanation:
    """Return an explanation of the mean person's motion with all channels in one person's units."""
    if person is None:
        return explanation
    frames, frame = len(speech.features.values), slice(explanation.frame, explanation.frame + 1)
    channels = tuple(channel for channel in person.channels if channel.name in explanation.motion)
    fitted = person.reorder(channels)
    poses = np.array([[explanation.motion[channel.name].value for channel in channels]])
    shift = fitted.shift(poses, weigh_viseme_classes(speech.units, frames)[frame])
    added = fitted.to_person(shift, measure_restfulness(speech.units, frames)[frame])[0]
    numbers = {channel.name: number for number, channel in enumerate(channels)}

    def map_values(values: Mapping[str, ChannelValue]) -> dict[str, ChannelValue]:
        result = {}
        for name, value in values.items():
            gain = float(fitted.gain[numbers[name]])
            result[name] = ChannelValue(float(added[numbers[name]]) + gain * value.value, gain * value.deviation)
        return result

    return replace(
        explanation,
        motion=map_values(explanation.motion),
        gaussians=tuple(replace(each, channels=map_values(each.channels)) for each in explanation.gaussians),
    )


def predict_outlook(request: Request, analysis: SpeechAnalysis) -> Outlook:
    """Return what to expect of the motion of some speech."""
    recognition, speech, fit = analysis.recognition, analysis.speech, analysis.fit
    similarity = recognition.similarity if recognition is not None else None
    needs = (  # the most helpful first: before all else the words, where they are not sure
        (WHOLE_TRANSCRIPT, fit is not None and fit.is_partial),
        (TRANSCRIPT, recognition is not None and weigh_words(recognition) < SURE_CONFIDENCE),
        (LESS_NOISE, speech.range_db < NOISY_DB),
        (OWN_MODEL, recognition is not None and (similarity is None or similarity < FULL_WEIGHT_SCORE)),
    )
    advice = tuple(what for what, is_needed in needs if is_needed)
    if analysis.is_without_speech:
        return Outlook("no speech", 0.0, None, speech.range_db, ())
    if recognition is not None:
        words = "words" if recognition.word_s > recognition.phone_s else "phones"
        voice = weigh_own_model(similarity) if similarity is not None else None
        return Outlook(words, weigh_words(recognition), voice, speech.range_db, advice)
    words = "given units" if request.units is not None else "transcript" if speech.units_known else "own model"
    share, known = fit.share if fit else 1.0, 1.0
    if words == "transcript" and request.language != ENGLISH:
        known = MAPPED_CONFIDENCE
    elif words == "transcript":
        from lipmotion.pipeline.analysis.transcribe import is_other_language

        lexicon, labels = read_lexicon(request), [span.label for span in group_words(speech.units) if span.label]
        known = sum(map(lexicon.known, labels)) / len(labels) if is_other_language(labels, lexicon) else 1.0
    if known < 1:
        words, share = "mapped transcript", share * known
    return Outlook(words, share, 1.0 if words == "own model" else None, speech.range_db, advice)


def generate_passages(
    generate: Callable[[Speech, Constraints], Generation],
    speech: Speech,
    pins: Sequence[Pin],
    finish: Callable[[Generation, float], Generation],
    resting: bool,
) -> Generation:
    """Return motion of which each passage (``Speech.parts``) is generated by itself.

    generate : returns the motion of the speech of one passage
    finish   : what else is done with that motion, whose time in the recording (s) is given; to it, silence at the ends
               of a passage is long
    resting  : whether motion finished so begins and ends at rest: that pose holds beside it
    Raises InputError: as ``generate``, with the time of the passage.
    """
    frames, parts = len(speech.features.values), speech.parts or ()
    still = np.zeros((REST_FRAMES, speech.features.values.shape[1]), np.float32)
    silence = Features(still, REST_FRAMES / FRAME_RATE_HZ)
    heard = speech.posteriors
    silent_speech = Speech(
        silence,
        Timeline((Span(0.0, silence.duration_s, Unit(SILENCE)),)),
        None if speech.log_f0 is None else np.full(REST_FRAMES, np.nan, np.float32),
        spectrum=None if speech.spectrum is None else np.zeros((REST_FRAMES, speech.spectrum.shape[1]), np.float32),
        posteriors=heard and replace(heard, values=np.repeat(heard.values[:1], REST_FRAMES // 2, axis=0)),
        encoding=None if speech.encoding is None else np.zeros((REST_FRAMES, speech.encoding.shape[1]), np.float16),
    )
    rest, made = finish(generate(silent_speech, Constraints()), -NOWHERE_S), list[Generation]()

    def generate_each() -> Iterator[NDArray[np.floating[Any]]]:
        """Yield the values of each passage: beside all of them together, they would take an hour's memory twice."""
        for part in parts:
            start_s = part.first / FRAME_RATE_HZ
            inside = [pin for pin in pins if part.inside.start <= round(pin.time_s * FRAME_RATE_HZ) < part.inside.stop]
            shifted = Constraints(tuple(replace(pin, time_s=pin.time_s - start_s) for pin in inside))
            try:
                generation = generate(replace(part.speech, times_given=speech.times_given), shifted)
            except InputError as error:
                raise InputError(f"{error} (in the passage that begins at {start_s:.2f} s)") from error
            spans = list(generation.units)
            spans[0] = replace(spans[0], start_s=-LONG_SILENCE_S)
            spans[-1] = replace(spans[-1], end_s=spans[-1].end_s + LONG_SILENCE_S)
            finished = finish(replace(generation, units=Timeline(tuple(spans))), start_s)
            none = replace(finished.motion, values=finished.motion.values[:0].copy())
            made.append(replace(finished, motion=none, units=generation.units))
            yield finished.motion.values

    like = np.empty((frames, 0), np.float32 if frames > DOUBLE_FRAMES else rest.motion.values.dtype)
    values = np.require(_join_rows(parts, generate_each(), rest.motion.values, like, resting), None, "W")
    spread: Any
    if isinstance(rest.spread, ReducedVariance):
        rows = [each.spread.reduced for each in made if isinstance(each.spread, ReducedVariance)]
        spread = replace(rest.spread, reduced=_join_rows(parts, rows, rest.spread.reduced, like, resting))
    else:
        spread = _join_rows(parts, [each.variance for each in made], rest.variance, like, resting)
    motion = replace(rest.motion, values=values)
    held = [(find_pinned_frame(pin, len(values)), motion.column(pin.channel), pin.value) for pin in pins]
    bend_through_pins(values, held, REACH_FRAMES)  # those in silence; the others hold but for the way to rest
    clip_at_zero(motion)
    if held and isinstance(spread, ReducedVariance):
        spread = replace(spread, reduced=np.require(spread.reduced, None, "W"))
        for frame, column, _ in held:
            spread.reduced[frame, spread.mixing[:, column] > 0] = 0
    states = tuple(dict.fromkeys(state for each in (rest, *made) for state in each.trace.states))
    number = {state: n for n, state in enumerate(states)}
    trace = np.full(frames, number[rest.trace.states[rest.trace.frames[REST_FRAMES // 2]]], np.intp)
    for part, each in zip(parts, made, strict=True):
        named = np.array([number[state] for state in each.trace.states], np.intp)[each.trace.frames]
        start, stop = max(part.first, 0), min(part.first + part.frames, frames)
        trace[start:stop] = named[start - part.first : stop - part.first]
    units = _join_units(speech, parts, made, rest.units[0].label)
    return replace(rest, motion=motion, spread=spread, units=units, trace=StateTrace(states, trace))


def _join_rows(
    parts: Sequence[SpeechPart],
    rows: Iterable[NDArray[np.floating[Any]]],
    rest: NDArray[np.floating[Any]],
    like: NDArray[np.floating[Any]],
    resting: bool,
) -> NDArray[Any]:
    """Return the rows of all passages in their places; the mouth goes to ``rest`` and comes from it beside them.

    resting : whether passages begin and end at rest, in poses that differ a little: the mouth goes slowly from one to
              the next, and to ``rest``; faster, it would twitch where nobody speaks
    Without passages all rows are one in memory, which may not be changed: silence may last for hours.
    """
    still = rest.mean(axis=0)
    if not parts:
        return np.broadcast_to(still.astype(like.dtype), (len(like), len(still)))
    joined = np.empty((len(like), len(still)), like.dtype)
    joined[:] = still

    def fade(gap: int) -> tuple[int, int, NDArray[np.float64]]:
        """Return how long two passages are shown in the gap between them, in frames, and how the second one rises."""
        frames = SETTLING_FRAMES if resting else RAMP_FRAMES
        shown = 2 * frames if gap >= 2 * frames else 0  # where nobody else speaks there
        if resting and not shown:  # one goes over into the other
            frames = max(abs(gap), 2 * RAMP_FRAMES)  # below 0: both are silent there
            shown = gap + frames
        return shown // 2, (shown + 1) // 2, smooth_step(np.arange(1, frames + 1) / (frames + 1))

    edges = [-NOWHERE_S, *(edge for part in parts for edge in (part.first, part.first + part.frames)), NOWHERE_S]
    fades = [fade(int(after - before)) for before, after in zip(edges[::2], edges[1::2], strict=True)]
    for part, inside, (_, lead, rise), (tail, _, fall) in zip(parts, rows, fades, fades[1:], strict=False):
        change = np.pad(inside, ((lead, tail), (0, 0)), "edge") - still
        change[: len(rise)] *= rise[: len(change), None]
        change[-len(fall) :] *= fall[::-1, None][-len(change) :]
        start = part.first - lead
        first, end = max(start, 0), min(start + len(change), len(like))
        joined[first:end] += change[first - start : end - start]
    return joined


def _join_units(
    speech: Speech, parts: Sequence[SpeechPart], made: Sequence[Generation], silence: Unit
) -> Timeline[Unit]:
    """Return the phones of all passages, as the engine names them and places them in time, and silence between."""
    end_s = speech.units[-1].end_s if len(speech.units) else speech.features.duration_s
    placed = (place_units(each.units, part.first, part.own) for part, each in zip(parts, made, strict=True))
    units = join_units(placed, silence, end_s)
    pairs = [(part.speech.units, each.units) for part, each in zip(parts, made, strict=True)]
    if any([span.start_s for span in before] != [span.start_s for span in after] for before, after in pairs):
        return units
    starts_s = [span.start_s for span in units]  # the engine moved none: a phone over two passages stays one
    spans = []
    for span in speech.units:
        there = units[max(bisect_right(starts_s, (span.start_s + span.end_s) / 2) - 1, 0)].label
        spans.append(replace(span, label=replace(span.label, unit=there.unit)))
    return Timeline(tuple(spans))


MARGIN_S = 2.5  # motion is computed so far before and after an edit; a second from an edit it hardly depends on it
GRID_S = 2.0
"""Excerpts begin and end at multiples of this, so that those of edits that are near to one another are the same."""
LONGEST_S = 40.0  # if edits lie further apart, the full motion is computed


@dataclass(frozen=True)
class Excerpt:
    """What has changed between two sets of edits of one recording.

    frames    : in which motion may differ
    unchanged : number of phones that are the same at the beginning, and at the end
    """

    frames: slice
    unchanged: tuple[int, int]

    def cut(self, units: Timeline[Unit], pins: Collection[Pin]) -> tuple[Timeline[Unit], Constraints]:
        """Return the phones in these frames, cut at the ends, and the pins; with times from the first of them."""
        first_s, last_s = self.frames.start / FRAME_RATE_HZ, (self.frames.stop - 1) / FRAME_RATE_HZ
        inside = [pin for pin in pins if first_s <= pin.time_s <= last_s]
        shifted = Constraints(tuple(replace(pin, time_s=pin.time_s - first_s) for pin in inside))
        return units.between(first_s, last_s), shifted


def find_excerpt(before: Timeline[Unit], after: Timeline[Unit], pins: Collection[Pin], frames: int) -> Excerpt | None:
    """Return the excerpt outside of which motion is the same; None: it is too long, outside, or nothing has changed.

    pins   : those before or after the edit, not both
    frames : of the recording at 100 Hz
    """
    shorter = min(len(before), len(after))
    first = next((n for n in range(shorter) if before[n] != after[n]), shorter)
    last = next((n for n in range(shorter - first) if before[-1 - n] != after[-1 - n]), shorter - first)
    changed = [*before.spans[first : len(before) - last], *after.spans[first : len(after) - last]]
    times_s = [time_s for span in changed for time_s in (span.start_s, span.end_s)] + [pin.time_s for pin in pins]
    if not times_s:
        return None
    start = GRID_S * math.floor(max(min(times_s) - MARGIN_S, 0) / GRID_S)
    end = GRID_S * math.ceil((max(times_s) + MARGIN_S) / GRID_S)
    if end - start > LONGEST_S or start * FRAME_RATE_HZ >= frames:
        return None
    return Excerpt(slice(round(start * FRAME_RATE_HZ), min(round(end * FRAME_RATE_HZ) + 1, frames)), (first, last))


def cut_speech(speech: Speech, frames: slice) -> Speech:
    """Return the speech of some frames alone, without phones; its first frame is a multiple of 4."""
    features = Features(speech.features.values[frames], (frames.stop - 1 - frames.start) / FRAME_RATE_HZ)
    steps, halves = (slice(frames.start // each, -(-frames.stop // each)) for each in (STEP, 2))
    posteriors, prior, confidence, parts = speech.posteriors, speech.prior, speech.confidence, None
    if prior is not None:
        prior = PriorOutput(prior.articulators[steps], prior.hidden[steps], prior.distortion[steps])
    if speech.parts is not None:
        parts = tuple(
            _cut_part(part, frames)
            for part in speech.parts
            if max(part.inside.start, frames.start) < min(part.inside.stop, frames.stop)
        )
    return Speech(
        features,
        Timeline(()),
        log_f0=None if speech.log_f0 is None else speech.log_f0[frames],
        units_known=speech.units_known,
        spectrum=None if speech.spectrum is None else speech.spectrum[frames],
        confidence=confidence[frames] if isinstance(confidence, np.ndarray) else confidence,
        prior=prior,
        voice=speech.voice,
        posteriors=None if posteriors is None else replace(posteriors, values=posteriors.values[halves]),
        encoding=None if speech.encoding is None else speech.encoding[frames],
        times_given=True,
        parts=parts,
    )


def _cut_part(part: SpeechPart, frames: slice) -> SpeechPart:
    first = max(frames.start - part.first, 0) // STEP * STEP
    inside = cut_speech(part.speech, slice(first, min(frames.stop - part.first, part.frames)))
    own = slice(max(part.own.start - frames.start, 0), min(part.own.stop, frames.stop) - frames.start)
    return SpeechPart(part.first + first - frames.start, own, inside)


def apply_excerpt(
    full: Generation, before: Generation, after: Generation, excerpt: Excerpt, units: Timeline[Unit]
) -> Generation:
    """Return motion with what an excerpt changes.

    full, before, after : the motion before the change; in the excerpt alone, before and after it
    What differs between excerpt and recording, as the mean pose at rest, is in both motions of the excerpt and cancels.
    Deviations and states stay as they were.
    """
    values, frames, (first, last) = full.motion.values.copy(), excerpt.frames, excerpt.unchanged
    changed = values[frames] + (after.motion.values - before.motion.values)
    clip_at_zero(replace(full.motion, values=changed))
    values[frames] = changed
    named = full.units.spans
    spans = (*named[:first], *units.spans[first : len(units) - last], *named[len(named) - last :])
    return replace(full, motion=replace(full.motion, values=values), units=Timeline(spans))
