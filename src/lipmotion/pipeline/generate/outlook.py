"""What to expect of generated motion: how well a model knows a voice and its words, and what would help most."""

from __future__ import annotations

from lipmotion.pipeline.request import Request
from lipmotion.pipeline.understand.spoken_language import confidence_of
from lipmotion.pipeline.understand.transcribe import is_other_language
from lipmotion.pipeline.understand.understood_speech import UnderstoodSpeech
from lipmotion.speech.recognition.agreement import LEAST_FITTING_SHARE
from lipmotion.speech.recognition.recognised_speech import NOISY_DB
from lipmotion.speech.recognition.recogniser import FULL_WEIGHT_SCORE, own_model_weight
from lipmotion.speech.voices.pronunciations import MAPPED_CONFIDENCE
from lipmotion.types import Outlook
from lipmotion.types.generation import SURE_CONFIDENCE
from lipmotion.types.languages import ENGLISH
from lipmotion.units import Lexicon, words_in_time

TRANSCRIPT = "the words that are spoken (--transcript)"
OWN_MODEL = "recordings of this person (lipmotion adapt for the sound alone, lipmotion train with video)"
WHOLE_TRANSCRIPT = "a transcript of all that is said, and of nothing else"
LESS_NOISE = "a recording with less noise"


def outlook_of(request: Request, understood: UnderstoodSpeech) -> Outlook:
    """Return what to expect of the motion of some speech."""
    found, speech = understood.recognition, understood.speech
    if understood.is_without_speech:
        return Outlook("no speech", 0.0, None, understood.range_db, ())
    if found is None:
        is_used = speech.units_known if understood.fit is None else not understood.fit.is_doubtful
        words = "given units" if request.units is not None else "transcript" if is_used else "own model"
        share = understood.fit.share if understood.fit else 1.0
        if words == "transcript" and (known := _known_share(request, understood)) < 1:
            words, share = "mapped transcript", share * known
        return Outlook(words, share, 1.0 if words == "own model" else None, understood.range_db, _advice(understood))
    words = "words" if found.word_s > found.phone_s else "phones"
    voice = own_model_weight(found.similarity) if found.similarity is not None else None
    return Outlook(words, confidence_of(found), voice, understood.range_db, _advice(understood))


def _known_share(request: Request, understood: UnderstoodSpeech) -> float:
    """Return how sure the phones of a transcript are, 0 to 1: 1 for English, less for what is mapped to English."""
    if request.language != ENGLISH:
        return MAPPED_CONFIDENCE
    said, lexicon = [span.label for span in words_in_time(understood.speech.units)], request.lexicon or Lexicon()
    words = [word for word in said if word]
    return sum(map(lexicon.known, words)) / len(words) if is_other_language(words, lexicon) else 1.0


def _advice(understood: UnderstoodSpeech) -> tuple[str, ...]:
    """Return what would help, the most helpful first: before all else the words, where they are not sure."""
    found, advice = understood.recognition, []
    if understood.fit is not None and understood.fit.share < LEAST_FITTING_SHARE:
        advice.append(WHOLE_TRANSCRIPT)
    if found is not None and confidence_of(found) < SURE_CONFIDENCE:
        advice.append(TRANSCRIPT)
    if understood.range_db < NOISY_DB:
        advice.append(LESS_NOISE)
    if found is not None and (found.similarity is None or found.similarity < FULL_WEIGHT_SCORE):
        advice.append(OWN_MODEL)
    return tuple(advice)
