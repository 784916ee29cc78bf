"""``xml``: metadata, and one element per cue with its start and end."""

from __future__ import annotations

import re
from html import escape

from lipmotion.export.cues.cue_lines import cue_time, shape_of, sheet_of
from lipmotion.export.cues.sheet import CUES_FPS, CueSheet
from lipmotion.units.mouth_chart import LETTERS

_NOT_XML = re.compile("[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_CONTROL = re.compile("[\t\n\x7f]")
"""Characters that XML 1.0 cannot hold, and those that it would change."""
_CUE = re.compile(r"<mouthCue\s+start=\"([^\"<]{0,40})\"\s+end=\"([^\"<]{0,40})\"\s*>([^<]{0,40})</mouthCue>")


def text(sheet: CueSheet, sound_file: str) -> str:
    """Return the content of the file, in ASCII; characters that XML cannot hold are escaped as in Python."""
    name = _NOT_XML.sub(lambda match: match[0].encode("unicode_escape").decode(), sound_file)
    name = _CONTROL.sub(lambda match: f"&#{ord(match[0])};", escape(name, quote=False))
    cues = "".join(
        f'    <mouthCue start="{cue.start_s:.2f}" end="{cue.end_s:.2f}">{cue.label}</mouthCue>\n' for cue in sheet.cues
    )
    document = (
        '<?xml version="1.0" encoding="utf-8"?>\n<rhubarbResult>\n  <metadata>\n'
        f"    <soundFile>{name}</soundFile>\n    <duration>{sheet.duration_s:.2f}</duration>\n"
        f"  </metadata>\n  <mouthCues>\n{cues}  </mouthCues>\n</rhubarbResult>\n"
    )
    return document.encode("ascii", "xmlcharrefreplace").decode()


def parse(text: str) -> CueSheet:
    """Return the cues of a file. Raises InputError: there is none, or one is none, with its number."""
    rows, end_s = [], 0.0
    for number, found in enumerate(_CUE.finditer(text), 1):
        place = f"cue {number}"
        rows.append((cue_time(found[1], place), shape_of(found[3], LETTERS, place)))
        end_s = cue_time(found[2], place)
    return sheet_of(rows, end_s, CUES_FPS)
