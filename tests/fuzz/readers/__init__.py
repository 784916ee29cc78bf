"""All readers by name: a module each, and those of speech."""

from importlib import import_module
from typing import Any

from fuzz.inputs import Reader
from fuzz.readers import speech

NAMES = "audio video labels face drawing corpus curves character lines settings requests live".split()
MODULES: dict[str, Any] = {name: import_module(f"fuzz.readers.{name}") for name in NAMES}
READERS = {name: Reader(name, module.seeds, module.read) for name, module in MODULES.items()} | speech.READERS
