"""``lipmotion explain``: print the states, probabilities and Gaussians behind a frame, or the states of all."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from lipmotion.cli.arguments.declared import add_options, pick_part
from lipmotion.cli.terminal.printing import print_json, print_lines
from lipmotion.pipeline.request import Request

RUNS = 2000


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("explain", help="print which states and Gaussians the motion of a frame comes from")
    add_options(parser, Request, but=("edits",))
    times = "time of a frame (repeatable; default: list the states of the whole recording)"
    parser.add_argument("--at", type=float, action="append", metavar="SECONDS", help=times)
    most = f"without --at: print at most N lines (default: {RUNS})"
    parser.add_argument("--count", type=int, default=RUNS, metavar="N", help=most)
    parser.add_argument("--json", action="store_true", help="print one JSON object per time, with all channels, or run")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.explain`` and print the explanations; without a time, ``lipmotion.state_runs`` and the runs."""
    from lipmotion.pipeline.analysis.read_request import read_request
    from lipmotion.pipeline.generate.explain import explain, run_lines, state_runs, write_document, write_explanation
    from lipmotion.pipeline.model import load_model

    requested = pick_part(options, Request())
    request, model = read_request(requested), load_model(requested.model)
    if options.at is not None:
        explanations = explain(request, at=options.at, model=model)
        documents, text = map(write_document, explanations), "\n\n".join(map(write_explanation, explanations))
    else:
        runs = state_runs(request, model=model)
        documents, text = map(asdict, runs), "\n".join(run_lines(runs, options.count))
    if not options.json:
        print_lines(text)
        return
    for document in documents:
        print_json(document)
