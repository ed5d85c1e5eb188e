"""Fields in the paths of photos: which parts of the names state terrain, position, lamp, camera and exposure.

Paths are split into folders, and names with equal separators into words. Words that vary are assigned to fields by
their values; words that are unknown or determined by other words become `{any}`.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain, count, takewhile

from polarsim.photo import NO_SUN, terrain_text
from polarsim.wording import counted

_SEPARATORS = re.compile(r"([_\-. ]+)")
_MAX_NAMES = 80  # of a field; words with more values are counters or time stamps
_MAX_EXPOSURES = 40
_COUNTER_SHARE, _FEW = 0.45, 4  # a counter has more values than this share of the photos
_COUNTER_DIGITS = 4  # minimum number of digits of a counter with few values, as in the DCF standard of cameras
_FIELDS = ("terrain", "position", "azimuth", "light", "camera", "exposure_ms")
_EXAMPLE = "scene1/north/lamp45/L_0040.jpg"
_MIN_ANGLE = 30  # of the largest azimuth in names that are not marked as lamps, degrees
_CAMERAS = [("l", "r"), ("left", "right"), ("port", "starboard")]
_NUMBERED_CAMERAS = [("0", "1"), ("1", "2")]
_DARK = re.compile(r"(?i)no|none|dark|off|unlit|no-?(sun|lamp|light)s?")
_OF_LIGHT = re.compile(r"(?i)(head(light|lamp)?|flash|led|rig|rover)-?\Z")
_OF_LAMP = re.compile(r"(?i)sun|lamp|light|az|illum")
_OF_POSITION = re.compile(r"(?i)pos|station|tripod|stop|stand")
_OF_EXPOSURE = re.compile(r"(?i)ms|exp|expo|exposure|t")


@dataclass
class _Word:
    """A word of the names: its text in each file, without the text that all files have in common."""

    texts: list[str]
    before: str = ""
    after: str = ""
    folder: int = 0  # number of the path's folder, -1 for the file
    named: str = ""  # field

    @property
    def values(self) -> list[str]:
        return sorted(set(self.texts))


@dataclass(frozen=True)
class PathFields:
    """Pattern of the paths of photos, and the text of each name of a field."""

    pattern: str
    names: dict[str, dict[str, str]]  # field -> name -> text in paths
    exposures_ms: dict[str, list[int]]  # azimuth -> exposures
    notes: list[str] = field(default_factory=list)

    @property
    def are_stated(self) -> bool:
        """Whether the paths state any field, or there is a single photo."""
        return bool(self.names or self.exposures_ms) or "{any}" not in self.pattern


def find_fields(paths: Sequence[str]) -> PathFields:
    """Return the fields of paths with equal numbers of folders and equal suffix."""
    columns = list(zip(*(path.split("/") for path in paths), strict=True))
    layout: list[str | _Word] = []
    for number, texts in enumerate(columns):
        if number:
            layout.append("/")
        layout += _words(list(texts), -1 if number == len(columns) - 1 else number)
    notes = [*_assign(layout), *_repeated_keys(layout, paths)]
    words = [part for part in layout if isinstance(part, _Word)]
    names = {word.named: _names(word) for word in words if word.named not in ("", "any", "exposure_ms")}
    pattern = "".join(part if isinstance(part, str) else _written(part) for part in layout)
    return PathFields(pattern, names, _exposures(words, names), notes)


def _repeated_keys(layout: Sequence[str | _Word], paths: Sequence[str]) -> list[str]:
    """Return a note if photos have the same text in all fields, so that no pattern can distinguish them."""
    named = {part.named: part for part in layout if isinstance(part, _Word) and part.named != "any"}
    paths_of_key: dict[tuple[str, ...], list[str]] = {}
    for number, path in enumerate(paths):
        paths_of_key.setdefault(tuple(word.texts[number] for word in named.values()), []).append(path)
    if len(paths_of_key) == len(paths):
        return []
    first, second, *_ = next(same for same in paths_of_key.values() if len(same) > 1)
    missing = ", ".join(name for name in _FIELDS if name not in named)
    return [
        f"{len(paths)} photos have {counted(len(paths_of_key), 'different key')}: {first} and {second} have the same "
        f"{' and '.join(named) or 'path without numbers'}. Write the missing fields in which they differ ({missing}) "
        f"into folders or names, such as {_EXAMPLE}, and repeat new-site"
    ]


def _words(texts: list[str], folder: int) -> list[str | _Word]:
    """Return the constant texts and the varying words of a folder or file."""
    if len(set(texts)) == 1:
        return [texts[0]]
    ending = ""
    if folder == -1:  # the suffix is not a word
        endings = {text[text.rfind(".") :].lower() for text in texts}
        ending = endings.pop()
        texts = [text[: len(text) - len(ending)] for text in texts]
    parts = [_SEPARATORS.split(text) for text in texts]
    if len({tuple(part[1::2]) for part in parts}) > 1:
        parts = [[text] for text in texts]
    layout: list[str | _Word] = []
    for column in zip(*parts, strict=True):
        layout += [column[0]] if len(set(column)) == 1 else _stripped(list(column), folder)
    return [*layout, *([ending] if ending else [])]


def _stripped(texts: list[str], folder: int) -> list[str | _Word]:
    """Return a word between the letters that all texts have in common: `sun45` and `sun135` vary in the number."""
    before = re.sub(r"\d+\Z", "", _common_start(texts))
    while before and any(not re.match(r"[A-Z0-9]|(?i:on|off|left|right|l|r)\Z", text[len(before) :]) for text in texts):
        before = before[:-1]
    rest = [text[len(before) :] for text in texts]
    after = re.sub(r"\A\d+", "", _common_start([text[::-1] for text in rest])[::-1])  # 10ms and 40ms share `0ms`
    after = after if after.isalpha() and all(text[: len(text) - len(after)].isdigit() for text in rest) else ""
    return [before, _Word([text[: len(text) - len(after)] for text in rest], before, after, folder), after]


def _common_start(texts: Sequence[str]) -> str:
    shortest = min(map(len, texts))
    same = (len({text[:count] for text in texts}) == 1 for count in range(1, shortest + 1))
    return texts[0][: sum(1 for _ in takewhile(bool, same))]


def _assign(layout: list[str | _Word]) -> list[str]:
    """Name the field of each word; return notes about words that were not understood.

    A further folder after the position is part of the position.
    """
    words = [part for part in layout if isinstance(part, _Word)]
    for word in words:
        if len(word.values) > min(_MAX_NAMES, max(_COUNTER_SHARE * len(word.texts), _FEW)) or _is_counter(word):
            word.named = "any"
    for number, word in enumerate(words):
        if not word.named and any(not other.named and _determines(other, word) for other in words[:number]):
            word.named = "any"
    free = [word for word in words if not word.named]
    _take(free, "camera", _is_camera)
    _take(free, "light", _is_light)
    of_files = [word for word in free if _is_exposure(word)]
    stated = [word for word in of_files if _OF_EXPOSURE.fullmatch(word.after or word.before)]
    if of_files:
        (stated or of_files)[-1].named = "exposure_ms"
    _take(free, "azimuth", _is_lamp)
    rest = [word for word in free if not word.named]
    if len(rest) > 1 or (rest and not _OF_POSITION.search(rest[0].before)):
        rest.pop(0).named = "terrain"
    if rest and not any(word.named == "azimuth" for word in words):
        angles = [word for word in rest[1:] if _is_angle(word)]
        if angles:
            angles[0].named = "azimuth"
            rest.remove(angles[0])
    if rest:
        position = rest.pop(0)
        position.named = "position"
        while rest and _joined(layout, position, rest[0]):
            rest.pop(0)
    for word in rest:
        word.named = "any"
    return [
        f"the part {'/'.join(word.values[:3])} of the names was not understood: several photos may have the same key"
        for word in rest
    ]


def _is_counter(word: _Word) -> bool:
    """Return whether a word has consecutive numbers of several digits, one per file, as cameras name their files."""
    if word.folder != -1 or not all(text.isdecimal() and len(text) >= _COUNTER_DIGITS for text in word.texts):
        return False
    numbers = sorted(map(int, word.texts))
    return numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def _joined(layout: list[str | _Word], first: _Word, second: _Word) -> bool:
    """Append the second word to the first, with the texts between both; False if there is another word between."""
    start, end = (next(n for n, part in enumerate(layout) if part is word) for word in (first, second))
    between = layout[start + 1 : end]
    if any(isinstance(part, _Word) for part in between):
        return False
    middle = "".join(map(str, between))
    first.texts = [one + middle + other for one, other in zip(first.texts, second.texts, strict=True)]
    del layout[start + 1 : end + 1]
    return True


def _take(words: list[_Word], name: str, matches: Callable[[_Word], bool]) -> None:
    """Name the last word that matches."""
    found = [word for word in words if not word.named and matches(word)]
    if found:
        found[-1].named = name


def _determines(first: _Word, second: _Word) -> bool:
    """Return whether the text of the first word determines that of the second."""
    return len(set(zip(first.texts, second.texts, strict=True))) == len(set(first.texts))


def _is_camera(word: _Word) -> bool:
    pair = tuple(text.lower() for text in word.values)
    return pair in _CAMERAS or (pair in _NUMBERED_CAMERAS and word.before.lower().endswith(("cam", "camera")))


def _is_light(word: _Word) -> bool:
    values = {text.lower() for text in word.values}
    return values == {"on", "off"} or (values == {"0", "1"} and bool(_OF_LIGHT.search(word.before)))


def _is_exposure(word: _Word) -> bool:
    return (
        not word.named and word.folder == -1 and len(word.values) <= _MAX_EXPOSURES and all(map(_positive, word.values))
    )


def _positive(text: str) -> bool:
    return text.isdecimal() and int(text) > 0


def _is_angle(word: _Word) -> bool:
    numbers = [int(text) for text in word.values if text.isdecimal()]
    return len(numbers) == len(word.values) and _MIN_ANGLE <= max(numbers) <= 360


def _is_lamp(word: _Word) -> bool:
    return bool(_OF_LAMP.search(word.before)) or any(
        _DARK.fullmatch(text) or _OF_LAMP.match(text) for text in word.values
    )


def _names(word: _Word) -> dict[str, str]:
    """Return the text of each name of a field."""
    if word.named == "camera":
        return dict(zip("LR", word.values, strict=True))
    if word.named == "light":
        return {{"0": "off", "1": "on"}.get(text, text.lower()): text for text in word.values}
    plain = {text: plain_name(text) for text in word.values}
    chosen = {text: _key_name(word, text, name) for text, name in plain.items()}
    if len(set(chosen.values())) < len(chosen):  # two texts with the same number
        chosen = plain
    names: dict[str, str] = {}
    for text, name in chosen.items():
        candidates = chain([name], (f"{name}-{number}" for number in count(2)))
        names[next(candidate for candidate in candidates if candidate not in names)] = text
    return names


def plain_name(text: str, default: str = "x") -> str:
    """Return a text as a name: letters without accents, digits, and hyphens for all else; a default without letters."""
    letters = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9-]+", "-", letters).strip("-") or default


def _key_name(word: _Word, text: str, name: str) -> str:
    """Return the name of a text, whose plain name is `name`: lamps and terrains with numbers are named by them."""
    if word.named == "azimuth":
        digits = re.findall(r"\d+", text)
        return NO_SUN if _DARK.fullmatch(text) else str(int(digits[0])) if len(digits) == 1 else name
    if word.named == "terrain" and all(value.isdecimal() for value in word.values):
        return terrain_text(int(text))
    return name


def _exposures(words: list[_Word], names: dict[str, dict[str, str]]) -> dict[str, list[int]]:
    """Return the exposures of each azimuth; without azimuths those of all photos."""
    times = next((word for word in words if word.named == "exposure_ms"), None)
    lamps = next((word for word in words if word.named == "azimuth"), None)
    if times is None:
        return {}
    if lamps is None:
        return {"": sorted({int(text) for text in times.texts})}
    name_of = {text: name for name, text in names["azimuth"].items()}
    pairs = {(name_of[lamp], int(time)) for lamp, time in zip(lamps.texts, times.texts, strict=True)}
    return {name: sorted(time for of, time in pairs if of == name) for name in names["azimuth"]}


def _written(word: _Word) -> str:
    lengths = {len(text) for text in word.texts}
    padded = word.named == "exposure_ms" and len(lengths) == 1 and any(text.startswith("0") for text in word.texts)
    return f"{{{word.named}{f':{lengths.pop()}' if padded else ''}}}"


def largest_group(paths: Iterable[str]) -> list[str]:
    """Return the paths with the most frequent suffix and number of folders."""
    groups = Counter((path[path.rfind(".") :].lower(), path.count("/")) for path in paths)
    if not groups:
        return []
    suffix, folders = groups.most_common(1)[0][0]
    return [path for path in paths if path.lower().endswith(suffix) and path.count("/") == folders]
