"""Gains and offsets from weights at which a mouth is open, closed and rounded."""

from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.errors import InputError
from lipmotion.meshes.files.rig_tables import RigRow, read_rig_table, write_rig_table
from lipmotion.meshes.fitting.driven import load_character
from lipmotion.pipeline.outputs.calibration import POSES, calibrate_rows, pose_sources
from meshes.heads import head, write_glb

STATED = {"open": {"jawOpen": 0.6}, "closed": {"jawOpen": 0.05}, "rounded": {"mouthPucker": 0.9}}


def test_a_character_has_the_stated_weights(tmp_path: Path) -> None:
    write_glb(tmp_path / "head.glb", head())
    before = load_character(tmp_path / "head.glb")
    rows = calibrate_rows(before.table_rows(), pose_sources(before, before.table_rows()), STATED)
    write_rig_table(before.table_file, rows)
    after = load_character(tmp_path / "head.glb")
    posed = {row.control: _values(after.table_rows(), pose_sources(after, rows), row.control) for row in rows}
    assert posed["jawOpen"][:2] == pytest.approx([0.6, 0.05], abs=1e-3)
    assert posed["mouthPucker"][2] == pytest.approx(0.9, abs=1e-3)
    assert [row for row in rows if row.control not in {"jawOpen", "mouthPucker"}] == [
        row for row in before.table_rows() if row.control not in {"jawOpen", "mouthPucker"}
    ]


def test_controls_of_a_rig_have_the_stated_values(tmp_path: Path) -> None:
    (tmp_path / "rig.csv").write_text("control,source,gain,offset\nJaw,jawOpen,-25,\nJaw,mouthPucker,-5,1\nLip,ou,1,\n")
    rows = read_rig_table(tmp_path / "rig.csv")
    sources = pose_sources(tmp_path / "rig.csv", rows)
    changed = calibrate_rows(rows, sources, {"open": {"Jaw": -20}, "closed": {"Jaw": 2}, "rounded": {"Lip": 3}})
    assert _values(changed, sources, "Jaw")[:2] == pytest.approx([-20, 2])
    assert _values(changed, sources, "Lip")[2] == pytest.approx(3)
    assert changed[1].gain / changed[0].gain == pytest.approx(0.2)


def test_three_values_of_one_control_are_met_as_nearly_as_a_line_can() -> None:
    stated = {pose: {"A": value} for pose, value in zip(POSES, (1.0, 0.0, 0.6), strict=True)}
    (row,) = calibrate_rows([RigRow("A", "jawOpen")], {"jawOpen": [0.5, 0.0, 0.2]}, stated)
    assert row.gain == pytest.approx(1.947, abs=1e-3)
    assert row.offset == pytest.approx(0.079, abs=1e-3)


@pytest.mark.parametrize(
    ("control", "message"),
    [("B", "the table has no 'B'; there are A"), ("A", "'A' follows no curve that tells these poses apart")],
)
def test_what_cannot_be_calibrated_is_said(control: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        calibrate_rows([RigRow("A", "")], {}, {"open": {control: 1.0}})


def _values(rows: list[RigRow] | tuple[RigRow, ...], sources: dict[str, list[float]], control: str) -> list[float]:
    ours = [row for row in rows if row.control == control]
    nothing = [0.0] * len(POSES)
    return [sum(row.offset + row.gain * sources.get(row.source, nothing)[n] for row in ours) for n in range(len(POSES))]
