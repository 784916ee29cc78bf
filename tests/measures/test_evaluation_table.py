from typing import Any

from lipmotion_lab.evaluation.table import format_figures


def figures():
    """Figures that are all different."""
    acc, closures = {"acc": 0.111, "acc_per_clip": 0.112, "nrmse": 0.113}, {"score": 0.121, "precision": 0.122}
    closings = {
        "closures": closures | {"f1": 0.123, "timing_ms": 124, "original": 125, "generated": 126},
        "closures_p_b_m": {"recall": 0.131, "intervals": 132, "false_per_minute": 13.3, "original_per_minute": 13.4},
    }
    free = {"channels": {"opening": {"acc": 0.141}}, "opening_acc_95": (0.142, 0.143), "acc": 0.144, **closings}
    condition: dict[str, Any] = {
        "channels": {"opening": acc | {"global_variance": 1.14, "jerk": 1.15}},
        "opening_acc_95": (0.151, 0.152),
        **{"acc": 0.153, "amse": 0.1541, "leading": "opening", "lag_ms": 15.5},
        **closings,
        "unpinned": free,
        "silence": {"generated": {"mean": 0.1611, "std": 0.1612, "frames": 163}, "original": {"frames": 0}},
    }
    condition["silence"]["original"] |= {"mean": 0.1613, "std": 0.1614}
    whole = {"split": "val", "clips": 171, "closed_under": 0.1721, "still_channels": []}
    return whole | {"conditions": {"audio only": condition}}


def numbers(content):
    if isinstance(content, dict):
        content = list(content.values())
    if isinstance(content, list | tuple):
        return [number for each in content for number in numbers(each)]
    return [content] if isinstance(content, int | float) and content else []


def test_every_figure_is_printed_and_what_limits_them_is_said():
    text = format_figures(figures())
    words = text.translate(str.maketrans(",;()+", "     ")).split()
    assert not [number for number in numbers(figures()) if str(number) not in words]
    for name in ("split val", "audio only", "opening", "are pinned"):
        assert name in text
    assert "trained on some of these" not in text
    result = figures() | {"seen_in_training": True, "without_words": 5, "clips": 18}
    condition = result["conditions"]["audio only"]
    condition["closures"] = {key: 0 if isinstance(value, int) else None for key, value in condition["closures"].items()}
    del condition["unpinned"]
    text = format_figures(result)
    assert "the model was trained on some of these recordings" in text
    assert "no figures with transcript: 5 of 18 clips have no words" in text
    assert "–" in text
    assert "pin" not in text
