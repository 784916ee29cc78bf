"""The page of a report: what was found first, then every experiment with its words, charts, tables and videos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from lipmotion.formats.web_page import Html, element, joined, whole_page
from lipmotion_lab.report.section import Section
from lipmotion_lab.report.shown_clip import draw_curves

SCRIPT = """"use strict";
for (const button of document.querySelectorAll("button.together")) {
  const videos = button.parentElement.querySelectorAll("video");
  button.hidden = false;
  button.addEventListener("click", () => videos.forEach((video, number) => {
    video.muted = number > 0;
    video.currentTime = 0;
    video.play();
  }));
}
"""
FOLDED = 3
"""More tables than these are folded together."""
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
    """An experiment whose figures are there.

    motion : of one clip, as ``shown_clip.ClipKeeper`` keeps it; empty: none was kept
    """

    name: str
    record: Mapping[str, Any]
    motion: Mapping[str, Any]
    section: Section


def report_html(
    title: str,
    about: Mapping[str, str],
    finished: Sequence[FinishedPart],
    left_open: Mapping[str, str],
    failed: Mapping[str, str],
    *,
    quick: bool,
) -> str:
    """Return the page of a report.

    left_open, failed : names of those that are not finished, or failed, with the reasons
    """
    style = resources.files(__package__).joinpath("report.css").read_text("utf-8")
    subtitle = "How the systems of three papers, and those of this project, do on a corpus."
    header = element("header", element("h1", title), element("p", subtitle, class_="quiet"))
    entries = [
        element("li", element("strong", element("a", each.section.title, href=f"#{each.name}")), each.section.verdict)
        for each in finished
    ]
    for reasons, look in ((failed, "failed"), (left_open, None)):
        entries += [element("li", element("strong", name), why, class_=look) for name, why in reasons.items()]
    warning = [element("p", QUICK_WARNING, class_="warning")] if quick else []
    overview = element("ul", *entries, class_="overview")
    main = element("main", *warning, overview, element("p", HOW_TO_READ, class_="quiet"), *map(_section, finished))
    footer = element("footer", element("h2", "The corpus and the run"), _listed(about))
    return whole_page(title, style, header, main, footer, script=SCRIPT)


def _section(part: FinishedPart) -> Html:
    section, heading = part.section, f"{part.name}-heading"
    words = [
        joined(element("h3", title), element("ul", *(element("li", sentence) for sentence in sentences)))
        for title, sentences in section.words.items()
        if sentences
    ]
    more = [
        element("details", element("summary", sentence), table.as_html(part.name)) for sentence, table in section.more
    ]
    if len(more) > FOLDED:
        more = [element("details", element("summary", f"{len(more)} more tables"), *more)]
    pictures = [
        element(
            "figure",
            element("img", src=f"{part.name}/{picture['file']}", alt=picture["caption"], loading="lazy"),
            element("figcaption", picture["caption"]),
        )
        for picture in part.record["pictures"]
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
        element("div", element("div", *words), element("div", *section.charts), class_="beside"),
        section.table.as_html(part.name),
        *more,
        *_clip(part),
        *(
            [element("h3", "Pictures like the paper's"), element("div", *pictures, class_="pictures")]
            if pictures
            else []
        ),
        element(
            "details",
            element("summary", "How this was made"),
            _listed(made_with),
            element(
                "p", "Beside this page: ", element("a", "all figures as JSON", href=f"{part.name}/figures.json"), "."
            ),
        ),
        id=part.name,
        aria_labelledby=heading,
    )


def _clip(part: FinishedPart) -> list[Html]:
    """Return the recording that is shown: its videos and its curves."""
    if not part.motion:
        return []
    name, words = part.motion["name"], " ".join(part.motion["words"])
    videos = [
        element(
            "figure",
            element(
                "video",
                src=f"{part.name}/{video['file']}",
                controls=True,
                preload="metadata",
                playsinline=True,
                aria_label=f"{name}: {video['caption']}",
            ),
            element("figcaption", video["caption"]),
        )
        for video in part.record["videos"]
    ]
    together = element("button", "Play all together", type="button", class_="together", hidden=True)
    said = f", “{words}”" if words else ""
    return [
        element("h3", "One recording, seen and heard"),
        element(
            "p",
            f"{name}{said}: of the compared recordings the one with most p, b and m, whatever the systems make of it. "
            "Sound alone was given.",
            class_="quiet",
        ),
        element("div", together, element("div", *videos, class_="videos"), class_="clip"),
        element("h3", "Its opening of the mouth"),
        element("p", "Dashed: recorded, in eye distances; line: generated; shaded: p, b and m.", class_="quiet"),
        element("div", *draw_curves(part.motion, part.section.shown), class_="grid"),
    ]


def _listed(entries: Mapping[str, str]) -> Html:
    """Return texts by name, one a line."""
    return element("dl", *(joined(element("dt", key), element("dd", text)) for key, text in entries.items()))
