"""How a study is made, and what raters read."""
# ruff: noqa: RUF009 (``option`` returns the field of a dataclass)

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lipmotion.errors import InputError
from lipmotion.types.configuration import Configuration, Rule, option
from lipmotion_studio.study.questions import SCALES
from lipmotion_studio.study.region import Region


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
    region: str = option(
        "",
        metavar="LEFT,TOP,WIDTH,HEIGHT",
        help="show only this part, as of the mouth, in shares of width and height (default: the whole picture)",
    )
    face: str = option(
        "portrait", reads="face", metavar="NAME|FILE.face", help="that motion is drawn with (default: portrait)"
    )
    fps: float | None = option(None, Rule(1, most=120), kind=float, help="frames per second of drawn videos")
    recogniser: str = option("auto", metavar="KIND", help="of models, as of animate (default: auto)")
    seed: int = option(0, Rule(0), metavar="N", help="another order of trials (default: 0)")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.shown_region  # noqa: B018 (raises)
        unknown = [name for name in self.scales if name not in SCALES]
        if unknown or not self.scales or len(set(self.scales)) < len(self.scales):
            raise InputError(f"the scales {','.join(self.scales)}, required some of {','.join(SCALES)}, each once")

    @property
    def shown_region(self) -> Region:
        """The part of the pictures that is shown. Raises InputError: not a region."""
        return Region.parsed(self.region)
