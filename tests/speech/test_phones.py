from __future__ import annotations

from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
import pytest

from lipmotion.errors import AlignmentError, CorpusError
from lipmotion.pipeline.model import Model, load_model
from lipmotion.pipeline.toy import WORDS, ToySentence, toy_sentences
from lipmotion.speech import phones as module
from lipmotion.speech.mfcc import mfcc
from lipmotion.speech.phones import SHORT_PAUSE_S, align, recognise, train_phones
from lipmotion.speech.read import read_audio
from lipmotion.speech.synthesise import synthesise
from lipmotion.stats.hmm.model import HmmConfig, UnitHmm
from lipmotion.types import Audio, Features, Timeline, Unit
from lipmotion.types.progress import silent_monitor
from lipmotion.units import PAUSE, SILENCE, Lexicon

SMALL = HmmConfig(mixtures=1, iterations=2)


@pytest.fixture(scope="module")
def sentences() -> list[ToySentence]:
    return toy_sentences(12)


@pytest.fixture(scope="module")
def hmm(toy_model: Model) -> UnitHmm:
    return toy_model.phones


def phones(units: Timeline[Unit]) -> list[str]:
    return [span.label.phone for span in units]


def with_pause(duration_s: float) -> Features:
    """Say ``papa mama`` with a pause between the words."""
    said = [(phone, 0.17 if phone[0] == "a" else 0.105) for word in ("papa", "mama") for phone in WORDS[word]]
    return mfcc(synthesise([("sil", 0.4), *said[:4], ("sil", duration_s), *said[4:], ("sil", 0.5)])[0])


def covers(units: Timeline[Unit], duration_s: float) -> bool:
    """Do the spans follow one another without a gap, from 0 to the end?"""
    edges_s = [0.0, *(span.end_s for span in units)]
    return edges_s == [*(span.start_s for span in units), duration_s]


def test_the_words_are_found_where_they_are(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    errors_s = []
    for sentence in sentences:
        features = mfcc(sentence.audio)
        found = align(hmm, features, sentence.words, Lexicon())
        assert phones(found) == phones(sentence.units)
        assert [span.label.word for span in found] == [span.label.word for span in sentence.units]
        assert covers(found, features.duration_s)
        errors_s += [a.start_s - b.start_s for a, b in zip(found, sentence.units, strict=True)][1:]
    assert np.mean(np.abs(errors_s)) < 0.03
    assert np.percentile(np.abs(errors_s), 90) < 0.05


def test_frame_n_reaches_from_half_a_frame_before_to_half_a_frame_after(
    hmm: UnitHmm, monkeypatch: pytest.MonkeyPatch
) -> None:
    bounds = np.array([0, 10, 12, 40, 60, 101])
    monkeypatch.setattr(module, "decode_units", lambda *_: (("sil", "p", "sil", "aa", "sil"), bounds))
    found = recognise(hmm, mfcc(Audio(np.sin(np.arange(16_100)).astype(np.float32), 16_000)))
    assert [span.start_s for span in found] == pytest.approx([0, 0.095, 0.115, 0.395, 0.595])
    assert covers(found, 16_100 / 16_000)
    assert phones(found) == ["sil", "p", "sil", "aa", "sil"]


def test_unknown_sentences_are_recognised(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    for sentence in sentences:
        features = mfcc(sentence.audio)
        found = recognise(hmm, features)
        assert covers(found, features.duration_s)
        assert set(phones(found)) <= set(hmm.table.units)
        if sentence.split == "test":
            assert phones(found) == phones(sentence.units)
        assert all(span.label.word == "" for span in found)


def test_silence_at_both_ends_is_silence_however_short(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    sentence = sentences[0]
    start, stop = sentence.units.spans[0].end_s - 0.08, sentence.units.spans[-1].start_s + 0.08
    samples = sentence.audio.samples[round(start * 16_000) : round(stop * 16_000)]
    features = mfcc(Audio(samples, 16_000))
    aligned = align(hmm, features, sentence.words, Lexicon())
    assert phones(aligned)[0] == phones(aligned)[-1] == SILENCE
    assert aligned.spans[0].duration_s < SHORT_PAUSE_S
    recognised = phones(recognise(hmm, features))
    assert PAUSE not in (recognised[0], recognised[-1])


def test_a_short_pause_between_words_is_a_pause(hmm: UnitHmm) -> None:
    found = recognise(hmm, with_pause(0.18))
    pauses = [span for span in found if span.label.phone == PAUSE]
    assert len(pauses) == 1
    assert pauses[0].duration_s < SHORT_PAUSE_S
    assert phones(found)[5] == PAUSE


@pytest.mark.parametrize("known", [True, False])
def test_a_long_pause_between_words_is_silence(hmm: UnitHmm, known: bool) -> None:
    features = with_pause(0.5)
    found = align(hmm, features, ("papa", "mama"), Lexicon()) if known else recognise(hmm, features)
    assert phones(found) == [SILENCE, *WORDS["papa"], SILENCE, *WORDS["mama"], SILENCE]
    assert found.spans[5].label.word == ""
    assert found.spans[5].duration_s == pytest.approx(0.5, abs=0.12)


def test_the_sound_decides_between_pronunciations(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    sentence = sentences[0]  # see bob papa mama
    both = Lexicon({"bob": (("t", "uw", "t"), ("b", "aa", "b"))})
    found = align(hmm, mfcc(sentence.audio), sentence.words, both)
    assert [span.label.phone for span in found if span.label.word == "bob"] == ["b", "aa", "b"]


def test_a_phone_never_heard_borrows_a_relative_s_sound(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    sentence = sentences[0]
    assert not {"z", "g"} & set(hmm.table.units)
    found = align(hmm, mfcc(sentence.audio), sentence.words, Lexicon({"see": (("z", "ih"),)}))
    assert phones(found)[1:3] == ["z", "ih"]  # named as in the lexicon
    errors_s = [a.start_s - b.start_s for a, b in zip(found, sentence.units, strict=True)]
    assert np.abs(errors_s).max() < 0.1


def test_digital_silence_is_silence(hmm: UnitHmm) -> None:
    found = recognise(hmm, mfcc(Audio(np.zeros(16_000, np.float32), 16_000)))
    assert phones(found) == [SILENCE]
    assert covers(found, 1.0)


def test_no_words_are_silence(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    found = align(hmm, mfcc(sentences[0].audio), (), Lexicon())
    assert set(phones(found)) == {SILENCE}


def test_too_many_words_for_the_sound(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    with pytest.raises(AlignmentError, match=r"in \d+ frames of 10 ms: the recording is too short"):
        align(hmm, mfcc(sentences[0].audio), ["baby"] * 50, Lexicon())


def test_training_is_reported_and_does_not_get_worse(sentences: list[ToySentence]) -> None:
    steps: list[tuple[str, float]] = []
    spoken = [(mfcc(sentence.audio), sentence.words) for sentence in sentences[:4]]
    hmm = train_phones(spoken, Lexicon(), SMALL, lambda event: steps.append((event.stage, event.figure)))
    assert {"flat start", "pronunciations"} <= {step for step, _ in steps}
    for stage in ("flat start", "pronunciations"):
        values = [value for step, value in steps if step == stage and value is not None]
        assert all(before <= after + 1e-6 for before, after in pairwise(values))
    said = {phone for sentence in sentences[:4] for word in sentence.words for phone in WORDS[word]}
    assert set(hmm.table.units) == said | {SILENCE, PAUSE}


def test_transcripts_that_do_not_fit_are_left_out(sentences: list[ToySentence]) -> None:
    good = [(mfcc(sentence.audio), sentence.words) for sentence in sentences[:4]]
    bad = (good[0][0], ("five",) * 100)
    hmm = train_phones([*good, bad], Lexicon(), SMALL, silent_monitor)
    assert np.array_equal(hmm.mixtures.means, train_phones(good, Lexicon(), SMALL, silent_monitor).mixtures.means)
    with pytest.raises(CorpusError, match="none of 1 utterances has a transcript that fits into its recording"):
        train_phones([bad], Lexicon(), SMALL, silent_monitor)


@pytest.mark.recordings
def test_words_of_real_recordings_are_found_where_others_found_them(recordings: Path) -> None:
    """GRID's own word times, of twelve sentences."""
    grid, errors_s = recordings / "grid-s1", []
    for name in (grid / "test.txt").read_text().split()[::4][:12]:
        rows = [line.split() for line in (grid / "align" / f"{name}.align").read_text().splitlines()]
        words = [(int(start) / 25_000, word) for start, _, word in rows if word not in (SILENCE, PAUSE)]
        features = mfcc(read_audio(grid / "clips" / f"{name}.mkv"))
        found = align(load_model().phones, features, [word for _, word in words], Lexicon())
        spoken = groupby((span for span in found if span.label.word), key=lambda span: span.label.word)
        starts_s = [next(spans).start_s for _, spans in spoken]
        errors_s += [a - b for a, (b, _) in zip(starts_s, words, strict=True)]
    assert np.mean(np.abs(errors_s)) < 0.05
    assert abs(np.median(errors_s)) < 0.03
