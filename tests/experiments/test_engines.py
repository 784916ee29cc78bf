"""The comparison of all engines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.conftest import SETTINGS, copied, renamed
from lipmotion import Corpus, Selection, evaluate, load_model, train
from lipmotion.errors import CorpusError, ExportError, InputError
from lipmotion.testing import CHANNELS
from lipmotion.testing import examples as sentences
from lipmotion.types import Example, TokenPosteriors, silent_monitor
from lipmotion_lab import learning_curve as module
from lipmotion_lab.baselines import BlstmBaseline, ContextRidge, FrameRegressionModel, MeanPose
from lipmotion_lab.engine_comparison import ENGINES_COMPARED, compare_engines
from lipmotion_lab.learning_curve import run_learning_curve
from lipmotion_lab.report.sections import build_learning_section
from lipmotion_lab.runner import ExperimentSettings, choose_training_names
from testing.toy import SMALL

LONG = pytest.mark.long

CONDITIONS = ["audio only", "with transcript"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("engines") / "models"


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, folder: Path) -> dict[str, Any]:
    return compare_engines(toy_corpus, split="test", models=folder, settings=SETTINGS)


@LONG
def test_every_system_in_every_condition(figures):
    assert (figures["split"], figures["clips"]) == ("test", 2)
    assert list(figures["conditions"]) == CONDITIONS
    for condition in figures["conditions"].values():
        assert list(condition["systems"]) == [*ENGINES_COMPARED]
        for row in condition["systems"].values():
            assert np.isfinite([row["acc"], row["nrmse"], row["global_variance"], row["width_acc"]]).all()
            assert row["acc_95"][0] - 1e-9 <= row["acc"] <= row["acc_95"][1] + 1e-9


@LONG
def test_the_figures_are_those_of_the_verb_evaluate(figures, folder, toy_corpus):
    wanted = evaluate(load_model(folder / "coupled.lipmotion"), toy_corpus, selection=Selection("test"))
    for name in CONDITIONS:
        found, condition = figures["conditions"][name]["systems"]["coupled"], wanted["conditions"][name]
        opening = condition["channels"]["opening"]
        assert found["acc"] == pytest.approx(opening["acc"])
        assert found["nrmse"] == pytest.approx(opening["nrmse"])
        assert found["width_acc"] == pytest.approx(condition["channels"]["width"]["acc"])
        free = condition.get("unpinned", condition)
        assert found["unpinned"]["acc"] == pytest.approx(free["channels"]["opening"]["acc"])
        assert found["unpinned"]["p_b_m"] == free["closures_p_b_m"]["intervals"]


@LONG
def test_a_second_run_trains_nothing(figures, toy_corpus, folder):
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    again = compare_engines(toy_corpus, split="test", models=folder, settings=SETTINGS)
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before
    assert sorted(before) == sorted(f"{name}.lipmotion" for name in ENGINES_COMPARED)
    assert [row["seconds"] for row in again["models"].values()] == [None] * 3
    assert all(row["seconds"] > 0 for row in figures["models"].values())
    assert again["conditions"] == figures["conditions"]


@LONG
def test_models_of_something_else_are_refused(figures, toy_corpus, folder, tmp_path):
    assert figures
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "coupled.lipmotion").write_bytes((folder / "trajectory.lipmotion").read_bytes())
    with pytest.raises(InputError, match="a model of the engine 'trajectory', required 'coupled'; move it away"):
        compare_engines(toy_corpus, models=tmp_path / "a", settings=SETTINGS)
    fewer = copied(
        toy_corpus, tmp_path, lambda u: replace(u, split="test") if u.name in ("toy00", "toy01", "toy03") else u
    )
    wanted = r"minutes 0\.\d, required the training list of this corpus: corpus \['copy'\], minutes 0\.\d; move it"
    with pytest.raises(InputError, match=wanted):
        compare_engines(fewer, models=folder, settings=SETTINGS)
    with pytest.raises(ExportError, match="the corpus"):
        compare_engines(toy_corpus, models=toy_corpus.path, settings=SETTINGS)
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match="is a file; give the name"):
        compare_engines(toy_corpus, models=tmp_path / "file", settings=SETTINGS)


def fitted(examples: list[Example], **options: float) -> FrameRegressionModel:
    return BlstmBaseline(cells=32, **options).fit(examples, silent_monitor).model


@pytest.mark.long
def test_held_out_motion_is_predicted(examples):
    held_out = sentences(14, seed=5)[-1]
    result = BlstmBaseline().generate(fitted(examples, rate=1e-2), held_out.speech)
    assert result.motion.channels == CHANNELS
    assert result.motion.values.shape == result.variance.shape == held_out.motion.values.shape
    for name in ("opening", "width"):
        assert np.corrcoef(result.motion[name], held_out.motion[name])[0, 1] > 0.8
    assert result.motion["opening"].max() < 1  # values of frames that are not valid are not learned


def test_the_same_seed_gives_the_same_and_all_that_is_heard_counts(examples):
    heard = []
    for one in examples[:3]:
        frames, draw = len(one.speech.features.values), np.random.default_rng(0).normal
        said = TokenPosteriors(draw(size=(-(-frames // 2), 200)).astype(np.float16), "a test", 1.0)
        speech = replace(one.speech, posteriors=said, encoding=draw(size=(frames, 64)).astype(np.float16))
        heard.append(replace(one, speech=speech))
    models = [fitted(each, seed=seed, steps=0.1) for seed, each in ((0, heard), (0, heard), (1, heard))]
    made = [BlstmBaseline().generate(each, heard[0].speech).motion.values for each in models]
    assert np.array_equal(made[0], made[1])
    assert not np.allclose(made[0], made[2])
    assert models[0].learned.network.parameters[0].shape[1] == 4 * 39 + 2 * 120 + 64
    deaf = replace(heard[0].speech, encoding=-heard[0].speech.encoding)
    assert not np.allclose(made[0], BlstmBaseline().generate(models[0], deaf).motion.values)


BASELINES: list[type] = [MeanPose, ContextRidge]


def valid_motion(examples: list[Example]) -> np.ndarray:
    return np.concatenate([one.motion.values[one.valid] for one in examples])


def test_the_mean_pose(examples):
    model = MeanPose().fit(examples, silent_monitor).model
    made = MeanPose().generate(model, examples[0].speech)
    assert made.motion.values == pytest.approx(
        np.broadcast_to(valid_motion(examples).mean(axis=0), made.motion.values.shape)
    )
    direct = made.motion.column("opening")
    assert made.variance[0, direct] == pytest.approx(valid_motion(examples)[:, direct].var())


@pytest.fixture(scope="module")
def order(toy_corpus: Corpus) -> tuple[str, ...]:
    return toy_corpus.names("train")[::-1]


@pytest.fixture(scope="module")
def curve_figures(toy_corpus: Corpus, order: tuple[str, ...]) -> dict[str, Any]:
    return run_learning_curve(toy_corpus, order=order, sizes=[8, 4, 4], settings=SETTINGS)


@pytest.mark.long
def test_a_row_is_what_train_and_evaluate_say(curve_figures, toy_corpus, order):
    names = sorted(order[: curve_figures["rows"][0]["names"]])
    wanted = evaluate(train(toy_corpus, selection=Selection(names=names), recogniser=SMALL)[0], toy_corpus)
    assert curve_figures["closed_under"] == wanted["closed_under"]
    for condition in CONDITIONS:
        made, said = curve_figures["rows"][0]["conditions"][condition], wanted["conditions"][condition]
        opening = said["channels"]["opening"]
        assert [made[key] for key in ("acc", "nrmse", "global_variance")] == [
            opening[key] for key in ("acc", "nrmse", "global_variance")
        ]
        assert made["acc_95"] == pytest.approx(list(said["opening_acc_95"]))
        assert [made[f"acc_{name}"] for name in ("width", "outer")] == [
            said["channels"][name]["acc"] for name in ("width", "outer")
        ]


@pytest.mark.long
def test_channels_that_are_not_there_are_dashes(toy_corpus, tmp_path):
    made = run_learning_curve(renamed(toy_corpus, tmp_path, "opening", "smile"), sizes=[8], settings=SETTINGS)
    row = made["rows"][0]["conditions"]["audio only"]
    assert (row["acc_width"], row["acc_outer"]) == (None, None)
    assert build_learning_section(made).table.as_lines()[1].split()[-2:] == ["–", "–"]
    made["rows"][0]["BLSTM"] = {"channels": {"outer": {"ours": 0.9, "acc": 0.8, "gain_95": [0.05, 0.15]}}}
    assert "8 recordings, outer: 0.900, BLSTM 0.800" in build_learning_section(made).as_text()


def test_by_default_the_training_list_is_shuffled_and_no_finished_size_is_trained_again(
    toy_corpus, tmp_path, monkeypatch
):
    trained: list[list[str]] = []
    stops = [True]

    def result(_: object, names: Sequence[str], held_out: Sequence[str], *__: object) -> SimpleNamespace:
        trained.append(list(names))
        if len(names) == 8 and stops.pop():
            stops.append(False)
            raise KeyboardInterrupt
        assert tuple(held_out) == toy_corpus.names("test")
        return SimpleNamespace(recordings=SimpleNamespace(closed_under=0.1), clips={"audio only": []})

    monkeypatch.setattr("lipmotion_lab.runner.train_and_generate", result)
    monkeypatch.setattr(module, "_make_row", lambda *_: {})
    settings = ExperimentSettings(seed=1)
    with pytest.raises(KeyboardInterrupt):
        run_learning_curve(toy_corpus, sizes=[3, 8], work=tmp_path, settings=settings)
    del trained[1:]
    curve_figures = run_learning_curve(toy_corpus, sizes=[3, 8], work=tmp_path, settings=settings)
    assert [row["names"] for row in curve_figures["rows"]] == [3, 8]
    names = toy_corpus.names("train")
    mixed = [names[i] for i in np.random.default_rng(1).permutation(8)]
    assert sorted(mixed[:3]) != list(names[:3])
    assert trained == [mixed[:3], mixed]
    assert (curve_figures["order"], curve_figures["seed"], curve_figures["closed_under"]) == ("shuffled", 1, 0.1)


def test_recordings_of_the_training_are_not_compared(toy_corpus):
    for split in ("train", None):
        with pytest.raises(CorpusError, match="are in the split that is compared with"):
            compare_engines(toy_corpus, split=split, settings=SETTINGS)


def test_a_name_that_could_not_be_prepared_is_left_out(caplog):
    listed = tuple("qwertyuiopasdfghjklz")
    corpus: Any = SimpleNamespace(path="corpus", names=lambda: sorted(listed))
    assert choose_training_names(corpus, [*listed, "smeared"], 1, ()) == listed
    assert "corpus: 1 of 21 names to train on (smeared) are not in the corpus; left out" in caplog.text


def test_what_cannot_be_trained_on(toy_corpus, tmp_path):
    with pytest.raises(InputError, match="sizes none; required: from 1 to 8"):
        run_learning_curve(toy_corpus, sizes=[])
    for order, words in (
        (["x1", "x2", "x3", "x4", "x5", "x6"], r"6 of 6 names to train on \(x1, x2, x3, x4, x5 and 1 more\) are not"),
        (["toy00", "toy01", "toy00"], r"1 of 3 names to train on \(toy00\) stand in the list more than once"),
    ):
        with pytest.raises(CorpusError, match=words):
            run_learning_curve(toy_corpus, order=order)
    with pytest.raises(CorpusError, match="compared by the channel 'opening', which is not in it"):
        run_learning_curve(renamed(toy_corpus, tmp_path, "smile", "frown"))
