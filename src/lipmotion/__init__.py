"""Speech in, lip motion out.

>>> import lipmotion
>>> result = lipmotion.animate("examples/welcome.flac")
>>> opening = result.motion["opening"]  # 100 values a second, in distances between the outer eye corners
>>> lipmotion.write(result, ["welcome.mp4", "welcome.json"], speech="examples/welcome.flac")  # doctest: +SKIP

A name is imported when it is first used, from where ``__init__.pyi`` says: so ``import lipmotion`` alone is fast.
"""

from __future__ import annotations

TYPE_CHECKING = False  # as in typing, whose import would delay the answer to Ctrl-C
if TYPE_CHECKING:
    from typing import Any

_HOMES: dict[str, str] = {}
"""The module of each public name, once one of them is used."""
_ADDED = (
    *("FilmedFace", "SessionPictures", "analyse_study", "build_face", "compare", "evaluate", "load_face"),
    *("map_onto", "prepare", "save_face"),
)
"""Names that the packages of faces, studio and lab provide (entry points of the group ``lipmotion.names``)."""


def _find_homes() -> dict[str, str]:
    """Return the module of each public name, as the stub of this module imports them."""
    if not _HOMES:
        from ast import ImportFrom, parse
        from pathlib import Path

        for node in parse(Path(__file__).with_suffix(".pyi").read_text(encoding="ascii")).body:
            if isinstance(node, ImportFrom) and node.module != "typing":
                _HOMES.update({alias.name: str(node.module) for alias in node.names})
    return _HOMES


def __getattr__(name: str) -> Any:
    homes = _find_homes()
    if name == "__all__":
        return sorted(homes)
    if name in _ADDED:
        from lipmotion.extensions import load_provided

        value = load_provided(name)
    elif name in homes:
        from importlib import import_module

        value = getattr(import_module(homes[name]), name)
    else:
        raise AttributeError(f"module 'lipmotion' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*_find_homes(), *_ADDED]
