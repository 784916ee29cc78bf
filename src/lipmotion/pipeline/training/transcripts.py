"""Transcripts of a training that are doubtful, and recordings without one: warnings with their names."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence

from lipmotion.errors import MissingDependencyError
from lipmotion.printable import printable
from lipmotion.speech.agreement import DOUBTFUL_SCORE, LEAST_FITTING_SHARE, transcript_fit
from lipmotion.types import Timeline, Unit, Utterance

LOG = logging.getLogger("lipmotion")
MOST_NAMED = 10
"""Largest number of recordings that one warning names."""


def warn_of_doubtful_transcripts(labelled: Iterable[tuple[Utterance, Timeline[Unit]]]) -> None:
    """Log a warning that names the utterances whose transcripts do not fit the sound.

    labelled : utterances with their aligned phones; those without words, or with labelled phones, are passed over
    The measure is that of ``animate`` (``speech.agreement``). Without pocketsphinx nothing is measured.
    """
    wrong, short, count = list[str](), list[str](), 0
    try:
        for utterance, units in labelled:
            if utterance.phones is None and utterance.words:
                fit, count = transcript_fit(utterance.audio, units), count + 1
                if fit.score < DOUBTFUL_SCORE:
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
    more = len(names) - MOST_NAMED
    return printable(", ".join(names[:MOST_NAMED])) + (f" and {more} more" if more > 0 else "")
