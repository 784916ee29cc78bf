"""Transcripts of a training that are doubtful, and recordings without one: warnings with their names."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence

from lipmotion.errors import AlignmentError, MissingDependencyError
from lipmotion.printable import printable
from lipmotion.speech.recognition.agreement import LEAST_FITTING_SHARE, TranscriptFit, transcript_fit
from lipmotion.types import Timeline, Unit, Utterance

LOG = logging.getLogger("lipmotion")
MOST_NAMED_RECORDINGS = 10
"""Largest number of recordings that one warning names."""


def warn_of_doubtful_transcripts(
    labelled: Iterable[tuple[Utterance, Timeline[Unit]]],
    realigned: Callable[[Utterance], Timeline[Unit]] | None = None,
) -> None:
    """Log a warning that names the utterances whose transcripts do not fit the sound.

    labelled : utterances with their aligned phones; those without words, or with labelled phones, are passed over
    realigned : aligns the words of an utterance once more, by the models of many voices: what little speech has taught
               may place them badly. A transcript is doubtful if it fits neither way
    The measure is that of ``animate`` (``speech.recognition.agreement``). Without pocketsphinx nothing is measured.
    """
    wrong, short, count = list[str](), list[str](), 0
    try:
        for utterance, units in labelled:
            if utterance.phones is None and utterance.words:
                fit, count = transcript_fit(utterance.audio, units), count + 1
                if realigned is not None and (fit.is_doubtful or fit.share < LEAST_FITTING_SHARE):
                    fit = _better(fit, utterance, realigned)
                if fit.is_doubtful:
                    wrong.append(utterance.name)
                elif fit.share < LEAST_FITTING_SHARE:
                    short.append(utterance.name)
    except MissingDependencyError:
        return
    for names, problem in ((wrong, "seem not to be what is said"), (short, "seem to leave out words that are said")):
        if names:
            LOG.warning(
                "%d of %d transcripts %s (%s): the model learns wrong lips from them; correct them, or remove them and "
                "train again",
                *(len(names), count, problem, _listed(names)),
            )


def _better(
    fit: TranscriptFit, utterance: Utterance, realigned: Callable[[Utterance], Timeline[Unit]]
) -> TranscriptFit:
    """Return the fit of the words aligned once more, if it is better than a fit."""
    try:
        other = transcript_fit(utterance.audio, realigned(utterance))
    except AlignmentError:
        return fit
    return max(fit, other, key=lambda each: (not each.is_doubtful, each.share))


def warn_of_missing_transcripts(utterances: Sequence[Utterance]) -> None:
    """Log a warning that names the utterances with neither words nor labelled phones, if others have them."""
    missing = [utterance.name for utterance in utterances if utterance.phones is None and not utterance.words]
    if 0 < len(missing) < len(utterances):
        LOG.warning(
            "%d of %d recordings have no transcript, or an empty one (%s): their phones are recognised, with errors; "
            "add the words",
            *(len(missing), len(utterances), _listed(missing)),
        )


def _listed(names: Sequence[str]) -> str:
    """Return the first names, and how many more there are."""
    more = len(names) - MOST_NAMED_RECORDINGS
    return printable(", ".join(names[:MOST_NAMED_RECORDINGS])) + (f" and {more} more" if more > 0 else "")
