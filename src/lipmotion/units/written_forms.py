"""Written forms that are said as other words: numbers, dates, times, sums, measures, addresses and abbreviations.

Many a form may be read in several ways. The usual one is the first; where there is sound, the sound decides.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import cache

from lipmotion.units.spelling import parse_table, read_table

Reading = tuple[str, ...]
Forms = tuple[tuple[str, str | Callable[[str], Iterator[str]]], ...]

MAX_READINGS = 8  # most readings of a form: alignment tries each
ONES, TENS = (words.split() for words in read_table("number_words").values())
SCALES = ((10**9, "billion"), (10**6, "million"), (1000, "thousand"), (100, "hundred"))
MONTHS = "january february march april may june july august september october november december".split()
_MONTHS = {name[:3]: name for name in MONTHS}
ORDINALS = parse_table("one=first two=second three=third five=fifth eight=eighth nine=ninth twelve=twelfth")
"""The ordinals that do not end in ``th`` after the cardinal."""
CURRENCIES = {sign: tuple(names.split()) for sign, names in read_table("currencies").items()}
MAGNITUDES = {"h": "hundred", "k": "thousand", "m": "million", "b": "billion", "t": "trillion"}
"""By the first letter, which the whole names begin with, too: ``mn``, ``bn``, ``million``."""
UNITS, ABBREVIATIONS, SIGNS = map(read_table, ("measures", "abbreviations", "signs"))


def spell_number(digits: str) -> list[str]:
    """Return the words of a whole number; from a trillion on, or with leading zeros, digit by digit."""
    if len(digits) > 12 or (len(digits) > 1 and digits[0] == "0"):
        return [ONES[int(digit)] for digit in digits]
    number = int(digits)
    if number < 20:
        return [ONES[number]]
    if number < 100:
        return [TENS[number // 10], *([ONES[number % 10]] if number % 10 else [])]
    scale, name = next((scale, name) for scale, name in SCALES if number >= scale)
    rest = spell_number(str(number % scale)) if number % scale else []
    return [*spell_number(str(number // scale)), name, *rest]


@cache
def list_readings(token: str) -> tuple[Reading, ...]:
    """Return the readings of a written form, the usual one first; of any other word, the word in lower case.

    >>> list_readings("1995")[:2]
    (('nineteen', 'ninety', 'five'), ('one', 'thousand', 'nine', 'hundred', 'ninety', 'five'))
    """
    readings = {tuple(_COUNTED.sub(_singular, each).split()): None for each in _iterate_readings(token)}
    return tuple(readings)[:MAX_READINGS]


def _iterate_readings(token: str) -> Iterator[str]:
    if token.isalpha() and token.islower():
        yield token
        return
    if token in SIGNS:
        yield from SIGNS[token].split("|")
        return
    matches = ((templates, re.fullmatch(pattern, token, re.IGNORECASE)) for pattern, templates in FORMS)
    templates, match = next(((templates, match) for templates, match in matches if match), ("", None))
    if match is None and token.endswith("'s"):  # of a written form, as "Henry VIII's"
        yield from (f"{' '.join(reading)}'s" for reading in list_readings(token[:-2]))
        return
    if match is None or callable(templates):
        yield from templates(token) if callable(templates) else [token.lower()]
        return
    parts = ["", *map(_FormPart, match.groups(""))]
    for template in templates.split("|"):
        each = re.search(r"{(\d):\*}", template)
        for reading in map(" ".join, list_readings(parts[int(each[1])])) if each else ("",):
            yield (template.replace(each[0], reading) if each else template).format(*parts)


class _FormPart(str):
    """A part of a written form, which the templates of ``FORMS`` say in several ways: ``{1:o}`` as an ordinal."""

    def __format__(self, way: str) -> str:
        if not self:
            return ""
        return SAID[way](str(self))


def _number(digits: str) -> Iterator[str]:
    """Yield the readings of a whole number, with or without commas."""
    whole, plain = digits.replace(",", ""), _cardinal(digits)
    number = int(whole) if len(whole) <= 12 else 0
    pairs = f"{_cardinal(whole[:-2])} {_pair(whole[-2:])}" if len(whole) in (3, 4) and whole[0] != "0" else ""
    pairs = pairs if whole == digits and number % 1000 and (len(whole) == 4 or number % 100) else ""
    spoken = [plain]
    if number > 100 and number % 100 and whole[0] != "0":
        spoken.append(f"{_cardinal(str(number - number % 100))} and {_cardinal(str(number % 100))}")
    if whole in ("911", "999", "411"):
        yield _spell(whole)
    if 1010 <= number <= 2099 and whole[1:3] != "00":
        yield pairs or plain
    yield from spoken
    yield pairs or plain
    yield _hundreds(whole) if len(whole) == 4 else plain
    yield _spell(whole)
    yield _spell(whole, "oh") if len(whole) > 2 or whole[0] == "0" else plain
    if re.fullmatch("00[1-9]", whole):
        yield f"double oh {ONES[number]}"
    if number < 200 or not number % 1000:
        yield from (re.sub("^one (hun|thou|mill)", r"a \1", each) for each in spoken)


def _decimal(digits: str) -> Iterator[str]:
    whole, _, part = digits.replace(",", "").partition(".")
    for first in (_cardinal(whole), "oh", "") if whole == "0" else (_cardinal(whole),) if whole else ("", "zero"):
        yield f"{first} point {_spell(part)}"
    if part == "5" and int(whole or 0):
        yield f"{_cardinal(whole)} and a half"
    if len(part) == 2:
        yield f"{_cardinal(whole or '0')} point {_pair(part)}"
        yield f"{_cardinal(whole or '0')} {_pair(part)}"


def _cardinal(digits: str) -> str:
    return " ".join(spell_number(digits.replace(",", "")))


def _plain(digits: str) -> str:
    return _cardinal(str(int(digits)))


def _spell(digits: str, zero: str = "zero") -> str:
    return " ".join(ONES[int(digit)] if int(digit) else zero for digit in digits)


def _ordinal(digits: str) -> str:
    *before, last = spell_number(digits.replace(",", "").lstrip("0"))
    regular = f"{last[:-1]}ieth" if last.endswith("y") else f"{last}th"
    return " ".join((*before, ORDINALS.get(last, regular)))


def _pair(digits: str) -> str:
    """Return two digits as they end a year or a time: ``05`` as oh five, ``00`` as hundred."""
    return "hundred" if digits == "00" else f"oh {_cardinal(digits[1])}" if digits[0] == "0" else _cardinal(digits)


def _minutes(digits: str) -> str:
    return {15: "quarter", 30: "half"}.get(int(digits), _plain(digits))


def _hour(digits: str, later: int = 0) -> str:
    return _cardinal(str((int(digits) + later - 1) % 12 + 1))


def _roman(numeral: str) -> str:
    values = [{"I": 1, "V": 5, "X": 10, "L": 50}[letter] for letter in numeral.upper()]
    return str(sum(-one if one < after else one for one, after in zip(values, [*values[1:], 0], strict=True)))


def _thousands(amount: str) -> str:
    return str(round(float(amount.replace(",", "")) * 1000))


def _hundreds(digits: str) -> str:
    """Return the words of a number as people say it: fifteen hundred."""
    return f"{_cardinal(digits[:-2])} hundred" if re.fullmatch(r"\d[1-9]00", digits) else _cardinal(digits)


def _usual(text: str) -> str:
    return " ".join(list_readings(text)[0])


def _telephone(text: str) -> Iterator[str]:
    """Yield the readings of a telephone number: by its digits, ``800`` also as a hundred, the last four in pairs."""
    groups, plus = re.findall(r"\d+", text), "plus " if text[0] == "+" else ""
    spelled = [_spell(group, "oh") for group in groups]
    hundreds = [_cardinal(g) if re.fullmatch("[1-9]00", g) else s for g, s in zip(groups, spelled, strict=True)]
    yield plus + " ".join(map(_spell, groups))
    for words in (spelled, hundreds):
        yield plus + " ".join(words)
        if len(groups[-1]) == 4:
            last = groups[-1]
            pairs = _cardinal(last) if last.endswith("000") else f"{_pair(last[:2])} {_pair(last[2:])}"
            yield plus + " ".join((*words[:-1], pairs))
    if len(groups) == 2:
        yield " to ".join(map(_cardinal, groups))


def _address(text: str) -> Iterator[str]:
    """Yield the reading of an address of the web or of mail; its protocol is not said."""
    parts = re.findall(r"[^\W\d_]+|\d+|[@./:_&=+-]", re.sub(r"^https?://", "", text.rstrip("/"), flags=re.IGNORECASE))
    special = {"-": "dash", "www": "w w w"}
    yield " ".join(special.get(part.lower()) or _usual(part) for part in parts)


def _stutter(text: str) -> Iterator[str]:
    """Yield ``b-b-but`` as the word, and as it is stuttered: ``bu bu but``."""
    *bits, word = text.lower().split("-")
    for vowel in (None, "u", ""):
        yield word if vowel is None else " ".join((*(bit + vowel for bit in bits), word))


def _abbreviation(text: str) -> Iterator[str]:
    name = text[:-1]
    yield from ABBREVIATIONS[name if name in ABBREVIATIONS else name.lower()].split("|")


SAID: dict[str, Callable[[str], str]] = {
    **{"": _usual, "w": str.lower, "c": _plain, "o": _ordinal, "p": _pair, "n": _minutes, "t": _hour},
    "i": lambda amount: _cardinal(amount) if re.fullmatch(NUMBER, amount) else _usual(amount),
    "y": lambda digits: _usual(digits if len(digits) == 4 else f"{'19' if int(digits) > 50 else '20'}{digits}"),
    "m": lambda text: MONTHS[int(text) - 1] if text.isdecimal() else _MONTHS[text[:3].lower()],
    "q": lambda digits: "quarter" if digits == "4" else _ordinal(digits),
    "N": lambda digits: _minutes(digits).replace("quarter", "a quarter"),
    "l": lambda digits: _minutes(str(60 - int(digits))),
    "L": lambda digits: _minutes(str(60 - int(digits))).replace("quarter", "a quarter"),
    "f": lambda digits: _hour(digits, 1),
    "e": lambda amount: _cardinal(_thousands(amount)),
    "k": lambda amount: _hundreds(_thousands(amount)),
    "x": lambda letters: MAGNITUDES["h" if letters[0] == "h" else letters.strip()[0].lower()],
    "s": lambda sign: CURRENCIES[sign][0],
    "S": lambda sign: CURRENCIES[sign][1],
    "b": lambda sign: CURRENCIES[sign][2],
    "u": lambda unit: UNITS["".join(unit.casefold().split())],
    "v": lambda unit: _COUNTED.sub(_singular, f"one {UNITS[unit.casefold()]}").removeprefix("one "),
    "r": lambda numeral: _cardinal(_roman(numeral)),
    "R": lambda numeral: _ordinal(_roman(numeral)),
    "a": lambda name: {"fig": "figure", "vol": "volume", "p": "page", "pp": "pages"}[name.lower()],
    "d": lambda digits: re.sub("ys$", "ies", f"{_usual(digits)}s"),
    "z": lambda letters: " ".join(letters.replace(".", "")).lower().replace("&", "and"),
    "g": lambda scale: "celsius" if scale in "cC" else "fahrenheit",
}
"""What the ways of templates make of a part."""
_NAME = "|".join(f"{name[:3].title()}(?:{name[3:]})?" for name in MONTHS).replace("Sep", "Sep(?:t(?!e))?")
_MEASURES = sorted((re.escape(unit) for unit in UNITS if len(unit) > 1 and unit != "in"), key=len, reverse=True)
PIECES = read_table("form_pieces") | {
    "MONTH": rf"(?-i:({_NAME})\.?)",
    "UNIT": "|".join(_MEASURES),
    "TITLE": "|".join(name for name in ABBREVIATIONS if name[0].isupper()),
    "SHORT": "|".join(re.escape(name) for name in ABBREVIATIONS if name.islower()),
}
"""Regular expressions of which those of forms are made."""
_NAMES = {each.split()[0] for each in UNITS.values()} | set().union(*CURRENCIES.values())
_COUNTED: re.Pattern[str] = re.compile(rf"((?:^|\band )one )({'|'.join(sorted(_NAMES))})\b")
_READERS = {"!telephone": _telephone, "!decimal": _decimal, "!number": _number}
_READERS |= {"!address": _address, "!abbreviation": _abbreviation, "!stutter": _stutter}


def _expand(pattern: str) -> str:
    return re.sub("<([A-Z]+)>", lambda piece: _expand(PIECES[piece[1]]), pattern)


def _read_forms(table: str) -> Forms:
    return tuple((_expand(form), _READERS.get(text, text)) for form, text in read_table(table).items())


NUMBER: str = _expand("<NUMBER>")
WORD = _expand("<WORD>")
NUMERIC = _read_forms("numeric_forms")
FORMS = NUMERIC + _read_forms("worded_forms")
"""Patterns of forms, without regard of case, and how they are read: the first that matches counts. Those that begin
with a letter come last."""


def _singular(match: re.Match[str]) -> str:
    name = match[2]
    return match[1] + (parse_table("pence=penny feet=foot inches=inch").get(name) or name.removesuffix("s"))
