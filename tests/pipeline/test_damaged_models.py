"""No array of a model, whatever is done to it, gives motion that no face has."""

import warnings
from collections.abc import Iterator

import numpy as np
import pytest

from lipmotion import Model, Request
from lipmotion.errors import ModelFormatError
from lipmotion.hmm.model import hmm_to_arrays
from lipmotion.motion.eigenlips import eigenlips_to_arrays
from lipmotion.pipeline.analysis.speech_analysis import analyse
from lipmotion.speech.recognition.adaptation import adaptation_arrays, identity_adaptation
from pipeline.damage import DAMAGES, LARGEST_DIFFERENCE, QUICK, UNREADABLE, animated, damaged, distance, refused
from testing.toy import ToySentence

ENGINES = ("toy_model", "joint_model", "coupled_model", "pictured_model")


@pytest.fixture(autouse=True)
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
@pytest.mark.parametrize("name", ENGINES)
def test_damaged_arrays_of_an_engine(name, toy_sentence, request):
    found, refusals, harmless = absurd(request.getfixturevalue(name), toy_sentence, QUICK)
    assert found == []
    assert refusals > 60
    assert harmless < refusals / 4


@pytest.mark.long
def test_damaged_arrays_of_all_other_parts(pictured_model):
    model = pictured_model
    assert model.eigenlips is not None
    parts = {
        "phones": hmm_to_arrays(model.phones),
        "eigenlips": eigenlips_to_arrays(model.eigenlips),
        "adaptation": adaptation_arrays(identity_adaptation(1.0, 0.5)),
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
