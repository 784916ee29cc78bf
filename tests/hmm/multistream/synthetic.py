"""Known multi-stream models, and utterances in which all streams depend on the same units."""

from itertools import product

import numpy as np

from lipmotion.hmm.multistream import densities, model, multistream_training, unit_states
from lipmotion.stats import bigram
from oracles.statistics import random_mixtures

UNITS = ("a", "b", "c", "d")
NAMES = ("sil", "sp", *UNITS, "x")  # ``x`` never occurs in utterances
CLASSES = {"early": frozenset("ab"), "late": frozenset("cdx"), "silence": frozenset({"sil", "sp"})}
DIMENSIONS = {densities.SPEECH: 3, **dict.fromkeys(densities.F0_STREAMS, 1), densities.MOTION: 6}


def inventory(states: int = 3, names=NAMES) -> unit_states.Inventory:
    return unit_states.Inventory(tuple(names), tuple(name for name in names if name in ("sil", "sp")), states)


def config(**changes) -> model.JointConfig:
    usual = {"mixtures": 2, "plain_iterations": 4, "iterations": 3, "least_frames": 8.0, "bigram_weight": 1.3}
    return model.JointConfig(**(usual | {"insertion": -0.4} | changes))


def observed(draw: np.random.Generator, frames: int, streams=densities.STREAMS) -> densities.StreamObservations:
    """Return noise in all streams, with some frames without a value."""
    found = {}
    for name in streams:
        known = draw.random(frames) < (1.0 if name == densities.SPEECH else 0.7)
        found[name] = densities.ObservedStream(draw.normal(0, 1.5, (frames, DIMENSIONS[name])) * known[:, None], known)
    return densities.StreamObservations(found)


def random_joint(
    seed: int, units=("a", "b"), states: int = 3, streams=densities.STREAMS, components: int = 2, **changes
) -> model.JointHmm:
    """Return models with random densities, and trees with random questions."""
    draw = np.random.default_rng(seed)
    known = inventory(states, ("sil", "sp", *units))
    sides = [name for name in known.names if name != "sp"]
    seen = [
        ((left, unit, right), state)
        for left, unit, right in product(sides, known.names, sides)
        for state in range(known.count(unit))
    ]
    questions = model.list_context_questions(known, CLASSES)
    parts = {}
    for name in streams:
        D, has_spaces = DIMENSIONS[name], name in densities.F0_STREAMS
        sums = densities.GaussianStatistics.zeros(len(seen), 1, D)
        effects = {place: draw.normal(0, 3, D) for place in product(range(3), (*known.names, ""))}
        means = np.array([sum(effects[i, context[i]] for i in range(3)) for context, _ in seen])
        sums.add(np.arange(len(seen)), 9.0 * np.concatenate([np.ones((len(seen), 2)), means, means**2 + 0.1], axis=1))
        tying = model.JointConfig(least_frames=1.0, both_neighbours=changes.get("both_neighbours", False))
        forest = model.grow_forest(name, known, questions, seen, sums, has_spaces=has_spaces, config=tying)
        mixtures = random_mixtures(draw, (forest.size, components, D), 2.0, 1.5, (0.3, 2))
        voiced = draw.uniform(0.1, 0.9, forest.size) if has_spaces else None
        parts[name] = model.StreamModel(
            densities.StreamScale(draw.normal(0, 1, D), draw.uniform(0.5, 2, D)),
            forest,
            densities.TiedDensities(mixtures, voiced),
        )
    count = len(known.names)
    return model.JointHmm(
        config(states=states, **changes),
        known,
        parts,
        np.log(draw.uniform(0.2, 0.9, len(known.monophones))),
        known.names,
        bigram.Bigram(known.names, np.log(draw.dirichlet(np.ones(count), count)).astype(np.float32)),
    )


SOUNDS = {
    "sil": (-3.0, 0.0, 0.0), "a": (2.0, 1.5, 0.0), "b": (2.0, -1.5, 1.5), "c": (0.5, 1.5, -2.0), "d": (1.0, -2.0, -1.5),
}  # fmt: skip
OPENINGS = {"sil": 0.0, "a": 1.0, "b": 0.1, "c": 0.6, "d": 0.3}
VOICED = ("a", "b", "d")


def say(draw: np.random.Generator, units, unseen: bool = True) -> multistream_training.TrainingUtterance:
    """Return an utterance of some units, with silence at both ends; each unit depends on its left neighbour."""
    said = ("sil", *units, "sil")
    speech, pitch, opening, edges = [], [], [], [0]
    before = "sil"
    for unit in said:
        length = int(draw.integers(8, 14) if unit == "sil" else draw.integers(6, 12))
        third = np.linspace(-0.6, 0.6, length)[:, None]
        colour = 0.8 * np.array(SOUNDS[before]) * (third < -0.2)
        speech.append(np.array(SOUNDS[unit]) + third + colour + draw.normal(0, 0.5, (length, 3)))
        pitch.append(np.where(unit in VOICED, 4.7, np.nan) + draw.normal(0, 0.05, length))
        opening.append(OPENINGS[unit] + 0.3 * OPENINGS[before] + draw.normal(0, 0.03, length))
        edges.append(edges[-1] + length)
        before = unit
    curve = np.convolve(np.pad(np.concatenate(opening), 2, "edge"), np.ones(5) / 5, "valid")
    motion = np.stack([curve, 1 - 0.5 * curve + draw.normal(0, 0.01, len(curve))], axis=1)
    seen = np.ones(len(motion), bool)
    if unseen and draw.random() < 0.3:
        seen[10:16] = False
        motion[10:16] = np.nan
    streams = densities.stream_observations(np.concatenate(speech), np.concatenate(pitch), motion, seen)
    return multistream_training.TrainingUtterance(streams, said, np.array(edges))


def utterances(count: int = 30, seed: int = 0, words: int = 6) -> list[multistream_training.TrainingUtterance]:
    draw = np.random.default_rng(seed)
    return [say(draw, [UNITS[i] for i in draw.integers(0, 4, words)]) for _ in range(count)]
