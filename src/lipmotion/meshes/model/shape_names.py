"""Names of blendshapes: ARKit's 52, visemes of Oculus and OpenXR, vowels of VRM; other sets as sums of ARKit's.

Each blendshape of ARKit is the sum of those of another set (FACEGOOD, Audio2Face, visemes, vowels), times their gains.
All gains were set by eye.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lipmotion.types import Motion
from lipmotion.units.spelling import parse_table

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
VRM_VOWELS = ("aa", "ih", "ou", "ee", "oh")  # the mouth shapes of VRM
VRM_EMOTIONS = ("angry", "happy", "relaxed", "sad", "surprised")  # the expressions of VRM that moods use
_VISEME_SPELLINGS = {"i": "ih", "o": "oh", "u": "ou"} | {name.lower(): name for name in VISEMES_15}
_VOWEL_SPELLINGS = {"a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh"} | {name: name for name in VRM_VOWELS}
_VOWEL_SPELLINGS |= dict(zip("あいうえお", VRM_VOWELS, strict=True))
_ARKIT = {name.lower(): name for name in (*ARKIT_MOUTH, *ARKIT_OTHERS)}
_SIDES = {"l": "left", "r": "right", "left": "left", "right": "right"}


_COPY = re.compile(r"(?:[._ ](?:\d{1,4}|(?i:copy|mesh|head|face|body|weight|(?:mesh)?shape)))+$|(?<=[a-z])Shape$")
"""What programs add to a name: ``jawOpen.001``, ``jawOpen_Head``, ``jawOpenShape``."""


def to_arkit(name: str) -> str | None:
    """Return ARKit's name of a blendshape as files spell it, or None: ``head.mouthSmile_L`` is ``mouthSmileLeft``."""
    text = re.sub(r"(?<=[a-z])([LR])$", r"_\1", re.split(r"[.:|]", _COPY.sub("", name))[-1])
    words = [word for word in re.split(r"[\s_\-]+", text) if word]
    for first in range(len(words)):
        rest = [word.lower() for word in words[first:]]
        joined = "".join([*rest[:-1], _SIDES.get(rest[-1], rest[-1])])
        if joined in _ARKIT:
            return _ARKIT[joined]
    return None


def find_viseme(name: str) -> str | None:
    """Return the Oculus name of a viseme as files spell it, or None: ``viseme_I`` and ``vrc.v_ih`` are ``ih``."""
    match = re.search(r"(?:viseme|vrc\.v|v)[_.\-](\w+?)$", _COPY.sub("", name), re.IGNORECASE)
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
    """Return whether a blendshape has a name that is understood."""
    return to_arkit(name) is not None or find_viseme(name) is not None or find_vowel(name) is not None


Array = NDArray[np.float64]
Sources = Mapping[str, tuple[tuple[str, float], ...]]  # the sources and gains of blendshapes, by ARKit's names
SIDES = ("Left", "Right")
OPENS = "jawOpen"


def _invert(forms: Mapping[str, str]) -> Sources:
    """Return the sources of blendshapes, from what each one of another set is made of: ``jawOpen 0.5 …``."""
    sources: dict[str, tuple[tuple[str, float], ...]] = {}
    for name, form in forms.items():
        words = form.split()
        for known, gain in zip(words[::2], words[1::2], strict=True):
            for side in SIDES if known in PAIRED else ("",):
                sources[known + side] = (*sources.get(known + side, ()), (name, float(gain)))
    return sources


PAIRED = frozenset(("mouthSmile", "mouthStretch", "mouthPress", "mouthLowerDown", "mouthUpperUp"))
CLOSED = "closed"  # the name of lips that are pressed together, beside the vowels of VRM
VOWEL_FORMS = {
    "aa": "jawOpen 0.5", "ih": "jawOpen 0.15 mouthStretch 0.5 mouthSmile 0.3", "ou": "jawOpen 0.2 mouthPucker 0.8",
    "ee": "jawOpen 0.3 mouthStretch 0.3 mouthSmile 0.3", "oh": "jawOpen 0.2 mouthFunnel 0.4 mouthPucker 0.3",
}  # fmt: skip
"""The vowels of VRM, which are the あ い う え お of MikuMikuDance, as blendshapes of ARKit."""
VOWELS = _invert({**VOWEL_FORMS, CLOSED: "mouthPress 0.4"})
VISEME_FORMS = {
    "PP": "mouthPress 0.4", "FF": "jawOpen 0.1 mouthRollLower 0.6", "TH": "jawOpen 0.2 tongueOut 0.3",
    "DD": "jawOpen 0.15", "kk": "jawOpen 0.2", "CH": "jawOpen 0.15 mouthFunnel 0.3",
    "SS": "jawOpen 0.1 mouthStretch 0.3", "nn": "jawOpen 0.12", "RR": "jawOpen 0.15 mouthPucker 0.4",
    "E": "jawOpen 0.3 mouthStretch 0.3", **{name: VOWEL_FORMS[name] for name in ("aa", "ih", "oh", "ou")},
}  # fmt: skip
"""The visemes of Oculus and OpenXR; silence moves nothing."""
VISEMES = _invert({f"viseme_{name}": form for name, form in VISEME_FORMS.items()})
FACEGOOD: Sources = {
    "jawOpen": (("mouth_stretch_c", 1.0), ("mouth_oh_c", 0.25)),
    "mouthFunnel": (*((f"mouth_funnel_{side}", 0.25) for side in ("dl", "dr", "ul", "ur")), ("mouth_oh_c", 0.5)),
    "mouthPucker": (("mouth_pucker_l", 0.5), ("mouth_pucker_r", 0.5), ("mouth_oo_c", 0.8)),
    "mouthRollLower": (("mouth_suck_dl", 0.5), ("mouth_suck_dr", 0.5)),
    "mouthRollUpper": (("mouth_suck_ul", 0.5), ("mouth_suck_ur", 0.5)),
    **{
        f"{known}{side}": ((f"mouth_{name}_{side[0].lower()}", 1.0),)
        for known, name in parse_table(
            "mouthSmile=lipCornerPull mouthFrown=lipCornerDepress mouthStretch=lipStretch "
            "mouthLowerDown=lowerLipDepress mouthUpperUp=upperLipRaise mouthPress=press"
        ).items()
        for side in SIDES
    },
}
"""The blendshapes of FACEGOOD-Audio2Face as ARKit's: their weights, times these, added up. Set by eye."""
_OF_BOTH_SIDES = parse_table(
    "mouthSmile=lipCornerPuller mouthFrown=lipCornerDepressor mouthStretch=lipStretcher mouthDimple=dimpler "
    "mouthUpperUp=upperLipRaiser mouthLowerDown=lowerLipDepressor eyeBlink=eyesClose eyeWide=eyesUpperLidRaiser "
    "eyeSquint=squint browDown=browLower browOuterUp=outerBrowRaiser cheekSquint=cheekRaiser noseSneer=noseWrinkler"
)
_OF_ONE = parse_table(
    "mouthPucker=pucker mouthFunnel=funneler mouthRollUpper=lipSuck mouthRollLower=lipSuck mouthShrugLower=chinRaiser "
    "mouthPressLeft=lipPressor mouthPressRight=lipPressor jawForward=jawThrust jawLeft=jawSlideLeft "
    "jawRight=jawSlideRight mouthLeft=mouthSlideLeft mouthRight=mouthSlideRight"
)
AUDIO2FACE: Sources = {
    "jawOpen": (("jawDrop", 1.0), ("jawDropLipTowards", 1.0)),
    "mouthClose": (("jawDropLipTowards", 1.0),),
    **{known: ((name, 1.0),) for known, name in _OF_ONE.items()},
    "browInnerUp": (("innerBrowRaiserL", 0.5), ("innerBrowRaiserR", 0.5)),
    "cheekPuff": (("cheekPuffL", 0.5), ("cheekPuffR", 0.5)),
    **{f"{known}{side}": ((f"{name}{side[0]}", 1.0),) for known, name in _OF_BOTH_SIDES.items() for side in SIDES},
}
"""The 46 blendshapes of NVIDIA Audio2Face's own solver as ARKit's, by their names in FACS; gaze is left out."""


def convert_to_arkit(motion: Motion) -> dict[str, Array]:
    """Return the weights of ARKit's blendshapes that those of another set in a motion stand for [each shape=(T,)].

    The sets are FACEGOOD's, Audio2Face's, visemes and vowels; of several the first that opens the jaw. Names of
    visemes and vowels are understood as files spell them. Empty: there is none.
    """
    named = {name: name for name in motion.names}
    for name in motion.names:
        viseme, vowel = find_viseme(name), find_vowel(name)
        if viseme in VISEMES_15:
            named.setdefault(f"viseme_{viseme}", name)
        if vowel in VRM_VOWELS:
            named.setdefault(vowel, name)
    for table in (FACEGOOD, AUDIO2FACE, VISEMES, VOWELS):
        if not any(source in named for source, _ in table[OPENS]):
            continue
        weights = {}
        for known, sources in table.items():
            curves = [gain * motion[named[name]].astype(np.float64) for name, gain in sources if name in named]
            if curves:
                weights[known] = np.asarray(np.sum(curves, axis=0))
        return weights
    return {}
