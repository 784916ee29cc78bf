from itertools import count

from lipmotion_lab.evaluation.table import format_figures


def figures():
    """Figures that are all different, and the text of every number."""
    numbers, printed = count(1), []

    def figure(form: str, scale: float = 0.001):
        value = 100 * scale + next(numbers) * scale
        printed.append(format(value, form))
        return value

    def channel():
        return {
            "acc": figure(".3f"),
            "acc_per_clip": figure(".3f"),
            "nrmse": figure(".3f"),
            "global_variance": figure(".2f", 0.01),
            "jerk": figure(".2f", 0.01),
        }

    def closing():
        return {
            "closures": {
                "score": figure(".3f"),
                "precision": figure(".3f"),
                "f1": figure(".3f"),
                "timing_ms": figure("+.0f", 1),
                "original": int(figure(".0f", 1)),
                "generated": int(figure(".0f", 1)),
            },
            "closures_p_b_m": {
                "recall": figure(".3f"),
                "intervals": int(figure(".0f", 1)),
                "false_per_minute": figure(".1f", 0.1),
                "original_per_minute": figure(".1f", 0.1),
            },
        }

    def unpinned():
        opening = {"acc": figure(".3f")}
        interval = (figure(".3f"), figure(".3f"))
        return {"channels": {"opening": opening}, "opening_acc_95": interval, "acc": figure(".3f")} | closing()

    def condition():
        return {
            "channels": {"opening": channel(), "width": channel()},
            "opening_acc_95": (figure(".3f"), figure(".3f")),
            "acc": figure(".3f"),
            "amse": figure(".4f", 0.0001),
            "leading": "opening",
            "lag_ms": figure("+.1f", 0.1),
            **closing(),
            "unpinned": unpinned(),
            "silence": {
                "generated": {
                    "mean": figure(".4f", 0.0001),
                    "std": figure(".4f", 0.0001),
                    "frames": int(figure(".0f", 1)),
                },
                "original": {"mean": figure(".4f", 0.0001), "std": figure(".4f", 0.0001), "frames": 0},
            },
        }

    return {
        "split": "val",
        "clips": int(figure(".0f", 1)),
        "closed_under": figure(".4f", 0.0001),
        "still_channels": [],
        "conditions": {"audio only": condition(), "with transcript": condition()},
    }, printed


def test_every_figure_is_printed_as_often_as_it_is_there():
    result, printed = figures()
    text = format_figures(result)
    assert len(set(printed)) == len(printed)
    words = text.replace(",", " ").replace(";", " ").replace(")", " ").replace("(", " ").split()
    assert not [number for number in printed if number not in words]
    for name in ("split val", "audio only", "with transcript", "opening", "width"):
        assert name in text


def test_what_limits_the_figures_is_said():
    result, _ = figures()
    assert "trained on some of these" not in format_figures(result)
    assert "have no words" not in format_figures(result)
    text = format_figures(result | {"seen_in_training": True, "without_words": 5, "clips": 18})
    assert "the model was trained on some of these recordings" in text
    assert "no figures with transcript: 5 of 18 clips have no words" in text


def test_figures_that_do_not_exist_are_printed_too():
    for part in ("closures", "closures_p_b_m"):
        result, _ = figures()
        condition = result["conditions"]["audio only"]
        condition[part] = {key: 0 if isinstance(value, int) else None for key, value in condition[part].items()}
        assert "–" in format_figures(result)


def test_pins_are_named_where_there_are_some():
    result, _ = figures()
    assert "are pinned" in format_figures(result)
    for condition in result["conditions"].values():
        del condition["unpinned"]
    assert "pin" not in format_figures(result)
