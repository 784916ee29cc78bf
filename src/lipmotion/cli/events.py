"""What a program that runs this one is told with ``--machine-readable``: JSON objects, the last says how it ended.

This module is loaded before any signal can be answered, and loads none that takes time.
"""

from __future__ import annotations

from contextlib import suppress

TYPE_CHECKING = False
if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Sequence
    from typing import Any

OPTIONS = ("--machine-readable", "--machineReadable")
STATUS_VERBS, LINES_VERBS = ("cues",), ("corpus", "train", "evaluate", "experiment")


class Events:
    """None: nobody asked for them.

    alone : whether they take the place of what standard error would say
    """

    alone = False

    def start(self, options: Namespace) -> None:
        """Say that it starts."""

    def fail(self, reason: str, code: int) -> None:
        """Say why it ended before it was done, if nothing has said so yet."""


class Lines(Events):
    """One object a line on standard output (docs/long-work.md)."""

    def __init__(self) -> None:
        self._over = False

    def start(self, options: Namespace) -> None:  # noqa: D102, ARG002
        self.say("start")

    def say(self, kind: str, /, **fields: Any) -> None:
        """Say that something happened; nothing after the end. Raises ExportError: standard output takes no more."""
        if self._over:
            return
        from lipmotion.cli.output import refused, say_json

        try:
            say_json({"type": kind, **fields})
        except OSError as error:  # a full disk, or a reader that has gone: then there is nobody to work for
            self._over = True
            raise refused(error) from error

    def succeed(self, **figures: Any) -> None:
        """Say what came of it."""
        self.say("success", **figures)
        self._over = True

    def fail(self, reason: str, code: int) -> None:  # noqa: D102
        from lipmotion.errors import ExportError

        with suppress(ExportError):
            self.say("failure", reason=reason, exit_code=code)
        self._over = True


class Status(Events):
    """One object a line on standard error, and nothing else there: those of Rhubarb's ``--machineReadable``."""

    alone = True

    def __init__(self) -> None:
        self._over = False

    def start(self, options: Namespace) -> None:  # noqa: D102
        from lipmotion.storage.files import as_text

        name = as_text(options.speech)
        self.say("start", "Info", f'Application startup. Input file: "{name}".', file=name)

    def say(self, kind: str, level: str, message: str, **data: Any) -> None:
        """Say that something happened; nothing after the end."""
        if not self._over:
            from lipmotion.cli.output import complain_json

            complain_json({"type": kind, **data, "log": {"level": level, "message": message}})

    def succeed(self) -> None:
        """Say that all is done."""
        self.say("success", "Info", "Application terminating normally.")
        self._over = True

    def fail(self, reason: str, code: int) -> None:  # noqa: D102, ARG002
        with suppress(OSError):  # nobody is there to be told
            self.say("failure", "Fatal", f"Application terminating with error: {reason}", reason=reason)
        self._over = True


def events_of(words: Sequence[str]) -> Events:
    """Return the events that a command line asks for: known before it is parsed, so that nothing comes too early."""
    asked = any(len(word) > 2 and option.startswith(word) for option in OPTIONS for word in words)
    verb = next((word for word in words if not word.startswith("-")), "")
    if asked and verb in STATUS_VERBS:
        return Status()
    return Lines() if asked and verb in LINES_VERBS else Events()
