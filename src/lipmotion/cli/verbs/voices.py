"""The list of installed voices, of ``lipmotion speak --voices``."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lipmotion.cli.terminal.progress import Report


def list_voices(report: Report) -> None:
    """Report the installed voices, one a line, with their languages."""
    from lipmotion.speech.voices.installed import all_voices

    voices = all_voices()
    report.finish(
        "\n".join(f"{voice.full_name:28} {voice.language}" for voice in voices) or "no voice is installed",
        voices=[{"name": voice.full_name, "language": voice.language} for voice in voices],
    )
