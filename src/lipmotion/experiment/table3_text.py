"""The figures of ``table3`` as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lipmotion.experiment.comparison import mark
from lipmotion.experiment.rivals import BEST, PRINTED
from lipmotion.measures.report import number

WIDTH = 27
HEAD = (
    f"  {'system':{WIDTH}}{'paper':>13}  {'AMSE (95 %)':25}  {'ACC (95 %)':22}  {'opening (95 %)':22}  "
    "nRMSE    RMSE    lag  score  p b m  false  variance  K  seconds"
)


def table(figures: Mapping[str, Any]) -> str:
    """Return the figures of ``table3`` as text."""
    order = {"given": "the list given", "shuffled": f"the training list shuffled with seed {figures['seed']}"}
    chosen = ", ".join(map(str, figures["mixtures"]))
    lines = [
        f"the first N clips of {order[figures['order']]}; split {figures['split']}: {figures['clips']} clips",
        f"{figures['states']} states a unit and {chosen} Gaussians a state, the best on val (K), in the systems of the "
        f"paper; AMSE, ACC of {', '.join(figures['channels'])}; closed under {figures['closed_under']:.4f}",
    ]
    for size in figures["rows"]:
        for condition, rows in size["conditions"].items():
            lines += ["", f"{condition}, {size['used']} of the first {size['names']} clips", HEAD]
            lines += [_line(name, row, size["training"][name]) for name, row in rows.items()]
    for kind in dict.fromkeys(row["kind"] for row in figures["noise"]):
        lines += ["", *_noise(kind, figures)]
    lines += ["", f"* differs from {BEST}: the 95 % interval of the difference on the same clips leaves out 0"]
    return "\n".join(lines)


def _line(name: str, row: Mapping[str, Any], training: Mapping[str, Any]) -> str:
    printed = "{:.3f} {:.3f}".format(*PRINTED[name]) if name in PRINTED else ""
    amse = _with_interval(row["amse"], row["amse_gain_95"], row["amse_95"], ".4f")
    acc = _with_interval(row["acc"], row["acc_gain_95"], row["acc_95"], ".3f")
    opening = row["opening"]
    lips = _with_interval(opening["acc"], row["opening_acc_gain_95"], opening["acc_95"], ".3f")
    return (
        f"  {name:{WIDTH}}{printed:>13}  {amse:25}  {acc:22}  {lips:22}{opening['nrmse']:7.3f}{row['rmse']:8.4f}"
        f"{number(row['lag_ms'], '+7.0f')}{number(opening['score'], '7.1f')}{number(opening['recall_p_b_m'], '7.1f')}"
        f"{number(row['false_per_minute'], '7.1f')}{opening['global_variance']:10.2f}"
        f"{number(training['mixtures'], '3.0f')}{training['seconds']:9.1f}"
    )


def _with_interval(value: float, gain: Sequence[float | None], interval: Sequence[float], form: str) -> str:
    low, high = (format(end, form) for end in interval)
    return f"{value:{form}}{mark(gain)} ({low}–{high})"


def _noise(kind: str, figures: Mapping[str, Any]) -> list[str]:
    """Return ACC and AMSE of every system, from clean to loudest."""
    loud = [row for row in figures["noise"] if row["kind"] == kind]
    size = figures["rows"][-1]
    clean = next(iter(size["conditions"].values()))
    heads = ["clean", *(f"{row['snr_db']:g} dB" for row in loud)]
    lines = [f"{kind} noise, audio only, trained on {size['used']} clips without noise: ACC / AMSE"]
    lines.append(f"  {'system':{WIDTH}}" + "".join(f"{head:>17}" for head in heads))
    for name in clean:
        cells = [
            f"{row['acc']:.3f}{mark(row['acc_gain_95'])} / {row['amse']:.4f}{mark(row['amse_gain_95'])}"
            for row in (clean[name], *(each["systems"][name] for each in loud))
        ]
        lines.append(f"  {name:{WIDTH}}" + "".join(f"{cell:>17}" for cell in cells))
    return lines
