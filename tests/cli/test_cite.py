import re
from importlib.metadata import version
from pathlib import Path

from lipmotion.citations import ENGINE_KEYS, bibliography, engine_citations, model_citations
from lipmotion.engines import ENGINES
from lipmotion.pipeline.model import shipped_path

ROOT = Path(__file__).parents[2]


def keys(lines: list[str]) -> list[str]:
    return re.findall(r"^@\w+\{(\w+),$", "\n".join(lines), flags=re.MULTILINE)


def test_the_shipped_model_is_the_default(run):
    done = run("cite")
    assert (done.code, done.err) == (0, [])
    assert keys(done.out) == ["lipmotion", *ENGINE_KEYS["trajectory"], "cooke2006"]
    assert done.out == run("cite", shipped_path()).out


def test_a_model_of_other_recordings(run, coupled_model_file):
    done = run("cite", coupled_model_file)
    assert (done.code, done.err) == (0, [])
    assert keys(done.out) == ["lipmotion", *ENGINE_KEYS["coupled"]]


def test_engines_and_keys(run):
    for name in sorted(ENGINE_KEYS):
        assert keys(run("cite", name).out) == ["lipmotion", *ENGINE_KEYS[name]]
    for key in set(bibliography()) - {"lipmotion"}:
        done = run("cite", key)
        assert (done.code, done.err, keys(done.out)) == (0, [], [key])


def test_every_built_in_engine_names_its_papers():
    assert set(ENGINE_KEYS) == set(ENGINES.built_in)
    assert {key for named in ENGINE_KEYS.values() for key in named} <= set(bibliography())


def test_what_a_header_adds():
    header = {"engine": "joint", "visual": "both", "adapted": {}, "attribution": ["GRID corpus, CC BY 4.0", "a; b"]}
    text = model_citations(header)
    assert keys(text.splitlines()) == ["lipmotion", *ENGINE_KEYS["joint"], "xieliu2007", "gales1998", "cooke2006"]
    assert text.endswith("\n% recordings: a; b")
    assert "another package" in engine_citations("ridge")
    assert keys(model_citations({"engine": "ridge"}).splitlines()) == ["lipmotion"]


def test_the_version_is_this_one():
    assert f"version = {{{version('lipmotion')}}}" in bibliography()["lipmotion"]
    assert f"\nversion: {version('lipmotion')}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_every_entry_is_whole():
    for entry in bibliography().values():
        assert entry.count("{") == entry.count("}")
        assert {"author", "title", "year"} <= set(re.findall(r"^ {2}(\w+) +=", entry, flags=re.MULTILINE))
        assert entry.endswith("\n}")
