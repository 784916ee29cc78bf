import zipfile

import pytest

from cli.conftest import is_one_error


def test_the_addon_is_written_or_one_line_says_why_not(run, here):
    for program, name in (("maya", "a.zip"), ("blender", "a.blend")):
        assert is_one_error(run("addon", program, "-o", name), 7)
        assert list(here.iterdir()) == []
    assert run("addon", "blender", "-o", "a.zip").code == 0
    assert zipfile.is_zipfile(here / "a.zip")


@pytest.mark.long
def test_scenes_takes_and_scripts_are_written_without_a_character(run, here, basics):
    names = ["a.glb", "a.usda", "a.livelink.csv", "a.blender.py"]
    assert run(*basics, "-o", *names, "--rate", "30").code == 0
    assert sorted(path.name for path in here.iterdir()) == sorted(names)
    assert (here / "a.usda").read_text().startswith("#usda 1.0")
    assert "SpatialAudio" in (here / "a.usda").read_text()
