"""Annotations as documents: Praat's ``.TextGrid``, ELAN's ``.eaf``, and captions in XML (TTML, DFXP, IMSC, YouTube's).

TextGrids are read in long and short form, and written in the long one, with the tiers ``phones`` and ``words``. Source:
Praat manual, "TextGrid file formats".
"""

from __future__ import annotations

import logging
import math
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from lipmotion.errors import InputError, shorten
from lipmotion.formats.label_tiers import LINES, OTHER, LabelTier, TimedLabel, check_count, find_tier, require_time
from lipmotion.storage.files import atomic_file
from lipmotion.types import Timeline, Unit
from lipmotion.types.values import parse_clock
from lipmotion.units import RECOGNISED, group_words, list_recognised_phones
from lipmotion.units.spelling import read_patterns, read_table

LOG = logging.getLogger("lipmotion")
MARKS = read_patterns(Path(__file__).with_name("annotations.tsv"))
"""Patterns of the forms that are read, by their names in the table."""
INTERVALS, POINTS = "IntervalTier", "TextTier"
TRIGRAPHS = read_table("trigraphs")  # letters as Praat spells them after a backslash
NEAR_S, DEEPEST = 0.01, 20


class _DamagedError(Exception):
    """The file ends too early, or another token was expected."""


def parse_interval_tiers(text: str, where: str) -> list[LabelTier]:
    """Return the interval tiers of a TextGrid; point tiers are ignored. Raises InputError: not a whole TextGrid."""
    head, *parts = MARKS["SIZE"].split(text)
    counted = zip(parts[::2], parts[1::2], strict=True)  # some programs count wrongly
    tokens = _tokens(head + "".join(f"{size}{len(MARKS['LABEL'].findall(rest))}{rest}" for size, rest in counted))
    tiers: list[LabelTier] = []
    total = 0
    place = "the header"
    try:
        if "chronological" in _take(tokens, "text"):
            raise InputError(f"{where}: a TextGrid in order of time; save it as a text file in Praat")
        if _take(tokens, "text") != "TextGrid":
            raise InputError(f"{where}: a Praat file of another kind; save a TextGrid")
        _take(tokens, "number"), _take(tokens, "number")  # from when to when it lasts
        tier_count = _count(tokens) if _take(tokens, "flag") == "exists" else 0
        for number in range(1, tier_count + 1):
            place = f"tier {number}"
            kind, name = _take(tokens, "text"), _take(tokens, "text")
            place = f"tier {shorten(name)!r}"
            _take(tokens, "number"), _take(tokens, "number")
            count = _count(tokens)
            total += count
            check_count(total, where)
            if count and kind not in (INTERVALS, POINTS):
                raise _DamagedError(f"its kind is {shorten(kind)!r}, required {INTERVALS} or {POINTS}")
            labels = []
            for position in (f"{place}, interval {i + 1}" for i in range(count)):
                start_s = require_time(_take(tokens, "number"), position, where)
                end_s = require_time(_take(tokens, "number"), position, where) if kind == INTERVALS else start_s
                label = _take(tokens, "text").replace('""', '"').strip()
                label = re.sub(r"\\(\S\S)", lambda pair: TRIGRAPHS.get(pair[1], pair[0]), label)
                labels.append(TimedLabel(start_s, end_s, label, position))
            tiers += [find_tier(name, labels)] if kind == INTERVALS else []
        place = "what follows the last tier"
        if next(tokens, None) is not None:
            raise _DamagedError("more is there than the counts say")
    except _DamagedError as error:
        raise InputError(f"{where}: {place} is damaged: {error}; save it again in Praat") from error
    return tiers


def _tokens(text: str) -> Iterator[tuple[str, str]]:
    """Yield kind (text, flag, number) and value of every token."""
    at = 0
    while match := MARKS["TOKEN"].search(text, at):
        at = match.end()
        if match.lastgroup == "text":
            # a quote that is written twice is one in the text
            while text[at : at + 1] == '"' and (closing := text.find('"', at + 1)) > 0:
                at = closing + 1
            yield "text", text[match.start() + 1 : at - 1]
        elif match.lastgroup:
            yield match.lastgroup, match[match.lastgroup]


def _count(tokens: Iterator[tuple[str, str]]) -> int:
    value = _take(tokens, "number")
    if re.fullmatch("[0-9]{1,18}", value) is None:
        raise _DamagedError(f"there stands number {value[:40]}, required a count")
    return int(value)


def _take(tokens: Iterator[tuple[str, str]], wanted: str) -> str:
    """Return the value of the next token. Raises _DamagedError: it is of another kind."""
    kind, value = next(tokens, ("the end of the file", ""))
    if kind != wanted:
        raise _DamagedError(f"there stands {kind} {' '.join(value[:40].split())}".rstrip() + f", required a {wanted}")
    return value


def write_textgrid(path: Path, units: Timeline[Unit]) -> None:
    """Write phones in time to a TextGrid in long text form, with the tiers ``phones`` and ``words``.

    Where a label has no phone, the name of its unit is written. Words are those of ``units.group_words``. Recognised
    phones are in a third tier, ``recognised``, with their confidence (``p 0.37``), so that a reader can tell them from
    corrected ones. Times are as exact as floats are. After a failure there is no partial file.
    Raises ExportError: the file cannot be written.
    """
    phones = [(float(span.start_s), float(span.end_s), span.label.phone or span.label.unit) for span in units]
    words = [(float(span.start_s), float(span.end_s), span.label) for span in group_words(units)]
    tiers = [("phones", phones), ("words", words)]
    recognised = [(p.start_s, p.end_s, f"{p.name} {p.confidence}") for p in list_recognised_phones(units)]
    tiers += [(RECOGNISED, recognised)] if recognised else []
    end_s = max((float(span.end_s) for span in units), default=0.0)
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0", f"xmax = {end_s}"]
    lines += ["tiers? <exists>", f"size = {len(tiers)}", "item []:"]
    for number, (name, intervals) in enumerate(tiers, 1):
        filled = list[tuple[float, float, str]]()  # and gaps: Praat requires intervals that follow each other
        reached_s = 0.0
        for start_s, stop_s, text in [*intervals, (end_s, end_s, "")]:
            filled += [(reached_s, start_s, "")] if start_s > reached_s else []
            filled.append((max(reached_s, start_s), stop_s, text))
            reached_s = stop_s
        filled.pop()
        lines += [f"    item [{number}]:", '        class = "IntervalTier"', f'        name = "{name}"']
        lines += ["        xmin = 0", f"        xmax = {end_s}", f"        intervals: size = {len(filled)}"]
        for place, (start_s, stop_s, text) in enumerate(filled, 1):
            quoted = text.replace('"', '""')
            lines += [f"        intervals [{place}]:", f"            xmin = {start_s}", f"            xmax = {stop_s}"]
            lines.append(f'            text = "{quoted}"')
    with atomic_file(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_xml_tiers(text: str, where: str) -> list[LabelTier]:
    """Return the tiers of an ``.eaf``, or the lines of captions. Raises InputError: damaged XML, or such times."""
    if re.search(r"<!(?:DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise InputError(f"{where}: its XML declares entities, which are not read; save it without them")
    try:
        root = ElementTree.fromstring(text.lstrip())  # noqa: S314 (no entities)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise InputError(f"{where}: damaged XML ({error}); save it again") from error
    check_count(sum(1 for _ in root.iter()) // 4, where)
    for element in root.iter():  # without namespaces
        element.tag = str(element.tag).rpartition("}")[2]
    return _read_elan(root, where) if root.tag == "ANNOTATION_DOCUMENT" else [_read_captions(root, where)]


def _read_elan(root: Element, where: str) -> list[LabelTier]:
    """Return the tiers of ELAN. Annotations without times divide another one: they are one label with its time."""
    spans_s = _read_elan_spans(root, _read_elan_origin(root, where), where)
    owners = {each.get("ANNOTATION_ID"): each.get("ANNOTATION_REF") for each in root.iter("REF_ANNOTATION")}
    tiers: list[LabelTier] = []
    for tier in root.iter("TIER"):
        name = tier.get("TIER_ID", "")
        texts: dict[str | None, list[str]] = defaultdict(list)
        for each in _order_annotations(tier):
            aligned = each.get("ANNOTATION_ID")
            for _ in range(DEEPEST):
                aligned = owners.get(aligned, aligned) if aligned not in spans_s else aligned
            texts[aligned].append((each.findtext("ANNOTATION_VALUE") or "").strip())
        timed = [(spans_s.get(aligned, (math.nan, math.nan)), " ".join(parts)) for aligned, parts in texts.items()]
        rows = enumerate(sorted(timed, key=lambda row: (math.isnan(row[0][0]), row[0])), 1)
        labels = [TimedLabel(*span_s, text, f"tier {name!r}, annotation {number}") for number, (span_s, text) in rows]
        named = find_tier(name, labels, tier.get("PARTICIPANT") or "")
        is_part = any(each.name == tier.get("PARENT_REF") and each.is_said for each in tiers)
        role = named.role or (OTHER if is_part else LINES if named.speaker else "")
        tiers.append(LabelTier(name, named.labels, role, named.speaker))
    return tiers


def _read_elan_origin(root: Element, where: str) -> float:
    """Return when in the recording the times of ELAN begin, in seconds, with a warning if that is not at its start."""
    unit = next((each.get("TIME_UNITS") for each in root.iter("HEADER")), None) or "milliseconds"
    if unit != "milliseconds":
        raise InputError(f"{where}: its times are {shorten(unit)}, required milliseconds; save it again in ELAN")
    media = [(each.get("TIME_ORIGIN") or "0", each.get("MEDIA_URL", "")) for each in root.iter("MEDIA_DESCRIPTOR")]
    origin_s, url = max(((_parse_seconds(f"{origin}ms", {}, where), url) for origin, url in media), default=(0.0, ""))
    if origin_s:
        what = "its times begin %.2f s after the start of %s: they are moved by that"
        LOG.warning(f"%s: {what}; cut the recording there if it is another one", where, origin_s, shorten(url))
    return origin_s


def _read_elan_spans(root: Element, origin_s: float, where: str) -> dict[str | None, tuple[float, float]]:
    """Return starts and ends in seconds by the annotations that have some; NaN where a time slot has no value."""
    slots = {each.get("TIME_SLOT_ID"): each.get("TIME_VALUE") for each in root.iter("TIME_SLOT")}
    times_s = {name: origin_s + _parse_seconds(f"{ms}ms", {}, where) if ms else math.nan for name, ms in slots.items()}
    spans_s: dict[str | None, tuple[float, float]] = {}
    for each in root.iter("ALIGNABLE_ANNOTATION"):
        start_s, end_s = (times_s.get(each.get(f"TIME_SLOT_REF{edge}"), math.nan) for edge in (1, 2))
        spans_s[each.get("ANNOTATION_ID")] = start_s, end_s
    return spans_s


def _order_annotations(tier: Element) -> list[Element]:
    """Return the annotations of a tier: each after the one that it names as the previous one, wherever it stands."""
    after: dict[str | None, list[Element]] = defaultdict(list)
    for each in (*tier.iter("ALIGNABLE_ANNOTATION"), *tier.iter("REF_ANNOTATION")):
        after[each.get("PREVIOUS_ANNOTATION")].append(each)
    in_order = after.pop(None, [])
    for each in in_order:  # which grows by what follows each
        in_order += after.pop(each.get("ANNOTATION_ID"), [])
    return [*in_order, *(each for rest in after.values() for each in rest)]


def _read_captions(root: Element, where: str) -> LabelTier:
    """Return the lines of TTML or of YouTube's captions; spans with times are parts of them."""
    attributes = {name.rpartition("}")[2]: value for name, value in root.attrib.items()}
    multiplier = attributes.get("frameRateMultiplier", "1 1").replace(":", " ").split()
    try:
        counted = float(attributes.get("frameRate", "30"))
        frames = counted * float(multiplier[0]) / float(multiplier[-1])
        per_s = {"f": frames, "t": float(attributes.get("tickRate") or (frames if "frameRate" in attributes else 1))}
        if (attributes.get("timeBase"), attributes.get("dropMode", "nonDrop")) == ("smpte", "nonDrop"):
            per_s["clock"] = frames / counted  # whose seconds are so many frames, at 29.97 a second too
    except (ValueError, ZeroDivisionError, IndexError):
        per_s = {"f": 0.0, "t": 0.0}
    if not min(per_s.values()) > 0:
        raise InputError(f"{where}: its rate of frames or ticks is no number above 0")
    labels: list[TimedLabel] = []

    def visit(element: Element, start_s: float, end_s: float) -> float:
        start_s, end_s = _read_times(element, start_s, end_s, per_s, where)
        if element.tag not in ("p", "text"):
            reached_s, in_turn = [start_s], element.get("timeContainer") == "seq"
            for child in element:
                reached_s.append(visit(child, reached_s[-1] if in_turn else start_s, end_s))
            return max(reached_s)
        place = f"line {len(labels) + 1}"
        parts: list[TimedLabel] = []
        spans = [child for child in element.iter() if child is not element and {"begin", "t"} & child.attrib.keys()]
        ends_s = (_read_times(child, start_s, math.inf, per_s, where)[1] for child in spans)
        origin_s = 0.0 if any(end_s + NEAR_S < each < math.inf for each in ends_s) else start_s  # Apple's are absolute
        glued = False
        for child in element.iter():
            child.text = f"\n{child.text or ''}" if child.tag == "br" else child.text
            if child not in spans:
                continue
            text, times_s = "".join(child.itertext()), _read_times(child, origin_s, end_s, per_s, where)
            if glued and not text[:1].isspace():  # no blank between spans: syllables of one word
                text, times_s = parts[-1].text + text, (parts.pop().start_s, times_s[1])
            parts.append(TimedLabel(*times_s, text, place))
            glued = not f"{text}{child.tail or ''}"[-1:].isspace()
        content = "".join(element.itertext())
        same_words = "".join(content.split()) == "".join("".join(part.text for part in parts).split())
        labels.append(TimedLabel(start_s, end_s, content, place, tuple(parts) if same_words else ()))
        return end_s

    visit(root, 0.0, math.inf)
    return LabelTier("captions", tuple(labels), LINES)


def _read_times(
    element: Element, start_s: float, end_s: float, per_s: dict[str, float], where: str
) -> tuple[float, float]:
    """Return the start and the end of an element; times relative to its owner, or absolute if only so they fit."""
    stated = {name: element.get(name) for name in ("begin", "end", "dur", "start", "t", "d")}
    ms = {name: f"{stated[name]}ms" for name in ("t", "d") if stated[name]}
    texts = (stated["begin"] or stated["start"] or ms.get("t"), stated["end"], stated["dur"] or ms.get("d"))
    begin, end, duration = (None if text is None else _parse_seconds(text, per_s, where) for text in texts)
    from_s = start_s + (begin or 0.0)
    until_s = from_s + duration if duration is not None else start_s + end if end is not None else end_s
    absolute = begin is not None and end is not None and start_s <= begin + NEAR_S and end <= end_s + NEAR_S
    if begin is not None and end is not None and absolute and until_s > end_s + NEAR_S:
        return begin, end
    return from_s, until_s


def _parse_seconds(value: str, per_s: dict[str, float], where: str) -> float:
    """Return a time of TTML: a clock, also with frames, or a number with its unit. Raises InputError: another text."""
    share, offset = per_s.get("clock", 1), MARKS["OFFSET_TIME"].fullmatch(value.strip())
    clock_s = parse_clock(value, per_s.get("f", 0) / share) / share
    if not math.isnan(clock_s):
        return clock_s
    if offset is None:
        raise InputError(f"{where}: a time is {shorten(value)!r}, required as in 00:00:01.500, 1.5s or 36f")
    return float(offset[1]) / {"h": 1 / 3600, "m": 1 / 60, "ms": 1000, **per_s}.get(offset[2] or "s", 1)
