"""Wording of messages."""


def counted(number: int, noun: str) -> str:
    """Return a number and a noun that is plural unless the number is one, such as `1 rock` and `0 rocks`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
