"""What NVIDIA Audio2Face exports as JSON: weights of blendshapes, one row a frame.

``facsNames`` names the columns of ``weightMat``: ARKit's 52 names, or the 46 of Audio2Face's own solver, which
``meshes.fitting.blendshape_motion`` understands.

Source: NVIDIA, "Audio2Face, Export" and "Blendshape conversion"; files of version 2022 and 2023.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from lipmotion.errors import InputError, shortened
from lipmotion.export.motion.json_stream import read_members
from lipmotion.types import WEIGHT, Channel, Motion, Timeline, Unit

NAMES, WEIGHTS, RATE, SOUND, POSES, FRAMES = (
    *("facsNames", "weightMat", "exportFps", "trackPath", "numPoses", "numFrames"),
)
"""The members of a file."""


def is_audio2face(text: str) -> bool:
    """Return whether a text may be such a file: it has the names of its two main members."""
    return f'"{NAMES}"' in text and f'"{WEIGHTS}"' in text


def audio2face_motion(text: str) -> tuple[Motion, Timeline[Unit]]:
    """Return the weights of a file, and an empty timeline. Joints, where a file has them, are passed over.

    Raises InputError: not such a file, no rate, or rows that do not fit the names.
    """
    try:
        document = read_members(text, WEIGHTS)
        names, rows, rate_hz = document[NAMES], document[WEIGHTS], float(document[RATE])
    except KeyError as error:
        raise InputError(f"not a file of Audio2Face: it has no {error}; export it again as JSON") from error
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"not JSON ({error}); export it again") from error
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"the file of Audio2Face is damaged ({error}); export it again") from error
    return Motion(_checked_rows(names, rows), rate_hz, tuple(Channel(name, WEIGHT) for name in names)), Timeline(())


def _checked_rows(names: Any, rows: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"the member {NAMES!r} is {shortened(repr(names)[:200])}, required a list of names")
    if not isinstance(rows, np.ndarray) or rows.ndim != 2 or rows.shape[1] != len(names):
        shape = rows.shape if isinstance(rows, np.ndarray) else "no"
        raise InputError(
            f"the member {WEIGHTS!r} has {shape} rows and columns, required a column for each of {NAMES!r}"
        )
    return rows
