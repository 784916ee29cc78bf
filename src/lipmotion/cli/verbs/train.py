"""``lipmotion train``: train a model on a corpus; ``lipmotion adapt``: adapt its phone models to a voice."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.declared import add_options
from lipmotion.cli.arguments.options import add_machine_readable, add_verb, count_workers, list_or_all
from lipmotion.cli.terminal.printing import print_line
from lipmotion.cli.terminal.progress import report_progress
from lipmotion.errors import InputError
from lipmotion.pipeline.request import Request
from lipmotion.storage.files import check_target

NONE = "none"
WORKERS = "number of processes (default: one per core), or a Dask scheduler (docs/long-work.md)"


def count_or_address(text: str) -> int | str:
    """Return a number, or the address of a scheduler. Raises ValueError: neither."""
    return text if "://" in text else int(text)


def add(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "train", run)
    add_options(parser, Request, "lexicon")
    parser.add_argument("--workers", type=count_or_address, metavar="N|tcp://HOST:PORT", help=WORKERS)
    add_machine_readable(parser)


def run(options: argparse.Namespace) -> None:
    """Call ``lipmotion.train`` and ``lipmotion.save_model``; report what was used.

    Raises InputError: a model to start from is given, but the engine's models do not stand on others.
    """
    from lipmotion.corpora import Corpus, Selection
    from lipmotion.engines import create_engine, find_visual
    from lipmotion.pipeline.model import GEOMETRY, load_model, save_model
    from lipmotion.pipeline.training.other_speakers import synthesise_others
    from lipmotion.pipeline.training.train import Run, train
    from lipmotion.storage.locks import keep_unfinished
    from lipmotion.units import Lexicon

    workers = options.workers if isinstance(options.workers, str) else count_workers(options)
    preset = " ".join(options.preset) if options.preset else None
    with report_progress(options) as report:
        lexicon = Lexicon.from_file(options.lexicon) if options.lexicon else None
        engine = create_engine(options.engine, preset=preset, units=options.units, settings=options.set)
        stands_on_prior = options.start != NONE and engine.inputs().prior
        if options.start not in ("", NONE) and not stands_on_prior:
            raise InputError(f"the engine {engine.name!r} does not start from another model; leave --from out")
        voices = synthesise_others(
            synthetic=options.voices, recordings=options.recordings, lexicon=lexicon, monitor=report.receive
        )
        with keep_unfinished(options.output) as work:
            model, result = train(
                Corpus.open(options.corpus),
                selection=Selection(list_or_all(options.split), tuple(options.speaker)),
                engine=engine,
                lexicon=lexicon,
                visual=options.visual or find_visual(preset) or GEOMETRY,
                voices=voices,
                prior=load_model(options.start or None) if stands_on_prior else None,
                run=Run(report.receive, work, workers),
            )
            save_model(model, options.output)
        figures = {"used": len(result.used), "minutes": model.about["minutes"], "skipped": len(result.skipped)}
        text = ", ".join(f"{value} {name}" for name, value in figures.items())
        text += f"; use it: lipmotion animate SPEECH -o FILE --model {options.output}"
        report.finish(f"{options.output}: {text}", model=str(options.output), **figures)


def add_adapt(verbs: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the parser of the command line."""
    parser = add_verb(verbs, __package__, "adapt", run_adapt)
    add_options(parser, Request, "model")


def run_adapt(options: argparse.Namespace) -> None:
    """Call ``lipmotion.adapt`` and ``lipmotion.save_model``; print how much speech was used."""
    from lipmotion.pipeline.model import save_model
    from lipmotion.pipeline.training.train import adapt

    check_target(options.output)
    model = adapt(options.model, options.recordings)
    save_model(model, options.output)
    used = model.about["adapted"]
    text = f"{used['recordings']} recordings, {used['speech_s']} s of speech"
    print_line(f"{options.output}: {text}; use it: lipmotion animate SPEECH -o FILE --model {options.output}")
