"""Measures what a training costs: processor time by stage, workers, and the merging of a thousand hours' statistics.

    python scripts/training_costs.py CORPUS [--clips 40] --engine NAME [NAME=VALUE ...]
    python scripts/training_costs.py CORPUS [--clips 40] --engine NAME --workers 1 2 4
    python scripts/training_costs.py --hours 1000

One JSON object is printed. Processor time is of this process, which the load of the machine changes little.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from collections import defaultdict
from typing import Any

import numpy as np

SHARD_S = 192.0  # speech of a shard: 16 utterances of 12 s


def measure_stages(options: argparse.Namespace) -> dict[str, Any]:
    """Return processor hours an hour of speech, by stage of the training."""
    seconds, begun_s, stage = defaultdict[str, float](float), time.process_time(), "reading"

    def note(event: Any) -> None:
        nonlocal begun_s, stage
        now_s = time.process_time()
        seconds[stage] += now_s - begun_s
        begun_s, stage = now_s, getattr(event, "stage", stage)

    minutes = _train(options, note, 1)
    seconds[stage] += time.process_time() - begun_s
    return {"minutes": minutes, "hours an hour": {name: s / 60 / minutes for name, s in seconds.items()}}


def measure_workers(options: argparse.Namespace) -> dict[str, Any]:
    """Return wall and processor seconds for each number of processes."""
    rows = {}
    for count in options.workers:
        begun_s = time.monotonic()
        before = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
        minutes = _train(options, lambda _: None, count)
        after = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
        used = [b.ru_utime + b.ru_stime - a.ru_utime - a.ru_stime for a, b in zip(before, after, strict=True)]
        rows[count] = {"wall_s": time.monotonic() - begun_s, "first_s": used[0], "others_s": used[1]}
    return {"minutes": minutes, "workers": rows}


def _train(options: argparse.Namespace, monitor: Any, workers: int) -> float:
    from lipmotion import Corpus, Run, Selection, train
    from lipmotion.engines import create_engine
    from lipmotion.pipeline import workers as pools

    pools.UTTERANCES_PER_WORKER = 1
    corpus = Corpus.open(options.corpus)
    names = corpus.names("train")[: options.clips]
    engine = create_engine(options.engine, preset=None, units=None, settings=options.setting)
    model, _ = train(corpus, selection=Selection(names=names), engine=engine, run=Run(monitor, workers=workers))
    return float(model.about["minutes"])


def expect(job: tuple[int, int]) -> dict[str, Any]:
    """Return statistics of a synthetic shard; of a model of so many numbers."""
    size, shard = job
    return {"moments": np.full(size, float(shard)), "frames": np.array(SHARD_S * 100)}


def measure_merging(hours: float, megabytes: float) -> dict[str, Any]:
    """Return seconds and memory of summing the statistics of many shards."""
    from lipmotion.stats.em import sum_statistics
    from lipmotion.storage.archive import NO_CHECKPOINT

    shards, rows = range(round(hours * 3600 / SHARD_S)), []
    for count in (len(shards) // 100, len(shards)):
        begun_s = time.process_time()
        sums = sum_statistics(expect, round(megabytes * 1e6 / 8), shards[:count], NO_CHECKPOINT)
        used_s, memory = time.process_time() - begun_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        rows.append({"hours": float(sums["frames"]) / 360_000, "seconds": used_s, "peak_mb": memory})
    return {"megabytes": megabytes, "rows": rows}


def main() -> None:
    """Print what is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", nargs="?")
    parser.add_argument("--clips", type=int, default=40)
    parser.add_argument("--engine", default="joint")
    parser.add_argument("--setting", nargs="*", default=[])
    parser.add_argument("--workers", type=int, nargs="*")
    parser.add_argument("--hours", type=float)
    parser.add_argument("--megabytes", type=float, default=10.0, help="statistics of a shard")
    options = parser.parse_args()
    if options.hours:
        result = measure_merging(options.hours, options.megabytes)
    else:
        result = measure_workers(options) if options.workers else measure_stages(options)
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
