"""Quality over the amount of training data: models of the first N recordings of a list, for growing N."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.corpora import Corpus, Selection
from lipmotion.engines import engine_named
from lipmotion.kernels.compiler import limit_threads
from lipmotion.motion.space import resample_track
from lipmotion.storage.json_text import replace_nan
from lipmotion.types import Example, Speech, Timeline
from lipmotion_lab import runner
from lipmotion_lab.evaluation.evaluate import measure_clips, pair_curves, sum_correlations
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, generate_clips, load_held_out
from lipmotion_lab.xie_liu2007.systems import BLSTM, as_row, find_best_trial, tune_network, with_inputs_of

OTHERS = ("width", "outer")  # channels that are compared beside the opening
_ROW = "row"


@limit_threads()
def run_learning_curve(
    corpus: Corpus,
    *,
    order: Sequence[str] | None = None,
    sizes: Sequence[int] | None = None,
    split: str | None = "test",
    rival: bool = False,
    work: Path | None = None,
    settings: runner.ExperimentSettings = runner.DEFAULT_SETTINGS,
) -> dict[str, Any]:
    """Train on the first N utterances of a list, for every N of ``sizes``; return figures of each model on ``split``.

    sizes    : by default 20, 50, 100, 200, as far as the list goes, and the whole list
    rival    : train a BLSTM on the same utterances, with the settings that are best on ``val``, and compare
    Phone models and engine are both trained on those N utterances alone; the phone models also align and recognise
    the utterances of the split.
    Raises InputError: sizes under 1 or over the list, or an empty list.
    Raises CorpusError: names that are not in the corpus, twice in the list or in the split; no utterances of this
    split; or motion without an opening.
    """
    held_out, validation = corpus.required(split), corpus.required("val") if rival else ()
    listed = runner.choose_training_names(corpus, order, settings.seed, (*held_out, *validation))
    steps = runner.choose_sizes(sizes, len(listed))
    channels = runner.check_opening(corpus, held_out)
    key = runner.PartKey(engine_named("trajectory"), (*listed, *held_out, *validation), others=BLSTM * rival)
    checkpoint = runner.open_parts(work, corpus, settings, key)
    rows, parts = [], runner.share_out(settings, [f"{count} clips" for count in steps], sizes=steps)
    for count, part in zip(steps, parts, strict=True):
        arrays = checkpoint.load(str(count))
        if arrays is None:
            result = runner.train_and_generate(corpus, listed[:count], held_out, channels, part, work)
            row = {"names": count} | _make_row(corpus, result, settings.seed)
            if rival:
                row[BLSTM] = _compare_network(corpus, result, validation, part)
            for condition, clips in result.clips.items():
                settings.receive(f"{count} recordings", condition, result.recordings, clips)
            arrays = {_ROW: np.array(json.dumps([result.recordings.closed_under, row]))}
            checkpoint.save(str(count), arrays)
        closed_under, row = json.loads(str(arrays[_ROW]))
        rows.append(row)
    about = {"split": split or "all", "clips": len(held_out), "seed": settings.seed, "workers": settings.workers}
    about |= {"order": "given" if order is not None else "shuffled", "closed_under": closed_under}
    return replace_nan(about | {"rows": rows})


def _make_row(corpus: Corpus, result: runner.HeldOutResult, seed: int) -> dict[str, Any]:
    """Return the figures of one model, by condition; None for channels that the corpus does not have."""
    conditions = {}
    for name, clips in result.clips.items():
        figures = measure_clips(clips, result.recordings, seed)
        accs = {f"acc_{other}": figures["channels"].get(other, {}).get("acc") for other in OTHERS}
        conditions[name] = runner.make_opening_row(figures) | accs
    return {
        "used": len(result.used),
        "minutes": sum(corpus.utterance(name).audio.duration_s for name in result.used) / 60,
        "seconds": result.seconds,
        "conditions": conditions,
    }


def _compare_network(
    corpus: Corpus, result: runner.HeldOutResult, validation: Sequence[str], settings: runner.ExperimentSettings
) -> dict[str, Any]:
    """Return the figures of a BLSTM, and the gains of our model without pins over it, from sound alone."""
    recordings, examples = result.recordings, list[Example]()
    for name in result.used:
        utterance = corpus.utterance(name)
        motion, valid = resample_track(utterance.track, len(utterance.features.values))
        examples.append(Example(name, Speech(utterance.features, Timeline(())), motion, valid))
    judges = load_held_out(
        corpus, recordings.phones, selection=Selection(names=validation), channels=recordings.channels
    )
    system = tune_network(with_inputs_of(BLSTM, examples, corpus), judges, settings.monitor)
    clips = generate_clips(recordings, AUDIO_ONLY, system.engine, system.model)
    free = result.model.engine.without_closures()
    ours = generate_clips(recordings, AUDIO_ONLY, free, result.model.learned)
    channels: dict[str, Any] = {}
    for channel in recordings.channels:
        own, other = (sum_correlations(*pair_curves(recordings, made, channel)) for made in (ours, clips))
        channels[channel] = {"ours": own.value, "acc": other.value, "acc_95": other.compute_interval(settings.seed)}
        channels[channel]["gain_95"] = own.compute_gain(other, settings.seed)
    best = find_best_trial(system.tried).options
    return {"options": best, "tried": [*map(as_row, system.tried)], "channels": channels}
