"""No array of a model, whatever is done to it, gives motion that no face has."""

import io
import warnings
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Model, Request, adapt, animate, load_model, save_model
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.hmm.model import hmm_to_arrays
from lipmotion.motion.eigenlips import eigenlips_to_arrays
from lipmotion.pipeline.analysis.speech_analysis import analyse
from lipmotion.pipeline.model import VERSION, find_shipped, read_header
from lipmotion.speech.recognition.adaptation import adaptation_to_arrays, create_adaptation
from lipmotion.storage.archive import HEADER
from lipmotion.types import Audio
from pipeline.damage import DAMAGES, LARGEST_DIFFERENCE, QUICK, UNREADABLE, animated, damaged, distance, refused
from robustness.case import changed_model
from testing.toy import ToySentence, toy_sentences


def test_saved_and_loaded_it_moves_the_same(toy_model, toy_model_file, toy_speech, tmp_path):
    """Figures are kept at half precision: the first save changes a little, another one nothing any more."""
    once = load_model(toy_model_file)
    save_model(once, tmp_path / "again.lipmotion")
    twice = load_model(tmp_path / "again.lipmotion")
    assert (tmp_path / "again.lipmotion").read_bytes() == toy_model_file.read_bytes()
    before, first, second = (animate(toy_speech, model=model) for model in (toy_model, once, twice))
    assert [s.label.phone for s in before.units] == [s.label.phone for s in first.units]
    assert np.abs(before.motion.values - first.motion.values).max() < 0.02
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


def test_models_are_one_short_line():
    model = load_model()
    assert repr(model).startswith("Model(trajectory, geometry, ")
    assert repr(model).endswith(" minutes, format version 3)")
    for part in (model, model.learned, model.phones, model.prior):
        assert len(repr(part)) < 120
        assert "\n" not in repr(part)


def test_the_shipped_model_is_read_once():
    assert load_model() is load_model()


def test_header_says_whose_recordings():
    header = read_header(find_shipped())
    assert (header["licence"], header["split"], header["utterances"]) == (["CC BY 4.0"], "all", 523)
    assert any("GRID" in line for line in header["attribution"])
    assert find_shipped().stat().st_size < 9_000_000


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


EXAMPLES = Path(__file__).parent.parent.parent / "examples"


def test_lips_meet_on_p_b_m():
    welcome = animate(EXAMPLES / "welcome.flac", transcript=(EXAMPLES / "welcome.txt").read_text())
    opening = welcome.motion["opening"]
    closing = [span for span in welcome.units if span.label.phone in ("p", "b", "m")]
    assert len(closing) == 9  # please speak my lips move big blue boats by
    for span in closing:
        first, last = int(span.start_s * 100) - 2, int(span.end_s * 100) + 3
        assert opening[max(first, 0) : last].min() < 0.01, span


@pytest.fixture(scope="module")
def adapted(toy_model: Model, toy_speech: Path) -> Model:
    return adapt(toy_model, [toy_speech, toy_sentences(3)[1].audio])


@pytest.mark.long
def test_only_the_adaptation_changes(toy_model, adapted):
    assert (toy_model.adaptation is None, adapted.adaptation is None) == (True, False)
    assert adapted.phones is toy_model.phones
    assert adapted.learned is toy_model.learned
    about = dict(adapted.about)
    assert about.pop("adapted")["recordings"] == 2
    assert about == toy_model.about


@pytest.mark.long
def test_an_earlier_adaptation_is_forgotten(adapted, toy_model, toy_speech):
    again, fresh = (adapt(model, [toy_speech]) for model in (adapted, toy_model))
    assert np.array_equal(again.adaptation.own, fresh.adaptation.own)
    assert again.about == fresh.about


def test_it_is_used_from_then_on(adapted, toy_speech):
    """With one that turns features about, phones, or their times, are others."""
    odd = replace(adapted, adaptation=replace(adapted.adaptation, own=-adapted.adaptation.own))
    for words in (None, "see papa"):
        request = Request(toy_speech, transcript=words, recogniser="own")
        assert animate(request, model=odd).units != animate(request, model=adapted).units


def test_a_saved_and_loaded_adaptation_gives_the_same_phones(adapted, toy_speech, tmp_path):
    save_model(adapted, tmp_path / "adapted.lipmotion")
    again = load_model(tmp_path / "adapted.lipmotion")
    assert np.array_equal(again.adaptation.own, adapted.adaptation.own)
    assert np.array_equal(again.adaptation.general, adapted.adaptation.general)
    assert again.about["adapted"] == adapted.about["adapted"]
    request = Request(toy_speech, recogniser="fast")
    before, after = (animate(request, model=model).units for model in (adapted, again))
    assert [span.label.phone for span in before] == [span.label.phone for span in after]


def test_a_list_of_recordings_is_required(toy_model):
    for given in ([], "one.wav", Path("one.wav"), Audio(np.zeros(16_000, np.float32), 16_000)):
        with pytest.raises(InputError, match="required: one or more recordings of the speaker"):
            adapt(toy_model, given)


ENGINES = ("toy_model", "joint_model", "coupled_model", "pictured_model")


@pytest.fixture
def quiet() -> Iterator[None]:
    """An overflow is detected by its consequences."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def absurd(model: Model, sentence: ToySentence, damages: tuple[str, ...]) -> tuple[list[str], int, int]:
    """Return what gave absurd motion, or was not noticed; how much was refused, and how much was harmless."""
    speech = analyse(model, Request(sentence.audio, recogniser="own"))
    arrays = model.engine.to_arrays(model.learned)
    whole = animated(model, arrays, speech)
    assert whole is not None
    found, refusals, harmless = [], 0, 0
    for name, what, changed in damaged(arrays, {damage: DAMAGES[damage] for damage in damages}):
        motion = animated(model, changed, speech)
        number = arrays[name].dtype.kind in "fiu" and arrays[name].size > 1
        if motion is None:
            refusals += 1
        elif distance(motion, whole) > LARGEST_DIFFERENCE or (number and what in UNREADABLE):
            found.append(f"{name}: {what}")
        else:
            harmless += 1
    return found, refusals, harmless


@pytest.mark.long
@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("name", ENGINES)
def test_damaged_arrays_of_an_engine(name, toy_sentence, request):
    found, refusals, harmless = absurd(request.getfixturevalue(name), toy_sentence, QUICK)
    assert found == []
    assert refusals > 60
    assert harmless < refusals / 4


@pytest.mark.long
@pytest.mark.usefixtures("quiet")
def test_damaged_arrays_of_all_other_parts(pictured_model):
    model = pictured_model
    assert model.eigenlips is not None
    parts = {
        "phones": hmm_to_arrays(model.phones),
        "eigenlips": eigenlips_to_arrays(model.eigenlips),
        "adaptation": adaptation_to_arrays(create_adaptation(1.0, 0.5)),
    }
    read = [
        f"{part}/{name}: {what}"
        for part, arrays in parts.items()
        for name, what, changed in damaged(arrays, {damage: DAMAGES[damage] for damage in UNREADABLE})
        if arrays[name].dtype.kind != "U" and not refused(part, model, changed)
    ]
    assert not any(refused(part, model, arrays) for part, arrays in parts.items())
    assert read == []


UNDECLARED = {
    "toy_model": ("more", "points", "joint/more"),
    "joint_model": ("more", "joint_more", "joint_f0/more", "joint_more/means"),
    "coupled_model": ("more", "chain_9/units", "group_0/more", "group_7/tie", "around/more", "visual_1/scale"),
}


@pytest.mark.parametrize("name", UNDECLARED)
def test_an_array_that_nothing_declares(name, request):
    model: Model = request.getfixturevalue(name)
    arrays = model.engine.to_arrays(model.learned)
    for more in UNDECLARED[name]:
        with pytest.raises(ModelFormatError, match=r"damaged \(.*undeclared "):
            model.engine.from_arrays(arrays | {more: np.zeros(3)})
