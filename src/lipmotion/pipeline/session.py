"""Sessions: one recording whose motion is edited; what an edit does not change is not computed again.

A recording is analysed (words, phones in time), animated (motion from phones) and delivered (intensity, offsets).
Each stage is cached under the edits that it depends on.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeVar

from lipmotion.errors import AlignmentError, InputError
from lipmotion.kernels.compiler import limit_threads, numba_works
from lipmotion.motion.speaker_maps import SpeakerMap
from lipmotion.pipeline.analysis.language import resolve_language
from lipmotion.pipeline.analysis.read_request import read_lexicon, read_recording, read_request
from lipmotion.pipeline.analysis.speech_analysis import (
    LATE_S,
    SpeechAnalysis,
    align_between,
    analyse_speech,
    prepare_search,
    with_units,
)
from lipmotion.pipeline.edits import (
    CurveStep,
    Edits,
    LockStep,
    PhoneStep,
    Step,
    Text,
    UnlockStep,
    WordsSaid,
    WordStep,
    find_locks,
    remove_pins,
    with_span,
)
from lipmotion.pipeline.generation import apply_excerpt, cut_speech, find_excerpt, find_person, generate_motion
from lipmotion.pipeline.model import Model, load_model, with_prior
from lipmotion.pipeline.request import Request, SpeechInput, as_request
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.types import (
    WEIGHT,
    Constraints,
    Gain,
    Generation,
    Hold,
    Monitor,
    Outlook,
    ParallelMap,
    Pin,
    Progress,
    Span,
    Speech,
    Timeline,
    Unit,
    silent_monitor,
)
from lipmotion.types.edits import Locked
from lipmotion.units import group_words

if TYPE_CHECKING:
    from lipmotion.articulation.curve_edits import MotionStretch

ResultT = TypeVar("ResultT")

ANALYSIS = 0.9  # the share of the work that is recognition, in reports; the rest is the generation of motion
MODELLED = ("opening", "width", "outer")
"""Channels, beside weights, that models generate as they are, so that motion runs smoothly through their pins."""
USUAL_CACHED, MIN_CACHED = 4, 2
"""Results of each stage that are cached: the last ones that were used; motion of many frames less often."""
MAX_CACHED = {"aligned": 1000, "locked": 1000}
"""Stages of which more is cached: the phones of words in edits, and locked stretches, each of which needs those before
it and is used again after every edit."""
MAX_CACHED_FRAMES = 60_000
"""Frames of motion that a stage holds together, as long as these are more than ``MIN_CACHED`` results."""
INTERACTIVE = 3  # a session that generates motion for the third time will do so often: kernels are loaded that pay then
NO_EDITS = Edits()
MotionKey = tuple[tuple[Step, ...], tuple[Pin, ...]]
"""Edits of phones and words, and pins that the model takes: what the engine's motion depends on."""
UnitStep = PhoneStep | WordStep | LockStep | UnlockStep  # edits that change phones, or keep others from changing them


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
            while len(results) > MAX_CACHED.get(stage, USUAL_CACHED) or (
                len(results) > MIN_CACHED
                and sum(len(each.motion.values) for each in results.values() if isinstance(each, Generation))
                > MAX_CACHED_FRAMES
            ):
                results.popitem(last=False)
        results.move_to_end(key)
        result: ResultT = results[key]
        return result


class Session:
    """One recording with one model: motion for any edits, of which only what they change is computed.

    speech    : as of ``animate``
    model     : from ``load_model``, or the path of a model file; None: the shipped model
    workers   : number of processes that recognise the words of a long recording
    monitor   : receives reports of the progress of the first motion
    background : is called while these processes work, where there are several
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
    >>> round(float(session.generate(closed).motion["opening"][50]), 6)
    0.02
    """

    def __init__(  # noqa: PLR0913
        self,
        speech: SpeechInput,
        *,
        model: Model | str | Path | None = None,
        workers: int = 1,
        monitor: Monitor = silent_monitor,
        background: Callable[[], None] | None = None,
        curves: Iterable[str] = (),
        outlook: Outlook | None = None,
        lasts_s: float | None = None,
        audio: AnalysedAudio | None = None,
    ) -> None:
        self.request: Request = resolve_language(read_request(as_request(speech), is_typed=False))
        self.model = load_model(model or self.request.model)
        request = self.request

        def prepare() -> None:  # not of this object, which would keep itself until the garbage is collected
            prepare_search(request)
            if background is not None:
                background()

        self._work: ParallelMap = map
        if workers != 1:
            from lipmotion.pipeline.workers import map_in_processes

            self._work = map_in_processes(workers, prepare)
        self._monitor, self._curves, self._outlook = monitor, frozenset(curves), outlook
        self._lasts_s, self._motions, self._known_audio = lasts_s, 0, audio
        self._one_at_a_time = RLock()
        self._cache = Cache()
        self.is_sketching = False
        self._last: tuple[MotionKey, Generation] | None = None

    @contextmanager
    def sketching(self) -> Iterator[None]:
        """Compute only what an edit changes, inside the block; the rest is the last motion.

        So the face follows an edit of a long recording at once; it differs a little from the full motion
        (docs/studio.md). Deviations, states and names of units stay as they were.
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
        with self._one_at_a_time, limit_threads():
            return self._edited_units(edits.steps)

    def generate(self, edits: Edits = NO_EDITS) -> Generation:
        """Return the motion with all edits but the delivery; with none, that of ``animate``.

        Pins hold exactly: those of channels that the model generates bend the motion as it does, others bend their
        own curve. Pins and gains of curves that the motion has not, as ``jawOpen``, are in ``Generation.curve_edits``,
        and hold in every output that has the curve.
        Raises InputError, AlignmentError: as ``units``; or a pin is not possible.
        """
        with self._one_at_a_time, limit_threads():
            return self._after(edits.steps)

    def deliver(self, edits: Edits = NO_EDITS) -> Generation:
        """Return the motion as files hold it: with its intensity, anticipation and offset (docs/controls.md)."""
        from lipmotion.pipeline.outputs.deliver import deliver  # curves, which ``animate`` needs not

        with self._one_at_a_time, limit_threads():
            key = (edits.steps, self.is_sketching)
            return self._cache.cached("delivered", key, lambda: deliver(self.generate(edits), edits.delivery()))

    def analyse(self, edits: Edits = NO_EDITS) -> SpeechAnalysis:
        """Return the speech as input of the engine, with the phones of ``units``."""
        with self._one_at_a_time, limit_threads():
            return self._edited_speech(edits.steps)

    @cached_property
    def _recording(self) -> SpeechAnalysis:
        self.speaker  # noqa: B018 # what is refused is refused before the long work
        request = self.request
        if self._lasts_s is not None and abs(self._audio.duration_s - self._lasts_s) > LATE_S:
            lasts = f"the recording lasts {self._audio.duration_s:.2f} s, the edited one {self._lasts_s:.2f} s"
            raise InputError(f"{lasts}: edits of another recording; begin anew: lipmotion edit FILE --of RECORDING")
        if self._lasts_s is not None or self._known_audio is not None:
            request = replace(request, recording=self._audio)
        return analyse_speech(self.model, request, self._work, self._monitor)

    @cached_property
    def speaker(self) -> SpeakerMap | None:
        """The map to the person whose motion is generated; None: the model knows one person."""
        return find_person(self.model, self.request)

    @cached_property
    def _audio(self) -> AnalysedAudio:
        return self._known_audio or analysed(read_recording(self.request))

    def _edited_units(self, steps: tuple[Step, ...]) -> Timeline[Unit]:
        """Return the phones in time after some edits; each edit sees those that the ones before it left."""
        ours = tuple(step for step in steps if isinstance(step, UnitStep))
        done = next((count for count in range(len(ours), 0, -1) if self._cache.has("units", ours[:count])), 0)
        units = self._cache.cached("units", ours[:done], lambda: self._recording.speech.units)
        for count, step in enumerate(ours[done:], start=done + 1):
            if isinstance(step, LockStep | UnlockStep):
                continue
            before = units
            units = step.apply(before) if isinstance(step, PhoneStep) else self._replace_words(before, step)
            held = find_locks(ours[:count]).values()
            changed = {*before} ^ {*units} if held else ()
            for lock in held:
                if any(lock.covers(span.start_s, span.end_s) for span in changed):
                    raise InputError(f"{str(step)!r} changes what is locked ({str(lock)!r}); take the lock out first")
        return self._cache.cached("units", ours, lambda: units)

    def _replace_words(self, units: Timeline[Unit], step: WordStep) -> Timeline[Unit]:
        """Return phones in time with other words in the time of some, aligned with the sound there."""
        if isinstance(step, WordsSaid):
            start_s, end_s, text = step.start_s, min(step.end_s, units[-1].end_s), step.words
            where = f"{start_s:.2f} to {end_s:.2f} s"
        else:
            words = [span for span in group_words(units) if span.label]
            if not 1 <= step.number <= len(words):
                required = f"1 to {len(words)}" if words else "words: give a transcript, or edit phones"
                raise InputError(f"{str(step)!r}: there is no word {step.number}, required {required}")
            there = words[step.number - 1]
            start_s, end_s, text = there.start_s, there.end_s, Text(step.word)
            where = f"{start_s:.2f} to {end_s:.2f} s, where {there.label!r} was"
        pronunciations = step.lexicon_entries

        def align() -> list[Span[Unit]]:
            request = self.request
            if pronunciations:
                lexicon = read_lexicon(request)
                request = replace(request, lexicon=replace(lexicon, user=lexicon.user | pronunciations))
            pauses = isinstance(step, WordsSaid)
            return align_between(self.model, request, self._audio, text, start_s, end_s, pauses=pauses)

        try:
            spans = self._cache.cached("aligned", (text, tuple(pronunciations.items()), start_s, end_s), align)
        except AlignmentError as error:
            room = "make room with 'phone N ends TIME' first"
            raise InputError(f"{str(step)!r}: does not fit into {where} ({error}); {room}") from error
        return with_span(units, spans)

    def _edited_speech(self, steps: tuple[Step, ...]) -> SpeechAnalysis:
        plain, units = self._recording, self._edited_units(steps)
        if units is plain.speech.units:
            return plain
        return self._cache.cached(
            "analysis", tuple(units), lambda: replace(plain, speech=self._with_units(plain.speech, units))
        )

    def _with_units(self, speech: Speech, units: Timeline[Unit]) -> Speech:
        return replace(with_prior(self.model.prior, with_units(speech, units)), voice=speech.voice, times_given=True)

    def _with_locks(self, steps: tuple[Step, ...]) -> Generation:
        """Return the motion after some edits, with locked spans as they were when they were locked."""
        self._edited_units(steps)  # hears the recording; refuses phones that change what is locked
        generation = self._with_curves(tuple(step for step in steps if not isinstance(step, LockStep | UnlockStep)))
        locks = find_locks(steps)
        if not locks:
            return generation
        from lipmotion.articulation.curve_edits import apply_stretch, cut_locked_stretch
        from lipmotion.articulation.phone_targets import SAID, with_gestures

        def add_gestures(generation: Generation, names: Sequence[str]) -> Generation:
            return generation.with_motion(with_gestures(generation.motion, generation.units, names))

        def cut(before: tuple[Step, ...], lock: LockStep, names: tuple[str, ...]) -> MotionStretch:
            return cut_locked_stretch(add_gestures(self._after(before), names), lock.start_s, lock.end_s)

        generation = add_gestures(generation, SAID)  # what phones beside a lock ask must not reach into it
        for place, lock in locks.items():
            for later in steps[place + 1 :]:
                if lock.holds(later):
                    raise InputError(f"{str(later)!r} lies in what is locked ({str(lock)!r}); take the lock out first")
            names = generation.motion.names  # also of later edits: in the lock they did nothing
            key = (steps[:place], lock, names, self.is_sketching)
            stretch = self._cache.cached("locked", key, partial(cut, steps[:place], lock, names))
            generation = add_gestures(generation, stretch.names)  # also of edits that were taken back since
            generation = apply_stretch(generation, stretch)
            earlier = [edit for step in steps[:place] if isinstance(step, CurveStep) for edit in step.parts]
            before = tuple(edit for edit in generation.curve_edits if edit in earlier)
            if len(before) < len(generation.curve_edits):
                locked = Locked(lock.start_s, lock.end_s, before)
                generation = replace(generation, curve_edits=(*generation.curve_edits, locked))
        return generation

    def _after(self, steps: tuple[Step, ...]) -> Generation:
        return self._cache.cached("edited", (steps, self.is_sketching), lambda: self._with_locks(steps))

    def _with_curves(self, steps: tuple[Step, ...]) -> Generation:
        """Return the motion after some edits without locks: the engine's, then gains and what bends single curves."""
        edits = [edit for step in remove_pins(steps) if isinstance(step, CurveStep) for edit in step.parts]
        phone_steps = tuple(step for step in steps if isinstance(step, PhoneStep | WordStep))
        if not edits:
            return self._with_pins(phone_steps, ())
        from lipmotion.articulation.curve_edits import apply_curve_edits, hold_mouth, intensify_span, mark_edited
        from lipmotion.articulation.phone_targets import GESTURES, with_gestures
        from lipmotion.pipeline.outputs.curve_sets import check_edit

        modelled = tuple(e for e in edits if isinstance(e, Pin) and self._is_modelled(e.channel, phone_steps))
        generation = self._with_pins(phone_steps, modelled)
        for edit in edits:
            if isinstance(edit, Gain) and not edit.channel:
                generation = intensify_span(generation, edit)
            elif isinstance(edit, Hold):
                generation = hold_mouth(generation, edit)
        curves = [edit for edit in edits if not isinstance(edit, Hold) and edit.channel and edit not in modelled]
        if any(not edit.channel for edit in edits):
            curves = [*modelled, *curves]  # a gain or a held pose has changed their values
        if gestures := [edit.channel for edit in curves if edit.channel in GESTURES]:
            generation = generation.with_motion(with_gestures(generation.motion, generation.units, gestures))
        motion = mark_edited(apply_curve_edits(generation.motion, generation.units, curves), [*modelled, *curves])
        for edit in edits:
            check_edit(edit, motion, self._curves)
        others = tuple(e for e in edits if isinstance(e, Hold) or (e in curves and e.channel not in motion.names))
        stated = (step.stated for step in remove_pins(steps) if isinstance(step, CurveStep))
        pinned_s = tuple(edit.time_s for edit in stated if isinstance(edit, Pin))
        return replace(generation.with_motion(motion), curve_edits=others, pinned_s=pinned_s)

    def _is_modelled(self, channel: str, phone_steps: tuple[Step, ...]) -> bool:
        """Return whether the engine moves a channel through pins: that of a mouth, or a weight of its motion."""
        if channel in MODELLED:
            return True
        motion = self._with_pins(phone_steps, ()).motion
        return channel in motion.names and motion.channels[motion.column(channel)].unit == WEIGHT

    def _with_pins(self, phone_steps: tuple[Step, ...], pins: tuple[Pin, ...]) -> Generation:
        """Return the engine's motion after some edits of phones, through pins; while sketching, a sketch of it."""
        key = (phone_steps, pins)

        def generate() -> Generation:
            analysis = self._edited_speech(phone_steps)
            self._motions += 1
            if self._motions == INTERACTIVE:
                numba_works()
            self._monitor(Progress("moving the mouth", 0, 1, ANALYSIS))
            generation = generate_motion(self.request, self.speaker, self.model, analysis, Constraints(pins))
            self._monitor(Progress("moving the mouth", 1, 1, 1.0))
            if self._outlook is not None:
                generation = replace(generation, outlook=self._outlook)
            self._last = key, generation
            return generation

        if self.is_sketching and not self._cache.has("motion", key):
            sketch = self._cache.cached("sketch", key, lambda: self._sketch(phone_steps, pins))
            if sketch is not None:
                return sketch
        return self._cache.cached("motion", key, generate)

    def _sketch(self, phone_steps: tuple[Step, ...], pins: tuple[Pin, ...]) -> Generation | None:
        """Return the last motion with what has changed since; None: all of it must be generated."""
        if self._last is None:
            return None
        (steps_before, pins_before), full_motion = self._last
        units_before, units = self._edited_units(steps_before), self._edited_units(phone_steps)
        excerpt = find_excerpt(units_before, units, {*pins} ^ {*pins_before}, len(full_motion.motion.values))
        if excerpt is None or len(units_before) != len(full_motion.units):
            return None
        place = (excerpt.frames.start, excerpt.frames.stop)

        def generate(units: Timeline[Unit], pins: tuple[Pin, ...]) -> Generation:
            phones, constraints = excerpt.cut(units, pins)

            def make() -> Generation:
                plain = self._recording
                speech = self._cache.cached("segment", place, lambda: cut_speech(plain.speech, excerpt.frames))
                segment = replace(plain, speech=self._with_units(speech, phones), tags=(), events=())
                return generate_motion(self.request, self.speaker, self.model, segment, constraints)

            return self._cache.cached("excerpt", (place, phones, constraints), make)

        try:
            before, after = generate(units_before, pins_before), generate(units, pins)
        except InputError:  # a pin that is refused: the full motion says its time
            return None
        sketch = apply_excerpt(full_motion, before, after, excerpt, units)
        self._last = (phone_steps, pins), sketch
        return sketch
