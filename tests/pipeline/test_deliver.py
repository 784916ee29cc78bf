import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lipmotion import Delivery, Outputs, Request, animate, read_motion, write
from lipmotion.articulation.contact import find_closures
from lipmotion.articulation.rest import LAUGH_GAP
from lipmotion.errors import InputError
from lipmotion.pipeline.outputs.curve_sets import make_curves, with_curves
from lipmotion.pipeline.outputs.deliver import deliver, deliver_to_face, hold_mouth
from lipmotion.pipeline.outputs.output import OutputSettings, Performance, shift_prosody
from lipmotion.types import Prosody
from lipmotion.types.audio import LAUGHTER
from lipmotion.types.delivery import MoodKey
from lipmotion_faces import Face, Staging
from lipmotion_faces.characters.character_files import load_character
from lipmotion_faces.filmed.face import FilmedFace
from lipmotion_faces.outputs.scenes import delivered_scene
from lipmotion_faces.outputs.shown_faces import ShownPerson, shown_face
from meshes.heads import head, write_glb
from speech.made_voices import laugh, pulses, recording, said, vowels


@pytest.mark.parametrize("offset_ms", [500.0, -250.0])
def test_files_say_when_the_sound_begins(generation, offset_ms, toy_speech, tmp_path):
    delivery = Delivery(offset_ms=offset_ms)
    paths = [tmp_path / "a.json", tmp_path / "a.blender.py"]
    write(generation, paths, speech=toy_speech, delivery=delivery, curves="arkit", channels=["jawOpen"])
    assert json.loads(paths[0].read_text())["source"] == {"file": toy_speech.name, "start_s": f"{offset_ms / 1000:g}"}
    assert f"SOUND_S = {offset_ms / 1000!r}\n" in paths[1].read_text()
    scene = delivered_scene(
        Performance(generation, OutputSettings(shown_face("head"), outputs=Outputs(rate_hz=12.0), delivery=delivery))
    )
    assert scene.sound_s == pytest.approx(offset_ms / 1000)


def test_weights_beside_an_opening_are_enlarged_for_the_mesh_that_has_them(generation, tmp_path):
    write_glb(tmp_path / "head.glb", head())
    character = load_character(tmp_path / "head.glb")
    larger = Delivery(intensity=2)
    both = with_curves(generation, "arkit")[0]
    before, after = both.motion["jawOpen"], deliver_to_face(both, larger, 25.0, character).motion["jawOpen"]
    assert after.max() > 1.3 * before.max()
    plain, doubled = (deliver_to_face(generation, each, 25.0).motion["opening"] for each in (Delivery(), larger))
    assert doubled.max() > 1.5 * plain.max()


def test_brows_and_head_of_pictures_come_later_with_the_mouth(generation, toy_speech, tmp_path, monkeypatch):
    levels = []

    def staged(face: Face, _: Staging, prosody: Prosody | None = None) -> Face:
        if prosody is not None:
            levels.append(prosody.level_db)
        return face

    monkeypatch.setattr("lipmotion_faces.outputs.drawn_video.stage_face", staged)
    monkeypatch.setattr("lipmotion_faces.video.mp4.write_pictures", lambda *_: None)
    for offset_ms in (0, 500):
        path = tmp_path / "a%d.png"
        write(generation, path, speech=toy_speech, fps=1, face="woman", delivery=Delivery(offset_ms=offset_ms))
    assert levels[-1][50:] == pytest.approx(levels[0])


@pytest.mark.parametrize("offset_ms", [30.0, -30.0, 0.0])
def test_loudness_and_pitch_move_together(offset_ms):
    prosody = Prosody(np.arange(10.0) - 40, np.arange(10.0) / 10)
    moved, by = shift_prosody(prosody, Delivery(offset_ms=offset_ms)), round(offset_ms / 10)
    assert len(moved.level_db) == len(moved.log_f0) == 10 + by
    assert moved.level_db[max(by, 0) :] == pytest.approx(prosody.level_db[max(-by, 0) :])
    assert moved.log_f0[max(by, 0) :] == pytest.approx(prosody.log_f0[max(-by, 0) :])
    assert (moved.level_db[: max(by, 0)] == -40).all()  # quiet, and without a pitch
    assert np.isnan(moved.log_f0[: max(by, 0)]).all()


@pytest.mark.parametrize("rate_hz", [12.0, 23.976])
def test_closures_between_two_frames_of_a_slow_file_are_kept(generation, rate_hz, tmp_path):
    narrow = generation.motion.values.copy()
    column, closed = (
        generation.motion.column("opening"),
        [each.frame for each in find_closures(generation.motion, generation.units)],
    )
    narrow[50:100, column] = 0.1
    narrow[closed, column] = 0.0
    spiky = replace(generation, motion=replace(generation.motion, values=narrow))
    write(spiky, tmp_path / "a.csv", rate_hz=rate_hz, channels=["opening"])
    opening = read_motion(tmp_path / "a.csv")[0]["opening"]
    assert opening[[round(frame / 100 * rate_hz) for frame in closed]] == pytest.approx(0.0, abs=1e-6)


def test_eyes_and_head_move_on_while_the_mouth_is_held(generation, tmp_path):
    smooth, delivery = with_curves(generation, "face")[0], Delivery(min_hold_ms=400)
    assert max(np.abs(smooth.motion[name]).max() for name in ("eyeBlinkLeft", "headYaw")) > 1e-3
    steps = hold_mouth(smooth, delivery.hold_frames(100), [])
    for name in ("eyeBlinkLeft", "headYaw", "browInnerUp"):
        assert steps.motion[name] == pytest.approx(smooth.motion[name])
        assert name not in steps.stepped
    mouth = steps.motion["jawOpen"]
    changes = np.flatnonzero(np.abs(np.diff(mouth)) > 1e-9) + 1
    assert np.diff([0, *changes, len(mouth)]).min() >= 40
    write(smooth, tmp_path / "a.livelink.csv", delivery=delivery, rate_hz=100)
    assert read_motion(tmp_path / "a.livelink.csv")[0]["headYaw"] == pytest.approx(smooth.motion["headYaw"], abs=1e-5)
    assert {"jawOpen", "opening"} <= set(steps.stepped)


def test_moods_are_channels_that_the_intensity_leaves_and_the_offset_moves(generation):
    found = deliver(generation, Delivery(mood="happy:0.5, neutral at 1.0", intensity=2.0, offset_ms=500)).motion
    assert found.names == (*generation.motion.names, "mood_happy")
    assert found["mood_happy"][[0, 100, -1]] == pytest.approx([0.5, 0.5, 0.0])
    again = deliver(replace(generation, motion=found), Delivery())
    assert np.array_equal(again.motion.values, found.values)


def test_words_say_the_mood_after_the_one_that_is_asked_for(generation):
    tagged = replace(generation, moods=(MoodKey(1.0, "sad"),))
    assert deliver(tagged, Delivery()).motion["mood_sad"][[0, -1]] == pytest.approx([0, 1])
    both = deliver(tagged, Delivery(mood="happy")).motion
    assert (both["mood_happy"][0], both["mood_sad"][-1]) == (1, 1)
    assert both["mood_happy"][-1] == pytest.approx(0)


def test_neutral_is_what_no_mood_is(generation):
    plain, neutral = (deliver(generation, Delivery(mood=mood)).motion for mood in ("", "neutral"))
    assert neutral.names == plain.names
    assert np.array_equal(neutral.values, plain.values)


def test_a_filmed_face_has_the_mood_of_its_footage(generation, caplog):
    person = ShownPerson(FilmedFace(None, None, ()))  # type: ignore[arg-type] # nothing of it is needed
    with pytest.raises(InputError, match="the mood of its footage"):
        person.check_video(Path("a.mp4"), OutputSettings(face=person, delivery=Delivery(mood="happy")))
    person.check_video(Path("a.mp4"), OutputSettings(face=person, delivery=Delivery(mood="whisper")))
    person.check_drawable(Path("a.mp4"), replace(generation, moods=(MoodKey(0, "shout"), MoodKey(1, "sad", 0.5))))
    assert caplog.messages == ["a.mp4: a filmed face has the mood of its footage; not shown: sad:0.5"]


def test_vowels_have_expressions_of_moods_that_leave_the_lips_closed(generation):
    afraid = deliver(generation, Delivery(mood="afraid"))
    curves = make_curves(afraid.motion, afraid.units, "vowels")
    assert {*curves.names} - {*make_curves(generation.motion, generation.units, "vowels").names} >= {"sad", "surprised"}
    assert (curves["sad"][0], curves["surprised"][0]) == pytest.approx((0.5, 0.5))
    pressed = curves["closed"] > 0
    assert pressed.any()
    assert curves["surprised"][pressed] == pytest.approx(0)


def test_moods_move_on_while_the_mouth_is_held(generation):
    found = deliver_to_face(generation, Delivery(mood="happy, sad at 1.0", stepped=True), 25.0)
    assert "mood_sad" not in found.stepped
    assert len(np.unique(found.motion["mood_sad"])) > 6


@pytest.fixture(scope="module")
def request_with_laughter() -> Request:
    audio = recording((0.5, vowels(pulses(1.0, 120))), (2.0, laugh(6)))
    return Request(audio, units=said(audio.duration_s, (0.5, 1.5)))


def test_a_face_laughs_where_laughter_is_detected(toy_model, request_with_laughter):
    laughing = animate(request_with_laughter, model=toy_model)
    (event,) = laughing.events
    assert event.kind == LAUGHTER
    opening = laughing.motion["opening"]
    loudest_s = max(event.calls, key=lambda call: call[1])[0]
    assert opening[round(loudest_s * 100)] == pytest.approx(LAUGH_GAP, rel=0.1)
    happy = deliver(laughing, Delivery()).motion["mood_happy"]
    assert happy[round(loudest_s * 100)] > 0.7
    assert not happy[:150].any()
    assert "mood_happy" not in deliver(laughing, Delivery(mood="neutral")).motion.names


def test_what_is_detected_changes_nothing_where_it_is_not_asked_for(toy_model, request_with_laughter):
    plain = animate(replace(request_with_laughter, manner="asked"), model=toy_model)
    laughing = animate(request_with_laughter, model=toy_model)
    assert not plain.events
    assert plain.motion["opening"][200:].max() < 0.05
    assert np.array_equal(plain.motion.values[50:150], laughing.motion.values[50:150])
