"""lipmotion: ``animate``, or a ``Stream`` (``ahead_ms``), of a ``model`` (or the shipped one); ``told``: of phones."""

from pathlib import Path

from jobs import run

CHANNELS = ("opening", "width")


def begin(settings):
    """Return a function of a recording."""
    from lipmotion import Stream, animate, load_model
    from lipmotion.pipeline.request import Request
    from lipmotion.speech.sound.audio_files import read_audio
    from lipmotion.types import Span, Timeline, Unit

    model = load_model(settings.get("model"))

    def answer(recording):
        units = None
        if settings.get("told"):
            spans = (Span(start, end, Unit(phone or "sil")) for phone, start, end in recording["phones"])
            units = Timeline(tuple(spans))
        if "ahead_ms" not in settings:
            motion = animate(Request(Path(recording["sound"]), units=units, pauses="natural"), model=model).motion
            return motion.time_s, {name: motion[name] for name in CHANNELS}
        audio = read_audio(Path(recording["sound"]))
        stream = Stream(audio.rate_hz, settings["ahead_ms"], model, pauses="natural", seed=None)
        frames = stream.push(audio.samples) + stream.flush()
        return [frame.time_s for frame in frames], {name: [frame[name] for frame in frames] for name in CHANNELS}

    return answer


run(begin)
