"""Unit selection: what a sequence of recorded units costs, and the search for the one that costs least."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines.base import read_presets
from lipmotion.engines.selection.inventory import (
    INVISIBLE,
    INVISIBLE_SYMBOL,
    OVERLAPS,
    PHONE_NUMBER,
    PROTECTED_PHONES,
    SILENT,
    VISEME_NUMBER,
    PhoneWindows,
    RecordedUnits,
    UnitIndex,
    UnitNumbers,
    find_lip_class,
    index_units,
    parse_invisible,
)
from lipmotion.errors import InputError
from lipmotion.motion.predictors import AUTOMATIC, check_predictor
from lipmotion.types import FRAME_RATE_HZ, Configuration, Rule, option
from lipmotion.units import PHONES, find_similar_lips
from lipmotion.units.phones import CLASSES

NOT_NEGATIVE = Rule(least=0)


@dataclass(frozen=True)
class SelectionConfig(Configuration):
    """Options of the unit selection engine; the default values were chosen on the validation list (docs/selection.md).

    window     : phones of a window, N: odd, 3 to 11
    candidates : units that are looked up for each phone and each bias; 0: every contextual match
    beam       : of all these, so many of the least target costs are candidates in the search; 0: all
    invisible  : phones without a lip shape of their own, those of the print by default (add ``l`` for faces without a
                 tongue): they count as one phone, and their neighbours choose the unit; empty: none
    suppressed : leave invisible phones out: the vowel that follows gives the shape, and no recorded one is played
    overlap    : how units overlap in a phone that they share: ``printed`` (Table 1), ``symmetric``,
                 ``anticipatory`` (Table 1, where "forward" is the phone after), ``middle``
    context    : target cost of another phone beside the phone, ``farther`` times as much for each phone further away;
                 half as much where both are of one viseme
    farther    : see ``context``
    word       : target cost of another edge of a word, at either end
    stress     : target cost of another stress
    duration   : target cost of another duration, for each unit of its natural logarithm
    guide      : target cost of motion that differs from what the guide predicts from the sound, for each tenth of a
                 second and squared deviation; 0: no guide, the phones alone choose
    trust      : deviations between the predictions for two sounds from which on they count as different: a unit that
                 sounds the same as the target need not agree with the guide
    join       : join cost for each squared deviation between two units where they are joined
    velocity   : seconds; weight of velocities in these deviations
    hard       : join cost where units have no phone in common
    protected  : join cost beside or inside a phone whose lip shape must be preserved
    cluster    : join cost where units abut between two consonants of one word
    most       : no join costs more than this; so candidates can be left out without a change of the result
    components : principal components that all point channels are reduced to
    conditions, epochs : of the acoustic network that is the guide, as of the trajectory engine
    joint_recogniser : train the joint model as well, where there is enough speech: it recognises phones of this speaker
    closures   : make the lips meet in every p, b and m
    articulation : lean on the table of English articulation in contexts that training saw little of
    predictor  : name of the predictor that is the guide (docs/extend/predictor.md); ``auto``: as suits the recordings
    """

    window: int = option(5, Rule(least=3, odd=True))
    candidates: int = option(300, Rule(least=0))
    beam: int = option(25, Rule(least=0))
    invisible: str = "t d g k"
    overlap: str = option("printed", Rule(choices=tuple(OVERLAPS)))
    context: float = option(0.3, NOT_NEGATIVE)
    farther: float = option(0.3, NOT_NEGATIVE)
    word: float = option(0.05, NOT_NEGATIVE)
    stress: float = option(0.05, NOT_NEGATIVE)
    duration: float = option(0.3, NOT_NEGATIVE)
    guide: float = option(20.0, NOT_NEGATIVE)
    trust: float = option(0.1, NOT_NEGATIVE)
    join: float = option(0.1, NOT_NEGATIVE)
    velocity: float = option(0.05, NOT_NEGATIVE)
    hard: float = option(0.15, NOT_NEGATIVE)
    protected: float = option(1.0, NOT_NEGATIVE)
    cluster: float = option(0.1, NOT_NEGATIVE)
    most: float = option(3.0, Rule(above=0))
    components: int = option(16, Rule(least=1))
    conditions: int = option(8, Rule(least=0))
    epochs: int = option(100, Rule(least=1))
    joint_recogniser: bool = True
    closures: bool = True
    articulation: bool = True
    predictor: str = option(AUTOMATIC, omit_default=True)
    suppressed: bool = option(False, omit_default=True)

    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = read_presets("selection")

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_invisible(self.invisible)
        if self.window > LARGEST_WINDOW:
            raise InputError(f"window is {self.window}, required an odd number from 3 to {LARGEST_WINDOW}")

    def check_files(self) -> None:  # noqa: D102
        check_predictor(self.predictor)

    @property
    def invisible_phones(self) -> frozenset[str]:
        """The phones of ``invisible``."""
        return parse_invisible(self.invisible)

    @property
    def suppressed_phones(self) -> frozenset[str]:
        """The phones that are left out: none, or those of ``invisible``."""
        return self.invisible_phones if self.suppressed else frozenset()


LARGEST_WINDOW = 11  # keys of larger windows do not fit into 64 bits


Array = NDArray[np.float64]
POINTS = 5  # points of a phone at which motions are compared
FRACTIONS = (np.arange(POINTS) + 0.5) / POINTS
PER_S = 10.0  # costs of the guide are given for a tenth of a second
MIN_S = 0.01
ABUTTING_JOIN, JOIN_BEFORE, JOIN_AFTER, NO_JOIN = 0, 1, 2, 3
"""Kinds of a join: units abut, overlap in the phone before or after it, or were recorded in succession."""
_CONSONANTS = frozenset(PHONES) - frozenset(CLASSES["vowel"]) - frozenset(CLASSES["silence"])


@dataclass(frozen=True, eq=False)
class Target:
    """The phones that units are wanted for.

    windows  : the phones, each present in the inventory or replaced by one that is [U phones]
    contexts : the symbols of their windows [shape=(U, N)]
    guided   : the motion that the guide predicts, as wide as recorded motion, times ``scale`` [shape=(U, POINTS, Q)]
    predicted : what it predicts, as it is, times ``scale`` [shape=(U, POINTS, Q)]; both None: there is no guide
    by_sound : whether the phones are not known, so that the guide alone chooses
    """

    windows: PhoneWindows
    contexts: NDArray[np.intp]
    guided: Array | None
    predicted: Array | None
    by_sound: bool = False

    def __len__(self) -> int:
        return len(self.windows)

    def symbol(self, number: int) -> int:
        """Return the symbol of a phone; silence beyond both ends."""
        return int(self.contexts[number, self.contexts.shape[1] // 2]) if 0 <= number < len(self) else SILENT


@dataclass(frozen=True, eq=False)
class Costs:
    """Costs of the units of one inventory."""

    inventory: RecordedUnits
    config: SelectionConfig
    scale: Array

    @cached_property
    def index(self) -> UnitIndex:
        """The index of the windows."""
        return index_units(self.inventory, self.config.invisible_phones, self.config.window)

    @cached_property
    def stand_ins(self) -> dict[str, str]:
        """The phone that stands in for each phone that no usable unit has; none, if no unit is usable."""
        known = {PHONES[number] for number in np.unique(self.inventory.windows.phones[self.inventory.usable])}
        return {phone: find_similar_lips(phone, known) for phone in PHONES if phone not in known and known}

    def suppress(self, windows: PhoneWindows) -> PhoneWindows:
        """Return the phones of one recording without those that are suppressed, if any are."""
        return windows.suppressed(self.config.suppressed_phones)

    def target(
        self, windows: PhoneWindows, guided: Array | None, predicted: Array | None, *, by_sound: bool = False
    ) -> Target:
        """Return phones to compare with units, and motion predicted at ``POINTS`` [each shape=(U, POINTS, Q)]."""
        table = np.array([PHONE_NUMBER[self.stand_ins.get(phone, phone)] for phone in PHONES], np.int16)
        known = replace(windows, phones=table[windows.phones])
        contexts = known.contexts(self.config.invisible_phones, self.config.window // 2)
        if guided is None or predicted is None:
            return Target(known, contexts, None, None)
        return Target(known, contexts, guided * self.scale, predicted * self.scale, by_sound)

    def candidates(self, target: Target, number: int, excluded: NDArray[np.bool_] | None = None) -> UnitNumbers:
        """Return the units for one phone: of each bias those of the longest agreement, and of these the cheapest."""
        cost = partial(self._phonological_costs, target, number)
        return self.index.candidates(target.contexts[number], self.config.candidates, excluded, cost)

    def target_costs(self, target: Target, number: int, units: UnitNumbers) -> Array:
        """Return the cost of each of some units for one phone [shape=(N,)]."""
        config, windows = self.config, self.inventory.windows
        costs = np.zeros(len(units))
        if not target.by_sound:
            symbols, others = target.contexts[number], self.index.contexts[units]
            other_visemes = VISEME_NUMBER[others] != VISEME_NUMBER[symbols]
            costs = ((others != symbols).astype(float) + other_visemes) @ (self._context_weights / 2)
            costs = costs + self._phonological_costs(target, number, units)
        duration_s = max(float(target.windows.durations_s[number]), MIN_S)
        costs += config.duration * np.abs(np.log(np.maximum(windows.durations_s[units], MIN_S) / duration_s))
        is_visible = target.by_sound or target.symbol(number) != INVISIBLE_SYMBOL
        if is_visible and target.guided is not None and target.predicted is not None and self._recorded is not None:
            distance = np.square(self._recorded[units] - target.guided[number]).mean(axis=1).sum(axis=1)
            if self._predicted is not None and config.trust:
                unlike = np.square(self._predicted[units] - target.predicted[number]).mean(axis=1).sum(axis=1)
                distance *= np.minimum(unlike / config.trust**2, 1)
            costs += config.guide * PER_S * duration_s * distance
        return costs

    def _phonological_costs(self, target: Target, number: int, units: UnitNumbers) -> Array:
        """Return what other edges of a word and other stress of each of some units cost for one phone [shape=(N,)]."""
        config, windows = self.config, self.inventory.windows
        costs: Array = config.stress * _differ(windows.stress[units], target.windows.stress[number]).astype(float)
        if target.windows.words_known:
            costs += config.word * (windows.words[units] != target.windows.words[number]).sum(axis=1)
        return costs

    def join_costs(self, target: Target, number: int, left: UnitNumbers, right: UnitNumbers) -> Array:
        """Return the costs of joining units of one phone with those of phone ``number`` [shape=(left, right)]."""
        costs = np.minimum.reduce(self._joins(target, number, left, right))
        np.minimum(costs, self.config.most, out=costs)
        costs[self._succeed(left, right)] = 0
        return costs

    def join_kind(self, target: Target, number: int, left: int, right: int, *, may_be_before: bool = True) -> int:
        """Return how a unit is joined with that of phone ``number``; ``may_be_before``: in the phone before."""
        pair = np.array([left]), np.array([right])
        if self._succeed(*pair)[0, 0]:
            return NO_JOIN if self.inventory.windows.adjoins[left] else ABUTTING_JOIN
        costs = [cost[0, 0] for cost in self._joins(target, number, *pair)]
        if not may_be_before:
            costs[JOIN_BEFORE] = np.inf
        return int(np.argmin(costs))

    def forward_share(self, target: Target, shared: int) -> float:
        """Return the forward share of a phone of the target in which units overlap."""
        invisible = self.config.invisible_phones
        phones = [PHONES[target.windows.phones[n]] if 0 <= n < len(target) else "sil" for n in (shared - 1, shared + 1)]
        before, after = (find_lip_class(phone, invisible) for phone in phones)
        hidden = target.windows.hidden
        if hidden is not None:
            before = INVISIBLE if 0 <= shared < len(target) and hidden[shared] else before
            after = INVISIBLE if shared + 1 < len(target) and hidden[shared + 1] else after
        return OVERLAPS[self.config.overlap][before, after]

    def _joins(self, target: Target, number: int, left: UnitNumbers, right: UnitNumbers) -> tuple[Array, Array, Array]:
        """Return the costs of joins: ``ABUTTING_JOIN``, ``JOIN_BEFORE``, ``JOIN_AFTER``; infinite where none is."""
        config, adjoins, symbols = self.config, self.inventory.windows.adjoins, self.index.contexts
        middle = symbols.shape[1] // 2
        before, after = (PHONES[target.windows.phones[n]] for n in (number - 1, number))
        protects = [config.protected * (phone in PROTECTED_PHONES) for phone in (before, after)]
        inside = config.cluster * (
            before in _CONSONANTS
            and after in _CONSONANTS
            and target.windows.words_known
            and not target.windows.words[number, 0]
        )
        hard = self._distances(left, 1.0, right, 0.0) + config.hard + max(protects) + inside
        earlier, later = np.maximum(right - 1, 0), np.minimum(left + 1, len(adjoins) - 1)
        usable = self.inventory.usable
        shares_before = usable[earlier] & adjoins[earlier] & (right > 0)
        shares_after = usable[later] & adjoins[left]
        if not target.by_sound:
            shares_before &= symbols[earlier, middle] == target.symbol(number - 1)
            shares_after &= symbols[later, middle] == target.symbol(number)
        fraction = self.forward_share(target, number - 1)
        stress = self.inventory.windows.stress
        soft_before = self._distances(left, fraction, earlier, fraction) + protects[0]
        soft_before += config.stress * _differ(stress[left][:, None], stress[earlier])
        fraction = self.forward_share(target, number)
        soft_after = self._distances(later, fraction, right, fraction) + protects[1]
        soft_after += config.stress * _differ(stress[later][:, None], stress[right])
        soft_before[:, ~shares_before] = np.inf
        soft_after[~shares_after] = np.inf
        return hard, soft_before, soft_after

    def _succeed(self, left: UnitNumbers, right: UnitNumbers) -> NDArray[np.bool_]:
        """Return which pairs were recorded in succession [shape=(len(left), len(right))]."""
        return (left[:, None] + 1 == right) & self.inventory.windows.continues[left][:, None]

    def _distances(self, left: UnitNumbers, at_left: float, right: UnitNumbers, at_right: float) -> Array:
        """Return the squared deviations between units at fractions of their durations, weighted."""
        if not self.config.join:
            return np.zeros((len(left), len(right)))
        a, b = self._states(at_left)[left], self._states(at_right)[right]
        squares = np.square(a).sum(axis=1)[:, None] + np.square(b).sum(axis=1)
        return self.config.join * np.maximum(squares - 2 * a @ b.T, 0)

    def _states(self, fraction: float) -> Array:
        """Return position and velocity of all units at a fraction of their durations [shape=(U, 2Q)]."""
        if fraction not in self._known_states:
            step_s, poses = 1 / FRAME_RATE_HZ, self.inventory.poses
            velocities = (poses(fraction, step_s) - poses(fraction, -step_s)) / (2 * step_s) * self.config.velocity
            state = np.concatenate([poses(fraction), velocities], axis=1) * np.tile(self.scale, 2)
            self._known_states[fraction] = state
        return self._known_states[fraction]

    def nearest(self, target: Target, number: int, units: UnitNumbers) -> UnitNumbers:
        """Return those of some units whose mean pose is nearest to what is wanted, ``candidates`` of them at most."""
        if target.guided is None or self._recorded is None or not 0 < self.config.candidates < len(units):
            return units
        distance = np.square(self._mean_poses[units] - target.guided[number].mean(axis=0)).sum(axis=1)
        order = np.argpartition(distance, self.config.candidates)[: self.config.candidates]
        return np.sort(units[order])

    @cached_property
    def _mean_poses(self) -> Array:
        """The mean over ``POINTS`` of the motion of every unit, times ``scale`` [shape=(U, Q)]."""
        return np.zeros((0, 0)) if self._recorded is None else self._recorded.mean(axis=1)

    @cached_property
    def _known_states(self) -> dict[float, Array]:
        return {}

    @cached_property
    def _context_weights(self) -> Array:
        offsets = np.abs(np.arange(self.config.window) - self.config.window // 2)
        return np.where(offsets > 0, self.config.context * self.config.farther ** np.maximum(offsets - 1, 0), 0.0)

    @cached_property
    def _recorded(self) -> Array | None:
        """The motion at ``POINTS`` of every unit, times ``scale`` [shape=(U, POINTS, Q)]; None: there is no guide."""
        if self.inventory.predicted is None or not self.config.guide:
            return None
        return np.stack([self.inventory.poses(fraction) for fraction in FRACTIONS], axis=1) * self.scale

    @cached_property
    def _predicted(self) -> Array | None:
        """What the guide predicts at ``POINTS`` of every unit, times ``scale`` [shape=(U, POINTS, Q)]."""
        return self.inventory.predicted.astype(float) * self.scale if self.inventory.predicted is not None else None


def _differ(one: NDArray[np.int8], other: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Return where two stresses are known and differ; the shapes are broadcast."""
    return (one != other) & (one >= 0) & (other >= 0)


def select(
    costs: Costs,
    target: Target,
    excluded: NDArray[np.bool_] | None = None,
    *,
    required: Mapping[int, int] | None = None,
    prune: bool = True,
) -> tuple[UnitNumbers, float]:
    """Return the candidates of least total cost, one for each phone of the target, and this cost.

    excluded : units that must not be used [shape=(all units,)]
    required : units that must be used, by the number of their phone in the target
    prune    : leave out candidates that cannot be part of the best sequence, and those beyond the beam
    A candidate whose target cost exceeds the least one of its phone by more than two joins can cost is never the best:
    the one of least target cost in its place would be better. So this does not change the cost of the result. Of the
    others, the beam keeps those of the least target costs, which changes it little (docs/results/selection.md).
    Source: Minnis & Breen 2000, §3.
    """
    required = required or {}
    trellis = [_candidates(costs, target, n, excluded, required.get(n), prune) for n in range(len(target))]
    total, backward = trellis[0][1], []
    for number in range(1, len(trellis)):
        (left, _), (right, right_costs) = trellis[number - 1], trellis[number]
        join = costs.join_costs(target, number, left, right)
        sums = total[:, None] + join
        best = sums.argmin(axis=0)
        backward.append(best)
        total = sums[best, np.arange(len(right))] + right_costs
    places = [int(total.argmin())]
    for best in reversed(backward):
        places.append(int(best[places[-1]]))
    units = [candidates[place] for (candidates, _), place in zip(trellis, reversed(places), strict=True)]
    return np.array(units, np.intp), float(total.min())


def _candidates(
    costs: Costs, target: Target, number: int, excluded: NDArray[np.bool_] | None, required: int | None, prune: bool
) -> tuple[UnitNumbers, Array]:
    """Return the candidates for one phone, and their target costs. Where all units are excluded, they are allowed."""
    if required is not None:
        units = np.array([required], np.intp)
        return units, costs.target_costs(target, number, units)
    if target.by_sound:
        usable = costs.inventory.usable
        units = np.flatnonzero(usable if excluded is None else usable & ~excluded)
        units = costs.nearest(target, number, units) if prune else units
    else:
        units = costs.candidates(target, number, excluded)
    if not len(units):
        units = costs.candidates(target, number)
    each = costs.target_costs(target, number, units)
    if prune:
        chosen = np.flatnonzero(each <= each.min() + 2 * costs.config.most)
        if 0 < costs.config.beam < len(chosen):
            chosen = np.sort(chosen[np.argsort(each[chosen], kind="stable")[: costs.config.beam]])
        units, each = units[chosen], each[chosen]
    return units, each
