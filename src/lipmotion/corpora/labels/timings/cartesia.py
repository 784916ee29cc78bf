"""Time stamps of Cartesia: messages with words, with phones in IPA, or both, in seconds.

Source: Cartesia API reference, "Text-to-Speech (WebSocket)": messages ``timestamps`` and ``phoneme_timestamps``.
"""

from __future__ import annotations

from lipmotion.corpora.labels.tier import LabelTier, TimedLabel
from lipmotion.corpora.labels.timings.ipa import inventory_labels
from lipmotion.corpora.labels.timings.rows import (
    Documents,
    parallel_lists,
    required_seconds,
    required_text,
    tiers_of,
)

MEMBERS = {"word_timestamps": "words", "phoneme_timestamps": "phonemes"}
"""The members of messages, and the list that each one has beside ``start`` and ``end``."""


def tiers(documents: Documents, where: str) -> list[LabelTier] | None:
    """Return words and phones in time; None: these are no messages of Cartesia. Messages of sound are passed over.

    Raises InputError: lists that do not fit, a time that is none, or a phone that is no IPA.
    """
    messages = [message for _, value in documents for message in (value if isinstance(value, list) else [value])]
    if not any(isinstance(message, dict) and MEMBERS.keys() & message.keys() for message in messages):
        return None
    found: dict[str, list[TimedLabel]] = {name: [] for name in MEMBERS}
    for number, message in enumerate(messages, 1):
        for name, what in MEMBERS.items():
            stamps = message.get(name) if isinstance(message, dict) else None
            if stamps is None:
                continue
            place = f"message {number}"
            for text, start, end in parallel_lists(stamps, (what, "start", "end"), f"{where}: {place}, {name}"):
                start_s, end_s = (required_seconds(time, where, place) for time in (start, end))
                label = TimedLabel(start_s, end_s, required_text(text, where, place), f"{place}, {name}")
                found[name].append(label)
    words, phones = found.values()
    return tiers_of(where, words, inventory_labels(phones, where))
