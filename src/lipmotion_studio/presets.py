"""Presets of exports: what each program reads (docs/for)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from lipmotion.errors import InputError, shorten
from lipmotion.pipeline.outputs.output import OutputSettings, output_suffixes
from lipmotion_faces.outputs.shown_faces import shown_face


@dataclass(frozen=True)
class Preset:
    """Files that a program reads.

    title  : programs that read the files
    curves : what motion files hold, as of ``Outputs.curves``
    fps    : frames a second of motion files and videos; None: as usual
    """

    name: str
    title: str
    files: tuple[str, ...]
    curves: str = ""
    fps: float | None = None


PRESETS = {
    each.name: each
    for each in (
        Preset("arkit", "Unreal, MetaHuman: a take of Live Link Face", (".livelink.csv",)),
        Preset("curves", "ARKit's curves as a table", (".csv",), "arkit", 60.0),
        Preset("visemes", "Oculus, Ready Player Me: visemes as a table", (".csv",), "visemes", 60.0),
        Preset("unity", "Unity", (".anim",)),
        Preset("godot", "Godot", (".tres",)),
        Preset("blender", "Blender: a script, and a take for the add-on", (".blender.py", ".livelink.csv")),
        Preset("web", "three.js and 3D programs: a moving head", (".glb",)),
        Preset("vrm", "VRM", (".vrma",)),
        Preset("moho", "Moho, OpenToonz", (".cues.dat",)),
        Preset("papagayo", "Papagayo", (".cues.pgo",)),
        Preset("rhubarb", "Rhubarb: mouth shapes", (".cues.json", ".cues.tsv")),
        Preset("spine", "Spine", (".cues.spine.json",)),
        Preset("live2d", "Live2D", (".motion3.json",)),
        Preset("video", "A video of the face", (".mp4",)),
        Preset("labels", "Praat, ELAN, subtitles", (".TextGrid", ".vtt")),
    )
}
_SUFFIX = re.compile(r"(?:\.[A-Za-z0-9]{1,10}){1,3}")


def find_preset(name: str, files: tuple[str, ...]) -> Preset:
    """Return a preset of a name, or, of an empty one, of suffixes. Raises InputError: there is none."""
    if name:
        if name not in PRESETS:
            raise InputError(f"no preset {shorten(repr(name))}; required one of: {', '.join(PRESETS)}")
        return PRESETS[name]
    known = suffixes()
    for suffix in files:
        if suffix not in known or not _SUFFIX.fullmatch(suffix):
            raise InputError(f"nothing is written as {shorten(repr(suffix))}; required some of: {' '.join(known)}")
    if not files:
        raise InputError("no preset and no files; required one of both")
    return Preset("", "", tuple(dict.fromkeys(files)))


def suffixes() -> tuple[str, ...]:
    """Return the suffixes of all files that can be exported."""
    everything = output_suffixes(OutputSettings(shown_face("head")))
    return tuple(suffix for suffix in everything if _SUFFIX.fullmatch(suffix))
