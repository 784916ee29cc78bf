import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engines.selection.drawn_units import PHONE_S, costs_of, inventory, target_of
from experiments.conftest import SETTINGS, few_sets, states
from lipmotion import Corpus, evaluate, train
from lipmotion.engines import create_engine
from lipmotion.engines.selection.concatenation import to_pieces
from lipmotion.engines.selection.costs import SelectionConfig
from lipmotion.types import Speech
from lipmotion.types.audio import JoinedRows
from lipmotion_lab import minnis2000
from lipmotion_lab.evaluation.held_out import ComparedClip, HeldOutRecordings, make_speech
from lipmotion_lab.hofer2008 import PhoneticTableOptions, run_hofer2008
from testing.toy import SMALL

LONG = pytest.mark.long


def test_all_additions_together_are_the_default():
    """Each row has an option of its own; without a row, an addition would be hidden in another one."""
    printed, everything = (
        minnis2000.list_configurations()[minnis2000.PRINTED],
        minnis2000.list_configurations()[minnis2000.EVERYTHING],
    )
    pair = ("candidates", "beam")
    options = {key for keys in minnis2000.ADDITIONS.values() if len(keys) == 1 or keys == pair for key in keys}
    alone = {key: getattr(everything, key) for key in options}
    assert replace(printed, **alone) == everything == SelectionConfig(closures=False)
    assert len({str(config) for config in minnis2000.list_configurations().values()}) == len(
        minnis2000.list_configurations()
    )
    unguided = minnis2000.list_configurations(guided=False)  # nothing is learned from the sound
    assert (minnis2000.PRINTED in unguided, minnis2000.EVERYTHING in unguided) == (True, False)
    assert {(config.guide, config.joint_recogniser) for config in unguided.values()} == {(0.0, False)}
    assert unguided.items() <= minnis2000.list_configurations().items()


def test_overlaps_count_where_table_1_leaves_the_middle():
    costs = costs_of(inventory("s aa f", "f aa m", levels=(0, 1)), hard=1.0)
    for text, inside in (("s aa m", [(PHONE_S, 2 * PHONE_S)]), ("m aa m", [])):
        target = target_of(costs, text)
        found = minnis2000.list_overlaps(costs, target, to_pieces(costs, target, np.array([0, 1, 5])))
        assert found == pytest.approx(np.reshape(inside, (-1, 2))), text


def test_a_bend_is_the_change_of_the_velocity():
    curve = np.maximum(np.arange(30.0) - 12, 0)
    change = minnis2000.measure_velocity_change(curve)
    assert change[12] == pytest.approx(4)
    assert change[[3, 25]] == pytest.approx(0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("minnis") / "models"


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, folder: Path) -> Iterator[dict[str, Any]]:
    measure = minnis2000.measure_joins
    rows: Any = JoinedRows([np.zeros((2, 64), np.float16)])

    def measure_arrays(engine: Any, model: Any, speech: Sequence[Speech], *rest: Any) -> Any:
        assert all(isinstance(each.encoding, np.ndarray) for each in speech)  # a guide takes it as one passage
        return measure(engine, model, speech, *rest)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            minnis2000, "make_speech", lambda *given: [replace(s, encoding=rows) for s in make_speech(*given)]
        )
        patch.setattr(minnis2000, "measure_joins", measure_arrays)
        yield minnis2000.run_minnis2000(toy_corpus, models=folder, settings=SETTINGS)


@LONG
def test_the_row_as_printed_is_the_preset(figures, toy_corpus):
    model, _ = train(toy_corpus, recogniser=SMALL, engine=create_engine(preset="minnis2000"))
    wanted = evaluate(model, toy_corpus)["conditions"]
    for condition, systems in figures["lists"]["test"]["conditions"].items():
        assert systems[minnis2000.PRINTED]["acc"] == pytest.approx(
            wanted[condition]["channels"]["opening"]["acc"], abs=1e-6
        )
        assert systems[minnis2000.PRINTED]["acc_gain_95"] == pytest.approx((0, 0))


@LONG
def test_a_second_run_does_not_train(figures, toy_corpus, folder):
    received: list[tuple[str, str, str, int]] = []

    def receive(system: str, condition: str, recordings: HeldOutRecordings, clips: Sequence[ComparedClip]) -> None:
        received.append((recordings.utterances[0].split, condition, system, len(clips)))

    settings = replace(SETTINGS, receive=receive)
    again = minnis2000.run_minnis2000(toy_corpus, models=folder, settings=settings)
    conditions = {(split, c, 2) for split, found in again["lists"].items() for c in found["conditions"]}
    assert sorted(received) == sorted(
        (split, c, row, n) for split, c, n in conditions for row in minnis2000.list_configurations()
    )
    assert (figures["seconds"] > 0, again["seconds"]) == (True, None)
    assert again["lists"] == figures["lists"]


@LONG
def test_a_run_that_was_stopped_goes_on(figures, toy_corpus, tmp_path):
    received: list[object] = []

    def stop(*given: object) -> None:
        received.append(given)
        if len(received) == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        minnis2000.run_minnis2000(toy_corpus, work=tmp_path, settings=replace(SETTINGS, receive=stop))
    before = states(tmp_path)
    again = minnis2000.run_minnis2000(toy_corpus, work=tmp_path, settings=SETTINGS)
    assert (again["seconds"], again["lists"]) == (None, figures["lists"])  # the model was kept, too
    assert before.items() <= states(tmp_path).items()


TWO = PhoneticTableOptions(states=(3,), mixtures=(1, 2), motion_mixtures=(1, 2), channels="opening width outer")


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("work")


@pytest.fixture(scope="module")
def hofer_figures(toy_corpus: Corpus, work: Path) -> dict[str, Any]:
    with few_sets():
        return run_hofer2008(toy_corpus, TWO, work=work, settings=SETTINGS)


@pytest.mark.long
def test_a_row_is_what_the_preset_trains_and_evaluate_says(hofer_figures, toy_corpus):
    assert (hofer_figures["clips"], hofer_figures["trained_on"], len(hofer_figures["tables"])) == (2, 8, 4)
    evaluated: dict[tuple[str, str], Any] = {}
    for block in hofer_figures["tables"]:
        row = block["rows"]["eVis"]
        pins = "true" if block["pins"] != "as printed" else "false"
        numbers = f"mixtures={row['gaussians']}", f"motion_mixtures={row['motion_gaussians']}"
        settings = ["states=3", *numbers, f"closures={pins}", "channels=opening width outer"]
        if (pins, settings[1]) not in evaluated:
            engine = create_engine(preset="hofer2008", settings=settings)
            model = train(toy_corpus, recogniser=SMALL, engine=engine)[0]
            evaluated[pins, settings[1]] = evaluate(model, toy_corpus)
        of_condition = evaluated[pins, settings[1]]["conditions"][block["condition"]]
        opening = of_condition["channels"]["opening"]
        assert [row[key] for key in ("acc", "jerk", "global_variance")] == pytest.approx(
            [opening[key] for key in ("acc", "jerk", "global_variance")], abs=0.02
        )  # a kept model is stored at half precision
        assert row["score"] == pytest.approx(100 * of_condition["closures"]["score"], abs=1e-9)
        chosen = f"{row['gaussians']}, {row['motion_gaussians']}"
        assert row["acc_on_val"][chosen] == max(row["acc_on_val"].values())
    assert json.loads(json.dumps(hofer_figures, allow_nan=False))


@pytest.mark.long
def test_pins_move_the_lips_of_the_same_units(hofer_figures):
    """Of given words: of recognised units, only those that are p b m alone are pinned."""
    printed, pinned = (
        block["rows"]["eVis"] for block in hofer_figures["tables"] if block["condition"] == "with transcript"
    )
    assert pinned["recall_p_b_m"] == 100
    assert pinned["nrmse"] != printed["nrmse"]
    assert pinned["gaussians"] == printed["gaussians"]
