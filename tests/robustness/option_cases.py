import os
from pathlib import Path

from robustness.case import case

case("options", "corpus prompts --text of 30 million bytes", 3, "30000000 bytes, required at most 4194304")(
    lambda bench: ["corpus", "prompts", "--text", bench.file("text.txt", b"a " * 15_000_000)]
)
case("outputs", "one name twice", 7, "is given twice; give every output another")(
    lambda bench: bench.animate(None, "-o", Path("./a.json"), output=Path.cwd() / "a.json")
)
case("outputs", "a name that is no UTF-8", 0)(lambda bench: bench.animate(output=os.fsdecode(b"a\xff.json")))
