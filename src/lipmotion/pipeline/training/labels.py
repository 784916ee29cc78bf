"""Phones in time of the utterances of a corpus, with checkpoints, so that a stopped training continues."""

from __future__ import annotations

import hashlib
import json
import logging
import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import astuple, replace
from functools import partial
from importlib import metadata
from typing import Any

import numpy as np

from lipmotion.corpora import Corpus
from lipmotion.engines import Engine
from lipmotion.errors import AlignmentError, InputError, MissingDependencyError, shorten_list
from lipmotion.extensions import find_version
from lipmotion.hmm.model import HmmConfig
from lipmotion.kernels.compiler import list_blas_kernels
from lipmotion.pipeline.model import GEOMETRY, Model
from lipmotion.printable import printable
from lipmotion.speech.recognition.agreement import measure_fit
from lipmotion.speech.recognition.network.posteriors import find_installed_recogniser
from lipmotion.storage.archive import Checkpoint
from lipmotion.storage.sources import hash_file
from lipmotion.types import Item, Monitor, Progress, Span, Timeline, Unit, Utterance
from lipmotion.units import Lexicon

LOG = logging.getLogger("lipmotion")
MAX_NAMED_RECORDINGS = 10  # largest number of recordings that one warning names


def warn_of_doubtful_transcripts(
    labelled: Iterable[tuple[Utterance, Timeline[Unit]]], realigned: Callable[[Utterance], Timeline[Unit]] | None = None
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
                fit, count = measure_fit(utterance.audio, units), count + 1
                if realigned is not None and fit.is_partial:
                    with suppress(AlignmentError):
                        other = measure_fit(utterance.audio, realigned(utterance))
                        fit = max(fit, other, key=lambda each: (not each.is_doubtful, each.share))
                if fit.is_doubtful:
                    wrong.append(utterance.name)
                elif fit.is_partial:
                    short.append(utterance.name)
    except MissingDependencyError:
        return
    for names, problem in ((wrong, "seem not to be what is said"), (short, "seem to leave out words that are said")):
        if names:
            counted = len(names), count, problem, printable(shorten_list(names, MAX_NAMED_RECORDINGS))
            LOG.warning("%d of %d transcripts %s (%s), which teaches wrong lips; correct or remove them", *counted)


def warn_of_missing_transcripts(utterances: Sequence[Utterance]) -> None:
    """Log a warning that names the utterances with neither words nor labelled phones, if others have them."""
    missing = [utterance.name for utterance in utterances if utterance.phones is None and not utterance.words]
    if 0 < len(missing) < len(utterances):
        counted = len(missing), len(utterances), printable(shorten_list(missing, MAX_NAMED_RECORDINGS))
        LOG.warning("%d of %d recordings have no transcript (%s): phones are recognised; add .txt files", *counted)


UTTERANCES_PER_CHECKPOINT = 32  # utterances that are labelled between two checkpoints
Labeller = Callable[[Utterance], Timeline[Unit]]
"""A function that returns phones in time; raises AlignmentError or InputError if it cannot."""
PhonesOrReason = Timeline[Unit] | str  # phones in time of an utterance, or the reason why it has none


def label_utterances(
    utterances: Sequence[Utterance], labeller: Labeller, monitor: Monitor, checkpoint: Checkpoint
) -> Iterator[tuple[Utterance, PhonesOrReason]]:
    """Yield every utterance with its phones in time, or with the reason why it has none.

    monitor    : called with the progress, and with the utterances without phones
    checkpoint : distributes the work, and stores the phones of every ``UTTERANCES_PER_CHECKPOINT`` utterances
    """
    starts = range(0, len(utterances), UTTERANCES_PER_CHECKPOINT)
    blocks = [utterances[start : start + UTTERANCES_PER_CHECKPOINT] for start in starts]
    stored = [checkpoint.load(f"phones-{number}") for number in range(len(blocks))]
    unlabelled = (block for block, arrays in zip(blocks, stored, strict=True) if arrays is None)
    # without mouth pictures, which take time to send to another process
    missing = [[replace(each, track=replace(each.track, crops=None)) for each in block] for block in unlabelled]
    labelled = iter(checkpoint.parallel_map(partial(_label_block, labeller=labeller), missing))
    done = 0
    for number, (block, arrays) in enumerate(zip(blocks, stored, strict=True)):
        results = next(labelled) if arrays is None else list(map(_read_result, arrays["results"].tolist()))
        if arrays is None:
            rows = [x if isinstance(x, str) else [(s.start_s, s.end_s, *astuple(s.label)) for s in x] for x in results]
            texts = [json.dumps(row, default=float) for row in rows]
            checkpoint.save(f"phones-{number}", {"results": np.array(texts)})
        for utterance, phones in zip(block, results, strict=True):
            if isinstance(phones, str):
                monitor(Item(utterance.name, "skipped", phones))
            yield utterance, phones
        done += len(block)
        monitor(Progress("phones: alignment and recognition", done, len(utterances), done / len(utterances)))


def _label_block(utterances: Sequence[Utterance], labeller: Labeller) -> list[PhonesOrReason]:
    """Return the phones in time, or the reason why there are none, of each utterance; runs in another process."""
    results: list[PhonesOrReason] = []
    for utterance in utterances:
        try:
            results.append(labeller(utterance))
        except (AlignmentError, InputError) as error:
            results.append(str(error))
    return results


def _read_result(text: str) -> PhonesOrReason:
    rows = json.loads(text)
    return rows if isinstance(rows, str) else Timeline(tuple(Span(a, b, Unit(*label)) for a, b, *label in rows))


PICTURES = "crops.npy"  # file of the mouth pictures of an utterance: large, and needed for eigenlips only


def fingerprint_training(
    corpus: Corpus,
    names: Sequence[str],
    engine: Engine[Any],
    recogniser: HmmConfig,
    lexicon: Lexicon,
    visual: str,
    prior: Model | None,
) -> str:
    """Return a digest of utterances, configurations, the user's lexicon, software, and the processor.

    Software are versions, and the phone recogniser that is installed: without one another model comes out.

    prior  : the model on which the new one stands, or None
    visual : kind of the channels; without eigenlips, mouth pictures are not part of the digest
    """
    digest = hashlib.sha256()
    job = {
        "engine": [engine.name, engine.config.as_mapping()],
        "recogniser": recogniser.as_mapping(),
        "words": lexicon.user,
        "visual": visual,
        "versions": [find_version(), *map(metadata.version, ("numpy", "scipy", "pocketsphinx"))],
        "phone recogniser": find_installed_recogniser(),
        "machine": [platform.machine(), list_blas_kernels()],
    }
    if prior is not None:
        for name, array in sorted(prior.engine.to_arrays(prior.learned).items()):
            digest.update(f"{name} {array.dtype} {array.shape}\n".encode())
            digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(json.dumps(job, sort_keys=True).encode())
    _add_utterances(digest, corpus, names, visual)
    return digest.hexdigest()


def digest_corpus(corpus: Corpus) -> str:
    """Return a digest of all utterances of a corpus, without their mouth pictures."""
    digest = hashlib.sha256()
    _add_utterances(digest, corpus, corpus.names(), GEOMETRY)
    return digest.hexdigest()


def _add_utterances(digest: hashlib._Hash, corpus: Corpus, names: Sequence[str], visual: str) -> None:
    for name in names:
        digest.update(f"\n{name}\n".encode())
        for path in sorted(corpus.folder(name).iterdir()):
            if path.name != PICTURES or visual != GEOMETRY:
                digest.update(f"{path.name}\n".encode())
                digest.update(bytes.fromhex(hash_file(path)))
