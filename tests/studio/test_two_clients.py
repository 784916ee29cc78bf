"""Lines are what their sounds are, changes name what they saw, damaged edits are an error: two clients of a studio."""

from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.pipeline.model import Model
from lipmotion.testing.toy import ToySentence

pytest.importorskip("starlette", reason="the extra 'studio' is not installed")

from studio.two_clients import walk


def test_nothing_that_was_acknowledged_is_lost(toy_model: Model, toy_sentence: ToySentence, tmp_path: Path) -> None:
    found = walk(toy_model, toy_sentence, tmp_path, 2, 10)
    assert found.steps > 10


@pytest.mark.long
def test_hundreds_of_steps_lose_nothing(toy_model: Model, toy_sentence: ToySentence, tmp_path: Path) -> None:
    found = walk(toy_model, toy_sentence, tmp_path, 6, 60)
    print(found.steps, found.acknowledged)
    assert found.steps > 300
    assert found.acknowledged > 100
