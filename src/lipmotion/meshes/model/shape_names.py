"""Names of blendshapes: ARKit's 52, visemes of Oculus and OpenXR, vowels of VRM; other sets as sums of ARKit's."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lipmotion.storage.sources import read_shipped_table
from lipmotion.types import Motion

_GROUPS = {row["name"]: row["group"] for row in read_shipped_table("lipmotion.meshes.model", "arkit.csv")}
ARKIT_52 = tuple(_GROUPS)  # in the order of ARKit's documentation: eyes, jaw and mouth, brows, cheeks, nose, tongue
ARKIT_MOUTH = tuple(name for name, group in _GROUPS.items() if group == "mouth")  # lips, jaw and tongue
ARKIT_OTHERS = tuple(name for name, group in _GROUPS.items() if group != "mouth")  # the other 24
VISEMES_15 = ("sil", "PP", "FF", "TH", "DD", "kk", "CH", "SS", "nn", "RR", "aa", "E", "ih", "oh", "ou")
"""The visemes of Oculus and OpenXR, in their order."""
VRM_VOWELS = ("aa", "ih", "ou", "ee", "oh")  # the mouth shapes of VRM
VRM_EMOTIONS = ("angry", "happy", "relaxed", "sad", "surprised")  # the expressions of VRM that moods use
_SPELLINGS = read_shipped_table("lipmotion.meshes.model", "spoken_names.csv")
_VISEME_SPELLINGS = {row["spelling"]: row["viseme"] for row in _SPELLINGS if row["viseme"]}
_VOWEL_SPELLINGS = {row["spelling"]: row["vowel"] for row in _SPELLINGS if row["vowel"]}
_VOWEL_SPELLINGS |= dict(zip("あいうえお", VRM_VOWELS, strict=True))
_ARKIT = {row["spelling"]: row["arkit"] for row in _SPELLINGS if row["arkit"]}
_ARKIT |= {name.lower(): name for name in ARKIT_52}
_SIDES = {"l": "left", "r": "right", "left": "left", "right": "right"}
_COPY = re.compile(
    r"(?:[._ ](?:\d{1,4}|(?i:copy|mesh|head|face|body|geo|key|value|weight|(?:mesh)?shape)))+$"
    r"|(?<=[a-z])(?:Shape|Mesh|Geo)$|_div\d$|\s*(?:\[.*\]|\(.*\)|%)$"
)
"""What programs add to a name: ``jawOpen.001``, ``jawOpen_Head``, ``jawOpenShape``, ``jawOpen [0..1]``."""


def to_arkit(name: str) -> str | None:
    """Return ARKit's name of a blendshape as files spell it, or None: ``head.mouthSmile_L`` is ``mouthSmileLeft``."""
    text = re.split(r"[.:|/]", re.sub(r"\.(?=(?i:[lr]|left|right)$)", "_", _COPY.sub("", name)))[-1]
    text = re.sub(r"(?<=[a-z])([LR])$", r"_\1", text)
    for spelled in (text, re.sub(r"^(?i:(left|right|[lr]))(?=[A-Z_ -])(.+)$", r"\2_\1", text)):  # the side may be first
        words = [word.lower() for word in re.split(r"[\s_\-]+", spelled) if word]
        for first in range(len(words)):
            joined = "".join([*words[first:-1], _SIDES.get(words[-1], words[-1])])
            if joined in _ARKIT:
                return _ARKIT[joined]
    return None


def find_viseme(name: str) -> str | None:
    """Return the Oculus name of a viseme as files spell it, or None: ``viseme_I`` and ``vrc.v_ih`` are ``ih``."""
    match = re.search(r"(?:(?:viseme|vrc\.v|v)[_.\-]|e(?=ctrlv))(\w+?)$", _COPY.sub("", name), re.I)
    return _VISEME_SPELLINGS.get(match[1].lower()) if match else None


def find_vowel(name: str) -> str | None:
    """Return the VRM name of a vowel as files spell it, or None: ``Fcl_MTH_A``, ``あ`` and ``aa`` are ``aa``."""
    match = re.search(r"(?:^|mth_|mouth_)(aa|ih|ou|ee|oh|[aiueoあいうえお])$", _COPY.sub("", name), re.IGNORECASE)
    return _VOWEL_SPELLINGS[match[1].lower()] if match else None


def find_spoken_name(name: str) -> str | None:
    """Return the viseme or vowel (``viseme_ih``, ``vowel_aa``) of a blendshape as files spell it; None: no speech."""
    viseme, vowel = find_viseme(name), find_vowel(name)
    if viseme is not None:
        return None if viseme == "sil" else f"viseme_{viseme}"
    return None if vowel is None else f"vowel_{vowel}"


def is_known(name: str) -> bool:
    """Return whether a blendshape has a known name."""
    return to_arkit(name) is not None or find_viseme(name) is not None or find_vowel(name) is not None


Array = NDArray[np.float64]
Sources = Mapping[str, tuple[tuple[str, float], ...]]  # the sources and gains of blendshapes, by ARKit's names
SIDES = ("Left", "Right")
OPENS = "jawOpen"
CLOSED = "closed"  # the name of lips that are pressed together, beside the vowels of VRM


def _read_sets() -> dict[str, Sources]:
    """Return the sets of ``shape_sets.csv``, by their names; their gains were set by eye."""
    sets: dict[str, dict[str, tuple[tuple[str, float], ...]]] = {}
    for row in read_shipped_table("lipmotion.meshes.model", "shape_sets.csv"):
        shapes, known = sets.setdefault(row["set"], {}), row["arkit"]
        shapes[known] = (*shapes.get(known, ()), (row["source"], float(row["gain"])))
    return dict(sets)


SETS = _read_sets()
"""Blendshapes of FACEGOOD-Audio2Face, of NVIDIA Audio2Face's own solver (46, in FACS), visemes, vowels of VRM (the
あ い う え お of MikuMikuDance) as ARKit's: their weights, times these, added up. Silence and gaze move nothing."""
VOWELS = SETS["vowels"]


def convert_to_arkit(motion: Motion) -> dict[str, Array]:
    """Return the weights of ARKit's blendshapes that those of another set in a motion stand for [each shape=(T,)].

    The sets are FACEGOOD's, Audio2Face's, visemes and vowels; of several the first that opens the jaw. Names of
    visemes and vowels are known in the spellings of files. Empty: there is none.
    """
    named = {name: name for name in motion.names}
    for name in motion.names:
        viseme, vowel = find_viseme(name), find_vowel(name)
        if viseme in VISEMES_15:
            named.setdefault(f"viseme_{viseme}", name)
        if vowel in VRM_VOWELS:
            named.setdefault(vowel, name)
    for table in SETS.values():
        if not any(source in named for source, _ in table[OPENS]):
            continue
        weights = {}
        for known, sources in table.items():
            curves = [gain * motion[named[name]].astype(np.float64) for name, gain in sources if name in named]
            if curves:
                weights[known] = np.asarray(np.sum(curves, axis=0))
        return weights
    return {}
