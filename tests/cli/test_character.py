import json
from dataclasses import replace
from pathlib import Path

import av
import pytest

from cli.conftest import check_refused
from lipmotion import read_motion
from lipmotion_faces.characters.character_files import read_character
from meshes.heads import head, lip_points, write_glb, write_obj


@pytest.fixture
def glb(here: Path) -> Path:
    write_glb(here / "head.glb", head())
    return here / "head.glb"


def test_what_is_in_a_file_is_printed(run, glb):
    done = run("character", glb, "--write-points", "points.csv", "--picture", "head.png")
    assert done.code == 0
    assert done.out[0].startswith("vertices")
    assert any("moved by       arkit: jawOpen, mouthClose" in line for line in done.out)
    assert done.out[-2:] == ["points.csv", "head.png"]
    assert Path("points.csv").read_text().startswith("point,vertex\n61,")
    assert Path("head.png").read_bytes().startswith(b"\x89PNG")


def test_a_table_is_written_calibrated_and_found(run, glb, here):
    assert run("character", glb, "--write-table").out[-1].endswith("head.glb.character.csv")
    assert (here / "head.glb.character.csv").read_text(encoding="utf-8-sig").startswith("control,source,gain,offset,")
    done = run("character", glb, "--open", "jawOpen=0.3", "--closed", "jawOpen=0.02")
    assert any(line.startswith("table ") for line in done.out)
    assert "jawOpen        jawOpen: gain 0." in done.out[-2]
    (here / "rig.csv").write_text("control,source\nJaw,jawOpen\n")
    assert run("character", "rig.csv", "--open", "Jaw=-20").out[-1] == "rig.csv"
    assert "Jaw,jawOpen,-" in (here / "rig.csv").read_text(encoding="utf-8-sig")
    for arguments, message in (
        (("character", glb, "--open", "0.3"), "--open: '0.3' names no control, required NAME=X"),
        (("character", "rig.csv"), "state values of its controls"),
    ):
        check_refused(run(*arguments), 3, message)


def test_the_table_of_a_mouth_that_is_not_found_is_written_to_be_filled_in(run, here):
    named = tuple(replace(shape, name=f"no {number}") for number, shape in enumerate(head().shapes))
    write_glb(here / "odd.glb", replace(head(), shapes=named))
    done = run("character", "odd.glb", "--write-table")
    assert (done.code, done.out) == (3, ["odd.glb.character.csv"])
    assert "Say which one does in a table beside the character" in done.err[0]
    assert (here / "odd.glb.character.csv").read_text(encoding="utf-8-sig").splitlines()[1] == "no 0,,1,0,0,1"


def test_a_mesh_without_blendshapes_is_bound_once(run, here, basics):
    plain = head(shapes=False)
    write_obj(here / "head.obj", plain)
    rows = "".join(f"{point},{vertex}\n" for point, vertex in lip_points(plain).items())
    (here / "points.csv").write_text("point,vertex\n" + rows)
    bound = run("character", "head.obj", "--lip-points", "points.csv", "--write-binding", "head.binding")
    assert bound.code == 0
    assert (here / "head.binding").exists()
    done = run(
        *basics, "--character", "head.obj", "--binding", "head.binding", "-o", "said.mp4", "--fps", "5", "--size", "90"
    )
    assert done == (0, ["said.mp4"], [])


def test_a_character_speaks(run, glb, basics, here):
    done = run(*basics, "--character", glb, "-o", "said.mp4", "said.json", "said.glb", "--fps", "3")
    assert done == (0, ["said.mp4", "said.json", "said.glb"], [])
    with av.open(str(here / "said.mp4")) as video:
        assert (video.streams.video[0].width, video.streams.video[0].height) == (1280, 720)
    motion, units = read_motion(here / "said.json")
    assert {channel.unit for channel in motion.channels} == {"weight"}
    assert motion.names[0] == "jawOpen"
    assert len(units) > 1
    assert 0 <= motion.values.min() <= motion.values.max() <= 1
    assert read_character(here / "said.glb").shape_names == head().shape_names
    stored = json.loads((here / "said.glb").read_bytes()[20:].split(b"\0")[0].rsplit(b"}", 1)[0] + b"}")
    assert stored["animations"][0]["name"] == "speech"
