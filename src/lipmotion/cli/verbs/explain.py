"""``explain``: states, probabilities, Gaussians behind a frame, or the states of all; ``words``: what is said, when."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from lipmotion.cli.arguments.declared import add_input, add_options, add_output, pick_part
from lipmotion.cli.arguments.options import add_arguments, add_execution, add_verb, count_workers
from lipmotion.cli.terminal.printing import print_json, print_lines
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.pipeline.request import Request


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("explain", help="print which states and Gaussians the motion of a frame comes from")
    add_options(parser, Request, but=("edits",))
    add_arguments(parser, __package__, "explain")
    parser.set_defaults(run=run, machine_readable=False)


def run(options: argparse.Namespace) -> None:
    """Print what ``lipmotion.explain`` returns; without a time, what ``lipmotion.state_runs`` does."""
    from lipmotion.pipeline.analysis.read_request import read_request
    from lipmotion.pipeline.generate import explain
    from lipmotion.pipeline.session import NO_EDITS, Session

    with report_progress(options) as report:
        session = Session(read_request(pick_part(options, Request())), monitor=report.receive)
        if options.at is not None:
            frames = explain.explain_session(session, NO_EDITS, options.at)
            documents, text = map(explain.write_document, frames), "\n\n".join(map(explain.write_explanation, frames))
        else:
            runs = explain.list_runs(session.generate())
            documents, text = map(asdict, runs), "\n".join(explain.run_lines(runs, options.count))
    if not options.json:
        print_lines(text)
        return
    for document in documents:
        print_json(document)


def add_words(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "words", run_words)
    add_input(parser, "speech", what="recording", help="audio or video file")
    outputs: dict[str, Any] = {"type": str, "nargs": "+", "action": "extend", "default": []}
    written = "FILE.txt, or FILE.json with times and confidences (default: text on standard output)"
    add_output(parser, "-o", "--output", force=True, help=written, **outputs)
    add_options(parser, Request, "recogniser", "model")
    add_execution(parser)


def run_words(options: argparse.Namespace) -> None:
    """Recognise words; print them, or the paths of the files that were written."""
    from lipmotion.pipeline.analysis import language

    with report_progress(options) as report:
        paths = language.check_word_outputs(options.output, options.speech)
        request = Request(options.speech, recogniser=options.recogniser)
        how: dict[str, Any] = {"workers": count_workers(options), "monitor": report.receive}
        recognition = language.recognise_words(request, model=options.model, **how)
        language.write_words(recognition.words, paths)
        report.finish(
            "\n".join(map(str, options.output)) or language.format_words(recognition.words).removesuffix("\n"),
            words=language.describe_words(recognition.words),
            confidence=round(recognition.confidence or 0.0, 3),
        )
