"""``lipmotion words``: the English words of a recording, in time."""

from __future__ import annotations

import argparse
from typing import Any

from lipmotion.cli.arguments.declared import add_input, add_options, add_output
from lipmotion.cli.arguments.options import add_execution, count_workers
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.pipeline.request import Request


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("words", help="recognise the English words of a recording, as a transcript to edit")
    add_input(parser, "speech", what="recording", help="audio or video file")
    outputs: dict[str, Any] = {"type": str, "nargs": "+", "action": "extend", "default": []}
    written = "FILE.txt, or FILE.json with times and confidences (default: text on standard output)"
    add_output(parser, "-o", "--output", force=True, help=written, **outputs)
    add_options(parser, Request, "recogniser", "model")
    add_execution(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``recognise_words`` and ``write_words``; print the words or the paths that were written."""
    from lipmotion.pipeline.analysis.language import (
        check_word_outputs,
        describe_word,
        format_words,
        recognise_words,
        write_words,
    )

    with report_progress(options) as report:
        check_word_outputs(options.output, options.speech)
        request = Request(options.speech, recogniser=options.recogniser)
        recognition = recognise_words(request, model=options.model, workers=count_workers(options))
        words, similarity = recognition.words, recognition.similarity
        write_words(words, options.output, options.speech)
        report.finish(
            "\n".join(map(str, options.output)) or format_words(words).removesuffix("\n"),
            words=[describe_word(span) for span in words],
            word_s=round(recognition.word_s, 2),
            phone_s=round(recognition.phone_s, 2),
            confidence=round(recognition.confidence or 0.0, 3),
            similarity=None if similarity is None else round(similarity, 2),
        )
