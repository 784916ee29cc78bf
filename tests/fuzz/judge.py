"""Classification of the result of one input."""

import logging
import re
import shutil
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path

from fuzz.inputs import Files, Good, ImplausibleError, Reader, lay_out, picked_up
from lipmotion.cli.terminal.progress import describe_outcome

READ, REFUSED = "read", "refused"
ERROR, IMPLAUSIBLE, LEFT, MEMORY, HANG, CRASH = "error", "implausible", "left behind", "memory", "hang", "crash"
LONGEST_LINE = 2000  # most characters of an error message
OBEYED = re.compile("[\x00-\x1f\x7f-\x9f]")  # terminal control characters


@dataclass(frozen=True)
class Result:
    """The result of reading an input.

    kind   : read, refused, or a kind of defect
    where  : identifies a defect
    detail : description for people
    """

    kind: str
    where: str = ""
    detail: str = ""


def read_result(reader: Reader, files: Files, folder: Path, good: Good) -> Result:
    """Return the result of reading an input in a folder of its own, which is removed afterwards."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    try:
        lay_out(files, folder)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", ".*(NumPy|numpy).*")
            result = _read(reader, folder, good)
        if result.kind in (READ, REFUSED) and picked_up(folder) != files:
            return Result(LEFT, reader.name, f"there are now: {', '.join(picked_up(folder))}")
        return result
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _read(reader: Reader, folder: Path, good: Good) -> Result:
    try:
        reader.read(folder, good)
    except ImplausibleError as error:
        return Result(IMPLAUSIBLE, str(error), _trace(error))
    except MemoryError as error:
        return Result(MEMORY, place_of(error), _trace(error))
    except Exception as error:
        return _error_result(error)
    return Result(READ)


def _error_result(error: Exception) -> Result:
    """Return the result for an error: refused, if the command line reports it in one good line."""
    known = describe_outcome(error)
    if known is None:
        return Result(ERROR, f"{type(error).__name__} {place_of(error)}", _trace(error))
    code, line = known
    if len(line) > LONGEST_LINE:
        return Result(ERROR, f"a long message {place_of(error)}", f"{len(line)} characters: {line[:400]!r}")
    if OBEYED.search(line):
        return Result(ERROR, f"a raw message {place_of(error)}", repr(line))
    shape = re.sub(r"\d+|'[^']*'|\"[^\"]*\"|/\S+|\(.*\)", "", line)[:80]  # without what quotes the input
    return Result(REFUSED, f"{code} {shape}", line)


def place_of(error: BaseException) -> str:
    """Return the innermost function of the package in the trace of an error."""
    steps = [step for step in traceback.extract_tb(error.__traceback__) if "lipmotion" in Path(step.filename).parts]
    return f"{Path(steps[-1].filename).name}:{steps[-1].name}" if steps else "outside"


def _trace(error: BaseException) -> str:
    return "".join(traceback.format_exception(error))[-4000:]


def quiet() -> None:
    """Format warnings of the package, but do not print them."""
    logger = logging.getLogger("lipmotion")
    logger.addHandler(_FormatOnly())
    logger.propagate = False


class _FormatOnly(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        record.getMessage()
