from pathlib import Path

import numpy as np
import pytest

from lipmotion import Model, Request, adapt, animate, load_model, save_model
from lipmotion.errors import InputError
from lipmotion.pipeline.model import read_header
from lipmotion.types import Audio
from testing.toy import toy_sentences


@pytest.fixture(scope="module")
def adapted(toy_model: Model, toy_speech: Path) -> Model:
    return adapt(toy_model, [toy_speech, toy_sentences(3)[1].audio])


@pytest.fixture(scope="module")
def adapted_file(adapted: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("adapted") / "adapted.lipmotion"
    save_model(adapted, path)
    return path


def test_only_the_adaptation_changes(toy_model, adapted):
    assert toy_model.adaptation is None
    assert adapted.adaptation is not None
    assert adapted.phones is toy_model.phones
    assert adapted.learned is toy_model.learned
    about = dict(adapted.about)
    assert about.pop("adapted")["recordings"] == 2
    assert about == toy_model.about


def test_it_is_used_from_then_on(toy_model, adapted, toy_speech, monkeypatch):
    used = []
    kind = type(adapted.adaptation)
    plain = kind.own_features
    monkeypatch.setattr(kind, "own_features", lambda one, *given: used.append(one) or plain(one, *given))
    for words in (None, "ba"):
        animate(Request(toy_speech, transcript=words, recogniser="own"), model=adapted)
    assert used == [adapted.adaptation] * 2
    animate(Request(toy_speech, recogniser="own"), model=toy_model)
    assert len(used) == 2


def test_a_saved_and_loaded_adaptation_gives_the_same_phones(adapted, adapted_file, toy_speech):
    again = load_model(adapted_file)
    assert np.array_equal(again.adaptation.own, adapted.adaptation.own)
    assert np.array_equal(again.adaptation.general, adapted.adaptation.general)
    assert read_header(adapted_file)["adapted"] == adapted.about["adapted"]
    request = Request(toy_speech, recogniser="fast")
    before, after = (animate(request, model=model).units for model in (adapted, again))
    assert [span.label.phone for span in before] == [span.label.phone for span in after]


@pytest.mark.long
def test_an_earlier_adaptation_is_forgotten(adapted, toy_model, toy_speech):
    again, fresh = (adapt(model, [toy_speech]) for model in (adapted, toy_model))
    assert np.array_equal(again.adaptation.own, fresh.adaptation.own)
    assert again.about == fresh.about


def test_a_list_of_recordings_is_required(toy_model):
    for given in ([], "one.wav", Path("one.wav"), Audio(np.zeros(16_000, np.float32), 16_000)):
        with pytest.raises(InputError, match="required: one or more recordings of the speaker"):
            adapt(toy_model, given)
