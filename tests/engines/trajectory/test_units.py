from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lipmotion import engines, errors, types
from lipmotion.motion import closure, frame_labels
from lipmotion.testing.examples import examples, speech, timeline
from lipmotion.units import LIP_CLOSING, PHONES, UNIT_SETS, load_unit_set

PLAIN = {"articulation": False, "acoustic_regression": False, "silent_states": 7}
SPOKEN = speech(timeline(("t", "aa", "p", "iy", "zh", "m", "uw", "sp", "s", "aa")))
named = pytest.mark.parametrize("name", UNIT_SETS)


@cache
def trained(units: str, acoustic_regression: bool = False):
    engine = engines.engine_named("trajectory", PLAIN | {"units": units, "acoustic_regression": acoustic_regression})
    return engine, engine.fit(examples(), types.silent_monitor).model


def generated(units: str) -> types.Generation:
    engine, model = trained(units)
    return engine.generate(model, SPOKEN)


def renamed_phones(folder: Path) -> str:
    """Write a table in which every phone is a unit of another name; the names sort in another order."""
    path = folder / "renamed.txt"
    path.write_text("".join(f"u{99 - number}{phone} {phone}\n" for number, phone in enumerate(PHONES)))
    return str(path)


@pytest.mark.parametrize("acoustic_regression", [False, True])
def test_phones_by_another_name_move_the_same_to_the_bit(tmp_path, acoustic_regression):
    own, renamed = (trained(units, acoustic_regression) for units in ("phone", renamed_phones(tmp_path)))
    one, two = (engine.generate(model, SPOKEN) for engine, model in (own, renamed))
    assert one.motion.values.tobytes() == two.motion.values.tobytes()
    assert one.variance.tobytes() == two.variance.tobytes()
    for key, array in (arrays := own[0].to_arrays(own[1])).items():
        if key != "questions":
            assert array.tobytes() == renamed[0].to_arrays(renamed[1])[key].tobytes()
    assert "units" not in arrays  # and what is saved is what it was before there were unit sets


@named
def test_trees_ask_about_units_of_the_set(name):
    _, model = trained(name)
    classes = set(load_unit_set(name).classes().values())
    for tree in model.emission.forest.values():
        assert {question.members for question in tree.questions} == classes


@named
def test_the_timeline_names_units_in_context(name):
    units = load_unit_set(name)
    phones = ["sil", *(span.label.phone for span in SPOKEN.units), "sil"]
    of = [units.unit_of_phone[phone] for phone in phones]
    wanted = [f"{left}-{unit}+{right}" for left, unit, right in zip(of, of[1:], of[2:], strict=False)]
    result = generated(name)
    assert [span.label.unit for span in result.units] == wanted
    assert [span.label.phone for span in result.units] == phones[1:-1]
    assert {state.split()[0] for state in result.trace.states} <= {*wanted, "rest"}


def test_phones_of_one_unit_move_alike():
    for name in [name for name in UNIT_SETS if name != "phone"]:
        engine, model = trained(name)
        units = load_unit_set(name)
        for one, two in (("t", "d"), ("iy", "ih"), ("aa", "ah"), ("f", "v")):
            assert units.unit_of_phone[one] == units.unit_of_phone[two]
            pair = [engine.generate(model, speech(timeline(("s", phone, "s")))).motion.values for phone in (one, two)]
            assert pair[0].tobytes() == pair[1].tobytes()


@named
def test_lips_meet_on_p_b_m_whatever_their_unit(name):
    result, (_, model) = generated(name), trained(name)
    spans = closure.find_closable_ranges(SPOKEN.units, len(result.motion.values))
    assert len(spans) == sum(span.label.phone in LIP_CLOSING for span in SPOKEN.units) == 2
    for span in spans:
        assert result.motion["opening"][span].min() <= model.closure.closed + 1e-9


def test_silence_that_is_a_closed_mouth_is_cut_as_speech():
    """Lips that meet between others do not rest, though their parts may have the number of silence's middle one."""
    layout = frame_labels.StateLayout(3, 7, 0.1, load_unit_set("2vis"))
    states = frame_labels.label_full_context(timeline(("p", "aa")), 141, layout)
    assert {state.unit for state in states} == {"open", "closed"}
    assert {layout.name(state) for state in states if state != layout.rest} == {"speech.0", "speech.1", "speech.2"}
    assert states[0] == states[-1] == layout.rest
    assert layout.rest not in states[60:80]
    layout = frame_labels.StateLayout(5, 5, 0.1, load_unit_set("2vis"))
    assert layout.rest not in frame_labels.label_full_context(timeline(("p", "b", "m")), 150, layout)[60:90]


def table_model(folder: Path) -> tuple[engines.Engine, dict]:
    """Train with a table file that is then removed."""
    path = Path(renamed_phones(folder))
    engine = engines.engine_named("trajectory", PLAIN | {"units": str(path)})
    model = engine.fit(examples(4), types.silent_monitor).model
    path.unlink()
    return engine, engine.to_arrays(model)


def test_a_model_needs_its_table_no_more(tmp_path):
    engine, arrays = table_model(tmp_path)
    model = engine.from_arrays(arrays)
    assert model.units.unit_of_phone == {phone: f"u{99 - number}{phone}" for number, phone in enumerate(PHONES)}
    assert np.isfinite(engine.generate(model, SPOKEN).motion.values).all()
    with pytest.raises(errors.InputError, match="no unit set"):
        engine.fit(examples(1), types.silent_monitor)
    with pytest.raises(errors.InputError, match="units"):
        engines.engine_named("trajectory", {"units": ["eVis"]})
    with pytest.raises(errors.InputError, match="there are: 2vis"):
        engines.engine_named("trajectory", {"units": "evis"}).fit(examples(1), types.silent_monitor)


def changed(pairs: np.ndarray, row: int, column: int, text: str) -> np.ndarray:
    result = pairs.astype("U20")
    result[row, column] = text
    return result


DAMAGES = {
    "an unknown phone": lambda pairs: changed(pairs, 3, 0, "xx"),
    "a phone twice": lambda pairs: changed(pairs, 3, 0, PHONES[4]),
    "a phone too many": lambda pairs: np.concatenate([pairs, pairs[:1]]),
    "a phone missing": lambda pairs: pairs[1:],
    "a unit without a name": lambda pairs: changed(pairs, 3, 1, ""),
    "silence in a unit of speech": lambda pairs: changed(pairs, PHONES.index("sil"), 1, str(pairs[0, 1])),
    "three columns": lambda pairs: np.concatenate([pairs, pairs[:, :1]], axis=1),
    "one column": lambda pairs: pairs[:, 0],
    "no table": lambda pairs: pairs[:0],
    "numbers": lambda pairs: np.zeros(pairs.shape),
}


def test_a_damaged_table_is_refused(tmp_path):
    engine, arrays = table_model(tmp_path)
    for damage in DAMAGES.values():
        with pytest.raises(errors.ModelFormatError):
            engine.from_arrays(arrays | {"units": damage(arrays["units"])})
