from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import Corpus, evaluate, train
from lipmotion.engines import engine_from_settings
from lipmotion.engines.selection.costs import SelectionConfig
from lipmotion.hmm.model import HmmConfig
from lipmotion_lab.evaluation.held_out import ComparedClip, HeldOutRecordings
from lipmotion_lab.minnis2000 import (
    ADDITIONS,
    EVERYTHING,
    PRINTED,
    join_figures,
    minnis2000,
    rows,
    velocity_change,
)
from lipmotion_lab.runner import ExperimentSettings

LONG = pytest.mark.long
PHONE_MODELS = HmmConfig(mixtures=1, iterations=2)


def test_all_additions_together_are_the_default():
    """Each row has an option of its own; without a row, an addition would be hidden in another one."""
    printed, everything = rows()[PRINTED], rows()[EVERYTHING]
    alone = {key: getattr(everything, key) for keys in ADDITIONS.values() if len(keys) == 1 for key in keys}
    assert replace(printed, **alone) == everything == SelectionConfig(closures=False)
    assert len({str(config) for config in rows().values()}) == len(rows())


def test_a_bend_is_the_change_of_the_velocity():
    curve = np.maximum(np.arange(30.0) - 12, 0)
    change = velocity_change(curve)
    assert change[12] == pytest.approx(4)
    assert change[[3, 25]] == pytest.approx(0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("minnis") / "models"


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, folder: Path) -> dict[str, Any]:
    return minnis2000(toy_corpus, models=folder, settings=ExperimentSettings(recogniser=PHONE_MODELS))


@LONG
def test_the_row_as_printed_is_the_preset(figures, toy_corpus):
    model, _ = train(toy_corpus, recogniser=PHONE_MODELS, engine=engine_from_settings(preset="minnis2000"))
    wanted = evaluate(model, toy_corpus)["conditions"]
    for condition, systems in figures["lists"]["test"]["conditions"].items():
        assert systems[PRINTED]["acc"] == pytest.approx(wanted[condition]["channels"]["opening"]["acc"], abs=1e-6)
        assert systems[PRINTED]["acc_gain_95"] == pytest.approx((0, 0))


@LONG
def test_a_second_run_does_not_train(figures, toy_corpus, folder):
    received: list[tuple[str, str, str, int]] = []

    def receive(system: str, condition: str, recordings: HeldOutRecordings, clips: Sequence[ComparedClip]) -> None:
        received.append((recordings.utterances[0].split, condition, system, len(clips)))

    settings = ExperimentSettings(recogniser=PHONE_MODELS, receive=receive)
    again = minnis2000(toy_corpus, models=folder, settings=settings)
    conditions = {(split, c, 2) for split, found in again["lists"].items() for c in found["conditions"]}
    assert sorted(received) == sorted((split, c, row, n) for split, c, n in conditions for row in rows())
    assert (figures["seconds"] > 0, again["seconds"]) == (True, None)
    assert again["lists"] == figures["lists"]


@LONG
def test_a_run_that_was_stopped_goes_on(figures, toy_corpus, tmp_path, monkeypatch):
    def run() -> dict[str, Any]:
        return minnis2000(toy_corpus, work=tmp_path, settings=ExperimentSettings(recogniser=PHONE_MODELS))

    module = "lipmotion_lab.minnis2000.join_figures"
    made: list[None] = []

    def stopping(*given: Any) -> dict[str, Any]:
        made.append(None)
        if len(made) == 4:
            raise KeyboardInterrupt
        return join_figures(*given)

    monkeypatch.setattr(module, stopping)
    with pytest.raises(KeyboardInterrupt):
        run()
    again = run()
    assert (again["seconds"], again["lists"]) == (None, figures["lists"])  # the model was kept, too
    assert len(made) == 1 + sum(
        len(systems) for found in figures["lists"].values() for systems in found["conditions"].values()
    )
