"""Phones in time of recordings: by forced alignment of a transcript, or by recognition."""

from __future__ import annotations

import logging
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import replace
from difflib import SequenceMatcher
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import AlignmentError, shorten, shorten_list
from lipmotion.speech.recognition.agreement import DOUBTFUL_SCORE, TranscriptFit, measure_fit
from lipmotion.speech.recognition.anchors import REACH_S, bound_words, find_anchors, leave_out_late_lines
from lipmotion.speech.recognition.network.posteriors import (
    POSTERIOR_STEP,
    find_stretches,
    mean_posterior,
    read_posteriors,
)
from lipmotion.speech.recognition.recognised_speech import PHONE_POSTERIORS, WORD_POSTERIORS
from lipmotion.speech.recognition.recogniser import Recogniser, uses_network
from lipmotion.speech.recognition.transcript_evidence import (
    MIN_GAP_S,
    SURE_COSTS,
    WORD_COSTS,
    OtherSpeech,
    TranscriptEvidence,
    WordEvidence,
    find_evidence,
)
from lipmotion.speech.sound.analysed_audio import AnalysedAudio, analysed
from lipmotion.speech.voices.espeak import LanguageLexicon
from lipmotion.types import FRAME_RATE_HZ, Audio, Span, TimedTranscript, Timeline, Unit
from lipmotion.units import Lexicon, Pronunciation, check_words, is_silent
from lipmotion.units.phones import count_phone_edits

LOG = logging.getLogger("lipmotion")
MAX_WARNINGS = 20  # largest number of guessed pronunciations that are reported one by one
FOREIGN_SHARE, MIN_FOREIGN = 0.25, 3
"""A text of which so large a share, and so many different words, are not in the dictionary is not English."""
MAX_STRETCHES = 3  # largest number of stretches without words that are named in one warning
MIN_INSERTED = 2  # fewer phones between words than this belong to them: recognition errs by one
ALIKE_SHARE = 0.34  # words are said all the same where recognition finds their phones, but for so small a share
HEARD_REACH_S = 1.5  # a word that the posteriors hear is sought no further away; what is like it there is another one
MAX_REPLACED, SAME_SHARE = 2, 0.6
"""So few words are said in place of others; more are of another sentence, unless so many of their phones are found."""


class Transcription(NamedTuple):
    """Phones in time of a recording, and how well the transcript fits.

    units : None where the transcript is of something else: what is said is to be recognised
    fit   : None where there was no transcript, or it was not compared with the sound (general phone models are needed)
    """

    units: Timeline[Unit] | None
    fit: TranscriptFit | None


def transcribe(
    phones: Recogniser,
    audio: Audio,
    words: Sequence[str] | TimedTranscript | None,
    lexicon: Lexicon,
    recognised: Callable[[], Timeline[Unit]] | None = None,
) -> Transcription:
    """Return the phones in time of a recording, with warnings for the user.

    audio      : an ``AnalysedAudio`` shares its features with what else is computed of it
    words      : the spoken words in lower case, also with times, within which they are aligned; or None
    recognised : recognises phones in time with their confidence; None: nothing is corrected
    Warnings are logged for guessed pronunciations and, with general phone models, for words that do not agree with the
    sound, and speech that the words leave out. Of English words, a phone recogniser judges, where one is installed: if
    it is sure, words that nobody says are left out, and speech that has no words is recognised.
    Raises AlignmentError: the words cannot be aligned with the recording.
    """
    audio = analysed(audio)
    if isinstance(words, TimedTranscript):
        words = leave_out_late_lines(words, audio.duration_s)
    spoken = words.words if isinstance(words, TimedTranscript) else words or ()
    if is_other_language(spoken, lexicon):
        LOG.warning("the transcript is read by English rules, but seems not to be English; give its --language")
    else:
        warn_of_guesses(spoken, lexicon)
    is_heard = not isinstance(lexicon, LanguageLexicon) and uses_network(phones.kind)
    refused: AlignmentError | None = None
    try:
        units = align_or_recognise(phones, audio, words, lexicon)
    except AlignmentError as error:  # too much for the recording: some of the words may be said all the same
        check_words(spoken, audio.duration_s)
        if not is_heard or recognised is None or compute_phone_posteriors(audio)[1] < PHONE_POSTERIORS[0]:
            raise
        refused, units = error, _spread_evenly(spoken, lexicon, audio.duration_s)
    if words is None or phones.kind == "own":
        return Transcription(units, None)
    fit = measure_fit(audio, units)
    if not is_heard:
        warn_of_misfit(fit)
        return Transcription(units, fit)
    evidence, heard = _compare_with_sound(audio, units, recognised, refused is not None)
    fit, corrected = replace(fit, missing=evidence.gaps, evidence=evidence), heard is not None
    warn_of_misfit(fit, corrected=corrected)
    if fit.is_doubtful and corrected:
        return Transcription(None, fit)
    if refused is not None and not evidence.unsaid:
        raise refused
    is_wrong, timed = bool(evidence.gaps or evidence.unsaid), isinstance(words, TimedTranscript) and words.has_times
    if (corrected and is_wrong) or not (is_wrong or timed or _are_in_order(units, evidence)):
        units = _correct(phones, audio, evidence, heard or Timeline(()), lexicon)
    return Transcription(units, fit)


def _spread_evenly(words: Sequence[str], lexicon: Lexicon, duration_s: float) -> Timeline[Unit]:
    """Return the phones of words that cannot be aligned, each for the same time of a recording."""
    labels = [Unit(phone, word=word) for word in words for phone in lexicon.pronunciations(word)[0]]
    edges_s = np.linspace(0, duration_s, len(labels) + 1).tolist()
    return Timeline(tuple(map(Span, edges_s[:-1], edges_s[1:], labels)))


def _compare_with_sound(
    audio: AnalysedAudio, units: Timeline[Unit], recognised: Callable[[], Timeline[Unit]] | None, is_refused: bool
) -> tuple[TranscriptEvidence, Timeline[Unit] | None]:
    """Return what a phone recogniser says of a transcript, and what is recognised where it seems wrong, else None."""
    posteriors, sure = compute_phone_posteriors(audio)
    costs = SURE_COSTS if sure >= WORD_POSTERIORS[0] else WORD_COSTS
    evidence = find_evidence(posteriors, POSTERIOR_STEP / FRAME_RATE_HZ, units, costs)
    if recognised is None or not (is_refused or (evidence.others and sure >= PHONE_POSTERIORS[0])):
        return evidence, None
    heard = recognised()
    return _compare(evidence, heard), heard


def compute_phone_posteriors(audio: AnalysedAudio) -> tuple[NDArray[np.float64], float]:
    """Return the log posteriors of a phone recogniser, and how sure it is of what is said, or of nothing, 0 to 1."""
    posteriors = read_posteriors(audio)
    sure = mean_posterior(find_stretches(audio)) if posteriors.has_phones else 1.0
    return posteriors.of_phones.astype(float), sure


def _compare(evidence: TranscriptEvidence, recognised: Timeline[Unit]) -> TranscriptEvidence:
    """Return evidence of a transcript that is wrong somewhere, compared with what is recognised (``_match_words``).

    Where nothing is recognised, nothing is missing. Neighbours are stretched over short words that are left out: so,
    once something is known to be missing, recognised phones between those of the words are more of it.
    """
    spans = [span for span in recognised if not is_silent(span.label.phone)]
    words, taken = _match_words(evidence, spans)
    others_said = [span for place, span in enumerate(spans) if place not in taken]
    middles_s = [(span.start_s + span.end_s) / 2 for span in others_said]
    known = {(other.first, other.stop) for other in evidence.others}
    spoken = [-1, *(number for number, word in enumerate(words) if word.is_said), len(words)]
    others = []
    for before, after in pairwise(spoken):
        before_s = words[before].end_s if before >= 0 else 0.0
        after_s = words[after].start_s if after < len(words) else np.inf
        between = others_said[bisect_left(middles_s, before_s) : bisect_left(middles_s, after_s)]
        lasts = between and between[-1].end_s - between[0].start_s >= MIN_GAP_S
        is_more = (before + 1, after) in known or (evidence.gaps and len(between) >= MIN_INSERTED)
        if after > before + 1 or (lasts and is_more):
            start_s, end_s = (between[0].start_s, between[-1].end_s) if between else (before_s, before_s)
            others.append(OtherSpeech(start_s, end_s, before + 1, after))
    return TranscriptEvidence(tuple(words), tuple(others))


def _match_words(evidence: TranscriptEvidence, spans: Sequence[Span[Unit]]) -> tuple[list[WordEvidence], set[int]]:
    """Return the words, said or not, with the times at which most of their phones are found, and these phones.

    Words that were doubted together are said if all their phones are found, or lie before and after those that are not.
    """
    words, phones = list(evidence.words), [span.label.phone for span in spans]
    wanted = [(number, phone) for number, word in enumerate(words) for phone in word.phones]
    matcher = SequenceMatcher(None, [phone for _, phone in wanted], phones, autojunk=False)
    matched, doubted, taken, end = dict[int, list[int]](), set[int](), set[int](), 0
    for first, at, size in matcher.get_matching_blocks():
        for (number, _), place in zip(wanted[first : first + size], range(at, at + size), strict=True):
            if _is_near(words[number], spans[place]):
                matched.setdefault(number, []).append(place)
    for other in evidence.others:
        left_out = range(other.first, other.stop)
        sizes = [len(words[number].phones) for number in left_out]
        shares = [len(matched.get(number, ())) / size for number, size in zip(left_out, sizes, strict=True)]
        unlike = {number: share for number, share in zip(left_out, shares, strict=True) if share < 1}
        replaced = [number for number, share in unlike.items() if share < 1 - ALIKE_SHARE]
        if replaced and max(unlike) - min(unlike) < MAX_REPLACED:
            doubted.update(range(min(unlike), max(unlike) + 1))
        elif replaced:
            doubted.update(replaced if np.average(shares, weights=sizes) >= SAME_SHARE else left_out)
    for number, word in enumerate(words):
        stop = next((matched[later][0] for later in range(number + 1, len(words)) if later in matched), len(spans))
        if number in doubted:
            continue
        lengths = range(max(len(word.phones) - 1, 1), len(word.phones) + 2)
        runs = [range(first, first + length) for length in lengths for first in range(end, stop - length + 1)]
        near = (run for run in runs if _is_near(word, spans[run.start]) and _is_near(word, spans[run.stop - 1]))
        edits = [(count_phone_edits(word.phones, phones[run.start : run.stop]), run.start, run.stop) for run in near]
        if edits and min(edits)[0] <= ALIKE_SHARE * len(word.phones):
            _, first, end = min(edits)
            words[number] = word._replace(start_s=spans[first].start_s, end_s=spans[end - 1].end_s, is_said=True)
            taken.update(range(first, end))
    return words, taken


def _is_near(word: WordEvidence, span: Span[Unit]) -> bool:
    """Return whether a phone may be one of a word: that of a word that is heard is within ``HEARD_REACH_S`` of it."""
    reach_s = HEARD_REACH_S if word.is_said else np.inf
    return bool(word.start_s - reach_s < span.end_s and span.start_s < word.end_s + reach_s)


def _are_in_order(units: Timeline[Unit], evidence: TranscriptEvidence) -> bool:
    """Return whether no word was aligned where the words beside it are heard, as forced alignment in noise does."""
    spans = [span for span in units if not is_silent(span.label.phone)]
    edges = np.cumsum([len(word.phones) for word in evidence.words]).tolist()
    return all(
        spans[edge - 1].end_s <= after.start_s + REACH_S and spans[edge].start_s >= before.end_s - REACH_S
        for (before, after), edge in zip(pairwise(evidence.words), edges, strict=False)
    )


def _select_recognised(
    recognised: Timeline[Unit], evidence: TranscriptEvidence, other: OtherSpeech
) -> list[list[Span[Unit]]]:
    """Return the recognised phones where something else is said than the transcript has, by words.

    Words count by their middle; single phones between what may be the end of one word and the beginning of another.
    """
    if other.start_s == other.end_s:
        return []
    words, spans = evidence.words, [span for span in recognised if not is_silent(span.label.phone)]
    middles_s = np.array([(span.start_s + span.end_s) / 2 for span in spans])
    before_s, after_s, first, stop = 0.0, np.inf, 0, len(spans)
    if other.first > 0:
        before_s = words[other.first - 1].end_s
        first = int(np.searchsorted(middles_s, before_s))
        near = range(*np.searchsorted(middles_s, [before_s - REACH_S, before_s + REACH_S]))
        first = max([n + 1 for n in near if spans[n].label.phone == words[other.first - 1].phones[-1]], default=first)
    if other.stop < len(words):
        after_s = words[other.stop].start_s
        stop = int(np.searchsorted(middles_s, after_s))
        near = range(*np.searchsorted(middles_s, [after_s - REACH_S, after_s + REACH_S]))
        stop = min([n for n in near if spans[n].label.phone == words[other.stop].phones[0]], default=stop)
    runs: list[list[Span[Unit]]] = []
    for word, group in groupby(enumerate(spans), key=lambda pair: pair[1].label.word):
        run = list(group)
        middle_s = (run[0][1].start_s + run[-1][1].end_s) / 2
        if word and (before_s + other.start_s) / 2 <= middle_s <= (other.end_s + after_s) / 2:
            runs.append([span for _, span in run])
        elif not word and (inside := [span for number, span in run if first <= number < stop]):
            runs.append(inside)
    return runs


def _correct(
    phones: Recogniser, audio: Audio, evidence: TranscriptEvidence, recognised: Timeline[Unit], lexicon: Lexicon
) -> Timeline[Unit]:
    """Return the words of a transcript that are said, and what is recognised beside them, aligned."""
    labels: list[tuple[str, float | None]] = []
    heard_s: list[tuple[float, float]] = []
    variants: dict[str, tuple[Pronunciation, ...]] = {}
    for number, word in enumerate((*evidence.words, None)):
        for other in (each for each in evidence.others if each.first == number):
            for run in _select_recognised(recognised, evidence, other):
                variants[str(len(labels))] = (tuple(span.label.phone for span in run),)
                labels.append((run[0].label.word, run[0].label.confidence))
                heard_s.append((run[0].start_s, run[-1].end_s))
        if word is not None and word.is_said:
            known = lexicon.pronunciations(word.word)
            variants[str(len(labels))] = known if word.phones in known else (word.phones,)
            labels.append((word.word, None))
            heard_s.append((word.start_s, word.end_s))
    spans = list[Span[Unit]]()
    anchors = bound_words(heard_s)
    for span in phones.align(audio, tuple(variants), Lexicon(variants), anchors):
        text, confidence = labels[int(span.label.word)] if span.label.word else ("", None)
        spans.append(replace(span, label=replace(span.label, word=text, confidence=confidence)))
    return Timeline(tuple(spans))


def align_or_recognise(
    phones: Recogniser, audio: Audio, words: Sequence[str] | TimedTranscript | None, lexicon: Lexicon
) -> Timeline[Unit]:
    """Return the phones in time of a recording as ``transcribe`` does, without warnings."""
    if words is None:
        return phones.recognise(audio).units
    anchors = None
    if isinstance(words, TimedTranscript):
        anchors, words = find_anchors(words) if words.has_times else None, words.words
    check_words(words, audio.duration_s)
    return phones.align(audio, words, lexicon, anchors)


def warn_of_misfit(fit: TranscriptFit, corrected: bool = False) -> None:
    """Log a warning if a transcript seems to be of something else, to leave out speech, or to have too many words.

    corrected : whether what is said instead is recognised
    """
    places = f"at {format_places(fit.missing)} ({min(fit.missing_s, fit.speech_s):.1f} of {fit.speech_s:.1f} s spoken)"
    if fit.is_doubtful:
        why = f"its phones agree with the sound at {fit.score:.1f}, required {DOUBTFUL_SCORE} or more"
        if fit.evidence is not None:
            count = sum(word.is_said for word in fit.evidence.words)
            why = f"{count} of its {len(fit.evidence.words)} words are heard"
        also = f" or to leave out words {places}" if fit.missing else ""
        done = "the sound is recognised instead: " if corrected else ""
        LOG.warning("the transcript seems not to be what is said (%s)%s; %scheck it, or leave it out", why, also, done)
        return
    if fit.unsaid:
        words = shorten_list([f"{shorten(w.word)!r} at {w.start_s:.1f} s" for w in fit.unsaid], MAX_STRETCHES)
        done = ", which are left out" if corrected else ""
        LOG.warning("the transcript seems to have words that are not said: %s%s; correct it", words, done)
    if fit.missing:
        done = "what is said there is recognised" if corrected else "the lips are wrong there"
        LOG.warning("the transcript seems to leave out words %s: %s; add them, or give no transcript", places, done)


def warn_of_label_misfit(fit: TranscriptFit, filled: bool) -> None:
    """Log warnings where given phones do not fit the sound; ``filled``: where they are open, phones are recognised."""
    problems = {
        "leave out speech": fit.missing,
        "lie where nothing is said": fit.idle,
        "are not what is said": fit.wrong,
    }
    for problem, places in problems.items():
        if places:
            done = "; what is said there is recognised" if filled and places is fit.missing else ""
            LOG.warning("the units %s at %s%s; correct them, or leave them out", problem, format_places(places), done)


def format_places(places: Sequence[tuple[float, float]]) -> str:
    """Return the longest of some stretches of time, for a message."""
    longest = sorted(places, key=lambda place: place[0] - place[1])[:MAX_STRETCHES]
    named = ", ".join(f"{start_s:.1f} to {end_s:.1f} s" for start_s, end_s in sorted(longest))
    more = len(places) - MAX_STRETCHES
    return named + (f" and at {more} more places" if more > 0 else "")


def is_other_language(words: Sequence[str], lexicon: Lexicon) -> bool:
    """Return whether words seem to be of another language than their lexicon."""
    unknown = [word for word in words if not lexicon.known(word)]
    return len({*unknown}) >= MIN_FOREIGN and len(unknown) >= FOREIGN_SHARE * len(words)


def guess_pronunciations(words: Sequence[str], lexicon: Lexicon) -> dict[str, Pronunciation]:
    """Return the first ``MAX_WARNINGS`` words whose pronunciation is a guess, with it."""
    unknown = [word for word in dict.fromkeys(words) if not lexicon.known(word)]
    return {word: lexicon.pronunciations(word)[0] for word in unknown[:MAX_WARNINGS]}


def warn_of_guesses(words: Sequence[str], lexicon: Lexicon) -> None:
    """Log a warning for every word whose pronunciation is a guess; after ``MAX_WARNINGS``, for how many more."""
    for word, guess in guess_pronunciations(words, lexicon).items():
        shown = map(shorten, (word, " ".join(guess)))
        LOG.warning("%r is not in the dictionary; read as %r; a lexicon file can say better", *shown)
    more = sum(not lexicon.known(word) for word in dict.fromkeys(words)) - MAX_WARNINGS
    if more > 0:
        LOG.warning("%d more words are not in the dictionary; a lexicon file can say better", more)
