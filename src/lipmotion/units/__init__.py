"""Phones, visemes, unit sets, and words with their pronunciations. Data and look-ups, no audio."""

from lipmotion.units.lexicon import Lexicon, Pronunciation, find_phone, reduce_vowels, require_phone
from lipmotion.units.phone_timelines import (
    RECOGNISED,
    RecognisedPhone,
    close_gaps,
    group_words,
    list_recognised_phones,
    restore_confidences,
)
from lipmotion.units.phones import (
    LIP_CLOSING,
    PAUSE,
    PHONES,
    SILENCE,
    SIMILAR_PHONES,
    UNKNOWN_PHONES,
    VISEME_OF,
    VISEMES,
    VOWELS,
    describe_unknown_phone,
    find_similar_lips,
    find_similar_phone,
    is_silent,
    list_phone_classes,
    mark_closing_phones,
)
from lipmotion.units.text_normalisation import check_phones, check_text, check_words, find_words, split_words
from lipmotion.units.unit_sets import UNIT_SETS, UnitSet, load_unit_set

__all__ = [
    "LIP_CLOSING", "PAUSE", "PHONES", "RECOGNISED", "SILENCE", "SIMILAR_PHONES", "UNIT_SETS", "UNKNOWN_PHONES",
    "VISEMES", "VISEME_OF", "VOWELS", "Lexicon", "Pronunciation", "RecognisedPhone", "UnitSet", "check_phones",
    "check_text", "check_words", "close_gaps", "describe_unknown_phone", "find_phone", "find_similar_lips",
    "find_similar_phone", "find_words", "group_words", "is_silent", "list_phone_classes", "list_recognised_phones",
    "load_unit_set", "mark_closing_phones", "reduce_vowels", "require_phone", "restore_confidences", "split_words",
]  # fmt: skip
