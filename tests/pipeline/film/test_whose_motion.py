from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from lipmotion.errors import InputError
from lipmotion_faces.film.filmed_video import is_person_of, person_shown
from lipmotion_faces.filmed.face import FilmedFace
from lipmotion_faces.outputs.shown_faces import shown_face


def model_of(*speakers: str, corpus: str = "filmed/many") -> Any:
    return SimpleNamespace(about={"corpus": [corpus], "speakers": list(speakers)}, visual="points")


def face_of(face: FilmedFace, speaker: str) -> FilmedFace:
    return replace(face, about={"corpus": ["filmed/many"], "speaker": speaker})


def test_the_person_of_one_corpus(filmed_face):
    for people, speaker, filmed, same in (
        ((), "", "anna", True),  # a corpus without names has one person
        (("anna",), "", "anna", True),
        (("anna",), "", "", True),
        (("ben",), "", "anna", False),
        (("anna", "ben"), "anna", "anna", True),
        (("anna", "ben"), "ben", "anna", False),
        (("anna", "ben"), "", "anna", False),  # the mean person
    ):
        face = face_of(filmed_face, filmed)
        assert is_person_of(model_of(*people), face, speaker) == same
        assert not is_person_of(model_of(*people, corpus="filmed/other"), face, speaker)


def test_without_speech_nothing_is_mapped(filmed_face, caplog):
    face = face_of(filmed_face, "anna")
    assert person_shown(model_of("ben"), face) is face
    assert person_shown(model_of("ben"), replace(face, takes=())) is None
    assert "built from footage without sound" in caplog.text
    assert person_shown(model_of("anna"), face) is None
    assert shown_face(face).other_person(model_of("ben")) is face
    assert shown_face("portrait").other_person(model_of("ben")) is None


def test_mouth_pictures_cannot_be_mapped_onto_another_person(filmed_face):
    pictured = SimpleNamespace(about={"corpus": ["filmed/many"], "speakers": ["ben"]}, visual="eigenlips")
    assert is_person_of(pictured, face_of(filmed_face, "ben"))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"mouth pictures of the person of filmed/many, the face is that of another"):
        is_person_of(pictured, face_of(filmed_face, "anna"))  # type: ignore[arg-type]
