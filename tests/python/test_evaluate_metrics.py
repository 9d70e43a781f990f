"""Metrics against cases made by hand."""

import math

import numpy as np
import pytest
from groundpose.lab.metrics import (
    angular_translation_error_deg,
    failed,
    rotation_error_deg,
    summarise,
    translation_error_percent,
    yaw_error_deg,
)


def turned(axis: int, degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    R = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[i, i], R[j, j], R[i, j], R[j, i] = c, c, -s, s
    return R


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("degrees", [0.01, 1.0, 45.0, 90.0, 179.0, 180.0])
def test_a_turn_about_an_axis_is_its_angle(axis: int, degrees: float) -> None:
    assert rotation_error_deg(np.eye(3), turned(axis, degrees)) == pytest.approx(degrees, abs=1e-5)


def test_equal_rotations_have_no_error_in_spite_of_rounding() -> None:
    R = turned(0, 33.0) @ turned(1, 71.0) @ turned(2, -12.0)
    assert rotation_error_deg(R * (1 + 1e-15), R) == pytest.approx(0.0, abs=1e-5)


def test_it_is_the_largest_column_angle_and_not_the_geodesic_one() -> None:
    R = turned(0, 10.0) @ turned(1, 10.0)
    columns = [math.degrees(math.acos(R[i, i])) for i in range(3)]
    geodesic = math.degrees(math.acos((np.trace(R) - 1) / 2))
    assert rotation_error_deg(np.eye(3), R) == pytest.approx(max(columns))
    assert max(columns) < geodesic


def test_rotations_broadcast_and_nan_stays_nan() -> None:
    R = np.stack([turned(1, 5.0), np.full((3, 3), np.nan)])
    error = rotation_error_deg(np.eye(3), R)
    assert error[0] == pytest.approx(5.0)
    assert np.isnan(error[1])


def test_translation_error_divides_by_the_estimate() -> None:
    assert translation_error_percent([0.0, 0.0, 10.0], [0.0, 0.0, 20.0]) == pytest.approx(50.0)
    assert translation_error_percent([0.0, 0.0, 20.0], [0.0, 0.0, 10.0]) == pytest.approx(100.0)
    assert translation_error_percent([0.0, 0.0, 20.0], [0.0, 0.0, 0.0]) == np.inf


def test_angular_translation_error_ignores_the_scale() -> None:
    assert angular_translation_error_deg([0.0, 0.0, 2.0], [0.0, 0.0, 9.0]) == 0.0
    assert angular_translation_error_deg([0.0, 0.0, 2.0], [0.0, 7.0, 7.0]) == pytest.approx(45.0)
    assert angular_translation_error_deg([0.0, 0.0, 2.0], [1e-9, 0.0, 1.0]) == pytest.approx(
        math.degrees(1e-9)
    )


def test_yaw_error_goes_round() -> None:
    yaw = np.radians([179.0, 90.0, 0.0])
    other = np.radians([-179.0, 450.0, 180.0])
    assert yaw_error_deg(yaw, other) == pytest.approx([2.0, 0.0, 180.0], abs=1e-9)


def test_a_failure_is_more_than_ten_of_either_or_no_answer() -> None:
    e_r, e_t = [10.0, 10.1, 0.0, np.nan], [10.0, 0.0, 10.1, np.nan]
    assert failed(e_r, e_t).tolist() == [False, True, True, True]


def test_no_answer_costs_as_much_as_the_worst_answer() -> None:
    summary = summarise([1.0, 2.0, 12.0, 20.0, np.nan], [1.0, 3.0, 1.0, 20.0, np.nan])
    assert summary.trials == 5
    assert summary.answered == pytest.approx(0.8)
    assert summary.mean_e_r_deg == pytest.approx((1 + 2 + 12 + 20 + 180) / 5)
    assert summary.median_e_r_deg == 12.0
    assert summary.mean_e_t_percent == pytest.approx((1 + 3 + 1 + 20 + 100) / 5)
    assert summary.failures == pytest.approx(0.6)
    assert summary.above_15_deg == pytest.approx(0.4)
    assert summary.mean_e_r_ok_deg == pytest.approx(1.5)
    assert summary.mean_e_t_ok_percent == pytest.approx(2.0)


def test_when_nothing_is_right_there_is_no_mean_of_the_right_ones() -> None:
    assert np.isnan(summarise([np.nan], [np.nan]).mean_e_r_ok_deg)


def test_no_trials_or_unequal_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="N > 0"):
        summarise([], [])
    with pytest.raises(ValueError, match="equal shapes"):
        summarise([1.0], [1.0, 2.0])
