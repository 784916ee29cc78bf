import json
from pathlib import Path

import pytest

from engines.coupled.tiny import SYSTEMS
from lipmotion.engines import ENGINES, create_engine, engine_named, find_visual
from lipmotion.errors import InputError


def test_settings_and_presets_are_options() -> None:
    for name in sorted(ENGINES.names):
        assert create_engine(name) == engine_named(name, {})
    for system in SYSTEMS:
        assert create_engine(preset=f"xieliu2007 {system}") == create_engine(preset=system)
        assert find_visual(f"xieliu2007 {system}") == find_visual(system) == "eigenlips"
    assert create_engine(preset="xieliu2007") == create_engine(preset="ph-vi-CHMM")
    assert (find_visual("xieliu2007"), find_visual("hofer2008"), find_visual(None)) == ("eigenlips", None, None)


def test_the_systems_of_xie_and_liu_are_as_printed() -> None:
    """Five states a unit, EM from the best path, nothing after it (§4.1, §7.1, Table 2, Eqs. 17-19)."""
    for system in SYSTEMS:
        config = create_engine(preset=system).config
        assert (config.states, config.conversion, config.start, config.update) == (5, "em", "viterbi", "exact")
        assert not any((config.variance_scaling, config.closures, config.articulation, config.dynamic))
        assert config.chains.split()[-1] == ("viseme" if "-vi-" in system else "phone")
        assert config.asynchrony == (-1 if "FHMM" in system else 1)
        if "FHMM" in system:  # every density integrates to 1, and nothing ties the chains together
            assert (config.unseen_loss, config.start_asynchrony) == (0, 4)
        assert not config.moves_together
        assert (config.audio_weight, config.visual_weight, config.mixtures, config.visual_mixtures) == (1, 1, 1, 1)


def test_settings_are_of_the_option_s_kind_and_have_the_last_word() -> None:
    settings = ["states=4", "audio_weight=2", "acoustic_regression=no", "variance_scaling=TRUE", "chains=sVis 2vis"]
    config = create_engine("coupled", preset="ph-CHMM", settings=[*settings, "asynchrony=0"]).config
    assert (config.states, config.audio_weight) == (4, 2.0)
    assert (config.acoustic_regression, config.variance_scaling) == (False, True)
    assert (config.structure, config.chains, config.asynchrony) == ("coupled", "sVis 2vis", 0)
    assert create_engine("trajectory", units="eVis", settings=["units=2vis"]).config.units == "2vis"
    assert create_engine("joint", units="eVis", settings=["mixtures=2"]).config.mixtures == 2


REFUSED = json.loads(Path(__file__).with_name("refused_arguments.json").read_text(encoding="utf-8"))


def test_arguments_that_are_not_allowed() -> None:
    for name, arguments, words in REFUSED:
        with pytest.raises(InputError) as error:
            create_engine(name, **arguments)
        assert words in str(error.value)


FORMER = {
    "trajectory": {"parts": 7, "silent_parts": 9, "listens": False, "axes": 20, "full_range": False, "joint": False},
    "coupled": {"crosses": False, "more_mixtures": 2, "more_steps": 3, "more_weight": 0.5, "follows": False}
    | {"full_range": False},
    "joint": {"sees": False, "recognises": True},
}


def test_former_names_of_options_are_understood() -> None:
    for name, values in FORMER.items():
        config = engine_named(name, values).config
        assert [getattr(config, config.aliases[option]) for option in values] == list(values.values())
        assert set(values) == set(config.aliases)
        settings = [f"{option}={value}" for option, value in values.items()]
        assert create_engine(name, settings=settings).config == config
