"""Sets of blendshapes other than ARKit's, as ARKit's: those of FACEGOOD and Audio2Face, visemes, the vowels of VRM.

Each blendshape of ARKit is the sum of those of the other set, times their gains. All gains were set by eye.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lipmotion.meshes.model.shape_names import VISEMES_15, VRM_VOWELS, viseme_name, vowel_name
from lipmotion.types import Motion

Array = NDArray[np.float64]
Sources = Mapping[str, tuple[tuple[str, float], ...]]
"""The sources and gains of blendshapes, by ARKit's names."""
SIDES = ("Left", "Right")
OPENS = "jawOpen"


def _by_arkit_names(forms: Mapping[str, str]) -> Sources:
    """Return the sources of blendshapes, from what each one of another set is made of: ``jawOpen 0.5 …``.

    A name that both sides of a face have, as ``mouthSmile``, stands for both.
    """
    found: dict[str, tuple[tuple[str, float], ...]] = {}
    for name, form in forms.items():
        words = form.split()
        for known, gain in zip(words[::2], words[1::2], strict=True):
            for side in SIDES if known in PAIRED else ("",):
                found[known + side] = (*found.get(known + side, ()), (name, float(gain)))
    return found


PAIRED = frozenset(("mouthSmile", "mouthStretch", "mouthPress", "mouthLowerDown", "mouthUpperUp"))
CLOSED = "closed"
"""The name of lips that are pressed together, beside the vowels of VRM."""
VOWEL_FORMS = {
    "aa": "jawOpen 0.5",
    "ih": "jawOpen 0.15 mouthStretch 0.5 mouthSmile 0.3",
    "ou": "jawOpen 0.2 mouthPucker 0.8",
    "ee": "jawOpen 0.3 mouthStretch 0.3 mouthSmile 0.3",
    "oh": "jawOpen 0.2 mouthFunnel 0.4 mouthPucker 0.3",
}
"""The vowels of VRM, which are the あ い う え お of MikuMikuDance, as blendshapes of ARKit."""
VOWELS = _by_arkit_names({**VOWEL_FORMS, CLOSED: "mouthPress 0.2"})
VISEME_FORMS = {
    "PP": "mouthPress 0.2",
    "FF": "jawOpen 0.1 mouthRollLower 0.6",
    "TH": "jawOpen 0.2 tongueOut 0.3",
    "DD": "jawOpen 0.15",
    "kk": "jawOpen 0.2",
    "CH": "jawOpen 0.15 mouthFunnel 0.3",
    "SS": "jawOpen 0.1 mouthStretch 0.3",
    "nn": "jawOpen 0.12",
    "RR": "jawOpen 0.15 mouthPucker 0.4",
    "E": "jawOpen 0.3 mouthStretch 0.3",
    **{name: VOWEL_FORMS[name] for name in ("aa", "ih", "oh", "ou")},
}
"""The visemes of Oculus and OpenXR; silence moves nothing."""
VISEMES = _by_arkit_names({f"viseme_{name}": form for name, form in VISEME_FORMS.items()})
FACEGOOD: Sources = {
    "jawOpen": (("mouth_stretch_c", 1.0), ("mouth_oh_c", 0.25)),
    "mouthFunnel": (*((f"mouth_funnel_{side}", 0.25) for side in ("dl", "dr", "ul", "ur")), ("mouth_oh_c", 0.5)),
    "mouthPucker": (("mouth_pucker_l", 0.5), ("mouth_pucker_r", 0.5), ("mouth_oo_c", 0.8)),
    "mouthRollLower": (("mouth_suck_dl", 0.5), ("mouth_suck_dr", 0.5)),
    "mouthRollUpper": (("mouth_suck_ul", 0.5), ("mouth_suck_ur", 0.5)),
    **{
        f"{known}{side}": ((f"mouth_{name}_{side[0].lower()}", 1.0),)
        for known, name in (
            ("mouthSmile", "lipCornerPull"),
            ("mouthFrown", "lipCornerDepress"),
            ("mouthStretch", "lipStretch"),
            ("mouthLowerDown", "lowerLipDepress"),
            ("mouthUpperUp", "upperLipRaise"),
            ("mouthPress", "press"),
        )
        for side in SIDES
    },
}
"""The blendshapes of FACEGOOD-Audio2Face as ARKit's: their weights, times these, added up. Set by eye."""
_OF_BOTH_SIDES = {
    "mouthSmile": "lipCornerPuller",
    "mouthFrown": "lipCornerDepressor",
    "mouthStretch": "lipStretcher",
    "mouthDimple": "dimpler",
    "mouthUpperUp": "upperLipRaiser",
    "mouthLowerDown": "lowerLipDepressor",
    "eyeBlink": "eyesClose",
    "eyeWide": "eyesUpperLidRaiser",
    "eyeSquint": "squint",
    "browDown": "browLower",
    "browOuterUp": "outerBrowRaiser",
    "cheekSquint": "cheekRaiser",
    "noseSneer": "noseWrinkler",
}
AUDIO2FACE: Sources = {
    "jawOpen": (("jawDrop", 1.0), ("jawDropLipTowards", 1.0)),
    "mouthClose": (("jawDropLipTowards", 1.0),),
    "mouthPucker": (("pucker", 1.0),),
    "mouthFunnel": (("funneler", 1.0),),
    "mouthRollUpper": (("lipSuck", 1.0),),
    "mouthRollLower": (("lipSuck", 1.0),),
    "mouthShrugLower": (("chinRaiser", 1.0),),
    "mouthPressLeft": (("lipPressor", 1.0),),
    "mouthPressRight": (("lipPressor", 1.0),),
    "jawForward": (("jawThrust", 1.0),),
    "jawLeft": (("jawSlideLeft", 1.0),),
    "jawRight": (("jawSlideRight", 1.0),),
    "mouthLeft": (("mouthSlideLeft", 1.0),),
    "mouthRight": (("mouthSlideRight", 1.0),),
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
        viseme, vowel = viseme_name(name), vowel_name(name)
        if viseme in VISEMES_15:
            named.setdefault(f"viseme_{viseme}", name)
        if vowel in VRM_VOWELS:
            named.setdefault(vowel, name)
    for table in (FACEGOOD, AUDIO2FACE, VISEMES, VOWELS):
        if not any(source in named for source, _ in table[OPENS]):
            continue
        found = {}
        for known, sources in table.items():
            curves = [gain * motion[named[name]].astype(np.float64) for name, gain in sources if name in named]
            if curves:
                found[known] = np.asarray(np.sum(curves, axis=0))
        return found
    return {}
