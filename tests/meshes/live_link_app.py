"""Files as the app Live Link Face writes them, for tests."""

from pathlib import Path

import numpy as np

from lipmotion.types import Motion

COLUMNS = tuple(Path(__file__).with_name("live_link_columns.txt").read_text(encoding="ascii").split())
"""The 61 curves in the order of the app."""
HEAD = ",".join(["Timecode", "BlendShapeCount", *COLUMNS])


def timecode(time_s: float, rate: float = 60.0, mark: str = ":") -> str:
    """Return a time as ``HH:MM:SS:FF.mmm``."""
    frames, thousandth = divmod(round(time_s * rate * 1000), 1000)
    seconds, frame = divmod(frames, round(rate))
    minutes, second = divmod(seconds, 60)
    return f"{minutes // 60 % 24:02d}:{minutes % 60:02d}:{second:02d}{mark}{frame:02d}.{thousandth:03d}"


def write_take(
    path: Path, motion: Motion, times_s: np.ndarray | None = None, *, start_s: float = 62_000.0, rate: float = 60.0
) -> None:
    """Write motion as a take of the app, with rows at some times; curves that it has not are 0."""
    times_s = motion.time_s if times_s is None else times_s
    held = motion.at(times_s)
    lower = [name.lower() for name in motion.names]
    columns = [held[:, lower.index(name.lower())] if name.lower() in lower else held[:, 0] * 0 for name in COLUMNS]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(HEAD + "\n")
        for time_s, row in zip(times_s, np.stack(columns, axis=1), strict=True):
            file.write(f"{timecode(start_s + time_s, rate)},{len(COLUMNS)},{','.join(f'{v:.10f}' for v in row)}\n")
