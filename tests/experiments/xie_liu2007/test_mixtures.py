from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np
import pytest

from lipmotion.corpora.store import Corpus, Selection
from lipmotion.engines import Fit
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.errors import InputError
from lipmotion.experiments.xie_liu2007 import mixtures
from lipmotion.experiments.xie_liu2007.mixtures import select_mixtures
from lipmotion.measures import curves
from lipmotion.pipeline.evaluation.conditions import HeldOutRecordings, compared_clips, held_out_recordings
from lipmotion.pipeline.model import Model
from lipmotion.pipeline.training.train import model_motion
from lipmotion.speech.recognition.recogniser import Recogniser
from lipmotion.testing.examples import examples
from lipmotion.testing.toy import toy_sentences
from lipmotion.types import Example, Speech, silent_monitor

PLAIN = CoupledConfig(structure="multistream", chains="viseme", states=2, conversion="em", closures=False)


@pytest.fixture(scope="module")
def sentences() -> list[Example]:
    return examples()


@pytest.fixture(scope="module")
def validation(toy_corpus: Corpus, toy_model: Model) -> HeldOutRecordings:
    return held_out_recordings(toy_corpus, Recogniser(toy_model.phones, "own"), selection=Selection("val"))


@pytest.mark.long
def test_a_model_on_the_way_is_that_of_its_own_training(
    sentences: list[Example], validation: HeldOutRecordings, monkeypatch: pytest.MonkeyPatch
) -> None:
    scores = {1: 0.0, 2: 1.0, 4: 0.0}
    monkeypatch.setattr(mixtures, "_mean_acc", lambda _, __, engine, ___: scores[engine.config.mixtures])
    selection = select_mixtures(sentences, validation, PLAIN, tuple(scores))
    engine = CoupledEngine(replace(PLAIN, mixtures=2, visual_mixtures=2))
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


def _known_acc(scores: dict[int, float], _: object, __: object, engine: CoupledEngine, ___: object) -> float:
    return scores[engine.config.mixtures]


def test_the_best_is_taken_and_of_equals_the_smallest(monkeypatch: pytest.MonkeyPatch) -> None:
    models = [lambda count=count: Fit(f"model of {count}", {}) for count in (1, 2, 4)]
    monkeypatch.setattr(mixtures, "growing_models", lambda *_: iter(models))
    for scores, wanted in (
        ({1: 0.5, 2: 0.7, 4: 0.6}, 2),
        ({1: 0.5, 2: 0.5, 4: 0.5}, 1),
        ({4: 0.6, 1: 0.5}, 4),
    ):
        monkeypatch.setattr(mixtures, "_mean_acc", partial(_known_acc, scores))
        selection = select_mixtures([], cast(HeldOutRecordings, object()), PLAIN, tuple(scores))
        assert (selection.engine.config.mixtures, selection.engine.config.visual_mixtures) == (wanted, wanted)
        assert selection.model == f"model of {wanted}"
        assert selection.validation_acc == scores
        assert list(selection.validation_acc) == sorted(scores)


def test_numbers_that_cannot_be() -> None:
    for numbers, words in (
        ([], "numbers of Gaussians none; required: powers of two"),
        ([1, 3], "numbers of Gaussians 1, 3; required: powers of two"),
        ([0], "numbers of Gaussians 0; required"),
        ([1, 2], "2 numbers of Gaussians and no recordings to choose with; give one number"),
    ):
        with pytest.raises(InputError, match=words):
            select_mixtures([], None, PLAIN, numbers)
