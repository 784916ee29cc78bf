"""How often the 95 % intervals of ``lipmotion study analyse`` cover the truth, in simulated studies.

Raters and sentences have known effects, on all conditions alike and on each; opinion scores are whole numbers from 1 to
5. The truth is what infinitely many raters would answer on infinitely many sentences. Beside our intervals stand others
of the same studies: of answers taken for independent, by Satterthwaite without our deviation, and by the bootstrap of
raters and sentences (percentiles; BCa, its acceleration by the jackknife over raters and sentences).

    python benchmarks/study_coverage.py -o coverage.json
    python benchmarks/study_coverage.py --parts power
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri, stdtrit

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from lipmotion_studio.study.analysis import crossed
from lipmotion_studio.study.analysis.analyse import compute_power, count_raters
from lipmotion_studio.study.analysis.crossed import Components, Interval, analyse_ratings
from lipmotion_studio.study.analysis.paired import analyse_pairs, fit_strengths
from study.simulated import Effects, comparisons, expected_preference, expected_rating, ratings

Array = NDArray[np.float64]
SIZES = [(raters, sentences) for sentences in (6, 20) for raters in (10, 20, 40)]
MEANS = np.array([3.1, 3.9, 4.7])
STRENGTHS, ORDER = np.array([-0.6, -0.2, 0.8]), 0.15
RATING_EFFECTS = {
    "usual": Effects(),
    "alike": Effects(rater=0.5, sentence=0.3, rater_each=0.0, sentence_each=0.0),
    "sentences differ": Effects(rater=0.3, sentence=0.5, rater_each=0.2, sentence_each=0.5),
    "raters differ": Effects(rater=0.7, sentence=0.1, rater_each=0.5, sentence_each=0.1),
}
"""Standard deviations; "alike": no rater and no sentence prefers a condition more than others do."""
PAIRED_EFFECTS = {
    "usual": Effects(rater_each=0.4, sentence_each=0.3),
    "alike": Effects(rater_each=0.0, sentence_each=0.0),
    "sentences differ": Effects(rater_each=0.2, sentence_each=0.6),
    "raters differ": Effects(rater_each=0.7, sentence_each=0.1),
}
DRAWS = 500


class Found(NamedTuple):
    """One interval of a study, and the truth."""

    name: str
    interval: Interval
    truth: float


def independent(values: Array, _: Any) -> Interval:
    """Return the interval of answers taken for independent."""
    half = 1.96 * values.std(ddof=1) / np.sqrt(values.size)
    return Interval(values.mean() - half, values.mean() + half)


def satterthwaite(values: Array, _: Any) -> Interval:
    """Return the plain interval: variances may be below 0, and all mean squares leave their degrees of freedom."""
    (R, S), mean = values.shape, values.mean()
    a = values.mean(axis=1).var(ddof=1) / R
    b = values.mean(axis=0).var(ddof=1) / S
    rest = values - values.mean(axis=1, keepdims=True) - values.mean(axis=0) + mean
    e = np.square(rest).sum() / ((R - 1) * (S - 1) * R * S)
    variance = max(a + b - e, 0.0)
    degrees = variance**2 / (a**2 / (R - 1) + b**2 / (S - 1) + e**2 / ((R - 1) * (S - 1)))
    half = stdtrit(max(degrees, 1.0), 0.975) * np.sqrt(variance)
    return Interval(mean - half, mean + half)


def drawn(values: Array, draw: np.random.Generator) -> Array:
    """Return means of tables of raters and sentences, drawn again (the pigeonhole bootstrap of Owen 2007)."""
    R, S = values.shape
    raters, sentences = draw.multinomial(R, np.full(R, 1 / R), DRAWS), draw.multinomial(S, np.full(S, 1 / S), DRAWS)
    return ((raters @ values) * sentences).sum(axis=1) / (R * S)


def percentiles(values: Array, draw: np.random.Generator) -> Interval:
    """Return the interval by percentiles of the bootstrap."""
    return Interval(*np.percentile(drawn(values, draw), [2.5, 97.5]))


def bca(values: Array, draw: np.random.Generator) -> Interval:
    """Return the interval by the bootstrap, bias-corrected and accelerated (Efron 1987)."""
    means, mean = drawn(values, draw), values.mean()
    bias = ndtri(np.clip((means < mean).mean(), 1 / DRAWS, 1 - 1 / DRAWS))
    (R, S), left = values.shape, []
    left += [(R * mean - row) / (R - 1) for row in values.mean(axis=1)]
    left += [(S * mean - column) / (S - 1) for column in values.mean(axis=0)]
    off = np.mean(left) - np.array(left)
    acceleration = (off**3).sum() / (6 * max((off**2).sum() ** 1.5, 1e-12))
    z = bias + ndtri([0.025, 0.975])
    return Interval(*np.percentile(means, 100 * ndtr(bias + z / (1 - acceleration * z))))


OTHERS: dict[str, Callable[[Array, np.random.Generator], Interval]] = {
    "independent": independent,
    "Satterthwaite": satterthwaite,
    "bootstrap": percentiles,
    "BCa": bca,
}


def rated(draw: np.random.Generator, size: tuple[int, int], effects: Effects) -> Iterator[Found]:
    """Yield the intervals of one study of opinion scores."""
    truth = {f"c{i}": expected_rating(float(mean), effects) for i, mean in enumerate(MEANS)}
    table = ratings(draw, MEANS, size, effects)
    figures = analyse_ratings(table, "c0")
    for row in figures["conditions"]:
        yield Found("mean", Interval(row["low"], row["high"]), truth[row["condition"]])
    for row in figures["pairs"]:
        off = truth[row["condition"]] - truth[row["other"]]
        yield Found("difference", Interval(row["low"], row["high"]), off)
        values = table.select_condition(row["condition"]) - table.select_condition(row["other"])
        for name, method in OTHERS.items():
            yield Found(f"difference, {name}", method(values, draw), off)
    for row in figures["relative_improvement"]:
        percent = 100 * (truth[row["condition"]] / truth["c0"] - 1)
        yield Found("improvement", Interval(row["low"], row["high"]), percent)
    for name, value in truth.items():
        for other, method in OTHERS.items():
            yield Found(f"mean, {other}", method(table.select_condition(name), draw), value)


def compared(draw: np.random.Generator, size: tuple[int, int], effects: Effects) -> Iterator[Found]:
    """Yield the intervals of one study of paired comparisons."""
    chance = expected_preference(STRENGTHS[:, None] - STRENGTHS + ORDER, effects)
    np.fill_diagonal(chance, 0)
    lost = 1 - chance - np.eye(len(chance))
    model, share = fit_strengths(chance, lost), (chance + lost.T) / 2
    table = comparisons(draw, STRENGTHS, size, effects, ORDER)
    figures = analyse_pairs(table)
    for row in figures["pairs"]:
        i, j = (int(row[name][1:]) for name in ("condition", "other"))
        yield Found("share", Interval(row["low"], row["high"]), share[i, j])
        cells = table.average_cells(table.is_preferred(i).astype(float), table.mark_between(i, j))
        for name, method in OTHERS.items():
            yield Found(f"share, {name}", method(cells, draw), share[i, j])
    for row in figures["bradley_terry"]["pairs"]:
        i, j = (int(row[name][1:]) for name in ("condition", "other"))
        yield Found("log odds", Interval(row["low"], row["high"]), model.strengths[i] - model.strengths[j])
    row = figures["bradley_terry"]["order"]
    yield Found("order", Interval(row["low"], row["high"]), model.order)


def coverage(studies: int) -> list[dict[str, Any]]:
    """Return and print the shares of intervals that cover the truth, and their mean widths."""
    rows = []
    for name, of_ratings in RATING_EFFECTS.items():
        for size in SIZES:
            draw = np.random.default_rng([studies, *size])
            hits: dict[str, list[tuple[bool, float]]] = {}
            for _ in range(studies):
                for part, effects in ((rated, of_ratings), (compared, PAIRED_EFFECTS[name])):
                    for found in part(draw, size, effects):
                        low, high = found.interval
                        hits.setdefault(found.name, []).append((low <= found.truth <= high, high - low))
            row: dict[str, Any] = {"effects": name, "raters": size[0], "sentences": size[1]}
            row |= {key: np.mean(values, axis=0).round(4).tolist() for key, values in hits.items()}
            rows.append(row)
            print(name, *size, *(f"{key} {row[key][0]:.3f}" for key in hits), sep="  ", flush=True)
    return rows


def power(studies: int) -> list[dict[str, Any]]:
    """Return and print how often studies of the size that was said to suffice tell a difference."""
    rows = []
    for rater, sentence, difference in ((0.4, 0.1, 0.5), (0.4, 0.3, 0.5), (0.2, 0.1, 0.3), (0.0, 0.0, 0.2)):
        for sentences in (6, 20):
            components = Components(rater**2, sentence**2, 1.0)
            raters = count_raters(components, difference, sentences)
            if raters is None:
                continue
            draw, told = np.random.default_rng([studies, raters, sentences]), 0
            for _ in range(studies):
                values = difference + draw.normal(size=(raters, sentences))
                values += rater * draw.normal(size=(raters, 1)) + sentence * draw.normal(size=(1, sentences))
                told += crossed.estimate_mean(values, 4.0).p_value < 0.05
            row = {"rater": rater, "sentence": sentence, "difference": difference, "sentences": sentences}
            said = compute_power(components, difference, raters, sentences)
            rows.append(row | {"raters": raters, "said": said, "told": told / studies})
            print(rows[-1], flush=True)
    return rows


PARTS = {"coverage": coverage, "power": power}


def main() -> None:
    """Print, and write, the figures of the chosen parts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--studies", type=int, default=1000, help="of each size (default: 1000)")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.json")
    options = parser.parse_args()
    figures = {"studies": options.studies} | {name: PARTS[name](options.studies) for name in options.parts}
    if options.output:
        options.output.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
