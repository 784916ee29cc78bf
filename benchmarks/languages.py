"""Measures of other languages: vowels and closures of espeak-ng's speech, and the jaw of FACEGOOD's Mandarin captures.

    python benchmarks/languages.py [--languages es fr ...] [--recogniser KIND] [--chart] [--facegood FOLDER]

One JSON object a line. For each language, six sentences in two voices, of which espeak-ng tells the phones in time:
from these phones, and with ``--recogniser`` from the sound alone. Of the vowels with five instances or more, the median
opening and width in the middle of the vowel, against the chart of the International Phonetic Association: ``height``:
rank correlation of the opening with the openness (0: close, to 6: open). ``in order``: share of the pairs of vowels
of the same rounding in which the more open one is more open. ``rounding``: rank correlation of the width with being
unrounded. ``closed``: share of p, b, m (and their like) in which the lips touch within 20 ms of the phone. ``shared``:
share of the phones whose letters English has as well. ``--chart`` adds a line for each vowel.
``--facegood``: the correlation of ``jawOpen``, audio only, with the captured jaw in the first minute of the recording
held out, of the shipped model and of a ridge on MFCC over 160 ms before and after, trained on 109 s of the speaker.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import unicodedata
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

import lipmotion
from lipmotion.articulation.contact import gap_in
from lipmotion.corpora.facegood import read_bare_motion, read_channels
from lipmotion.corpora.source_recordings import MotionFile
from lipmotion.pipeline.outputs.curve_sets import curves_of
from lipmotion.speech.features.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.voices.espeak import ESPEAK_NG
from lipmotion.speech.voices.inventory_phones import inventory_timeline
from lipmotion.types import Audio, Span
from lipmotion.types.languages import LANGUAGES
from lipmotion.units import LIP_CLOSING
from lipmotion.units.ipa_phones import VOWEL_CHART, ipa_phones

SENTENCES = {
    "en": "The quick brown fox jumps over the lazy dog|She had a dark blue suit in greasy wash water"
    "|Two big boats move to the bay|My mother bought some apples and pears"
    "|People hope for peace and good food|The bird sat up in a tree",
    "es": "El perro de mi abuela come pan y bebe leche|Mañana iremos a la playa con los niños"
    "|El lobo vive en una cueva del bosque|Mi madre compra uvas y peras"
    "|Pepe puso la mesa para la boda|Una nube tapa la luna",
    "fr": "Je veux une rue pour la lune et deux œufs bleus|Bonjour madame où est la gare"
    "|Les enfants jouent dans le jardin|Mon père boit un peu de bière brune"
    "|La peur du loup est une vieille peur|Sur la mer il y a une belle vue",
    "de": "Die schönen Füße laufen über die grüne Wiese|Ich möchte gern ein Stück Kuchen"
    "|Wo ist der nächste Bahnhof bitte|Meine Mutter übt fünf böse Lieder|Er hört im Büro Musik"
    "|Der Apfel fällt auf den Boden",
    "it": "Il gatto dorme sulla sedia vicino alla finestra|Mi piace mangiare la pizza con gli amici"
    "|Domani andiamo a Roma|La mamma porta pane e burro|Un bel lupo beve al pozzo"
    "|Ogni uomo vuole una cosa buona",
    "pt": "O menino comprou um pão na padaria|Amanhã vamos à praia com os amigos"
    "|Não sei onde está o meu coração|A minha avó bebe um copo de vinho|O lobo subiu a rua"
    "|É bom ter uma mesa no jardim",
    "nl": "De kinderen spelen buiten in de tuin|Ik wil graag een kopje koffie met melk"
    "|Morgen gaan we naar de zee|Mijn moeder koopt boter en peren|De buurman heeft een groot huis"
    "|Deze deur is heel duur",
    "ja": "こんにちは わたしは ふゆが すきです|きょうは とても いい てんきですね"
    "|ともだちと えいがを みに いきます|まどの そとに ばらが あります|ぼくは ぱんと みずを のみます"
    "|うみべで ふねを みました",
    "ko": "안녕하세요 밥을 먹고 물을 마셨어요|오늘은 날씨가 아주 좋습니다"
    "|내일 친구와 함께 영화를 보러 가요|우리 어머니는 바다를 좋아해요|비가 오면 우산을 써요"
    "|바람이 불어서 문을 닫았어요",
    "zh": "今天天气很好我们去公园玩|我想喝一杯热茶|你明天要去学校吗|他们都喜欢吃中国菜|妈妈买了八本新书|不要跑慢慢走",
}
VOICES, VARIANTS = {"en": "en-gb", "zh": "cmn"}, ("f2", "m3")
"""espeak-ng tells the phones of American English in its own letters."""
LEAST_COUNT, LATE_S, PITCH_S = 5, 0.02, 0.01
HELD_OUT, TRAINED, JAW = "1114_2_01", ("1114_2_02", "1114_3_15"), "mouth_stretch_c"
MINUTE_S, REACH, STEP, PENALTY = 60.0, 16, 4, 3000.0
Said = tuple[Audio, lipmotion.Timeline[lipmotion.Unit], lipmotion.Timeline[str]]


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--languages", nargs="*", default=list(SENTENCES))
    parser.add_argument("--recogniser", default="")
    parser.add_argument("--chart", action="store_true")
    parser.add_argument("--facegood", type=Path)
    options = parser.parse_args()
    for language in options.languages:
        for row in of_language(language, options.recogniser, chart=options.chart):
            print(json.dumps(row, ensure_ascii=False), flush=True)
    if options.facegood:
        print(json.dumps(of_captures(options.facegood, options.recogniser or "auto")), flush=True)


def spoken(language: str) -> Iterator[Said]:
    """Yield the sentences of a language: sound, phones of the inventory in time, and espeak-ng's labels in time."""
    name = VOICES.get(language, language)
    for variant in VARIANTS:
        with tempfile.TemporaryDirectory() as folder:
            for said in ESPEAK_NG.synthesise(f"{name}+{variant}", SENTENCES[language].split("|"), Path(folder)):
                assert said.phone_map is not None
                assert said.words is not None
                units = inventory_timeline(said.phones, said.phone_map, said.words, None, said.audio.duration_s)
                yield said.audio, units, said.phones


def of_language(language: str, recogniser: str, *, chart: bool) -> Iterator[dict[str, object]]:
    """Yield the figures of a language: of phones that are given, and of the sound alone if there is a recogniser."""
    sentences = list(spoken(language))
    for kind in ("", recogniser) if recogniser else ("",):
        opened, widths = defaultdict(list), defaultdict(list)
        closed = []
        for audio, units, labels in sentences:
            request = lipmotion.Request(
                audio, units=None if kind else units, recogniser=kind or "auto", language=language
            )
            motion = lipmotion.animate(request).motion
            for span in labels:
                letter = vowel_of(span.label)
                if letter:
                    middle = round((span.start_s + span.end_s) / 2 * motion.rate_hz)
                    opened[letter].append(float(motion["opening"][middle]))
                    widths[letter].append(float(motion["width"][middle]))
            gap = gap_in(motion)
            closed += [touches(gap, span) for span in units if span.label.phone in LIP_CLOSING]
        yield row_of(language, kind, opened, widths, closed) | {"shared": shared(sentences)}
        if chart:
            for letter in sorted(opened, key=lambda vowel: VOWEL_CHART[vowel]):
                row = {"language": language, "phones": kind or "given", "vowel": letter}
                row |= {"height": VOWEL_CHART[letter].height, "rounded": VOWEL_CHART[letter].rounded}
                yield row | {"count": len(opened[letter])} | medians(opened[letter], widths[letter])


def row_of(
    language: str, kind: str, opened: dict[str, list[float]], widths: dict[str, list[float]], closed: list[bool]
) -> dict[str, object]:
    """Return the figures of a language over all its vowels."""
    common = [vowel for vowel, values in opened.items() if len(values) >= LEAST_COUNT]
    heights = [VOWEL_CHART[vowel].height for vowel in common]
    unrounded = [not VOWEL_CHART[vowel].rounded for vowel in common]
    openings = [float(np.median(opened[vowel])) for vowel in common]
    height = spearmanr(heights, openings).statistic
    rows = list(zip(heights, unrounded, openings, strict=True))
    pairs = [far > near for h, r, near in rows for g, q, far in rows if g > h and q == r]
    rounding = spearmanr(unrounded, [np.median(widths[vowel]) for vowel in common]).statistic
    return {
        "language": LANGUAGES[language].name,
        "phones": kind or "given",
        "vowels": len(common),
        "height": round(float(height), 2),
        "in order": f"{sum(pairs)} of {len(pairs)}",
        "rounding": round(float(rounding), 2),
        "closed": f"{100 * np.mean(closed):.0f} % of {len(closed)}",
    }


def medians(openings: list[float], widths: list[float]) -> dict[str, float]:
    """Return the median opening and width of a vowel, in eye distances."""
    return {"opening": round(float(np.median(openings)), 3), "width": round(float(np.median(widths)), 3)}


def vowel_of(label: str) -> str:
    """Return the letter of a label that is one vowel, with whatever marks; empty: it is none, or a diphthong."""
    letters = [letter for letter in unicodedata.normalize("NFD", label) if ipa_phones(letter)[0]]
    return letters[0] if len(letters) == 1 and letters[0] in VOWEL_CHART else ""


def touches(gap: np.ndarray, span: Span[lipmotion.Unit]) -> bool:
    """Return whether the lips touch in a phone, or within ``LATE_S`` of it."""
    first, last = (round(time_s / PITCH_S) for time_s in (max(span.start_s - LATE_S, 0), span.end_s + LATE_S))
    return bool((gap[first : last + 1] <= 0).any())


def shared(sentences: list[Said]) -> float:
    """Return the share of labels all of whose letters English has, as it is written in the same alphabet."""
    english = {*"iɪɛæɑɔʊuʌəɚɝaeopbtdkgɡmnŋfvθðszʃʒhlɹwj"}
    labels = [label.label for _, _, spans in sentences for label in spans if ipa_phones(label.label)[0]]
    letters = ([letter for letter in label if ipa_phones(letter)[0]] for label in labels)
    return round(float(np.mean([english.issuperset(found) for found in letters])), 2)


def of_captures(folder: Path, recogniser: str) -> dict[str, object]:
    """Return the correlations with the captured jaw of the recording held out."""
    (audio, jaw), trained = captured(folder, HELD_OUT), [captured(folder, name) for name in TRAINED]
    request = lipmotion.Request(audio, recogniser=recogniser, language="zh")
    generation = lipmotion.animate(request)
    curve = curves_of(generation.motion, generation.units, "arkit")["jawOpen"]
    inputs, outputs = zip(*((contexts(sound), values) for sound, values in trained), strict=True)
    x, y = np.vstack(inputs), np.concatenate(outputs)
    mean, scale = x.mean(axis=0), x.std(axis=0)
    x = (x - mean) / scale
    weights = np.linalg.solve(x.T @ x + PENALTY * np.eye(x.shape[1]), x.T @ (y - y.mean()))
    ridge = (contexts(audio) - mean) / scale @ weights
    found = {"shipped": curve, "opening": generation.motion["opening"], "ridge": ridge}
    scores = {
        name: round(float(np.corrcoef(values[: len(jaw)], jaw[: len(values)])[0, 1]), 3)
        for name, values in found.items()
    }
    return {"captures": HELD_OUT, "recogniser": recogniser} | scores


def captured(folder: Path, name: str) -> tuple[Audio, np.ndarray]:
    """Return the first minute of a recording, and its jaw at 100 Hz."""
    whole = read_audio(folder / f"{name}.wav")
    audio = Audio(whole.samples[: int(MINUTE_S * whole.rate_hz)], whole.rate_hz)
    channels = read_channels(next(folder.glob("*_bs_name.npy")))
    motion = read_bare_motion(MotionFile(folder / f"bs_value_{name}.npy", 30.0, channels))
    times = np.arange(len(analysed(audio).mfcc().values)) * PITCH_S
    return audio, motion.at(times)[:, motion.column(JAW)]


def contexts(audio: Audio) -> np.ndarray:
    """Return the cepstra of every frame and of frames around it [shape=(T, D)]."""
    values = analysed(audio).mfcc().values.astype(float)
    padded = np.pad(values, ((REACH, REACH), (0, 0)), mode="edge")
    return np.hstack([padded[start : start + len(values)] for start in range(0, 2 * REACH + 1, STEP)])


if __name__ == "__main__":
    main()
