"""Faces that are none, and what does not go with a face."""

import shutil

import numpy as np

from robustness.case import Bench, case, npy
from speech.sounds import tone, write_sound

GROUP = "faces"


def _face(
    name: str, code: int, messages: tuple[str, ...], changes: dict[str, bytes | None], /, **header: object
) -> None:
    """Add a case of the good face with other members or another header."""

    @case(GROUP, name, code, *messages)
    def _(bench: Bench) -> list[object]:
        changed = bench.changed_model(changes, bench.face, **header).rename(bench.folder / "changed.face")
        return bench.animate(None, "--face", changed, output="a.mp4")


case(GROUP, "a model named .face", 6, "not a face; give a file that `lipmotion face build` wrote")(
    lambda bench: ["face", "info", shutil.copy(bench.model, bench.folder / "a.face")]
)


_face("a newer face", 6, ("face version 9, this lipmotion reads version 1; upgrade lipmotion",), {}, version=9)
_face("without its mouths", 6, ("mouths is missing", "build"), {"appearance/mouths.npy": None})
_face("a background of zeros", 6, ("damaged",), {"background/data.npy": npy(np.zeros(5000, np.uint8))})
_face("pickled objects", 6, ("damaged",), {"appearance/light.npy": npy(np.array([{}, {}, {}], object))})


@case(GROUP, "an output in the place of the face", 7, "is the face itself; give another name")
def _(bench: Bench) -> list[object]:
    face = shutil.copy(bench.face, bench.folder / "b.face")
    return bench.animate(None, "--face", face, output=face)


@case(GROUP, "several people", 3, "2 speakers, a face is that of one person; name it (--speaker): anna, ben")
def _(bench: Bench) -> list[object]:
    for name in ("anna", "ben"):
        (bench.folder / name).mkdir()
        write_sound(bench.folder / name / "a.mkv", tone(16_000), 16_000, "flac", video=True)
    return ["face", "build", bench.folder, "-o", "a.face"]
