import json

import pytest

from lipmotion.errors import ExportError
from lipmotion.storage.json_text import as_json, from_json, nan_as_null

NAN, INFINITE = float("nan"), float("inf")


def test_there_and_back() -> None:
    content = {"a": [1, 2.5, "é", None], "b": {"c": True}}
    assert from_json(as_json(content)) == content
    assert as_json(content, indent=1, ensure_ascii=False) == json.dumps(content, indent=1, ensure_ascii=False)
    for text in ("\ud800", {"a": ["é\udfff"]}, "é", "😀"):  # every text is written as UTF-8
        written = as_json(text, ensure_ascii=False)
        assert from_json(written.encode()) == text
        assert ("é" in written) == (text == "é")


def test_numbers_that_json_does_not_have() -> None:
    for content in (NAN, {"a": [1.0, INFINITE]}, [-INFINITE]):
        with pytest.raises(ExportError, match="every number must be finite"):
            as_json(content)


def test_a_figure_that_nothing_defines_is_null() -> None:
    nested = {"a": [1.5, NAN, (INFINITE, "b", -INFINITE)], "c": 2, "d": "nan", "e": None, "f": True}
    assert nan_as_null(nested) == {"a": [1.5, None, (None, "b", None)], "c": 2, "d": "nan", "e": None, "f": True}


def test_what_is_refused() -> None:
    for text, says in (
        ("{", "Expecting"),
        ('{"a": 1, "b": 2, "a": 1}', "the key 'a' occurs twice"),
        ('{"a": {"b": 1, "b": 2}}', "the key 'b' occurs twice"),
        ('{"a": NaN}', "the number NaN, required a finite one"),
        ("[-Infinity]", "the number -Infinity"),
        ("[1e999]", "the number 1e999"),
    ):
        with pytest.raises(ValueError, match=says):
            from_json(text)
