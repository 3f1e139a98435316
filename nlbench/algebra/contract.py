"""Index notation over component tensors: products, contractions and the thesis's N{...}, expanded at trace time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import reduce
from itertools import permutations, product

from nlbench.algebra.scalars import Scalar, add, is_known, multiply
from nlbench.algebra.tensor import Groups, Index, Tensor, canonical_indices, sort_within

# Each factor: its index letters, its tensor, and the place of the first operand that is that very tensor, by which
# factors are ordered: the same expression then is the same program, to the last bit, in every process.
Factors = tuple[tuple[str, Tensor, int], ...]


def einsum(subscripts: str, *operands: Tensor, sym: str = "", times: float = 1.0) -> Tensor:
    """Contract tensors as numpy.einsum does, forming unique and nonzero components only.

    subscripts: such as "ie,je->ij"; a letter stands once in the output, or twice among the operands.
    sym: output letters known to be exchangeable, such as "ij" (several groups: "ij,kl"). Symmetry that the expression
        shows by itself, as H_ia H_jb P_ab does in ij, needs no mention.
    times: a known factor of the result.
    """
    factors, output = _parse(subscripts, operands)
    symmetry = _declared(sym, output) if sym else _symmetry(factors, output)
    return _evaluate([factors], output, symmetry, times)


def placements(number: int, subscripts: str, *operands: Tensor, times: float = 1.0) -> Tensor:
    """N{...} `times` a factor: the sum over distinct placements of the output indices, fully symmetric.

    `number` is N, as the sources write it; `ValueError` if the expression has another number of distinct placements.
    placements(3, "ie,jke->ijk", F, S) is F_ie S_jke + F_je S_ike + F_ke S_ije.
    """
    factors, output = _parse(subscripts, operands)
    distinct = {_signature(placed, output): placed for placed in _permuted(factors, output)}
    if len(distinct) != number:
        raise ValueError(f"{number}{{{subscripts}}} has {len(distinct)} distinct placements")
    return _evaluate(list(distinct.values()), output, (tuple(range(len(output))),), times)


def _parse(subscripts: str, operands: Sequence[Tensor]) -> tuple[Factors, str]:
    left, output = subscripts.replace(" ", "").split("->")
    letters = left.split(",")
    if [len(word) for word in letters] != [len(operand.shape) for operand in operands]:
        raise ValueError(f"{subscripts} does not fit tensors of shapes {[o.shape for o in operands]}")
    places = [next(place for place, other in enumerate(operands) if other is operand) for operand in operands]
    return tuple(zip(letters, operands, places, strict=True)), output


def _permuted(factors: Factors, output: str) -> list[Factors]:
    """The expression under every permutation of its output letters."""
    return [_renamed(factors, dict(zip(output, order, strict=True))) for order in permutations(output)]


def _renamed(factors: Factors, names: dict[str, str]) -> Factors:
    return tuple(
        ("".join(names.get(letter, letter) for letter in word), tensor, place)
        for word, tensor, place in factors
    )


def _signature(factors: Factors, output: str) -> tuple:
    """Equal for expressions that are equal whatever their tensors hold: symmetry, order and dummy names taken out."""
    dummies = _contracted(factors, output)
    forms = (
        sorted((place, sort_within(tuple(word), X.symmetry)) for word, X, place in _renamed(factors, names))
        for names in (dict(zip(dummies, order, strict=True)) for order in permutations(dummies))
    )
    return tuple(min(forms))


def _contracted(factors: Factors, output: str) -> str:
    return "".join(dict.fromkeys(letter for word, *_ in factors for letter in word if letter not in output))


def _symmetry(factors: Factors, output: str) -> Groups:
    """Output positions that may be exchanged because the expression looks the same afterwards."""
    groups: list[list[int]] = []
    own = _signature(factors, output)
    for position, letter in enumerate(output):
        for group in groups:
            other = output[group[0]]
            if _signature(_renamed(factors, {letter: other, other: letter}), output) == own:
                group.append(position)
                break
        else:
            groups.append([position])
    return tuple(map(tuple, groups))


def _declared(sym: str, output: str) -> Groups:
    together = [tuple(output.index(letter) for letter in word) for word in sym.split(",")]
    alone = [(p,) for p in range(len(output)) if not any(p in group for group in together)]
    return tuple(sorted(together + alone))


def _evaluate(expressions: Sequence[Factors], output: str, symmetry: Groups, times: float) -> Tensor:
    extents = {
        letter: size
        for word, tensor, _ in expressions[0]
        for letter, size in zip(word, tensor.shape, strict=True)
    }
    shape = tuple(extents[letter] for letter in output)
    entries = {}
    for index in canonical_indices(shape, symmetry):
        monomials: Counter = Counter()
        for factors in expressions:
            _collect(
                factors,
                dict(zip(output, index, strict=True)),
                _contracted(factors, output),
                extents,
                monomials,
            )
        entries[index] = _sum(monomials, times, {place: tensor for _, tensor, place in expressions[0]})
    return Tensor(shape, symmetry, entries)


def _collect(
    factors: Factors, fixed: dict[str, int], dummies: str, extents: dict[str, int], into: Counter
) -> None:
    """Count the products of components that the expression sums, equal ones together."""
    for values in product(*(range(extents[letter]) for letter in dummies)):
        where = fixed | dict(zip(dummies, values, strict=True))
        monomial: list[tuple[int, Index]] = []
        for word, tensor, place in factors:
            index = tensor.canonical(tuple(where[letter] for letter in word))
            if index not in tensor.entries:
                break
            monomial.append((place, index))
        else:
            into[tuple(sorted(monomial))] += 1


def _sum(monomials: Counter, times: float, tensors: dict[int, Tensor]) -> Scalar:
    sums: dict[float, Scalar] = {}  # by known coefficient, so that each multiplies once
    for monomial, count in monomials.items():
        entries = [tensors[key].entries[index] for key, index in monomial]
        coefficient = reduce(multiply, filter(is_known, entries), times * count)
        unknown = reduce(multiply, (entry for entry in entries if not is_known(entry)), 1.0)
        sums[coefficient] = add(sums.get(coefficient, 0.0), unknown)
    return reduce(add, (multiply(coefficient, unknown) for coefficient, unknown in sums.items()), 0.0)
