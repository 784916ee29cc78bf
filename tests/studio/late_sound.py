"""Videos whose streams begin later than at 0."""

from pathlib import Path

import av


def shifted(video: Path, path: Path, *, sound_s: float = 0.0, all_s: float = 0.0) -> Path:
    """Write a video with its sound so much later, or all of it [s]; return where."""
    with av.open(str(video)) as source, av.open(str(path), "w") as target:
        streams = {stream.index: target.add_stream_from_template(stream) for stream in source.streams}
        for packet in source.demux():
            if packet.dts is None:
                continue
            late = round((all_s + (sound_s if packet.stream.type == "audio" else 0.0)) / packet.time_base)
            packet.pts, packet.dts, packet.stream = packet.pts + late, packet.dts + late, streams[packet.stream.index]
            target.mux(packet)
    return path
