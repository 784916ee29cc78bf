"""A command that sends itself a signal at a chosen step of its work.

``python signalled.py NUMBER STEP ARGUMENT ...``: the number of the signal; the number of function calls after which it
is sent, counted from the installation of the handlers (0: never; -1: after ``main``; -2: when Python clears its
modules, at the very end); and the arguments of ``lipmotion``. Without a signal the file ``steps`` gets their number.
"""

import os
import sys
from pathlib import Path
from types import FrameType

from lipmotion.cli import main

RETURN_MARK, CLEARANCE_MARK = -1, -2


class Steps:
    """Counts calls, and sends a signal at one of them."""

    def __init__(self, step: int, number: int) -> None:
        self.taken = 0
        self._step, self._number = step, number
        self._listening = False

    def watch(self, frame: FrameType, event: str, _: object) -> None:
        if not self._listening:
            self._listening = event == "return" and frame.f_code.co_name == "listen"
        elif event in ("call", "c_return"):
            self.taken += 1
            if self.taken == self._step:
                os.kill(os.getpid(), self._number)


class Last:
    """Sends a signal when it is deleted."""

    def __init__(self, number: int) -> None:
        self._send = os.kill, os.getpid(), number

    def __del__(self) -> None:
        kill, process, number = self._send
        kill(process, number)


if __name__ == "__main__":
    number, step, sys.argv = int(sys.argv[1]), int(sys.argv[2]), ["lipmotion", *sys.argv[3:]]
    steps, last = Steps(step, number), Last(number) if step == CLEARANCE_MARK else None
    sys.setprofile(steps.watch)
    code = main.main()
    sys.setprofile(None)
    if step == RETURN_MARK:
        os.kill(os.getpid(), number)
    if step == 0:
        Path("steps").write_text(str(steps.taken))
    sys.exit(code)
