"""Run a command and print the processor time that it took, in a unit that is the same on fast and slow machines.

    python scripts/processor_time.py [--limit LOOPS] COMMAND ...

The unit is a Python loop of ten million additions on this machine, the mean of one before and one after the command.
Processor seconds are user and system time of the command and of all children that it waited for; of these, the largest
process is printed, too (MB on Linux). The exit code is the command's; more than the limit is said, and is no failure:
how fast two cores are beside each other varies by the hour.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time

LOOP = compile("total = 0\nfor number in range(10_000_000):\n    total += number", "loop", "exec")
"""With the variables of a module: in a function the same takes half the time."""


def loop_s() -> float:
    """Return the processor seconds of a loop of ten million additions."""
    start_s = time.process_time()
    exec(LOOP, {})  # noqa: S102 - the constant above
    return time.process_time() - start_s


def main() -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--limit", type=int, help="loops that the command should take at most")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    options = parser.parse_args()
    before_s, start_s = loop_s(), time.monotonic()
    with subprocess.Popen(options.command) as process:
        while process.returncode is None:
            try:
                process.wait()
            except KeyboardInterrupt:  # the command got it, too, and tidies up
                continue
    wall_s, used = time.monotonic() - start_s, resource.getrusage(resource.RUSAGE_CHILDREN)
    unit_s, used_s = (before_s + loop_s()) / 2, used.ru_utime + used.ru_stime
    loops = used_s / unit_s
    limit = "" if options.limit is None else f", {'within' if loops <= options.limit else 'OVER'} {options.limit:,}"
    print(
        f"{' '.join(options.command)}: {used_s:,.0f} processor seconds, {loops:,.0f} loops of {unit_s:.2f} s{limit}; "
        f"{wall_s:,.0f} s by the clock; largest process {used.ru_maxrss / 1024:,.0f} MB",
        flush=True,
    )
    return process.returncode if process.returncode >= 0 else 128 - process.returncode


if __name__ == "__main__":
    sys.exit(main())
