from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lipmotion import engines, errors, types
from lipmotion.engines.trajectory.trajectory_training import MIN_VARIANCE, SHARE_DIVISOR, fit_trajectory
from lipmotion.motion import closure, fit_acoustic_context, frame_labels
from lipmotion.motion.context_window import OFFSETS, SCALE
from lipmotion.motion.frame_labels import FullContextState, label_full_context
from lipmotion.stats.trees import Question, Tree, create_statistics, fit_tree_regressions, ridge
from lipmotion.testing import CHANNELS, examples, speech, timeline
from lipmotion.types import WEIGHT, Channel, Constraints, Pin, silent_monitor
from lipmotion.units import LIP_CLOSING, PHONES, UNIT_SETS, load_unit_set

SHUT = 0.02  # of silence in the examples
ENGINE = engines.engine_named("trajectory", {"silent_states": 7, "articulation": False})  # at rest from 0.24 s on


@cache
def model() -> object:
    return ENGINE.fit(examples(), silent_monitor).model


def test_a_configuration_that_makes_no_sense_is_an_input_error():
    for options in (
        {"states": 4}, {"edge_s": 0.0}, {"components": 0}, {"shrinkage": -1.0}, {"silent_states": 2},
        {"ridge_frames": float("nan")}, {"modulation_filter": -0.5},
    ):  # fmt: skip
        with pytest.raises(errors.InputError):
            engines.engine_named("trajectory", options)


def test_the_mouth_rests_in_silence_and_does_not_learn_to_lick_the_lips_there():
    """Away from speech the opening is that of silence, and still."""
    spoken = speech(timeline(("aa", "iy", "aa")))
    opening = ENGINE.generate(model(), spoken).motion["opening"]
    for rest in (opening[:25], opening[-25:]):
        assert rest == pytest.approx(np.full(25, SHUT), abs=2e-3)
        assert np.ptp(rest) < 2e-3
    restless = examples()
    for example in restless[:5]:
        example.motion.values[10:20, 0] += 0.2
    opening = ENGINE.generate(ENGINE.fit(restless, silent_monitor).model, spoken).motion["opening"]
    assert opening[:25].max() < SHUT + 0.01


def test_variance_is_smaller_near_a_pin_and_what_is_far_stays():
    talk = speech(timeline(("aa", "iy", "t", "uw", "s", "aa")))
    free = ENGINE.generate(model(), talk)
    pinned = ENGINE.generate(model(), talk, Constraints((Pin(0.9, "width", 0.7),)))
    width = [channel.name for channel in CHANNELS].index("width")
    assert (pinned.variance[88:93, width] < free.variance[88:93, width]).all()
    assert pinned.motion["width"][:60] == pytest.approx(free.motion["width"][:60], abs=1e-4)
    assert pinned.motion["opening"] == pytest.approx(free.motion["opening"], abs=1e-12)


def weighted():
    """The same motion as weights of blendshapes that are mostly 0, and one that is always 0.3."""
    channels = tuple(Channel(name, WEIGHT) for name in ("jaw", "funnel", "still"))
    for number, one in enumerate(examples()):
        opening = one.motion["opening"]
        shapes = [np.maximum(opening - 0.1, 0), np.maximum(0.5 - one.motion["width"], 0), 0 * opening + 0.3]
        yield replace(
            one, name=f"{number}", motion=replace(one.motion, values=np.stack(shapes, axis=1), channels=channels)
        )


def test_blendshapes_without_an_opening():
    """No closing is pinned; weights are followed, never negative, and what never moves stays where it is."""
    model = ENGINE.fit(list(weighted()), silent_monitor).model
    assert model.closure is None
    quiet = ENGINE.generate(model, speech(timeline(()))).motion  # at rest, the median pose
    np.testing.assert_allclose(quiet["jaw"], 0, atol=1e-3)
    np.testing.assert_allclose(quiet["funnel"], 0, atol=1e-3)
    kept = ENGINE.from_arrays(ENGINE.to_arrays(model))
    spoken = speech(timeline(("t", "aa", "p", "uw", "s", "aa", "m", "iy")))
    result = ENGINE.generate(kept, spoken)
    assert result.motion.values.min() >= 0
    assert result.motion["jaw"].max() > 0.1
    assert result.motion["funnel"].max() > 0.04
    np.testing.assert_allclose(result.motion["still"], 0.3, atol=1e-3)
    pressed = ENGINE.generate(kept, spoken, Constraints((Pin(0.9, "jaw", 0.25),)))
    assert pressed.motion["jaw"][90] == 0.25
    with pytest.raises(errors.InputError, match=r"sets jaw to -0\.1, required at least 0"):
        ENGINE.generate(kept, spoken, Constraints((Pin(0.9, "jaw", -0.1),)))


def test_models_from_before_the_modulation_filter_have_none():
    former = {name: value for name, value in ENGINE.config.as_mapping().items() if name != "modulation_filter"}
    engine = engines.engine_named("trajectory", former, stored=True)
    assert engine.config.modulation_filter == 0
    assert engine.config.as_mapping() == former  # so that earlier versions can read it
    arrays = ENGINE.to_arrays(model())
    arrays.pop("modulation")
    talk = speech(timeline(("aa", "iy", "t", "uw", "s", "aa")))
    one = engine.generate(engine.from_arrays(arrays), talk).motion.values
    two = ENGINE.generate(replace(model(), modulation=None), talk).motion.values
    assert one == pytest.approx(two, abs=2e-3)  # half precision
    with pytest.raises(errors.ModelFormatError):
        ENGINE.from_arrays(arrays)


def test_the_modulation_filter_is_for_voices_that_training_knows():
    talk = speech(timeline(("aa", "iy", "t", "uw", "s", "aa")))
    for voice, is_off in ((1.0, False), (0.0, True)):
        one, two = (
            ENGINE.generate(each, replace(talk, voice=voice)) for each in (model(), replace(model(), modulation=None))
        )
        assert (np.abs(one.motion["opening"] - two.motion["opening"]).max() < 1e-9) == is_off


SMALL = {"states": 3, "silent_states": 7, "components": 2}
OPTIONS = engines.engine_named("trajectory", SMALL | {"acoustic_regression": False}).config
LAYOUT = OPTIONS.layout(load_unit_set(OPTIONS.units))


def fit(corpus, **changes):
    return fit_trajectory(corpus, replace(OPTIONS, **changes), silent_monitor)


def frames_by_density(corpus, emission):
    """Static, Δ and Δ² of the opening in all frames that have them, by the density of their state."""
    found: dict[int, list[list[float]]] = {}
    for example in corpus:
        x = example.motion["opening"]
        for t, state in list(enumerate(label_full_context(example.speech.units, len(x), LAYOUT)))[1:-1]:
            row = [x[t], (x[t + 1] - x[t - 1]) / 2, x[t + 1] - 2 * x[t] + x[t - 1]]
            found.setdefault(emission.row(state), []).append(row)
    return {density: np.array(rows) for density, rows in found.items()}


def test_without_shrinkage_each_leaf_has_the_mean_and_variance_of_its_frames():
    corpus = examples(6)
    emission = fit(corpus, shrinkage=1e-9, variance_shrinkage=1e-9).emission
    rest = len(emission.means) - 1
    found = frames_by_density(corpus, emission)
    assert len(found) > 20
    for density, rows in found.items():
        if density == rest:
            continue
        assert emission.means[density, :, 0] == pytest.approx(rows.mean(axis=0), abs=1e-5)
        assert emission.variances[density, :, 0] == pytest.approx(rows.var(axis=0), rel=0.02, abs=1e-5)


def test_trees_tell_apart_what_moves_apart():
    emission = fit(examples(12)).emission
    middle = {
        phone: emission.means[emission.row(FullContextState("t", phone, "s", 1)), 0, 0]
        for phone in ("aa", "iy", "uw", "p")
    }
    assert middle["aa"] > middle["iy"] + 0.1
    assert middle["iy"] > middle["p"] + 0.05
    assert {tree.questions[tree.splits[0]].position for tree in emission.forest.values() if tree.splits[0] >= 0} >= {1}


def test_a_channel_that_never_moves_keeps_a_variance():
    corpus = examples(4)
    for example in corpus:
        example.motion.values[:, 1] = 0.0
    emission = fit(corpus, acoustic_regression=True, acoustic_components=20).emission
    assert (emission.variances >= MIN_VARIANCE / 1e4).all()
    rows = np.array([emission.row(state) for state in label_full_context(corpus[0].speech.units, 99, LAYOUT)])
    for statistic in emission.statistics(rows, corpus[0].speech.features.values, slice(0, 99)):
        assert np.isfinite(statistic).all()


REGRESSION = engines.engine_named(
    "trajectory", SMALL | {"acoustic_components": 20, "ridge": 10.0, "ridge_frames": 50.0}
).config


def moments_of(z, r):
    moments = create_statistics(z.shape[1], r.shape[1])
    moments.add(z.astype(np.float32), r.astype(np.float32))
    return moments


def sample(frames, truth, seed):
    draw = np.random.default_rng(seed)
    z = draw.normal(size=(frames, len(truth)))
    return z, z @ truth + draw.normal(0, 0.1, (frames, truth.shape[1]))


def small_tree():
    """A root that splits twice: nodes 0 (1 2), 2 (3 4)."""
    questions = (Question(0, "a", frozenset("a")), Question(0, "b", frozenset("b")))
    return Tree(
        questions, np.array([0, -1, 1, -1, -1], np.int32), np.array([2, -1, 4, -1, -1], np.int32),
        np.array([100.0, 40, 60, 50, 10]),
    )  # fmt: skip


def test_each_node_is_drawn_towards_the_one_above():
    tree, truth = small_tree(), np.random.default_rng(5).normal(size=(3, 2))
    parts = {node: moments_of(*sample(frames, truth + node, node)) for node, frames in ((0, 40), (2, 10), (3, 50))}
    z, r = sample(30, truth, 1)
    stacked = np.concatenate([z, np.sqrt(5.0) * np.eye(3)]), np.concatenate([r, np.sqrt(5.0) * np.ones((3, 2))])
    least_squares = np.linalg.lstsq(*stacked, rcond=None)[0]
    assert ridge(moments_of(z, r), np.ones((3, 2)), 5.0) == pytest.approx(least_squares, abs=1e-5)
    found = fit_tree_regressions(tree, parts, np.zeros((3, 2)), 7.0)
    root = ridge(parts[0] + parts[2] + parts[3], np.zeros((3, 2)), 7.0)
    below = ridge(parts[2] + parts[3], root, 7.0)
    assert found[0] == pytest.approx(root)
    assert found[2] == pytest.approx(below)
    assert found[3] == pytest.approx(ridge(parts[3], below, 7.0))
    stiff = fit_tree_regressions(tree, parts, np.ones((3, 2)), 1e12)
    assert stiff[3] == pytest.approx(np.ones((3, 2)), abs=1e-6)


def test_the_context_uses_features_around_a_frame_and_no_further():
    draw = np.random.default_rng(0)
    recordings = [draw.normal(size=(80, 3)).astype(np.float32) for _ in range(4)]
    window = fit_acoustic_context(recordings, 10)
    x = recordings[0]
    z = window(x, slice(None))
    assert z.shape == (80, 10)
    assert np.array_equal(window(x, np.array([40, 41])), z[40:42])
    changed = x.copy()
    changed[40] += 1
    moved = np.nonzero(np.abs(window(changed, slice(None)) - z).max(axis=1) > 1e-4)[0]
    assert set(moved) == {40 - offset for offset in OFFSETS}
    everything = np.concatenate([window(one, slice(None)) for one in recordings])
    assert everything.mean(axis=0) == pytest.approx(np.zeros(10), abs=0.05)
    assert np.cov(everything.T) == pytest.approx(np.diag(np.diag(np.cov(everything.T))), abs=0.15)
    lengths = np.square(fit_acoustic_context(recordings, 33)(x, slice(None))).sum(axis=1)
    assert SCALE * 0.5 < np.sqrt(lengths.mean()) < SCALE * 1.5


def loud_and_soft(count):
    """The same sentences said with more or less voice: the first feature says how far the mouth opens."""
    for number, one in enumerate(examples(count)):
        gain = np.random.default_rng(number).uniform(0.5, 1.5)
        values = one.speech.features.values.copy()
        values[:, 0] = 3 * (gain - 1)
        motion = one.motion.values.copy()
        motion[:, 0] *= gain
        speech = replace(one.speech, features=replace(one.speech.features, values=values))
        yield replace(one, speech=speech, motion=replace(one.motion, values=motion))


def error(model, corpus):
    squares = []
    for one in corpus:
        states = label_full_context(one.speech.units, len(one.valid), model.emission.layout)
        rows = np.array([model.emission.row(state) for state in states])
        means, _ = model.emission.statistics(rows, one.speech.features.values, slice(None))
        squares.append((means[:, 0, 0] - one.motion["opening"])[60:-60] ** 2)
    return float(np.sqrt(np.concatenate(squares).mean()))


def test_means_follow_the_sound():
    corpus = list(loud_and_soft(16))
    plain, regressed = (
        fit_trajectory(corpus[:12], replace(REGRESSION, acoustic_regression=on), silent_monitor) for on in (False, True)
    )
    assert error(regressed, corpus[12:]) < 0.75 * error(plain, corpus[12:])
    assert regressed.emission.variances[:-1, 0, 0].mean() < plain.emission.variances[:-1, 0, 0].mean()


def test_a_leaf_has_the_regression_of_the_last_node_with_enough_frames_and_the_rest_pose_none():
    assert [small_tree().path_to(leaf) for leaf in (1, 3, 4)] == [[0, 1], [0, 2, 3], [0, 2, 4]]
    model = fit_trajectory(list(loud_and_soft(12)), REGRESSION, silent_monitor)
    forest, rows = model.emission.forest, model.emission.regression.rows.tolist()
    enough = max(REGRESSION.ridge_frames, sum(tree.frames[0] for tree in forest.values()) / SHARE_DIVISOR)
    owners = [
        (name, [node for node in tree.path_to(leaf) if tree.frames[node] >= enough][-1:])
        for name, tree in forest.items()
        for leaf in tree.leaves
    ]
    assert [rows.index(row) for row in rows[:-1]] == [owners.index(owner) for owner in owners]
    assert rows[-1] == -1
    rows = np.full(5, len(model.emission.means) - 1)
    means, _ = model.emission.statistics(rows, np.random.default_rng(0).normal(size=(5, 39)), slice(None))
    assert means == pytest.approx(np.repeat(model.emission.means[-1:], 5, axis=0))


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


def test_a_model_needs_its_table_no_more_and_a_damaged_one_is_refused(tmp_path):
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
    for damage in DAMAGES.values():
        with pytest.raises(errors.ModelFormatError):
            engine.from_arrays(arrays | {"units": damage(arrays["units"])})


def changed(pairs: np.ndarray, row: int, column: int, text: str) -> np.ndarray:
    result = pairs.astype("U20")
    result[row, column] = text
    return result


DAMAGES = {
    "an unknown phone": lambda pairs: changed(pairs, 3, 0, "xx"),
    "a phone twice": lambda pairs: changed(pairs, 3, 0, PHONES[4]),
    "a phone missing": lambda pairs: pairs[1:],
    "silence in a unit of speech": lambda pairs: changed(pairs, PHONES.index("sil"), 1, str(pairs[0, 1])),
    "three columns": lambda pairs: np.concatenate([pairs, pairs[:, :1]], axis=1),
}
