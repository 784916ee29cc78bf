from pathlib import Path

import numpy as np
import pytest

from lipmotion.meshes.model.rig_tables import read_rig_table
from lipmotion.pipeline.outputs.curve_sets import make_curves
from meshes.speech import motion, units

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "for").glob("*.md"))
TABLES = sorted((ROOT / "examples" / "rigs").glob("*.csv"))
MAX_LINES = 60


def test_a_jaw_opens_and_closes():
    jaw = make_curves(motion(), units(), ROOT / "examples" / "rigs" / "jaw-bone.csv")["jaw.rotation.x"]
    assert jaw.max() == pytest.approx(65 * 0.2 - 0.8, abs=0.5)
    assert jaw[[20, 55, 95]] == pytest.approx(0.0)


def test_pages_are_short():
    assert [page for page in PAGES if len(page.read_text(encoding="utf-8").splitlines()) > MAX_LINES] == []


def test_every_table_moves_its_rig_and_is_on_a_page():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert TABLES
    for table in TABLES:
        rows = read_rig_table(table)
        said = make_curves(motion(), units(), table)
        assert said.names == tuple(dict.fromkeys(row.control for row in rows))
        assert np.ptp(said.values, axis=0).max() > 0
        first = {row.control: row for row in reversed(rows)}
        for name in said.names:
            assert first[name].low <= said[name].min() <= said[name].max() <= first[name].high
        assert table.name in text
