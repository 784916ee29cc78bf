from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.conftest import SETTINGS, copied
from lipmotion import Corpus, Selection, errors, train
from lipmotion.measures import closures, curves
from lipmotion.speech.recognition.recogniser import open_recogniser
from lipmotion_lab import folds as module
from lipmotion_lab import runner
from lipmotion_lab.evaluation import evaluate
from lipmotion_lab.evaluation.held_out import ComparedClip, generate_clips, load_held_out
from lipmotion_lab.folds import cross_validate, cross_validate_blocks
from lipmotion_lab.report.sections import build_blocks_section, build_folds_section
from testing.toy import SMALL

CONDITIONS = ["audio only", "with transcript"]
RATE_HZ = 25
OPENING_ROW = (
    *("score", "precision", "timing_ms", "closings", "generated_closings", "recall_p_b_m", "p_b_m"),
    *("acc", "nrmse", "global_variance"),
)


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus) -> dict[str, Any]:
    return cross_validate(toy_corpus, count=2, settings=SETTINGS)


@pytest.fixture(scope="module")
def by_hand(toy_corpus: Corpus) -> list[ComparedClip]:
    """Every clip of the training list, generated with its transcript by a model that was not trained on it."""
    names = toy_corpus.names("train")
    mixed = [names[i] for i in np.random.default_rng(0).permutation(len(names))]
    made = []
    for held_out in (mixed[0::2], mixed[1::2]):
        model = train(toy_corpus, selection=Selection(names=sorted(set(names) - set(held_out))), recogniser=SMALL)[0]
        found = load_held_out(toy_corpus, open_recogniser(model.phones), selection=Selection(names=sorted(held_out)))
        made += generate_clips(found, "with transcript", model.engine, model.learned)
    return made


@pytest.mark.long
def test_figures_are_of_all_clips_as_one_split(figures, by_hand):
    generated = np.concatenate([clip.generated[:, 0] for clip in by_hand])
    original = np.concatenate([clip.original[:, 0] for clip in by_hand])
    row = figures["conditions"]["with transcript"]
    assert row["acc"] == pytest.approx(np.corrcoef(generated, original)[0, 1])
    assert row["nrmse"] == pytest.approx(np.sqrt(np.mean((generated - original) ** 2)) / original.std())
    spread = [(clip.generated[:, 0].std(), clip.original[:, 0].std()) for clip in by_hand]
    assert row["global_variance"] == pytest.approx(np.mean([g for g, _ in spread]) / np.mean([o for _, o in spread]))
    low, high = row["acc_95"]
    assert low <= row["acc"] <= high


def replace_training(
    monkeypatch: pytest.MonkeyPatch,
    result: Callable[..., object],
    figures_of: Callable[[Any], object],
    row_of: Callable[[Any], object] = lambda figures: {"clips": figures},
) -> None:
    """Let functions stand for training with generation, for the figures of clips, and for the row of figures."""
    monkeypatch.setattr(runner, "train_and_generate", result)
    monkeypatch.setattr(module, "measure_clips", lambda clips, *_: figures_of(clips))
    monkeypatch.setattr(runner, "make_opening_row", row_of)


def test_each_clip_is_held_out_once_and_never_trained_on(toy_corpus: Corpus, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fold with an utterance that has no words lacks a condition, so all folds together lack it."""
    cut: list[tuple[str, ...]] = []

    def result(_: object, names: Sequence[str], held_out: Sequence[str], *__: object) -> SimpleNamespace:
        assert sorted([*names, *held_out]) == sorted(toy_corpus.names("train"))
        cut.append(tuple(held_out))
        conditions = CONDITIONS if len(cut) != 2 else CONDITIONS[:1]
        clips = {condition: [f"{name} {condition}" for name in held_out] for condition in conditions}
        return SimpleNamespace(used=names, clips=clips, recordings=SimpleNamespace(closed_under=0.1, utterances=[]))

    replace_training(monkeypatch, result, sorted)
    figures = cross_validate(toy_corpus, count=3)
    assert sorted(name for held_out in cut for name in held_out) == sorted(toy_corpus.names("train"))
    assert [len(held_out) for held_out in cut] == [3, 3, 2]
    assert (figures["trained_on"], figures["closed_under"]) == ([5, 5, 6], 0.1)
    wanted = [f"{name} audio only" for name in sorted(toy_corpus.names("train"))]
    assert figures["conditions"] == {"audio only": {"clips": wanted}}
    first = cut[:]
    cut.clear()
    cross_validate(toy_corpus, count=3, settings=runner.ExperimentSettings(seed=1))
    assert cut != first


def test_finished_parts_are_not_generated_again(toy_corpus, tmp_path, monkeypatch):
    made: list[tuple[str, ...]] = []

    def result(_: object, names: Sequence[str], held_out: Sequence[str], *__: object) -> SimpleNamespace:
        made.append(tuple(held_out))
        if len(made) == 2:
            raise KeyboardInterrupt
        curves = [np.full((3 + n, 1), float(toy_corpus.names().index(name))) for n, name in enumerate(held_out)]
        clips = [ComparedClip(x, x + 0.5, np.arange(len(x)) / RATE_HZ, ((0.04, 0.08, "b"),)) for x in curves]
        recordings = SimpleNamespace(closed_under=0.1, utterances=[toy_corpus.utterance(name) for name in held_out])
        return SimpleNamespace(used=names, clips=dict.fromkeys(CONDITIONS, clips), recordings=recordings)

    def run(work: Path | None) -> dict[str, Any]:
        return cross_validate(toy_corpus, count=2, by_speaker=False, work=work)

    def as_lists(clips: Sequence[ComparedClip]) -> list[Any]:
        return [(clip.original.tolist(), clip.generated.tolist(), clip.time_s.tolist(), clip.spoken) for clip in clips]

    replace_training(monkeypatch, result, as_lists)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path)
    again = run(tmp_path)
    assert len(made) == 3
    assert len(set(made)) == 2
    made[:] = [("whole",)] * 2
    assert run(None) == again


def test_by_speaker_everybody_is_a_stranger_once(toy_corpus, tmp_path, monkeypatch):
    people = ["anna", "ben", "", "anna", "eve", "ben", "anna", "eve"]
    speaker_of = dict(zip(toy_corpus.names("train"), people, strict=True))
    corpus = copied(toy_corpus, tmp_path, lambda each: replace(each, speaker=speaker_of.get(each.name, "test only")))
    left_out: list[set[str]] = []

    def result(_: object, names: Sequence[str], held_out: Sequence[str], *__: object) -> SimpleNamespace:
        assert {speaker_of[name] for name in names}.isdisjoint(speaker_of[name] for name in held_out)
        left_out.append({speaker_of[name] for name in held_out})
        curve = np.arange(4.0)[:, None]
        clips = [
            SimpleNamespace(generated=curve if speaker_of[name] != "ben" else -curve, original=curve)
            for name in held_out
        ]
        recordings = SimpleNamespace(closed_under=0.1, utterances=[corpus.utterance(name) for name in held_out])
        return SimpleNamespace(used=names, clips={CONDITIONS[0]: clips}, recordings=recordings)

    row = dict.fromkeys(OPENING_ROW, 0.5) | {"acc_95": [0.4, 0.6], "false_per_minute": 1.0, "original_per_minute": 2.0}
    replace_training(monkeypatch, result, lambda _: {}, lambda _: row)
    figures = cross_validate(corpus, by_speaker=True)
    assert sorted(map(sorted, left_out)) == [[""], ["anna"], ["ben"], ["eve"]]
    assert figures["conditions"]["audio only"]["speakers"] == pytest.approx(
        {"anna": 1, "ben": -1, "eve": 1, "unknown": 1}
    )
    told = ["4 speakers: mean ACC 0.500, -1.000 (ben) to 1.000 (unknown)."]
    assert build_folds_section(figures).words["Speakers unknown to the model"] == told
    left_out.clear()
    cross_validate(corpus, by_speaker=True, count=2)
    assert [len(each) for each in left_out] == [2, 2]
    with pytest.raises(errors.InputError, match="5 folds; required: from 2 to 4, which is how many speakers there are"):
        cross_validate(corpus, by_speaker=True, count=5)


Clips = list[np.ndarray]


@pytest.fixture
def clips() -> tuple[Clips, Clips, Clips]:
    """Original curves, curves close to them, and curves less close: six clips of three channels far from 0."""
    draw = np.random.default_rng(3)
    original = [draw.normal(size=(int(n), 3)) + 50 for n in draw.integers(20, 40, 6)]
    near = [0.9 * o + 0.2 * draw.normal(size=o.shape) for o in original]
    far = [0.4 * o + draw.normal(size=o.shape) for o in original]
    return original, near, far


def test_figures_are_those_of_the_measures(clips):
    original, near, _ = clips
    wanted = curves.correlate_pooled(near, original).mean()
    assert evaluate.sum_correlations(near, original).value == pytest.approx(wanted, abs=1e-12)
    assert evaluate.sum_distances(near, original).value == pytest.approx(
        curves.measure_mean_distance(near, original), abs=1e-12
    )
    some, others = [g[:, :1] for g in near], [o[:, :1] for o in original]
    score = closures.measure_closures([g[:, 0] for g in near], [o[:, 0] for o in original], 50, 25).score
    assert evaluate.sum_closings(some, others, 50).value == pytest.approx(100 * score)


def test_what_leaves_out_nothing_is_marked():
    marks = {(0.1, 0.2): "*", (-2, -0.1): "*", (-0.1, 0.1): "", (0, 0): "", (2e-10, 7e-9): "", (None, None): ""}
    assert {gain: evaluate.mark_significance(gain) for gain in marks} == marks


def test_the_interval_is_that_of_drawn_clips(clips):
    original, near, far = clips
    draw = np.random.default_rng(7)
    drawn = [draw.integers(6, size=6) for _ in range(50)]

    def acc(made: Clips, chosen: np.ndarray) -> float:
        return float(curves.correlate_pooled([made[i] for i in chosen], [original[i] for i in chosen]).mean())

    one, other = evaluate.sum_correlations(near, original), evaluate.sum_correlations(far, original)
    wanted = np.percentile([acc(near, chosen) for chosen in drawn], [2.5, 97.5])
    assert one.compute_interval(7) == pytest.approx(tuple(wanted), abs=1e-12)
    paired = np.percentile([acc(near, chosen) - acc(far, chosen) for chosen in drawn], [2.5, 97.5])
    assert one.compute_gain(other, 7) == pytest.approx(tuple(paired), abs=1e-12)
    assert evaluate.mark_significance(one.compute_gain(other, 7)) == "*"
    assert one.compute_gain(one, 7) == (0, 0)
    assert evaluate.ClipStatistic([np.array([3.0, 2.0])], evaluate.divide_sums).compute_interval(0) == (1.5, 1.5)


def test_in_blocks_each_clip_is_compared_once_by_systems_that_did_not_see_it(toy_corpus, tmp_path):
    """The figures are those of all clips; what is done is not done again, and clips of ``val`` are not compared."""
    cut: list[list[tuple[str, ...]]] = []

    def experiment(corpus: Corpus, *, settings: runner.ExperimentSettings) -> dict[str, Any]:
        cut.append([corpus.names(split) for split in ("train", "val", "test")])
        for split in ("val", "test"):
            utterances = [corpus.utterance(name) for name in corpus.names(split)]
            for system, error in (("true", 0.0), ("noisy", 0.1)):
                clips = []
                for one in utterances:
                    seen = one.track.motion.selected(("opening", "width")).values[one.track.seen]
                    time_s = np.arange(len(seen)) / RATE_HZ
                    noise = error * np.random.default_rng(0).normal(size=seen.shape)
                    clips.append(ComparedClip(seen, seen + noise, time_s, ((0.04, 0.08, "b"),)))
                recordings = SimpleNamespace(utterances=utterances, channels=("opening", "width"))
                settings.receive(system, "audio only", recordings, clips)
        return {}

    figures = cross_validate_blocks(experiment, toy_corpus, ["true"], count=4, work=tmp_path)
    names = list(toy_corpus.names())
    assert [name for _, _, test in cut for name in test] == names
    assert all(sorted([*train, *val, *test]) == names for train, val, test in cut)
    assert [test for _, _, test in cut] == [cut[number - 1][1] for number in range(4)]
    rows = figures["conditions"]["audio only"]
    assert rows["true"]["acc"] == pytest.approx(1)
    assert rows["true"]["score"] == rows["true"]["opening"]["score"] == 100
    assert rows["noisy"]["acc_gain_95"]["true"][1] < 0 < rows["noisy"]["amse_gain_95"]["true"][0]
    assert cross_validate_blocks(experiment, toy_corpus, ["true"], count=4, work=tmp_path) == figures
    assert len(cut) == 4
    said = f"{rows['noisy']['acc']:.3f}*", "Highest ACC: true, 1.000."
    assert all(part in build_blocks_section(figures).as_text() for part in said)
    with pytest.raises(errors.InputError, match="2 blocks; required: from 3 to 12"):
        cross_validate_blocks(experiment, toy_corpus, [], count=2)
