"""``lipmotion adapt``: recordings of a voice to a model that hears it better."""

from __future__ import annotations

import argparse
from pathlib import Path


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb."""
    parser = verbs.add_parser("adapt", help="make a model hear a voice better, from recordings without transcripts")
    parser.add_argument("recordings", type=Path, nargs="+", metavar="RECORDING", help="audio or video of this voice")
    parser.add_argument("--model", type=Path, help="trained model (default: the one that ships with the package)")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MODEL")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.adapt`` and ``lipmotion.save_model``."""
    from lipmotion.files import check_target
    from lipmotion.pipeline.adapt import adapt
    from lipmotion.pipeline.model import save_model

    for recording in options.recordings:
        check_target(options.output, recording)
    model = adapt(options.model, options.recordings)
    save_model(model, options.output)
    done = model.about["adapted"]
    text = f"{done['recordings']} recordings, {done['speech_s']} s of speech"
    print(f"{options.output}: {text}; use it: lipmotion animate SPEECH -o FILE --model {options.output}")
