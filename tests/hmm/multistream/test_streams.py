import numpy as np
import pytest

from lipmotion.errors import InputError
from lipmotion.hmm.multistream.streams import ObservedStream, StreamObservations, StreamWeights, stream_observations

NAN = float("nan")


def test_f0_has_a_slope_only_where_all_frames_of_the_window_are_voiced():
    pitch = np.array([NAN, 4.0, 4.2, 4.6, NAN, NAN, 4.0, 4.1])
    streams = stream_observations(np.zeros((8, 3)), pitch).streams
    assert streams["f0"].known.tolist() == [False, True, True, True, False, False, True, True]
    for name in ("f0_slope", "f0_curvature"):
        assert np.flatnonzero(streams[name].known).tolist() == [2]
    assert streams["f0_slope"].values[2, 0] == pytest.approx(0.3)
    assert streams["f0_curvature"].values[2, 0] == pytest.approx(0.2)


def test_motion_is_unknown_beside_frames_that_were_not_measured():
    motion = np.arange(14.0).reshape(7, 2) ** 2
    seen = np.ones(7, bool)
    seen[3], motion[3] = False, NAN
    stream = stream_observations(np.zeros((7, 3)), motion=motion, measured=seen).streams["motion"]
    assert np.flatnonzero(stream.known).tolist() == [1, 5]
    assert stream.values[1].reshape(3, 2)[2] == pytest.approx(motion[0] - 2 * motion[1] + motion[2])
    assert (stream.values[~stream.known] == 0).all()


def test_what_does_not_fit_is_refused():
    for given in (
        {"log_f0": np.zeros(4)},
        {"log_f0": np.full(5, np.inf)},
        {"motion": np.full((5, 2), NAN)},
        {"motion": np.zeros((5, 2)), "measured": np.ones(4, bool)},
    ):
        with pytest.raises(InputError):
            stream_observations(np.zeros((5, 3)), **given)
    with pytest.raises(InputError, match="required speech"):
        StreamObservations({"motion": ObservedStream(np.zeros((3, 3)), np.ones(3, bool))})
    for weight in (-0.1, NAN, float("inf")):
        with pytest.raises(InputError, match="f0_slope"):
            StreamWeights(f0_slope=weight)


def test_a_weight_of_nothing_switches_off():
    assert list(StreamWeights(motion=0, f0=0).active) == ["speech", "f0_slope", "f0_curvature"]
