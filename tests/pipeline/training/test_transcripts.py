import logging
from dataclasses import replace

import pytest

from lipmotion import Corpus, train
from lipmotion.engines import engine_named
from lipmotion.errors import MissingDependencyError
from lipmotion.pipeline.training import labels as module
from lipmotion.pipeline.training.labels import (
    MAX_NAMED_RECORDINGS,
    warn_of_doubtful_transcripts,
    warn_of_missing_transcripts,
)
from lipmotion.speech.recognition.agreement import DOUBTFUL_SCORE, TranscriptFit
from lipmotion.types import Timeline, Unit, Utterance
from testing.toy import SMALL, toy_sentences, toy_utterances

Labelled = list[tuple[Utterance, Timeline[Unit]]]


@pytest.fixture(scope="module")
def labelled() -> Labelled:
    """Utterances whose transcripts are right, with their phones in time."""
    sentences = toy_sentences(12)[:3]
    return [(utterance, said.units) for utterance, said in zip(toy_utterances(12)[:3], sentences, strict=True)]


def messages(caplog: pytest.LogCaptureFixture) -> list[str]:
    assert all(record.levelno == logging.WARNING for record in caplog.records)
    return [record.getMessage() for record in caplog.records]


@pytest.mark.long
def test_training_names_the_transcripts_of_something_else_and_what_has_none(tmp_path, caplog):
    corpus = Corpus.create(tmp_path / "corpus")
    changed = {2: ("squash", "six", "fish", "chefs"), 4: None, 5: ()}
    for number, utterance in enumerate(toy_utterances(12)):
        corpus.add(replace(utterance, words=changed.get(number, utterance.words), phones=None))
    train(corpus, recogniser=SMALL, engine=engine_named("joint", {}))
    missing, wrong = (text for text in messages(caplog) if "transcript" in text)
    assert missing.startswith("2 of 8 recordings have no transcript, or an empty one (toy04, toy05): their phones are")
    assert wrong.startswith("1 of 6 transcripts seem not to be what is said (toy02): the model learns wrong lips")


def test_right_transcripts_are_not_named(labelled, caplog):
    warn_of_doubtful_transcripts(labelled)
    warn_of_missing_transcripts([utterance for utterance, _ in labelled])
    assert not caplog.records


def test_words_that_are_left_out(labelled, caplog):
    """Half of the sentence stands as silence."""
    utterance, units = labelled[0]
    spans = list(units)
    half = [replace(span, label=Unit("sil")) if number > 2 else span for number, span in enumerate(spans)]
    merged = [*half[:3], replace(half[3], end_s=half[-1].end_s)]
    warn_of_doubtful_transcripts([(utterance, Timeline(tuple(merged)))])
    assert [text[:62] for text in messages(caplog)] == [
        "1 of 1 transcripts seem to leave out words that are said (toy0"
    ]


def test_labelled_phones_are_believed(labelled, caplog):
    (utterance, units), (_, others) = labelled[:2]
    warn_of_doubtful_transcripts([(replace(utterance, phones=units), others)])
    assert not caplog.records


def test_without_general_models_nothing_is_measured(labelled, caplog, monkeypatch):
    def missing(*_: object) -> None:
        raise MissingDependencyError("no pocketsphinx")

    monkeypatch.setattr(module, "transcript_fit", missing)
    warn_of_doubtful_transcripts([(labelled[0][0], labelled[1][1])])
    assert not caplog.records


def test_only_some_are_named(labelled, caplog):
    named = labelled[0][0]
    many = [
        replace(named, name=f"take{number:02d}", words=None, phones=None) for number in range(MAX_NAMED_RECORDINGS + 4)
    ]
    warn_of_missing_transcripts([named, *many])
    (text,) = messages(caplog)
    assert "14 of 15 recordings" in text
    assert "take09 and 4 more)" in text
    warn_of_missing_transcripts(many)  # that none has words is said elsewhere
    assert len(caplog.records) == 1


def test_of_two_alignments_the_better_one_counts(labelled, caplog, monkeypatch):
    """It may cover more of the speech and fit it worse."""
    first, second = TranscriptFit(DOUBTFUL_SCORE, ((0.0, 3.0),), 4.0), TranscriptFit(DOUBTFUL_SCORE - 0.1, (), 4.0)
    fits = iter([first, second, second, first])
    monkeypatch.setattr(module, "transcript_fit", lambda *_: next(fits))
    for _ in range(2):
        warn_of_doubtful_transcripts(labelled[:1], lambda utterance: utterance.phones)  # type: ignore[arg-type,return-value]
    assert ["leave out words" in text for text in messages(caplog)] == [True, True]
