"""The guide of unit selection where there is little motion: a regression, or a network of posteriors?

    python benchmarks/selection_guide.py CORPUS --order FILE [--sizes 10,20,50]

Printed: ACC of opening, width and outer on `val`, unpinned, of models of the first N recordings in the file, which
stand on no other model.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from lipmotion import Corpus
from lipmotion.corpora.splits import read_names
from lipmotion.corpora.store import Selection
from lipmotion.engines import engine_named
from lipmotion.pipeline.training.train import train
from lipmotion_lab.evaluation.evaluate import evaluate

CHANNELS = ("opening", "width", "outer")
GUIDES = ("prior", "posteriors")


def main() -> None:
    """Print one JSON object for each size and guide."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--order", type=Path, required=True)
    parser.add_argument("--sizes", default="10,20,50")
    options = parser.parse_args()
    corpus, order = Corpus.open(options.corpus), read_names(options.order)
    for size in map(int, options.sizes.split(",")):
        for guide in GUIDES:
            engine = engine_named("selection", {"predictor": guide})
            model, _ = train(corpus, selection=Selection(names=order[:size]), engine=engine)
            conditions = evaluate(model, corpus, selection=Selection("val"))["conditions"]
            free = {name: found.get("unpinned", found)["channels"] for name, found in conditions.items()}
            acc = {name: [round(found[channel]["acc"], 3) for channel in CHANNELS] for name, found in free.items()}
            print(json.dumps({"clips": size, "guide": guide, "acc": acc}), flush=True)


if __name__ == "__main__":
    main()
