import numpy as np
import pytest

from lipmotion import Corpus, Model, Selection, types
from lipmotion.engines.coupled import engine, model
from lipmotion.measures import curves
from lipmotion.testing import examples
from lipmotion_lab.evaluation.held_out import HeldOutRecordings, generate_clips, load_held_out
from lipmotion_lab.xie_liu2007 import systems
from pipeline.made import recogniser_of

SMALL = systems.SYSTEMS["ph-MSHMM"] | {"chains": "viseme", "states": 2}


@pytest.fixture(scope="module")
def validation(toy_corpus: Corpus, toy_model: Model) -> HeldOutRecordings:
    phones = recogniser_of(toy_model)
    return load_held_out(toy_corpus, phones, selection=Selection("val"), channels=("opening", "width"))


def test_a_model_on_the_way_is_that_of_its_own_training():
    sentences = examples(3)
    one, two = systems.train_stages(SMALL | {"mixtures": 2}, sentences)
    assert [system.engine.config.mixtures for system in (one, two)] == [1, 2]
    for system in (one, two):
        alone = engine.CoupledEngine(model.CoupledConfig(**SMALL | {"mixtures": system.engine.config.mixtures}))
        arrays = alone.to_arrays(alone.fit(sentences, types.silent_monitor).model)
        found = system.engine.to_arrays(system.model)
        assert all(np.array_equal(arrays[name], found[name]) for name in arrays)
    # 13 visemes × 2 states: means and variances of every density, and a probability of moving on of every state
    groups = [group.mixtures.means.shape[2] for group in one.model.chains.groups]
    assert two.model.chains.parameters > one.model.chains.parameters == 26 * (2 * sum(groups) + 1)


@pytest.mark.long
def test_systems_are_judged_by_the_correlation_of_what_they_make(validation):
    found = [*systems.judge_systems(systems.train_stages(SMALL | {"mixtures": 2}, examples(3)), validation)]
    assert [trial.options["mixtures"] for trial, _ in found] == [1, 2]
    for trial, system in found:
        made = generate_clips(validation, "audio only", system.engine, system.model)
        generated, original = [clip.generated for clip in made], [clip.original for clip in made]
        assert trial.acc == pytest.approx(curves.correlate_pooled(generated, original).mean())
        assert trial.amse == pytest.approx(curves.measure_mean_distance(generated, original))
    best = systems.choose_best(found)
    assert best.tried == tuple(trial for trial, _ in found)
    assert best.engine is max(found, key=lambda pair: pair[0].acc)[1].engine


@pytest.mark.long
def test_the_network_with_the_best_settings_is_chosen(validation, monkeypatch):
    monkeypatch.setattr(systems, "NETWORK_SETTINGS", ([{"cells": 8, "steps": 1.0, "rate": 1e-9}], [{"rate": 1e-2}]))
    found = systems.tune_network(examples(3), validation, types.silent_monitor)
    assert [trial.options["rate"] for trial in found.tried] == [1e-9, 1e-2]
    assert {trial.options["cells"] for trial in found.tried} == {8}  # one kind of setting after another
    best = systems.find_best_trial(found.tried)
    assert best.options["rate"] == found.engine.rate
    made = generate_clips(validation, "audio only", found.engine, found.model)
    assert systems.measure_system(made) == pytest.approx((best.acc, best.amse))


def test_gaussians_are_split_while_that_is_better():
    found = [(systems.Trial({}, acc, 0.0, 0), None) for acc in (0.5, 0.6, 0.6, 0.9)]
    assert [*systems.split_while_better(found)] == found[:3]


def test_of_equal_trials_the_first_is_the_best():
    trials = [systems.Trial({"n": n}, acc, 0.0, 0) for n, acc in enumerate((0.5, 0.6, 0.6))]
    assert systems.find_best_trial(trials).options == {"n": 1}


def test_options_are_told_where_they_are_not_those_printed():
    for system, options in systems.SYSTEMS.items():
        changed = systems.list_changed_options(
            model.CoupledConfig(**options | {"audio_weight": 0.3, "unseen_loss": 3.0})
        )
        assert changed == {
            "structure": options["structure"], "chains": options["chains"], "audio_weight": 0.3, "unseen_loss": 3.0,
        }, system  # fmt: skip
