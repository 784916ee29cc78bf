"""Pictures like Figs. 7, 10 and 11 of Xie & Liu 2007. They need the extra ``plots``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from lipmotion.engines.coupled.conversion.em_conversion import convert
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.errors import ExportError, MissingDependencyError
from lipmotion.extensions import install_command
from lipmotion.storage.files import atomic_file, make_folder
from lipmotion.types import GREY, Speech, Timeline
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, HeldOutRecordings, generate_clips
from lipmotion_lab.xie_liu2007.systems import TrainedSystem

CONVERGENCE_RECORDINGS, PREDICTED_RECORDINGS = 8, 6
"""Recordings that are shown in one picture."""
PLOT_FILES = {"start": "conversion.png", "steps": "convergence.png", "clips": "predicted.png"}
PLOT_CAPTIONS = {
    PLOT_FILES["start"]: "As Fig. 7: conversion by ph-vi-CHMM of one recording, from means along the best path by EM",
    PLOT_FILES["steps"]: "As Fig. 10: convergence of the conversion, by steps of EM",
    PLOT_FILES["clips"]: "As Fig. 11: predicted beside recorded motion, ph-vi-CHMM",
}


def import_figure() -> Any:
    """Return matplotlib's class ``Figure``, which needs no screen. Raises MissingDependencyError."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError(
            f"pictures need matplotlib, which cannot be imported ({error}); {install_command('plots')}"
        ) from error
    return Figure


def check_plot_folder(folder: Path) -> None:
    """Check, before long work, that pictures can be written. Raises MissingDependencyError, ExportError."""
    import_figure()
    if not folder.parent.is_dir():
        raise ExportError(f"{folder}: the folder {folder.parent} does not exist; create it first")
    if folder.exists() and not folder.is_dir():
        raise ExportError(f"{folder}: is a file; give a folder for the pictures")


def draw_plots(chains: TrainedSystem, recordings: HeldOutRecordings, folder: Path) -> None:
    """Write pictures of the conversion by EM of the first recordings. Raises MissingDependencyError, ExportError."""
    figure = import_figure()
    some = recordings.first(CONVERGENCE_RECORDINGS)
    by_em = generate_clips(some, AUDIO_ONLY, chains.engine, chains.model)
    path_engine = CoupledEngine(replace(chains.engine.config, conversion="viterbi"))
    by_path = generate_clips(some, AUDIO_ONLY, path_engine, chains.model)
    make_folder(folder)

    picture = figure(figsize=(10, 4.2), layout="constrained")
    axes, clip = picture.subplots(), by_em[0]
    axes.plot(clip.time_s, clip.original[:, 0], "k:", label="recorded")
    axes.plot(by_path[0].time_s, by_path[0].generated[:, 0], color="tab:orange", label="means along the best path")
    axes.plot(clip.time_s, clip.generated[:, 0], color="tab:blue", label="EM, started from these means")
    _label_axes(axes, some, f"Audio to visual conversion: {some.utterances[0].name}")
    axes.set_xlabel("time (s)")
    axes.legend(loc="upper right")
    _save(picture, folder / PLOT_FILES["start"])

    picture = figure(figsize=(7, 4.6), layout="constrained")
    axes, model = picture.subplots(), chains.model
    for utterance in some.utterances:
        observations = model.speech_observations(Speech(utterance.features, Timeline(())))
        steps = convert(model.chains, observations, model.chains.full_lattice, chains.engine.config.em).log_likelihood
        axes.plot(range(len(steps)), steps, "o-", markersize=3, label=utterance.name)
    axes.set_xlabel("step of EM (0: means along the best path)")
    axes.set_ylabel("log likelihood of speech and lips (nats per frame)")
    axes.set_title(f"Convergence of the conversion, {len(some.utterances)} recordings")
    picture.legend(loc="outside right upper", fontsize="small")
    axes.grid(alpha=0.3)
    _save(picture, folder / PLOT_FILES["steps"])

    made = by_em[:PREDICTED_RECORDINGS]
    picture = figure(figsize=(10, 2.2 * len(made)), layout="constrained")
    all_axes = picture.subplots(len(made), 1, squeeze=False)[:, 0]
    for axes, clip, utterance in zip(all_axes, made, some.utterances, strict=False):
        axes.plot(clip.time_s, clip.original[:, 0], "k:", label="recorded")
        axes.plot(clip.time_s, clip.generated[:, 0], color="tab:blue", label="predicted")
        _label_axes(axes, some, f"{utterance.name}: {' '.join(utterance.words or ())}")
    all_axes[0].legend(loc="upper right", ncols=2)
    all_axes[-1].set_xlabel("time (s)")
    _save(picture, folder / PLOT_FILES["clips"])


def _label_axes(axes: Any, recordings: HeldOutRecordings, title: str) -> None:
    name = recordings.channels[0]
    unit = next(c.unit for c in recordings.utterances[0].track.motion.channels if c.name == name).replace("_", " ")
    axes.set_ylabel(f"{name} ({unit}{'s' if unit != GREY else ' levels'})")
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.3)


def _save(picture: Any, path: Path) -> None:
    with atomic_file(path) as unfinished:
        picture.savefig(unfinished, format="png", dpi=110)
