"""``lipmotion experiment unit-sets``: the tables of the papers, on a corpus."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from lipmotion.cli.options import add_machine_readable


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("experiment", help="train and compare systems on a corpus, as the papers did")
    actions = parser.add_subparsers(title="experiments", required=True, metavar="EXPERIMENT")
    sets = actions.add_parser("unit-sets", help="which units find the closings of the mouth (Hofer 2008, Table 1)")
    sets.add_argument("corpus", type=Path)
    sets.add_argument("--split", default="test", help="compare on train, val, test or all (default: test)")
    sets.add_argument("--closures", action="store_true", help="make the lips meet in every p, b and m")
    sets.add_argument("--lexicon", type=Path, metavar="FILE", help="pronunciations: WORD PHONE PHONE ... a line")
    sets.add_argument("--workers", type=int, help="processes (default: one a core)")
    sets.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="write all figures here as well")
    add_machine_readable(sets)
    sets.set_defaults(run=run_unit_sets)


def run_unit_sets(options: argparse.Namespace) -> None:
    """Call ``experiment.unit_sets`` and print its table."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # the processes share the cores

    import json

    from lipmotion.cli.progress import reporting
    from lipmotion.corpora.store import Corpus
    from lipmotion.experiment.unit_sets import table, unit_sets
    from lipmotion.files import check_target, whole_file
    from lipmotion.units import Lexicon

    with reporting(options) as report:
        if options.output:
            check_target(options.output)
        lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
        chosen = {"split": None if options.split == "all" else options.split, "closures": options.closures}
        chosen |= {"lexicon": lexicon, "workers": options.workers or os.cpu_count() or 1}
        figures = unit_sets(Corpus.open(options.corpus), **chosen, monitor=report.hear)
        if options.output:
            with whole_file(options.output) as unfinished:
                unfinished.write_text(json.dumps(figures, indent=1, allow_nan=False) + "\n")
        report.finish(table(figures), figures=figures)
