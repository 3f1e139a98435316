"""Arithmetic that writes itself down as straight-line C: zeros vanish, equal terms are formed once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Union

Number = Union["Value", float]


@dataclass(frozen=True)
class Value:
    """A variable of the C text, perhaps with a minus sign, which costs nothing until it is written out."""

    trace: Trace
    name: str
    negative: bool = False

    def __neg__(self) -> Value:
        return replace(self, negative=not self.negative)

    def __add__(self, other: Number) -> Number:
        return self.trace.sum(self, other)

    def __radd__(self, other: float) -> Number:
        return self.trace.sum(self, other)

    def __sub__(self, other: Number) -> Number:
        return self.trace.sum(self, -other)

    def __rsub__(self, other: float) -> Number:
        return self.trace.sum(-self, other)

    def __mul__(self, other: Number) -> Number:
        return self.trace.product(self, other)

    def __rmul__(self, other: float) -> Number:
        return self.trace.product(self, other)


class Trace:
    """The C statements of one function's body, and how many operations they are."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.operations = 0
        self._formed: dict[str, str] = {}

    def variable(self, name: str) -> Value:
        """Something that the C text around it defines."""
        return Value(self, name)

    def sum(self, a: Value, b: Number) -> Number:
        """a + b."""
        if not isinstance(b, Value):
            return a if b == 0.0 else self._form(f"{b!r} {'-' if a.negative else '+'} {a.name}")
        if a.negative and b.negative:
            return -self.sum(-a, -b)
        if a.negative or b.negative:
            plus, minus = (b, a) if a.negative else (a, b)
            return self._form(f"{plus.name} - {minus.name}")
        return self._form(" + ".join(sorted((a.name, b.name))))

    def product(self, a: Value, b: Number) -> Number:
        """a b."""
        if isinstance(b, Value):
            formed = self._form(" * ".join(sorted((a.name, b.name))))
            return -formed if a.negative != b.negative else formed
        if b in (0.0, 1.0):
            return a if b else 0.0
        if b < 0.0:
            return -self.product(a, -b)
        formed = self._form(f"{b!r} * {a.name}")
        return -formed if a.negative else formed

    def quotient(self, a: float, b: Number) -> Number:
        """a / b, counted as one operation."""
        if not isinstance(b, Value):
            return a / b
        formed = self._form(f"{a!r} / {b.name}")
        return -formed if b.negative else formed

    def call(self, function: str, *arguments: Number, operations: int) -> Value:
        """A function of vectors, told how many operations it is."""
        return self._form(f"{function}({', '.join(map(written, arguments))})", operations)

    def write(self, line: str) -> None:
        """A statement as it is."""
        self.lines.append(line)

    def _form(self, expression: str, operations: int = 1) -> Value:
        if expression not in self._formed:
            self._formed[expression] = name = f"v{len(self._formed)}"
            self.lines.append(f"const real {name} = {expression};")
            self.operations += operations
        return Value(self, self._formed[expression])


def written(value: Number) -> str:
    """As a C expression."""
    if isinstance(value, Value):
        return f"-{value.name}" if value.negative else value.name
    return f"all({value!r})"
