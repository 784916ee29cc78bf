"""Training of the unit selection engine: the inventory, the guide, and the error on recordings that are left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.selection.concatenation import join_pieces, to_pieces
from lipmotion.engines.selection.costs import Costs, SelectionConfig, Target, select
from lipmotion.engines.selection.inventory import RecordedUnits, cover_recording, list_windows
from lipmotion.engines.selection.model import Guide, SelectionModel, interpolate_at
from lipmotion.errors import CorpusError
from lipmotion.hmm.multistream.phone_recogniser import fit_phone_recogniser
from lipmotion.motion.closure import OPENING
from lipmotion.motion.frame_labels import find_runs, mark_distant, rate_phones
from lipmotion.motion.generation import fit_motion
from lipmotion.motion.predictors import PREDICTORS, PredictorTraining, choose_predictor
from lipmotion.motion.space import MotionSpace
from lipmotion.stats.curves import mark_known_dynamics, with_dynamics
from lipmotion.storage.archive import Checkpoint
from lipmotion.types import FRAME_RATE_HZ, Example, Monitor, Progress, Span, Speech, Timeline, Unit, sub_monitor
from lipmotion.units import SILENCE, is_silent

SEGMENT_S = 0.1  # duration of the segments of speech whose phones cannot be relied on
MIN_RELIABILITY = 0.5  # mean reliability of the phones from which on they choose


def build_target(model: SelectionModel, costs: Costs, speech: Speech) -> Target:
    """Return the phones of speech, with the motion that the guide predicts from its sound.

    Where noise makes the recognised phones of a recording unreliable on the whole, the target is segments of equal
    duration, for which the sound alone chooses.
    Raises InputError: an unknown phone.
    """
    frames = len(speech.features.values)
    duration_s = (frames - 1) / FRAME_RATE_HZ
    units, guide = cover_recording(speech.units, duration_s), model.guide
    if guide is None or not guide.predictor.can_predict(speech) or not costs.config.guide:
        return costs.target(costs.suppress(list_windows([units])), None, None)
    motion, distortion = guide.predictor.predict(speech)
    by_sound = bool(rate_phones(speech, distortion, frames).mean() < MIN_RELIABILITY)
    if by_sound:
        edges = np.linspace(0, duration_s, max(round(duration_s / SEGMENT_S), 1) + 1).tolist()
        units = Timeline(tuple(Span(a, b, Unit(SILENCE)) for a, b in pairwise(edges)))
    windows = list_windows([units]) if by_sound else costs.suppress(list_windows([units]))
    predicted = interpolate_at(motion, windows.times_s)
    guided = guide.centre + (predicted - guide.centre) * guide.expansion  # as wide as recorded motion
    return costs.target(windows, guided, predicted, by_sound=by_sound)


Array = NDArray[np.float64]
CHANNEL_WEIGHTS = {"opening": 8.0, "width": 3.0}
"""Weights of channels in comparisons of motion; that of any other dimension is 1."""
LEFT_OUT_RECORDINGS = 24
"""Recordings that are generated without their own units, which come back as they were; spread evenly over all."""
MIN_EXPANSION, MAX_EXPANSION = 1.0, 1.6
NEW_SPEECH_EXPANSION = 1.05
"""Predictions for new recordings are so much narrower again than those for recordings of the training."""
REST_AWAY_S = 0.3  # the rest pose is that of silence further than this from speech,
MIN_REST_FRAMES = 20  # or, where there are fewer frames of it, that of the frames with the smallest openings
KEPT_SILENCE_S = 0.5
"""Silence further than this from speech is not stored (§6: "to edit out this data but maintain synchronisation")."""
_STAGE = "units"


def fit_selection(
    examples: Sequence[Example], config: SelectionConfig, monitor: Monitor, checkpoint: Checkpoint
) -> tuple[SelectionModel, Array]:
    """Return a model of the recorded units of some examples, and the standard deviation of its error [shape=(Q,)].

    Raises CorpusError: no example has valid motion in speech, or the examples have different channels.
    """
    motion, values = fit_motion(examples, config.components)
    if not config.articulation:
        motion = replace(motion, prior=None)
    recogniser = None
    if config.joint_recogniser:
        recogniser = fit_phone_recogniser(examples, values, sub_monitor(monitor, 0, 0.3), checkpoint)
    recorded = np.concatenate([x[example.valid] for x, example in zip(values, examples, strict=True)])
    guide = None
    if config.guide:
        kind = choose_predictor(config.predictor, examples) or PREDICTORS.load("prior")
        direct, of_guide = len(motion.space.direct), sub_monitor(monitor, 0.3, 0.9)
        training = PredictorTraining(examples, values, direct, config.epochs, of_guide, checkpoint)
        predictor = kind.fit(training).predictor
        predicted = np.concatenate([predictor.predict(e.speech)[0][e.valid] for e in examples])
        ratio = NEW_SPEECH_EXPANSION * recorded.std(axis=0) / np.maximum(predicted.std(axis=0), 1e-9)
        guide = Guide(predictor, recorded.mean(axis=0), np.clip(ratio, MIN_EXPANSION, MAX_EXPANSION))
    monitor(Progress(_STAGE, 1, 3, 0.9))
    inventory = build_inventory(examples, values, guide)
    monitor(Progress(_STAGE, 2, 3, 0.92))
    deviations = np.maximum(recorded.std(axis=0), 1e-9)
    count = len(motion.space.direct)
    deviations[count:] = deviations[count:].max(initial=1e-9)
    weights = np.ones(len(deviations))
    weights[:count] = [CHANNEL_WEIGHTS.get(name, 1.0) for name in motion.space.direct_names]
    scale = np.sqrt(weights) / deviations
    rest, unknown = _find_rest_pose(examples, values, recorded, motion.space), np.ones((3, len(scale)))
    model = SelectionModel(motion, inventory, scale, rest, unknown, guide, recogniser)
    costs, errors = model.costs(config), []
    numbers = np.unique(np.linspace(0, len(examples) - 1, LEFT_OUT_RECORDINGS).astype(int)).tolist()
    for number in numbers if len(examples) > 1 else ():
        frames = mark_known_dynamics(examples[number].valid)
        if frames.any():
            target = build_target(model, costs, examples[number].speech)
            units = select(costs, target, costs.inventory.windows.recording == number)[0]
            joined = join_pieces(costs.inventory, target, to_pieces(costs, target, units), len(values[number]))
            errors.append(with_dynamics(values[number] - joined)[frames])
    spread = with_dynamics(recorded).var(axis=0)
    variances: Array = np.square(np.concatenate(errors)).mean(axis=0) if errors else spread
    model = replace(model, variances=np.maximum(variances, 1e-4 * spread + 1e-12))
    monitor(Progress(_STAGE, 3, 3, 1.0))
    return model, np.sqrt(model.variances[0])


def build_inventory(examples: Sequence[Example], values: Sequence[Array], guide: Guide | None) -> RecordedUnits:
    """Return the inventory of some examples, from reduced motion. Raises CorpusError: no phone was measured whole."""
    timelines = [cover_recording(e.speech.units, (len(e.valid) - 1) / FRAME_RATE_HZ) for e in examples]
    windows = list_windows(timelines)
    first = np.concatenate([[0], np.cumsum([len(x) for x in values])]).astype(np.intp)
    known = np.concatenate([example.valid for example in examples])
    begin = first[windows.recording] + np.floor(windows.times_s[:, 0] * FRAME_RATE_HZ).astype(np.intp)
    end = first[windows.recording] + np.ceil(windows.times_s[:, 1] * FRAME_RATE_HZ).astype(np.intp) + 1
    missed = np.concatenate([[0], np.cumsum(~known)])
    last = first[windows.recording + 1]
    usable = (missed[np.minimum(end, last)] == missed[np.minimum(begin, last)]) & (begin < last)
    spoken = ~np.array([is_silent(span.label.phone) for units in timelines for span in units], bool)
    usable &= np.isin(windows.recording, windows.recording[spoken])  # of others, no motion is stored
    if not (usable & spoken).any():
        raise CorpusError(f"no phone in {len(examples)} recordings is measured throughout; record more speech")
    predicted = None
    if guide is not None:
        motions = (guide.predictor.predict(example.speech)[0] for example in examples)
        times_s = (windows.times_s[windows.recording == number] for number in range(len(examples)))
        points = [interpolate_at(*pair) for pair in zip(motions, times_s, strict=True)]
        predicted = np.concatenate(points).astype(np.float16)
    names = tuple(example.name for example in examples)
    stored = list[list[int]]()  # ranges of rows: not the middle of long silences, nor what was not measured
    for example, begin in zip(examples, first[:-1].tolist(), strict=True):
        near = example.valid & ~mark_distant(example.speech.units, len(example.valid), KEPT_SILENCE_S)
        stored += (find_runs(near) + begin).tolist()
    rows = np.concatenate([np.arange(start, stop) for start, stop in stored])
    motion = np.concatenate(values)[rows].astype(np.float16)
    return RecordedUnits(names, windows, usable, first, np.array(stored, np.intp), motion, predicted)


def _find_rest_pose(examples: Sequence[Example], values: Sequence[Array], recorded: Array, space: MotionSpace) -> Array:
    """Return the mean pose in silence away from speech, or that of the least open frames [shape=(Q,)]."""
    away = (example.valid & mark_distant(example.speech.units, len(example.valid), REST_AWAY_S) for example in examples)
    poses = np.concatenate([x[frames] for x, frames in zip(values, away, strict=True)])
    if len(poses) < MIN_REST_FRAMES:
        poses = recorded
        if OPENING in space.direct_names:
            opening = poses[:, space.direct_names.index(OPENING)]
            poses = poses[opening <= np.percentile(opening, 10)]
    return poses.mean(axis=0)
