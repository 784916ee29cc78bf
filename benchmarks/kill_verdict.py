"""Whether a run that was killed ended as it should."""

from __future__ import annotations

import json
import signal

from kill_jobs import Job

LINE = "lipmotion: stopped; run the same command again to go on"
EARLY = 0.5
"""Before this share of its usual duration, Python itself may still be starting, which knows no handlers."""


def judged(number: int, code: int, out: str, said: str, share: float, job: Job) -> tuple[str, str]:
    """Return how a killed run ended, and what is wrong with that, empty if nothing is.

    number, code : the signal, and the exit code
    out, said    : standard output and standard error
    share        : when the signal came, of the usual duration
    """
    early = not out and share < EARLY
    if number == signal.SIGKILL:
        return "killed at once", "" if code == -number else f"exit code {code}: {said}"
    if "runpy" in said or (code == -number and early):
        return "before the program had begun", ""
    if code != 128 + number:
        what = "killed without a word" if code == -number else f"exit code {code}"
        return what, f"at {share:.0%} of its duration, having said {out[-200:]!r} and {said!r}"
    return _stopped(out, said, job)


def _stopped(out: str, said: str, job: Job) -> tuple[str, str]:
    events, others = parted(out if job.events == "stdout" else said)
    if job.events and (not events or events[-1].get("type") != "failure"):
        return "no failure event", f"said {out!r} and {said!r}"
    spoken = said.splitlines() if job.events != "stderr" else others
    if spoken != [LINE] and not (job.events == "stderr" and not spoken):
        return "other words", f"said {said!r}"
    return "stopped with one line", ""


def parted(text: str) -> tuple[list[dict[str, object]], list[str]]:
    """Return the lines that are JSON objects, and the others."""
    events, others = [], []
    for line in text.splitlines():
        if line.startswith("{"):
            events.append(json.loads(line))
        else:
            others.append(line)
    return events, others
