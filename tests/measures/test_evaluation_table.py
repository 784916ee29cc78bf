from itertools import count

from lipmotion_lab.evaluation.table import format_figures


def figures():
    """Figures that are all different, and the text of every number."""
    numbers, printed = count(1), []

    def figure(form: str, scale: float = 0.001):
        value = 100 * scale + next(numbers) * scale
        printed.append(format(value, form))
        return value

    def shares(*names: str):
        return {name: figure(".3f") for name in names}

    def counts(*names: str):
        return {name: int(figure(".0f", 1)) for name in names}

    def channel():
        ranges = {name: figure(".2f", 0.01) for name in ("global_variance", "jerk")}
        return shares("acc", "acc_per_clip", "nrmse") | ranges

    def closing():
        closures = shares("score", "precision", "f1") | {"timing_ms": figure("+.0f", 1)}
        rates = {name: figure(".1f", 0.1) for name in ("false_per_minute", "original_per_minute")}
        return {
            "closures": closures | counts("original", "generated"),
            "closures_p_b_m": shares("recall") | counts("intervals") | rates,
        }

    def unpinned():
        interval = (figure(".3f"), figure(".3f"))
        return {"channels": {"opening": shares("acc")}, "opening_acc_95": interval} | shares("acc") | closing()

    def silence():
        return {name: figure(".4f", 0.0001) for name in ("mean", "std")}

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
            "silence": {"generated": silence() | counts("frames"), "original": silence() | {"frames": 0}},
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
