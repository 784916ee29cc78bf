"""The fuzzed readers by name."""

from __future__ import annotations

from fuzz.inputs import Reader
from fuzz.readers import (
    audio,
    character,
    corpus,
    curves,
    drawing,
    face,
    labels,
    lexicon,
    lines,
    model,
    requests,
    settings,
    transcript,
    units,
    video,
)

_MODULES = (
    *(audio, video, transcript, lexicon, units, labels, model, face),
    *(drawing, corpus, curves, character, lines, settings, requests),
)
READERS: dict[str, Reader] = {
    module.__name__.rpartition(".")[2]: Reader(module.__name__.rpartition(".")[2], module.seeds, module.read)
    for module in _MODULES
}
