"""Claim: index notation over component tensors equals numpy.einsum over full arrays, at fewer components."""

from __future__ import annotations

from itertools import permutations, product

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nlbench.algebra import Tensor, einsum, identity, placements, zeros
from tests.oracle import outer, rng, symmetrise
from tests.oracle import placements as all_placements

LETTERS = "abcde"
SIZES = dict(zip(LETTERS, (2, 3, 2, 2, 3), strict=True))


def full(tensor):
    """The array by definition: every index looked up through its sorted representative, missing ones zero."""
    array = np.zeros(tensor.shape)
    for index in product(*map(range, tensor.shape)):
        key = list(index)
        for group in tensor.symmetry:
            for position, value in zip(group, sorted(index[p] for p in group), strict=True):
                key[position] = value
        array[index] = float(tensor.entries.get(tuple(key), 0.0))
    return array


@st.composite
def tensors(draw, word):
    """A tensor over the word's letters: symmetric or not, its entries missing, known or arrays."""
    shape = tuple(SIZES[letter] for letter in word)
    symmetry = tuple((p,) for p in range(len(word)))
    if len(set(shape)) == 1 and len(word) > 1 and draw(st.booleans()):
        symmetry = (tuple(range(len(word))),)
    entries = {}
    for index in product(*map(range, shape)):
        if all([index[p] for p in g] == sorted(index[p] for p in g) for g in symmetry):
            kind = draw(st.sampled_from(("missing", "zero", "one", "known", "array")))
            value = draw(st.integers(-3, 3)) + 0.5
            if kind != "missing":
                entries[index] = {"zero": 0.0, "one": 1.0, "known": value, "array": jnp.asarray(value)}[kind]
    return Tensor(shape, symmetry, entries)


@st.composite
def expressions(draw):
    words = draw(st.lists(st.text(LETTERS, min_size=1, max_size=3), min_size=1, max_size=3))
    letters = sorted(set("".join(words)))
    output = "".join(draw(st.permutations([c for c in letters if draw(st.booleans())])))
    operands = [draw(tensors(word)) for word in words]
    if len(words) > 1 and words[0] == words[1] and draw(st.booleans()):
        operands[1] = operands[0]
    return ",".join(words) + "->" + output, operands


@settings(max_examples=150, deadline=None, derandomize=True)
@given(expressions())
def test_einsum_equals_numpy_einsum(expression):
    subscripts, operands = expression
    result = einsum(subscripts, *operands)
    np.testing.assert_allclose(
        full(result), np.einsum(subscripts, *map(full, operands)), rtol=1e-12, atol=1e-12, err_msg=subscripts
    )


@settings(max_examples=40, deadline=None, derandomize=True)
@given(expressions())
def test_to_array_shows_every_component(expression):
    _, operands = expression
    np.testing.assert_array_equal(np.asarray(operands[0].to_array()), full(operands[0]))


def symmetric(seed, n, order):
    array = symmetrise(rng(seed).normal(size=(n,) * order))
    return Tensor.symmetric(n, order, lambda index: float(array[index])), array


def matrix(seed, n):
    array = rng(seed).normal(size=(n, n))
    return Tensor.from_array(array), array


@pytest.mark.parametrize("n", [1, 2, 3])
def test_placements_equal_explicit_permutation_sums(n):
    """The products that the equations sheet uses, each against the permutations written out."""
    p, p_ = symmetric(1, n, 2)
    s, s_ = symmetric(2, n, 3)
    k, k_ = symmetric(3, n, 4)
    d, d_ = symmetric(4, n, 1)
    q, q_ = symmetric(5, n, 2)
    cases = (
        (3, "ij,kl->ijkl", (p, p), (p_, p_)),
        (10, "ij,klm->ijklm", (p, s), (p_, s_)),
        (15, "ij,klmn->ijklmn", (p, k), (p_, k_)),
        (15, "ij,kl,mn->ijklmn", (p, p, p), (p_, p_, p_)),
        (10, "ijk,lmn->ijklmn", (s, s), (s_, s_)),
        (3, "i,jk->ijk", (d, p), (d_, p_)),
        (4, "i,jkl->ijkl", (d, s), (d_, s_)),
        (6, "i,j,kl->ijkl", (d, d, p), (d_, d_, p_)),
        (6, "ij,kl->ijkl", (p, q), (p_, q_)),
        (1, "i,j,k->ijk", (d, d, d), (d_, d_, d_)),
    )
    for number, subscripts, operands, arrays in cases:
        if n == 3 and len(subscripts) > 16:
            continue
        result = placements(number, subscripts, *operands)
        np.testing.assert_allclose(
            full(result), all_placements(number, *arrays), atol=1e-12, err_msg=subscripts
        )


def distinct_sum(array_of, letters):
    """Sum over all orders of the output letters, divided by how often each distinct placement occurs."""
    return sum(array_of(dict(zip(letters, order, strict=True))) for order in permutations(letters))


def test_placements_of_contractions_equal_the_terms_of_the_moment_equations():
    n = 2
    f, f_ = matrix(1, n)
    p, p_ = symmetric(2, n, 2)
    s, s_ = symmetric(3, n, 3)
    mu4, mu4_ = symmetric(4, n, 4)
    a_ = rng(5).normal(size=(n, n, n))
    a_ = (a_ + a_.transpose(0, 2, 1)) / 2
    a = Tensor.from_array(a_, ((0,), (1, 2)))
    fp = np.einsum("ie,je->ij", f_, p_)
    fs = np.einsum("ie,jke->ijk", f_, s_)
    am = np.einsum("ief,jkef->ijk", a_, mu4_)
    app = np.einsum("ief,je,kf->ijk", a_, p_, p_)
    np.testing.assert_allclose(full(placements(2, "ie,je->ij", f, p)), fp + fp.T, atol=1e-13)
    for tensor, array in (
        (placements(3, "ie,jke->ijk", f, s), fs),
        (placements(3, "ief,jkef->ijk", a, mu4), am),
    ):
        expected = array + array.transpose(1, 0, 2) + array.transpose(1, 2, 0)
        np.testing.assert_allclose(full(tensor), expected, atol=1e-13)
    expected = app + app.transpose(1, 0, 2) + app.transpose(1, 2, 0)
    np.testing.assert_allclose(full(placements(3, "ief,je,kf->ijk", a, p, p)), expected, atol=1e-13)


def test_a_wrong_number_of_placements_is_refused():
    p, _ = symmetric(1, 2, 2)
    with pytest.raises(ValueError, match="3 distinct placements"):
        placements(6, "ij,kl->ijkl", p, p)


def test_shapes_that_do_not_fit_are_refused():
    p, _ = symmetric(1, 2, 2)
    with pytest.raises(ValueError, match="does not fit"):
        einsum("ijk->i", p)


def test_structural_zeros_stay_structural():
    sparse = Tensor((2, 2), ((0,), (1,)), {(0, 1): jnp.asarray(2.0)})
    vector = Tensor((2,), ((0,),), {(0,): jnp.asarray(3.0)})
    assert einsum("ij,j->i", sparse, vector).entries == {}
    assert set(einsum("ij,i->j", sparse, vector).entries) == {(1,)}
    assert einsum("ij,j->i", sparse, zeros(2, 1)).entries == {}


def test_only_unique_components_are_formed():
    p, _ = symmetric(1, 3, 2)
    h, h_ = matrix(2, 3)
    hph = einsum("ia,jb,ab->ij", h, h, p)
    assert len(hph.entries) == 6
    assert len(placements(3, "ij,kl->ijkl", p, p).entries) == 15
    declared = einsum("ij,jk->ik", Tensor.from_array(h_ @ h_.T), Tensor.from_array(np.eye(3)), sym="ik")
    np.testing.assert_allclose(full(declared), h_ @ h_.T, atol=1e-13)
    assert len(declared.entries) == 6


def test_constants_stay_python_floats():
    h, _ = matrix(2, 3)
    product_ = einsum("ij,jk->ik", h, identity(3))
    assert product_.entries
    assert all(type(entry) is float for entry in product_.entries.values())


def test_a_structural_zero_wins_over_nan():
    sparse = Tensor((1, 1), ((0, 1),), {})
    nan = Tensor((1,), ((0,),), {(0,): jnp.asarray(jnp.nan)})
    assert einsum("ij,j->i", sparse, nan).entries == {}


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.data())
def test_sums_differences_and_multiples_equal_those_of_arrays(data):
    """Also between tensors of different symmetry, whose sum has only the symmetry of both."""
    word = data.draw(st.sampled_from(["a", "aa", "aaa"]))
    x, y = data.draw(tensors(word)), data.draw(tensors(word))
    np.testing.assert_allclose(full(x + y), full(x) + full(y), atol=1e-13)
    np.testing.assert_allclose(full(x - y), full(x) - full(y), atol=1e-13)
    np.testing.assert_allclose(full(-2.5 * x), -2.5 * full(x), atol=1e-13)
    np.testing.assert_allclose(full(x * jnp.asarray(0.0)), 0 * full(x), atol=0)


def test_outer_products_of_one_vector_are_fully_symmetric():
    d, d_ = symmetric(1, 3, 1)
    cube = einsum("i,j,k->ijk", d, d, d)
    assert len(cube.entries) == 10
    np.testing.assert_allclose(full(cube), outer(d_, d_, d_), atol=1e-14)
