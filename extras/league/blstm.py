"""The recurrent baseline of the experiments, trained on the list ``train`` of a corpus; in an environment with PyTorch.

Settings: ``corpus``. The network is kept beside this file's job, in ``blstm.pickle``.
"""

import pickle
import sys
from pathlib import Path

from jobs import run


def begin(settings):
    """Return a function of a recording."""
    import torch  # noqa: F401 - absent: the rival is
    from lipmotion import Corpus, animate
    from lipmotion.pipeline.request import Request
    from lipmotion_lab.baselines import BlstmBaseline
    from lipmotion_lab.engine_comparison import train_engine
    from lipmotion_lab.runner import ExperimentSettings

    kept = Path(sys.argv[1]).parent.parent / "blstm.pickle"
    if not kept.is_file():
        model = train_engine(Corpus.open(settings["corpus"]), BlstmBaseline(), ExperimentSettings())
        kept.write_bytes(pickle.dumps(model))
    model = pickle.loads(kept.read_bytes())

    def answer(recording):
        motion = animate(Request(Path(recording["sound"]), pauses="natural"), model=model).motion
        return motion.time_s, {name: motion[name] for name in ("opening", "width")}

    return answer


run(begin)
