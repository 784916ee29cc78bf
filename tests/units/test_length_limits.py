from __future__ import annotations

import pytest

from lipmotion.errors import AlignmentError, InputError
from lipmotion.units import check_phones, check_text, check_words
from lipmotion.units.length_limits import (
    ALWAYS_ALLOWED_CHARACTERS,
    ALWAYS_ALLOWED_PHONES,
    CHARACTERS_PER_S,
    PHONES_PER_S,
)


def test_a_text_may_be_as_long_as_can_be_said() -> None:
    for duration_s in (0.0, 1.0, 3600.0):
        most = ALWAYS_ALLOWED_CHARACTERS + int(CHARACTERS_PER_S * duration_s)
        check_text("a" * most, duration_s)
        with pytest.raises(
            AlignmentError, match=f"has {most + 1} characters, required at most {most} for {duration_s:.2f} s"
        ):
            check_text("a" * (most + 1), duration_s)


def test_words_count_with_the_blanks_between_them() -> None:
    check_words(["a"] * (ALWAYS_ALLOWED_CHARACTERS // 2), 0.0)
    with pytest.raises(AlignmentError, match=f"has {ALWAYS_ALLOWED_CHARACTERS + 2} characters"):
        check_words(["a"] * (ALWAYS_ALLOWED_CHARACTERS // 2 + 1), 0.0)
    with pytest.raises(AlignmentError, match="give the words of this recording"):
        check_words(["a" * ALWAYS_ALLOWED_CHARACTERS], 0.0)


def test_the_fastest_speech_on_record_fits() -> None:
    """655 words a minute, of six characters and a blank, for an hour."""
    check_text("strong " * 655 * 60, 3600.0)


def test_phones_are_no_more_than_frames() -> None:
    most = ALWAYS_ALLOWED_PHONES + 2 * PHONES_PER_S
    check_phones(most, 2.0)
    with pytest.raises(InputError, match=f"{most + 1} units in time, required at most {most} for 2.00 s of sound"):
        check_phones(most + 1, 2.0)
