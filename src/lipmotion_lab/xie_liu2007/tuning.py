"""Settings of the paper's systems that the print leaves open, chosen on validation recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from time import process_time
from typing import Any

from lipmotion.engines.coupled.chains.structures import FACTORIAL, HMM, SYSTEMS
from lipmotion.engines.coupled.config import CoupledConfig
from lipmotion.engines.coupled.engine import CoupledEngine
from lipmotion.engines.coupled.training.coupled_training import growing_models
from lipmotion.types import Example, Monitor, silent_monitor
from lipmotion_lab.comparison import correlation_statistic, distance_statistic
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY, HeldOutRecordings, compared_clips

Options = Mapping[str, Any]
FREE = {"unseen_loss": 0.0, "start_asynchrony": 4}
"""Factorial chains that nothing ties together: every density integrates to 1, and they may be apart from the start."""
CONVERSIONS: tuple[Options, ...] = ({"start": "viterbi", "steps": 3}, {"start": "soft", "steps": 1})
"""Conversions by EM that are tried: from the best path to where it converges, and one step from all paths."""


@dataclass(frozen=True)
class TuningOptions:
    """What is tried, one kind of setting after another, each from the best before.

    clips           : number of recordings to train on while settings are tried
    judges          : number of recordings of the list ``val`` by which they are judged
    weights         : exponents of the density of speech
    mixtures        : most Gaussians a state, of speech; 1, 2, 4, … are tried
    visual_mixtures : Gaussians a state of lips, then
    pair_mixtures   : most Gaussians of factorial chains, whose densities are those of pairs of states
    states          : a unit
    """

    clips: int = 50
    judges: int = 8
    weights: tuple[float, ...] = (1.0, 0.3, 0.1)
    mixtures: int = 8
    visual_mixtures: int = 2
    pair_mixtures: int = 1
    states: tuple[int, ...] = (3,)


TUNING = TuningOptions()


@dataclass(frozen=True)
class Trial:
    """One setting that was tried.

    options    : of the coupled engine
    acc, amse  : of the validation recordings, audio only
    parameters : numbers that its chains have learned
    """

    options: Options
    acc: float
    amse: float
    parameters: int


@dataclass(frozen=True)
class TrainedSystem:
    """A system after training.

    engine  : an ``Animator``
    model   : its trained model
    seconds : processor time of training
    tried   : the settings among which its own was chosen on validation recordings
    """

    engine: Any
    model: Any
    seconds: float
    tried: Sequence[Trial] = field(default_factory=tuple)


def alternatives(options: Options, tuning: TuningOptions) -> list[list[dict[str, Any]]]:
    """Return the kinds of settings that are tried for a system, in order, each with its values."""
    factorial = options["structure"] == FACTORIAL
    most = tuning.pair_mixtures if factorial else tuning.mixtures
    kinds = [[{"audio_weight": weight, "mixtures": most} for weight in tuning.weights]]
    if options["structure"] != HMM and most > 1:
        kinds.append([{"visual_mixtures": tuning.visual_mixtures}])
    if factorial:
        kinds.append([{"unseen_loss": 0.0}, FREE])
    return [*kinds, [{"states": states} for states in tuning.states]]


def tuned(
    options: Options, kinds: Sequence[Sequence[Options]], attempt: Callable[[Options], Sequence[Trial]]
) -> list[Trial]:
    """Return all trials of a search that takes one kind of setting after another; the best is ``best_trial`` of them.

    options : the start
    attempt : trains with some options, and returns the trials on the way
    """
    tried: list[Trial] = []
    for kind in kinds:
        start = best_trial(tried).options if tried else options
        for change in kind:
            tried += attempt({**start, **change})
    return tried


def best_trial(trials: Sequence[Trial]) -> Trial:
    """Return the trial of the highest ACC; of equals the first."""
    return max(trials, key=lambda trial: trial.acc)


def trained_on_the_way(
    options: Options, examples: Sequence[Example], monitor: Monitor = silent_monitor
) -> Iterator[TrainedSystem]:
    """Yield coupled chains with 1, 2, 4, … Gaussians a state, up to those of the options.

    Those of fewer Gaussians are stages of the training of more. Source: Xie & Liu 2007, §7.1.
    """
    config, count, begin_s = CoupledConfig(**options), 1, process_time()
    for make_model in growing_models(examples, config, monitor):
        own = replace(config, mixtures=min(count, config.mixtures), visual_mixtures=min(count, config.visual_mixtures))
        model = make_model().model
        yield TrainedSystem(CoupledEngine(own), model, process_time() - begin_s)
        count *= 2


def judged(
    systems: Iterable[TrainedSystem], validation: HeldOutRecordings, conversions: Sequence[Options] = ({},)
) -> Iterator[tuple[Trial, TrainedSystem]]:
    """Yield every system with its figures on validation recordings.

    conversions : options of the conversion, one after another, in place of the system's own
    """
    for system in systems:
        for conversion in conversions:
            engine = CoupledEngine(replace(system.engine.config, **conversion))
            made = compared_clips(validation, AUDIO_ONLY, engine, system.model)
            generated, original = [clip.generated for clip in made], [clip.original for clip in made]
            acc = correlation_statistic(generated, original).value
            amse = distance_statistic(generated, original).value
            trial = Trial(engine.config.as_mapping(), acc, amse, system.model.chains.parameters)
            yield trial, replace(system, engine=engine)


def chosen_by(of: Callable[[Trial], float], found: Iterable[tuple[Trial, TrainedSystem]]) -> TrainedSystem:
    """Return the system of which something is highest, as the ACC of its trial; with all trials.

    found : from ``judged``
    """
    pairs = list(found)
    _, best = max(pairs, key=lambda pair: of(pair[0]))
    return replace(best, tried=tuple(trial for trial, _ in pairs))


def as_row(trial: Trial) -> dict[str, Any]:
    """Return a trial as figures; its options are those that ``changed_options`` returns."""
    return asdict(trial) | {"options": changed_options(CoupledConfig.parsed(trial.options))}


def changed_options(config: CoupledConfig) -> dict[str, Any]:
    """Return the options that are not those of the paper's system of the same structure and chains, as printed."""
    of = {"structure": config.structure, "chains": config.chains}
    printed = next(options for options in SYSTEMS.values() if options.items() >= of.items())
    as_printed = CoupledConfig.parsed(printed).as_mapping()
    options = config.as_mapping()
    return of | {
        name: value
        for name, value in options.items()
        if as_printed.get(name, value) != value or (name not in as_printed)
    }
