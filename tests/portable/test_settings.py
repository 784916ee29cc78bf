import numpy as np

from portable import settings


def test_kernels_without_their_features_are_never_started(monkeypatch):
    started = []
    features = {"SSE3": True, "AVX": True, "AVX2": True, "FMA3": True, "AVX512_SKX": False}
    monkeypatch.setattr(np._core._multiarray_umath, "__cpu_features__", features)  # type: ignore[attr-defined]
    monkeypatch.setattr(settings, "kernels", lambda core: started.append(core) or core)
    assert settings.possible_cores() == ["Haswell", "Zen", "Sandybridge", "Prescott"]
    assert settings.different_cores() == ["Haswell", "Zen", "Sandybridge", "Prescott"]
    assert "SkylakeX" not in started


def test_kernels_that_a_build_has_once_are_run_once(monkeypatch):
    monkeypatch.setattr(settings, "possible_cores", lambda: ["Haswell", "Zen", "Prescott"])
    monkeypatch.setattr(settings, "kernels", lambda core: "Prescott" if core == "Prescott" else "Haswell")
    assert settings.different_cores() == ["Haswell", "Prescott"]
