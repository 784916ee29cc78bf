"""The order in which frames of a background are shown, for speech of any length, without a visible jump.

Frames are compared by descriptors: what a viewer would see change from one to another, mouth aside.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
Scenes = Sequence[tuple[int, int]]

FRAME_CELLS = 32  # cells of the thumbnail of the whole frame along its longer side
UPPER_FACE = (-54.0, -45.0, 54.0, 42.0)
EYES = (-50.0, -14.0, 50.0, 14.0)
"""Left, top, right and bottom of the regions that are compared with the face aligned, px of the face that looks
straight ahead, from the point between the eyes."""
LOWER_FACE = (-60.0, 42.0, 60.0, 140.0)  # the region that is replaced, or moves with speech: not compared
FACE_STEP, EYES_STEP = 6.0, 4.0  # distance of the samples of these regions, px of the face that looks straight ahead
MIN_ORDINARY = (0.2, 0.2, 0.2)
"""Least ordinary difference of neighbouring frames, in the whole frame and the upper face, levels, and of the
place of the face, px of the frame: smaller differences are not seen."""


@dataclass(frozen=True, eq=False)
class FrameDescriptors:
    """What T frames look like, in levels of green."""

    whole: Array  # thumbnails of the whole frame; the cells of the lower face are 0 in all of them [shape=(T, A)]
    face: Array  # the upper face, aligned [shape=(T, B)]
    eyes: Array  # the eyes, aligned [shape=(T, C)]
    place: Array  # x and then y of the eye corners and the mouth in the frame, px [shape=(T, 6)]

    def __len__(self) -> int:
        return len(self.whole)

    def select(self, start: int, stop: int) -> FrameDescriptors:
        """Return the descriptors of frames from ``start`` (included) to ``stop`` (excluded)."""
        return FrameDescriptors(*(rows[start:stop] for rows in (self.whole, self.face, self.eyes, self.place)))

    def standardise(self, scenes: Scenes, fade: int = 1) -> Array:
        """Return rows whose distances count in ordinary differences: that of neighbours has a median of about 1.

        scenes : first frame of each part without a cut, and the one after its last
        fade   : frames over which the whole frame and the place of the face change from one to another; the upper face
                 is aligned, and counts as it is
        Whole frame, upper face and place of the face have the same weight [shape=(T, A + B + 6)].
        """
        groups = []
        for rows, min_step, frames in zip(
            (self.whole, self.face, self.place), MIN_ORDINARY, (fade, 1, fade), strict=True
        ):
            steps = [np.linalg.norm(np.diff(rows[start:stop], axis=0), axis=1) for start, stop in scenes]
            different = np.concatenate([part[part > 0] for part in steps])
            ordinary = float(np.median(different)) if len(different) else 0.0
            groups.append(rows / (frames * max(ordinary, min_step * np.sqrt(rows.shape[1]))))
        return np.concatenate(groups, axis=1) / np.sqrt(len(groups))


def describe_frames(frames: Iterable[NDArray[np.uint8]], face_to_image: Array) -> FrameDescriptors:
    """Return descriptors of the frames of a background.

    frames        : uint8 RGB, all of one size [shape=(H, W, 3)]; taken one at a time
    face_to_image : affine map of each frame [shape=(T, 2, 3)], from px of a face that looks ahead to px of the frame
    Raises InputError: another number of frames, or frames of several sizes.
    """
    pictures, face, eyes = [], [], []
    lower: NDArray[np.bool_] | None = None
    cell = 1
    size: tuple[int, ...] = ()
    for n, frame in enumerate(frames):
        if n == len(face_to_image) or (size and frame.shape != size):
            raise InputError(
                f"frame {n} of shape {frame.shape} with {len(face_to_image)} maps; required as many frames, of one size"
            )
        if not size:
            size, cell = frame.shape, max(1, round(max(frame.shape[:2]) / FRAME_CELLS))
        grey = frame[:, :, 1].astype(np.float32)  # green, of which a camera has most pixels
        thumbnail = _average_cells(grey, cell)
        rows, columns = np.mgrid[: thumbnail.shape[0], : thumbnail.shape[1]]
        centres = np.stack([(columns.ravel() + 0.5) * cell, (rows.ravel() + 0.5) * cell])
        x, y = np.linalg.solve(face_to_image[n][:, :2], centres - face_to_image[n][:, 2:])
        left, top, right, bottom = LOWER_FACE
        hidden = ((x > left) & (x < right) & (y > top) & (y < bottom)).reshape(thumbnail.shape)
        lower = hidden if lower is None else lower | hidden
        pictures.append(thumbnail)
        face.append(_sample(grey, face_to_image[n], UPPER_FACE, FACE_STEP))
        eyes.append(_sample(grey, face_to_image[n], EYES, EYES_STEP))
    if len(pictures) != len(face_to_image) or lower is None:
        raise InputError(f"{len(pictures)} frames with {len(face_to_image)} maps, required as many, at least one")
    points = np.array([[-45.0, 0, 1], [45, 0, 1], [0, 76, 1]]).T
    place = (face_to_image @ points).reshape(len(pictures), 6)
    shown = (np.stack(pictures) * ~lower).reshape(len(pictures), -1)
    alike, eye_levels = np.stack(face).astype(np.float64), np.stack(eyes).astype(np.float64)
    return FrameDescriptors(shown.astype(np.float64), alike, eye_levels, place)


def compare_rows(rows: Array) -> Array:
    """Return the distance between every two rows, such as of ``FrameDescriptors.standardise`` [shape=(T, T)]."""
    rows = rows - rows.mean(axis=0)
    power = np.square(rows).sum(axis=1)
    return np.sqrt(np.maximum(power[:, None] + power - 2 * rows @ rows.T, 0))


def _average_cells(grey: Floats, cell: int) -> Floats:
    """Return means of square cells; pixels beyond the last whole cell are left out."""
    height, width = (side // cell for side in grey.shape)
    if not height or not width:
        return grey.mean(keepdims=True)
    if cell == 1:
        return grey
    rows = grey[: height * cell, : width * cell].reshape(height, cell, -1).sum(axis=1)
    return rows.reshape(height, width, cell).sum(axis=2) / cell**2


def _sample(grey: Floats, to_image: Array, box: tuple[float, float, float, float], step: float) -> Floats:
    """Return a region of the aligned face on a grid, each sample the mean of about its part [shape=(N,)]."""
    left, top, right, bottom = box
    scale = float(np.sqrt(abs(np.linalg.det(to_image[:, :2]))))
    shrink = max(1, int(scale * step / 2))
    x, y = np.meshgrid(np.arange(left + step / 2, right, step), np.arange(top + step / 2, bottom, step))
    columns, rows = (to_image[:, :2] @ np.stack([x.ravel(), y.ravel()]) + to_image[:, 2:]) / shrink - 0.5
    image = _average_cells(grey, shrink)
    height, width = image.shape  # bilinear samples; outside, the picture is as at its edge
    rows, columns = np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)
    top, left = np.minimum(rows.astype(int), max(height - 2, 0)), np.minimum(columns.astype(int), max(width - 2, 0))
    below, next_column = np.minimum(top + 1, height - 1), np.minimum(left + 1, width - 1)
    down, across = rows - top, columns - left
    upper = (1 - across) * image[top, left] + across * image[top, next_column]
    under = (1 - across) * image[below, left] + across * image[below, next_column]
    return (1 - down) * upper + down * under


Numbers = NDArray[np.intp]
Kind = Literal["turn", "jump"]

JUMP_LIMIT = 2.5
"""No jump is made between frames that differ by more than this many times the difference of ordinary neighbours, what
a cross-fade spreads over its frames being counted a frame."""
MIN_RUN_S = 0.8
"""Frames are shown one after the other for at least so long between two joins, where the background is long enough."""
USUAL_RUN_S = 4.0
"""A run of this length costs as much as a join at which everything moves as usual; longer ones cost less."""
CHOICE_COST_RANGE = 1.0
"""Joins whose cost exceeds the least one by less than this are chosen by chance, so that no rhythm is seen."""
FADE_S = 0.56  # time over which a jump is cross-faded; the head moves from one place to the other in it
REPEAT_COST, REPEAT_S = 4.0, 10.0
"""What going to frames that were just shown costs, and in which time it falls to 1/e of this."""
REPEATS_COST = 3.0  # what an order costs all of whose frames are shown again within ``REPEAT_S``
BUSY_CHANGE_RATIO, BUSY_S = 2.5, 0.12
"""Eyes that change by more than this many times the median change blink or look elsewhere: no join so near, s."""
BUSY_COST = 10.0  # what a join there costs: more than any other
MAX_COMPARED_FRAMES = 1500  # in longer backgrounds no jumps are searched, as every pair of frames would be compared
TRIES = 32
"""Orders that are drawn; the one with the least cost of its worst join, its last frame and its repeats is returned."""
_DYNAMICS = ((-2, 0.125), (-1, 0.375), (0, 0.375), (1, 0.125))
"""Neighbours whose differences are averaged, so that motion goes on in its direction (Schödl et al. 2000, 3.1)."""


@dataclass(frozen=True)
class Join:
    """A place where frames that were not neighbours in the background follow one another, or its direction changes.

    kind  : ``turn``, the background is then shown the other way round, or ``jump``
    cost  : of a turn, the speed of the background relative to its median; of a jump, the difference of the frames and
            of their neighbours relative to the ordinary difference of neighbours
    """

    at: int
    kind: Kind
    cost: float


@dataclass(frozen=True, eq=False)
class LoopOrder:
    """Which frames of a background are shown, N of them.

    first, second : numbers of frames of the background [shape=(N,)]
    weight        : share of ``second`` in what is shown, 0 but where a jump is cross-faded [shape=(N,)]
    joins         : every join, in order
    """

    first: Numbers
    second: Numbers
    weight: Array
    joins: tuple[Join, ...]

    def __len__(self) -> int:
        return len(self.first)


def find_loop_order(
    descriptors: FrameDescriptors,
    count: int,
    rate_hz: float,
    *,
    usable: NDArray[np.bool_] | None = None,
    cuts: Sequence[int] = (),
    seed: int = 0,
) -> LoopOrder:
    """Return an order of a background's frames for speech of any length.

    rate_hz     : frame rate of the background
    usable      : the frames that may be shown, all where it is not given [shape=(T,)]
    cuts        : frames before which the camera changes
    seed        : for the choice among joins that are equally good; the same seed gives the same order
    A background that is long enough is shown as it is, from where it begins and ends most calmly. Another one is shown
    in runs, forwards and backwards, with joins between them: turns, at frames where little moves, and jumps between
    frames in which the face looks and moves alike, cross-faded. What was shown long ago comes first. No join is made in
    a blink while there is another one.
    Raises InputError: no frames are wanted, or none may be shown.
    Source: Schödl et al. 2000, "Video textures" (cost of jumps); turns and runs are ours.
    Cost: O(T²) for T frames up to ``MAX_COMPARED_FRAMES``, else O(T).
    """
    allowed = np.ones(len(descriptors), bool) if usable is None else np.asarray(usable, bool)
    if count < 1 or allowed.shape != (len(descriptors),) or not allowed.any():
        raise InputError(
            f"{count} frames of a background of which {int(allowed.sum())} of {len(descriptors)} may be shown; "
            "required at least one of each"
        )
    plan = _Plan(descriptors, rate_hz, allowed, cuts)
    longest = max(plan.scenes, key=lambda scene: scene[1] - scene[0])
    if count <= longest[1] - longest[0]:
        starts = np.arange(longest[0], longest[1] - count + 1)
        start = int(starts[np.argmin(plan.restless[starts] + plan.restless[starts + count - 1])])
        return _make_order([(start, 1, count)], (), count, 0)
    draws = np.random.default_rng(seed)
    orders = [plan.find_order(count, longest, draws) for _ in range(TRIES)]
    return min(orders, key=plan.rate_blemish)


class _Plan:
    """A background, its scenes, and the cost of turning, beginning or ending at each frame [shape=(T,)]."""

    def __init__(
        self, descriptors: FrameDescriptors, rate_hz: float, allowed: NDArray[np.bool_], cuts: Sequence[int]
    ) -> None:
        from scipy.ndimage import binary_dilation, gaussian_filter1d

        self.scenes = list_scenes(allowed, cuts)
        self._scene_of = np.full(len(allowed), -1)
        for index, (start, stop) in enumerate(self.scenes):
            self._scene_of[start:stop] = index
        change = np.zeros(len(descriptors.eyes))
        for first, last in self.scenes:
            steps = np.sqrt(np.square(np.diff(descriptors.eyes[first:last], axis=0)).mean(axis=1))
            change[first : last - 1] = steps
            change[first + 1 : last] = np.maximum(change[first + 1 : last], steps)
        ordinary = np.median(change[change > 0]) if (change > 0).any() else np.inf
        self.busy = binary_dilation(change > BUSY_CHANGE_RATIO * ordinary, iterations=max(1, round(BUSY_S * rate_hz)))
        rows = descriptors.standardise(self.scenes)
        speed = np.zeros(len(rows))
        for start, stop in self.scenes:
            if stop - start > 1:
                smooth = gaussian_filter1d(rows[start:stop], 1.0, axis=0, mode="nearest")
                speed[start:stop] = np.linalg.norm(np.gradient(smooth, axis=0), axis=1)
        ordinary = float(np.median(speed[speed > 0])) if (speed > 0).any() else 1.0
        self.restless = speed / ordinary + BUSY_COST * self.busy
        self._least = max(1, round(MIN_RUN_S * rate_hz))
        self._usual = USUAL_RUN_S * rate_hz
        self._repeat = REPEAT_S * rate_hz
        self._fade = count_fade(rate_hz)
        count = len(descriptors)
        if count > MAX_COMPARED_FRAMES:
            none = np.full((count, 1), -1), np.full((count, 1), np.inf)
            self._jumps = {1: none, -1: none}
        else:
            distance = compare_rows(descriptors.standardise(self.scenes, self._fade))
            self._jumps = {way: self._find_jumps(distance, way) for way in (1, -1)}

    def find_order(self, count: int, longest: tuple[int, int], draws: np.random.Generator) -> LoopOrder:
        """Return one order of frames, drawn by chance."""
        early = np.arange(longest[0], longest[0] + max(1, (longest[1] - longest[0]) // 4))
        at, way, shown = int(early[np.argmin(self.restless[early])]), 1, 0
        last_shown = np.full(len(self.restless), -np.inf)
        runs: list[tuple[int, int, int]] = []
        joins: list[Join] = []
        while shown < count:
            # possible joins: the last frame before each, its cost, and the frame after it, -1 for a turn
            room = self._count_room(at, way)
            min_run = min(self._least, max(room, 1))
            last_frames = at + way * (np.arange(min_run, room + 1) if room >= min_run else np.array([room]))
            targets, jump_costs = (table[last_frames] for table in self._jumps[way])
            row, scene = np.nonzero(targets >= 0)
            ends = np.concatenate([last_frames, last_frames[row]])
            join_costs = np.concatenate([self.restless[last_frames], jump_costs[row, scene]])
            nexts = np.concatenate([np.full(len(last_frames), -1), targets[row, scene]])
            lengths = np.abs(ends - at) + 1
            following = nexts[:, None] + way * np.arange(self._least)
            seen = last_shown[np.clip(following, 0, len(last_shown) - 1)].max(axis=1)  # -inf: never
            ages = np.where(nexts < 0, 0, shown + lengths - seen)
            costs = join_costs + self._usual / lengths + REPEAT_COST * np.exp(-ages / self._repeat)
            chosen = int(draws.choice(np.flatnonzero(costs <= costs.min() + CHOICE_COST_RANGE)))
            end, after = int(ends[chosen]), int(nexts[chosen])
            runs.append((at, way, abs(end - at) + 1))
            shown += runs[-1][2]
            last_shown[at : end + way if end + way >= 0 else None : way] = shown
            if shown >= count:
                break
            joins.append(Join(shown, "turn" if after < 0 else "jump", float(join_costs[chosen])))
            if after < 0:
                way = -way
                after = end + way if self._count_room(end, way) else end
            at = after
        return _make_order(runs, tuple(joins), count, self._fade)

    def rate_blemish(self, order: LoopOrder) -> float:
        """Return how bad an order is: the cost of its worst join, how restless its last frame is, and its repeats."""
        worst = max((join.cost for join in order.joins), default=0.0) + float(self.restless[order.first[-1]])
        shown = np.lexsort((np.arange(len(order)), order.first))
        again = (np.diff(order.first[shown]) == 0) & (np.diff(shown) < self._repeat)
        return worst + REPEATS_COST * float(again.sum()) / len(order)

    def _count_room(self, at: int, way: int) -> int:
        """Return how many frames of its scene follow a frame that way."""
        start, stop = self.scenes[int(self._scene_of[at])]
        return stop - 1 - at if way > 0 else at - start

    def _find_jumps(self, distance: Array, way: int) -> tuple[Numbers, Array]:
        """Return the best frame of each scene to jump to, -1 for none, and the cost [both shape=(T, S)]."""
        count = len(distance)
        frames = np.arange(count)
        power = np.zeros((count, count))
        for shift, weight in _DYNAMICS:
            old, new = (np.clip(frames + way * (k + shift), 0, count - 1) for k in (1, 0))
            power += weight * np.square(distance[old][:, new])
        room, behind = np.full(count, -1), np.full(count, -1)
        for start, stop in self.scenes:
            later = np.arange(stop - start)
            room[start:stop], behind[start:stop] = (later[::-1], later)[::way]
        near = np.abs(frames[:, None] + way - frames) < self._least
        around = self._fade // 2 + 1
        wrong = near | (distance > JUMP_LIMIT) | (power > JUMP_LIMIT**2)
        wrong |= ((room < max(self._least, around)) | (behind < around) | self.busy)[None, :]
        wrong |= ((behind < 0) | (room < around) | self.busy)[:, None]
        power[wrong] = np.inf
        best = np.stack([start + np.argmin(power[:, start:stop], axis=1) for start, stop in self.scenes], axis=1)
        smallest = np.sqrt(np.take_along_axis(power, best, axis=1))
        return np.where(np.isfinite(smallest), best, -1), smallest


def count_fade(rate_hz: float) -> int:
    """Return the number of frames over which a jump is cross-faded, even."""
    return max(2, 2 * round(FADE_S * rate_hz / 2))


def list_scenes(allowed: NDArray[np.bool_], cuts: Sequence[int]) -> list[tuple[int, int]]:
    """Return the parts between cuts (first frame, end) of frames that may be shown [shape=(T,)]."""
    change = np.flatnonzero(np.diff(allowed.astype(int))) + 1
    ends = sorted({0, len(allowed), *change.tolist(), *(cut for cut in cuts if 0 < cut < len(allowed))})
    return [(start, stop) for start, stop in pairwise(ends) if allowed[start]]


def _make_order(runs: Sequence[tuple[int, int, int]], joins: tuple[Join, ...], count: int, fade: int) -> LoopOrder:
    """Return the order of runs (first frame, way, length), ``count`` frames of it; jumps fade smoothly (3s² − 2s³)."""
    first = np.concatenate([at + way * np.arange(length) for at, way, length in runs])[:count]
    second, weight = first.copy(), np.zeros(count)
    for join, (before, after) in zip(joins, pairwise(runs), strict=False):
        if join.kind == "jump":
            way = before[1]
            for step in range(-fade // 2, fade // 2):
                at, share = join.at + step, (step + fade / 2 + 0.5) / fade
                if 0 <= at < count:
                    first[at] = before[0] + way * (before[2] + step)
                    second[at], weight[at] = after[0] + way * step, share * share * (3 - 2 * share)
    return LoopOrder(first, second, weight, joins)
