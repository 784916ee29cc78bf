"""What a motion file holds: the channels that were asked for, or the curves of its format."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from lipmotion.articulation.contact import sample_pictures
from lipmotion.articulation.delivery import close_on_frame_grid, find_closed_times
from lipmotion.articulation.expression import is_mood
from lipmotion.articulation.mouth import find_mouth
from lipmotion.articulation.phone_targets import GESTURES, with_gestures
from lipmotion.errors import ExportError, InputError
from lipmotion.formats.base import (
    Thinning,
    check_motion,
    find_motion_format,
    find_suffix,
    list_suffixes,
    read_motion,
    write_motion,
)
from lipmotion.formats.cues import read_cue_motion
from lipmotion.formats.fap import FAP
from lipmotion.formats.steady_rate import match_sound_rate
from lipmotion.meshes.fitting.blendshape_motion import with_mouth
from lipmotion.meshes.fitting.driven import DrivenCharacter
from lipmotion.meshes.fitting.eyes_and_brows import compute_living_curves
from lipmotion.meshes.model.rig_tables import CONTROL
from lipmotion.meshes.model.shape_names import convert_to_arkit, is_known, to_arkit
from lipmotion.pipeline.analysis.read_request import read_units
from lipmotion.pipeline.outputs.curve_sets import (
    ARKIT,
    LIVING_SETS,
    WHOLE_FACE,
    edit_face_curves,
    join_channels,
    make_curves,
    with_curves,
)
from lipmotion.pipeline.outputs.deliver import deliver, hold_mouth_poses
from lipmotion.pipeline.outputs.output import Output, OutputSettings, Performance, measure_recorded_prosody
from lipmotion.storage.files import as_text, sound_reference
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Prosody, StateTrace, Timeline, Unit
from lipmotion.types.delivery import Staging
from lipmotion.types.motion import RADIAN

LOG = logging.getLogger("lipmotion")
CURVES = (WEIGHT, CONTROL, RADIAN)  # the units of curves that drive a character
MODEL_HZ = 100  # frames per second of generated motion
SAME_HZ = 1e-6
OPENING = "opening"


class MotionOutput(Output):
    """``.json``, ``.csv``, ``.livelink.csv``, …: the motion, or curves that follow from it (``formats.base``)."""

    @classmethod
    def suffixes(cls, settings: OutputSettings) -> tuple[str, ...]:  # noqa: D102, ARG003
        return list_suffixes()

    @classmethod
    def takes(cls, path: Path, settings: OutputSettings) -> bool:  # noqa: D102, ARG003
        return bool(find_suffix(path))

    def check(self) -> None:  # noqa: D102
        form, rate_hz = find_motion_format(self.path), self.settings.outputs.rate_hz
        if form.fixed_rate and rate_hz is not None and rate_hz != form.rate_hz:
            required = f"required {form.rate_hz:g}: leave --rate out"
            raise ExportError(f"{self.path}: {rate_hz:g} frames a second in {find_suffix(self.path)}, {required}")

    def prepare(self, performance: Performance) -> Callable[[], None]:  # noqa: D102
        settings, form = self.settings, find_motion_format(self.path)
        spoken, chosen, requested = performance.cached(_choose)
        lives = form.curves in LIVING_SETS or settings.curves in LIVING_SETS
        prosody = performance.cached(measure_recorded_prosody) if lives else None
        rate_hz, channels = settings.outputs.rate_hz, settings.outputs.channels
        held = fit_to_format(self.path, spoken, chosen, rate_hz, settings.staging, prosody, channels)
        names = held.motion.names
        is_replaced = form.mouth and OPENING in names and OPENING not in requested
        if requested and (is_replaced or not {*requested} & {*names}):
            file = f"{self.path.name}: {find_suffix(self.path)}"
            LOG.warning("%s holds channels of its own, none of those that were asked for", file)
        frames = settings.delivery.hold_frames(held.motion.rate_hz)
        held = hold_mouth_poses(held, frames, performance.cached(_find_closed_s))
        if form.keyed and settings.delivery.key_tolerance:
            held = thin_keys(held, Thinning(settings.delivery.key_tolerance, tuple(find_closed_times(held))))
        check_motion(self.path, held.motion)
        return partial(self._write, held, performance)

    def _write(self, held: Generation, performance: Performance) -> None:
        about, model = performance.model.about if performance.model else performance.generation.about, {}
        for key in ("name", "corpus", "licence", "attribution"):
            if value := about.get(key):
                model[key] = as_text("; ".join(map(str, value)) if isinstance(value, list) else str(value))
        speech, sound_s = performance.sound_file, self.settings.delivery.offset_ms / 1000
        source = {"file": as_text(speech.name)} if speech else {}
        if speech and sound_s:
            source["start_s"] = f"{sound_s:.9g}"
        if speech and find_motion_format(self.path).names_sound:
            source["path"] = sound_reference(speech, self.path)
        write_motion(self.path, held, source=source, model=model)


def thin_keys(held: Generation, thinning: Thinning) -> Generation:
    """Return a generation whose weights go straight between the keys that are kept of each.

    Weights that never exceed the tolerance are left out, and held poses stay as they are.
    """
    motion, moving = held.motion, []
    values = motion.values.astype(np.float64)
    for column, channel in enumerate(motion.channels):
        curve = values[:, column]
        if channel.unit != WEIGHT or np.abs(curve).max(initial=0.0) > thinning.tolerance:
            moving.append(channel.name)
        if channel.unit == WEIGHT and channel.name not in held.stepped:
            keys = thinning.choose(motion.time_s, curve[:, None])
            values[:, column] = np.interp(motion.time_s, motion.time_s[keys], curve[keys])
    return replace(held, motion=replace(motion, values=values)).selected(moving)


def _deliver(performance: Performance) -> Generation:
    """Return the motion as delivered, with the articulatory channels that were asked for."""
    generation, settings = performance.generation, performance.settings
    if {*settings.outputs.channels} & {*GESTURES}:
        generation = with_articulation(generation, settings.outputs.channels)
    return deliver(generation, settings.delivery)


def _find_closed_s(performance: Performance) -> list[float]:
    """Return the times of p, b and m that held poses show; none, where poses are not held."""
    return find_closed_times(performance.cached(_deliver)) if performance.settings.delivery.hold_ms else []


def _choose(performance: Performance) -> tuple[Generation, Generation, Sequence[str]]:
    """Return the motion, what motion files hold of it unless their format says more, and the channels asked for."""
    settings, spoken = performance.settings, performance.cached(_deliver)
    rate_hz, curves, channels = settings.outputs.rate_hz, settings.curves, settings.outputs.channels or None
    if rate_hz is not None and (performance.cached(_find_closed_s) or rate_hz < spoken.motion.rate_hz):
        spoken = close_on_frame_grid(spoken, rate_hz)
    names, requested = channels, channels or ()
    if curves is not None:
        prosody = performance.cached(measure_recorded_prosody) if curves in LIVING_SETS else None
        spoken, curve_names = with_curves(spoken, curves, staging=settings.staging, prosody=prosody)
        names = channels or curve_names
        requested = requested if isinstance(curves, DrivenCharacter) else names
    chosen = spoken.selected(names) if names is not None else spoken
    if rate_hz is not None:
        chosen = chosen.resampled(rate_hz) if curves is None else resample_curves(chosen, spoken, rate_hz)
    return spoken, chosen, requested


def with_articulation(generation: Generation, channels: Sequence[str] = GESTURES) -> Generation:
    """Return the generation with articulatory channels that its motion lacks, as they follow from its phones.

    channels : the articulatory ones among these are added (docs/articulation.md); their variance is 0
    """
    return generation.with_motion(with_gestures(generation.motion, generation.units, channels))


def fit_to_format(
    path: Path,
    generation: Generation,
    chosen: Generation,
    rate_hz: float | None,
    staging: Staging | None = None,
    prosody: Prosody | None = None,
    channels: Sequence[str] | None = None,
) -> Generation:
    """Return a generation as a motion file of that name holds it.

    chosen  : the generation with the channels, and at the rate, that the user asked for: what most formats hold
    rate_hz : the rate that the user asked for; None: that of the format for motion at the model's rate, else its own
    staging, prosody : of what moves on its own, in formats that hold a whole face; None: everything moves; not known
    channels : those that the user asked for by name: of a format's own curves only these are held, if any of them is
               one; None: all
    Where the lips close between two frames of curves, the nearer one shows it. Blendshapes that the motion has
    already, by any spelling of ARKit's names, are taken as they are.
    Raises ExportError: unknown suffix. Raises InputError: curves that cannot be computed.
    """
    form = find_motion_format(path)
    held = chosen
    is_all = held.motion.names == generation.motion.names and _blendshapes(generation.motion) is not None
    others = form.other_curves and not is_all and all(channel.unit in CURVES for channel in held.motion.channels)
    if form.curves and not others:
        curves = _make_curves(generation, form.curves, staging, prosody)
        curves = edit_face_curves(curves, generation.units, generation.curve_edits)
        held = replace(generation, motion=curves, spread=np.zeros(curves.values.shape))
        named = [name for name in channels or () if name in curves.names]
        held = held.selected(named) if named else held
    elif form.mouth and OPENING not in held.motion.names:
        held = generation
    of_format = form.fixed_rate or abs(generation.motion.rate_hz - MODEL_HZ) < SAME_HZ
    hertz = rate_hz or (form.rate_hz if of_format else None)
    if hertz is None or abs(hertz - held.motion.rate_hz) < SAME_HZ:
        return held
    return held.resampled(hertz) if held is chosen or held is generation else resample_curves(held, generation, hertz)


def resample_curves(held: Generation, generation: Generation, rate_hz: float) -> Generation:
    """Return curves at another rate, in whose frames the lips touch as in pictures of the motion at that rate.

    held       : the curves;  generation : the motion that they are of, with as many frames
    """
    resampled, mouth = held.resampled(rate_hz), with_mouth(generation.motion)
    if OPENING not in mouth.names or len(held.motion.values) != len(mouth.values):
        return resampled
    contact = find_mouth(mouth, generation.units).contact
    time_s = held.sample_times(rate_hz)
    rows = sample_pictures(held.motion.values.astype(np.float64), contact, held.motion.rate_hz, time_s)
    return replace(resampled, motion=replace(resampled.motion, values=rows))


def _make_curves(generation: Generation, name: str, staging: Staging | None, prosody: Prosody | None) -> Motion:
    """Return a set of curves, with those that the motion has already."""
    motion, units, is_arkit = generation.motion, generation.units, name in (ARKIT, WHOLE_FACE)
    faps = [channel.name for channel in motion.channels if channel.unit == name == FAP]
    shapes = _blendshapes(motion) if is_arkit else None
    if shapes is None:
        return motion.selected(faps) if faps else make_curves(motion, units, name, staging=staging, prosody=prosody)
    moods = [channel.name for channel in motion.channels if is_mood(channel.name)]
    shown = join_channels(shapes, generation.selected(moods).motion) if moods else shapes
    mouth = make_curves(shown, units, ARKIT)  # the same weights, but where lips close that would not, and more of them
    curves = {name: shapes[name] for name in shapes.names}
    curves |= {name: mouth[name] for name in mouth.names if name in curves or mouth[name].any()}
    known = {channel.name: channel for channel in (*mouth.channels, *shapes.channels)}
    values = np.stack([curve.astype(np.float64) for curve in curves.values()], axis=1)
    face = Motion(values, motion.rate_hz, tuple(known[name] for name in curves))
    if name != WHOLE_FACE:
        return face
    living = compute_living_curves(with_mouth(motion), units, staging, prosody)
    return join_channels(face, living.selected([name for name in living.names if name not in face.names]))


def _blendshapes(motion: Motion) -> Motion | None:
    """Return the channels of a motion that are ARKit's blendshapes, by ARKit's names, and angles of head and eyes."""
    channels = reversed([*enumerate(motion.channels)])
    known = {each.name if each.unit == RADIAN else to_arkit(each.name): n for n, each in channels}
    columns = [(name, column) for name, column in sorted(known.items(), key=lambda each: each[1]) if name]
    jaw = known.get("jawOpen")
    if jaw is None or (not motion.values[:, jaw].any() and convert_to_arkit(motion)):
        return None
    of_face = tuple(replace(motion.channels[column], name=name) for name, column in columns)
    return Motion(motion.values[:, [column for _, column in columns]], motion.rate_hz, of_face)


TOLERATED_S = 0.1  # sound and motion may differ so much in length without a warning
SLOWEST_HZ, FASTEST_HZ = 4.0, 1_000.0
"""Smallest and largest frame rate of motion that is read: others are of times in another unit, or of frames."""
LONGEST_S = 86_400.0  # longest motion that is read
CUE_SUFFIXES = (".dat", ".tsv", ".xml", ".pgo")
STATE = "file"  # the state of every frame of motion that was read


def read_generation(
    path: str | Path, units: str | Path | Timeline[Unit] | None = None, rate_hz: float | None = None
) -> Generation:
    """Return the motion of a file as ``write`` takes it: with its phones, if it has them, and without variance.

    path  : ``.json``, ``.csv``, ``.npz``, or another motion file that can be read
    units : phones in time, or a file with them (``read_units``), for motion files that have none; None: those of the
            motion file
    rate_hz : frames a second, where the file states them wrong, or not at all, as Moho's ``.dat``; None: as it says
    Blendshapes, visemes, vowels and moods count as weights, whatever unit the file gives them.
    Raises InputError: a file that cannot be read, motion without frames, of an unlikely rate, or of more than a day.
    """
    if rate_hz is not None and Path(path).suffix.lower() in CUE_SUFFIXES:
        motion, stated = read_cue_motion(Path(path), rate_hz)
    else:
        motion, stated = read_motion(path)
        motion = motion if rate_hz is None else replace(motion, rate_hz=rate_hz)
    if not len(motion.values):
        raise InputError(f"{path}: the motion has no frames; export it again")
    if not SLOWEST_HZ <= motion.rate_hz <= FASTEST_HZ:
        required = f"required {SLOWEST_HZ:.0f} to {FASTEST_HZ:.0f}; if it has others, state them: --motion-rate"
        raise InputError(f"{path}: {motion.rate_hz:g} frames a second, {required}")
    lasts_s = (len(motion.values) - 1) / motion.rate_hz
    if lasts_s > LONGEST_S:
        raise InputError(f"{path}: the motion lasts {lasts_s:.0f} s, required at most {LONGEST_S:.0f}; cut it")
    phones = stated if units is None else read_units(units) if isinstance(units, str | Path) else units
    channels = tuple(
        Channel(each.name, WEIGHT)
        if each.unit not in (CONTROL, RADIAN) and (is_known(each.name) or is_mood(each.name))
        else each
        for each in motion.channels
    )
    return as_generation(replace(motion, channels=channels), phones)


def as_generation(motion: Motion, units: Timeline[Unit]) -> Generation:
    """Return motion that no model made as ``write`` takes it, without variance."""
    states = StateTrace((STATE,), np.zeros(len(motion.values), np.intp))
    return Generation(motion, np.broadcast_to(0.0, motion.values.shape), units, states)


def correct_rate(motion: Motion, duration_s: float, advice: str = "") -> Motion:
    """Return motion at the rate of its sound, where it is off by 1001 / 1000 (``match_sound_rate``); a warning."""
    rate_hz = match_sound_rate(motion.rate_hz, len(motion.values), duration_s)
    if rate_hz != motion.rate_hz:
        lasts_s = len(motion.values) / motion.rate_hz
        what = f"the motion lasts {lasts_s:.2f} s, the sound {duration_s:.2f}, {duration_s / lasts_s:.4f} times as long"
        LOG.warning("%s: read at %.3f frames a second, not at %.3f%s", what, rate_hz, motion.rate_hz, advice)
    return replace(motion, rate_hz=rate_hz)


def match_duration(generation: Generation, duration_s: float, *, keeps_rate: bool = False) -> Generation:
    """Return a generation that lasts as long as its sound: the last pose stays, or the rest is cut.

    keeps_rate : whether its rate is right; otherwise one that is off by 1001 / 1000 is corrected, if it has no phones
    A difference of more than ``TOLERATED_S`` is logged as a warning.
    """
    motion = generation.motion
    if not keeps_rate and not len(generation.units):
        motion = correct_rate(motion, duration_s, "; --motion-rate says another")
    lasts_s = (len(motion.values) - 1) / motion.rate_hz
    if abs(lasts_s - duration_s) > TOLERATED_S:
        what = "the last pose stays" if lasts_s < duration_s else "what comes after the sound is left out"
        LOG.warning("the motion lasts %.2f s, the sound %.2f s: %s", lasts_s, duration_s, what)
    count = int(np.floor(duration_s * motion.rate_hz + 1e-6)) + 1
    frames = np.minimum(np.arange(count), len(motion.values) - 1)
    return replace(
        generation,
        motion=Motion(motion.values[frames], motion.rate_hz, motion.channels),
        spread=np.broadcast_to(0.0, (count, len(motion.channels))),
        trace=StateTrace(generation.trace.states, generation.trace.frames[frames]),
    )
