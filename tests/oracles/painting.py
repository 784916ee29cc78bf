"""A textured band, all pixels at once: the definition of ``painting.paint_band`` in the kernels, to the bit."""

import numpy as np

from lipmotion_faces.kernels.painting import Floats, Layer


def paint_band(layer: Layer, top: Floats, bottom: Floats, across: Floats, texture: Floats) -> None:
    row = np.arange(len(layer))[:, None].astype(np.float64)
    cover = np.zeros(layer.shape[:2])
    for upper, lower in zip(top, bottom, strict=True):
        cover += np.maximum(np.minimum(lower, row + 1) - np.maximum(upper, row), 0)
    cover = cover / len(top)
    start, end = top[0].copy(), bottom[0].copy()
    for upper, lower in zip(top[1:], bottom[1:], strict=True):
        start += upper
        end += lower
    start, end = start / len(top), end / len(top)
    depth = np.minimum(np.maximum((row + 0.5 - start) / np.maximum(end - start, 1e-3), 0), 1)
    down, beside = depth * (texture.shape[0] - 1), across * (texture.shape[1] - 1)
    d0 = np.minimum(down.astype(np.int64), max(texture.shape[0] - 2, 0))
    u0 = np.minimum(beside.astype(np.int64), max(texture.shape[1] - 2, 0))
    d1, u1 = np.minimum(d0 + 1, texture.shape[0] - 1), np.minimum(u0 + 1, texture.shape[1] - 1)
    fd, fu = (down - d0)[..., None], (beside - u0)[:, None]
    upper_row = texture[d0, u0] + fu * (texture[d0, u1] - texture[d0, u0])
    lower_row = texture[d1, u0] + fu * (texture[d1, u1] - texture[d1, u0])
    texel = upper_row + fd * (lower_row - upper_row)
    opacity = cover * texel[..., 3]
    texel[..., 3] = 1
    layer += (opacity[..., None] * (texel - layer)).astype(np.float32)
