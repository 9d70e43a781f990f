"""Threads that work ahead: the order of the items, errors in their place, few at a time, a quick end."""

import re
import signal
import subprocess
import sys
import threading
import time
from itertools import count

import groundpose as gp
import pytest
from groundpose._checks import cores
from groundpose.cli.crew import MOST, Crew, done, split
from groundpose.lab.evaluate.kill_inputs import pictures

CREWS = (1, 2, 3)


def squared(number):
    time.sleep(0.001 * (number % 3))  # the later ones are often sooner
    if number % 7 == 5:
        raise gp.InputError(f"{number}: expected another number")
    return number * number


@pytest.mark.parametrize("threads", CREWS)
def test_answers_come_in_order_and_errors_in_their_place(threads):
    items = [None if n % 5 == 4 else n for n in range(40)]
    with Crew(threads) as crew:
        found = list(crew.ahead(lambda n: n + 1, crew.ahead(squared, items)))
    for n, (item, answer) in enumerate(zip(items, found, strict=True)):
        if item is None:
            assert answer is None
        elif n % 7 == 5:
            assert str(answer) == f"{n}: expected another number"
        else:
            assert answer == n * n + 1


@pytest.mark.parametrize("threads", CREWS)
def test_few_are_at_work_ahead(threads):
    begun = []
    with Crew(threads) as crew:
        answers = crew.ahead(begun.append, count())
        for n in range(10):
            next(answers)
            # with one thread nothing is done that is not asked for
            assert len(begun) <= n + 1 + (threads if threads > 1 else 0)


@pytest.mark.parametrize("threads", [2, 3])
def test_nothing_begins_after_the_end(threads):
    begun, at_work, gate = [], threading.Semaphore(0), threading.Event()

    def work(n):
        begun.append(n)
        at_work.release()
        assert n == 0 or gate.wait(5.0)

    with Crew(threads) as crew:
        next(crew.ahead(work, count()))
        for _ in range(threads + 1):  # the first one, and one in every thread
            assert at_work.acquire(timeout=5.0)
        threading.Timer(0.05, gate.set).start()
    assert sorted(begun) == list(range(threads + 1))


@pytest.mark.parametrize("threads", CREWS)
def test_one_thread_fetches_beside(threads):
    names = set()

    def frames():
        for n in range(20):
            names.add(threading.get_ident())
            yield gp.InputError("a damaged one") if n == 3 else n

    with Crew(threads) as crew:
        found = list(crew.beside(frames()))
    assert len(names) == 1
    assert str(found.pop(3)) == "a damaged one"
    assert found == [0, 1, 2, *range(4, 20)]


@pytest.mark.parametrize("threads", [2, 3])
def test_who_fetches_also_closes(threads):
    """Whatever is left open when the caller has enough."""
    names = []

    def frames():
        try:
            for n in count():
                names.append(threading.get_ident())
                yield n
        finally:
            names.append(threading.get_ident())
            names.append("closed")

    with Crew(threads) as crew:
        assert next(crew.beside(frames())) == 0
    assert names[-1] == "closed"
    assert len(set(names[:-1])) == 1
    assert threading.get_ident() not in names


@pytest.mark.parametrize("threads", CREWS)
def test_what_the_iterator_raises_is_raised(threads):
    def frames():
        yield 1
        raise OSError(5, "gone")

    with Crew(threads) as crew, pytest.raises(OSError, match="gone"):
        list(crew.beside(frames()))


def test_an_interrupt_in_a_thread_is_its_answer():
    def interrupted(n):
        raise KeyboardInterrupt

    with Crew(2) as crew:
        assert isinstance(next(crew.ahead(interrupted, [1])), KeyboardInterrupt)
    with pytest.raises(KeyboardInterrupt):  # but not that of the caller
        done(interrupted, 1)


def test_threads_are_shared_out(monkeypatch):
    assert split(1, several=True) == (1, 1)
    assert split(None, several=False) == (1, cores())
    monkeypatch.setattr("groundpose._checks.cores", lambda: 16)
    monkeypatch.setattr("groundpose.cli.crew.cores", lambda: 16)
    assert split(None, several=True) == (MOST, 16 // MOST)
    assert split(3, several=True) == (3, 1)
    assert split(6, several=True) == (MOST, 1)


@pytest.mark.skipif(sys.platform == "win32", reason="no Ctrl-C for one process there")
def test_ctrl_c_ends_a_run_with_images_at_work(tmp_path):
    """At once, with what is written whole."""
    pictures(tmp_path, 200)
    asked = ["estimate", "images", "--boxes", "boxes", "--calib", "camera.json", "--network", "int8"]
    asked += ["--threads", "2", "-o", "poses.jsonl", "--no-pictures"]
    with subprocess.Popen(
        [sys.executable, "-m", "groundpose.cli", *asked],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        # a shell's background job ignores Ctrl-C and hands that down
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        record, deadline = tmp_path / ".poses.jsonl.run", time.monotonic() + 60.0
        while time.monotonic() < deadline and not (record.exists() and record.read_bytes().count(b"\n") > 2):
            time.sleep(0.005)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
        assert time.monotonic() - sent < 3.0  # 0.02 s on a quiet machine
    assert process.returncode == 130
    written = int(re.search(r"interrupted; images finished and written: (\d+)", errors.decode())[1])
    assert 0 < written < 200
    assert len((tmp_path / "poses.jsonl").read_text(encoding="utf-8").splitlines()) == written
