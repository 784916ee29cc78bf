"""The characters that are drawn, in ``characters.json``: the woman of the first version, a man, a cartoon."""

from __future__ import annotations

import json
from importlib import resources
from types import SimpleNamespace
from typing import Any

from lipmotion_faces.portrait.design import Design, EyeDesign, LipDesign, Lock, close_curve, mirror_curve

PARTS = {"palette": SimpleNamespace, "lips": LipDesign, "eyes": EyeDesign}


def _read_design(drawn: dict[str, Any]) -> Design:
    """Return the design of a character: its parts, its outlines, closed or mirrored, its colours, else the woman's."""
    values: dict[str, Any] = drawn | {"palette": _DRAWN["woman"]["palette"] | drawn["palette"]}
    values |= {name: kind(**_as_tuples(values[name])) for name, kind in PARTS.items() if name in drawn}
    values |= {name: close_curve(drawn[name]) for name in ("neck", "shoulders")}
    values |= {name: mirror_curve(drawn[name]) for name in ("cap", "hair_behind") if name in drawn}
    values["collar"] = tuple(map(close_curve, drawn.get("collar", ())))
    values["hair"] = tuple(
        Lock(**_as_tuples(each) | {"outline": close_curve(each["outline"])}) for each in drawn["hair"]
    )
    return Design(**values)


def _as_tuples(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _as_tuples(each) for name, each in value.items()}
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


_DRAWN = json.loads(resources.files(__package__).joinpath("characters.json").read_text(encoding="ascii"))
WOMAN, MAN, CARTOON = (_read_design(_DRAWN[name]) for name in ("woman", "man", "cartoon"))
