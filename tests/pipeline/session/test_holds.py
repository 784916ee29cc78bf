"""What an edit decides stays on every face and in every set of curves, whatever the phones ask for."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lipmotion import Edits, Model, Request, Session, cues
from lipmotion.articulation.contact import opening_to_gap
from lipmotion.articulation.mouth import LIP_SPEED
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.pipeline.outputs.deliver import deliver_to_face
from lipmotion.types import Delivery, Generation
from lipmotion_faces.base import Staging
from lipmotion_faces.head.pose import head_poses
from lipmotion_faces.outputs.scenes import character_scene, head_scene
from lipmotion_faces.portrait.layered import MOUTHS, choose_mouths
from lipmotion_faces.portrait.portrait_rasteriser import face_poses
from meshes.heads import head, write_glb
from pipeline.made import read_character
from testing.toy import ToySentence

Rows = NDArray[np.float64]
STILL = Staging(blinks=False, gaze=False, brows=False, head=False)
HOLD, LASTS = "hold from 0.8 to 1.4", slice(81, 140)


@pytest.fixture(scope="module")
def character(tmp_path_factory: pytest.TempPathFactory) -> Any:
    path: Path = tmp_path_factory.mktemp("character") / "head.glb"
    write_glb(path, head())
    return read_character(path)


@pytest.fixture
def session(toy_sentence: ToySentence, toy_model: Model) -> Session:
    return Session(Request(toy_sentence.audio, " ".join(toy_sentence.words)), model=toy_model)


@pytest.fixture
def spoken(session: Session) -> Edits:
    """A sentence that asks much of the lips between 0.8 and 1.4 s."""
    inside = [n for n, span in enumerate(session.units(), 1) if 0.8 < (span.start_s + span.end_s) / 2 < 1.4]
    assert len(inside) > 3
    return Edits().then(*(f"phone {n} is {'w f m th'.split()[k % 4]}" for k, n in enumerate(inside)))


def show(generation: Generation, character: Any) -> dict[str, Rows]:
    """Return what each face and each set of curves shows of the mouth, 100 times a second [each shape=(T, N)]."""
    seen = deliver_to_face(generation, Delivery(), 100.0, staging=STILL)
    drawn = [pose.mouth for pose in face_poses(seen.motion, seen.units, 100.0, STILL)]
    poses = head_poses(seen.motion, seen.units, 100.0, STILL)
    sheet = cues(generation, fps=100.0, hold_frames=1)
    letters = [
        ord(span.label) for span in sheet.cues for _ in range(round(100 * span.end_s) - round(100 * span.start_s))
    ]
    rows = {
        "drawn": np.array(drawn),
        "layers": np.array([[sorted(MOUTHS).index(name)] for name in choose_mouths(drawn, list(MOUTHS), 100.0)]),
        "head": np.array([[number for number in pose if isinstance(number, float)] for pose in poses]),
        "cues": np.array(letters)[:, None],
    }
    for name in ("arkit", "visemes", "vowels", "fap"):
        curves = make_curves(generation.motion, generation.units, name, staging=STILL, edits=generation.curve_edits)
        rows[name] = curves.values / (1000 if name == "fap" else 1)
    for name, scene in (
        ("head.glb", head_scene(generation, staging=STILL)),
        ("character", character_scene(generation, character, staging=STILL)),
    ):
        rows[name] = scene.weights.values
    return rows


def test_what_is_held_or_locked_stays_on_all_faces(session: Session, spoken: Edits, character: Any):
    plain, held = (show(session.generate(each), character) for each in (spoken, spoken.then(HOLD)))
    for name, rows in held.items():
        assert np.ptp(plain[name][LASTS], axis=0).max() > 0.1, name
        assert np.ptp(rows[LASTS], axis=0).max() < 0.03, name
    last = len(session.units()) - 1
    lock = spoken.then("gain jawOpen 0.5 from 0.9 to 1", "lock from 0.8 to 1.4")
    later = lock.then("hold from 1.3 to 1.7", "gain jawOpen 3 from 0.2 to 1.9", f"phone {last} is w")
    before, after = (show(session.generate(each), character) for each in (lock, later))
    for name in {*before} - {"cues"}:  # shapes are chosen for a line as a whole
        assert np.abs(after[name] - before[name])[LASTS].max() < 0.03, name


def test_a_hold_is_left_no_faster_than_lips_move(session: Session, spoken: Edits, character: Any):
    open_at = float(session.generate(spoken).motion["opening"].argmax()) / 100
    edits = spoken.then(f"pin opening 0.3 at {open_at}", f"hold from {open_at} to {open_at + 0.3}")
    left = show(session.generate(edits), character)["drawn"][:, 0]
    after = round(100 * (open_at + 0.3))
    assert np.abs(np.diff(left[after : after + 15])).max() < 1.2 * LIP_SPEED / 100


@pytest.mark.parametrize("sentence", ["pin opening 0.1 at 1.1", "draw opening 0.1 0.1 from 1.05 to 1.15"])
def test_what_is_pinned_or_drawn_is_shown_in_every_phone(session, spoken, character, sentence):
    for phone in "m w f th".split():
        number = next(n for n, span in enumerate(session.units(), 1) if span.end_s > 1.1)
        generation = session.generate(spoken.then(f"phone {number} is {phone}", sentence))
        shown, wanted = show(generation, character), float(opening_to_gap(np.array([0.1]))[0])
        assert shown["drawn"][110, 0] == pytest.approx(wanted, abs=1e-3), phone
        assert shown["head"][110, 0] == pytest.approx(wanted, abs=1e-3), phone
        assert shown["arkit"][110] @ arkit_mouth().gap == pytest.approx(wanted, abs=1e-2), phone


def test_a_pin_of_any_curve_shows_on_every_face(session: Session, spoken: Edits, character: Any):
    plain = show(session.generate(spoken), character)
    for sentence, sign in (("pin jawOpen 0.8 at 1.1", 1), ("pin viseme_aa 1 at 1.1", 1), ("pin aa 1 at 1.1", 1)):
        shown = show(session.generate(spoken.then(sentence)), character)
        for name in ("drawn", "head"):
            more = shown[name][:, 0] - plain[name][:, 0]
            assert sign * more[110] > 0.05, (sentence, name)
            assert np.abs(more[[*range(99), *range(122, len(more))]]).max() < 1e-6, (sentence, name)
    seen = deliver_to_face(
        session.generate(spoken.then("pin browInnerUp 0.9 at 1.1", "pin mouthPucker 1 at 1.1")), Delivery(), 100.0
    )
    pose = head_poses(seen.motion, seen.units, 100.0)[110]
    assert pose.mood.inner > 0.5
    assert pose.roundness > 0.6
