import sys

import numpy as np
import pytest

from lipmotion import errors, types
from lipmotion.speech.features.mfcc import general_features
from lipmotion.speech.recognition import general as acoustic
from lipmotion.speech.recognition.general import PHONES, STATES, STREAMS, find_density, load_bigram, load_general
from lipmotion.units import PHONES as OURS
from testing.formant_synthesiser import synthesise


def vowels() -> types.Audio:
    return synthesise([("sil", 0.3), ("iy", 0.4), ("s", 0.3), ("aa", 0.4), ("sil", 0.3)])[0]


def test_blocks_change_nothing() -> None:
    features = general_features(vowels())
    wanted = load_general().log_density(features)
    assert len(features) > acoustic.BLOCK
    for first in (1, 100):
        np.testing.assert_allclose(
            load_general().log_density(features[first:]), wanted[first:], rtol=0, atol=2e-3, equal_nan=False
        )


def test_vowels_are_told_apart_at_any_level() -> None:
    audio = vowels()
    louder = types.Audio(audio.samples * np.float32(3), audio.rate_hz)
    np.testing.assert_allclose(general_features(louder), general_features(audio), rtol=0, atol=1e-3, equal_nan=False)
    assert general_features(audio).shape == (171, 39)
    assert np.abs(general_features(audio)[:, :13].mean(axis=0)).max() < 1e-3
    with pytest.raises(errors.InputError, match="16000 Hz"):
        general_features(types.Audio(np.zeros(8000, np.float32), 8000))
    density = load_general().log_density(general_features(audio))

    def best(start_s: float, end_s: float, phones: tuple[str, ...]) -> str:
        frames = density[round(start_s * 100) : round(end_s * 100)]
        return max(phones, key=lambda phone: frames[:, find_density(phone, 1, 3)].sum())

    phones = ("iy", "aa", "uw", "s", "sil")
    assert [best(start_s, start_s + 0.2, phones) for start_s in (0.4, 0.75, 1.1)] == ["iy", "s", "aa"]
    assert best(0.05, 0.25, ("iy", "aa", "s", "sil")) == "sil"


def test_every_phone_has_a_column() -> None:
    columns = [find_density(phone, state, 3) for phone in OURS for state in range(3)]
    assert min(columns) >= 2 * STATES  # the noises are nobody's
    assert {PHONES[c // STATES] for c in columns} == set(PHONES[2:])
    assert [find_density("b", state, 5) % 3 for state in range(5)] == [0, 0, 1, 2, 2]
    assert find_density("sp", 0, 1) == find_density("sil", 1, 3)


def test_the_bigram_is_that_of_the_phone_model() -> None:
    units = (*OURS, "+nsn+")
    bigram = load_bigram(units)
    assert bigram.sum(axis=1) == pytest.approx(1)
    s, t, ng = units.index("s"), units.index("t"), units.index("ng")
    assert bigram[s, t] > 0.1 > bigram[t, s] * 0.5
    assert bigram[units.index("sil"), ng] < 0.002
    assert bigram[s, units.index("ax")] > bigram[s, units.index("ah")]


def test_another_pocketsphinx_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    data = tmp_path / "pocketsphinx" / "model" / "en-us" / "en-us"
    data.mkdir(parents=True)
    (tmp_path / "pocketsphinx" / "__init__.py").touch()
    load_general.cache_clear()
    monkeypatch.delitem(sys.modules, "pocketsphinx")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(errors.MissingDependencyError, match="not those of its version 5"):
        load_general()
    for name in ("means", "variances", "sendump"):
        (data / name).write_bytes(b"s3\nendhdr\n" + bytes(64))
    with pytest.raises(errors.MissingDependencyError, match="unexpected header"):
        load_general()


def test_the_densities_of_its_streams_are_mixtures() -> None:
    model, x = load_general(), np.random.default_rng(0).normal(0, 2, (5, 39)).astype(np.float32)
    total = sum(model.mixtures(n).log_likelihood(x[:, stream]) for n, stream in enumerate(STREAMS))
    expected = total - total.max(axis=1, keepdims=True)
    near = expected > -60  # beyond, products of tiny shares are floored
    np.testing.assert_allclose(model.log_density(x)[near], expected[near], atol=0.02)
