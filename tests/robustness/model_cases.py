from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustness.case import Bench, case, declared, npy

GROUP = "models"
Remake = Callable[[NDArray[Any]], NDArray[Any]]
NO_MODEL = ("not a lipmotion model", "give a file that `lipmotion train` wrote")
DAMAGED = ("damaged", "train or download")


case(GROUP, "cut off", 6, *NO_MODEL)(
    lambda bench: bench.animate(None, "--model", bench.file("m.lipmotion", bench.model.read_bytes()[:-99]))
)


def _header(name: str, *messages: str, **header: object) -> None:
    case(GROUP, name, 6, *messages)(lambda bench: bench.animate(None, "--model", bench.changed_model({}, **header)))


_header("a newer version", "model version 9, this lipmotion reads version 3; upgrade lipmotion", version=9)
_header("another format", *NO_MODEL, format="other")
_header(
    "an unknown engine",
    "no engine 'quantum'; there are: trajectory",
    "install the package that adds it",
    engine="quantum",
)
_header("an unknown option", *DAMAGED, "no option 'colour'", configuration={"colour": 1})
_header("an option that is a text", *DAMAGED, configuration={"states": "5"})
_header("an option of a billion", *DAMAGED, "required at most", configuration={"states": 10**9 + 1})
_header("more parts than the model has", *DAMAGED, configuration={"states": 9})
_header("eigenlips that it has not", "the model says visual 'both', which its eigenlips do not fit", visual="both")


def _changed(name: str, member: str, content: bytes | None, *messages: str) -> None:
    case(GROUP, name, 6, *messages)(
        lambda bench: bench.animate(None, "--model", bench.changed_model({member: content}))
    )


_changed("a header of 100,000 brackets", "header.json", b"[" * 100_000, *NO_MODEL)
_changed("a header with a key twice", "header.json", b'{"format": "lipmotion.model", "format": "other"}', *NO_MODEL,
         "the key 'format' occurs twice")  # fmt: skip
_changed("without an array of the engine", "engine/variances.npy", None, *DAMAGED)
_changed("a trillion numbers declared", "phones/means.npy", declared("(1000000000000,)"), *DAMAGED, "in 0 bytes")
_changed("pickled objects", "phones/means.npy", npy(np.array([{}], object)), *DAMAGED)
_changed("a path to elsewhere", "../../elsewhere.npy", npy(np.zeros(3)), *DAMAGED)
_changed("an array that nothing declares", "engine/more.npy", npy(np.zeros(3)), *DAMAGED, "undeclared 'more'")
_changed("an adaptation of a wrong shape", "adaptation/own.npy", npy(np.zeros((39, 39))), "the adaptation is damaged",
         "adapt the model again")  # fmt: skip


def _changed_array(name: str, member: str, remake: Remake, *messages: str, of: str = "model") -> None:
    @case(GROUP, name, 6, *(messages or DAMAGED))
    def _(bench: Bench) -> list[object]:
        whole = getattr(bench, of)
        content = npy(remake(bench.array(member, whole)))
        return bench.animate(None, "--model", bench.changed_model({f"{member}.npy": content}, whole))


FAR = ("the motion would go from", "the model is damaged; train or download it again")
_changed_array("NaN among means", "phones/means", lambda a: a * np.nan, *DAMAGED, "means holds values that are not")
_changed_array("coefficients times 1000", "engine/coefficients", lambda a: a.astype(float) * 1000, *FAR)
_changed_array("coupled: one state less", "engine/chain_0/advance", lambda a: a[:1], of="coupled")
_changed_array("coupled: rest times 1000", "engine/rest", lambda a: a * 1000, *DAMAGED, "rest pose of", of="coupled")
LIPS = ("the eigenlips are damaged", "train the model again")
_changed_array("eigenlips: a colour less", "eigenlips/basis", lambda a: a[:2], *LIPS, "basis of shape", of="pictured")
