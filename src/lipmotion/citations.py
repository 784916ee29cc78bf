"""What to cite: the BibTeX entries of ``citations.bib``, and which of them an engine or a model rests on."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources
from typing import Any

LIPMOTION, EIGENLIPS, ADAPTATION, GRID = "lipmotion", "xieliu2007", "gales1998", "cooke2006"
"""Keys of the software itself, of the methods of eigenlips and of adaptation, and of the GRID corpus."""
ENGINE_KEYS: Mapping[str, tuple[str, ...]] = {
    "trajectory": ("hofer2008", "tokuda2000", "tokuda1999", "shinoda2000", "fujinaga2001", "silen2012"),
    "coupled": ("xieliu2007", "tokuda2000", "fujinaga2001", "silen2012"),
    "selection": ("minnisbreen2000", "verhelst1993"),
    "joint": ("hofer2008", "tokuda2000", "tokuda1999", "shinoda2000"),
}
"""Keys of the papers that each built-in engine implements, with its default options."""


@cache
def bibliography() -> Mapping[str, str]:
    """Return all BibTeX entries by citation key, in the order of ``citations.bib``."""
    text = (resources.files("lipmotion") / "citations.bib").read_text(encoding="utf-8")
    entries = [entry.strip() for entry in re.split(r"^(?=@)", text, flags=re.MULTILINE) if entry.strip()]
    return {entry[entry.index("{") + 1 : entry.index(",")]: entry for entry in entries}


def list_engine_citations(name: str) -> str:
    """Return the BibTeX entries of lipmotion and of an engine's papers; of another package's engine, a remark."""
    return _entries((LIPMOTION, *ENGINE_KEYS.get(name, ())), _list_engine_remarks(name))


def list_model_citations(header: Mapping[str, Any]) -> str:
    """Return the BibTeX entries of lipmotion, of a model's engine and methods, and of the corpus that it learned from.

    header : of a model file. Recordings other than those of GRID are named in a BibTeX comment
    """
    engine = str(header.get("engine"))
    attribution = header.get("attribution") or []
    owners = [
        " ".join(str(owner).split()) for owner in (attribution if isinstance(attribution, list) else [attribution])
    ]
    others = [owner for owner in owners if "GRID corpus" not in owner]
    keys = [LIPMOTION, *ENGINE_KEYS.get(engine, ())]
    if header.get("visual", "geometry") != "geometry":
        keys.append(EIGENLIPS)
    if "adapted" in header:
        keys.append(ADAPTATION)
    if len(others) < len(owners):
        keys.append(GRID)
    return _entries(keys, [*_list_engine_remarks(engine), *(f"% recordings: {owner}" for owner in others)])


def _list_engine_remarks(name: str) -> list[str]:
    """Return a BibTeX comment for an engine of another package; nothing for a built-in one."""
    if name in ENGINE_KEYS:
        return []
    return [f"% the engine {name!r} comes with another package: cite what its documentation names"]


def _entries(keys: Iterable[str], remarks: Iterable[str]) -> str:
    """Return the entries of some keys, each once, and the remarks, separated by empty lines."""
    return "\n\n".join([*(bibliography()[key] for key in dict.fromkeys(keys)), *remarks])
