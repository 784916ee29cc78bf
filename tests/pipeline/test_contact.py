"""What an edit decides stays on every face and in every set of curves, whatever the phones ask for."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from formats.examples import of_motion
from lipmotion import Delivery, Edits, Model, Request, Session, Staging, cues, read_motion
from lipmotion.articulation.contact import MIN_GAP, opening_to_gap
from lipmotion.articulation.lip_points import FACING
from lipmotion.articulation.mouth import LIP_SPEED, find_mouth
from lipmotion.formats import write_motion
from lipmotion.formats.fap import FAP
from lipmotion.meshes.fitting.blendshape_motion import arkit_mouth, vowel_mouth, with_mouth
from lipmotion.pipeline.outputs.curve_sets import ARKIT, VOWELS, WHOLE_FACE, make_curves
from lipmotion.pipeline.outputs.deliver import deliver
from lipmotion.pipeline.outputs.motion_files import fit_to_format, resample_curves
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Span, Timeline, Unit
from lipmotion.types.delivery import MOODS
from lipmotion.units import mark_closing_phones
from lipmotion_faces.head import list_head_poses
from lipmotion_faces.head.stage import build_head_mesh, make_figure, measure_lip_gap
from lipmotion_faces.outputs.drawn_video import deliver_to_face
from lipmotion_faces.outputs.scenes import build_character_scene, build_head_scene
from lipmotion_faces.portrait.layered import MOUTHS, choose_mouths
from lipmotion_faces.portrait.portrait_rasteriser import list_face_poses
from meshes.heads import VISEMES, head, lip_points, renamed, write_glb, write_obj
from meshes.speech import motion, units
from pipeline.made import read_character
from testing.toy import ToySentence

Mask = NDArray[np.bool_]
Reader = Callable[[Generation, float], Mask]
RATES = (24.0, 25.0, 30.0, 60.0, 100.0)
FILES = ("a.vmd", "a.vrma")  # files of vowels that can be read, of one frame rate or any
OWN_VOWELS = {"jawOpen": "A", "mouthPucker": "O", "mouthStretchLeft": "E"}
TOUCHING_GAP = MIN_GAP / 2


def _sentence() -> Timeline[Unit]:
    phones = "sil m ay f r eh n d sp w aa z b uw th p ey v b l em sil".split()
    return Timeline(tuple(Span(0.11 * n, 0.11 * (n + 1), Unit(phone)) for n, phone in enumerate(phones)))


def _wandering(rate_hz: float, seed: int) -> Motion:
    """Motion that knows nothing of the phones: lips touch where they happen to."""
    draw, count = np.random.default_rng(seed), int(2.42 * rate_hz)
    knots = np.maximum(draw.normal(0.06, 0.06, 40), 0.0)
    opening = np.interp(np.arange(count) / rate_hz, np.linspace(0, 2.42, 40), knots)
    width = 0.57 + 0.03 * np.sin(np.arange(count) / rate_hz * 5)
    return Motion(np.column_stack([opening, width]), rate_hz, (Channel("opening"), Channel("width")))


def _captured() -> Motion:
    """Weights of blendshapes at 60 Hz, as a capture has them: p, b and m are not wholly closed."""
    time_s = np.arange(146) / 60
    jaw = np.where((time_s > 1.0) & (time_s < 1.1), 0.0, 0.16 + 0.14 * np.sin(2 * np.pi * 2.3 * time_s))
    curves = {"jawOpen": jaw, "mouthClose": 0.5 * jaw, "mouthFunnel": 0.1 * jaw, "mouthSmileLeft": 0.2 * (1 - jaw)}
    return Motion(np.column_stack(list(curves.values())), 60.0, tuple(Channel(name, WEIGHT) for name in curves))


def _edited() -> Motion:
    """A generated motion with one vowel closed, and one m held further apart, by hand."""
    moved = motion()
    values = moved.values.copy()
    values[70:78, 0], values[50:60, 0] = 0.0, 0.06
    return replace(moved, values=values)


KINDS: dict[str, Callable[[], Generation]] = {
    "generated": lambda: of_motion(motion(), units()),
    "distances alone": lambda: of_motion(motion(points=False), units()),
    "edited by hand": lambda: of_motion(_edited(), units()),
    "imported at 25 Hz": lambda: of_motion(_wandering(25.0, 1), _sentence()),
    "imported at 100 Hz, no phones": lambda: of_motion(_wandering(100.0, 2), Timeline(())),
    "captured weights": lambda: of_motion(_captured(), _sentence()),
    "captured weights, no phones": lambda: of_motion(_captured(), Timeline(())),
}


@pytest.fixture(scope="module")
def characters(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("characters")
    for name, mesh in (("arkit", head()), ("visemes", renamed(VISEMES)), ("vowels", renamed(OWN_VOWELS))):
        write_glb(folder / f"{name}.glb", mesh)
    plain = head(shapes=False)
    write_obj(folder / "points.obj", plain)
    rows = "".join(f"{point},{vertex}\n" for point, vertex in lip_points(plain).items())
    (folder / "points.csv").write_text("point,vertex\n" + rows)
    found = {name: read_character(folder / f"{name}.glb") for name in ("arkit", "visemes", "vowels")}
    found["points"] = read_character(folder / "points.obj", points=folder / "points.csv")
    return found


def _mesh_gap(character: Any, vertices: NDArray[np.float64]) -> float:
    placement, rest = character.placement, character.mesh.vertices
    rows = [tuple(placement.vertices[placement.row(point)] for point in pair) for pair in FACING[:3]]
    moved = [(vertices[up] - vertices[low] - rest[up] + rest[low]) @ placement.axes[:, 1] for up, low in rows]
    return float(np.mean(moved)) / placement.scale


def _of_character(character: Any) -> Reader:
    def read(generation: Generation, fps: float) -> Mask:
        moved = generation.motion
        vertices = character.vertices(moved, generation.units, moved.resampled(fps).time_s)
        gaps = [_mesh_gap(character, each) for each in vertices]
        return np.array(gaps) < TOUCHING_GAP

    return read


def _of_curves(name: str) -> Reader:
    def read(generation: Generation, fps: float) -> Mask:
        curves = make_curves(generation.motion, generation.units, name)
        whole = replace(generation, motion=curves, spread=np.zeros(curves.values.shape))
        return _closed(resample_curves(whole, generation, fps).motion)

    return read


def _of_file(name: str) -> Reader:
    return lambda generation, fps: _closed(fit_to_format(Path(name), generation, generation, fps).motion)


def _of_scene(character: Any) -> Reader:
    gap = dict(zip(character.shapes.names, character.shapes.gap.tolist(), strict=True))

    def read(generation: Generation, fps: float) -> Mask:
        weights = build_character_scene(generation, character, fps).weights
        apart = sum(gap[name] * weights[name] for name in weights.names if name in gap)
        return np.asarray(apart < TOUCHING_GAP)

    return read


def _of_head_scene(generation: Generation, fps: float) -> Mask:
    moved = of_motion(with_mouth(generation.motion), generation.units)
    weights = build_head_scene(moved, fps).weights
    character = make_figure()
    mesh = build_head_mesh(character, moods=any(name.startswith("mood_") for name in generation.motion.names))
    moved = mesh.displacements(np.arange(len(character.skin.rest)))
    parting = dict(zip(mesh.shape_names, measure_lip_gap(moved[:, character.skin.list_lip_rows()]), strict=True))
    return np.asarray(sum(parting[name] * weights[name] for name in weights.names) < TOUCHING_GAP)


def _closed(curves: Motion) -> Mask:
    """Return the frames in which curves close the lips, as a program that reads them would show it."""
    if "viseme_sil" in curves.names:
        return np.asarray(curves["viseme_sil"] + curves["viseme_PP"] > 0.99)
    if "fap4_lower_t_midlip" in curves.names:
        return np.asarray(np.abs(curves["fap4_lower_t_midlip"] + curves["fap5_raise_b_midlip"]) < 5)
    mouth = vowel_mouth() if "aa" in curves.names else arkit_mouth()
    return np.asarray(
        sum(gap * curves[name] for name, gap in zip(mouth.names, mouth.gap, strict=True) if name in curves.names)
        < TOUCHING_GAP
    )


def _drawn(generation: Generation, fps: float) -> Mask:
    poses = list_face_poses(with_mouth(generation.motion), generation.units, fps, Staging())
    return np.array([pose.mouth.gap < TOUCHING_GAP for pose in poses])


def _of_head(generation: Generation, fps: float) -> Mask:
    poses = list_head_poses(with_mouth(generation.motion), generation.units, fps)
    return np.array([pose.gap < TOUCHING_GAP for pose in poses])


def _readers(characters: dict[str, Any]) -> dict[str, Reader]:
    readers: dict[str, Reader] = {"drawn faces": _drawn, "head": _of_head, "head scene": _of_head_scene}
    readers |= {name: _of_curves(name) for name in (ARKIT, WHOLE_FACE, VOWELS, "visemes", FAP)}
    readers |= {"take": _of_file("a.livelink.csv"), "clip": _of_file("a.tres")}
    readers |= {f"character {name}": _of_character(each) for name, each in characters.items()}
    return readers | {f"scene {name}": _of_scene(each) for name, each in characters.items() if each.shapes is not None}


def _check(generation: Generation, fps: float, readers: dict[str, Reader]) -> None:
    mouth = find_mouth(with_mouth(generation.motion), generation.units, fps)
    assert 0 < mouth.contact.sum() < 0.8 * len(mouth.contact)
    for name, read in readers.items():
        wrong = np.flatnonzero(read(generation, fps) != mouth.contact)
        assert not len(wrong), f"{name} at {fps:g} Hz: other contact in frames {wrong.tolist()}"


AT_RATES = [  # the first of the quick ones goes through all that is ours, the second through what others give
    pytest.param(kind, fps, marks=[] if kind in ("generated", "imported at 25 Hz") else pytest.mark.long)
    for kind, fps in zip(KINDS, RATES * 2, strict=False)
]


@pytest.mark.parametrize(("kind", "fps"), AT_RATES)
def test_lips_touch_in_the_same_frames_everywhere(kind, fps, characters):
    readers = _readers(characters)
    if kind != "edited by hand":
        del readers["head scene"]
    _check(deliver(KINDS[kind](), Delivery()), fps, readers)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("kind", KINDS)
def test_files_of_vowels_have_the_same_contact(kind, name, tmp_path):
    generation = deliver(KINDS[kind](), Delivery())
    write_motion(tmp_path / name, fit_to_format(Path(name), generation, generation, None), source={}, model={})
    read, _ = read_motion(tmp_path / name)
    contact = find_mouth(with_mouth(generation.motion), generation.units, read.rate_hz).contact
    assert np.flatnonzero(_closed(read)[: len(contact)] != contact).tolist() == []


def _closures_kept(kind: str, mood: str) -> Generation:
    """Return motion in a mood; every p, b and m closes the lips in it for as long as in none."""
    generation, moody = (deliver(KINDS[kind](), Delivery(mood=name)) for name in ("", mood))
    plain, mouth = (find_mouth(with_mouth(each.motion), each.units).contact for each in (generation, moody))
    time_s = generation.motion.time_s
    for span, closing in zip(generation.units, mark_closing_phones(generation.units), strict=True):
        within = (span.start_s <= time_s) & (time_s < span.end_s)
        assert not closing or (mouth[within].sum() >= 1 and plain[within].sum() - mouth[within].sum() <= 2)
    return moody


@pytest.mark.parametrize("mood", MOODS)
def test_lips_touch_in_the_same_frames_in_every_mood(mood, characters):
    quick = ("drawn faces", "head", ARKIT, FAP, "take")
    readers = {name: read for name, read in _readers(characters).items() if name in quick}
    _check(_closures_kept("imported at 25 Hz", mood), 25.0, readers)


@pytest.mark.long
@pytest.mark.parametrize("mood", MOODS)
def test_everywhere_in_every_mood(mood, characters):
    for kind in ("generated", "captured weights"):
        _check(_closures_kept(kind, mood), 30.0, _readers(characters))


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
    drawn = [pose.mouth for pose in list_face_poses(seen.motion, seen.units, 100.0, STILL)]
    poses = list_head_poses(seen.motion, seen.units, 100.0, STILL)
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
        ("head.glb", build_head_scene(generation, staging=STILL)),
        ("character", build_character_scene(generation, character, staging=STILL)),
    ):
        rows[name] = scene.weights.values
    return rows


@pytest.mark.long
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


@pytest.mark.long
def test_a_hold_is_left_no_faster_than_lips_move(session: Session, spoken: Edits, character: Any):
    open_at = float(session.generate(spoken).motion["opening"].argmax()) / 100
    edits = spoken.then(f"pin opening 0.3 at {open_at}", f"hold from {open_at} to {open_at + 0.3}")
    left = show(session.generate(edits), character)["drawn"][:, 0]
    after = round(100 * (open_at + 0.3))
    assert np.abs(np.diff(left[after : after + 15])).max() < 1.2 * LIP_SPEED / 100


@pytest.mark.long
@pytest.mark.parametrize("sentence", ["pin opening 0.1 at 1.1", "draw opening 0.1 0.1 from 1.05 to 1.15"])
def test_what_is_pinned_or_drawn_is_shown_in_every_phone(session, spoken, character, sentence):
    for phone in "m w f th".split():
        number = next(n for n, span in enumerate(session.units(), 1) if span.end_s > 1.1)
        generation = session.generate(spoken.then(f"phone {number} is {phone}", sentence))
        shown, wanted = show(generation, character), float(opening_to_gap(np.array([0.1]))[0])
        assert shown["drawn"][110, 0] == pytest.approx(wanted, abs=1e-3), phone
        assert shown["head"][110, 0] == pytest.approx(wanted, abs=1e-3), phone
        assert shown["arkit"][110] @ arkit_mouth().gap == pytest.approx(wanted, abs=1e-2), phone


@pytest.mark.long
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
    pose = list_head_poses(seen.motion, seen.units, 100.0)[110]
    assert pose.mood.inner > 0.5
    assert pose.roundness > 0.6
