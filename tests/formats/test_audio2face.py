import json
from pathlib import Path

import numpy as np
import pytest

from formats.examples import of_motion, written
from lipmotion import read_motion
from lipmotion.errors import InputError
from lipmotion.meshes.fitting.blendshape_motion import arkit_weights, with_mouth
from lipmotion.meshes.model.shape_names import ARKIT_52
from lipmotion.types import WEIGHT, Channel, Motion

OWN = {"exportFps": 30, "trackPath": "talk.wav", "numPoses": 4, "numFrames": 2}
OWN |= {"facsNames": ["jawDrop", "jawDropLipTowards", "lipCornerPullerL", "eyesCloseR"], "joints": ["jaw"]}
OWN |= {"weightMat": [[0.0, 0.0, 0.25, 0.0], [0.5, 0.25, 0.0, 1.0]], "rotations": [[[0, 0, 0, 1]], [[0, 0, 0, 1]]]}


def file(folder: Path, document: object, name: str = "a.json") -> Path:
    (folder / name).write_text(json.dumps(document), encoding="utf-8")
    return folder / name


def test_its_members_are_those_of_the_program(tmp_path: Path) -> None:
    draw = np.random.default_rng(3)
    moved = Motion(draw.random((61, 2)), 60.0, (Channel("jawOpen", WEIGHT), Channel("eyeBlinkLeft", WEIGHT)))
    path = written(tmp_path / "a.a2f.json", of_motion(moved), path="b/talk.wav")
    document = json.loads(path.read_text(encoding="utf-8"))
    assert {name: document[name] for name in ("exportFps", "trackPath", "numPoses", "numFrames")} == {
        "exportFps": 60, "trackPath": "b/talk.wav", "numPoses": 52, "numFrames": 61,
    }  # fmt: skip
    assert document["facsNames"] == list(ARKIT_52)
    assert (document["facsNames"][0], document["facsNames"][17], len(set(ARKIT_52))) == ("eyeBlinkLeft", "jawOpen", 52)
    assert np.array(document["weightMat"])[:, 17] == pytest.approx(moved["jawOpen"], abs=1e-5)
    for name in ("a.a2f.json", "talk_bsweight.json"):
        (tmp_path / name).write_text(json.dumps(document), encoding="utf-8")
        again, units = read_motion(tmp_path / name)
        assert (again.rate_hz, len(units), again.names) == (60.0, 0, ARKIT_52)
        assert again["eyeBlinkLeft"] == pytest.approx(moved["eyeBlinkLeft"], abs=1e-5)


def test_the_names_of_its_own_solver_are_understood(tmp_path: Path) -> None:
    motion, _ = read_motion(file(tmp_path, OWN))
    known = arkit_weights(motion)
    assert {name: curve.tolist() for name, curve in known.items() if curve.any()} == {
        "jawOpen": [0.0, 0.75], "mouthClose": [0.0, 0.25], "mouthSmileLeft": [0.25, 0.0], "eyeBlinkRight": [0.0, 1.0],
    }  # fmt: skip
    assert with_mouth(motion)["lip_gap"][0] == 0 < with_mouth(motion)["lip_gap"][1]


ERRORS = {
    "no rate": ({**OWN, "exportFps": None}, r"a\.json: the file of Audio2Face is damaged"),
    "no names": ({**OWN, "facsNames": 3}, "facsNames is 3, required a list"),
    "a name too many": (
        {**OWN, "facsNames": ["jawDrop"]}, r"'weightMat' has \(2, 4\) rows and columns, required a column for each"),
    "uneven rows": ({**OWN, "weightMat": [[0.0], [0.0, 1.0]]}, "row 2 of the values is not a list of as many numbers"),
    "a name twice": ({**OWN, "facsNames": ["a", "a", "b", "c"]}, "motion channel names repeat"),
}  # fmt: skip


@pytest.mark.parametrize("name", ERRORS)
def test_damaged_files_are_refused(tmp_path: Path, name: str) -> None:
    document, message = ERRORS[name]
    with pytest.raises(InputError, match=message):
        read_motion(file(tmp_path, document))
    text = json.dumps(OWN).replace('"exportFps"', '"fps"')
    (tmp_path / "b.a2f.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="exportFps is missing"):
        read_motion(tmp_path / "b.a2f.json")
