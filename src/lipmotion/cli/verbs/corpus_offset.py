"""``lipmotion corpus offset``: by how much one recording of a sound is later than another one."""

from __future__ import annotations

import argparse

from lipmotion.cli.arguments.paths import add_input
from lipmotion.cli.terminal.printing import print_line


def add(actions: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the action to ``lipmotion corpus``."""
    parser = actions.add_parser("offset", help="measure by how much a separate recording of the sound is late")
    add_input(parser, "camera", what="recording", help="the recording that is in step with the motion: video or sound")
    add_input(parser, "recorder", what="recording", help="the separate recording of the same sound")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Call ``sound_offset``; print the offset and how it was found."""
    from lipmotion.speech.sound.audio_files import read_audio
    from lipmotion.speech.sound.sound_offset import sound_offset

    found = sound_offset(read_audio(options.camera), read_audio(options.recorder))
    print_line(f"--offset-ms {found.late_s * 1000:.1f}  (by {found.how}; levels correlate by {found.alike:.2f})")
