"""``lipmotion explain``: states, probabilities and Gaussians behind a generated frame."""

from __future__ import annotations

import argparse

from lipmotion.cli.output import print_json, print_lines
from lipmotion.cli.paths import add_input
from lipmotion.cli.speech import add_speech_arguments, request_and_model


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("explain", help="print which states and Gaussians the motion of a frame comes from")
    add_input(
        parser, "former_model", what="model", nargs="?", help=argparse.SUPPRESS
    )  # explain MODEL SPEECH, before 0.2
    add_speech_arguments(parser)
    parser.add_argument(
        "--at", type=float, action="append", required=True, metavar="SECONDS", help="time of a frame (repeatable)"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object per time, with all channels")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.explain`` and print the explanations."""
    from lipmotion.pipeline.explain import explain, explanation_document, explanation_text

    options.model = options.former_model or options.model
    request, model = request_and_model(options)
    explanations = explain(request, at=options.at, model=model)
    if options.json:
        for explanation in explanations:
            print_json(explanation_document(explanation))
    else:
        print_lines("\n\n".join(map(explanation_text, explanations)))
