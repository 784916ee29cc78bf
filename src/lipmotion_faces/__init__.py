"""Faces: from motion to pictures and videos; and from videos of people to motion, by tracking.

This package stands on the core, ``lipmotion``, which finds its verbs, outputs and names as entry points.
"""

TYPE_CHECKING = False  # as in typing; a name is imported when it is first used
if TYPE_CHECKING:
    from typing import Any

    from lipmotion_faces.base import Face, Stageable, Staging
    from lipmotion_faces.registry import FACES, make_face, stage_face

__all__ = ["FACES", "Face", "Stageable", "Staging", "make_face", "stage_face"]


def __getattr__(name: str) -> "Any":
    if name not in __all__:
        raise AttributeError(f"module 'lipmotion_faces' has no attribute {name!r}")
    from importlib import import_module

    home = "base" if name in {"Face", "Stageable", "Staging"} else "registry"
    return getattr(import_module(f"lipmotion_faces.{home}"), name)
