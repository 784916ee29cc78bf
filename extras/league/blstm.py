"""The recurrent baseline of the experiments, trained on the list ``train`` of a corpus.

Settings: ``corpus``. It trains for many minutes, every time.
"""

from pathlib import Path

from jobs import run


def begin(settings):
    """Return a function of a recording."""
    from lipmotion import Corpus, animate
    from lipmotion.pipeline.request import Request
    from lipmotion_lab.baselines import BlstmBaseline
    from lipmotion_lab.engine_comparison import train_engine
    from lipmotion_lab.runner import ExperimentSettings

    model = train_engine(Corpus.open(settings["corpus"]), BlstmBaseline(), ExperimentSettings())

    def answer(recording):
        motion = animate(Request(Path(recording["sound"]), pauses="natural"), model=model).motion
        return motion.time_s, {name: motion[name] for name in ("opening", "width")}

    return answer


run(begin)
