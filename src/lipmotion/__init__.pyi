from typing import Any

from lipmotion.articulation.cue_sheets import CueSheet as CueSheet
from lipmotion.corpora import Corpus as Corpus
from lipmotion.corpora import Selection as Selection
from lipmotion.engines import engine_named as engine_named
from lipmotion.formats.base import read_motion as read_motion
from lipmotion.live.face import LiveFrame as LiveFrame
from lipmotion.live.stream import Stream as Stream
from lipmotion.pipeline.edits import Edits as Edits
from lipmotion.pipeline.generate.animate import animate as animate
from lipmotion.pipeline.generate.explain import explain as explain
from lipmotion.pipeline.generate.explain import state_runs as state_runs
from lipmotion.pipeline.generate.speak import speak as speak
from lipmotion.pipeline.job import Job as Job
from lipmotion.pipeline.model import Model as Model
from lipmotion.pipeline.model import load_model as load_model
from lipmotion.pipeline.model import save_model as save_model
from lipmotion.pipeline.model import with_person as with_person
from lipmotion.pipeline.outputs.cues import cues as cues
from lipmotion.pipeline.outputs.cues import write_cues as write_cues
from lipmotion.pipeline.outputs.output import write as write
from lipmotion.pipeline.request import Outputs as Outputs
from lipmotion.pipeline.request import Request as Request
from lipmotion.pipeline.session import Session as Session
from lipmotion.pipeline.training.train import Run as Run
from lipmotion.pipeline.training.train import adapt as adapt
from lipmotion.pipeline.training.train import train as train
from lipmotion.types import Audio as Audio
from lipmotion.types import Constraints as Constraints
from lipmotion.types import Delivery as Delivery
from lipmotion.types import Explanation as Explanation
from lipmotion.types import Gain as Gain
from lipmotion.types import Generation as Generation
from lipmotion.types import Motion as Motion
from lipmotion.types import Pin as Pin
from lipmotion.types import Span as Span
from lipmotion.types import SpokenText as SpokenText
from lipmotion.types import Staging as Staging
from lipmotion.types import Timeline as Timeline
from lipmotion.types import Unit as Unit
from lipmotion.units import Lexicon as Lexicon

__all__: list[str]

def __getattr__(name: str) -> Any: ...
