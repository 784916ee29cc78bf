from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Lexicon
from lipmotion.errors import ExportError, InputError
from lipmotion.testing.toy import LIP_LEAD_S, LIPS_TOUCH, WORDS, ToySentence, toy_motion, toy_sentences, toy_utterances
from lipmotion.types import Span, Timeline, Unit
from lipmotion.units.phones import SILENCE
from lipmotion_faces.testing import write_toy_recordings
from lipmotion_faces.tracking.track import track

FPS = 25.0


@pytest.fixture(scope="module")
def sentences() -> list[ToySentence]:
    return toy_sentences(12)


def spelled(*phones: tuple[str, float]) -> Timeline[Unit]:
    edges_s = np.cumsum([0.0, *(duration_s for _, duration_s in phones)])
    return Timeline(
        tuple(Span(start, end, Unit(phone)) for (phone, _), (start, end) in zip(phones, pairwise(edges_s), strict=True))
    )


def test_words_are_pronounced_as_in_the_dictionary():
    for word in WORDS:
        assert Lexicon().known(word)
        assert WORDS[word] in Lexicon().pronunciations(word)


def test_sentences_say_their_words(sentences):
    for sentence in sentences:
        phones = [span.label.phone for span in sentence.units]
        assert phones == [SILENCE, *(phone for word in sentence.words for phone in WORDS[word]), SILENCE]
        words = [span.label.word for span in sentence.units][1:-1]
        assert words == [word for word in sentence.words for _ in WORDS[word]]
        assert len(sentence.words) >= 3


def test_sentences_have_the_promised_lengths(sentences):
    for sentence in sentences:
        assert 2 <= sentence.audio.duration_s <= 3.1
        assert sentence.units.spans[-1].end_s == pytest.approx(sentence.audio.duration_s, abs=1e-4)
        for silence in (sentence.units.spans[0], sentence.units.spans[-1]):
            assert 0.4 <= silence.duration_s <= 0.6
            assert silence.label.word == ""


def test_the_splits(sentences):
    assert [sentence.split for sentence in sentences] == ["train"] * 8 + ["val"] * 2 + ["test"] * 2
    assert [sentence.split for sentence in toy_sentences(3)] == ["train", "val", "test"]
    for seed in range(1):
        said = {word for s in toy_sentences(6, seed) if s.split == "train" for word in s.words}
        assert said == set(WORDS)


def test_the_seed_decides_and_more_begins_with_the_same(sentences):
    for few, many in zip(toy_sentences(4), sentences, strict=False):
        assert (few.name, few.words, few.units) == (many.name, many.words, many.units)
        assert np.array_equal(few.audio.samples, many.audio.samples)
    assert [s.words for s in toy_sentences(4, seed=1)] != [s.words for s in sentences[:4]]


def test_a_corpus_needs_three_sentences():
    for make in (toy_sentences, toy_utterances):
        with pytest.raises(InputError, match="2 toy sentences asked for"):
            make(2)


@pytest.mark.parametrize("rate_hz", [25.0, 30.0, 100.0])
def test_the_mouth_is_shut_in_silence_and_touches_in_p_b_m(sentences, rate_hz):
    for sentence in sentences:
        motion = toy_motion(sentence.units, rate_hz)
        first, last = sentence.units.spans[0].end_s, sentence.units.spans[-1].start_s
        quiet = (motion.time_s < first - 0.1) | (motion.time_s > last + 0.1)
        assert quiet.sum() > 0.5 * rate_hz
        assert (motion["opening"][quiet] == 0).all()
        for span in sentence.units:
            inside = (motion.time_s >= span.start_s) & (motion.time_s < span.end_s)
            if span.label.phone in LIPS_TOUCH:
                assert motion["opening"][inside].min() == 0
            elif span.label.phone == "aa":
                assert motion["opening"][inside].max() > 0.2


def test_the_lips_lead_the_sound():
    motion = toy_motion(spelled(("sil", 0.5), ("aa", 0.2), ("sil", 0.5)), 100.0)
    middle_s = np.average(motion.time_s, weights=motion["opening"])
    assert middle_s == pytest.approx(0.6 - LIP_LEAD_S, abs=0.002)
    assert 0 < LIP_LEAD_S < 1 / FPS


def test_motion_says_what_is_wrong():
    for units, rate_hz, message in (
        (Timeline(()), 25.0, "at least one"),
        (spelled(("aa", 0.1)), 0.0, "rate is 0.0 Hz"),
        (spelled(("aa", 0.1), ("AA", 0.1)), 25.0, "'AA'"),
    ):
        with pytest.raises(InputError, match=message):
            toy_motion(units, rate_hz)


def test_utterances_are_the_sentences_perfectly_tracked(sentences):
    for utterance, sentence in zip(toy_utterances(12), sentences, strict=True):
        assert (utterance.name, utterance.words, utterance.split) == (sentence.name, sentence.words, sentence.split)
        assert np.array_equal(utterance.audio.samples, sentence.audio.samples)
        assert utterance.features.values.shape == (int(sentence.audio.duration_s * 100 + 1e-9) + 1, 39)
        assert utterance.track.motion.rate_hz == FPS
        assert np.array_equal(utterance.track.motion.values, toy_motion(sentence.units, FPS).values)
        assert utterance.track.seen.shape == (len(utterance.track.motion.values),)
        assert utterance.track.seen.all()


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_toy_recordings(tmp_path_factory.mktemp("toy") / "new", sentences=3)


def test_recordings_come_with_transcripts_and_lists(recordings):
    folder = recordings[0].parent
    sentences = toy_sentences(3)
    assert [path.name for path in recordings] == ["toy00.mp4", "toy01.mp4", "toy02.mp4"]
    assert sorted(path.name for path in folder.iterdir() if path.suffix == ".txt") == [
        *("test.txt", "toy00.txt", "toy01.txt", "toy02.txt", "train.txt", "val.txt")
    ]
    for path, sentence in zip(recordings, sentences, strict=True):
        assert path.with_suffix(".txt").read_text().split() == list(sentence.words)
        assert (folder / f"{sentence.split}.txt").read_text() == f"{sentence.name}\n"


def test_recordings_say_what_is_wrong(tmp_path):
    with pytest.raises(InputError, match="2 toy sentences"):
        write_toy_recordings(tmp_path / "new", sentences=2)
    assert not (tmp_path / "new").exists()
    with pytest.raises(InputError, match="0"):
        write_toy_recordings(tmp_path, sentences=3, fps=0)
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").touch()
    with pytest.raises(ExportError, match="file"):
        write_toy_recordings(tmp_path / "file", sentences=3)


@pytest.mark.long
@pytest.mark.video
def test_toy_faces_can_be_tracked(recordings):
    pytest.importorskip("mediapipe")
    for path, sentence in zip(recordings, toy_sentences(3), strict=True):
        tracked, known = track(path, crops=False), toy_motion(sentence.units, FPS)["opening"]
        opening = tracked.motion["opening"]
        assert tracked.seen.all()
        assert np.corrcoef(opening, known)[0, 1] > 0.9
        assert np.median(opening[known == 0]) < 0.3 * np.percentile(opening, 95)
