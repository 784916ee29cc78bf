"""How a study is made, and what raters read and are asked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion_studio.study.answers import MOS, PAIRED

PREFERENCE = "preference"  # the question of a paired comparison
SCALES = {
    "smoothness": "Does the mouth move smoothly, without jumps or trembling?",
    "closure": "Do the lips close where they should, as in m, b and p, and only there?",
    "protrusion": "Are the lips pushed forward where they should be, as in oo, w and sh?",
    "turning": "Does the mouth turn from opening to closing, and back, at the right moments?",
    "overall": "All in all, how natural is the mouth with this sound?",
}
"""The criteria of Xie & Liu 2007 (section 7.3), which names them without a definition: the questions are ours."""
POINTS = ("bad", "poor", "fair", "good", "excellent")
"""Words of the points 1 to 5: the ends are the paper's, those between are of ITU-T P.800."""
QUESTIONS = {PAIRED: "In which video do the lips match the sound better?", MOS: "How good is the mouth in this video?"}
CONSENT = """You will watch short videos of a person or a drawn face speaking, and judge how the mouth moves. Some of the videos are recordings of people; in others a program makes the mouth move.
Taking part is voluntary. You may stop at any time by closing the page, without a reason.
Stored are your judgements, how often you played each video, and how long each judgement took; under a number, without your name, address or anything about your device.
You may have your judgements deleted later: tell the researcher your number, which the page shows."""  # noqa: E501
INSTRUCTIONS = {
    PAIRED: """You will see pairs of videos in which the same sentence is said. Play both to the end, with sound, as often as you like. Then choose the one in which the lips match the sound better. If you are not sure, guess.""",  # noqa: E501
    MOS: """You will see one video at a time. Play it to the end, with sound, as often as you like. Then judge the mouth on every scale, from 1 (bad) to 5 (excellent).""",  # noqa: E501
}
"""What raters are asked to do, for each kind; paragraphs are lines."""


# ruff: noqa: RUF009 (``option`` returns the field of a dataclass)


@dataclass(frozen=True)
class StudySettings(Configuration):
    """How a study is made and what raters read; what the fields mean is said by their help.

    >>> StudySettings(practice=0).anchor_ms
    400.0
    """

    title: str = option("How do the lips move?", metavar="TEXT", help="of the page (default: How do the lips move?)")
    consent: Path | None = option(
        None, kind=Path, reads="consent text", metavar="FILE", help="what raters agree to, as text (default: built in)"
    )
    instructions: Path | None = option(
        None, kind=Path, reads="instructions", metavar="FILE", help="what raters are to do, as text (default: built in)"
    )
    scales: tuple[str, ...] = option(tuple(SCALES), metavar="NAME,NAME", help=f"of --mos (default: {','.join(SCALES)})")
    practice: int = option(2, Rule(0, most=50), metavar="N", help="trials for practice (default: 2)")
    anchors: int = option(
        2, Rule(0, most=1000), metavar="N", help="sentences that are also shown out of step (default: 2)"
    )
    anchor_ms: float = option(
        400.0, Rule(50, most=5000), metavar="MS", help="how late the sound is in them (default: 400)"
    )
    checks: int = option(1, Rule(0, most=100), metavar="N", help="pages that tell what to answer (default: 1)")
    face: str = option(
        "portrait", reads="face", metavar="NAME|FILE.face", help="that motion is drawn with (default: portrait)"
    )
    fps: float | None = option(None, Rule(1, most=120), kind=float, help="frames per second of drawn videos")
    recogniser: str = option("auto", metavar="KIND", help="of models, as of animate (default: auto)")
    seed: int = option(0, Rule(0), metavar="N", help="another order of trials (default: 0)")

    def __post_init__(self) -> None:
        super().__post_init__()
        unknown = [name for name in self.scales if name not in SCALES]
        if unknown or not self.scales or len(set(self.scales)) < len(self.scales):
            raise InputError(f"the scales {','.join(self.scales)}, required some of {','.join(SCALES)}, each once")
