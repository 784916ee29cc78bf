"""Fuzz every reader for a while.

    PYTHONPATH=tests python -m fuzz [--minutes 10] [--reader NAME ...] [--seed 0]

The minutes are shared between the readers; making the good input (a minute) is not counted. Each defect is stored in a
folder of its own, its trace beside it; a copy in ``tests/fuzz/found/READER`` is a test. Exit code 1: defects.
"""

import argparse
import os
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # of the processes that read
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from fuzz.campaign import CampaignRecord, campaign
from fuzz.inputs import Good
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
    paths = {name: folder / f"{name}.lipmotion" for name in ENGINES}
    for name, path in paths.items():
        model, _ = train(corpus, recogniser=SMALL, engine=engine_named(name, ENGINES[name]))
        save_model(model, path)
    return Good(folder / "corpus", tuple(paths.values()))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--reader", action="append", choices=sorted(READERS), help="this one only (repeatable)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--found", type=Path, default=Path("build/fuzz"), help="where defects go (default: build/fuzz)")
    options = parser.parse_args()
    names = options.reader or list(READERS)
    workers = min(os.cpu_count() or 1, len(names))
    budget_s = 60 * options.minutes * workers / len(names)

    def fuzz(name: str) -> CampaignRecord:
        with Worker(good) as worker:
            end_s = time.monotonic() + budget_s
            record = campaign(READERS[name], worker, good, options.seed, lambda _: time.monotonic() < end_s)
        print(f"{name}: {dict(record.kinds)}", *record.keep(options.found), sep="\n  ", flush=True)
        return record

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
        good = make_good(Path(folder))
        return int(any(record.findings for record in pool.map(fuzz, names)))


if __name__ == "__main__":
    sys.exit(main())
