"""The analysis of a study: all its figures, with and without screening of raters, and their table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lipmotion.errors import InputError, shorten
from lipmotion.printable import printable
from lipmotion_studio.study.analysis import crossed, paired
from lipmotion_studio.study.answers import ANCHOR, FIRST, MOS, PAIRED, RECORDING, Answer, read_answers

MIN_ATTENTION = 2 / 3  # share of the checks of attention that must be right
MAX_ANCHOR = 0.5  # share of the comparisons with the anchor in which it may be preferred
MIN_CHANCE = 0.01  # a rater whose answers to both orders disagree more than by so small a chance presses the same side
RULES = {
    "attention": f"at least {MIN_ATTENTION:.0%} of the checks of attention right",
    "anchor": f"the anchor rated below the recording (without one: below the mean of the others); preferred in at "
    f"most {MAX_ANCHOR:.0%} of its comparisons",
    "sides": f"not one side whatever is shown: pairs in both orders answered alike not more rarely than by a chance "
    f"of {MIN_CHANCE:.0%}",
}


def select_counting(answers: Sequence[Answer]) -> list[Answer]:
    """Return the answers that count: neither practice nor checks of attention."""
    return [answer for answer in answers if not answer.practice and not answer.expected]


def screen(answers: Sequence[Answer]) -> Figures:
    """Return the rules, how many raters of a study there are and are kept, and which are left out, by what rule."""
    real = [answer for answer in answers if not answer.practice]
    raters = sorted({answer.rater for answer in real})
    judged: dict[str, list[Answer]] = {rater: [] for rater in raters}
    checks: dict[str, list[Answer]] = {rater: [] for rater in raters}
    for answer in real:
        (checks if answer.expected else judged)[answer.rater].append(answer)
    left_out = []
    for rater, mine in judged.items():
        right, shown = sum(each.value == each.expected for each in checks[rater]), len(checks[rater])
        texts = {
            "attention": f"{right} of {shown} right" if right < MIN_ATTENTION * shown else "",
            "anchor": _check_anchor(mine),
            "sides": _check_sides([each for each in mine if each.kind == PAIRED]),
        }
        left_out += [{"rater": rater, "rule": rule, "found": text} for rule, text in texts.items() if text]
    counted = len(raters) - len({row["rater"] for row in left_out})
    return {"rules": dict(RULES), "raters": len(raters), "kept": counted, "left_out": left_out}


def _check_anchor(mine: Sequence[Answer]) -> str:
    compared = [each for each in mine if each.kind == PAIRED and ANCHOR in (each.condition, each.other)]
    chosen = sum((each.condition == ANCHOR) == (each.value == FIRST) for each in compared)
    if chosen > MAX_ANCHOR * len(compared):
        return f"preferred in {chosen} of {len(compared)}"
    rated = [(each.condition, int(each.value)) for each in mine if each.kind == MOS]
    names = {name for name, _ in rated} - {ANCHOR}
    standard = {RECORDING} & names or names
    values = [value for name, value in rated if name in standard]
    low = [value for name, value in rated if name == ANCHOR]
    if low and values and np.mean(low) >= np.mean(values):
        better = RECORDING if standard == {RECORDING} else "others"
        return f"rated {np.mean(low):.2f}, {better} {np.mean(values):.2f}"
    return ""


def _check_sides(mine: Sequence[Answer]) -> str:
    from scipy.special import bdtr

    alike, pairs = paired.compare_orders(paired.tabulate_pairs(mine)).sum(axis=0).tolist()
    if pairs and bdtr(alike, pairs, 0.5) < MIN_CHANCE:
        return f"{alike} of {pairs} pairs answered alike in both orders"
    return ""


MAX_RATERS = 1000  # no search goes beyond
DIFFERENCES = (0.1, 0.2, 0.3, 0.5, 1.0)  # differences of means whose numbers of raters are given
SHARES = (0.55, 0.6, 0.65, 0.7, 0.75)  # preferences whose numbers of raters are given
USUAL_POWER = 0.8
DRAWS, SEED = 1000, 0
MAX_DEGREES = 1e6  # degrees of freedom from which on Student's t is normal
Figures = dict[str, Any]


def compute_power(components: crossed.Components, difference: float, raters: int, sentences: int) -> float:
    """Return the probability that the test of ``estimate_mean`` tells a mean difference from 0, at the 5 % level."""
    from scipy.special import ndtr, stdtrit

    rater, sentence, rest = components.rater / raters, components.sentence / sentences, components.residual
    rest /= raters * sentences
    if rater + sentence + rest <= 0:
        return 1.0 if difference else 1 - crossed.CONFIDENCE
    free = raters - 1, sentences - 1, (raters - 1) * (sentences - 1)
    of_rater, of_sentence, of_rest = np.random.default_rng(SEED).chisquare(free, (DRAWS, 3)).T / np.array(free)[:, None]
    noise = rest * of_rest
    parts = [np.maximum((part + rest) * draw - noise, 0) for part, draw in ((rater, of_rater), (sentence, of_sentence))]
    variance, degrees = crossed.combine_variances(parts[0], parts[1], noise, free)
    limit = stdtrit(np.minimum(degrees, MAX_DEGREES), (1 + crossed.CONFIDENCE) / 2) * np.sqrt(variance)
    truth = np.sqrt(rater + sentence + rest)
    return float((ndtr((difference - limit) / truth) + ndtr((-difference - limit) / truth)).mean())


def count_raters(
    components: crossed.Components, difference: float, sentences: int, power: float = USUAL_POWER
) -> int | None:
    """Return the least number of raters that tells a difference; None: ``MAX_RATERS`` do not, for want of sentences."""
    low, high = 1, 2  # the power grows with the raters; one rater is no panel
    while compute_power(components, difference, high, sentences) < power:
        low, high = high, 2 * high
        if low >= MAX_RATERS:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        reached = compute_power(components, difference, middle, sentences) >= power
        low, high = (low, middle) if reached else (middle, high)
    return high if high <= MAX_RATERS else None


def plan_study(components: crossed.Components | None, kind: str, sentences: int, power: float) -> list[Figures]:
    """Return the raters needed for differences of means, or for preferences.

    components : of ``average_difference_effects``, or of ``average_share_effects``
    """
    rows: list[Figures] = []
    if components is None or sentences < 2:
        return rows
    for share in SHARES if kind == PAIRED else ():
        scaled = crossed.Components(*(share * (1 - share) * np.array(components)).tolist())
        rows.append({"share": share, "raters": count_raters(scaled, share - 0.5, sentences, power)})
    for difference in () if kind == PAIRED else DIFFERENCES:
        rows.append({"difference": difference, "raters": count_raters(components, difference, sentences, power)})
    return rows


def analyse_study(
    answers: Sequence[Answer] | Path | str,
    *,
    baseline: str | None = None,
    power: float = USUAL_POWER,
    sentences: int | None = None,
) -> Figures:
    """Return the figures of a study (docs/study-analysis.md).

    answers   : of ``read_answers``, or the path of their table
    baseline  : condition to which improvement is relative; None: that with the lowest mean
    power     : with which planned studies shall tell a difference
    sentences : of planned studies; None: as many as in this one
    Returns ``screening``; ``screened``, a list of parts without the raters that are left out; and ``all``, with all
    raters. A part is what was asked in one question of one kind. ``screened`` is None if no rater is left.
    Raises InputError: no answer counts; the baseline is not a condition; a value that is not allowed.

    >>> import lipmotion
    >>> from lipmotion_studio.study.answers import Answer
    >>> answers = [
    ...     Answer(rater, "mos", 0, sentence, "overall", condition, "", value, 9.0, 1, False, "")
    ...     for rater in ("r001", "r002")
    ...     for sentence in ("bin blue", "place red")
    ...     for condition, value in (("trajectory", "4"), ("coupled", "2"))
    ... ]
    >>> (part,) = lipmotion.analyse_study(answers)["all"]
    >>> [(row["condition"], row["mean"]) for row in part["conditions"]]
    [('trajectory', 4.0), ('coupled', 2.0)]
    """
    table = read_answers(Path(answers)) if isinstance(answers, str | Path) else list(answers)
    counted = select_counting(table)
    if not counted:
        raise InputError(
            f"{len(table)} answers, none of which counts: required some that are neither practice nor checks"
        )
    conditions = sorted({each.condition for each in counted if each.kind != PAIRED})
    if baseline is not None and baseline not in conditions:
        known = ", ".join(conditions) or "none, for these are no opinion scores; leave --baseline out"
        raise InputError(f"the baseline is {shorten(baseline)!r}, required one of: {known}")
    if not 0.05 < power < 1:
        raise InputError(f"a power of {power:g}, required between 0.05 and 1, such as {USUAL_POWER}")
    if sentences is not None and sentences < 2:
        raise InputError(f"{sentences} sentences of planned studies, required at least 2")
    screening = screen(table)
    left_out = {row["rater"] for row in screening["left_out"]}
    kept = [answer for answer in counted if answer.rater not in left_out]
    plan = (baseline, power, sentences)
    everybody = _list_parts(counted, *plan)
    screened = everybody if len(kept) == len(counted) else _list_parts(kept, *plan)
    return {
        "answers": len(counted),
        "left_aside": len(table) - len(counted),
        "power": power,
        "screening": screening,
        "screened": screened or None,
        "all": everybody,
    }


def _list_parts(answers: Sequence[Answer], baseline: str | None, power: float, sentences: int | None) -> list[Figures]:
    parts = []
    for kind, question in dict.fromkeys((each.kind, each.question) for each in answers):
        mine = [each for each in answers if (each.kind, each.question) == (kind, question)]
        part: Figures = {"kind": kind, "question": question, "answers": len(mine)}
        part |= {"raters": len({each.rater for each in mine}), "sentences": len({each.sentence for each in mine})}
        parts.append(part)
        if kind == PAIRED:
            compared = [each for each in mine if ANCHOR not in (each.condition, each.other)]  # the others only screen
            if not compared:
                part["missing"] = "all comparisons are with the anchor"
                continue
            pairs = paired.tabulate_pairs(compared)
            components, planned = paired.average_share_effects(pairs), sentences or len(pairs.sentences)
            part |= paired.analyse_pairs(pairs)
        else:
            ratings = crossed.tabulate_ratings(mine)
            components, planned = crossed.average_difference_effects(ratings), sentences or ratings.values.shape[2]
            part |= crossed.analyse_ratings(ratings, baseline)
        part |= {"variance": components._asdict() if components else None, "planned_sentences": planned}
        part["raters_needed"] = plan_study(components, kind, planned, power)
    return parts


NO_FIGURE = "–"


def format_analysis(figures: Figures) -> str:
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
        lines += (_format_pairs if part["kind"] == PAIRED else _format_ratings)(part, unscreened)
        if part.get("raters_needed"):
            needed = []
            for row in part["raters_needed"]:
                size = f"{row['share']:.0%}" if "share" in row else f"{row['difference']:g}"
                needed.append(f"{size}: {row['raters'] or 'more sentences'}")
            what = "a preference" if part["kind"] == PAIRED else "a difference"
            planned = f"{part['planned_sentences']} sentences, power {figures['power']:.0%}"
            lines.append(f"  raters to tell {what} ({planned}): {', '.join(needed)}")
    return "\n".join(map(printable, lines))


def _format_ratings(part: Figures, everybody: Figures | None) -> list[str]:
    before = {row["condition"]: row["mean"] for row in everybody["conditions"]} if everybody else {}
    relative = {row["condition"]: row for row in part["relative_improvement"]}
    rows = [
        [
            "condition",
            "mean",
            "95 %",
            "deviation",
            f"% over {part['baseline']}",
            "95 %",
            *(["all raters"] if before else []),
        ]
    ]
    for row in part["conditions"]:
        better = relative.get(row["condition"], {"percent": None, "low": None, "high": None})
        mean = [row["condition"], _show(row["mean"], ".2f"), _show_ci(row, ".2f"), _show(row["deviation"], ".2f")]
        gain = [_show(better["percent"], "+.1f"), _show_ci(better, "+.1f")]
        rows.append([*mean, *gain, *([_show(before.get(row["condition"]), ".2f")] if before else [])])
    pairs = [["pair", "difference", "95 %", "p", "p (Holm)"]]
    for row in part["pairs"]:
        name, difference = f"{row['condition']} - {row['other']}", _show(row["difference"], "+.2f")
        pairs.append([name, difference, _show_ci(row, "+.2f"), _show_p(row["p"]), _show_p(row["p_holm"])])
    return [*_align(rows), *_format_scope(part["conditions"]), *_align(pairs)]


def _format_pairs(part: Figures, everybody: Figures | None) -> list[str]:
    """Return how often each condition was preferred, the pairs, the strengths, and the effect of the order."""
    if "missing" in part:
        return [f"  {part['missing']}"]
    before = {(row["condition"], row["other"]): row["share"] for row in everybody.get("pairs", ())} if everybody else {}
    scores = [["condition", "preferred", "share", "95 %"]]
    scores += [
        [row["condition"], f"{row['wins']} of {row['answers']}", _show(row["share"], ".1%"), _show_ci(row, ".1%")]
        for row in part["conditions"]
    ]
    pairs = [
        ["pair", "preferred", "share", "95 %", "p", "p (Holm)", "p (binomial)", *(["all raters"] if before else [])]
    ]
    for row in part["pairs"]:
        name = f"{row['condition']} over {row['other']}"
        share = [f"{row['wins']} of {row['answers']}", _show(row["share"], ".1%"), _show_ci(row, ".1%")]
        tests = [_show_p(row[key]) for key in ("p", "p_holm", "p_binomial")]
        all_raters = [_show(before.get((row["condition"], row["other"])), ".1%")] if before else []
        pairs.append([name, *share, *tests, *all_raters])
    first, both = part["first_preferred"], part["consistency"]
    orders = f"  the first was preferred in {_show(first['share'], '.1%')} ({_show_ci(first, '.1%')}); "
    orders += f"{both['consistent']} of {both['pairs']} pairs in both orders alike ({_show(both['share'], '.1%')})"
    lines = [*_align(scores), *_align(pairs), *_format_scope(part["pairs"]), orders]
    model = part["bradley_terry"]
    if "missing" in model:
        return [*lines, f"  no Bradley–Terry strengths: {model['missing']}"]
    rows = [["Bradley–Terry", "log odds", "95 %"]]
    rows += [[row["condition"], _show(row["strength"], "+.2f"), _show_ci(row, "+.2f")] for row in model["conditions"]]
    rows.append(["shown first", _show(model["order"]["strength"], "+.2f"), _show_ci(model["order"], "+.2f")])
    lines += _align(rows)
    if model["is_shrunk"]:
        lines.append("  a strength would be infinite: half a win was given to both sides of each comparison")
    return lines


def _format_scope(rows: Sequence[Figures]) -> list[str]:
    """Return what the intervals are over, where it is not raters and sentences."""
    scopes = sorted({row["over"] for row in rows} - {crossed.BOTH})
    limited = [row for row in rows if row["over"] in scopes]
    named = [f"{row['condition']}–{row['other']}" if "other" in row else row["condition"] for row in limited]
    return [f"  intervals over {' / '.join(scopes)} only: {', '.join(named)}"] if scopes else []


def _align(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows in columns, the first to the left, the others to the right; no line for a head alone."""
    if len(rows) < 2:
        return []
    first, *sizes = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join([f"  {row[0]:{first}}", *map(str.rjust, row[1:], sizes)]) for row in rows]


def _show_p(p: float | None) -> str:
    return "<0.001" if p is not None and p < 0.001 else _show(p, ".3f")


def _show_ci(row: Figures, form: str) -> str:
    low, high = _show(row["low"], form), _show(row["high"], form)
    return low if low == NO_FIGURE else f"{low} to {high}"


def _show(value: float | None, form: str) -> str:
    return NO_FIGURE if value is None or np.isnan(value) else format(value, form)
