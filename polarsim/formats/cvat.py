"""The labels of a CVAT task, as its raw label editor takes them: without them CVAT drops rock ids at import."""

from __future__ import annotations

from typing import Any

from polarsim.photo import NO_ROCK


def label_list(colours: dict[str, str]) -> list[dict[str, Any]]:
    """Rectangles with the attributes of `coco`.

    Parameters
    ----------
    colours : kind -> "#rrggbb"
    """
    attributes = [
        _attribute("rock", "number", str(NO_ROCK), [str(NO_ROCK), "99999", "1"]),  # lowest, highest, step
        _attribute("confidence", "text", "1", []),
        _attribute("label_source", "text", "", []),
    ]
    return [
        {"name": kind, "color": colour, "type": "rectangle", "attributes": attributes}
        for kind, colour in colours.items()
    ]


def _attribute(name: str, input_type: str, default: str, values: list[str]) -> dict[str, Any]:
    return {
        "name": name,
        "input_type": input_type,
        "mutable": False,
        "default_value": default,
        "values": values or [default],
    }
