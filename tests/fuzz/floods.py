"""Inputs that once showed defects and are too large to be stored: long repetitions."""

import json
from collections.abc import Callable

from fuzz.character_floods import CHARACTER_FLOODS
from fuzz.inputs import Files
from robustness.motion_cases import GOOD

TIER = b'"ooTextFile"\n"TextGrid"\n0\n2\n<exists>\n1\n"%s"\n"a"\n0\n2\n1\n0\n2\n"x"\n'


def _units(count: int) -> Files:
    """Return a document of so many phones, a millisecond each."""
    units = [{"start_s": n / 1000, "end_s": (n + 1) / 1000, "phone": "p", "unit": ""} for n in range(count)]
    return {"a.json": json.dumps(GOOD | {"units": units}).encode()}


def _drawing(inside: str) -> Files:
    return {"face.svg": f'<svg viewBox="0 0 9 9">{inside}<g id="mouth-rest"><path d="M0 0h1z"/></g></svg>'.encode()}


FLOODS: dict[tuple[str, str], Callable[[], Files]] = {
    ("transcript", "digits"): lambda: {"said.txt": b"9" * 20_000_000},
    ("transcript", "numbers"): lambda: {"said.txt": b"9," * 1_500_000},
    ("transcript", "short words"): lambda: {"said.txt": b"a " * 15_000_000},
    ("transcript", "phones"): lambda: {"said.txt": b"Mama. Papa?\np " + b"p " * 1_500_000},
    ("transcript", "a long word"): lambda: {"said.txt": b"ma" * 30_000_000},
    ("lexicon", "lines"): lambda: {"words.dict": b"".join(b"w%d M AA1\n" % n for n in range(40_000))},
    ("lexicon", "pronunciations of one word"): lambda: {"words.dict": b"baby B EY1 B IY0\n" * 40_000},
    ("lexicon", "phones of one word"): lambda: {"words.dict": b"baby" + b" B" * 1_000_000},
    ("lexicon", "a phone of many letters"): lambda: {"words.dict": b"baby " + b"p," * 10_000},
    ("drawing", "letters of a transform"): lambda: _drawing(f'<g transform="{"a" * 2_000_000}"/>'),
    ("drawing", "document types"): lambda: {"face.svg": b"<!DOCTYPE svg [" * 300_000},
    ("drawing", "arcs of many paths"): lambda: _drawing(f'<path d="M0 0{"a1 1 0 0 1 1 1" * 24_000}"/>' * 20),
    ("drawing", "points of one path"): lambda: _drawing(f'<path stroke="red" d="M0 0{"h1" * 399_000}"/>'),
    ("drawing", "subpaths over the picture"): lambda: _drawing(f'<path d="{"M0 0L9 9L9 0z" * 90_000}"/>'),
    ("drawing", "wide lines"): lambda: _drawing(f'<path stroke="red" stroke-width="99" d="M0 0{"h1" * 99_000}"/>'),
    ("units", "units"): lambda: _units(60_000),
    ("labels", "a word time of many letters"): lambda: {"grid.align": b"0 1 sil\n" + b"9," * 100_000},
    ("labels", "a tier's kind of many letters"): lambda: {"a.TextGrid": TIER % (b"9" * 100_000)},
    **{("character", name): made for name, made in CHARACTER_FLOODS.items()},
}
"""By reader and name."""
