"""Eigenlips: principal components of mouth pictures, for each colour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.errors import InputError
from lipmotion.stats.pca import check_orthonormal, fit_pca
from lipmotion.storage.schema import Arrays, ArraySpec, check_arrays, format_errors, refuse_undeclared
from lipmotion.types import GREY, Channel

COLOURS = "rgb"
COMPONENTS = 30  # components of each colour, as in the paper
MOUTH_WIDTH, MOUTH_HEIGHT = 72, 56  # size of a mouth picture, px of a head that is upright and faces the camera
MOUTH_CORNER = (-36.0, 48.0)  # its upper left corner, px from the point between the eyes, y down
EYE_DISTANCE_PX = 90.0  # distance between the outer eye corners
Images = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Eigenlips:
    """The space of mouth pictures: of each colour a mean picture and its principal components.

    Source: Xie & Liu 2007, §5, Eqs. 12–13 (there r > d; read r < d). Deviation: the covariance is diagonalised, not the
    correlation matrix, so that Eq. 13 is the least-squares solution of Eq. 12.
    """

    mean: NDArray[np.float32]  # [shape=(3, D)], grey levels, D = height · width, row by row
    basis: NDArray[np.float32]  # [shape=(3, K, D)], orthonormal in each colour, most variance first
    explained: NDArray[np.float64]  # share of each colour's variance that they explain, in training [shape=(3,)]
    size: tuple[int, int]  # height and width of a picture, px

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The coefficients as motion channels: ``lips_r_01``, …, ``lips_b_30``."""
        numbers = range(1, self.basis.shape[1] + 1)
        return tuple(Channel(f"lips_{colour}_{number:02d}", GREY) for colour in COLOURS for number in numbers)

    @property
    def summary(self) -> str:
        """A description: number of coefficients, size of the pictures, explained variance."""
        height, width = self.size
        share = 100 * float(self.explained.mean())
        return f"{len(self.channels)} of {width} × {height} px, {share:.1f} % of the variance of the pictures"

    def project(self, images: Images) -> NDArray[np.float32]:
        """Return coefficients [shape=(T, 3·K)] of pictures: g = Aᵀ(I − Ī), Eq. 13. Raises InputError: another size."""
        _check(images, self.size)
        flat = _sort_by_colour(images)
        colours = [(flat[c] - self.mean[c]) @ self.basis[c].T for c in range(len(COLOURS))]
        return np.concatenate(colours, axis=1, dtype=np.float32)

    def restore(self, coefficients: NDArray[np.floating[Any]]) -> Images:
        """Return pictures [shape=(T, H, W, 3)]: I = Ī + Ag, Eq. 12. Raises InputError: another number of them."""
        return np.clip(np.rint(self.expand(coefficients)), 0, 255).astype(np.uint8)

    def expand(self, coefficients: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        """Return the same pictures before they are rounded, in grey levels, float32 [shape=(T, H, W, 3)]."""
        wanted = self.basis.shape[0] * self.basis.shape[1]
        if coefficients.ndim != 2 or coefficients.shape[1] != wanted:
            raise InputError(f"coefficients of shape {coefficients.shape}, required (T, {wanted}), as of project")
        parts = np.split(coefficients.astype(np.float32), len(COLOURS), axis=1)
        flat = np.stack([part @ self.basis[c] + self.mean[c] for c, part in enumerate(parts)], axis=-1)
        return flat.reshape(-1, *self.size, len(COLOURS))


def fit_eigenlips(images: Images, components: int = COMPONENTS) -> Eigenlips:
    """Return the principal components of some mouth pictures, colour by colour.

    images     : uint8 array [shape=(N, H, W, 3)]
    components : of each colour; fewer where the pictures do not span as many
    Raises InputError: not pictures, fewer than two, or all the same.
    """
    if components < 1:
        raise InputError(f"{components} components asked for, required at least 1")
    _check(images)
    flat = _sort_by_colour(images)
    spaces = [fit_pca(colour, components) for colour in flat]
    count = min(len(space.basis) for space in spaces)
    if len(images) < 2 or not count:
        raise InputError(f"{len(images)} mouth pictures, all the same; required at least two that differ")
    basis = np.stack([space.basis[:count] for space in spaces]).astype(np.float32)
    mean = np.stack([space.mean for space in spaces]).astype(np.float32)
    explained = np.zeros(len(COLOURS))
    for c, (colour, axes) in enumerate(zip(flat, basis, strict=True)):
        centred = colour - mean[c]
        explained[c] = np.square(centred @ axes.T).sum(dtype=float) / np.square(centred).sum(dtype=float)
    height, width = images.shape[1:3]
    return Eigenlips(mean, basis, explained, (height, width))


def eigenlips_to_arrays(eigenlips: Eigenlips) -> dict[str, NDArray[Any]]:
    """Return eigenlips serialised as arrays (``SIZE``, ``SPACES``)."""
    parts = {name: getattr(eigenlips, name) for name in SPACES}
    return parts | {"size": np.array(eigenlips.size)}


def eigenlips_from_arrays(arrays: Arrays, remedy: str = "train the model again") -> Eigenlips:
    """Deserialise eigenlips; ``remedy``: what to do about damaged ones. Raises ModelFormatError: they are damaged."""
    with format_errors("the eigenlips", remedy, verb="are"):
        refuse_undeclared(arrays, SIZE, SPACES)
        height, width = check_arrays(arrays, SIZE)["size"].tolist()
        spaces = check_arrays(arrays, SPACES, D=height * width)
        for basis in spaces["basis"]:
            check_orthonormal("basis", basis)
        return Eigenlips(spaces["mean"], spaces["basis"], spaces["explained"], (height, width))


SIZE = {"size": ArraySpec(np.intp, "2", 1, 10_000)}
SPACES = {
    "mean": ArraySpec(np.float32, f"{len(COLOURS)} D", 0, 255),
    "basis": ArraySpec(np.float32, f"{len(COLOURS)} K D", -1.01, 1.01),
    "explained": ArraySpec(np.float64, f"{len(COLOURS)}", 0, 1.01),
}
"""The arrays of eigenlips."""


def _sort_by_colour(images: Images) -> NDArray[np.uint8]:
    """Return pictures as rows of each colour [shape=(3, T, H·W)]."""
    return np.moveaxis(images, -1, 0).reshape(len(COLOURS), len(images), -1)


def _check(images: Images, size: tuple[int, int] | None = None) -> None:
    required = f"(T, {size[0]}, {size[1]}, 3)" if size else "(N, H, W, 3)"
    is_valid = images.ndim == 4 and images.shape[3] == len(COLOURS) and (size is None or images.shape[1:3] == size)
    if not is_valid or images.dtype != np.uint8 or not images.size:
        what = f"mouth pictures of shape {images.shape} and type {images.dtype}, required {required}, uint8"
        raise InputError(f"{what}; prepare the recordings again with mouth images")
