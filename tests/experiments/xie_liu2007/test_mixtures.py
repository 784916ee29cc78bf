from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.errors import InputError
from lipmotion.experiments.xie_liu2007 import mixtures
from lipmotion.experiments.xie_liu2007.mixtures import MixtureSelection, select_mixtures
from lipmotion.measures import curves
from lipmotion.pipeline.evaluation.conditions import HeldOutRecordings, compared_clips, held_out_recordings
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.training.train import model_motion
from lipmotion.speech.recogniser import cached_recogniser
from lipmotion.testing.examples import examples
from lipmotion.testing.toy import toy_sentences
from lipmotion.types import Example, Progress, Speech, silent_monitor

PLAIN = CoupledConfig(structure="multistream", chains="viseme", states=2, conversion="em", closures=False)


@pytest.fixture(scope="module")
def sentences() -> list[Example]:
    return examples()


@pytest.fixture(scope="module")
def validation(toy_corpus: Corpus, toy_model: Model) -> HeldOutRecordings:
    return held_out_recordings(toy_corpus, cached_recogniser(toy_model.phones), selection=Selection("val"))


def chosen(
    sentences: list[Example], validation: HeldOutRecordings, scores: dict[int, float], monkeypatch: pytest.MonkeyPatch
) -> MixtureSelection:
    monkeypatch.setattr(mixtures, "_mean_acc", lambda _, __, engine, ___: scores[engine.config.mixtures])
    return select_mixtures(sentences, validation, PLAIN, tuple(scores))


@pytest.mark.parametrize(
    ("scores", "wanted"), [({1: 0.5, 2: 0.7, 4: 0.6}, 2), ({1: 0.5, 2: 0.5, 4: 0.5}, 1), ({4: 0.6, 1: 0.5}, 4)]
)
def test_the_best_is_taken(
    scores: dict[int, float],
    wanted: int,
    sentences: list[Example],
    validation: HeldOutRecordings,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    selection = chosen(sentences, validation, scores, monkeypatch)
    assert (selection.engine.config.mixtures, selection.engine.config.visual_mixtures) == (wanted, wanted)
    assert {group.mixtures.size[1] for group in selection.model.chains.groups} == {wanted}
    assert selection.validation_acc == scores
    assert list(selection.validation_acc) == sorted(scores)


@pytest.mark.parametrize("number", [1, 2])
def test_a_model_on_the_way_is_that_of_its_own_training(
    number: int, sentences: list[Example], validation: HeldOutRecordings, monkeypatch: pytest.MonkeyPatch
) -> None:
    selection = chosen(sentences, validation, {1: 0.0, 2: 0.0, 4: 0.0} | {number: 1.0}, monkeypatch)
    engine = CoupledEngine(replace(PLAIN, mixtures=number, visual_mixtures=number))
    alone = engine.to_arrays(engine.fit(sentences, silent_monitor).model)
    selected = engine.to_arrays(selection.model)
    assert selection.engine == engine
    assert all(np.array_equal(alone[name], selected[name]) for name in alone)
    assert selection.seconds > 0


def test_the_score_is_the_mean_correlation_of_what_is_made(toy_corpus: Corpus, validation: HeldOutRecordings) -> None:
    utterance = toy_corpus.utterance("toy00")
    motion, valid = model_motion(utterance.track, len(utterance.features.values))
    learned = Example("toy00", Speech(utterance.features, toy_sentences(3)[0].units), motion, valid)
    selection = select_mixtures([learned], validation, PLAIN, [1, 2])
    made = compared_clips(validation, "audio only", selection.engine, selection.model)
    acc = curves.pooled_correlation([clip.generated for clip in made], [clip.original for clip in made])
    assert selection.validation_acc[selection.engine.config.mixtures] == pytest.approx(acc.mean())
    assert max(selection.validation_acc.values()) == selection.validation_acc[selection.engine.config.mixtures]


def test_one_number_is_taken_without_being_tried(sentences: list[Example]) -> None:
    stages: list[Progress] = []
    selection = select_mixtures(sentences, None, PLAIN, [2], monitor=stages.append)
    assert (selection.engine.config.mixtures, selection.validation_acc) == (2, {})
    assert not any("trying" in event.stage for event in stages)
    shares = [event.share for event in stages]
    assert shares == sorted(shares)


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ([], "numbers of Gaussians none; required: powers of two"),
        ([1, 3], "numbers of Gaussians 1, 3; required: powers of two"),
        ([0], "numbers of Gaussians 0; required"),
        ([1, 2], "2 numbers of Gaussians and no recordings to choose with; give one number"),
    ],
)
def test_numbers_that_cannot_be(sentences: list[Example], numbers: list[int], words: str) -> None:
    with pytest.raises(InputError, match=words):
        select_mixtures(sentences, None, PLAIN, numbers)
