"""All services whose timings are read; the content decides which one a file is of."""

from __future__ import annotations

from collections.abc import Callable

from lipmotion.corpora.labels.json_documents import is_json, json_documents
from lipmotion.corpora.labels.tier import LabelTier
from lipmotion.corpora.labels.timings import (
    amazon_polly,
    azure,
    cartesia,
    elevenlabs,
    gentle,
    google,
    kokoro,
    mfa,
    piper,
)
from lipmotion.corpora.labels.timings.rows import Documents

SERVICES: tuple[Callable[[Documents, str], list[LabelTier] | None], ...] = (
    amazon_polly.tiers,
    azure.tiers,
    elevenlabs.tiers,
    cartesia.tiers,
    google.tiers,
    piper.tiers,
    kokoro.tiers,
    gentle.tiers,
    mfa.tiers,
)


def timing_tiers(text: str, where: str) -> list[LabelTier] | None:
    """Return the tiers of words and phones of a file of a service; None: it is of none of them.

    where : the file's name, for messages
    Raises InputError: it is damaged, or a symbol in it is not known.
    """
    if mfa.is_table(text):
        return mfa.table_tiers(text, where)
    if not is_json(text):
        return None
    documents = list(json_documents(text, where))
    found = (tiers(documents, where) for tiers in SERVICES)
    return next((tiers for tiers in found if tiers is not None), None)
