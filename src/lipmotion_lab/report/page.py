"""The page of a report: what was found first, then every experiment with its words, tables and pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.motion.eigenlips import MOUTH_HEIGHT, MOUTH_WIDTH
from lipmotion.types import Channel, Motion, Timeline, Unit
from lipmotion_faces import Staging, stage_face
from lipmotion_lab.report.html import Html, add_caption, build_page, element, joined
from lipmotion_lab.report.section import Section

FPS = 25.0
STAGING = Staging(size=640, blinks=False, gaze=False, brows=False, head=False)
"""Only the mouth moves, so that nothing else differs between systems."""
LOWER_FACE = (slice(340, 340 + 4 * MOUTH_HEIGHT), slice(176, 176 + 4 * MOUTH_WIDTH))
"""The part of the drawn picture that is shown."""


def draw_mouths(
    values: NDArray[np.float64], channels: Sequence[str], silence: Timeline[Unit]
) -> Iterator[NDArray[np.uint8]]:
    """Yield pictures of a drawn face's mouth, ``FPS`` a second, for values of some channels [shape=(T, P)]."""
    motion = Motion(values, FPS, tuple(map(Channel, channels)))
    return (picture[LOWER_FACE] for picture in stage_face("woman", STAGING).render(motion, silence, fps=FPS))


FOLDED = 3  # more tables than these are folded together
QUICK_WARNING = (
    "A quick run: few recordings, small models. It shows that everything runs; what it finds about the papers is worth "
    "little. Run it without --quick for figures."
)
HOW_TO_READ = (
    "How to read it: intervals are 95 % bootstrap intervals over the compared recordings; two systems are compared by "
    "the interval of their difference on the same draws of recordings. A pair of the paper holds where that interval "
    "is on the paper's side of 0, is reversed on the other side, open where 0 is in it. The papers used other speakers "
    "and other measures: orders compare, values do not. Every sentence here follows from the figures below it."
)


@dataclass(frozen=True)
class FinishedPart:
    """An experiment whose figures are there."""

    name: str
    record: Mapping[str, Any]
    section: Section


def write_html(  # noqa: PLR0913
    title: str,
    about: Mapping[str, str],
    finished: Sequence[FinishedPart],
    left_open: Mapping[str, str],
    failed: Mapping[str, str],
    *,
    subtitle: str = "How the systems of three papers, and those of this project, do on a corpus.",
    how_to_read: str = HOW_TO_READ,
    quick: bool = False,
) -> str:
    """Return the page of a report; ``left_open`` and ``failed``: reasons by experiment."""
    style = resources.files(__package__).joinpath("report.css").read_text("utf-8")
    header = element("header", element("h1", title), element("p", subtitle, class_="quiet"))
    entries = [
        element("li", element("strong", element("a", each.section.title, href=f"#{each.name}")), each.section.verdict)
        for each in finished
    ]
    for reasons, look in ((failed, "failed"), (left_open, None)):
        entries += [element("li", element("strong", name), why, class_=look) for name, why in reasons.items()]
    warning = [element("p", QUICK_WARNING, class_="warning")] if quick else []
    overview = element("ul", *entries, class_="overview")
    main = element("main", *warning, overview, element("p", how_to_read, class_="quiet"), *map(_write_part, finished))
    footer = element("footer", element("h2", "The corpus and the run"), _list(about))
    return build_page(title, style, header, main, footer)


def _write_part(part: FinishedPart) -> Html:
    section, heading = part.section, f"{part.name}-heading"
    words = [
        joined(element("h3", title), element("ul", *(element("li", sentence) for sentence in sentences)))
        for title, sentences in section.words.items()
        if sentences
    ]
    more = [
        element("details", element("summary", table.heading or table.caption), table.as_html(part.name))
        for table in section.more
    ]
    if len(more) > FOLDED:
        more = [element("details", element("summary", f"{len(more)} more tables"), *more)]
    pictures = [
        add_caption(
            element("img", src=f"{part.name}/{each['file']}", alt=each["caption"], loading="lazy"), each["caption"]
        )
        for each in part.record["pictures"]
    ]
    made_with = {
        key: ", ".join(f"{name} {value}" for name, value in content.items() if value is not None)
        if isinstance(content, Mapping)
        else str(content)
        for key, content in part.record["stamp"].items()
        if content is not None
    }
    return element(
        "section",
        element("h2", section.title, id=heading),
        element("p", section.about, class_="quiet"),
        element("p", section.verdict, class_="verdict"),
        *words,
        section.table.as_html(part.name),
        *more,
        *([element("h3", "Pictures"), element("div", *pictures, class_="pictures")] if pictures else []),
        element(
            "details",
            element("summary", "How this was made"),
            _list(made_with),
            element(
                "p", "Beside this page: ", element("a", "all figures as JSON", href=f"{part.name}/figures.json"), "."
            ),
        ),
        id=part.name,
        aria_labelledby=heading,
    )


def _list(entries: Mapping[str, str]) -> Html:
    return element("dl", *(joined(element("dt", key), element("dd", text)) for key, text in entries.items()))
