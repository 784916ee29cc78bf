"""Studies with known effects of raters and sentences, and what their answers would be in the end."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lipmotion_studio.study.analysis.crossed import SCALE, RatingTable
from lipmotion_studio.study.analysis.paired import PairTable
from lipmotion_studio.study.answers import FIRST, MOS, PAIRED, SECOND, Answer

Array = NDArray[np.float64]
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(61)


@dataclass(frozen=True)
class Effects:
    """Standard deviations of what is random, in points of the scale or in log odds.

    rater, sentence         : of what raters and sentences add to all conditions
    rater_each, sentence_each : of what they add to each condition
    rest                    : of a single judgement; none in log odds, where the choice itself is random
    """

    rater: float = 0.5
    sentence: float = 0.3
    rater_each: float = 0.3
    sentence_each: float = 0.2
    rest: float = 0.7

    @property
    def whole(self) -> float:
        """Standard deviation of a judgement."""
        parts = (self.rater, self.sentence, self.rater_each, self.sentence_each, self.rest)
        return float(np.sqrt(np.square(parts).sum()))


def ratings(draw: np.random.Generator, means: Array, sizes: tuple[int, int], effects: Effects) -> RatingTable:
    """Return judgements in whole numbers within the scale; ``means``: before rounding [shape=(C,)]."""
    raters, sentences = sizes
    values = means[:, None, None] + effects.rest * draw.normal(size=(len(means), raters, sentences))
    values += effects.rater * draw.normal(size=(1, raters, 1)) + effects.sentence * draw.normal(size=(1, 1, sentences))
    values += effects.rater_each * draw.normal(size=(len(means), raters, 1))
    values += effects.sentence_each * draw.normal(size=(len(means), 1, sentences))
    values = np.clip(np.round(values), *SCALE)
    return RatingTable(_names("c", len(means)), values, np.ones(values.shape, np.intp))


def expected_rating(mean: float, effects: Effects) -> float:
    """Return the mean of all judgements that ``ratings`` could give: of a rounded normal variable within the scale."""
    from scipy.special import ndtr

    limits = np.arange(*SCALE) + 0.5
    return float(SCALE[0] + ndtr((mean - limits) / effects.whole).sum())


def comparisons(
    draw: np.random.Generator, strengths: Array, sizes: tuple[int, int], effects: Effects, order: float = 0.0
) -> PairTable:
    """Return answers to all pairs in both orders; ``strengths``: log odds [shape=(C,)]."""
    raters, sentences = sizes
    count = len(strengths)
    mine = strengths[:, None, None] + effects.rater_each * draw.normal(size=(count, raters, 1))
    mine = mine + effects.sentence_each * draw.normal(size=(count, 1, sentences))
    grid = np.stack(np.meshgrid(*map(np.arange, (count, count, raters, sentences)), indexing="ij"), -1).reshape(-1, 4)
    first, second, rater, sentence = grid[grid[:, 0] != grid[:, 1]].T
    odds = mine[first, rater, sentence] - mine[second, rater, sentence] + order
    is_first = draw.random(len(odds)) < 1 / (1 + np.exp(-odds))
    names = _names("c", count), _names("r", raters), _names("s", sentences)
    return PairTable(*names, np.stack([first, second], axis=1), is_first, rater, sentence)


def expected_preference(odds: Array, effects: Effects) -> Array:
    """Return the mean probability over raters and sentences of log odds that they shift."""
    spread = np.sqrt(2 * (effects.rater_each**2 + effects.sentence_each**2))
    shifted = 1 / (1 + np.exp(-(np.asarray(odds)[..., None] + spread * NODES)))
    return shifted @ (WEIGHTS / WEIGHTS.sum())


def paired_answers(table: PairTable) -> list[Answer]:
    """Return a table of comparisons as answers."""
    rows = zip(table.rater.tolist(), table.sentence.tolist(), table.shown.tolist(), table.is_first, strict=True)
    return [
        pair_answer(
            (table.raters[rater], table.sentences[sentence]),
            (table.conditions[first], table.conditions[second]),
            bool(is_first),
            trial=trial,
        )
        for trial, (rater, sentence, (first, second), is_first) in enumerate(rows)
    ]


def pair_answer(who: tuple[str, str], shown: tuple[str, str], is_first: bool, *, trial: int = 0) -> Answer:
    """Return one answer of a rater on a sentence."""
    value = FIRST if is_first else SECOND
    return Answer(who[0], PAIRED, trial, who[1], "preference", *shown, value, 9.0, 2, False, "")


def rating(who: tuple[str, str], condition: str, value: int) -> Answer:
    """Return one judgement of a rater on a sentence."""
    return Answer(who[0], MOS, 0, who[1], "overall", condition, "", str(value), 6.0, 1, False, "")


def rated_answers(table: RatingTable) -> list[Answer]:
    """Return a table of judgements as answers."""
    return [
        rating((f"r{rater}", f"s{sentence}"), table.conditions[condition], int(value))
        for (condition, rater, sentence), value in np.ndenumerate(table.values)
        if np.isfinite(value)
    ]


def _names(letter: str, count: int) -> tuple[str, ...]:
    return tuple(f"{letter}{number}" for number in range(count))
