"""Sessions: one recording whose motion is edited; what an edit does not change is not computed again.

A recording is analysed (words, phones in time), moved (motion from phones) and delivered (intensity, offsets).
Each stage is cached under the edits that it depends on.
"""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from functools import cached_property
from pathlib import Path
from threading import RLock
from typing import Any, TypeVar

from lipmotion.articulation.curve_edits import (
    MotionStretch,
    apply_curve_edits,
    apply_gain,
    apply_stretch,
    check_drawn,
    cut_locked_stretch,
    find_pinned_frame,
    hold_mouth,
)
from lipmotion.articulation.phone_targets import GESTURES, with_gestures
from lipmotion.errors import AlignmentError, InputError, shortened
from lipmotion.kernels.compiler import numba_works
from lipmotion.kernels.threads import one_thread
from lipmotion.motion.speaker_maps import SpeakerMap
from lipmotion.pipeline.edits import (
    CurveStep,
    Edits,
    LockStep,
    PhoneStep,
    Step,
    Text,
    UnlockStep,
    WordSaid,
    WordsSaid,
    WordsSaidSo,
    WordStep,
    locks,
    with_span,
)
from lipmotion.pipeline.excerpts import Excerpt, excerpt_of_change, speech_within, with_excerpt
from lipmotion.pipeline.generation import generation_of, person_of
from lipmotion.pipeline.model import Model, load_model, with_prior
from lipmotion.pipeline.request import Request, SpeechInput, request_of
from lipmotion.pipeline.understand.language import in_language
from lipmotion.pipeline.understand.read_request import lexicon_of, read_request
from lipmotion.pipeline.understand.understood_speech import (
    UnderstoodSpeech,
    aligned_within,
    audio_of,
    prepare_search,
    understood_speech,
    with_units,
)
from lipmotion.pipeline.workers import map_in_processes
from lipmotion.speech.features.analysed_audio import AnalysedAudio, analysed
from lipmotion.types import (
    WEIGHT,
    Constraints,
    CurveEdit,
    DrawnCurve,
    Gain,
    Generation,
    Hold,
    Monitor,
    Motion,
    Outlook,
    Pin,
    Progress,
    Span,
    Speech,
    Timeline,
    Unit,
    silent_monitor,
)
from lipmotion.units import Pronunciation, group_words, split_words

ResultT = TypeVar("ResultT")

UNDERSTANDING = 0.9
"""The share of the work that is recognition, in reports; the rest is the generation of motion."""
MODELLED = ("opening", "width", "outer")
"""Channels, beside weights, that models generate as they are, so that motion runs smoothly through their pins."""
LIP_POINT = re.compile(r"[xyz]_\d+")
LATE_S = 0.1
"""Seconds by which times of edits may lie after the end; editing programs round times."""
USUAL_CACHED, MIN_CACHED = 4, 2
"""Results of each stage that are cached: the last ones that were used; motion of many frames less often."""
MAX_CACHED = {"aligned": 1000, "locked": 1000}
"""Stages of which more is cached: the phones of words in edits, and locked stretches, each of which needs those before
it and is used again after every edit."""
MAX_CACHED_FRAMES = 60_000
"""Frames of motion that a stage holds together, as long as these are more than ``MIN_CACHED`` results."""
INTERACTIVE = 3
"""A session that generates motion for the third time will do so often: kernels are loaded that pay then."""
NO_EDITS = Edits()
MotionKey = tuple[tuple[Step, ...], tuple[Pin, ...]]
"""Edits of phones and words, and pins that the model takes: what the engine's motion depends on."""
UnitStep = PhoneStep | WordStep | LockStep | UnlockStep
"""Edits that change phones, or keep others from changing them."""


class Cache:
    """The last results of each stage of some work, by what they depend on."""

    def __init__(self) -> None:
        self._stages: dict[str, OrderedDict[Hashable, Any]] = {}

    def has(self, stage: str, key: Hashable) -> bool:
        """Return whether the result of a stage for a key is cached."""
        return key in self._stages.get(stage, ())

    def cached(self, stage: str, key: Hashable, make: Callable[[], ResultT]) -> ResultT:
        """Return the result of a stage for a key, made if it is not cached."""
        results = self._stages.setdefault(stage, OrderedDict())
        if key not in results:
            results[key] = make()
            while len(results) > MAX_CACHED.get(stage, USUAL_CACHED) or _is_heavy(results):
                results.popitem(last=False)
        results.move_to_end(key)
        result: ResultT = results[key]
        return result


def _is_heavy(results: OrderedDict[Hashable, Any]) -> bool:
    """Return whether results hold too much motion together."""
    frames = sum(len(each.motion.values) for each in results.values() if isinstance(each, Generation))
    return frames > MAX_CACHED_FRAMES and len(results) > MIN_CACHED


class Session:
    """One recording with one model: motion for any edits, of which only what they change is computed.

    speech    : as of ``animate``
    model     : from ``load_model``, or the path of a model file; None: the shipped model
    workers   : number of processes that recognise the words of a long recording
    monitor   : receives reports of the progress of the first motion
    meanwhile : is called while these processes work, where there are several
    curves    : names of further curves that outputs will have: controls of a rig, blendshapes of a character
    outlook   : what to expect of the motion, where it is known; None: it follows from the speech
    lasts_s   : duration of the recording that was edited, in seconds: another one is refused; None: not known
    audio     : the sound of the recording, where it has been read already; None: it is read when it is needed
    is_sketching : whether motion is that of ``sketching``
    A session may be used by several threads, one at a time; several sessions do not disturb one another.
    Raises InputError: the model knows no such speaker.  Raises ModelFormatError: as ``load_model``.

    >>> import lipmotion
    >>> session = lipmotion.Session("examples/welcome.flac")
    >>> closed = lipmotion.Edits().then("pin opening 0.02 at 0.5")
    >>> round(float(session.generated(closed).motion["opening"][50]), 6)
    0.02
    """

    def __init__(  # noqa: PLR0913
        self,
        speech: SpeechInput,
        *,
        model: Model | str | Path | None = None,
        workers: int = 1,
        monitor: Monitor = silent_monitor,
        meanwhile: Callable[[], None] | None = None,
        curves: Iterable[str] = (),
        outlook: Outlook | None = None,
        lasts_s: float | None = None,
        audio: AnalysedAudio | None = None,
    ) -> None:
        self.request: Request = in_language(read_request(request_of(speech), is_typed=False))
        self.model = model if isinstance(model, Model) else load_model(model or self.request.model)
        self._work = map_in_processes(workers, self._prepare)
        self._monitor, self._curves, self._outlook = monitor, frozenset(curves), outlook
        self._meanwhile = meanwhile
        self._lasts_s, self._motions, self._known_audio = lasts_s, 0, audio
        self._one_at_a_time = RLock()
        self._cache = Cache()
        self.is_sketching = False
        self._last: tuple[MotionKey, Generation] | None = None

    @contextmanager
    def sketching(self) -> Iterator[None]:
        """Within it, motion is the last one with what an edit changes around it, where that is not far.

        It is for long recordings, whose face then follows an edit at once; it differs a little from the motion that is
        made whole (docs/studio.md). Deviations, states and names of units stay those of before.
        """
        with self._one_at_a_time:
            before, self.is_sketching = self.is_sketching, True
            try:
                yield
            finally:
                self.is_sketching = before

    def units(self, edits: Edits = NO_EDITS) -> Timeline[Unit]:
        """Return the phones in time with the edits of words and phones.

        Raises InputError, AlignmentError: as ``animate``; or an edit is not possible.
        """
        with self._one_at_a_time, one_thread():
            return self._edited_units(edits.steps)

    def generated(self, edits: Edits = NO_EDITS) -> Generation:
        """Return the motion with all edits but the delivery; with none, that of ``animate``.

        Pins hold exactly: those of channels that the model generates bend the motion as it does, others bend their
        own curve. Pins and gains of curves that the motion has not, as ``jawOpen``, are in ``Generation.curve_edits``,
        and hold in every output that has the curve.
        Raises InputError, AlignmentError: as ``units``; or a pin is not possible.
        """
        with self._one_at_a_time, one_thread():
            return self._after(edits.steps)

    def delivered(self, edits: Edits = NO_EDITS) -> Generation:
        """Return the motion as files hold it: with its intensity, anticipation and offset (docs/controls.md)."""
        from lipmotion.pipeline.outputs.delivered import delivered  # curves, which ``animate`` needs not

        with self._one_at_a_time, one_thread():
            key = (edits.steps, self.is_sketching)
            return self._cache.cached("delivered", key, lambda: delivered(self.generated(edits), edits.delivery()))

    def understood(self, edits: Edits = NO_EDITS) -> UnderstoodSpeech:
        """Return the speech as input of the engine, with the phones of ``units``."""
        with self._one_at_a_time, one_thread():
            return self._edited_speech(edits.steps)

    def _prepare(self) -> None:
        """Prepare what comes next, while processes work on the recording."""
        prepare_search(self.request)
        if self._meanwhile is not None:
            self._meanwhile()

    @cached_property
    def _recording(self) -> UnderstoodSpeech:
        """The speech without edits."""
        self.speaker  # noqa: B018 # what is refused is refused before the long work
        request = self.request
        if self._lasts_s is not None and abs(self._audio.duration_s - self._lasts_s) > LATE_S:
            raise InputError(
                f"the recording lasts {self._audio.duration_s:.2f} s, the edited one {self._lasts_s:.2f} s: the "
                "edits are of another recording; make some of this one: lipmotion edit FILE --of RECORDING"
            )
        if self._lasts_s is not None or self._known_audio is not None:
            request = replace(request, recording=self._audio)
        return understood_speech(self.model, request, self._work, self._monitor)

    @cached_property
    def speaker(self) -> SpeakerMap | None:
        """The map onto the person whose motion is generated; None: the model knows one person."""
        return person_of(self.model, self.request)

    @cached_property
    def _audio(self) -> AnalysedAudio:
        return self._known_audio or analysed(audio_of(self.request))

    def _edited_units(self, steps: tuple[Step, ...]) -> Timeline[Unit]:
        """Return the phones in time after some edits; each edit sees those that the ones before it left."""
        ours = tuple(step for step in steps if isinstance(step, UnitStep))
        done = next((count for count in range(len(ours), 0, -1) if self._cache.has("units", ours[:count])), 0)
        units = self._cache.cached("units", ours[:done], lambda: self._recording.speech.units)
        for count in range(done + 1, len(ours) + 1):
            units = self._changed_units(units, ours[:count])
        return self._cache.cached("units", ours, lambda: units)

    def _changed_units(self, before: Timeline[Unit], ours: tuple[UnitStep, ...]) -> Timeline[Unit]:
        """Return phones in time after the last of some edits; ``before``: after the others."""
        step = ours[-1]
        if isinstance(step, LockStep | UnlockStep):
            return before
        after = step.applied(before) if isinstance(step, PhoneStep) else self._reworded(before, step)
        held = locks(ours).values()
        changed = {*before} ^ {*after} if held else ()
        for lock in held:
            if any(lock.covers(span.start_s, span.end_s) for span in changed):
                raise InputError(f"{str(step)!r} changes what is locked ({str(lock)!r}); take the lock out first")
        return after

    def _reworded(self, units: Timeline[Unit], step: WordStep) -> Timeline[Unit]:
        """Return phones in time with other words in the time of some, aligned with the sound there."""
        if isinstance(step, WordsSaid):
            start_s, end_s, said = step.start_s, min(step.end_s, units[-1].end_s), step.words
            where = f"{start_s:.2f} to {end_s:.2f} s"
        else:
            words = [span for span in group_words(units) if span.label]
            if not 1 <= step.number <= len(words):
                found = f"1 to {len(words)}" if words else "words: give a transcript, or edit phones"
                raise InputError(f"{str(step)!r}: there is no word {step.number}, required {found}")
            there = words[step.number - 1]
            start_s, end_s, said = there.start_s, there.end_s, Text(step.word)
            where = f"{start_s:.2f} to {end_s:.2f} s, where {there.label!r} was"
        own = tuple(own_pronunciations(step).items())
        try:
            spans = self._cache.cached(
                "aligned", (said, own, start_s, end_s), lambda: self._said(step, said, start_s, end_s)
            )
        except AlignmentError as error:
            raise InputError(
                f"{str(step)!r}: does not fit into {where} ({error}); make room with 'phone N ends TIME' first"
            ) from error
        return with_span(units, spans)

    def _said(self, step: WordStep, said: str, start_s: float, end_s: float) -> list[Span[Unit]]:
        """Return the phones in time of words that a step says. Raises AlignmentError: they do not fit in there."""
        request, pauses = self.request, isinstance(step, WordsSaid)
        if own := own_pronunciations(step):
            lexicon = lexicon_of(request)
            request = replace(request, lexicon=replace(lexicon, user=lexicon.user | own))
        return aligned_within(self.model, request, self._audio, said, start_s, end_s, pauses=pauses)

    def _edited_speech(self, steps: tuple[Step, ...]) -> UnderstoodSpeech:
        plain, units = self._recording, self._edited_units(steps)
        if units is plain.speech.units:
            return plain
        return self._cache.cached(
            "analysis", tuple(units), lambda: replace(plain, speech=self._spoken(plain.speech, units))
        )

    def _spoken(self, speech: Speech, units: Timeline[Unit]) -> Speech:
        spoken = with_prior(self.model.prior, with_units(speech, units))
        return replace(spoken, voice=speech.voice, times_given=True)

    def _with_locks(self, steps: tuple[Step, ...]) -> Generation:
        """Return the motion after some edits, with locked spans as they were when they were locked."""
        self._edited_units(steps)  # refuses phones that change what is locked
        generation = self._with_curves(tuple(step for step in steps if not isinstance(step, LockStep | UnlockStep)))
        for place, lock in locks(steps).items():
            for later in steps[place + 1 :]:
                if isinstance(later, CurveStep) and lock.holds(later.edit):
                    raise InputError(f"{str(later)!r} lies in what is locked ({str(lock)!r}); take the lock out first")
            generation = apply_stretch(generation, self._locked(steps[:place], lock, generation.motion.names))
        return generation

    def _locked(self, before: tuple[Step, ...], lock: LockStep, names: tuple[str, ...]) -> MotionStretch:
        """Return what a lock keeps: the motion after the edits before it, with the channels of these names."""

        def stretch() -> MotionStretch:
            generation = self._after(before)
            motion = with_gestures(generation.motion, generation.units, names)
            return cut_locked_stretch(generation.with_motion(motion), lock.start_s, lock.end_s)

        return self._cache.cached("locked", (before, lock, names, self.is_sketching), stretch)

    def _after(self, steps: tuple[Step, ...]) -> Generation:
        return self._cache.cached("edited", (steps, self.is_sketching), lambda: self._with_locks(steps))

    def _with_curves(self, steps: tuple[Step, ...]) -> Generation:
        """Return the motion after some edits without locks: the engine's, then gains and what bends single curves."""
        edits = [step.edit for step in steps if isinstance(step, CurveStep)]
        modelled = tuple(edit for edit in edits if isinstance(edit, Pin) and self._is_modelled(edit.channel, steps))
        generation = self._with_pins(self._phone_steps(steps), modelled)
        for edit in edits:
            if isinstance(edit, Gain) and not edit.channel:
                generation = apply_gain(generation, edit)
            elif isinstance(edit, Hold):
                generation = hold_mouth(generation, edit)
        curves = [edit for edit in edits if not isinstance(edit, Hold) and edit.channel and edit not in modelled]
        if any(not edit.channel for edit in edits):
            curves = [*modelled, *curves]  # a gain or a held pose has moved their values
        asked = [edit.channel for edit in curves if edit.channel in GESTURES]
        if asked:
            generation = generation.with_motion(with_gestures(generation.motion, generation.units, asked))
        motion = apply_curve_edits(generation.motion, generation.units, curves)
        others = tuple(edit for edit in curves if edit.channel not in motion.names)
        for edit in edits:
            self._check_edit(edit, motion)
        return replace(generation, motion=motion, curve_edits=others)

    def _check_edit(self, edit: CurveEdit | Hold, motion: Motion) -> None:
        """Raise InputError if an edit is of no curve that is known, or of no time of the recording."""
        from lipmotion.pipeline.outputs.curve_sets import KNOWN_CURVES, WEIGHTS  # they load characters

        known = (*motion.names, *GESTURES, *KNOWN_CURVES, *self._curves)
        if edit.channel and edit.channel not in known:
            what, lower = (
                {Pin: "pin", DrawnCurve: "draw"}.get(type(edit), "change"),
                {name.lower(): name for name in known},
            )
            near = get_close_matches(edit.channel.lower(), lower, 1)
            others = ", ".join(name for name in (*motion.names, *GESTURES) if not LIP_POINT.fullmatch(name))
            named = shortened(repr(edit.channel)) + (f" (is it {lower[near[0]]}?)" if near else "")
            raise InputError(
                f"cannot {what} {named}; channels that can be pinned: {others}; lip points, as y_14; curves, as "
                "jawOpen, viseme_PP, open_jaw"
            )
        last_s = (len(motion.values) - 1) / motion.rate_hz
        if isinstance(edit, Pin):
            find_pinned_frame(edit, motion, is_weight=edit.channel in WEIGHTS)
        elif not 0 <= edit.start_s <= edit.end_s <= last_s + LATE_S:
            kind = {DrawnCurve: "draw", Hold: "hold"}.get(type(edit), "gain")
            raise InputError(f"{kind} from {edit.start_s} to {edit.end_s} s, required times from 0 to {last_s:.2f} s")
        if isinstance(edit, DrawnCurve):
            check_drawn(edit, is_weight=edit.channel in WEIGHTS)

    def _phone_steps(self, steps: tuple[Step, ...]) -> tuple[Step, ...]:
        return tuple(step for step in steps if isinstance(step, PhoneStep | WordStep))

    def _is_modelled(self, channel: str, steps: tuple[Step, ...]) -> bool:
        """Return whether the model generates a channel as it is."""
        if channel in MODELLED:
            return True
        motion = self._with_pins(self._phone_steps(steps), ()).motion
        return channel in motion.names and motion.channels[motion.column(channel)].unit == WEIGHT

    def _with_pins(self, phone_steps: tuple[Step, ...], pins: tuple[Pin, ...]) -> Generation:
        key = (phone_steps, pins)
        if self.is_sketching and not self._cache.has("moved", key):
            sketch = self._cache.cached("sketch", key, lambda: self._sketch(phone_steps, pins))
            if sketch is not None:
                return sketch
        return self._cache.cached("moved", key, lambda: self._generation(phone_steps, pins))

    def _sketch(self, phone_steps: tuple[Step, ...], pins: tuple[Pin, ...]) -> Generation | None:
        """Return the last motion with what has changed since; None: it must be made whole."""
        if self._last is None:
            return None
        (steps_before, pins_before), full = self._last
        units = self._edited_units(steps_before), self._edited_units(phone_steps)
        excerpt = excerpt_of_change(*units, {*pins} ^ {*pins_before}, len(full.motion.values))
        if excerpt is None or len(units[0]) != len(full.units):
            return None
        try:
            parts = [self._of_excerpt(excerpt, *held) for held in zip(units, (pins_before, pins), strict=True)]
        except InputError:  # a pin that is refused: the whole says its time
            return None
        sketch = with_excerpt(full, parts[0], parts[1], excerpt, units[1])
        self._last = (phone_steps, pins), sketch
        return sketch

    def _of_excerpt(self, excerpt: Excerpt, units: Timeline[Unit], pins: tuple[Pin, ...]) -> Generation:
        """Return the motion in the frames of an excerpt alone. Raises InputError: a pin is refused."""
        place, phones = (excerpt.frames.start, excerpt.frames.stop), excerpt.within(units)
        constraints = excerpt.pinned(pins)

        def generation() -> Generation:
            part = self._cache.cached("segment", place, lambda: speech_within(self._recording, excerpt.frames))
            spoken = replace(part, speech=self._spoken(part.speech, phones))
            return generation_of(self.request, self.speaker, self.model, spoken, constraints)

        return self._cache.cached("excerpt", (place, phones, constraints), generation)

    def _generation(self, phone_steps: tuple[Step, ...], pins: tuple[Pin, ...]) -> Generation:
        understood = self._edited_speech(phone_steps)
        self._motions += 1
        if self._motions == INTERACTIVE:
            numba_works()
        self._monitor(Progress("moving the mouth", 0, 1, UNDERSTANDING))
        generation = generation_of(self.request, self.speaker, self.model, understood, Constraints(pins))
        self._monitor(Progress("moving the mouth", 1, 1, 1.0))
        if self._outlook is not None:
            generation = replace(generation, outlook=self._outlook)
        self._last = (phone_steps, pins), generation
        return generation


def own_pronunciations(step: Step) -> dict[str, tuple[Pronunciation, ...]]:
    """Return the pronunciations that an edit brings along, by word, as a lexicon holds them."""
    own = step.own if isinstance(step, WordSaid | WordsSaidSo) else {}
    return {word: (phones,) for given, phones in own.items() for word in split_words(given)}
