"""Pages of HTML that need no network: elements that escape what they hold, in light and dark."""

from __future__ import annotations

import re
from html import escape

from lipmotion.pipeline.batch.report import insert_colours
from lipmotion.printable import printable

VOID = frozenset({"br", "img", "link", "meta"})  # elements that hold nothing and have no end
SIMPLE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9-]*")
GENERATOR = '<meta name="generator" content="lipmotion">'  # what pages of this program hold


class Html(str):
    """Text that is HTML already. Every other text is escaped where it becomes part of an element."""

    __slots__ = ()


def element(name: str, *content: str, **attributes: str | bool | None) -> Html:
    """Return an element.

    content    : ``Html`` as it is; other texts are escaped, and what is invisible in them is shown (``printable``)
    attributes : ``class_`` is ``class``, ``aria_label`` is ``aria-label``; True: the name alone; False, None: left out
    Raises ValueError: no name of an element or an attribute.
    """
    words = [_simple(name)]
    for key, value in attributes.items():
        if value is not None and value is not False:
            attribute = _simple(key.rstrip("_").replace("_", "-"))
            words.append(attribute if value is True else f'{attribute}="{escape(printable(value))}"')
    start = f"<{' '.join(words)}>"
    return Html(start if name in VOID else f"{start}{joined(*content)}</{name}>")


def joined(*content: str) -> Html:
    """Return some content one after another, escaped as in ``element``."""
    return Html("".join(text if isinstance(text, Html) else escape(printable(text)) for text in content))


def build_page(title: str, style: str, *content: str) -> str:
    """Return a page that loads nothing but the pictures and videos in its own folder.

    style  : CSS, with ``SHARED_COLOURS`` in the place of the colours of all pages, without the end of its element: the
             caller's own, nothing of a user's
    """
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' file:; media-src 'self' file:"
    head = joined(
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content_=policy),
        element("meta", name_="viewport", content_="width=device-width, initial-scale=1"),
        Html(GENERATOR),
        element("title", title),
        Html(f"<style>\n{insert_colours(style)}</style>"),
    )
    body = element("body", *content)
    return f'<!DOCTYPE html>\n<html lang="en">\n{element("head", head)}\n{body}\n</html>\n'


def _simple(name: str) -> str:
    if not SIMPLE_NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name of an element or an attribute")
    return name


def add_caption(content: Html, caption: str) -> Html:
    """Return a figure with its caption."""
    return element("figure", content, element("figcaption", caption))
