"""Every JSON file that lipmotion writes fits its schema in ``formats/schemas.json``, and names nothing else."""

import json
import re
import zipfile
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion_studio.folder import open_folder
from study.small_study import small_study

SCHEMAS = json.loads(resources.files("lipmotion.formats").joinpath("schemas.json").read_text("utf-8"))["$defs"]
TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
UNDERSTOOD = {*"$ref const enum type properties required additionalProperties items minItems maxItems pattern".split()}
UNDERSTOOD |= {*"minimum maximum exclusiveMinimum description".split()}


def is_of(value: Any, kind: str) -> bool:
    if kind in {"number", "integer"}:
        return isinstance(value, int if kind == "integer" else int | float) and not isinstance(value, bool)
    return isinstance(value, TYPES[kind])


def check(value: Any, schema: dict[str, Any], where: str = "") -> None:
    """Assert that a value fits a schema: the part of JSON Schema 2020-12 that these schemas use."""
    assert set(schema) <= UNDERSTOOD
    schema = SCHEMAS[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema
    kinds = schema.get("type", [])
    assert not kinds or any(is_of(value, kind) for kind in ([kinds] if isinstance(kinds, str) else kinds)), where
    assert value == schema.get("const", value), where
    assert value in schema.get("enum", [value]), where
    if isinstance(value, str):
        assert re.search(schema.get("pattern", ""), value), where
    elif isinstance(value, int | float):
        assert schema.get("minimum", value) <= value <= schema.get("maximum", value), where
        assert value > schema.get("exclusiveMinimum", -np.inf), where
    elif isinstance(value, list):
        assert schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)), where
        for number, each in enumerate(value):
            check(each, schema.get("items", {}), f"{where}[{number}]")
    elif isinstance(value, dict):
        assert set(schema.get("required", ())) <= set(value), where
        others = schema.get("additionalProperties", {})
        for name, each in value.items():
            assert name in schema.get("properties", {}) or others is not False, f"{where}.{name}"
            check(each, schema.get("properties", {}).get(name, others or {}), f"{where}.{name}")


def read(path: Path) -> Any:
    return json.loads(path.read_text("utf-8"))


@pytest.mark.parametrize(("name", "wrong"), [("motion", {"format": "lipmotion.motion"}), ("cues", {}), ("unit", [])])
def test_what_does_not_fit(name, wrong):
    with pytest.raises(AssertionError):
        check(wrong, SCHEMAS[name])


def test_motion_cues_and_edits(run, tmp_path, toy_model_file, toy_speech):
    files = [tmp_path / name for name in ("a.json", "a.npz", "a.cues.json", "b.edits.json")]
    assert run("animate", toy_speech, "--model", toy_model_file, "-o", *files[:3]).code == 0
    edits = ("pin opening 0.02 at 0.5", "pin opening 0.03 at 0.7")
    assert run("edit", files[3], *edits, "--of", toy_speech, "--model", toy_model_file).code == 0
    assert run("edit", files[3], "--undo", 1).code == 0
    check(read(files[3]), SCHEMAS["edits"])
    check(read(files[0]), SCHEMAS["motion"])
    check(json.loads(str(np.load(files[1])["document"])), SCHEMAS["motion of .npz"])
    check(read(files[2]), SCHEMAS["cues"])


def test_folders(run, tmp_path, toy_corpus, toy_model_file, toy_speech):
    check(read(toy_corpus.path / "corpus.json"), SCHEMAS["corpus"])
    for entry in toy_corpus.path.glob("utterances/*/entry.json"):
        check(read(entry), SCHEMAS["utterance"])
    with zipfile.ZipFile(toy_model_file) as model:
        check(json.loads(model.read("header.json")), SCHEMAS["model"])
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "broken.wav").write_bytes(b"RIFF")
    (tmp_path / "in" / "good.wav").write_bytes(toy_speech.read_bytes())
    run("batch", tmp_path / "in", "--out", tmp_path / "out", "--model", toy_model_file, "--jobs", 1)
    rows = (tmp_path / "out" / "batch.jsonl").read_text("utf-8").splitlines()
    assert len(rows) == 2
    for row in rows:
        check(json.loads(row), SCHEMAS["batch"])
    with open_folder(tmp_path / "in") as folder:
        check(read(folder.path / "project.json"), SCHEMAS["project"])
    small_study(tmp_path / "study")
    check(read(tmp_path / "study" / "study.json"), SCHEMAS["study"])
