"""What the adapters in Python share: a job in, weights out. It needs nothing but Python, for rivals have their own."""

import json
import sys
import time
import traceback
from pathlib import Path

ABSENT = 8
"""Exit code: the rival is not installed."""
STEP_S = 0.01


def run(begin):
    """Answer the job of the command line.

    ``begin(settings)`` imports and loads the rival, and returns a function of a recording that returns times and
    weights by name; its processor seconds are measured.
    """
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    answers = {recording["name"]: [] for recording in job["recordings"]}
    for settings in job["settings"]:
        try:
            answer = begin(settings)
        except (ImportError, FileNotFoundError):
            traceback.print_exc()
            sys.exit(ABSENT)
        for recording in job["recordings"]:
            start_s = seconds()
            times, weights = answer(recording)
            columns = {name: [float(value) for value in values] for name, values in weights.items()}
            row = {"times": [float(each) for each in times], "weights": columns, "seconds": seconds() - start_s}
            answers[recording["name"]].append(row)
    Path(sys.argv[2]).write_text(json.dumps(answers), encoding="utf-8")


def seconds():
    """Return processor seconds of this process, and of programs that it has run."""
    try:
        import resource
    except ImportError:  # Windows
        return time.process_time()
    return time.process_time() + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def steps(spans, names, duration_s):
    """Return times and weights of spans ``(start_s, end_s, name)``, each of which is whole in its time."""
    times = [n * STEP_S for n in range(int(duration_s / STEP_S) + 1)]
    spans = sorted(spans)
    weights = {name: [0.0] * len(times) for name in names}
    for start_s, end_s, name in spans:
        for n in range(max(round(start_s / STEP_S), 0), min(round(end_s / STEP_S), len(times) - 1) + 1):
            weights[name][n] = 1.0
    return times, weights
