"""Edits of generated motion: sentences that say what is changed, as values, and as a file."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any, get_type_hints

from lipmotion.errors import InputError, shorten
from lipmotion.types import FRAME_RATE_HZ, CurveEdit, DrawnCurve, Gain, Hold, Pin, SlopedPin, Span, Timeline, Unit
from lipmotion.types.delivery import Delivery, MoodKey, Staging, format_moods, parse_moods, sort_moods
from lipmotion.types.values import check_class, parse_number, parse_whole
from lipmotion.units import Pronunciation, is_silent, require_phone, split_words

MIN_PHONE_S = 0.01  # shortest phone that an edit may leave


class Text(str):
    """Several words of a sentence."""

    __slots__ = ()


_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
Numbers = tuple[float, ...]
_READ: dict[Any, tuple[str, Any]] = {
    int: (r"[0-9]+", parse_whole),
    float: (_NUMBER, parse_number),
    str: (r"\S+", str),
    Text: (r"\S.*?", lambda text: Text(" ".join(text.split()))),
    Numbers: (rf"{_NUMBER}(?:\s+{_NUMBER})*", lambda text: tuple(map(parse_number, text.split()))),
}
"""How the values of fields are written, and what reads them."""


@dataclass(frozen=True)
class Step:
    """An edit that one sentence states (``STEPS``). Raises InputError: a word that it spells out has no phones."""

    def __post_init__(self) -> None:
        for word, phones in self.spelled.items():
            if not phones:
                raise InputError(f"{str(self)!r}: {shorten(repr(word))} has no phones; required WORD PHONES, WORD …")
            if any(is_silent(_read_unit(phone).phone) for phone in phones):
                raise InputError(f"{str(self)!r}: a word has no silence in it; say two words")

    @property
    def stated(self) -> Any:
        """The value whose fields the sentence has."""
        return self

    @property
    def form(self) -> str:
        """The sentence, with the names of the fields."""
        forms = [form for form, kind in STEPS.items() if kind is type(self.stated)]
        return forms[-1 if getattr(self.stated, "channel", "") else 0]

    @property
    def spelled(self) -> dict[str, tuple[str, ...]]:
        """The phones of words that the sentence spells out, by word."""
        return {}

    @property
    def lexicon_entries(self) -> dict[str, tuple[Pronunciation, ...]]:
        """The same as a lexicon holds it."""
        return {word: (phones,) for text, phones in self.spelled.items() for word in split_words(text)}

    def __str__(self) -> str:
        return self.form.format(**{name: _written(value) for name, value in vars(self.stated).items()})


@lru_cache
def _read_form(form: str, kind: Any) -> tuple[re.Pattern[str], dict[str, Any]]:
    """Return the pattern of a kind of sentence, and what reads its values, by the names of the fields."""
    types, names = get_type_hints(kind), re.findall(r"{(\w+)}", form)
    pattern = re.sub(r"\\{(\w+)\\}", lambda name: f"({_READ[types[name[1]]][0]})", re.escape(form))
    return re.compile(pattern.replace(r"\ ", r"\s+"), re.IGNORECASE), {name: _READ[types[name]][1] for name in names}


def _written(value: object) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_written, value))
    return repr(value) if isinstance(value, float) else str(value)


class PhoneStep(Step):
    """An edit of the phones in time; they are numbered from 1, as they are after the edits before it."""

    @abstractmethod
    def apply(self, units: Timeline[Unit]) -> Timeline[Unit]:
        """Return the phones in time after the edit. Raises InputError: it is not possible."""

    def _index(self, units: Timeline[Unit], number: int) -> int:
        """Return the place of a phone. Raises InputError: there is none of that number."""
        if not 1 <= number <= len(units):
            raise InputError(f"{str(self)!r}: there is no phone {number}, required 1 to {len(units)}")
        return number - 1

    def _check_border(self, time_s: float, first_s: float, last_s: float) -> None:
        """Raise InputError unless two phones, from one time to another, may meet at a time between them."""
        if not first_s + MIN_PHONE_S - 1e-9 <= time_s <= last_s - MIN_PHONE_S + 1e-9:
            required = f"{first_s + MIN_PHONE_S:.3f} to {last_s - MIN_PHONE_S:.3f} s, between the phones beside it"
            raise InputError(f"{str(self)!r}: required {required}")


def _read_unit(phone: str, word: str = "") -> Unit:
    """Return the label of a phone that a user gives. Raises InputError: there is no such phone."""
    return Unit(require_phone(phone), word=word)


@dataclass(frozen=True)
class PhoneIs(PhoneStep):
    """Another phone is said in the same time."""

    number: int
    phone: str

    def apply(self, units: Timeline[Unit]) -> Timeline[Unit]:  # noqa: D102
        phone = units[self._index(units, self.number)]
        return with_span(units, [replace(phone, label=_read_unit(self.phone, phone.label.word))])


@dataclass(frozen=True)
class PhoneEnds(PhoneStep):
    """A phone ends at another time, and the one after it begins there."""

    number: int
    time_s: float

    def apply(self, units: Timeline[Unit]) -> Timeline[Unit]:  # noqa: D102
        return self._move_border(units, self._index(units, self.number))

    def _move_border(self, units: Timeline[Unit], before: int) -> Timeline[Unit]:
        """Return phones with another time between the phone at place ``before`` and the next one."""
        spans = list(units)
        if not 0 <= before < len(spans) - 1:
            end = "first phone begins" if before < 0 else "last phone ends"
            raise InputError(f"{str(self)!r}: the {end} with the recording")
        self._check_border(self.time_s, spans[before].start_s, spans[before + 1].end_s)
        for place, change in ((before, {"end_s": self.time_s}), (before + 1, {"start_s": self.time_s})):
            label = replace(spans[place].label, confidence=None)
            spans[place] = replace(spans[place], label=label, **change)
        return Timeline(tuple(spans))


@dataclass(frozen=True)
class PhoneBegins(PhoneEnds):
    """A phone begins at another time, and the one before it ends there."""

    def apply(self, units: Timeline[Unit]) -> Timeline[Unit]:  # noqa: D102
        return self._move_border(units, self._index(units, self.number) - 1)


@dataclass(frozen=True)
class PhoneRemoved(PhoneStep):
    """A phone is not said; the one before it, or else the one after it, takes its time."""

    number: int

    def apply(self, units: Timeline[Unit]) -> Timeline[Unit]:  # noqa: D102
        place = self._index(units, self.number)
        spans = list(units)
        if len(spans) == 1:
            raise InputError(f"{str(self)!r}: it is the only phone; say what it is: 'phone 1 is sil'")
        removed = spans.pop(place)
        change = {"end_s": removed.end_s} if place else {"start_s": removed.start_s}
        other = max(place - 1, 0)
        spans[other] = replace(spans[other], label=replace(spans[other].label, confidence=None), **change)
        return Timeline(tuple(spans))


@dataclass(frozen=True)
class PhoneInserted(PhoneStep):
    """A phone is said from one time to another; what was said there is cut, or gone."""

    phone: str
    start_s: float
    end_s: float

    def apply(self, units: Timeline[Unit]) -> Timeline[Unit]:  # noqa: D102
        last_s = units[-1].end_s if len(units) else 0.0
        if not (self.start_s >= 0 and self.start_s + MIN_PHONE_S - 1e-9 <= self.end_s <= last_s + 1e-9):
            raise InputError(f"{str(self)!r}: required at least {MIN_PHONE_S} s within 0 to {last_s:.3f} s")
        return with_span(units, [Span(self.start_s, min(self.end_s, last_s), _read_unit(self.phone))])


@dataclass(frozen=True)
class PhoneSplit(PhoneStep):
    """A phone becomes two of the same kind; either can then be another one."""

    number: int
    time_s: float

    def apply(self, units: Timeline[Unit]) -> Timeline[Unit]:  # noqa: D102
        phone = units[self._index(units, self.number)]
        self._check_border(self.time_s, phone.start_s, phone.end_s)
        label = replace(phone.label, confidence=None)
        return with_span(units, [Span(phone.start_s, self.time_s, label), Span(self.time_s, phone.end_s, label)])


def with_span(units: Timeline[Unit], spans: Sequence[Span[Unit]]) -> Timeline[Unit]:
    """Return phones in time with others in place of what was said from their start to their end."""
    start_s, end_s = spans[0].start_s, spans[-1].end_s
    before = [replace(span, end_s=min(span.end_s, start_s)) for span in units if span.start_s < start_s - 1e-9]
    after = [replace(span, start_s=max(span.start_s, end_s)) for span in units if span.end_s > end_s + 1e-9]
    return Timeline((*before, *spans, *after))


@dataclass(frozen=True)
class WordIs(Step):
    """Another word is said in the same time; words are numbered from 1. Its phones are aligned with the sound there."""

    number: int
    word: str


@dataclass(frozen=True)
class WordSaid(Step):
    """Another word is said in the same time, with these phones, which are aligned with the sound there."""

    number: int
    word: str
    phones: Text

    @property
    def spelled(self) -> dict[str, tuple[str, ...]]:  # noqa: D102
        return {self.word: tuple(self.phones.split())}


@dataclass(frozen=True)
class WordsSaid(Step):
    """Other words are said from one time to another; their phones are aligned with the sound there."""

    words: Text
    start_s: float
    end_s: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.start_s < self.end_s:
            raise InputError(f"{str(self)!r}: required an end after the start")


@dataclass(frozen=True)
class WordsSaidSo(WordsSaid):
    """Other words are said from one time to another, some of them with these phones: ``zoe z ow iy, qi k iy``."""

    pronunciations: Text

    @property
    def spelled(self) -> dict[str, tuple[str, ...]]:  # noqa: D102
        parts = (part.split() for part in self.pronunciations.split(","))
        return {word: tuple(phones) for word, *phones in filter(None, parts)}


WordStep = WordIs | WordSaid | WordsSaid  # edits of words, whose phones are aligned with the sound


@dataclass(frozen=True)
class CurveStep(Step):
    """An edit of values: a pin, a gain, what is drawn or held."""

    edit: CurveEdit | Hold

    @property
    def stated(self) -> CurveEdit | Hold:  # noqa: D102
        return self.edit

    @property
    def parts(self) -> tuple[CurveEdit | Hold, ...]:
        """The edit, or the pins that make up one with a slope."""
        return self.edit.pins if isinstance(self.edit, SlopedPin) else (self.edit,)


@dataclass(frozen=True)
class PinRemoved(Step):
    """The pins of a curve at a time hold no longer."""

    channel: str
    time_s: float


def remove_pins(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return edits without the pins that were taken out again. Raises InputError: there was none to take out."""
    left: list[Step] = []
    for step in steps:
        if not isinstance(step, PinRemoved):
            left.append(step)
            continue
        there = [
            each
            for each in left
            if isinstance(each, CurveStep) and isinstance(each.edit, Pin) and each.edit.channel == step.channel
            if abs(each.edit.time_s - step.time_s) < 0.5 / FRAME_RATE_HZ
        ]
        if not there:
            pins = [repr(str(each)) for each in left if str(each).startswith(f"pin {step.channel} ")]
            raise InputError(f"{str(step)!r}: not pinned there; pins of it: {'; '.join(pins) or 'none'}")
        left = [each for each in left if each not in there]
    return tuple(left)


@dataclass(frozen=True)
class LockStep(Step):
    """The motion in a span stays as it is with the edits before this one, whatever comes after."""

    start_s: float
    end_s: float

    def __post_init__(self) -> None:
        if not self.start_s < self.end_s:
            raise InputError(f"{str(self)!r}: required an end after the start")

    def holds(self, step: Step) -> bool:
        """Return whether a step changes values in the locked span: a pin, or all of another edit of values."""
        edit = step.stated
        if isinstance(edit, Pin | PinRemoved):
            return self.covers(edit.time_s, edit.time_s)
        return isinstance(step, CurveStep) and self.start_s <= edit.start_s and edit.end_s <= self.end_s

    def covers(self, start_s: float, end_s: float) -> bool:
        """Return whether some time lies in the locked span."""
        return start_s <= self.end_s - 1e-9 and end_s >= self.start_s + 1e-9


@dataclass(frozen=True)
class UnlockStep(Step):
    """A lock of the same times holds no longer, and holds nothing of what it held."""

    start_s: float
    end_s: float


def find_locks(steps: Sequence[Step]) -> dict[int, LockStep]:
    """Return the locks that hold after some edits, by their places among these.

    Raises InputError: what is taken out was not locked.
    """
    locks: dict[int, LockStep] = {}
    for place, step in enumerate(steps):
        if isinstance(step, LockStep):
            locks[place] = step
        elif isinstance(step, UnlockStep):
            same = [n for n, lock in locks.items() if (lock.start_s, lock.end_s) == (step.start_s, step.end_s)]
            if not same:
                locked = "; ".join(map(repr, map(str, locks.values()))) or "nothing"
                raise InputError(f"{str(step)!r}: not locked there; locked: {locked}")
            del locks[same[-1]]
    return locks


@dataclass(frozen=True)
class SetStep(Step):
    """How the motion is delivered, or how a drawn face is shown (docs/controls.md, docs/faces.md)."""

    name: str
    value: str

    def __post_init__(self) -> None:
        if self.name not in _KIND_OF:
            name, known = shorten(repr(self.name)), ", ".join(_KIND_OF)
            others = "the rest, as --fps, are options of animate and render"
            raise InputError(f"{str(self)!r}: nothing is called {name}; required one of: {known}; {others}")
        _KIND_OF[self.name](**{self.name: self.parsed_value})  # checks it

    @property
    def parsed_value(self) -> Any:
        """The value, of the type of what is set. Raises InputError: it is of another."""
        return _KIND_OF[self.name].values_of([f"{self.name}={self.value}"])[self.name]


@dataclass(frozen=True)
class MoodStep(Step):
    """The face goes over to a mood, and keeps it until the next one (docs/expression.md)."""

    mood: str
    time_s: float

    def __post_init__(self) -> None:
        self.key  # noqa: B018 # checks the values

    @property
    def key(self) -> MoodKey:
        """The mood, its strength, and its time. Raises InputError: as ``parse_moods``."""
        keys = parse_moods(f"{self.mood} at {self.time_s!r}")
        if len(keys) != 1:
            raise InputError(f"{str(self)!r}: required one mood, as happy:0.7")
        return keys[0]


_KIND_OF: dict[str, Any] = {each.name: kind for kind in (Delivery, Staging) for each in fields(kind)}

STEPS: dict[str, Any] = {
    "word {number} is {word}": WordIs,
    "word {number} is {word} said {phones}": WordSaid,
    "say {words} from {start_s} to {end_s}": WordsSaid,
    "say {words} from {start_s} to {end_s} with {pronunciations}": WordsSaidSo,
    "phone {number} is {phone}": PhoneIs,
    "phone {number} begins {time_s}": PhoneBegins,
    "phone {number} ends {time_s}": PhoneEnds,
    "split phone {number} at {time_s}": PhoneSplit,
    "remove phone {number}": PhoneRemoved,
    "insert {phone} from {start_s} to {end_s}": PhoneInserted,
    "pin {channel} {value} at {time_s}": Pin,
    "pin {channel} {value} at {time_s} slope {slope}": SlopedPin,
    "unpin {channel} at {time_s}": PinRemoved,
    "gain {factor} from {start_s} to {end_s}": Gain,
    "gain {channel} {factor} from {start_s} to {end_s}": Gain,
    "draw {channel} {values} from {start_s} to {end_s}": DrawnCurve,
    "hold from {start_s} to {end_s}": Hold,
    "lock from {start_s} to {end_s}": LockStep,
    "unlock from {start_s} to {end_s}": UnlockStep,
    "mood {mood} at {time_s}": MoodStep,
    "set {name} {value}": SetStep,
}
"""All sentences that state an edit, with the names of its fields, and what each makes."""
FORMS = tuple(re.sub(r"{(\w+?)(?:_s)?}", lambda name: name[1].upper(), form) for form in STEPS)
"""The sentences, for messages and help; times are in seconds."""


def parse_step(sentence: str) -> Step:
    """Return the edit that a sentence states. Raises InputError: it states none, or a value is not allowed.

    >>> parse_step("phone 12 ends 1.24")
    PhoneEnds(number=12, time_s=1.24)
    >>> str(parse_step("pin  jawOpen .2 at 1"))
    'pin jawOpen 0.2 at 1.0'
    """
    check_class(sentence, str, "edit", f"a sentence: {FORMS[0]!r}")
    for form, kind in STEPS.items():
        pattern, readers = _read_form(form, kind)
        if match := pattern.fullmatch(sentence.strip()):
            values = zip(readers.items(), match.groups(), strict=True)
            stated = kind(**{name: read(text) for (name, read), text in values})
            return stated if isinstance(stated, Step) else CurveStep(stated)
    first = sentence.lower().split()[:1]
    near = [form for form in FORMS if form.split()[:1] == first] or FORMS
    required = f"required {'one of: ' if len(near) > 1 else ''}{'; '.join(near)}"
    raise InputError(f"{shorten(repr(sentence))} is no edit; {required} (whole numbers, seconds as 1.24, one word)")


@dataclass(frozen=True)
class Edits:
    """What a user has changed of generated motion: a value; undoing is going back to an earlier one.

    steps : edits, in the order in which they were made

    >>> Edits().then("phone 2 is p", "pin opening 0.02 at 1.2").sentences
    ('phone 2 is p', 'pin opening 0.02 at 1.2')
    >>> Edits().then("set intensity 1.3").delivery(Delivery(anticipation_ms=40)).as_mapping()
    {'intensity': 1.3, 'anticipation_ms': 40, 'offset_ms': 0.0, 'min_hold_ms': 0.0, 'stepped': False}
    """

    steps: tuple[Step, ...] = ()

    def then(self, *edits: str | Step) -> Edits:
        """Return these edits and some more, sentences or values. Raises InputError: a sentence states no edit."""
        return Edits(self.steps + tuple(edit if isinstance(edit, Step) else parse_step(edit) for edit in edits))

    @property
    def sentences(self) -> tuple[str, ...]:
        """The steps as sentences."""
        return tuple(map(str, self.steps))

    def delivery(self, requested: Delivery = Delivery()) -> Delivery:  # noqa: B008 # a frozen value
        """Return how the motion is delivered; a requested value that is not the default wins over these edits."""
        delivery = replace(requested, **self._settings(requested, Delivery()))
        keys = sort_moods([*delivery.moods, *(step.key for step in self.steps if isinstance(step, MoodStep))])
        return replace(delivery, mood=format_moods(keys)) if keys != delivery.moods else delivery

    def staging(self, requested: Staging = Staging()) -> Staging:  # noqa: B008 # a frozen value
        """Return how a drawn face is shown; a requested value that is not the default wins over these edits."""
        return replace(requested, **self._settings(requested, Staging()))

    def _settings(self, requested: Delivery | Staging, default: Delivery | Staging) -> dict[str, Any]:
        """Return what these edits set of the fields whose requested value is the default, by name."""
        values = {step.name: step.parsed_value for step in self.steps if isinstance(step, SetStep)}
        names = [field.name for field in fields(default) if field.name in values]
        return {name: values[name] for name in names if getattr(requested, name) == getattr(default, name)}
