"""Regions and ages: tables that are whole, sizes that differ, the mean of the world's cars."""

import numpy as np
import pytest
from groundpose.lab.bodies import STYLES, catalogue, regions
from groundpose.lab.bodies.catalogue import outline, region_of, style_of
from groundpose.lab.bodies.dimensions import draw_dimensions, random_stream
from groundpose.vehicles import CLASSES

SEEDS = range(600)


@pytest.mark.parametrize("class_name", CLASSES)
def test_fractions_of_styles_add_up(class_name: str) -> None:
    fractions = regions.style_fractions(class_name)
    assert len(fractions) == len(STYLES[class_name])
    assert sum(fractions) == pytest.approx(1.0)
    assert min(fractions) > 0.01
    drawn = [style_of(class_name, seed) for seed in SEEDS]
    for style, fraction in zip(STYLES[class_name], fractions, strict=True):
        assert drawn.count(style) / len(drawn) == pytest.approx(fraction, abs=0.06)


def test_names_of_all_styles_are_unique() -> None:
    names = tuple(style for name in CLASSES for style in STYLES[name])
    assert names == catalogue.STYLE_NAMES
    assert len(set(catalogue.STYLE_NAMES)) == len(catalogue.STYLE_NAMES)


def test_the_region_is_that_of_the_measures() -> None:
    for class_name in CLASSES:
        for seed in range(20):
            style = style_of(class_name, seed)
            drawn = draw_dimensions(class_name, style, random_stream(class_name, style, seed))
            assert drawn.region == region_of(class_name, seed)
            assert drawn.region in regions.REGIONS
    assert {region_of("car", seed, "kei_car") for seed in range(20)} == {"japan"}


def test_sizes_of_the_worlds_cars() -> None:
    boxes = np.stack([outline("car", seed)[1] for seed in SEEDS])
    width, height, length = (boxes[:, 1] - boxes[:, 0]).T
    assert length.mean() == pytest.approx(4.22, abs=0.06)
    assert height.mean() == pytest.approx(1.545, abs=0.02)
    assert width.mean() == pytest.approx(1.75, abs=0.02)
    assert length.min() < 3.45
    assert length.max() > 5.1
    where = np.array([region_of("car", seed) for seed in SEEDS])
    assert length[where == "north_america"].mean() > length[where == "europe"].mean() + 0.3
    assert width[where == "japan"].mean() < width[where == "europe"].mean() - 0.05


def test_old_cars_are_smaller() -> None:
    drawn = [draw_dimensions("car", "hatchback", random_stream("car", "hatchback", seed)) for seed in SEEDS]
    age, sizes = np.array([d.age for d in drawn]), np.array([(d.length, d.height, d.width) for d in drawn])
    grown = sizes[age > 0.7].mean(axis=0) - sizes[age < 0.4].mean(axis=0)
    assert np.all(grown > [0.05, 0.01, 0.03])
