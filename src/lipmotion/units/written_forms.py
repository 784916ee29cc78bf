"""Written forms that are said as other words: numbers, dates, times, sums, measures, addresses and abbreviations.

Many a form may be read in several ways. The usual one is the first; where there is sound, the sound decides.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import cache

Reading = tuple[str, ...]
Form = tuple[str, Callable[[re.Match[str]], Iterable[str]]]

MOST_READINGS = 8
"""Most readings of a form: alignment tries each."""
ONES = (
    "zero one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen "
    "seventeen eighteen nineteen"
).split()
TENS = "_ _ twenty thirty forty fifty sixty seventy eighty ninety".split()
SCALES = ((10**9, "billion"), (10**6, "million"), (1000, "thousand"), (100, "hundred"))
DIGITS_FIRST = ("911", "999", "411")
"""Numbers that are said by their digits."""
ORDINALS = dict(
    pair.split("=")
    for pair in "one=first two=second three=third five=fifth eight=eighth nine=ninth twelve=twelfth".split()
)
"""The ordinals that do not end in ``th`` after the cardinal."""
MONTHS = "january february march april may june july august september october november december".split()
CURRENCIES = {
    "$": "dollar dollars cent cents bucks",
    "£": "pound pounds penny pence quid",
    "€": "euro euros cent cents euro",
    "¥": "yen yen sen sen yen",
    "₹": "rupee rupees paisa paise rupees",
    "₩": "won won jeon jeon won",
}
"""One and many of each, one and many of its parts, and how it is also called."""
MAGNITUDES = {"k": "thousand", "m": "million", "b": "billion", "t": "trillion"}
"""By the first letter, which the whole names begin with, too: ``mn``, ``bn``, ``million``."""
UNITS = dict(
    pair.split("=")
    for pair in (
        "km=kilometer cm=centimeter mm=millimeter m=meter kg=kilogram mg=milligram g=gram lb=pound lbs=pound oz=ounce "
        "km/h=kilometer_per_hour kph=kilometer_per_hour mph=mile_per_hour m/s=meter_per_second mi=mile yd=yard ft=foot "
        "in=inch ml=milliliter l=liter hz=hertz khz=kilohertz mhz=megahertz ghz=gigahertz kb=kilobyte mb=megabyte "
        "gb=gigabyte tb=terabyte kw=kilowatt kwh=kilowatt_hour w=watt v=volt ms=millisecond s=second sec=second "
        "secs=second min=minute mins=minute hr=hour hrs=hour h=hour yrs=year px=pixel fps=frame_per_second db=decibel "
        "%=percent °c=degree_celsius °f=degree_fahrenheit °=degree c=degree_celsius f=degree_fahrenheit"
    ).split()
)
PLURALS = {"foot": "feet", "inch": "inches", "percent": "percent"} | {f"{each}hertz": f"{each}hertz" for each in (
    "", "kilo", "mega", "giga")}  # fmt: skip
TITLES = dict(
    pair.split("=")
    for pair in (
        "Dr=doctor|drive Mr=mister Mrs=missus Ms=miz Prof=professor Gov=governor Sen=senator Rep=representative "
        "Gen=general Col=colonel Lt=lieutenant Sgt=sergeant Capt=captain Rev=reverend Hon=honorable Mt=mount Ft=fort"
    ).split()
)
"""Abbreviations before a name, without the full stop; the readings divided by ``|``."""
ABBREVIATIONS = dict(
    pair.split("=")
    for pair in (
        "jr=junior sr=senior vs=versus|v_s etc=et_cetera e.g=for_example|e_g i.e=that_is|i_e a.k.a=a_k_a|also_known_as "
        "approx=approximately dept=department ave=avenue blvd=boulevard inc=inc|incorporated ltd=limited "
        "corp=corporation|corp jan=january|jan feb=february aug=august sept=september oct=october nov=november "
        "dec=december tues=tuesday thurs=thursday"
    ).split()
)
"""Others."""
SIGNS = {
    "&": "and",
    "@": "at",
    "+": "plus|and",
    "=": "equals",
    "×": "times|by",
    "÷": "divided by",
    "#": "hashtag|number|hash",
    "~": "about",
    "-": "minus|negative",
    "−": "minus|negative",
    "–": "to",
    "w/": "with",
    "w/o": "without",
    ".": "dot",
    "/": "slash",
    "_": "underscore",
    ":": "colon",
}
"""Signs that are said where they stand alone, and in addresses."""
ROMAN = {"I": 1, "V": 5, "X": 10, "L": 50}
PARTS = (
    "war|part|chapter|act|scene|volume|book|episode|section|phase|type|level|class|round|title|bowl|rocky|mark|stage"
)
"""What is counted by cardinals: ``Chapter IV``, but ``Henry VIII``."""


def number_words(digits: str) -> list[str]:
    """Return the words of a whole number; from a trillion on, or with leading zeros, digit by digit."""
    if len(digits) > 12 or (len(digits) > 1 and digits[0] == "0"):
        return [ONES[int(digit)] for digit in digits]
    number = int(digits)
    if number < 20:
        return [ONES[number]]
    if number < 100:
        return [TENS[number // 10], *([ONES[number % 10]] if number % 10 else [])]
    scale, name = next((scale, name) for scale, name in SCALES if number >= scale)
    rest = number_words(str(number % scale)) if number % scale else []
    return [*number_words(str(number // scale)), name, *rest]


def ordinal_word(word: str) -> str:
    """Return the ordinal of the last word of a number: ``third`` of ``three``, ``twentieth`` of ``twenty``."""
    if word in ORDINALS:
        return ORDINALS[word]
    return f"{word[:-1]}ieth" if word.endswith("y") else f"{word}th"


@cache
def readings(token: str) -> tuple[Reading, ...]:
    """Return the readings of a written form, the usual one first; of any other word, the word in lower case.

    >>> readings("1995")[:2]
    (('nineteen', 'ninety', 'five'), ('one', 'thousand', 'nine', 'hundred', 'ninety', 'five'))
    """
    if token in SIGNS:
        found: Iterable[str] = SIGNS[token].split("|")
    else:
        matches = ((say, re.fullmatch(pattern, token, re.IGNORECASE)) for pattern, say in FORMS)
        found = next((say(match) for say, match in matches if match), [token.lower()])
    different = dict.fromkeys(tuple(each.split()) for each in found)
    return tuple(different)[:MOST_READINGS] or ((),)


def _said(text: str) -> str:
    """Return the usual reading of a number or another form within a form."""
    return " ".join(readings(text)[0])


def _number(digits: str) -> list[str]:
    """Return the readings of a whole number, with or without commas, or of a decimal."""
    whole, dot, decimals = digits.replace(",", "").partition(".")
    if dot:
        spelled = f"point {_spelled(decimals)}"
        pair = [f"{_cardinal(whole)} {'point ' * said}{_cardinal(decimals)}" for said in (1, 0)] if whole else []
        begun = [_cardinal(whole), "oh", ""] if whole == "0" else [_cardinal(whole)] if whole else ["", "zero"]
        half = [f"{_cardinal(whole)} and a half"] if decimals == "5" and whole not in ("", "0") else []
        return [*(f"{each} {spelled}" for each in begun), *half, *(pair if len(decimals) == 2 else ())]
    if len(whole) > 12:
        return [_spelled(whole), _spelled(whole, "oh")]
    number, plain = int(whole), _cardinal(whole)
    by_pairs, hundreds = [], []
    if len(whole) in (3, 4) and whole[0] != "0" and whole == digits:
        first, last = whole[:-2], whole[-2:]
        rest = "hundred" if last == "00" else f"oh {_cardinal(last[1])}" if last[0] == "0" else _cardinal(last)
        by_pairs = [f"{_cardinal(first)} {rest}"]
    elif len(whole) == 4 and whole[1] != "0" and whole.endswith("00"):
        hundreds = [f"{_cardinal(whole[:2])} hundred"]
    is_year = 1010 <= number <= 2099 and whole[1:3] != "00" and whole == digits
    with_and = []
    if number > 100 and number % 100 and whole[0] != "0":
        with_and = [f"{_cardinal(str(number - number % 100))} and {_cardinal(str(number % 100))}"]
    is_short = number < 200 or not number % 1000
    with_a = [f"a{each[3:]}" for each in (plain, *with_and) if is_short and re.match("one (hun|thou|mill)", each)]
    first = [_spelled(whole)] if whole in DIGITS_FIRST else by_pairs if is_year else []
    ohs = [_spelled(whole, "oh")] if "0" in whole and (len(whole) > 2 or number < 10) else []
    doubled = [f"double oh {_cardinal(whole[2])}"] if whole[:2] == "00" and len(whole) == 3 else []
    return [*first, plain, *with_and[:1], *by_pairs, *hundreds, _spelled(whole), *ohs, *doubled, *with_a]


def _cardinal(digits: str) -> str:
    return " ".join(number_words(digits))


def _spelled(digits: str, zero: str = "zero") -> str:
    return " ".join(ONES[int(digit)] if int(digit) else zero for digit in digits)


def _ordinal(digits: str) -> str:
    *before, last = number_words(digits.replace(",", ""))
    return " ".join((*before, ordinal_word(last)))


def _decade(found: re.Match[str]) -> list[str]:
    """Return ``1990s`` as nineteen nineties, ``'80s`` as eighties, ``1900s`` as nineteen hundreds."""
    number = _said(found[1])
    decade = f"{number[:-1]}ies" if number.endswith("y") else f"{number}s"
    return [decade, f"{number} seconds"] if len(found[1]) == 2 else [decade]


def _clock(found: re.Match[str]) -> list[str]:
    """Return the readings of a time of day, or of a length of time."""
    hour, minute, second, half = int(found[1]), found[2], found[3], f" {found[4].lower()} m" if found[4] else ""
    spoken = _cardinal(str(hour))
    if second:
        units = zip((found[1], minute, second), ("hour", "minute", "second"), strict=True)
        parts = [
            spoken,
            *(f"oh {_cardinal(each[1])}" if each[0] == "0" else _cardinal(each) for each in (minute, second)),
        ]
        return [" ".join(parts), " ".join(_counted(each, name) for each, name in units if int(each))]
    if minute == "00":
        hundred = f"{'zero ' * (0 < hour < 10 and found[1][0] == '0')}{spoken} hundred"
        plain = [f"{spoken}{half}", f"{spoken} o'clock{half}"]
        afternoon = [f"{_cardinal(str(hour - 12))} {each}" for each in ("o'clock", "p m")] if hour > 12 else []
        names = {12: ["noon"], 0: ["midnight", "twelve a m"]}.get(hour, [])
        military = [hundred, f"{hundred} hours"]
        return (
            [*military, *afternoon, *names]
            if hour > 12 or not hour
            else [*(plain if half else plain[::-1]), *military, *names]
        )
    late = f"oh {_cardinal(minute[1])}" if minute[0] == "0" else _cardinal(minute)
    clock, following = _cardinal(str((hour - 1) % 12 + 1)), _cardinal(str(hour % 12 + 1))
    past = int(minute)
    by_hour = f"{_near(past)} past {clock}" if past <= 30 else f"{_near(60 - past)} to {following}"
    others = [by_hour, f"a {by_hour}"] if past % 30 == 15 else [by_hour]
    again = [f"{clock} {late}"] if hour > 12 else []
    return [f"{spoken} {late}{half}", *(f"{each}{half}" for each in others), *again, f"{spoken} {_cardinal(str(past))}"]


def _near(minutes: int) -> str:
    """Return so many minutes as they are said before ``past`` and ``to``."""
    return {15: "quarter", 30: "half"}.get(minutes, _cardinal(str(minutes)))


def _counted(digits: str, name: str) -> str:
    """Return a number with the name of what is counted: ``one hour``, ``two hours``."""
    return f"{_cardinal(str(int(digits)))} {_many(name) if int(digits) != 1 else name}"


def _many(name: str) -> str:
    """Return the plural of a unit: ``miles per hour`` of ``mile per hour``."""
    first, blank, rest = name.partition(" ")
    return f"{PLURALS.get(first, f'{first}s')}{blank}{rest}" if name != "kilowatt hour" else "kilowatt hours"


def _date(year: str, month: str, day: str, *, day_first: bool = False) -> list[str]:
    """Return the readings of a date; ``day_first``: the first of them as in Britain."""
    years = _number(year)[:3] if year else [""]
    american, british = (
        f"{MONTHS[int(month) - 1]} {_ordinal(str(int(day)))}",
        f"the {_ordinal(str(int(day)))} of {MONTHS[int(month) - 1]}",
    )
    orders = [british, american] if day_first else [american, british]
    plain = [f"{american.split(maxsplit=1)[0]} {_cardinal(str(int(day)))}"]
    return [f"{each} {said}" for said in years for each in (*orders, *plain)]


def _slashed(found: re.Match[str]) -> list[str]:
    """Return the readings of ``3/4/2021``: of both orders, and as numbers."""
    one, two, year = found.groups()
    full = year if len(year) == 4 else f"{'19' if int(year) > 50 else '20'}{year}"
    dates = [
        _date(full, *order)
        for order in ((one, two), (two, one))
        if 1 <= int(order[0]) <= 12 and 1 <= int(order[1]) <= 31
    ]
    numbers = " ".join(_cardinal(str(int(each))) for each in (one, two))
    plain = [
        f"{numbers} {said}" for said in (_said(full), f"oh {_said(year[-1])}" if year[-2] == "0" else _said(year[-2:]))
    ]
    return [*(said for each in dates for said in each[:2]), *plain, *(said for each in dates for said in each[2:])]


def _day(found: re.Match[str]) -> list[str]:
    """Return the readings of ``May 5th`` and of ``5 May``."""
    month = next(n for n, name in enumerate(MONTHS, 1) if name.startswith((found[1] or found[4])[:3].lower()))
    day_first = found[1] is None
    dates = _date("", str(month), found[2] or found[3], day_first=day_first)
    american = f"{MONTHS[month - 1]} the {_ordinal(found[2] or found[3])}"
    return [*dates, f"{_cardinal(found[2] or found[3])} {MONTHS[month - 1]}" if day_first else american]


def _money(found: re.Match[str]) -> list[str]:
    """Return the readings of a sum of money, which may be a range: ``$5.50``, ``$1.5k``, ``£3 million``, ``$5-10``."""
    sign, amount, last, scale = (
        found[1] or found[6] or "",
        found[2] or found[5],
        found[3],
        (found[4] or "").strip().lower(),
    )
    one, many, one_part, many_parts, other = (
        CURRENCIES[sign].split() if sign != "¢" else ("cent", "cents", "", "", "cents")
    )
    magnitude = "hundred" if scale.startswith("h") else MAGNITUDES.get(scale[:1], "")
    whole, _, part = amount.replace(",", "").partition(".")
    if last or magnitude or len(part) == 1:
        amounts = [f"{each} to {_said(last)}" for each in _number(amount)[:2]] if last else _number(amount)
        spoken = [f"{each} {magnitude} {many}" for each in amounts]
        if magnitude == "thousand":
            worth = str(round(float(f"{whole}.{part or 0}") * 1000))
            spoken[1:1] = [f"{amounts[0]} k", *(f"{each} {many}" for each in _number(worth)[:2])]
        elif magnitude:
            spoken[1:1] = [f"{amounts[0]} {magnitude}", f"{amounts[0]} {scale[0]}", f"{amounts[0]} {magnitude} {other}"]
        return spoken
    if not part or not int(part):
        amounts = _number(whole if "," not in amount else amount.partition(".")[0])
        name = one if int(whole or 0) == 1 else many
        other = other[:-1] if name == one and other != "quid" else other
        return [f"{amounts[0]} {name}", f"{amounts[0]} {other}", *(f"{each} {name}" for each in amounts[1:])]
    parts = f"{_cardinal(str(int(part)))} {one_part if int(part) == 1 else many_parts}"
    if not int(whole or 0):
        return [parts]
    said = _cardinal(whole)
    late = f"oh {_cardinal(part[1])}" if part[0] == "0" else _cardinal(part)
    name = one if int(whole) == 1 else many
    return [f"{said} {name} and {parts}", f"{said} {name} {parts}", f"{said} {late}", f"{said} {name} {late}"]


def _measure(found: re.Match[str]) -> list[str]:
    """Return the readings of a number, or a range, with a unit: ``5 km``, ``20%``, ``5-10 kg``, ``16 GB``, ``-3°C``."""
    sign, amount, last, unit = found[1], found[2], found[3], "".join(found[4].lower().split())
    name = UNITS[unit.strip("-")].replace("_", " ")
    name = name if (amount == "1" and not last) or unit[0] == "-" else _many(name)
    amounts = [f"{each} to {_said(last)}" for each in _number(amount)[:2]] if last else _number(amount)
    minus = ("minus ", "negative ") if sign else ("",)
    names = [name]
    if name.startswith("degree") and " " in name:
        first, _, scale = name.partition(" ")
        names += [first, scale[0], scale, f"{first} centigrade"]
    elif unit in ("m", "g", "l", "h", "s"):
        capital = "million" if unit == "m" else unit
        names = [capital, name] if found[4].isupper() else [name, capital]
    elif unit in ("mph", "gb", "mb"):
        names += [" ".join(unit), {"mph": "miles an hour", "gb": "gigs", "mb": "megs"}[unit]]
    usual = [f"{before}{amounts[0]} {each}" for before in minus for each in names]
    return [*usual, *(f"{minus[0]}{each} {name}" for each in amounts[1:])]


def _fraction(found: re.Match[str]) -> list[str]:
    """Return the readings of ``1/2``, ``2 3/4``, ``24/7``, ``9/11``."""
    whole, top, under = found[1], found[2], found[3]
    pair = f"{_said(top)} {_said(under)}"
    name = {"2": "half", "4": "quarter"}.get(under, _ordinal(under))
    names = [
        f"{_said(top)} {each if top == '1' else 'halves' if each == 'half' else f'{each}s'}"
        for each in dict.fromkeys((name, _ordinal(under) if under != "2" else name))
    ]
    if top == "1":
        names[1:1] = [f"a {name}", *([name] if name == "half" else [])]
    if whole:
        return [f"{_said(whole)} and {each}" for each in sorted(names, key=lambda each: not each.startswith("a "))]
    dates = _date("", top, under)[:2] if 1 <= int(top) <= 12 and 1 <= int(under) <= 31 else []
    others = [
        f"{_said(top)} out of {_said(under)}",
        pair,
        f"{_said(top)} over {_said(under)}",
        f"{_said(top)} slash {_said(under)}",
    ]
    is_fraction = int(top) < int(under) and (int(under) <= 10 or int(under) in (12, 16, 20, 32, 64, 100))
    if under in ("10", "100"):
        return [*others[:2], *names[: 2 * is_fraction], *dates, *others[2:]]
    return [*names, *others, *dates] if is_fraction else [pair, *dates, *others]


def _range(found: re.Match[str]) -> list[str]:
    """Return the readings of ``9-5``, ``10–12``, ``1939-45``, ``3-2``."""
    firsts, lasts = _number(found[1]), _number(found[2])
    joined = [f"{firsts[0]} {between}{lasts[0]}" for between in ("to ", "", "through ", "minus ")]
    others = [f"{first} to {last}" for first, last in zip(firsts[1:], [*lasts[1:], *lasts[-1:] * 9], strict=False)]
    nil = [f"{firsts[0]} nil"] if found[2] == "0" else []
    joined[:2] = joined[:2][:: -1 if found[1] == found[2] else 1]
    return [*joined[:2], *nil, *others[:3], *joined[2:]]


def _telephone(found: re.Match[str]) -> list[str]:
    """Return the readings of a telephone number: by its digits, ``800`` also as a hundred, the last four in pairs."""
    groups = re.findall(r"\d+", found[0])
    plus = "plus " if found[0].startswith("+") else ""
    by_digit, by_oh = [[_spelled(group, zero) for group in groups] for zero in ("zero", "oh")]
    hundreds = [
        _cardinal(each) if re.fullmatch("[1-9]00", each) else said for each, said in zip(groups, by_oh, strict=True)
    ]
    pairs = [[*each[:-1], _pairs(groups[-1])] for each in (by_oh, hundreds)] if len(groups[-1]) == 4 else []
    whole = [" to ".join(map(_cardinal, groups))] if len(groups) == 2 and not plus else []
    return [*(plus + " ".join(each) for each in (by_digit, by_oh, hundreds, *pairs)), *whole]


def _pairs(digits: str) -> str:
    """Return ``1234`` as twelve thirty four, ``5000`` as five thousand."""
    if digits.endswith("000"):
        return _cardinal(digits)
    two = [f"oh {_cardinal(each[1])}" if each[0] == "0" else _cardinal(each) for each in (digits[:2], digits[2:])]
    return " ".join(two) if not digits.endswith("00") else f"{two[0]} hundred"


def _address(found: re.Match[str]) -> list[str]:
    """Return the reading of an address of the web or of mail; its protocol is not said."""
    text = re.sub(r"^https?://", "", found[0].rstrip("/"), flags=re.IGNORECASE)
    spoken = [
        "w w w" if each.lower() == "www" else _said(each) for each in re.findall(r"[^\W\d_]+|\d+|[@./:_&=+]|-", text)
    ]
    return [" ".join("dash" if each == "minus" else each for each in spoken)]


def _abbreviation(found: re.Match[str]) -> list[str]:
    return (TITLES.get(found[1]) or ABBREVIATIONS[found[1].lower()]).replace("_", " ").split("|")


def _stutter(found: re.Match[str]) -> list[str]:
    """Return ``b-b-but`` as the word, and as it is stuttered: ``bu bu but``."""
    *bits, word = found[0].lower().split("-")
    return [word, " ".join((*(f"{bit}u" for bit in bits), word)), " ".join((*bits, word))]


def _roman(found: re.Match[str]) -> list[str]:
    """Return the readings of a name with a Roman number: ``Henry VIII``, ``Part II``."""
    name, numeral = found[1].lower(), found[2].upper()
    values = [ROMAN[letter] for letter in numeral]
    number = str(
        sum(-value if value < following else value for value, following in zip(values, [*values[1:], 0], strict=True))
    )
    cardinal, ordinal = f"{name} {_cardinal(number)}", f"{name} the {_ordinal(number)}"
    letter = [f"{name} {numeral.lower()}"] if len(numeral) == 1 else []
    return [cardinal, ordinal, *letter] if re.fullmatch(PARTS, name) else [*letter, ordinal, cardinal]


NUMBER = r"(?:\d{1,3}(?:,\d{3})+(?!\d)|\d+)"
AMOUNT = rf"(?:{NUMBER}(?:\.\d+)?|\.\d+)"
WORD = r"[^\W\d_]+(?:'[^\W\d_]+)*"
_MONTH = "|".join(f"{name[:3].title()}(?:{name[3:]})?" for name in MONTHS).replace("Sep", "Sep(?:t(?!e))?")
_SCALE = r"(\s?(?:hundred|thousand|million|billion|trillion)\b|k|mm?|mn|mil|bn?|tn?)"
_UNIT = "|".join(sorted((re.escape(unit) for unit in UNITS if len(unit) > 1 and unit != "in"), key=len, reverse=True))
_SIGN = "[" + "".join(CURRENCIES) + "]"
_ABBREVIATED = "|".join(map(re.escape, ABBREVIATIONS))
_PART = "|".join(each.title() for each in PARTS.split("|"))
FORMS: tuple[Form, ...] = (
    (r"[\w.+-]{1,64}@[\w-]{1,63}(?:\.[\w-]{1,63}){1,4}|(?:https?://|www\.)[^\s<>()]{0,200}[\w/]", _address),
    (
        r"[a-z][\w-]{0,63}(?:\.[\w-]{1,63}){0,4}\.(?:com|org|net|edu|gov|io|uk|de|ai|dev|tv)\b(?:/[\w/.-]{0,200}\w)?",
        _address,
    ),
    (
        r"(?:\+\d{1,3}[ .-]?|1[-.])?(?:\(\d{3}\)[ -]?|\d{3}[-.])?\d{3}-\d{4}|\d{3}\.\d{3}\.\d{4}|\+\d{7,14}"
        r"|\+\d{1,3}(?:[ .-]\(?\d{1,4}\)?){2,5}",
        _telephone,
    ),
    (r"(\d{4})-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])", lambda found: _date(*found.groups())),
    (r"\d+(?:-\d+){2,5}", _telephone),
    (r"(0?[1-9]|[12]\d|3[01])[/.](0?[1-9]|[12]\d|3[01])[/.](\d{4}|\d\d)", _slashed),
    (
        rf"(?-i:({_MONTH})\.?)\s(0?[1-9]|[12]\d|3[01])(?:st|nd|rd|th)?(?!\s?[-–:.]?\d)"
        rf"|([12]\d|3[01]|[1-9])(?:st|nd|rd|th)?\s(?-i:({_MONTH}))",
        _day,
    ),
    (r"([01]?\d|2[0-4]):([0-5]\d)(?::([0-5]\d))?(?:\s?([ap])\.?m(?:\.|\b))?", _clock),
    (r"(1[0-2]|[1-9])\s?([ap])\.?m(?:\.|\b)", lambda found: [f"{_said(found[1])} {found[2].lower()} m"]),
    (r"(\d+):(\d+)", lambda found: [f"{_said(found[1])} {between}{_said(found[2])}" for between in ("to ", "")]),
    (
        rf"(?:us)?({_SIGN})\s?({AMOUNT})(?:\s?[-–]\s?{_SIGN}?({AMOUNT}))?{_SCALE}?|({AMOUNT})\s?({_SIGN}|¢)",
        _money,
    ),
    (r"'?(\d0|\d\d\d0)'?s", _decade),
    (
        rf"([-−]?)({AMOUNT})(?:\s?[-–]\s?({AMOUNT}))?([\s-]?(?:{_UNIT}|°\s?[cf]|[%°])|in|[mglshwvcf])",
        _measure,
    ),
    (
        r"(\d)'\s?(1[01]|\d)(?:\"|'')?",
        lambda found: [_said(found[1]) + between + _said(found[2]) for between in (" ", " foot ", " feet ")],
    ),
    (
        r"\d+(?:\.\d+){2,}",
        lambda found: [between.join(map(_said, found[0].split("."))) for between in (" point ", " dot ", " ")],
    ),
    (rf"({NUMBER})(?:st|nd|rd|th)", lambda found: [_ordinal(found[1])]),
    (r"(?:(\d+)[ -])?(\d{1,3})[/⁄]([1-9]\d{0,2})", _fraction),
    (rf"({AMOUNT})\s?[-–]\s?({AMOUNT})", _range),
    (rf"({AMOUNT})([kmb]|bn)", lambda found: [f"{_said(found[1])} {each}" for each in _magnitude(found[2])]),
    (
        rf"({AMOUNT})\s?[x×]\s?({AMOUNT})",
        lambda found: [f"{_said(found[1])} {between} {_said(found[2])}" for between in ("by", "times", "x")],
    ),
    (rf"({AMOUNT})x", lambda found: [f"{_said(found[1])} {each}" for each in ("times", "x")]),
    (
        r"(no\.\s?|#)(\d+)",
        lambda found: [f"{each} {_said(found[2])}" for each in ("number", "no" if found[1][0] in "nN" else "hashtag")],
    ),
    (rf"({AMOUNT})", lambda found: _number(found[1])),
    (r"(?-i:St\. ([A-Z][a-z]+))", lambda found: [f"{each} {found[1].lower()}" for each in ("saint", "street")]),
    (r"st\.", lambda _: ["street", "saint"]),
    (rf"(?-i:({'|'.join(TITLES)})\.)(?=\s+(?-i:[A-Z])|\Z)", _abbreviation),
    (rf"({_ABBREVIATED})\.", _abbreviation),
    (
        rf"(?-i:((?:{_PART})(?= I)|[A-Z][a-z]+(?= (?:[IVX]{{2}}|[VX]))) (X{{0,3}}(?:IX|IV|V?I{{0,3}})))",
        _roman,
    ),
    (r"(?:[a-z]\.){2,}[a-z]?", lambda found: [" ".join(found[0].lower().replace(".", " ").split())]),
    (rf"(?!d-day)(?P<bit>[b-df-hj-np-tv-z]{{1,3}})-(?:(?P=bit)-)*(?=(?P=bit)){WORD}", _stutter),
    (r"(?-i:[A-Z]{2,5}s?)", lambda found: [" ".join(re.sub("(?<!^)S?s$", " s", found[0])).lower(), found[0].lower()]),
)
"""Patterns of forms, without regard of case, and what reads them; the first that matches counts."""


def _magnitude(letters: str) -> list[str]:
    name = MAGNITUDES[letters[0].lower()]
    return [letters.lower(), name] if letters.lower() == "k" else [name, letters[0].lower()]
