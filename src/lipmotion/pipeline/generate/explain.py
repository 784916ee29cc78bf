"""What determined frames of motion: ``explain(speech, at=…)``, ``state_runs(speech)``; their text and JSON."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from lipmotion.engines.base import explain_by_trace
from lipmotion.errors import InputError
from lipmotion.kernels.compiler import limit_threads
from lipmotion.pipeline.edits import Edits
from lipmotion.pipeline.generate.animate import animate
from lipmotion.pipeline.generation import map_explanation
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.request import SpeechInput, as_request
from lipmotion.pipeline.session import NO_EDITS, Session
from lipmotion.printable import printable
from lipmotion.types import FRAME_RATE_HZ, ChannelValue, Explanation, Generation, NamedProbability, SpeechPart, frame_of

LINE = 110  # width of the text of a row, without its name, and of a state in a list, in characters
SHOWN_CHANNELS = 6  # largest number of channels in a text; points are left out if there are other channels


def explain(
    speech: SpeechInput,
    *,
    at: float | Sequence[float],
    model: Model | str | Path | None = None,
    transcript: str | Path | None = None,
) -> tuple[Explanation, ...]:
    """Return what determined some frames of the motion that ``animate`` generates for the same speech.

    speech, transcript : as of ``animate``
    at    : one or several times, in seconds; the nearest 10 ms frame of each is explained
    model : from ``load_model``, or the path of a model file; None: the shipped model
    Raises InputError: a time lies outside the recording; else as ``animate``.
    Raises AlignmentError: the transcript cannot be aligned with the recording.

    >>> import lipmotion
    >>> first, second = lipmotion.explain("examples/welcome.flac", at=[0.0, 1.0])
    >>> first.state, second.frame
    ('rest', 100)
    """
    session = Session(as_request(speech, transcript), model=model)
    return explain_session(session, NO_EDITS, [at] if isinstance(at, int | float) else at)


@limit_threads()
def explain_session(session: Session, edits: Edits, times: Sequence[float]) -> tuple[Explanation, ...]:
    """Return what determined the frames nearest to some times, in seconds, of a session's motion with some edits.

    Of what pins, gains and locks change it says nothing: it is what the model did with the phones.
    Raises InputError: a time lies outside the recording; else as ``Session.generate``.
    """
    speech = session.analyse(edits).speech
    count = len(speech.features.values)
    places = [(time_s, frame_of(time_s, count, FRAME_RATE_HZ)) for time_s in times]
    for time_s, frame in places:
        if frame is None:
            raise InputError(f"{time_s} s lies outside the recording (0 to {(count - 1) / FRAME_RATE_HZ:.2f} s)")
    generation, explanations = session.generate(edits), []
    parts = speech.parts if speech.parts is not None else [SpeechPart(0, slice(0, count), speech)]
    for frame in (frame for _, frame in places if frame is not None):
        first, part = next(
            ((each.first, each.speech) for each in parts if each.own.start <= frame < each.own.stop),
            (frame + 1, speech),
        )
        by_engine = None
        if 0 <= frame - first < len(part.features.values):  # not in the silence between passages
            part = replace(part, times_given=speech.times_given)
            by_engine = session.model.engine.explain(session.model.learned, part, [frame - first])
        if by_engine is None:
            explanation = explain_by_trace(generation, frame)
        else:  # with the times of its passage
            explanation = map_explanation(session.speaker, by_engine[0], part)
            offset_s, span = first / FRAME_RATE_HZ, explanation.span
            if span is not None:
                span = replace(span, start_s=max(span.start_s + offset_s, 0.0), end_s=span.end_s + offset_s)
            explanation = replace(explanation, time_s=explanation.time_s + offset_s, frame=frame, span=span)
        if generation.confidence is not None:
            explanation = replace(explanation, confidence=float(generation.confidence[frame]))
        explanations.append(explanation)
    return tuple(explanations)


def write_document(explanation: Explanation) -> dict[str, Any]:
    """Return an explanation as an object of JSON (docs/explain.md)."""
    document = asdict(explanation)
    for written, chain in zip(document["chains"], explanation.chains, strict=True):
        if chain.lead:
            written["expected_lead"] = chain.expected_lead
    return document


def write_explanation(explanation: Explanation) -> str:
    """Return an explanation as lines of text for people to read."""
    rows = list(_rows(explanation))
    width = max(len(name) for name, _ in rows) + 2
    lines = [f"{explanation.time_s:.2f} s (frame {explanation.frame})"]
    for name, text in rows:
        first, *others = wrap(text, LINE, break_long_words=False, break_on_hyphens=False) or [""]
        lines += [f"  {name:{width}}{first}", *(f"  {'':{width}}{other}" for other in others)]
    return "\n".join(map(printable, lines))


def _rows(explanation: Explanation) -> Iterator[tuple[str, str]]:
    phone, span = "none", explanation.span
    if span is not None:
        word = f" in {span.label.word!r}" if span.label.word else ""
        times = f"{span.start_s:.2f} to {span.end_s:.2f} s"
        phone = f"{span.label.phone or 'not known'}{word}, {times}, modelled by {span.label.unit}"
    yield "phone", phone
    yield "state", explanation.state
    for number, chain in enumerate(explanation.chains):
        yield f"chain {number + 1}: {chain.name}", _list_probabilities(chain.states)
    if explanation.joint is not None and len(explanation.chains) > 1:
        yield "together", _list_probabilities([explanation.joint])
    for chain in explanation.chains:
        if chain.lead:
            shares = (
                f"{states:+d}: {share:.2f}" if states else f"0: {share:.2f}" for states, share in chain.lead.items()
            )
            side = f"states {'ahead of' if chain.expected_lead >= 0 else 'behind'} {explanation.chains[0].name}"
            yield "asynchrony", f"{chain.name} {abs(chain.expected_lead):.2f} {side}   ({'   '.join(shares)})"
    for gaussian in explanation.gaussians:
        which = f" number {gaussian.component} of {gaussian.components}" if gaussian.components > 1 else ""
        distance = f", {gaussian.distance:.2f} deviations away" if gaussian.distance is not None else ""
        text = f"{gaussian.density}{which}, responsible for {gaussian.responsibility:.2f}{distance}"
        yield f"Gaussian of {gaussian.stream}", text
        yield from _list_values(gaussian.channels)
    values = _list_values(explanation.motion)
    yield "generated", next(values)[1]
    yield from values
    if explanation.confidence is not None:
        yield "confidence", f"{explanation.confidence:.2f}"


def _list_probabilities(probabilities: Sequence[NamedProbability]) -> str:
    return "   ".join(f"{item.name} {item.probability:.2f}" for item in probabilities)


def _list_values(channels: Mapping[str, ChannelValue]) -> Iterator[tuple[str, str]]:
    names = [name for name in channels if name[:2] not in ("x_", "y_", "z_")] or list(channels)
    for start in range(0, min(len(names), SHOWN_CHANNELS), 3):
        shown = names[start : min(start + 3, SHOWN_CHANNELS)]
        text = "   ".join(f"{name} {channels[name].value:6.3f} ± {channels[name].deviation:.3f}" for name in shown)
        yield "", text
    if len(channels) > min(len(names), SHOWN_CHANNELS):
        yield "", f"and {len(channels) - min(len(names), SHOWN_CHANNELS)} more channels (--json has all)"


@dataclass(frozen=True)
class StateRun:
    """Consecutive frames of generated motion behind which stands one state of the model.

    start_s, end_s : seconds; the frames are centred at times from ``start_s`` (included) to ``end_s`` (excluded)
    phone, word    : of the frame in the middle of the run; empty: none, or not known
    state          : as in ``Generation.trace``; of the engine ``selection`` it names a recording and the times in it
    """

    start_s: float
    end_s: float
    phone: str
    word: str
    state: str


def state_runs(
    speech: SpeechInput, *, model: Model | str | Path | None = None, transcript: str | Path | None = None
) -> tuple[StateRun, ...]:
    """Return which state of the model stands behind every frame of the motion that ``animate`` generates.

    speech, model, transcript : as of ``animate``
    Returns the runs of frames with one state, in order and without gaps.
    Raises InputError, AlignmentError: as ``animate``.

    >>> import lipmotion
    >>> runs = lipmotion.state_runs("examples/welcome.flac")
    >>> runs[0].start_s, runs[0].state, runs[0].end_s == runs[1].start_s
    (0.0, 'rest', True)
    """
    return list_runs(animate(speech, model=model, transcript=transcript))


def list_runs(generation: Generation) -> tuple[StateRun, ...]:
    """Return the runs of frames with one state of generated motion."""
    frames, rate_hz, spans = generation.trace.frames, generation.motion.rate_hz, generation.units.spans
    starts_s, runs = [span.start_s for span in spans], []
    firsts = np.flatnonzero(np.diff(frames, prepend=-1)).tolist()
    for first, end in pairwise([*firsts, len(frames)]):
        place = bisect_right(starts_s, (first + end - 1) // 2 / rate_hz) - 1
        phone, word = (spans[place].label.phone, spans[place].label.word) if place >= 0 else ("", "")
        runs.append(StateRun(first / rate_hz, end / rate_hz, phone, word, generation.trace.states[frames[first]]))
    return tuple(runs)


def run_lines(runs: Sequence[StateRun], count: int) -> Iterator[str]:
    """Yield runs as lines of text for people to read, the first ``count`` of them, with a title."""
    shown = runs[: max(count, 0)]
    width = max([len("word"), *(len(printable(run.word)) for run in shown)])
    yield f"{'from':>8} {'to':>8}  phone  {'word':{width}}  state"
    for run in shown:
        state = run.state[:LINE] + "..." * (len(run.state) > LINE)
        yield f"{run.start_s:8.2f} {run.end_s:8.2f}  {run.phone:5}  {run.word:{width}}  {state}"
    if len(runs) > len(shown):
        yield f"and {len(runs) - len(shown)} more (--count N prints N, --json all)"
