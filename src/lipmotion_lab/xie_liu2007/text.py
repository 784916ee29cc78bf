"""The figures of ``xieliu2007`` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.measures.evaluation_table import figure_text
from lipmotion.pipeline.model import EIGENLIPS
from lipmotion.printable import printable
from lipmotion_lab.comparison import significance_mark
from lipmotion_lab.xie_liu2007.systems import PAPER_FIGURES, REFERENCE_SYSTEM

WIDTH = 34
NAMED_CHANNELS = 8
"""Most channels that are named one by one."""
HEAD = (
    f"  {'system':{WIDTH}}{'paper':>13}  {'AMSE (95 %)':25}  {'ACC (95 %)':22}  {'opening (95 %)':22}  "
    "nRMSE    RMSE    lag  score  p b m  false  variance   numbers  seconds"
)

LEGEND = (
    "paper: its AMSE and ACC; nRMSE, RMSE, variance: of the opening, the last by that of the recordings; lag: ms",
    "score, p b m: %; false: closings outside p b m, a minute of speech; seconds: of a processor, for training",
)


def table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``xieliu2007`` as text."""
    order = {"given": "the list given", "shuffled": f"the training list shuffled with seed {figures['seed']}"}
    closed = f"; closed under {figures['closed_under']:.4f}" if figures["closed_under"] is not None else ""
    names = figures["channels"]
    compared = ", ".join(names) if len(names) <= NAMED_CHANNELS else f"{len(names)} channels"
    lines = [
        f"the first N clips of {order[figures['order']]}; split {figures['split']}: {figures['clips']} clips",
        f"AMSE, ACC of {compared}{closed}; numbers: what the chains have learned",
    ]
    for size in figures["rows"]:
        for condition, rows in size["conditions"].items():
            lines += ["", f"{condition}, {size['used']} of the first {size['names']} clips", HEAD]
            lines += [_line(name, row, size["training"][name], _amse_form(figures)) for name, row in rows.items()]
            lines += _eigenlips(rows)
        lines += [*_settings(size["training"]), *_pairs(size["pairs"], _amse_form(figures))]
    for kind in dict.fromkeys(row["kind"] for row in figures["noise"]):
        lines += ["", *_noise(kind, figures)]
    lines += [
        "",
        f"* differs from {REFERENCE_SYSTEM}: the 95 % interval of the difference on the same clips leaves out 0",
        *LEGEND,
    ]
    return "\n".join(map(printable, lines))


def _amse_form(figures: Mapping[str, Any]) -> str:
    """Return how AMSE is written: in eye distances, or in grey levels."""
    return ".1f" if figures["visual"] == EIGENLIPS else ".4f"


def _line(name: str, row: Mapping[str, Any], training: Mapping[str, Any], amse_form: str) -> str:
    printed = "{:.3f} {:.3f}".format(*PAPER_FIGURES[name]) if name in PAPER_FIGURES else ""
    amse, acc = _with_interval(row, "amse", amse_form), _with_interval(row, "acc", ".3f")
    return (
        f"  {name:{WIDTH}}{printed:>13}  {amse:25}  {acc:22}  {_opening(row)}"
        f"{figure_text(training['parameters'], '10.0f')}{training['seconds']:9.1f}"
    )


def _settings(training: Mapping[str, Any]) -> list[str]:
    """Return the lines of what tuned systems do otherwise than printed ones."""
    lines = []
    for name, row in training.items():
        if row["tried"]:
            options = {key: value for key, value in row["options"].items() if key not in ("structure", "chains")}
            changed = ", ".join(
                f"{key}={value:g}" if key != "start" else f"{key}={value}" for key, value in options.items()
            )
            lines.append(f"  {name:{WIDTH}}{changed or 'as printed'}")
    return ["", "settings, the best on val", *lines] if lines else []


def _pairs(pairs: Sequence[Mapping[str, Any]], amse_form: str) -> list[str]:
    """Return the lines of the paper's order, pair by pair."""
    if not pairs:
        return []
    lines = ["", f"  {'in the paper better than':{2 * WIDTH}}{'ACC (95 %)':27}AMSE (95 %)"]
    for pair in pairs:
        acc, amse = (
            "{:+{f}}{} ({:+{f}} to {:+{f}})".format(
                pair[key], significance_mark(pair[f"{key}_95"]), *pair[f"{key}_95"], f=form
            )
            for key, form in (("acc", ".3f"), ("amse", amse_form))
        )
        lines.append(f"  {pair['better']:{WIDTH}}{pair['worse']:{WIDTH}}{acc:27}{amse}")
    return lines


def _opening(row: Mapping[str, Any]) -> str:
    """Return the columns from the ACC of the opening to its variance."""
    lips = row["opening"] or dict.fromkeys(
        ("nrmse", "rmse", "score", "recall_p_b_m", "false_per_minute", "global_variance")
    )
    columns = [(lips["nrmse"], "7.3f"), (lips["rmse"], "8.4f"), (row["lag_ms"], "+7.0f"), (lips["score"], "7.1f")]
    columns += [(lips["recall_p_b_m"], "7.1f"), (lips["false_per_minute"], "7.1f"), (lips["global_variance"], "10.2f")]
    texts = "".join(figure_text(value, form) for value, form in columns)
    return f"{_with_interval(row, 'opening_acc', '.3f'):22}{texts}"


def _eigenlips(rows: Mapping[str, Any]) -> list[str]:
    """Return the lines of AMSE and ACC of eigenlips; none where eigenlips are not compared beside geometry."""
    if "eigenlips_acc" not in next(iter(rows.values())):
        return []
    lines = [f"  {'eigenlips':{WIDTH}}{'AMSE (95 %)':27}{'ACC (95 %)'}"]
    for name, row in rows.items():
        amse, acc = _with_interval(row, "eigenlips_amse", ".2f"), _with_interval(row, "eigenlips_acc", ".3f")
        lines.append(f"  {name:{WIDTH}}{amse:27}{acc}")
    return lines


def _with_interval(row: Mapping[str, Any], name: str, form: str) -> str:
    if name not in row:
        return "–"
    low, high = (format(end, form) for end in row[f"{name}_95"])
    return f"{row[name]:{form}}{significance_mark(row[f'{name}_gain_95'])} ({low}–{high})"


def _noise(kind: str, figures: Mapping[str, Any]) -> list[str]:
    """Return the lines of ACC and AMSE of every system, from clean sound to the loudest noise."""
    in_noise = [row for row in figures["noise"] if row["kind"] == kind]
    size = figures["rows"][-1]
    clean = next(iter(size["conditions"].values()))
    heads = ["clean", *(f"{row['snr_db']:g} dB" for row in in_noise)]
    lines = [f"{kind} noise, audio only, trained on {size['used']} clips without noise: ACC / AMSE"]
    lines.append(f"  {'system':{WIDTH}}" + "".join(f"{head:>17}" for head in heads))
    for name in clean:
        cells = [
            f"{row['acc']:.3f}{significance_mark(row['acc_gain_95'])} / "
            f"{row['amse']:{_amse_form(figures)}}{significance_mark(row['amse_gain_95'])}"
            for row in (clean[name], *(row["systems"][name] for row in in_noise))
        ]
        lines.append(f"  {name:{WIDTH}}" + "".join(f"{cell:>17}" for cell in cells))
    return lines
