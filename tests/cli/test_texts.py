from __future__ import annotations

from pathlib import Path

import pytest

from lipmotion.cli.texts import text_or_file_content
from lipmotion.errors import InputError


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("text", ["hello there", "see p. 3", "", "α" * 3000, "a/b/c", "the file words.txt", "..", "\n"])
def test_a_text_is_itself(text: str) -> None:
    assert text_or_file_content(text) == text


def test_a_file_is_its_content(here: Path) -> None:
    (here / "words").write_text("näh\n", encoding="utf-8-sig")
    assert text_or_file_content("words") == "näh\n"


def test_a_file_deep_in_folders(here: Path) -> None:
    deep = here / ("a" * 200) / ("b" * 200)
    deep.mkdir(parents=True)
    (deep / "words.txt").write_text("hello")
    assert text_or_file_content(str(deep / "words.txt")) == "hello"


@pytest.mark.usefixtures("here")
def test_a_file_that_is_not_there() -> None:
    with pytest.raises(InputError, match=r"words.txt: no such transcript file"):
        text_or_file_content("words.txt")


def test_a_file_that_is_not_text(here: Path) -> None:
    (here / "words.txt").write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match=r"words.txt: not a readable UTF-8 transcript"):
        text_or_file_content("words.txt")
