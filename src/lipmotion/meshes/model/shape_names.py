"""Names of blendshapes: ARKit's 52, the 15 visemes of Oculus and OpenXR, the vowels of VRM, and how files spell
them."""

from __future__ import annotations

import re

ARKIT_MOUTH = (
    *("jawForward", "jawLeft", "jawRight", "jawOpen", "mouthClose", "mouthFunnel", "mouthPucker"),
    *("mouthLeft", "mouthRight", "mouthSmileLeft", "mouthSmileRight", "mouthFrownLeft", "mouthFrownRight"),
    *("mouthDimpleLeft", "mouthDimpleRight", "mouthStretchLeft", "mouthStretchRight", "mouthRollLower"),
    *("mouthRollUpper", "mouthShrugLower", "mouthShrugUpper", "mouthPressLeft", "mouthPressRight"),
    *("mouthLowerDownLeft", "mouthLowerDownRight", "mouthUpperUpLeft", "mouthUpperUpRight", "tongueOut"),
)
"""ARKit's blendshapes of lips, jaw and tongue, in the order of its documentation."""
ARKIT_OTHERS = (
    *("eyeBlinkLeft", "eyeLookDownLeft", "eyeLookInLeft", "eyeLookOutLeft", "eyeLookUpLeft", "eyeSquintLeft"),
    *("eyeWideLeft", "eyeBlinkRight", "eyeLookDownRight", "eyeLookInRight", "eyeLookOutRight", "eyeLookUpRight"),
    *("eyeSquintRight", "eyeWideRight", "browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft"),
    *("browOuterUpRight", "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "noseSneerLeft", "noseSneerRight"),
)
"""The other 24 of ARKit's 52."""
ARKIT_52 = (*ARKIT_OTHERS[:14], *ARKIT_MOUTH[:-1], *ARKIT_OTHERS[14:], ARKIT_MOUTH[-1])
"""All of them, in the order of ARKit's documentation: eyes, jaw and mouth, brows, cheeks, nose, tongue."""
VISEMES_15 = ("sil", "PP", "FF", "TH", "DD", "kk", "CH", "SS", "nn", "RR", "aa", "E", "ih", "oh", "ou")
"""The visemes of Oculus and OpenXR, in their order."""
VRM_VOWELS = ("aa", "ih", "ou", "ee", "oh")
"""The mouth shapes of VRM."""
VRM_EMOTIONS = ("angry", "happy", "relaxed", "sad", "surprised")
"""The expressions of VRM that moods use."""
_VISEME_SPELLINGS = {"i": "ih", "o": "oh", "u": "ou"} | {name.lower(): name for name in VISEMES_15}
_VOWEL_SPELLINGS = {"a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh"} | {name: name for name in VRM_VOWELS}
_VOWEL_SPELLINGS |= dict(zip("あいうえお", VRM_VOWELS, strict=True))
_ARKIT = {name.lower(): name for name in (*ARKIT_MOUTH, *ARKIT_OTHERS)}
_SIDES = {"l": "left", "r": "right", "left": "left", "right": "right"}


_COPY = re.compile(r"[._ ]\d{1,4}$")
"""What programs add to a name that is there already: ``jawOpen.001``."""


def arkit_name(name: str) -> str | None:
    """Return ARKit's name of a blendshape as files spell it, or None.

    ``head.mouthSmile_L``, ``Face_mouthSmileL`` and ``mouth_smile_left.001`` are ``mouthSmileLeft``.
    """
    text = re.sub(r"(?<=[a-z])([LR])$", r"_\1", re.split(r"[.:|]", _COPY.sub("", name))[-1])
    words = [word for word in re.split(r"[\s_\-]+", text) if word]
    for first in range(len(words)):
        rest = [word.lower() for word in words[first:]]
        joined = "".join([*rest[:-1], _SIDES.get(rest[-1], rest[-1])])
        if joined in _ARKIT:
            return _ARKIT[joined]
    return None


def viseme_name(name: str) -> str | None:
    """Return the Oculus name of a viseme as files spell it, or None: ``viseme_I`` and ``vrc.v_ih`` are ``ih``."""
    found = re.search(r"(?:viseme|vrc\.v|v)[_.\-](\w+?)$", _COPY.sub("", name), re.IGNORECASE)
    return _VISEME_SPELLINGS.get(found[1].lower()) if found else None


def vowel_name(name: str) -> str | None:
    """Return the VRM name of a vowel as files spell it, or None: ``Fcl_MTH_A``, ``あ`` and ``aa`` are ``aa``."""
    found = re.search(r"(?:^|mth_|mouth_)(aa|ih|ou|ee|oh|[aiueoあいうえお])$", _COPY.sub("", name), re.IGNORECASE)
    return _VOWEL_SPELLINGS[found[1].lower()] if found else None


def spoken_name(name: str) -> str | None:
    """Return the viseme or vowel of a blendshape, but for silence, or None.

    ``viseme_I`` is ``viseme_ih``, ``Fcl_MTH_A`` is ``vowel_aa``.
    """
    viseme, vowel = viseme_name(name), vowel_name(name)
    if viseme is not None:
        return None if viseme == "sil" else f"viseme_{viseme}"
    return None if vowel is None else f"vowel_{vowel}"


def is_known(name: str) -> bool:
    """Return whether a blendshape has a name that is understood."""
    return arkit_name(name) is not None or viseme_name(name) is not None or vowel_name(name) is not None
