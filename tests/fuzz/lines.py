"""Line coverage of the package: inputs that reach new lines are changed further."""

from __future__ import annotations

import sys
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import lipmotion

ROOT = str(Path(lipmotion.__file__).parent)
FREQUENT_HITS, RARE_HITS = 500, 50
"""After so many calls without a new line, a function is traced only once in so many calls."""


class LineCoverage:
    """Records every line of the package when it first runs; later runs of the line cost little."""

    def __init__(self) -> None:
        self._new: set[str] = set()

    def taken(self) -> set[str]:
        """Return the lines that first ran since the last call."""
        new, self._new = self._new, set()
        return new

    def _note(self, code: CodeType, line: int) -> None:
        self._new.add(f"{code.co_filename[len(ROOT) + 1 :]}:{line}")

    if sys.version_info >= (3, 12):

        def watch(self) -> None:
            """Start recording."""
            tool, events = sys.monitoring.COVERAGE_ID, sys.monitoring.events
            sys.monitoring.use_tool_id(tool, "fuzz")
            sys.monitoring.register_callback(tool, events.LINE, self._run)
            sys.monitoring.set_events(tool, events.LINE)

        def _run(self, code: CodeType, line: int) -> Any:
            if code.co_filename.startswith(ROOT):
                self._note(code, line)
            return sys.monitoring.DISABLE

    else:

        def watch(self) -> None:
            """Start recording."""
            self._missing: dict[CodeType, set[int]] = {}
            self._calls: dict[CodeType, int] = {}
            sys.settrace(self._called)

        def _called(self, frame: FrameType, *_: object) -> Any:
            code = frame.f_code
            missing = self._missing.get(code)
            if missing is None:
                own = code.co_filename.startswith(ROOT)
                missing = self._missing[code] = {line for *_, line in code.co_lines() if line} if own else set()
            if not missing:
                return None
            calls = self._calls[code] = self._calls.get(code, 0) + 1
            return self._run if calls < FREQUENT_HITS or calls % RARE_HITS == 0 else None

        def _run(self, frame: FrameType, *_: object) -> Any:
            missing = self._missing[frame.f_code]
            if frame.f_lineno in missing:
                missing.remove(frame.f_lineno)
                self._calls[frame.f_code] = 0
                self._note(frame.f_code, frame.f_lineno)
            return self._run if missing else None
