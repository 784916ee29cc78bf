"""Cues for Spine: the members of its documents, and what its own runtime reads of them, where it is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import programs
from formats.cue_examples import spoken
from lipmotion import CueSheet
from lipmotion.articulation.cue_sheets import choose_cues
from lipmotion.formats.cues import format_of, write_cue_file


@pytest.fixture
def sheet() -> CueSheet:
    return choose_cues(spoken("m aa m uw"), optional="GX")


def test_every_cue_is_a_key_of_an_attachment_that_there_is(sheet: CueSheet, tmp_path: Path) -> None:
    path = tmp_path / "a.spine.json"
    write_cue_file(path, sheet, "talk.wav", format_of(path))
    document = json.loads(path.read_text(encoding="ascii"))
    keys = document["animations"]["speech"]["slots"]["mouth"]["attachment"]
    expected = [(cue.start_s, cue.label) for cue in sheet.cues] + [(sheet.duration_s, "X")]
    assert [(key["time"], key["name"]) for key in keys] == expected
    assert "A" in {key["name"] for key in keys} <= {*document["skins"][0]["attachments"]["mouth"]} == {*"ABCDEFGX"}
    assert document["slots"] == [{"name": "mouth", "bone": "root", "attachment": "X"}]
    assert document["events"] == {"speech": {"audio": "talk.wav"}}
    write_cue_file(path, sheet, "", "spine.json")
    assert "events" not in json.loads(path.read_text(encoding="ascii"))


@pytest.mark.long
@pytest.mark.skipif(not programs.node_package("@esotericsoftware/spine-core"), reason="no spine-core")
def test_spine_reads_it(sheet: CueSheet, tmp_path: Path) -> None:
    write_cue_file(tmp_path / "a.spine.json", sheet, "talk.wav", "spine.json")
    found = programs.run_node("spine_keys.mjs", "@esotericsoftware/spine-core", tmp_path / "a.spine.json")
    assert (found["slot"], found["attachments"], found["audio"]) == ("mouth", [*"ABCDEFGX"], ["talk.wav"])
    assert found["names"] == [*(cue.label for cue in sheet.cues), "X"]
    assert found["times"] == pytest.approx([*(cue.start_s for cue in sheet.cues), sheet.duration_s], abs=1e-5)
