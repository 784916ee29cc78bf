"""Live motion: pieces do not matter, frames are neither lost nor doubled, closures, rest, interruption."""

import asyncio
import copy
import gc
import itertools
import socket
import struct
import tracemalloc
from collections.abc import AsyncIterator

import numpy as np
import pytest

from lipmotion import LiveFrame, Request, Stream, animate
from lipmotion.errors import InputError
from lipmotion.live.consumers import live_link_packet, open_consumer, osc_packet, vmc_packet
from lipmotion.live.face import WEIGHT_NAMES
from lipmotion.live.network import CausalSteps, SoundFeatures, live_network, silent_step
from lipmotion.meshes.model.shape_names import ARKIT_52
from lipmotion.types import Audio
from lipmotion_agents.conversation import Conversation
from pipeline.made import read_welcome

STEP_S = 0.02


@pytest.fixture(scope="module")
def sound() -> np.ndarray:
    return read_welcome().samples


def all_of(stream: Stream, samples: np.ndarray, sizes: list[int]) -> list[LiveFrame]:
    frames, coming = list[LiveFrame](), itertools.cycle(sizes)
    while len(samples):
        pieces = np.split(samples, [next(coming)])
        frames, samples = frames + stream.push(pieces[0]), pieces[1]
    return frames + stream.flush()


def opening_of(frames: list[LiveFrame]) -> np.ndarray:
    return np.array([frame["opening"] for frame in frames])


def values_of(frames: list[LiveFrame]) -> np.ndarray:
    return np.array([[frame.time_s, frame.known_s, *frame.motion, *frame.weights.values()] for frame in frames])


RATES = [pytest.param(*each, marks=pytest.mark.long) for each in ((16_000, 160), (24_000, 0), (8_000, 80))]


@pytest.mark.parametrize(("rate_hz", "look_ahead_ms"), [(44_100, 320), *RATES])
def test_pieces_do_not_matter(sound: np.ndarray, rate_hz: int, look_ahead_ms: float) -> None:
    positions = np.arange(0, len(sound) - 1, 16_000 / rate_hz)
    there = np.interp(positions, np.arange(len(sound)), sound).astype(np.float32)[: 3 * rate_hz]
    whole, *others = (
        values_of(all_of(Stream(rate_hz, look_ahead_ms), there, sizes))
        for sizes in ([len(there)], [rate_hz // 1000], [1, 977, 20_011, 3], [rate_hz // 25])
    )
    assert len(whole) == 150
    assert whole[:, 0] == pytest.approx(np.arange(150) * STEP_S)
    assert (whole[:, 1] - whole[:, 0]).max() < max(look_ahead_ms / 1000, 0.0026) + 1e-9
    for other in others:
        assert other.tobytes() == whole.tobytes()


def test_integers_and_channels_are_the_same_sound(sound: np.ndarray) -> None:
    rounded = np.round(sound[:16_000] * 32767).astype(np.int16)
    alone = values_of(all_of(Stream(), rounded, [16_000]))
    stereo = values_of(all_of(Stream(), np.stack([rounded, rounded], axis=1), [16_000]))
    stream = Stream()
    every_other = memoryview(np.repeat(rounded.view(np.uint8), 2).tobytes())[::2]
    as_bytes = values_of(stream.push(every_other) + stream.flush())
    assert np.array_equal(alone, stereo)
    assert np.array_equal(alone, as_bytes)


@pytest.mark.long
def test_without_a_limit_it_is_what_animate_makes(sound: np.ndarray) -> None:
    stream = Stream(look_ahead_ms=None)
    assert stream.push(sound[:48_000]) == []
    frames = stream.flush()
    expected = animate(Request(Audio(sound[:48_000], 16_000))).motion.resampled(50.0)
    assert opening_of(frames) == pytest.approx(expected["opening"][: len(frames)], abs=1e-9)
    assert ({frame.known_s for frame in frames}, stream.time_s) == ({3.0}, 3.0)


@pytest.mark.parametrize("look_ahead_ms", [80, *(pytest.param(each, marks=pytest.mark.long) for each in (0, 320))])
def test_it_follows_the_whole_recording(sound: np.ndarray, look_ahead_ms: float) -> None:
    whole = animate(Request(Audio(sound, 16_000))).motion
    frames = all_of(Stream(look_ahead_ms=look_ahead_ms), sound, [640])
    time_s = np.array([frame.time_s for frame in frames])
    opening = opening_of(frames)
    assert np.corrcoef(opening, np.interp(time_s, whole.time_s, whole["opening"]))[0, 1] > 0.6


def test_it_rests_in_silence_and_within_100_ms_after_it(sound: np.ndarray) -> None:
    line = np.concatenate([np.zeros(16_000), sound[:40_000], np.zeros(16_000)]).astype(np.float32)
    frames = all_of(Stream(), line, [640])
    opening = opening_of(frames)
    assert opening[:45].max() < 0.01
    assert opening[-35:].max() < 0.01
    assert opening.max() > 0.08
    still = values_of(all_of(Stream(seed=None), np.zeros(32_000, np.float32), [640]))[:, 2:]
    assert np.ptp(still, axis=0).max() < 1e-9


@pytest.mark.parametrize("turns", [40, pytest.param(400, marks=pytest.mark.long)])
def test_an_interruption_rests_and_time_goes_on(sound: np.ndarray, turns: int) -> None:
    rng, stream, frames = np.random.default_rng(5), Stream(look_ahead_ms=80), []
    for _ in range(turns):
        start = int(rng.integers(len(sound) - 16_000))
        frames += stream.push(sound[start : start + int(rng.integers(1, 12_000))])
        if rng.random() < 0.4:
            rested = stream.interrupt()
            assert len(rested) == 5
            assert rested[-1]["opening"] < 0.005
            frames += rested
    frames += stream.flush()
    assert [frame.number for frame in frames] == list(range(len(frames)))
    opening = opening_of(frames)
    assert np.isfinite(values_of(frames)).all()
    assert np.abs(np.diff(opening)).max() < 0.12


def test_the_mouth_goes_on_from_where_it_was(sound: np.ndarray) -> None:
    """A line that ends in the middle of a word, and the next one."""
    stream = Stream()
    frames = stream.push(sound[:30_400]) + stream.flush() + stream.push(sound[20_000:60_000]) + stream.flush()
    opening = opening_of(frames)
    assert [frame.number for frame in frames] == list(range(len(frames)))
    assert np.abs(np.diff(opening)).max() < 0.0801
    assert max(frame.known_s for frame in frames[:95]) <= 1.9 + 1e-9


def test_an_interruption_takes_back_what_is_not_heard_yet(sound: np.ndarray) -> None:
    stream = Stream()
    pushed = stream.push(sound[:48_000])
    frames = stream.interrupt(1.0)
    assert frames[0].time_s == pytest.approx(1.02)
    assert frames[0]["opening"] < pushed[50]["opening"] + 1e-9
    assert stream.push(sound[:16_000])[0].time_s == pytest.approx(frames[-1].time_s + STEP_S)
    stream.push(np.tile(sound, 3))  # what it looked like that long ago is forgotten
    assert (frames := stream.interrupt(1.0))[0].time_s == pytest.approx(1.02)
    assert frames[0]["opening"] < 0.005
    assert max(frame["eyeBlinkLeft"] for frame in stream.push(np.zeros(160_000, np.float32))) > 0.5


def test_a_damaged_sample_makes_nothing_quiet(sound: np.ndarray) -> None:
    damaged = np.where(np.arange(48_000) == 8_000, 1e5, sound[:48_000])
    one, other = (opening_of(all_of(Stream(seed=None), each, [1_600])) for each in (sound[:48_000], damaged))
    assert np.corrcoef(one, other)[0, 1] > 0.85
    assert 0.8 < other[60:].std() / one[60:].std() < 1.2


def test_a_copy_goes_on_by_itself(sound: np.ndarray) -> None:
    stream = Stream()
    stream.push(sound[:20_000])
    other = copy.deepcopy(stream)
    first = values_of(stream.push(sound[20_000:40_000]))
    stream.push(sound)
    assert np.array_equal(values_of(other.push(sound[20_000:40_000])), first)


def test_sound_that_comes_while_others_work(sound: np.ndarray) -> None:
    async def pieces() -> AsyncIterator[np.ndarray]:
        for first in range(0, 32_000, 640):
            await asyncio.sleep(0)
            yield sound[first : first + 640]

    async def collect() -> list[LiveFrame]:
        return [frame async for frame in Stream().frames(pieces())]

    assert np.array_equal(values_of(asyncio.run(collect())), values_of(all_of(Stream(), sound[:32_000], [640])))


@pytest.mark.long
def test_hours_need_no_more_memory_than_minutes(sound: np.ndarray) -> None:
    stream, sizes = Stream(), []
    line = np.concatenate([sound, np.zeros(80_000, np.float32)])
    tracemalloc.start()
    for number in range(8):
        stream.add_words([("welcome", stream.begins_s + 0.3, stream.begins_s + 0.8)])
        all_of(stream, line, [640])
        if number > 1:
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert max(sizes[3:]) - max(sizes[:3]) < 7_500  # of 32 s of sound, 1,600 frames


def test_what_cannot_be_heard_is_refused_and_the_stream_goes_on(sound: np.ndarray) -> None:
    stream = Stream()
    for wrong, message in (
        *((np.array([0.1, value]), "not finite, or beyond 1e") for value in (np.nan, np.inf, 1e300, 2e6)),
        (np.zeros((3, 0)), r"shape \(3, 0\)"),
        ([[1.0, 2.0], [3.0]], "no samples"),
        *((np.zeros(shape), rf"shape \({str(shape)[1:-1]}\)") for shape in ((2, 2, 2), (1, 800), (2, 16_000))),
        (np.zeros(3, np.int32), "int32"),
        *((b"123", "3 bytes"), (b"OggS", "OggS"), (np.ma.masked_less(np.zeros(3), 1), "none masked")),
    ):
        with pytest.raises(InputError, match=message):
            stream.push(wrong)
    heard, wanted = (values_of(all_of(each, sound[:8000], [80])) for each in (stream, Stream()))
    assert np.array_equal(heard, wanted)
    for arguments, message in (
        ((0,), "0 Hz"),
        (("16000",), "'16000' Hz"),
        ((16_000, 700), "700 ms"),
        ((16_000, -1), "-1 ms"),
    ):
        with pytest.raises(InputError, match=message):
            Stream(*arguments)


def test_natural_pauses_stay_as_people_s_do(sound: np.ndarray) -> None:
    line = np.concatenate([sound[:40_000], np.zeros(16_000)]).astype(np.float32)
    rested, natural = (opening_of(all_of(Stream(pauses=pauses), line, [640])) for pauses in ("rest", "natural"))
    assert rested[-20:].max() < 0.005
    assert 0.005 < natural[-20:].max() < 0.08
    with pytest.raises(InputError, match="'none'"):
        Stream(pauses="none")  # type: ignore[arg-type]


WORDS = [("map", 0.5, 0.9), ("[music]", 0.9, 1.0), ("boom", 1.7, 2.1)]
PHONES = [("m", 0.5, 0.61), ("ae", 0.61, 0.79), ("p", 0.79, 0.9), ("", 0.9, 1.7), ("b", 1.7, 1.81), ("uw", 1.81, 2.0)]


@pytest.mark.parametrize(("timings", "phones"), [(WORDS, False), (PHONES, True)])
def test_what_is_told_is_said(sound: np.ndarray, timings: list[tuple[str, float, float]], phones: bool) -> None:
    def tell(stream: Stream) -> None:
        (stream.add_phones if phones else stream.add_words)(timings)

    stream, other = Stream(look_ahead_ms=80), Stream(look_ahead_ms=80)
    tell(stream)
    tell(other)
    frames = all_of(stream, sound[:40_000], [640])
    assert np.array_equal(values_of(frames), values_of(all_of(other, sound[:40_000], [977])))
    for moment_s in (0.56, 0.84, 1.75):  # m, p, b
        frame = frames[round(moment_s / STEP_S)]
        assert frame["viseme_PP"] > 0.9
        assert frame["opening"] < 0.005
    assert frames[35]["viseme_aa"] + frames[35]["viseme_E"] > 0.9  # ae
    assert frames[65]["viseme_sil"] > 0.9
    assert frames[65]["opening"] < 0.01
    late = Stream(look_ahead_ms=80)
    before = late.push(sound[:16_000])
    tell(late)  # its first words are said already
    after = late.push(sound[16_000:40_000])
    assert [frame.number for frame in before + after] == list(range(len(before + after)))
    assert after[88 - len(before)]["viseme_PP"] > 0.9


def test_what_is_told_wrongly_is_refused_and_forgotten_at_an_interruption(sound: np.ndarray) -> None:
    stream = Stream()
    stream.add_words([("map", 0.5, 0.9)])
    for wrong in ([("a", 0.8, 1.0)], [("a", 1.5, 1.2)], [("a", 1000, 1400)], [("a", 1.0, np.nan)]):
        with pytest.raises(InputError, match="required seconds"):
            stream.add_words(wrong)
    for other in (("a", "b", 0.3), ("a", None, 0.3), ("a", 0.3), ("a", 1, 10**400), 5):
        with pytest.raises(InputError, match="a text with its start and end"):
            stream.add_words([("b", 1.0, 2.0), other])  # type: ignore[list-item]
    for time_s in (np.nan, np.inf):
        with pytest.raises(InputError, match="a time of the stream"):
            stream.interrupt(time_s)
    with pytest.raises(InputError, match="unknown phone"):
        stream.add_phones([("qq", 1.0, 1.2)])
    stream.add_words([("boom", 0.9, 1.3)])
    stream.push(sound[:8_000])
    ends_s = stream.interrupt()[-1].time_s
    frames = stream.push(np.zeros(16_000, np.float32))
    assert frames[0].time_s == pytest.approx(ends_s + STEP_S)
    assert max(frame["viseme_PP"] for frame in frames) < 0.2


@pytest.mark.long
def test_eyes_and_head_move_by_themselves() -> None:
    silence = np.zeros(16_000 * 30, np.float32)
    frames = Stream(seed=3).push(silence)
    same, mouth_alone = (Stream(seed=seed).push(silence[:48_000]) for seed in (3, None))
    assert np.array_equal(values_of(frames[: len(same)]), values_of(same))
    lids = np.array([frame["eyeBlinkLeft"] for frame in frames])
    blinks = int(((lids[1:] > 0.5) & (lids[:-1] <= 0.5)).sum())
    assert 4 <= blinks <= 20
    yaw = np.array([frame["headYaw"] for frame in frames])
    assert 0.003 < yaw.std() < 0.1
    assert np.abs(np.diff(yaw)).max() < 0.01
    assert any(frame["eyeLookOutLeft"] > 0.15 or frame["eyeLookInLeft"] > 0.15 for frame in frames)
    assert "eyeBlinkLeft" not in mouth_alone[0].weights
    stream = Stream()
    stream.look_at(0.5)
    turned = stream.push(silence[:48_000])[-1]
    assert 0.2 < turned["headYaw"] < 0.5
    assert turned["eyeLookOutLeft"] > 0.05
    with pytest.raises(InputError, match="required at most 1"):
        stream.look_at(2.0)


def test_steps_are_those_of_the_whole_network(sound: np.ndarray) -> None:
    live = live_network()
    typical = live.typical
    rows = np.stack(SoundFeatures(typical).push(sound[:32_000]))
    steps = rows[: len(rows) // 2 * 2].reshape(len(rows) // 2, -1)
    hears = CausalSteps(live.network, silent_step(typical))
    one_by_one = np.stack([hears.push(step) for step in steps])
    reach = live.network.reach
    heard = np.concatenate([np.tile(silent_step(typical), (2 * reach, 1)), steps])
    assert one_by_one == pytest.approx(live.network(heard)[reach : reach + len(steps)], abs=1e-4)


def frame(number: int = 3) -> LiveFrame:
    weights = {name: (index + 1) / 100 for index, name in enumerate(WEIGHT_NAMES)}
    return LiveFrame(number * 0.02, number * 0.02 + 0.1, np.array([0.125, 0.5]), ("opening", "width"), weights)


def read_osc(packet: bytes) -> list[tuple[str, list[str | float]]]:
    """Return the messages of a bundle, as python-osc reads them."""
    osc = pytest.importorskip("pythonosc.osc_bundle", reason="no python-osc")
    return [(message.address, message.params) for message in osc.OscBundle(packet)]


def test_vmc_receivers_get_vowels_and_perfect_sync() -> None:
    *values, last = read_osc(vmc_packet(frame()))
    assert last == ("/VMC/Ext/Blend/Apply", [])
    assert {address for address, _ in values} == {"/VMC/Ext/Blend/Val"}
    named = {name: value for _, (name, value) in values}
    assert named["A"] == pytest.approx(frame()["viseme_aa"])
    assert named["jawOpen"] == pytest.approx(frame()["jawOpen"])


def test_osc_has_an_address_for_every_value() -> None:
    by_address = dict(read_osc(osc_packet(frame())))
    assert (len(by_address), by_address["/lipmotion/opening"]) == (2 + len(WEIGHT_NAMES), [0.125])


def test_live_link_packets_are_read_as_by_the_app() -> None:
    packet = live_link_packet(frame())
    assert struct.unpack("<i", packet[:4]) == (6,)
    assert packet[4:5] == b"$"
    (size,) = struct.unpack(">i", packet[41:45])
    assert packet[45 : 45 + size] == b"lipmotion"
    number, sub, rate, over, count = struct.unpack(">if2iB", packet[45 + size : 62 + size])
    assert (number, sub, rate, over, count) == (3, 0, 50, 1, 61)
    values = dict(zip(ARKIT_52, struct.unpack(">61f", packet[62 + size :]), strict=False))
    assert values["jawOpen"] == pytest.approx(frame()["jawOpen"])
    assert values["eyeBlinkLeft"] == 0
    face = pytest.importorskip("pylivelinkface", reason="no PyLiveLinkFace: pip install pylivelinkface")
    _, read = face.PyLiveLinkFace.decode(packet)
    assert (read.name, read.fps) == ("lipmotion", 50)
    assert read.get_blendshape(face.FaceBlendShape.JawOpen) == pytest.approx(frame()["jawOpen"])


def test_frames_reach_a_receiver() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(20)
        with open_consumer(f"vmc:127.0.0.1:{receiver.getsockname()[1]}", print) as take:
            take(frame())
        assert receiver.recv(65_536) == vmc_packet(frame())


@pytest.mark.parametrize("to", ["nothing", "vmc:here:x", "osc:127.0.0.1:700000"])
def test_what_takes_no_frames_is_refused(to: str) -> None:
    with pytest.raises(InputError, match=f"--to {to}"), open_consumer(to, print):
        pass


def test_words_with_odd_times_do_no_harm() -> None:
    sound = np.zeros(16_000, "<i2").tobytes()
    odd: list[tuple[str, float, float | None]] = [
        ("mama", np.nan, 0.2), ("mama", -1.0, 0.3), ("mama", 0.2, 0.1), ("two words", 0.4, 0.5), ("mama", 0.4, np.inf),
        ("papa", 0.5, 0.9), ("\u5988\u5988", 0.9, 0.95), ("", 0.95, None), ("mama", np.inf, None),
    ]  # fmt: skip

    async def speak() -> list[float]:
        conversation = Conversation()
        conversation.add_words(odd)
        frames = await conversation.push(sound, 16_000, 1, at_rest=True)
        conversation.add_words([("mama", 0.1, 0.2)])
        return [frame["viseme_PP"] for frame in frames + conversation.finish()]

    closed = asyncio.run(speak())
    assert min(max(closed[:15]), max(closed[25:45])) > 0.8
