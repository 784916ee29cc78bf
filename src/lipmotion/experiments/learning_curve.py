"""How much speech a model needs: the first N recordings of a list, N larger and larger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from lipmotion.corpora.store import Corpus
from lipmotion.errors import CorpusError, InputError
from lipmotion.experiments.runner import Trial, channels_with_opening, opening_row, shuffled, trial
from lipmotion.hmm.model import HmmConfig
from lipmotion.kernels.threads import one_thread
from lipmotion.measures.report import number
from lipmotion.pipeline.evaluation.evaluate import figures_of
from lipmotion.storage.json_text import defined
from lipmotion.types import Monitor, part_of, silent_monitor
from lipmotion.units import Lexicon

SIZES = (20, 50, 100, 200)
"""Of these, by default, those smaller than the list; and the list."""
OTHERS = ("width", "outer")
"""Channels that are compared beside the opening."""


@one_thread()
def learning_curve(
    corpus: Corpus,
    *,
    order: Sequence[str] | None = None,
    sizes: Sequence[int] | None = None,
    split: str | None = "test",
    recogniser: HmmConfig | None = None,
    lexicon: Lexicon | None = None,
    seed: int = 0,
    monitor: Monitor = silent_monitor,
    workers: int = 1,
) -> dict[str, Any]:
    """Train everything on the first N utterances of a list for every N of ``sizes``; return what it makes of ``split``.

    order      : names of utterances; the training list, shuffled with the seed, by default
    sizes      : by default 20, 50, 100, 200, as far as the list goes, and the whole list
    recogniser : configuration of the phone models
    seed       : of the shuffled list, and of the intervals
    workers    : as in ``train``
    Phone models and engine are both trained on those N alone, and find the phones of the split, too.
    Raises InputError: sizes under 1 or over the list, or no list.
    Raises CorpusError: names that are not in the corpus, twice in the list or in the split; no utterances of this
    split; or motion without an opening.
    """
    listed = tuple(order) if order is not None else shuffled(corpus.required("train"), seed)
    held_out = corpus.required(split)
    steps = steps_of(sizes, len(listed))
    check_lists(corpus, listed, held_out)
    channels = channels_with_opening(corpus, held_out)
    shares = np.cumsum([0, *steps]) / sum(steps)
    tried = partial(trial, corpus, recogniser=recogniser, lexicon=lexicon, workers=workers)
    rows = []
    for count, (start, stop) in zip(steps, pairwise(shares), strict=True):
        part = part_of(monitor, float(start), float(stop), f"{count} clips: ")
        result = tried(listed[:count], held_out, channels, monitor=part)
        rows.append({"names": count} | _row(corpus, result, seed))
    about = {"split": split or "all", "clips": len(held_out), "seed": seed, "workers": workers}
    about |= {"order": "given" if order is not None else "shuffled", "closed_under": result.found.closed_under}
    figures: dict[str, Any] = defined(about | {"rows": rows})
    return figures


def steps_of(sizes: Sequence[int] | None, listed: int) -> list[int]:
    """Return the sizes, each once, the smallest first; the default ones where none are given.

    listed : how many names there are
    Raises InputError: sizes under 1 or over the list, or an empty list.
    """
    if not listed:
        raise InputError("the list of utterances to train on is empty; give one name a line")
    steps = sorted(set(sizes)) if sizes is not None else [*(n for n in SIZES if n < listed), listed]
    if not steps or not 1 <= steps[0] <= steps[-1] <= listed:
        found = ", ".join(map(str, steps)) or "none"
        raise InputError(f"sizes {found}; required: from 1 to {listed}, which is how many names the list has")
    return steps


def check_lists(corpus: Corpus, listed: Sequence[str], held_out: Sequence[str]) -> None:
    """Raise CorpusError where names to train on are not in the corpus, twice in the list, or among those held out."""
    known, kept = set(corpus.names()), set(held_out)
    wrong = {
        "are not in the corpus; take them out, or prepare them": [name for name in listed if name not in known],
        "are in the split that is compared with; take them out": [name for name in listed if name in kept],
        "stand in the list more than once; keep one of each": [n for n in set(listed) if listed.count(n) > 1],
    }
    for reason, names in wrong.items():
        if names:
            some = ", ".join(sorted(names)[:5]) + (", ..." if len(names) > 5 else "")
            raise CorpusError(f"{corpus.path}: {len(names)} of {len(listed)} names to train on ({some}) {reason}")


def _row(corpus: Corpus, result: Trial, seed: int) -> dict[str, Any]:
    conditions = {name: figures_of(made, result.found, seed) for name, made in result.made.items()}
    return {
        "used": len(result.used),
        "minutes": sum(corpus.utterance(name).audio.duration_s for name in result.used) / 60,
        "seconds": result.seconds,
        "conditions": {name: opening_row(figures) | _others(figures) for name, figures in conditions.items()},
    }


def _others(figures: Mapping[str, Any]) -> dict[str, Any]:
    channels = figures["channels"]
    return {f"acc_{name}": channels[name]["acc"] if name in channels else None for name in OTHERS}


def table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``learning_curve`` as text."""
    order = {"given": "the list given", "shuffled": f"the training list shuffled with seed {figures['seed']}"}
    lines = [
        f"trained on the first N clips of {order[figures['order']]}, with up to {figures['workers']} process(es); "
        f"split {figures['split']}: {figures['clips']} clips"
    ]
    for condition in figures["rows"][0]["conditions"]:
        lines += ["", condition, HEAD, *(_line(row, row["conditions"][condition]) for row in figures["rows"])]
    return "\n".join(lines)


HEAD = f"      N  used  minutes  seconds  {'ACC (95 %)':20}  nRMSE  variance  width  outer"


def _line(row: Mapping[str, Any], made: Mapping[str, Any]) -> str:
    acc = "{:.3f} ({:.3f}–{:.3f})".format(made["acc"], *made["acc_95"])
    others = "".join(f"  {number(made[f'acc_{name}'], '5.3f')}" for name in OTHERS)
    return (
        f"  {row['names']:5}{row['used']:6}{row['minutes']:9.1f}{row['seconds']:9.1f}  {acc:20}"
        f"{made['nrmse']:7.3f}{made['global_variance']:10.2f}{others}"
    )
