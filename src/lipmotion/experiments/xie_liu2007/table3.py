"""Xie & Liu 2007, Table 3, on any corpus: which structure of chains predicts lips best, and what is better still."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.corpora.store import Corpus
from lipmotion.errors import InputError
from lipmotion.experiments.comparison import Tally, correlation_tally, distance_tally, openings_of
from lipmotion.experiments.learning_curve import check_lists, steps_of
from lipmotion.experiments.noise import AUDIO_ONLY, in_noise
from lipmotion.experiments.runner import channels_with_opening, opening_row, shuffled
from lipmotion.experiments.xie_liu2007.mixtures import CANDIDATES, check_numbers
from lipmotion.experiments.xie_liu2007.plots import check_plots, draw_plots
from lipmotion.experiments.xie_liu2007.systems import BEST, Contender, chosen_rivals, trained_rivals
from lipmotion.hmm.model import HmmConfig
from lipmotion.kernels.threads import one_thread
from lipmotion.measures import curves
from lipmotion.pipeline.evaluation.evaluate import OPENING, Clip, Recorded, clips, figures_of, recorded
from lipmotion.pipeline.training.channels import EIGENLIPS, GEOMETRY, as_learned, check_visual, learned_eigenlips
from lipmotion.pipeline.training.train import FEWEST, phones_and_examples
from lipmotion.pipeline.workers import working
from lipmotion.speech.noise import FEWEST_TALKERS, KINDS
from lipmotion.speech.recogniser import recogniser as cached_recogniser
from lipmotion.stats.rounding import varies
from lipmotion.storage.checkpoint import NOTHING_KEPT
from lipmotion.storage.json_text import defined
from lipmotion.storage.sources import Source, check_apart
from lipmotion.types import Audio, Monitor, counted, part_of, silent_monitor
from lipmotion.units import Lexicon

Array = NDArray[np.float64]
STATES = 5
"""Per unit, in the paper."""
BABBLE = "babble"
RATIOS_DB = (20.0, 10.0, 5.0, 0.0)


@dataclass(frozen=True)
class Noises:
    """Noise to hear the recordings in.

    kinds   : of ``speech.noise.KINDS``;  ratios_db : signal-to-noise ratios
    talkers : of the babble
    """

    kinds: tuple[str, ...] = ()
    ratios_db: tuple[float, ...] = RATIOS_DB
    talkers: tuple[Audio, ...] = ()

    def __post_init__(self) -> None:
        unknown = [kind for kind in self.kinds if kind not in KINDS]
        if unknown:
            raise InputError(f"unknown noise {unknown[0]!r}; required some of: {', '.join(KINDS)}")
        if BABBLE in self.kinds and len(self.talkers) < FEWEST_TALKERS:
            raise InputError(f"a babble of {len(self.talkers)} talkers; required at least {FEWEST_TALKERS}: --talkers")


@one_thread()
def table3(
    corpus: Corpus,
    *,
    split: str | None = "test",
    order: Sequence[str] | None = None,
    sizes: Sequence[int] | None = None,
    systems: Sequence[str] | None = None,
    states: int = STATES,
    mixtures: Sequence[int] = CANDIDATES,
    visual: str = GEOMETRY,
    transcripts: bool = False,
    noises: Noises | None = None,
    plots: Path | None = None,
    recogniser: HmmConfig | None = None,
    lexicon: Lexicon | None = None,
    seed: int = 0,
    monitor: Monitor = silent_monitor,
    workers: int = 1,
) -> dict[str, Any]:
    """Train the six systems of the paper, ours and yardsticks; return what they make of ``split``.

    order, sizes : train on the first N names of a list, as ``learning_curve``; by default on all of ``train``
    systems     : names of ``rivals.RIVALS``; by default all that can be
    states      : per unit, of the paper's systems
    mixtures    : Gaussians per state that these may have, chosen with the list ``val`` for each size
    visual      : what of a face is learned and compared, as ``train`` has it; eigenlips are those of the training
    transcripts : compare also with the words known
    noises      : that the systems hear ``split`` in as well, those of the largest size
    plots       : a folder for pictures like Figs. 7, 10 and 11 of the paper, of the largest size
    recogniser  : configuration of the phone models
    workers     : processes that share the finding of the phones
    The phones in time are found once for each size and are the same for all systems.
    Raises InputError: no such system, sizes that the list does not have, numbers that are no powers of two.
    Raises CorpusError: no utterances to train on, to choose with, or of this split, or motion without an opening.
    Raises MissingDependencyError: a system or the pictures need a package that is not installed.
    Raises ExportError: the pictures cannot be written.
    """
    names = chosen_rivals(systems)
    check_numbers(mixtures)
    check_visual(visual)
    listed = tuple(order) if order is not None else shuffled(corpus.required("train"), seed)
    held_out, kept_aside = corpus.required(split), corpus.required("val") if len(mixtures) > 1 else ()
    check_lists(corpus, listed, (*held_out, *kept_aside))
    steps = steps_of(sizes if sizes is not None else [len(listed)], len(listed))
    setup = _Setup(corpus, names, held_out, kept_aside, states, tuple(mixtures), visual, recogniser, lexicon, workers)
    if visual != EIGENLIPS:
        channels_with_opening(corpus, held_out)  # before the long work
    if plots is not None:
        check_plots(plots)
        check_apart([plots], [Source(corpus.path, "corpus")])
    shares = 0.9 * np.cumsum([0, *steps]) / sum(steps)
    rows: list[dict[str, Any]] = []
    for count, (start, stop) in zip(steps, pairwise(shares), strict=True):
        part = part_of(monitor, float(start), float(stop), f"{count} clips: ")
        tried = setup.trained(listed[:count], part)
        rows.append({"names": count} | _size(tried, transcripts, seed))
    loud = _in_noise(tried, noises or Noises(), seed, part_of(monitor, 0.9, 1))
    if plots is not None:
        draw_plots(tried.contenders[BEST], tried.found, plots)
    about = {"split": split or "all", "clips": len(held_out), "seed": seed, "states": states, "workers": workers}
    about |= {"order": "given" if order is not None else "shuffled", "mixtures": list(mixtures)}
    about |= {"visual": visual, "channels": list(tried.found.channels), "closed_under": tried.found.closed_under}
    figures: dict[str, Any] = defined(about | {"rows": rows, "noise": loud})
    return figures


@dataclass(frozen=True, eq=False)
class _Tried:
    """Systems trained on some utterances, and the recordings to compare with."""

    used: tuple[str, ...]
    found: Recorded
    contenders: Mapping[str, Contender]


@dataclass(frozen=True, eq=False)
class _Setup:
    corpus: Corpus
    systems: Sequence[str]
    held_out: Sequence[str]
    kept_aside: Sequence[str]
    states: int
    mixtures: tuple[int, ...]
    visual: str
    recogniser: HmmConfig | None
    lexicon: Lexicon | None
    workers: int

    def trained(self, names: Sequence[str], monitor: Monitor) -> _Tried:
        """Return all systems, trained on the same phones of some utterances."""
        lexicon, config = self.lexicon or Lexicon(), self.recogniser or HmmConfig()
        utterances = [self.corpus.utterance(name) for name in sorted(names)]
        eigenlips = learned_eigenlips(utterances) if self.visual != GEOMETRY else None
        utterances = [as_learned(utterance, self.visual, eigenlips) for utterance in utterances]
        with working(min(self.workers, len(utterances) // FEWEST)) as team:
            finding = part_of(monitor, 0, 0.2)
            phones, examples, _ = phones_and_examples(utterances, config, lexicon, finding, NOTHING_KEPT, team.each)
        listen = partial(recorded, self.corpus, cached_recogniser(phones), lexicon=lexicon)
        listen = partial(listen, visual=self.visual, eigenlips=eigenlips)
        found = listen(names=self.held_out, monitor=part_of(monitor, 0.2, 0.25))
        kept_aside = None
        if self.kept_aside:
            listening = part_of(monitor, 0.25, 0.3)
            kept_aside = listen(names=self.kept_aside, channels=found.channels, monitor=listening)
        training = part_of(monitor, 0.3, 1)
        contenders = trained_rivals(self.systems, examples, kept_aside, self.states, self.mixtures, training)
        return _Tried(tuple(example.name for example in examples), found, contenders)


def _size(tried: _Tried, transcripts: bool, seed: int) -> dict[str, Any]:
    """Return the figures of all systems after training on so many utterances."""
    told = list(tried.found.conditions) if transcripts else [AUDIO_ONLY]
    return {
        "used": len(tried.used),
        "training": {
            name: {"seconds": one.seconds, "mixtures": one.mixtures, "tried": {str(k): v for k, v in one.tried.items()}}
            for name, one in tried.contenders.items()
        },
        "conditions": {condition: _rows(tried.found, condition, tried.contenders, seed) for condition in told},
    }


def _rows(found: Recorded, condition: str, contenders: Mapping[str, Contender], seed: int) -> dict[str, dict[str, Any]]:
    """Return the figures of all systems on the same recordings, told the same."""
    made = {name: clips(found, condition, one.engine, one.model) for name, one in contenders.items()}
    return {name: _row(found, own, made[BEST], seed) for name, own in made.items()}


def _row(found: Recorded, made: Sequence[Clip], best: Sequence[Clip], seed: int) -> dict[str, Any]:
    figures, others = figures_of(made, found, seed), _tallies(found, best)
    row: dict[str, Any] = {}
    for name, tally in _tallies(found, made).items():
        ends = {"95": tally.interval(seed), "gain_95": tally.gain(others[name], seed)}
        row |= {name: tally.value} | {f"{name}_{key}": interval for key, interval in ends.items()}
    still = not varies(np.concatenate([clip.generated for clip in made])).any()
    row |= {"lag_ms": None if still else figures["lag_ms"], "opening": None}
    if OPENING not in found.channels:
        return row
    lips, (generated, original) = figures["closures_p_b_m"], openings_of(found, made)
    opening = opening_row(figures) | {"rmse": float(curves.rmse(generated, original)[0])}
    return row | {"opening": opening | {key: lips[key] for key in ("false_per_minute", "original_per_minute")}}


def _tallies(found: Recorded, made: Sequence[Clip]) -> dict[str, Tally]:
    """Return AMSE and ACC of geometry, or of eigenlips where there is nothing else; beside it those of the opening."""
    pictured = np.array([name in found.pictured for name in found.channels])
    parts = {"": pictured} if pictured.all() else {"": ~pictured, "eigenlips_": pictured}
    tallies = {}
    for part, columns in parts.items():
        if columns.any():
            generated, original = ([side[:, columns] for side in sides] for sides in _sides(made))
            tallies[f"{part}amse"] = distance_tally(generated, original)
            tallies[f"{part}acc"] = correlation_tally(generated, original)
    if OPENING in found.channels:
        tallies["opening_acc"] = correlation_tally(*openings_of(found, made))
    return tallies


def _sides(made: Sequence[Clip]) -> tuple[list[Array], list[Array]]:
    return [clip.generated for clip in made], [clip.original for clip in made]


def _in_noise(tried: _Tried, noises: Noises, seed: int, monitor: Monitor) -> list[dict[str, Any]]:
    """Return the figures of all systems for every kind of noise and ratio."""
    rows = []
    every = [(kind, ratio) for kind in noises.kinds for ratio in noises.ratios_db]
    for kind, ratio in counted(every, "comparing in noise", monitor):
        found = in_noise(tried.found, kind, ratio, noises.talkers, seed)
        made = _rows(found, AUDIO_ONLY, tried.contenders, seed)
        rows.append({"kind": kind, "snr_db": ratio, "systems": made})
    return rows
