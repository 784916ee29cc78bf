"""What raters are asked: the scales of mean opinion scores, the words of their points, and the texts of the page."""

from __future__ import annotations

from dataclasses import dataclass

from lipmotion_studio.study.answers import MOS, PAIRED, RANKING

PREFERENCE, MATCH = "preference", "match"
"""Questions of a paired comparison, and of a ranking."""


@dataclass(frozen=True)
class OpinionScale:
    """A five-point scale.

    title : its name, as raters read it
    asks  : the question
    """

    title: str
    asks: str


SCALES = {
    "smoothness": OpinionScale("Smoothness", "Does the mouth move smoothly, without jumps or trembling?"),
    "closure": OpinionScale("Closure", "Do the lips close where they should, as in m, b and p, and only there?"),
    "protrusion": OpinionScale("Protrusion", "Are the lips pushed forward where they should be, as in oo, w and sh?"),
    "turning": OpinionScale("Turning", "Does the mouth turn from opening to closing, and back, at the right moments?"),
    "overall": OpinionScale("Overall", "All in all, how natural is the mouth with this sound?"),
}
"""The criteria of Xie & Liu 2007 (section 7.3), which names them without a definition: the questions are ours."""
POINTS = ("bad", "poor", "fair", "good", "excellent")
"""Words of the points 1 to 5: the ends are the paper's, those between are of ITU-T P.800."""
ASKED = {
    PAIRED: "In which video do the lips match the sound better?",
    MOS: "How good is the mouth in this video?",
    RANKING: "How well do the lips match the sound? 0 is not at all, 100 is perfectly.",
}
"""The question of a page, for each kind."""
CONSENT = """You will watch short videos of a person or a drawn face speaking, and judge how the mouth moves. Some of the videos are recordings of people; in others a program makes the mouth move.
Taking part is voluntary. You may stop at any time by closing the page, without a reason.
Stored are your judgements, how often you played each video, and how long each judgement took; under a number, without your name, address or anything about your device.
You may have your judgements deleted later: tell the researcher your number, which the page shows."""  # noqa: E501
INSTRUCTIONS = {
    PAIRED: """You will see pairs of videos in which the same sentence is said. Play both to the end, with sound, as often as you like. Then choose the one in which the lips match the sound better. If you are not sure, guess.""",  # noqa: E501
    MOS: """You will see one video at a time. Play it to the end, with sound, as often as you like. Then judge the mouth on every scale, from 1 (bad) to 5 (excellent).""",  # noqa: E501
    RANKING: """You will see several videos of one sentence on a page. Play each to the end, with sound, as often as you like. Then set the slider of each between 0 (the lips do not match the sound at all) and 100 (they match it perfectly).""",  # noqa: E501
}
"""What raters are asked to do, for each kind; paragraphs are lines."""
