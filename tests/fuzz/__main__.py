"""Fuzz every reader for a while.

    PYTHONPATH=tests python -m fuzz [--minutes 10] [--reader NAME ...] [--seed 0]
    PYTHONPATH=tests python -m fuzz --reader NAME --replay FOLDER

The minutes are shared between the readers; making the good input (a minute) is not counted. Each defect is stored in a
folder of its own, reduced, with its trace beside it; ``--replay`` reads such a folder again. Exit code 1: defects.
"""

import argparse
import os
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # of the processes that read
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from fuzz.campaign import CampaignRecord, campaign, keep, row
from fuzz.inputs import Good, picked_up
from fuzz.judge import READ, REFUSED
from fuzz.readers import READERS
from fuzz.worker import Worker
from lipmotion import Corpus, save_model, train
from lipmotion.engines import engine_named
from testing.toy import SMALL, toy_utterances

SENTENCES = 6
ENGINES: dict[str, dict[str, object]] = {
    "trajectory": {},
    "coupled": {"chains": "sVis 2vis", "mixtures": 1, "states": 2},
    "joint": {},
}


def make_good(folder: Path) -> Good:
    """Prepare a corpus, and train a model of every engine on it."""
    corpus = Corpus.create(folder / "corpus")
    for utterance in toy_utterances(SENTENCES):
        corpus.add(utterance)
    for name, options in ENGINES.items():
        engine = engine_named(name, options)
        model, _ = train(corpus, recogniser=SMALL, engine=engine)
        save_model(model, folder / f"{name}.lipmotion")
    return good_in(folder)


def good_in(folder: Path) -> Good:
    return Good(folder / "corpus", tuple(folder / f"{name}.lipmotion" for name in ENGINES))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--reader", action="append", choices=sorted(READERS), help="this one only (repeatable)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="readers at a time (default: one a core)"
    )
    parser.add_argument("--found", type=Path, default=Path("build/fuzz"), help="where defects go (default: build/fuzz)")
    parser.add_argument("--replay", type=Path, metavar="FOLDER", help="read one kept input; says what becomes of it")
    parser.add_argument("--good", type=Path, metavar="FOLDER", help="keep the good input here, for further runs")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = options.good or Path(folder) / "good"
        good = good_in(place) if place.is_dir() else make_good(place)
        return replay(options, good) if options.replay else fuzz(options, good)


def fuzz(options: argparse.Namespace, good: Good) -> int:
    """Fuzz the readers, several at a time; Ctrl-C ends it early, with the table."""
    names = options.reader or list(READERS)
    workers = max(1, min(options.workers, len(names)))
    stopped = threading.Event()
    budget_s = 60 * options.minutes * workers / len(names)

    def one(name: str) -> CampaignRecord:
        with Worker(good) as worker:
            end_s = time.monotonic() + (0 if stopped.is_set() else budget_s)
            begin = (READERS[name], worker, good, options.seed)
            record = campaign(*begin, lambda _: time.monotonic() < end_s and not stopped.is_set())
            defects = sum(found.count for found in record.findings.values())
            print(f"{name}: {record.distinct} inputs, {defects} defects", file=sys.stderr, flush=True)
            for place in keep(record, worker, options.found):
                print(f"{name}: {place}; again: python -m fuzz --reader {name} --replay {place}", file=sys.stderr)
            return record

    with ThreadPoolExecutor(workers) as pool:
        runs = [pool.submit(one, name) for name in names]
        try:
            wait(runs)
        except KeyboardInterrupt:
            stopped.set()
        records = [run.result() for run in runs]
    print(*map(row, records), sep="\n")
    return int(any(record.findings for record in records))


def replay(options: argparse.Namespace, good: Good) -> int:
    name = options.reader[0] if options.reader else options.replay.parent.name
    with Worker(good) as worker:
        result = worker.read_input(name, picked_up(options.replay))
    print(f"{result.kind}: {result.where}\n{result.detail}")
    return int(result.kind not in (READ, REFUSED))


if __name__ == "__main__":
    sys.exit(main())
