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
ONES = (
    "zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen "
    "seventeen eighteen nineteen"
).split()
TENS = "_ _ twenty thirty forty fifty sixty seventy eighty ninety".split()
SCALES = ((10**9, "billion"), (10**6, "million"), (1000, "thousand"), (100, "hundred"))
MONTHS = "january february march april may june july august september october november december".split()
_MONTHS = {name[:3]: name for name in MONTHS}
ORDINALS = parse_table("one=first two=second three=third five=fifth eight=eighth nine=ninth twelve=twelfth")
"""The ordinals that do not end in ``th`` after the cardinal."""
CURRENCIES = {sign: tuple(names.split()) for sign, names in read_table("currencies").items()}
MAGNITUDES = {"h": "hundred", "k": "thousand", "m": "million", "b": "billion", "t": "trillion"}
"""By the first letter, which the whole names begin with, too: ``mn``, ``bn``, ``million``."""
UNITS, ABBREVIATIONS, SIGNS = map(read_table, ("measures", "abbreviations", "signs"))
PARTS = "War|Part|Chapter|Act|Scene|Volume|Book|Episode|Section|Phase|Type|Level|Class|Round|Title|Bowl|Rocky|Stage"
"""What is counted by cardinals: ``Chapter IV``, but ``Henry VIII``."""


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
    "u": lambda unit: UNITS["".join(unit.lower().split())],
    "v": lambda unit: _COUNTED.sub(_singular, f"one {UNITS[unit.lower()]}").removeprefix("one "),
    "r": lambda numeral: _cardinal(_roman(numeral)),
    "R": lambda numeral: _ordinal(_roman(numeral)),
    "a": lambda name: {"fig": "figure", "vol": "volume", "p": "page", "pp": "pages"}[name.lower()],
    "d": lambda digits: re.sub("ys$", "ies", f"{_usual(digits)}s"),
    "g": lambda scale: "celsius" if scale in "cC" else "fahrenheit",
}
"""What the ways of templates make of a part."""
NUMBER = r"(?:\d{1,3}(?:,\d{3})+(?!\d)|\d+)"
A = rf"(?:{NUMBER}(?:\.\d+)?|\.\d+)"
R = rf"({A}(?:\s?[-–]\s?{A})?)"  # an amount, and one or a range of them
WORD = r"[^\W\d_]+(?:'[^\W\d_]+)*"
_NAME = "|".join(f"{name[:3].title()}(?:{name[3:]})?" for name in MONTHS).replace("Sep", "Sep(?:t(?!e))?")
MONTH, MM, DD = rf"(?-i:({_NAME})\.?)", "(0?[1-9]|1[0-2])", r"(0?[1-9]|[12]\d|3[01])"
UNIT = "|".join(sorted((re.escape(unit) for unit in UNITS if len(unit) > 1 and unit != "in"), key=len, reverse=True))
S, OVER, PM = "([$£€¥₹₩])", "[/⁄]", r"\s?([ap])\.?m(?:\.|\b)"
DOMAIN = "(?:com|org|net|edu|gov|io|uk|de|ai|tv)"
PARTED = "([3-9]|12|16|20|32|64)"
NUMERAL = "((?:XL|L?X{0,3})(?:IX|IV|V?I{0,3}))"
TITLE = "|".join(name for name in ABBREVIATIONS if name[0].isupper())
_NAMES = {each.split()[0] for each in UNITS.values()} | set().union(*CURRENCIES.values())
_COUNTED: re.Pattern[str] = re.compile(rf"((?:^|\band )one )({'|'.join(sorted(_NAMES))})\b")
NUMERIC: Forms = (
    (r"(?:\+\d{1,3}[ .-]?|1[-.])?(?:\(\d{3}\)[ -]?|\d{3}[-.])?\d{3}-\d{4}|\d{3}\.\d{3}\.\d{4}|\+\d{7,14}", _telephone),
    (r"0\d{2,4}(?: \d{3,4}){2}", _telephone),
    (rf"(\d{{4}})[-/]{MM}[-/]{DD}", "{2:m} {3:o} {1}|the {3:o} of {2:m} {1}|{2:m} {3:c} {1}|{2:m} {3:o} {1:*}"),
    (r"\+\d{1,3}(?:[ .-]\(?\d{1,4}\)?){2,5}|\d+(?:-\d+){2,5}", _telephone),
    (
        rf"{MM}[/.]{MM}[/.](\d{{4}}|\d\d)",
        "{1:m} {2:o} {3:y}|the {2:o} of {1:m} {3:y}|{2:m} {1:o} {3:y}|the {1:o} of {2:m} {3:y}|{1:c} {2:c} {3:y}",
    ),
    (rf"{MM}[/.]{DD}[/.](\d{{4}}|\d\d)", "{1:m} {2:o} {3:y}|the {2:o} of {1:m} {3:y}|{1:c} {2:c} {3:y}"),
    (rf"{DD}[/.]{MM}[/.](\d{{4}}|\d\d)", "the {1:o} of {2:m} {3:y}|{2:m} {1:o} {3:y}|{1:c} {2:c} {3:y}"),
    (rf"{DD}(?:st|nd|rd|th)?\s{MONTH}", "the {1:o} of {2:m}|{1:o} of {2:m}|{2:m} {1:o}|{1:c} {2:m}|the {1:o} {2:m}"),
    (rf"(\d\d?):00{PM}", "{1:c} {2:w} m|{1:c} o'clock {2:w} m|{1:c} o'clock|{1:c}"),
    (rf"(\d\d?:\d\d){PM}", "{1:*} {2:w} m|{1}"),
    (rf"(1[0-2]|[1-9]){PM}", "{1} {2:w} m"),
    (r"([01]?\d|2[0-4]):([0-5]\d):([0-5]\d)", "{1:c} {2:p} {3:p}|{1:c} hours {2:c} minutes {3:c} seconds"),
    (r"12:00", "twelve o'clock|twelve|noon|midnight|twelve hundred"),
    (r"([1-9]|1[01]):00", "{1} o'clock|{1}|{1} hundred|{1} hundred hours"),
    (r"(0\d|1\d|2[0-4]):00", "{1} hundred|{1} hundred hours|{1:t} o'clock|{1:t} p m|{1:t}|midnight"),
    (
        r"([01]?\d|2[0-4]):(0\d|1\d|2\d|30)",
        "{1:c} {2:p}|{2:n} past {1:t}|{2:N} past {1:t}|{1:t} {2:p}|{2:n} after {1:t}|{1:c} {2:c}",
    ),
    (r"([01]?\d|2[0-4]):([345]\d)", "{1:c} {2:p}|{2:l} to {1:f}|{2:L} to {1:f}|{1:t} {2:p}"),
    (r"(\d+):(\d+)", "{1} to {2}|{1} {2}"),
    (rf"{S}\s?({A})\s?(?:k|thousand)", "{2} thousand {1:s}|{2} k|{2:k} {1:s}|{2:e} {1:s}|{2:*} thousand {1:s}"),
    (
        rf"{S}\s?{R}(\s?(?:hundred|million|billion|trillion|mn|mil|bn)\b|mm?|bn?|tn?)",
        "{2:*} {3:x} {1:s}|{2} {3:x}|{2} {3:x} {1:b}",
    ),
    (rf"{S}\s?0?\.(?!00)(\d\d)", "{2:c} {1:S}"),
    (rf"{S}\s?({NUMBER})\.00", "{2} {1:s}|{2} {1:s} even"),
    (rf"{S}\s?({NUMBER})\.(\d\d)", "{2:i} {1:s} and {3:c} {1:S}|{2:i} {1:s} {3:c} {1:S}|{2:i} {3:p}|{2:i} {1:s} {3:p}"),
    (rf"{S}\s?{R}(?:\s?[-–]\s?{S})?", "{2:i} {1:s}|{2:i} {1:b}|{2:*} {1:s}"),
    (rf"{R}\s?([$£€¥₹₩¢])", "{1:i} {2:s}|{1:i} {2:b}|{1:*} {2:s}"),
    (r"'(0[1-9])", "{1:p}|{1}"),
    (
        r"(\d+)\s?h(?:\s?(\d\d?)\s?m(?:ins?)?|(\d\d))",
        "{1} hours {2:c}{3:c} minutes|{1} hours and {2:c}{3:c} minutes|{1} hours {2}{3}",
    ),
    (r"(\d+)\s?m(?:ins?)?\s?(\d\d?)\s?s(?:ecs?)?", "{1} minutes {2:c} seconds|{1} minutes and {2:c} seconds"),
    (r"'?(\d0)'?s", "{1:d}|{1} seconds"),
    (r"'?(\d\d\d0)'?s", "{1:d}"),
    (rf"{R}\s?°\s?([cf])", "{1} degrees {2:g}|{1} degrees|{1} {2:w}|{1} {2:g}|{1} degrees centigrade"),
    (rf"{R}((?-i:[CF]))", "{1} degrees {2:g}|{1} {2:w}|{1} degrees|{1} {2:g}"),
    (rf"{R}\s?mph", "{1} miles per hour|{1} m p h|{1} miles an hour|{1:*} miles per hour"),
    (rf"{R}\s?gb(?!/)", "{1} gigabytes|{1} gigs|{1} g b|{1:*} gigabytes"),
    (rf"{R}((?-i:[M]))", "{1} million|{1:i} meters"),
    (rf"{R}((?-i:[GLHS]))", "{1} {2:w}|{1:i} {2:u}"),
    (rf"{R}(\s?(?-i:[gl])|[hs])", "{1:i} {2:u}|{1} {2:w}"),
    (rf"{R}\s?m", "{1:i} meters|{1} million|{1} m"),
    (rf"{R}(\s?(?:{UNIT}|[%°])|in|[wv])", "{1:i} {2:u}|{1:*} {2:u}"),
    (rf"({A})-({UNIT})", "{1} {2:v}"),
    (r"(\d)'\s?(1[01]|\d)(?:\"|'')?", "{1} {2}|{1} foot {2}|{1} feet {2}"),
    (r"(\d+)\.(\d+)\.(\d+)\.(\d+)", "{1} dot {2} dot {3} dot {4}|{1} point {2} point {3} point {4}"),
    (r"(\d+)\.(\d+)\.(\d+)", "{1} point {2} point {3}|{1} dot {2} dot {3}|{1} {2} {3}"),
    (rf"({NUMBER})(?:st|nd|rd|th)", "{1:o}"),
    (rf"(\d+)[ -]1{OVER}2", "{1} and a half|{1} and one half"),
    (rf"(\d+)[ -]1{OVER}(\d+)", "{1} and a {2:q}|{1} and one {2:q}"),
    (rf"(\d+)[ -](\d+){OVER}(\d+)", "{1} and {2} {3:q}s"),
    (rf"1{OVER}2", "one half|a half|half|one over two|one out of two|one two|january second"),
    (rf"1{OVER}{PARTED}", "one {1:q}|a {1:q}|one {1:o}|one over {1}|one out of {1}|one {1}"),
    (rf"([2-9]){OVER}{PARTED}", "{1} {2:q}s|{1} {2:o}s|{1} out of {2}|{1} {2}|{1} over {2}|{1} slash {2}"),
    (rf"(\d+){OVER}(10|100)", "{1} out of {2}|{1} {2}|{1} {2:o}s|{1} over {2}|{1} slash {2}"),
    (rf"{MM}{OVER}{DD}", "{1:c} {2:c}|{1:m} {2:o}|the {2:o} of {1:m}|{1:c} out of {2:c}|{1:c} over {2:c}"),
    (rf"(\d+){OVER}(\d+)", "{1} {2}|{1} out of {2}|{1} over {2}|{1} slash {2}"),
    (r"(20(?=[-–]20)|50(?=[-–]50))[-–][25]0", "{1} {1}|{1} to {1}"),
    (r"(\d+)[-–]0", "{1} to zero|{1} nil|{1} zero|{1} nothing|{1} oh"),
    (rf"({A})\s?[-–]\s?({A})", "{1} to {2}|{1} {2}|{1:*} to {2}|{1} to {2:*}|{1} through {2}|{1} minus {2}"),
    (rf"({A})k", "{1} k|{1} thousand|{1:k}"),
    (rf"({A})(b|bn)", "{1} billion|{1} b"),
    (rf"({A})\s?[x×]\s?({A})(?!\^)", "{1} by {2}|{1} times {2}|{1} x {2}"),
    (rf"({A})x", "{1} times|{1} x"),
    (r"#(\d+)", "number {1}|hashtag {1}"),
    (rf"({NUMBER})\^2", "{1} squared|{1} to the second"),
    (rf"({NUMBER})\^(\d+)", "{1} to the {2:o}"),
    (rf"{NUMBER}?\.\d+", _decimal),
    (NUMBER, _number),
)
FORMS: Forms = (
    *NUMERIC,
    (r"[\w.+-]{1,64}@[\w-]{1,63}(?:\.[\w-]{1,63}){1,4}|(?:https?://|www\.)[^\s<>()]{0,200}[\w/]", _address),
    (rf"[a-z][\w-]{{0,63}}(?:\.[\w-]{{1,63}}){{0,4}}\.{DOMAIN}\b(?:/[\w/.-]{{0,200}}\w)?", _address),
    (rf"{MONTH}\s{DD}(?:st|nd|rd|th)?(?!\s?[-–:.]?\d)", "{1:m} {2:o}|{1:m} {2:c}|{1:m} the {2:o}|the {2:o} of {1:m}"),
    (r"no\.\s?(\d+)", "number {1}|no {1}"),
    (r"(fig|vol|pp?)\.\s?(\d+(?:[-–]\d+)?)", "{1:a} {2}"),
    (r"(?-i:CO)2", "c o two"),
    (r"(?-i:St\. ([A-Z][a-z]+))", "saint {1:w}|street {1:w}"),
    (rf"(?-i:(?:{TITLE})\.)(?=\s+(?-i:[A-Z])|\Z)", lambda text: iter(ABBREVIATIONS[text[:-1]].split("|"))),
    (
        "(?:" + "|".join(re.escape(name) for name in ABBREVIATIONS if name.islower()) + r")\.",
        lambda text: iter(ABBREVIATIONS[text[:-1].lower()].split("|")),
    ),
    (rf"(?-i:({PARTS}) (?=[IVXL]){NUMERAL})", "{1:w} {2:r}|{1:w} the {2:R}|{1:w} {2:w}"),
    (r"(?-i:([A-Z][a-z]+) ([VX]))", "{1:w} {2:w}|{1:w} the {2:R}|{1:w} {2:r}"),
    (rf"(?-i:([A-Z][a-z]+) (?=[IVX]{{2}}){NUMERAL})", "{1:w} the {2:R}|{1:w} {2:r}"),
    (r"(?:[a-z]\.){2,}[a-z]?", lambda text: iter([text.lower().replace(".", " ")])),
    (r"(?-i:([A-Z])\+\+)", "{1:w} plus plus"),
    (r"(?-i:([A-Z])#)", "{1:w} sharp"),
    (r"(?-i:[A-Z]{1,3}&[A-Z]{1,3})", lambda text: iter([" ".join(text).lower().replace("&", "and")])),
    (rf"(?!d-day)(?P<bit>[b-df-hj-np-tv-z]{{1,3}})-(?:(?P=bit)-)*(?=(?P=bit)){WORD}", _stutter),
    (r"(?-i:[A-Z]{2,5}s?)", lambda text: iter([" ".join(text).lower(), text.lower()])),
)  # fmt: skip
"""Patterns of forms, without regard of case, and how they are read: the first that matches counts.
Those that begin with a letter come last.

Readings are divided by ``|``; ``{1}`` is the usual one of the first group, ``{1:*}`` each of them; or as of ``SAID``.
"""


def _singular(match: re.Match[str]) -> str:
    name = match[2]
    return match[1] + (parse_table("pence=penny feet=foot inches=inch").get(name) or name.removesuffix("s"))
