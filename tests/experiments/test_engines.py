"""The comparison of all engines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.copies import SETTINGS, copied
from lipmotion import Corpus, Selection, evaluate, load_model
from lipmotion.errors import CorpusError, ExportError, InputError
from lipmotion.testing import speech, timeline
from lipmotion.types import Progress
from lipmotion_lab.engine_comparison import ENGINES_COMPARED, engines

LONG = pytest.mark.long

CONDITIONS = ["audio only", "with transcript"]
SPOKEN = speech(timeline(("b", "aa", "t", "iy", "m", "uw", "s", "aa")))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("engines") / "models"


@pytest.fixture(scope="module")
def stages() -> list[Progress]:
    return []


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, folder: Path, stages: list[Progress]) -> dict[str, Any]:
    return engines(toy_corpus, split="test", models=folder, settings=replace(SETTINGS, monitor=stages.append))


@LONG
def test_every_system_in_every_condition(figures):
    assert list(figures["conditions"]) == CONDITIONS
    for condition in figures["conditions"].values():
        assert list(condition["systems"]) == [*ENGINES_COMPARED]
        for row in condition["systems"].values():
            assert np.isfinite([row["acc"], row["nrmse"], row["global_variance"], row["width_acc"]]).all()
            assert row["acc_95"][0] - 1e-9 <= row["acc"] <= row["acc_95"][1] + 1e-9
    assert (figures["split"], figures["clips"]) == ("test", 2)


@LONG
def test_differences_are_paired(figures):
    for condition in figures["conditions"].values():
        rows = condition["systems"]
        for name in ENGINES_COMPARED:
            assert rows[name]["acc_gain_95"][name] == pytest.approx((0, 0))
        for engine, (low, high) in rows["coupled"]["acc_gain_95"].items():
            assert low - 1e-9 <= rows["coupled"]["acc"] - rows[engine]["acc"] <= high + 1e-9


@LONG
@pytest.mark.parametrize("engine", ["coupled"])
def test_the_figures_are_those_of_the_verb_evaluate(figures, folder, toy_corpus, engine):
    wanted = evaluate(load_model(folder / f"{engine}.lipmotion"), toy_corpus, selection=Selection("test"))
    for name in CONDITIONS:
        found, condition = figures["conditions"][name]["systems"][engine], wanted["conditions"][name]
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
    received: set[tuple[str, str]] = set()
    settings = replace(SETTINGS, receive=lambda system, condition, *_: received.add((condition, system)))
    again = engines(toy_corpus, split="test", models=folder, settings=settings)
    assert received == {(c, s) for c, found in again["conditions"].items() for s in found["systems"]}
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before
    assert sorted(before) == sorted(f"{name}.lipmotion" for name in ENGINES_COMPARED)
    assert [row["seconds"] for row in again["models"].values()] == [None] * 3
    assert all(row["seconds"] > 0 for row in figures["models"].values())
    assert again["conditions"] == figures["conditions"]


@LONG
def test_progress_goes_from_nothing_to_all(figures, stages):
    shares = [event.share for event in stages]
    assert figures
    assert shares == sorted(shares)
    assert (shares[0] < 0.1, shares[-1]) == (True, 1.0)


@LONG
def test_models_of_something_else_are_refused(figures, toy_corpus, folder, tmp_path):
    assert figures
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "coupled.lipmotion").write_bytes((folder / "trajectory.lipmotion").read_bytes())
    with pytest.raises(InputError, match="a model of the engine 'trajectory', required 'coupled'; move it away"):
        engines(toy_corpus, models=tmp_path / "a", settings=SETTINGS)
    fewer = copied(
        toy_corpus, tmp_path, lambda u: replace(u, split="test") if u.name in ("toy00", "toy01", "toy03") else u
    )
    wanted = r"minutes 0\.\d, required the training list of this corpus: corpus \['copy'\], minutes 0\.\d; move it"
    with pytest.raises(InputError, match=wanted):
        engines(fewer, models=folder, settings=SETTINGS)
    with pytest.raises(ExportError, match="the corpus"):
        engines(toy_corpus, models=toy_corpus.path, settings=SETTINGS)
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match="is a file; give the name"):
        engines(toy_corpus, models=tmp_path / "file", settings=SETTINGS)


def test_recordings_of_the_training_are_not_compared(toy_corpus):
    for split in ("train", None):
        with pytest.raises(CorpusError, match="are in the split that is compared with"):
            engines(toy_corpus, split=split, settings=SETTINGS)
