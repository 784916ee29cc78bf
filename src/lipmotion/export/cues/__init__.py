"""Motion → held mouth shapes for 2D animation: Rhubarb's formats and Moho's."""

from lipmotion.export.cues.base import CUE_FORMATS, format_of, write_cue_file
from lipmotion.export.cues.choose import choose_cues
from lipmotion.export.cues.sheet import CueSheet
from lipmotion.units.mouth_chart import OPTIONAL, SHAPES

__all__ = ["CUE_FORMATS", "OPTIONAL", "SHAPES", "CueSheet", "choose_cues", "format_of", "write_cue_file"]
