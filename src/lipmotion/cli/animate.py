"""``lipmotion animate``: generate lip motion from speech, as motion files and videos."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from lipmotion.cli.options import add_execution, worker_count
from lipmotion.cli.output import print_note
from lipmotion.cli.paths import add_output
from lipmotion.cli.results import add_result_arguments, check_results, load_what_draws, write_results
from lipmotion.cli.speech import add_speech_arguments, request_and_model
from lipmotion.printable import printable

if TYPE_CHECKING:
    from lipmotion.cli.progress import Report
    from lipmotion.types.generation import Outlook


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("animate", help="turn speech into lip motion or an animated face")
    add_speech_arguments(parser)
    add_result_arguments(parser, "FILE.mp4 .webm .mov %%05d.png .json .csv .npz .TextGrid, or several")
    posteriors = "draw the posterior probabilities of the chains' units over time (coupled models)"
    add_output(parser, "--posteriors", metavar="FILE.png", help=posteriors)
    add_execution(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.animate`` and ``lipmotion.write``; print the paths that were written."""
    from lipmotion.cli.progress import reporting

    with reporting(options) as report:
        outlook = _animate(options, report)
    if outlook is not None:
        print_note(outlook.text)


def _animate(options: argparse.Namespace, report: Report) -> Outlook | None:
    """Write the outputs; return what is to be said of the recording."""
    from lipmotion.pipeline.animate import animate
    from lipmotion.pipeline.film.video import person_shown
    from lipmotion.pipeline.posteriors import animate_with_posteriors, check_picture, write_posteriors

    check_results(options, options.speech)
    if options.posteriors:
        check_picture(options.posteriors, options.speech)
    request, model = request_and_model(options)
    if request.onto is None:
        request = replace(request, onto=person_shown(model, options.face, options.speaker))
    if options.posteriors:
        result, posteriors = animate_with_posteriors(request, model=model)
        write_posteriors(options.posteriors, result, posteriors)
    else:
        load = partial(load_what_draws, options)
        result = animate(request, model=model, workers=worker_count(options), meanwhile=load)
    write_results(options, result, options.speech, model, report)
    written = [str(path) for path in (*options.output, options.posteriors) if path]
    report.finish("\n".join(map(printable, written)), files=written)
    return result.outlook
