from fuzz.inputs import Reader
from fuzz.readers import (
    audio,
    character,
    corpus,
    curves,
    drawing,
    face,
    labels,
    lines,
    requests,
    settings,
    speech,
    video,
)

READERS: dict[str, Reader] = {
    reader.name: reader
    for reader in (
        Reader("audio", audio.seeds, audio.read),
        Reader("video", video.seeds, video.read),
        Reader("transcript", speech.seed_transcript, speech.read_transcript),
        Reader("lexicon", speech.seed_lexicon, speech.read_lexicon),
        Reader("units", speech.seed_units, speech.read_units),
        Reader("labels", labels.seeds, labels.read),
        Reader("model", speech.seed_model, speech.read_model),
        Reader("face", face.seeds, face.read),
        Reader("drawing", drawing.seeds, drawing.read),
        Reader("corpus", corpus.seeds, corpus.read),
        Reader("curves", curves.seeds, curves.read),
        Reader("character", character.seeds, character.read),
        Reader("lines", lines.seeds, lines.read),
        Reader("settings", settings.seeds, settings.read),
        Reader("requests", requests.seeds, requests.read),
    )
}
