from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from experiments.copies import copied
from lipmotion.corpora.store import Corpus
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError, ExportError, InputError, MissingDependencyError
from lipmotion.experiments.runner import ExperimentSettings
from lipmotion.experiments.xie_liu2007.plots import PLOT_FILES
from lipmotion.experiments.xie_liu2007.systems import (
    BEST_PATH,
    BLSTM,
    COMPARED_SYSTEMS,
    PAPER_FIGURES,
    REFERENCE_SYSTEM,
    selected_systems,
)
from lipmotion.experiments.xie_liu2007.table3 import ComparisonOptions, NoiseConditions, table3
from lipmotion.experiments.xie_liu2007.table3_text import table
from lipmotion.hmm.model import HmmConfig
from lipmotion.measures import curves
from lipmotion.pipeline.evaluation.evaluate import evaluate
from lipmotion.pipeline.evaluation.held_out import compared_clips, held_out_recordings
from lipmotion.pipeline.training.train import train
from lipmotion.speech.recognition.recogniser import cached_recogniser

LONG = pytest.mark.long
PHONE_MODELS = HmmConfig(mixtures=1, iterations=2)
SMALL = ExperimentSettings(recogniser=PHONE_MODELS)
SYSTEMS = [REFERENCE_SYSTEM, BEST_PATH, "trajectory HMM", "loudness", "mean pose"]
PICTURE = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pictures") / "new"


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, folder: Path) -> dict[str, Any]:
    return table3(
        toy_corpus,
        ComparisonOptions(
            systems=SYSTEMS,
            states=2,
            mixtures=[1],
            transcripts=True,
            noise=NoiseConditions(("white",), (0.0,)),
        ),
        sizes=[8, 3],
        plots=folder,
        settings=SMALL,
    )


@LONG
def test_every_size_condition_and_system(figures: dict[str, Any]) -> None:
    assert [(row["names"], row["used"]) for row in figures["rows"]] == [(3, 3), (8, 8)]
    for row in figures["rows"]:
        assert list(row["conditions"]) == ["audio only", "with transcript"]
        assert all(list(rows) == SYSTEMS for rows in row["conditions"].values())
        assert list(row["training"]) == SYSTEMS
    assert (figures["split"], figures["clips"], figures["states"]) == ("test", 2, 2)
    assert [(row["kind"], row["snr_db"]) for row in figures["noise"]] == [("white", 0)]
    assert json.loads(json.dumps(figures, allow_nan=False))


@LONG
def test_a_row_is_what_train_and_evaluate_say(figures: dict[str, Any], toy_corpus: Corpus) -> None:
    wanted = evaluate(train(toy_corpus, recogniser=PHONE_MODELS)[0], toy_corpus)
    for condition, expected_figures in wanted["conditions"].items():
        row = figures["rows"][-1]["conditions"][condition]["trajectory HMM"]
        assert (row["acc"], row["amse"]) == pytest.approx((expected_figures["acc"], expected_figures["amse"]))
        assert row["opening_acc_95"] == pytest.approx(tuple(expected_figures["opening_acc_95"]))
        expected = (expected_figures["lag_ms"], expected_figures["channels"]["opening"]["acc"])
        assert (row["lag_ms"], row["opening"]["acc"]) == pytest.approx(expected)
        assert row["opening"]["false_per_minute"] == expected_figures["closures_p_b_m"]["false_per_minute"]


@LONG
def test_the_conversion_is_all_that_differs(figures: dict[str, Any], toy_corpus: Corpus) -> None:
    """The figures of both conversions agree with those of one model trained here."""
    options = {
        "states": 2,
        "mixtures": 1,
        "variance_scaling": False,
        "closures": False,
        "articulation": False,
        "start": "viterbi",
        "steps": 10,
    }
    by_em = engine_named("coupled", options | {"conversion": "em"})
    by_path = engine_named("coupled", options | {"conversion": "viterbi"})
    model = train(toy_corpus, recogniser=PHONE_MODELS, engine=by_em)[0]
    recordings = held_out_recordings(toy_corpus, cached_recogniser(model.phones))
    for name, engine in ((REFERENCE_SYSTEM, by_em), (BEST_PATH, by_path)):
        made = compared_clips(recordings, "audio only", engine, model.learned)
        row = figures["rows"][-1]["conditions"]["audio only"][name]
        generated, original = [clip.generated for clip in made], [clip.original for clip in made]
        assert row["acc"] == pytest.approx(curves.pooled_correlation(generated, original).mean())
        assert row["opening"]["rmse"] == pytest.approx(curves.rmse(generated, original)[0])
    training = figures["rows"][-1]["training"]
    assert training[REFERENCE_SYSTEM] == training[BEST_PATH]
    assert training[REFERENCE_SYSTEM]["mixtures"] == 1


@LONG
def test_intervals_hold_their_figures_and_nothing_differs_from_itself(figures: dict[str, Any]) -> None:
    for name, row in figures["rows"][-1]["conditions"]["audio only"].items():
        for key in ("amse", "acc"):
            low, high = row[f"{key}_95"]
            assert low - 1e-9 <= row[key] <= high + 1e-9
        assert (row["acc_gain_95"] == (0, 0)) == (name == REFERENCE_SYSTEM)


@LONG
def test_noise_makes_it_worse(figures: dict[str, Any]) -> None:
    clean = figures["rows"][-1]["conditions"]["audio only"]
    much = figures["noise"][0]["systems"]
    for name in ("trajectory HMM", REFERENCE_SYSTEM):
        assert clean[name]["amse"] < much[name]["amse"]
    assert clean["mean pose"]["opening"] == much["mean pose"]["opening"]


@LONG
def test_pictures_are_written(figures: dict[str, Any], folder: Path) -> None:
    assert figures
    assert sorted(path.name for path in folder.iterdir()) == sorted(PLOT_FILES.values())
    assert all(path.read_bytes().startswith(PICTURE) for path in folder.iterdir())


@LONG
def test_the_text_names_every_system(figures: dict[str, Any]) -> None:
    lines = table(figures).splitlines()
    for name in SYSTEMS:
        assert sum(line.startswith(f"  {name}  ") for line in lines) == 5
    assert any(line.split()[:3] == [REFERENCE_SYSTEM, "6.911", "0.696"] for line in lines)
    assert any(line.split()[-3:] == ["clean", "0", "dB"] for line in lines)


@LONG
@pytest.mark.parametrize("visual", ["both"])
def test_eigenlips(visual: str, toy_corpus: Corpus) -> None:
    options = ComparisonOptions(systems=["trajectory HMM"], states=2, mixtures=[1], visual=visual)
    made = table3(toy_corpus, options, settings=SMALL)
    model = train(toy_corpus, recogniser=PHONE_MODELS, visual=visual)[0]
    expected_figures = evaluate(model, toy_corpus)["conditions"]["audio only"]
    row = made["rows"][0]["conditions"]["audio only"]["trajectory HMM"]
    assert (row["acc"], row["amse"]) == pytest.approx((expected_figures["acc"], expected_figures["amse"]))
    part = "eigenlips_" if visual == "both" else ""
    assert row[f"{part}acc"] == pytest.approx(expected_figures["eigenlips"]["acc"])
    assert row[f"{part}amse"] == pytest.approx(expected_figures["eigenlips"]["amse"])
    assert len(made["channels"]) == len(expected_figures["eigenlips"]["channels"]) + (3 if visual == "both" else 0)
    assert (row["opening"] is None) == (visual == "eigenlips")
    assert json.loads(json.dumps(made, allow_nan=False))
    starts = [line.split()[:1] for line in table(made).splitlines()]
    assert (["eigenlips"] in starts) == (visual == "both")


def test_systems_in_the_order_of_the_table() -> None:
    assert selected_systems(["loudness", "ph-HMM"]) == ["ph-HMM", REFERENCE_SYSTEM, "loudness"]
    assert list(PAPER_FIGURES) == list(COMPARED_SYSTEMS)[:6]
    with pytest.raises(InputError, match="no system 'ph-RNN'; there are: ph-HMM, "):
        selected_systems(["ph-RNN"])


def test_without_torch_the_network_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    assert selected_systems(None) == [name for name in COMPARED_SYSTEMS if name != BLSTM]
    with pytest.raises(MissingDependencyError, match=r'needs PyTorch.*; pip install "lipmotion\[network\]"'):
        selected_systems([BLSTM])


def test_without_matplotlib_there_are_no_pictures(
    toy_corpus: Corpus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingDependencyError, match=r'need matplotlib.*; pip install "lipmotion\[plots\]"'):
        table3(toy_corpus, plots=tmp_path)


def test_what_cannot_be_chosen(toy_corpus: Corpus, tmp_path: Path) -> None:
    for options, words in (
        ({"systems": ["nothing"]}, "no system 'nothing'"),
        ({"mixtures": []}, "numbers of Gaussians none; required: powers of two"),
    ):
        with pytest.raises(InputError, match=words):
            table3(toy_corpus, ComparisonOptions(**({"systems": [REFERENCE_SYSTEM]} | options)), settings=SMALL)
    with pytest.raises(InputError, match="sizes 9; required: from 1 to 8"):
        table3(toy_corpus, ComparisonOptions(systems=[REFERENCE_SYSTEM]), sizes=[9], settings=SMALL)
    with pytest.raises(CorpusError, match="are in the split that is compared with"):
        table3(toy_corpus, order=toy_corpus.names("val"))
    with pytest.raises(CorpusError, match="no utterances of split 'val'"):
        table3(copied(toy_corpus, tmp_path / "b", lambda u: replace(u, split="test") if u.split == "val" else u))
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match="file: is a file; give a folder for the pictures"):
        table3(toy_corpus, plots=tmp_path / "file")


def test_noise_that_cannot_be_made() -> None:
    with pytest.raises(InputError, match="unknown noise 'pink'; required some of: white, babble"):
        NoiseConditions(("pink",))
    with pytest.raises(InputError, match="a babble of 0 talkers; required at least 2"):
        NoiseConditions(("babble",))


def test_the_document_shows_the_figures_beside_it() -> None:
    results = Path(__file__).parents[3] / "docs" / "results"
    text = (results / "table3.md").read_text(encoding="utf-8")
    for name in ("table3", "table3-noise"):
        figures = json.loads((results / f"{name}.json").read_text(encoding="utf-8"))
        assert name == "table3-noise" or f"```text\n{table(figures)}\n```" in text
        assert REFERENCE_SYSTEM in figures["rows"][0]["training"]
