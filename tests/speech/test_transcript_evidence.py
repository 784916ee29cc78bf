from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion import load_model
from lipmotion.speech.features.mfcc import general_features
from lipmotion.speech.recognition import agreement, general
from lipmotion.speech.recognition import transcript_evidence as module
from lipmotion.speech.recognition.transcript_evidence import _find_best_path
from lipmotion.types import Audio, Span, Timeline, Unit
from lipmotion.units import PHONES, Lexicon
from lipmotion_faces.corpus.folder import spell_name
from pipeline.made import read_sound, recogniser_of
from testing.toy import ToySentence, toy_sentences

FRAME_S = 0.02
SAID = {"papa": "p aa p aa", "sees": "s iy z", "a": "ax", "fish": "f ih sh"}
OTHER = {"book": "b uh k", "away": "ax w ey", "meow": "m iy aw"}


def heard(words: list[str], sure: float = 0.9, pause: int = 10) -> NDArray[np.float64]:
    """Return the log posteriors of words: a phone in every other frame, pauses at both ends [shape=(T, 48)]."""
    phones = [phone for word in words for phone in (SAID | OTHER)[word].split()]
    names = ["", *(name for phone in phones for name in (phone, ""))]
    columns = [len(PHONES)] * pause + [PHONES.index(name) if name else len(PHONES) for name in names]
    columns += [len(PHONES)] * pause
    found = np.full((len(columns), len(PHONES) + 1), (1 - sure) / len(PHONES))
    found[np.arange(len(columns)), columns] = sure
    return np.log(found)


def transcript(words: list[str], end_s: float, word_s: float = 0.1) -> Timeline[Unit]:
    """Return words in time, one after another: what forced alignment makes of any transcript."""
    spans, at_s = [Span(0.0, 0.2, Unit("sil"))], 0.2
    for word in words:
        phones = (SAID | OTHER)[word].split()
        for phone in phones:
            spans.append(Span(at_s, at_s + word_s / len(phones), Unit(phone, word=word)))
            at_s = spans[-1].end_s
    return Timeline((*spans, Span(at_s, max(end_s, at_s + 0.1), Unit("sil"))))


def test_a_right_transcript_is_said() -> None:
    found = module.find_evidence(heard([*SAID]), FRAME_S, transcript([*SAID], 1.0))
    assert [word.word for word in found.words] == [*SAID]
    assert (found.unsaid, found.others, found.is_doubtful) == ((), (), False)
    assert found.words[0].start_s == pytest.approx(0.22)
    assert found.words[0].end_s == pytest.approx(0.36)  # four phones and the blanks between them


def test_words_that_do_not_fit_into_the_frames_are_not_said() -> None:
    crowded = module.find_evidence(heard([], pause=12), FRAME_S, transcript([*SAID] * 3, 0.5, word_s=0.02))
    assert (crowded.unsaid, crowded.gaps) == (crowded.words, ())


def test_another_transcript_is_doubtful() -> None:
    for words in ([*OTHER], [*SAID][::-1]):
        found = module.find_evidence(heard([*SAID], sure=0.99999), FRAME_S, transcript(words, 1.0))
        assert found.is_doubtful
        assert found.gaps


def test_the_word_that_is_not_said_is_left_out_where_another_is() -> None:
    words = ["papa", "sees", "meow", "fish"]
    said = heard(["papa", "sees", "away", "fish"], sure=0.99999)
    found = module.find_evidence(said, FRAME_S, transcript(words, 1.0))
    (wrong,) = found.unsaid
    assert wrong.word == "meow"
    assert (wrong.start_s, wrong.end_s) == pytest.approx((0.4, 0.5))  # where it was aligned
    (other,) = found.others
    assert (other.first, other.stop) == (2, 3)
    assert (other.start_s, other.end_s) == pytest.approx((0.50, 0.60), abs=0.03)
    assert found.spoken_share == pytest.approx(10 / 13)
    assert not found.is_doubtful


@pytest.mark.parametrize("first", [False, True])
def test_a_sentence_too_many_is_left_out_and_nothing_is_missing(first: bool) -> None:
    words = [*OTHER, *SAID] if first else [*SAID, *OTHER]
    found = module.find_evidence(heard([*SAID], sure=0.99999), FRAME_S, transcript(words, 2.0, word_s=0.05))
    assert [word.word for word in found.unsaid] == [*OTHER]
    assert found.gaps == ()


def test_words_that_are_left_out_are_a_gap_in_their_place() -> None:
    whole, part = ["papa", "meow", "away", "fish"], ["papa", "fish"]
    found = module.find_evidence(heard(whole, sure=0.999), FRAME_S, transcript(part, 1.0))
    first = 10 + 1 + 2 * 4  # pause, blank, papa
    (gap,) = found.gaps
    assert gap == pytest.approx((first * FRAME_S, (first + 11) * FRAME_S), abs=0.03)
    assert found.unsaid == ()
    nothing = module.find_evidence(heard(whole, sure=0.999), FRAME_S, Timeline((Span(0.0, 1.0, Unit("sil")),)))
    assert len(nothing.gaps) == 1
    assert nothing.words == ()


def test_similar_phones_are_heard_for_one_another() -> None:
    """And an unsure network has no strong opinion."""
    spoken = Timeline(tuple(Span(n / 10, (n + 1) / 10, Unit(p, word="c")) for n, p in enumerate(["z", "ih", "s"])))
    assert module.find_evidence(heard(["sees"]), FRAME_S, spoken).others == ()
    wrong = [module.find_evidence(heard(["sees"], sure), FRAME_S, transcript(["book"], 1.0)) for sure in (0.9999, 0.2)]
    assert [len(found.unsaid) for found in wrong] == [1, 0]


def test_a_long_recording_is_divided(monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["papa", "sees", "a", "fish"]
    log_posteriors = np.concatenate([heard(words, sure=0.99999)] * 3)
    piece_s = len(log_posteriors) / 3 * FRAME_S
    spans = []
    for number in range(3):
        spans += list(transcript([*SAID] if number != 1 else [*OTHER], piece_s).shifted(number * piece_s))
    whole = module.find_evidence(log_posteriors, FRAME_S, Timeline(tuple(spans)))
    monkeypatch.setattr(module, "LARGEST_SEARCH", 0)
    monkeypatch.setattr(module, "MIN_STRETCH_S", 0.3)
    parts = module.find_evidence(log_posteriors, FRAME_S, Timeline(tuple(spans)))
    assert [word.is_said for word in parts.words] == [True] * 4 + [False] * 3 + [True] * 4
    assert [word[:2] for word in parts.words] == [word[:2] for word in whole.words]
    (one,), (other,) = whole.others, parts.others
    assert other == pytest.approx(one, abs=0.05)


def best_by_trying(log_posteriors: NDArray[np.float64], words: list[list[int]]) -> tuple[float, list[bool]]:
    """Return the score of the best path, and which words it says: all of them are tried, one after another."""
    phones = [phone for word in words for phone in word]
    edges = list(np.cumsum([0, *map(len, words)]))
    silent = np.logaddexp.reduce(log_posteriors[:, module.SILENT], axis=1)
    anything = np.maximum(log_posteriors.max(axis=1), silent)
    spoken = np.log(np.exp(log_posteriors) @ module._count_taken())

    def best(t: int, n: int, how: str) -> tuple[float, list[bool]]:
        """Return the best way on from the frame t, where n phones are said, or left out."""
        ways = []
        if t == len(log_posteriors):
            return (0.0 if n == len(phones) else -np.inf), []
        rest, said = best(t + 1, n, "blank")
        ways.append((silent[t] + rest, said))
        if how == "phone":
            rest, said = best(t + 1, n, "phone")
            ways.append((spoken[t, phones[n - 1]] + rest, said))
        if n < len(phones) and (how != "phone" or n in edges or phones[n] != phones[n - 1]):
            rest, said = best(t + 1, n + 1, "phone")
            ways.append((spoken[t, phones[n]] + rest, [True, *said] if n + 1 in edges else said))
        if n in edges:
            for stop in edges[edges.index(n) :]:
                left_out = edges.index(stop) - edges.index(n)
                first_cost = 0.0 if how in ("free", "instead") else module.GAP_COST
                cost = (
                    first_cost + bool(left_out and how != "instead") * module.WORD_COST + module.PHONE_COST * (stop - n)
                )
                rest, said = best(t + 1, stop, "instead" if left_out or how == "instead" else "free")
                ways.append((anything[t] - cost + rest, [False] * left_out + said))
        return max(ways)

    return best(0, 0, "blank")


@pytest.mark.parametrize("seed", range(6))
def test_the_best_path_is_the_best_of_all(seed: int) -> None:
    draw = np.random.default_rng(seed)
    words = [[4], [9, 9], [12]][: 2 + seed % 2]
    logits = draw.normal(0, 12, (5, len(PHONES) + 1))
    log_posteriors = logits - np.logaddexp.reduce(logits, axis=1)[:, None]
    _, said = best_by_trying(log_posteriors, words)
    frames_of_words, _ = _find_best_path(log_posteriors, [np.array(word) for word in words])
    assert [frames is not None for frames in frames_of_words] == said


ROW_S = 2 * FRAME_S


def labels(words: list[str], start_s: float = 0.2) -> Timeline[Unit]:
    """Return the phones of words in time as ``heard`` has them."""
    phones = [phone for word in words for phone in (SAID | OTHER)[word].split()]
    return Timeline(tuple(Span(start_s + n * ROW_S, start_s + (n + 1) * ROW_S, Unit(p)) for n, p in enumerate(phones)))


def test_labels_are_compared_with_what_is_said_at_their_times() -> None:
    words = [*SAID] * 2
    log_posteriors = heard(words, pause=40)
    right = module.label_evidence(log_posteriors, FRAME_S, labels(words, 0.8))
    assert right == ((), (), ())
    half = module.label_evidence(log_posteriors, FRAME_S, labels([*SAID], 0.8))
    ((start_s, end_s),) = half.missing
    assert (start_s, end_s) == pytest.approx((1.3, 1.7), abs=0.15)
    assert half[1:] == ((), ())
    silent = module.label_evidence(heard([], pause=60), FRAME_S, labels(words, 0.8))
    assert silent.idle == ((pytest.approx(0.8), pytest.approx(0.8 + 22 * ROW_S)),)
    other = module.label_evidence(log_posteriors, FRAME_S, labels([*OTHER] * 2, 0.8))
    assert other.wrong
    late = module.label_evidence(log_posteriors, FRAME_S, labels(words, 1.3))
    assert late.missing
    assert late.idle


@pytest.fixture(scope="module")
def sentences() -> list[ToySentence]:
    return toy_sentences(5)


def test_it_is_the_mean_over_phones_of_the_best_state_of_what_is_said(sentences: list[ToySentence]) -> None:
    """Frame by frame, by name."""
    sentence = sentences[0]
    density = general.load_general().log_density(general_features(sentence.audio))
    names = {"ax": "AH", "axr": "ER", "ix": "IH"}
    spoken = [
        (n, number, span.label.phone)
        for n in range(len(density))
        for number, span in enumerate(sentence.units)
        if span.start_s - 1e-8 <= n / 100 < span.end_s - 1e-8 and span.label.phone not in ("sil", "sp")
    ]
    wanted: dict[int, list[float]] = {}
    for frame, number, phone in spoken[:: agreement.FRAME_STEP]:
        states = density[frame].reshape(len(general.PHONES), 3)[general.PHONES.index(names.get(phone, phone.upper()))]
        wanted.setdefault(number, []).append(max(states.max(), agreement.WORST_SCORE))
    mean = np.mean([np.mean(scores) for scores in wanted.values()])
    assert agreement.measure_fit(sentence.audio, sentence.units).score == pytest.approx(mean, abs=1e-4)


def test_loud_silence_is_missing_speech(sentences: list[ToySentence]) -> None:
    audio, units = sentences[0].audio, sentences[0].units
    fit = agreement.measure_fit(audio, Timeline((Span(0.0, audio.duration_s, Unit("sil")),)))
    ((start_s, end_s),) = fit.missing
    spoken = [span for span in units if span.label.phone != "sil"]
    assert (start_s, end_s) == pytest.approx((spoken[0].start_s, spoken[-1].end_s), abs=0.2)
    assert fit.speech_s == pytest.approx(fit.missing_s)
    assert fit.share == pytest.approx(0)
    assert agreement.measure_fit(audio, units).missing == ()


def test_long_phones_are_judged_by_their_sound(sentences: list[ToySentence]) -> None:
    """A vowel that is drawn out is right; another phone in its place is stretched over speech that is left out.

    Over what is quiet it is stretched, too, and nothing is left out.
    """
    said, longer_s = sentences[0], 0.6
    spans = list(said.units)
    place = next(number for number, span in enumerate(spans) if span.label.phone == "iy")
    rate_hz = said.audio.rate_hz
    first, stop = (round(time_s * rate_hz) for time_s in (spans[place].start_s + 0.03, spans[place].end_s - 0.03))
    samples = said.audio.samples
    vowel = np.resize(samples[first:stop], round(longer_s * rate_hz))
    end_s = spans[place].end_s + longer_s
    later = [replace(s, start_s=s.start_s + longer_s, end_s=s.end_s + longer_s) for s in spans[place + 1 :]]

    def missing(phone: str, gain: float = 1.0) -> tuple[tuple[float, float], ...]:
        audio = Audio(np.concatenate([samples[:stop], gain * vowel, samples[stop:]]), rate_hz)
        units = Timeline((*spans[:place], replace(spans[place], end_s=end_s, label=Unit(phone)), *later))
        fit = agreement.measure_fit(audio, units)
        assert (fit.share < 0.8) == bool(fit.missing)
        return fit.missing

    assert missing("iy") == ()
    assert missing("m") == ((spans[place].start_s, end_s),)
    assert missing("m", gain=0.003) == ()


@pytest.mark.recordings
def test_a_part_of_a_transcript_is_noticed_and_a_whole_one_is_not(recordings: Path) -> None:
    """Docs/robustness.md."""
    names = (recordings / "grid-s1" / "val.txt").read_text().split()[::4]
    phones, whole, half = recogniser_of(load_model(), "auto"), 0, 0
    for name in names:
        audio, words = read_sound(recordings / "grid-s1" / "clips" / f"{name}.mkv"), spell_name(name)
        assert words is not None
        for said, kept in ((words, True), (words[:3], False)):
            units = phones.align(audio, said, Lexicon())
            noticed = bool(agreement.measure_fit(audio, units).missing)
            whole, half = whole + (kept and noticed), half + (noticed and not kept)
    assert whole == 0
    assert half > 0.7 * len(names)
