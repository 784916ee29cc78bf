"""``lipmotion adapt``: adapt the phone models of a model to the voice of some recordings."""

from __future__ import annotations

import argparse
from typing import Any

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.paths import add_input, add_output
from lipmotion.cli.terminal.printing import print_line
from lipmotion.pipeline.request import Request


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = verbs.add_parser("adapt", help="adapt a model to a voice, from recordings without transcripts")
    recordings: dict[str, Any] = {"nargs": "+", "metavar": "RECORDING", "help": "audio or video of this voice"}
    add_input(parser, "recordings", what="recording", **recordings)
    add_options(parser, Request, "model")
    add_output(parser, "-o", "--output", force=True, required=True, metavar="MODEL")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.adapt`` and ``lipmotion.save_model``; print how much speech was used."""
    from lipmotion.pipeline.model import save_model
    from lipmotion.pipeline.training.train import adapt
    from lipmotion.storage.files import check_target

    check_target(options.output)
    model = adapt(options.model, options.recordings)
    save_model(model, options.output)
    used = model.about["adapted"]
    text = f"{used['recordings']} recordings, {used['speech_s']} s of speech"
    print_line(f"{options.output}: {text}; use it: lipmotion animate SPEECH -o FILE --model {options.output}")
