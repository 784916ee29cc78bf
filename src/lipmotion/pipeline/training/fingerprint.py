"""Digest of all input of a training: a checkpoint is used only if its digest is the same."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Sequence
from importlib import metadata
from typing import Any

import numpy as np

from lipmotion.corpora.store import Corpus
from lipmotion.engines import Engine
from lipmotion.extensions import installed_version
from lipmotion.hmm.model import HmmConfig
from lipmotion.kernels.threads import blas_kernels
from lipmotion.pipeline.model import GEOMETRY, Model
from lipmotion.speech.recognition.network.posteriors import installed_phone_recogniser
from lipmotion.storage.files import sha256_of
from lipmotion.units import Lexicon

PICTURES = "crops.npy"
"""File of the mouth pictures of an utterance: large, and needed for eigenlips only."""


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

    names  : of the utterances of the corpus
    prior  : the model on which the new one stands, or None
    visual : kind of the channels; without eigenlips, mouth pictures are not part of the digest
    """
    digest = hashlib.sha256()
    job = {
        "engine": [engine.name, engine.config.as_mapping()],
        "recogniser": recogniser.as_mapping(),
        "words": lexicon.user,
        "visual": visual,
        "versions": [installed_version(), *map(metadata.version, ("numpy", "scipy", "pocketsphinx"))],
        "phone recogniser": installed_phone_recogniser(),
        "machine": [platform.machine(), blas_kernels()],
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
                digest.update(bytes.fromhex(sha256_of(path)))
