from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from lipmotion.errors import CorpusError
from lipmotion.hmm.model import HmmConfig
from lipmotion.pipeline.training.train import train_phone_models
from lipmotion.testing.toy import WORDS, ToySentence, toy_sentences
from lipmotion.types.progress import silent_monitor
from lipmotion.units import PAUSE, SILENCE, Lexicon

SMALL = HmmConfig(mixtures=1, iterations=2)


@pytest.fixture(scope="module")
def sentences() -> list[ToySentence]:
    return toy_sentences(12)


def test_training_is_reported_and_does_not_get_worse(sentences: list[ToySentence]) -> None:
    steps: list[tuple[str, float | None]] = []
    spoken = [(sentence.audio, sentence.words) for sentence in sentences[:4]]
    hmm = train_phone_models(spoken, Lexicon(), SMALL, lambda event: steps.append((event.stage, event.figure)))
    assert {"flat start", "pronunciations"} <= {step for step, _ in steps}
    for stage in ("flat start", "pronunciations"):
        values = [value for step, value in steps if step == stage and value is not None]
        assert all(before <= after + 1e-6 for before, after in pairwise(values))
    said = {phone for sentence in sentences[:4] for word in sentence.words for phone in WORDS[word]}
    assert set(hmm.table.units) == said | {SILENCE, PAUSE}


def test_transcripts_that_do_not_fit_are_left_out(sentences: list[ToySentence]) -> None:
    good = [(sentence.audio, sentence.words) for sentence in sentences[:3]]
    bad = (good[0][0], ("five",) * 100)
    hmm = train_phone_models([*good, bad], Lexicon(), SMALL, silent_monitor)
    assert np.array_equal(hmm.mixtures.means, train_phone_models(good, Lexicon(), SMALL, silent_monitor).mixtures.means)
    with pytest.raises(CorpusError, match="none of 1 utterances has a transcript that fits into its recording"):
        train_phone_models([bad], Lexicon(), SMALL, silent_monitor)
