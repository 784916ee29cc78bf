"""Mutations of XML: its elements, attributes, values, declarations and nesting."""

import gzip
import re
from random import Random

from fuzz.mutators import raw
from fuzz.mutators.text import NUMBERS, POWERS

_TAG = r"<[^<>]*>"
_NAME = r"[\w:-]+(?==)"
_VALUE = r'(?<==")[^"]*'
PROLOGUES = (
    *('<?xml version="1.0" encoding="UTF-7"?>', '<?xml version="1.0" encoding="UTF-16"?>', "<?xml version='9'?>"),
    *('<?xml version="1.0" encoding="cp037"?>', '<?xml version="1.0" encoding="iso-8859-1"?>', "\ufeff", "\ufeff" * 2),
    *("<!DOCTYPE svg>", '<!DOCTYPE svg SYSTEM "file:///etc/passwd">', '<!DOCTYPE svg [<!ENTITY a "b">]>', "<!DOCTYPE"),
    *('<!DOCTYPE svg [<!ENTITY % p SYSTEM "p">%p;]>', '<!DOCTYPE svg [<!ATTLIST rect fill CDATA "red">]>', "<!--"),
    *('<?xml-stylesheet href="http://h/s.css"?>', "<![CDATA[", "]]>", "\x00", "<!ENTITY a 'b'>", "<?a?>"),
)
ELEMENTS = (
    *('<use href="#a"/>', '<image href="data:image/png;base64,AAAA"/>', "<style>*{fill:url(a)}</style>"),
    *("<g/>", "<title>"),
    *("<script>x</script>", "<text>a</text>", "<!-- -- -->", "&a;", "&#0;", "&#x10ffff;", "&#xd800;", "&lt;", "]]>"),
    *('<g id="mouth-x"><rect width="1" height="1"/></g>', '<rect width="-1" height="1e6"/>', "<defs><g/></defs>"),
    *('<svg viewBox="0 0 1 1"/>', '<path d="M0 0A1 1 0 011 1z"/>', '<circle r="1e6"/>', "<metadata>", "</g>", "</svg>"),
)
VALUES = (
    *("", "nan", "1e999", "1e6", "-1e6", "1e-400", "1_0", "٣", "50%", "1px", "1em", "url(#a)", "inherit", "none"),
    *("#fff", "#ffff", "rgb(999,-1,0)", "hsl(1e9,1%,1%)", "currentColor", "red !important", "var(--a)", "0 0 0 0"),
    *("scale(0)", "scale(1e6)", "matrix(1 2 3 4 5)", "rotate(1 2)", "skewX(90)", "translate()", "scale(1))", "a(1)"),
    *(
        "M0 0", "M0 0z1", "M1e6 1e6L-1e6-1e6", "m1 1a0 0 0 000 0", "M0 0A1e6 1e-9 9 1 0 1 1", "M0,0,,1",
        "0 0 1e-300 1", "\x00", "inf",
    ),
    *("javascript:x()", "&a;", "&#x9;", "mouth-", "mouth-aa", "head", "pupils", "fill:red;fill:", "a:b:c;;", "evenodd"),
)  # fmt: skip
NAMES = (
    *("id", "d", "points", "transform", "style", "fill", "stroke", "stroke-width", "opacity", "viewBox", "width", "rx"),
    *("href", "xlink:href", "xmlns", "xmlns:a", "onload", "inkscape:label", "a:b:c", "fill-opacity", "fill-rule", "="),
)


def change(chance: Random, content: bytes) -> bytes:
    """Change an XML text, or how it is encoded or packed."""
    text = content.decode("utf-8", "surrogateescape")
    ways = (_prologue, _element, _value, _value, _value, _number, _name, _nest, _flood, _copy, _coding)
    changed = chance.choice(ways)(chance, text)
    return changed if isinstance(changed, bytes) else changed.encode("utf-8", "surrogateescape")


def _place(chance: Random, pattern: str, text: str) -> tuple[int, int]:
    found = [match.span() for match in re.finditer(pattern, text[:100_000])]
    return chance.choice(found or [(len(text), len(text))])


def _put(text: str, span: tuple[int, int], new: str) -> str:
    return text[: span[0]] + new + text[span[1] :]


def _prologue(chance: Random, text: str) -> str:
    many = 10 ** chance.choice((0, 0, 0, 0, 2, 4))
    return (chance.choice(PROLOGUES) * many)[: raw.LARGEST_BYTES // 2] + text


def _element(chance: Random, text: str) -> str:
    _, end = _place(chance, _TAG, text)
    return _put(text, (end, end), chance.choice(ELEMENTS) * chance.choice((1, 1, 1, 1000)))


def _value(chance: Random, text: str) -> str:
    span = _place(chance, _VALUE, text)
    old = text[slice(*span)]
    return _put(text, span, chance.choice((chance.choice(VALUES), old + chance.choice(VALUES), old * 2, old[::-1])))


def _number(chance: Random, text: str) -> str:
    return _put(text, _place(chance, r"-?\d+(?:\.\d*)?", text), chance.choice(NUMBERS))


def _name(chance: Random, text: str) -> str:
    pattern = chance.choice((_NAME, r"(?<=<)[\w:]+"))
    return _put(text, _place(chance, pattern, text), chance.choice(NAMES))


def _nest(chance: Random, text: str) -> str:
    """Put an element into many."""
    start, end = _place(chance, _TAG, text)
    name, depth = chance.choice(("g", "svg", "metadata", "a", "path")), 10 ** chance.choice(POWERS)
    return _put(text, (start, end), f"<{name}>" * depth + text[start:end] + f"</{name}>" * depth)


def _flood(chance: Random, text: str) -> str:
    """Repeat a value, or a part of one, very often within it."""
    start, end = _place(chance, _VALUE, text)
    one = chance.choice(
        (text[start:end], "a", "(", ")", "9", ".", " ", ",", "-", "M", "z", "h1", "a1 1 0 0 1 1 1", ";")
    )
    many = min(10 ** chance.choice(POWERS), raw.LARGEST_BYTES // 2 // max(len(one), 1))
    at = chance.choice((start, end))
    return text[:at] + one * many + text[at:]


def _copy(chance: Random, text: str) -> str:
    """Copy an element to another place."""
    element = text[slice(*_place(chance, _TAG, text))] * chance.choice((1, 2, 50, 3000))
    _, end = _place(chance, _TAG, text)
    return _put(text, (end, end), element)


def _coding(chance: Random, text: str) -> bytes:
    coding = chance.choice(("utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig", "utf-7", "cp037", "gzip"))
    if coding == "gzip":
        return gzip.compress(text.encode("utf-8", "replace"), mtime=0)
    return text.encode(coding, "replace")
