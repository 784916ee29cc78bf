"""What files of motion hold; what was written and is given back unedited is what it was."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lipmotion import Delivery, Request, animate, cues, read_motion, speak, write
from lipmotion.articulation.delivery import find_closed_times
from lipmotion.articulation.liveliness import Liveliness
from lipmotion.articulation.mouth import find_mouth
from lipmotion.formats.base import Thinning
from lipmotion.meshes.fitting.eyes_and_brows import FULL_LOOK_RAD, compute_living_curves, eye_and_brow_weights
from lipmotion.meshes.model.rig_tables import RigRow, read_rig_table
from lipmotion.pipeline.analysis.read_request import read_units
from lipmotion.pipeline.analysis.speech_analysis import analyse
from lipmotion.pipeline.outputs.curve_sets import make_curves
from lipmotion.pipeline.outputs.motion_files import fit_to_format, read_generation, thin_keys
from lipmotion.types import WEIGHT, Channel, Generation, Motion, Span, Timeline, Unit
from lipmotion_faces import Staging
from lipmotion_faces.characters.calibration import POSES, calibrate_rows, list_pose_sources
from pipeline.made import in_mood
from speech import stand_in_voice

TAKE = Path("a.livelink.csv")

HEAD = ("headYaw", "headPitch", "headRoll")


def test_plain_formats_hold_what_was_chosen(generation):
    chosen = generation.selected(["opening"])
    assert fit_to_format(Path("a.csv"), generation, chosen, None) is chosen


def test_a_take_holds_a_whole_face_at_60_frames(generation):
    held = fit_to_format(TAKE, generation, generation.selected(["opening"]), None)
    assert held.motion.rate_hz == pytest.approx(60.0)
    assert {"mouthClose", "mouthFunnel", "mouthSmileLeft"} < set(held.motion.names)
    assert {"eyeBlinkLeft", "browInnerUp", *HEAD} < set(held.motion.names)
    assert held.motion["jawOpen"].max() > 0.2


def test_a_take_shows_the_closures_of_the_motion(generation):
    at_100 = make_curves(generation.motion, generation.units, "arkit")
    held = fit_to_format(TAKE, generation, generation, 12.0).motion
    for start_s, end_s in ((0.46, 0.64), (0.86, 1.04)):
        spans = [(each.time_s >= start_s) & (each.time_s <= end_s) for each in (held, at_100)]
        gaps = [each["jawOpen"] - each["mouthClose"] for each in (held, at_100)]
        slow, fast = (gap[span].min() for gap, span in zip(gaps, spans, strict=True))
        assert slow == pytest.approx(fast, abs=0.01)


def test_blendshapes_that_the_motion_has_are_kept(generation):
    frames = len(generation.motion.values)
    names = ("head.jawOpen", "mouthSmile_L", "eyeBlink_L", "opening")
    values = np.random.default_rng(2).random((frames, 4))
    given = Motion(values, 100.0, tuple(Channel(name, WEIGHT) for name in names))
    edited = replace(generation, motion=given, spread=np.zeros(values.shape), units=Timeline(()))
    held = fit_to_format(TAKE, edited, edited, 100.0).motion
    for column, name in enumerate(("jawOpen", "mouthSmileLeft", "eyeBlinkLeft")):
        assert held[name] == pytest.approx(values[:, column])
    assert "eyeBlinkRight" in held.names
    alone = edited.selected(["head.jawOpen", "mouthSmile_L"])
    held = fit_to_format(TAKE, alone, alone, 100.0).motion
    assert held.names[:2] == ("jawOpen", "mouthSmileLeft")
    assert {"eyeBlinkLeft", "browInnerUp", *HEAD} < set(held.names)


def test_the_script_takes_controls_that_were_asked_for(generation):
    control = Motion(np.zeros((201, 1)), 100.0, (Channel("Jaw.rotation.x", "control"),))
    chosen = replace(generation, motion=control, spread=np.zeros((201, 1)))
    assert fit_to_format(Path("a.blender.py"), generation, chosen, None).motion.names == ("Jaw.rotation.x",)
    assert "jawOpen" in fit_to_format(Path("a.blender.py"), generation, generation, None).motion.names


def test_what_moves_on_its_own_can_be_switched_off(generation):
    said = (generation.motion, generation.units)
    still = compute_living_curves(*said, Staging(blinks=False, gaze=False, brows=False, head=False))
    moving = compute_living_curves(*said)
    assert np.abs(still.values).max() < 1e-9
    assert all(np.abs(moving[name]).max() > 1e-3 for name in ("browInnerUp", *HEAD))
    assert 0 <= moving["eyeBlinkLeft"].min() <= moving["eyeBlinkLeft"].max() <= 1


def test_eyes_look_to_one_side_together(generation):
    gaze = np.array([[0.5 * FULL_LOOK_RAD, 0.25 * FULL_LOOK_RAD]])
    to_its_left = eye_and_brow_weights(Liveliness(np.zeros(1), np.zeros(1), gaze, np.zeros((1, 3))))
    for name, weight in (("OutLeft", 0.5), ("InRight", 0.5), ("InLeft", 0), ("OutRight", 0), ("UpLeft", 0.25)):
        assert to_its_left[f"eyeLook{name}"] == pytest.approx(weight)
    moving = compute_living_curves(generation.motion, generation.units)
    assert moving["eyeLookOutLeft"] == pytest.approx(moving["eyeLookInRight"])
    assert moving["eyeLookInLeft"] == pytest.approx(moving["eyeLookOutRight"])
    assert np.abs(moving["eyeLookOutLeft"] * moving["eyeLookInLeft"]).max() < 1e-12


def written(folder: Path, generation: Generation, name: str, **asked: Any) -> list[str]:
    write(generation, folder / name, **asked)
    return (folder / name).read_text(encoding="utf-8").splitlines()


def test_channels_choose_among_the_curves_of_a_format(generation, tmp_path):
    lines = written(tmp_path, generation, "a.livelink.csv", curves="arkit", channels=["jawOpen", "opening"])
    moved = np.array([line.split(",")[2:] for line in lines[1:]], float).any(axis=0)
    assert [name for name, moves in zip(lines[0].split(",")[2:], moved, strict=True) if moves] == ["JawOpen"]


@pytest.mark.parametrize(
    ("name", "asked", "warned"),
    [
        ("a.livelink.csv", {"channels": ["opening"]}, True),
        ("a.fap", {"curves": "visemes"}, True),
        ("a.livelink.csv", {"curves": "arkit"}, False),
        ("a.csv", {"channels": ["opening"]}, False),
        ("a.bvh", {"channels": ["opening"]}, False),
    ],
)
def test_what_a_format_cannot_hold_is_said(generation, tmp_path, caplog, name, asked, warned):
    assert written(tmp_path, generation, name, **asked)
    assert ("holds channels of its own, none of those" in caplog.text) == warned


@pytest.mark.parametrize("name", ["a.bvh", "a.motion3.json"])
@pytest.mark.parametrize("rate_hz", [None, 24.0])
def test_formats_of_the_mouth_do_not_depend_on_curves(generation, tmp_path, name, rate_hz):
    plain = written(tmp_path, generation, name, rate_hz=rate_hz)
    assert written(tmp_path, generation, name, rate_hz=rate_hz, curves="visemes") == plain


def test_controls_of_a_rig_follow_brows_in_every_mood(generation, tmp_path):
    table = tmp_path / "rig.csv"
    table.write_text("control,source\nfrown,browDownLeft\ncheek,cheekSquintRight\n")
    plain, angry = (make_curves(in_mood(generation.motion, mood), generation.units, table) for mood in ("", "angry"))
    assert not plain["frown"].any()
    assert angry["frown"].min() > 0.5
    assert not angry["cheek"].any()


@pytest.mark.parametrize("suffix", [".json", ".csv", ".npz"])
def test_files_of_motion_hold_moods(generation, tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write(generation, path, delivery=Delivery(mood="sad:0.5"))
    found = read_generation(path).motion
    assert found.channels[-1] == Channel("mood_sad", WEIGHT)
    assert find_mouth(found, generation.units).frown.max() > 0.2


@pytest.mark.long
def test_files_of_keys_hold_fewer_of_them_and_no_curve_that_is_hardly_there(generation, tmp_path):
    plain, fewer = (written(tmp_path, generation, f"{n}.tres", delivery=Delivery(key_tolerance=n)) for n in (0, 0.03))
    assert sum(map(len, fewer)) < 0.5 * sum(map(len, plain))
    names = [line for line in fewer if "NodePath" in line]
    assert 5 < len(names) < sum("NodePath" in line for line in plain)
    held = fit_to_format(Path("a.tres"), generation, generation, None)
    thin = thin_keys(held, Thinning(0.03, tuple(find_closed_times(held)))).motion
    for name in thin.names:
        assert np.abs(thin[name] - held.motion[name]).max() < 0.0301
    assert all(held.motion[name].max() <= 0.03 for name in {*held.motion.names} - {*thin.names})
    assert {*HEAD} < {*thin.names}
    json = [written(tmp_path, generation, f"{n}.json", delivery=Delivery(key_tolerance=n)) for n in (0, 0.03)]
    assert json[0] == json[1]


def test_controls_of_a_rig_have_the_stated_values(tmp_path):
    (tmp_path / "rig.csv").write_text("control,source,gain,offset\nJaw,jawOpen,-25,\nJaw,mouthPucker,-5,1\nLip,ou,1,\n")
    rows = read_rig_table(tmp_path / "rig.csv")
    sources = list_pose_sources(tmp_path / "rig.csv", rows)
    changed = calibrate_rows(rows, sources, {"open": {"Jaw": -20}, "closed": {"Jaw": 2}, "rounded": {"Lip": 3}})
    assert _values(changed, sources, "Jaw")[:2] == pytest.approx([-20, 2])
    assert _values(changed, sources, "Lip")[2] == pytest.approx(3)
    assert changed[1].gain / changed[0].gain == pytest.approx(0.2)  # three values of one are met as nearly as they can:
    stated = {pose: {"A": value} for pose, value in zip(POSES, (1.0, 0.0, 0.6), strict=True)}
    (row,) = calibrate_rows([RigRow("A", "jawOpen")], {"jawOpen": [0.5, 0.0, 0.2]}, stated)
    assert row.gain == pytest.approx(1.947, abs=1e-3)
    assert row.offset == pytest.approx(0.079, abs=1e-3)


def _values(rows: list[RigRow] | tuple[RigRow, ...], sources: dict[str, list[float]], control: str) -> list[float]:
    ours = [row for row in rows if row.control == control]
    nothing = [0.0] * len(POSES)
    return [sum(row.offset + row.gain * sources.get(row.source, nothing)[n] for row in ours) for n in range(len(POSES))]


LEFT_CORNER = "y_291"  # a channel of one side of the mouth: an edit may be of that side alone
PHONE_FILES = ("a.TextGrid", "a.json", "a.npz")


def test_spoken_text_and_its_phones_give_the_motion_of_speak(monkeypatch, toy_model, tmp_path):
    stand_in_voice.install(monkeypatch)
    sound, said = speak("Papa, see Bob. Mama!", model=toy_model)
    write(said, [tmp_path / name for name in ("a.wav", "a.flac", *PHONE_FILES)], speech=sound)
    for recording, phones in (("a.wav", "a.TextGrid"), ("a.flac", "a.json"), ("a.wav", "a.npz")):
        request = Request(tmp_path / recording, units=read_units(tmp_path / phones))
        again = animate(request, model=toy_model)
        assert np.array_equal(again.motion.values, said.motion.values)
        assert again.units == said.units
        assert cues(again) == cues(said)


@pytest.mark.parametrize("name", PHONE_FILES)
@pytest.mark.parametrize("words", [None, "all"])
def test_phones_of_a_recording_say_what_is_known_of_them(toy_model, toy_sentence, tmp_path, words, name):
    transcript = " ".join(toy_sentence.words) if words else None
    request = Request(toy_sentence.audio, transcript=transcript, recogniser="own")
    first = analyse(toy_model, request)
    result = animate(request, model=toy_model)
    write(result, tmp_path / name)
    given = Request(toy_sentence.audio, units=read_units(tmp_path / name), recogniser="own")
    again, known = analyse(toy_model, given), bool(words)
    for each in (first, again):
        assert (each.units_known, each.confidence, each.units_decide) == (known, float(known), known)
    assert np.array_equal(animate(given, model=toy_model).motion.values, result.motion.values)


@pytest.mark.parametrize("name", PHONE_FILES)
def test_corrected_phones_are_known_and_all_others_as_doubtful_as_before(
    toy_model, toy_sentence, generation, tmp_path, name
):
    found = Timeline(tuple(replace(s, label=replace(s.label, confidence=0.25)) for s in toy_sentence.units))
    write(replace(generation, units=found), tmp_path / name)
    read = read_units(tmp_path / name)
    assert [span.label.confidence for span in read] == [0.25] * len(found)
    at, border_s = 4, read[4].end_s + 0.02
    spans = list(read)
    spans[at] = replace(spans[at], end_s=border_s)
    spans[at + 1] = replace(spans[at + 1], start_s=border_s)
    edited = tmp_path / f"b{Path(name).suffix}"
    write_as_edited(edited, Timeline(tuple(spans)), found, generation)
    speech = analyse(toy_model, Request(toy_sentence.audio, units=read_units(edited)))
    assert [span.label.confidence for span in speech.units].count(None) == 2
    confidence = np.asarray(speech.confidence)
    known = np.flatnonzero(confidence == 1) / 100
    assert speech.units_decide
    assert not speech.units_known
    assert read[at].start_s - 1e-6 <= known.min() < known.max() <= read[at + 1].end_s
    assert set(np.unique(confidence)) == {0.25, 1.0}


def write_as_edited(path: Path, units: Timeline[Unit], found: Timeline[Unit], generation: Generation) -> None:
    """Write phones as a user leaves them who edited the file of ``found``."""
    write(replace(generation, units=found), path)
    if path.suffix == ".npz":
        with np.load(path) as file:
            arrays = dict(file)
        arrays["document"] = np.array(edited_text(str(arrays["document"]), units, found, "json"))
        np.savez(path, **arrays)
    else:
        path.write_text(edited_text(path.read_text(), units, found, path.suffix), encoding="utf-8")


def edited_text(text: str, units: Timeline[Unit], found: Timeline[Unit], kind: str) -> str:
    """Return the text of a file with the times of phones changed, but not of what was recognised."""
    phones, mark, rest = text.partition('"words"' if kind == ".TextGrid" else '"recognised"')
    for before, after in zip(found, units, strict=True):
        for key, was, now in (
            ("xmax = ", before.end_s, after.end_s),
            ("xmin = ", before.start_s, after.start_s),
            ('"end_s": ', before.end_s, after.end_s),
            ('"start_s": ', before.start_s, after.start_s),
        ):
            phones = phones.replace(f"{key}{was}", f"{key}{now}") if was != now else phones
    return phones + mark + rest


def test_silence_alone_comes_back(generation, tmp_path):
    silent = Timeline((Span(0.0, 1.0 / 3, Unit("sil", confidence=0.0)),))
    write(replace(generation, units=silent), tmp_path / "a.TextGrid")
    assert read_units(tmp_path / "a.TextGrid") == silent


@pytest.mark.parametrize("suffix", ["json", "csv", "npz", "c3d", "livelink.csv", "fap"])
@pytest.mark.parametrize("rate_hz", [25.0, 30_000 / 1001])
def test_motion_that_is_read_and_written_is_what_it_was(generation, tmp_path, suffix, rate_hz):
    first, second = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
    write(generation, first, rate_hz=rate_hz)
    write(read_generation(first), second)
    (one, phones), (other, same_phones) = read_motion(first), read_motion(second)
    assert one.channels == other.channels
    assert one.rate_hz == other.rate_hz == rate_hz
    assert phones == same_phones
    assert np.array_equal(one.values, other.values)


@pytest.mark.parametrize("suffix", ["json", "csv", "npz", "c3d"])
@pytest.mark.parametrize("output", ["json", "csv", "npz", "c3d"])
def test_an_edited_value_is_the_only_one_that_changes(generation, tmp_path, suffix, output):
    write(generation, tmp_path / f"a.{suffix}")
    given = read_generation(tmp_path / f"a.{suffix}")
    values = given.motion.values.copy()
    columns = sorted(given.motion.column(name) for name in ("opening", LEFT_CORNER))
    values[50, columns] += 0.125
    write(replace(given, motion=replace(given.motion, values=values)), tmp_path / f"b.{suffix}")
    write(given, tmp_path / f"c.{output}")
    write(read_generation(tmp_path / f"b.{suffix}"), tmp_path / f"d.{output}")
    before, after = (read_motion(tmp_path / f"{name}.{output}")[0].values for name in "cd")
    changed = np.argwhere(before != after)
    assert changed.tolist() == [[50, column] for column in columns]
    assert (after - before)[50, columns] == pytest.approx(0.125, abs=1e-5)


def test_an_edited_opening_leaves_brows_alone_that_are_far_away(generation, tmp_path):
    values = generation.motion.values.copy()
    values[20:25, generation.motion.column("opening")] += 0.3
    edited = replace(generation, motion=replace(generation.motion, values=values))
    write(generation, tmp_path / "a.livelink.csv")
    write(edited, tmp_path / "b.livelink.csv")
    before, after = (read_motion(tmp_path / name)[0] for name in ("a.livelink.csv", "b.livelink.csv"))
    far = before.time_s > 1.25
    assert far.any()
    moved = np.abs(before.values - after.values)[far].max(axis=0)
    mouth = np.array([name.startswith(("mouth", "jaw")) for name in before.names])
    assert moved[~mouth].max() < 1e-4
    assert moved[mouth].max() < 2e-3  # all frames are solved at once, in steps
