from collections.abc import Sequence
from difflib import SequenceMatcher
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Model, errors, load_model
from lipmotion.hmm.model import HmmConfig, UnitHmm
from lipmotion.pipeline.training.train import train_phone_models
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.recognition import recogniser
from lipmotion.speech.recognition import recogniser as module
from lipmotion.speech.recognition.general import NOISES, combine_phones, combined_log_likelihoods, general_model
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.types import Audio, Timeline, Unit, silent_monitor
from lipmotion.units import PAUSE, PHONES, SILENCE, Lexicon, split_words
from lipmotion.units.phones import SHORT_PAUSE_S
from testing.formant_synthesiser import synthesise
from testing.toy import WORDS, ToySentence, toy_sentences


@pytest.fixture(scope="module")
def sentences() -> list[ToySentence]:
    return toy_sentences(12)


@pytest.fixture(scope="module")
def hmm(toy_model: Model) -> UnitHmm:
    return toy_model.phones


def align(hmm: UnitHmm, audio: Audio, words: Sequence[str], lexicon: Lexicon, kind: str = "own") -> Timeline[Unit]:
    heard = analysed(audio)
    return recogniser.Recogniser(hmm, kind).align(heard, heard.mfcc(), words, lexicon)


def recognise(hmm: UnitHmm, audio: Audio, kind: str = "own") -> Timeline[Unit]:
    heard = analysed(audio)
    return recogniser.Recogniser(hmm, kind).recognise(heard, heard.mfcc())


def phones(units: Timeline[Unit]) -> list[str]:
    return [span.label.phone for span in units]


def with_pause(duration_s: float) -> Audio:
    """Say ``papa mama`` with a pause between the words."""
    said = [(phone, 0.17 if phone[0] == "a" else 0.105) for word in ("papa", "mama") for phone in WORDS[word]]
    return synthesise([("sil", 0.4), *said[:4], ("sil", duration_s), *said[4:], ("sil", 0.5)])[0]


def covers(units: Timeline[Unit], duration_s: float) -> bool:
    """Do the spans follow one another without a gap, from 0 to the end?"""
    edges_s = [0.0, *(span.end_s for span in units)]
    return edges_s == [*(span.start_s for span in units), duration_s]


def test_the_words_are_found_where_they_are(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    errors_s = []
    for sentence in sentences[::2]:
        found = align(hmm, sentence.audio, sentence.words, Lexicon())
        assert phones(found) == phones(sentence.units)
        assert [span.label.word for span in found] == [span.label.word for span in sentence.units]
        assert covers(found, sentence.audio.duration_s)
        errors_s += [a.start_s - b.start_s for a, b in zip(found, sentence.units, strict=True)][1:]
    assert np.mean(np.abs(errors_s)) < 0.03
    assert np.percentile(np.abs(errors_s), 90) < 0.05


def test_frame_n_reaches_from_half_a_frame_before_to_half_a_frame_after_and_silences_are_one() -> None:
    bounds = np.array([0, 10, 12, 40, 60, 80, 100])
    found = module._timeline([(phone, "") for phone in ("sil", "p", "sil", "aa", "sil", "sil")], bounds, 1.0)
    assert [span.start_s for span in found] == pytest.approx([0, 0.095, 0.115, 0.395, 0.595])
    assert covers(found, 1.0)
    assert phones(found) == ["sil", "p", "sil", "aa", "sil"]


def test_unknown_sentences_are_recognised_and_digital_silence_is_silence(
    hmm: UnitHmm, sentences: list[ToySentence]
) -> None:
    for sentence in sentences[-3:]:
        found = recognise(hmm, sentence.audio)
        assert covers(found, sentence.audio.duration_s)
        assert set(phones(found)) <= set(hmm.table.units)
        if sentence.split == "test":
            assert SequenceMatcher(None, phones(found), phones(sentence.units)).ratio() > 0.9
        assert all(span.label.word == "" for span in found)
    silent = recognise(hmm, Audio(np.zeros(16_000, np.float32), 16_000))
    assert phones(silent) == [SILENCE]
    assert covers(silent, 1.0)


def test_silence_at_both_ends_is_silence_however_short(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    sentence = sentences[0]
    start, stop = sentence.units.spans[0].end_s - 0.08, sentence.units.spans[-1].start_s + 0.08
    samples = sentence.audio.samples[round(start * 16_000) : round(stop * 16_000)]
    audio = Audio(samples, 16_000)
    aligned = align(hmm, audio, sentence.words, Lexicon())
    assert phones(aligned)[0] == phones(aligned)[-1] == SILENCE
    assert aligned.spans[0].duration_s < SHORT_PAUSE_S
    recognised = phones(recognise(hmm, audio))
    assert PAUSE not in (recognised[0], recognised[-1])


def test_a_short_pause_between_words_is_a_pause(hmm: UnitHmm) -> None:
    found = recognise(hmm, with_pause(0.18))
    pauses = [span for span in found if span.label.phone == PAUSE]
    assert len(pauses) == 1
    assert pauses[0].duration_s < SHORT_PAUSE_S
    assert phones(found)[5] == PAUSE


@pytest.mark.parametrize("known", [True, False])
def test_a_long_pause_between_words_is_silence(hmm: UnitHmm, known: bool) -> None:
    audio = with_pause(0.5)
    found = align(hmm, audio, ("papa", "mama"), Lexicon()) if known else recognise(hmm, audio)
    assert phones(found) == [SILENCE, *WORDS["papa"], SILENCE, *WORDS["mama"], SILENCE]
    assert found.spans[5].label.word == ""
    assert found.spans[5].duration_s == pytest.approx(0.5, abs=0.12)


def test_a_phone_without_data_takes_the_models_of_a_similar_one(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    sentence = sentences[0]
    assert not {"z", "g"} & set(hmm.table.units)
    found = align(hmm, sentence.audio, sentence.words, Lexicon({"see": (("z", "ih"),)}))
    assert phones(found)[1:3] == ["z", "ih"]  # named as in the lexicon
    errors_s = [a.start_s - b.start_s for a, b in zip(found, sentence.units, strict=True)]
    assert np.abs(errors_s).max() < 0.1


def test_too_many_words_for_the_sound_and_an_unknown_kind_are_refused(
    hmm: UnitHmm, sentences: list[ToySentence]
) -> None:
    with pytest.raises(errors.AlignmentError, match=r"50 words take at least \d+ frames of 10 ms, found \d+"):
        align(hmm, sentences[0].audio, ["baby"] * 50, Lexicon())
    with pytest.raises(errors.InputError, match="'best'; required one of: auto, words, fast, own, general"):
        recogniser.Recogniser(hmm, "best")


@pytest.mark.recordings
def test_words_of_real_recordings_are_found_where_others_found_them(recordings: Path) -> None:
    """GRID's own word times, of twelve sentences."""
    grid, errors_s = recordings / "grid-s1", []
    for name in (grid / "test.txt").read_text().split()[::4][:12]:
        rows = [line.split() for line in (grid / "align" / f"{name}.align").read_text().splitlines()]
        words = [(int(start) / 25_000, word) for start, _, word in rows if word not in (SILENCE, PAUSE)]
        audio = read_audio(grid / "clips" / f"{name}.mkv")
        found = align(load_model().phones, audio, [word for _, word in words], Lexicon(), "auto")
        spoken = groupby((span for span in found if span.label.word), key=lambda span: span.label.word)
        starts_s = [next(spans).start_s for _, spans in spoken]
        errors_s += [a - b for a, (b, _) in zip(starts_s, words, strict=True)]
    assert np.mean(np.abs(errors_s)) < 0.05
    assert abs(np.median(errors_s)) < 0.03


@pytest.mark.parametrize("kind", ["auto", "fast", "general"])
def test_every_kind_gives_phones_from_start_to_end(hmm: UnitHmm, sentences: list[ToySentence], kind: str) -> None:
    sentence = sentences[0]
    found = recognise(hmm, sentence.audio, kind)
    assert covers(found, sentence.audio.duration_s)
    assert set(phones(found)) <= set(PHONES)
    aligned = align(hmm, sentence.audio, sentence.words, Lexicon(), kind)
    errors_s = [a.start_s - b.start_s for a, b in zip(aligned, sentence.units, strict=True)]
    assert np.median(np.abs(errors_s)) < 0.03


def test_own_models_that_learned_little_do_not_align(hmm: UnitHmm, sentences: list[ToySentence]) -> None:
    """They still say what was said; where it was is left to the general models."""
    assert hmm.mixtures.size[1] <= module.FEW_GAUSSIANS
    said, lexicon = sentences[0], Lexicon()
    aligned = align(hmm, said.audio, said.words, lexicon, "auto")
    assert aligned == align(hmm, said.audio, said.words, lexicon, "general")
    assert aligned != align(hmm, said.audio, said.words, lexicon, "own")
    found = recognise(hmm, said.audio, "auto")
    again = recogniser.Recogniser(hmm, "general").align_phones(said.audio, analysed(said.audio).mfcc(), found)
    assert phones(found) == phones(again)
    assert [span.start_s for span in found] == pytest.approx([span.start_s for span in again], abs=0.011)


@pytest.mark.recordings
def test_speakers_and_words_beyond_all_training(recordings: Path) -> None:
    """The general models find about twice as many phones as those of one GRID speaker."""
    share = {}
    for kind in ("own", "auto"):
        right = count = 0
        for name in ("61-70968-0000.flac", "sense_and_sensibility_01_austen_64kb-0880.wav"):
            audio = read_audio(recordings / "speech-open" / name)
            text = (recordings / "speech-open" / name).with_suffix(".txt" if name.endswith("wav") else ".lab")
            spoken = phones(align(load_model().phones, audio, split_words(text.read_text()), Lexicon(), "general"))
            matcher = SequenceMatcher(None, spoken, phones(recognise(load_model().phones, audio, kind)), autojunk=False)
            right += sum(block.size for block in matcher.get_matching_blocks())
            count += len(spoken)
        share[kind] = right / count
    assert share["auto"] > 0.5
    assert share["auto"] > share["own"] + 0.15


def test_all_phones_are_there_and_the_own_ones_are_as_they_were(toy_model: Model) -> None:
    own = toy_model.phones
    combined = combine_phones(own)
    table = combined.hmm.table
    assert set(table.units) == {*PHONES, *NOISES}
    assert table.free[0] == SILENCE
    assert len(combined.columns) == len(table.names) == len(combined.hmm.mixtures.means)
    for index, name in enumerate(own.table.names):
        there = table.names.index(name)
        assert np.array_equal(combined.hmm.mixtures.means[there], own.mixtures.means[index])
    assert combined.hmm.stay("b", 0) == own.stay("b", 0)
    assert np.exp(combined.hmm.bigram.log_probability).sum(axis=1) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("trust", [0.0, 0.4])
def test_evidence_is_the_sum_of_both(toy_model: Model, trust: float) -> None:
    own, general = np.random.default_rng(0).normal(size=(2, 9, 39)).astype(np.float32)
    combined = combine_phones(toy_model.phones)
    log_likelihoods = combined_log_likelihoods(combined, own, trust, general)
    wanted = general_model().log_density(general)[:, combined.columns] + trust * combined.hmm.mixtures.log_likelihood(
        own
    )
    assert log_likelihoods.frames == 9
    assert log_likelihoods.log_density(0, 9, None) == pytest.approx(wanted, abs=2e-3)
    some = np.array([5, 2, 40])
    assert log_likelihoods.log_density(3, 7, some) == pytest.approx(wanted[3:7, some], abs=2e-3)


SMALL = HmmConfig(mixtures=1, iterations=2)


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
    with pytest.raises(errors.CorpusError, match="none of 1 utterances has a transcript that fits into its recording"):
        train_phone_models([bad], Lexicon(), SMALL, silent_monitor)
