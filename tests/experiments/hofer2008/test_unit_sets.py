from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.copies import copied, renamed
from lipmotion.corpora.store import Corpus
from lipmotion.engines import engine_named
from lipmotion.errors import CorpusError
from lipmotion.experiments.hofer2008 import unit_sets as module
from lipmotion.experiments.hofer2008.unit_sets import ENGINE_SETTINGS, PAPER_SCORES, table, unit_sets
from lipmotion.experiments.runner import ExperimentSettings
from lipmotion.hmm.model import HmmConfig
from lipmotion.measures.closures import closings
from lipmotion.pipeline.evaluation.evaluate import evaluate
from lipmotion.pipeline.evaluation.held_out import compared_clips, held_out_recordings
from lipmotion.pipeline.training.train import train
from lipmotion.speech.recognition.recogniser import cached_recogniser
from lipmotion.units import unit_set

PHONE_MODELS = HmmConfig(mixtures=1, iterations=2)
SMALL = ExperimentSettings(recogniser=PHONE_MODELS)
PLAIN, SHIPPED = ENGINE_SETTINGS
CONDITIONS = ["audio only", "with transcript"]
Rows = dict[str, dict[str, Any]]


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus) -> dict[str, Any]:
    return unit_sets(toy_corpus, settings=SMALL)


def all_rows(figures: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    return [item for system in figures["systems"].values() for rows in system.values() for item in rows.items()]


@pytest.mark.long
def test_the_rows_are_those_of_the_paper(figures: dict[str, Any]) -> None:
    assert (figures["split"], figures["clips"], figures["trained_on"], figures["closures"]) == ("test", 2, 8, False)
    assert list(figures["systems"]) == [PLAIN, SHIPPED]
    for system in figures["systems"].values():
        assert list(system) == CONDITIONS
        for rows in system.values():
            assert [(units, row["units"], row["paper"]) for units, row in rows.items()] == [
                ("2vis", 2, 66.5),
                ("pbVis", 9, 67.7),
                ("sVis", 6, 67.4),
                ("eVis", 19, 68.8),
                ("phone", 46, 65.2),
            ]
    assert json.loads(json.dumps(figures, allow_nan=False))


@pytest.mark.long
def test_a_row_is_what_train_and_evaluate_say(figures: dict[str, Any], toy_corpus: Corpus) -> None:
    engine = engine_named("trajectory", ENGINE_SETTINGS[PLAIN] | {"units": "eVis", "closures": False})
    wanted = evaluate(train(toy_corpus, recogniser=PHONE_MODELS, engine=engine)[0], toy_corpus)
    assert figures["closed_under"] == wanted["closed_under"]
    for condition in CONDITIONS:
        row, said = figures["systems"][PLAIN][condition]["eVis"], wanted["conditions"][condition]
        opening = said["channels"]["opening"]
        for key in ("acc", "nrmse", "global_variance"):
            assert row[key] == pytest.approx(opening[key])
        assert row["score"] == 100 * said["closures"]["score"]
        assert row["precision"] == 100 * said["closures"]["precision"]
        assert row["timing_ms"] == said["closures"]["timing_ms"]
        assert row["recall_p_b_m"] == 100 * said["closures_p_b_m"]["recall"]


@pytest.mark.long
def test_figures_by_hand(figures: dict[str, Any], toy_corpus: Corpus) -> None:
    """RMSE and score of one row, from the curves and the paper's rule."""
    engine = engine_named("trajectory", {"units": "2vis", "closures": False})
    model = train(toy_corpus, recogniser=PHONE_MODELS, engine=engine)[0]
    found = held_out_recordings(toy_corpus, cached_recogniser(model.phones))
    pairs = [(c.generated[:, 0], c.original[:, 0]) for c in compared_clips(found, "audio only", engine, model.learned)]
    error = np.concatenate([g - o for g, o in pairs])
    points = [
        any(abs(int(g_frame) - int(o_frame)) <= 2 for g_frame in closings(g, found.closed_under))
        for g, o in pairs
        for o_frame in closings(o, found.closed_under)
    ]
    row = figures["systems"][SHIPPED]["audio only"]["2vis"]
    assert row["rmse"] == pytest.approx(np.sqrt(np.mean(error**2)))
    assert row["score"] == pytest.approx(100 * np.mean(points))
    assert row["closings"] == len(points) > 4


@pytest.mark.long
def test_phones_know_more_than_open_and_closed(figures: dict[str, Any]) -> None:
    for system in figures["systems"].values():
        for rows in system.values():
            assert rows["2vis"]["acc"] < rows["phone"]["acc"]
            assert rows["2vis"]["rmse"] > rows["phone"]["rmse"]
            assert rows["2vis"]["acc_gain_95"][1] < 0


@pytest.mark.long
def test_intervals_hold_their_figures_and_nothing_differs_from_itself(figures: dict[str, Any]) -> None:
    for units, row in all_rows(figures):
        for key in ("score", "acc"):
            low, high = row[f"{key}_95"]
            assert low <= row[key] + 1e-9
            assert row[key] <= high + 1e-9
            if units == "phone":
                assert row[f"{key}_gain_95"] == (0, 0)


@pytest.mark.long
def test_lips_that_are_made_to_meet_do(toy_corpus: Corpus, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a corpus without transcripts to compare with, there is ``audio only``."""
    monkeypatch.setattr(module, "PAPER_SCORES", {"2vis": 66.5, "phone": 65.2})
    corpus = copied(toy_corpus, tmp_path, lambda u: u if u.split == "train" else replace(u, words=None))
    pinned = unit_sets(corpus, settings=SMALL, closures=True, split="val")
    assert list(pinned["systems"][SHIPPED]) == ["audio only"]
    assert (pinned["split"], pinned["closures"]) == ("val", True)
    rows = pinned["systems"][SHIPPED]["audio only"]
    assert [row["recall_p_b_m"] for row in rows.values()] == [100] * 2
    assert all(row["p_b_m"] > 3 for row in rows.values())
    assert "lips made to meet on p b m" in table(pinned)


def test_nothing_to_train_on_or_to_compare_with(toy_corpus: Corpus, tmp_path: Path) -> None:
    with pytest.raises(CorpusError, match="no utterances of split 'train'"):
        unit_sets(copied(toy_corpus, tmp_path, partial(replace, split="test")))
    with pytest.raises(CorpusError, match="compared by the channel 'opening', which is not in it"):
        unit_sets(renamed(toy_corpus, tmp_path / "b", "shape 0", "shape 1", "shape 2"))


def test_the_document_shows_the_figures_beside_it() -> None:
    results = Path(__file__).parents[3] / "docs" / "results"
    figures = json.loads((results / "unit-sets.json").read_text(encoding="utf-8"))
    text = (results / "unit-sets.md").read_text(encoding="utf-8")
    assert f"```text\n{table(figures)}\n```" in text
    for name, row in all_rows(figures):
        assert (row["units"], row["paper"]) == (unit_set(name).count, PAPER_SCORES[name])
