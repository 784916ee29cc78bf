"""The engine of coupled chains: how far it leans on the table of articulation."""

from dataclasses import replace

import numpy as np

from lipmotion.engines import engine_named
from lipmotion.testing.examples import examples, speech, timeline
from lipmotion.types.progress import silent_monitor

SENTENCE = ("t", "aa", "p", "iy", "m", "uw", "s", "aa")


def test_it_leans_on_recognised_phones_as_far_as_the_voice_is_unknown_or_words_confirm_them():
    engine = engine_named("coupled", {"states": 1, "asynchrony": 0, "mixtures": 1, "closures": False})
    model = engine.fit(examples(4), silent_monitor).model
    recognised = replace(speech(timeline(SENTENCE)), units_known=False)

    def motion(of, confidence, voice):
        return engine.generate(of, replace(recognised, confidence=confidence, voice=voice)).motion.values

    without = motion(replace(model, prior=None), 1.0, 1.0)
    np.testing.assert_allclose(motion(model, 0.0, 1.0), without)
    full = motion(model, 1.0, 1.0)
    assert np.abs(full - without).max() > 1e-3
    np.testing.assert_allclose(motion(model, 0.0, 0.0), full)
    half = np.abs(motion(model, 0.0, 0.5) - without).max()
    assert 1e-4 < half < np.abs(full - without).max()
