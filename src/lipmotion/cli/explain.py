"""``lipmotion explain``: what stands behind a frame."""

from __future__ import annotations

import argparse
from pathlib import Path

from lipmotion.cli.speech import add_hearing_arguments, speech_arguments


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("explain", help="say which states and Gaussians a model's motion comes from")
    parser.add_argument("model", type=Path)
    add_hearing_arguments(parser)
    parser.add_argument(
        "--at", type=float, action="append", required=True, metavar="SECONDS", help="which frame (repeatable)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a time, with all channels")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.explain`` and print what it found."""
    from lipmotion.json_text import as_json, defined
    from lipmotion.pipeline.explain import explain, explanation_document, explanation_text

    found = explain(speech=options.speech, at_s=options.at, **speech_arguments(options))
    if options.json:
        for explanation in found:
            print(as_json(defined(explanation_document(explanation))))
    else:
        print("\n\n".join(map(explanation_text, found)))
