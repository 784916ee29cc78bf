"""``lipmotion adapt``: recordings of a voice to a model that hears it better."""

from __future__ import annotations

import argparse
from typing import Any

from lipmotion.cli.output import say
from lipmotion.cli.paths import add_input, add_output
from lipmotion.cli.speech import add_model_argument


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("adapt", help="make a model hear a voice better, from recordings without transcripts")
    voice: dict[str, Any] = {"nargs": "+", "metavar": "RECORDING", "help": "audio or video of this voice"}
    add_input(parser, "recordings", what="recording", **voice)
    add_model_argument(parser)
    add_output(parser, "-o", "--output", force=True, required=True, metavar="MODEL")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.adapt`` and ``lipmotion.save_model``."""
    from lipmotion.pipeline.adapt import adapt
    from lipmotion.pipeline.model import save_model
    from lipmotion.storage.files import check_target

    check_target(options.output)
    model = adapt(options.model, options.recordings)
    save_model(model, options.output)
    done = model.about["adapted"]
    text = f"{done['recordings']} recordings, {done['speech_s']} s of speech"
    say(f"{options.output}: {text}; use it: lipmotion animate SPEECH -o FILE --model {options.output}")
