"""Linear algebra in one order of operations: right, and in that order."""

import math

import casadi as ca
import numpy as np
import pytest

from asvhil.dynamics.ordered import SingularMatrix, product, solve, symmetric, total

RNG = np.random.default_rng(7)


@pytest.mark.parametrize(("m", "k", "n"), [(1, 1, 1), (3, 7, 2), (6, 8, 40), (40, 120, 40)])
def test_products_are_those_of_blas_to_rounding(m: int, k: int, n: int) -> None:
    a, b = RNG.normal(size=(m, k)), RNG.normal(size=(k, n))
    assert np.allclose(product(a, b), a @ b, rtol=0.0, atol=1e-13 * k)
    assert np.allclose(product(a, b[:, 0]), a @ b[:, 0], rtol=0.0, atol=1e-13 * k)


def test_the_terms_of_a_product_are_added_one_after_the_other() -> None:
    a, b = RNG.normal(size=(4, 33)) * 10.0 ** RNG.integers(-8, 8, (4, 33)), RNG.normal(size=(33, 3))
    by_hand = [[total(a[i, k] * b[k, j] for k in range(33)) for j in range(3)] for i in range(4)]
    assert product(a, b).tolist() == by_hand


def test_a_sum_is_not_compensated() -> None:
    values = [1e16, 1.0, -1e16] * 3
    assert total(values) == 0.0
    assert math.fsum(values) == 3.0


@pytest.mark.parametrize("n", [1, 2, 7, 40])
def test_solutions_are_those_of_lapack_to_rounding(n: int) -> None:
    a, b = RNG.normal(size=(n, n)), RNG.normal(size=(n, 3))
    assert np.allclose(solve(a, b), np.linalg.solve(a, b), rtol=1e-9, atol=1e-9)
    assert np.allclose(solve(a, b[:, 0]), np.linalg.solve(a, b[:, 0]), rtol=1e-9, atol=1e-9)


def test_a_row_is_exchanged_where_its_pivot_is_zero() -> None:
    assert solve(np.array([[0.0, 2.0], [4.0, 1.0]]), np.array([6.0, 7.0])).tolist() == [1.0, 3.0]


@pytest.mark.parametrize("a", [np.zeros((2, 2)), np.ones((2, 2)), np.full((2, 2), np.nan)])
def test_a_matrix_without_inverse_is_refused(a: np.ndarray) -> None:
    with pytest.raises(SingularMatrix):
        solve(a, np.ones(2))


def test_arguments_are_left_as_they_are() -> None:
    a, b = RNG.normal(size=(3, 3)), RNG.normal(size=(3, 1))
    kept = a.copy(), b.copy()
    solve(a, b)
    assert np.array_equal(a, kept[0]) and np.array_equal(b, kept[1])


def test_the_upper_triangle_is_not_read() -> None:
    p = ca.SX.sym("p", 3, 3)
    mirror = ca.Function("mirror", [p], [symmetric(p)])
    values = np.array([[1.0, np.nan, np.nan], [2.0, 3.0, np.nan], [4.0, 5.0, 6.0]])
    assert np.array(mirror(values)).tolist() == [[1.0, 2.0, 4.0], [2.0, 3.0, 5.0], [4.0, 5.0, 6.0]]
