"""Phones, visemes, unit sets, and words with their pronunciations. Data and look-ups, no audio."""

from lipmotion.units.classes import phone_classes
from lipmotion.units.length_limits import check_phones, check_text, check_words
from lipmotion.units.lexicon import Lexicon, Pronunciation, phone_named, with_reduced_vowels
from lipmotion.units.phones import (
    LIP_CLOSING,
    PAUSE,
    PHONES,
    SILENCE,
    SIMILAR_PHONES,
    UNKNOWN_PHONES,
    closing_phones,
    is_silent,
    most_similar_lips,
    most_similar_phone,
    unknown_phone_message,
)
from lipmotion.units.recognised import RECOGNISED, RecognisedPhone, recognised_phones, with_confidences, without_gaps
from lipmotion.units.text_normalisation import words_in, words_of
from lipmotion.units.unit_set import UnitSet
from lipmotion.units.unit_sets import UNIT_SETS, unit_set
from lipmotion.units.visemes import VISEME_OF, VISEMES, VOWELS
from lipmotion.units.word_spans import words_in_time

__all__ = [
    "LIP_CLOSING",
    "PAUSE",
    "PHONES",
    "RECOGNISED",
    "SILENCE",
    "SIMILAR_PHONES",
    "UNIT_SETS",
    "UNKNOWN_PHONES",
    "VISEMES",
    "VISEME_OF",
    "VOWELS",
    "Lexicon",
    "Pronunciation",
    "RecognisedPhone",
    "UnitSet",
    "check_phones",
    "check_text",
    "check_words",
    "closing_phones",
    "is_silent",
    "most_similar_lips",
    "most_similar_phone",
    "phone_classes",
    "phone_named",
    "recognised_phones",
    "unit_set",
    "unknown_phone_message",
    "with_confidences",
    "with_reduced_vowels",
    "without_gaps",
    "words_in",
    "words_in_time",
    "words_of",
]
