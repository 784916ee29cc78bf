"""Faces by name: the built-in ones, and those of installed packages."""

from __future__ import annotations

from lipmotion.errors import InputError
from lipmotion.extensions import Registry
from lipmotion.faces.base import Face

FACES: Registry[type[Face]] = Registry(
    "face",
    "lipmotion.faces",
    {"portrait": "lipmotion.faces.portrait:Portrait", "head": "lipmotion.faces.character:Head"},
)


def face_named(name: str = "portrait") -> Face:
    """Return a face. Raises InputError: none of that name, or what an installed package adds is no face."""
    chosen = FACES.load(name)
    if not (isinstance(chosen, type) and issubclass(chosen, Face)):
        raise InputError(f"{chosen!r} is called a face, {name!r}, by an installed package; required a class of Face")
    return chosen()
