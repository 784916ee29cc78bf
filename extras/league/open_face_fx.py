"""OpenFaceFX (package ``openfacefx``): curves of loudness, or of phones that it is told.

Settings for sound: ``gate``, ``window``. For phones: ``smooth``, ``intensity``, ``stream`` (look-ahead of its
``StreamingGenerator``; 0: ``build_viseme_curves``).
"""

from jobs import ABSENT, run

try:
    from openfacefx.alignment import PhonemeSegment
    from openfacefx.coarticulation import CoartParams, build_viseme_curves
    from openfacefx.energy import energy_envelope
    from openfacefx.streaming import StreamingGenerator
    from openfacefx.visemes import VISEMES
except ImportError:
    raise SystemExit(ABSENT) from None

FPS = 60.0


def begin(settings):
    """Return a function of a recording."""

    def hear(recording):
        times, loudness = energy_envelope(recording["sound"], fps=FPS, **settings)
        return times, {"open": loudness, "rounded": loudness * loudness}  # its shapes are functions of these

    def read(recording):
        known = dict(settings)
        look_ahead, params = known.pop("stream"), CoartParams(**known)
        segments = [PhonemeSegment(phone.upper() or "sil", start, end) for phone, start, end in recording["phones"]]
        if not look_ahead:
            times, matrix = build_viseme_curves(segments, fps=FPS, params=params)
            return times, dict(zip(VISEMES, matrix.T, strict=True))
        stream = StreamingGenerator(FPS, params=params, look_ahead=look_ahead)
        frames = [frame for segment in segments for frame in stream.push([segment])] + stream.flush()
        columns = zip(*(values.tolist() for _, values in frames), strict=True)
        return [time_s for time_s, _ in frames], dict(zip(stream.target_names, columns, strict=True))

    return read if "stream" in settings else hear


run(begin)
