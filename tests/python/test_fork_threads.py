"""Threads, processes and interrupts: the same bits everywhere, and nobody waits for ever."""

import multiprocessing
import signal
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import groundpose as gp
import numpy as np
import pytest
from conftest import MODEL, VIEW, assert_same, make_batch

SHAPED = gp.ShapeModel(
    MODEL.keypoints_3d, MODEL.bbox_3d, np.random.default_rng(0).normal(size=(1, 24, 3)) / 8.0, [0.1]
)


@pytest.fixture(scope="module")
def large():
    """More objects than one block of the core's loop, and two kinds of model."""
    return make_batch(2500, seed=11, outliers=0.4)


def mixed_models(n: int) -> list[gp.ShapeModel]:
    return [SHAPED if i % 2 else MODEL for i in range(n)]


@pytest.mark.parametrize("solver", ["auto", "p3p"])
def test_any_number_of_threads_gives_the_same_bits(large, solver):
    options, models = gp.Options(solver=solver, max_iterations=50), mixed_models(2500)

    def run(threads: int | None) -> gp.PoseBatch:
        return gp.estimate_poses(large.view, large.keypoints_2d, large.bboxes, models, None, options, threads)

    expected = run(1)
    assert expected.ok.mean() > 0.5
    for threads in (2, 3, 7, None):
        assert_same(run(threads), expected)


def test_many_python_threads_at_once():
    batches = [make_batch(200, seed=s) for s in range(6)]
    expected = [b.estimate(threads=1) for b in batches]
    with ThreadPoolExecutor(6) as pool:
        for threads in (1, 2, None):
            running = [pool.submit(b.estimate, threads=threads) for b in batches]
            for future, want in zip(running, expected, strict=True):
                assert_same(future.result(60.0), want)


def _child(connection, batch) -> None:
    connection.send([batch.estimate(threads=threads).t for threads in (1, 2, None)])


@pytest.mark.skipif(sys.platform == "win32", reason="fork is a thing of Unix")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_fork_after_use_in_the_parent():
    """A forked child has none of the parent's worker threads; it must not wait for them."""
    batch = make_batch(400, seed=12)
    expected = batch.estimate(threads=2).t  # starts the parent's threads
    context = multiprocessing.get_context("fork")
    receiving, sending = context.Pipe(duplex=False)
    child = context.Process(target=_child, args=(sending, batch))
    child.start()
    try:
        assert receiving.poll(60.0), "the forked child hangs"
        for t in receiving.recv():
            np.testing.assert_array_equal(t, expected)
        child.join(60.0)
        assert child.exitcode == 0
    finally:
        child.kill()
        child.join()
    np.testing.assert_array_equal(batch.estimate(threads=2).t, expected)


def test_spawned_process_gives_the_same_bits():
    batch = make_batch(100, seed=13)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        t = pool.apply_async(_estimate_t, (batch,)).get(120.0)
    np.testing.assert_array_equal(t, batch.estimate().t)


def _estimate_t(batch) -> np.ndarray:
    return batch.estimate().t


def test_the_gil_is_released(large):
    """Python code runs on while a batch is computed."""
    done, began = threading.Event(), threading.Event()

    def work() -> None:
        began.set()
        for _ in range(3):
            large.estimate(threads=1)
        done.set()

    worker = threading.Thread(target=work)
    worker.start()
    began.wait()
    turns, longest, last = 0, 0.0, time.perf_counter()
    while not done.is_set():
        time.sleep(0.001)
        now = time.perf_counter()
        turns, longest, last = turns + 1, max(longest, now - last), now
    worker.join()
    assert turns >= 10


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timer")
def test_ctrl_c_stops_a_long_batch():
    batch = make_batch(500, seed=14)
    n = 40
    start = time.perf_counter()
    batch.estimate()
    whole = n * 4 * (time.perf_counter() - start)
    keypoints, boxes = np.tile(batch.keypoints_2d, (4 * n, 1, 1)), np.tile(batch.bboxes, (4 * n, 1))
    previous = signal.signal(signal.SIGALRM, signal.default_int_handler)
    try:
        start = time.perf_counter()
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(KeyboardInterrupt):
            gp.estimate_poses(batch.view, keypoints, boxes, MODEL, threads=1)
        assert time.perf_counter() - start < 0.5 * whole
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def slow_objects(threads: int) -> Callable[[], object]:
    """Nothing but wrong keypoints, without the ground: a thousand times as slow as usual objects."""
    keypoints = np.random.default_rng(0).uniform(0.0, 1280.0, (4000, 24, 2))
    options = gp.Options(solver="p3p", refinement="none")
    return lambda: gp.estimate_poses(VIEW, keypoints, None, MODEL, None, options, threads=threads)


def many_pixels(_: int) -> Callable[[], object]:
    fisheye = gp.Camera(600, 600, 640, 360, (-0.02, 0.01, -0.008, 0.002), lens="equidistant")
    pixels = np.full((5_000_000, 2), 300.0)
    return lambda: fisheye.undistort(pixels)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timer")
@pytest.mark.parametrize(
    ("work", "threads"),
    [(slow_objects, 1), (slow_objects, 2), (many_pixels, 1)],
    ids=["one thread", "two threads", "pixels"],
)
def test_ctrl_c_is_looked_for_all_the_time(work, threads):
    """In one call each of several seconds."""
    raised, call = [], work(threads)

    def interrupt(*_: object) -> None:
        raised.append(time.perf_counter())
        raise KeyboardInterrupt

    previous = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        asked = time.perf_counter() + 0.3
        with pytest.raises(KeyboardInterrupt):
            call()
        assert raised[0] - asked < 0.2
        assert time.perf_counter() - asked < 1.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)
