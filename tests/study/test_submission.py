"""What is accepted of a page, and what is not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lipmotion.errors import InputError
from lipmotion_studio.study.answers import MOS, RANKING
from lipmotion_studio.study.store import AnswerSheet
from lipmotion_studio.study.submission import submitted_sheet
from lipmotion_studio.study.trials import trials_of
from study.small_study import small_study

SENT = {"trial": 4, "values": ["second"], "plays": [1, 2], "seconds": 1.25}


def test_an_answer_is_taken_as_it_is(tmp_path: Path) -> None:
    study = small_study(tmp_path / "study")
    assert submitted_sheet(study, trials_of(study, 7), 7, SENT) == AnswerSheet(7, 4, ("second",), 1.25, 3)


@pytest.mark.parametrize(
    "change",
    [
        {"trial": -1},
        {"trial": 1000},
        {"trial": True},
        {"trial": "4"},
        {"trial": 4.0},
        {"values": []},
        {"values": ["third"]},
        {"values": ["first", "first"]},
        {"values": "first"},
        {"values": [1]},
        {"values": None},
        {"plays": [1]},
        {"plays": [1, 0]},
        {"plays": [1, True]},
        {"plays": [1, 10**9]},
        {"plays": {}},
        {"seconds": 0.8},  # two videos of half a second
        {"seconds": -1},
        {"seconds": 10**400},
        {"seconds": "1.25"},
        {"seconds": None},
        {"more": 1},
    ],
)
def test_anything_else_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    study = small_study(tmp_path / "study")
    with pytest.raises(InputError):
        submitted_sheet(study, trials_of(study, 7), 7, SENT | change)


@pytest.mark.parametrize("content", [None, [], "text", 7, {}, {"trial": 0}])
def test_only_the_object_is_taken(tmp_path: Path, content: Any) -> None:
    study = small_study(tmp_path / "study")
    with pytest.raises(InputError, match="required a"):
        submitted_sheet(study, trials_of(study, 7), 7, content)


def test_every_scale_and_every_slider_has_a_value(tmp_path: Path) -> None:
    opinions, ranking = small_study(tmp_path / "m", MOS), small_study(tmp_path / "r", RANKING)
    sent = {"trial": 0, "values": ["01", "2", "3", "4", "5"], "plays": [1], "seconds": 0.5}
    sheet = submitted_sheet(opinions, trials_of(opinions, 1), 1, sent)
    assert sheet.values == ("1", "2", "3", "4", "5")
    for values in (["1"] * 4, ["0", "2", "3", "4", "5"], ["6", "2", "3", "4", "5"]):
        with pytest.raises(InputError):
            submitted_sheet(opinions, trials_of(opinions, 1), 1, sent | {"values": values})
    sent = {"trial": 0, "values": ["0", "50", "100", "7"], "plays": [1] * 4, "seconds": 2.0}
    assert submitted_sheet(ranking, trials_of(ranking, 1), 1, sent).values == ("0", "50", "100", "7")
    with pytest.raises(InputError):
        submitted_sheet(ranking, trials_of(ranking, 1), 1, sent | {"values": ["0", "50", "101", "7"]})
