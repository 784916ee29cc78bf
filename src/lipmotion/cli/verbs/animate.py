"""``lipmotion animate``: generate lip motion from speech, as motion files and videos."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from lipmotion.cli.arguments.options import add_execution
from lipmotion.cli.arguments.paths import add_output
from lipmotion.cli.arguments.pipes import add_pipe_format, is_pipe, read_pipe, written_pipe
from lipmotion.cli.arguments.results import add_result_arguments, check_results, work_of, write_results
from lipmotion.cli.arguments.several import add_kinds_argument, animated_one_by_one
from lipmotion.cli.arguments.speech import add_speech_arguments, model_loader, spoken_request
from lipmotion.cli.terminal.output import print_note
from lipmotion.printable import printable

if TYPE_CHECKING:
    from lipmotion.cli.terminal.progress import Report
    from lipmotion.pipeline.model import Model


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("animate", help="turn speech into lip motion or an animated face")
    add_speech_arguments(parser, several=True)
    add_result_arguments(parser, "FILE.mp4 .webm .mov %%05d.png .json .csv .vtt, ... (docs/formats.md); FOLDER/; -")
    add_output(parser, "--posteriors", metavar="FILE.png", help="draw the posteriors of units over time (coupled)")
    for add_more in (add_kinds_argument, add_pipe_format, add_execution):
        add_more(parser)
    parser.set_defaults(run=run, piped=False, words_beside=False)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.animate`` and ``lipmotion.write``; print the paths that were written."""
    from lipmotion.cli.terminal.progress import reporting

    load, note = model_loader(options), ""
    with reporting(options) as report:
        if animated_one_by_one(options, report, partial(_animate, load)):
            return
        options.piped = is_pipe(options.speech[0])
        with read_pipe(options.speech[0]) as options.speech, written_pipe(options) as pipe:
            note = _animate(load, options, report)
        written = [str(path) for path in (*options.output, options.posteriors) if path and not pipe]
        report.finish("\n".join(map(printable, written)), files=written)
    print_note(note)


def _animate(load: Callable[[], Model], options: argparse.Namespace, report: Report) -> str:
    """Write the outputs of one recording; return what is to be said of it."""
    from lipmotion.pipeline.generate.animate import animate
    from lipmotion.pipeline.generate.posteriors import animate_with_posteriors, check_picture, write_posteriors

    check_results(options, options.speech)
    if options.posteriors:
        check_picture(options.posteriors, options.speech)
    request, model = spoken_request(options, options.words_beside), load()
    if request.onto is None:
        request = replace(request, onto=options.face.other_person(model, options.speaker))
    if options.posteriors:
        result, posteriors = animate_with_posteriors(request, model=model)
        write_posteriors(options.posteriors, result, posteriors)
    else:
        result = animate(request, model=model, **work_of(options, report))
    write_results(options, result, options.speech, model, report, options.piped)
    return result.outlook.text if result.outlook is not None else ""
