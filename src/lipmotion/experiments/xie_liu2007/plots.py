"""Pictures like Figs. 7, 10 and 11 of Xie & Liu 2007. They need the extra ``plots``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.engines.coupled.conversion.em import converted
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.errors import ExportError, MissingDependencyError
from lipmotion.experiments.noise import AUDIO_ONLY
from lipmotion.experiments.xie_liu2007.systems import Contender
from lipmotion.pipeline.evaluation.evaluate import Clip, Recorded, clips
from lipmotion.storage.files import whole_file
from lipmotion.types import GREY

EIGHT, SIX = 8, 6
DOTS_AN_INCH = 110
NAMES = {"start": "conversion.png", "steps": "convergence.png", "clips": "predicted.png"}
"""Like Figs. 7, 10 and 11."""


def import_figure() -> Any:
    """Return matplotlib's class ``Figure``, which needs no screen. Raises MissingDependencyError."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            f'pictures need matplotlib, which cannot be imported ({error}); pip install "lipmotion[plots]"'
        ) from error
    return Figure


def check_plots(folder: Path) -> None:
    """Find out before the long work whether pictures can be drawn, and written into a folder that may yet be made.

    Raises MissingDependencyError: no matplotlib. Raises ExportError: the folder cannot be made.
    """
    import_figure()
    if not folder.parent.is_dir():
        raise ExportError(f"{folder}: the folder {folder.parent} does not exist; create it first")
    if folder.exists() and not folder.is_dir():
        raise ExportError(f"{folder}: is a file; give a folder for the pictures")


def draw_plots(chains: Contender, found: Recorded, folder: Path) -> None:
    """Write pictures of coupled chains that convert by EM: of the first recordings, audio only.

    folder : made if it is not there
    Raises MissingDependencyError: no matplotlib. Raises ExportError: a picture cannot be written.
    """
    figure = import_figure()
    few = replace(
        found,
        utterances=found.utterances[:EIGHT],
        reference=found.reference[:EIGHT],
        conditions={AUDIO_ONLY: found.conditions[AUDIO_ONLY][:EIGHT]},
    )
    by_em = clips(few, AUDIO_ONLY, chains.engine, chains.model)
    path_engine = CoupledEngine(replace(chains.engine.config, conversion="viterbi"))
    by_path = clips(few, AUDIO_ONLY, path_engine, chains.model)
    folder.mkdir(parents=True, exist_ok=True)
    _save(_conversion(figure, few, by_em[0], by_path[0]), folder / NAMES["start"])
    _save(_convergence(figure, few, chains), folder / NAMES["steps"])
    _save(_predicted(figure, few, by_em[:SIX]), folder / NAMES["clips"])


def _conversion(figure: Any, found: Recorded, by_em: Clip, by_path: Clip) -> Any:
    drawn = figure(figsize=(10, 4.2), layout="constrained")
    axes = drawn.subplots()
    axes.plot(by_em.time_s, by_em.original[:, 0], "k:", label="recorded")
    axes.plot(by_path.time_s, by_path.generated[:, 0], color="tab:orange", label="means along the best path")
    axes.plot(by_em.time_s, by_em.generated[:, 0], color="tab:blue", label="EM, started from them")
    _labelled(axes, found, f"Audio to visual conversion: {found.utterances[0].name}")
    axes.set_xlabel("time (s)")
    axes.legend(loc="upper right")
    return drawn


def _convergence(figure: Any, found: Recorded, chains: Contender) -> Any:
    drawn = figure(figsize=(7, 4.6), layout="constrained")
    axes = drawn.subplots()
    engine, model = chains.engine, chains.model
    for utterance in found.utterances:
        observed = model.unseen(np.asarray(utterance.features.values))
        steps = converted(model.chains, observed, model.chains.everywhere, engine.config.em).log_likelihood
        axes.plot(range(len(steps)), steps, "o-", markersize=3, label=utterance.name)
    axes.set_xlabel("step of EM (0: means along the best path)")
    axes.set_ylabel("log likelihood of sound and lips (nats a frame)")
    axes.set_title(f"Convergence of the conversion, {len(found.utterances)} recordings")
    drawn.legend(loc="outside right upper", fontsize="small")
    axes.grid(alpha=0.3)
    return drawn


def _predicted(figure: Any, found: Recorded, made: list[Clip]) -> Any:
    drawn = figure(figsize=(10, 2.2 * len(made)), layout="constrained")
    every = drawn.subplots(len(made), 1, squeeze=False)[:, 0]
    for axes, clip, utterance in zip(every, made, found.utterances, strict=False):
        axes.plot(clip.time_s, clip.original[:, 0], "k:", label="recorded")
        axes.plot(clip.time_s, clip.generated[:, 0], color="tab:blue", label="predicted")
        _labelled(axes, found, f"{utterance.name}: {' '.join(utterance.words or ())}")
    every[0].legend(loc="upper right", ncols=2)
    every[-1].set_xlabel("time (s)")
    return drawn


def _labelled(axes: Any, found: Recorded, title: str) -> None:
    name = found.channels[0]
    unit = next(c.unit for c in found.utterances[0].track.motion.channels if c.name == name).replace("_", " ")
    axes.set_ylabel(f"{name} ({unit}{'s' if unit != GREY else ' levels'})")
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.3)


def _save(drawn: Any, path: Path) -> None:
    with whole_file(path) as unfinished:
        drawn.savefig(unfinished, format="png", dpi=DOTS_AN_INCH)
