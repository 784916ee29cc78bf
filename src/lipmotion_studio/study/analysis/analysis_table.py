"""The figures of a study as text tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.printable import printable
from lipmotion_studio.study.analysis.crossed import BOTH
from lipmotion_studio.study.answers import PAIRED

Figures = Mapping[str, Any]
NO_FIGURE = "–"


def analysis_table(figures: Figures) -> str:
    """Return the figures of ``analyse_study`` as text."""
    lines = [f"{figures['answers']} answers count; {figures['left_aside']} of practice and attention do not"]
    screening = figures["screening"]
    lines += [f"screening: {screening['kept']} of {screening['raters']} raters kept; required of each:"]
    lines += [f"  {name}: {rule}" for name, rule in screening["rules"].items()]
    lines += [f"  left out: {row['rater']} ({row['rule']}: {row['found']})" for row in screening["left_out"]]
    parts = figures["screened"]
    if parts is None:
        lines += ["", "no rater is left after screening: figures of all raters"]
    shown = figures["all"] if parts is None else parts
    others = {(part["kind"], part["question"]): part for part in figures["all"]}
    for part in shown:
        everybody = others[part["kind"], part["question"]]
        title = f"{part['kind']}, {part['question']}: {part['answers']} answers, {part['raters']} raters, "
        lines += ["", f"{title}{part['sentences']} sentences"]
        unscreened = everybody if everybody["raters"] > part["raters"] else None
        lines += (_paired_lines if part["kind"] == PAIRED else _rating_lines)(part, unscreened)
        if part.get("raters_needed"):
            needed = []
            for row in part["raters_needed"]:
                size = f"{row['share']:.0%}" if "share" in row else f"{row['difference']:g}"
                needed.append(f"{size}: {row['raters'] or 'more sentences'}")
            what = "a preference" if part["kind"] == PAIRED else "a difference"
            planned = f"{part['planned_sentences']} sentences, power {figures['power']:.0%}"
            lines.append(f"  raters to tell {what} ({planned}): {', '.join(needed)}")
    return "\n".join(map(printable, lines))


def _rating_lines(part: Figures, everybody: Figures | None) -> list[str]:
    """Return the means, the improvement over the baseline and the differences of all pairs."""
    before = {row["condition"]: row["mean"] for row in everybody["conditions"]} if everybody else {}
    relative = {row["condition"]: row for row in part["relative_improvement"]}
    rows = [["condition", "mean", "95 %", "deviation", f"% over {part['baseline']}", "95 %", "all raters"]]
    for row in part["conditions"]:
        better = relative.get(row["condition"], {"percent": None, "low": None, "high": None})
        mean = [row["condition"], _number(row["mean"], ".2f"), _limits(row, ".2f"), _number(row["deviation"], ".2f")]
        gain = [_number(better["percent"], "+.1f"), _limits(better, "+.1f")]
        rows.append([*mean, *gain, _number(before.get(row["condition"]), ".2f")])
    pairs = [["pair", "difference", "95 %", "p", "p (Holm)"]]
    pairs += [
        [f"{row['condition']} - {row['other']}", _number(row["difference"], "+.2f"), _limits(row, "+.2f"), *_tests(row)]
        for row in part["pairs"]
    ]
    return [*_align(_without_last(rows, bool(before))), *_scope_lines(part["conditions"]), *_align(pairs)]


def _paired_lines(part: Figures, everybody: Figures | None) -> list[str]:
    """Return how often each condition was preferred, the pairs, the strengths, and the effect of the order."""
    if "missing" in part:
        return [f"  {part['missing']}"]
    before = {(row["condition"], row["other"]): row["share"] for row in everybody.get("pairs", ())} if everybody else {}
    scores = [["condition", "preferred", "share", "95 %"]]
    scores += [
        [row["condition"], f"{row['wins']} of {row['answers']}", _number(row["share"], ".1%"), _limits(row, ".1%")]
        for row in part["conditions"]
    ]
    pairs = [["pair", "preferred", "share", "95 %", "p", "p (Holm)", "p (binomial)", "all raters"]]
    for row in part["pairs"]:
        name = f"{row['condition']} over {row['other']}"
        share = [f"{row['wins']} of {row['answers']}", _number(row["share"], ".1%"), _limits(row, ".1%")]
        all_raters = _number(before.get((row["condition"], row["other"])), ".1%")
        pairs.append([name, *share, *_tests(row), _p_text(row["p_binomial"]), all_raters])
    first, both = part["first_preferred"], part["consistency"]
    orders = f"  the first was preferred in {_number(first['share'], '.1%')} ({_limits(first, '.1%')}); "
    orders += f"{both['consistent']} of {both['pairs']} pairs in both orders alike ({_number(both['share'], '.1%')})"
    lines = [*_align(scores), *_align(_without_last(pairs, bool(before))), *_scope_lines(part["pairs"]), orders]
    model = part["bradley_terry"]
    if "missing" in model:
        return [*lines, f"  no Bradley–Terry strengths: {model['missing']}"]
    rows = [["Bradley–Terry", "log odds", "95 %"]]
    rows += [[row["condition"], _number(row["strength"], "+.2f"), _limits(row, "+.2f")] for row in model["conditions"]]
    rows.append(["shown first", _number(model["order"]["strength"], "+.2f"), _limits(model["order"], "+.2f")])
    lines += _align(rows)
    if model["is_shrunk"]:
        lines.append("  a strength would be infinite: half a win was given to both sides of each comparison")
    return lines


def _scope_lines(rows: Sequence[Figures]) -> list[str]:
    """Return what the intervals are over, where it is not raters and sentences."""
    scopes = sorted({row["over"] for row in rows} - {BOTH})
    found = [row for row in rows if row["over"] in scopes]
    named = [f"{row['condition']}–{row['other']}" if "other" in row else row["condition"] for row in found]
    return [f"  intervals over {' / '.join(scopes)} only: {', '.join(named)}"] if scopes else []


def _without_last(rows: list[list[str]], is_kept: bool) -> list[list[str]]:
    return rows if is_kept else [row[:-1] for row in rows]


def _align(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows in columns, the first to the left, the others to the right; no line for a head alone."""
    if len(rows) < 2:
        return []
    sizes = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  "
        + "  ".join(
            [f"{row[0]:{sizes[0]}}", *(f"{cell:>{size}}" for cell, size in zip(row[1:], sizes[1:], strict=True))]
        )
        for row in rows
    ]


def _tests(row: Figures) -> list[str]:
    return [_p_text(row["p"]), _p_text(row["p_holm"])]


def _p_text(p: float | None) -> str:
    return "<0.001" if p is not None and p < 0.001 else _number(p, ".3f")


def _limits(row: Figures, form: str) -> str:
    if _is_missing(row["low"]):
        return NO_FIGURE
    return f"{row['low']:{form}} to {row['high']:{form}}"


def _number(value: float | None, form: str) -> str:
    return NO_FIGURE if value is None or _is_missing(value) else format(value, form)


def _is_missing(value: float | None) -> bool:
    return value is None or value != value  # noqa: PLR0124 - NaN
