import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from experiments.copies import SETTINGS, copied, renamed
from lipmotion import Corpus, evaluate, train
from lipmotion.engines import engine_from_settings
from lipmotion.engines.joint.engine import JointEngine
from lipmotion.errors import CorpusError
from lipmotion_lab import hofer2008 as table1
from lipmotion_lab.hofer2008 import PAPER_SCORES, PhoneticTableOptions, hofer2008
from lipmotion_lab.report.sections import hofer_section
from testing.toy import SMALL

TWO = PhoneticTableOptions(states=(3,), mixtures=(1, 2), motion_mixtures=(1, 2), channels="opening width outer")


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("work")


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, work: Path) -> dict[str, Any]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table1, "PAPER_SCORES", {name: PAPER_SCORES[name] for name in ("eVis", "2vis", "phone")})
        return hofer2008(toy_corpus, TWO, work=work, settings=SETTINGS)


@pytest.mark.long
def test_a_row_is_what_the_preset_trains_and_evaluate_says(figures, toy_corpus):
    assert (figures["clips"], figures["trained_on"], len(figures["tables"])) == (2, 8, 4)
    evaluated: dict[tuple[str, str], Any] = {}
    for block in figures["tables"]:
        row = block["rows"]["eVis"]
        pins = "true" if block["pins"] != "as printed" else "false"
        numbers = f"mixtures={row['gaussians']}", f"motion_mixtures={row['motion_gaussians']}"
        settings = ["states=3", *numbers, f"closures={pins}", "channels=opening width outer"]
        if (pins, settings[1]) not in evaluated:
            engine = engine_from_settings(preset="hofer2008", settings=settings)
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
    assert json.loads(json.dumps(figures, allow_nan=False))


@pytest.mark.long
def test_what_was_finished_is_not_trained_again(figures, toy_corpus, work, monkeypatch):
    monkeypatch.setattr(table1, "PAPER_SCORES", {name: PAPER_SCORES[name] for name in ("eVis", "2vis", "phone")})
    monkeypatch.setattr(JointEngine, "growing_models", None)
    again = hofer2008(toy_corpus, TWO, work=work, settings=SETTINGS)
    assert hofer_section(again).as_text() == hofer_section(figures).as_text()


@pytest.mark.long
def test_pins_move_the_lips_of_the_same_units(figures):
    """Of given words: of recognised units, only those that are p b m alone are pinned."""
    printed, pinned = (block["rows"]["eVis"] for block in figures["tables"] if block["condition"] == "with transcript")
    assert pinned["recall_p_b_m"] == 100
    assert pinned["nrmse"] != printed["nrmse"]
    assert pinned["gaussians"] == printed["gaussians"]


def test_nothing_to_train_on_or_to_compare_with(toy_corpus, tmp_path):
    with pytest.raises(CorpusError, match="no utterances of split 'val'"):
        hofer2008(copied(toy_corpus, tmp_path, partial(replace, split="test")))
    with pytest.raises(CorpusError, match="compared by the channel 'opening', which is not in it"):
        hofer2008(renamed(toy_corpus, tmp_path / "b", "shape 0", "shape 1", "shape 2"))
