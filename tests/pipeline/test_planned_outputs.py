"""Several recordings: which they are, and where the outputs of each go."""

from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion.pipeline.analysis.recordings import is_for_several, list_recordings, plan_outputs


def test_files_stay_in_order_and_folders_are_listed(tmp_path: Path) -> None:
    for name in ("b.wav", "a.MP4", "notes.txt"):
        (tmp_path / name).touch()
    assert list_recordings([Path("z.wav"), tmp_path]) == [Path("z.wav"), tmp_path / "a.MP4", tmp_path / "b.wav"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no sounds and no videos in it"):
        list_recordings([tmp_path / "empty"])


def test_folders_and_templates(tmp_path: Path) -> None:
    planned = plan_outputs([Path("in/a.wav"), Path("b.c.flac")], ["out/", "x/{name}-take.mp4"], ["json", "csv"])
    assert planned == [["out/a.json", "out/a.csv", "x/a-take.mp4"], ["out/b.c.json", "out/b.c.csv", "x/b.c-take.mp4"]]
    assert is_for_several(str(tmp_path))
    assert not is_for_several("a.json")


def test_outputs_that_would_be_written_twice() -> None:
    with pytest.raises(ExportError, match=r"o/a\.json: would be written for x/a\.wav and for y/a\.wav"):
        plan_outputs([Path("x/a.wav"), Path("y/a.wav")], ["o/"], ["json"])
    with pytest.raises(ExportError, match=r"a\.json: is one file, and there are 2 recordings"):
        plan_outputs([Path("a.wav"), Path("b.wav")], ["a.json"], ["json"])


@pytest.mark.parametrize("output", ["out/", "{name}.json", "out/{name}/a.json"])
def test_a_recording_that_is_called_as_a_device_names_no_output(output: str) -> None:
    for name in ("CON.wav", "nul .flac"):
        with pytest.raises(ExportError, match="Windows"):
            plan_outputs([Path(name)], [output], ["json"])
    assert plan_outputs([Path("CON.wav")], ["../a.json"], ["json"]) == [["../a.json"]]
