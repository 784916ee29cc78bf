"""OpenFaceFX's ``StreamingGenerator`` (PyPI ``openfacefx``): visemes of phones as they are told.

``python openfacefx_stream.py JOB.json ANSWER.json``; settings: its arguments (``look_ahead``, ``causal_smooth``), and
fields of its ``CoartParams``.
"""

import json
import sys
from dataclasses import fields
from pathlib import Path

from openfacefx.alignment import PhonemeSegment
from openfacefx.coarticulation import CoartParams
from openfacefx.streaming import StreamingGenerator

STEPS_HZ = 50.0


def answer(phones, settings):
    """Return times and weights for phones with their times, pushed one by one."""
    known = {field.name for field in fields(CoartParams)}
    params = CoartParams(**{name: value for name, value in settings.items() if name in known})
    others = {name: value for name, value in settings.items() if name not in known}
    stream = StreamingGenerator(STEPS_HZ, params=params, **others)
    frames = []
    for phone, start_s, end_s in phones:
        frames += stream.push([PhonemeSegment(phone.upper() if phone else "sil", start_s, end_s)])
    frames += stream.flush()
    columns = zip(*(values.tolist() for _, values in frames), strict=True)
    return {
        "times": [float(time_s) for time_s, _ in frames],
        "weights": dict(zip(stream.target_names, columns, strict=True)),
    }


if __name__ == "__main__":
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    answers = {each["name"]: answer(each["phones"], job["settings"]) for each in job["recordings"]}
    Path(sys.argv[2]).write_text(json.dumps(answers), encoding="utf-8")
