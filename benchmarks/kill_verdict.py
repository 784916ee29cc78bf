"""Verdict on a killed run: whether it ended as it should."""

from __future__ import annotations

import json
import signal

from kill_jobs import Job

LINE = "lipmotion: stopped; run the same command again to go on"
EARLY_SHARE = 0.5
"""Before this share of its usual duration, Python may still be starting, without the program's signal handlers."""


def verdict(number: int, code: int, out: str, err: str, share: float, job: Job) -> tuple[str, str]:
    """Return how a killed run ended, and what is wrong with it; an empty text if nothing is.

    number, code : the signal, and the exit code
    out, err     : standard output and standard error
    share        : time of the signal relative to the usual duration
    """
    early = not out and share < EARLY_SHARE
    if number == signal.SIGKILL:
        return "killed at once", "" if code == -number else f"exit code {code}: {err}"
    if "runpy" in err or (code == -number and early):
        return "before the program had begun", ""
    if code != 128 + number:
        what = "killed without a word" if code == -number else f"exit code {code}"
        return what, f"at {share:.0%} of its duration, with output {out[-200:]!r} and {err!r}"
    return _stopped(out, err, job)


def _stopped(out: str, err: str, job: Job) -> tuple[str, str]:
    events, others = events_and_lines(out if job.events == "stdout" else err)
    if job.events and (not events or events[-1].get("type") != "failure"):
        return "no failure event", f"said {out!r} and {err!r}"
    lines = err.splitlines() if job.events != "stderr" else others
    if lines != [LINE] and not (job.events == "stderr" and not lines):
        return "other words", f"said {err!r}"
    return "stopped with one line", ""


def events_and_lines(text: str) -> tuple[list[dict[str, object]], list[str]]:
    """Return the JSON objects among the lines, and the other lines."""
    events, others = [], []
    for line in text.splitlines():
        if line.startswith("{"):
            events.append(json.loads(line))
        else:
            others.append(line)
    return events, others
