"""Overlap of boxes and average precision against independent implementations."""

from dataclasses import replace

import numpy as np
import pytest
from groundpose.formats.kitti.labels import KittiLabel
from groundpose.lab.evaluate.kitti.average_precision import MEASURES, Hits, Overlaps, average_precision, judge
from groundpose.lab.evaluate.kitti.official import Case, official_precision, thresholds
from groundpose.lab.evaluate.kitti.overlap import Boxes, image_overlap, intersection_areas, space_overlaps


def clip(polygon: list, outline: np.ndarray) -> list:
    """Sutherland and Hodgman, one polygon at a time."""
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        edge = b - a
        side = [edge[0] * (p[1] - a[1]) - edge[1] * (p[0] - a[0]) for p in polygon]
        out = []
        for k, p in enumerate(polygon):
            q, sp, sq = polygon[k - 1], side[k], side[k - 1]
            if (sp >= 0) != (sq >= 0):
                out.append(q + (p - q) * sq / (sq - sp))
            if sp >= 0:
                out.append(p)
        polygon = out
    return polygon


def signed(polygon: list) -> float:
    x, y = np.array(polygon).T
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


def area(polygon: list) -> float:
    return abs(signed(polygon)) if len(polygon) > 2 else 0.0


def random_boxes(n: int, seed: int, spread: float = 3.0) -> Boxes:
    rng = np.random.default_rng(seed)
    size = np.array([1.5, 1.7, 4.0]) * rng.uniform(0.7, 1.4, (n, 3))
    return Boxes(size, rng.normal(0, spread, (n, 3)) * [1, 0.2, 1] + [0, 0, 30], rng.uniform(-7, 7, n))


def test_areas_are_those_of_clipping():
    a, b = random_boxes(60, 0, 1.0), random_boxes(60, 1, 1.0)
    A, B = a.corners(), b.corners()
    assert signed(B[0]) < 0.0
    turned = B[:, ::-1]  # clipping wants the other order
    expected = [area(clip(list(p), q)) for p, q in zip(A, turned, strict=True)]
    assert np.count_nonzero(expected) > 20
    np.testing.assert_allclose(intersection_areas(A, B), expected, atol=1e-9)


def test_overlap_of_known_boxes():
    def box(x=0.0, y=0.0, z=0.0, turn=0.0, size=(1.0, 2.0, 2.0)):
        return Boxes(np.array([size]), np.array([[x, y, z]]), np.array([turn]))

    def both(a, b):
        above, space = space_overlaps(a, b)
        return float(above[0, 0]), float(space[0, 0])

    assert both(box(), box()) == pytest.approx((1.0, 1.0))
    assert both(box(), box(turn=np.pi / 2)) == pytest.approx((1.0, 1.0))  # a square
    octagon = 4.0 * (2.0 * np.sqrt(2.0) - 2.0)
    assert both(box(), box(turn=np.pi / 4))[0] == pytest.approx(octagon / (8.0 - octagon))
    assert both(box(), box(x=1.0)) == pytest.approx((1 / 3, 1 / 3))
    assert both(box(), box(y=0.5)) == pytest.approx((1.0, 1 / 3))
    assert both(box(), box(y=2.0)) == pytest.approx((1.0, 0.0))
    assert both(box(), box(x=2.0)) == (0.0, 0.0)  # they touch
    assert both(box(), box(size=(1.0, 1.0, 1.0))) == pytest.approx((0.25, 0.25))
    assert both(box(), box(x=np.nan)) == (0.0, 0.0)
    far = both(box(x=1e4, z=1e4, turn=0.3), box(x=1e4, z=1e4, turn=0.3))
    assert far == pytest.approx((1.0, 1.0), abs=1e-6)


def test_overlap_is_symmetric_and_ignores_where_everything_is():
    a, b = random_boxes(40, 2), random_boxes(30, 3)
    above, space = space_overlaps(a, b)
    swapped = space_overlaps(b, a)
    np.testing.assert_allclose(above, swapped[0].T, atol=1e-12)
    np.testing.assert_allclose(space, swapped[1].T, atol=1e-12)
    step = np.array([5.0, -1.0, 40.0])
    moved = [Boxes(x.size, x.bottom + step, x.rotation_y) for x in (a, b)]
    np.testing.assert_allclose(space_overlaps(*moved)[1], space, atol=1e-9)
    assert (space <= above + 1e-12).all()


def test_image_overlap():
    a = np.array([[0.0, 0.0, 10.0, 10.0]])
    b = np.array([[5.0, 0.0, 15.0, 10.0], [20.0, 0.0, 30.0, 10.0]])
    np.testing.assert_allclose(image_overlap(a, b), [[1 / 3, 0.0]])
    np.testing.assert_allclose(image_overlap(a, b, over_a=True), [[0.5, 0.0]])
    assert image_overlap(np.zeros((0, 4)), b).shape == (0, 2)


# --- average precision -------------------------------------------------------------------------------------


def a_car(
    x: float, z: float, angle: float, score: float | None = None, class_name: str = "Car", **more
) -> KittiLabel:
    """Its box in the image follows from where it is, roughly."""
    u, side = 600.0 + 700.0 * x / z, 700.0 * 3.0 / z
    box = (u - side / 2, 170.0, u + side / 2, 170.0 + 700.0 * 1.5 / z)
    values = {
        "type": class_name,
        "truncated": 0.0,
        "occluded": 0,
        "alpha": angle,
        "bbox": box,
        "score": score,
    }
    place = {"height": 1.5, "width": 1.6, "length": 4.0, "location": (x, 1.6, z), "rotation_y": angle}
    return KittiLabel(**{**values, **place, **more})


def world(seed: int, frames: int = 150) -> list[tuple[list[KittiLabel], list[KittiLabel]]]:
    """Truth and noisy detections, some missed, some made up, vans and regions to ignore among them."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(frames):
        truth, found = [], []
        for k in range(rng.integers(1, 5)):
            z = float(rng.uniform(8, 60))
            x, angle = float((k - 2) * 7 + rng.uniform(-1, 1)), float(rng.uniform(-3, 3))
            class_name = "Van" if rng.random() < 0.1 else "Car"
            car = a_car(x, z, angle, None, class_name, occluded=int(rng.integers(0, 3)))
            truth.append(car)
            if rng.random() < 0.85:
                off = rng.normal(0, 0.12, 2)
                turn = angle + rng.normal(0, 0.3)
                score = float(np.clip(1 - abs(off).sum() + rng.normal(0, 0.2), 0, 1))
                found.append(a_car(x + off[0], z + 2 * off[1], turn, round(score, 4)))
        if rng.random() < 0.3:
            found.append(a_car(12.0, float(rng.uniform(8, 40)), 0.0, round(float(rng.random()), 4)))
        if rng.random() < 0.2:
            stuff = a_car(12.0, 10.0, 0.0, None, "DontCare", height=-1.0)
            truth.append(
                replace(stuff, bbox=(0.0, 100.0, 1242.0, 300.0) if rng.random() < 0.3 else stuff.bbox)
            )
        made.append((truth, found))
    return made


def ours(frames) -> dict[str, list[float | None]]:
    hits = Hits()
    for truth, found in frames:
        hits.add(judge(truth, found, "Car"))
    return average_precision(hits)


# What the official evaluator does (KITTI's evaluate_object.cpp), written down again without its indices.
LIMITS = ((40, 0, 0.15), (25, 1, 0.30), (25, 2, 0.50))


def official(frames, measure: str, level: int, least: float, orientation: bool = False) -> float:
    height, occlusion, truncation = LIMITS[level]
    cases = []
    for truth, found in frames:
        objects = [x for x in truth if x.type in ("Car", "Van")]

        def counts(x):
            return (
                x.type == "Car"
                and x.occluded <= occlusion
                and x.truncated <= truncation
                and x.bbox[3] - x.bbox[1] > height
            )

        o = Overlaps.of(found, objects + [x for x in truth if x.type == "DontCare"])
        matrix = {"2D": o.image, "BEV": o.above, "3D": o.space}[measure][:, : len(objects)]
        small = [x.bbox[3] - x.bbox[1] < height for x in found]
        excused = o.excused > least if measure == "2D" else np.zeros(len(found), bool)
        cases.append((objects, [counts(x) for x in objects], found, small, matrix, excused))

    def match(case, threshold, by_score):
        objects, valid, found, small, matrix, excused = case
        taken, hits, similarity, scores = set(), 0, 0.0, []
        for j, _ in enumerate(objects):
            able = [
                i
                for i, d in enumerate(found)
                if i not in taken and d.score >= threshold and matrix[i, j] > least
            ]
            if not able:
                continue
            if by_score:
                best = max(able, key=lambda i: found[i].score)
            else:
                # of small ones the first that is found
                best = max(able, key=lambda i: (not small[i], -i if small[i] else matrix[i, j]))
            taken.add(best)
            if valid[j] and not small[best]:
                hits += 1
                scores.append(found[best].score)
                similarity += (1 + np.cos(found[best].alpha - objects[j].alpha)) / 2
        wrong = sum(
            i not in taken and not small[i] and d.score >= threshold and not excused[i]
            for i, d in enumerate(found)
        )
        return hits, wrong, similarity, scores

    total = sum(sum(case[1]) for case in cases)
    scores = sorted((s for case in cases for s in match(case, 0.0, True)[3]), reverse=True)
    thresholds, current = [], 0.0
    for i, score in enumerate(scores):
        left, right = (i + 1) / total, (i + 2) / total if i < len(scores) - 1 else (i + 1) / total
        if right - current < current - left and i < len(scores) - 1:
            continue
        thresholds.append(score)
        current += 1 / 40
    precision = np.zeros(41)
    for k, threshold in enumerate(thresholds[:41]):
        hits, wrong, similarity, _ = map(
            sum, zip(*[(*match(c, threshold, False)[:3], 0) for c in cases], strict=True)
        )
        precision[k] = (similarity if orientation else hits) / (hits + wrong)
    best = np.maximum.accumulate(precision[::-1])[::-1]
    return 100 * best[1:].mean()


@pytest.mark.parametrize("measure", ["2D", "BEV", "3D"])
def test_average_precision_is_the_official_one_in_large_sets(measure):
    frames = world(0, 500)
    for level in range(3):
        expected = official(frames, measure, level, 0.7)
        assert 5 < expected < 99
        assert ours(frames)[measure][level] == pytest.approx(expected, abs=0.5)


@pytest.mark.parametrize("measure", ["2D", "BEV", "3D"])
@pytest.mark.parametrize("frames", [20, 80])
def test_to_the_digit_as_officially(measure, frames):
    made = world(3, frames)
    for level in range(3):
        cases = [Case.of(truth, found, "Car", measure, level) for truth, found in made]
        assert official_precision(cases) == pytest.approx(official(made, measure, level, 0.7), abs=1e-9)


def test_an_example_worked_by_hand():
    """Five cars, hits with scores .9, .7, .6 and wrong ones with .8 and .5: recalls 1/5, 2/5, 3/5 are each
    nearest to one of the recalls 0, 1/40, 2/40 that are asked first, so that the precisions 1/1, 2/3, 3/4 are
    the first of 41. The second becomes 3/4, the best from there on; 38 recalls are never reached."""
    cars = [a_car(6.0 * k - 12.0, 20.0, 0.2) for k in range(5)]
    hits = [replace(car, score=score) for car, score in zip(cars, (0.9, 0.7, 0.6), strict=False)]
    wrong = [a_car(x, 20.0, 0.2, score) for x, score in ((-9.0, 0.8), (9.0, 0.5))]
    case = Case.of(cars, hits + wrong, "Car", "3D", 0)
    assert thresholds(case.hit_scores(), 5) == [0.9, 0.7, 0.6]
    assert [case.judged(t) for t in (0.9, 0.7, 0.6, 0.0)] == [(1, 0), (2, 1), (3, 1), (3, 2)]
    assert official_precision([case]) == pytest.approx(100.0 * (2 * 3 / 4) / 40)
    assert official_precision([Case.of([], hits, "Car", "3D", 0)]) is None


def test_orientation_similarity_is_the_official_one_in_large_sets():
    frames = world(1, 500)
    assert ours(frames)["AOS"][1] == pytest.approx(official(frames, "2D", 1, 0.7, True), abs=0.5)


def test_the_truth_against_itself_has_100():
    frames = [(truth, [replace(x, score=1.0) for x in truth]) for truth, _ in world(2, 20)]
    found = ours(frames)
    assert set(found) == {*MEASURES, "AOS"}
    for values in found.values():
        assert values == [100.0] * 3


def test_what_neither_helps_nor_harms():
    car = a_car(0.0, 20.0, 0.3)
    hit = replace(car, score=0.5)
    van = replace(a_car(8.0, 20.0, 0.0), type="Van")
    on_van = replace(van, type="Car", score=0.9)
    assert ours([([car, van], [on_van, hit])])["3D"] == [100.0] * 3
    hidden = replace(van, type="Car", occluded=2)
    assert ours([([car, hidden], [on_van, hit])])["3D"] == [100.0, 100.0, 100.0]
    stuff = replace(van, type="DontCare", height=-1.0)
    assert ours([([car, stuff], [on_van, hit])])["2D"] == [100.0] * 3
    assert ours([([car, stuff], [on_van, hit])])["3D"] == [50.0] * 3  # as officially: only in the image
    assert ours([([car], [on_van, hit])])["2D"] == [50.0] * 3  # a wrong one before the right one
    assert ours([([car], [hit, replace(hit, score=0.4)])])["2D"] == [100.0] * 3  # twice, after full recall
    assert ours([([car], [])])["2D"] == [0.0] * 3
    assert ours([([], [hit])])["2D"] == [None] * 3


def test_half_turned_cars_are_found_but_not_by_orientation():
    car = a_car(0.0, 20.0, 0.3)
    turned = replace(car, alpha=car.alpha + np.pi, rotation_y=car.rotation_y + np.pi, score=1.0)
    found = ours([([car], [turned])])
    assert found["3D"] == [100.0] * 3
    assert found["AOS"] == pytest.approx([0.0] * 3)


def test_a_detection_without_a_pose_counts_in_the_image_only():
    car = a_car(0.0, 20.0, 0.3)
    flat = replace(car, height=-1.0, width=-1.0, length=-1.0, location=(-1000.0,) * 3, alpha=-10.0, score=1.0)
    found = ours([([car], [flat])])
    assert found["2D"] == [100.0] * 3
    assert found["3D"] == found["AOS"] == [0.0] * 3
