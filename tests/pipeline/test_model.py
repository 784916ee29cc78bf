import io
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import animate, load_model, save_model
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.pipeline import model as module
from lipmotion.pipeline.model import VERSION, read_header, shipped_path
from lipmotion.storage.archive import HEADER
from lipmotion.types import Audio, Generation
from robustness.case import changed_model


def test_saved_and_loaded_it_moves_the_same(toy_model, toy_model_file, toy_speech):
    """Figures are kept at half precision, so the first save changes a little."""
    before, after = (animate(toy_speech, model=model) for model in (toy_model, load_model(toy_model_file)))
    assert [s.label.phone for s in before.units] == [s.label.phone for s in after.units]
    assert np.abs(before.motion.values - after.motion.values).max() < 0.02


def test_after_one_save_nothing_changes_any_more(toy_model_file, toy_speech, tmp_path):
    once = load_model(toy_model_file)
    save_model(once, tmp_path / "again.lipmotion")
    twice = load_model(tmp_path / "again.lipmotion")
    assert (tmp_path / "again.lipmotion").read_bytes() == toy_model_file.read_bytes()
    first, second = (animate(toy_speech, model=model) for model in (once, twice))
    assert np.array_equal(first.motion.values, second.motion.values)
    assert np.array_equal(first.variance, second.variance)
    assert first.units == second.units
    assert first.trace.states == second.trace.states
    assert once.about == twice.about
    assert once.engine == twice.engine


def test_the_file_is_plain_arrays_and_a_header(toy_model_file):
    header = read_header(toy_model_file)
    assert (header["format"], header["version"], header["engine"]) == ("lipmotion.model", VERSION, "trajectory")
    assert header["configuration"]["states"] == 5
    assert header["recogniser"]["mixtures"] == 1
    assert header["licence"] == ["synthesised by lipmotion"]
    with zipfile.ZipFile(toy_model_file) as file:
        names = file.namelist()
        assert names[0] == HEADER
        assert {info.date_time for info in file.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert {name.split("/")[0] for name in names[1:]} == {"phones", "engine"}
        for name in names[1:]:
            array = np.lib.format.read_array(io.BytesIO(file.read(name)), allow_pickle=False)
            assert array.dtype.kind in "fiuU"


def test_what_a_user_must_know_comes_back(toy_model, tmp_path):
    about = {"corpus": ["mine"], "licence": ["CC BY 4.0"], "attribution": ["Ünal 日本"], "minutes": 1.5}
    save_model(replace(toy_model, about=about), tmp_path / "m.lipmotion")
    assert load_model(tmp_path / "m.lipmotion").about == about


def test_the_header_says_what_there_is_not(toy_model_file, tmp_path):
    for changes, message in (
        ({"engine": "concatenative"}, "no engine 'concatenative'; there are: trajectory"),
        ({"configuration": {"part": 5}}, "no option 'part'; there are: states, "),
        ({"configuration": {"states": 4}}, "states is 4, required an odd number"),
        ({"recogniser": {"state": 3}}, "no option 'state'; there are: states, "),
        ({"recogniser": []}, "damaged"),
        ({"configuration": None}, "damaged"),
    ):
        with pytest.raises(ModelFormatError, match=message):
            load_model(changed_model(toy_model_file, tmp_path / "m.lipmotion", {}, **changes))


def test_models_are_one_short_line():
    model = load_model()
    assert repr(model).startswith("Model(trajectory, geometry, ")
    assert repr(model).endswith(" minutes, format version 3)")
    for part in (model, model.learned, model.phones, model.prior):
        assert len(repr(part)) < 120
        assert "\n" not in repr(part)


@pytest.mark.parametrize("fixture", ["joint_model", "coupled_model"])
def test_models_of_engines_are_one_short_line(fixture, request):
    learned = request.getfixturevalue(fixture).learned
    assert repr(learned).startswith(f"{type(learned).__name__}(")
    assert len(repr(learned)) < 120


def test_the_shipped_model_is_read_once():
    assert load_model() is load_model()


def test_a_package_without_a_model_says_so(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "shipped_path", lambda: tmp_path / "grid-s1.lipmotion")
    with pytest.raises(ModelFormatError, match="the package holds no model; install it again, or give one"):
        animate(Audio(np.zeros(16_000, np.float32), 16_000))


def test_a_model_with_the_former_names_of_options_is_read(toy_model_file, tmp_path):
    former = {
        "parts": 5, "silent_parts": 13, "listens": True, "axes": 150, "full_range": True, "joint": True,
        "trajectory_steps": 0, "articulation": False,
    }  # fmt: skip
    model = load_model(changed_model(toy_model_file, tmp_path / "m.lipmotion", {}, configuration=former))
    present = load_model(toy_model_file).engine
    assert model.engine.config == replace(present.config, modulation_filter=0.0)
    with pytest.raises(ModelFormatError, match="trajectory_steps is 3; this option no longer exists, required 0"):
        load_model(changed_model(toy_model_file, tmp_path / "n.lipmotion", {}, configuration={"trajectory_steps": 3}))


def test_what_is_no_model(toy_model_file, tmp_path):
    path = tmp_path / "m.lipmotion"
    for read in (load_model, read_header):
        for missing in (tmp_path / "missing.lipmotion", tmp_path):
            with pytest.raises(InputError, match="no such model"):
                read(missing)
        for version in (VERSION + 1, str(VERSION), None):
            wanted = f"model version {version}, .* reads version {VERSION}; upgrade lipmotion, or"
            with pytest.raises(ModelFormatError, match=wanted):
                read(changed_model(toy_model_file, path, {}, version=version))
        for content in (b"", b"words, not a model", b"PK\3\4", b"PK\5\6" + bytes(18)):
            path.write_bytes(content)
            wanted = r"m.lipmotion: not a lipmotion model \(.+\); give a file that"
            with pytest.raises(ModelFormatError, match=wanted) as caught:
                read(path)
            assert "\n" not in str(caught.value)
        for header in (b"{", b"\xff", b"[]", b'{"format": "lipmotion.motion"}', None):
            with pytest.raises(ModelFormatError, match="not a lipmotion model"):
                read(changed_model(toy_model_file, path, {HEADER: header}))


EXAMPLES = Path(__file__).parent.parent.parent / "examples"


@pytest.fixture(scope="module")
def welcome() -> Generation:
    return animate(EXAMPLES / "welcome.flac", transcript=(EXAMPLES / "welcome.txt").read_text())


def test_header_says_whose_recordings():
    header = read_header(shipped_path())
    assert header["licence"] == ["CC BY 4.0"]
    assert any("GRID" in line for line in header["attribution"])
    assert header["split"] == "all"
    assert header["utterances"] == 524
    assert shipped_path().stat().st_size < 9_000_000


def test_lips_meet_on_p_b_m(welcome):
    opening = welcome.motion["opening"]
    closing = [span for span in welcome.units if span.label.phone in ("p", "b", "m")]
    assert len(closing) == 9  # please speak my lips move big blue boats by
    for span in closing:
        first, last = int(span.start_s * 100) - 2, int(span.end_s * 100) + 3
        assert opening[max(first, 0) : last].min() < 0.01, span


def test_vowels_open_and_silence_rests(welcome):
    opening = welcome.motion["opening"]
    loudest = [span for span in welcome.units if span.label.phone in ("ay", "ae", "iy")]
    assert np.median([opening[int(s.start_s * 100) : int(s.end_s * 100) + 1].max() for s in loudest]) > 0.05
    assert opening[:10].max() < 0.02
    assert opening[-10:].max() < 0.02
    assert np.abs(np.diff(opening)).max() < 0.04  # smooth: no jump between frames of 10 ms
