"""Trained models: as a value, and as a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion.engines import ENGINES, Engine, engine_named
from lipmotion.errors import InputError, ModelFormatError
from lipmotion.hmm.model import HmmConfig, UnitHmm, hmm_from_arrays, hmm_to_arrays
from lipmotion.motion.articulation import ARTICULATORS, measure_articulators
from lipmotion.motion.eigenlips import Eigenlips, eigenlips_from_arrays, eigenlips_to_arrays
from lipmotion.motion.network_steps import STEP
from lipmotion.motion.speaker_maps import SpeakerMap, SpeakerMaps, speakers_from_arrays, speakers_to_arrays
from lipmotion.speech.features.mfcc import FEATURES
from lipmotion.speech.recognition.adaptation import Adaptation, adaptation_from_arrays, adaptation_to_arrays
from lipmotion.storage.archive import UNREADABLE, read_archive, read_header_of, write_archive
from lipmotion.storage.schema import refuse_undeclared, select_arrays
from lipmotion.types import PriorOutput, Speech

FORMAT = "lipmotion.model"
VERSION = 3
SHIPPED = "grid-s1.lipmotion"
GEOMETRY, EIGENLIPS, BOTH = "geometry", "eigenlips", "both"
VISUALS = (GEOMETRY, EIGENLIPS, BOTH)
"""Tracked or supplied channels; coefficients of mouth pictures (eigenlips); the former followed by the latter."""


@dataclass(frozen=True, eq=False)
class Model:
    """A trained model: phone models, and an engine with its model of motion.

    phones     : phone models for recognition and alignment
    engine     : the engine, with its configuration
    about      : corpus, split, seed, versions, licence, attribution, by name: the information for users
    adaptation : adaptation of the phone models to a speaker (None: not adapted)
    eigenlips  : principal components of mouth pictures (None: the channels do not contain their coefficients)
    prior      : the model on which this one stands: its motion is an input of this engine (None: it stands on none)
    speakers   : maps from the motion of the mean person, which the engine generates, to that of each person it was
                 trained on (None: it tells no people apart)

    >>> import lipmotion
    >>> model = lipmotion.load_model()
    >>> model.engine.name, model.visual, model.adaptation is None
    ('trajectory', 'geometry', True)
    """

    phones: UnitHmm
    engine: Engine[Any]
    learned: Any
    about: Mapping[str, Any]
    adaptation: Adaptation | None = None
    eigenlips: Eigenlips | None = None
    prior: Model | None = None
    speakers: SpeakerMaps | None = None

    def __repr__(self) -> str:
        size = f"{self.about.get('utterances', '?')} utterances, {self.about.get('minutes', '?')} minutes"
        return f"Model({self.engine.name}, {self.visual}, {size}, format version {VERSION})"

    @property
    def visual(self) -> str:
        """The kind of channels of the model: ``geometry``, ``eigenlips`` or ``both``."""
        return str(self.about.get("visual", GEOMETRY if self.eigenlips is None else EIGENLIPS))


def save_model(model: Model, path: str | Path) -> None:
    """Write a model to a file: a zip of plain arrays and a JSON header (docs/formats.md), never pickle.

    Raises ExportError: the file cannot be written.

    >>> import lipmotion, tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     lipmotion.save_model(lipmotion.load_model(), Path(folder) / "copy.lipmotion")
    ...     lipmotion.load_model(Path(folder) / "copy.lipmotion").engine.name
    'trajectory'
    """
    parts: dict[str, Mapping[str, NDArray[Any]]] = {
        "phones": hmm_to_arrays(model.phones),
        "engine": model.engine.to_arrays(model.learned),
        "prior": model.prior.engine.to_arrays(model.prior.learned) if model.prior is not None else {},
    }
    for name, (to_arrays, _) in _OPTIONAL.items():
        part = getattr(model, name)
        parts[name] = to_arrays(part) if part is not None else {}
    config = model.phones.config.as_mapping()
    header = {"format": FORMAT, "version": VERSION, **_describe_engine(model), "recogniser": config}
    if model.prior is not None:
        header["prior"] = _describe_engine(model.prior)
    arrays = {f"{part}/{key}": array for part, inner in parts.items() for key, array in inner.items()}
    write_archive(Path(path), header, arrays)


def _describe_engine(model: Model) -> dict[str, Any]:
    return {"engine": model.engine.name, "configuration": model.engine.config.as_mapping(), **model.about}


def load_model(path: str | Path | Model | None = None) -> Model:
    """Return the model in a file.

    path : of a file that ``save_model`` or ``lipmotion train`` wrote; None: the model that ships with the package; a
           model that is loaded already is returned as it is
    Raises InputError: no such file.
    Raises ModelFormatError: the file is not a model, is damaged, or has another version.

    >>> import lipmotion
    >>> lipmotion.load_model().about["licence"]
    ['CC BY 4.0']
    """
    if path is not None:
        return path if isinstance(path, Model) else _read(Path(path))
    if not find_shipped().is_file():
        raise ModelFormatError("the package holds no model; install it again, or give one with --model")
    return _read_shipped()


def read_header(path: Path) -> dict[str, Any]:
    """Return the header of a model file. Raises as ``load_model``."""
    if path.is_dir():
        raise InputError(f"{path}: is a folder, required a model file; a corpus comes after it: evaluate MODEL CORPUS")
    if not path.is_file():
        raise InputError(f"{path}: no such model; train one (lipmotion train), or use the one of: lipmotion info")
    return read_header_of(path, FORMAT, VERSION, "lipmotion model", "give a file that `lipmotion train` wrote")


def find_shipped() -> Path:
    """Return the path of the model that ships with the package."""
    return Path(str(resources.files("lipmotion") / "models" / SHIPPED))


@cache
def _read_shipped() -> Model:
    return _read(find_shipped())


def _read(path: Path) -> Model:
    header = read_header(path)
    if header.get("engine") not in ENGINES.names:
        name, known = header.get("engine"), ", ".join(ENGINES.names)
        raise ModelFormatError(f"{path}: no engine {name!r}; there are: {known}; install the package that adds it")
    try:
        stored = read_archive(path)
        arrays = {folder: select_arrays(stored, f"{folder}/") for folder in _FOLDERS}
        refuse_undeclared(stored, (f"{folder}/{key}" for folder, inner in arrays.items() for key in inner))
        engine = engine_named(header["engine"], _options(header, "configuration"), stored=True)
        config = HmmConfig.parsed(_options(header, "recogniser"))
        phones = hmm_from_arrays(arrays["phones"], config)
        if phones.mixtures.size[2] != FEATURES:
            raise ValueError(f"phone models of {phones.mixtures.size[2]} features, required {FEATURES}")
        learned = engine.from_arrays(arrays["engine"])
        if arrays["prior"] and "prior" not in header:
            raise ValueError("arrays of another model, which the header does not name")
        prior = None
        if "prior" in header:
            inner = _options(header, "prior")
            below = engine_named(inner["engine"], _options(inner, "configuration"), stored=True)
            about = {key: value for key, value in inner.items() if key not in _OWN_KEYS}
            prior = Model(phones, below, below.from_arrays(arrays["prior"]), about)
        more = {name: read(arrays[name]) if arrays[name] else None for name, (_, read) in _OPTIONAL.items()}
    except ModelFormatError as error:
        raise ModelFormatError(f"{path}: {error}") from error
    except UNREADABLE as error:
        raise ModelFormatError(f"{path}: the model is damaged ({error}); train or download it again") from error
    about = {key: value for key, value in header.items() if key not in _OWN_KEYS}
    if (about.get("visual", GEOMETRY) != GEOMETRY) != (more["eigenlips"] is not None):
        raise ModelFormatError(f"{path}: the model says visual {about.get('visual')!r}, which its eigenlips do not fit")
    return Model(phones, engine, learned, about, prior=prior, **more)


def _options(header: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    options: Any = header[key]
    if not isinstance(options, dict):
        raise TypeError(f"{key} is {options!r}, required options by name")
    return options


_OPTIONAL: dict[str, tuple[Any, Any]] = {
    "adaptation": (adaptation_to_arrays, adaptation_from_arrays),
    "eigenlips": (eigenlips_to_arrays, eigenlips_from_arrays),
    "speakers": (speakers_to_arrays, speakers_from_arrays),
}
"""Parts that a model may lack, each with what makes arrays of it, and it of arrays."""
_FOLDERS = ("phones", "engine", "prior", *_OPTIONAL)  # prefixes of the names of all arrays
_OWN_KEYS = ("format", "version", "engine", "configuration", "recogniser", "prior")
"""Keys of the header that are not part of ``Model.about``."""


def with_person(model: Model, name: str, person: SpeakerMap) -> Model:
    """Return a model that also knows another person, so that a map is fitted once: ``Request(speaker=name)``.

    name   : of the person; the model must not know another one of this name
    person : from ``map_onto``, without a speaker: the map from the motion of the model's mean or only person
    Raises InputError: an empty name, or one that the model knows; a map without all channels of the model's people.

    >>> import lipmotion
    >>> model = lipmotion.load_model()
    >>> known = lipmotion.with_person(model, "anna", lipmotion.map_onto(model, "anna.mp4"))  # doctest: +SKIP
    >>> lipmotion.save_model(known, "with-anna.lipmotion")  # doctest: +SKIP
    """
    known = model.speakers or {}
    if not name or name in known:
        raise InputError(f"a person named {name!r}, required another name than: {', '.join(('', *known))}")
    first = next(iter(known.values()), person)
    speakers = {**known, name: replace(person.reorder(first.channels), lips=first.lips)}
    return replace(model, speakers=speakers, about={**model.about, "speakers": list(speakers)})


def with_prior(prior: Model | None, speech: Speech) -> Speech:
    """Return speech with what another model makes of it; the same speech if there is no other model.

    The closures that the other engine would force are left to the engine that stands on it. The other model takes
    everybody for an unseen speaker, in training as in use: if it knew a voice in one of them only, it would differ.
    """
    if prior is None:
        return speech
    if speech.parts is not None:
        parts = tuple(part._replace(speech=with_prior(prior, part.speech)) for part in speech.parts)
        speech = replace(speech, parts=parts)
    speech_arrays = replace(speech.with_arrays(), voice=0.0)
    motion = prior.engine.without_closures().generate(prior.learned, speech_arrays).motion
    measured = measure_articulators(motion.values, motion.names)
    chosen = [measured[name][::STEP] for name in ARTICULATORS if name in measured]
    steps = len(motion.values[::STEP])
    nothing = np.zeros((steps, 0), np.float32), np.zeros(steps)
    hidden, distortion = prior.engine.hidden(prior.learned, speech_arrays) or nothing
    articulators = np.stack(chosen, axis=1) if chosen else np.zeros((steps, 0))
    return replace(speech, prior=PriorOutput(articulators, hidden, distortion))
