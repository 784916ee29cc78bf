"""The comparison of all engines and the hybrid."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import rankdata

from experiments.copies import copied
from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines.selection.config import SelectionConfig
from lipmotion.engines.selection.engine import SelectionEngine
from lipmotion.engines.trajectory.engine import TrajectoryConfig, TrajectoryEngine
from lipmotion.errors import CorpusError, ExportError, InputError
from lipmotion.experiments.engines import disagreement
from lipmotion.experiments.engines.disagreement import (
    OpeningOfClip,
    confidence_of,
    disagreement_figures,
    openings_of_clips,
    partial_rank_correlation,
    rank_correlation,
)
from lipmotion.experiments.engines.engine_comparison import HYBRID, MEAN, engines, mean_of_clips
from lipmotion.experiments.engines.hybrid import Hybrid, HybridModel
from lipmotion.experiments.engines.models import ENGINES_COMPARED
from lipmotion.experiments.engines.text import table
from lipmotion.experiments.runner import ExperimentSettings
from lipmotion.hmm.model import HmmConfig
from lipmotion.measures.bootstrap import bootstrap_interval
from lipmotion.pipeline.evaluation.evaluate import evaluate
from lipmotion.pipeline.evaluation.held_out import ComparedClip
from lipmotion.pipeline.model import load_model
from lipmotion.testing.examples import examples, speech, timeline
from lipmotion.types import Constraints, Pin, Progress, silent_monitor

LONG = pytest.mark.long
SMALL = ExperimentSettings(recogniser=HmmConfig(mixtures=1, iterations=2))
CONDITIONS = ["audio only", "with transcript"]
SPOKEN = speech(timeline(("b", "aa", "t", "iy", "m", "uw", "s", "aa")))
ONLY_IN_THE_FILE = ("rank correlation of", "… in the", "with the error of", "disagreement: error of")
"""Lines of the table that the page sums up in words."""


@pytest.fixture(scope="module", autouse=True)
def few_draws_here() -> Any:
    """Bootstrap intervals of 50 draws."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(disagreement, "bootstrap_interval", partial(bootstrap_interval, draws=50))
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("engines") / "models"


@pytest.fixture(scope="module")
def stages() -> list[Progress]:
    return []


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, folder: Path, stages: list[Progress]) -> dict[str, Any]:
    return engines(toy_corpus, split="test", models=folder, settings=replace(SMALL, monitor=stages.append))


@pytest.fixture(scope="module")
def hybrid() -> tuple[Hybrid, HybridModel]:
    guiding = TrajectoryEngine(TrajectoryConfig(components=2, acoustic_components=20, joint_recogniser=False))
    engine = Hybrid(guiding, SelectionEngine(SelectionConfig(joint_recogniser=False)))
    return engine, engine.fit(examples(), silent_monitor).model


@LONG
def test_every_system_in_every_condition(figures: dict[str, Any]) -> None:
    assert list(figures["conditions"]) == CONDITIONS
    for condition in figures["conditions"].values():
        assert list(condition["systems"]) == [*ENGINES_COMPARED, HYBRID, MEAN]
        for row in condition["systems"].values():
            assert np.isfinite([row["acc"], row["nrmse"], row["global_variance"], row["width_acc"]]).all()
            assert row["acc_95"][0] - 1e-9 <= row["acc"] <= row["acc_95"][1] + 1e-9
    assert (figures["split"], figures["clips"]) == ("test", 2)


@LONG
def test_differences_are_paired(figures: dict[str, Any]) -> None:
    for condition in figures["conditions"].values():
        rows = condition["systems"]
        for name in ENGINES_COMPARED:
            assert rows[name]["acc_gain_95"][name] == pytest.approx((0, 0))
        for engine, (low, high) in rows[HYBRID]["acc_gain_95"].items():
            assert low - 1e-9 <= rows[HYBRID]["acc"] - rows[engine]["acc"] <= high + 1e-9


@LONG
@pytest.mark.parametrize("engine", ["coupled"])
def test_the_figures_are_those_of_the_verb_evaluate(
    figures: dict[str, Any], folder: Path, toy_corpus: Corpus, engine: str
) -> None:
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
def test_a_second_run_trains_nothing(figures: dict[str, Any], toy_corpus: Corpus, folder: Path) -> None:
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    received: set[tuple[str, str]] = set()
    settings = replace(SMALL, receive=lambda system, condition, *_: received.add((condition, system)))
    again = engines(toy_corpus, split="test", models=folder, settings=settings)
    assert received == {(c, s) for c, found in again["conditions"].items() for s in found["systems"] if s != MEAN}
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before
    assert sorted(before) == sorted(f"{name}.lipmotion" for name in ENGINES_COMPARED)
    assert [row["seconds"] for row in again["models"].values()] == [None] * 3
    assert all(row["seconds"] > 0 for row in figures["models"].values())
    assert again["conditions"] == figures["conditions"]


@LONG
def test_progress_goes_from_nothing_to_all(figures: dict[str, Any], stages: list[Progress]) -> None:
    shares = [event.share for event in stages]
    assert figures
    assert shares == sorted(shares)
    assert (shares[0] < 0.1, shares[-1]) == (True, 1.0)


@LONG
def test_models_of_something_else_are_refused(
    figures: dict[str, Any], toy_corpus: Corpus, folder: Path, tmp_path: Path
) -> None:
    assert figures
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "coupled.lipmotion").write_bytes((folder / "trajectory.lipmotion").read_bytes())
    with pytest.raises(InputError, match="a model of the engine 'trajectory', required 'coupled'; move it away"):
        engines(toy_corpus, models=tmp_path / "a", settings=SMALL)
    fewer = copied(
        toy_corpus, tmp_path, lambda u: replace(u, split="test") if u.name in ("toy00", "toy01", "toy03") else u
    )
    wanted = r"minutes 0\.\d, required the training list of this corpus: corpus \['copy'\], minutes 0\.\d; move it"
    with pytest.raises(InputError, match=wanted):
        engines(fewer, models=folder, settings=SMALL)
    with pytest.raises(ExportError, match="the corpus"):
        engines(toy_corpus, models=toy_corpus.path, settings=SMALL)
    (tmp_path / "file").write_text("")
    with pytest.raises(ExportError, match="cannot be a folder for models"):
        engines(toy_corpus, models=tmp_path / "file", settings=SMALL)


def test_recordings_of_the_training_are_not_compared(toy_corpus: Corpus) -> None:
    for split in ("train", None):
        with pytest.raises(CorpusError, match="are in the split that is compared with"):
            engines(toy_corpus, split=split, settings=SMALL)


@LONG
def test_the_table_has_every_system_and_every_clip(figures: dict[str, Any], toy_corpus: Corpus) -> None:
    lines = table(figures).splitlines()
    for name in (*ENGINES_COMPARED, HYBRID, MEAN):
        assert sum(line.startswith(f"  {name} ") for line in lines) == 2
    for name in toy_corpus.names("test"):
        confidences = [float(x) for x in next(line for line in lines if line.startswith(f"  {name}")).split()[1:]]
        clip = figures["conditions"]["audio only"]["disagreement"]["clips"][name]
        assert confidences == pytest.approx(clip["confidence"], abs=0.005)
    assert "1 where trajectory, coupled and selection agree, 0 where they are" in table(figures)


@LONG
def test_the_guide_decides_what_is_selected(hybrid: tuple[Hybrid, HybridModel]) -> None:
    engine, model = hybrid
    selecting, learned = engine.selecting.without_closures(), model.selecting
    guide = learned.motion.space.reduce(engine.guiding.generate(model.guiding, SPOKEN).motion.values)
    one = selecting.generate_guided(learned, SPOKEN, guide)
    strong = SelectionEngine(replace(selecting.config, guide=1e4, trust=0.0))
    middle = learned.motion.space.direct_names.index("opening")
    for opening, compare in ((guide[:, middle].max(), np.greater), (guide[:, middle].min(), np.less)):
        other = guide.copy()
        other[:, middle] = opening
        found = strong.generate_guided(learned, SPOKEN, other).motion["opening"].mean()
        assert compare(found, strong.generate_guided(learned, SPOKEN, guide).motion["opening"].mean())
    assert one.motion.names == selecting.generate(learned, SPOKEN).motion.names


@LONG
def test_its_own_guide_given_is_its_own_motion(hybrid: tuple[Hybrid, HybridModel]) -> None:
    engine, model = hybrid
    guide = model.selecting.guide
    assert guide is not None
    own = guide.expanded(guide.predict(SPOKEN)[0])
    wanted = engine.selecting.generate(model.selecting, SPOKEN).motion.values
    given = engine.selecting.generate_guided(model.selecting, SPOKEN, own).motion.values
    assert np.abs(given - wanted).max() < 1e-9


@LONG
def test_the_hybrid_is_guided_by_the_trajectory_engine(hybrid: tuple[Hybrid, HybridModel]) -> None:
    engine, model = hybrid
    guiding = engine.guiding.without_closures()
    guide = model.selecting.motion.space.reduce(guiding.generate(model.guiding, SPOKEN).motion.values)
    wanted = engine.selecting.generate_guided(model.selecting, SPOKEN, guide)
    found = engine.generate(model, SPOKEN)
    assert np.abs(found.motion.values - wanted.motion.values).max() < 1e-9
    assert all(span.label.unit for span in found.units)
    pinned = engine.generate(model, SPOKEN, Constraints((Pin(0.5, "opening", 0.2),)))
    assert pinned.motion["opening"][50] == pytest.approx(0.2)


@LONG
def test_guides_that_cannot_be(hybrid: tuple[Hybrid, HybridModel]) -> None:
    engine, model = hybrid
    with pytest.raises(InputError, match=r"a guide of shape \(3, 1\), required \("):
        engine.selecting.generate_guided(model.selecting, SPOKEN, np.zeros((3, 1)))
    wanted = len(SPOKEN.features.values), model.selecting.motion.space.dimensions
    with pytest.raises(InputError, match="does not compare motion; train one with the option guide"):
        engine.selecting.generate_guided(replace(model.selecting, guide=None), SPOKEN, np.zeros(wanted))


def clip(original: Any, generated: Any) -> ComparedClip:
    """Ten frames a second, with speech from 0.5 s to 1.2 s."""
    time_s, spoken = np.arange(len(original)) / 10, ((0.5, 0.9, "aa"), (0.9, 1.2, "p"))
    return ComparedClip(np.reshape(original, (-1, 1)), np.reshape(generated, (-1, 1)), time_s, spoken)


def test_disagreement_by_hand() -> None:
    original = np.tile([0.0, 2.0], 12)  # deviation 1; 2.4 s, the last 0.4 s too short
    curves: Mapping[str, list[ComparedClip]] = {
        "a": [clip(original, original)],
        "b": [clip(original, original + np.repeat([0, 3, 5], [10, 10, 4]))],
        "c": [clip(original, original)],
    }
    (opening,), deviation = openings_of_clips(curves, 0)
    assert deviation == pytest.approx(1)
    differs = opening.disagreement(("a", "b", "c"))
    assert differs[:2] == pytest.approx([0, np.std([0, 3, 0])])
    assert np.isnan(differs[2])
    assert opening.error("b")[:2] == pytest.approx([0, 3])
    assert opening.movement("a")[:2] == pytest.approx([1, 1])
    assert opening.speech()[:2] == pytest.approx([0.5, 0.2])
    assert confidence_of(differs)[:2] == pytest.approx([1, 0])
    assert confidence_of(np.array([0.2, np.nan]))[0] == pytest.approx(0.6)


def test_silence_that_is_right_says_nothing_about_speech() -> None:
    """Disagreement and error are drawn apart in speech and are small in silence."""
    draw = np.random.default_rng(2)
    openings = []
    for _ in range(40):
        loud = np.repeat([1.0, 1.0, 0.01], 25)
        mean, apart = (np.repeat(draw.uniform(0.2, 1, 3), 25) * loud for _ in range(2))
        made = {"a": mean - apart, "b": mean + apart, "m": mean}
        openings.append(OpeningOfClip(np.arange(75) / 25, np.zeros(75), made, np.arange(75) < 50))
    found = disagreement_figures(openings, ("a", "b"), "m", [str(number) for number in range(40)], 0)
    assert found["rank_correlation"]["m"]["value"] > 0.5
    assert abs(found["in_speech"]["m"]["value"]) < 0.25


def test_the_mean_is_the_mean() -> None:
    one, other = clip([0, 1], [1, 3]), clip([0, 1], [3, 5])
    assert mean_of_clips([[one], [other]])[0].generated[:, 0].tolist() == [2, 4]


def test_rank_correlations() -> None:
    draw = np.random.default_rng(0)
    common = [draw.normal(size=50) for _ in range(4)]
    some, others = ([np.exp(c + noise * draw.normal(size=50)) for c in common] for noise in (0.3, 1.0))
    assert rank_correlation(some, [-np.log(x) for x in some]) == pytest.approx(-1)
    assert rank_correlation(some, others) > 0.5
    assert rank_correlation(some, [np.ones(50)] * 4) == pytest.approx(0)
    ranks = [rankdata(np.concatenate(side)) for side in (some, others, common)]
    line = np.column_stack([ranks[2], np.ones(200)])
    left = [side - line @ np.linalg.lstsq(line, side, rcond=None)[0] for side in ranks[:2]]  # by definition
    assert partial_rank_correlation(some, others, common) == pytest.approx(np.corrcoef(*left)[0, 1])


def test_disagreement_that_is_error_is_a_confidence() -> None:
    """Engines whose errors are drawn with the same spread disagree where they are wrong."""
    draw = np.random.default_rng(1)
    openings = []
    for _ in range(20):
        spread = np.repeat(draw.uniform(0.1, 1, 3), 25)
        original = np.sin(np.arange(75) / 3)
        made = {name: original + spread * draw.normal(size=75) for name in ("a", "b")}
        made["m"] = (made["a"] + made["b"]) / 2
        openings.append(OpeningOfClip(np.arange(75) / 25, original, made, np.arange(75) < 50))
    names = [str(number) for number in range(20)]
    found = disagreement_figures(openings, ("a", "b"), "m", names, 0)
    low, high = found["rank_correlation"]["m"]["95"]
    assert 0.7 < low < found["rank_correlation"]["m"]["value"] < high
    assert (found["seconds"], found["seconds_of_speech"]) == (60, 40)
    assert found["in_speech"]["m"]["value"] > 0.7
    errors = [part["error"] for part in found["quarters"]]
    assert errors == sorted(errors)
    assert [part["seconds"] for part in found["quarters"]] == [15] * 4
    assert list(found["clips"]) == names
    assert json.dumps(found)


@pytest.mark.parametrize(("split", "clips"), [("val", 22), ("test", 50)])
def test_the_document_shows_the_figures_beside_it(split: str, clips: int) -> None:
    results = Path(__file__).parents[2] / "docs" / "results"
    figures = json.loads((results / f"engines-{split}.json").read_text(encoding="utf-8"))
    lines = table(figures).partition("\n\nconfidence in every second")[0].splitlines()
    shown = "\n".join(line for line in lines if not line.strip().startswith(ONLY_IN_THE_FILE))
    assert split == "val" or f"```text\n{shown}\n```" in (results / "engines.md").read_text(encoding="utf-8")
    assert (figures["split"], figures["clips"]) == (split, clips)
