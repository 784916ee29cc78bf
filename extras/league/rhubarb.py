"""Rhubarb Lip Sync: mouth shapes of sound. Settings: ``program``, ``recognizer`` (``phonetic``, ``pocketSphinx``)."""

import json
import os
import shutil
import subprocess

from jobs import run, steps

SHAPES = "ABCDEFGHX"


def begin(settings):
    """Return a function that runs the program once for each recording."""
    program = shutil.which(os.environ.get("LIPMOTION_RHUBARB", "rhubarb"))
    if program is None:
        raise FileNotFoundError("rhubarb")

    def answer(recording):
        command = [program, "-q", "-f", "json", "--threads", "1", "-r", settings["recognizer"], recording["sound"]]
        cues = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["mouthCues"]
        spans = [(cue["start"], cue["end"], cue["value"]) for cue in cues]
        return steps(spans, SHAPES, recording["duration_s"])

    return answer


run(begin)
