"""What a report says of each experiment: of the papers, of all engines, learning curve, folds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from lipmotion_lab.evaluation.evaluate import find_sign
from lipmotion_lab.evaluation.held_out import AUDIO_ONLY
from lipmotion_lab.evaluation.table import format_figure
from lipmotion_lab.hofer2008 import PAPER_SCORES, PINS, REFERENCE_SET
from lipmotion_lab.minnis2000 import ADDITIONS, EVERYTHING, PRINTED, UNGUIDED, VARIANTS
from lipmotion_lab.report.section import Column, PaperOrder, PaperPair, Row, Section, Table, read_columns, warn_of_few
from lipmotion_lab.xie_liu2007.systems import BLSTM, PAPER_FIGURES, REFERENCE_SYSTEM, SPLIT

AS_PRINTED, SETS = next(iter(PINS)), "Unit sets, "


def subtract(one: float | None, other: float | None) -> float | None:
    """Return by how much a figure is above another one; None where one of them is not defined."""
    return None if one is None or other is None else one - other


def _make_tables(
    name: str,
    caption: str,
    columns: Sequence[Column],
    conditions: Mapping[str, Mapping[str, Row]],
    reference: str = "",
    head: str = "system",
) -> list[Table]:
    """Return a table for each condition, that of sound alone first."""
    return [
        Table(f"{name}-{each}".replace(" ", "-"), f"{caption}, {each}", columns, conditions[each], reference, head)
        for each in sorted(conditions, key=lambda each: not each.endswith(AUDIO_ONLY))
    ]


def build_hofer_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``run_hofer2008`` say; the case of the paper: audio alone, as printed, most states."""
    blocks = list(figures["tables"])
    states = max(block["states"] for block in blocks)
    case = (states, AUDIO_ONLY, AS_PRINTED)
    main = next(each for each in blocks if (each["states"], each["condition"], each["pins"]) == case)
    table, rows = _build_hofer_table(main), main["rows"]
    order = _build_hofer_order(main)
    about = (
        f"Which set of units predicts closings of the mouth best: the system of the paper, trained on "
        f"{figures['trained_on']} recordings with each of {len(rows)} sets, compared on {figures['clips']} of "
        f"{figures['split']}.{_describe_closings(figures, next(iter(rows.values())))} "
        f"Channels of motion: {figures['channels'] or 'all'}. Shown first: sound alone, {AS_PRINTED}, {states} states."
    )
    words = warn_of_few(figures["clips"]) | {"The paper's order": order.describe()}
    more = []
    for block in blocks:
        if block is not main:
            other = _build_hofer_table(block)
            heading = f"{other.caption.removeprefix(SETS)}: {_build_hofer_order(block).judge()}"
            more.append(replace(other, heading=heading))
    title = "Hofer, Yamagishi & Shimodaira 2008, Table 1: unit sets"
    shown = [f"{units}, {states} states" for units in table.rows]
    return Section(title, about, order.judge(), words, table, more, shown)


def _build_hofer_order(block: Mapping[str, Any]) -> PaperOrder:
    pairs = []
    for pair in block["paper_order"]:
        better, worse = pair["better"], pair["worse"]
        gain = subtract(block["rows"][better]["score"], block["rows"][worse]["score"])
        pairs.append(PaperPair(better, worse, gain, pair["score_gain_95"]))
    here = {name: row["score"] for name, row in block["rows"].items()}
    return PaperOrder("Score of closings", {name: PAPER_SCORES[name] for name in here}, here, pairs, "+.1f")


def _describe_closings(figures: Mapping[str, Any], row: Row) -> str:
    """Return a sentence on the closings of the recordings, of which there is a row; empty: no opening is compared."""
    if figures["closed_under"] is None:
        return ""
    return (
        f" The mouth is closed under {figures['closed_under']:.4f} eye distances; the recordings close it "
        f"{row['closings']} times, and in {row['p_b_m']} p, b and m."
    )


def _build_hofer_table(block: Mapping[str, Any]) -> Table:
    case = f"{block['states']} states, {block['condition']}, {block['pins']}"
    name = f"hofer2008-{case}".replace(",", "").replace(" ", "-")
    return Table(name, f"{SETS}{case}", read_columns("hofer2008"), block["rows"], REFERENCE_SET, "unit set")


def build_minnis_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``run_minnis2000`` say, on the last of its lists, which is ``test``."""
    tables, columns = dict[tuple[str, str], Table](), read_columns("minnis2000")
    for split, part in figures["lists"].items():
        for condition, rows in part["conditions"].items():
            name, caption = f"minnis2000-{split}-{condition}", f"Unit selection, {split}, {condition}"
            with_joins = {}
            for system, row in rows.items():
                joins, overlap = row["joins"], row.get("overlap", {"error": None})
                joined = {f"joins_{key}": joins.get(key) for key in ("per_clip", "candidates")}
                joined |= {f"joins_{key}": joins[key] and 100 * joins[key] for key in ("hard", "smooth")}
                joined |= {f"overlap_{key}": each for key, each in overlap.items()}
                for channel, each in row["channels"].items():
                    joined |= {f"{channel}_{ratio}": each[ratio] for ratio in ("global_variance", "jerk")}
                with_joins[system] = {**row, **joined}
            tables[split, condition] = Table(name.replace(" ", "-"), caption, columns, with_joins, PRINTED)
    split, last = list(figures["lists"].items())[-1]
    main = tables[split, AUDIO_ONLY]
    rows, everything = main.rows, main.rows.get(EVERYTHING, main.rows[PRINTED])
    acc = format_figure(rows[PRINTED]["acc"], ".3f"), format_figure(everything["acc"], ".3f")
    gained = subtract(everything["acc"], rows[PRINTED]["acc"])
    effect = ("leave open whether they change", "raise", "lower")[find_sign(everything["acc_gain_95"])]
    gain, (low, high) = format_figure(gained, "+.3f"), everything["acc_gain_95"]
    gain += "" if low is None else f", 95 % interval {low:+.3f} to {high:+.3f}"
    closed = [
        "–" if row["recall_p_b_m"] is None else f"{row['recall_p_b_m']:.1f} %" for row in (rows[PRINTED], everything)
    ]
    verdict = (
        f"The paper prints no figures. All additions together {effect} the correlation of the opening: "
        f"{acc[0]} as printed, {acc[1]} with them ({gain})."
    )
    if EVERYTHING not in rows:
        verdict = f"The paper prints no figures. As printed, the correlation of the opening is {acc[0]}."
    words = warn_of_few(last["clips"]) | {
        "Each addition alone": _list_effects(rows, ADDITIONS),
        "Other readings of the print": _list_effects(rows, VARIANTS),
        "Lips in p, b and m": [
            f"As printed, the lips close in {closed[0]} of {rows[PRINTED]['p_b_m']} p, b and m"
            f"{f'; with all additions in {closed[1]}' if EVERYTHING in rows else ''}; nothing is pinned."
        ],
    }
    about = (
        f"The system of the paper as printed, each addition of this project alone, and other readings of the print: "
        f"units of {figures['utterances']} recordings ({figures['minutes']} minutes), compared on {last['clips']} "
        f"recordings of {split}, sound alone."
        f"{' Quick: few epochs, only to see that it runs.' if figures['quick'] else ''}"
    )
    more = [table for table in tables.values() if table is not main]
    title, compared = "Minnis & Breen 2000: unit selection", (PRINTED, UNGUIDED, EVERYTHING)
    return Section(title, about, verdict, words, main, more, compared)


def _list_effects(rows: Mapping[str, Row], names: Iterable[str]) -> list[str]:
    """Return which of some rows are better than the system as printed, worse, and neither for sure."""
    signs = {name: find_sign(rows[name]["acc_gain_95"]) for name in names if name in rows}
    printed = rows[PRINTED]["acc"]
    described = {name: f"{name} ({format_figure(subtract(rows[name]['acc'], printed), '+.3f')})" for name in signs}
    outcomes = ("ACC is higher", "ACC is lower", "The interval of the difference contains 0")
    return _group(signs, described, outcomes)


def _group(signs: Mapping[str, int], described: Mapping[str, str], outcomes: Sequence[str]) -> list[str]:
    """Return which differences are positive, negative, and neither for sure, each in a sentence."""
    return [
        f"{what}: {', '.join(described[name] for name, each in signs.items() if each == sign) or 'none'}."
        for sign, what in zip((1, -1, 0), outcomes, strict=True)
    ]


MEASURES = (("acc", "ACC", "+.3f"), ("amse", "AMSE", "+.4f"))


def build_xie_liu_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``run_xieliu2007`` say, of the largest number of recordings."""
    *smaller, size = figures["rows"]
    cases = [(condition, rows, size) for condition, rows in size["conditions"].items()]
    for each in smaller:
        cases += [(f"{name}, {each['names']} recordings", rows, each) for name, rows in each["conditions"].items()]
    main, *others = (_build_systems_table(*case) for case in cases)
    more = [replace(table, heading=case) for table, (case, *_) in zip(others, cases[1:], strict=True)]
    words, verdict, by_amse = warn_of_few(figures["clips"]), "", []
    for ending, called in (("", "as printed"), (SPLIT, "with Gaussians chosen on val")):
        names = {name + ending for name in PAPER_FIGURES}
        pairs = [pair for pair in size["pairs"] if {pair["better"], pair["worse"]} <= names]
        if pairs:
            by_acc, by_error = (_compare_order(main.rows, pairs, ending, *measure) for measure in MEASURES)
            words[f"Systems {called}, by ACC"] = [*([by_acc.judge()] if verdict else []), *by_acc.describe()]
            by_amse.append(f"Systems {called}: {by_error.judge()}")
            verdict = verdict or by_acc.judge()
    words["By AMSE"] = by_amse
    changed = []
    for name, row in size["training"].items():
        if row["tried"]:
            texts = [f"{key}={value}" for key, value in row["options"].items() if key not in ("structure", "chains")]
            changed.append(f"{name}: {', '.join(texts) or 'as printed'}.")
    if changed:
        words["Settings, the best on val"] = changed
    if size["pairs"]:
        rows = {f"{pair['better']} over {pair['worse']}": pair for pair in size["pairs"]}
        columns = [Column(key, f"difference of {title}", form) for key, title, form in MEASURES]
        more.append(Table("xieliu2007-pairs", "Pairs of the paper", columns, rows, head="pair"))
    channels = figures["channels"]
    about = (
        f"Which structure of chains predicts lips best: {len(main.rows)} systems trained on {size['used']} recordings, "
        f"compared on {figures['clips']} of {figures['split']}, by {len(channels)} channels "
        f"({', '.join(channels[:3])}{', …' if len(channels) > 3 else ''})."
        f"{_describe_closings(figures, next(iter(main.rows.values())))}"
    )
    if changed:
        about += " K on val: with the number of Gaussians that was best there; nothing was chosen on test."
    title = "Xie & Liu 2007, Table 3: structures of chains"
    return Section(title, about, verdict, words, main, more, [name for name in PAPER_FIGURES if name in main.rows])


def _build_systems_table(case: str, rows: Mapping[str, Row], size: Mapping[str, Any]) -> Table:
    """Return the table of all systems in one case, with the paper's figures, the opening and the training."""
    full_rows = {}
    for name, row in rows.items():
        amse, acc = PAPER_FIGURES.get(name.removesuffix(SPLIT), (None, None))
        training = {key: size["training"][name][key] for key in ("parameters", "seconds")}
        full_rows[name] = {**(row["opening"] or {}), **row, **training, "paper_amse": amse, "paper_acc": acc}
    columns = [*read_columns("xieliu2007")]
    if not any(row["opening"] for row in rows.values()):  # eigenlips alone, in grey levels
        columns = [replace(column, form=".1f") if column.key == "amse" else column for column in columns]
    elif any("eigenlips_acc" in row for row in rows.values()):
        columns += [Column(f"eigenlips_{key}", f"{title}, eigenlips", ".3f") for key, title, _ in MEASURES]
    name = f"xieliu2007-{case}".replace(", ", "-").replace(" ", "-")
    return Table(name, f"Structures of chains, {case}", columns, full_rows, REFERENCE_SYSTEM)


def _compare_order(
    rows: Mapping[str, Row], pairs: Sequence[Mapping[str, Any]], ending: str, key: str, title: str, form: str
) -> PaperOrder:
    """Return the paper's order of systems by one measure; ``ending``: of their names here."""
    is_error = key == "amse"
    compared = []
    for pair in pairs:
        gain, interval = pair[key], pair[f"{key}_95"]
        if is_error:  # turned such that positive differences are better
            gain = None if gain is None else -gain
            interval = [None if end is None else -end for end in reversed(interval)]
        better, worse = (pair[which].removesuffix(ending) for which in ("better", "worse"))
        compared.append(PaperPair(better, worse, gain, interval))
    paper = {name: PAPER_FIGURES[name][0 if is_error else 1] for name in PAPER_FIGURES if name + ending in rows}
    here = {name: rows[name + ending][key] for name in paper}
    return PaperOrder(title, paper, here, compared, form, is_error)


def build_engines_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``compare_engines`` say."""
    reference = figures["reference"]
    conditions = {
        condition: {
            name: _take_gains(row, reference) | {f"unpinned_{key}": value for key, value in row["unpinned"].items()}
            for name, row in case["systems"].items()
        }
        for condition, case in figures["conditions"].items()
    }
    main, *more = _make_tables("engines", "Engines", read_columns("engines"), conditions, reference)
    signs = {name: find_sign(row["acc_gain_95"]) for name, row in main.rows.items() if name != reference}
    best = max(main.rows, key=lambda name: main.rows[name]["acc"] or 0.0)
    acc = format_figure(main.rows[best]["acc"], ".3f")
    verdict = f"Most alike to the recordings: {best} (ACC {acc}); nothing is in print to compare."
    places = ("Higher than that", "Lower than that", "Not different for sure from that")
    outcomes = [f"{place} of the engine {reference}" for place in places]
    words = warn_of_few(figures["clips"]) | {"ACC of the opening": _group(signs, {n: n for n in signs}, outcomes)}
    minutes = ", ".join(sorted({f"{row['minutes']}" for row in figures["models"].values()}))
    about = (
        f"All engines with their defaults, trained on {minutes} minutes, on {figures['clips']} "
        f"recordings of {figures['split']}, with closed lips forced in p, b and m."
        f"{_describe_closings(figures, main.rows[best])}"
    )
    return Section("The engines of this project", about, verdict, words, main, more, list(main.rows))


def _take_gains(row: Row, reference: str) -> dict[str, Any]:
    """Return a row whose differences, of each figure from several references, are those from one of them."""
    return {key: value.get(reference) if key.endswith("_gain_95") else value for key, value in row.items()}


def build_learning_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``run_learning_curve`` say."""
    sizes = {str(row["names"]): row for row in figures["rows"]}
    conditions = {
        condition: {size: {**row, **row["conditions"][condition]} for size, row in sizes.items()}
        for condition in figures["rows"][0]["conditions"]
    }
    columns = read_columns("learning-curve")
    main, *more = _make_tables("learning-curve", "Learning curve", columns, conditions, head="recordings")
    accs = {size: row["acc"] for size, row in main.rows.items()}
    first, last = next(iter(accs)), list(accs)[-1]
    low, high = (format_figure(accs[size], ".3f") for size in (first, last))
    steps = [size for before, size in pairwise(accs) if (subtract(accs[size], accs[before]) or 0) < 0]
    words = warn_of_few(figures["clips"]) | {
        "More recordings": [
            f"From {first} to {last} recordings the correlation of the opening goes from {low} to {high}.",
            f"It falls at: {', '.join(steps)}." if steps else "It falls at no step.",
        ]
    }
    compared = {size: row[BLSTM]["channels"] for size, row in sizes.items() if BLSTM in row}
    if compared:
        words["Without pins, beside a BLSTM"] = [
            f"{size} recordings, {channel}: {', BLSTM '.join(format_figure(row[k], '.3f') for k in ('ours', 'acc'))}, "
            f"95 % interval of the difference {' to '.join(format_figure(end, '+.3f') for end in row['gain_95'])}."
            for size, channels in compared.items()
            for channel, row in channels.items()
        ]
    about = (
        f"The default engine trained on the first recordings of "
        f"{'the list given' if figures['order'] == 'given' else 'the training list, in a random order,'} alone, "
        f"compared on {figures['clips']} of {figures['split']}."
    )
    verdict = f"ACC {low} with {first} recordings, {high} with {last}."
    shown = [f"{size} recordings" for size in dict.fromkeys((first, last))]
    return Section("Learning curve", about, verdict, words, main, more, shown)


def build_folds_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``cross_validate`` say."""
    rows = figures["conditions"]
    row = rows[AUDIO_ONLY]
    columns = read_columns("folds")
    table = Table("folds", f"Cross-validation, {figures['folds']} folds", columns, rows, head="condition")
    acc, clips = format_figure(row["acc"], ".3f"), figures["clips"]
    verdict = f"ACC {acc} on {clips} recordings, each generated by a model of the others."
    about = (
        f"The training list in {figures['folds']} parts: each is generated by a model of the others, "
        f"{min(figures['trained_on'])} to {max(figures['trained_on'])} recordings.{_describe_closings(figures, row)}"
    )
    words = warn_of_few(figures["clips"]) | {
        "More closings than a test list has": [
            f"Of {row['p_b_m']} p, b and m the lips close in {format_figure(row['recall_p_b_m'], '.1f')} %; of "
            f"{row['closings']} closings {format_figure(row['score'], '.1f')} % are made in time."
        ]
    }
    if speakers := sorted((acc, name) for name, acc in row.get("speakers", {}).items() if acc is not None):
        mean, lowest, highest = sum(acc for acc, _ in speakers) / len(speakers), speakers[0], speakers[-1]
        words["Speakers unknown to the model"] = [
            "{} speakers: mean ACC {:.3f}, {:.3f} ({}) to {:.3f} ({}).".format(len(speakers), mean, *lowest, *highest)
        ]
    return Section("Cross-validation", about, verdict, words, table)


def build_blocks_section(figures: Mapping[str, Any]) -> Section:
    """Return what the figures of ``cross_validate_blocks`` say: of sound alone, systems by their mean correlation."""
    cases = figures["conditions"][AUDIO_ONLY]
    reference = next((name for name in figures["references"] if name in cases), "")
    rows = {name: {**(row.get("opening") or {}), **_take_gains(row, reference)} for name, row in cases.items()}
    best = max(rows, key=lambda name: rows[name]["acc"])
    about = (
        f"{figures['clips']} recordings, {figures['minutes']:.1f} minutes, in {figures['blocks']} blocks: each is "
        f"generated by systems trained on the others but one, on which they choose."
    )
    verdict = f"Highest ACC: {best}, {rows[best]['acc']:.3f}."
    table = Table("blocks", "Small corpus, sound alone", read_columns("blocks"), rows, reference)
    return Section("Small corpus in blocks", about, verdict, warn_of_few(figures["clips"]), table)
