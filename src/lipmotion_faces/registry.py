"""Faces by name: the built-in ones, and those of installed packages."""

from __future__ import annotations

from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.extensions import Registry
from lipmotion.types import Prosody
from lipmotion_faces.base import Face, Stageable, Staging

_DRAWN = "lipmotion_faces.portrait"
FACES: Registry[type[Face]] = Registry(
    "face",
    "lipmotion.faces",
    {
        "portrait": f"{_DRAWN}:Portrait",
        "woman": f"{_DRAWN}:Woman",
        "man": f"{_DRAWN}:Man",
        "cartoon": f"{_DRAWN}:Cartoon",
        "head": "lipmotion_faces.head:Head",
    },
    Face,
)


def make_face(name: str = "portrait") -> Face:
    """Return a face; a name that ends in ``.svg`` is the path of a drawing in layers (docs/faces.md).

    Raises InputError: none of that name, a drawing that cannot be used, or what an installed package adds is no face.
    """
    if name.lower().endswith(".svg"):
        from lipmotion_faces.portrait.layered import LayeredFace

        return LayeredFace(Path(name))
    if name not in FACES.names:
        raise InputError(
            f"no face {name!r}; there are: {', '.join(FACES.names)}; or give a FILE.svg, a FILE.face, or a folder of "
            "drawings that is there; a 3D character: --character FILE"
        )
    return FACES.load(name)()


def is_drawings(face: str | Path, folder: Path = Path()) -> bool:
    """Return whether a face is a folder of drawings in a folder, and not the name of another face."""
    return str(face) not in FACES.names and (folder / face).is_dir()


def stage_face(face: str | Face, staging: Staging, prosody: Prosody | None = None) -> Face:
    """Return a face, or that of a name, with settings and prosody. Raises InputError: as ``make_face``; no settings."""
    if isinstance(face, str):
        face = make_face(face)
    if isinstance(face, Stageable):
        return face.with_staging(staging, prosody)
    if staging != Staging():
        kind = type(face).__name__
        raise InputError(f"the face {kind!r} has no settings, as size and background; leave them out")
    return face
