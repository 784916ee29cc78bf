import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.conftest import SETTINGS, copied, states
from lipmotion import Corpus, engines, evaluate, train
from lipmotion.errors import CorpusError, InputError, MissingDependencyError
from lipmotion.measures import curves
from lipmotion.pipeline.training.other_speakers import SpokenSentence
from lipmotion.speech.recognition.recogniser import open_recogniser
from lipmotion.storage.archive import read_archive
from lipmotion_lab.evaluation.held_out import generate_clips, load_held_out
from lipmotion_lab.report.sections import build_xie_liu_section
from lipmotion_lab.xie_liu2007 import six_systems, systems
from lipmotion_lab.xie_liu2007.six_systems import ComparisonOptions, run_xieliu2007
from testing.toy import SMALL, toy_sentences

LONG = pytest.mark.long

MULTISTREAM = "ph-MSHMM"
CHAINS = [MULTISTREAM, systems.REFERENCE_SYSTEM, MULTISTREAM + systems.SPLIT, systems.REFERENCE_SYSTEM + systems.SPLIT]
OTHERS = [MULTISTREAM + systems.ALL_PATHS, systems.BEST_PATH, "trajectory HMM", "mean pose"]
SYSTEMS = [*CHAINS, *OTHERS]
PICTURE = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("pictures") / "new"


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("work")


@pytest.fixture(scope="module")
def figures(toy_corpus: Corpus, folder: Path, work: Path) -> dict[str, Any]:
    options = ComparisonOptions(systems=SYSTEMS, mixtures=2, transcripts=True)
    return run_xieliu2007(toy_corpus, options, sizes=[8, 3], plots=folder, work=work, settings=SETTINGS)


@LONG
@pytest.mark.usefixtures("figures")
def test_pictures_are_written(folder):
    assert sorted(path.name for path in folder.iterdir()) == sorted(six_systems.PLOT_FILES.values())
    assert all(path.read_bytes().startswith(PICTURE) for path in folder.iterdir())


@LONG
def test_the_text_names_every_system(figures):
    section = build_xie_liu_section(figures)
    assert [list(table.rows) for table in section.tables[:4]] == [SYSTEMS] * 4
    assert len(section.words["Settings, the best on val"]) == 2


@LONG
def test_every_size_condition_and_system(figures):
    assert [(row["names"], row["used"]) for row in figures["rows"]] == [(3, 3), (8, 8)]
    for row in figures["rows"]:
        assert list(row["conditions"]) == ["audio only", "with transcript"]
        assert all(list(rows) == SYSTEMS for rows in row["conditions"].values())
        assert list(row["training"]) == SYSTEMS
    assert (figures["split"], figures["clips"], figures["validation"]) == ("test", 2, 2)
    assert json.loads(json.dumps(figures, allow_nan=False))


@LONG
def test_a_row_is_what_train_and_evaluate_say(figures, toy_corpus):
    wanted = evaluate(train(toy_corpus, recogniser=SMALL)[0], toy_corpus)
    for condition, expected_figures in wanted["conditions"].items():
        row = figures["rows"][-1]["conditions"][condition]["trajectory HMM"]
        assert (row["acc"], row["amse"]) == pytest.approx((expected_figures["acc"], expected_figures["amse"]))
        assert row["opening_acc_95"] == pytest.approx(tuple(expected_figures["opening_acc_95"]))
        expected = (expected_figures["lag_ms"], expected_figures["channels"]["opening"]["acc"])
        assert (row["lag_ms"], row["opening"]["acc"]) == pytest.approx(expected)
        assert row["opening"]["false_per_minute"] == expected_figures["closures_p_b_m"]["false_per_minute"]


@LONG
@pytest.mark.parametrize("name", [MULTISTREAM, systems.REFERENCE_SYSTEM])
def test_a_preset_is_the_row_of_the_table(name, figures, work, toy_corpus):
    """The arrays of the model file and the motion are the same; conversions of one model differ by that alone."""
    model = train(toy_corpus, recogniser=SMALL, engine=engines.create_engine(preset=name))[0]
    arrays = model.engine.to_arrays(model.learned)
    kept = read_archive(work / "8" / f"system-{name}.checkpoint")
    assert kept.keys() == {*arrays, "about"}
    for key, array in arrays.items():
        np.testing.assert_array_equal(array, kept[key])
    system, learned = systems.system_from_arrays(kept), model.engine.from_arrays(arrays)
    recordings = load_held_out(toy_corpus, open_recogniser(model.phones))
    made = generate_clips(recordings, "audio only", model.engine, learned)
    for ours, theirs in zip(made, generate_clips(recordings, "audio only", system.engine, system.model), strict=True):
        np.testing.assert_array_equal(ours.generated, theirs.generated)
    rows, training = (figures["rows"][-1][part] for part in ("conditions", "training"))
    row, generated = rows["audio only"][name], [clip.generated for clip in made]
    original = [clip.original for clip in made]
    assert row["acc"] == pytest.approx(curves.correlate_pooled(generated, original).mean())
    assert row["amse"] == pytest.approx(curves.measure_mean_distance(generated, original))
    assert training[name]["parameters"] == model.learned.chains.parameters
    if name == systems.REFERENCE_SYSTEM:
        by_path = engines.engine_named("coupled", model.engine.config.as_mapping() | {"conversion": "viterbi"})
        made = generate_clips(recordings, "audio only", by_path, learned)
        acc = curves.correlate_pooled([clip.generated for clip in made], original).mean()
        assert rows["audio only"][systems.BEST_PATH]["acc"] == pytest.approx(acc)


@LONG
def test_a_number_of_gaussians_is_the_best_that_was_tried(figures):
    for name in (MULTISTREAM, systems.REFERENCE_SYSTEM):
        row = figures["rows"][-1]["training"][name + systems.SPLIT]
        best = max(row["tried"], key=lambda trial: trial["acc"])
        assert (row["options"], row["parameters"]) == (best["options"], best["parameters"])
        assert row["tried"][0]["options"].keys() == {"structure", "chains"}  # as printed
    pairs = figures["rows"][-1]["pairs"]
    compared = [(pair["better"], pair["worse"]) for pair in pairs]
    assert compared[:2] == [(systems.REFERENCE_SYSTEM, MULTISTREAM), (MULTISTREAM + systems.ALL_PATHS, MULTISTREAM)]
    assert compared[2:] == [(systems.REFERENCE_SYSTEM + systems.SPLIT, MULTISTREAM + systems.SPLIT)]
    split = figures["rows"][-1]["training"][MULTISTREAM + systems.SPLIT]
    assert {trial["options"].get("visual_mixtures", 1) for trial in split["tried"]} == {1, 2}
    rows = figures["rows"][-1]["conditions"]["audio only"]
    assert pairs[0]["acc"] == pytest.approx(rows[systems.REFERENCE_SYSTEM]["acc"] - rows[MULTISTREAM]["acc"])


@LONG
def test_it_goes_on_from_what_is_finished(figures, work, toy_corpus):
    before = states(work)
    options = ComparisonOptions(systems=[*CHAINS, "mean pose"], mixtures=2)
    again = run_xieliu2007(toy_corpus, options, sizes=[8, 3], work=work, settings=SETTINGS)
    for name in CHAINS:
        kept, rows = (each["rows"][-1]["conditions"]["audio only"][name] for each in (again, figures))
        assert kept == rows
    assert states(work) == before


@LONG
def test_eigenlips(toy_corpus):
    options = ComparisonOptions(systems=["trajectory HMM"], visual="both")
    received: list[tuple[str, str]] = []
    settings = replace(SETTINGS, receive=lambda *given: received.append(given[:2]))
    made = run_xieliu2007(toy_corpus, options, settings=settings)
    assert made["rows"][0]["names"] == 8
    assert received == [(name, "audio only") for name in made["rows"][0]["training"]]
    model = train(toy_corpus, recogniser=SMALL, visual="both")[0]
    expected_figures = evaluate(model, toy_corpus)["conditions"]["audio only"]
    row = made["rows"][0]["conditions"]["audio only"]["trajectory HMM"]
    assert (row["acc"], row["amse"]) == pytest.approx((expected_figures["acc"], expected_figures["amse"]))
    for key in ("acc", "amse"):
        assert row[f"eigenlips_{key}"] == pytest.approx(expected_figures["eigenlips"][key])
    assert len(made["channels"]) == len(expected_figures["eigenlips"]["channels"]) + 3
    assert row["opening"] is not None
    assert json.loads(json.dumps(made, allow_nan=False))
    assert "ACC, eigenlips" in build_xie_liu_section(made).table.as_lines()[0]


@LONG
def test_two_stages_beside_one(toy_corpus):
    others = tuple(SpokenSentence(s.name, "anna", s.audio, s.units) for s in toy_sentences(3))
    options = ComparisonOptions(systems=[systems.REFERENCE_SYSTEM + systems.TWO_STAGES], voices=others)
    (row,) = run_xieliu2007(toy_corpus, options, sizes=[4], settings=SETTINGS)["rows"]
    assert [(each["better"], each["worse"]) for each in row["pairs"]] == [
        (options.systems[0], systems.REFERENCE_SYSTEM)
    ]
    one, two = row["training"].values()
    assert two["parameters"] > one["parameters"]
    with pytest.raises(InputError, match="two stages needs speech of others; give it by --recordings or --voices"):
        run_xieliu2007(toy_corpus, replace(options, voices=()), settings=SETTINGS)


def test_systems_in_the_order_of_the_table():
    assert systems.select_systems(["mean pose", "ph-HMM"]) == ["ph-HMM", systems.REFERENCE_SYSTEM, "mean pose"]
    assert systems.select_systems(["ph-CHMM" + systems.ALL_PATHS]) == [
        "ph-CHMM",
        systems.REFERENCE_SYSTEM,
        "ph-CHMM" + systems.ALL_PATHS,
    ]
    assert list(systems.PAPER_FIGURES) == list(systems.COMPARED_SYSTEMS)[:6]
    with pytest.raises(InputError, match="no system 'ph-RNN'; there are: ph-HMM, "):
        systems.select_systems(["ph-RNN"])


def test_what_cannot_be_chosen(toy_corpus, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingDependencyError, match=r'need matplotlib.*; pip install ".*\[plots\]"'):
        run_xieliu2007(toy_corpus, plots=tmp_path)
    with pytest.raises(InputError, match="sizes 9; required: from 1 to 8"):
        run_xieliu2007(toy_corpus, ComparisonOptions(systems=[systems.REFERENCE_SYSTEM]), sizes=[9], settings=SETTINGS)
    with pytest.raises(CorpusError, match="are in the split that is compared with"):
        run_xieliu2007(toy_corpus, order=toy_corpus.names("val"))
    with pytest.raises(CorpusError, match="no utterances of split 'val'"):
        run_xieliu2007(copied(toy_corpus, tmp_path / "b", lambda u: replace(u, split=u.split.replace("val", "test"))))
