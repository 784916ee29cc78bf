from itertools import groupby, pairwise

import numpy as np
import pytest

from hmm import synthetic
from lipmotion.errors import CorpusError
from lipmotion.hmm import model, unit_training
from lipmotion.stats.bigram import estimate_bigram
from lipmotion.types import silent_monitor

CONFIG = model.HmmConfig(mixtures=2, context_frames=20)


@pytest.fixture(scope="module")
def trained():
    """Models, the speaker, the utterances, their units, the first frames of these, and the log."""
    log: list[tuple[str, float]] = []
    who = synthetic.speaker(0)
    corpus = synthetic.recordings(0, 30, who, pauses=True)
    hmm = unit_training.train_hmm(corpus[0], synthetic.INVENTORY, CONFIG, lambda e: log.append((e.stage, e.figure)))
    return hmm, who, *corpus, log


def test_no_iteration_of_any_stage_lowers_the_likelihood(trained):
    *_, log = trained
    stages = {stage: [value for _, value in steps] for stage, steps in groupby(log, key=lambda step: step[0])}
    stages = {stage: [value for value in values if value is not None] for stage, values in stages.items()}
    first, *others = ["flat start", "pronunciations", "2 Gaussians", "pronunciations again", "contexts"]
    assert list(stages) == [first, *others[:-1], "states in context", others[-1]]
    for stage, values in stages.items():
        assert all(after >= before - 1e-5 for before, after in pairwise(values)), stage


def test_boundaries_are_found_within_two_frames(trained):
    hmm, _, transcribed, said, edges, _ = trained
    parts = zip(transcribed, said, edges, strict=True)
    errors = np.concatenate(
        [synthetic.align(hmm, utterance.features, units) - where for utterance, units, where in parts]
    )
    assert np.abs(errors).max() <= 2
    assert np.abs(errors).mean() < 0.15


def test_pauses_are_found_where_they_were_made(trained):
    hmm, _, transcribed, said, _, _ = trained
    chosen = (synthetic.choose(hmm, utterance.features, utterance.words) for utterance in transcribed)
    assert [tuple(unit for part in parts for unit in part.units) for parts in chosen] == said


def test_new_sentences_are_recognised(trained):
    hmm, who, _, said, *_ = trained
    seen = {pair for units in said for pair in pairwise(units)}
    for number, words in enumerate(synthetic.sentences(99, 15)):
        units = synthetic.within_silence(words)
        features, edges = who.say(np.random.default_rng([99, number]), units)
        found, bounds = synthetic.decode(hmm, features, (synthetic.SILENCE, *synthetic.UNITS))
        assert found == units, f"{set(pairwise(units)) - seen} were never seen in training"
        assert bounds == pytest.approx(edges, abs=2)


def test_the_bigram_is_that_of_what_was_said_pauses_being_silence(trained):
    hmm, _, _, said, _, _ = trained
    silent = [tuple(synthetic.SILENCE if unit == synthetic.PAUSE else unit for unit in units) for units in said]
    assert hmm.bigram.units == (synthetic.SILENCE, synthetic.PAUSE, *synthetic.UNITS)
    wanted = estimate_bigram(hmm.bigram.units, silent)
    assert np.array_equal(hmm.bigram.log_probability, wanted.log_probability)


def test_an_utterance_too_short_for_its_words_is_left_out():
    transcribed, _, _ = synthetic.recordings(2, 10, synthetic.speaker(2))
    short = unit_training.TranscribedUtterance(transcribed[0].features[:15], transcribed[0].words)
    for nothing in ([], [short]):
        with pytest.raises(CorpusError, match=f"none of {len(nothing)}"):
            unit_training.train_hmm(nothing, synthetic.INVENTORY, CONFIG, silent_monitor)
    with_it, without = (
        unit_training.train_hmm(given, synthetic.INVENTORY, CONFIG, silent_monitor)
        for given in ([short, *transcribed], transcribed)
    )
    assert np.array_equal(with_it.mixtures.means, without.mixtures.means)
