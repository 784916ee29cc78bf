import numpy as np
import pytest

from lipmotion.types import SpeechKnowledge

CURVE = np.array([0.0, 0.1, 0.2, 0.1])
CERTAIN, UNCERTAIN = np.zeros(4), np.full(4, 2e-3)


def test_a_known_voice_is_as_sure_as_its_variance() -> None:
    known = SpeechKnowledge(voice=1.0, phones=0.0)
    np.testing.assert_allclose(known.confidence(CURVE, CERTAIN), 1)
    np.testing.assert_allclose(known.confidence(CURVE, UNCERTAIN), 1 / (1 + 8 * 2e-3 / CURVE.var()))


def test_movements_of_a_stranger_are_less_sure_than_his_mean() -> None:
    confidence = SpeechKnowledge(voice=0.0, phones=1.0).confidence(CURVE, CERTAIN)
    assert confidence[0] == pytest.approx(confidence[2])
    assert confidence[0] < confidence[1]


@pytest.mark.parametrize("better", [{"voice": 0.5, "phones": 0.5}, {"voice": 0.2, "phones": 0.9}])
def test_knowing_more_makes_sure(better: dict[str, float]) -> None:
    worse = SpeechKnowledge(voice=0.2, phones=0.5).confidence(CURVE, UNCERTAIN)
    assert (SpeechKnowledge(**better).confidence(CURVE, UNCERTAIN) > worse).all()


def test_motion_of_other_words_is_not_sure_whoever_speaks() -> None:
    for voice in (0.0, 1.0):
        other = SpeechKnowledge(voice, 1.0, fit=0.0).confidence(CURVE, CERTAIN)
        assert 1 / other - 1 / SpeechKnowledge(voice, 1.0).confidence(CURVE, CERTAIN) == pytest.approx(0.5)


def test_motion_that_stands_still_has_a_confidence() -> None:
    still = SpeechKnowledge(voice=0.0, phones=1.0).confidence(np.full(5, 0.1, np.float32), np.full(5, -1e-12))
    assert (still > 0.5).all()
