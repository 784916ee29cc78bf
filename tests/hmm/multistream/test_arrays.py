import numpy as np
import pytest

from hmm.multistream.synthetic import observed, random_joint
from lipmotion.errors import ModelFormatError
from lipmotion.hmm.multistream.align import align
from lipmotion.hmm.multistream.generate import select_densities, solve_trajectory
from lipmotion.hmm.multistream.model import joint_from_arrays, joint_to_arrays
from lipmotion.hmm.multistream.recognise import JointRecogniser

HMM = random_joint(1, ("a", "b", "c"))


def test_a_model_comes_back_as_it_was():
    arrays = joint_to_arrays(HMM, np.float32)
    again = joint_from_arrays(arrays, HMM.config)
    data = observed(np.random.default_rng(2), 30)
    assert JointRecogniser(again).recognise(data) == JointRecogniser(HMM).recognise(data)
    found, wanted = (solve_trajectory(select_densities(m, align(m, data, ("sil", "a", "sil")))) for m in (again, HMM))
    assert np.array_equal(found.values, wanted.values)
    for key, array in joint_to_arrays(again, np.float32).items():
        assert array.dtype == arrays[key].dtype
        assert np.array_equal(array, arrays[key]), key
    assert again.text() == HMM.text()


def changed(**changes):
    arrays = joint_to_arrays(HMM)
    for key, change in changes.items():
        name = key.replace("__", "/")
        if change is None:
            del arrays[name]
        else:
            arrays[name] = change(arrays[name].copy())
    return arrays


def put(value, where=(0,)):
    def change(array):
        array[where] = value
        return array

    return change


DAMAGED = [
    *({name.replace("/", "__"): None} for name in sorted(joint_to_arrays(HMM))[::3]),
    {"log_stay": lambda a: a[:-1]},
    {"log_stay": put(0.0)},
    {"log_stay": put(np.nan)},
    {"durations": put(0.0)},
    {"durations": lambda a: a[:, 0]},
    {"bigram": lambda a: a[:-1]},
    {"units": put("b")},
    {"free": put("q")},
    {"spoken": lambda a: a * 0},
    {"spoken": lambda a: a[1:]},
    {"streams": put("q")},
    {"streams": put("motion")},
    {"speech__means": lambda a: a[:-1]},
    {"speech__means": put(np.inf)},
    {"speech__variances": put(0.0)},
    {"speech__variances": lambda a: a[:, :1]},
    {"speech__log_weights": put(-np.inf)},
    {"speech__log_weights": put(np.nan)},
    {"speech__log_weights": put(5.0)},
    {"speech__mean": put(np.nan)},
    {"speech__deviation": put(0.0)},
    {"speech__asked": put(10_000)},
    {"speech__trees": put("7")},
    {"f0__voiced": put(1.0)},
    {"f0__voiced": lambda a: a[:-1]},
    {"motion__sizes": put(0)},
]


def test_damaged_arrays_are_refused():
    for changes in DAMAGED:
        with pytest.raises(ModelFormatError, match="damaged"):
            joint_from_arrays(changed(**changes), HMM.config)
    with pytest.raises(ModelFormatError):
        joint_from_arrays(joint_to_arrays(HMM), random_joint(1, states=2).config)
